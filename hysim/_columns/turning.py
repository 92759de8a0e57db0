"""The turning points of an input, the branches between them, its complete cycles, and the drift between these.

The input turns where it retreats from an extreme by more than a threshold; the record's ends count as turning
points. A branch runs from one turning point to the next. Three consecutive turning points are a complete cycle if
the outer two lie near one extreme of the record and the middle one near the other. A plateau at a turning point is
divided in its middle, half to each branch; a sample in the very middle belongs to both.

An output that repeats itself from cycle to cycle, plus a polynomial p of time, is

    y_c(b, u) = g(b, u) + p(t_c(b, u))

where cycle c passes the input u on branch b at time t_c. The loop g cancels in the differences between the cycles, to
which p is fitted: a loop of any shape is neither tilted nor narrowed.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray

NEAR = 0.05
"""Largest distance of a full cycle's turning points from the record's extremes, as a fraction of the input's span."""

ROUNDING = 1e-12
"""Largest difference of equal values, as a fraction of the span or the stroke."""

TOLERANCE = 0.01
"""Largest reversal of the input that is ignored by default, as a fraction of its span."""

Samples = slice | npt.NDArray[np.intp]


class Cycle(NamedTuple):
    """The samples of a cycle's branches, and those of both in the order of time."""

    loading: Samples
    unloading: Samples
    path: slice


class Turns(NamedTuple):
    """First and last sample of each turning point, and the branches between them."""

    plateaus: list[tuple[int, int]]
    branches: list[slice]


def complete_cycles(u: FloatArray, tolerance: float) -> list[Cycle]:
    """Every complete cycle that shares no branch with a later one, the latest first."""
    plateaus, branches = turns(u, tolerance)
    levels = u[[first for first, _ in plateaus]]
    low, high = u.min(), u.max()
    near = NEAR * (high - low)
    side = (levels >= high - near).astype(int) - (levels <= low + near)

    cycles = []
    k = side.size - 1
    while k >= 2:
        if side[k] == side[k - 2] == -side[k - 1] != 0:
            halves = branches[k - 2], branches[k - 1]
            loading, unloading = halves if side[k] < 0 else halves[::-1]
            cycles.append(Cycle(loading, unloading, slice(halves[0].start, halves[1].stop)))
            k -= 2
        else:
            k -= 1
    return cycles


def turns(u: FloatArray, tolerance: float) -> Turns:
    """The turning points after reversals of more than `tolerance` times the input's span, and the branches."""
    if not 0 <= tolerance < 0.5:
        raise ValueError(f"tolerance is a fraction of the input's span from 0 to below 0.5, got {tolerance}")
    plateaus = _turning_points(u, tolerance * float(np.ptp(u)))
    starts = [plateaus[0][0], *((first + last + 1) // 2 for first, last in plateaus[1:-1])]
    stops = [*((first + last) // 2 + 1 for first, last in plateaus[1:-1]), plateaus[-1][1] + 1]
    return Turns(plateaus, [slice(*ends) for ends in zip(starts, stops, strict=True)] if len(plateaus) > 1 else [])


def settled(u: FloatArray) -> npt.NDArray[np.intp]:
    """The samples of a branch in the order of their inputs; of several with equal inputs the last."""
    order = np.argsort(u, kind="stable")
    x = u[order]
    samples: npt.NDArray[np.intp] = order[np.append(x[1:] > x[:-1], True)]
    return samples


def too_few(u: FloatArray, tolerance: float, wanted: int, present: int) -> str:
    levels = u[[first for first, _ in turns(u, tolerance).plateaus]]
    shown = ", ".join(f"{level:.6g}" for level in levels[:8]) + (", ..." if levels.size > 8 else "")
    return (
        f"asked for {wanted} complete cycle(s) of the input, found {present}: it turns at {shown}. A cycle goes from "
        f"one extreme to the other and back, each within {NEAR:.0%} of the span, or from a level to one extreme or to "
        "both and back to the level, such as 0, max, min, 0. Give a longer record. hysim.loop_metrics(tolerance=...) "
        "ignores small turns of the input, hysim.cycle_metrics measures cycles with minor loops and of every amplitude"
    )


def _turning_points(u: FloatArray, threshold: float) -> list[tuple[int, int]]:
    """First and last sample of each extreme from which the input retreats by more than the threshold, ends included."""
    begins = np.flatnonzero(np.append(True, np.abs(np.diff(u)) > ROUNDING * np.ptp(u)))
    ends = np.append(begins[1:], u.size) - 1
    rises = np.diff(u[begins]) > 0
    extremes = np.concatenate([[0], np.flatnonzero(rises[1:] != rises[:-1]) + 1, [begins.size - 1]])
    levels = u[begins[extremes]]

    reach = np.maximum.accumulate(levels) - np.minimum.accumulate(levels)
    sign = -1 if levels[np.argmax(reach > threshold)] > levels[0] else 1
    plateaus = []
    best, first, last = levels[0], 0, int(ends[0])
    for run, level in zip(extremes.tolist(), levels.tolist(), strict=True):
        if level == best:
            last = int(ends[run])
            continue
        is_turn = sign * (best - level) > threshold
        if is_turn:
            plateaus.append((first, last))
            sign = -sign
        if is_turn or sign * (level - best) > 0:
            best, first, last = level, int(begins[run]), int(ends[run])
    return [*plateaus, (first, last)]


_NODES = 64  # inputs on each branch at which the cycles are compared


def drift(cycles: list[Cycle], u: FloatArray, y: FloatArray, times: FloatArray, order: int) -> FloatArray:
    """The polynomial at every sample, shape (n,), less its mean over the cycles."""
    centre, half = (times[0] + times[-1]) / 2, (times[-1] - times[0]) / 2
    powers = np.polynomial.legendre.legvander((times - centre) / half, order)[:, 1:]
    compared = np.column_stack([y, powers])
    rows = []
    for branches in ([cycle.loading for cycle in cycles], [cycle.unloading for cycle in cycles]):
        passages = [np.arange(u.size)[branch][settled(u[branch])] for branch in branches]
        low, high = max(u[samples[0]] for samples in passages), min(u[samples[-1]] for samples in passages)
        nodes = np.linspace(low, high, _NODES)
        values = np.array([_at(nodes, u[samples], compared[samples]) for samples in passages])
        rows.append((values - values.mean(axis=0)).reshape(-1, compared.shape[1]))
    differences = np.concatenate(rows)
    coefficients = np.linalg.lstsq(differences[:, 1:], differences[:, 0])[0]
    inside = np.unique(np.concatenate([np.arange(u.size)[cycle.path] for cycle in cycles]))
    polynomial: FloatArray = (powers - powers[inside].mean(axis=0)) @ coefficients
    return polynomial


def _at(nodes: FloatArray, u: FloatArray, columns: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(nodes, u, column) for column in columns.T])
