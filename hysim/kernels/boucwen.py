"""The Bouc-Wen law along a monotone input, exactly.

    dz/du = A - |z|^n (gamma + beta sign(z du))

Let `du` be one monotone stretch of the input. In the frame that points along it, with L the length
travelled and w = |z|, both sides of z = 0 obey the same scalar equation

    dw/dL = a - c w^n,   w >= 0,      loading (z du > 0):    a =  A,  c = beta + gamma
                                      unloading (z du < 0):  a = -A,  c = beta - gamma

so one flow, used twice around a zero crossing, is the whole law. It is

    n = 1       w + (a - c w) (1 - exp(-c L)) / c
    n = 2       w + (a - c w^2) T / (1 + c w T),  T = tanh(r L)/r or tan(r L)/r,  r^2 = |a c|
    other n     a power series, whose order follows its terms: about w itself, or, where w^n is not
                analytic, about the place where w = 0.

For other n everything is measured in w* = |a/c|^(1/n), the value at which the two terms balance: then
a and c are plus or minus one. An escape to infinity (c < 0) is returned as `inf`.

Layers: scalar functions first (no allocation, no exceptions), then the loops over a path and over a
batch of laws, then `step`, the form in which closed loops and chains take the law.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel

N_TERMS = 32
N_CONSTANTS = 2 + N_TERMS
N_SCRATCH = 2 * N_TERMS

_NEAR = 0.15  # |w/w*|^n below which the flow is expanded about w = 0; the expansion serves up to _EDGE
_EDGE = 0.25  # its radius is 1.085 at n = 20 and larger below, so 32 terms leave less than rounding
_STEP = 0.5  # length of a Taylor step in units of w / (max(n, 1) (1 + w^n)), half of the radius or less
_NEGLIGIBLE = 2.0**-54


# ---------------------------------------------------------------------------------- scalar functions


@kernel
def linear_flow(w: float, a: float, c: float, length: float) -> tuple[float, float]:
    """Flow of n = 1: the value after `length`, and the length left over if w = 0 came first."""
    slope = a - c * w
    if a < 0.0 and slope < 0.0:
        ratio = c * w / a
        to_zero = -math.log1p(-ratio) / -c if abs(ratio) > _NEGLIGIBLE else -w / a
        if length >= to_zero:
            return 0.0, length - to_zero
    x = c * length
    if abs(x) < _NEGLIGIBLE:
        return w + slope * length, 0.0
    if x < -709.0:
        return (math.inf if slope > 0.0 else w), 0.0
    return w - slope * math.expm1(-x) / c, 0.0


@kernel
def quadratic_flow(w: float, a: float, c: float, length: float) -> tuple[float, float]:
    """Flow of n = 2, as `linear_flow`."""
    r = math.sqrt(abs(a * c))
    x = r * length
    same_sign = (a > 0.0) == (c > 0.0)
    if a < 0.0:
        q = -r * w / a
        if q < 1.0e-9:
            to_zero = -w / a
        elif not same_sign:
            to_zero = math.atan(q) / r
        elif q < 1.0:
            to_zero = math.atanh(q) / r
        else:
            to_zero = math.inf
        if length >= to_zero:
            return 0.0, length - to_zero
    if x < 1.0e-9:
        t = length
    elif same_sign:
        t = math.tanh(x) / r
    elif x < 0.5 * math.pi:
        t = math.tan(x) / r
    else:
        return math.inf, 0.0
    denominator = 1.0 + c * w * t
    if denominator <= 0.0:
        return math.inf, 0.0
    return w + (a - c * w * w) * t / denominator, 0.0


@kernel
def power_flow(w: float, c: float, n: float, length: float) -> float:
    """Flow of w' = -c w^n, the case a = 0, for n other than 1."""
    if w == 0.0 or c == 0.0:
        return w
    m = n - 1.0
    base = 1.0 + m * c * w**m * length
    if base <= 0.0:
        return math.inf if m > 0.0 else 0.0
    return float(w * base ** (-1.0 / m))


@kernel
def phase(w: float, sigma: float, n: float) -> float:
    """Length from 0 to w on w' = 1 - sigma w^n: the sum of w (sigma w^n)^k / (k n + 1)."""
    x = sigma * w**n
    total, power = 1.0, 1.0
    for k in range(1, 64):
        power *= x
        term = power / (k * n + 1.0)
        total += term
        if abs(term) < _NEGLIGIBLE:
            break
    return w * total


@kernel
def from_zero(length: float, sigma: float, n: float, series: FloatArray) -> float:
    """Value after `length` from 0 on w' = 1 - sigma w^n: the inverse of `phase`, by its own series."""
    y = sigma * length**n
    total = 0.0
    for k in range(N_TERMS - 1, -1, -1):
        total = total * y + series[k]
    return length * total


@kernel
def taylor_step(w: float, a: float, c: float, n: float, h: float, scratch: FloatArray) -> float:
    """Value after `h` on w' = a - c w^n by the Taylor series about w > 0.

    With w(h) = sum t_k and w(h)^n = sum g_k, the identity w (w^n)' = n w' w^n gives both recursively.
    """
    t, g = scratch[:N_TERMS], scratch[N_TERMS:]
    g[0] = w**n
    t[1] = (a - c * g[0]) * h
    total = t[1]
    for k in range(1, N_TERMS - 1):
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * t[j] * g[k - j]
        g[k] = convolution / (k * w)
        t[k + 1] = -c * h * g[k] / (k + 1)
        total += t[k + 1]
        if abs(t[k + 1]) + abs(t[k]) < _NEGLIGIBLE * w:
            break
    return float(w + total)


@kernel
def scaled_flow(
    w: float, a: float, c: float, n: float, length: float, series: FloatArray, scratch: FloatArray
) -> tuple[float, float]:
    """Flow of any n with a and c plus or minus one, as `linear_flow`."""
    sigma = c * a
    while length > 0.0:
        power = w**n
        if power <= _NEAR:
            travelled = a * phase(w, sigma, n)
            target = travelled + length
            if a < 0.0:
                return (0.0, target) if target >= 0.0 else (from_zero(-target, sigma, n, series), 0.0)
            edge = _EDGE ** (1.0 / n)
            if target <= edge:
                return from_zero(target, sigma, n, series), 0.0
            w = from_zero(edge, sigma, n, series)
            length = target - edge
            power = w**n
        slope = a - c * power
        if abs(slope) < _NEGLIGIBLE:
            return w, 0.0
        if c < 0.0 and power * _NEGLIGIBLE > 1.0:
            return power_flow(w, c, n, length), 0.0
        h = min(length, _STEP * w / (max(n, 1.0) * (1.0 + power)))
        following = taylor_step(w, a, c, n, h, scratch)
        if following == w:  # at the balance to rounding, where every further step would be the same
            return w, 0.0
        w = following
        length -= h
    return w, 0.0


@kernel
def flow(
    w: float, a: float, c: float, n: float, length: float, balance: float, series: FloatArray, scratch: FloatArray
) -> tuple[float, float]:
    """Move along w' = a - c w^n for `length`, or until w = 0: the value, and the length left over.

    `balance` is w* = |a/c|^(1/n), zero or infinite where one of the terms vanishes.
    """
    if n == 1.0:
        return linear_flow(w, a, c, length)
    if n == 2.0:
        return quadratic_flow(w, a, c, length)
    if a == 0.0 or balance == 0.0:
        return power_flow(w, c, n, length), 0.0
    if c == 0.0 or balance == math.inf:
        return linear_flow(w, a, 0.0, length)
    rate = abs(a) / balance
    value, left = scaled_flow(
        w / balance, math.copysign(1.0, a), math.copysign(1.0, c), n, length * rate, series, scratch
    )
    return value * balance, left / rate


@kernel
def advance(
    z: float, du: float, A: float, beta: float, gamma: float, n: float, constants: FloatArray, scratch: FloatArray
) -> float:
    """Memory after the input has moved monotonically by `du`; `constants` come from `prepare`."""
    if du == 0.0:
        return z
    direction = math.copysign(1.0, du)
    loading = direction * z > 0.0 or (z == 0.0 and A > 0.0)
    w, length = abs(z), abs(du)
    for _ in range(2):  # the second time from w = 0, on the other side, where w grows
        side = 1.0 if loading else -1.0
        c = beta + gamma if loading else beta - gamma
        w, length = flow(w, side * A, c, n, length, constants[0 if loading else 1], constants[2:], scratch)
        if length == 0.0 or A == 0.0:
            break
        loading = not loading
    return direction * side * w


@kernel
def prepare(A: float, beta: float, gamma: float, n: float, constants: FloatArray) -> None:
    """Fill `constants`, shape (N_CONSTANTS,): w* loading, w* unloading, the series about w = 0."""
    loading, unloading = abs(beta + gamma), abs(beta - gamma)
    constants[0] = abs(A / loading) ** (1.0 / n) if loading > 0.0 else math.inf
    constants[1] = abs(A / unloading) ** (1.0 / n) if unloading > 0.0 else math.inf
    constants[2:] = 0.0
    constants[2] = 1.0
    if n in (1.0, 2.0):
        return
    # w = L v(y), y = sigma L^n, turns w' = 1 - sigma w^n into (1 + k n) v_k = -[v^n]_(k-1).
    power = np.empty(N_TERMS)
    power[0] = 1.0
    v = constants[2:]
    for k in range(1, N_TERMS):
        v[k] = -power[k - 1] / (1.0 + k * n)
        convolution = 0.0
        for j in range(1, k + 1):
            convolution += (j * (n + 1.0) - k) * v[j] * power[k - j]
        power[k] = convolution / k


# ---------------------------------------------------------------------------------- path and batch


@kernel
def path(A: float, beta: float, gamma: float, n: float, last_u: float, z: float, u: FloatArray, out: FloatArray) -> int:
    """Memory at the samples of `u` from (last_u, z) into `out`: the first sample that is not finite, or -1."""
    constants, scratch = np.empty(N_CONSTANTS), np.empty(N_SCRATCH)
    prepare(A, beta, gamma, n, constants)
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
    for i in range(start, stop):
        A, beta, gamma, n, z0 = parameters[i]
        row = u[min(i, u.shape[0] - 1)]
        if path(A, beta, gamma, n, row[0], z0, row, out[i]) >= 0:
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
