"""Memories of laws: of one after each sample, and of many after the last one."""

import math

import numpy as np
from numba import int64, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.batches import ROWS, TABLE, begin
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step, drive


@signed_kernel(int64(STEP, CONSTANTS, VECTOR, CONSTANTS, ROWS))
def drive_memory(step: Step, parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray) -> int:
    """Write the state without the last input after each `u` into `out`; the first sample that is not finite, or -1."""
    for k in range(u.size):
        y = step(parameters, state, u[k])
        for i in range(out.shape[1]):
            out[k, i] = state[1 + i]
        if not abs(y) < 1.7976931348623157e308:
            return k
    return -1


@signed_kernel(void(STEP, TABLE, TABLE, int64, CONSTANTS, VECTOR, ROWS))
def drive_to_end(
    step: Step, parameters: FloatArray, memory: FloatArray, scratch: int, u: FloatArray, y: FloatArray, out: FloatArray
) -> None:
    """The memory of each law after the last sample of `u` into `out`, nan where it diverges.

    `y` has room for the outputs of one law.
    """
    state = np.zeros(memory.shape[1] + scratch)
    for i in range(out.shape[0]):
        begin(state, memory[i], u[0])
        lost = drive(step, parameters[i], state, u, y) >= 0
        for k in range(memory.shape[1]):
            out[i, k] = math.nan if lost else state[k]
