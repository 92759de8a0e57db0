"""The regression of an oscillator's output on the terms of its memory, the plant projected out.

Columns are scaled so that the coefficients of all terms together have standard errors of one: a threshold is then a
number of standard errors. Where terms are nearly collinear a small coefficient is no sign of a small loss, so that
STLSQ's thresholds are accompanied by plain elimination.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._pysindy import sparse_path
from hysim.discovery._slopes import independent
from hysim.laws.differential.terms import Term
from hysim.metrics.criteria import information

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
        """Sum of squared residuals of a structure, in units of the noise."""
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
