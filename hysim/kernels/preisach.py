"""Relays under a staircase: the Preisach law along an input, and backwards.

The law remembers the extremes x_0, x_1, ..., x_d of its input that later ones have not wiped out: minima at
even places, maxima at odd ones, each between the two before it. x_0 is the lowest level, where all relays are
down, and x_d is the input itself. With the Everett function E(a, b) = -E(b, a)

    y_k = y_(k-1) + 2 E(x_k, x_(k-1))

is the output at x_k. An input that goes on past x_(k-1) wipes out x_(k-1) and x_k; as each y_k depends on the x before
it alone, a return to an extreme returns to the output there to the bit. E is monotone, so that the same
holds of the outputs where the law is taken backwards.

`parameters` is (spread, y_0, number of levels, levels, E at the pairs of levels). Spread relays make E linear in each
argument between the levels; else a relay switches at the two levels themselves, and E is a step.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, inner, kernel
from hysim.kernels.inverses import N_LIMITS, N_PLACE, within_limits
from hysim.kernels.tellinen_table import interval

HEAD = 3


# ---------------------------------------------------------------------------------- scalar functions


@inner
def everett(parameters: FloatArray, a: float, b: float) -> float:
    """E(a, b): half of the rise of the output from `b` to `a`, inputs between the levels."""
    n = int(parameters[2])
    i, j = interval(parameters, HEAD, n, a), interval(parameters, HEAD, n, b)
    low_a, high_a = parameters[HEAD + i], parameters[HEAD + i + 1]
    low_b, high_b = parameters[HEAD + j], parameters[HEAD + j + 1]
    p, q = (a - low_a) / (high_a - low_a), (b - low_b) / (high_b - low_b)
    if parameters[0] == 0.0:  # the levels that the input has met, compared since a quotient may be rounded to 1
        p = 1.0 if (a >= high_a if a > b else a > low_a) else 0.0
        q = 1.0 if (b > low_b if a > b else b >= high_b) else 0.0
        if (a > b) != (i + p > j + q):
            return 0.0
    at = HEAD + n + i * n + j
    low = (1.0 - q) * parameters[at] + q * parameters[at + 1]
    high = (1.0 - q) * parameters[at + n] + q * parameters[at + n + 1]
    return float((1.0 - p) * low + p * high)


@inner
def origin(of: FloatArray, d: int, end: float) -> int:
    """Place of the extreme at which a branch from place `d` to another value `end` begins; -1 for x_0 or below.

    `of` holds the inputs x or the outputs y.
    """
    rising = end > of[d]
    start = d - 1 if rising == (d % 2 == 1) else d
    while start > 0 and (end >= of[start - 1] if rising else end <= of[start - 1]):
        start -= 2
    return start


@inner
def place_after(parameters: FloatArray, x: FloatArray, y: FloatArray, d: int, u: float) -> int:
    """Place of the last extreme once the input is `u`."""
    end = min(max(u, parameters[HEAD]), parameters[HEAD + int(parameters[2]) - 1])
    if end == x[d]:
        return d
    start = origin(x, d, end)
    x[start + 1] = end
    if start >= 0:
        y[start + 1] = y[start] + 2.0 * everett(parameters, end, x[start])
    return start + 1


@inner
def shortened(parameters: FloatArray, x: FloatArray, y: FloatArray, d: int) -> int:
    """Place of the last extreme without those two neighbours that close the smallest rectangle of the staircase."""
    least, chosen = math.inf, 1
    for k in range(1, d - 1):
        size = abs((x[k] - x[k + 2]) * (x[k + 1] - x[k - 1]))
        if size < least:
            least, chosen = size, k
    for k in range(chosen, d - 1):
        x[k] = x[k + 2]
        y[k] = y[k - 1] + 2.0 * everett(parameters, x[k], x[k - 1])
    return d - 2


@inner
def solved(parameters: FloatArray, start: float, y: float, wanted: float) -> float:
    """Input at which the output, `y` at the extreme `start`, is `wanted`; nan if that is beyond the last level."""
    side = 1 if wanted > y else -1
    near = interval(parameters, HEAD, int(parameters[2]), start) + (side + 1) // 2
    far = int(parameters[2]) - 1 if side > 0 else 0
    if side * (y + 2.0 * everett(parameters, parameters[HEAD + far], start)) < side * wanted:
        return math.nan
    while near != far:  # the nearest level that is far enough
        middle = (near + far) // 2 if side > 0 else (near + far + 1) // 2
        if side * (y + 2.0 * everett(parameters, parameters[HEAD + middle], start)) >= side * wanted:
            far = middle
        else:
            near = middle + side
    level, before = parameters[HEAD + far], parameters[HEAD + far - side]
    before = max(before, start) if side > 0 else min(before, start)
    at_level = y + 2.0 * everett(parameters, level, start)
    at_before = y + 2.0 * everett(parameters, before, start)
    return float(before + (level - before) * ((wanted - at_before) / (at_level - at_before)))


# ---------------------------------------------------------------------------------- path and batch


@kernel
def path(parameters: FloatArray, x: FloatArray, y: FloatArray, d: int, u: FloatArray, out: FloatArray) -> int:
    """Outputs at the samples of `u` into `out`, and the place of the last extreme.

    `x` and `y` hold the extremes and outputs up to place `d`, and have room for one more each sample.
    """
    for k in range(u.size):
        d = place_after(parameters, x, y, d, u[k])
        out[k] = y[d]
    return d


@kernel
def batch(parameters: FloatArray, z0: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """Outputs of many laws into `out`, shape (n_sets, n_samples).

    `parameters` (n_sets, n_parameters), `z0` (n_sets, n_past), the inputs before, `u` (1 or n_sets, n_samples).
    """
    room = 1 + z0.shape[1] + u.shape[1]
    x, y, past = np.empty(room), np.empty(room), np.empty(z0.shape[1])
    for i in range(out.shape[0]):
        x[0], y[0] = parameters[i, HEAD], parameters[i, 1]
        d = path(parameters[i], x, y, 0, z0[i], past)
        path(parameters[i], x, y, d, u[min(i, u.shape[0] - 1)], out[i])


# ---------------------------------------------------------------------------------- one sample at a time


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` is (last u, d, x, y), where x and y are equally long, and moves along."""
    room = (state.size - 2) // 2
    x, y = state[2 : 2 + room], state[2 + room :]
    d = int(state[1])
    if d + 1 == room:
        d = shortened(parameters, x, y, d)
    d = place_after(parameters, x, y, d, u)
    state[0], state[1] = u, d
    return float(y[d])


@kernel
def inverse_step(parameters: FloatArray, state: FloatArray, wanted: float) -> float:
    """Input at which the output is `wanted`, or nan beyond saturation; see `hysim.kernels.inverses`.

    `parameters` are the limits, 1.0 for a law that rises or -1.0 for one that falls with its input, and the
    parameters of `step` of the law with this sign, which rises; `state` is (u, y) and the state of `step`.
    """
    parameters, state = borrowed(parameters), borrowed(state)
    sign, own, law = parameters[N_LIMITS], parameters[N_LIMITS + 1 :], state[N_PLACE:]
    room = (law.size - 2) // 2
    x, y = law[2 : 2 + room], law[2 + room :]
    d, rising_wanted = int(law[1]), sign * wanted
    if d + 1 == room:
        d = shortened(own, x, y, d)
    direction, u, place = 1.0 if rising_wanted > y[d] else -1.0, x[d], d
    if rising_wanted != y[d]:
        start = origin(y, d, rising_wanted)
        place = start + 1
        if start >= 0:
            u = solved(own, x[start], y[start], rising_wanted)
        else:
            u = x[0] if rising_wanted >= y[0] else math.nan
    end = within_limits(parameters, u, direction)
    if end == u:
        x[place], y[place], d = u, rising_wanted, place
    elif not math.isnan(end):
        d = place_after(own, x, y, d, end)
    law[1] = d
    if not math.isnan(end):
        law[0] = state[0] = end
        state[1] = sign * y[d]
    return float(u)
