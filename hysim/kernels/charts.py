"""The universal branch of the Bouc-Wen law for any n, by charts that are made when they are first visited.

Measured in w* = |a/c|^(1/n), the value at which its two terms balance, each side of z = 0 moves on

    dw/dT = 1 - sigma w^n,    sigma = 1 or -1,    w >= 0

forwards or backwards in T. A way of length L goes from w to the point where T has changed by L. T(w) is a
hypergeometric function, which is slow, but it is analytic away from w = 0 and w^n = sigma. So the branch
is covered by charts, each with two polynomials, there (from w to T) and back (from T to w):

    near zero     w^n <= 1/16, with x = sigma w^n and y = sigma T^n
                      T = w sum x^k / (k n + 1),    w = T sum v_k y^k,    (1 + k n) v_k = -[v^n]_(k-1)
    cells         |w - w_c| <= 1/8 of the distance at which a series about w_c ends, with r = w/w_c - 1
                      s = (T - T_c)/w_c = sum q_k r^k, the integral of 1/(1 - sigma w_c^n (1 + r)^n),
                      r = sum p_k s^k
    saturation    max(n, 1) |1 - w| <= 1/10 and sigma = 1, with e = max(n, 1) (1 - w)
                      S = e sum s_k e^k, which the flow takes to S exp(-n T) (Koenigs),    e = S sum e_k S^k
    elsewhere     (far beyond saturation) Taylor steps of the flow, whose order follows their terms

The sixteen terms leave out less than 2^-54 of w. What is returned is the change of w, so that a short way
carries no more rounding than the sum at its end. A chart depends on n and sigma alone: it does not matter
which ones have been made before.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel
from hysim.kernels.polynomials import N_TERMS, sum16

_N_CELLS = 64
_REACH = 0.125  # half width of a cell over the distance at which its series end
_SATURATION = 0.1  # half width of the chart of saturation
_ZERO = 0.0625  # w^n at the end of the chart near zero
_NEGLIGIBLE = 2.0**-54
_LARGEST_EXPONENT = 700.0

# The constants of an exponent: four series, the places where the charts meet, the edges of both lines of cells.
_ZERO_THERE, _ZERO_BACK, _SATURATION_THERE, _SATURATION_BACK = range(0, 4 * N_TERMS, N_TERMS)
_W_ZERO, _W_LOW, _W_HIGH, _S_LOW, _S_HIGH, _W_FAR, _T_ZERO, _LAST_CELL = (4 * N_TERMS + k for k in (*range(7), 8))
_EDGES = 4 * N_TERMS + 10
N_EXPONENT = _EDGES + 2 * (_N_CELLS + 1)

# The charts: the cell of the last visit for each sigma, then for each cell w_c, 1/w_c, s at both ends, two series.
_CENTRE, _INVERSE, _BELOW, _ABOVE, _THERE, _BACK = 0, 1, 2, 3, 4, 4 + N_TERMS
_CELL = 4 + 2 * N_TERMS
_CELLS = 2
_SPARE = _CELLS + 2 * _N_CELLS * _CELL
_N_TAYLOR = 32
N_CHARTS = _SPARE + 2 * _N_TAYLOR


# ---------------------------------------------------------------------------------- constants of an exponent


@kernel
def prepare_exponent(n: float, constants: FloatArray) -> None:
    """Fill `constants`, shape (N_EXPONENT,), with what all charts of an exponent share."""
    constants[:] = 0.0
    for k in range(N_TERMS):
        constants[_ZERO_THERE + k] = 1.0 / ((k + 1) * n + 1.0)
    zero_back(n, constants[_ZERO_BACK:], constants[_EDGES:])
    saturation(n, constants[_SATURATION_THERE:], constants[_SATURATION_BACK:], constants[_EDGES:])
    w_zero = _ZERO ** (1.0 / n)
    half = _SATURATION / max(n, 1.0)
    constants[_W_ZERO] = w_zero
    constants[_W_LOW], constants[_W_HIGH] = 1.0 - half, 1.0 + half
    constants[_S_LOW] = _SATURATION * sum16(constants, _SATURATION_THERE, _SATURATION)
    constants[_S_HIGH] = -_SATURATION * sum16(constants, _SATURATION_THERE, -_SATURATION)
    constants[_W_FAR] = math.exp(min(_LARGEST_EXPONENT, -math.log(_NEGLIGIBLE) / n))
    for side in range(2):
        x = _ZERO if side == 0 else -_ZERO
        constants[_T_ZERO + side] = w_zero + w_zero * x * sum16(constants, _ZERO_THERE, x)
        first = _EDGES + side * (_N_CELLS + 1)
        constants[_LAST_CELL + side] = edges(n, side, w_zero, 1.0 - half, constants[first:]) - 1.0


@kernel
def zero_back(n: float, v: FloatArray, power: FloatArray) -> None:
    """Fill v_1 to v_16 of w = T (1 + v_1 y + ...), with `power` for the coefficients of v^n."""
    power[0] = 1.0
    for k in range(1, N_TERMS + 1):
        v[k - 1] = -power[k - 1] / (1.0 + k * n)
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * v[j - 1] * power[k - j]
        power[k] = convolution / k


@kernel
def saturation(n: float, there: FloatArray, back: FloatArray, spare: FloatArray) -> None:
    """Fill both series of the chart of saturation.

    With e' = -n e f(e), f = 1 + f_1 e + ...: S'(e)/S = 1/(e f), so (e S')(f) = S; and S e'(S) = e f(e).
    """
    scale = max(n, 1.0)
    f, bracket = spare[: N_TERMS + 1], spare[N_TERMS + 1 :]
    # (1 - (1 - e/m)^n) m / (n e): each term follows from the last
    f[0] = 1.0
    for k in range(1, N_TERMS):
        f[k] = f[k - 1] * (k - n) / ((k + 1) * scale)
    there[0] = 1.0
    for k in range(1, N_TERMS):
        total = 0.0
        for j in range(k):
            total += (j + 1) * there[j] * f[k - j]
        there[k] = -total / k
    # b = (1 - e/m)^n as a series in S, from (1 - e/m) b' = -(n/m) e' b; then S e' = (m/n) (1 - b)
    back[0], bracket[0], bracket[1] = 1.0, 1.0, -n / scale
    for k in range(2, N_TERMS + 1):
        # the coefficient k of b holds -(n/m) e_k, which S e' = (m/n)(1 - b) then determines
        total = 0.0
        for j in range(1, k):
            total += (j * (n + 1.0) - k) * (-back[j - 1] / scale) * bracket[k - j]
        back[k - 1] = -(scale / n) * (total / k) / (k - 1.0)
        bracket[k] = total / k - n / scale * back[k - 1]


@kernel
def edges(n: float, side: int, bottom: float, top: float, out: FloatArray) -> int:
    """Fill the edges of a line of cells, upwards from `bottom`, for sigma = 1 to `top`; the number of cells."""
    out[0] = bottom
    ratio = _REACH / max(n, 1.0)
    for i in range(_N_CELLS):
        half = out[i] * ratio / (1.0 - ratio)
        if side == 0:
            half = 0.0
            for _ in range(3):  # h = reach * distance(w + h) contracts by 1/8 each time
                half = _REACH * distance(out[i] + half, n)
        out[i + 1] = out[i] + 2.0 * half
        if side == 0 and out[i + 1] >= top:
            out[i + 1] = top
            return i + 1
    return _N_CELLS


@kernel
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


@kernel
def forget(charts: FloatArray) -> None:
    """Make `charts`, shape (N_CHARTS,), ready for another exponent."""
    charts[:_CELLS] = 0.0
    for i in range(2 * _N_CELLS):
        charts[_CELLS + i * _CELL] = 0.0


@kernel
def move(
    w: float, forwards: bool, side: int, n: float, length: float, constants: FloatArray, charts: FloatArray
) -> tuple[float, float]:
    """Change of w over `length` in T, or up to w = 0, and the length left over then.

    `side` is 0 for sigma = 1 and 1 for sigma = -1. An escape is a change of inf.
    """
    change = 0.0
    for _ in range(1_000_000):
        if w < constants[_W_ZERO] or (w == constants[_W_ZERO] and not forwards):
            part, left = near_zero(w, forwards, side, n, length, constants)
            if left == 0.0 or not forwards:
                return change + part, left
            after = constants[_W_ZERO]
        elif side == 0 and in_saturation(w, forwards, constants):
            part, left = near_saturation(w, forwards, n, length, constants)
            after = constants[_W_LOW] if w < 1.0 else constants[_W_HIGH]
        elif in_cells(w, forwards, side, constants):
            part, left, after = along_cells(w, forwards, side, n, length, constants, charts)
        else:
            part, left = far_step(w, forwards, side, n, length, constants, charts)
            after = w + part
        change += part
        if left == 0.0:
            break
        w, length = after, left
    return change, 0.0


@kernel
def in_saturation(w: float, forwards: bool, constants: FloatArray) -> bool:
    """Whether a way from w, at sigma = 1, begins in the chart of saturation."""
    low, high = constants[_W_LOW], constants[_W_HIGH]
    return low <= w <= high if forwards else low < w < high


@kernel
def in_cells(w: float, forwards: bool, side: int, constants: FloatArray) -> bool:
    """Whether a way from w, not near zero, begins in a cell."""
    top = constants[_EDGES + side * (_N_CELLS + 1) + int(constants[_LAST_CELL + side]) + 1]
    return w < top if forwards else w <= top


@kernel
def near_zero(
    w: float, forwards: bool, side: int, n: float, length: float, constants: FloatArray
) -> tuple[float, float]:
    """As `move`, from w near zero to the end of that chart or to w = 0."""
    x = w**n if side == 0 else -(w**n)
    beyond = w * x * sum16(constants, _ZERO_THERE, x)  # T - w
    way = length if forwards else -length
    target = w + beyond + way
    if target <= 0.0:
        return -w, -target
    if target > constants[_T_ZERO + side] and forwards:
        return constants[_W_ZERO] - w, target - constants[_T_ZERO + side]
    y = target**n if side == 0 else -(target**n)
    return way + (beyond + target * y * sum16(constants, _ZERO_BACK, y)), 0.0


@kernel
def near_saturation(w: float, forwards: bool, n: float, length: float, constants: FloatArray) -> tuple[float, float]:
    """As `move`, from w near 1 at sigma = 1 to the end of that chart, which only a way backwards reaches."""
    scale = max(n, 1.0)
    e = scale * (1.0 - w)
    if e == 0.0:
        return 0.0, 0.0
    s = e * sum16(constants, _SATURATION_THERE, e)
    exponent = n * length
    if not forwards:
        end, half = (constants[_S_LOW], _SATURATION) if e > 0.0 else (constants[_S_HIGH], -_SATURATION)
        to_end = math.log(end / s)
        if exponent > to_end:
            return (e - half) / scale, (exponent - to_end) / n
        exponent = -exponent
    s *= math.exp(-exponent)
    return (e - s * sum16(constants, _SATURATION_BACK, s)) / scale, 0.0


@kernel
def along_cells(
    w: float, forwards: bool, side: int, n: float, length: float, constants: FloatArray, charts: FloatArray
) -> tuple[float, float, float]:
    """As `move`, from w in a cell to the end of the line of cells, which is the third value."""
    edge, last = _EDGES + side * (_N_CELLS + 1), int(constants[_LAST_CELL + side])
    i = int(charts[side])
    if forwards:
        while w >= constants[edge + i + 1]:
            i += 1
        while w < constants[edge + i]:
            i -= 1
    else:
        while w > constants[edge + i + 1]:
            i += 1
        while w <= constants[edge + i]:
            i -= 1
    cell = visit(i, side, n, constants, charts)
    centre = start = charts[cell + _CENTRE]
    r = begin = (w - start) * charts[cell + _INVERSE]
    s = r * sum16(charts, cell + _THERE, r)
    if forwards:
        s += length * charts[cell + _INVERSE]
        while s > charts[cell + _ABOVE]:
            left = (s - charts[cell + _ABOVE]) * centre
            if i == last:
                charts[side] = i
                return constants[edge + i + 1] - w, left, constants[edge + i + 1]
            i += 1
            cell = visit(i, side, n, constants, charts)
            centre = charts[cell + _CENTRE]
            s = charts[cell + _BELOW] + left * charts[cell + _INVERSE]
    else:
        s -= length * charts[cell + _INVERSE]
        while s < charts[cell + _BELOW]:
            left = (charts[cell + _BELOW] - s) * centre
            if i == 0:
                charts[side] = i
                return constants[edge] - w, left, constants[edge]
            i -= 1
            cell = visit(i, side, n, constants, charts)
            centre = charts[cell + _CENTRE]
            s = charts[cell + _ABOVE] - left * charts[cell + _INVERSE]
    charts[side] = i
    r = s * sum16(charts, cell + _BACK, s)
    if centre == start:
        return (r - begin) * centre, 0.0, w
    return (centre - start) + (r * centre - begin * start), 0.0, w


@kernel
def visit(i: int, side: int, n: float, constants: FloatArray, charts: FloatArray) -> int:
    """Where the cell `i` begins in `charts`; it is made if this is the first visit."""
    cell = _CELLS + (side * _N_CELLS + i) * _CELL
    if charts[cell + _CENTRE] == 0.0:
        edge = _EDGES + side * (_N_CELLS + 1) + i
        make_cell(constants[edge], constants[edge + 1], side, n, charts[cell : cell + _CELL], charts[_SPARE:])
    return cell


@kernel
def make_cell(below: float, above: float, side: int, n: float, cell: FloatArray, spare: FloatArray) -> None:
    """Both series about the middle of a cell."""
    centre = 0.5 * (below + above)
    x = centre**n if side == 0 else -(centre**n)
    cell[_CENTRE], cell[_INVERSE] = centre, 1.0 / centre
    integral_series(x, n, cell[_THERE:_BACK], spare)
    flow_series(x, n, cell[_BACK:], spare)
    for place, w in ((_BELOW, below), (_ABOVE, above)):
        r = (w - centre) * cell[_INVERSE]
        cell[place] = r * sum16(cell, _THERE, r)


@kernel
def integral_series(x: float, n: float, q: FloatArray, spare: FloatArray) -> None:
    """q_1 to q_16 of the integral of 1/(1 - x (1 + r)^n)."""
    term = -x
    for k in range(1, N_TERMS):
        term *= (n - k + 1.0) / k
        spare[k] = term
    first = 1.0 / (1.0 - x)
    q[0] = first
    for k in range(1, N_TERMS):
        total = 0.0
        for j in range(1, k + 1):
            total += spare[j] * q[k - j]
        q[k] = -total * first
    for k in range(1, N_TERMS):
        q[k] /= k + 1.0


@kernel
def flow_series(x: float, n: float, p: FloatArray, power: FloatArray) -> None:
    """p_1 to p_16 of r(s) on dr/ds = 1 - x (1 + r)^n, with `power` for the coefficients of (1 + r)^n."""
    power[0] = 1.0
    p[0] = 1.0 - x
    for k in range(1, N_TERMS):
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * p[j - 1] * power[k - j]
        power[k] = convolution / k
        p[k] = -x * power[k] / (k + 1.0)


# ---------------------------------------------------------------------------------- far from saturation


@kernel
def far_step(
    w: float, forwards: bool, side: int, n: float, length: float, constants: FloatArray, charts: FloatArray
) -> tuple[float, float]:
    """As `move`, for a step of the flow about w, as long as its series serves."""
    a = 1.0 if forwards else -1.0
    c = a if side == 0 else -a
    far = constants[_W_FAR]
    if w > far:
        if c < 0.0:
            return power_flow(w, c, n, length) - w, 0.0
        to_far = far ** (1.0 - n) * -math.expm1((1.0 - n) * math.log(w / far)) / (n - 1.0)
        return (far - w, length - to_far) if length > to_far else (power_flow(w, c, n, length) - w, 0.0)
    power = w**n
    h = min(length, 0.5 * w / (max(n, 1.0) * (1.0 + power)))
    return taylor_change(w, power, a, c, n, h, charts[_SPARE:]), length - h


@kernel
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


@kernel
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
    return w * math.exp(-math.log1p(x) / m)
