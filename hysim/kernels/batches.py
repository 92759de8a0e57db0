"""Many laws of one family at once, by the step with which loops take one of them, and the memory of one.

`parameters` is (n_sets, n_parameters) and `memory`, the front of the state before the first sample, (n_sets, n_memory):
one law a row. The laws use one state in turn, `scratch` places more than the memory. Each finds its first input, its
memory, a zero in the last place, and the rest as left by the law before. `u` is (1 or n_sets, n_samples).
"""

import math

import numpy as np
from numba import float64, int64, types, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, START, STEP, VECTOR, Start, Step, drive

TABLE = types.Array(float64, 2, "C", readonly=True)
ROWS = types.Array(float64, 2, "C")


@signed_kernel(void(STEP, START, TABLE, ROWS, int64, TABLE, ROWS))
def drive_each(
    step: Step, begun: Start, parameters: FloatArray, memory: FloatArray, scratch: int, u: FloatArray, out: FloatArray
) -> None:
    """Outputs of many laws, which `begun` starts, into `out`, and their memories after them in place of `memory`.

    A law that diverges is a row of inf, and has a memory of nan. The outputs may share a single row.
    """
    n_memory = memory.shape[1]
    state = np.zeros(n_memory + scratch)
    for i in range(memory.shape[0]):
        row, y = u[min(i, u.shape[0] - 1)], out[min(i, out.shape[0] - 1)]
        if row.size == 0:
            continue
        for k in range(1, n_memory):
            state[k] = memory[i, k]
        if scratch > 0:
            state[-1] = 0.0
        state[0] = row[0]
        begun(parameters[i], state, row[0])
        lost = drive(step, parameters[i], state, row, y) >= 0
        if lost:
            y[:] = math.inf
        for k in range(n_memory):
            memory[i, k] = math.nan if lost else state[k]


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
