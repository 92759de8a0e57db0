"""Stribeck's curve, and the velocity along a stroke of an element of a structure.

A law that depends on the rate of its input has two steps. One is for a sample time: its first parameter, the input
moves evenly from sample to sample, and the state is the last input and the memory.

The other one, the *rated* step, is for the elements of a structure. Its state begins with four numbers: the last input,
the duration of the stroke [s], the rate of the input at the end of the stroke, and that at its begin; the first is
moved by the step, the next two are set before it, and the last one is set by the step for the stroke that follows. In
between the input is the cubic through the ends with these rates, whose rate in the middle of the stroke is

    v_m = 3/2 (u - u0) / h - (v0 + v1) / 4

A rated step leaves out the part of the force that a dashpot has, which the structure takes into its damping.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined

LAST, DURATION, RATE, FIRST_RATE, N_RATED = 0, 1, 2, 3, 4


@inlined
def stribeck(speed: float, coulomb: float, breakaway: float, stribeck_velocity: float, exponent: float) -> float:
    """Friction at a steady speed, which is not negative: breakaway at rest, coulomb at high speed."""
    return coulomb + (breakaway - coulomb) * math.exp(-((speed / stribeck_velocity) ** exponent))


@inlined
def middle_speed(length: float, first: float, last: float, duration: float) -> float:
    """Speed in the middle of a stroke of this length, from the speeds at its ends; speeds are not negative."""
    if duration <= 0.0:
        return 0.5 * (first + last)
    return max(0.0, 1.5 * length / duration - 0.25 * (first + last))


@inlined
def moved_on(state: FloatArray, u: float) -> None:
    """The end of this stroke as the begin of the next one."""
    state[0] = u
    state[3] = state[2]
