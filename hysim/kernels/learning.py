"""Corrections of a reference that repeats, learned from the errors of its last repetition.

A controller follows r + c in place of the reference r. From one repetition j to the next the correction becomes

    c_(j+1)[k] = sum_i q_i c_j[k + i] + sum_i l_i e_j[k + i] - sum_i a_i s_j[k + i],       i = -m ... m

with the error e, the reference as the sensor would read it minus the measurement, and s, the part of the controller's
drive that its law cannot reach within the limits. q is a low pass without phase; l and a are the same times the inverse
models from c to the measurement and to the drive. They look m samples ahead, in the repetition before.

The last sum takes what was not applied out of c, so that e is the error of what remains. Corrections that cannot act
then do not grow, and errors shrink as without limits: the nearest drive within limits is no farther from another such
drive than the drive itself. Before a trial, which begins at rest, corrections and errors are zero. Corrections fade in
along its first m samples and out before its last m, which would need errors after it; a weight of at most one enlarges
nothing, so they shrink where they do on a line without ends. In a loop whose reference has a period of N samples j is
the period before, and rings keep the last N + m samples of c, e and s.
"""

from numba import void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, kernel, signed_kernel
from hysim.kernels.controllers import CONTROLLER, ControllerStep
from hysim.kernels.stepping import CONSTANTS, VECTOR
from hysim.kernels.tracking import bound, push

N_HEAD = 6
N_FILTERS = 3  # q, l and -a
N_PLACES = 2  # of the state before the ring of references


@signed_kernel(void(CONSTANTS, CONSTANTS, VECTOR))
def renew(filters: FloatArray, signals: FloatArray, following: FloatArray) -> None:
    """Corrections of the trial that follows one with these c, e and s, joined in this order like the `filters`."""
    end, reach = following.size, filters.size // (2 * N_FILTERS)
    taps = 2 * reach + 1
    for k in range(end):
        following[k] = 0.0
    for j in range(N_FILTERS):
        for i in range(taps):  # tap by tap, so that several samples are summed at once
            first, tap = max(0, reach - i), filters[j * taps + i]
            sums, values = following[first : end - reach], signals[j * end + first + i - reach :]
            for k in range(end - reach - first):
                sums[k] += tap * values[k]
    for k in range(end):
        faded = max(0.0, min(1.0, (k + 1.0) / (reach + 1.0), (end - reach - k) / (reach + 1.0)))
        following[k] *= faded * faded * (3.0 - 2.0 * faded)


@kernel
def learn(
    inner: ControllerStep, parameters: FloatArray, state: FloatArray, reference: float, measurement: float
) -> float:
    """The command of a controller whose reference is corrected.

    `parameters` are (samples of a repetition, m, whole samples and part of one of sensor delay, whether trials begin
    from rest, length of the inner state, q, l, -a, inner state at rest, inner parameters). `state` is (command, sample,
    ring of references, corrections, errors, what is out of reach, a trial's next corrections, inner state).
    """
    parameters, state = borrowed(parameters), borrowed(state)
    period, reach, late = int(parameters[0]), int(parameters[1]), int(parameters[2])
    part, is_trial, size = parameters[3], parameters[4] > 0.0, int(parameters[5])
    taps = 2 * reach + 1
    p, s = N_HEAD, N_PLACES
    filters, p = parameters[p : p + N_FILTERS * taps], p + N_FILTERS * taps
    low_pass, inverse, released = filters[:taps], filters[taps : 2 * taps], filters[2 * taps :]
    rest, p = parameters[p : p + size], p + size
    room, spare = period + reach + 1, 0
    if is_trial:
        room = spare = period
    past, s = state[s : s + late + 2], s + late + 2
    signals, s = state[s : s + N_FILTERS * room], s + N_FILTERS * room
    corrections, errors, beyond = signals[:room], signals[room : 2 * room], signals[2 * room :]
    following, own = state[s : s + spare], state[s + spare :]

    k = int(state[1])
    if k == room:
        k = 0
        if is_trial:
            renew(filters, signals, following)
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
            total += low_pass[i] * corrections[at] + inverse[i] * errors[at] + released[i] * beyond[at]
        corrections[k] = total
    errors[k] = (1.0 - part) * past[late] + part * past[late + 1] - measurement
    u = inner(parameters[p:], own, reference + corrections[k], measurement)
    beyond[k] = own[1]
    state[0], state[1] = own[0], float(k + 1)
    return float(u)


def learning(inner: ControllerStep) -> ControllerStep:
    """The step `learn` around the step of a controller."""
    return bound(learn, inner, CONTROLLER)
