"""The Bouc-Wen law of Zhu and Wang with n = 1 along a monotone input, in closed form.

    dz/du = A - |z| (gamma + beta sgn(z du)) + delta u sgn(du)

With s the input's direction, L the length travelled from u_0, w = |z| and e = sgn(s z) on one side of z = 0, this is

    dw/dL = a + d L - c w,    a = e (A + s delta u_0),    d = e delta,    c = beta + e gamma

a forcing that is linear in L and drives one decay, so that

    w + (a - c w) E_1 + d E_2,    E_1 = (1 - exp(-c L)) / c,    E_2 = (L - E_1) / c

with a power series for each near c L = 0. w has one extremum at most, at a length that is closed too. The first w = 0
is found by Newton's rule in a bracket. A law that diverges is returned as `inf`.
"""

import math

from hysim._basics.frozen import read_only
from hysim.kernels._compile import inner
from hysim.kernels.elementary import N_TERMS, linear_flow, sum16

_RAMP = read_only([(-1.0) ** k / math.factorial(k + 2) for k in range(N_TERMS)])  # of (x - 1 + exp(-x)) / x^2
_RAMP_REACH = 0.75  # the terms left out are below 1e-18 here
_LARGEST_EXPONENT = 709.0
_ROUNDING = 2.0**-53
_TINY = 2.0**-1000  # next to zero, z left it elsewhere
_MAX_NEWTON = 1000  # more than the largest exponent: down a growing exponential, Newton's rule goes 1/|c| at a time
_MAX_SIDES = 8  # the forcing changes its sign once, so that there are no more than two zeros of z


@inner
def ramp(A: float, beta: float, gamma: float, delta: float, z: float, u: float, du: float) -> float:
    """Memory after the input has moved from `u` by `du`, from one zero of z to the next."""
    direction = 1.0 if du > 0.0 else -1.0
    a, w, length = A + direction * delta * u, direction * z, abs(du)
    begin, stands = 0.0, False
    if abs(w) < _TINY and a != 0.0:
        begin, w = -w / a + 0.0, 0.0
    for _ in range(_MAX_SIDES):
        left, forcing = length - begin, a + delta * begin
        if stands:  # z left zero and came back within the rounding of the length: the forcing changes its sign here
            forcing = 0.0
        if w != 0.0:
            side = 1.0 if w > 0.0 else -1.0
        else:
            side = 1.0 if forcing > 0.0 or (forcing == 0.0 and delta > 0.0) else -1.0
        w, travelled = linear_side(abs(w), side * forcing, side * delta, beta + side * gamma, left)
        if w != 0.0 or travelled >= left:
            return direction * side * w
        stands = begin + travelled == begin
        begin += travelled
    return math.nan


@inner
def linear_side(w: float, a: float, d: float, c: float, length: float) -> tuple[float, float]:
    """Value after `length` and `length`, or 0 and the length to the first w = 0 on the way."""
    after = linear_ramp(w, a, d, c, length)
    slope = a - c * w
    falls = slope < 0.0 or (slope == 0.0 and d < 0.0)
    low, high = 0.0, length
    if falls and a + d * length > c * after:
        high = min(length, linear_turn(slope, d, c))
    elif not falls and after < 0.0:
        low = min(length, linear_turn(slope, d, c))
    if not linear_ramp(w, a, d, c, high) < 0.0:
        return after, length
    return 0.0, ramp_zero(w, a, d, c, low, high)


@inner
def newton(low: float, high: float, x: float, value: float, slope: float) -> float:
    """The next place to look for the zero of a falling function: by Newton's rule if it stays in the bracket."""
    trial = x - value / slope if slope < 0.0 else math.nan
    return trial if low < trial < high else 0.5 * (low + high)


@inner
def ramp_zero(w: float, a: float, d: float, c: float, low: float, high: float) -> float:
    """Length between `low` and `high` at which w' = a + d L - c w has fallen to w = 0."""
    x = high
    for _ in range(_MAX_NEWTON):
        value = linear_ramp(w, a, d, c, x)
        low, high = (x, high) if value >= 0.0 else (low, x)
        trial = newton(low, high, x, value, a + d * x - c * value)
        if value == 0.0 or abs(trial - x) <= _ROUNDING * x:
            break
        x = trial
    return x


@inner
def linear_ramp(w: float, a: float, d: float, c: float, length: float) -> float:
    """Value after `length` on w' = a + d L - c w, whatever the sign of w."""
    x = c * length
    if x < -_LARGEST_EXPONENT:
        growth = (a - c * w) - d / c
        return math.copysign(math.inf, growth) if growth != 0.0 else w + d / c * length
    decayed = linear_flow(w, a, c, length)
    if abs(x) <= _RAMP_REACH:
        return decayed + d * (length * length * sum16(_RAMP, 0, x))
    return decayed + d * ((length + math.expm1(-x) / c) / c)


@inner
def linear_turn(slope: float, d: float, c: float) -> float:
    """Length at which w' = a + d L - c w is zero, from w' = `slope` at L = 0 on."""
    x = -c * slope / d
    return -slope / d * (1.0 - 0.5 * x) if abs(x) < _ROUNDING else math.log1p(x) / c
