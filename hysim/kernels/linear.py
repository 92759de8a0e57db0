"""Outputs of linear plants under an input that is linear on each piece of a step.

    x <- A x + B0 v + B1 v',    v and v' the input at the begin and the end of the piece

A step has one piece, or two where a delay cuts it. The matrices are exact: blocks of the exponential of

    [[F, g, 0], [0, 0, 1], [0, 0, 0]]    for x' = F x + g v in time counted in pieces,

which holds A = exp(F) beside the responses B0 + B1 to a held input and B1 to one that rises from zero to
one (C. Van Loan, IEEE Trans. Automat. Control 23, 1978).
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, kernel

Indices = npt.NDArray[np.int64]

_N_TERMS = 15  # 0.5^16 / 16! is below the rounding of one


@kernel
def exponentials(matrices: FloatArray, out: FloatArray) -> None:
    """Exponentials of `matrices`, (n_matrices, m, m), into `out`.

    D = exp(M / 2^k) - 1 by its Taylor series, then k times D <- 2 D + D^2: without the one, slow modes keep
    their digits beside fast ones. A matrix that is not finite gives nan, one that overflows infinities or nan.
    """
    m = matrices.shape[1]
    scaled, product = np.empty((m, m)), np.empty((m, m))
    for i in range(len(matrices)):
        norm, less_one = 0.0, out[i]
        for row in range(m):
            for column in range(m):
                norm += abs(matrices[i, row, column])
        if not norm < math.inf:
            for row in range(m):
                for column in range(m):
                    less_one[row, column] = math.nan
            continue
        squarings = max(0, math.ceil(math.log2(norm)) + 1) if norm > 0.0 else 0
        for row in range(m):
            for column in range(m):
                scaled[row, column] = matrices[i, row, column] * 0.5**squarings
                less_one[row, column] = 0.0
        for k in range(_N_TERMS, 0, -1):
            multiply(scaled, less_one, product)
            for row in range(m):
                for column in range(m):
                    less_one[row, column] = (scaled[row, column] + product[row, column]) / k
        for _ in range(squarings):
            multiply(less_one, less_one, product)
            for row in range(m):
                for column in range(m):
                    less_one[row, column] = 2.0 * less_one[row, column] + product[row, column]
        for row in range(m):
            less_one[row, row] += 1.0


@kernel
def multiply(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two small square matrices; calling BLAS for them costs more than the product."""
    m = len(left)
    for row in range(m):
        for column in range(m):
            total = 0.0
            for k in range(m):
                total += left[row, k] * right[k, column]
            out[row, column] = total


@kernel
def columns(
    A: FloatArray,
    B0: FloatArray,
    B1: FloatArray,
    level: FloatArray,
    rise: FloatArray,
    lags: Indices,
    parts: FloatArray,
    scaled: FloatArray,
    back: FloatArray,
    at_end: bool,
    out: FloatArray,
) -> None:
    """Outputs of many plants for a one in each coefficient of the numerator and in each initial state, and zero.

    `A` is (n_sets, 2, n, n), `B0` and `B1` (n_sets, 2, n): over the `parts` (n_sets,) of a step in which the
    stretch of the input before the last still acts, and over the rest of it. `level` and `rise`
    (n_samples + 1,) hold each stretch's begin and rise, a zero before the first; they act `lags` (n_sets,) whole
    steps late. `scaled` (n_sets, n) is den in the scaled time, `back` (n_sets, n + 1) the way back to seconds.
    `out` is (n_sets, n_samples, n_numerator + n + 1), with the lowest powers of the numerator.
    """
    n_sets, n_samples, width = out.shape
    n = scaled.shape[1]
    first = 2 * n + 2 - width  # power n - first is the numerator's highest
    x, free, moved = np.zeros(n), np.zeros(n), np.empty(n)
    whole = np.empty((n, n))
    for i in range(n_sets):
        part, lag, own = parts[i], lags[i], out[i]
        cut_A, cut_B0, cut_B1 = A[i, 0], B0[i, 0], B1[i, 0]
        full_A, full_B0, full_B1 = A[i, 1], B0[i, 1], B1[i, 1]
        den, powers = scaled[i], back[i]
        multiply(full_A, cut_A, whole)
        x[:] = 0.0
        free[:] = 0.0
        free[:1] = 1.0
        for k in range(n_samples):
            before, now = max(0, k - lag), max(0, k + 1 - lag)
            cut = level[before] + (1.0 - part) * rise[before]
            end = level[now] + (1.0 - part) * rise[now]
            if not at_end:
                _write(x, free, cut if part > 0.0 else level[now], den, powers, first, own[k])
            if part > 0.0:
                _advance(cut_A, cut_B0, cut_B1, cut, level[before] + rise[before], x, moved)
            _advance(full_A, full_B0, full_B1, level[now], end, x, moved)
            for column in range(n):
                total = 0.0
                for row in range(n):
                    total += free[row] * whole[row, column]
                moved[column] = total
            for column in range(n):
                free[column] = moved[column]
            if at_end:
                _write(x, free, end, den, powers, first, own[k])


@kernel
def outputs(
    A: FloatArray,
    B0: FloatArray,
    B1: FloatArray,
    level: FloatArray,
    rise: FloatArray,
    first: int,
    lag: int,
    part: float,
    C: FloatArray,
    D: FloatArray,
    at_end: bool,
    x: FloatArray,
    out: FloatArray,
) -> None:
    """Outputs C x + D v of one plant for several inputs, each from its own state.

    The matrices are those of one set in `columns`. `level` and `rise` (n_inputs, m) begin with a zero and hold every
    stretch that still acts; that of the first sample has the place `first`. `C` is (n_inputs, n), `D` (n_inputs,),
    `out` (n_inputs, n_samples). `x` (n_inputs, n) are the states at the first sample, and after the call at the last.
    """
    n_inputs, n_samples = out.shape
    now, moved = np.empty(x.shape[1]), np.empty(x.shape[1])
    for i in range(n_inputs):
        for row in range(now.size):
            now[row] = x[i, row]
        for k in range(n_samples):
            older, newer = max(0, first + k - 1 - lag), max(0, first + k - lag)
            cut = level[i, older] + (1.0 - part) * rise[i, older]
            end = level[i, newer] + (1.0 - part) * rise[i, newer]
            if not at_end:
                out[i, k] = _seen(C[i], D[i], now, cut if part > 0.0 else level[i, newer])
            for row in range(now.size):
                x[i, row] = now[row]
            if part > 0.0:
                _advance(A[0], B0[0], B1[0], cut, level[i, older] + rise[i, older], now, moved)
            _advance(A[1], B0[1], B1[1], level[i, newer], end, now, moved)
            if at_end:
                out[i, k] = _seen(C[i], D[i], now, end)


@inlined
def _seen(C: FloatArray, D: float, x: FloatArray, through: float) -> float:
    """C x + D v; a state that overflows does not matter where it is not seen."""
    total = D * through
    for j in range(x.size):
        if C[j] != 0.0:
            total += C[j] * x[j]
    return total


@inlined
def _advance(
    A: FloatArray, B0: FloatArray, B1: FloatArray, begin: float, end: float, x: FloatArray, moved: FloatArray
) -> None:
    for row in range(x.size):
        total = B0[row] * begin + B1[row] * end
        for column in range(x.size):
            total += A[row, column] * x[column]
        moved[row] = total
    for row in range(x.size):
        x[row] = moved[row]


# ---------------------------------------------------------------------------------- one sample at a time

N_HEAD = 7
N_BEFORE = 3  # places of the state before the plant's own
N_RING = 3  # more inputs than whole steps in the dead time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`, with the bits of `outputs`.

    `parameters` is (n, whole steps of the dead time, part, 1 for an output at the end of the step, 1 for an input that
    is linear, 1 where there is a free response, D, C), then A, B0 and B1 of the whole step less the part, and, if there
    is a part, those of the part. `state` is (last u, place of the last input, inputs so far up to `N_RING` more than
    the whole steps, x, room, x of the free response), and a ring of inputs, zero at first.
    """
    n, part, at_end, free = int(parameters[0]), parameters[2], parameters[3] != 0.0, parameters[5] != 0.0
    C, first = parameters[N_HEAD : N_HEAD + n], N_HEAD + n
    A, B0 = parameters[first : first + n * n].reshape((n, n)), parameters[first + n * n : first + n * n + n]
    B1, behind = parameters[first + n * n + n : first + n * n + 2 * n], first + n * n + 2 * n
    x, moved = state[N_BEFORE : N_BEFORE + n], state[N_BEFORE + n : N_BEFORE + 2 * n]
    free_at = N_BEFORE + 2 * n
    ring_at = free_at + n if free else free_at
    ring = state[ring_at:]
    size = ring.size
    place = (int(state[1]) + 1) % size
    ring[place] = u
    state[0], state[1] = u, place
    known = state[2]
    if known < size:
        known += 1.0
        state[2] = known
    newer, older, oldest = ring[(place + 3) % size], ring[(place + 2) % size], ring[(place + 1) % size]
    rise, last_rise = 0.0, 0.0  # of the input over the stretches that begin with `older` and with `oldest`
    if parameters[4] != 0.0:
        if known > size - 2:
            rise = newer - older
        if known > size - 1:
            last_rise = older - oldest
    begin, turn, begin_rise, turn_rise = oldest, older, last_rise, rise
    if at_end:
        begin, turn, begin_rise, turn_rise = older, newer, 0.0, 0.0
    if at_end or known > 1.0:
        if part > 0.0:
            cut_A = parameters[behind : behind + n * n].reshape((n, n))
            cut_B0 = parameters[behind + n * n : behind + n * n + n]
            cut_B1 = parameters[behind + n * n + n : behind + n * n + 2 * n]
            cut = begin + (1.0 - part) * begin_rise
            _advance(cut_A, cut_B0, cut_B1, cut, begin + begin_rise, x, moved)
            if free:
                _advance(cut_A, cut_B0, cut_B1, 0.0, 0.0, state[free_at : free_at + n], moved)
        _advance(A, B0, B1, turn, turn + (1.0 - part) * turn_rise, x, moved)
        if free:
            _advance(A, B0, B1, 0.0, 0.0, state[free_at : free_at + n], moved)
    through = newer
    if part > 0.0 and not at_end:
        through = older + (1.0 - part) * rise
    y = _seen(C, parameters[6], x, through)
    return y + state[free_at] if free else y


@inlined
def _write(
    x: FloatArray, free: FloatArray, through: float, den: FloatArray, powers: FloatArray, first: int, row: FloatArray
) -> None:
    """A sample: s^j / den(s) u for the powers j from n - `first` down, the free responses, and zero."""
    n = len(x)
    if first == 0:
        for j in range(n):
            through -= den[j] * x[n - 1 - j]
        row[0] = through
    for j in range(max(first, 1), n + 1):
        row[j - first] = x[n - j] * powers[j]
    for j in range(n):
        row[n + 1 - first + j] = free[j] * powers[j]
    row[2 * n + 1 - first] = 0.0
