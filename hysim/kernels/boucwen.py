"""The Bouc-Wen law along a monotone input, exactly.

    dz/du = A - |z|^n (gamma + beta sign(z du))

Let `du` be one monotone stretch of the input. In the frame that points along it, with L the length
travelled and w = |z|, both sides of z = 0 obey the same scalar equation

    dw/dL = a - c w^n,   w >= 0,      loading (z du > 0):    a =  A,  c = beta + gamma
                                      unloading (z du < 0):  a = -A,  c = beta - gamma

so one flow, used twice around a zero crossing, is the whole law. It is elementary for n = 1 and n = 2
(`hysim.kernels.elementary`). For other n everything is measured in w* = |a/c|^(1/n), the value at which
the two terms balance: then a and c are plus or minus one, and what is left is one function of n
(`hysim.kernels.charts`). An escape to infinity is returned as `inf`.

Layers: scalar functions first (no allocation, no exceptions), then the loops over a path and over a
batch of laws, then `step`, the form in which closed loops and chains take the law.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel
from hysim.kernels.charts import N_CHARTS, N_EXPONENT, forget, move, power_flow, prepare_exponent
from hysim.kernels.elementary import linear_advance, quadratic_advance

# The constants of a law: w*, 1/w* and |a|/w* loading, the same unloading, and those of its exponent.
_SIDE = 3
_EXPONENT = 2 * _SIDE
N_CONSTANTS = _EXPONENT + N_EXPONENT
N_SCRATCH = N_CHARTS

_EXTREME = 1.0e300  # a balance beyond it, or below its inverse, is one of a vanishing term


# ---------------------------------------------------------------------------------- scalar functions


@kernel
def flow(
    w: float, a: float, c: float, n: float, length: float, side: int, constants: FloatArray, scratch: FloatArray
) -> tuple[float, float]:
    """Move along w' = a - c w^n for `length`, or until w = 0: the change of w, and the length left over.

    `side` is 0 for the constants of loading, 1 for those of unloading.
    """
    balance, inverse, rate = constants[_SIDE * side], constants[_SIDE * side + 1], constants[_SIDE * side + 2]
    if 0.0 < balance < math.inf:
        change, left = move(
            w * inverse, a > 0.0, 0 if (a > 0.0) == (c > 0.0) else 1, n, length * rate, constants[_EXPONENT:], scratch
        )
        return (change * balance, 0.0) if left == 0.0 else (-w, left / rate)
    if balance == 0.0:
        return power_flow(w, c, n, length) - w, 0.0
    if a < 0.0 and w + a * length < 0.0:
        return -w, length + w / a
    return a * length, 0.0


@kernel
def advance(
    z: float, du: float, A: float, beta: float, gamma: float, n: float, constants: FloatArray, scratch: FloatArray
) -> float:
    """Memory after the input has moved monotonically by `du`; `constants` come from `prepare`."""
    if du == 0.0:
        return z
    if n == 1.0:
        return linear_advance(z, du, A, beta + gamma, beta - gamma)
    if n == 2.0:
        return quadratic_advance(z, du, A, beta + gamma, beta - gamma)
    return power_advance(z, du, A, beta, gamma, n, constants, scratch)


@kernel
def power_advance(
    z: float, du: float, A: float, beta: float, gamma: float, n: float, constants: FloatArray, scratch: FloatArray
) -> float:
    """As `advance` for other n."""
    direction = math.copysign(1.0, du)
    loading = direction * z > 0.0 or (z == 0.0 and A > 0.0)
    w, length = abs(z), abs(du)
    if loading:
        change, left = flow(w, A, beta + gamma, n, length, 0, constants, scratch)
    else:
        change, left = flow(w, -A, beta - gamma, n, length, 1, constants, scratch)
    if left > 0.0:  # the rest of the way begins at z = 0, on the other side, where w grows
        w, loading = 0.0, not loading
        if loading:
            change, left = flow(w, A, beta + gamma, n, left, 0, constants, scratch)
        else:
            change, left = flow(w, -A, beta - gamma, n, left, 1, constants, scratch)
    return direction * (w + change) if loading else -direction * (w + change)


@kernel
def prepare(A: float, beta: float, gamma: float, n: float, constants: FloatArray) -> None:
    """Fill `constants`, shape (N_CONSTANTS,)."""
    prepare_side(A, beta + gamma, n, constants)
    prepare_side(A, beta - gamma, n, constants[_SIDE:])
    if not elementary(n):
        prepare_exponent(n, constants[_EXPONENT:])


@kernel
def elementary(n: float) -> bool:
    """Whether the law needs no constants."""
    return n == 1.0 or n == 2.0  # noqa: PLR1714  (a tuple would be built)


@kernel
def prepare_side(A: float, c: float, n: float, constants: FloatArray) -> None:
    """Fill w*, 1/w* and |A|/w*; w* is 0 or inf where one of the terms vanishes."""
    balance = math.inf
    if A == 0.0:
        balance = 0.0
    elif c != 0.0:
        exponent = (math.log(abs(A)) - math.log(abs(c))) / n
        balance = abs(A / c) ** (1.0 / n) if abs(exponent) < 600.0 else 0.0 if exponent < 0.0 else math.inf
    constants[0] = balance
    constants[1] = constants[2] = 0.0
    if 0.0 < balance < math.inf:
        constants[1], constants[2] = 1.0 / balance, abs(A) / balance


# ---------------------------------------------------------------------------------- path and batch


@kernel
def path(A: float, beta: float, gamma: float, n: float, last_u: float, z: float, u: FloatArray, out: FloatArray) -> int:
    """Memory at the samples of `u` from (last_u, z) into `out`: the first sample that is not finite, or -1."""
    constants, scratch = np.zeros(N_CONSTANTS), np.empty(N_SCRATCH)
    prepare(A, beta, gamma, n, constants)
    forget(scratch)
    return along(A, beta, gamma, n, last_u, z, u, constants, scratch, out)


@kernel
def along(
    A: float,
    beta: float,
    gamma: float,
    n: float,
    last_u: float,
    z: float,
    u: FloatArray,
    constants: FloatArray,
    scratch: FloatArray,
    out: FloatArray,
) -> int:
    """As `path`, with the law's constants."""
    for k in range(u.size):
        z = advance(z, u[k] - last_u, A, beta, gamma, n, constants, scratch)
        last_u = u[k]
        out[k] = z
        if not math.isfinite(z):
            return k
    return -1


@kernel
def batch(parameters: FloatArray, u: FloatArray, out: FloatArray, start: int, stop: int) -> None:
    """Memories of the laws `start` to `stop - 1`.

    `parameters` is (n_sets, 5) with columns A, beta, gamma, n, z0; `u` is (1, n_samples) or
    (n_sets, n_samples); `out` is (n_sets, n_samples). A law that escapes is a row of inf.
    """
    constants, scratch = np.zeros(N_CONSTANTS), np.empty(N_SCRATCH)
    last_n = math.nan
    for i in range(start, stop):
        A, beta, gamma, n, z0 = parameters[i]
        row = u[min(i, u.shape[0] - 1)]
        if n == last_n:
            prepare_side(A, beta + gamma, n, constants)
            prepare_side(A, beta - gamma, n, constants[_SIDE:])
        else:
            prepare(A, beta, gamma, n, constants)
            forget(scratch)
            last_n = n
        if along(A, beta, gamma, n, row[0], z0, row, constants, scratch, out[i]) >= 0:
            out[i] = math.inf


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is (last u, z, scratch) and moves along.

    `parameters` is (A, beta, gamma, n, gain, offset, constants, c1, c2, ...) with the output
    y = offset + c1 u + c2 u^2 + ... + gain z.
    """
    A, beta, gamma, n = parameters[0], parameters[1], parameters[2], parameters[3]
    z = advance(state[1], u - state[0], A, beta, gamma, n, parameters[6 : 6 + N_CONSTANTS], state[2:])
    state[0], state[1] = u, z
    return float(parameters[5] + polynomial(u, parameters[6 + N_CONSTANTS :]) + parameters[4] * z)


@kernel
def polynomial(u: float, coefficients: FloatArray) -> float:
    """c1 u + c2 u^2 + ..."""
    total = 0.0
    for k in range(coefficients.size - 1, -1, -1):
        total = (total + coefficients[k]) * u
    return total
