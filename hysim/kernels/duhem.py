"""The polynomial Duhem law along a piecewise-linear input.

    y' = u' p(u, y) + |u'| q(u, y),    p = sum p_ij u^i y^j,    q likewise

On a stretch of the input in one direction time drops out, and the law is one of two equations,

    dy/du = rising(u, y)  = p + q     where u rises
    dy/du = falling(u, y) = p - q     where u falls

each solved by the power series of its flow about the present point. With u = u0 + h x, 0 <= x <= 1,

    y = sum t_k x^k,    (k + 1) t_(k+1) = h sum_j [a_j y^j]_k,    a_j(x) = sum_i f_ij (u0 + h x)^i

The order follows the terms: the series ends where they have become rounding. Where N_TERMS do not reach
that, the step is cut to the length at which the last of them do, at no further cost because t_k goes
with h^k. There is no closed form and the law is not called exact: it is good to 1e-12 of the range.
A law that escapes is returned as `inf`; one so stiff that it needs more than MAX_STEPS as `nan`.

Layers: scalar functions first (no allocation, no exceptions), then the loops over a path and over a
batch of laws, then `step`, the form in which closed loops and chains take the law.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import inner, kernel

N_TERMS = 24
MAX_STEPS = 20_000
LARGEST = 1.7976931348623157e308

_NEGLIGIBLE = 2.0**-54
_GROWTH = 16.0  # of the length tried, over the last one that served
_RETREAT = 2.0**-10  # of a length at which a term overflows


# ---------------------------------------------------------------------------------- scalar functions


@inner
def expand(f: FloatArray, u: float, h: float, local: FloatArray) -> None:
    """Fill `local`, of the shape of `f`, with the coefficients of f(u + h x, y) in powers of x and y."""
    rows, columns = f.shape
    for j in range(columns):
        for i in range(rows):
            local[i, j] = f[i, j]
        scale = 1.0
        for i in range(rows):
            for m in range(rows - 2, i - 1, -1):
                local[m, j] += u * local[m + 1, j]
            local[i, j] *= scale
            scale *= h


@kernel
def coefficient(local: FloatArray, powers: FloatArray, k: int) -> float:
    """Coefficient k of local(x, y(x)); row j of `powers` is the series of y^j, known before k and extended to k."""
    rows, columns = local.shape
    total = local[k, 0] if k < rows else 0.0
    for j in range(1, columns):
        if j > 1:
            convolution = 0.0
            for m in range(k + 1):
                convolution += powers[1, m] * powers[j - 1, k - m]
            powers[j, k] = convolution
        for i in range(min(rows, k + 1)):
            total += local[i, j] * powers[j, k - i]
    return total


@inner
def series(local: FloatArray, y: float, h: float, powers: FloatArray) -> int:
    """Fill row 1 of `powers` with the terms of y(x) until they have died out, N_TERMS after the first at most.

    Returns the index of the last one, or -1 if they have not died out.
    """
    rows, columns = local.shape
    powers[1, 0] = y
    scale, small = abs(y), 0
    for k in range(N_TERMS):
        term = h * coefficient(local, powers, k) / (k + 1.0)
        powers[1, k + 1] = term
        if k < 2:
            scale += abs(term)
        small = small + 1 if abs(term) <= _NEGLIGIBLE * scale else 0
        if small == rows + columns - 1:  # longer than any gap between two terms
            return k + 1
    return -1


@inner
def reach(powers: FloatArray, n_last: int) -> float:
    """Fraction of the step at which the last `n_last` terms have died out beside one of the first three."""
    fraction = 1.0
    for k in range(N_TERMS + 1 - n_last, N_TERMS + 1):
        term = abs(powers[1, k])
        if not math.isfinite(term):
            return 0.0
        if term > 0.0:
            allowed = 0.0
            for m in range(3):
                allowed = max(allowed, (_NEGLIGIBLE * (abs(powers[1, m]) / term)) ** (1.0 / (k - m)))
            fraction = min(fraction, allowed)
    return fraction


@inner
def advance(u: float, y: float, du: float, f: FloatArray, bound: float, local: FloatArray, powers: FloatArray) -> float:
    """Output after the input has moved monotonically from `u` by `du` along dy/du = f(u, y).

    An output beyond `bound` counts as an escape.
    """
    rest = h = du
    for _ in range(MAX_STEPS):
        if rest == 0.0:
            return y
        expand(f, u + (du - rest), h, local)
        last = series(local, y, h, powers)
        fraction = 1.0
        if last < 0:
            last = N_TERMS
            fraction = reach(powers, local.shape[0] + local.shape[1] - 1)
        if fraction == 0.0:
            if not math.isfinite(powers[1, 1]):
                return math.inf
            h *= _RETREAT
            continue
        y = 0.0
        for k in range(last, -1, -1):
            y = y * fraction + powers[1, k]
        if not abs(y) <= bound:
            return math.inf
        taken = h * fraction
        rest = 0.0 if taken == rest else rest - taken
        h = math.copysign(min(abs(rest), _GROWTH * abs(taken)), du)
    return math.nan


# ---------------------------------------------------------------------------------- path and batch


@kernel
def path(
    rising: FloatArray, falling: FloatArray, last_u: float, y: float, u: FloatArray, bound: float, out: FloatArray
) -> int:
    """Output at the samples of `u` from the state (last_u, y) into `out`: the first one not finite, or -1."""
    local, powers = np.empty(rising.shape), np.empty((max(2, rising.shape[1]), N_TERMS + 1))
    for k in range(u.size):
        du = u[k] - last_u
        y = advance(last_u, y, du, rising if du > 0.0 else falling, bound, local, powers)
        last_u = u[k]
        out[k] = y
        if not math.isfinite(y):
            return k
    return -1


@kernel
def batch(
    rising: FloatArray,
    falling: FloatArray,
    y0: FloatArray,
    u: FloatArray,
    bound: float,
    out: FloatArray,
    start: int,
    stop: int,
) -> None:
    """Outputs of the laws `start` to `stop - 1`.

    `rising` and `falling` are (n_sets, rows, columns), `y0` is (n_sets,), `u` is (1, n_samples) or
    (n_sets, n_samples), `out` is (n_sets, n_samples). A law that escapes is a row of inf.
    """
    for i in range(start, stop):
        row = u[min(i, u.shape[0] - 1)]
        if path(rising[i], falling[i], row[0], y0[i], row, bound, out[i]) >= 0:
            out[i] = math.inf


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is (last u, y, scratch), `state_size` long, and moves along.

    `parameters` is (rows, columns, rising, falling), the two polynomials row by row.
    """
    rows, columns = int(parameters[0]), int(parameters[1])
    size = rows * columns
    du = u - state[0]
    first = 2 if du > 0.0 else 2 + size
    f = parameters[first : first + size].reshape((rows, columns))
    local = state[2 : 2 + size].reshape((rows, columns))
    powers = state[2 + size : state_size(rows, columns)].reshape((max(2, columns), N_TERMS + 1))
    y = advance(state[0], state[1], du, f, LARGEST, local, powers)
    state[0], state[1] = u, y
    return y


@kernel
def state_size(rows: int, columns: int) -> int:
    """Length of the state of `step` for polynomials of `rows` by `columns` coefficients."""
    return 2 + rows * columns + max(2, columns) * (N_TERMS + 1)
