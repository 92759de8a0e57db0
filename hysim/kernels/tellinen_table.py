"""Tellinen's law between two branches that are broken lines, exactly.

With m = lower + p (upper - lower) a rising input obeys p' = -p upper' / (upper - lower), a falling one the same for
1 - p and the lower branch. Where both branches are straight their distance w is so too, and a stroke from w1 to w2, on
which the branch behind rises by s, multiplies p by

    exp(-(s / w1) log(1 + x) / x),    x = w2 / w1 - 1

Beyond the table both branches are level.

`parameters` is (offset, feedthrough, inputs, lower branch, upper branch), `state` (u, z) with z = 2 p - 1.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner, signed_kernel
from hysim.kernels.stepping import STEP

N_HEAD = 2
_NEARLY_TOUCHED = -0.5  # x, from which on the distance that is left tells the logarithm better
_STRAIGHT = 1e-8  # x for which log(1 + x) / x is 1 - x / 2 to rounding


@inner
def interval(parameters: FloatArray, first: int, n: int, u: float) -> int:
    """The piece of a table of `n` inputs from the place `first` on in which `u` lies; outside, the piece next to it."""
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if parameters[first + middle] <= u:
            low = middle
        else:
            high = middle
    return low


@inlined
def branch(parameters: FloatArray, first: int, n: int, k: int, u: float) -> float:
    """The branch whose values begin at the place `first`, in the piece k or level beyond it."""
    left, right = parameters[N_HEAD + k], parameters[N_HEAD + k + 1]
    part = min(max((u - left) / (right - left), 0.0), 1.0)
    return float((1.0 - part) * parameters[first + k] + part * parameters[first + k + 1])


@inlined
def width_at(parameters: FloatArray, n: int, k: int, u: float) -> float:
    """Distance of the branches, in the piece k or level beyond it."""
    return float(branch(parameters, N_HEAD + 2 * n, n, k, u) - branch(parameters, N_HEAD + n, n, k, u))


@inlined
def decay(parameters: FloatArray, n: int, k: int, u: float, end: float) -> float:
    """Logarithm of what is left of the distance to the branch along which a stroke goes, after its part in piece k."""
    lower, upper = N_HEAD + n + k, N_HEAD + 2 * n + k
    left, right = parameters[N_HEAD + k], parameters[N_HEAD + k + 1]
    length = (min(max(end, left), right) - min(max(u, left), right)) / (right - left)
    rise, climb = parameters[lower + 1] - parameters[lower], parameters[upper + 1] - parameters[upper]
    behind = abs(length) * (climb if end > u else rise)
    if behind <= 0.0:
        return 0.0
    width = width_at(parameters, n, k, u)
    after = width_at(parameters, n, k, end)
    if width <= 0.0 or after <= 0.0:  # where the branches touch, nothing is left
        return -math.inf
    x = (climb - rise) * length / width
    if abs(x) < _STRAIGHT:
        return float(-(behind / width) * (1.0 - 0.5 * x + x * x / 3.0))
    return float(-(behind / width) * (math.log1p(x) if x > _NEARLY_TOUCHED else math.log(after / width)) / x)


@inner
def stroke(parameters: FloatArray, n: int, u1: float, u2: float) -> float:
    """Logarithm of what is left of the distance to the branch along which a stroke goes."""
    k, last = interval(parameters, N_HEAD, n, u1), interval(parameters, N_HEAD, n, u2)
    side, total, u = (1 if u2 > u1 else 0), 0.0, u1
    while k != last:
        end = parameters[N_HEAD + k + side]
        total += decay(parameters, n, k, u, end)
        u = end
        k += 2 * side - 1
    return total + decay(parameters, n, k, u, u2)


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    n = (parameters.size - N_HEAD) // 3
    if u != state[0]:
        direction = 1.0 if u > state[0] else -1.0
        lost = -math.expm1(stroke(parameters, n, state[0], u))
        state[1] = state[1] * (1.0 - lost) - direction * lost
        state[0] = u
    k = interval(parameters, N_HEAD, n, u)
    lower = branch(parameters, N_HEAD + n, n, k, u)
    upper = branch(parameters, N_HEAD + 2 * n, n, k, u)
    return float(parameters[0] + parameters[1] * u + 0.5 * ((1.0 + state[1]) * upper + (1.0 - state[1]) * lower))
