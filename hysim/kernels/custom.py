"""A user's own step: compiled to the type of all steps, and driven over many parameter sets.

    out[i, k] = step(parameters[i], state[i], u[k])

See `hysim.kernels.stepping` for the type of the step.
"""

from numba import float64, int64, types, void

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step, drive

TABLE = types.Array(float64, 2, "C")
CONSTANT_TABLE = types.Array(float64, 2, "C", readonly=True)


def compile_step(function: Step) -> Step:
    """Compile a plain function for the type `STEP`; numba's errors pass through."""
    return signed_kernel(float64(CONSTANTS, VECTOR, float64))(function)


@signed_kernel(void(STEP, CONSTANT_TABLE, TABLE, CONSTANTS, TABLE, int64, int64))
def drive_sets(
    step: Step, parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray, start: int, stop: int
) -> None:
    """Outputs (n_sets, n_samples) of the sets `start` to `stop - 1`; a set that is lost is a row of inf."""
    for i in range(start, stop):
        if drive(step, parameters[i], state[i], u, out[i]) >= 0:
            out[i] = float("inf")
