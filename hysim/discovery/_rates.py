"""At how many rates records show their input: what tells hysteresis from a lag, and where a record changes its rate."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._cycles import TOLERANCE, complete_cycles
from hysim._frozen import FloatArray
from hysim.records import Record

SEVERAL = 1.5
"""Rates whose ratio is smaller count as one."""

_EDGES = np.linspace(0.05, 0.95, 10)  # of the bands, in spans of the input
_TAILS = (0.05, 0.95)

Samples = npt.NDArray[np.intp]


def rate_spread(records: Sequence[Record]) -> float:
    """How much the input's rate differs between passes at the same input; 1 for one rate, nan without time.

    The input's range, all records together, has nine equal bands between 5 and 95 % of it. A branch that crosses a
    band whole has there the rate band over time of crossing, a stop at an edge being divided in its middle. In each
    band the 95th percentile of the rates is divided by the 5th, where every record has the same weight however many
    passes it has. The median over the bands that are crossed more than once is taken; where two records cross the same
    bands, only over these, since the others do not compare the records. So a sine that slows down
    before it turns, always at the same place, has one rate, and so has a triangle of any amplitude; sines of two
    amplitudes, or of a decaying one, have several.
    """
    if any(record.t is None for record in records):
        return math.nan
    low, high = min(record.u.min() for record in records), max(record.u.max() for record in records)
    crossed = [_crossings(record, low + (high - low) * _EDGES) for record in records]
    bands = list(zip(*crossed, strict=True))
    shared = [band for band in bands if sum(map(bool, band)) > 1]
    ratios = [ratio for band in shared or bands if (ratio := _ratio(band)) is not None]
    return float(np.median(ratios)) if ratios else math.nan


def at_one_rate(record: Record) -> list[Samples]:
    """The stretches of a record whose cycles have one rate, one after the other; the whole where that is one."""
    everything = np.arange(len(record))
    if record.t is None:
        return [everything]
    begins, rate = [], 0.0
    for cycle in reversed(complete_cycles(record.u, TOLERANCE)):
        here = 1.0 / float(np.ptp(record.t[cycle.path]))
        if rate == 0.0 or not 1.0 / SEVERAL < here / rate < SEVERAL:
            begins.append(cycle.path.start)
            rate = here
    return np.split(everything, begins[1:])


def _crossings(record: Record, edges: FloatArray) -> list[list[float]]:
    """Rates of the passes of one record through each band."""
    found: list[list[float]] = [[] for _ in itertools.pairwise(edges)]
    for branch in record.branches(TOLERANCE):
        sign = 1.0 if branch.u[-1] > branch.u[0] else -1.0
        reached, first, count = np.unique(np.maximum.accumulate(sign * branch.u), return_index=True, return_counts=True)
        t = np.asarray(branch.t, dtype=float)
        times = 0.5 * (t[first] + t[first + count - 1])
        at_edges = np.interp(sign * edges, reached, times, left=math.nan, right=math.nan)
        for rates, height, duration in zip(found, np.diff(edges), np.abs(np.diff(at_edges)), strict=True):
            if duration > 0.0:
                rates.append(float(height / duration))
    return found


def _ratio(band: Sequence[list[float]]) -> float | None:
    """High over low rate of a band's passes, a list for each record; None for fewer than two passes."""
    rates = np.concatenate(band)
    if rates.size < 2:
        return None
    shares = np.concatenate([np.full(len(passes), 1.0 / max(len(passes), 1)) for passes in band])
    slow, fast = np.quantile(rates, _TAILS, weights=shares, method="inverted_cdf")
    return float(fast / slow)
