"""The inverse of the law of Jiles and Atherton: the field H for an output, B or M.

    y = offset + feedthrough H + gain M,    H = a (x - A (w c m + (1 - w c) z)),    M = Ms (c m + (1 - c) z)

y is a sum of x, m and z like H: the same search finds the effective field (`hysim.kernels.jiles_atherton`), and H
follows. Feedthrough and gain have one sign: y then rises, or falls, along every branch.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import jiles_atherton as law
from hysim.kernels._compile import kernel
from hysim.kernels.inverses import N_LIMITS, N_PLACE, within_limits


@kernel
def step(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Field for the next output `y`, nan if no field gives it.

    `parameters` are the limits and those of the law, `state` is (u, y) and the state of the copy of the law.
    """
    own, copy = parameters[N_LIMITS:], state[N_PLACE:]
    u, reached = state[0], state[1]
    if y == reached:
        return float(u)
    a, Ms, coupling, c = own[law.FIELD], own[law.SATURATION], own[law.COUPLING], own[law.REVERSIBLE]
    share, gain, feedthrough = own[law.FEEDBACK] * c, abs(own[law.GAIN]) * Ms, abs(own[law.FEEDTHROUGH]) * a
    rising = math.copysign(1.0, own[law.GAIN] + own[law.FEEDTHROUGH])
    delta = rising if y > reached else -rising
    z = copy[1] / Ms
    if copy[2] == 0.0:
        copy[2], copy[3] = law.first_place(u / a, z, own), 0.0
    of_m, of_z = gain * c - feedthrough * coupling * share, gain * (1.0 - c) - feedthrough * coupling * (1.0 - share)
    target = delta * rising * (y - own[law.OFFSET])
    x, rest = delta * copy[2], delta * copy[3]
    x, rest, after, m = law.advance(x, rest, delta * z, target, (feedthrough, of_m, of_z), own)
    wanted = delta * a * (x - coupling * (share * m + (1.0 - share) * after))
    if delta * (wanted - u) <= 0.0:
        return float(u)  # the step is below a rounding of the effective field, and might go the wrong way
    end = within_limits(parameters, wanted, delta)
    if end == wanted:
        state[0], state[1] = end, y
        copy[0], copy[2], copy[3] = end, delta * x, delta * rest
        if after != delta * z:
            copy[1] = delta * Ms * after
    elif not math.isnan(end):
        reached = law.step(own, copy, end)
        state[0], state[1] = end, reached
    return float(wanted)
