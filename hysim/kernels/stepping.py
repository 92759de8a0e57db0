"""The one way in which loops and chains take a law: as a pointer to `step(parameters, state, u) -> y`.

Every step has the same type, so that a loop is compiled once for all laws, the users' own among them,
and is found in the cache by later processes. `state` is changed in place.

Two steps make one of the same type. Its parameters are the numbers of the first law's parameters and states, and
then both laws' own; its state is that of the first law, and then that of the second. More than two are pairs of pairs.

A start, `start(parameters, state, u0)`, completes a state that has not been stepped yet for a first input `u0`: the
first step is that to `u0` itself. It is run once on a state. The second of two laws behind each other learns its first
input from the first one: it is `self_starting`, with one place more at the end of its state.
"""

import math
from collections.abc import Callable
from typing import Any

from numba import float64, int64, types, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import Addressed as Addressed
from hysim.kernels._compile import borrowed as borrowed
from hysim.kernels._compile import by_address as by_address
from hysim.kernels._compile import inlined_kernel as inlined_kernel
from hysim.kernels._compile import signed as signed
from hysim.kernels._compile import signed_closure, signed_kernel
from hysim.kernels._compile import sources as sources
from hysim.kernels._compile import unstored as unstored

VECTOR = types.Array(float64, 1, "C")
CONSTANTS = types.Array(float64, 1, "C", readonly=True)
STEP = types.FunctionType(float64(CONSTANTS, VECTOR, float64))
START = types.FunctionType(void(CONSTANTS, VECTOR, float64))
RESUME = types.FunctionType(void(CONSTANTS, CONSTANTS, VECTOR))

Step = Callable[[FloatArray, FloatArray, float], float]
Start = Callable[[FloatArray, FloatArray, float], None]
Resume = Callable[[FloatArray, FloatArray, FloatArray], None]


@signed_kernel(int64(STEP, CONSTANTS, VECTOR, CONSTANTS, VECTOR))
def drive(step: Step, parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray) -> int:
    """Outputs of a law at the inputs `u` into `out`: the first sample that is not finite, or -1."""
    for k in range(u.size):
        out[k] = step(parameters, state, u[k])
        if not abs(out[k]) < 1.7976931348623157e308:
            return k
    return -1


@signed_kernel(STEP.signature)
def line(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The law without memory, `parameters` (offset, slope) and `state` (last u)."""
    state[0] = u
    return float(parameters[0] + parameters[1] * u)


@signed_kernel(STEP.signature)
def dashpot(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The damper, `parameters` (sample time, c) and `state` (last u)."""
    rise = u - state[0]
    state[0] = u
    return float(parameters[1] * (rise / parameters[0]))


# ---------------------------------------------------------------------------------- starts


@signed_kernel(START.signature)
def start(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """The last input is the first one: all that most laws need."""
    state[0] = u0


@signed_kernel(RESUME.signature)
def unchanged(parameters: FloatArray, before: FloatArray, state: FloatArray) -> None:
    """Nothing: no place of the state depends on the parameters."""


@signed_kernel(START.signature)
def complete(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """Nothing: the state does not depend on the first input."""


# ---------------------------------------------------------------------- laws side by side and behind each other


_PAIR = float64(STEP, STEP, CONSTANTS, VECTOR, float64)


@signed_kernel(_PAIR, _nrt=False)
def side_by_side(first: Step, second: Step, parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The sum of both outputs."""
    n, m = 2 + int(parameters[0]), int(parameters[1])
    y = first(parameters[2:n], state[:m], u)
    return y + second(parameters[n:], state[m:], u)


@signed_kernel(_PAIR, _nrt=False)
def one_behind_the_other(first: Step, second: Step, parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The output of the second law for that of the first."""
    n, m = 2 + int(parameters[0]), int(parameters[1])
    y = first(parameters[2:n], state[:m], u)
    return second(parameters[n:], state[m:], y) if math.isfinite(y) else y


def paired(join: Callable[..., float], first: Step, second: Step) -> Step:
    """The step of two laws that a kernel joins: its code is compiled once for all pairs."""
    by, first_by, second_by = by_address(join, _PAIR), *(by_address(each, STEP.signature) for each in (first, second))

    @signed_closure(STEP.signature)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        return by(first_by, second_by, parameters, state, u)

    return step


def started_both(first: Start, second: Start) -> Start:
    """The start of two laws for the same input."""
    first_by, second_by = by_address(first, START.signature), by_address(second, START.signature)

    @signed_closure(START.signature)
    def start_both(parameters: FloatArray, state: FloatArray, u0: float) -> None:
        first_by(parameters[2 : 2 + int(parameters[0])], state[: int(parameters[1])], u0)
        second_by(parameters[2 + int(parameters[0]) :], state[int(parameters[1]) :], u0)

    return start_both


def self_starting(step: Step, start: Start) -> Step:
    """The step of a law that starts at its first input; the last place of its state is zero before."""
    start_by, step_by = by_address(start, START.signature), by_address(step, STEP.signature)

    @signed_closure(STEP.signature)
    def started_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        last = state.size - 1
        if state[last] == 0.0:
            start_by(parameters, state[:last], u)
            state[last] = 1.0
        return step_by(parameters, state[:last], u)

    return started_step


# ---------------------------------------------------------------------------------- a user's own step


def compile_as(kind: Any, function: Any) -> Any:
    """Compile a plain function as a kind, `STEP` or `START`, at once; numba's errors pass through."""
    compiled = signed_kernel(kind.signature)(function)
    if compiled is not function:  # numba compiles
        compiled.compile(kind.signature)
    return compiled
