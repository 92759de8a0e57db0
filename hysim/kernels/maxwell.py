"""The generalized Maxwell-slip model along a stroke.

    an element that sticks     F_i' = k_i v                              until |F_i| reaches weight_i g(v)
    an element that slips      F_i' = sign(v) C (weight_i - |F_i| / g)   until v turns or stops
    force                      sum of F_i + viscous v

Along an even stroke g is constant: an element sticks over a known distance, and then its force decays exponentially to
weight_i g. Along a stroke of a structure's element g is taken as linear over the distance.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.friction_rates import moved_on, stribeck
from hysim.kernels.stepping import STEP

_N_OTHERS = 8  # parameters beside those of the elements


@inlined
def stuck_distance(along: float, stiffness: float, limit: float, slope: float) -> float:
    """Distance over which an element sticks: its limit changes by `slope` with the distance."""
    if along >= limit:
        return 0.0
    return (limit - along) / (stiffness - slope) if stiffness > slope else math.inf


@inlined
def relaxed(along: float, begin: float, end: float, kappa: float) -> float:
    """Force of an element that slips while its limit goes evenly from `begin` to `end`."""
    decay = math.exp(-kappa)
    average = -math.expm1(-kappa) / kappa if kappa > 0.0 else 1.0 - 0.5 * kappa
    return end + (along - begin) * decay - (end - begin) * average


@inlined
def friction(parameters: FloatArray, n: int, speed: float) -> float:
    """Friction of `n` elements together at a steady speed."""
    i = 2 * n + 1
    return stribeck(speed, parameters[i], parameters[i + 1], parameters[i + 2], parameters[i + 3])


@inlined
def move(
    parameters: FloatArray, state: FloatArray, first: int, rise: float, duration: float, begin: float, end: float
) -> float:
    """Sum of the forces after a stroke, along which friction goes evenly from `begin` to `end`.

    The forces of the elements stand in the state from the place `first` on, and their directions of slip behind them.
    A stroke without a duration is a correction, of either direction, after which what slips goes on to slip.
    """
    n = (parameters.size - _N_OTHERS) // 2
    direction = 1.0 if rise > 0.0 else -1.0
    length, attraction = abs(rise), parameters[2 * n + 5]
    force = 0.0
    for i in range(n):
        if duration == 0.0:
            if state[first + n + i] == 0.0:
                state[first + i] += parameters[1 + i] * rise
        elif length > 0.0:
            along, slips = direction * state[first + i], state[first + n + i] * direction > 0.0
            stiffness, weight = parameters[1 + i], parameters[1 + n + i]
            slope = weight * (end - begin) / length
            stuck = 0.0 if slips else stuck_distance(along, stiffness, weight * begin, slope)
            if stuck >= length:
                along += stiffness * length
                state[first + n + i] = 0.0
            else:
                limit = weight * begin + slope * stuck
                along = max(along, limit) if stuck == 0.0 and not slips else along if slips else limit
                kappa = attraction * (1.0 - stuck / length) / (0.5 * (limit / weight + end)) * duration
                along = relaxed(along, limit, weight * end, kappa)
                state[first + n + i] = direction
            state[first + i] = direction * along
        else:
            state[first + n + i] = 0.0
        force += state[first + i]
    return force


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force after an even stroke; `state` is (last u, forces, directions of slip).

    `parameters` are sample_time, the stiffness and the weight of each element, coulomb, breakaway, stribeck_velocity,
    stribeck_exponent, attraction, viscous and offset.
    """
    n = (parameters.size - _N_OTHERS) // 2
    rise = u - state[0]
    rate = rise / parameters[0]
    g = friction(parameters, n, abs(rate))
    force = move(parameters, state, 1, rise, parameters[0], g, g)
    state[0] = u
    return float(parameters[2 * n + 7] + force + parameters[2 * n + 6] * rate)


@signed_kernel(STEP.signature)
def rated_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force after a stroke of an element without the viscous part; see `rates`."""
    n = (parameters.size - _N_OTHERS) // 2
    rise = u - state[0]
    begin, end = friction(parameters, n, abs(state[3])), friction(parameters, n, abs(state[2]))
    force = move(parameters, state, 4, rise, state[1], begin, end)
    moved_on(state, u)
    return float(parameters[2 * n + 7] + force)
