"""Laws side by side and behind each other.

Two steps make one of the same type. Its parameters are the numbers of the first law's parameters and states, and
then both laws' own; its state is that of the first law, and then that of the second. More than two are pairs of pairs.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_closure
from hysim.kernels.stepping import STEP, Step


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
