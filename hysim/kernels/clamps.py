"""Sums of plays and of stops along an input, exactly.

A play of threshold r is a position z that the input pushes from either side, a clamp:

    z_k = min(max(z_(k-1), u_k - r), u_k + r)

For an input that is monotone between its samples this is the whole operator. The stop of the same threshold
is what is left of the input, u - z. All laws of this family are one sum of such elements,

    y = offset + feedthrough u + sum_i w_i (through u + (1 - 2 through) z_i)

over plays with through = 0, over stops with through = 1. The plays do not know of each other: the
clamps of few are taken side by side at each sample; many are summed by the turns of the input, up to which any input
leaves them in the order of their thresholds.

The plays may also have a common weight that depends on the input, beside a polynomial of it (`bent_step`):

    y = offset + c_1 u + ... + c_n u^n + (weight + weight_slope u) sum_i m_i (z_i - u)
"""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner, kernel, signed_kernel
from hysim.kernels.stepping import START, STEP

N_OUTPUT = 3
N_BENT = 4
_ROUNDING = 2.0**-50
_MANY = 64  # plays from which on turns are faster than clamps on a noisy input too: experiments/04_batch.py


@inlined
def clamp(z: float, u: float, r: float) -> float:
    """Position of a play of threshold `r` that stood at `z`, once the input is `u`."""
    return min(max(z, u - r), u + r)


@kernel
def batch(parameters: FloatArray, state: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """Outputs of many laws into `out`, shape (n_sets, n_samples).

    Parameters and states as in `step`, one law a row; positions move along. `u` is (1 or n_sets, n_samples).
    """
    n_plays = state.shape[1] - 1
    terms = np.empty(n_plays)
    for k in range(out.shape[0]):
        through, offset, feedthrough = parameters[k, 0], parameters[k, 1], parameters[k, 2]
        sign, z, inputs = 1.0 - 2.0 * through, state[k, 1:].copy(), u[min(k, u.shape[0] - 1)]
        elements = parameters[k, N_OUTPUT:].copy()  # known to be apart, which makes the loop faster
        thresholds, weights = elements[:n_plays], elements[n_plays:]
        if n_plays >= _MANY and inputs.size > 0 and is_ordered(thresholds, z, inputs[0]):
            slope = feedthrough + through * weights.sum()
            by_turns(thresholds, sign * weights, z, inputs, out[k])
            for j in range(inputs.size):
                out[k, j] += offset + slope * inputs[j]
        else:
            for j in range(inputs.size):
                for i in range(n_plays):  # by itself, so that it is done for several plays at once
                    z[i] = clamp(z[i], inputs[j], thresholds[i])
                    terms[i] = weights[i] * (through * inputs[j] + sign * z[i])
                total = offset + feedthrough * inputs[j]
                for i in range(n_plays):
                    total += terms[i]
                out[k, j] = total
        for i in range(n_plays):
            state[k, 1 + i] = z[i]


@inner
def is_ordered(thresholds: FloatArray, z: FloatArray, u: float) -> bool:
    """Whether the plays are pushed in the order of their thresholds from the input `u` on.

    They are if the positions that `u` leaves differ by no more than the thresholds, as those after any input do.
    """
    for i in range(1, z.size):
        apart = abs(clamp(z[i], u, thresholds[i]) - clamp(z[i - 1], u, thresholds[i - 1]))
        if not apart <= thresholds[i] - thresholds[i - 1] + _ROUNDING * (abs(u) + thresholds[i]):
            return False
    return True


@inner
def by_turns(thresholds: FloatArray, weights: FloatArray, z: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """The sums of w_i z_i at the samples of `u` into `out`, by the turns of the input that the plays remember.

    On a stroke in the direction d the first m plays stand at u - d r_i. At a turn e they stay, and the next stroke
    pushes those with 2 r_i < |u - e|; one that pushes all of them, or goes beyond e, takes the turn from the memory.
    With W and R, the sums of w_i and w_i r_i up to a play, an output is the sum over

        the first m plays    u W_m - d R_m
        up to the M of the last turn    e (W_M - W_m) - d_e (R_M - R_m)
        the others    as they stood at this turn
    """
    n_plays = z.size
    W, R, others = np.zeros(n_plays + 1), np.zeros(n_plays + 1), np.zeros(n_plays + 1)
    for i in range(n_plays):
        W[i + 1], R[i + 1] = W[i] + weights[i], R[i] + weights[i] * thresholds[i]
        z[i] = clamp(z[i], u[0], thresholds[i])
    for i in range(n_plays - 1, -1, -1):
        others[i] = others[i + 1] + weights[i] * z[i]
    places, directions, beyond = np.empty(n_plays), np.empty(n_plays), np.empty(n_plays)  # of the turns
    counts = np.empty(n_plays, dtype=np.int64)
    last, direction, rest = u[0], 1.0, others[0]
    m = turns = 0
    for j in range(u.size):
        if direction * (u[j] - last) < 0.0:
            if m > 0:
                places[turns], directions[turns], beyond[turns], counts[turns] = last, direction, rest, m
                turns += 1
            direction, m = -direction, 0
        last = u[j]
        while turns > 0:
            M, way = counts[turns - 1], direction * (last - places[turns - 1])
            if directions[turns - 1] != direction:
                m = pushed(thresholds, m, M, 0.5 * way)
            elif way > 0.0:
                m = M
            if m < M:
                e, d = places[turns - 1], directions[turns - 1]
                rest = e * (W[M] - W[m]) - d * (R[M] - R[m]) + beyond[turns - 1]
                break
            turns -= 1
        if turns == 0:
            while m < n_plays and direction * (last - direction * thresholds[m] - z[m]) > 0.0:
                m += 1
            rest = others[m]
        out[j] = last * W[m] - direction * R[m] + rest
    for i in range(m):
        z[i] = last - direction * thresholds[i]
    for k in range(turns - 1, -1, -1):
        for i in range(m, counts[k]):
            z[i] = places[k] - directions[k] * thresholds[i]
        m = counts[k]


@inner
def pushed(thresholds: FloatArray, first: int, end: int, reach: float) -> int:
    """How many of the first `end` plays have thresholds below `reach`, if the first ones have."""
    if first == end or not thresholds[first] < reach:
        return first
    low, high = first + 1, end
    while low < high:
        middle = (low + high) // 2
        if thresholds[middle] < reach:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is the last u and the positions, and moves along.

    `parameters` is (through, offset, feedthrough, thresholds, weights).
    """
    n_plays = state.size - 1
    through = parameters[0]
    total = parameters[1] + parameters[2] * u
    for i in range(n_plays):
        z = clamp(state[1 + i], u, parameters[N_OUTPUT + i])
        state[1 + i] = z
        total += parameters[N_OUTPUT + n_plays + i] * (through * u + (1.0 - 2.0 * through) * z)
    state[0] = u
    return float(total)


@kernel
def bent_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output of plays of a common weight at the next input `u`; `state` is the last u and the positions.

    `parameters` is (n, offset, weight, weight_slope, c_1 ... c_n, thresholds, shares m_i).
    """
    first, n_plays = N_BENT + int(parameters[0]), state.size - 1
    lag = 0.0
    for i in range(n_plays):
        z = clamp(state[1 + i], u, parameters[first + i])
        state[1 + i] = z
        lag += parameters[first + n_plays + i] * (z - u)
    state[0] = u
    static = 0.0
    for k in range(first - 1, N_BENT - 1, -1):
        static = (static + parameters[k]) * u
    return float(parameters[1] + static + (parameters[2] + parameters[3] * u) * lag)


@signed_kernel(START.signature)
def start_extreme(parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """The running extreme begins at the first input, without a direction."""
    state[0] = u0
    state[1] = u0
    state[2] = 0.0


@signed_kernel(STEP.signature)
def extreme(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Running extreme of the input; `parameters` (threshold,), `state` (last u, extreme v, direction 1, -1 or 0)."""
    ahead = u - state[1]
    state[0] = u
    if state[2] * ahead >= 0.0 and state[2] != 0.0:
        state[1] = u
    elif abs(ahead) > parameters[0]:
        state[1] = u
        state[2] = 1.0 if ahead > 0.0 else -1.0
    return float(state[1])
