"""The Bouc-Wen law along a monotone input, where it is elementary: n = 1 and n = 2.

In the frame that points along the input (H = z sign(du), L = |du|) each side of H = 0 obeys

    n = 1    H' = A - k H,      H + (A - k H) T,                     T = (1 - exp(-k L)) / k
    n = 2    H' = A - k H^2,    H + (A - k H^2) T / (1 + k H T),     T = tanh(r L) / r,  r^2 = A k

(tan for A k < 0). T does not depend on H, so that the samples of a path wait for each other for a few
operations only. Near L = 0 it is a power series, elsewhere one exponential; both are good to 2e-16.
Where H changes its sign, the rest of the way is gone from H = 0 with the other k. A memory that diverges is `inf`.

The polynomials of 16 terms that the closed forms and the series of other laws take are summed by a tree of 9
dependent operations, where Horner's rule is a chain of 30.

Many laws of n = 1 on one input all go the same way by the same length. The short flow is then straight arithmetic,
the same for every law, of which a processor does several at once. The few laws for which it does not hold are stepped
again, one by one: those with A = 0, those whose way is too long for the series, and those that cross z = 0. The
operations are those of a single path in the same order, and so are the bits.
"""

import math
from fractions import Fraction

from numba import float64, int64, types

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels._compile import inlined, inlined_kernel, inner, signed_inlined

N_TERMS = 16
_COEFFICIENTS = types.Array(float64, 1, "C", readonly=True)
_NOT_NEGATIVE = 0xFFFF  # says to the compiler that no index counts from the end: a third of the time otherwise


@signed_inlined(float64(_COEFFICIENTS, int64, float64))
def sum16(c: FloatArray, first: int, x: float) -> float:
    """The polynomial with the coefficients ``c[first : first + 16]``."""
    k = first & _NOT_NEGATIVE
    x2 = x * x
    x4 = x2 * x2
    a = (c[k] + c[k + 1] * x) + (c[k + 2] + c[k + 3] * x) * x2
    b = (c[k + 4] + c[k + 5] * x) + (c[k + 6] + c[k + 7] * x) * x2
    d = (c[k + 8] + c[k + 9] * x) + (c[k + 10] + c[k + 11] * x) * x2
    e = (c[k + 12] + c[k + 13] * x) + (c[k + 14] + c[k + 15] * x) * x2
    return float((a + b * x4) + (d + e * x4) * (x4 * x4))


@signed_inlined(float64(_COEFFICIENTS, int64, float64))
def sum8(c: FloatArray, first: int, x: float) -> float:
    """The polynomial of eight terms with the coefficients ``c[first : first + 8]``."""
    k = first & _NOT_NEGATIVE
    x2 = x * x
    a = (c[k] + c[k + 1] * x) + (c[k + 2] + c[k + 3] * x) * x2
    b = (c[k + 4] + c[k + 5] * x) + (c[k + 6] + c[k + 7] * x) * x2
    return float(a + b * (x2 * x2))


def riccati_series(m: int) -> list[float]:
    """Coefficients of T(x) / x in powers of x^2, from T' = 1 - T^2 - (m - 1) T / x."""
    c = [Fraction(1, m)]
    for k in range(1, N_TERMS):
        c.append(-sum((c[j] * c[k - 1 - j] for j in range(k)), Fraction(0)) / (2 * k + m))
    return [float(value) for value in c]


_DECAY = read_only([(-1.0) ** k / math.factorial(k + 1) for k in range(N_TERMS)])  # of (1 - exp(-x)) / x
_TANGENT = read_only(riccati_series(1))  # of tanh(sqrt(y)) / sqrt(y)
DECAY_REACH = 0.75  # the terms left out are below 3e-17 here
TANGENT_REACH = 0.2  # and below 5e-18 here
_LARGEST_EXPONENT = 709.0
_SMALL = 2.0**-54
_FAR = 4.0  # times the balance, or more: from there on a decay is not taken as a change


@inlined_kernel
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
        return -along / A * (1.0 + 0.5 * x)  # the second term is for derivatives, here and below
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
    if abs(y) <= TANGENT_REACH:
        return short_tangent(y, length)
    r = math.sqrt(abs(A * k))
    x = r * length
    if y > 0.0:
        decay = math.exp(-2.0 * x)
        return (1.0 - decay) / ((1.0 + decay) * r)
    return math.tan(x) / r if x < 0.5 * math.pi else math.inf


@inlined
def short_tangent(y: float, length: float) -> float:
    """As `quadratic_tangent`, for ``|y| = |A k| length^2`` up to TANGENT_REACH."""
    return length * sum16(_TANGENT, 0, y)


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
        return tangent * (1.0 + A * k * tangent * tangent / 3.0)
    if A * k < 0.0:
        return math.atan(q) / r
    return math.atanh(q) / r if q < 1.0 else math.inf


# ---------------------------------------------------------------------------------- many laws of n = 1 on one input

N_AT_ONCE = 64
N_ROWS = 5
_A, _LOADING, _UNLOADING, _MEMORY, _ANEW = range(N_ROWS)


@inlined
def count_linear(parameters: FloatArray, start: int) -> int:
    """How many laws from `start` on, N_AT_ONCE at most, have n = 1."""
    end = min(parameters.shape[0], start + N_AT_ONCE)
    i = start
    while i < end and parameters[i, 3] == 1.0:
        i += 1
    return i - start


@inner
def linear_rows(
    parameters: FloatArray, start: int, count: int, u: FloatArray, several: FloatArray, out: FloatArray
) -> None:
    """Memories of `count` laws from `start` on at the samples of `u` into their rows; `several` is (N_ROWS, N_AT_ONCE).

    A law that diverges has a last memory that is not finite.
    """
    A, loading, unloading, z = several[_A], several[_LOADING], several[_UNLOADING], several[_MEMORY]
    for j in range(count):
        law = parameters[start + j]
        A[j], loading[j], unloading[j], z[j] = law[0], law[1] + law[2], law[1] - law[2], law[4]
    last_u = u[0]
    for k in range(u.size):
        du = u[k] - last_u
        if du != 0.0:
            advance_all(A, loading, unloading, z, several[_ANEW], count, du)
        last_u = u[k]
        for j in range(count):
            out[start + j, k] = z[j]


@inlined
def advance_all(
    A: FloatArray, loading: FloatArray, unloading: FloatArray, z: FloatArray, anew: FloatArray, count: int, du: float
) -> None:
    """Move the memories `z` of all laws by `du`; `anew` takes those of laws that cannot take the short flow."""
    length, direction = abs(du), math.copysign(1.0, du)
    n_anew = 0
    for j in range(count):
        before, slope, along = z[j], A[j], direction * z[j]
        rises, falls = loading[j], unloading[j]
        k = rises if (along > 0.0) | ((along == 0.0) & (slope > 0.0)) else falls
        is_long = abs(k * length) > DECAY_REACH
        after = short_flow(along, slope, k, 0.0 if is_long else length)
        crosses = ((along > 0.0) & (after < 0.0)) | ((along < 0.0) & (after > 0.0))
        fails = (crosses | is_long | (slope == 0.0)) & (abs(before) < math.inf)
        n_anew += 1 if fails else 0
        anew[j] = before if fails else math.nan
        z[j] = direction * after
    if n_anew > 0:
        for j in range(count):
            if not math.isnan(anew[j]):
                z[j] = linear_advance(anew[j], du, A[j], loading[j], unloading[j])


@inner
def bent(t: float, length: float, sharpness: float) -> float:
    """t / (1 + (t / length)^sharpness)^(1 / sharpness), which rises with the slope 1 and bends to `length`."""
    small, large = min(t, length), max(t, length)
    if small <= 0.0:
        return 0.0
    return float(small * math.exp(-math.log1p((small / large) ** sharpness) / sharpness))
