"""Many Bouc-Wen laws of n = 1 side by side on one input, so that a processor steps several of them at once.

All laws go the same way by the same length. The short flow of `hysim.kernels.elementary` is then straight
arithmetic, the same for every law, and the few laws for which it does not hold are stepped anew, one by one: those
with A = 0, those whose way is too long for the series, and those that cross z = 0. The operations are those
of a single path in the same order, and so are the bits.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels._compile import inlined, inner
from hysim.kernels.elementary import DECAY_REACH, linear_advance, short_flow

N_LANES = 64
N_ROWS = 5
_A, _LOADING, _UNLOADING, _MEMORY, _ANEW = range(N_ROWS)


@inlined
def fellows(parameters: FloatArray, start: int, stop: int) -> int:
    """How many laws from `start` on, N_LANES at most, have n = 1."""
    end = min(stop, start + N_LANES)
    i = start
    while i < end and parameters[i, 3] == 1.0:
        i += 1
    return i - start


@inner
def linear_rows(
    parameters: FloatArray, start: int, count: int, u: FloatArray, lanes: FloatArray, out: FloatArray
) -> None:
    """Memories of `count` laws from `start` on at the samples of `u` into their rows; `lanes` is (N_ROWS, N_LANES).

    A law that escapes has a last memory that is not finite.
    """
    A, loading, unloading, z = lanes[_A], lanes[_LOADING], lanes[_UNLOADING], lanes[_MEMORY]
    for j in range(count):
        law = parameters[start + j]
        A[j], loading[j], unloading[j], z[j] = law[0], law[1] + law[2], law[1] - law[2], law[4]
    last_u = u[0]
    for k in range(u.size):
        du = u[k] - last_u
        if du != 0.0:
            advance_all(A, loading, unloading, z, lanes[_ANEW], count, du)
        last_u = u[k]
        for j in range(count):
            out[start + j, k] = z[j]


@inlined
def advance_all(
    A: FloatArray, loading: FloatArray, unloading: FloatArray, z: FloatArray, anew: FloatArray, count: int, du: float
) -> None:
    """Move the memories `z` of all laws by `du`; `anew` takes those of laws that cannot take the short flow."""
    length, direction = abs(du), math.copysign(1.0, du)
    n_anew = 0
    for j in range(count):
        before, slope, along = z[j], A[j], direction * z[j]
        rises, falls = loading[j], unloading[j]
        k = rises if (along > 0.0) | ((along == 0.0) & (slope > 0.0)) else falls
        is_long = abs(k * length) > DECAY_REACH
        after = short_flow(along, slope, k, 0.0 if is_long else length)
        crosses = ((along > 0.0) & (after < 0.0)) | ((along < 0.0) & (after > 0.0))
        fails = (crosses | is_long | (slope == 0.0)) & (abs(before) < math.inf)
        n_anew += 1 if fails else 0
        anew[j] = before if fails else math.nan
        z[j] = direction * after
    if n_anew > 0:
        for j in range(count):
            if not math.isnan(anew[j]):
                z[j] = linear_advance(anew[j], du, A[j], loading[j], unloading[j])
