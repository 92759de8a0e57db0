"""Plays of the field, followed by an anhysteretic curve, exactly.

    z_i  = min(max(z_i, u - r_i), u + r_i)
    y    = offset + feedthrough u + sum_i w_i L(z_i / field),    L(x) = coth x - 1 / x

`parameters` is (offset, feedthrough, field, thresholds, weights), `state` (u, z), z the reversible fields of the cells.
"""

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import kernel, signed_kernel
from hysim.kernels.anhysteretic import langevin
from hysim.kernels.clamps import clamp
from hysim.kernels.stepping import STEP

N_HEAD = 3


@kernel
def anhysteretic(x: FloatArray, out: FloatArray) -> None:
    """Langevin's function of all `x` into `out`."""
    for i in range(x.size):
        out[i], _ = langevin(x[i])


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    n_cells = state.size - 1
    total = parameters[0] + parameters[1] * u
    for i in range(n_cells):
        z = clamp(state[1 + i], u, parameters[N_HEAD + i])
        state[1 + i] = z
        curve, _ = langevin(z / parameters[2])
        total += parameters[N_HEAD + n_cells + i] * curve
    state[0] = u
    return float(total)
