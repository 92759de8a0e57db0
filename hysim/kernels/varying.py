"""Laws whose parameters change along the input: each branch between two samples has those of the sample at its end.

`parameters` is (n_sets * n_samples, n_parameters), the samples of the first set above those of the second. Behind the
first n_memory places of the state, those of `memory` (n_sets, n_memory), is what a law works out from its parameters.
Where these change, `resume`, or with `anew` the start, makes it ready and keeps the memory.
"""

import math

import numpy as np
from numba import boolean, int64, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.batches import ROWS, TABLE
from hysim.kernels.stepping import CONSTANTS, RESUME, START, STEP, Resume, Start, Step


@inlined
def differ(first: FloatArray, second: FloatArray) -> bool:
    """Whether two rows of parameters are different."""
    k = 0
    while k < first.size and first[k] == second[k]:
        k += 1
    return k < first.size


@signed_kernel(void(STEP, START, RESUME, boolean, TABLE, TABLE, int64, CONSTANTS, ROWS, int64, int64))
def drive_varying(
    step: Step,
    start: Start,
    resume: Resume,
    anew: bool,
    parameters: FloatArray,
    memory: FloatArray,
    workspace: int,
    u: FloatArray,
    out: FloatArray,
    first: int,
    stop: int,
) -> None:
    """Outputs of the laws `first` to `stop - 1` at the inputs `u`; one that diverges is a row of inf."""
    n_memory, n = memory.shape[1], u.size
    state = np.empty(n_memory + workspace)
    for i in range(first, stop):
        state[n_memory:] = 0.0
        for k in range(n_memory):
            state[k] = memory[i, k]
        start(parameters[i * n], state, u[0])
        for k in range(n):
            row = i * n + k
            if k > 0 and differ(parameters[row], parameters[row - 1]):
                if anew:
                    kept = state[:n_memory].copy()
                    state[n_memory:] = 0.0
                    start(parameters[row], state, kept[0])
                    for p in range(n_memory):
                        state[p] = kept[p]
                else:
                    resume(parameters[row], parameters[row - 1], state)
            out[i, k] = step(parameters[row], state, u[k])
            if not abs(out[i, k]) < 1.7976931348623157e308:
                out[i] = math.inf
                break
