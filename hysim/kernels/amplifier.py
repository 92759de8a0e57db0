"""A driven voltage over one sub-step: it slews towards its target, and charges the load through a resistance.

    s' = +-slew until s is the target,        v' = (s - v) / tau

s is a ramp and then constant, and v has closed forms on both pieces. With e = 1 - exp(-t / tau)

    ramp from s0 to s1 in the time t     v + (s0 - v) e + (s1 - s0) (1 - tau e / t)
    constant s1                          v + (s1 - v) e
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels._compile import inlined


@inlined
def charge(parameters: FloatArray, voltages: FloatArray, target: float) -> float:
    """The voltage v at the end of a sub-step; `voltages` is (s, v) and moves along.

    `parameters` begins with (slew per sub-step, sub-step / tau); infinite ones act at once.
    """
    reach, rate = parameters[0], parameters[1]
    begin, v = voltages[0], voltages[1]
    way = target - begin
    if abs(way) > reach:
        end, ramp = begin + math.copysign(reach, way), 1.0
    else:
        end, ramp = target, abs(way) / reach
    voltages[0] = end
    if rate == math.inf:
        v = end
    else:
        if ramp * rate > 0.0:
            decayed = -math.expm1(-ramp * rate)
            v += (begin - v) * decayed + (end - begin) * (1.0 - decayed / (ramp * rate))
        v += (end - v) * -math.expm1(-(1.0 - ramp) * rate)
    voltages[1] = v
    return float(v)
