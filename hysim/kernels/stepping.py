"""The one way in which loops and chains take a law: as a pointer to `step(parameters, state, u) -> y`.

Every step has the same type, so that a loop is compiled once for all laws, the users' own among them,
and is found in the cache by later processes. `state` is changed in place.
"""

import math
from collections.abc import Callable

import numpy as np
from numba import float64, int64, types, void

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel

VECTOR = types.Array(float64, 1, "C")
CONSTANTS = types.Array(float64, 1, "C", readonly=True)
TABLE = types.Array(float64, 2, "C", readonly=True)
ROWS = types.Array(float64, 2, "C")
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


@signed_kernel(void(STEP, TABLE, CONSTANTS, int64, TABLE, ROWS, int64, int64))
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
    its first input and its z0 in front, a zero in the last place, and the rest as its forerunner left it.
    """
    state = np.zeros(n_state)
    for i in range(start, stop):
        row = u[min(i, u.shape[0] - 1)]
        if row.size == 0:
            continue
        state[0], state[1], state[-1] = row[0], z0[i], 0.0
        if drive(step, parameters[i], state, row, out[i]) >= 0:
            out[i] = math.inf


@signed_kernel(float64(CONSTANTS, VECTOR, float64))
def line(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The law without memory, `parameters` (offset, slope)."""
    return float(parameters[0] + parameters[1] * u)
