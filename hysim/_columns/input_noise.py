"""The noise of a measured input, and the path without the reversals that are only noise.

Differences of order k have the variance C(2k, k) sigma^2 where a signal is white noise of standard deviation sigma, and
fall with k where it is smooth. Noise is what the orders 3, 4 and 5 agree upon, by medians, to a third (variate
differences: O. Anderson, Die Korrelationsrechnung in der Konjunkturforschung, 1929); a signal with content at every
frequency passes for none, since more than 5 % of the span is not taken for noise.

The path turns where it retreats by more than five standard deviations of a difference. Between these reversals it is
the monotone path nearest to the samples (isotonic regression), at a turning point no further than their mean there.
"""

import math
from itertools import pairwise

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import turns

_ORDERS = (3, 4, 5)
_AGREE = 1.0 / 3.0
_MOST = 0.05  # of the span
_REACH = 5.0 * math.sqrt(2.0)  # of the noise: differences of two samples are larger once in a million
_NORMAL = 1.4826  # standard deviation over the median size, of normal noise
MOST_IGNORED = 0.4  # of the span: turning points are counted for tolerances below a half
_CORNER = 4.0  # of the noise: samples so near to a turning point are averaged to its level
_MANY = 3.0  # times as many reversals as are above the noise


def input_noise(u: FloatArray, many: float = _MANY) -> float:
    """As `noise_level`; 0 also where noise makes no `many` times as many reversals as the input has above it."""
    noise = noise_level(u)
    if noise == 0.0:
        return 0.0
    inner = len(turns(u, 0.0).plateaus) - 2
    above = len(turns(u, min(reach(noise) / float(np.ptp(u)), MOST_IGNORED)).plateaus) - 2
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


def quiet_path(u: FloatArray, noise: float) -> FloatArray:
    """The input (n,), monotone between its reversals above the `noise`."""
    from scipy.optimize import isotonic_regression

    plateaus = turns(u, min(reach(noise) / float(np.ptp(u)), MOST_IGNORED)).plateaus
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
