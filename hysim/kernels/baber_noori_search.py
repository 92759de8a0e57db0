"""The law of Baber and Noori as the later steps of a search take it: as exact as a search can tell.

It is `hysim.kernels.baber_noori` with a wider tolerance, but for memories near zero, where that law's series take many
short steps (`hysim.kernels.near_zero`).
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import baber_noori as law
from hysim.kernels import boucwen
from hysim.kernels._compile import inner, kernel
from hysim.kernels.baber_noori_series import EXPONENT, N_ROWS, SCALE, SLOPE, STRENGTH, TOLERANCE, begin
from hysim.kernels.near_zero import EDGE, STRETCHES, ZONE, pays, stretch
from hysim.kernels.remainder import N_TERMS, ROUNDING

_FIRST, _LAST = 3, 3 + N_ROWS * (N_TERMS + 1)


@kernel
def close_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `hysim.kernels.baber_noori.step`, good to about 1e-8 of the range."""
    if parameters[0] == 0.0 and parameters[1] == 0.0 and parameters[2] == 0.0 and parameters[3] == 0.0:
        return law.step(parameters, state, u)
    common = parameters[TOLERANCE + 1 :]
    last, z, e = state[0], state[1], state[2]
    if u != last and math.isfinite(z):
        direction = 1.0 if u > last else -1.0
        of_z, of_u = parameters[SCALE], parameters[SCALE + 1]
        room = state[_FIRST:_LAST]
        w, e = advance(direction * z * of_z, e * of_z * of_u, abs(u - last) * of_u, parameters, room)
        state[1], state[2] = direction * w / of_z, e / of_u / of_z
    state[0] = u
    return float(common[5] + boucwen.polynomial(u, common, 6) + common[4] * state[1])


@inner
def advance(w: float, e: float, length: float, parameters: FloatArray, room: FloatArray) -> tuple[float, float]:
    """w and e after the input has moved by `length`; `room` is for the series, or for stretches near zero."""
    n, left = parameters[EXPONENT], length
    series = room.reshape((N_ROWS, N_TERMS + 1))
    for _ in range(0 if n == 1.0 or n == 2.0 else STRETCHES):
        if left <= ROUNDING * length:
            return w, e
        begin(w, e, True, parameters, series)
        forcing, zone = series[SLOPE, 0], ZONE * law.nearness(e, length, parameters, series)[2]
        if not pays(w, forcing, zone, left):
            break
        if abs(w) <= EDGE * zone:
            w, e, gone = stretch(w, e, left, forcing, zone, parameters[STRENGTH], 0.0, parameters, room)
        else:
            begin(w, e, False, parameters, series)
            gone = min(left, (zone - abs(w)) / (math.copysign(1.0, w) * series[SLOPE, 0]))
            if gone > 0.0:
                w, e = law.advance(w, e, gone, parameters, series)
        if not gone > 0.0:
            break
        left -= gone
    return law.advance(w, e, left, parameters, series)
