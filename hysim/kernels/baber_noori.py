"""The Bouc-Wen law of Baber and Noori along a monotone input: strength and stiffness that wear off, and pinching.

    dz/du = h (A(e) - nu(e) |z|^n (gamma + beta sgn(z u'))) / eta(e),    de/du = z
    A(e)  = A - delta_a e,    nu = 1 + delta_nu e,    eta = 1 + delta_eta e
    h     = 1 - zeta1 exp(-(z sgn(u') - q z_u)^2 / zeta2^2),    z_u = (1 / (nu (beta + gamma)))^(1/n)
    zeta1 = zeta_s (1 - exp(-p e)),    zeta2 = (psi + delta_psi e) (lambda + zeta1)

Let s be the direction of the input and w = s z. With L the length travelled the direction drops out, and on one side
of z = 0, where c = beta + gamma for w > 0 and gamma - beta for w < 0, everything is analytic:

    dw/dL = h(w, e) (A(e) - c nu(e) |w|^n) / eta(e),    de/dL = w

Steps are power series about the present point (`hysim.kernels.baber_noori_series`). A step is no longer, and a series
no shorter, than the bound of what is left out allows. A step also ends where w crosses zero. |w|^n has no series at
w = 0 unless n is 1 or 2: within a distance in which the integral of its term is rounding it is left out, and close to
there it is bounded on a disc of its own, shorter than that of the rest. There is no closed form; this is good to
1e-12 of the range. A memory that diverges is returned as `inf`; one that needs more than MAX_STEPS, or whose eta
vanishes on the way, as `nan`. That it diverges is proved, or it has grown beyond 1e100: the wear may turn back a memory
that moves at any speed, so that a fast memory is no proof.

A law that neither wears off nor pinches takes the exact step of `hysim.kernels.boucwen`, so that z has its bits.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels._compile import inner, kernel
from hysim.kernels.baber_noori_series import (
    BETA,
    ENERGY,
    EXPONENT,
    GAMMA,
    LARGEST,
    MEMORY,
    N_ROWS,
    PINCH,
    POWER,
    SCALE,
    SLOPE,
    STRENGTH,
    TOLERANCE,
    begin,
    expand,
)
from hysim.kernels.charts import N_WORK
from hysim.kernels.duhem import place, untangled, zero
from hysim.kernels.remainder import N_TERMS, ROUNDING

_SERIES = 3  # after u, z and e
_EXPONENT = _SERIES + N_ROWS * (N_TERMS + 1)  # the n that the charts are made for
_PLAIN = _EXPONENT + 1  # the state of the Bouc-Wen law; behind it, at the end, 0 before the charts are looked at
N_LEAN = _PLAIN + 3  # of a law that needs no charts: one that degrades or pinches, or has n = 1 or 2
N_STATE = _PLAIN + N_WORK + 1

MAX_STEPS = 5_000
_COMMON = TOLERANCE + 1
_SMALLEST = 2.0**-1022
_BEYOND, _BEYOND_POWER = 1e100, 1e200  # a memory, or its power n, that grows from there on has escaped,
_SLOW_BEYOND = 1e150  # and for n < 1 one that grows from there on
_GROWTH = 4.0  # of the length tried, over the last one that served
_VANISHED = 1e-3  # of eta: what is lost beside it did not escape
_RETREAT = 2.0**-10  # of a length at which a term overflows


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` has the last u, z and e in front, and moves along.

    Its shape is (N_STATE,), or (N_LEAN,) without charts: a law that needs them is then computed by the series, too.

    `parameters` are those of wear and pinching, (A, beta, gamma, n, scale of z, scale of u, tolerance), and (A, beta,
    gamma, n, gain, offset, c1, c2, ...). What a series leaves out is the tolerance beside the memory: a rounding, or
    more in a search. Those before the scales are of the law for z and u times their scales, powers of two;
    those after them, and the state, are in the user's units.
    """
    common, plain = parameters[_COMMON:], state[_PLAIN : state.size - 1]
    last, z, e = state[0], state[1], state[2]
    if u != last and math.isfinite(z):  # a memory that has diverged remains so
        direction = 1.0 if u > last else -1.0
        series = state[_SERIES:_EXPONENT].reshape((N_ROWS, N_TERMS + 1))
        of_z, of_u = parameters[SCALE], parameters[SCALE + 1]
        w, e = advance(direction * z * of_z, e * of_z * of_u, abs(u - last) * of_u, parameters, series)
        state[1], state[2] = direction * w / of_z, e / of_u / of_z
    state[0] = u
    A, beta, gamma, n = common[0], common[1], common[2], common[3]
    is_plain = parameters[0] == 0.0 and parameters[1] == 0.0 and parameters[2] == 0.0 and parameters[3] == 0.0
    if is_plain and (n == 1.0 or n == 2.0 or plain.size >= N_WORK):
        if state[-1] == 0.0:
            boucwen.prepare(A, beta, gamma, n, state[_EXPONENT], plain)
            state[_EXPONENT], state[-1] = n, 1.0
        plain[0], plain[1] = last, z
        y = boucwen.step(common, plain, u)
        state[1] = plain[1]
        return float(y)
    return float(common[5] + boucwen.polynomial(u, common, 6) + common[4] * state[1])


@kernel
def advance(w: float, e: float, length: float, parameters: FloatArray, series: FloatArray) -> tuple[float, float]:
    """w and e after the input has moved by `length`; `series` is (N_ROWS, N_TERMS + 1)."""
    n = parameters[EXPONENT]
    beyond = _BEYOND if n >= 1.0 else _SLOW_BEYOND
    left = t = length
    lost = 0.0
    for _ in range(MAX_STEPS):
        if left <= ROUNDING * length:
            return w, e
        size, free, whole = abs(w), False, n == 1.0 or n == 2.0
        if w == 0.0 or not whole:
            begin(w, e, True, parameters, series)
            forcing = series[SLOPE, 0]
            if w == 0.0 and forcing == 0.0:
                return w, e
            if not whole:
                near, reach, bent = nearness(e, length, parameters, series)
                size = max(size, min(reach, bent))
                free = abs(w) <= near
                if not free and abs(w) < 0.5 * bent:
                    t = short_way(w, forcing, near, n, t)
                elif free:
                    t = min(t, 2.0 * abs(w / forcing) if w * forcing < 0.0 else near / abs(forcing))
        last, fraction = expand(w, e, t, free, size, parameters, series)
        if w * series[SLOPE, 0] > 0.0 and (abs(w) > beyond or series[POWER, 0] > _BEYOND_POWER):
            return math.copysign(math.inf, w), e
        if fraction == 0.0:
            if not math.isfinite(series[MEMORY, 1]):
                return series[MEMORY, 1], e
            t *= _RETREAT
            continue
        if fraction < 1.0:
            if t * fraction <= ROUNDING * length and abs(1.0 + parameters[2] * e) <= _VANISHED:
                return math.nan, e
            if diverges(w, e, left, parameters, series):
                return math.copysign(math.inf, w), e
        served = t * fraction
        if whole:  # else the series keeps away from zero, or is nearly a line
            fraction = untangled(series, last, fraction)
        before, w = w, place(series, last, fraction)[0]
        if not abs(w) < LARGEST:
            return w, e
        if before * w < 0.0:
            fraction, w = zero(series, last, fraction), 0.0
        e = place(series[ENERGY - 1 :], last, fraction)[0]
        taken = t * fraction
        if taken >= left:
            return w, e
        taken += lost
        remaining = left - taken
        lost = taken - (left - remaining)  # many steps may be a rounding of what is left, each of them
        left = remaining
        t = min(left, _GROWTH * served)
    return math.nan, e


@inner
def diverges(w: float, e: float, left: float, parameters: FloatArray, series: FloatArray) -> bool:
    """Whether w is sure to reach infinity within the length `left`; after `begin`.

    It is if dw/dL is at least a quarter of the term of ``|w|^n`` from here on, and n > 1: then w^(1 - n) comes to zero
    in time. That holds as long as A stays small beside the term, nu keeps half of its size, and eta at least does not
    grow by more than a half. For n > 2, e goes no further than w^2 / ((n - 2) rate) until then. For others it
    goes anywhere, and nu is to grow, and eta to stay.
    """
    n, nu, eta = parameters[EXPONENT], 1.0 + parameters[1] * e, 1.0 + parameters[2] * e
    side = 1.0 if w > 0.0 else -1.0
    term = -(parameters[GAMMA] + side * parameters[BETA]) * nu * series[POWER, 0]
    rate = 0.25 * side * term / eta
    if n <= 1.0 or not (rate > 0.0 and (n - 1.0) * rate * left >= abs(w)) or series[PINCH, 0] != 1.0:
        return False
    forcing = abs(parameters[STRENGTH] - parameters[0] * e) + abs(parameters[0]) * w * w / rate
    if forcing > 0.125 * abs(term):
        return False
    if n <= 2.0:
        return bool(parameters[1] * side * nu >= 0.0 and parameters[2] == 0.0 and parameters[3] == 0.0)
    farthest = w * w / ((n - 2.0) * rate)
    bell = parameters[3] == 0.0 or abs(parameters[5]) * farthest <= 0.5
    width = abs(parameters[6] + parameters[7] * e)
    bell = bell and (parameters[3] == 0.0 or abs(parameters[7]) * farthest <= 0.5 * width)
    return bool(
        bell and 2.0 * abs(parameters[1]) * farthest <= abs(nu) and 2.0 * abs(parameters[2]) * farthest <= abs(eta)
    )


@inner
def nearness(e: float, length: float, parameters: FloatArray, series: FloatArray) -> tuple[float, float, float]:
    """How near to zero w must be to leave out the term with ``|w|^n``, and the order of what w comes to; after `begin`.

    The integral of the term is within the tolerance up to the first distance. w comes to the smaller of the other two:
    as far as the length goes without the term, and where the term cancels the slope.
    """
    n, forcing = parameters[EXPONENT], abs(series[SLOPE, 0])
    c = abs(parameters[BETA]) + abs(parameters[GAMMA])
    factor = c * abs((1.0 + parameters[1] * e) * series[PINCH, 0] / (1.0 + parameters[2] * e))
    if forcing == 0.0 or factor == 0.0:
        return (0.0 if forcing == 0.0 else math.inf), forcing * length, math.inf
    bent = (forcing / factor) ** (1.0 / n)
    room = max(_SMALLEST, parameters[TOLERANCE] * min(forcing * length, bent)) * (n + 1.0) * forcing / factor
    return float(0.5 * room ** (1.0 / (n + 1.0))), forcing * length, bent


@inner
def short_way(w: float, forcing: float, near: float, n: float, left: float) -> float:
    """Length over which a series near w = 0 ends after about a dozen terms, or `left` if that is shorter.

    The terms fall off as the powers of the fraction by which w changes, from (w / near)^(n + 1) roundings on.
    """
    way = 0.6 * abs(w)
    if left * abs(forcing) < 0.3 * way:
        return left
    theta = min(1.0, max(0.3, (abs(w) / near) ** (-(n + 1.0) / 12.0)))
    return float(min(left, theta * way / abs(forcing)))


# ------------------------------------------------------------------------- a few parts in a thousand, for a search

_MOST_ROUGH = 4_000
_STRIDE = 0.25  # of the yield memory, that w moves in one rough step
_ACROSS = 0.4  # likewise of the width of the bell
_NEAR_ZERO = 0.05  # of the yield memory: below, a rough step may cross zero


@kernel
def rough_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `step`, in place of the power series by exponential Rosenbrock steps of order 3 (Hochbruck and Ostermann).

    The lengths of the steps are continuous in all parameters, so that differences of outputs are derivatives.
    """
    common = parameters[_COMMON:]
    last, z, e = state[0], state[1], state[2]
    if u != last and math.isfinite(z):
        direction = 1.0 if u > last else -1.0
        of_z, of_u = parameters[SCALE], parameters[SCALE + 1]
        w, e = rough_advance(direction * z * of_z, e * of_z * of_u, abs(u - last) * of_u, parameters)
        state[1], state[2] = direction * w / of_z, e / of_u / of_z
    state[0] = u
    return float(common[5] + boucwen.polynomial(u, common, 6) + common[4] * state[1])


@inner
def rough_advance(w: float, e: float, length: float, parameters: FloatArray) -> tuple[float, float]:
    """w and e after the input has moved by `length`, roughly."""
    n, pinches = parameters[EXPONENT], parameters[3] != 0.0
    loading = parameters[BETA] + parameters[GAMMA]
    bend = max(abs(loading), abs(parameters[GAMMA] - parameters[BETA]))
    bent = (abs(parameters[STRENGTH]) / bend) ** (1.0 / n) if bend > 0.0 else math.inf
    parting = parameters[4] * max(loading, 0.0) ** (-1.0 / n) if pinches and parameters[4] != 0.0 else 0.0
    t, left = 0.0, length
    for _ in range(_MOST_ROUGH):
        if not left > 1e-12 * length:
            return w, e
        ahead = e + 0.5 * t * w  # as far again as the step before: half of it is the middle of this one
        depth, where, width = 0.0, 0.0, 1.0
        if pinches:
            depth = -parameters[3] * math.expm1(min(-parameters[5] * ahead, 500.0))
            nu = 1.0 + parameters[1] * ahead
            where = parting * nu ** (-1.0 / n) if parting != 0.0 and nu > 0.0 else parting
            width = (parameters[6] + parameters[7] * ahead) * (parameters[8] + depth)
        f, slope = rough_slope(w, ahead, depth, where, width, parameters)
        size = min(max(bent, abs(w)), abs(w) + abs(f) * length)
        room = _STRIDE * size
        if pinches:
            room = min(room, max(_ACROSS * abs(width), abs(w - where) - 2.0 * abs(width)))
        if w * f < 0.0:
            room = min(room, max(abs(w), _NEAR_ZERO * size))
        t = min(left, room / max(abs(f), 1e-300), 1.0 / max(slope, 1e-300))
        first, third = phi(slope * t)
        middle = w + t * first * f
        there, _ = rough_slope(middle, ahead, depth, where, width, parameters)
        after = middle + 2.0 * t * third * (there - f - slope * (middle - w))
        if not abs(after) < _BEYOND:
            return math.copysign(math.inf, w), e
        e += 0.5 * t * (w + after)
        w = after
        left -= t
    return math.nan, e


@inner
def rough_slope(
    w: float, e: float, depth: float, where: float, width: float, parameters: FloatArray
) -> tuple[float, float]:
    """dw/dL at w, and its derivative by w, for a bell and an energy that stand still."""
    n, nu, eta = parameters[EXPONENT], 1.0 + parameters[1] * e, 1.0 + parameters[2] * e
    side = 1.0 if w > 0.0 else -1.0
    power = abs(w) if n == 1.0 else w * w if n == 2.0 else abs(w) ** n
    term = (parameters[GAMMA] + side * parameters[BETA]) * nu * power / eta
    f = (parameters[STRENGTH] - parameters[0] * e) / eta - term
    slope = -n * term / w if w != 0.0 and n >= 1.0 else 0.0
    if depth == 0.0:
        return f, slope
    x = (w - where) / width
    bell = depth * math.exp(-x * x)
    return (1.0 - bell) * f, (1.0 - bell) * slope + 2.0 * x / width * bell * f


@inner
def phi(x: float) -> tuple[float, float]:
    """(exp(x) - 1) / x, and ((exp(x) - 1 - x) / x - x / 2) / x^2, the weights of an exponential step."""
    if abs(x) < 0.02:
        return 1.0 + x * (0.5 + x / 6.0), 1.0 / 6.0 + x / 24.0
    first = math.expm1(x) / x
    return first, ((first - 1.0) / x - 0.5) / x
