"""A user's own step, compiled to the type of all steps; see `hysim.kernels.stepping`."""

from numba import float64

from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, VECTOR, Step


def compile_step(function: Step) -> Step:
    """Compile a plain function for the type `STEP`; numba's errors pass through."""
    return signed_kernel(float64(CONSTANTS, VECTOR, float64))(function)
