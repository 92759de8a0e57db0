"""A memory that is not measured, from the equation of motion along a measured displacement.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

For given coefficients z follows from y by integration, so that no noise is differentiated. Both sides of the equation
of motion are filtered alike (`hysim.plants.equation_of_motion`); m, c and k are projected out, and a Gauss-Newton step
is a regression on the slopes of z. Only the curvature of the memory distinguishes A from k: the descent begins from
several shares of the stiffness. Noise lengthens the path of y, a bias of about a percent; a simulation refines it.

**The regression** is that of an oscillator's output on the terms of its memory, the plant projected out. Columns are
scaled so that the coefficients of all terms together have standard errors of one: a threshold is then a number of
standard errors. Where terms are nearly collinear a small coefficient is no sign of a small loss, so that STLSQ's
thresholds are accompanied by plain elimination.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from hysim._basics.frozen import FloatArray
from hysim.discovery._slopes import independent, sparse_path
from hysim.identification.marquardt import Schedule, SumOfSquares, descend
from hysim.kernels import memory_terms as kernels
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_terms
from hysim.metrics.criteria import information
from hysim.plants.equation_of_motion import Filter, Linear, Motion, filtering, interpolated

FLOOR = 1e-5  # of the rms output: smaller residuals are no evidence of a term
BLOCKS = 4  # that are held out in turn, where there are no periods
_RIDGE = 1e-13  # of unit columns: those that a draw of samples makes dependent cost rounding, and no failure
DEPENDENT = 1e-5  # share of a slope that those before it do not explain, below which it is left out


@dataclass(frozen=True)
class TermRegression:
    """target = plant @ ... + features @ coefficients + noise of one, all about an oscillator.

    `features` (n_samples, n_terms) and `target` have the plant projected out; `units` are the standard errors that
    scale them. `dependent` are terms left out as combinations of others; `n_others` counts other fitted numbers.
    """

    terms: tuple[Term, ...]
    dependent: tuple[Term, ...]
    features: FloatArray
    target: FloatArray
    units: FloatArray
    sigma: float
    floor: float
    n_plant: int
    blocks: list[slice]
    n_others: int = 0

    @cached_property
    def triangle(self) -> FloatArray:
        return np.asarray(np.linalg.qr(np.column_stack([self.features, self.target]), mode="r"))

    def thresholded(self) -> list[tuple[Term, ...]]:
        path = sparse_path(self.features, self.target) if self.terms else []
        return [tuple(t for t, value in zip(self.terms, values, strict=True) if value != 0.0) for _, values in path]

    def eliminated(self) -> list[tuple[Term, ...]]:
        """Structures from dense to sparse, each without the term whose removal costs least."""
        R, included, path = self.triangle, list(range(len(self.terms))), []
        sizes = np.linalg.norm(R[:, :-1], axis=0)
        columns = R[:, :-1] / np.where(sizes > 0.0, sizes, 1.0)
        normal, right = columns.T @ columns + _RIDGE * np.eye(len(included)), columns.T @ R[:, -1]
        while included:
            path.append(tuple(self.terms[k] for k in included))
            inverse = np.linalg.inv(normal[np.ix_(included, included)])
            included.pop(int(np.argmin((inverse @ right[included]) ** 2 / np.diag(inverse))))
        return path

    def best(self, structures: Sequence[tuple[Term, ...]]) -> tuple[Term, ...]:
        return min([*structures, ()], key=self.bic)

    def inclusion(self, rng: np.random.Generator, n_draws: int) -> dict[Term, float]:
        """Share of regressions on samples drawn with replacement whose best structure has each term."""
        counts = dict.fromkeys(self.terms, 0)
        for _ in range(n_draws):
            rows = rng.integers(self.target.size, size=self.target.size)
            drawn = replace(self, features=self.features[rows], target=self.target[rows])
            for term in drawn.best(drawn.eliminated()):
                counts[term] += 1
        return {term: count / n_draws for term, count in counts.items()}

    @cached_property
    def condition(self) -> float:
        R = self.triangle[:, :-1]
        return float(np.linalg.cond(R / np.linalg.norm(R, axis=0))) if R.shape[1] else 1.0

    def places(self, terms: Sequence[Term]) -> list[int]:
        return [self.terms.index(term) for term in terms]

    def squares(self, terms: Sequence[Term]) -> float:
        included, goal = self.triangle[:, self.places(terms)], self.triangle[:, -1]
        rest = goal - included @ np.linalg.lstsq(included, goal, rcond=None)[0]
        return float(rest @ rest)

    def bic(self, terms: Sequence[Term]) -> float:
        n, n_parameters = self.target.size, self.n_plant + self.n_others + len(terms)
        return information(self.squares(terms) / n * self.sigma**2, n, n_parameters, floor=self.floor)

    def held_out_rmse(self, terms: Sequence[Term]) -> float:
        """Rmse on each block of a structure that the other blocks have fitted [unit of y]."""
        X, y = self.features[:, self.places(terms)], self.target
        normal, right, total = X.T @ X, X.T @ y, 0.0
        for block in self.blocks:
            rest = normal - X[block].T @ X[block], right - X[block].T @ y[block]
            error = y[block] - X[block] @ np.linalg.lstsq(*rest, rcond=None)[0]
            total += float(error @ error)
        return float(self.sigma * np.sqrt(total / y.size))


def term_regression(
    terms: tuple[Term, ...],
    plant: FloatArray,
    slopes: FloatArray,
    target: FloatArray,
    floor: float,
    blocks: list[slice],
) -> TermRegression:
    """Regression of `target` (n_samples,) on slopes (n_samples, n_terms), the plant's (n_samples, n) projected out."""
    sizes = np.linalg.norm(plant, axis=0)
    plant, sizes = plant[:, sizes > 0.0], sizes[sizes > 0.0]  # where the motion diverges a slope is unknown, and zero
    basis = np.linalg.qr(plant / sizes)[0]
    n_plant, included = basis.shape[1], independent(slopes, basis, range(len(terms)), DEPENDENT)
    features = slopes[:, included] - basis @ (basis.T @ slopes[:, included])
    goal = target - basis @ (basis.T @ target)
    size = np.linalg.norm(features, axis=0)
    scaled = features / size
    residual = goal - scaled @ np.linalg.lstsq(scaled, goal, rcond=None)[0]
    freedom = max(goal.size - n_plant - len(included), 1)
    sigma = max(float(np.sqrt(residual @ residual / freedom)), floor)
    units = sigma * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))) / size
    return TermRegression(
        terms=tuple(terms[k] for k in included),
        dependent=tuple(term for k, term in enumerate(terms) if k not in included),
        features=features * units / sigma,
        target=goal / sigma,
        units=units,
        sigma=sigma,
        floor=floor,
        n_plant=n_plant,
        blocks=blocks,
    )


POWERS = (1.0, 2.0, 3.0)
SHARES = (0.2, 0.5, 0.8)  # of the stiffness of small motions, in A
PLANT = ("mass", "damping", "stiffness")

OSCILLATOR_SCHEDULE = Schedule(failure=5.0, least=1e-12)

_FINER = 4  # increments of y for each sample
_DEGREE = 3


class Regressed(NamedTuple):
    """A law, the plant that goes with it, and the unexplained share of the filtered force."""

    coefficients: dict[Term, float]
    plant: dict[str, float]
    error: float


class _Along(NamedTuple):
    """One motion: its filter, its increments, their time, and the samples of the memory along them."""

    filtered: Filter
    steps: FloatArray
    h: float
    samples: slice


class MemoryArrays(NamedTuple):
    """A law as `hysim.kernels.memory_terms` takes it: polynomials in z by direction and side, and one more power."""

    polynomial: FloatArray
    extra: FloatArray
    power: float
    relaxation: float


def memory_arrays(coefficients: Mapping[Term, float], degree: int) -> MemoryArrays:
    """The law with these coefficients; terms whose powers are not whole must share one power."""
    polynomial, extra, power = np.zeros((2, 2, degree + 1)), np.zeros((2, 2)), 1.0
    for term, value in coefficients.items():
        if term.is_polynomial:
            polynomial += value * cases(term, degree)
        elif not term.relaxing:
            extra, power = extra + value * _signs(term), term.degree
    return MemoryArrays(polynomial, extra, power, coefficients.get(RELAXATION, 0.0))


def cases(term: Term, degree: int) -> FloatArray:
    """Polynomials in z of a term, shape (2, 2, degree + 1), by direction and side of z = 0."""
    polynomials = np.zeros((2, 2, degree + 1))
    polynomials[..., int(term.degree)] = _signs(term)
    if term.degree % 2:
        polynomials[:, 0] *= -1.0  # z^power = -|z|^power there
    return polynomials


def _signs(term: Term) -> FloatArray:
    direction = np.array([1.0, 1.0] if term.rectified else [-1.0, 1.0])
    side = np.array([1.0, 1.0] if term.is_even_in_memory else [-1.0, 1.0])
    return np.asarray(direction[:, np.newaxis] * side)


class HiddenMemory:
    """Regressions of the memory along one or several motions of one plant, parts of which may be `known`."""

    def __init__(self, motions: Sequence[Motion], linear: Linear, known: Mapping[str, float]) -> None:
        self.linear, self.known = linear, dict(known)
        self._along = [_along(motion, linear) for motion in motions]
        force = self._stacked([motion.force for motion in motions], 0)
        sides = {
            name: self._stacked([motion.y for motion in motions], power)
            for name, power in zip(PLANT, (2, 1, 0), strict=True)
        }
        self._target = force - sum((value * sides[name] for name, value in known.items()), np.zeros_like(force))
        self._free = [name for name in PLANT if name not in known]
        self._columns = np.array([sides[name] for name in self._free]).reshape(-1, force.size).T
        self._basis = np.linalg.qr(self._columns / np.linalg.norm(self._columns, axis=0))[0]
        self._size = float(np.linalg.norm(force))

    def fit(self, terms: Sequence[Term]) -> Regressed | None:
        """Law of these terms, the first of which is u', from the best of several starts; None if all diverge."""
        spring = self.linear.stiffness
        shares = [1.0 - self.known["stiffness"] / spring] if "stiffness" in self.known else SHARES
        starts = [np.array([max(share, 0.01) * spring, *np.zeros(len(terms) - 1)]) for share in shares]
        return _best(self._descended(terms, start) for start in starts)

    def nearest(self) -> Regressed | None:
        """Bouc-Wen law with a whole n, or linear relaxation, of the smallest error; None if all diverge."""
        laws = [bouc_wen_terms(n) for n in POWERS] + [(bouc_wen_terms(1.0)[0], RELAXATION)]
        return _best(map(self.fit, laws))

    def regression(self, library: Sequence[Term]) -> TermRegression:
        """Regression on all terms, about z = A y, of the force that a linear spring does not explain."""
        spring = bouc_wen_terms(1.0)[0]
        terms = (spring, *(term for term in library if term != spring))
        share = 1.0 - self.known.get("stiffness", 0.5 * self.linear.stiffness) / self.linear.stiffness
        x = np.array([share * self.linear.stiffness, *np.zeros(len(terms) - 1)])
        rows = self._memory(terms, x)
        if rows is None:
            raise ValueError("the displacement is not finite or too large")
        target = self._target - rows[0] + rows[1] * x[0]
        edges = [target.size * k // BLOCKS for k in range(BLOCKS + 1)]
        blocks = [slice(*pair) for pair in itertools.pairwise(edges)]
        floor = FLOOR * self._size / float(np.sqrt(target.size))
        return term_regression(terms, self._columns, rows[1:].T, target, floor, blocks)

    def _descended(self, terms: Sequence[Term], start: FloatArray) -> Regressed | None:
        def residuals(points: FloatArray) -> FloatArray:
            values = np.full((len(points), self._target.size), np.inf)
            for k, x in enumerate(points):
                rows = self._memory(terms, x)
                if rows is not None:
                    values[k] = self._projected(self._target - rows[0])
            return values

        def columns(x: FloatArray) -> FloatArray:
            rows = self._memory(terms, x)
            return np.zeros((self._target.size, x.size)) if rows is None else rows[1:].T

        problem = SumOfSquares(
            residuals,
            lambda x, residual: -self._projected(columns(x)),
            sizes=lambda x: np.linalg.norm(columns(x), axis=0),  # those of slopes that the plant explains are tiny
        )
        reached = descend(problem, start[np.newaxis], relative=1e-7, steps=100, schedule=OSCILLATOR_SCHEDULE)
        return self._regressed(terms, reached.x[0])

    def _regressed(self, terms: Sequence[Term], x: FloatArray) -> Regressed | None:
        rows = self._memory(terms, x)
        if rows is None:
            return None
        goal = self._target - rows[0]
        plant = np.linalg.lstsq(self._columns, goal, rcond=None)[0].tolist()
        error = float(np.linalg.norm(self._projected(goal))) / self._size
        coefficients = dict(zip(terms, x.tolist(), strict=True))
        return Regressed(coefficients, self.known | dict(zip(self._free, plant, strict=True)), error)

    def _memory(self, terms: Sequence[Term], x: FloatArray) -> FloatArray | None:
        """Filtered memory and its slopes along the coefficients, (1 + n_terms, n_rows); None if it diverges."""
        polynomial, _, _, relaxation = memory_arrays(dict(zip(terms, x.tolist(), strict=True)), _DEGREE)
        polynomials = [term for term in terms if not term.relaxing]
        units = np.array([cases(term, _DEGREE) for term in polynomials])
        place = [1 + (len(polynomials) if term.relaxing else polynomials.index(term)) for term in terms]
        signals = []
        for each in self._along:
            memory = np.zeros((2 + len(polynomials), each.steps.size + 1))
            if not kernels.along(each.steps, each.h, polynomial, relaxation, units, memory[0], memory[1:]):
                return None
            signals.append(memory[[0, *place]][:, each.samples])
        rows = self._stacked(signals, 0)
        return rows if np.isfinite(rows).all() else None

    def _projected(self, rows: FloatArray) -> FloatArray:
        return np.asarray(rows - self._basis @ (self._basis.T @ rows))

    def _stacked(self, signals: Sequence[FloatArray], power: int) -> FloatArray:
        return np.concatenate(
            [each.filtered(signal, power) for each, signal in zip(self._along, signals, strict=True)], axis=-1
        )


def _best(laws: Iterable[Regressed | None]) -> Regressed | None:
    return min((each for each in laws if each is not None), key=lambda each: each.error, default=None)


def _along(motion: Motion, linear: Linear) -> _Along:
    h = motion.sample_time / _FINER
    if motion.periodic:
        fine = interpolated(motion.y, _FINER)
        steps = np.diff(np.tile(fine, 2), append=fine[0])
        return _Along(filtering(motion, linear), steps, h, slice(fine.size, -1, _FINER))
    places = np.arange((motion.y.size - 1) * _FINER + 1) / _FINER
    fine = CubicSpline(np.arange(motion.y.size), motion.y)(places)
    return _Along(filtering(motion, linear), np.diff(fine), h, slice(None, None, _FINER))
