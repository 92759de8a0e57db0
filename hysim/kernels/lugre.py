"""The LuGre model along a stroke.

    z' = v - sigma0 |v| z / g(v),    F = sigma0 z + sigma1(v) z' + sigma2 v

Along the motion (Z = z sign(v)) the bristles approach their steady deflection g / sigma0. Their distance from it,
w = Z - g / sigma0, obeys, with the path measured in kappa, d kappa = sigma0 |v| / g dt,

    dw / dkappa = -w - (dg / dkappa) / sigma0

At a constant velocity w decays exponentially, whatever the stiffness: z is exact. Along a stroke of a structure's
element g is taken as the quadratic of kappa through begin, middle and end, and kappa by Simpson's rule; the integral of
the exponential with that quadratic is exact again, so that stiff bristles need no short strokes.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.friction_rates import middle_speed, moved_on, stribeck
from hysim.kernels.stepping import STEP

_SERIES = 0.05  # kappa below which the averages of the exponential are series; the terms left out are below 1e-16
_NEAR = 0.5  # kappa below which the change of z is taken, and not its distance from the end
_CLOSEST = 0.05  # share of kappa that either half of a stroke has at least


@inlined
def micro_damping(speed: float, sigma1: float, damping_velocity: float) -> float:
    """Damping of the bristles, which falls with the speed where a velocity for it is given."""
    if damping_velocity == 0.0:
        return sigma1
    ratio = speed / damping_velocity
    return sigma1 * math.exp(-ratio * ratio)


@inlined
def deflection(
    along: float, length: float, sigma0: float, first: float, middle: float, last: float, begin: float, half: float,
    end: float,
) -> float:  # fmt: skip
    """Deflection along the motion after a stroke; speeds and friction at its begin, middle and end."""
    total = first + 4.0 * middle + last
    if total > 0.0:
        f0, fm, f1 = first / begin, 4.0 * middle / half, last / end
        kappa = sigma0 * length * ((f0 + fm + f1) / total)
        share = (5.0 * f0 + 2.0 * fm - f1) / (4.0 * (f0 + fm + f1))
        share = min(max(share, _CLOSEST), 1.0 - _CLOSEST)
    else:
        kappa, share = sigma0 * length / half, 0.5
    square = (half - begin - share * (end - begin)) / (share * (share - 1.0))
    slope = end - begin - square
    if kappa < _SERIES:
        second = 1.0 / 2.0 - kappa * (1.0 / 6.0 - kappa * (1.0 / 24.0 - kappa * (
            1.0 / 120.0 - kappa * (1.0 / 720.0 - kappa * (1.0 / 5040.0 - kappa / 40320.0)))))  # fmt: skip
        average = 1.0 - kappa * second
    else:
        average = -math.expm1(-kappa) / kappa
        second = (1.0 - average) / kappa
    moved = (slope * average + 2.0 * square * second) / sigma0
    return (along - begin / sigma0) * math.exp(-kappa) - moved + end / sigma0


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force after an even stroke; `state` is (last u, z).

    `parameters` are sample_time, sigma0, sigma1, sigma2, coulomb, breakaway, stribeck_velocity, stribeck_exponent,
    damping_velocity and offset.
    """
    sigma0 = parameters[1]
    if u == state[0]:
        return float(parameters[9] + sigma0 * state[1])
    direction = 1.0 if u > state[0] else -1.0
    length = abs(u - state[0])
    speed = length / parameters[0]
    steady = stribeck(speed, parameters[4], parameters[5], parameters[6], parameters[7]) / sigma0
    kappa = length / steady
    distance = direction * state[1] - steady
    after = distance * math.exp(-kappa)
    along = direction * state[1] + distance * math.expm1(-kappa) if kappa < _NEAR else steady + after
    state[0] = u
    state[1] = direction * along
    bristles = micro_damping(speed, parameters[2], parameters[8]) * (-after / steady)
    return float(parameters[9] + direction * (sigma0 * along + (bristles + parameters[3]) * speed))


@signed_kernel(STEP.signature)
def rated_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Force after a stroke of an element, without the dashpot (sigma1 + sigma2) v; see `rates`.

    `parameters` as of `step`, the first without a meaning; `state` ends in z.
    """
    sigma0, z, rate = parameters[1], state[4], state[2]
    length = abs(u - state[0])
    end = stribeck(abs(rate), parameters[4], parameters[5], parameters[6], parameters[7])
    if length > 0.0:
        direction = 1.0 if u > state[0] else -1.0
        first, last = max(0.0, direction * state[3]), max(0.0, direction * rate)
        middle = middle_speed(length, first, last, state[1])
        begin = stribeck(first, parameters[4], parameters[5], parameters[6], parameters[7])
        half = stribeck(middle, parameters[4], parameters[5], parameters[6], parameters[7])
        z = direction * deflection(direction * z, length, sigma0, first, middle, last, begin, half, end)
    moved_on(state, u)
    state[4] = z
    damping = micro_damping(abs(rate), parameters[2], parameters[8])
    bristles = damping * (rate - sigma0 * abs(rate) * z / end)
    return float(parameters[9] + sigma0 * z + bristles - parameters[2] * rate)
