"""Predictive control around the inverse of a law, one sample at a time.

The law's output w drives the linear stage x' = A x + B w, whose displacement is y = C x and whose measurement is
m = M x + d with a disturbance d that stays. A stationary Kalman filter corrects x and d by the measurement. At each
sample the outputs v_0 ... v_(p-1) of the law for the next p samples minimise

    sum (r_i - y_i - d)^2 + effort sum (v_i - v_(i-1))^2 + softness sum (distance of y_i + d from its limits)^2

with bounds on v and on its change, which are those of the command and its rate by the slope of the law. In the form

    min z'P z / 2 + q'z        low <= (z, D z, G z) <= high

with the differences D and the response G of the linear stage it is solved by the alternating direction method of
multipliers, as OSQP does (B. Stellato et al., Math. Prog. Comp. 12 (2020) 637), from the solution before:

    z = K^-1 (sigma z - q + A'(rho s - l)),     s = bounded(a + l / rho),     l += rho (a - s)

with a = 1.6 A z - 0.6 s. The number of iterations is fixed. v_0 goes through the inverse of the law, whose limits are
those of the command and of its change since the last one, so that these hold exactly. The linear stage then takes what
the law has given. Displacements are in units of those that the law's unit causes at rest.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, kernel
from hysim.kernels.stepping import Step
from hysim.kernels.tracking import dot, push

N_HEAD = 19
RELAXED = 1.6  # of a step of the solver, as in OSQP
N_PLACES = 2  # of the state before its arrays: command and disturbance


@kernel
def predict(inverse: Step, parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The command within the limits.

    `parameters` are a head (states, samples of the horizon, iterations, whether the reference comes ahead of its time,
    part of the disturbance that a sample corrects, lowest and highest voltage at the law, its largest change, slope of
    the law, effort, whether the displacement has limits, these, their hardness, rho, sigma, gain and offset of the
    amplifier, unit of the displacement), A, B, M, gains of the filter, responses of the displacement to the states
    (p, n) and to one output (p), K^-1, parameters of the inverse. `state` is (command, disturbance, x and room for it,
    references, z and room for it, s, l, displacement without new outputs, parameters of the inverse, its state).
    """
    parameters, state = borrowed(parameters), borrowed(state)
    n, p, iterations = int(parameters[0]), int(parameters[1]), int(parameters[2])
    is_ahead, correction, lowest, highest = parameters[3] > 0.0, parameters[4], parameters[5], parameters[6]
    change, slope, effort, has_limits = parameters[7], parameters[8], parameters[9], parameters[10] > 0.0
    low, high, hardness, rho, sigma = parameters[11], parameters[12], parameters[13], parameters[14], parameters[15]
    gain, offset, size, at = parameters[16], parameters[17], parameters[18], N_HEAD
    A, at = parameters[at : at + n * n], at + n * n
    B, at = parameters[at : at + n], at + n
    M, at = parameters[at : at + n], at + n
    L, at = parameters[at : at + n], at + n
    free, at = parameters[at : at + p * n], at + p * n
    pulse, at = parameters[at : at + p], at + p
    K, at = parameters[at : at + p * p], at + p * p
    own, s = parameters[at:], N_PLACES
    x, s = state[s : s + n], s + n
    following, s = state[s : s + n], s + n
    ahead, s = state[s : s + p], s + p
    z, s = state[s : s + p], s + p
    right, s = state[s : s + p], s + p
    slack, s = state[s : s + 3 * p], s + 3 * p
    multiplier, s = state[s : s + 3 * p], s + 3 * p
    base, s = state[s : s + p], s + p
    limits, s = state[s : s + own.size], s + own.size
    law = state[s:]

    push(ahead, reference / size)
    if not is_ahead:
        for i in range(p):
            ahead[i] = reference / size
    surprise = measurement / size - dot(M, x) - state[1]
    state[1] += correction * surprise
    for i in range(n):
        x[i] += L[i] * surprise
    last, before = law[0], law[1]
    for i in range(p):
        base[i] = dot(free[i * n : (i + 1) * n], x) + state[1]
    reach, to_low, to_high = abs(slope) * change, slope * (lowest - last), slope * (highest - last)
    floor, ceiling = before + min(to_low, to_high), before + max(to_low, to_high)
    for _ in range(iterations):
        for i in range(p):
            total = sigma * z[i] + rho * slack[i] - multiplier[i] + rho * slack[p + i] - multiplier[p + i]
            if i < p - 1:
                total -= rho * slack[p + i + 1] - multiplier[p + i + 1]
            for j in range(i, p):
                weight = 2.0 * (ahead[p - 1 - j] - base[j])
                if has_limits:
                    weight += rho * slack[2 * p + j] - multiplier[2 * p + j]
                total += pulse[j - i] * weight
            right[i] = total
        right[0] += 2.0 * effort * before
        for i in range(p):
            z[i] = dot(K[i * p : (i + 1) * p], right)
        for i in range(p):
            wanted = RELAXED * z[i] + (1.0 - RELAXED) * slack[i] + multiplier[i] / rho
            slack[i] = min(max(wanted, floor), ceiling)
            multiplier[i] = rho * (wanted - slack[i])
            difference = z[i]
            lower, upper = -reach, reach
            if i > 0:
                difference -= z[i - 1]
            else:
                lower, upper = before - reach, before + reach
            wanted = RELAXED * difference + (1.0 - RELAXED) * slack[p + i] + multiplier[p + i] / rho
            slack[p + i] = min(max(wanted, lower), upper)
            multiplier[p + i] = rho * (wanted - slack[p + i])
            if has_limits:
                displaced = 0.0
                for j in range(i + 1):
                    displaced += pulse[i - j] * z[j]
                wanted = RELAXED * displaced + (1.0 - RELAXED) * slack[2 * p + i] + multiplier[2 * p + i] / rho
                inside = min(max(wanted, low - base[i]), high - base[i])
                slack[2 * p + i] = wanted + hardness * (inside - wanted)
                multiplier[2 * p + i] = rho * (wanted - slack[2 * p + i])

    for i in range(own.size):
        limits[i] = own[i]
    limits[0] = min(max(lowest, last - change), last + change)
    limits[1] = max(min(highest, last + change), last - change)
    wanted = inverse(limits, law, slack[0])
    state[0] = ((law[0] if math.isnan(wanted) else wanted) - offset) / gain
    for i in range(n):
        following[i] = dot(A[i * n : (i + 1) * n], x) + B[i] * law[1]
    for i in range(n):
        x[i] = following[i]
    return float((law[0] - offset) / gain)
