"""Sums of plays with everything that the field has added to them, in one operator.

    below, above = gamma_left(u), gamma_right(u)              gamma(u) = a_0 tanh(a_1 u + a_2) + a_3 + a_4 u
    rho_i = r_i + width |u_k - u_(k-1)| where r_i > 0,  else 0
    z_i   = max(below - rho_i, min(above + rho_i, z_i))       the plays
    y     = offset + S(sum_i w_i z_i)                         S(x) = sum_j c_j S_(d_j)(x), or x without dead zones

    S_d(x) = max(x - d, 0) for d > 0,  min(x - d, 0) for d < 0,  x for d = 0

Layers: scalar functions, then `step` and its inverse for loops. `parameters` is (offset, width, a_0 ... a_4 of the left
envelope, of the right one, r_0 ..., w_0 ..., d_0 ..., c_0 ...), `state` the last input and the positions.
"""

import math

from numba import void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, inlined, inner, kernel, signed_kernel
from hysim.kernels.inverses import N_LIMITS, N_PLACE, within_limits
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR

N_ENVELOPE = 5
LEFT = 2
RIGHT = LEFT + N_ENVELOPE
N_HEAD = RIGHT + N_ENVELOPE

_MAX_STEPS = 400
_ROUNDINGS = 4.0 * 2.0**-52
_REACHED = 1e-13  # of the terms: what rounding may leave where the bracket has closed
_FIRST_STEP = 2.0**-10  # where the output stands still; doubled until it moves


# ---------------------------------------------------------------------------------- scalar functions


@inlined
def envelope(u: float, parameters: FloatArray, first: int) -> tuple[float, float]:
    """The envelope whose coefficients begin at the place `first`, and its slope."""
    height, steepness, line = parameters[first], parameters[first + 1], parameters[first + 4]
    bend = math.tanh(steepness * u + parameters[first + 2])
    return height * bend + parameters[first + 3] + line * u, height * steepness * (1.0 - bend * bend) + line


@inlined
def dead_zone(x: float, d: float) -> float:
    """One-sided dead zone of the threshold `d`; the input itself where that is zero."""
    return max(x - d, 0.0) if d > 0.0 else min(x - d, 0.0) if d < 0.0 else x


@inner
def through_dead_zones(x: float, parameters: FloatArray, first: int) -> float:
    """The sum of the dead zones, whose thresholds begin at the place `first`; x without dead zones."""
    count = (parameters.size - first) // 2
    if count == 0:
        return x
    total = 0.0
    for j in range(first, first + count):
        total += parameters[j + count] * dead_zone(x, parameters[j])
    return total


@inner
def output_after(parameters: FloatArray, state: FloatArray, u: float, widening: float) -> float:
    """Output at the next input `u`, thresholds beyond zero being wider by `widening`; `state` moves along."""
    n_plays = state.size - 1
    below, above = envelope(u, parameters, LEFT)[0], envelope(u, parameters, RIGHT)[0]
    total = 0.0
    for i in range(n_plays):
        r = parameters[N_HEAD + i]
        rho = r + widening if r > 0.0 else r
        state[1 + i] = max(below - rho, min(above + rho, state[1 + i]))
        total += parameters[N_HEAD + n_plays + i] * state[1 + i]
    state[0] = u
    return float(parameters[0] + through_dead_zones(total, parameters, N_HEAD + 2 * n_plays))


@inner
def output_and_slope(
    parameters: FloatArray, state: FloatArray, u: float, direction: float
) -> tuple[float, float, float]:
    """Output, slope in a direction of the input, and size of the terms at the next input `u`, without dead zones."""
    n_plays = state.size - 1
    below, rising = envelope(u, parameters, LEFT)
    above, falling = envelope(u, parameters, RIGHT)
    total, slope, size = parameters[0], 0.0, abs(parameters[0])
    for i in range(n_plays):
        r, weight = parameters[N_HEAD + i], parameters[N_HEAD + n_plays + i]
        width = parameters[1] if r > 0.0 else 0.0
        rho = r + width * abs(u - state[0])
        z = state[1 + i]
        if below - rho >= min(above + rho, z):
            z = below - rho
            slope += weight * (rising - direction * width)
        elif above + rho <= z:
            z = above + rho
            slope += weight * (falling + direction * width)
        total += weight * z
        size += abs(weight * z)
    return total, slope, size


# ---------------------------------------------------------------------------------- what loops take


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    return float(output_after(parameters, state, u, parameters[1] * abs(u - state[0])))


@inner
def solved(parameters: FloatArray, state: FloatArray, y: float, direction: float, side: float) -> float:
    """Input in a direction from the last one that takes the output to `y`, on one side of it; nan without one.

    The output of a law without dead zones is monotone in the input: Newton's method in a bracket that closes on the
    zero, and a bisection where the output stands still.
    """
    u = behind = state[0]
    beyond, ahead = direction * math.inf, _FIRST_STEP * (1.0 + abs(u))
    for _ in range(_MAX_STEPS):
        total, slope, size = output_and_slope(parameters, state, u, direction)
        error = total - y
        if abs(error) <= _ROUNDINGS * (size + abs(y)):
            break
        if side * error < 0.0:
            behind = u
        else:
            beyond = u
        trial = u - error / slope if slope != 0.0 else math.nan
        if trial == u:
            break
        if not direction * behind < direction * trial < direction * beyond:
            trial = 0.5 * (behind + beyond)
            if math.isinf(beyond):
                trial = behind + direction * ahead
                ahead *= 2.0
            if trial in (behind, beyond):
                break
        u = trial
    return u if abs(error) <= _REACHED * (size + abs(y)) else math.nan


@kernel
def inverse_step(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Input that takes the output to `y`, the next one to the last input; see `hysim.kernels.inverses`.

    `parameters` are the limits and those of `step`; `state` is (u, y) and that of `step`.
    """
    own, law = borrowed(parameters)[N_LIMITS:], borrowed(state)[N_PLACE:]
    n_plays, rising = law.size - 1, 0.0
    for i in range(n_plays):
        rising += own[N_HEAD + n_plays + i]  # the sign of all weights together
    side = math.copysign(1.0, y - output_and_slope(own, law, law[0], 1.0)[0])
    direction = math.copysign(1.0, rising) * side
    u = solved(own, law, y, direction, side)
    end = within_limits(parameters, u, direction)
    if not math.isnan(end):
        output = step(own, law, end)
        state[0], state[1] = end, y if end == u else output
    return float(u)


@signed_kernel(void(CONSTANTS, VECTOR, CONSTANTS, CONSTANTS, VECTOR))
def widened(parameters: FloatArray, state: FloatArray, u: FloatArray, widening: FloatArray, out: FloatArray) -> None:
    """Outputs at the samples of `u` into `out`, thresholds beyond zero being wider by `widening`."""
    for k in range(u.size):
        out[k] = output_after(parameters, state, u[k], widening[k])
