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

**PySINDy.** This is the only place that touches PySINDy (2.1): its optimizers, from dense to sparse. Features and
slopes are scaled arrays: PySINDy never differentiates, so that nothing is taken across a reversal. Its ensembles draw
from NumPy's global generator, so that their rows are drawn here.
"""

import contextlib
import importlib.util
import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import chebyshev

from hysim._basics.frozen import FloatArray
from hysim.laws.differential.terms import Term
from hysim.records import Record

RIDGE = 1e-12  # of the squared columns: keeps the normal equations solvable and changes nothing else
STEP = 1.1
_MAX_ITERATIONS = 50
_CONVEX = ("ConstrainedSR3", "StableLinearSR3", "TrappingSR3")
_EXTRAS = {**dict.fromkeys(_CONVEX, "cvxpy"), "MIOSR": "miosr", "SBR": "sbr"}

OPTIMIZERS = ("STLSQ", "SR3", "SSR", "FROLS")
"""PySINDy's optimizers that a path is made with."""


def sparse_path(features: FloatArray, slope: FloatArray, optimizer: str = "STLSQ") -> list[tuple[float, FloatArray]]:
    """Thresholds from zero up, and the coefficients (n_terms,) that the optimizer finds at each; rows are `compressed`.

    The next threshold is just above the smallest coefficient of the last result, so that none that matters is missed;
    SR3, whose coefficients may be smaller than its threshold, goes on in steps of STEP. SSR and FROLS have no
    threshold: their own sequence of structures is the path, each with its smallest coefficient.
    """
    if optimizer in ("SSR", "FROLS"):
        return _greedy_path(features, slope, optimizer)
    path: list[tuple[float, FloatArray]] = []
    threshold = 0.0
    while (coefficients := sparse_fit(features, slope, threshold, optimizer)).any():
        if not path or not np.array_equal(coefficients != 0.0, path[-1][1] != 0.0):
            path.append((threshold, coefficients))
        smallest = float(np.abs(coefficients[coefficients != 0.0]).min())
        threshold = smallest * (1.0 + 1e-9) if smallest > threshold else STEP * threshold
    return path


def compressed(features: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A regression with as many rows as terms, and one more, with the least squares of all rows."""
    triangle = np.asarray(np.linalg.qr(np.column_stack([features, slope]), mode="r"))
    return triangle[:, :-1], triangle[:, -1]


def sparse_fit(features: FloatArray, slope: FloatArray, threshold: float, optimizer: str = "STLSQ") -> FloatArray:
    """Coefficients (n_terms,) at one threshold, zero where the optimizer removed the term."""
    fitted = _thresholding(optimizer, threshold, features)
    with _quiet():
        fitted.fit(features, slope[:, np.newaxis])
    return np.array(fitted.coef_[0])


def inclusion(features: FloatArray, slope: FloatArray, threshold: float, *, n_models: int, seed: int) -> FloatArray:
    """Share of fits (n_terms,) by STLSQ that keep each term when the rows are drawn anew (PySINDy's bagging)."""
    fitted, n = _thresholding("STLSQ", threshold, features), len(slope)
    random = np.random.RandomState(seed)  # draws the same rows as PySINDy
    with _quiet():
        draws = (random.choice(n, n) for _ in range(n_models))
        included = [fitted.fit(features[rows], slope[rows, np.newaxis]).coef_[0] != 0.0 for rows in draws]
    return np.asarray(np.mean(included, axis=0))


def check(optimizer: str) -> None:
    """A ValueError for an unknown optimizer; an ImportError if its extra is not installed."""
    if optimizer in OPTIMIZERS:
        return
    extra = _EXTRAS.get(optimizer)
    if extra is not None and importlib.util.find_spec(extra) is None:
        raise ImportError(f"PySINDy's {optimizer} needs its extra: pip install 'pysindy[{extra}]'")
    raise ValueError(f"optimizer must be one of {', '.join(OPTIMIZERS)}, got {optimizer!r}")


def _thresholding(optimizer: str, threshold: float, features: FloatArray) -> Any:
    import pysindy

    if optimizer == "SR3":
        return pysindy.SR3(
            reg_weight_lam=0.5 * threshold**2, regularizer="L0", relax_coeff_nu=1.0, max_iter=1000, unbias=True
        )
    return pysindy.STLSQ(threshold=threshold, alpha=_ridge(features), max_iter=_MAX_ITERATIONS, unbias=False)


def _ridge(features: FloatArray) -> float:
    return RIDGE * float(np.mean(np.sum(features**2, axis=0)))


def _greedy_path(features: FloatArray, slope: FloatArray, optimizer: str) -> list[tuple[float, FloatArray]]:
    import pysindy

    kinds = {"SSR": pysindy.SSR, "FROLS": pysindy.FROLS}
    fitted = kinds[optimizer](alpha=_ridge(features), max_iter=features.shape[1], unbias=False)
    with _quiet():
        fitted.fit(features, slope[:, np.newaxis])
    structures: dict[tuple[bool, ...], FloatArray] = {}
    for coefficients in (np.ravel(each) for each in fitted.history_):
        if coefficients.any():
            structures.setdefault(tuple(coefficients != 0.0), np.array(coefficients))
    ordered = sorted(structures.values(), key=np.count_nonzero, reverse=True)
    return [(float(np.abs(each[each != 0.0]).min()), each) for each in ordered]


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """An empty law is the end of a path, and the last iterate of an unfinished one is still a structure."""
    import sklearn.exceptions

    # the options of each of thousands of small regressions are the same
    with warnings.catch_warnings(), sklearn.config_context(skip_parameter_validation=True):
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        warnings.filterwarnings("ignore", category=sklearn.exceptions.ConvergenceWarning)
        yield


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

    def columns(self, feature: Feature, feedthrough: float, offset: float) -> FloatArray:
        """Right side, shape (n_rows, n_terms)."""
        values = feature(self.u, self.y - feedthrough * self.u - offset, self.direction)
        return self._summed(values * self.length[:, np.newaxis])

    def target(self, feedthrough: float) -> FloatArray:
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
    columns = ((each.u, each.y, np.full(each.u.size, each.direction), each.slope) for each in smooth)
    u, y, direction, slope = (np.concatenate(column) for column in zip(*columns, strict=True))
    return Rows(u, y, direction, slope, np.ones(u.size))


def weak_rows(u: FloatArray, y: FloatArray) -> Rows | None:
    """Weak form, or None where there are too few samples for a window."""
    u, y = without_rests(u, y)
    n = u.size - 1
    if n < _SHORTEST:
        return None
    size = max(_SHORTEST, min(n // _WINDOWS, n // len(pieces(u))))
    stride = max(1, size // _OVERLAP)
    bump = (1.0 - np.linspace(-1.0, 1.0, size + 1) ** 2) ** 2
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
    ends = [0, *np.flatnonzero(turning(u)).tolist(), u.size - 1]
    return [slice(first, last + 1) for first, last in itertools.pairwise(ends)]


def turning(u: FloatArray) -> npt.NDArray[np.bool_]:
    """The samples at which an input turns, without its ends."""
    direction = np.sign(np.diff(u))
    return np.concatenate([[False], direction[1:] != direction[:-1], [False]])


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
    """target = features @ coefficients in units of `size` / `sizes` (n_terms,); collinear terms are `dependent`."""

    terms: tuple[Term, ...]
    dependent: tuple[Term, ...]
    features: FloatArray
    target: FloatArray
    sizes: FloatArray
    size: float

    @cached_property
    def triangle(self) -> tuple[FloatArray, FloatArray]:
        return compressed(self.features, self.target)

    @cached_property
    def condition(self) -> float:
        rows = self.triangle[0]
        return float(np.linalg.cond(rows / np.linalg.norm(rows, axis=0))) if self.terms else 1.0

    def path(self, optimizer: str = "STLSQ") -> list[tuple[float, tuple[Term, ...]]]:
        """Thresholds of an optimizer from dense to sparse, each with the terms that it keeps."""
        path = sparse_path(*self.triangle, optimizer) if self.terms else []
        return [(threshold, tuple(itertools.compress(self.terms, values != 0.0))) for threshold, values in path]

    def places(self, terms: Sequence[Term]) -> list[int]:
        return [self.terms.index(term) for term in terms]

    def ridge(self, terms: Sequence[Term], weight: float) -> FloatArray:
        """Coefficients (n_terms,) of a law with these terms alone, by ridge regression."""
        included = self.places(terms)
        scaled = ridge(self.features[:, included], self.target, weight)
        return np.asarray(scaled * self.size / self.sizes[included])


@dataclass(frozen=True)
class Slopes:
    """Rows of several records in one form."""

    rows: tuple[Rows, ...]

    def equations(self, features: Feature, feedthrough: float, offset: float) -> tuple[FloatArray, FloatArray]:
        """Right sides (n_rows, n_terms) and left side (n_rows,) for z = y - feedthrough u - offset."""
        columns = np.concatenate([rows.columns(features, feedthrough, offset) for rows in self.rows])
        return columns, np.concatenate([rows.target(feedthrough) for rows in self.rows])

    def misfit(self, terms: Sequence[Term], feedthrough: float, offset: float) -> float:
        """Rms of the residual slope with all terms together."""
        columns, slope = self.equations(partial(_features, terms), feedthrough, offset)
        return abs(float(compressed(columns, slope)[1][-1])) / math.sqrt(len(slope))

    def regression(self, terms: Sequence[Term], feedthrough: float = 0.0, offset: float = 0.0) -> Regression:
        """Regression on the independent ones of the terms, for z = y - feedthrough u - offset."""
        raw, slope = self.equations(partial(_features, terms), feedthrough, offset)
        sizes, size = np.sqrt(np.mean(raw**2, axis=0)), float(np.sqrt(np.mean(slope**2))) or 1.0
        scaled = raw / np.where(sizes > 0.0, sizes, 1.0)
        by_degree = sorted(range(len(terms)), key=lambda k: (terms[k].degree, k))
        included = sorted(independent(scaled, np.empty((len(slope), 0)), by_degree, DEPENDENT))
        return Regression(
            terms=tuple(terms[k] for k in included),
            dependent=tuple(term for k, term in enumerate(terms) if k not in included),
            features=scaled[:, included],
            target=slope / size,
            sizes=sizes[included],
            size=size,
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


def _features(terms: Sequence[Term], u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
    return np.stack([feature(term, u, z, direction) for term in terms], axis=1)


def feature(term: Term, u: FloatArray, z: FloatArray, direction: FloatArray | float) -> FloatArray:
    column = u**term.i * z**term.j
    if term.absolute:
        column = column * np.abs(z)
    return column if term.rectified else direction * column


def ridge(columns: FloatArray, target: FloatArray, weight: float) -> FloatArray:
    normal = columns.T @ columns / len(columns) + weight * np.eye(columns.shape[1])
    return np.asarray(np.linalg.solve(normal, columns.T @ target / len(columns)))


def independent(columns: FloatArray, basis: FloatArray, order: Sequence[int], least: float) -> list[int]:
    """Columns, in `order`, whose share outside an orthonormal `basis` and the earlier columns is at least `least`."""
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
