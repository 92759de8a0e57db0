"""A memory with a term of ``|w|^n`` on its way to zero, or away from it, in a few evaluations of its slope.

    dw/dL = f(w, e, L) = h(w, e) (strength - delta_a e + ramp L - c nu(e) |w|^n) / eta(e),    de/dL = w

with the names of `hysim.kernels.baber_noori`. |w|^n has no power series at zero unless n is whole: steps of series in L
shrink with w there. In x, with w = x^4, the lengths and energies

    dL/dx = 4 x^3 / f,    de/dx = 4 x^3 w / f

are smooth, and depend on L and e only weakly. Gauss's rule of collocation solves them, iterated to a fixed point.
Where the two rules that the same nodes give differ too much, where f changes its sign or the iteration does not
contract, nothing is returned, and the law's own series go on. Good to about 1e-9 of the memory's range: for searches.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels._compile import inner
from hysim.kernels.baber_noori_series import BETA, EXPONENT, GAMMA

N_NODES = 8
STRETCHES = 64  # between two samples at most
ZONE, EDGE = 0.6, 1.01  # of the memory at which the term of ``|w|^n`` cancels the forcing; of the zone
N_WORK = 5 * N_NODES  # rates, energies, lengths, memories and their powers n at the nodes
_TURNS = 3.0  # times the memory: a length on which it moves less needs few series
_ENERGY, _LENGTH, _PLACE, _POWER = N_NODES, 2 * N_NODES, 3 * N_NODES, 4 * N_NODES
_SWEEPS = 10
_HALVINGS = 6
_CONVERGED = 1e-9  # of the length
_DOUBTED, _STEEP_DOUBTED = 3e-5, 1e-7  # likewise, by which the weaker rule may differ: the other is better by far,
_STEEP = 3.0  # if less so for exponents from here on
_ITERATIONS = 12
_LANDED = 1e-10  # of the length
_WIDTHS, _FROM_BELL = 0.7, 3.0  # of the bell, that a stretch may be wide, or is away from it


def _collocation() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Nodes on [0, 1], weights up to each node (row after row) and to 1, and these less those of a weaker rule."""
    places, weights = np.polynomial.legendre.leggauss(N_NODES)
    legendre = np.polynomial.legendre
    basis = np.linalg.inv(legendre.legvander(places, N_NODES - 1)).T
    to_nodes = [0.5 * (legendre.legval(places, legendre.legint(row, lbnd=-1.0))) for row in basis]
    fewer = np.delete(places, N_NODES // 2)
    others = np.linalg.solve(legendre.legvander(fewer, N_NODES - 2).T, np.eye(N_NODES - 1)[0])
    doubt = 0.5 * weights - np.insert(others, N_NODES // 2, 0.0)
    return tuple(  # type: ignore[return-value]
        read_only(each) for each in (0.5 * (places + 1.0), np.array(to_nodes).T.ravel(), 0.5 * weights, doubt)
    )


_NODES, _TO_NODES, _WEIGHTS, _DOUBT = _collocation()


@inner
def pays(w: float, forcing: float, zone: float, left: float) -> bool:
    """Whether a memory on its way to the `zone`, or in it, would need many series on the length that is left."""
    return bool(zone > 0.0 and (w * forcing < 0.0 or abs(w) < zone) and _TURNS * abs(forcing) * left >= abs(w))


@inner
def stretch(
    w: float,
    e: float,
    left: float,
    forcing: float,
    zone: float,
    strength: float,
    ramp: float,
    parameters: FloatArray,
    work: FloatArray,
) -> tuple[float, float, float]:
    """w, e and the length gone: to zero, to the end of the `zone`, or as far as `left`; a length of -1 for no result.

    `forcing` is the slope at w without the term of ``|w|^n``, which is less than the forcing within the zone.
    """
    is_inward = w * forcing < 0.0
    side = math.copysign(1.0, w if w != 0.0 else forcing)
    begin = abs(w)
    end = 0.0 if is_inward else min(zone, begin + abs(forcing) * left)
    if parameters[3] != 0.0:
        way = room_beside_bell(w, e, parameters)
        end = max(end, begin - way) if is_inward else min(end, begin + way)
    length, energy = way_to(begin, end, side, e, True, strength, ramp, parameters, work)
    for _ in range(_HALVINGS):
        if length < math.inf:
            break
        end = 0.5 * (begin + end)
        length, energy = way_to(begin, end, side, e, True, strength, ramp, parameters, work)
    if length <= left:
        return side * end, e + energy, length
    last = end
    for _ in range(_ITERATIONS):
        if not length < math.inf:
            break
        power = last ** parameters[EXPONENT]
        f = slope(side * last, power, e + energy, length, strength, ramp, parameters)
        change = (left - length) * side * f
        last = min(max(last + change, min(begin, end)), max(begin, end))
        length, energy = way_to(begin, last, side, e, False, strength, ramp, parameters, work)
        if abs(left - length) <= _LANDED * left:
            return side * last, e + energy, left
    return w, e, -1.0


@inner
def way_to(
    begin: float,
    end: float,
    side: float,
    e: float,
    is_first: bool,
    strength: float,
    ramp: float,
    parameters: FloatArray,
    work: FloatArray,
) -> tuple[float, float]:
    """Length and energy on the way of ``|w|`` from `begin` to `end` on one `side` of zero; inf where they are unsure.

    Unless it `is_first`, the iteration goes on from energies and lengths of a way that ended nearly there.
    """
    first = math.sqrt(math.sqrt(begin))
    span = math.sqrt(math.sqrt(end)) - first
    for i in range(N_NODES):
        x = first + span * _NODES[i]
        work[_PLACE + i] = side * (x * x) * (x * x)
        work[_POWER + i] = ((x * x) * (x * x)) ** parameters[EXPONENT]
        if is_first:
            work[_ENERGY + i], work[_LENGTH + i] = e, 0.0
    before = 0.0
    for _ in range(_SWEEPS):
        length, doubt, energy = 0.0, 0.0, 0.0
        for i in range(N_NODES):
            x, w = first + span * _NODES[i], work[_PLACE + i]
            f = slope(w, work[_POWER + i], work[_ENERGY + i], work[_LENGTH + i], strength, ramp, parameters)
            rate = 4.0 * side * (x * x) * x * span / f
            if not 0.0 < rate < math.inf:
                return math.inf, 0.0
            work[i] = rate
            length += _WEIGHTS[i] * rate
            doubt += _DOUBT[i] * rate
            energy += _WEIGHTS[i] * rate * w
        if abs(length - before) <= _CONVERGED * length:
            doubted = _DOUBTED if parameters[EXPONENT] < _STEEP else _STEEP_DOUBTED
            if abs(doubt) <= doubted * length:
                return length, energy
            return math.inf, 0.0
        before = length
        for i in range(N_NODES):
            gone, taken = 0.0, 0.0
            for j in range(N_NODES):
                part = _TO_NODES[i * N_NODES + j] * work[j]
                gone += part
                taken += part * work[_PLACE + j]
            work[_LENGTH + i], work[_ENERGY + i] = gone, e + taken
    return math.inf, 0.0


@inner
def slope(
    w: float, power: float, e: float, length: float, strength: float, ramp: float, parameters: FloatArray
) -> float:
    """f(w, e, L), where ``|w|^n`` is `power`."""
    nu, eta = 1.0 + parameters[1] * e, 1.0 + parameters[2] * e
    c = parameters[GAMMA] + (parameters[BETA] if w > 0.0 else -parameters[BETA])
    f = (strength - parameters[0] * e + ramp * length - c * nu * power) / eta
    if parameters[3] == 0.0:
        return float(f)
    depth, where, width = bell(e, nu, parameters)
    x = (w - where) / width
    return float((1.0 - depth * math.exp(-x * x)) * f)


@inner
def bell(e: float, nu: float, parameters: FloatArray) -> tuple[float, float, float]:
    """Depth, place and width of the pinching."""
    depth = -parameters[3] * math.expm1(min(-parameters[5] * e, 500.0))
    where = 0.0
    if parameters[4] != 0.0:
        root = -1.0 / parameters[EXPONENT]
        loading = (parameters[BETA] + parameters[GAMMA]) * nu
        where = parameters[4] * loading**root if loading > 0.0 and nu > 0.0 else math.nan
    return depth, where, (parameters[6] + parameters[7] * e) * (parameters[8] + depth)


@inner
def room_beside_bell(w: float, e: float, parameters: FloatArray) -> float:
    """How far w may go before the bell is no polynomial of the order of the rule."""
    _, where, width = bell(e, 1.0 + parameters[1] * e, parameters)
    return float(max(_WIDTHS * abs(width), abs(w - where) - _FROM_BELL * abs(width)))
