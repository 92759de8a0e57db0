"""The law of Jiles and Atherton along a monotone field, in its effective field.

    He = H + alpha (M_irr + w c (M_an - M_irr)),    M = c M_an(He) + (1 - c) M_irr
    dM_irr/dHe = (M_an(He) - M_irr) / (delta k),    zero where (M_an - M_irr) delta < 0,    delta = sgn(dH)

w = 1 is an effective field with the whole magnetisation, w = 0 one with M_irr alone. Let x = He / a, m = M_an / Ms, z =
M_irr / Ms, kappa = k / a and A = alpha Ms / a. In the frame along the field (x, m and z times delta) z stands still
while z > m(x); from there on it follows m as an exponential average,

    z(x) = z0 + int_x0^x (m(s) - z0) exp(-(x - s) / kappa) ds / kappa

Gauss' rule is used on panels so short that its remainder is a rounding. With n points on a panel of half length r it
leaves out less than (64 / 15) r max|f| R^(2 - 2 n) / (1 - R^-2) of an f that is analytic within the ellipse about the
panel of semi-axes r (R + 1/R) / 2 and r (R - 1/R) / 2 (L. N. Trefethen, Approximation Theory and Approximation
Practice, theorem 19.3). 4, 8 and 16 points are used up to R = 400, 19.3 and 4.4, where the ellipse keeps within 0.8 of
the distance of the poles of m from the real axis, and the exponential grows less than 14 times: 4e-17 is left out.

What is known at a sample, H or B, is a sum of x, m and z,

    target = of_x x + of_m m(x) + of_z z(x)

and x is its root, by Newton's method inside a bracket. H is of_x = 1, of_m = -A w c, of_z = -A (1 - w c). Its slope
must be positive along the whole branch, or else the law jumps there; z follows m, so that its slope is never above the
larger of what it is at the beginning and the steepest slope of m ahead, which settles the question for most branches at
once; the others are gone in pieces on which it does. The output of a law that jumps is returned as `inf`.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels._compile import inner, kernel
from hysim.kernels.anhysteretic import curve, field_of

FIELD, SATURATION, COUPLING, PINNING, REVERSIBLE, FEEDBACK, ANISOTROPY, GAIN, FEEDTHROUGH, OFFSET = range(10)
"""Places of the parameters: a, Ms, A, kappa, c, w, p, gain, feedthrough, offset."""

_EPSILON = 2.0**-52
_CLOSE = 1e-8  # of the shorter of a and k: from here on Newton's next place is the last one
_NEARLY = 1e-5  # likewise of the stroke
_ROUNDINGS = 8.0  # of the target: no closer can the root be known
_MAX_NEWTON = 100
_MAX_PIECES = 20_000
_SHORTEST = 1e-9  # piece: where the slope of H is not positive even on such a one, the law jumps
_CERTAIN = 1.0 - 1e-12
_FORGOTTEN = 40.0  # times kappa: what was before has a share below e^-40
_POLE = 0.8 * math.pi  # part of the distance of the poles that an ellipse may take
_FEW, _SOME, _MANY = 4, 8, 16
_FEW_REACH, _SOME_REACH, _MANY_REACH = 1.0 / 200.0, 1.0 / 9.7, 1.0 / 2.09  # half panel, of the distance of the poles
_FEW_DECAY, _SOME_DECAY, _MANY_DECAY = 0.005, 0.25, 2.0  # half panel, of kappa
_AXIS = 2.32  # half length of the ellipse of the largest rule, of that of the panel
_CLEAR = 0.5  # distance from x = 0 from which on the poles, all on the imaginary axis, are out of the ellipse's way
_PLACES, _SHARES = (
    read_only(np.concatenate([np.polynomial.legendre.leggauss(n)[k] for n in (_FEW, _SOME, _MANY)])) for k in (0, 1)
)


Stroke = tuple[float, float, float, float]  # x, its rest, z and m at the end
Weights = tuple[float, float, float]
"""Weights of x, m and z in the sum that a stroke takes to its target."""


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next field `u`; `state` is (last u, M_irr, x, rest), and moves along.

    x = He / a is zero before the first sample, where it is not known yet. It is kept, and not found anew from the last
    u, so that the stretches of x over which z is averaged leave no gaps. The rest is what the rounding of x leaves out:
    where kappa is small, z moves by many of its roundings along it. `parameters` are those named in this module.
    """
    a, Ms = parameters[FIELD], parameters[SATURATION]
    last, z = state[0], state[1] / Ms
    if not abs(z) < math.inf:
        return math.inf
    if state[2] == 0.0:
        state[2], state[3] = first_place(last / a, z, parameters), 0.0
    if u != last:
        delta = 1.0 if u > last else -1.0
        share = parameters[FEEDBACK] * parameters[REVERSIBLE]
        weights = 1.0, -parameters[COUPLING] * share, -parameters[COUPLING] * (1.0 - share)
        x, rest = delta * state[2], delta * state[3]
        x, rest, after, _ = advance(x, rest, delta * z, delta * (u / a), weights, parameters)
        if after != delta * z:
            state[1] = delta * Ms * after
        state[0], state[2], state[3] = u, delta * x, delta * rest
    return output(state, parameters)


@kernel
def resume(parameters: FloatArray, before: FloatArray, state: FloatArray) -> None:
    """Make the state ready for other parameters: M_irr stays, and He is that of the last field."""
    for k in (FIELD, COUPLING, REVERSIBLE, FEEDBACK, ANISOTROPY):
        if parameters[k] != before[k]:
            state[2] = 0.0


@inner
def output(state: FloatArray, parameters: FloatArray) -> float:
    """Output in a state, infinite after a jump."""
    if not abs(state[1]) + abs(state[2]) < math.inf:
        return math.inf
    c = parameters[REVERSIBLE]
    m, _ = curve(state[2], parameters[ANISOTROPY])
    magnetisation = c * parameters[SATURATION] * m + (1.0 - c) * state[1]
    return float(parameters[OFFSET] + parameters[FEEDTHROUGH] * state[0] + parameters[GAIN] * magnetisation)


@inner
def first_place(h: float, z: float, parameters: FloatArray) -> float:
    """x at the first field h = H / a, where M_irr is not moved; nan for a law in which this is not unique."""
    share, coupling, p = parameters[FEEDBACK] * parameters[REVERSIBLE], parameters[COUPLING], parameters[ANISOTROPY]
    if coupling == 0.0:
        return h
    if not coupling * share * curve(0.0, p)[1] < 1.0:
        return math.nan
    target, reach = h + coupling * (1.0 - share) * z, abs(coupling * share)
    return reversible(target - reach, target + reach, target, 1.0, -coupling * share, p)


@inner
def reversible(low: float, high: float, target: float, of_x: float, of_m: float, p: float) -> float:
    """The x from `low` to `high` with of_x x + of_m m(x) = `target`, a sum that rises with x."""
    if of_x == 0.0 and not target < of_m:
        return math.nan
    x = low
    if high < math.inf and of_x > 0.0:
        x = min(max(target / of_x, low), high)
    for i in range(_MAX_NEWTON):
        m, slope = curve(x, p)
        error = target - of_x * x - of_m * m
        low, high = (x, high) if error > 0.0 else (low, x)
        rise = of_x + of_m * slope
        trial = x + error / rise if rise > 0.0 else math.nan
        if not low <= trial <= high or (i % 8 == 7 and high < math.inf):
            trial = 0.5 * (low + high) if high < math.inf else 2.0 * abs(x) + 1.0
        noise = 2.0 * _EPSILON * (abs(of_x * x) + abs(of_m * m) + abs(target))
        if abs(trial - x) <= 2.0 * _EPSILON * abs(x) or abs(error) <= noise:
            return x + error / rise if rise > 0.0 else x
        x = trial
    return x


@inner
def advance(x: float, rest: float, z: float, target: float, weights: Weights, parameters: FloatArray) -> Stroke:
    """x, its rest, z and m at the first place ahead with of_x x + of_m m + of_z z = `target`; nan without one."""
    of_x, of_m, of_z = weights
    p, kappa = parameters[ANISOTROPY], parameters[PINNING]
    m, slope = curve(x, p)
    if z > m:
        end = max(x, field_of(z, p))
        at_end = of_x * end + (of_m + of_z) * z
        if end == math.inf or at_end >= target:
            x = reversible(x, end, target - of_z * z, of_x, of_m, p)
            return x, 0.0, z, curve(x, p)[0]
        x, m = end, z
        slope = curve(x, p)[1]
    else:
        z -= rest * (m - z) / kappa  # from where x was to its rounding
    if of_x == 0.0 and not target < of_m + of_z:
        return math.nan, math.nan, math.nan, math.nan
    steepest = curve(0.0, p)[1] if x < 0.0 else slope
    if is_steady(m - z, steepest, steepest, parameters):
        return solve(x, z, m, slope, math.inf, target, weights, parameters)
    length = 0.5
    for _ in range(_MAX_PIECES):
        length = steady_length(x, m - z, slope, length, parameters)
        if length == 0.0:
            break
        end = x + length
        z_end = averaged(x, z, length, parameters)
        m_end, slope_end = curve(end, p)
        if of_x * end + of_m * m_end + of_z * z_end >= target:
            return solve(x, z, m, slope, end, target, weights, parameters)
        x, z, m, slope = end, z_end, m_end, slope_end
        length = min(2.0 * length, max(1.0, kappa))
    return math.nan, math.nan, math.nan, math.nan


@inner
def is_steady(gap: float, slope: float, steepest: float, parameters: FloatArray) -> bool:
    """Whether H rises with x where z' is between gap / kappa and `slope`, and m' is at most `steepest`."""
    share = parameters[FEEDBACK] * parameters[REVERSIBLE]
    of_z = max(gap / parameters[PINNING], slope)
    return bool(parameters[COUPLING] * (share * steepest + (1.0 - share) * of_z) < _CERTAIN)


@inner
def steady_length(x: float, gap: float, slope: float, length: float, parameters: FloatArray) -> float:
    """A length, no more than the one given, on which H is sure to rise; 0 without such a length."""
    kappa, p = parameters[PINNING], parameters[ANISOTROPY]
    while length > _SHORTEST:
        end = x + length
        steepest = slope
        if x < 0.0:
            steepest = curve(min(end, 0.0), p)[1]
        ahead = gap / kappa
        ahead += max(0.0, steepest - ahead) * -math.expm1(-length / kappa)
        if is_steady(gap, ahead, steepest, parameters):
            return length
        length *= 0.5
    return 0.0


@inner
def solve(
    x: float, z: float, m: float, slope: float, end: float, target: float, weights: Weights, parameters: FloatArray
) -> Stroke:
    """As `advance`, for a place up to `end` on a branch along which z follows m, and the sum rises."""
    of_x, of_m, of_z = weights
    kappa, p = parameters[PINNING], parameters[ANISOTROPY]
    low, z_low, high = x, z, end
    rise = of_x + of_m * slope + of_z * (m - z) / kappa
    error = target - of_x * x - of_m * m - of_z * z
    trial = predicted(x, (m - z) / kappa, error, rise, slope, weights, parameters)
    if not error > 0.0 or trial == x:  # the place is within a rounding of x
        left = error / rise if rise > 0.0 else 0.0
        start, rest = landed(x, left)
        return start, rest, z + left * (m - z) / kappa, m
    start = x
    for i in range(_MAX_NEWTON):
        if not low < trial < high or (i % 3 == 2 and high < math.inf):  # else it might go from side to side
            trial = 0.5 * (low + high) if high < math.inf else low + 2.0 * (x - low) + kappa
        moved = trial - x
        if abs(moved) <= min(_FEW_DECAY * kappa, 2.0 * _FEW_REACH):
            z = averaged(x, z, moved, parameters)
        else:
            z = averaged(low, z_low, trial - low, parameters)
        x = trial
        m, slope = curve(x, p)
        steepness = (m - z) / kappa
        error = target - of_x * x - of_m * m - of_z * z
        rise = of_x + of_m * slope + of_z * steepness
        terms = abs(of_x * x) + abs(of_m * m) + abs(of_z * z)
        left = error / rise if rise > 0.0 else math.nan
        close = max(min(_CLOSE * min(1.0, kappa), _NEARLY * abs(x - start)), 2.0 * _EPSILON * abs(x))
        if abs(left) <= max(close, _ROUNDINGS * _EPSILON * terms / rise):
            z += left * (steepness + 0.5 * left * (slope - steepness) / kappa)
            m += left * slope
            x, rest = landed(x, left)
            return x, rest, z, m
        if error > 0.0:
            low, z_low = x, z
        else:
            high = x
        trial = x + left
    return x, 0.0, z, m


@inner
def landed(x: float, left: float) -> tuple[float, float]:
    """x + left, and what its rounding leaves out."""
    end = x + left
    return end, left - (end - x)


@inner
def predicted(
    x: float, steepness: float, error: float, rise: float, slope: float, weights: Weights, parameters: FloatArray
) -> float:
    """The place to look first: by the slopes in the middle of a step of Newton's rule from the beginning."""
    of_x, of_m, of_z = weights
    half = 0.5 * error / rise if rise > 0.0 else math.nan
    if not half < _FORGOTTEN:
        return math.nan
    in_middle = curve(x + half, parameters[ANISOTROPY])[1]
    steepness += (0.5 * (slope + in_middle) - steepness) * -math.expm1(-half / parameters[PINNING])
    rise = of_x + of_m * in_middle + of_z * steepness
    return x + error / rise if rise > 0.0 else math.nan


@inner
def averaged(x: float, z: float, length: float, parameters: FloatArray) -> float:
    """z after `length` from x, which may be negative if it is short."""
    kappa, p = parameters[PINNING], parameters[ANISOTROPY]
    if length > _FORGOTTEN * kappa:
        x += length - _FORGOTTEN * kappa
        length = _FORGOTTEN * kappa
        z = curve(x, p)[0]
    poles = _POLE if p <= 0.0 else 0.5 * _POLE
    while length != 0.0:
        half = 0.5 * length
        size = abs(half)
        first, points = _FEW + _SOME, _MANY
        if size <= _FEW_REACH * poles and size <= _FEW_DECAY * kappa:
            first, points = 0, _FEW
        elif size <= _SOME_REACH * poles and size <= _SOME_DECAY * kappa:
            first, points = _FEW, _SOME
        else:
            reach = _MANY_REACH * poles
            if p == 0.0 and x > 0.0:
                reach = max(reach, (x - _CLEAR) / (_AXIS - 1.0))
            elif p == 0.0:
                reach = max(reach, (-x - _CLEAR) / (_AXIS + 1.0))
            half = min(half, reach, _MANY_DECAY * kappa)
        z += panel(x, z, half, first, points, parameters)
        x += 2.0 * half
        length = 0.0 if size <= abs(half) else length - 2.0 * half
    return z


@inner
def panel(x: float, z: float, half: float, first: int, points: int, parameters: FloatArray) -> float:
    """Change of z over a panel of a half length, by the rule that begins at the place `first` of the tables."""
    decay, p = half / parameters[PINNING], parameters[ANISOTROPY]
    total = 0.0
    for j in range(points):
        place = _PLACES[first + j]
        m = curve(x + half * (1.0 + place), p)[0]
        total += _SHARES[first + j] * (m - z) * math.exp(-decay * (1.0 - place))
    return float(decay * total)
