"""Moments of the rest of an element's force along the path of its drift.

    r(s) = k0 d(s) - f(d),     m_j = integral over (0, 1) of r s^j ds,     j = 0, ..., 4

s is the share of the step. d(s) is the quintic through the drifts and their rates at the begin, the middle and the end;
f is the law along it, cut where the drift turns. On each monotone stretch the integrals are those of
Radau, which begin with the known value, with three nodes or four. Where a law has a kink, these two do not agree, or
the end of the stretch is not where the four nodes lead; the stretch is then divided until Lobatto's rule with four
nodes agrees with that of the halves: it has nodes at the ends, which a kink beside them moves.

The cubic c0 + c1 s + c2 s^2 + c3 s^3 with the first four moments stands for r; in the first sweep, of three nodes, the
quadratic. Its work is the integral of r d'.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, uncounted, unfolded
from hysim.kernels.stepping import Step

IntArray = npt.NDArray[np.int64]

# nodes, weights of the integral, and of the extrapolation to the end
_RADAU_3 = np.array(
    [
        [0.0, 1.0 / 9.0, 0.3333333333333333],
        [0.3550510257216822, 0.5124858261884216, -0.8914115380582557],
        [0.8449489742783178, 0.3764030627004673, 1.5580782047249224],
    ]
)
_RADAU_4 = np.array(
    [
        [0.0, 0.0625, -0.25],
        [0.2123405382391529, 0.3288443199800598, 0.6461389554268262],
        [0.5905331355592653, 0.3881934688431719, -0.9736765952010222],
        [0.9114120404872961, 0.2204622111767684, 1.5775376397741954],
    ]
)
_LOBATTO = np.array(
    [
        [0.0, 1.0 / 12.0, 0.0],
        [0.27639320225002106, 5.0 / 12.0, 0.0],
        [0.7236067977499789, 5.0 / 12.0, 0.0],
        [1.0, 1.0 / 12.0, 1.0],
    ]
)
_NARROWEST = 2.0**-26  # share of a step: the smallest part that is divided
UNSEEN = 0.05  # share of a stretch behind its last node, halved: a kink there is seen at the end alone
_MOST_PARTS = 1000  # that are tried on one stretch

Member = tuple[FloatArray, FloatArray, float]
"""Parameters and state of a law, and the duration of a step if it depends on the rate, else zero."""
Memory = tuple[IntArray, int, int, FloatArray, FloatArray, FloatArray]
"""Stretches of the states that are memory, first places and lengths; which of them are one law's; all states, those
before the step, and room for some."""
Path = tuple[float, float, float, float, float, float]
"""Coefficients of a drift, a quintic of the share of a step."""
Integrals = tuple[float, float, float, float, float, float, float, float]
"""Five moments, the work of r, r at the last node, and r extrapolated to the end."""


@inlined
def quintic(d0: float, v0: float, dm: float, vm: float, d1: float, v1: float) -> Path:
    """The path through drifts and rates at the begin, the middle and the end; the rates are for a step of length 1."""
    half, whole = dm - d0 - 0.5 * v0, d1 - d0 - v0
    slope, rise = vm - v0, v1 - v0
    c2 = 16.0 * half + 7.0 * whole - 8.0 * slope - rise
    c3 = -32.0 * half - 34.0 * whole + 32.0 * slope + 5.0 * rise
    c4 = 16.0 * half + 52.0 * whole - 40.0 * slope - 8.0 * rise
    c5 = -24.0 * whole + 16.0 * slope + 4.0 * rise
    return d0, v0, c2, c3, c4, c5


@inlined
def drift_at(s: float, path: Path) -> float:
    """Drift on the path."""
    return path[0] + s * (path[1] + s * (path[2] + s * (path[3] + s * (path[4] + s * path[5]))))


@inlined
def rate_at(s: float, path: Path) -> float:
    """Slope of the path."""
    return path[1] + s * (2.0 * path[2] + s * (3.0 * path[3] + s * (4.0 * path[4] + s * 5.0 * path[5])))


@uncounted
def turn(low: float, high: float, end: float, path: Path) -> float:
    """Place between `low` and `high` at which the slope takes the sign of `end`, its value at `high`."""
    s = 0.5 * (low + high)
    for _ in range(50):
        value = rate_at(s, path)
        slope = bend_at(s, path)
        low, high = (low, s) if value * end > 0.0 else (s, high)
        target = s - value / slope if slope != 0.0 else -1.0
        if not low < target < high:
            target = 0.5 * (low + high)
        change, s = abs(target - s), target
        if change < 1.0e-14:
            break
    return s


@inlined
def bend_at(s: float, path: Path) -> float:
    """Second derivative of the path."""
    return 2.0 * path[2] + s * (6.0 * path[3] + s * (12.0 * path[4] + s * 20.0 * path[5]))


@uncounted
def dip(low: float, high: float, rate: float, path: Path) -> float:
    """Place at which the slope, of one sign at both ends, comes nearest to zero between them; `high` if it does not."""
    if not (rate * bend_at(low, path) < 0.0 and rate * bend_at(high, path) > 0.0):
        return high
    begin, end = low, high
    for _ in range(40):
        s = 0.5 * (begin + end)
        begin, end = (s, end) if rate * bend_at(s, path) < 0.0 else (begin, s)
    return begin if rate * rate_at(begin, path) < 0.0 else high


@inlined
def turns(path: Path, middle: float, last: float) -> tuple[float, float, float, float]:
    """Places of at most four turns, two in each half, in their order; 1 for no turn."""
    one = two = three = four = 1.0
    if middle * last < 0.0:
        three = turn(0.5, 1.0, last, path)
    else:
        lowest = dip(0.5, 1.0, last, path)
        if lowest < 1.0:
            three, four = turn(0.5, lowest, -last, path), turn(lowest, 1.0, last, path)
    if path[1] * middle < 0.0:
        return turn(0.0, 0.5, middle, path), three, four, 1.0
    lowest = dip(0.0, 0.5, middle, path)
    if lowest < 0.5:
        one, two = turn(0.0, lowest, -middle, path), turn(lowest, 0.5, middle, path)
        return one, two, three, four
    return three, four, 1.0, 1.0


@inlined
def set_clock(state: FloatArray, duration: float, share: float, rate: float) -> None:
    """Tell a law that depends on the rate how long its next stroke takes, and how it ends.

    `duration` is the step's, zero for a rate-independent law; `rate` is for length 1 (`hysim.kernels.friction_rates`).
    """
    if duration > 0.0:
        state[1] = duration * share
        state[2] = rate / duration


@uncounted
def along(
    step: Step, member: Member, rule: FloatArray, begin: float, end: float, r: float, k0: float, path: Path
) -> Integrals:
    """Integrals over a monotone part, and the last r; `r` is that at its begin, where the rule has a node."""
    parameters, state, duration = member
    place = begin
    m0 = m1 = m2 = m3 = m4 = work = ahead = 0.0
    length = end - begin
    for i in range(rule.shape[0]):
        s = begin + length * rule[i, 0]
        d = drift_at(s, path)
        if i > 0 or rule[i, 0] > 0.0:
            set_clock(state, duration, s - place, rate_at(s, path))
            r = k0 * d - step(parameters, state, d)
            place = s
        ahead += rule[i, 2] * r
        weight = length * rule[i, 1] * r
        work += weight * rate_at(s, path)
        m0 += weight
        weight *= s
        m1 += weight
        weight *= s
        m2 += weight
        weight *= s
        m3 += weight
        m4 += weight * s
    return m0, m1, m2, m3, m4, work, r, ahead


@inlined
def together(one: Integrals, two: Integrals) -> Integrals:
    """Integrals over two consecutive parts."""
    return (
        one[0] + two[0], one[1] + two[1], one[2] + two[2], one[3] + two[3], one[4] + two[4], one[5] + two[5], two[6],
        two[7],
    )  # fmt: skip


@uncounted
def divided(
    step: Step, member: Member, memory: Memory, begin: float, end: float, r: float, allowed: float, k0: float,
    path: Path,
) -> Integrals:  # fmt: skip
    """Integrals over a monotone stretch that begins with `r`, which is divided until its parts agree."""
    states, spare = memory[3], memory[5]
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    low, length, tried = begin, end - begin, 0
    copy(memory, states, spare)
    whole = along(step, member, _LOBATTO, low, end, r, k0, path)
    while True:
        middle, high = low + 0.5 * length, low + length
        copy(memory, spare, states)
        one = along(step, member, _LOBATTO, low, middle, r, k0, path)
        two = along(step, member, _LOBATTO, middle, high, one[6], k0, path)
        tried += 1
        agree = abs(one[0] + two[0] - whole[0]) <= allowed or not math.isfinite(one[0] + two[0])
        if not agree and length > _NARROWEST and tried < _MOST_PARTS:
            length, whole = 0.5 * length, one
            continue
        total = together(total, together(one, two))
        low, r = high, two[6]
        if not low < end:
            break
        length = min(2.0 * length, end - low)
        copy(memory, states, spare)
        whole = along(step, member, _LOBATTO, low, low + length, r, k0, path)
    return total


@inlined
def copy(memory: Memory, source: FloatArray, target: FloatArray) -> None:
    """A law's memory from one row of states into another."""
    stretches = memory[0]
    for i in range(memory[1], memory[2]):
        for q in range(stretches[i, 0], stretches[i, 0] + stretches[i, 1]):
            target[q] = source[q]


@unfolded
def fit_rest(
    step: Step, member: Member, memory: Memory, is_fine: bool, allowed: float, begins: tuple[float, float], path: Path,
    rates: tuple[float, float], rest: FloatArray, sums: FloatArray,
) -> bool:  # fmt: skip
    """One sweep of an element: whether its stretches were divided.

    It `begins` with the slope k0 and the force; `rates` are those in the middle and at the end. Its rows of `rest`,
    (c0, c1, c2, c3), and of `sums` are overwritten: m0, the work of r, the largest drift at a turn, r at the last node,
    the place of that node, what the fit misses of the fifth moment, what the rule may have missed behind its nodes, in
    a first sweep without the last of them, the r to which its last nodes lead, and the place of the memory. The m0
    before is that of the sweep before. The law's memory is at the last node, or at the end, afterwards; before a
    division it is that before the step.
    """
    parameters, state, duration = member
    k0, f0 = begins
    one, two, three, four = turns(path, rates[0], rates[1])
    rule = _RADAU_4 if is_fine else _RADAU_3
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, k0 * path[0] - f0, 0.0)
    begin = peak = missed = 0.0
    for part in range(5):
        end = one if part == 0 else two if part == 1 else three if part == 2 else four if part == 3 else 1.0
        total = together(total, along(step, member, rule, begin, end, total[6], k0, path))
        sums[3], sums[4], sums[7] = total[6], begin + (end - begin) * rule[rule.shape[0] - 1, 0], total[7]
        if end == 1.0 and not is_fine:
            break
        d = drift_at(end, path)
        set_clock(state, duration, end - sums[4], rate_at(end, path))
        r = k0 * d - step(parameters, state, d)
        missed += UNSEEN * (end - begin) * abs(r - total[7])
        total = total[0], total[1], total[2], total[3], total[4], total[5], r, 0.0
        if end == 1.0:
            break
        begin, peak = end, max(peak, abs(d))
    is_divided = is_fine and not max(abs(total[0] - sums[0]), missed) <= allowed
    if is_divided:
        copy(memory, memory[4], memory[3])
        total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, k0 * path[0] - f0, 0.0)
        begin = 0.0
        for part in range(5):
            end = one if part == 0 else two if part == 1 else three if part == 2 else four if part == 3 else 1.0
            total = together(total, divided(step, member, memory, begin, end, total[6], allowed, k0, path))
            if end == 1.0:
                break
            begin = end
    m0, m1, m2, m3, m4, work, _, _ = total
    if is_fine:
        rest[0] = 16.0 * m0 - 120.0 * m1 + 240.0 * m2 - 140.0 * m3
        rest[1] = -120.0 * m0 + 1200.0 * m1 - 2700.0 * m2 + 1680.0 * m3
        rest[2] = 240.0 * m0 - 2700.0 * m1 + 6480.0 * m2 - 4200.0 * m3
        rest[3] = -140.0 * m0 + 1680.0 * m1 - 4200.0 * m2 + 2800.0 * m3
    else:
        rest[0] = 9.0 * m0 - 36.0 * m1 + 30.0 * m2
        rest[1] = -36.0 * m0 + 192.0 * m1 - 180.0 * m2
        rest[2] = 30.0 * m0 - 180.0 * m1 + 180.0 * m2
        rest[3] = 0.0
    fitted = rest[0] / 5.0 + rest[1] / 6.0 + rest[2] / 7.0 + rest[3] / 8.0
    sums[0], sums[1], sums[2], sums[5], sums[6] = m0, work, peak, abs(m4 - fitted), missed
    sums[8] = 1.0 if is_fine else sums[4]
    return is_divided


@inlined
def crest(x0: float, v0: float, x1: float, v1: float) -> float:
    """Size of the cubic at its turn between ends of rates v of opposite sign; v0 and v1 are for a step of length 1."""
    b, c = 3.0 * (x1 - x0) - 2.0 * v0 - v1, 2.0 * (x0 - x1) + v0 + v1
    root = math.sqrt(max(b * b - 3.0 * c * v0, 0.0))
    s = -v0 / (b - math.copysign(root, v0)) if b != math.copysign(root, v0) else 0.5
    s = min(max(s, 0.0), 1.0)
    return abs(x0 + s * (v0 + s * (b + s * c)))
