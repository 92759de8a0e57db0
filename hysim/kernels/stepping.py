"""The one way in which loops and chains take a law: as a pointer to `step(parameters, state, u) -> y`.

Every step has the same type, so that a loop is compiled once for all laws, the users' own among them,
and is found in the cache by later processes. `state` is changed in place.
"""

from collections.abc import Callable

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel

VECTOR = types.Array(float64, 1, "C")
CONSTANTS = types.Array(float64, 1, "C", readonly=True)
STEP = types.FunctionType(float64(CONSTANTS, VECTOR, float64))

Step = Callable[[FloatArray, FloatArray, float], float]


@signed_kernel(int64(STEP, CONSTANTS, VECTOR, CONSTANTS, VECTOR))
def drive(step: Step, parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray) -> int:
    """Outputs of a law at the inputs `u` into `out`: the first sample that is not finite, or -1."""
    for k in range(u.size):
        out[k] = step(parameters, state, u[k])
        if not abs(out[k]) < 1.7976931348623157e308:
            return k
    return -1


@signed_kernel(float64(CONSTANTS, VECTOR, float64))
def line(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The law without memory, `parameters` (offset, slope) and `state` (last u)."""
    state[0] = u
    return float(parameters[0] + parameters[1] * u)
