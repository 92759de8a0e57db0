"""Many parameter sets of a law that is taken as a pointer, each over the same input.

    out[i, k] = step(parameters[i], state[i], u[k])

See `hysim.kernels.stepping` for the type of the step.
"""

from numba import float64, int64, types, void

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, STEP, Step, drive

TABLE = types.Array(float64, 2, "C")
CONSTANT_TABLE = types.Array(float64, 2, "C", readonly=True)


@signed_kernel(void(STEP, CONSTANT_TABLE, TABLE, CONSTANTS, TABLE, int64, int64))
def drive_sets(
    step: Step, parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray, start: int, stop: int
) -> None:
    """Outputs (n_sets, n_samples) of the sets `start` to `stop - 1`; a set that is lost is a row of inf."""
    for i in range(start, stop):
        if drive(step, parameters[i], state[i], u, out[i]) >= 0:
            out[i] = float("inf")
