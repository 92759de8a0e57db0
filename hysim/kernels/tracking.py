"""A feed-forward and a feedback in one sampled controller, one sample at a time.

At each sample the controller gets the reference r some samples ahead, and a measurement m just before the command:

    target   s = sum p_i r_(-i)                        where the displacement is to be now
    drive    d = sum q_i r_(-i)                        what creep and law together are to give next
    creep    v = (d - sum w_i q_i (1 + e_i)) / (g_0 - sum w_i e_i)     so that they do at the end of the sample
    law      f = the input at which the law's output is v, within the limits; w is the output there
    creep    q_i <- q_i + e_i (q_i - w),               e_i = exp(-h / tau_i) - 1
    feedback b = notch(PID(s, m)) + damping(m - s)
    u = f + b within the limits,  what is cut off winds the PID's integral back

With a model, s in the feedback is what a copy of the plant, driven by w, would have measured. The copy's equations
are those of `hysim.kernels.loop`, its rings of past values kept with the newest first.

The inverse of the law is a step (`hysim.kernels.inverses`); `bound` makes a controller of a kernel and this step.
The parameters are a head and blocks one behind the other, in the order in which the kernel takes them; so is the
state, which begins with the command before the limits, and the part of d that the law does not reach within them.

The parts are functions that are inlined into one kernel, and not steps behind pointers: each link of a chain of
pointers is a closure that no cache holds, 0.3 s of compilation in every process, and a chain of four (shaper, PID,
notch, feed-forward) took 24 % longer a sample than the kernel.
"""

import math
from collections.abc import Callable
from typing import Any

from numba import float64

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, by_address, inlined, kernel, signed_closure
from hysim.kernels.controllers import CONTROLLER, ControllerStep, pid
from hysim.kernels.loop import advance, output
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step

N_HEAD = 10
N_PLACES = 2  # of the state: the command before the limits, and the part of the reference out of reach of the law
N_FEEDFORWARD = 4

BoundStep = Callable[[Any, FloatArray, FloatArray, float, float], float]
_JUST, _TINY = 1e-15, 1e-300  # beyond a limit: the command where no input gives the output


@inlined
def push(ring: FloatArray, newest: float) -> None:
    """Put a value before the others and drop the last one."""
    for i in range(ring.size - 1, 0, -1):
        ring[i] = ring[i - 1]
    ring[0] = newest


@inlined
def dot(weights: FloatArray, values: FloatArray) -> float:
    """Sum of weights times values."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * values[i]
    return total


@inlined
def biquad(coefficients: FloatArray, state: FloatArray, x: float) -> float:
    """Filter (b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2) in its transposed direct form."""
    y = coefficients[0] * x + state[0]
    state[0] = coefficients[1] * x - coefficients[3] * y + state[1]
    state[1] = coefficients[2] * x - coefficients[4] * y
    return float(y)


@inlined
def feed_forward(
    inverse: Step, parameters: FloatArray, state: FloatArray, drive: float
) -> tuple[float, float, float, float]:
    """Command that takes creep and law together to `drive`, the one within the limits, the law's output there, and
    the part of `drive` that this does not reach.

    `parameters` are (gain and offset of the amplifier, elements of the creep, its 1 / (g_0 - sum w_i e_i), w_i, e_i,
    parameters of the inverse); `state` is (q_i, state of the inverse).
    """
    gain, offset, elements = parameters[0], parameters[1], int(parameters[2])
    p = N_FEEDFORWARD + elements
    weights, declines, own = parameters[N_FEEDFORWARD:p], parameters[p : p + elements], parameters[p + elements :]
    positions, law = state[:elements], state[elements:]
    for i in range(elements):
        drive -= weights[i] * (positions[i] + declines[i] * positions[i])
    u = inverse(own, law, drive * parameters[3])
    reached, short = law[0], drive - law[1] / parameters[3]
    if math.isnan(u) and (reached == own[0] or reached == own[1]):
        beyond = _JUST * abs(reached) + _TINY
        u = reached + (beyond if reached == own[1] else -beyond)
    for i in range(elements):
        positions[i] += declines[i] * (positions[i] - law[1])
    limited = math.nan if math.isnan(u) else reached
    return (u - offset) / gain, (limited - offset) / gain, law[1], short


@kernel
def invert(inverse: Step, parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The command of a feed-forward alone; `state` is as that of `track`, then its own."""
    state[0], limited, _, state[1] = feed_forward(inverse, parameters, state[N_PLACES:], reference)
    return float(limited)


@kernel
def track(inverse: Step, parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The command within the limits.

    The head is (lowest and highest command, number of taps, whether there is a feed-forward, and a model, its numbers
    of creep states and of all, its whole samples of dead time and of delay, whether the delay has a part of a sample).
    """
    parameters, state = borrowed(parameters), borrowed(state)
    lowest, highest, taps = parameters[0], parameters[1], int(parameters[2])
    feeds_forward, has_model, has_part = parameters[3] > 0.0, parameters[4] > 0.0, parameters[9] > 0.0
    p, s = N_HEAD, N_PLACES
    ring = state[s : s + taps]
    push(ring, reference)
    drive, target = dot(parameters[p : p + taps], ring), dot(parameters[p + taps : p + 2 * taps], ring)
    p, s = p + 2 * taps, s + taps

    creeping, order, dead, late = int(parameters[5]), int(parameters[6]), int(parameters[7]), int(parameters[8])
    others = order - creeping
    decline, p = parameters[p : p + creeping], p + creeping
    A, p = parameters[p : p + others * order], p + others * order
    B, p = parameters[p : p + 3 * order], p + 3 * order
    at_samples, p = parameters[p : p + order + 3], p + order + 3
    within, p = parameters[p : p + order + 3], p + order + 3
    x, s = state[s : s + 2 * order], s + 2 * order
    past, s = state[s : s + dead + 3], s + dead + 3
    readings, s = state[s : s + late + 2], s + late + 2
    if has_model:
        y = output(at_samples, x, past[dead + 1], past[dead], 0.0)
        push(readings[: late + 1], readings[late + 1] if has_part else y)
        target = readings[late]

    integral, unwinding = s + 1, parameters[p + 8]
    command = pid(parameters[p : p + 9], state[s : s + 4], target, measurement)
    command = biquad(parameters[p + 9 : p + 14], state[s + 4 : s + 6], command)
    command += biquad(parameters[p + 14 : p + 19], state[s + 6 : s + 8], measurement - target)
    p, s = p + 19, s + 8

    wanted = total = command
    if feeds_forward:
        forward, limited, level, state[1] = feed_forward(inverse, parameters[p:], state[s:], drive)
        wanted += forward
        total += limited
        push(past, level)
        oldest, older, newer = past[dead + 2], past[dead + 1], past[dead]
        if has_part:
            readings[late + 1] = output(within, x, oldest, older, newer)
        advance(decline, A, B, x, oldest, older, newer)
    u = min(max(total, lowest), highest)
    if u != total:
        state[integral] += unwinding * (u - total)
    state[0] = wanted
    return float(u)


def bound(controller: BoundStep, inner: Any, kind: Any = STEP) -> ControllerStep:
    """The controller of a kernel, such as `track`, with what it steps: an inverse, or a function of another kind."""
    signature = float64(kind, CONSTANTS, VECTOR, float64, float64)
    controller_by, inner_by = by_address(controller, signature), by_address(inner, kind.signature)

    @signed_closure(CONTROLLER.signature)
    def step(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
        return controller_by(inner_by, parameters, state, reference, measurement)

    return step
