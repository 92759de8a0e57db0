"""Refinement by simulation error: the coefficients and y0 whose free run is nearest to the record.

    minimise sum w_k (y_k - law(u; c, y0)_k)^2

A derivative that fits says little about a law that must run on its own output, so every structure is
judged by its free run alone. Unknowns are measured in what they contribute, outputs in strokes; the
Jacobian is a central difference, all of it one batch. A free run that leaves BOUND strokes has diverged.

    BIC = N ln(V + FLOOR^2) + d ln N,    V = mean squared residual in strokes,  d = terms + 1 for y0
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._library import Regression
from hysim.models.duhem import Duhem
from hysim.models.duhem_runs import free_runs
from hysim.models.duhem_terms import Term, coefficient_units
from hysim.records import Record

BOUND = 30.0
FLOOR = 1e-6  # smaller residuals, in strokes, are no evidence for one law over another
_DIVERGED = 1e3  # the residual, in strokes, of a free run that has
_DIFFERENCE = 1e-6  # truncation and rounding of a central difference are both near 1e-10
RANKING = 1e-5  # relative change of the cost at which a descent ends: far less than a difference of BIC that counts
POLISH = 1e-12
_MAX_EVALUATIONS = 60
_RIDGES = tuple(10.0**power for power in range(-9, 1))


@dataclass(frozen=True)
class Candidate:
    """A refined structure.

    `unknowns` (n_terms + 1,) are the coefficients and y0, `residual` (n_samples,) is in strokes, `jacobian`
    (n_samples, n_terms + 1) is its derivative.
    """

    terms: tuple[Term, ...]
    unknowns: FloatArray
    jacobian: FloatArray
    residual: FloatArray

    @property
    def cost(self) -> float:
        """Sum of squared residuals, in squared strokes."""
        return float(self.residual @ self.residual)

    @property
    def n_parameters(self) -> int:
        """The terms and y0."""
        return len(self.unknowns)

    @property
    def bic(self) -> float:
        """Bayesian information criterion, the lower the better."""
        return information(self.cost, self.residual.size, self.n_parameters)


def information(cost: float, n_samples: int, n_parameters: int) -> float:
    """BIC of a sum of squared residuals in squared strokes."""
    return n_samples * math.log(cost / n_samples + FLOOR**2) + n_parameters * math.log(n_samples)


@dataclass(frozen=True)
class FreeRun:
    """The least-squares problem of one record; `weights`, shape (n_samples,), may leave samples out."""

    record: Record
    weights: FloatArray | None = None

    @cached_property
    def stroke(self) -> float:
        """Range of the measured output, the unit of outputs and residuals."""
        return float(np.ptp(self.record.y))

    def units(self, terms: Sequence[Term]) -> FloatArray:
        """Units of the unknowns (n_terms + 1,): the law's coefficients and y0 are these times x."""
        return np.append(coefficient_units(self.record.u, self.record.y, terms), self.stroke)

    def outputs(self, terms: Sequence[Term], unknowns: FloatArray) -> FloatArray:
        """Free runs (n_sets, n_samples) of coefficients and y0 (n_sets, n_terms + 1), inf where one diverges."""
        bound = BOUND * self.stroke + float(np.abs(self.record.y).max())
        return free_runs(terms, unknowns[:, :-1], 0.0, unknowns[:, -1], self.record.u[np.newaxis], bound)

    def residuals(self, terms: Sequence[Term], unknowns: FloatArray) -> FloatArray:
        """Weighted residuals (n_sets, n_samples) in strokes."""
        left = (self.record.y - self.outputs(terms, unknowns)) / self.stroke
        left[~np.isfinite(left)] = _DIVERGED
        return left if self.weights is None else left * np.sqrt(self.weights)

    def refine(self, terms: tuple[Term, ...], starts: FloatArray, *, tolerance: float = RANKING) -> Candidate | None:
        """The optimum that is reached from the best of `starts` (n_starts, n_terms + 1), or None if all diverge."""
        from scipy.optimize import least_squares

        costs = np.sum(self.residuals(terms, starts) ** 2, axis=1)
        if costs.min() >= _DIVERGED**2:
            return None
        units = self.units(terms)
        steps = _DIFFERENCE * np.eye(len(units))

        def jacobian(x: FloatArray) -> FloatArray:
            around = np.concatenate([x + steps, x - steps])
            ahead, behind = np.split(self.residuals(terms, around * units), 2)
            return np.asarray((ahead - behind).T / (2.0 * _DIFFERENCE))

        found = least_squares(
            lambda x: self.residuals(terms, x[np.newaxis] * units)[0],
            starts[np.argmin(costs)] / units,
            jac=jacobian,
            method="trf",  # "lm" (SciPy 1.17) now and then gives other bits from the same start
            ftol=tolerance,
            xtol=1e-2 * tolerance,
            gtol=tolerance,
            max_nfev=_MAX_EVALUATIONS,
        )
        return Candidate(terms, found.x * units, found.jac / units, found.fun)

    def regressed(self, regression: Regression, terms: Sequence[Term]) -> FloatArray:
        """Starts (n_ridges, n_terms + 1) from ridge regressions of the slope: the stiffer, the tamer the free run."""
        y0 = regression.branches[0].y[0]
        return np.array([[*regression.ridge(terms, weight), y0] for weight in _RIDGES])


def law(candidate: Candidate) -> Duhem:
    """The law with a candidate's coefficients."""
    *coefficients, y0 = candidate.unknowns.tolist()
    return Duhem.from_terms(dict(zip((t.name for t in candidate.terms), coefficients, strict=True)), y0=y0)


class Loss(NamedTuple):
    """A structure that has lost a term: its cost and unknowns as the linearised free run predicts them."""

    terms: tuple[Term, ...]
    cost: float
    unknowns: FloatArray


def without(candidate: Candidate, k: int) -> Loss:
    """Take term `k` out of a candidate."""
    jacobian = np.delete(candidate.jacobian, k, axis=1)
    sizes = np.linalg.norm(jacobian, axis=0)
    sizes[sizes == 0.0] = 1.0
    removed = candidate.jacobian[:, k] * candidate.unknowns[k]
    shift = np.linalg.lstsq(jacobian / sizes, removed, rcond=1e-10)[0] / sizes
    left = candidate.residual - removed + jacobian @ shift
    terms = candidate.terms[:k] + candidate.terms[k + 1 :]
    return Loss(terms, float(left @ left), np.delete(candidate.unknowns, k) + shift)
