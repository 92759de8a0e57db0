"""One more step of each iteration to a root: what the forward mode differentiates in place of the iteration.

Each function takes the results of the iteration, and then its arguments. The results come back unchanged to rounding,
as functions of the arguments whose derivatives are those of the root.
"""

import math

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim.kernels.baber_noori_series import bell_within
from hysim.kernels.charts import power_flow
from hysim.kernels.duhem import place
from hysim.kernels.magnetics import chan
from hysim.kernels.magnetics.anhysteretic import curve
from hysim.kernels.magnetics.jiles_atherton import ANISOTROPY, PINNING, averaged
from hysim.kernels.remainder import N_TERMS
from hysim.kernels.zhu_wang import linear_ramp, moment

_SHORT = 0.125  # of the forcing: its change on a short way
_POINTS = 20  # of a rule on a panel as long as its distance from zero: what is left out is below a rounding
_PLACES, _SHARES = (read_only(values) for values in np.polynomial.legendre.leggauss(_POINTS))


def degenerate(
    change: float, left: float, end: float, w: float, a: float, c: float, n: float, length: float
) -> tuple[float, float, float]:
    """A flow on w' = a - c w^n where one of the terms has vanished, to first order in that term."""
    if a == 0.0 or (c != 0.0 and abs(a) < abs(c)):
        after = power_flow(w, c, n, length)
        if w == 0.0:
            return a * length, 0.0, a * length
        slope = (after ** (1.0 - n) - w ** (1.0 - 2.0 * n) * after**n) / (c * (2.0 * n - 1.0)) if c != 0.0 else length
        return after - w + a * slope, 0.0, after + a * slope
    if a < 0.0 and w + a * length < 0.0:
        return -w, length + w / a + c * w ** (n + 1.0) / (a * a * (n + 1.0)), 0.0
    straight = w + a * length
    bent = c * (straight ** (n + 1.0) - w ** (n + 1.0)) / (a * (n + 1.0))
    return a * length - bent, 0.0, straight - bent


def ends(local: FloatArray, last: int, h: float, size: float, powers: FloatArray) -> bool:
    """Whether a series may end before its last term; its rate may need the others."""
    return False


def worn_ends(
    k: int, t: float, size: float, free: bool, pinches: bool, parameters: FloatArray, series: FloatArray
) -> bool:
    """As `ends`, for a law that wears off."""
    return False


def pinch_within(rw: float, re: float, parameters: FloatArray, series: FloatArray) -> float:
    """Bound for a bell of depth one at least: that of none has a rate, too."""
    return bell_within(rw, re, 1.0, parameters, series)


def is_last(k: int, tail: float, room: float) -> bool:
    """As `ends`, for a series that says so of each term."""
    return k == N_TERMS - 1


def series_zero(x: float, powers: FloatArray, last: int, end: float) -> float:
    """The place of the zero of a series."""
    value, slope = place(powers, last, x)
    return x - value / slope if slope != 0.0 else x


def ramp_zero(x: float, w: float, a: float, d: float, c: float, low: float, high: float) -> float:
    """The length to w = 0 on a linear decay under a ramp."""
    value = linear_ramp(w, a, d, c, x)
    slope = a + d * x - c * value
    return x - value / slope if slope != 0.0 else x


def take_off(
    h: float, w: float, a: float, d: float, c: float, n: float, negligible: float, left: float
) -> tuple[float, float]:
    """A way from w = 0 and the value there, with the decay that is negligible beside it."""
    way = left if h >= left else h
    if w == 0.0:
        return way, 0.0
    return way, way * (a + 0.5 * d * way) - c * decay_from_zero(a, d, n, way)


def decay_from_zero(a: float, d: float, n: float, length: float) -> float:
    """Integral of (a L + d L^2 / 2)^n from 0 to `length`: as for a short way, and then by panels twice as long each."""
    if a <= 0.0:
        return (0.5 * d) ** n * length ** (2.0 * n + 1.0) / (2.0 * n + 1.0) if d > 0.0 else 0.0
    end = length
    while 0.5 * abs(d) * end > _SHORT * a:
        end *= 0.5
    total = moment(a, d, n, end)
    while end < length:
        half = 0.5 * end
        for j in range(_POINTS):
            at = end + half * (1.0 + _PLACES[j])
            total += half * _SHARES[j] * (at * (a + 0.5 * d * at)) ** n
        end *= 2.0
    return total


def arrival(t: float, u: float, rate: float, x: float, time: float, side: float, begin: float, end: float) -> float:
    """The moment at which a side of a gap is reached."""
    carried = x * math.exp(-t / time)
    slope = rate + carried / time
    return t - (u + rate * t - carried - side) / slope if slope != 0.0 else t


def excess_inside(excess: float, parameters: FloatArray, side: float, z: float, u: float) -> float:
    """The field in a core behind an air gap, between the branches: its size over the coercivity."""
    gap, coercivity, knee = parameters[3], parameters[4], parameters[5]
    stiffness, drop = 1.0 + gap * parameters[2], gap * parameters[1]
    near, far = abs(excess) + knee, excess + 2.0 * coercivity + knee
    shares = (0.5 - 0.5 * side * z) / (near * near) + (0.5 + 0.5 * side * z) / (far * far)
    left = stiffness * (coercivity + excess) + side * drop * chan.inside(side, excess, z, coercivity, knee) - side * u
    return float(excess - left / (stiffness + drop * knee * shares))


def field_of(x: float, m: float, p: float) -> float:
    """The x of an anhysteretic curve at m."""
    if not abs(x) < math.inf:
        return x
    value, slope = curve(x, p)
    return x + (m - value) / slope if slope > 0.0 else x


def reversible(x: float, low: float, high: float, target: float, of_x: float, of_m: float, p: float) -> float:
    """The effective field at which the magnetisation does not move irreversibly."""
    m, slope = curve(x, p)
    rise = of_x + of_m * slope
    return x + (target - of_x * x - of_m * m) / rise if rise > 0.0 else x


def solve(
    x: float,
    rest: float,
    after: float,
    m: float,
    begin: float,
    z: float,
    before: float,
    slope: float,
    end: float,
    target: float,
    of_x: float,
    of_m: float,
    of_z: float,
    parameters: FloatArray,
) -> tuple[float, float, float, float]:
    """The effective field on a branch of Jiles and Atherton, its rest, and both parts of the magnetisation there."""
    moved = averaged(begin, z, x - begin, parameters)
    here, steep = curve(x, parameters[ANISOTROPY])
    climb = (here - moved) / parameters[PINNING]
    rise = of_x + of_m * steep + of_z * climb
    left = (target - of_x * x - of_m * here - of_z * moved) / rise if rise > 0.0 else 0.0
    return x + left, rest, moved + left * climb, here + left * steep
