"""The universal branch of the Bouc-Wen law for any n, by charts that are made when they are first visited.

Measured in w* = |a/c|^(1/n), the value at which its two terms balance, each side of z = 0 moves on

    dw/dT = 1 - sigma w^n,    sigma = 1 or -1,    w >= 0

forwards or backwards in T. A way of length L goes from w to the point where T has changed by L. T(w) is a
hypergeometric function, which is slow, but it is analytic away from w = 0 and w^n = sigma. So the branch
is covered by charts, each with two polynomials, there (from w to T) and back (from T to w):

    near zero     w^n <= 1/64, with x = sigma w^n and y = sigma T^n
                      T = w sum x^k / (k n + 1),    w = T sum v_k y^k,    (1 + k n) v_k = -[v^n]_(k-1)
    cells         |w - w_c| <= 1/8 of the distance at which a series about w_c ends, with r = w/w_c - 1
                      s = (T - T_c)/w_c = sum q_k r^k, the integral of 1/(1 - sigma w_c^n (1 + r)^n),
                      r = sum p_k s^k
    saturation    max(n, 1) |1 - w| <= 1/10 and sigma = 1, with e = max(n, 1) (1 - w)
                      S = e sum s_k e^k, which the flow takes to S exp(-n T) (Koenigs),    e = S sum e_k S^k
    elsewhere     (far beyond saturation) Taylor steps of the flow, whose order follows their terms

Sixteen terms, eight near zero, leave out less than 2^-54 of w. Both the change of w and the end itself are returned: a
short way by its change carries no more rounding than the sum at its end, and a decay by many decades keeps its digits,
and its side of the balance, by its end. A chart depends on n and sigma alone, not on which ones were made before.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner
from hysim.kernels.elementary import N_TERMS, sum8, sum16

_N_CELLS = 64
_REACH = 0.125  # half width of a cell over the distance at which its series end
_SATURATION = 0.1  # half width of the chart of saturation
_ZERO = 1.0 / 64.0  # w^n at the end of the chart near zero
_NEGLIGIBLE = 2.0**-54
_NOT_NEGATIVE = 0xFFFF  # as in `hysim.kernels.elementary`
_LARGEST_EXPONENT = 700.0

# The workspace of a law. Its first places are the caller's; then the cell of the last visit for each sigma; four
# series, the places where the charts meet, the edges of both lines of cells; for each cell w_c, 1/w_c, s at both
# ends, the length in T, two series; and room for a Taylor series.
FREE = 8
_VISITED = FREE
_ZERO_THERE, _ZERO_BACK, _SATURATION_THERE, _SATURATION_BACK, _PLACES = (FREE + 2 + k * 8 for k in (0, 1, 2, 4, 6))
_W_ZERO, _W_LOW, _W_HIGH, _S_LOW, _S_HIGH, _W_FAR, _T_ZERO, _LAST_CELL = (_PLACES + k for k in (*range(7), 8))
_EDGES = _PLACES + 10
_CELLS = _EDGES + 2 * (_N_CELLS + 1)
_CENTRE, _INVERSE, _BELOW, _ABOVE, _LENGTH, _THERE, _BACK = 0, 1, 2, 3, 4, 5, 5 + N_TERMS
_CELL = 5 + 2 * N_TERMS
_SPARE = _CELLS + 2 * _N_CELLS * _CELL
_N_TAYLOR = 32
_TAYLOR_REACH = 0.25  # of a bound of the distance at which the series ends: 31 terms leave out 4^-32
N_WORK = _SPARE + 2 * _N_TAYLOR


Moved = tuple[float, float, float]  # the change of w, the length left over, and the end


# ---------------------------------------------------------------------------------- constants of an exponent


@inner
def prepare_exponent(n: float, work: FloatArray) -> None:
    """Fill `work`, shape (N_WORK,), from FREE on with what all charts of an exponent share, and forget its cells."""
    for k in range(8):
        work[_ZERO_THERE + k] = 1.0 / ((k + 1) * n + 1.0)
    zero_back(n, work)
    saturation(n, work)
    w_zero = _ZERO ** (1.0 / n)
    half = _SATURATION / max(n, 1.0)
    work[_W_ZERO], work[_W_LOW], work[_W_HIGH] = w_zero, 1.0 - half, 1.0 + half
    work[_S_LOW] = _SATURATION * sum16(work, _SATURATION_THERE, _SATURATION)
    work[_S_HIGH] = -_SATURATION * sum16(work, _SATURATION_THERE, -_SATURATION)
    work[_W_FAR] = math.exp(min(_LARGEST_EXPONENT, -math.log(_NEGLIGIBLE) / n))
    for side in range(2):
        x = _ZERO if side == 0 else -_ZERO
        work[_VISITED + side] = 0.0
        work[_T_ZERO + side] = w_zero + w_zero * x * sum8(work, _ZERO_THERE, x)
        work[_LAST_CELL + side] = edges(n, side, w_zero, 1.0 - half, work) - 1.0
    for i in range(2 * _N_CELLS):
        work[_CELLS + i * _CELL + _CENTRE] = 0.0


@inner
def zero_back(n: float, work: FloatArray) -> None:
    """Fill v_1 to v_8 of w = T (1 + v_1 y + ...), with the spare room for the coefficients of v^n."""
    work[_SPARE] = 1.0
    for k in range(1, 9):
        work[_ZERO_BACK + k - 1] = -work[_SPARE + k - 1] / (1.0 + k * n)
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * work[_ZERO_BACK + j - 1] * work[_SPARE + k - j]
        work[_SPARE + k] = convolution / k


@inner
def saturation(n: float, work: FloatArray) -> None:
    """Fill both series of the chart of saturation.

    With e' = -n e f(e), f = 1 + f_1 e + ...: S'(e)/S = 1/(e f), so (e S')(f) = S; and S e'(S) = e f(e).
    """
    scale = max(n, 1.0)
    # (1 - (1 - e/m)^n) m / (n e): each term follows from the last
    work[_SPARE] = 1.0
    for k in range(1, N_TERMS):
        work[_SPARE + k] = work[_SPARE + k - 1] * (k - n) / ((k + 1) * scale)
    work[_SATURATION_THERE] = 1.0
    for k in range(1, N_TERMS):
        total = 0.0
        for j in range(k):
            total += (j + 1) * work[_SATURATION_THERE + j] * work[_SPARE + k - j]
        work[_SATURATION_THERE + k] = -total / k
    # b = (1 - e/m)^n as a series in S, from (1 - e/m) b' = -(n/m) e' b; then S e' = (m/n) (1 - b)
    work[_SATURATION_BACK], work[_SPARE], work[_SPARE + 1] = 1.0, 1.0, -n / scale
    for k in range(2, N_TERMS + 1):
        # the coefficient k of b holds -(n/m) e_k, which S e' = (m/n)(1 - b) then determines
        total = 0.0
        for j in range(1, k):
            total += (j * (n + 1.0) - k) * (-work[_SATURATION_BACK + j - 1] / scale) * work[_SPARE + k - j]
        work[_SATURATION_BACK + k - 1] = -(scale / n) * (total / k) / (k - 1.0)
        work[_SPARE + k] = total / k - n / scale * work[_SATURATION_BACK + k - 1]


@inner
def edges(n: float, side: int, bottom: float, top: float, work: FloatArray) -> int:
    """Fill the edges of a line of cells, upwards from `bottom`, for sigma = 1 to `top`; the number of cells."""
    first = _EDGES + side * (_N_CELLS + 1)
    work[first] = below = bottom
    ratio = _REACH / max(n, 1.0)
    for i in range(_N_CELLS):
        half = below * ratio / (1.0 - ratio)
        if side == 0:
            half = 0.0
            for _ in range(3):  # h = reach * distance(w + h) contracts by 1/8 each time
                half = _REACH * distance(below + half, n)
        below += 2.0 * half
        if side == 0 and below >= top:
            work[first + i + 1] = top
            return i + 1
        work[first + i + 1] = below
    return _N_CELLS


@inner
def distance(w: float, n: float) -> float:
    """Distance from w at which, at sigma = 1, the series about it end: zero, or the nearest root of w^n = 1.

    For n < 1 the series of w(T) end a little before. At sigma = -1 it is w / max(n, 1), an escape.
    """
    nearest = min(w, 1.0 - w) * min(1.0, 0.7 + 0.35 * n)
    if n > 2.0:
        angle = 2.0 * math.pi / n
        nearest = min(nearest, math.hypot(w - math.cos(angle), math.sin(angle)))
    return nearest


# ---------------------------------------------------------------------------------- moving on the branch


@inlined
def in_chart(w: float, forwards: bool, side: int, n: float, length: float, work: FloatArray) -> Moved:
    """From w over `length` in T within one chart, or up to its end: the change of w, the length left over, the end.

    `side` is 0 for sigma = 1 and 1 for sigma = -1. The change is inf for a memory that
    diverges. The end has the rounding of its own size, and lies on the side of the balance on which the way began.
    """
    if w < work[_W_ZERO] or (w == work[_W_ZERO] and not forwards):
        return near_zero(w, forwards, side, n, length, work)
    if side == 0:
        low, high = work[_W_LOW], work[_W_HIGH]
        if (low <= w <= high) if forwards else (low < w < high):
            return near_saturation(w, forwards, n, length, work)
    last = int(work[_LAST_CELL + side]) & _NOT_NEGATIVE
    top = work[_EDGES + side * (_N_CELLS + 1) + last + 1]
    if w < top or (w == top and not forwards):
        return along_cells(w, forwards, side, last, n, length, work)
    return far_step(w, forwards, side, n, length, work)


@inlined
def near_zero(w: float, forwards: bool, side: int, n: float, length: float, work: FloatArray) -> Moved:
    """As `in_chart` near zero; the way backwards ends at w = 0."""
    x = w**n if side == 0 else -(w**n)
    beyond = w * x * sum8(work, _ZERO_THERE, x)  # T - w
    way = length if forwards else -length
    target = w + beyond + way
    if target <= 0.0:
        return -w, -target, 0.0
    if target > work[_T_ZERO + side] and forwards:
        return work[_W_ZERO] - w, target - work[_T_ZERO + side], work[_W_ZERO]
    y = target**n if side == 0 else -(target**n)
    bend = target * y * sum8(work, _ZERO_BACK, y)
    return way + (beyond + bend), 0.0, target + bend


@inlined
def near_saturation(w: float, forwards: bool, n: float, length: float, work: FloatArray) -> Moved:
    """As `in_chart` near w = 1 at sigma = 1; only the way backwards has an end."""
    scale = max(n, 1.0)
    e = scale * (1.0 - w)
    if e == 0.0:
        return 0.0, 0.0, w
    s = e * sum16(work, _SATURATION_THERE, e)
    exponent = n * length
    if not forwards:
        end, half = (work[_S_LOW], _SATURATION) if e > 0.0 else (work[_S_HIGH], -_SATURATION)
        to_end = math.log(end / s)
        if exponent > to_end:
            return (e - half) / scale, (exponent - to_end) / n, work[_W_LOW] if e > 0.0 else work[_W_HIGH]
        exponent = -exponent
    s *= math.exp(-exponent)
    below = s * sum16(work, _SATURATION_BACK, s)
    return (e - below) / scale, 0.0, 1.0 - below / scale


@inlined
def along_cells(w: float, forwards: bool, side: int, last: int, n: float, length: float, work: FloatArray) -> Moved:
    """As `in_chart` in a line of cells; `last` is the uppermost."""
    i = int(work[_VISITED + side]) & _NOT_NEGATIVE
    edge = _EDGES + side * (_N_CELLS + 1) + i
    if w < work[edge] or w > work[edge + 1] or w == (work[edge + 1] if forwards else work[edge]):
        i = find(w, forwards, side, i, work)
    cell = visit(i, side, n, work)
    centre = start = work[cell + _CENTRE]
    inverse = work[cell + _INVERSE]
    begin = (w - start) * inverse
    s = begin * sum16(work, cell + _THERE, begin)
    s = s + length * inverse if forwards else s - length * inverse
    if s < work[cell + _BELOW] or s > work[cell + _ABOVE]:
        i, s, left = walk(i, s, forwards, side, last, n, work)
        if left > 0.0:
            end = work[_EDGES + side * (_N_CELLS + 1) + (last + 1 if forwards else 0)]
            return end - w, left, end
        cell = (_CELLS + (side * _N_CELLS + i) * _CELL) & _NOT_NEGATIVE
        centre = work[cell + _CENTRE]
    work[_VISITED + side] = i
    r = s * sum16(work, cell + _BACK, s)
    end = centre + r * centre
    if centre == start:
        return (r - begin) * centre, 0.0, end
    return (centre - start) + (r * centre - begin * start), 0.0, end


@inner
def find(w: float, forwards: bool, side: int, i: int, work: FloatArray) -> int:
    """The cell from which a way from w begins, sought from the cell `i`."""
    edge = _EDGES + side * (_N_CELLS + 1)
    while w > work[edge + i + 1] or (w == work[edge + i + 1] and forwards):
        i += 1
    while w < work[edge + i] or (w == work[edge + i] and not forwards):
        i -= 1
    return i


@inner
def walk(
    i: int, s: float, forwards: bool, side: int, last: int, n: float, work: FloatArray
) -> tuple[int, float, float]:
    """From the place s, beyond the end of the cell `i`, to a cell and a place in it, or what is left after the last."""
    cell = visit(i, side, n, work)
    left = (s - work[cell + _ABOVE] if forwards else work[cell + _BELOW] - s) * work[cell + _CENTRE]
    final, by = (last, 1) if forwards else (0, -1)
    while i != final:
        i += by
        cell = visit(i, side, n, work)
        if left <= work[cell + _LENGTH]:
            way = left * work[cell + _INVERSE]
            return i, work[cell + _BELOW] + way if forwards else work[cell + _ABOVE] - way, 0.0
        left -= work[cell + _LENGTH]
    return i, s, left


@inlined
def visit(i: int, side: int, n: float, work: FloatArray) -> int:
    """Begin of the cell `i`, which is made at the first visit."""
    cell = (_CELLS + (side * _N_CELLS + i) * _CELL) & _NOT_NEGATIVE
    if work[cell + _CENTRE] == 0.0:
        edge = _EDGES + side * (_N_CELLS + 1) + i
        make_cell(work[edge], work[edge + 1], side, n, work[cell : cell + _CELL], work[_SPARE:])
    return cell


@inner
def make_cell(below: float, above: float, side: int, n: float, cell: FloatArray, spare: FloatArray) -> None:
    """Both series about the middle of a cell."""
    centre = 0.5 * (below + above)
    x = centre**n if side == 0 else -(centre**n)
    cell[_CENTRE], cell[_INVERSE] = centre, 1.0 / centre
    cell_series(x, n, cell[_THERE:_BACK], cell[_BACK:], spare[: N_TERMS + 1], spare[N_TERMS + 1 :])
    cell[_BELOW] = (below - centre) * cell[_INVERSE]
    cell[_BELOW] *= sum16(cell, _THERE, cell[_BELOW])
    cell[_ABOVE] = (above - centre) * cell[_INVERSE]
    cell[_ABOVE] *= sum16(cell, _THERE, cell[_ABOVE])
    cell[_LENGTH] = (cell[_ABOVE] - cell[_BELOW]) * centre


@inner
def cell_series(x: float, n: float, q: FloatArray, p: FloatArray, slope: FloatArray, power: FloatArray) -> None:
    """q_1 to q_16 of the integral of 1/(1 - x (1 + r)^n), and p_1 to p_16 of r(s) on dr/ds = 1 - x (1 + r)^n.

    `slope` and `power` take the coefficients of the denominator, and of (1 + r(s))^n. The two recursions wait
    for their sums, each for itself: in one loop they take the time of one.
    """
    first, term, one_more = 1.0 / (1.0 - x), -x, n + 1.0
    q[0], p[0], power[0] = first, 1.0 - x, 1.0
    for k in range(1, N_TERMS):
        term *= (n - k + 1.0) / k
        slope[k] = term
        total, convolution, weight = 0.0, 0.0, -float(k)
        for j in range(1, k + 1):
            weight += one_more
            total += slope[j] * q[k - j]
            convolution += weight * p[j - 1] * power[k - j]
        q[k] = -total * first
        power[k] = convolution / k
        p[k] = -x * power[k] / (k + 1.0)
    for k in range(1, N_TERMS):
        q[k] /= k + 1.0


# ---------------------------------------------------------------------------------- far from saturation


@inner
def far_step(w: float, forwards: bool, side: int, n: float, length: float, work: FloatArray) -> Moved:
    """As `in_chart`, for a step of the flow about w, as long as its series serves."""
    a = 1.0 if forwards else -1.0
    c = a if side == 0 else -a
    far = work[_W_FAR]
    if w > far:
        to_far = math.inf
        if c > 0.0:
            to_far = far ** (1.0 - n) * -math.expm1((1.0 - n) * math.log(w / far)) / (n - 1.0)
        if length > to_far:
            return far - w, length - to_far, far
        end = power_flow(w, c, n, length)
        return end - w, 0.0, end
    power = w**n
    h = min(length, _TAYLOR_REACH * w / (max(n, 1.0) * (1.0 + power)))
    change = taylor_change(w, power, a, c, n, h, work[_SPARE:])
    return change, length - h, w + change


@inner
def taylor_change(w: float, power: float, a: float, c: float, n: float, h: float, spare: FloatArray) -> float:
    """Change after `h` on w' = a - c w^n by the Taylor series about w > 0.

    With w(h) = sum t_k and w(h)^n = sum g_k, the identity w (w^n)' = n w' w^n gives both recursively.
    """
    t, g = spare[:_N_TAYLOR], spare[_N_TAYLOR:]
    g[0] = power
    t[1] = (a - c * power) * h
    total = t[1]
    for k in range(1, _N_TAYLOR - 1):
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * t[j] * g[k - j]
        g[k] = convolution / (k * w)
        t[k + 1] = -c * h * g[k] / (k + 1)
        total += t[k + 1]
        if abs(t[k + 1]) + abs(t[k]) < _NEGLIGIBLE * w:
            break
    return float(total)


@inner
def power_flow(w: float, c: float, n: float, length: float) -> float:
    """Flow of w' = -c w^n, for n other than 1."""
    if w == 0.0 or c == 0.0:
        return w
    m = n - 1.0
    exponent = m * math.log(w)
    if exponent > _LARGEST_EXPONENT:  # w has no part in the result
        return math.inf if c < 0.0 else math.exp(-math.log(m * c * length) / m)
    x = m * c * math.exp(exponent) * length
    if x <= -1.0:
        return math.inf if m > 0.0 else 0.0
    if x > 1.0:  # the logarithm of w would be lost beside that of the length, and its rounding with it
        return float((m * c * length * (1.0 + 1.0 / x)) ** (-1.0 / m))
    return w * math.exp(-math.log1p(x) / m)
