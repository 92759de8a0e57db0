"""The Bouc-Wen law along a monotone input, exactly.

    dz/du = A - |z|^n (gamma + beta sign(z du))

Let `du` be one monotone stretch of the input. In the frame that points along it, with L the length
travelled and w = |z|, both sides of z = 0 obey the same scalar equation

    dw/dL = a - c w^n,   w >= 0,      loading (z du > 0):    a =  A,  c = beta + gamma
                                      unloading (z du < 0):  a = -A,  c = beta - gamma

so one flow, used twice around a zero crossing, is the whole law. It is elementary for n = 1 and n = 2
(`hysim.kernels.elementary`). For other n everything is measured in w* = |a/c|^(1/n), the value at which
the two terms balance: then a and c are plus or minus one, and what is left is one function of n
(`hysim.kernels.charts`). A memory that diverges is returned as `inf`.
"""

import math
from collections.abc import Callable

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, inlined, inner, kernel, pasted
from hysim.kernels.charts import N_WORK, in_chart, power_flow, prepare_exponent
from hysim.kernels.elementary import (
    DECAY_REACH,
    N_AT_ONCE,
    N_ROWS,
    TANGENT_REACH,
    count_linear,
    linear_advance,
    linear_rows,
    quadratic_advance,
    quadratic_flow,
    short_flow,
    short_tangent,
)

# The first places of a law's workspace: last u and z, for `step`; then w*, 1/w* and |a|/w* loading, and unloading.
_LOADING, _UNLOADING = 2, 5
Move = Callable[[float, float, float, float, float], float]
"""A memory after a way, from the memory, the way, A, and two more numbers."""

_EXTREME = 690.0  # of |log w*|, beyond which one of the two terms counts as vanished, and of |log(A/c)| for a power
_N_ALIKE = 2  # steps in one direction after another, from which on a run is tried: in noise it ends where it begins


# ---------------------------------------------------------------------------------- scalar functions


@inlined
def power_advance(z: float, du: float, A: float, beta: float, gamma: float, n: float, work: FloatArray) -> float:
    """As `advance` for other n than 1 and 2."""
    sign = 1.0 if (z > 0.0 and du > 0.0) or (z < 0.0 and du < 0.0) or (z == 0.0 and A > 0.0) else -1.0
    w, left = z if (du > 0.0) == (sign > 0.0) else -z, abs(du)  # |z|, and on this side of z = 0 its continuation
    while True:  # a second time only from w = 0, on the other side, where w grows
        forwards = (sign > 0.0) == (A > 0.0)
        c, side = (beta + gamma, _LOADING) if sign > 0.0 else (beta - gamma, _UNLOADING)
        balance = work[side]
        if balance > 0.0:
            end, left, change = w * work[side + 1], left * work[side + 2], 0.0
            while True:
                part, left, end = in_chart(end, forwards, 0 if forwards == (c > 0.0) else 1, n, left, work)
                change += part
                if not left > 0.0 or (end <= 0.0 and not forwards):  # not a number ends it, too
                    break
            change *= balance
            end *= balance
            if left > 0.0:
                left /= work[side + 2]
        else:
            change, left, end = degenerate(w, sign * A, c, n, left)
        if not left > 0.0:
            break
        sign, w = -sign, 0.0
    along = w + change
    if along < 0.5 * w:  # the sum would carry the rounding of w, and might pass a small balance, or zero
        along = end
    return along if (du > 0.0) == (sign > 0.0) else -along


@inner
def degenerate(w: float, a: float, c: float, n: float, length: float) -> tuple[float, float, float]:
    """Change of w, length left over at w = 0, and end, on w' = a - c w^n where one of the terms has vanished."""
    if a == 0.0 or (c != 0.0 and abs(a) < abs(c)):
        end = power_flow(w, c, n, length)
        return end - w, 0.0, end
    end = w + a * length
    if a < 0.0 and end < 0.0:
        return -w, length + w / a, 0.0
    return a * length, 0.0, end


@inlined
def advance(z: float, du: float, A: float, beta: float, gamma: float, n: float, work: FloatArray) -> float:
    """Memory after the input has moved monotonically by `du`; `work` comes from `prepare`."""
    if du == 0.0:
        return z
    if n == 1.0:
        return linear_advance(z, du, A, beta + gamma, beta - gamma)
    if n == 2.0:
        return quadratic_advance(z, du, A, beta + gamma, beta - gamma)
    return power_advance(z, du, A, beta, gamma, n, work)


@kernel
def prepare(A: float, beta: float, gamma: float, n: float, last_n: float, work: FloatArray) -> None:
    """Make `work`, shape (N_WORK,), ready for a law; it has been ready for the exponent `last_n`."""
    if n == 1.0 or n == 2.0:
        return
    prepare_side(A, beta + gamma, n, _LOADING, work)
    prepare_side(A, beta - gamma, n, _UNLOADING, work)
    if n != last_n:
        prepare_exponent(n, work)


@inner
def prepare_side(A: float, c: float, n: float, side: int, work: FloatArray) -> None:
    """Fill w*, 1/w* and |A|/w*; they are 0 where one of the terms vanishes, or w* is not a number of this size."""
    balance = inverse = rate = 0.0
    ratio = math.log(abs(A)) - math.log(abs(c)) if A != 0.0 and c != 0.0 else math.inf
    if abs(ratio) < _EXTREME * n:
        near = abs(ratio) < _EXTREME  # else the quotient is no number of this size, though its root is
        balance = abs(A / c) ** (1.0 / n) if near else abs(A) ** (1.0 / n) / abs(c) ** (1.0 / n)
        inverse, rate = 1.0 / balance, abs(A) / balance
    work[side], work[side + 1], work[side + 2] = balance, inverse, rate


# ---------------------------------------------------------------------------------- path and batch


@kernel
def linear_path(A: float, beta: float, gamma: float, last_u: float, z: float, u: FloatArray, out: FloatArray) -> int:
    """Memory of n = 1 at the samples of `u` from (last_u, z) into `out`: the first sample that is not finite, or -1."""
    return elementary_path(linear_advance, linear_part, A, beta, gamma, last_u, z, u, out)


@kernel
def quadratic_path(A: float, beta: float, gamma: float, last_u: float, z: float, u: FloatArray, out: FloatArray) -> int:
    """As `linear_path`, for n = 2."""
    return elementary_path(quadratic_advance, quadratic_part, A, beta, gamma, last_u, z, u, out)


@pasted
def elementary_path(
    flow: Move, part: Move, A: float, beta: float, gamma: float, last: float, z: float, u: FloatArray, out: FloatArray
) -> int:
    """As `linear_path`, by the `flow` of an exponent and the `part` of it that runs take."""
    loading, unloading = beta + gamma, beta - gamma
    k = n_alike = 0
    last_du = 0.0
    while k < u.size:
        du = u[k] - last
        z = z if du == 0.0 else flow(z, du, A, loading, unloading)
        last = u[k]
        out[k] = z
        if not math.isfinite(z):
            return k
        k += 1
        n_alike = n_alike + 1 if du * last_du >= 0.0 else 0
        last_du = du
        if n_alike == _N_ALIKE:
            n_alike = 0
            k = run(part, A, loading, unloading, du, u, out, k)
            last, z = u[k - 1], out[k - 1]
    return -1


@pasted
def run(
    part: Move, A: float, loading: float, unloading: float, du: float, u: FloatArray, out: FloatArray, k: int
) -> int:
    """Go on from sample k - 1 while the input moves as by `du` and z keeps its sign: the first sample not reached.

    The rate is the same for the whole run, so that a sample does not wait for the sign of the one before.
    """
    direction, last_u = math.copysign(1.0, du), u[k - 1]
    along = direction * out[k - 1]
    side = math.copysign(1.0, along)
    rate = loading if along > 0.0 else unloading
    if along == 0.0:
        return k
    while k < u.size:
        length = direction * (u[k] - last_u)
        if length != 0.0:
            along = part(along, length, A, rate, side)
            if not 0.0 < side * along < math.inf:
                break
            last_u = u[k]
        out[k] = direction * along
        k += 1
    return k


@inlined
def linear_part(along: float, length: float, A: float, rate: float, side: float) -> float:
    """Value of n = 1 after a short way on this `side` of zero, nan where the way is not short or not ahead."""
    is_short = length > 0.0 and abs(rate * length) <= DECAY_REACH and A != 0.0
    return short_flow(along, A, rate, length) if is_short else math.nan


@inlined
def quadratic_part(along: float, length: float, A: float, rate: float, side: float) -> float:
    """As `linear_part`, for n = 2."""
    y = A * (side * rate) * length * length
    tangent = short_tangent(y, length)
    # whether it crosses zero, as `quadratic_advance` decides, to the last bit
    if not (length > 0.0 and abs(y) <= TANGENT_REACH) or side * (along + A * tangent) <= 0.0:
        return math.nan
    return quadratic_flow(along, A, side * rate, tangent)


@kernel
def power_path(law: FloatArray, last_u: float, z: float, u: FloatArray, work: FloatArray, out: FloatArray) -> int:
    """As `linear_path`, for other n; `law` begins with (A, beta, gamma, n), and `work` comes from `prepare`."""
    A, beta, gamma, n, charts = law[0], law[1], law[2], law[3], borrowed(work)
    for k in range(u.size):
        du = u[k] - last_u
        z = z if du == 0.0 else power_advance(z, du, A, beta, gamma, n, charts)
        last_u = u[k]
        out[k] = z
        if not math.isfinite(z):
            return k
    return -1


def batch(parameters: FloatArray, output: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """Outputs of many laws.

    `parameters` is (n_sets, 5) with columns A, beta, gamma, n, z0; `output` is (n_sets, 2 + degree) with
    columns gain, offset, c1, c2, ...; `u` is (1, n_samples) or (n_sets, n_samples); `out` is
    (n_sets, n_samples). A law that diverges is a row of inf. Neighbours of equal n share their charts.
    """
    n = parameters[:, 3]
    linear, quadratic = n == 1.0, n == 2.0
    if u.shape[1] == 0:
        return
    if linear.any():  # a kernel for each kind of exponent: none is compiled that no law needs
        linear_batch(parameters, output, u, out)
    if quadratic.any():
        quadratic_batch(parameters, output, u, out)
    if not (linear | quadratic).all():
        power_batch(parameters, output, u, out)


@kernel
def linear_batch(parameters: FloatArray, output: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """As `batch`, for the laws of n = 1; those on one input go side by side."""
    several, side_by_side = np.empty((N_ROWS, N_AT_ONCE)), 0
    for i in range(out.shape[0]):
        A, beta, gamma, n, z0 = parameters[i]
        if n == 1.0:
            row = u[min(i, u.shape[0] - 1)]
            lost = -1
            if u.shape[0] > 1:
                lost = linear_path(A, beta, gamma, row[0], z0, row, out[i])
            elif i >= side_by_side:
                count = count_linear(parameters, i)
                linear_rows(parameters, i, count, row, several, out)
                side_by_side = i + count
            finish(lost < 0 and math.isfinite(out[i, row.size - 1]), output[i], row, out[i])


@kernel
def quadratic_batch(parameters: FloatArray, output: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """As `batch`, for the laws of n = 2."""
    for i in range(out.shape[0]):
        A, beta, gamma, n, z0 = parameters[i]
        if n == 2.0:
            row = u[min(i, u.shape[0] - 1)]
            lost = quadratic_path(A, beta, gamma, row[0], z0, row, out[i])
            finish(lost < 0, output[i], row, out[i])


@kernel
def power_batch(parameters: FloatArray, output: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """As `batch`, for the laws of other n."""
    work, last_n = np.empty(N_WORK), 0.0
    for i in range(out.shape[0]):
        A, beta, gamma, n, z0 = parameters[i]
        if n != 1.0 and n != 2.0:
            row = u[min(i, u.shape[0] - 1)]
            prepare(A, beta, gamma, n, last_n, work)
            last_n = n
            lost = power_path(parameters[i], row[0], z0, row, work, out[i])
            finish(lost < 0, output[i], row, out[i])


@inlined
def finish(is_finite: bool, output: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """Outputs in place of the memories of a law, inf where it has diverged."""
    if is_finite:
        to_output(output, 0, u, out)
    else:
        for k in range(u.size):
            out[k] = math.inf


@kernel
def to_output(parameters: FloatArray, first: int, u: FloatArray, out: FloatArray) -> None:
    """Replace the memories z in `out` by offset + c1 u + c2 u^2 + ... + gain z.

    The parameters from `first` on are (gain, offset, c1, c2, ...).
    """
    gain, offset = parameters[first], parameters[first + 1]
    if parameters.size == first + 3:
        slope = 0.0 + parameters[first + 2]  # as `polynomial` begins
        for k in range(u.size):
            out[k] = offset + slope * u[k] + gain * out[k]
        return
    for k in range(u.size):
        total = 0.0  # as `polynomial`, without a view for each sample
        for j in range(parameters.size - 1, first + 1, -1):
            total = (total + parameters[j]) * u[k]
        out[k] = offset + total + gain * out[k]


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is a law's workspace with the last u and z in front, and moves along.

    `parameters` is (A, beta, gamma, n, gain, offset, c1, c2, ...) with the output
    y = offset + c1 u + c2 u^2 + ... + gain z.
    """
    A, beta, gamma, n = parameters[0], parameters[1], parameters[2], parameters[3]
    z = state[1]
    if math.isfinite(z):  # a memory that has diverged remains so
        z = advance(z, u - state[0], A, beta, gamma, n, borrowed(state))
    return moved_to(u, z, parameters, state)


@kernel
def start(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """Complete the state of `step` for a first input `u0`: the input, and the charts of the exponent."""
    state[0] = u0
    prepare(parameters[0], parameters[1], parameters[2], parameters[3], 0.0, state)


@kernel
def resume(parameters: FloatArray, before: FloatArray, state: FloatArray) -> None:
    """Make a state ready for other parameters than those `before`: a new exponent needs new charts."""
    prepare(parameters[0], parameters[1], parameters[2], parameters[3], before[3], state)


@kernel
def linear_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `step` for n = 1, without a workspace."""
    z, du = state[1], u - state[0]
    if math.isfinite(z) and du != 0.0:
        A, beta, gamma = parameters[0], parameters[1], parameters[2]
        z = linear_advance(z, du, A, beta + gamma, beta - gamma)
    return moved_to(u, z, parameters, state)


@kernel
def quadratic_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `step` for n = 2, without a workspace."""
    z, du = state[1], u - state[0]
    if math.isfinite(z) and du != 0.0:
        A, beta, gamma = parameters[0], parameters[1], parameters[2]
        z = quadratic_advance(z, du, A, beta + gamma, beta - gamma)
    return moved_to(u, z, parameters, state)


@inlined
def moved_to(u: float, z: float, parameters: FloatArray, state: FloatArray) -> float:
    """Put input and memory into the state, and return the output there."""
    state[0], state[1] = u, z
    return float(parameters[5] + polynomial(u, parameters, 6) + parameters[4] * z)


@inner
def polynomial(u: float, coefficients: FloatArray, first: int) -> float:
    """c1 u + c2 u^2 + ..., with c1 at `first`."""
    total = 0.0
    for k in range(coefficients.size - 1, first - 1, -1):
        total = (total + coefficients[k]) * u
    return total
