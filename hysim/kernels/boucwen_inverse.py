"""The inverse of the Bouc-Wen law: the input that takes the output to a given value.

    y(u) = offset + P(u) + gain z(u),    dy/du = P'(u) + gain (A - |z|^n (gamma + beta sign(z du)))

From one sample of the output to the next the input moves monotonically, along one branch of the law. The forward step
(`hysim.kernels.boucwen.step`) and the slope above are exact there, so the input is the root of a scalar equation, found
by Newton's method inside a bracket that closes on it. The residual is that of the output itself, not of its increment:
nothing drifts, and the law's response to these inputs is the given output to rounding.

The slope must have one sign, `rising` = 1 or -1, along the whole branch, and at its beginning in the other
direction too, or the output would not determine the direction of the input. On one side of z = 0 the memory's slope
changes monotonically; with a linear P the ends of the stretch and the crossing of z = 0 therefore decide.
With a polynomial a bound on P'' decides where it can, and a few points in between where it cannot.

Layers: scalar functions, then `step` and `elementary_step` in the form in which loops take them; a path is
`stepping.drive`. The scalar functions take `charts`, 1, or None for n = 1 and 2: they then move the law by its closed
forms, and numba leaves out the charts of other exponents, which take most of the time to compile.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels._compile import borrowed, inner, kernel, pasted
from hysim.kernels.elementary import power
from hysim.kernels.inverses import N_LIMITS, N_PLACE, within_limits

N_HEAD = 8
N_OWN = N_PLACE + 2
MAX_STEPS = 400

_EPSILON = 2.0**-52
_SMALLEST = 2.0**-1022  # below it numbers lose their bits: an output that near to another is no other
_ROUNDINGS = 16.0  # of the forward step, which may keep the residual from zero where the bracket has closed
_FLAT = 1e-12  # of the slope ahead: a slope of zero, rounded, where the input turns back
Place = tuple[float, float]
"""Input and memory."""
_POINTS = 16  # evaluated along a branch that the bound on P'' does not decide


# ---------------------------------------------------------------------------------- scalar functions


@inner
def derivative(u: float, coefficients: FloatArray) -> float:
    """c1 + 2 c2 u + 3 c3 u^2 + ..."""
    total = 0.0
    for k in range(coefficients.size - 1, -1, -1):
        total = total * u + (k + 1.0) * coefficients[k]
    return total


@inner
def curvature_bound(reach: float, coefficients: FloatArray) -> float:
    """The most that |P''| can be for |u| <= `reach`."""
    total = 0.0
    for k in range(coefficients.size - 1, 0, -1):
        total = total * reach + (k + 1.0) * k * abs(coefficients[k])
    return total


@inner
def memory_slope(z: float, direction: float, parameters: FloatArray) -> float:
    """Slope dz/du for an input that moves in `direction`, times the gain."""
    A, beta, gamma, n, gain = parameters[1], parameters[2], parameters[3], parameters[4], parameters[5]
    c = gamma + beta if direction * z > 0.0 else gamma - beta
    return float(gain * (A - c * power(abs(z), n)))


@inner
def slope(u: float, z: float, direction: float, parameters: FloatArray) -> float:
    """Slope dy/du for an input that moves in `direction`, counted positive where the output moves with `rising`."""
    coefficients = parameters[N_HEAD : N_HEAD + int(parameters[7])]
    return float(parameters[0] * (derivative(u, coefficients) + memory_slope(z, direction, parameters)))


@inner
def rounding(y: float, u: float, z: float, parameters: FloatArray) -> float:
    """One rounding of the terms of the output at (u, z)."""
    coefficients = parameters[N_HEAD : N_HEAD + int(parameters[7])]
    terms = abs(parameters[5] * z) + abs(parameters[6]) + abs(u * derivative(u, coefficients))
    return float(_EPSILON * (abs(y) + terms) + _SMALLEST)


@pasted
def forward(u: float, z: float, target: float, parameters: FloatArray, memory: FloatArray, charts: int | None) -> float:
    """Output after the input has moved from `u` to `target`; `memory` is then the law's state there."""
    memory[0], memory[1] = u, z
    law = parameters[N_HEAD + int(parameters[7]) :]
    if charts is not None:
        return boucwen.step(law, memory, target)
    return boucwen.linear_step(law, memory, target) if law[3] == 1.0 else boucwen.quadratic_step(law, memory, target)


@inner
def lowest_slope(u: float, z: float, end: float, z_end: float, direction: float, parameters: FloatArray) -> float:
    """A lower bound of `slope` from (u, z) to (end, z_end), the lowest slope itself if P is linear."""
    coefficients = parameters[N_HEAD : N_HEAD + int(parameters[7])]
    rising = parameters[0]
    memory = min(rising * memory_slope(z, direction, parameters), rising * memory_slope(z_end, direction, parameters))
    if z * z_end < 0.0:
        memory = min(memory, rising * memory_slope(0.0, direction, parameters))
    at_ends = rising * (derivative(u, coefficients) + derivative(end, coefficients))
    bend = curvature_bound(max(abs(u), abs(end)), coefficients) * abs(end - u)
    return float(memory + 0.5 * (at_ends - bend))


@pasted
def monotone(place: Place, direction: float, parameters: FloatArray, state: FloatArray, charts: int | None) -> bool:
    """Whether the slope is positive from a place to where the law's state stands; else `state` gets the place."""
    memory = state[N_OWN:]
    u, z, end, z_end = place[0], place[1], memory[0], memory[1]
    lowest = lowest_slope(u, z, end, z_end, direction, parameters)
    if lowest > 0.0:
        return True
    flat = -_FLAT * slope(u, z, direction, parameters)  # and zero where the law has saturated
    for k in range(_POINTS + 1):
        point = u + (end - u) * (k / _POINTS)
        forward(u, z, point, parameters, memory, charts)
        steepness = slope(point, memory[1], direction, parameters)
        if not steepness > flat:
            state[2], state[3] = point, parameters[0] * steepness
            return False
    memory[0], memory[1] = end, z_end
    return bool(parameters[7] > 1.0 or lowest > flat)


@pasted
def solve(
    place: Place, y: float, direction: float, gap: float, parameters: FloatArray, state: FloatArray, charts: int | None
) -> bool:
    """Move the law's state in `direction` from a place (u, z), `gap` short of `y`, to where the output is `y`.

    Returns whether it was reached; the last place goes into `state`.
    """
    memory, u, z = state[N_OWN:], place[0], place[1]
    upward = parameters[0] * direction
    steepness, back = slope(u, z, direction, parameters), slope(u, z, -direction, parameters)
    state[2], state[3] = u, parameters[0] * min(steepness, back)
    if not (steepness > 0.0 and back > -_FLAT * steepness):
        return False
    at_start = rounding(y, u, z, parameters)
    behind, beyond, ahead = u, direction * math.inf, steepness
    before_last = last = math.inf
    target = u + direction * gap / steepness
    for _ in range(MAX_STEPS):
        if math.isinf(target):
            return False
        error = upward * (forward(u, z, target, parameters, memory, charts) - y)
        steepness = slope(target, memory[1], direction, parameters)
        noise = max(at_start, rounding(y, target, memory[1], parameters))
        if abs(error) <= noise < math.inf:
            return True
        if error < 0.0 and steepness > 0.0:
            behind, ahead = target, steepness
        else:
            beyond = target
        if not error >= 0.0:
            state[2], state[3] = target, parameters[0] * steepness
        move = -error / steepness if steepness > 0.0 else math.nan
        trial = target + direction * move
        inside = direction * behind <= direction * trial <= direction * beyond
        if not inside or (not math.isinf(beyond) and abs(move) > 0.5 * before_last):
            trial = 0.5 * (behind + beyond)
            move = abs(trial - target)
        if trial == target and math.isinf(beyond):  # the output rises within a rounding of the input
            trial = target + direction * 2.0 * max(_EPSILON * abs(target), _SMALLEST)
        if trial in (behind, beyond, target):
            steepest = max(steepness, ahead)
            return bool(
                abs(error) < math.inf and abs(error) <= _ROUNDINGS * (noise + _EPSILON * abs(target) * steepest)
            )
        before_last, last = last, abs(move)
        target = trial
    return False


@pasted
def inverse(parameters: FloatArray, state: FloatArray, y: float, charts: int | None) -> float:
    """`step` or `elementary_step`."""
    parameters, state = borrowed(parameters), borrowed(state)
    if y == state[1] and parameters[0] <= state[0] <= parameters[1]:
        return float(state[0])
    own, memory = parameters[N_LIMITS:], state[N_OWN:]
    u, z = memory[0], memory[1]
    upward = 1.0 if y > state[1] else -1.0
    coefficients = own[N_HEAD : N_HEAD + int(own[7])]
    gap = upward * (y - (own[6] + boucwen.polynomial(u, coefficients, 0) + own[5] * z))
    direction, wanted = own[0] * upward, u
    if not gap <= 0.0:
        place = u, z
        exists = solve(place, y, direction, gap, own, state, charts) and monotone(place, direction, own, state, charts)
        stays = not exists and gap <= _ROUNDINGS * rounding(y, u, z, own)  # saturated but for rounding
        if stays:
            memory[0], memory[1] = u, z
        wanted = memory[0] if exists or stays else math.nan
    end = within_limits(parameters, wanted, direction)
    if end == wanted:
        state[0], state[1] = wanted, y
    elif math.isnan(end):
        memory[0], memory[1] = u, z
    else:
        state[0], state[1] = end, forward(u, z, end, own, memory, charts)
    return float(wanted)


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Input at the next output `y`, or nan where the law has no inverse; see `hysim.kernels.inverses`.

    `parameters` is (lowest input, highest input, rising, A, beta, gamma, n, gain, offset, number of coefficients, c1,
    c2, ..., parameters of `boucwen.step`). `state` is (u, y, input and slope at the place that has no inverse, state
    of `boucwen.step`).
    """
    return inverse(parameters, state, y, 1)


@kernel
def elementary_step(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """As `step` for n = 1 and 2, with the state of `boucwen.linear_step` in place of that of `boucwen.step`."""
    return inverse(parameters, state, y, None)
