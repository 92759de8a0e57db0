"""An inverse of a law whose numbers are estimated while it runs, one sample at a time.

    theta_k = theta_(k-1) + K (m - y),   K = P g / (g' P g + noise^2),   P <- P + drift^2 - K g' P
    z_k     <- z_k + (dz/dtheta) K (m - y)
    u_k: the input at which the law of theta_k has the output r

m is the measured output at the last command, y the law's own there, and g its derivatives by the numbers, which are the
differences to copies of the law with one number a little larger each. The copies remember their own past, so that g
holds what a number has done to the memory z, and the memory is moved with the numbers (an extended Kalman filter of
numbers and memory, whose only uncertainty is that of the numbers). An error m - y beyond 5 standard deviations counts
as 5 of them, so that one false measurement does not carry the numbers away; without a measurement (nan) P alone moves.

The parameters of the step are affine in the numbers, base + sum delta_i rates_i. `parameters` is (numbers p,
parameters of the step q, places of the law's state s, places of the search, noise^2, drift^2 (p), differences h (p),
base (q), rates (p, q)), `state` is (last command, delta (p), P (p, p), outputs of the copies (p), parameters now,
before and of a copy (q each), states of the copies (p, s), parameters of the search, its state, room for 2 p numbers).
"""

import math

from numba import float64

from hysim._basics.frozen import FloatArray
from hysim.kernels import inverses
from hysim.kernels._compile import by_address, inner, kernel, signed_closure
from hysim.kernels.controllers import CONTROLLER, ControllerStep
from hysim.kernels.stepping import CONSTANTS, RESUME, STEP, VECTOR, Resume, Step

N_HEAD = 5
_OUTLIER = 5.0  # standard deviations: one in two million errors of a normal distribution is larger


@inner
def estimate(parameters: FloatArray, state: FloatArray, error: float, g: FloatArray) -> None:
    """Move the deltas and their covariance by one measurement, for the derivatives `g` of the output.

    The moves are left in the p places before the last p of the state.
    """
    p = g.size
    moves = state[state.size - 2 * p : state.size - p]
    delta, P = state[1 : 1 + p], state[1 + p : 1 + p + p * p].reshape((p, p))
    drift = parameters[N_HEAD : N_HEAD + p]
    variance = parameters[4]
    for i in range(p):
        P[i, i] += drift[i]
        for j in range(p):
            variance += g[i] * P[i, j] * g[j]
    for i in range(p):
        moved = 0.0
        for j in range(p):
            moved += P[i, j] * g[j]
        moves[i] = 0.0 if math.isnan(error) else moved
    largest = _OUTLIER * math.sqrt(variance)
    error = 0.0 if math.isnan(error) else min(max(error, -largest), largest)
    for i in range(p):
        for j in range(p):
            P[i, j] -= moves[i] * moves[j] / variance
    for i in range(p):
        moves[i] *= error / variance
        delta[i] += moves[i]


@inner
def shift(moves: FloatArray, h: FloatArray, copies: FloatArray, law: FloatArray, s: int, k: int) -> None:
    """Move the memory at the place k of all states to where numbers moved by `moves` would have taken it."""
    total = 0.0
    for i in range(h.size):
        total += (copies[i * s + k] - law[k]) / h[i] * moves[i]
    law[k] += total
    for i in range(h.size):
        copies[i * s + k] += total


@kernel
def adapt(
    step: Step,
    resume: Resume,
    search: inverses.Search,
    parameters: FloatArray,
    state: FloatArray,
    reference: float,
    measurement: float,
) -> float:
    """The command within the limits; the last 2 p places of the state are room for work."""
    p, q, s, places = int(parameters[0]), int(parameters[1]), int(parameters[2]), int(parameters[3])
    first = 1 + p + p * p
    outputs, now = state[first : first + p], state[first + p : first + p + q]
    before, copy = state[first + p + q : first + p + 2 * q], state[first + p + 2 * q : first + p + 3 * q]
    at = first + p + 3 * q
    copies, at = state[at : at + p * s], at + p * s
    own, at = state[at : at + places + q], at + places + q
    place = state[at : state.size - 2 * p]
    law = place[inverses.N_SEARCH : inverses.N_SEARCH + s]
    h, base = parameters[N_HEAD + p : N_HEAD + 2 * p], parameters[N_HEAD + 2 * p : N_HEAD + 2 * p + q]
    rates = parameters[N_HEAD + 2 * p + q :]

    g = state[state.size - p :]
    for i in range(p):
        g[i] = (outputs[i] - place[1]) / h[i]
    estimate(parameters, state, measurement - place[1], g)
    for j in range(int(own[3])):
        begin, count = int(own[inverses.N_SEARCHED + 2 * j]), int(own[inverses.N_SEARCHED + 2 * j + 1])
        for k in range(max(begin, 1), begin + count):
            shift(state[state.size - 2 * p : state.size - p], h, copies, law, s, k)
    for k in range(q):
        before[k], now[k] = now[k], base[k]
        for i in range(p):
            now[k] += state[1 + i] * rates[i * q + k]
        own[places + k] = now[k]
    resume(now, before, law)
    place[1] = step(now, law, place[0])
    u = search(step, own, place, reference)
    for i in range(p):
        for k in range(q):
            before[k] += h[i] * rates[i * q + k]
            copy[k] = now[k] + h[i] * rates[i * q + k]
        resume(copy, before, copies[i * s : (i + 1) * s])
        outputs[i] = step(copy, copies[i * s : (i + 1) * s], place[0])
        for k in range(q):
            before[k] -= h[i] * rates[i * q + k]
    state[0] = u
    return float(math.nan if math.isnan(u) and place[0] not in (own[0], own[1]) else place[0])


_ADAPT = float64(STEP, RESUME, inverses.SEARCH, CONSTANTS, VECTOR, float64, float64)


def adaptive(step: Step, resume: Resume) -> ControllerStep:
    """The controller around the inverse of the law with this step."""
    adapt_by = by_address(adapt, _ADAPT)
    search_by = by_address(inverses.search, inverses.SEARCH.signature)
    step_by, resume_by = by_address(step, STEP.signature), by_address(resume, RESUME.signature)

    @signed_closure(CONTROLLER.signature)
    def controller(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
        return adapt_by(step_by, resume_by, search_by, parameters, state, reference, measurement)

    return controller
