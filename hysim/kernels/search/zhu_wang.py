"""The law of Zhu and Wang as a search takes it: near a memory of zero without the law's many short series.

It is `hysim.kernels.zhu_wang`, and there `hysim.kernels.search.near_zero` with the ramp as the forcing.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels import zhu_wang as law
from hysim.kernels._compile import inner, kernel
from hysim.kernels.baber_noori_series import BETA, EXPONENT, GAMMA, N_OWN, SCALE
from hysim.kernels.remainder import ROUNDING
from hysim.kernels.search.near_zero import N_WORK, stretch

N_STATE = law.N_STATE + N_WORK + SCALE
_WORK = law.N_STATE
_PARAMETERS = _WORK + N_WORK  # those of `near_zero`: zeros, beta, gamma and n
_SCALE, _OUTPUT = 5, 7  # places in the parameters
_STRETCHES = 64
_ZONE = 0.6  # of the memory at which the term of ``|w|^n`` cancels the forcing
_EDGE = 1.01  # of the zone
_TURNS = 3.0  # times the memory: a length on which it moves less needs few series


@kernel
def close_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `hysim.kernels.zhu_wang.step`, good to about 1e-8 of the range."""
    last, z, of_z, of_u = state[0], state[1], parameters[_SCALE], parameters[_SCALE + 1]
    if u != last and math.isfinite(z):
        state[1] = advance(last * of_u, z * of_z, (u - last) * of_u, parameters, state) / of_z
    state[0] = u
    gain, offset = parameters[_OUTPUT], parameters[_OUTPUT + 1]
    return float(offset + boucwen.polynomial(u, parameters, _OUTPUT + 2) + gain * state[1])


@inner
def advance(u: float, z: float, du: float, parameters: FloatArray, state: FloatArray) -> float:
    """Memory after the input has moved from `u` by `du`."""
    A, beta, gamma, n, delta = parameters[0], parameters[1], parameters[2], parameters[3], parameters[4]
    direction, length = math.copysign(1.0, du), abs(du)
    series, work, own = state[law.N_HEAD : _WORK], state[_WORK:_PARAMETERS], state[_PARAMETERS:]
    for k in range(N_OWN):
        own[k] = 0.0
    own[BETA], own[GAMMA], own[EXPONENT] = beta, gamma, n
    w, left, bend = direction * z, length, abs(beta) + abs(gamma)
    for _ in range(0 if n == 1.0 or bend == 0.0 else _STRETCHES):
        if left <= ROUNDING * length:
            return direction * w
        at = u + direction * (length - left)
        forcing = A + direction * delta * at
        zone = _ZONE * (abs(forcing) / bend) ** (1.0 / n)
        is_inward = w * forcing < 0.0
        if not zone > 0.0 or not (is_inward or abs(w) < zone) or _TURNS * abs(forcing) * left < abs(w):
            break
        if abs(w) <= _EDGE * zone:
            w, _, gone = stretch(w, 0.0, left, forcing, zone, forcing, delta, own, work)
        else:
            side = math.copysign(1.0, w)
            slope = forcing - (gamma + side * beta) * abs(w) ** n
            gone = min(left, (zone - abs(w)) / (side * slope))
            if gone > 0.0:
                w = direction * law.advance(at, direction * w, direction * gone, parameters, series)
        if not gone > 0.0:
            break
        left -= gone
    at = u + direction * (length - left)
    return law.advance(at, direction * w, direction * left, parameters, series)
