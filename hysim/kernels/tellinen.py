"""Tellinen's law between two branches of tanh, exactly.

    upper(u) = tanh((u + coercivity) / scale)       lower(u) = tanh((u - coercivity) / scale)
    rising     m' = (upper - m) / (upper - lower) lower'
    falling    m' = (m - lower) / (upper - lower) upper'

in units of the saturation. With m = lower + p (upper - lower) a rising input obeys p' = -p upper' / (upper - lower),
which for these branches is p' = -p (coth k - tanh x) / scale with x = (u + coercivity) / scale and
k = 2 coercivity / scale. A stroke of the length d scale therefore multiplies p by

    (1 + tanh x) / 2 exp(-(coth k - 1) d) + (1 - tanh x) / 2 exp(-(coth k + 1) d)

with x where the stroke has begun. These are two decays: what p loses is a sum of two terms of one sign. A falling
input is a rising one of the mirrored law, in which 1 - p takes the place of p.

`parameters` is (offset, saturation, feedthrough, coercivity, scale, coth k - 1, coth k + 1), `state` (u, z) with
z = 2 p - 1, the place between the branches from -1 to 1.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.stepping import STEP

_LARGEST = 700.0
"""Exponent beyond which the exponential function overflows."""


@inlined
def share(x: float) -> float:
    """(1 + tanh x) / 2, with all its digits where it is small."""
    return float(1.0 / (1.0 + math.exp(min(-2.0 * x, _LARGEST))))


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    coercivity, scale = parameters[3], parameters[4]
    if u != state[0]:
        direction = 1.0 if u > state[0] else -1.0
        x = (direction * state[0] + coercivity) / scale
        d = abs(u - state[0]) / scale
        lost = -share(x) * math.expm1(-parameters[5] * d) - share(-x) * math.expm1(-parameters[6] * d)
        state[1] = state[1] * (1.0 - lost) - direction * lost
        state[0] = u
    upper, lower = math.tanh((u + coercivity) / scale), math.tanh((u - coercivity) / scale)
    m = 0.5 * ((1.0 + state[1]) * upper + (1.0 - state[1]) * lower)
    return float(parameters[0] + parameters[2] * u + parameters[1] * m)
