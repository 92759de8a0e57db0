"""The Bouc-Wen law of Zhu and Wang along a monotone input.

    dz/du = A - |z|^n (gamma + beta sgn(z du)) + delta u sgn(du)

Let s be the direction of the input and L the length travelled from u_0. On one side of z = 0, with
w = |z| there, and e = sgn(s z), this is

    dw/dL = a + d L - c w^n,    a = e (A + s delta u_0),    d = e delta,    c = beta + e gamma

so a forcing that is linear in L drives one decay. dw/dL changes its sign at most once: where it is zero,
its own slope is d. So w has one extremum at most, and the first L at which it is zero lies in a bracket.

n = 1     closed: w + (a - c w) E_1 + d E_2,  E_1 = (1 - exp(-c L))/c,  E_2 = (L - E_1)/c, each a power
          series near c L = 0. The place of the extremum is closed too, that of w = 0 is found by Newton's
          method in its bracket.
other n   the power series of the flow about the present point, w = sum t_k x^k with L = h x and
          w^n = sum g_k x^k, where w (w^n)' = n w' w^n gives g_k. A step is as long as its last terms are
          rounding (`hysim.kernels.duhem`). At w = 0 the series do not begin, so the way from there goes
          by a L + d L^2/2 for as long as the term left out is rounding beside the scale of the stretch.
          This is good to 1e-12 of the range, and not called exact.

A law that escapes is returned as `inf`; one so stiff that it needs more than MAX_STEPS as `nan`.
"""

import math

from hysim._frozen import FloatArray, read_only
from hysim.kernels import boucwen
from hysim.kernels._compile import kernel
from hysim.kernels.duhem import MAX_STEPS, N_TERMS, newton, place, reach
from hysim.kernels.elementary import linear_flow
from hysim.kernels.polynomials import N_TERMS as N_RAMP
from hysim.kernels.polynomials import sum16

N_HEAD = 2
N_STATE = N_HEAD + 2 * (N_TERMS + 1)

_RAMP = read_only([(-1.0) ** k / math.factorial(k + 2) for k in range(N_RAMP)])  # of (x - 1 + exp(-x)) / x^2
_RAMP_REACH = 0.75  # the terms left out are below 1e-18 here
_LARGEST_EXPONENT = 709.0
_LARGEST = 1.7976931348623157e308
_SMALL = 2.0**-54
_N_LAST = 3  # terms that are rounding where a series ends: of a symmetric one every other term is zero
_GROWTH = 16.0  # of the length tried, over the last one that served
_RETREAT = 2.0**-10  # of a length at which a term overflows
_MAX_NEWTON = 100
_MAX_HALVES = 60  # to the last bit of the place of an extremum


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state`, shape (N_STATE,), is (last u, z, scratch), and moves along.

    `parameters` is (A, beta, gamma, n, delta, gain, offset, c1, c2, ...).
    """
    last, z = state[0], state[1]
    if u != last:
        z = advance(last, z, u - last, parameters, state[N_HEAD:])
    state[0], state[1] = u, z
    return float(parameters[6] + boucwen.polynomial(u, parameters, 7) + parameters[5] * z)


@kernel
def advance(u: float, z: float, du: float, parameters: FloatArray, scratch: FloatArray) -> float:
    """Memory after the input has moved from `u` by `du`, from one zero of z to the next."""
    direction = 1.0 if du > 0.0 else -1.0
    A, beta, gamma, n, delta = parameters[0], parameters[1], parameters[2], parameters[3], parameters[4]
    a, w, length = A + direction * delta * u, direction * z, abs(du)
    begin = 0.0
    while True:  # the forcing a + delta L changes its sign once, so there are no more than two zeros of z
        left, forcing = length - begin, a + delta * begin
        if w != 0.0:
            side = 1.0 if w > 0.0 else -1.0
        else:
            side = 1.0 if forcing > 0.0 or (forcing == 0.0 and delta > 0.0) else -1.0
        c = beta + side * gamma
        if n == 1.0:
            w, travelled = linear_side(abs(w), side * forcing, side * delta, c, left)
        else:
            w, travelled = power_side(abs(w), side * forcing, side * delta, c, n, left, scratch)
        if w != 0.0 or travelled >= left:
            return direction * side * w
        begin += travelled


# ---------------------------------------------------------------------------------- n = 1


@kernel
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
    x = high
    for _ in range(_MAX_NEWTON):
        value = linear_ramp(w, a, d, c, x)
        low, high = (x, high) if value >= 0.0 else (low, x)
        trial = newton(low, high, x, value, a + d * x - c * value)
        if value == 0.0 or abs(trial - x) <= _SMALL * x:
            break
        x = trial
    return 0.0, x


@kernel
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


@kernel
def linear_turn(slope: float, d: float, c: float) -> float:
    """Length at which w' = a + d L - c w is zero, from w' = `slope` at L = 0 on."""
    x = -c * slope / d
    return -slope / d if abs(x) < _SMALL else math.log1p(x) / c


# ---------------------------------------------------------------------------------- other n


@kernel
def power_side(
    w: float, a: float, d: float, c: float, n: float, length: float, scratch: FloatArray
) -> tuple[float, float]:
    """As `linear_side`, by power series; `scratch` has 2 (N_TERMS + 1) places."""
    terms = scratch.reshape((2, N_TERMS + 1))
    negligible = _SMALL * scale(w, a, d, c, n, length)
    done, h = 0.0, length
    for _ in range(MAX_STEPS):
        left, forcing = length - done, a + d * done
        if escapes(w, abs(a) + abs(d) * length, c, n, left):
            return math.inf, length
        if w == 0.0:
            way = min(left, free_way(forcing, d, abs(c), n, negligible))
            w = way * (forcing + 0.5 * d * way)
            if done + way >= length or not w > 0.0:
                return max(w, 0.0), length if done + way >= length else done + way
            done += way
            h = way
            continue
        landing = free_landing(w, forcing, d)
        if landing <= left and abs(c) * w**n * landing <= negligible:
            return 0.0, done + landing
        last, fraction = series(w, forcing, d, c, n, h, terms)
        if fraction == 0.0:
            if not math.isfinite(terms[1, 1]):
                return math.inf, length
            h *= _RETREAT
            continue
        w, slope = place(terms, last, fraction)
        if w <= 0.0 or (terms[1, 1] < 0.0 and slope > 0.0):
            zero = first_zero(terms, last, fraction)
            if zero > 0.0:
                return 0.0, min(length, done + h * zero)
        if not w < _LARGEST:
            return math.inf, length
        taken = h * fraction
        if taken >= left:
            return w, length
        done += taken
        h = min(length - done, _GROWTH * taken)
    return math.nan, length


@kernel
def escapes(w: float, forcing: float, c: float, n: float, length: float) -> bool:
    """Whether w is sure to reach infinity: -c w^n, which only grows, is twice any forcing, and half of it is enough."""
    if c >= 0.0 or n <= 1.0:
        return False
    growth = -c * w**n
    return bool(growth > 2.0 * forcing and 2.0 * w < (n - 1.0) * growth * length)


@kernel
def scale(w: float, a: float, d: float, c: float, n: float, length: float) -> float:
    """What w comes to on a stretch, to its order: as far as the forcing takes it, or to where the decay stops it."""
    forcing = abs(a) + abs(d) * length
    reached = forcing * length
    return max(w, min(reached, (forcing / abs(c)) ** (1.0 / n)) if c != 0.0 else reached)


@kernel
def free_way(a: float, d: float, c: float, n: float, negligible: float) -> float:
    """Length from w = 0 on which w grows and the integral of c w^n stays negligible."""
    way = -0.5 * a / d if d < 0.0 else math.inf
    if c > 0.0 and a > 0.0:
        way = min(way, 0.5 * (negligible / c / a**n) ** (1.0 / (n + 1.0)))
    if c > 0.0 and d > 0.0:
        way = min(way, 0.5 * (negligible / c / d**n) ** (1.0 / (2.0 * n + 1.0)))
    return way


@kernel
def free_landing(w: float, a: float, d: float) -> float:
    """Length at which w + a L + d L^2/2 is zero on a way that falls from the beginning; inf where it is not."""
    square = a * a - 2.0 * d * w
    return 2.0 * w / (math.sqrt(square) - a) if a < 0.0 and square >= 0.0 else math.inf


@kernel
def series(w: float, a: float, d: float, c: float, n: float, h: float, terms: FloatArray) -> tuple[int, float]:
    """Fill row 1 of `terms` with w(h x) and row 0 with w^n: the index of the last term, the fraction of h they serve.

    They end where _N_LAST of them in a row are rounding, or with N_TERMS.
    """
    terms[1, 0], terms[0, 0] = w, w**n
    size, small = w, 0
    for k in range(N_TERMS):
        forcing = a if k == 0 else d * h if k == 1 else 0.0
        term = h * (forcing - c * terms[0, k]) / (k + 1.0)
        terms[1, k + 1] = term
        size += abs(term) if k < 2 else 0.0
        small = small + 1 if abs(term) <= _SMALL * size else 0
        if small == _N_LAST:
            return k + 1, 1.0
        convolution, weight = 0.0, -(k + 1.0)
        for j in range(1, k + 2):
            weight += n + 1.0
            convolution += weight * terms[1, j] * terms[0, k + 1 - j]
        terms[0, k + 1] = convolution / ((k + 1.0) * w)
    return N_TERMS, reach(terms, _N_LAST)


@kernel
def first_zero(terms: FloatArray, last: int, end: float) -> float:
    """The first place up to `end` at which the series of w is zero, or 0 if there is none."""
    low, high = 0.0, end
    if terms[1, 1] < 0.0 and place(terms, last, end)[1] > 0.0:
        below = 0.0
        for _ in range(_MAX_HALVES):
            middle = 0.5 * (below + high)
            below, high = (middle, high) if place(terms, last, middle)[1] < 0.0 else (below, middle)
    x = high
    value, slope = place(terms, last, x)
    if not value <= 0.0:
        return 0.0
    for _ in range(_MAX_NEWTON):
        low, high = (x, high) if value >= 0.0 else (low, x)
        trial = newton(low, high, x, value, slope)
        if value == 0.0 or abs(trial - x) <= _SMALL * x:
            break
        x = trial
        value, slope = place(terms, last, x)
    return x
