"""Fields of losses that depend on the velocity of the flux."""

import math

from numba import float64

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, VECTOR


@signed_kernel(float64(CONSTANTS, VECTOR, float64))
def excess(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The root of the velocity with its sign, `parameters` (c, sample time) and `state` (last u)."""
    velocity = (u - state[0]) / parameters[1]
    state[0] = u
    return float(parameters[0] * math.copysign(math.sqrt(abs(velocity)), velocity))
