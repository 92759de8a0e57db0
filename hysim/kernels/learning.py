"""Corrections of a reference that repeats, learned from the errors of its last repetition.

A controller follows r + c in place of the reference r. From one repetition j to the next the correction becomes

    c_(j+1)[k] = sum_i q_i c_j[k + i] + sum_i l_i e_j[k + i],       i = -m ... m

with the error e, the reference as the sensor would read it minus the measurement. q is a low pass without phase, and l
the same times the inverse model from c to the measurement. Both look m samples ahead, in the repetition before.

Where a command is at a limit, and as long as the sensor may show that, errors count as zero: corrections that cannot
act would grow without end. Before a trial, which begins at rest, corrections and errors are zero. Corrections fade in
along its first m samples and out before its last m, which would need errors after it; a weight of at most one enlarges
nothing, so they shrink where they do on a line without ends. In a loop whose reference has a period of N samples j is
the period before, and rings keep the errors of the last N samples and the corrections of the last N + m.
"""

from numba import void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, kernel, signed_kernel
from hysim.kernels.controllers import CONTROLLER, ControllerStep
from hysim.kernels.stepping import CONSTANTS, VECTOR
from hysim.kernels.tracking import bound, push

N_HEAD = 6
N_PLACES = 3  # of the state before the ring of references


@signed_kernel(void(CONSTANTS, CONSTANTS, CONSTANTS, CONSTANTS, VECTOR))
def renew(
    low_pass: FloatArray, inverse: FloatArray, corrections: FloatArray, errors: FloatArray, following: FloatArray
) -> None:
    """The corrections of the trial that follows, from the corrections and the errors of one."""
    reach, end = low_pass.size // 2, corrections.size
    for k in range(end):
        following[k] = 0.0
    for i in range(low_pass.size):  # tap by tap, so that several samples are summed at once
        first = max(0, reach - i)
        sums, c, e = following[first : end - reach], corrections[first + i - reach :], errors[first + i - reach :]
        for k in range(end - reach - first):
            sums[k] += low_pass[i] * c[k] + inverse[i] * e[k]
    for k in range(end):
        faded = max(0.0, min(1.0, (k + 1.0) / (reach + 1.0), (end - reach - k) / (reach + 1.0)))
        following[k] *= faded * faded * (3.0 - 2.0 * faded)


@kernel
def learn(
    inner: ControllerStep, parameters: FloatArray, state: FloatArray, reference: float, measurement: float
) -> float:
    """The command of a controller whose reference is corrected.

    `parameters` are (samples of a repetition, m, whole samples and part of one of sensor delay, whether trials begin
    from rest, length of the inner state, q, l, inner state at rest, inner parameters). `state` is (command, sample,
    samples for which a limit counts, ring of references, corrections, errors, a trial's next corrections, inner state).
    """
    parameters, state = borrowed(parameters), borrowed(state)
    period, reach, late = int(parameters[0]), int(parameters[1]), int(parameters[2])
    part, is_trial, size = parameters[3], parameters[4] > 0.0, int(parameters[5])
    taps = 2 * reach + 1
    p, s = N_HEAD, N_PLACES
    low_pass, inverse, p = parameters[p : p + taps], parameters[p + taps : p + 2 * taps], p + 2 * taps
    rest, p = parameters[p : p + size], p + size
    room, spare = period + reach + 1, 0
    if is_trial:
        room = spare = period
    past, s = state[s : s + late + 2], s + late + 2
    corrections, s = state[s : s + room], s + room
    errors, s = state[s : s + room], s + room
    following, own = state[s : s + spare], state[s + spare :]

    k = int(state[1])
    if k == room:
        k = 0
        if is_trial:
            renew(low_pass, inverse, corrections, errors, following)
            for i in range(room):
                corrections[i] = following[i]
            for i in range(size):
                own[i] = rest[i]
    if is_trial and k == 0:
        for i in range(late + 2):
            past[i] = reference
    push(past, reference)
    if not is_trial:
        total = 0.0
        for i in range(taps):
            at = k + 1 + i
            if at >= room:
                at -= room
            total += low_pass[i] * corrections[at] + inverse[i] * errors[at]
        corrections[k] = total
    error = (1.0 - part) * past[late] + part * past[late + 1] - measurement
    errors[k] = 0.0 if state[2] > 0.0 else error
    u = inner(parameters[p:], own, reference + corrections[k], measurement)
    state[0], state[1] = own[0], float(k + 1)
    state[2] = state[2] - 1.0 if u == own[0] else float(late + 2)
    return float(u)


def learning(inner: ControllerStep) -> ControllerStep:
    """The step `learn` around the step of a controller."""
    return bound(learn, inner, CONTROLLER)
