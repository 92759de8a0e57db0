"""The Bouc-Wen law of Baber and Noori along a monotone input: strength and stiffness that wear off, and pinching.

    dz/du = h (A(e) - nu(e) |z|^n (gamma + beta sgn(z u'))) / eta(e),    de/du = z
    A(e)  = A - delta_a e,    nu = 1 + delta_nu e,    eta = 1 + delta_eta e
    h     = 1 - zeta1 exp(-(z sgn(u') - q z_u)^2 / zeta2^2),    z_u = (1 / (nu (beta + gamma)))^(1/n)
    zeta1 = zeta_s (1 - exp(-p e)),    zeta2 = (psi + delta_psi e) (lambda + zeta1)

Let s be the direction of the input and w = s z. With L the length travelled the direction drops out, and on one side
of z = 0, where c = beta + gamma for w > 0 and gamma - beta for w < 0, everything is analytic:

    dw/dL = h(w, e) (A(e) - c nu(e) |w|^n) / eta(e),    de/dL = w

Its power series about the present point, L = t x, follows term by term from those of e, nu^(-1/n), exp(-p e), the
bell exp(-X^2) and |w|^n. A step is no longer, and a series no shorter, than the bound of what is left out allows
(`hysim.kernels.remainder`): on a disc about the point each factor is bounded by its size there and the most by which
it changes, the bell by the least real part of X^2. Far from the bell all its terms underflow; there it is left out,
and a step ends before the bell could be more than rounding. A step also ends where w crosses zero. |w|^n has no series
at w = 0 unless n is 1 or 2: within a distance in which the integral of its term is rounding it is left out, and close
to there it is bounded on a disc of its own, shorter than that of the rest. There is no closed form; this is good to
1e-12 of the range. A law that escapes is returned as `inf`; one that needs more than MAX_STEPS, or whose eta vanishes
on the way, as `nan`. That it escapes is shown, or it grows beyond 1e100: the wear may turn back a memory that moves at
any speed, so that a fast memory is no proof.

A law that neither wears off nor pinches takes the exact step of `hysim.kernels.boucwen`, so that z has its bits.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels._compile import inner, kernel
from hysim.kernels.charts import N_WORK
from hysim.kernels.duhem import place, untangled, zero
from hysim.kernels.remainder import FARTHEST, N_TERMS, ROUNDING, fraction

N_OWN = 9  # delta_a, delta_nu, delta_eta, zeta_s, q, p, psi, delta_psi, lambda, before what `boucwen.step` takes
_A, _BETA, _GAMMA, _N = range(N_OWN, N_OWN + 4)

# Rows of the series; `reach`, `place` and `zero` look at row 1.
_POWER, _W, _ENERGY, _BRACKET, _ROOT, _FADED, _DEPTH, _WIDTH, _X, _SQUARE, _BELL, _PINCH, _SLOPE = range(13)
_N_ROWS = 13

_PLAIN = 3  # after u, z and e the workspace of the Bouc-Wen law
_SERIES = _PLAIN + N_WORK
_EXPONENT = _SERIES + _N_ROWS * (N_TERMS + 1)  # the n that its charts are made for
_READY = _EXPONENT + 1  # 0 before the first step
N_STATE = _READY + 1

MAX_STEPS = 5_000
_LARGEST = 1.7976931348623157e308
_BEYOND, _BEYOND_POWER = 1e100, 1e200  # a memory, or its power n, that grows from there on has escaped
_LARGEST_EXPONENT = 700.0
_GROWTH = 4.0  # of the length tried, over the last one that served
_WIDEST = 6.0  # disc looked at, in steps: a little wider than what serves a step of N_TERMS
_MAX_DISCS = 40
_ALL, _SMOOTH, _BEND = 0, 1, 2  # parts of dw/dL: together, without the term of |w|^n, this term
_FAR = 8.0  # in X: from here on the bell, below 1e-27, is left out
_CLEAR = 6.0  # and up to here, if it is rounding
_VANISHED = 1e-3  # of eta: what is lost beside it did not escape
_RETREAT = 2.0**-10  # of a length at which a term overflows


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state`, shape (N_STATE,), has the last u, z and e in front, and moves along.

    `parameters` are N_OWN of the law's own, and (A, beta, gamma, n, gain, offset, c1, c2, ...).
    """
    common, plain = parameters[N_OWN:], state[_PLAIN:_SERIES]
    last, z, e = state[0], state[1], state[2]
    if state[_READY] == 0.0:
        A, beta, gamma, n = common[0], common[1], common[2], common[3]
        boucwen.prepare(A, beta, gamma, n, state[_EXPONENT], plain)
        state[_EXPONENT], state[_READY] = n, 1.0
    if u != last and math.isfinite(z):  # an escape remains one
        direction = 1.0 if u > last else -1.0
        series = state[_SERIES:_EXPONENT].reshape((_N_ROWS, N_TERMS + 1))
        w, e = advance(direction * z, e, abs(u - last), parameters, series)
        state[1], state[2] = direction * w, e
    state[0] = u
    if parameters[0] == 0.0 and parameters[1] == 0.0 and parameters[2] == 0.0 and parameters[3] == 0.0:
        plain[0], plain[1] = last, z
        y = boucwen.step(common, plain, u)
        state[1] = plain[1]
        return float(y)
    return float(common[5] + boucwen.polynomial(u, common, 6) + common[4] * state[1])


@kernel
def advance(w: float, e: float, length: float, parameters: FloatArray, series: FloatArray) -> tuple[float, float]:
    """w and e after the input has moved by `length`; `series` is (_N_ROWS, N_TERMS + 1)."""
    n = parameters[_N]
    left = t = length
    lost = 0.0
    for _ in range(MAX_STEPS):
        if left <= ROUNDING * length:
            return w, e
        size, free, whole = abs(w), False, n == 1.0 or n == 2.0
        if w == 0.0 or not whole:
            begin(w, e, True, parameters, series)
            forcing = series[_SLOPE, 0]
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
        if w * series[_SLOPE, 0] > 0.0 and (abs(w) > _BEYOND or series[_POWER, 0] > _BEYOND_POWER):
            return math.copysign(math.inf, w), e
        if fraction == 0.0:
            if not math.isfinite(series[_W, 1]):
                return series[_W, 1], e
            t *= _RETREAT
            continue
        if fraction < 1.0:
            if t * fraction <= ROUNDING * length and abs(1.0 + parameters[2] * e) <= _VANISHED:
                return math.nan, e
            if escapes(w, e, left, parameters, series):
                return math.copysign(math.inf, w), e
        served = t * fraction
        if whole:  # else the series keeps away from zero, or is nearly a line
            fraction = untangled(series, last, fraction)
        before, w = w, place(series, last, fraction)[0]
        if not abs(w) < _LARGEST:
            return w, e
        if before * w < 0.0:
            fraction, w = zero(series, last, fraction), 0.0
        e = place(series[_ENERGY - 1 :], last, fraction)[0]
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
def escapes(w: float, e: float, left: float, parameters: FloatArray, series: FloatArray) -> bool:
    """Whether w is sure to reach infinity within the length `left`; after `begin`.

    It is if dw/dL is at least a quarter of the term of ``|w|^n`` from here on, and n > 1: then w^(1 - n) comes to zero
    in time. That holds as long as A stays small beside the term, nu keeps half of its size, and eta at least does not
    grow by more than a half. For n > 2, e goes no further than w^2 / ((n - 2) rate) until then. For others it
    goes anywhere, and nu is to grow, and eta to stay.
    """
    n, nu, eta = parameters[_N], 1.0 + parameters[1] * e, 1.0 + parameters[2] * e
    side = 1.0 if w > 0.0 else -1.0
    term = -(parameters[_GAMMA] + side * parameters[_BETA]) * nu * series[_POWER, 0]
    rate = 0.25 * side * term / eta
    if n <= 1.0 or not (rate > 0.0 and (n - 1.0) * rate * left >= abs(w)) or series[_PINCH, 0] != 1.0:
        return False
    forcing = abs(parameters[_A] - parameters[0] * e) + abs(parameters[0]) * w * w / rate
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

    The integral of the term is rounding up to the first distance. w comes to the smaller of the other two: as far as
    the length goes without the term, and where the term cancels the slope.
    """
    n, forcing = parameters[_N], abs(series[_SLOPE, 0])
    c = abs(parameters[_BETA]) + abs(parameters[_GAMMA])
    factor = c * abs((1.0 + parameters[1] * e) * series[_PINCH, 0] / (1.0 + parameters[2] * e))
    if forcing == 0.0 or factor == 0.0:
        return (0.0 if forcing == 0.0 else math.inf), forcing * length, math.inf
    bent = (forcing / factor) ** (1.0 / n)
    room = ROUNDING * min(forcing * length, bent) * (n + 1.0) * forcing / factor
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


@kernel
def begin(w: float, e: float, free: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Fill the first terms, and return the side of zero; a `free` memory is without the term of ``|w|^n``."""
    n, nu = parameters[_N], 1.0 + parameters[1] * e
    series[_W, 0], series[_ENERGY, 0], series[_PINCH, 0] = w, e, 1.0
    if parameters[3] != 0.0:
        parting = parameters[4]  # q z_u where nu = 1
        if parting != 0.0:
            loading = parameters[_BETA] + parameters[_GAMMA]
            parting *= loading ** (-1.0 / n) if loading > 0.0 else math.nan
            parting *= nu ** (-1.0 / n) if nu > 0.0 else math.nan
        series[_ROOT, 0] = parting
        fading = min(-parameters[5] * e, _LARGEST_EXPONENT)
        series[_FADED, 0], series[_DEPTH, 0] = math.exp(fading), -parameters[3] * math.expm1(fading)
        series[_WIDTH, 0] = (parameters[6] + parameters[7] * e) * (parameters[8] + series[_DEPTH, 0])
        series[_X, 0] = (w - series[_ROOT, 0]) / series[_WIDTH, 0]
        series[_SQUARE, 0] = series[_X, 0] * series[_X, 0]
        series[_BELL, 0] = math.exp(-series[_SQUARE, 0])
        series[_PINCH, 0] = 1.0 - series[_DEPTH, 0] * series[_BELL, 0]
    strength, eta = parameters[_A] - parameters[0] * e, 1.0 + parameters[2] * e
    above = w > 0.0 or (w == 0.0 and series[_PINCH, 0] * strength / eta > 0.0)
    side = 1.0 if above else -1.0
    series[_POWER, 0] = 0.0 if free else abs(w) ** n
    series[_BRACKET, 0] = strength - (parameters[_GAMMA] + side * parameters[_BETA]) * nu * series[_POWER, 0]
    series[_SLOPE, 0] = series[_PINCH, 0] * series[_BRACKET, 0] / eta
    return side


@inner
def expand(
    w: float, e: float, t: float, free: bool, size: float, parameters: FloatArray, series: FloatArray
) -> tuple[int, float]:
    """Fill the series over a length t until what is left out is rounding beside `size`, or the way that w goes.

    Returns the index of the last term and the fraction of t that the terms serve, 0 where none is known to.
    """
    side = begin(w, e, free, parameters, series)
    pinches = parameters[3] != 0.0
    if pinches and abs(series[_X, 0]) >= _FAR:
        pinches = False
        series[_PINCH, 0], series[_SLOPE, 0] = 1.0, series[_BRACKET, 0] / (1.0 + parameters[2] * e)
    tried, scale = 0, size
    for k in range(1, N_TERMS + 1):
        term = t * series[_SLOPE, k - 1] / k
        series[_W, k], series[_ENERGY, k] = term, t * series[_W, k - 1] / k
        scale = max(size, abs(term)) if k < 2 else scale
        if abs(term) <= ROUNDING * scale and k >= tried:
            tried = k + 2
            if ends(k, t, scale, free, pinches, parameters, series):
                served = clear(k, 1.0, pinches, parameters, series)
                if served > 0.0:
                    return k, served
        if k < N_TERMS:
            extend(k, side, free, pinches, parameters, series)
    served = serves(t, size, free, pinches, parameters, series)
    return N_TERMS, clear(N_TERMS, served, pinches, parameters, series)


@inner
def ends(k: int, t: float, size: float, free: bool, pinches: bool, parameters: FloatArray, series: FloatArray) -> bool:
    """Whether the series may end at the term k: whether the terms left out are rounding beside `size`."""
    room = ROUNDING * size * (k + 1.0)
    flow = max(abs(series[_W, 1]), ROUNDING * size)
    x, gain, doubling = 2.0, 2.0**k, 2.0**k
    while gain * room < 16.0 * flow and x < _LARGEST:
        x, gain = 2.0 * x, doubling * gain
    spread = spread_within(k, x, _SMOOTH if free else _ALL, pinches, parameters, series)
    if spread * t * x <= room * gain * (x - 1.0):
        return True
    if free or spread < math.inf:
        return False
    rest = x - spread_within(k, x, _SMOOTH, pinches, parameters, series) * t * x / (room * gain) - 1.0
    shorter = x * inside(k, x, series)
    if not (rest > 0.0 and shorter > 1.0):
        return False
    spread = spread_within(k, shorter, _BEND, pinches, parameters, series)
    return bool(spread * t * shorter <= room * shorter**k * (shorter - 1.0) * rest / (x - 1.0))


@inner
def serves(t: float, size: float, free: bool, pinches: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Fraction of t that N_TERMS terms serve, the best of a few discs."""
    x, best = _WIDEST, 0.0
    for _ in range(_MAX_DISCS):
        spread = spread_within(N_TERMS, x, _SMOOTH if free else _ALL, pinches, parameters, series)
        share = 0.0
        if spread < math.inf:
            share = x * reached(spread * t * x, size, abs(series[_W, 1]) * x)
        elif not free:
            shorter = x * inside(N_TERMS, x, series)
            smooth = spread_within(N_TERMS, x, _SMOOTH, pinches, parameters, series)
            bend = spread_within(N_TERMS, shorter, _BEND, pinches, parameters, series)
            if smooth < math.inf and bend < math.inf:
                way = 0.5 * abs(series[_W, 1])
                share = x * reached(smooth * t * x, 0.5 * size, way * x)
                share = min(share, shorter * reached(bend * t * shorter, 0.5 * size, way * shorter))
        if share >= 1.0:
            return 1.0
        if share < best:
            break
        best = share
        x *= 0.75 if share > 0.01 * x else 0.25
    return best


@inner
def reached(spread: float, size: float, way: float) -> float:
    """As `fraction`, beside `size` or beside the part of `way` that the memory goes in this fraction.

    The way of a whole step that only serves in part is no measure: no memory comes there.
    """
    room = ROUNDING * way * (1.0 - FARTHEST) * (N_TERMS + 1.0)
    along = FARTHEST
    if room < spread:
        along = min(FARTHEST, (room / spread) ** (1.0 / N_TERMS))
    return float(max(along, fraction(spread, size)))


@inner
def sum_of_sizes(series: FloatArray, row: int, last: int, x: float) -> float:
    """What the terms after the first come to at most at the distance x."""
    total = 0.0
    for k in range(last, 0, -1):
        total = (total + abs(series[row, k])) * x
    return total


@inner
def inside(last: int, x: float, series: FloatArray) -> float:
    """Part of the distance x up to which the series of w keeps away from zero."""
    return float(min(1.0, 0.9 * abs(series[_W, 0]) / sum_of_sizes(series, _W, last, x)))


@inner
def spread_within(last: int, x: float, part: int, pinches: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Bound of ``|f - f(0)|`` where the series go at complex distances up to x; inf where none is known.

    f is dw/dL, or the part of it without the term of ``|w|^n``, or this term. Each factor of f is replaced by its size
    at 0 and the most by which it changes.
    """
    rw, re = sum_of_sizes(series, _W, last, x), sum_of_sizes(series, _ENERGY, last, x)
    n, w, e = parameters[_N], series[_W, 0], series[_ENERGY, 0]
    growth, eta = abs(parameters[1]) * re, abs(1.0 + parameters[2] * e)
    wear = abs(parameters[2]) * re
    if not (wear < 0.9 * eta and rw < _LARGEST):
        return math.inf
    worn = abs(parameters[0]) * re
    if part == _SMOOTH:
        bracket = abs(parameters[_A] - parameters[0] * e)
        changed = bracket + worn
    else:
        power, nu, size = series[_POWER, 0], abs(1.0 + parameters[1] * e), abs(w)
        if n == 1.0:
            rise = rw
        elif n == 2.0:
            rise = rw * (2.0 * size + rw)
        elif rw >= 0.95 * size:
            return math.inf
        else:
            rise = (size + rw) ** n - power if n > 1.0 else power - (size - rw) ** n
        c = abs(parameters[_GAMMA] + (parameters[_BETA] if w > 0.0 else -parameters[_BETA]))
        if w == 0.0:
            c = abs(parameters[_GAMMA]) + abs(parameters[_BETA])
        change = c * (nu * rise + growth * (power + rise))
        bracket = abs(series[_BRACKET, 0])
        changed = bracket + worn + change
        if part == _BEND:
            bracket = c * nu * power
            changed = bracket + change
    pinch = abs(series[_PINCH, 0])
    deeper = pinch_within(rw, re, parameters, series) if pinches else 0.0
    return float((pinch + deeper) * changed / (eta - wear) - pinch * bracket / eta)


@inner
def pinch_within(rw: float, re: float, parameters: FloatArray, series: FloatArray) -> float:
    """Bound of ``|h - its value at 0|`` where w and e go no further than rw and re, by the real part of X^2."""
    deeper, farther, wider = shifts(re, parameters, series)
    x, width = abs(series[_X, 0]), abs(series[_WIDTH, 0])
    if not wider < 0.9 * width:
        return math.inf
    apart = (rw + farther + x * wider) / (width - wider)
    exponent = -((x - apart) ** 2) if apart <= 0.5 * x else apart * apart - 0.5 * x * x
    if not exponent < 0.5 * _LARGEST_EXPONENT:
        return math.inf
    highest = math.exp(exponent)
    change = min(highest * apart * (2.0 * x + apart), highest + series[_BELL, 0])
    return float(abs(series[_DEPTH, 0]) * change + deeper * highest)


@inner
def shifts(re: float, parameters: FloatArray, series: FloatArray) -> tuple[float, float, float]:
    """The most by which depth, place and width of the bell change where e goes no further than re."""
    e = series[_ENERGY, 0]
    fading = abs(parameters[5]) * re
    deeper = math.inf
    if fading < 0.5 * _LARGEST_EXPONENT:
        deeper = abs(parameters[3]) * series[_FADED, 0] * math.expm1(fading)
    farther = 0.0
    if parameters[4] != 0.0 and parameters[1] != 0.0:
        ratio = abs(parameters[1] * re / (1.0 + parameters[1] * e))
        farther = math.inf
        if ratio < 0.9:
            farther = abs(series[_ROOT, 0]) * ((1.0 - ratio) ** (-1.0 / parameters[_N]) - 1.0)
    broad = abs(parameters[6] + parameters[7] * e)
    wider = broad * deeper + abs(parameters[7]) * re * (abs(parameters[8] + series[_DEPTH, 0]) + deeper)
    return deeper, farther, wider


@inner
def clear(last: int, served: float, pinches: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Fraction of a step, no more than `served`, on which a bell that is left out stays rounding; 0 for none."""
    if pinches or parameters[3] == 0.0 or served == 0.0:
        return served
    for _ in range(_MAX_DISCS):
        rw, re = sum_of_sizes(series, _W, last, served), sum_of_sizes(series, _ENERGY, last, served)
        deeper, farther, wider = shifts(re, parameters, series)
        apart = abs(series[_W, 0] - series[_ROOT, 0]) - rw - farther
        width = abs(series[_WIDTH, 0]) + wider
        depth = abs(series[_DEPTH, 0]) + deeper
        if apart > _CLEAR * width and depth * math.exp(-((apart / width) ** 2)) <= ROUNDING:
            return served
        served *= 0.5
    return 0.0


@inner
def extend(k: int, side: float, free: bool, pinches: bool, parameters: FloatArray, series: FloatArray) -> None:
    """The terms k of all rows, from those of w and e and all terms before.

    They follow from  w g' = n w' g  for g = |w|^n,  nu r' = -nu' r / n  for r = nu^(-1/n),  f' = -p e' f  for
    f = exp(-p e)  and  b' = -(X^2)' b  for b = exp(-X^2).
    """
    n, growth = parameters[_N], parameters[1]
    nu, eta = 1.0 + growth * series[_ENERGY, 0], 1.0 + parameters[2] * series[_ENERGY, 0]
    if free:
        series[_POWER, k] = 0.0
    elif n == 1.0:
        series[_POWER, k] = side * series[_W, k]
    elif n == 2.0:
        series[_POWER, k] = product(series, _W, _W, k, 0)
    else:
        moment = (n + 1.0) * weighted(series, _W, _POWER, k) - k * product(series, _W, _POWER, k, 1)
        series[_POWER, k] = moment / (k * series[_W, 0])
    strength = nu * series[_POWER, k] + growth * product(series, _ENERGY, _POWER, k, 1)
    strength *= parameters[_GAMMA] + side * parameters[_BETA]
    series[_BRACKET, k] = -parameters[0] * series[_ENERGY, k] - strength
    driven = series[_BRACKET, k]
    if pinches:
        moment = (1.0 / n - 1.0) * weighted(series, _ENERGY, _ROOT, k) + k * product(series, _ENERGY, _ROOT, k, 1)
        series[_ROOT, k] = -growth * moment / (k * nu)
        series[_FADED, k] = -parameters[5] * weighted(series, _ENERGY, _FADED, k) / k
        series[_DEPTH, k] = -parameters[3] * series[_FADED, k]
        breadth = parameters[6] + parameters[7] * series[_ENERGY, 0]
        widened = parameters[7] * (product(series, _ENERGY, _DEPTH, k, 1) + parameters[8] * series[_ENERGY, k])
        series[_WIDTH, k] = breadth * series[_DEPTH, k] + widened
        apart = series[_W, k] - series[_ROOT, k] - product(series, _WIDTH, _X, k, 1)
        series[_X, k] = apart / series[_WIDTH, 0]
        series[_SQUARE, k] = product(series, _X, _X, k, 0)
        series[_BELL, k] = -weighted(series, _SQUARE, _BELL, k) / k
        series[_PINCH, k] = -product(series, _DEPTH, _BELL, k, 0)
        driven = product(series, _PINCH, _BRACKET, k, 0)
    series[_SLOPE, k] = (driven - parameters[2] * product(series, _ENERGY, _SLOPE, k, 1)) / eta


@inner
def product(series: FloatArray, a: int, b: int, k: int, first: int) -> float:
    """Sum of a_j b_(k-j) from j = `first` on: the term k of a product, or what of it does not hold a_0."""
    total = 0.0
    for j in range(first, k + 1):
        total += series[a, j] * series[b, k - j]
    return total


@inner
def weighted(series: FloatArray, a: int, b: int, k: int) -> float:
    """Sum of j a_j b_(k-j): k times what a' b gives."""
    total = 0.0
    for j in range(1, k + 1):
        total += j * series[a, j] * series[b, k - j]
    return total
