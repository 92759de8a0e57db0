"""Many laws of one family at once, by the step with which loops take one of them.

A family then needs no batch kernel of its own: what is compiled for it is its step.
"""

import math

import numpy as np
from numba import float64, int64, types, void

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, STEP, Step, drive

_TABLE = types.Array(float64, 2, "C", readonly=True)
_ROWS = types.Array(float64, 2, "C")


@signed_kernel(void(STEP, _TABLE, CONSTANTS, int64, _TABLE, _ROWS, int64, int64))
def drive_each(
    step: Step,
    parameters: FloatArray,
    z0: FloatArray,
    n_state: int,
    u: FloatArray,
    out: FloatArray,
    start: int,
    stop: int,
) -> None:
    """Outputs of the laws `start` to `stop - 1`, one a row of `parameters`; one that escapes is a row of inf.

    `u` is (1, n_samples) or (n_sets, n_samples). The laws use one state, of `n_state` places, in turn: each finds
    its first input, its z0 and a zero in front, a zero in the last place, and the rest as its forerunner left it.
    """
    state = np.zeros(n_state)
    for i in range(start, stop):
        row = u[min(i, u.shape[0] - 1)]
        if row.size == 0:
            continue
        state[0], state[1], state[2], state[-1] = row[0], z0[i], 0.0, 0.0
        if drive(step, parameters[i], state, row, out[i]) >= 0:
            out[i] = math.inf
