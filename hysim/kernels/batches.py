"""Many laws of one family at once, by the step with which loops take one of them.

`parameters` is (n_sets, n_parameters) and `memory`, the front of the state before the first sample, (n_sets, n_memory):
one law a row. The laws use one state in turn, `scratch` places more than the memory. Each finds its first input, its
memory, a zero in the last place, and the rest as left by the law before. `u` is (1 or n_sets, n_samples).
"""

import math

import numpy as np
from numba import float64, int64, types, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.stepping import START, STEP, Start, Step, drive

TABLE = types.Array(float64, 2, "C", readonly=True)
ROWS = types.Array(float64, 2, "C")


@inlined
def begin(state: FloatArray, memory: FloatArray, first: float) -> None:
    """The state of a law with this memory before its first input."""
    for k in range(1, memory.size):
        state[k] = memory[k]
    if state.size > memory.size:
        state[-1] = 0.0
    state[0] = first


@signed_kernel(void(STEP, START, TABLE, TABLE, int64, TABLE, ROWS))
def drive_each(
    step: Step, begun: Start, parameters: FloatArray, memory: FloatArray, scratch: int, u: FloatArray, out: FloatArray
) -> None:
    """Outputs of many laws, which `begun` starts; one that diverges is a row of inf."""
    state = np.zeros(memory.shape[1] + scratch)
    for i in range(out.shape[0]):
        row = u[min(i, u.shape[0] - 1)]
        if row.size == 0:
            continue
        begin(state, memory[i], row[0])
        begun(parameters[i], state, row[0])
        if drive(step, parameters[i], state, row, out[i]) >= 0:
            out[i] = math.inf
