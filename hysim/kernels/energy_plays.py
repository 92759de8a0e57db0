"""Plays of the field, followed by an anhysteretic curve, exactly.

    z_i  = min(max(z_i, u - r_i), u + r_i)
    y    = offset + feedthrough u + sum_i w_i L(z_i / field),    L(x) = coth x - 1 / x

`parameters` is (offset, feedthrough, field, thresholds, weights), `state` (u, z), z the reversible fields of the cells.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, kernel, signed_kernel
from hysim.kernels.clamps import clamp
from hysim.kernels.stepping import STEP

N_HEAD = 3
_NEAR = 1.0
_TERMS = 8
"""Terms of the continued fraction of L: at x = 1 the ninth is below a rounding."""


@inlined
def langevin(x: float) -> float:
    """Langevin's function, by its continued fraction x / (3 + x^2 / (5 + ...)) where coth x and 1 / x would cancel."""
    if abs(x) > _NEAR:
        return 1.0 / math.tanh(x) - 1.0 / x
    below = 2.0 * _TERMS + 3.0
    for k in range(_TERMS, 0, -1):
        below = 2.0 * k + 1.0 + x * x / below
    return x / below


@kernel
def anhysteretic(x: FloatArray, out: FloatArray) -> None:
    """Langevin's function of all `x` into `out`."""
    for i in range(x.size):
        out[i] = langevin(x[i])


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    n_cells = state.size - 1
    total = parameters[0] + parameters[1] * u
    for i in range(n_cells):
        z = clamp(state[1 + i], u, parameters[N_HEAD + i])
        state[1 + i] = z
        total += parameters[N_HEAD + n_cells + i] * langevin(z / parameters[2])
    state[0] = u
    return float(total)
