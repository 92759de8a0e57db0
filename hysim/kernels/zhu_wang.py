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
          w^n = sum g_k x^k, where w (w^n)' = n w' w^n gives g_k. A step is no longer than the bounds of
          `hysim.kernels.remainder` allow. w^n is analytic up to w = 0 only, so that no step of the series gets
          there: near zero w is a L + d L^2/2 less the integral of c (a L + d L^2/2)^n, for as long as the
          next correction is rounding beside the scale of the stretch, on the way up and on the way down.
          This is good to 1e-12 of the range, and not called exact.

A law that diverges is returned as `inf`; one so stiff that it needs more than MAX_STEPS as `nan`.
"""

import math

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import boucwen
from hysim.kernels._compile import kernel
from hysim.kernels.duhem import MAX_STEPS, newton
from hysim.kernels.elementary import N_TERMS as N_RAMP
from hysim.kernels.elementary import linear_flow, sum16
from hysim.kernels.remainder import N_TERMS, ROUNDING, fraction, radius

N_HEAD = 2
N_STATE = N_HEAD + 2 * (N_TERMS + 1)
_SCALE, _OUTPUT = 5, 7  # places in the parameters

_RAMP = read_only([(-1.0) ** k / math.factorial(k + 2) for k in range(N_RAMP)])  # of (x - 1 + exp(-x)) / x^2
_RAMP_REACH = 0.75  # the terms left out are below 1e-18 here
_LARGEST_EXPONENT = 709.0
_SMALLEST = 2.0**-1022
_TINY = 2.0**-1000
_LARGEST = 1.7976931348623157e308
_MAX_NEWTON = 1000  # more than the largest exponent: down a growing exponential, Newton's rule goes 1/|c| at a time
_AHEAD = 16.0  # times the length that is sure before, of a step whose terms tell how much of it they serve
_WIDEST = 6.0  # disc looked at, in steps: a little wider than what serves a step of N_TERMS
_MAX_DISCS = 40
_BRISK = 0.6  # of a sure length near w = 0: the series then needs half as many terms
_MAX_SIDES = 8


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state`, shape (N_STATE,), is (last u, z, scratch), and moves along.

    `parameters` is (A, beta, gamma, n, delta, scale of z, scale of u, gain, offset, c1, c2, ...). The first five are
    those of the law for z and u times their scales, powers of two; all others, and the state, are in the user's units.
    """
    last, z, of_z, of_u = state[0], state[1], parameters[_SCALE], parameters[_SCALE + 1]
    if u != last and math.isfinite(z):  # a memory that has diverged remains so
        z = advance(last * of_u, z * of_z, (u - last) * of_u, parameters, state[N_HEAD:]) / of_z
    state[0], state[1] = u, z
    gain, offset = parameters[_OUTPUT], parameters[_OUTPUT + 1]
    return float(offset + boucwen.polynomial(u, parameters, _OUTPUT + 2) + gain * z)


@kernel
def advance(u: float, z: float, du: float, parameters: FloatArray, scratch: FloatArray) -> float:
    """Memory after the input has moved from `u` by `du`, from one zero of z to the next."""
    direction = 1.0 if du > 0.0 else -1.0
    A, beta, gamma, n, delta = parameters[0], parameters[1], parameters[2], parameters[3], parameters[4]
    a, w, length = A + direction * delta * u, direction * z, abs(du)
    begin, stands = 0.0, False
    if abs(w) < _TINY and a != 0.0:  # series about such a memory overflow
        begin, w = -w / a + 0.0, 0.0  # next to zero, z left it elsewhere; at zero that moves derivatives alone
    # the forcing a + delta L changes its sign once, so there are no more than two zeros of z
    for _ in range(_MAX_SIDES):
        left, forcing = length - begin, a + delta * begin
        if stands:  # z left zero and came back within the rounding of the length: the forcing changes its sign here
            forcing = 0.0
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
        stands = begin + travelled == begin
        begin += travelled
    return math.nan


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
    return 0.0, ramp_zero(w, a, d, c, low, high)


@kernel
def ramp_zero(w: float, a: float, d: float, c: float, low: float, high: float) -> float:
    """Length between `low` and `high` at which w' = a + d L - c w has fallen to w = 0."""
    x = high
    for _ in range(_MAX_NEWTON):
        value = linear_ramp(w, a, d, c, x)
        low, high = (x, high) if value >= 0.0 else (low, x)
        trial = newton(low, high, x, value, a + d * x - c * value)
        if value == 0.0 or abs(trial - x) <= ROUNDING * x:
            break
        x = trial
    return x


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
    return -slope / d * (1.0 - 0.5 * x) if abs(x) < ROUNDING else math.log1p(x) / c


# ---------------------------------------------------------------------------------- other n


@kernel
def power_side(
    w: float, a: float, d: float, c: float, n: float, length: float, terms: FloatArray
) -> tuple[float, float]:
    """As `linear_side`, by power series; `terms` has 2 (N_TERMS + 1) places."""
    done, negligible = 0.0, -1.0
    from_w = w
    for _ in range(MAX_STEPS):
        left, forcing = length - done, a + d * done
        if left <= ROUNDING * length:
            return w, length
        if w == 0.0 or forcing < 0.0:
            landing = free_landing(w, forcing, d)
            if negligible < 0.0 and (w == 0.0 or landing <= left):
                negligible = max(_SMALLEST, ROUNDING * scale(from_w, a, d, c, n, length))
            if w == 0.0:
                h, w = take_off(forcing, d, c, n, negligible, left)
                if h >= left or w == 0.0:
                    return w, length if h >= left else done + h
                done += h
                continue
            if landing <= left and landing <= near(-forcing - d * landing, d, abs(c), n, negligible):
                return 0.0, done + landing + c * moment(-forcing - d * landing, d, n, landing) / (forcing + d * landing)
        power = w**n
        if diverges(w, abs(a) + abs(d) * length, c * power, n, left):
            return math.inf, length
        slope = forcing - c * power
        if slope == 0.0 and d == 0.0:
            return w, length
        bend = abs(c) * power
        reach, spread = disc(w, abs(slope), d, bend, n, 5.0 * left)
        safe = left  # as it is: times the reach it would round, and a denormal one to nothing
        if left > 0.2 * reach:
            safe = min(left, fraction(spread * reach, w) * reach)
        if safe < left and spread < abs(slope):
            safe *= _BRISK
        if safe == left or spread < abs(slope):
            w = series(w, power, forcing, d, c, n, safe, safe / reach, spread * safe, terms)
            done = length if safe == left else done + safe
            continue
        h = min(left, _AHEAD * safe)
        series(w, power, forcing, d, c, n, h, 1.0, math.inf, terms)
        share = max(safe / h, serves(terms, bend * h, n))
        w = summed(terms, share)
        if not w < _LARGEST:
            return math.inf if c < 0.0 else math.nan, length
        if share == 1.0 and h == left:
            return w, length
        done += share * h
    return math.nan, length


@kernel
def disc(w: float, slope: float, d: float, bend: float, n: float, wanted: float) -> tuple[float, float]:
    """Radius and spread (`hysim.kernels.remainder`) of the flow about w, where dw/dL is `slope` and |c| w^n is `bend`.

    On the disc |v| <= q w, |(w + v)^n - w^n| is at most G w^n, with G = (1 + q)^n - 1 for n >= 1, and 1 - (1 - q)^n
    for n < 1. A q of order 1/n keeps G of order one. The forcing is known to the end: it adds |d| L to the slope, and
    nothing to the tail; L is no more than either radius without the other.
    """
    if n >= 1.389:
        q, rise = 1.25 / n, 2.4904
    elif n >= 1.0:
        q, rise = 0.9, 1.4393
    else:
        q, rise = 0.5, 0.6932 * n
    reach = disc_radius(q * w, slope, d, bend * rise)
    if reach < wanted and bend < slope:
        rise_widest = 1.9**n - 1.0 if n >= 1.0 else 1.0 - 0.1**n
        if rise_widest * bend < slope:
            return disc_radius(0.9 * w, slope, d, bend * rise_widest), bend * rise_widest
    return reach, bend * rise


@kernel
def disc_radius(r: float, slope: float, d: float, spread: float) -> float:
    """Radius of the flow while the memory stays within r; L is no more than either radius without the other."""
    total = slope
    if d != 0.0:
        lowest = math.sqrt(r / abs(d))
        total += abs(d) * (min(lowest, r / slope) if slope > 0.0 else lowest)
    return radius(total / r, spread / r)


@kernel
def serves(terms: FloatArray, bend: float, n: float) -> float:
    """Fraction of a step that all of its terms serve, by the terms themselves (`hysim.kernels.remainder`)."""
    rows = terms.size // 2
    w = terms[rows]
    x, allowed = _WIDEST, 0.9 * w
    reaches = False
    for _ in range(_MAX_DISCS):
        total, slope = 0.0, 0.0
        for k in range(N_TERMS, 0, -1):
            slope = slope * x + total
            total = total * x + abs(terms[rows + k])
        slope = slope * x + total
        total *= x
        reaches = total < 1.2 * allowed
        if reaches:
            x *= min(1.0, allowed / total)  # enough: without a constant term, a sum of powers falls at least as x does
            break
        x *= (allowed / total) ** (total / (slope * x))  # Newton's rule on logarithms, where the sum is convex
    if not reaches:
        return 0.0
    rise = 1.9**n - 1.0 if n >= 1.0 else 1.0 - 0.1**n
    return min(1.0, x * fraction(x * bend * rise, w))


@kernel
def summed(terms: FloatArray, x: float) -> float:
    """Value at the place x of the series in the second half of `terms`."""
    rows, total = terms.size // 2, 0.0
    for k in range(N_TERMS, -1, -1):
        total = total * x + terms[rows + k]
    return total


@kernel
def diverges(w: float, forcing: float, bend: float, n: float, length: float) -> bool:
    """Whether w is sure to reach infinity: -c w^n, which only grows, is twice any forcing, and half of it is enough."""
    return bool(n > 1.0 and -bend > 2.0 * forcing and 2.0 * w < (1.0 - n) * bend * length)


@kernel
def scale(w: float, a: float, d: float, c: float, n: float, length: float) -> float:
    """Order of w at the end of a branch: as far as the forcing takes it, or to where the decay stops it."""
    forcing = abs(a) + abs(d) * length
    reached = forcing * length
    return max(w, min(reached, (forcing / abs(c)) ** (1.0 / n)) if c != 0.0 else reached)


@kernel
def take_off(a: float, d: float, c: float, n: float, negligible: float, left: float) -> tuple[float, float]:
    """A length that can be gone from w = 0, and the value there."""
    h = near(a, d, abs(c), n, negligible)
    free = free_length(a, d, abs(c), n, negligible)
    if free >= h:
        h = min(left, free)
        return h, max(0.0, h * (a + 0.5 * d * h))
    h = min(left, h)
    return h, max(0.0, h * (a + 0.5 * d * h) - c * moment(a, d, n, h))


@kernel
def near(a: float, d: float, c: float, n: float, negligible: float) -> float:
    """Length from w = 0 on which w grows nearly as a L and one correction by c w^n is enough: the next is negligible.

    The next is at most n c^2 w^(2 n + 1) / (a^2 (n + 1) (2 n + 1)); 1.2 a L is more than w.
    """
    if not a > 0.0:
        return 0.0
    length = 0.125 * a / abs(d) if d != 0.0 else math.inf
    if c > 0.0:
        room = negligible * (n + 1.0) * (2.0 * n + 1.0) / n / a
        unit = c * (1.2 * a) ** n / a
        length = min(length, 0.8 * (room / unit / unit) ** (1.0 / (2.0 * n + 1.0)))
    return length


@kernel
def moment(a: float, d: float, n: float, length: float) -> float:
    """Integral of (a L + d L^2 / 2)^n from 0 to `length`, a binomial series in d L / (2 a), which is small."""
    ratio, factor, total = 0.5 * d * length / a, 1.0, 1.0 / (n + 1.0)
    for k in range(1, 16):
        factor *= ratio * (n + 1.0 - k) / k
        total += factor / (n + 1.0 + k)
        if abs(factor) < 1e-11:
            break
    return float((a * length) ** n * length * total)


@kernel
def free_length(a: float, d: float, c: float, n: float, negligible: float) -> float:
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
def is_last(k: int, tail: float, room: float) -> bool:
    """Whether a series may end with the next term: by what is left out, or since there is no room for more."""
    return (tail <= room * (k + 2.0) and k > 0) or k == N_TERMS - 1


@kernel
def series(
    w: float,
    power: float,
    a: float,
    d: float,
    c: float,
    n: float,
    h: float,
    theta: float,
    spread: float,
    terms: FloatArray,
) -> float:
    """Value after h, from w with w^n = `power`, by as many terms as the bound of the tail asks for.

    h is the fraction `theta` of the radius, and `spread` is for a length h. The terms of w(h x) go to the second half
    of `terms`, those of w^n to the first.
    """
    rows = terms.size // 2
    terms[rows], terms[0] = w, power
    room, tail = ROUNDING * w * (1.0 - theta), spread
    for k in range(N_TERMS):
        forcing = a if k == 0 else d * h if k == 1 else 0.0
        terms[rows + k + 1] = h * (forcing - c * terms[k]) / (k + 1.0)
        tail *= theta
        if is_last(k, tail, room):
            total = 0.0
            for j in range(k + 1, -1, -1):
                total += terms[rows + j]
            return total
        even, odd, weight, top = 0.0, 0.0, n - k, k + 1  # two sums, so that one need not wait for the other
        for j in range(1, top, 2):
            even += weight * terms[rows + j] * terms[top - j]
            odd += (weight + n + 1.0) * terms[rows + j + 1] * terms[top - j - 1]
            weight += 2.0 * n + 2.0
        if top % 2 == 1:
            even += n * top * terms[rows + top] * power
        terms[top] = (even + odd) / (top * w)
    return math.nan
