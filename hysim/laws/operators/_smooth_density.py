"""A smooth density of relays from records, as smooth as predicts best what was left out.

With the output A w + c of weights w and offset c, smoothness is a small sum of squares of second differences of
neighbouring weights, along each threshold and across both; the weights of the diagonal have their own along it. A ridge
holds what these leave free. For each strength the best weights are those of

    min ||y - c - A w||^2 + strength (trace(A'A) / trace(P)) w' P w,    P = D'D + ridge

Parts are left out one at a time, and the strength is that whose fits to the others predict them best: each record whose
input the others reach, or each cycle or curve of a single record; and a quarter of each record. The squared errors of
the former, and those of all, are each taken over their least value, and added. Generalised cross-validation chooses too
weak a strength here: what a smooth law leaves of a clean record is no noise, but follows the curves. One generalised
eigenproblem for each part gives the weights of all strengths at once.

What was before a record, all relays down or the record itself, is what the better of the two errors says.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._cycles import TOLERANCE
from hysim._frozen import FloatArray
from hysim.laws.operators._clamp_search import TURN
from hysim.laws.operators._preisach_search import PreisachStructure
from hysim.models.search_space import Parameters
from hysim.records import Record

STRENGTHS = np.logspace(-10.0, 4.0, 43)
_RIDGE = 1e-3  # of the squares of second differences
_MOST_CURVES = 8
_MOST_INTERVALS = 32
_MOST_SAMPLES, _TURN = 2000, 0.01  # of a record, beside reversals by more than this part of the span
_LEAST = 1e-14  # strength, below which rounding decides what the record does not determine
_COVERED = 0.02  # of its span, by which a record left out may reach beyond the others
_MIXED = np.sqrt(2.0)  # weight of the difference across both thresholds, which is met once where it stands twice


Parts = Sequence[npt.NDArray[np.intp]]
"""Samples that are left out together."""


class Chosen(NamedTuple):
    """Weights and offset; the strength, and the rms of the errors at the left-out samples."""

    weights: FloatArray
    offset: float
    strength: float
    left_out: float


def chosen(columns: FloatArray, y: FloatArray, parts: Sequence[Parts], n: int, strength: float | None = None) -> Chosen:
    """The fit to outputs `y` (n_samples,) of relays on `n` intervals, with the strength that the parts choose."""
    penalty, strengths = roughness(n), STRENGTHS if strength is None else np.array([strength])
    errors = np.zeros((len(parts), strengths.size))
    for kind, part in ((kind, part) for kind, each in enumerate(parts) for part in each):
        training = np.ones(y.size, dtype=bool)
        training[part] = False
        weights, offsets = fits(columns[training], y[training], penalty, strengths)
        errors[kind] += np.sum((y[part, np.newaxis] - columns[part] @ weights - offsets) ** 2, axis=0)
    voices = np.cumsum(errors, axis=0)  # of the first kind, and of all parts
    least = np.maximum(voices.min(axis=1, keepdims=True), np.finfo(float).tiny)
    best = int(np.argmin(np.sum(voices / least, axis=0)))
    weights, offsets = fits(columns, y, penalty, strengths[[best]])
    left_out = float(np.sqrt(errors[:, best].sum() / sum(part.size for each in parts for part in each)))
    return Chosen(weights[:, 0], float(offsets[0]), float(strengths[best]), left_out)


def smooth(
    structure: PreisachStructure, records: Sequence[Record], strength: float | None
) -> tuple[Chosen, tuple[float, ...]]:
    """The fit of a structure with levels, and the inputs before the first record."""
    short = [_thinned(record) for record in records]
    y, parts, levels = np.concatenate([record.y for record in short]), parts_of(short), structure.levels
    places: dict[str, Any] = {f"levels[{k}]": level for k, level in enumerate(levels)}
    best: tuple[Chosen, tuple[float, ...]] | None = None
    for before in (_down, structure.steady):
        starts = [before({**places, TURN: levels[0]}, record) for record in short]
        outputs = [structure.regressors(start, record)[0] for start, record in zip(starts, short, strict=True)]
        fit = chosen(np.concatenate(outputs)[:, :-2], y, parts, len(levels) - 1, strength)
        if best is None or fit.left_out < best[0].left_out:
            past = [float(value) for name, value in starts[0].items() if name.startswith("z0[")]
            best = fit, tuple(value for value in past if value > levels[0])
    assert best is not None  # there are two states
    return best


def supported(records: Sequence[Record]) -> int:
    """Intervals no finer than the steps of the inputs, at most 32."""
    span = max(float(each.u.max()) for each in records) - min(float(each.u.min()) for each in records)
    steps = np.abs(np.concatenate([np.diff(each.u) for each in records]))
    if span == 0.0:
        raise ValueError("the input is constant: nothing can be identified from it")
    return int(np.clip(span / np.median(steps[steps > 0.0]), 2, _MOST_INTERVALS))


def _down(parameters: Parameters, record: Record) -> dict[str, Any]:
    """All relays down before the record."""
    return dict(parameters)


def _thinned(record: Record) -> Record:
    evenly = np.linspace(0, len(record) - 1, min(_MOST_SAMPLES, len(record))).round().astype(np.intp)
    kept = np.union1d(evenly, record.reversals(_TURN))
    return Record(u=record.u[kept], y=record.y[kept])


def parts_of(records: Sequence[Record]) -> list[Parts]:
    """Samples to leave out at a time, of each kind that these records have."""
    cuts = np.cumsum([0, *(len(record) for record in records)])
    samples = np.split(np.arange(cuts[-1]), cuts[1:-1])
    quarters = [part for each in samples for part in np.array_split(each, 4)]
    if len(records) > 1:
        reached = [_covered(record.u, [*records[:k], *records[k + 1 :]]) for k, record in enumerate(records)]
        whole = [part for part, within in zip(samples, reached, strict=True) if within]
    else:
        curves = np.split(samples[0], records[0].reversals(TOLERANCE)[1::2])
        count = min(_MOST_CURVES, len(curves))
        whole = [np.concatenate(curves[k::count]) for k in range(count if count > 2 else 0)]
    return [whole, quarters] if whole else [quarters]


def _covered(u: FloatArray, others: Sequence[Record]) -> bool:
    """Whether the others reach as far as this input: relays that they do not switch have nothing to predict from."""
    slack = _COVERED * float(np.ptp(u))
    lowest, highest = min(float(each.u.min()) for each in others), max(float(each.u.max()) for each in others)
    return bool(u.min() >= lowest - slack and u.max() <= highest + slack)


def roughness(n: int) -> FloatArray:
    """P for the weights of `n` intervals, row by row."""
    rows, columns = np.tril_indices(n)
    place = {(i, j): k for k, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True))}
    differences = []
    for i, j in place:
        if i == j:
            stencils = [{(i, i): 1.0, (i + 1, i + 1): -2.0, (i + 2, i + 2): 1.0}]
        else:
            stencils = [
                {(i, j): 1.0, (i + 1, j): -2.0, (i + 2, j): 1.0},
                {(i, j): 1.0, (i, j + 1): -2.0, (i, j + 2): 1.0},
                {(i, j): _MIXED, (i + 1, j): -_MIXED, (i, j + 1): -_MIXED, (i + 1, j + 1): _MIXED},
            ]
        inside = (each for each in stencils if all(p in place and (p[0] == p[1]) == (i == j) for p in each))
        differences += [{place[p]: value for p, value in each.items()} for each in inside]
    table = np.zeros((len(differences), rows.size))
    for row, each in zip(table, differences, strict=True):
        row[list(each)] = list(each.values())
    return np.asarray(table.T @ table + _RIDGE * np.eye(rows.size))


def fits(
    columns: FloatArray, y: FloatArray, penalty: FloatArray, strengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weights (n_weights, n_strengths) and offsets (n_strengths,) of the best fits."""
    from scipy.linalg import eigh  # imported where it is needed

    centre, middle = columns.mean(axis=0), float(y.mean())
    beside = columns - centre
    normal = beside.T @ beside
    scale = float(np.trace(normal) / np.trace(penalty)) or 1.0
    size, vectors = eigh(normal / scale, penalty)
    share = vectors.T @ (beside.T @ (y - middle)) / scale
    weights = vectors @ (share[:, np.newaxis] / (np.maximum(size, 0.0)[:, np.newaxis] + np.maximum(strengths, _LEAST)))
    return weights, middle - centre @ weights
