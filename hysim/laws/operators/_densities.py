"""Densities of relays and of plays: from a function, and smooth ones from records.

A smooth density is as smooth as predicts best what was left out.

The density is linear between the centres of coarse cells, and the law's weights w = B c are its integrals over the
finer pairs of intervals between the levels: a law as coarse as the cells would be wrong between its levels by as much
as the density is bent. With the output A w + d of weights w and offset d, smoothness is a small sum of squares of
second differences of neighbouring cells, along each threshold and across both; the weights of the diagonal have their
own along it. A ridge holds what these leave free. A line k u, which weights of the diagonal make,
is free of both: its slope may be a thousand times that of the loop. For each strength the best cells are those of

    min ||y - d - k u - A B c||^2 + strength (trace(N) / trace(P)) c' P c,    P = D'D + ridge

with N = B'A'A B less what d and k explain of it.

Parts are left out one at a time and predicted by fits to the others: each record whose input the others reach, or each
cycle or curve of a single record; and a quarter of each record. The rms error of each part is taken over its least for
any strength, so that a part that no strength predicts well has no more say than another; the strength is that of the
least sum of the means over both kinds. Whole records alone choose too strong a smoothness, since without a record the
gap is twice as wide as between records; quarters alone, and generalised cross-validation, choose too weak a one, since
what a smooth law leaves of a clean record is no noise, but follows the curves. One generalised eigenproblem for each
part gives the cells of all strengths at once.

The state before a record, all relays down or what the record itself leaves, is the one of the lower left-out error.
Source: P. H. C. Eilers, B. D. Marx, Statist. Sci. 11 (1996), for differences as a penalty on many coefficients.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import TOLERANCE
from hysim.models.protocols import DirectFit, Smoother
from hysim.models.tables import Tables
from hysim.records import Record, by_record, few_places

STRENGTHS = np.logspace(-10.0, 4.0, 43)
_SMALLEST = 1e-280  # a smaller incomplete gamma function is its first term
_RIDGE = 1e-3  # of the squares of second differences
_MOST_CURVES = 8
_MOST_INTERVALS = 64
_MOST_CELLS = 24  # along a threshold; of 16, 24 and 32 those with the best predictions for their time
_MOST_SAMPLES = 2000  # of a record, with its reversals
_LEAST = 1e-14  # strength, below which rounding decides what the record does not determine
_EXACT = 1e-6  # of the outputs' standard deviation: smaller errors are all equally good
_COVERED = 0.02  # of its span, by which a record left out may reach beyond the others
_MIXED = np.sqrt(2.0)  # weight of the difference across both thresholds, which is met once where it stands twice


Parts = Sequence[npt.NDArray[np.intp]]
"""Samples that are left out together."""


Density = Callable[[FloatArray, FloatArray], npt.ArrayLike]
"""Weight of relays per area at arrays of upper and lower thresholds of one shape."""
_POINTS = 8  # of Gauss's rule on an interval


def relay_weights(grid: FloatArray, density: Density) -> tuple[float, ...]:
    """A density integrated over each pair of intervals between the levels."""
    rows, columns = np.tril_indices(max(grid.size - 1, 0))
    nodes, share = np.polynomial.legendre.leggauss(_POINTS)
    p, q = (1.0 + nodes) / 2.0, (1.0 + nodes[:, np.newaxis]) / 2.0
    length = np.diff(grid)
    diagonal = (rows == columns)[:, np.newaxis, np.newaxis]
    reach = np.where(diagonal, p, 1.0)  # of b on the way up to a
    a = grid[rows][:, np.newaxis, np.newaxis] + length[rows][:, np.newaxis, np.newaxis] * p
    b = grid[columns][:, np.newaxis, np.newaxis] + length[columns][:, np.newaxis, np.newaxis] * reach * q
    area = (length[rows] * length[columns] / 4.0)[:, np.newaxis, np.newaxis] * np.outer(share, share) * reach
    heights = np.asarray(density(np.broadcast_to(a, b.shape), b), dtype=float)
    return tuple(np.sum(area * heights, axis=(1, 2)).tolist())


@dataclass(frozen=True)
class _Ridge:
    """Samples of a regression: `columns` (n, n_cells) with a penalty, `free` ones without, outputs and weights (n,)."""

    columns: FloatArray
    free: FloatArray
    y: FloatArray
    weights: FloatArray
    penalty: FloatArray

    def sums(self, part: Any = slice(None)) -> FloatArray:
        """Sums of products of columns, free ones and outputs; those of parts add up."""
        beside = np.column_stack([self.columns[part], self.free[part], self.y[part]])
        return np.asarray(beside.T @ (self.weights[part, np.newaxis] * beside))

    def directions(self, sums: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Curvatures of the sum of squares over those of the penalty, their directions; free ones of a cell; (F'F)^-1.

        The free columns F are eliminated: they explain F (shares C) of the columns C.
        """
        from scipy.linalg import eigh  # imported where it is needed

        n = len(self.penalty)
        inverse = np.linalg.pinv(sums[n:-1, n:-1], hermitian=True)
        shares = inverse @ sums[n:-1, :n]
        normal = sums[:n, :n] - sums[:n, n:-1] @ shares
        scale = float(np.trace(normal) / np.trace(self.penalty)) or 1.0
        size, vectors = eigh(normal / scale, self.penalty)
        return np.maximum(size, 0.0), vectors / np.sqrt(scale), shares, np.asarray(inverse)

    def fits(self, sums: FloatArray, strengths: FloatArray) -> FloatArray:
        """Coefficients (n_cells + n_free, n_strengths) of the best fits."""
        n = len(self.penalty)
        size, vectors, shares, inverse = self.directions(sums)
        goal = vectors.T @ (sums[:n, -1] - shares.T @ sums[n:-1, -1])
        cells = vectors @ (goal[:, np.newaxis] / (size[:, np.newaxis] + np.maximum(strengths, _LEAST)))
        return np.concatenate([cells, inverse @ sums[n:-1, -1:] - shares @ cells])

    def errors(self, part: npt.NDArray[np.intp], coefficients: FloatArray) -> FloatArray:
        """Measured outputs less those of coefficients, (n, n_strengths)."""
        n = len(self.penalty)
        outputs = self.columns[part] @ coefficients[:n] + self.free[part] @ coefficients[n:]
        return np.asarray(self.y[part, np.newaxis] - outputs)

    def rows(self, strength: float) -> FloatArray:
        """R (n, k): the outputs of the best fit are R R' W y."""
        size, vectors, shares, inverse = self.directions(self.sums())
        cells = (self.columns - self.free @ shares) @ vectors / np.sqrt(size + max(strength, _LEAST))
        return np.column_stack([cells, self.free @ np.linalg.cholesky(inverse)])


def chosen(ridge: _Ridge, parts: Sequence[Parts], strength: float | None = None) -> tuple[float, float, FloatArray]:
    """The rms of the errors at left-out samples, the strength of the best predictions, and the coefficients."""
    strengths, total = STRENGTHS if strength is None else np.array([strength]), ridge.sums()
    exact = max(_EXACT * float(np.std(ridge.y)), np.finfo(float).tiny)
    score, squares = np.zeros(strengths.size), np.zeros(strengths.size)
    for kind in parts:
        for part in kind:
            errors = ridge.errors(part, ridge.fits(total - ridge.sums(part), strengths))
            each = np.sum(ridge.weights[part, np.newaxis] * errors**2, axis=0)
            rms = np.maximum(np.sqrt(each / part.size), exact)
            score += rms / rms.min() / len(kind)
            squares += each
    best = int(np.argmin(score))
    left_out = float(np.sqrt(squares[best] / sum(part.size for each in parts for part in each)))
    return left_out, float(strengths[best]), ridge.fits(total, strengths[[best]])[:, 0]


def smooth(
    law: type[Any],
    records: Sequence[Record],
    intervals: int | None = None,
    strength: float | None = None,
    weights: FloatArray | None = None,
) -> tuple[DirectFit, float]:
    """The law of spread relays with the density of the best strength, after the inputs before each record; and it."""
    low, high = min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)
    n = _supported(high - low, records) if intervals is None else intervals
    levels = tuple(np.linspace(low, high, n + 1).tolist())
    places = [few_places(record, _MOST_SAMPLES) for record in records]
    begins = np.cumsum([0, *(len(record) for record in records)]).tolist()
    kept = np.concatenate([k + own for k, own in zip(begins, places, strict=False)])
    of_records = [Record(u=record.u[own], y=record.y[own]) for record, own in zip(records, places, strict=True)]
    u, y = (np.concatenate([vars(record)[name] for record in of_records]) for name in "uy")
    shares = np.ones(y.size) if weights is None else weights[kept]
    cells = min(n, _MOST_CELLS)
    table, penalty = linear_between(cells, n), roughness(cells)
    relays = law(levels=levels, weights=(0.0,) * len(table))
    middle, free = float(y.mean()), np.column_stack([np.ones(y.size), 2.0 * (u - low) / (high - low) - 1.0])

    at_rest = [levels[:1] for _ in of_records]  # the inputs before each record
    repeated = [(*levels[:1], *relays.advance(record.u)[1][1:]) for record in of_records]
    fits = []
    for pasts in (at_rest, repeated):
        memories = [np.tile(past, (table.shape[1], 1)) for past in pasts]
        sets = [{"levels": np.array(levels), "weights": table.T, "z0": z0} for z0 in memories]
        columns = np.concatenate(
            [law.responses(each, record.u).T for each, record in zip(sets, of_records, strict=True)]
        )
        centre = columns.mean(axis=0)  # about which, and about `middle`, the sums keep more digits
        ridge = _Ridge(columns - centre, free, y - middle, shares, penalty)
        fits.append((*chosen(ridge, parts_of(of_records), strength), ridge, centre, pasts))
    _, strength, coefficients, ridge, centre, pasts = min(fits, key=lambda fit: fit[0])
    *own, offset, slope = coefficients.tolist()
    diagonal = np.equal(*np.tril_indices(n))
    best = law(
        levels=levels,
        weights=tuple((table @ own + slope / n * diagonal).tolist()),
        offset=middle + offset - float(centre @ own),
    )
    models = tuple(replace(best, z0=tuple(value for value in past if value > levels[0])) for past in pasts)
    smoother = Smoother(kept, ridge.rows(strength), shares)
    words = f"density of {cells} cells along a threshold, smooth by a penalty of strength {strength:.2g}"
    return DirectFit(models, smoother.degrees_of_freedom, smoother.spread(begins[-1]), words, smoother), strength


def check_strength(value: Any) -> float:
    """A strength of the penalty; else a ValueError."""
    if isinstance(value, str) or not 0.0 <= value < math.inf:
        raise ValueError(f"the strength must be finite and not negative, got {value!r}")
    return float(value)


def _supported(span: float, records: Sequence[Record]) -> int:
    """Intervals no finer than the steps of the inputs, at most 64."""
    steps = np.abs(np.concatenate([np.diff(each.u) for each in records]))
    if span == 0.0:
        raise ValueError("the input is constant: nothing can be identified from it")
    return int(np.clip(span / np.median(steps[steps > 0.0]), 2, _MOST_INTERVALS))


def parts_of(records: Sequence[Record]) -> list[Parts]:
    """Samples to leave out at a time, of each kind that these records have."""
    samples = by_record(np.arange(sum(map(len, records))), records)
    quarters = [part for each in samples for part in np.array_split(each, 4)]
    if len(records) > 1:
        reached = [_covered(record.u, [*records[:k], *records[k + 1 :]]) for k, record in enumerate(records)]
        complete = [part for part, within in zip(samples, reached, strict=True) if within]
    else:
        curves = np.split(samples[0], records[0].reversals(TOLERANCE)[1::2])
        count = min(_MOST_CURVES, len(curves))
        complete = [np.concatenate(curves[k::count]) for k in range(count if count > 2 else 0)]
    return [complete, quarters] if complete else [quarters]


def _covered(u: FloatArray, others: Sequence[Record]) -> bool:
    """Whether the others reach as far as this input: relays that they do not switch have nothing to predict from."""
    slack = _COVERED * float(np.ptp(u))
    lowest, highest = min(float(each.u.min()) for each in others), max(float(each.u.max()) for each in others)
    return bool(u.min() >= lowest - slack and u.max() <= highest + slack)


def roughness(n: int) -> FloatArray:
    """P for the weights of `n` intervals, row by row.

    Differences that reach the diagonal, or beyond it, are left out; the diagonal has its own.
    """
    rows, columns = np.tril_indices(n)
    first, second, one = np.diff(np.eye(n), axis=0), np.diff(np.eye(n), 2, axis=0), np.eye(n)
    off = np.tril(np.ones((n, n), dtype=bool), -1).ravel()
    differences = np.concatenate([np.kron(second, one), np.kron(one, second), _MIXED * np.kron(first, first)])
    inside = differences[~differences[:, ~off].any(axis=1)]
    inside = inside[np.argsort((inside != 0.0).argmax(axis=1), kind="stable")]
    table = np.zeros((len(inside) + len(second), rows.size))
    table[: len(inside), rows > columns], table[len(inside) :, rows == columns] = inside[:, off], second
    return np.asarray(table.T @ table + _RIDGE * np.eye(rows.size))


def linear_between(cells: int, n: int) -> FloatArray:
    """Table B (n (n + 1) / 2, cells (cells + 1) / 2) from weights of coarse cells to weights on `n` intervals.

    The density is linear between, and beyond, the centres of cells off the diagonal; so are weights per length on it.
    """
    rows, columns = np.tril_indices(n)
    if cells >= n:
        return np.eye(rows.size)
    ratio = cells / n
    centre = (np.arange(n) + 0.5) * ratio - 0.5
    first = np.clip(np.floor(centre).astype(np.intp), 0, cells - 2)
    share = centre - first
    tents = np.zeros((n, cells))  # of each coarse cell at the centres of the intervals
    tents[np.arange(n), first], tents[np.arange(n), first + 1] = 1.0 - share, share
    table = ratio**2 * np.einsum("kp,kq,pqc->kc", tents[rows], tents[columns], _beyond_diagonal(cells), optimize=True)
    table[rows == columns] = 0.0
    of_diagonal = np.flatnonzero(np.equal(*np.tril_indices(cells)))
    table[np.ix_(np.flatnonzero(rows == columns), of_diagonal)] = ratio * tents
    return np.asarray(table)


def _beyond_diagonal(cells: int) -> FloatArray:
    """Densities (cells, cells, n_coefficients) in a square of cells: linear on the diagonal and next to it above."""
    rows, columns = np.tril_indices(cells)
    values = np.zeros((cells, cells, rows.size))
    below = np.flatnonzero(rows > columns)
    values[rows[below], columns[below], below] = 1.0
    inner = np.arange(1, cells - 1)
    values[inner, inner] = values[inner, inner - 1] + values[inner + 1, inner] - values[inner + 1, inner - 1]
    values[0, 0] = 2.0 * values[1, 0] - values[2, 0]
    values[-1, -1] = 2.0 * values[-1, -2] - values[-1, -3]
    k = np.arange(cells - 1)
    values[k, k + 1] = values[k, k] + values[k + 1, k + 1] - values[k + 1, k]
    return values


def gamma_plays(tables: Tables) -> tuple[FloatArray, FloatArray]:
    """Thresholds and shares (n_sets, n_plays) of plays with a parametric density; see its law.

    Laws with fewer plays have some without a share.
    """
    from scipy.special import gammainc  # imported where it is needed

    plays = tables["plays"]
    place = np.minimum(np.arange(plays.max() + 1.0), plays) / plays
    edges = tables["reach"] * place**2
    power, decay = tables["exponent"] + 1.0, tables["decay"]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore", under="ignore"):
        total = gammainc(power, tables["reach"] / decay)
        below = np.where(total > _SMALLEST, gammainc(power, edges / decay) / total, place ** (2.0 * power))
    return 0.5 * (edges[:, 1:] + edges[:, :-1]), np.diff(below, axis=1)
