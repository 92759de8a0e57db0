"""The Bouc-Wen law along a monotone input, where it is elementary: n = 1 and n = 2.

In the frame that points along the input (H = z sign(du), L = |du|) each side of H = 0 obeys

    n = 1    H' = A - k H,      H + (A - k H) T,                     T = (1 - exp(-k L)) / k
    n = 2    H' = A - k H^2,    H + (A - k H^2) T / (1 + k H T),     T = tanh(r L) / r,  r^2 = A k

(tan for A k < 0). T does not depend on H, so that the samples of a path wait for each other for a few
operations only. Near L = 0 it is a power series, elsewhere one exponential; both are good to 2e-16.
Where H changes its sign, the rest of the way is gone from H = 0 with the other k. An escape is `inf`.
"""

import math
from fractions import Fraction

from hysim._frozen import read_only
from hysim.kernels._compile import inlined, inner
from hysim.kernels.polynomials import N_TERMS, sum16


def _tangent_series() -> list[float]:
    """Coefficients of tanh(sqrt(y)) / sqrt(y) in powers of y, from T' = 1 - T^2."""
    c = [Fraction(1)]
    for k in range(1, N_TERMS):
        c.append(-sum((c[j] * c[k - 1 - j] for j in range(k)), Fraction(0)) / (2 * k + 1))
    return [float(value) for value in c]


_DECAY = read_only([(-1.0) ** k / math.factorial(k + 1) for k in range(N_TERMS)])  # of (1 - exp(-x)) / x
_TANGENT = read_only(_tangent_series())
DECAY_REACH = 0.75  # the terms left out are below 3e-17 here
_TANGENT_REACH = 0.2  # and below 5e-18 here
_LARGEST_EXPONENT = 709.0
_SMALL = 2.0**-54
_FAR = 4.0  # times the balance, or more: from there on a decay is not taken as a change


@inlined
def power(w: float, n: float) -> float:
    """|w|^n, and its analytic continuation to w < 0 where n is 1 or 2."""
    if n == 1.0:
        return w
    if n == 2.0:
        return w * w
    return float(abs(w) ** n)


@inlined
def linear_advance(z: float, du: float, A: float, loading: float, unloading: float) -> float:
    """Memory of n = 1 after the input has moved by `du`; `loading` is beta + gamma, `unloading` beta - gamma."""
    length = abs(du)
    along = z if du > 0.0 else -z
    is_loading = along > 0.0 or (along == 0.0 and A > 0.0)
    k = loading if is_loading else unloading
    after = linear_flow(along, A, k, length)
    if (along > 0.0 and after < 0.0) or (along < 0.0 and after > 0.0):
        left = max(0.0, length - linear_travel(along, A, k))
        after = linear_flow(0.0, A, unloading if is_loading else loading, left)
    return after if du > 0.0 else -after


@inner
def linear_flow(along: float, A: float, k: float, length: float) -> float:
    """Value after `length` on H' = A - k H."""
    x = k * length
    if abs(x) <= DECAY_REACH:
        return along * math.exp(-x) if A == 0.0 else short_flow(along, A, k, length)
    return long_flow(along, A, k, x)


@inner
def long_flow(along: float, A: float, k: float, x: float) -> float:
    """As `linear_flow`, for |x| = |k| length from DECAY_REACH on."""
    slope = A - k * along
    if x < -_LARGEST_EXPONENT:
        return along if slope == 0.0 else math.copysign(math.inf, slope)
    decay = math.exp(-x)
    if A == 0.0:
        return along * decay
    travelled = (1.0 - decay) / k
    if x > 0.0 and abs(slope) > _FAR * abs(A):  # a sum of sizes: the one below might be rounded past a small balance
        return along * decay + A * travelled
    return along + slope * travelled


@inlined
def short_flow(along: float, A: float, k: float, length: float) -> float:
    """As `linear_flow`, for |k| length up to DECAY_REACH and A other than 0."""
    return along + (A - k * along) * (length * sum16(_DECAY, 0, k * length))


@inlined
def linear_travel(along: float, A: float, k: float) -> float:
    """Length from H to 0 on H' = A - k H; H beyond A/k does not get there, unless by rounding."""
    x = k * along / A
    if abs(x) < _SMALL:
        return -along / A
    return math.log1p(-x) / k if x < 1.0 else math.inf


@inlined
def quadratic_advance(z: float, du: float, A: float, loading: float, unloading: float) -> float:
    """Memory of n = 2 after the input has moved by `du`, as `linear_advance`."""
    length = abs(du)
    along = z if du > 0.0 else -z
    is_loading = along > 0.0 or (along == 0.0 and A > 0.0)
    k = loading if is_loading else -unloading
    tangent = quadratic_tangent(A, k, length)
    after = quadratic_flow(along, A, k, tangent)
    if (along < 0.0 and tangent * A >= -along) or (along > 0.0 and tangent * A <= -along):
        left = length - quadratic_travel(along, A, k)
        if left >= 0.0:  # not so at a saturation, where T = -H/A may hold to rounding
            after = A * quadratic_tangent(A, -unloading if is_loading else loading, left)
    return after if du > 0.0 else -after


@inner
def quadratic_tangent(A: float, k: float, length: float) -> float:
    """tanh(r L) / r, or tan(r L) / r, which is `inf` from its pole on."""
    y = A * k * length * length
    if abs(y) <= _TANGENT_REACH:
        return length * sum16(_TANGENT, 0, y)
    r = math.sqrt(abs(A * k))
    x = r * length
    if y > 0.0:
        decay = math.exp(-2.0 * x)
        return (1.0 - decay) / ((1.0 + decay) * r)
    return math.tan(x) / r if x < 0.5 * math.pi else math.inf


@inlined
def quadratic_flow(along: float, A: float, k: float, tangent: float) -> float:
    """Value on H' = A - k H^2 where T is `tangent`, on this side of H = 0."""
    slope = A - k * along * along
    if slope == 0.0:
        return along
    if tangent == math.inf:
        return math.copysign(math.inf, slope)
    denominator = 1.0 + k * along * tangent
    if denominator <= 0.0:
        return math.copysign(math.inf, slope)
    if denominator > _FAR:  # as in `linear_flow`
        return (along + A * tangent) / denominator
    return along + slope * tangent / denominator


@inlined
def quadratic_travel(along: float, A: float, k: float) -> float:
    """Length from H to 0 on H' = A - k H^2, the one at which T is -H/A."""
    tangent = -along / A
    r = math.sqrt(abs(A * k))
    q = r * tangent
    if q < 1.0e-9:
        return tangent
    if A * k < 0.0:
        return math.atan(q) / r
    return math.atanh(q) / r if q < 1.0 else math.inf
