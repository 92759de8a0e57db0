"""Friction as a curve of the velocity.

    F = sqrt(2 e) (breakaway - coulomb) exp(-(v / v_s)^2) v / v_s + coulomb tanh(v / v_c) + viscous v

with v_s = sqrt(2) breakaway_velocity and v_c = breakaway_velocity / 10.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.friction_rates import moved_on
from hysim.kernels.stepping import STEP

_PEAK = math.sqrt(2.0 * math.e)
_STRIBECK = math.sqrt(2.0)
_COULOMB = 0.1


@inlined
def dry(rate: float, coulomb: float, breakaway: float, breakaway_velocity: float) -> float:
    """Force without the viscous part."""
    ratio = rate / (_STRIBECK * breakaway_velocity)
    peak = _PEAK * (breakaway - coulomb) * (ratio * math.exp(-ratio * ratio)) if abs(ratio) < 1.0e3 else 0.0
    return peak + coulomb * math.tanh(rate / (_COULOMB * breakaway_velocity))


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force after an even stroke; `state` is (last u).

    `parameters` are sample_time, coulomb, breakaway, breakaway_velocity, viscous and offset.
    """
    rate = (u - state[0]) / parameters[0]
    state[0] = u
    force = dry(rate, parameters[1], parameters[2], parameters[3])
    return float(parameters[5] + force + parameters[4] * rate)


@signed_kernel(STEP.signature)
def rated_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force at the end of a stroke of an element without the viscous part; see `rates`."""
    moved_on(state, u)
    return float(parameters[5] + dry(state[2], parameters[1], parameters[2], parameters[3]))
