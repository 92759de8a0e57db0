"""Cycles from a level of the input and back to it, as in cyclic tests of structures and of ferroelectrics.

An excursion begins and ends at the level and lies on one side of it: 0 -> max -> 0. Two successive excursions, one to
each side, are a cycle; an excursion without a partner on the other side, as in 0 -> 5 -> 0 -> 8 -> 0, is a cycle of
its own. Samples before the first excursion belong to no cycle, nor does the last excursion of a record whose excursions
alternate, which is half a cycle. Ends of the record within 5 % of the span of the level are no excursions.

The level is the input at the first sample, where tests begin at rest, or the middle of the levels that the branches of
the greatest total length reach: the one with cycles of the larger total span. The record's first and last branch do not
count there, since they may be incomplete. A turning point within the tolerance of the level counts as at the level.
Between two samples the input is linear, and a cycle begins and ends between them where the input passes the level. Of
several passages in one branch (noise, a pause) the middle one is taken. Source: ATC-24, Guidelines for Cyclic Seismic
Testing of Components of Steel Structures, Applied Technology Council, 1992, glossary ("excursion", "cycle"); FEMA 461
(2007) and ISO 16670 (2003) count their protocols in the same cycles. There the level is zero load, here it is a level
of the input, so that every cycle of the input is closed.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import NEAR, ROUNDING, Cycle, complete_cycles, too_few, turns

_FULL = 1.0 - 2.0 * NEAR
"""Least span of a cycle of full amplitude, as a fraction of the widest cycle's: each end may miss by `NEAR`."""


class Loops(NamedTuple):
    """Cycles of a record into which samples have been inserted where the cycles begin and end.

    `places` are the record's samples and the inserted ones, as fractional numbers of samples; None if none is inserted.
    The cycles' slices and indices refer to the samples at these places.
    """

    places: FloatArray | None
    cycles: list[Cycle]

    def of(self, values: FloatArray) -> FloatArray:
        """Values of shape (n,) or (n_sets, n) at the places, linear between the samples."""
        if self.places is None:
            return values
        below = self.places.astype(np.intp)
        part = self.places - below
        above = np.minimum(below + 1, values.shape[-1] - 1)
        inserted: FloatArray = (1.0 - part) * values[..., below] + part * values[..., above]
        return inserted

    def first_sample(self, cycle: Cycle) -> int:
        return cycle.path.start if self.places is None else int(np.ceil(self.places[cycle.path.start]))


class Protocol(NamedTuple):
    """The cycles about a level: the ends of each, in samples, and whether it contains minor loops."""

    level: float
    spans: list[tuple[float, float]]
    loops: Loops
    has_inner_turns: list[bool]

    @property
    def slices(self) -> list[slice]:
        return [slice(int(np.floor(begin)), int(np.ceil(end)) + 1) for begin, end in self.spans]


class _Excursion(NamedTuple):
    begin: float
    end: float
    side: int
    turns: range


def measured_cycles(u: FloatArray, cycles: int, tolerance: float) -> Loops:
    """The last cycles between the extremes, else of full amplitude about a level, latest first; else a ValueError."""
    if cycles < 1:
        raise ValueError(f"cycles must be at least 1, got {cycles}")
    between_extremes = complete_cycles(u, tolerance)
    if len(between_extremes) >= cycles:
        return Loops(None, between_extremes[:cycles])
    about_level = protocol(u, tolerance)
    full = full_amplitude(u, about_level)
    if len(full) < cycles:
        raise ValueError(too_few(u, tolerance, cycles, max(len(full), len(between_extremes))))
    return Loops(about_level.loops.places, [about_level.loops.cycles[k] for k in full[: -cycles - 1 : -1]])


def full_amplitude(u: FloatArray, about_level: Protocol) -> list[int]:
    """Numbers of the cycles without minor loops whose span is at least 90 % of the widest cycle's."""
    at_places = about_level.loops.of(u)
    spans = np.array([np.ptp(at_places[cycle.path]) for cycle in about_level.loops.cycles])
    is_full = spans >= _FULL * spans.max(initial=0.0)
    return np.flatnonzero(is_full & ~np.array(about_level.has_inner_turns, dtype=bool)).tolist()


def protocol(u: FloatArray, tolerance: float, level: float | None = None) -> Protocol:
    """The cycles about a level, by default that with the widest cycles, in the order of time."""
    plateaus = turns(u, tolerance).plateaus
    reach = tolerance * float(np.ptp(u))
    levels = u[[first for first, _ in plateaus]]
    candidates = [level] if level is not None else _candidates(levels, float(u[0]), reach)
    attempts = [(middle, _pairs_about(middle, u, plateaus, levels, reach)) for middle in candidates]
    middle, pairs = max(attempts, key=lambda attempt: _total_span(attempt[0], attempt[1], levels))
    spans = [(pair[0].begin, pair[-1].end) for pair in pairs]
    places = np.union1d(np.arange(float(u.size)), [place for span in spans for place in span])
    return Protocol(
        level=middle,
        spans=spans,
        loops=Loops(places, [_cycle(places, plateaus, levels, pair) for pair in pairs]),
        has_inner_turns=[any(len(part.turns) > 1 for part in pair) for pair in pairs],
    )


def _candidates(levels: FloatArray, first: float, reach: float) -> list[float]:
    """The first input, and the middle of the levels that the branches reach most, the first and the last left out."""
    ends = np.sort(np.column_stack([levels[1:-2], levels[2:-1]]), axis=1)
    if not ends.size:
        return [first]
    lengths = np.diff(ends)[:, 0]
    lows, highs = ends[:, 0] - reach, ends[:, 1] + reach
    edges = np.unique(np.concatenate([lows, highs, [first]]))
    begun, ended = (np.zeros(edges.size) for _ in range(2))
    np.add.at(begun, np.searchsorted(edges, lows), lengths)
    np.add.at(ended, np.searchsorted(edges, highs), lengths)
    reached = np.cumsum(begun) - np.cumsum(ended) + ended
    is_most = reached >= (1.0 - ROUNDING) * reached.max()
    if is_most[np.searchsorted(edges, first)]:
        return [first]
    begin = int(np.argmax(is_most))
    return [first, float(edges[begin] + edges[begin + np.argmax(ended[begin:] > 0.0)]) / 2.0]


def _pairs_about(
    level: float, u: FloatArray, plateaus: list[tuple[int, int]], levels: FloatArray, reach: float
) -> list[list[_Excursion]]:
    sides = np.sign(np.where(np.abs(levels - level) > reach, levels - level, 0.0)).astype(np.int64)
    excursions = _excursions(u - level, plateaus, sides)
    far = np.where(np.abs(levels - level) > NEAR * float(np.ptp(u)), sides, 0)  # a record may pass its own end a little
    return _paired(excursions, *_around(excursions, far)) if excursions else []


def _total_span(level: float, pairs: list[list[_Excursion]], levels: FloatArray) -> float:
    """Sum over all cycles of the largest distances from the level to either side."""
    return sum(max(abs(float(levels[turn]) - level) for turn in part.turns) for pair in pairs for part in pair)


def _excursions(v: FloatArray, plateaus: list[tuple[int, int]], sides: npt.NDArray[np.int64]) -> list[_Excursion]:
    """The excursions of an input `v` that is measured from the level; `sides` are those of its turning points."""
    away = np.flatnonzero(sides).tolist()
    visits = []
    for before, after in pairwise([-1, *away, len(plateaus)]):
        begin = plateaus[before][1] if before >= 0 else 0
        end = plateaus[after][0] if after < len(plateaus) else v.size - 1
        visits.append(_visit(v, begin, end, plateaus[before + 1 : after]))
    reached = [k for k, place in enumerate(visits) if place is not None]
    return [
        _Excursion(visits[k], visits[j], int(sides[away[k]]), range(away[k], away[j - 1] + 1))  # type: ignore[arg-type]
        for k, j in pairwise(reached)
    ]


def _visit(v: FloatArray, begin: int, end: int, near: list[tuple[int, int]]) -> float | None:
    """Place between two samples where the input passes zero; otherwise the turning point there that is near zero."""
    part = v[begin : end + 1]
    at = np.flatnonzero(part == 0.0)
    pauses = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if at.size else []
    k = np.flatnonzero(np.sign(part[:-1]) * np.sign(part[1:]) < 0.0)
    middles = [float((pause[0] + pause[-1]) // 2) for pause in pauses]
    passed = np.sort(np.append(k + part[k] / (part[k] - part[k + 1]), middles))
    if passed.size:
        return float(begin + passed[(passed.size - 1) // 2])
    if near:  # one alone: two are further apart than the tolerance, so that the level is passed between them
        first, last = near[0]
        return float((first + last) // 2)
    return None


def _around(excursions: list[_Excursion], sides: npt.NDArray[np.int64]) -> tuple[int, int]:
    """The sides of the turning points before the first and after the last excursion; 0 without such a point."""
    before, after = sides[: excursions[0].turns.start], sides[excursions[-1].turns.stop :]
    return int(before[before != 0][-1]) if before.any() else 0, int(after[after != 0][0]) if after.any() else 0


def _paired(excursions: list[_Excursion], before: int, after: int) -> list[list[_Excursion]]:
    """One excursion to each side, or one alone whose neighbours lie on its own side.

    `before` and `after` are the sides of the parts of the record ahead of the first excursion and behind the last one.
    """
    sides = [before, *(excursion.side for excursion in excursions), after]
    pairs = []
    k = 0
    while k < len(excursions):
        alternates = k + 1 < len(excursions) and excursions[k + 1].side != excursions[k].side
        pair = excursions[k : k + 2] if alternates else excursions[k : k + 1]
        is_last = k + 1 == len(excursions)
        if not (is_last and -sides[k + 1] in (sides[k], sides[k + 2])):
            pairs.append(pair)
        k += len(pair)
    return pairs


def _cycle(places: FloatArray, plateaus: list[tuple[int, int]], levels: FloatArray, pair: list[_Excursion]) -> Cycle:
    """The branches of a cycle between its largest and its smallest input, in the order of time."""
    begin, end = (int(np.searchsorted(places, place)) for place in (pair[0].begin, pair[-1].end))
    extremes = [max(part.turns, key=lambda turn: part.side * levels[turn]) for part in pair]
    ends, starts = [], []
    for first, last in (plateaus[turn] for turn in extremes):
        ends.append(int(np.searchsorted(places, (first + last) // 2)))
        starts.append(int(np.searchsorted(places, (first + last + 1) // 2)))
    outer = np.append(np.arange(begin, ends[0] + 1), np.arange(starts[-1], end + 1))
    if len(pair) == 2:
        branches = outer, np.arange(starts[0], ends[1] + 1)
    else:
        branches = np.arange(begin, ends[0] + 1), np.arange(starts[0], end + 1)
    loading, unloading = branches if pair[0].side > 0 else branches[::-1]
    return Cycle(loading, unloading, slice(begin, end + 1))
