"""The power series of the Bouc-Wen law of Baber and Noori about a point, with a bound on what it leaves out.

The series of w and e follow term by term from those of nu^(-1/n), exp(-p e), the bell exp(-X^2) and ``|w|^n``; the
equations are those of `hysim.kernels.baber_noori`. On a disc about the point each factor is bounded by its size there
and the most by which it changes, the bell by the least real part of X^2 (`hysim.kernels.remainder`). Far from the bell
all its terms underflow; there it is left out, and a step ends before the bell could be more than rounding.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner, kernel, pasted
from hysim.kernels.remainder import FARTHEST, N_TERMS, ROUNDING, fraction

N_OWN = 9  # delta_a, delta_nu, delta_eta, zeta_s, q, p, psi, delta_psi, lambda, before A, beta, gamma and n
STRENGTH, BETA, GAMMA, EXPONENT = range(N_OWN, N_OWN + 4)
SCALE = EXPONENT + 1  # place of the scales of z and u
TOLERANCE = SCALE + 2

# Rows of the series; `reach`, `place` and `zero` look at row 1.
POWER, MEMORY, ENERGY, _BRACKET, _ROOT, _FADED, _DEPTH, _WIDTH, _X, _SQUARE, _BELL, PINCH, SLOPE = range(13)
N_ROWS = 13

LARGEST = 1.7976931348623157e308
_LARGEST_EXPONENT = 700.0
_WIDEST = 6.0  # disc looked at, in steps: a little wider than what serves a step of N_TERMS
_MAX_DISCS = 40
_ALL, _SMOOTH, _BEND = 0, 1, 2  # parts of dw/dL: together, without the term of |w|^n, this term
_FAR = 8.0  # in X: from here on the bell, below 1e-27, is left out
_CLEAR = 6.0  # and up to here, if it is rounding


@kernel
def begin(w: float, e: float, free: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Fill the first terms, and return the side of zero; a `free` memory is without the term of ``|w|^n``."""
    n, nu = parameters[EXPONENT], 1.0 + parameters[1] * e
    series[MEMORY, 0], series[ENERGY, 0], series[PINCH, 0] = w, e, 1.0
    if parameters[3] != 0.0:
        parting = parameters[4]  # q z_u where nu = 1
        if parting != 0.0:
            loading = parameters[BETA] + parameters[GAMMA]
            parting *= loading ** (-1.0 / n) if loading > 0.0 else math.nan
            parting *= nu ** (-1.0 / n) if nu > 0.0 else math.nan
        series[_ROOT, 0] = parting
        fading = min(-parameters[5] * e, _LARGEST_EXPONENT)
        series[_FADED, 0], series[_DEPTH, 0] = math.exp(fading), -parameters[3] * math.expm1(fading)
        series[_WIDTH, 0] = (parameters[6] + parameters[7] * e) * (parameters[8] + series[_DEPTH, 0])
        series[_X, 0] = (w - series[_ROOT, 0]) / series[_WIDTH, 0]
        series[_SQUARE, 0] = series[_X, 0] * series[_X, 0]
        series[_BELL, 0] = math.exp(-series[_SQUARE, 0])
        series[PINCH, 0] = 1.0 - series[_DEPTH, 0] * series[_BELL, 0]
    strength, eta = parameters[STRENGTH] - parameters[0] * e, 1.0 + parameters[2] * e
    above = w > 0.0 or (w == 0.0 and series[PINCH, 0] * strength / eta > 0.0)
    side = 1.0 if above else -1.0
    series[POWER, 0] = 0.0 if free else abs(w) ** n
    series[_BRACKET, 0] = strength - (parameters[GAMMA] + side * parameters[BETA]) * nu * series[POWER, 0]
    series[SLOPE, 0] = series[PINCH, 0] * series[_BRACKET, 0] / eta
    return side


@inner
def expand(
    w: float, e: float, t: float, free: bool, size: float, parameters: FloatArray, series: FloatArray
) -> tuple[int, float]:
    """Fill the series over a length t until what is left out is within the tolerance of `size`, or the way w goes.

    Returns the index of the last term and the fraction of t that the terms serve, 0 where none is known to.
    """
    side = begin(w, e, free, parameters, series)
    pinches = parameters[3] != 0.0
    if pinches and abs(series[_X, 0]) >= _FAR:
        pinches = False
        series[PINCH, 0], series[SLOPE, 0] = 1.0, series[_BRACKET, 0] / (1.0 + parameters[2] * e)
    tried, scale = 0, size
    for k in range(1, N_TERMS + 1):
        term = t * series[SLOPE, k - 1] / k
        series[MEMORY, k], series[ENERGY, k] = term, t * series[MEMORY, k - 1] / k
        scale = max(size, abs(term)) if k < 2 else scale
        if abs(term) <= parameters[TOLERANCE] * scale and k >= tried:
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
    """Whether the series may end at the term k: whether the terms left out are within the tolerance of `size`."""
    room = parameters[TOLERANCE] * size * (k + 1.0)
    flow = max(abs(series[MEMORY, 1]), parameters[TOLERANCE] * size)
    x, gain, doubling = 2.0, 2.0**k, 2.0**k
    while gain * room < 16.0 * flow and x < LARGEST:
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
            share = x * reached(spread * t * x, size, abs(series[MEMORY, 1]) * x, parameters)
        elif not free:
            shorter = x * inside(N_TERMS, x, series)
            smooth = spread_within(N_TERMS, x, _SMOOTH, pinches, parameters, series)
            bend = spread_within(N_TERMS, shorter, _BEND, pinches, parameters, series)
            if smooth < math.inf and bend < math.inf:
                way = 0.5 * abs(series[MEMORY, 1])
                share = x * reached(smooth * t * x, 0.5 * size, way * x, parameters)
                share = min(share, shorter * reached(bend * t * shorter, 0.5 * size, way * shorter, parameters))
        if share >= 1.0:
            return 1.0
        if share < best:
            break
        best = share
        x *= 0.75 if share > 0.01 * x else 0.25
    return best


@inner
def reached(spread: float, size: float, way: float, parameters: FloatArray) -> float:
    """As `fraction`, beside `size` or beside the part of `way` that the memory goes in this fraction.

    The way of a whole step that only serves in part is no measure: no memory comes there.
    """
    tolerance = parameters[TOLERANCE]
    room = tolerance * way * (1.0 - FARTHEST) * (N_TERMS + 1.0)
    along = FARTHEST
    if room < spread:
        along = min(FARTHEST, (room / spread) ** (1.0 / N_TERMS))
    return float(max(along, fraction(spread * (ROUNDING / tolerance), size)))


@inner
def sum_of_sizes(series: FloatArray, row: int, last: int, x: float) -> float:
    """The largest sum of the terms after the first at the distance x."""
    total = 0.0
    for k in range(last, 0, -1):
        total = (total + abs(series[row, k])) * x
    return total


@inner
def inside(last: int, x: float, series: FloatArray) -> float:
    """Part of the distance x up to which the series of w keeps away from zero."""
    return float(min(1.0, 0.9 * abs(series[MEMORY, 0]) / sum_of_sizes(series, MEMORY, last, x)))


@inner
def spread_within(last: int, x: float, part: int, pinches: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Bound of ``|f - f(0)|`` where the series go at complex distances up to x; inf where none is known.

    f is dw/dL, or the part of it without the term of ``|w|^n``, or this term. Each factor of f is replaced by its size
    at 0 and the most by which it changes.
    """
    rw, re = sum_of_sizes(series, MEMORY, last, x), sum_of_sizes(series, ENERGY, last, x)
    n, w, e = parameters[EXPONENT], series[MEMORY, 0], series[ENERGY, 0]
    growth, eta = abs(parameters[1]) * re, abs(1.0 + parameters[2] * e)
    wear = abs(parameters[2]) * re
    if not (wear < 0.9 * eta and rw < LARGEST):
        return math.inf
    worn = abs(parameters[0]) * re
    if part == _SMOOTH:
        bracket = abs(parameters[STRENGTH] - parameters[0] * e)
        changed = bracket + worn
    else:
        power, nu, size = series[POWER, 0], abs(1.0 + parameters[1] * e), abs(w)
        if n == 1.0:
            rise = rw
        elif n == 2.0:
            rise = rw * (2.0 * size + rw)
        elif rw >= 0.95 * size:
            return math.inf
        else:
            rise = (size + rw) ** n - power if n > 1.0 else power - (size - rw) ** n
        c = abs(parameters[GAMMA] + (parameters[BETA] if w > 0.0 else -parameters[BETA]))
        if w == 0.0:
            c = abs(parameters[GAMMA]) + abs(parameters[BETA])
        change = c * (nu * rise + growth * (power + rise))
        bracket = abs(series[_BRACKET, 0])
        changed = bracket + worn + change
        if part == _BEND:
            bracket = c * nu * power
            changed = bracket + change
    pinch = abs(series[PINCH, 0])
    deeper = pinch_within(rw, re, parameters, series) if pinches else 0.0
    return float((pinch + deeper) * changed / (eta - wear) - pinch * bracket / eta)


@inner
def pinch_within(rw: float, re: float, parameters: FloatArray, series: FloatArray) -> float:
    """Bound of ``|h - its value at 0|`` where w and e go no further than rw and re, by the real part of X^2."""
    return bell_within(rw, re, 0.0, parameters, series)


@inner
def bell_within(rw: float, re: float, least: float, parameters: FloatArray, series: FloatArray) -> float:
    """As `pinch_within`, for a bell whose depth zeta_s is taken as `least` where it is less."""
    deeper, farther, wider = shifts(re, parameters, series)
    if least > 0.0:
        deeper = max(deeper, least * series[_FADED, 0] * math.expm1(min(abs(parameters[5]) * re, _LARGEST_EXPONENT)))
    x, width = abs(series[_X, 0]), abs(series[_WIDTH, 0])
    if not wider < 0.9 * width:
        return math.inf
    apart = (rw + farther + x * wider) / (width - wider)
    exponent = -((x - apart) ** 2) if apart <= 0.5 * x else apart * apart - 0.5 * x * x
    if not exponent < 0.5 * _LARGEST_EXPONENT:
        return math.inf
    highest = math.exp(exponent)
    change = min(highest * apart * (2.0 * x + apart), highest + series[_BELL, 0])
    return float(max(least, abs(series[_DEPTH, 0])) * change + deeper * highest)


@inner
def shifts(re: float, parameters: FloatArray, series: FloatArray) -> tuple[float, float, float]:
    """The most by which depth, place and width of the bell change where e goes no further than re."""
    e = series[ENERGY, 0]
    fading = abs(parameters[5]) * re
    deeper = math.inf
    if fading < 0.5 * _LARGEST_EXPONENT:
        deeper = abs(parameters[3]) * series[_FADED, 0] * math.expm1(fading)
    farther = 0.0
    if parameters[4] != 0.0 and parameters[1] != 0.0:
        ratio = abs(parameters[1] * re / (1.0 + parameters[1] * e))
        farther = math.inf
        if ratio < 0.9:
            farther = abs(series[_ROOT, 0]) * ((1.0 - ratio) ** (-1.0 / parameters[EXPONENT]) - 1.0)
    broad = abs(parameters[6] + parameters[7] * e)
    wider = broad * deeper + abs(parameters[7]) * re * (abs(parameters[8] + series[_DEPTH, 0]) + deeper)
    return deeper, farther, wider


@inner
def clear(last: int, served: float, pinches: bool, parameters: FloatArray, series: FloatArray) -> float:
    """Fraction of a step, no more than `served`, on which a bell left out stays within the tolerance; 0 for none."""
    if pinches or parameters[3] == 0.0 or served == 0.0:
        return served
    for _ in range(_MAX_DISCS):
        rw, re = sum_of_sizes(series, MEMORY, last, served), sum_of_sizes(series, ENERGY, last, served)
        deeper, farther, wider = shifts(re, parameters, series)
        apart = abs(series[MEMORY, 0] - series[_ROOT, 0]) - rw - farther
        width = abs(series[_WIDTH, 0]) + wider
        depth = abs(series[_DEPTH, 0]) + deeper
        if apart > _CLEAR * width and depth * math.exp(-((apart / width) ** 2)) <= parameters[TOLERANCE]:
            return served
        served *= 0.5
    return 0.0


@inner
def extend(k: int, side: float, free: bool, pinches: bool, parameters: FloatArray, series: FloatArray) -> None:
    """The terms k of all rows, from those of w and e and all terms before.

    They follow from  w g' = n w' g  for g = |w|^n,  nu r' = -nu' r / n  for r = nu^(-1/n),  f' = -p e' f  for
    f = exp(-p e)  and  b' = -(X^2)' b  for b = exp(-X^2).
    """
    n, growth = parameters[EXPONENT], parameters[1]
    nu, eta = 1.0 + growth * series[ENERGY, 0], 1.0 + parameters[2] * series[ENERGY, 0]
    if free:
        series[POWER, k] = 0.0
    elif n == 1.0:
        series[POWER, k] = side * series[MEMORY, k]
    elif n == 2.0:
        series[POWER, k] = product(series, MEMORY, MEMORY, k, 0)
    else:
        moment = (n + 1.0) * weighted(series, MEMORY, POWER, k) - k * product(series, MEMORY, POWER, k, 1)
        series[POWER, k] = moment / (k * series[MEMORY, 0])
    strength = nu * series[POWER, k] + growth * product(series, ENERGY, POWER, k, 1)
    strength *= parameters[GAMMA] + side * parameters[BETA]
    series[_BRACKET, k] = -parameters[0] * series[ENERGY, k] - strength
    driven = series[_BRACKET, k]
    if pinches:
        moment = (1.0 / n - 1.0) * weighted(series, ENERGY, _ROOT, k) + k * product(series, ENERGY, _ROOT, k, 1)
        series[_ROOT, k] = -growth * moment / (k * nu)
        series[_FADED, k] = -parameters[5] * weighted(series, ENERGY, _FADED, k) / k
        series[_DEPTH, k] = -parameters[3] * series[_FADED, k]
        breadth = parameters[6] + parameters[7] * series[ENERGY, 0]
        widened = parameters[7] * (product(series, ENERGY, _DEPTH, k, 1) + parameters[8] * series[ENERGY, k])
        series[_WIDTH, k] = breadth * series[_DEPTH, k] + widened
        apart = series[MEMORY, k] - series[_ROOT, k] - product(series, _WIDTH, _X, k, 1)
        series[_X, k] = apart / series[_WIDTH, 0]
        series[_SQUARE, k] = product(series, _X, _X, k, 0)
        series[_BELL, k] = -weighted(series, _SQUARE, _BELL, k) / k
        series[PINCH, k] = -product(series, _DEPTH, _BELL, k, 0)
        driven = product(series, PINCH, _BRACKET, k, 0)
    series[SLOPE, k] = (driven - parameters[2] * product(series, ENERGY, SLOPE, k, 1)) / eta


@pasted
def product(series: FloatArray, a: int, b: int, k: int, first: int) -> float:
    """Sum of a_j b_(k-j) from j = `first` on: the term k of a product, or what of it does not hold a_0."""
    total = 0.0
    for j in range(first, k + 1):
        total += series[a, j] * series[b, k - j]
    return total


@pasted
def weighted(series: FloatArray, a: int, b: int, k: int) -> float:
    """Sum of j a_j b_(k-j): k times what a' b gives."""
    total = 0.0
    for j in range(1, k + 1):
        total += j * series[a, j] * series[b, k - j]
    return total
