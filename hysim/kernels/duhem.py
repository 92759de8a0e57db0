"""The polynomial Duhem law along a piecewise-linear input.

    z' = u' p(u, z) + |u'| q(u, z),    p = sum (p_ij + p_abs_ij |z|) u^i z^j,    q likewise

On a stretch of the input in one direction time drops out, and on one side of z = 0 so does the bar of |z|.
What is left is one of two equations, or of four in a law with |z|,

    dz/du = f(u, z) = sum f_ij u^i z^j

each solved by the power series of its flow about the present point. With u = u0 + h x, 0 <= x <= 1,

    z = sum t_k x^k,    (k + 1) t_(k+1) = h sum_j [a_j z^j]_k,    a_j(x) = sum_i f_ij (u0 + h x)^i

The order follows what is left out: the series ends where the bound of that, from the sizes of the coefficients on a
complex disc (`hysim.kernels.remainder`), has become rounding. Where N_TERMS do not reach that, the step is cut to the
length at which they do, at no further cost because t_k goes with h^k. There is no closed form and the law is not
called exact: it is good to 1e-12 of the range. A law that diverges is returned as `inf`; one so stiff that it needs
more than MAX_STEPS as `nan`.

In a law with |z| a step ends where its series crosses zero, and the memory is then zero to the bit. A step is
cut before to a length on which the series keeps away from zero or is monotone, so that its sign at the end
tells. From zero on, the side is that to which the memory moves; both sides have the same slope there.

A law is an array of its polynomials f, shape (2, rows, columns): where u rises, and where it falls. With |z|
it is (4, rows, columns), each of the two for z >= 0 and then for z <= 0.

Layers: scalar functions first (no allocation, no exceptions), then the loops over a path and over a
batch of laws, then `step`, the form in which closed loops and chains take the law.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner, kernel
from hysim.kernels.remainder import N_TERMS, ROUNDING, fraction

MAX_STEPS = 20_000
LARGEST = 1.7976931348623157e308

_GROWTH = 4.0  # of the length tried, over the last one that served
_RETREAT = 2.0**-10  # of a length at which a term overflows
_GRAZE = 2.0**-18  # of a step: on less, a dip below zero and back has no weight
_MAX_NEWTON = 100
_WIDEST = 6.0  # disc looked at, in steps: a little wider than what serves a step of N_TERMS
_MAX_DISCS = 40


# ---------------------------------------------------------------------------------- scalar functions


@inner
def expand(law: FloatArray, part: int, u: float, h: float, local: FloatArray) -> None:
    """Fill `local`, (rows, columns), with the coefficients of f(u + h x, z) in powers of x and z; f is law[part]."""
    rows, columns = local.shape
    for j in range(columns):
        for i in range(rows):
            local[i, j] = law[part, i, j]
        scale = 1.0
        for i in range(rows):
            for m in range(rows - 2, i - 1, -1):
                local[m, j] += u * local[m + 1, j]
            local[i, j] *= scale
            scale *= h


@kernel
def coefficient(local: FloatArray, powers: FloatArray, k: int) -> float:
    """Coefficient k of local(x, z(x)); row j of `powers` is the series of z^j, known before k and extended to k."""
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
def series(local: FloatArray, z: float, h: float, powers: FloatArray) -> tuple[int, float]:
    """Fill row 1 of `powers` with the terms of z(x) until those left out are rounding, N_TERMS after the first at most.

    Returns the index of the last one, and the fraction of the step that they serve.
    """
    powers[1, 0] = z
    scale, tried = abs(z), 0
    for k in range(N_TERMS):
        term = h * coefficient(local, powers, k) / (k + 1.0)
        powers[1, k + 1] = term
        if k < 2 or scale == 0.0:
            scale += abs(term)
        if abs(term) <= ROUNDING * scale and k >= tried:
            tried = k + 2
            if ends(local, k + 1, abs(h), scale, powers):
                return k + 1, 1.0
    return N_TERMS, serves(local, abs(h), scale, powers)


@inner
def ends(local: FloatArray, last: int, h: float, size: float, powers: FloatArray) -> bool:
    """Whether the series may end at this term: whether all terms left out are rounding beside `size`."""
    x, gain, doubling = 2.0, 2.0**last, 2.0**last
    room = ROUNDING * size * (last + 1.0)
    first = 16.0 * max(abs(powers[1, 1]), ROUNDING * size)
    while gain * room < first:
        x, gain = 2.0 * x, doubling * gain
    return bool(spread_within(local, last, x, powers) * h * x <= room * gain * (x - 1.0))


@inner
def serves(local: FloatArray, h: float, size: float, powers: FloatArray) -> float:
    """Fraction of a step that N_TERMS terms serve, the best of a few discs."""
    x, best = _WIDEST, 0.0
    if size == 0.0:
        size = h * spread_within(local, N_TERMS, 1.0, powers)
    for _ in range(_MAX_DISCS):
        spread = spread_within(local, N_TERMS, x, powers)
        share = x * fraction(spread * h * x, size) if spread <= LARGEST else 0.0
        if share >= 1.0:
            return 1.0
        if share < best:
            break
        best = share
        x *= 0.75 if share > 0.01 * x else 0.25
    return best


@inner
def spread_within(local: FloatArray, last: int, x: float, powers: FloatArray) -> float:
    """Bound of ``|f - f(0)|`` where the series of z goes at complex distances up to x, from that of each monomial."""
    rows, columns = local.shape
    farthest, size = 0.0, abs(powers[1, 0])
    for k in range(last, 0, -1):
        farthest = (farthest + abs(powers[1, k])) * x
    farthest += size
    total, here, there = 0.0, 1.0, 1.0
    for j in range(columns):
        column = 0.0
        for i in range(rows - 1, 0, -1):
            column = (column + abs(local[i, j])) * x
        total += column * there + abs(local[0, j]) * (there - here)
        here, there = here * size, there * farthest
    return total


@inner
def falls_from_zero(local: FloatArray, h: float) -> bool:
    """Whether the memory goes from zero to below it along a step of `h`."""
    for i in range(local.shape[0]):
        if local[i, 0] != 0.0:
            return bool((local[i, 0] < 0.0) == (h > 0.0))
    return False


@inner
def untangled(powers: FloatArray, last: int, fraction: float) -> float:
    """Fraction of a step, no more than the one given, on which the series is monotone or keeps away from zero."""
    lead = 1
    while lead < last and powers[1, lead] == 0.0:
        lead += 1
    first = abs(powers[1, lead])
    while fraction > _GRAZE:
        others, steepness = 0.0, 0.0
        for k in range(last, lead, -1):
            others = others * fraction + abs(powers[1, k])
            steepness = steepness * fraction + k * abs(powers[1, k])
        if lead * first >= steepness * fraction:
            break
        if abs(powers[1, 0]) > (first + others * fraction) * fraction**lead:
            break
        fraction *= 0.5
    return fraction


@inner
def place(powers: FloatArray, last: int, x: float) -> tuple[float, float]:
    """Value and slope of the series in row 1 of `powers` at the place x."""
    value, slope = 0.0, 0.0
    for k in range(last, -1, -1):
        slope = slope * x + value
        value = value * x + powers[1, k]
    return value, slope


@inner
def newton(low: float, high: float, x: float, value: float, slope: float) -> float:
    """The next place to look for the zero of a falling function: by Newton's rule if it stays in the bracket."""
    trial = x - value / slope if slope < 0.0 else math.nan
    return trial if low < trial < high else 0.5 * (low + high)


@inner
def zero(powers: FloatArray, last: int, end: float) -> float:
    """The place up to `end` at which the series, of another sign there than at 0, is zero."""
    sign = math.copysign(1.0, powers[1, 0])
    low, high, x = 0.0, end, end
    for _ in range(_MAX_NEWTON):
        value, slope = place(powers, last, x)
        low, high = (x, high) if sign * value >= 0.0 else (low, x)
        trial = newton(low, high, x, sign * value, sign * slope)
        if value == 0.0 or abs(trial - x) <= ROUNDING * x:
            break
        x = trial
    return x


@inner
def advance(
    u: float, z: float, du: float, law: FloatArray, bound: float, most: int, local: FloatArray, powers: FloatArray
) -> tuple[float, int]:
    """Memory after the input has moved monotonically from `u` by `du`, and the terms of series that this takes.

    The memory is inf beyond `bound`, and nan where `most` steps do not reach the end.
    """
    two_sided = law.shape[0] == 4
    above = 0 if du > 0.0 else law.shape[0] // 2
    rest = h = du
    terms = 0
    for _ in range(most):
        if rest == 0.0:
            return z, terms
        here = u + (du - rest)
        expand(law, above + 1 if two_sided and z < 0.0 else above, here, h, local)
        if two_sided and z == 0.0 and falls_from_zero(local, h):
            expand(law, above + 1, here, h, local)
        last, served = series(local, z, h, powers)
        terms += last
        if served == 0.0:
            if not math.isfinite(powers[1, 1]):
                return math.inf, terms
            h *= _RETREAT
            continue
        end = served
        if two_sided:
            end = untangled(powers, last, end)
        before, z = z, 0.0
        for k in range(last, -1, -1):
            z = z * end + powers[1, k]
        if not abs(z) <= bound:
            return math.inf, terms
        if abs(h * end) <= ROUNDING * abs(du) and abs(z) > 1.01 * abs(before) > 0.0:  # nothing moves u any more, but z
            return math.inf, terms
        if two_sided and ((before > 0.0 and z < 0.0) or (before < 0.0 and z > 0.0)):
            end, z = zero(powers, last, end), 0.0
        taken = h * end
        rest = 0.0 if taken == rest else rest - taken
        h = math.copysign(min(abs(rest), _GROWTH * abs(h * served)), du)
    return math.nan, terms


# ---------------------------------------------------------------------------------- path and batch


@kernel
def path(
    law: FloatArray, last_u: float, z: float, u: FloatArray, bound: float, most: int, out: FloatArray
) -> tuple[int, int]:
    """Memory at the samples of `u` from the state (last_u, z) into `out`.

    Returns the first sample that is not finite, or -1, and the terms of series that the samples take.
    """
    rows, columns = law.shape[1:]
    total = 0
    local, powers = np.empty((rows, columns)), np.empty((max(2, columns), N_TERMS + 1))
    for k in range(u.size):
        z, terms = advance(last_u, z, u[k] - last_u, law, bound, most, local, powers)
        last_u, total = u[k], total + terms
        out[k] = z
        if not math.isfinite(z):
            return k, total
    return -1, total


@kernel
def batch(
    laws: FloatArray, z0: FloatArray, u: FloatArray, bound: float, most: int, out: FloatArray, start: int, stop: int
) -> int:
    """Memories of the laws `start` to `stop - 1`; returns the terms of series that they take.

    `laws` is (n_sets, 2 or 4, rows, columns), `z0` is (n_sets,), `u` is (1, n_samples) or (n_sets, n_samples),
    `out` is (n_sets, n_samples). A law that diverges, or needs more than `most` steps from one sample to the next, is a
    row of inf.
    """
    if u.shape[1] == 0:
        return 0
    total = 0
    for i in range(start, stop):
        row = u[min(i, u.shape[0] - 1)]
        lost, terms = path(laws[i], row[0], z0[i], row, bound, most, out[i])
        total += terms
        if lost >= 0:
            out[i] = math.inf
    return total


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is (last u, z, scratch), `state_size` long, and moves along.

    `parameters` is (offset, feedthrough, 2 or 4, rows, columns, law), the polynomials of the law one after the other.
    """
    rows, columns = int(parameters[3]), int(parameters[4])
    law = parameters[5:].reshape((int(parameters[2]), rows, columns))
    size = rows * columns
    local = state[2 : 2 + size].reshape((rows, columns))
    powers = state[2 + size : state_size(rows, columns)].reshape((max(2, columns), N_TERMS + 1))
    z = state[1]
    if math.isfinite(z):  # a memory that has diverged remains so
        z = advance(state[0], z, u - state[0], law, LARGEST, MAX_STEPS, local, powers)[0]
    state[0], state[1] = u, z
    return float(parameters[0] + (parameters[1] * u + z))


@kernel
def start(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """Complete a state that holds the first output less the offset: the memory z is what the feedthrough leaves."""
    state[0] = u0
    state[1] -= parameters[1] * u0


@kernel
def state_size(rows: int, columns: int) -> int:
    """Length of the state of `step` for polynomials of `rows` by `columns` coefficients."""
    return 2 + rows * columns + max(2, columns) * (N_TERMS + 1)
