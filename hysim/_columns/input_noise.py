"""The noise of a measured input, and the path without the reversals that are only noise.

Differences of order k have the variance C(2k, k) sigma^2 where a signal is white noise of standard deviation sigma, and
fall with k where it is smooth. Noise is what the orders 3, 4 and 5 agree upon, by medians, to a third (variate
differences: O. Anderson, Die Korrelationsrechnung in der Konjunkturforschung, 1929); a signal with content at every
frequency passes for none, since more than 5 % of the span is not taken for noise.

The path turns where it retreats by more than five standard deviations of a difference. Between these reversals it is
the monotone path nearest to the samples (isotonic regression), at a turning point no further than their mean there.

**The cycle** with which a record begins may be repeated by its input, whole or cut short.

The path of the input is its turning points. It repeats itself after q of them, an even number, if

1. the turning points behind are those q before, to 5 % of the branch that leads there, as far as the record goes, and
2. the branch after q turning points comes back to the first input.

The least such q is the cycle. A record of 2.5 cycles repeats itself after 1, and one of 1.2 cycles too; where the
record ends one step before its first input, all of it is one cycle. Turning points are those beyond the noise of the
input, so that a measured input has a cycle as well.
"""

import math
from itertools import pairwise

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import NEAR, ROUNDING, TOLERANCE, turns

_ORDERS = (3, 4, 5)
_AGREE = 1.0 / 3.0
_MOST = 0.05  # of the span
_REACH = 5.0 * math.sqrt(2.0)  # of the noise: differences of two samples are larger once in a million
_NORMAL = 1.4826  # standard deviation over the median size, of normal noise
_MOST_IGNORED = 0.4  # of the span: turning points are counted for tolerances below a half
_CORNER = 4.0  # of the noise: samples so near to a turning point are averaged to its level
_MANY = 3.0  # times as many reversals as are above the noise


def input_noise(u: FloatArray, many: float = _MANY) -> float:
    """As `noise_level`; 0 also where noise makes no `many` times as many reversals as the input has above it."""
    noise = noise_level(u)
    if noise == 0.0:
        return 0.0
    inner = len(turns(u, 0.0).plateaus) - 2
    above = len(turns(u, _tolerance(u, noise)).plateaus) - 2
    return noise if inner > many * max(above, 1) else 0.0


def noise_level(u: FloatArray) -> float:
    """Standard deviation of the noise of an input (n,); 0 where it is smooth."""
    span = float(np.ptp(u))
    if u.size < 20 or span == 0.0:
        return 0.0
    levels = []
    for order in _ORDERS:
        typical = _NORMAL * float(np.median(np.abs(np.diff(u, order))))
        levels.append(typical / math.sqrt(math.comb(2 * order, order)))
    noise = levels[1]
    if not 0.0 < noise <= _MOST * span or max(levels) - min(levels) > _AGREE * noise:
        return 0.0
    return noise


def reach(noise: float) -> float:
    """Largest reversal that white noise of this standard deviation makes in a million samples [unit of u]."""
    return _REACH * noise


def _tolerance(u: FloatArray, noise: float) -> float:
    return min(reach(noise) / float(np.ptp(u)), _MOST_IGNORED)


def quiet_path(u: FloatArray, noise: float) -> FloatArray:
    """The input (n,), monotone between its reversals above the `noise`."""
    from scipy.optimize import isotonic_regression

    plateaus = turns(u, _tolerance(u, noise)).plateaus
    corners = [0, *((first + last) // 2 for first, last in plateaus[1:-1]), u.size - 1]
    path = u.copy()
    for begin, end in pairwise(corners):
        rising = bool(u[end] >= u[begin])
        path[begin : end + 1] = isotonic_regression(u[begin : end + 1], increasing=rising).x
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        beside = path[before : after + 1]
        near = np.abs(beside - path[corner]) <= _CORNER * noise
        if u[corner] > u[before]:
            np.minimum(beside, u[before : after + 1][near].mean(), out=beside)
        else:
            np.maximum(beside, u[before : after + 1][near].mean(), out=beside)
    return path


_CLOSING = 2.0  # largest steps of the input, by which a record may end before its first input


def repeated_cycle(u: FloatArray) -> int | None:
    """Number of samples of the cycle with which `u` (n,) begins, or None."""
    span = float(np.ptp(u))
    if span == 0.0:
        return None
    tolerance = max(TOLERANCE, _tolerance(u, input_noise(u)))
    plateaus = turns(u, tolerance).plateaus
    levels = u[[first for first, _ in plateaus]]
    inner = levels[1:-1]
    branches = np.abs(np.diff(levels[:-1]))
    near, rising = NEAR * span, bool(levels[1] > levels[0])
    for q in range(2, len(plateaus), 2):
        if (np.abs(inner[q:] - inner[:-q]) > np.maximum(NEAR * branches[q:], tolerance * span)).any():
            continue
        if (sample := _return(u, plateaus[q][0], _end(plateaus, q), near=near, rising=rising)) is not None:
            return sample
    return None


def _end(plateaus: list[tuple[int, int]], q: int) -> int:
    return plateaus[min(q + 1, len(plateaus) - 1)][1]


def _return(u: FloatArray, begin: int, end: int, *, near: float, rising: bool) -> int | None:
    """Sample from `begin` to `end`, on one branch, at which the input is back at its first value, or would be next."""
    ahead = (u[begin : end + 1] - u[0]) * (1.0 if rising else -1.0)
    rounding = ROUNDING * float(np.ptp(u))
    back = np.flatnonzero(ahead >= -rounding)
    if back.size and (back[0] > 0 or ahead[0] <= rounding):
        return begin + int(back[0])
    closing = _CLOSING * float(np.abs(np.diff(u)).max())
    if end == u.size - 1 and np.abs(ahead).min() <= min(closing, near) and (begin == end or not back.size):
        return u.size
    return begin if ahead[0] > 0.0 and ahead[0] <= near else None  # it turns a little beyond its first value
