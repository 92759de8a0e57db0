"""The law of Zhu and Wang as a search takes it: roughly, or without the law's many short series near zero.

The rough law goes by exponential Rosenbrock steps, as that of `hysim.kernels.baber_noori`. The close one is
`hysim.kernels.zhu_wang`, and near zero `hysim.kernels.near_zero` with the ramp as the forcing.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels import zhu_wang as law
from hysim.kernels._compile import inner, kernel
from hysim.kernels.baber_noori import phi
from hysim.kernels.baber_noori_series import BETA, EXPONENT, GAMMA, N_OWN, SCALE
from hysim.kernels.near_zero import EDGE, N_WORK, STRETCHES, ZONE, pays, stretch
from hysim.kernels.remainder import ROUNDING

N_STATE = law.N_STATE + N_WORK + SCALE
_WORK = law.N_STATE
_PARAMETERS = _WORK + N_WORK  # those of `near_zero`: zeros, beta, gamma and n
_SCALE, _OUTPUT = 5, 7  # places in the parameters

_MOST_ROUGH = 4_000
_STRIDE = 0.25  # of the yield memory, that w moves in one rough step
_NEAR_ZERO = 0.05  # likewise: below, a rough step may cross zero
_BEYOND = 1e100


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
    for _ in range(0 if n == 1.0 or bend == 0.0 else STRETCHES):
        if left <= ROUNDING * length:
            return direction * w
        at = u + direction * (length - left)
        forcing = A + direction * delta * at
        zone = ZONE * (abs(forcing) / bend) ** (1.0 / n)
        if not pays(w, forcing, zone, left):
            break
        if abs(w) <= EDGE * zone:
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


# ------------------------------------------------------------------------- a few parts in a thousand, for a search


@kernel
def rough_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `close_step`, good to a few parts in a thousand; the lengths of its steps are continuous in all parameters."""
    last, z, of_z, of_u = state[0], state[1], parameters[_SCALE], parameters[_SCALE + 1]
    if u != last and math.isfinite(z):
        direction, length = 1.0 if u > last else -1.0, abs(u - last) * of_u
        ramp = parameters[4]
        forcing = parameters[0] + direction * ramp * last * of_u
        w = rough_advance(direction * z * of_z, forcing, ramp, length, parameters)
        state[1] = direction * w / of_z
    state[0] = u
    gain, offset = parameters[_OUTPUT], parameters[_OUTPUT + 1]
    return float(offset + boucwen.polynomial(u, parameters, _OUTPUT + 2) + gain * state[1])


@inner
def rough_advance(w: float, forcing: float, ramp: float, length: float, parameters: FloatArray) -> float:
    """w after the input has moved by `length`, roughly: in each step the forcing is that of its middle."""
    beta, gamma, n = parameters[1], parameters[2], parameters[3]
    bend, left = max(abs(beta + gamma), abs(gamma - beta)), length
    most = abs(forcing) + abs(ramp) * length
    bent = (most / bend) ** (1.0 / n) if bend > 0.0 else math.inf
    for _ in range(_MOST_ROUGH):
        if not left > 1e-12 * length:
            return w
        term, slope = rough_term(w, beta, gamma, n)
        f = forcing - term
        size = min(max(bent, abs(w)), abs(w) + most * length)
        room = _STRIDE * size
        if w * f < 0.0:
            room = min(room, max(abs(w), _NEAR_ZERO * size))
        t = min(left, room / max(abs(f), math.sqrt(room * abs(ramp)), 1e-300), 1.0 / max(slope, 1e-300))
        first, third = phi(slope * t)
        f += 0.5 * ramp * t
        middle = w + t * first * f
        there, _ = rough_term(middle, beta, gamma, n)
        w = middle + 2.0 * t * third * (term - there - slope * (middle - w))
        if not abs(w) < _BEYOND:
            return math.copysign(math.inf, w)
        forcing += ramp * t
        left -= t
    return math.nan


@inner
def rough_term(w: float, beta: float, gamma: float, n: float) -> tuple[float, float]:
    """The term of ``|w|^n``, and the derivative of minus it by w."""
    power = abs(w) if n == 1.0 else abs(w) ** n
    term = (gamma + (beta if w > 0.0 else -beta)) * power
    return term, -n * term / w if w != 0.0 and n >= 1.0 else 0.0
