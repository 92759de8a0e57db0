"""The one way in which loops and chains take a law: as a pointer to `step(parameters, state, u) -> y`.

Every step has the same type, so that a loop is compiled once for all laws, the users' own among them,
and is found in the cache by later processes. `state` is changed in place.

Two steps make one of the same type. Its parameters are the numbers of the first law's parameters and states, and
then both laws' own; its state is that of the first law, and then that of the second. More than two are pairs of pairs.
"""

import math
from collections.abc import Callable

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_closure, signed_kernel

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


# ---------------------------------------------------------------------- laws side by side and behind each other


def side_by_side(first: Step, second: Step) -> Step:
    """The step of the sum of both outputs."""

    @signed_closure(STEP.signature)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        n, m = 2 + int(parameters[0]), int(parameters[1])
        y = first(parameters[2:n], state[:m], u)
        return y + second(parameters[n:], state[m:], u)

    return step


def one_behind_the_other(first: Step, second: Step) -> Step:
    """The step of the second law for the output of the first."""

    @signed_closure(STEP.signature)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        n, m = 2 + int(parameters[0]), int(parameters[1])
        y = first(parameters[2:n], state[:m], u)
        return second(parameters[n:], state[m:], y) if math.isfinite(y) else y

    return step


# ---------------------------------------------------------------------------------- a user's own step


def compile_step(function: Step) -> Step:
    """Compile a plain function for the type `STEP`; numba's errors pass through."""
    return signed_kernel(float64(CONSTANTS, VECTOR, float64))(function)
