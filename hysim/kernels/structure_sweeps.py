"""Sweeps of one step of a structure: the rests of its elements along a path, and the path under these rests.

The first sweep takes the path that follows from the rests before the step, the next one the path that follows from the
first. What two of them differ by, and what the fits of the rests miss, is the error of the step.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import unfolded
from hysim.kernels.structure_flows import N_POWERS, add_columns, put
from hysim.kernels.structure_layout import Elements, Flows, Motion, Room
from hysim.kernels.structure_moments import UNSEEN, IntArray, fit_rest, quintic, set_clock
from hysim.kernels.structure_pointers import step_at

_MOST_SWEEPS = 4
_MISSED = 4.0  # response in the middle of a step to a load without its first four moments, by the fifth one
_AT_ONCE = 0.1  # share of the tolerance below which the first sweep is the last one
LEAST_DRIFT = 1.0e-4  # share of the displacements: the least drift whose error counts as its own
_OF_DIVISIONS = 0.1  # share of the tolerance that a divided moment may take
_TINY = 1.0e-290


@unfolded
def combine(columns: FloatArray, weights: FloatArray, base: FloatArray, out: FloatArray) -> None:
    """The columns by their weights, added to `base`."""
    put(base, out)
    add_columns(columns, weights, out)


@unfolded
def keep(stretches: IntArray, source: FloatArray, target: FloatArray) -> None:
    """Copy the memories of all laws."""
    for i in range(stretches.shape[0]):
        for q in range(stretches[i, 0], stretches[i, 0] + stretches[i, 1]):
            target[q] = source[q]


@unfolded
def sweep(elements: Elements, h: float, is_fine: bool, motion: Motion, room: Room) -> bool:
    """The rests along the present paths; whether a stretch was divided."""
    n, carry = elements.k0.size, motion.carry
    any_divided = False
    keep(elements.stretches, room.saved, motion.laws)
    for e in range(n):
        first, end = elements.stretch_ends[e], elements.stretch_ends[e + 1]
        memory = elements.stretches, first, end, motion.laws, room.saved, room.spare
        state = motion.laws[elements.state_ends[e] : elements.state_ends[e + 1]]
        parameters = elements.parameters[elements.parameter_ends[e] : elements.parameter_ends[e + 1]]
        middle, last = h * room.middle[n + e], h * room.drifts[n + e]
        path = quintic(carry[2, e], h * carry[3, e], room.middle[e], middle, room.drifts[e], last)
        member = parameters, state, h * elements.rated[e]
        begins, rates = (elements.k0[e], carry[0, e]), (middle, last)
        is_divided = fit_rest(
            step_at(elements.steps[e]), member, memory, is_fine, room.allowed[e], begins, path, rates,
            room.rest[4 * e : 4 * e + 4], room.sums[e],
        )  # fmt: skip
        any_divided = any_divided or is_divided
    return any_divided


@unfolded
def largest_error(h: float, phase: float, tolerance: float, room: Room) -> float:
    """The largest error of a drift, or of its rate over the step, in units of the tolerance.

    The errors are the changes by the last sweep, or what the fits of the rests miss: the response to a load that has no
    first four moments, at the end of the step, and in the middle, from where it comes back by the path.
    """
    n, share = room.scales.size, phase * phase * (_MISSED + phase * phase / 12.0)
    largest = 0.0
    for e in range(n):
        change = max(abs(room.drifts[e] - room.before[e]), h * abs(room.drifts[n + e] - room.before[n + e]))
        error = max(change, share * room.sums[e, 5] * room.own[e])
        room.errors[e] = error if math.isfinite(error) else math.inf
        if room.errors[e] > 0.0:
            largest = max(largest, room.errors[e] / (tolerance * room.scales[e]))
    return largest


@unfolded
def is_smooth(elements: Elements, h: float, motion: Motion, room: Room) -> bool:
    """Whether each rest ends where its nodes lead, so that no kink is missed; the laws are put there."""
    smooth = True
    for e in range(room.allowed.size):
        parameters = elements.parameters[elements.parameter_ends[e] : elements.parameter_ends[e + 1]]
        state = motion.laws[elements.state_ends[e] : elements.state_ends[e + 1]]
        rate = h * room.drifts[room.allowed.size + e]
        set_clock(state, h * elements.rated[e], 1.0 - room.sums[e, 8], rate)
        f = step_at(elements.steps[e])(parameters, state, room.drifts[e])
        room.forces[e] = f
        missed = room.sums[e, 6] + UNSEEN * abs(elements.k0[e] * room.drifts[e] - f - room.sums[e, 7])
        smooth = smooth and missed <= room.allowed[e]
    return smooth


@unfolded
def halve(rest: FloatArray, half: FloatArray) -> None:
    """The coefficients of cubics over a step as those over its first half."""
    for e in range(rest.size // 4):
        half[4 * e], half[4 * e + 1] = rest[4 * e], 0.5 * rest[4 * e + 1]
        half[4 * e + 2], half[4 * e + 3] = 0.25 * rest[4 * e + 2], 0.125 * rest[4 * e + 3]


@unfolded
def set_scales(n_nodes: int, tolerance: float, drifts: FloatArray, peaks: FloatArray, room: Room) -> None:
    """Sizes of the drifts, and the errors that their moments may have; `drifts` are those by the rests."""
    n, reach = room.scales.size, 0.0
    for q in range(n_nodes):
        reach = max(reach, peaks[2 * n + q])
    for e in range(n):
        reach = max(reach, abs(room.drifts[e]))
    for e in range(n):
        room.scales[e] = max(max(peaks[e], abs(room.drifts[e])), max(LEAST_DRIFT * reach, _TINY))
        room.own[e] = max(abs(drifts[N_POWERS * e, e]), _TINY)
        room.allowed[e] = _OF_DIVISIONS * tolerance * room.scales[e] / room.own[e]


@unfolded
def try_step(
    elements: Elements, flows: Flows, level: int, h: float, share: float, rate: float, is_adaptive: bool,
    tolerance: float, motion: Motion, room: Room,
) -> float:  # fmt: skip
    """Sweeps of one step, whose result is in `room`: the disagreement of the last two in units of the tolerance."""
    n, m, n_loads = elements.k0.size, motion.x.size, motion.loads.size
    carry, rest, half, inputs = motion.carry, room.rest, room.half, room.inputs
    drifts, half_drifts = flows.drifts[level], flows.drifts[level + 1]
    put(motion.x, inputs)
    for i in range(n_loads):
        inputs[m + 2 * i] = room.loads[1, i]
        inputs[m + 2 * i + 1] = 0.5 * share * room.loads[0, i]
    for e in range(2 * n):
        room.free_drifts[e] = room.free_middle[e] = 0.0
    add_columns(flows.free_drifts[level + 1], inputs, room.free_middle)
    for i in range(n_loads):
        inputs[m + 2 * i + 1] = share * room.loads[0, i]
    add_columns(flows.free_drifts[level], inputs, room.free_drifts)
    for e in range(n):
        rest[4 * e] = elements.k0[e] * carry[2, e] - carry[0, e]
        rest[4 * e + 1] = h * carry[1, e]
        rest[4 * e + 2] = rest[4 * e + 3] = 0.0
    combine(drifts, rest, room.free_drifts, room.drifts)
    set_scales(m // 2, tolerance, drifts, motion.peaks, room)
    apart = 0.0
    room.is_at_end[0] = False
    for k in range(_MOST_SWEEPS):
        halve(rest, half)
        combine(half_drifts, half, room.free_middle, room.middle)
        any_divided = sweep(elements, h, k > 0, motion, room)
        put(room.drifts, room.before)
        combine(drifts, rest, room.free_drifts, room.drifts)
        if k == 0 and not is_adaptive:
            continue
        apart = largest_error(h, h * rate, tolerance, room)
        if k > 0 and not (any_divided and apart > 1.0):
            break
        if apart < _AT_ONCE and is_smooth(elements, h, motion, room):
            room.is_at_end[0] = True
            break
    return apart
