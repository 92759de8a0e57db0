"""A feed-forward and a feedback in one sampled controller, one sample at a time.

At each sample the controller gets the reference of some samples ahead, r, and the measurement m of the displacement
just before the new command:

    target   s = sum p_i r_(-i)                        where the displacement is to be now
    drive    d = sum q_i r_(-i)                        what creep and law together are to give next
    creep    v = (d - sum w_i q_i (1 + e_i)) / (g_0 - sum w_i e_i)     so that they do at the end of the sample
    law      f = the input that takes the law's copy to v, within the limits; where it ends is w
    creep    q_i <- q_i + e_i (q_i - w),               e_i = exp(-h / tau_i) - 1
    feedback b = notch(PID(s, m)) + damping(m - s)
    u = f + b within the limits,  what is cut off winds the PID's integral back

With a model, s in the feedback is what a copy of the plant, driven by w, would have measured. The copy's equations
are those of `hysim.kernels.loop`, its rings of past values kept with the newest first.

The parameters are a head and blocks one behind the other, in the order in which the kernel takes them; so is the
state, which begins with the command before the limits.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels import boucwen_inverse, clamps
from hysim.kernels._compile import inlined, inner, kernel
from hysim.kernels.controllers import pid
from hysim.kernels.loop import advance, output

N_HEAD = 18
LINE, BOUC_WEN, PLAYS = 1, 2, 3
"""Laws of which the kernel has the inverse; 0 stands for no feed-forward."""

_JUST, _TINY = 1e-15, 1e-300  # beyond a limit: what is asked for where nothing reaches


@inlined
def push(ring: FloatArray, newest: float) -> None:
    """Put a value before the others, of which the last one goes."""
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


@inner
def invert_bouc_wen(
    parameters: FloatArray, state: FloatArray, v: float, lowest: float, highest: float, reached: FloatArray
) -> float:
    """Input that gives `v`; `reached` is then the one within the limits, and the output there."""
    memory = state[boucwen_inverse.N_OWN :]
    u_before, z_before, y_before = memory[0], memory[1], state[0]
    u = boucwen_inverse.step(parameters, state, v)
    reached[0], reached[1] = u, v
    if lowest <= u <= highest:
        return float(u)
    beyond = u
    if math.isnan(u):
        beyond = math.inf if (v > y_before) == (parameters[0] > 0.0) else -math.inf
    reached[0] = min(max(beyond, lowest), highest)
    reached[1] = boucwen_inverse.forward(u_before, z_before, reached[0], parameters, memory)
    memory[0] = reached[0]
    state[0] = reached[1]
    return float(reached[0] + math.copysign(_JUST * abs(reached[0]) + _TINY, beyond)) if math.isnan(u) else float(u)


@inner
def invert_plays(
    parameters: FloatArray, state: FloatArray, v: float, lowest: float, highest: float, reached: FloatArray
) -> float:
    """As `invert_bouc_wen`, of plays; the inverse and the law come one behind the other, then room for one state."""
    n, m = parameters.size // 2, state.size // 3
    inverse, law, kept = state[:m], state[m : 2 * m], state[2 * m :]
    for i in range(m):
        kept[i] = inverse[i]
    u = clamps.step(parameters[:n], inverse, v)
    reached[0] = min(max(u, lowest), highest)
    reached[1] = clamps.step(parameters[n:], law, reached[0])
    if reached[0] != u:
        for i in range(m):
            inverse[i] = kept[i]
        clamps.step(parameters[:n], inverse, reached[1])
    return float(u)


@inner
def invert(
    kind: int,
    parameters: FloatArray,
    state: FloatArray,
    v: float,
    lowest: float,
    highest: float,
    reached: FloatArray,
) -> float:
    """Input that takes a law of a kind to `v`."""
    if kind == BOUC_WEN:
        return float(invert_bouc_wen(parameters, state, v, lowest, highest, reached))
    if kind == PLAYS:
        return float(invert_plays(parameters, state, v, lowest, highest, reached))
    u = (v - parameters[0]) / parameters[1]
    reached[0] = min(max(u, lowest), highest)
    reached[1] = v if reached[0] == u else parameters[0] + parameters[1] * reached[0]
    return float(u)


@kernel
def track(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The command within the limits.

    The head is (lowest and highest command, lowest and highest voltage, gain and offset of the amplifier, number
    of taps, kind of the law, its numbers of parameters and of states, elements of the creep, its 1 / (g_0 - sum
    w_i e_i), whether there is a model, its number of states that creep and of all states, its whole samples of
    dead time and of delay, and whether a part of a sample is left of the delay).
    """
    lowest, highest = parameters[0], parameters[1]
    taps, kind = int(parameters[6]), int(parameters[7])
    p, s = N_HEAD, 3
    ring = state[s : s + taps]
    push(ring, reference)
    drive, target = dot(parameters[p : p + taps], ring), dot(parameters[p + taps : p + 2 * taps], ring)
    p, s = p + 2 * taps, s + taps

    creeping, order = int(parameters[13]), int(parameters[14])
    dead, late = int(parameters[15]), int(parameters[16])
    others = order - creeping
    decline, p = parameters[p : p + creeping], p + creeping
    A, p = parameters[p : p + others * order], p + others * order
    B, p = parameters[p : p + 3 * order], p + 3 * order
    at_samples, p = parameters[p : p + order + 3], p + order + 3
    within, p = parameters[p : p + order + 3], p + order + 3
    x, s = state[s : s + 2 * order], s + 2 * order
    past, s = state[s : s + dead + 3], s + dead + 3
    readings, s = state[s : s + late + 2], s + late + 2
    if parameters[12] > 0.0:
        y = output(at_samples, x, past[dead + 1], past[dead], 0.0)
        push(readings[: late + 1], readings[late + 1] if parameters[17] > 0.0 else y)
        target = readings[late]

    integral, unwinding = s + 1, parameters[p + 8]
    command = pid(parameters[p : p + 9], state[s : s + 4], target, measurement)
    command = biquad(parameters[p + 9 : p + 14], state[s + 4 : s + 6], command)
    command += biquad(parameters[p + 14 : p + 19], state[s + 6 : s + 8], measurement - target)
    p, s = p + 19, s + 8

    wanted = given = command
    if kind > 0:
        elements, n_parameters, n_states = int(parameters[10]), int(parameters[8]), int(parameters[9])
        weights, p = parameters[p : p + elements], p + elements
        declines, p = parameters[p : p + elements], p + elements
        positions, s = state[s : s + elements], s + elements
        for i in range(elements):
            drive -= weights[i] * (positions[i] + declines[i] * positions[i])
        law, law_state, reached = parameters[p : p + n_parameters], state[s : s + n_states], state[1:3]
        v = drive * parameters[11]
        u = invert(kind, law, law_state, v, parameters[2], parameters[3], reached)
        for i in range(elements):
            positions[i] += declines[i] * (positions[i] - reached[1])
        wanted += (u - parameters[5]) / parameters[4]
        given += (reached[0] - parameters[5]) / parameters[4]
        push(past, reached[1])
        oldest, older, newer = past[dead + 2], past[dead + 1], past[dead]
        if parameters[17] > 0.0:
            readings[late + 1] = output(within, x, oldest, older, newer)
        advance(decline, A, B, x, oldest, older, newer)
    limited = min(max(given, lowest), highest)
    if limited != given:
        state[integral] += unwinding * (limited - given)
    state[0] = wanted
    return float(limited)
