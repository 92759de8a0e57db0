"""Slopes of the memory along the loading length L, dL = |du|, and their regression on terms.

With s = sgn(du) and z = y - feedthrough u - offset, in two forms,

    dz/dL = sum c_k phi_k(u, z, s)                        smoothed
    int psi dz = sum c_k int psi phi_k(u, z, s) dL        weak, psi a bump that ends at zero

**Smoothed.** On each branch, from one reversal of the input to the next, the output is smoothed by a polynomial
in L whose degree is the lowest within 1 % of the best leave-one-out error; dy/dL is its slope. Nothing is smoothed
across a reversal, where the slope jumps. Samples between which the input rests count as one, with the mean of their
outputs. Branches of fewer than MIN_SAMPLES such points are left out.

**Weak.** By parts, int psi dz = -int z dpsi: no slope of the output is taken, and a window may reach across reversals.
Where a branch is long enough the features take its smoothed output, elsewhere the measured one.

Each column is scaled to unit rms over the rows, and so is the slope: a threshold is the share of a term in the slope.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import chebyshev

from hysim._frozen import FloatArray
from hysim.discovery._pysindy import compressed
from hysim.laws.differential.terms import Term
from hysim.records import Record

MIN_SAMPLES = 4
MAX_DEGREE = 12
_NEAR = 1.01  # a lower degree whose leave-one-out error is within 1 % of the best is taken
_SHORTEST = 6  # intervals of a window
_WINDOWS = 400
_OVERLAP = 4

Feature = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Value of one term (n,) or of several (n, n_terms), from input, memory and direction at n points."""


@dataclass(frozen=True)
class Branch:
    """One monotone part of a record: inputs, smoothed outputs, dy/dL, each (n,), and the sign of du."""

    u: FloatArray
    y: FloatArray
    slope: FloatArray
    direction: float


@dataclass(frozen=True)
class Rows:
    """Rows of a regression at points (n_points,) of the path.

    `slope` (n_rows,) is the left side for z = y. `window` (n_window,) sums values at points into rows, every `stride`
    points one, each times `length`; with None, each point is a row.
    """

    u: FloatArray
    y: FloatArray
    direction: FloatArray
    slope: FloatArray
    length: FloatArray
    window: FloatArray | None = None
    stride: int = 1

    def columns(self, feature: Feature, feedthrough: float = 0.0, offset: float = 0.0) -> FloatArray:
        """Right side, shape (n_rows, n_terms)."""
        values = feature(self.u, self.y - feedthrough * self.u - offset, self.direction)
        return self._summed(values * self.length[:, np.newaxis])

    def target(self, feedthrough: float = 0.0) -> FloatArray:
        """Left side for z = y - feedthrough u, shape (n_rows,)."""
        return self.slope - feedthrough * self._summed((self.direction * self.length)[:, np.newaxis])[:, 0]

    def _summed(self, values: FloatArray) -> FloatArray:
        if self.window is None:
            return values
        return np.asarray(sliding_window_view(values, self.window.size, axis=0)[:: self.stride] @ self.window)


def smoothed_rows(u: FloatArray, y: FloatArray) -> Rows | None:
    """Smoothed form, or None where no branch is long enough."""
    smooth = branches(u, y)
    if not smooth:
        return None
    direction = np.concatenate([np.full(each.u.size, each.direction) for each in smooth])
    points = (np.concatenate(parts) for parts in zip(*((each.u, each.y, each.slope) for each in smooth), strict=True))
    inputs, outputs, slope = points
    return Rows(inputs, outputs, direction, slope, np.ones(direction.size))


def weak_rows(u: FloatArray, y: FloatArray) -> Rows | None:
    """Weak form, or None where there are too few samples for a window."""
    u, y = without_rests(u, y)
    n = u.size - 1
    if n < _SHORTEST:
        return None
    size = max(_SHORTEST, min(n // _WINDOWS, n // len(pieces(u))))
    stride = max(1, size // _OVERLAP)
    x = np.linspace(-1.0, 1.0, size + 1)
    bump = (1.0 - x**2) ** 2
    shares = 0.5 * (bump[1:] + bump[:-1])  # with these the sum by parts is exact, whatever the steps of the input
    du, smooth = np.diff(u), _smoothed_where_long(u, y)
    mean_y = 0.5 * (y[1:] + y[:-1])
    slope = -sliding_window_view(mean_y, size)[::stride] @ np.diff(bump)
    points = [0.5 * (values[1:] + values[:-1]) for values in (u, smooth)]
    return Rows(points[0], points[1], np.sign(du), slope, np.abs(du), shares, stride)


def branches(u: FloatArray, y: FloatArray) -> list[Branch]:
    u, y = without_rests(u, y)
    return [smoothed(u[piece], y[piece]) for piece in pieces(u) if u[piece].size >= MIN_SAMPLES]


def smoothed(u: FloatArray, y: FloatArray) -> Branch:
    length = np.abs(u - u[0])
    x = 2.0 * length / length[-1] - 1.0
    series = _polynomial(x, y)
    slope = chebyshev.chebval(x, chebyshev.chebder(series)) * 2.0 / length[-1]
    return Branch(u, chebyshev.chebval(x, series), slope, float(np.sign(u[-1] - u[0])))


def without_rests(u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Samples between which the input moves, each with the mean of the outputs while it rests there."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(u) != 0.0]))
    counts = np.diff(np.append(starts, u.size))
    return u[starts], np.add.reduceat(y, starts) / counts


def pieces(u: FloatArray) -> list[slice]:
    """Slices of the branches of an input without rests, each with both its ends."""
    direction = np.sign(np.diff(u))
    reversals = np.flatnonzero(direction[1:] != direction[:-1]) + 1
    return [slice(first, last + 1) for first, last in itertools.pairwise([0, *reversals.tolist(), u.size - 1])]


def _smoothed_where_long(u: FloatArray, y: FloatArray) -> FloatArray:
    out = y.copy()
    for piece in pieces(u):
        if u[piece].size >= MIN_SAMPLES:
            out[piece] = smoothed(u[piece], y[piece]).y
    return out


def _polynomial(x: FloatArray, y: FloatArray) -> FloatArray:
    highest = min(MAX_DEGREE, x.size - 2)
    basis, triangle = np.linalg.qr(chebyshev.chebvander(x, highest))
    weights = basis.T @ y
    fits = np.cumsum(basis * weights, axis=1)
    leverages = np.cumsum(basis**2, axis=1)
    left_out = (y[:, np.newaxis] - fits) / np.maximum(1.0 - leverages, 1e-12)
    errors = np.sqrt(np.mean(left_out**2, axis=0))
    degree = int(np.argmax(errors <= _NEAR * errors.min()))
    return np.linalg.solve(triangle[: degree + 1, : degree + 1], weights[: degree + 1])


DEPENDENT = 1e-6  # share of a column that those before it do not explain, below which it is left out
FORMS = {"smoothed": smoothed_rows, "weak": weak_rows}


def signs_of(terms: Sequence[Term], signs: Mapping[str, int] | None) -> dict[Term, int]:
    wanted = {Term.parse(name): sign for name, sign in (signs or {}).items()}
    for term, sign in wanted.items():
        if term not in terms:
            raise ValueError(f"signs: {term.name!r} is not in the library")
        if sign not in (-1, 1):
            raise ValueError(f"signs: the sign of {term.name!r} must be 1 or -1, got {sign!r}")
    return wanted


@dataclass(frozen=True)
class Regression:
    """slope = features @ coefficients, scaled by the rms values `sizes` (n_terms,) and `slope_size`.

    `dependent` are terms left out since their columns are combinations of those of lower degree.
    """

    terms: tuple[Term, ...]
    dependent: tuple[Term, ...]
    features: FloatArray
    slope: FloatArray
    sizes: FloatArray
    slope_size: float

    @property
    def condition(self) -> float:
        return float(np.linalg.cond(self.features))

    def included(self, coefficients: FloatArray) -> tuple[Term, ...]:
        return tuple(term for term, value in zip(self.terms, coefficients, strict=True) if value != 0.0)

    def ridge(self, terms: Sequence[Term], weight: float) -> FloatArray:
        """Coefficients (n_terms,) of a law with these terms alone, by ridge regression."""
        included = [self.terms.index(term) for term in terms]
        return np.asarray(
            ridge(self.features[:, included], self.slope, weight) * self.slope_size / self.sizes[included]
        )


@dataclass(frozen=True)
class Slopes:
    """Rows of several records in one form."""

    rows: tuple[Rows, ...]

    def equations(
        self, features: Feature, feedthrough: float = 0.0, offset: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Right sides (n_rows, n_terms) and left side (n_rows,) for z = y - feedthrough u - offset."""
        columns = np.concatenate([rows.columns(features, feedthrough, offset) for rows in self.rows])
        return columns, np.concatenate([rows.target(feedthrough) for rows in self.rows])

    def misfit(self, terms: Sequence[Term], feedthrough: float, offset: float) -> float:
        """Rms of the residual slope with all terms together."""
        columns, slope = self.equations(_features(terms), feedthrough, offset)
        return abs(float(compressed(columns, slope)[1][-1])) / math.sqrt(len(slope))

    def regression(self, terms: Sequence[Term], feedthrough: float = 0.0, offset: float = 0.0) -> Regression:
        """Regression on the independent ones of the terms, for z = y - feedthrough u - offset."""
        raw, slope = self.equations(_features(terms), feedthrough, offset)
        sizes, slope_size = np.sqrt(np.mean(raw**2, axis=0)), float(np.sqrt(np.mean(slope**2))) or 1.0
        scaled = raw / np.where(sizes > 0.0, sizes, 1.0)
        by_degree = sorted(range(len(terms)), key=lambda k: (terms[k].degree, k))
        included = sorted(independent(scaled, np.empty((len(slope), 0)), by_degree, DEPENDENT))
        return Regression(
            terms=tuple(terms[k] for k in included),
            dependent=tuple(term for k, term in enumerate(terms) if k not in included),
            features=scaled[:, included],
            slope=slope / slope_size,
            sizes=sizes[included],
            slope_size=slope_size,
        )


def slopes(records: Sequence[Record], form: str) -> Slopes:
    """Rows of records in the "smoothed" or the "weak" form; a ValueError if these cannot distinguish u' from |u'|."""
    parts = tuple(rows for record in records if (rows := FORMS[form](record.u, record.y)) is not None)
    directions = {sign for rows in parts for sign in np.unique(rows.direction).tolist()}
    if len(directions) < 2:
        raise ValueError(
            f"a memory law needs a rising and a falling branch of at least {MIN_SAMPLES} samples each: with one of "
            "them alone u' and |u'| are equal. Give a record whose input reverses, sampled more finely"
        )
    return Slopes(parts)


def _features(terms: Sequence[Term]) -> Feature:
    def features(u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
        return np.stack([feature(term, u, z, direction) for term in terms], axis=1)

    return features


def feature(term: Term, u: FloatArray, z: FloatArray, direction: FloatArray | float) -> FloatArray:
    column = u**term.i * z**term.j
    if term.absolute:
        column = column * np.abs(z)
    return column if term.rectified else direction * column


def ridge(columns: FloatArray, target: FloatArray, weight: float) -> FloatArray:
    """Ridge regression on columns of about unit rms."""
    normal = columns.T @ columns / len(columns) + weight * np.eye(columns.shape[1])
    return np.asarray(np.linalg.solve(normal, columns.T @ target / len(columns)))


def independent(columns: FloatArray, basis: FloatArray, order: Sequence[int], least: float) -> list[int]:
    """Columns, in `order`, of which a share of `least` is no combination of an orthonormal `basis` and those before."""
    included = []
    for k in order:
        rest = columns[:, k]
        for _ in range(2):  # twice is enough for orthogonality to rounding
            rest = rest - basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > least * float(np.linalg.norm(columns[:, k])):
            included.append(k)
            basis = np.column_stack([basis, rest / size])
    return included
