"""Fields of losses that depend on the velocity of the flux, and the field of a core that is linear in its weights."""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import STEP

N_ALONE, N_POWERS = 6, 3  # weights of the polynomial alone, 1, x, x^3, ..., x^9; of each stop b, 1, x^2, b^2
_HEAD = 3


@signed_kernel(STEP.signature)
def excess(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The root of the velocity with its sign, `parameters` (sample time, c) and `state` (last u)."""
    velocity = (u - state[0]) / parameters[0]
    state[0] = u
    return float(parameters[1] * math.copysign(math.sqrt(abs(velocity)), velocity))


@signed_kernel(STEP.signature)
def field(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Field of a core, see `hysim.CoreField`; `state` is (last u, stops, what u is ahead of its lags).

    `parameters` are sample_time, size, spread, thresholds, lags, lag_sizes and weights.
    """
    n_memories = state.size - 1
    n_lags = (parameters.size - _HEAD - N_ALONE - (N_POWERS + 1) * n_memories) // (N_POWERS + 1)
    n_stops, rise = n_memories - n_lags, u - state[0]
    first_size, first_weight = _HEAD + n_memories, _HEAD + n_memories + n_lags
    state[0] = u
    x = u / parameters[1]
    squared, power = x * x, x
    total = parameters[first_weight]
    for k in range(1, N_ALONE):
        total += parameters[first_weight + k] * power
        power *= squared
    for k in range(n_memories + n_lags):
        place = k + 1 if k < n_memories else k + 1 - n_lags
        if k < n_stops:
            r = parameters[_HEAD + k]
            state[place] = min(max(state[place] + rise, -r), r)
            part = state[place] / r
        elif k < n_memories:
            ratio = parameters[0] / parameters[_HEAD + k]
            state[place] = state[place] * math.exp(-ratio) - rise * math.expm1(-ratio) / ratio
            part = state[place] / parameters[first_size + k - n_stops]
        else:
            ahead = state[place] / parameters[first_size + k - n_memories]
            part = math.copysign(math.sqrt(abs(ahead)), ahead)
        w = first_weight + N_ALONE + N_POWERS * k
        last = part * part if k < n_stops else squared * squared
        total += part * (parameters[w] + parameters[w + 1] * squared + parameters[w + 2] * last)
    return float(total)
