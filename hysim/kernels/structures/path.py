"""Motion of a structure, sample by sample.

    M x'' + C x' + K x + sum over elements of b f(b . x) = sum over loads of q p(t)

The linear part with an elastic slope k0 of each element, K + sum k0 b b', is propagated exactly (`flows`). The rest of
each element's force, k0 d - f(d), enters as a cubic over the step (`moments`). A step has sweeps: the first one takes
the path that follows from the rests before the step, the next one the path that follows from the first. Reversals
within a step do not lower the order, which is 4 at least.

A base step is divided into 2^k parts until the drifts of two sweeps agree to the tolerance, and what the cubics miss is
below it: k is found by trial, and falls again where it may. Without a tolerance the base steps are taken as they are.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel, uncounted, unfolded
from hysim.kernels.structures.flows import N_POWERS, add_columns
from hysim.kernels.structures.moments import UNSEEN, IntArray, crest, fit_rest, quintic, set_clock
from hysim.kernels.structures.pointers import step_at

_MOST_SWEEPS = 4
_MISSED = 4.0  # response in the middle of a step to a load without its first four moments, by the fifth one
_AT_ONCE = 0.1  # share of the tolerance below which the first sweep is the last one
_EASY = 1.0 / 64.0  # share of the tolerance below which steps of twice the length are tried
LEAST_DRIFT = 1.0e-4  # share of the displacements: the least drift whose error counts as its own
_OF_DIVISIONS = 0.1  # share of the tolerance that a divided moment may take
OF_MOMENTS = 1.0e-9  # tolerance of the moments where the steps have none
_NEAREST = 1.0e-3  # of the step: a last node closer to its end has no slope but that of rounding
_TINY = 1.0e-290


BoolArray = npt.NDArray[np.bool_]


class Elements(NamedTuple):
    """Elements with memory, one behind the other.

    Element e has the nodes ``nodes[node_ends[e]:node_ends[e + 1]]`` with the weights of the drift, its elastic slope
    ``k0[e]``, the address of its step in ``steps[e]``; likewise its parameters, its state, and the stretches of the
    state that are memory. Where ``rated[e]`` is 1 the step depends on the rate of the drift, and its state begins as
    `hysim.kernels.friction.rates` says; else it is 0.
    """

    nodes: IntArray
    weights: FloatArray
    node_ends: IntArray
    k0: FloatArray
    steps: IntArray
    rated: FloatArray
    parameters: FloatArray
    parameter_ends: IntArray
    state_ends: IntArray
    stretches: IntArray
    stretch_ends: IntArray


class Flows(NamedTuple):
    """Flows over the base step and its halves, quarters, ...: columns whose weights are what the motion depends on.

    `free`, (n_levels, m + 2 n_loads, m), is the state after a step by the state before, the loads at the begin and
    their rises; `rests`, (n_levels, 4 n_elements, m), by the coefficients of the rests. `free_drifts` and `drifts`,
    with 2 n_elements in the last axis, are the drifts and their rates. There is a level more than steps are divided,
    for the middle of a step.
    """

    free: FloatArray
    rests: FloatArray
    free_drifts: FloatArray
    drifts: FloatArray


class Room(NamedTuple):
    """Room for work.

    `inputs`, (m + 2 n_loads,), are the weights of the free flows. `free_drifts` and `free_middle`, (2 n_elements,), are
    the drifts and their rates without the rests after the step and its half; `drifts` and `middle` those with the
    rests; `before` the drifts of the sweep before. `scales` are the sizes of drifts, `own` the drifts by unit rests of
    the same element, `allowed` the errors that their moments may have, `errors` those of the drifts. `forces` are
    those after the step, where `is_at_end`, (1,), says that the laws have been put there. `rest`, (4 n_elements,), are
    the coefficients of the rests, `half` those for the half of the step; `sums` is (n_elements, 9), see
    `moments.fit_rest`. `saved` and `spare` are states of the laws, `end`, `point` and `now` states of the structure
    after and in the step; `speeds`, (2, n_nodes), are two derivatives of the velocity; `loads`, (2, n_loads), the rise
    over a sample, and the loads at the begin of a step.
    """

    inputs: FloatArray
    free_drifts: FloatArray
    free_middle: FloatArray
    drifts: FloatArray
    middle: FloatArray
    before: FloatArray
    scales: FloatArray
    own: FloatArray
    allowed: FloatArray
    errors: FloatArray
    forces: FloatArray
    is_at_end: BoolArray
    rest: FloatArray
    half: FloatArray
    sums: FloatArray
    saved: FloatArray
    spare: FloatArray
    end: FloatArray
    point: FloatArray
    now: FloatArray
    speeds: FloatArray
    loads: FloatArray


class Motion(NamedTuple):
    """The state of a simulation, which moves along.

    `x` is the state (x, v), `laws` are the laws' states, `carry` is (5, n_elements): force, slope of the rest over
    time, drift, its rate, and the largest error of the drift in a step. `peaks` are the largest sizes so far of drifts,
    forces, displacements and, where there is room, accelerations; `work` is that of the loads, of the damping and of
    each element. `division`, (1,), is the present number of halvings. `loads` are those of the last sample.
    """

    x: FloatArray
    laws: FloatArray
    carry: FloatArray
    peaks: FloatArray
    work: FloatArray
    division: FloatArray
    loads: FloatArray


class Tracks(NamedTuple):
    """Tables of the samples, a row each; with one row the last sample only, without rows none."""

    x: FloatArray
    carry: FloatArray
    peaks: FloatArray
    work: FloatArray
    laws: FloatArray


class Plant(NamedTuple):
    """The linear part: A, (m, m), and the loads, (n_loads + n_elements, m), of s' = A s + loads, for accelerations.

    `damping` is (n_nodes, n_nodes) and `directions` (n_loads, n_nodes), for energies; without rows where these are not
    wanted. `pushing`, (n_loads,), is 1 for a force, and 0 for a moving base, whose acceleration is not counted.
    """

    A: FloatArray
    loads: FloatArray
    damping: FloatArray
    directions: FloatArray
    pushing: FloatArray


class Steps(NamedTuple):
    """How a sample is divided.

    Its length [s], the rate of the fastest mode [1/s], equal base steps, the most halvings of these (0 for none), and
    the tolerance, a share of the drifts.
    """

    sample_time: float
    rate: float
    base: int
    halvings: int
    tolerance: float


def make_room(n_elements: int, m: int, n_state: int, n_loads: int = 1) -> Room:
    """Room for a structure."""
    shapes = {
        "inputs": m + 2 * n_loads,
        **dict.fromkeys(("free_drifts", "free_middle", "drifts", "middle", "before"), 2 * n_elements),
        **dict.fromkeys(("scales", "own", "allowed", "errors", "forces"), n_elements),
        **dict.fromkeys(("rest", "half"), N_POWERS * n_elements),
        "sums": (n_elements, 9),
        **dict.fromkeys(("saved", "spare"), n_state),
        **dict.fromkeys(("end", "point", "now"), m),
        "speeds": (2, m // 2),
        "loads": (2, n_loads),
    }
    vectors = {name: np.zeros(shape) for name, shape in shapes.items()}
    return Room(**vectors, is_at_end=np.zeros(1, dtype=np.bool_))


@uncounted
def project(elements: Elements, columns: FloatArray, drifts: FloatArray) -> None:
    """Drifts and rates of the drifts, (n_levels, k, 2 n_elements), of columns of states (n_levels, k, m)."""
    n, n_nodes = elements.k0.size, columns.shape[2] // 2
    for level in range(columns.shape[0]):
        for i in range(columns.shape[1]):
            for e in range(n):
                drift = rate = 0.0
                for q in range(elements.node_ends[e], elements.node_ends[e + 1]):
                    node, weight = elements.nodes[q], elements.weights[q]
                    drift += weight * columns[level, i, node]
                    rate += weight * columns[level, i, n_nodes + node]
                drifts[level, i, e] = drift
                drifts[level, i, n + e] = rate


@unfolded
def combine(columns: FloatArray, weights: FloatArray, base: FloatArray, out: FloatArray) -> None:
    """The columns by their weights, added to `base`."""
    for q in range(out.size):
        out[q] = base[q]
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
        memory = elements.stretches, elements.stretch_ends[e], elements.stretch_ends[e + 1], motion.laws
        state = motion.laws[elements.state_ends[e] : elements.state_ends[e + 1]]
        parameters = elements.parameters[elements.parameter_ends[e] : elements.parameter_ends[e + 1]]
        middle, last = h * room.middle[n + e], h * room.drifts[n + e]
        path = quintic(carry[2, e], h * carry[3, e], room.middle[e], middle, room.drifts[e], last)
        is_divided = fit_rest(
            step_at(elements.steps[e]), parameters, state, h * elements.rated[e], memory, room.saved, room.spare,
            is_fine, room.allowed[e],
            elements.k0[e], carry[0, e], path, middle, last, e, room.rest, room.sums,
        )  # fmt: skip
        any_divided = any_divided or is_divided
    return any_divided


@unfolded
def set_errors(h: float, phase: float, room: Room) -> None:
    """Errors of the drifts, or of their rates over the step.

    They are the changes by the last sweep, or what the fits of the rests miss: the response to a load that has no first
    four moments, at the end of the step, and in the middle, from where it comes back by the path.
    """
    n, share = room.scales.size, phase * phase * (_MISSED + phase * phase / 12.0)
    for e in range(n):
        change = max(abs(room.drifts[e] - room.before[e]), h * abs(room.drifts[n + e] - room.before[n + e]))
        error = max(change, share * room.sums[e, 5] * room.own[e])
        room.errors[e] = error if math.isfinite(error) else math.inf


@unfolded
def largest_error(tolerance: float, room: Room) -> float:
    """The largest error in units of the tolerance."""
    largest = 0.0
    for e in range(room.errors.size):
        if room.errors[e] > 0.0:
            largest = max(largest, room.errors[e] / (tolerance * room.scales[e]))
    return largest


@unfolded
def is_smooth(elements: Elements, h: float, motion: Motion, room: Room) -> bool:
    """Whether each rest ends where its nodes lead, so that no kink behind them is missed; the laws are put there."""
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
    for q in range(m):
        inputs[q] = motion.x[q]
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
        for e in range(2 * n):
            room.before[e] = room.drifts[e]
        combine(drifts, rest, room.free_drifts, room.drifts)
        if k == 0 and not is_adaptive:
            continue
        set_errors(h, h * rate, room)
        apart = largest_error(tolerance, room)
        if k > 0 and not (any_divided and apart > 1.0):
            break
        if apart < _AT_ONCE and is_smooth(elements, h, motion, room):
            room.is_at_end[0] = True
            break
    return apart


@unfolded
def take_step(
    elements: Elements, flows: Flows, level: int, h: float, share: float, motion: Motion, plant: Plant, room: Room
) -> None:
    """Move along by the step that was tried."""
    n, m = elements.k0.size, motion.x.size
    n_nodes = m // 2
    x, carry, peaks, work, sums, end = motion.x, motion.carry, motion.peaks, motion.work, room.sums, room.end
    for q in range(m):
        end[q] = 0.0
    add_columns(flows.free[level], room.inputs, end)
    add_columns(flows.rests[level], room.rest, end)
    for e in range(n):
        parameters = elements.parameters[elements.parameter_ends[e] : elements.parameter_ends[e + 1]]
        state = motion.laws[elements.state_ends[e] : elements.state_ends[e + 1]]
        d = room.drifts[e]
        set_clock(state, h * elements.rated[e], 1.0 - sums[e, 8], h * room.drifts[n + e])
        f = room.forces[e] if room.is_at_end[0] else step_at(elements.steps[e])(parameters, state, d)
        ahead = 1.0 - sums[e, 4]
        slope = (elements.k0[e] * d - f - sums[e, 3]) / (h * ahead) if ahead > _NEAREST else 0.0
        carry[1, e] = slope
        end_of_path = room.before[e]
        work[2 + e] += 0.5 * elements.k0[e] * (end_of_path - carry[2, e]) * (end_of_path + carry[2, e]) - sums[e, 1]
        work[2 + e] += f * (d - end_of_path)
        carry[0, e], carry[2, e], carry[3, e] = f, d, room.drifts[n + e]
        peaks[e] = max(peaks[e], max(abs(d), sums[e, 2]))
        peaks[n + e] = max(peaks[n + e], abs(f))
        carry[4, e] = max(carry[4, e], room.errors[e])
    for q in range(n_nodes):
        size = abs(end[q])
        if x[n_nodes + q] * end[n_nodes + q] < 0.0:
            size = max(size, crest(x[q], h * x[n_nodes + q], end[q], h * end[n_nodes + q]))
        peaks[2 * n + q] = max(peaks[2 * n + q], size)
    if plant.directions.shape[0] > 0:
        add_work(flows, plant, level, h, share, motion, room)
    for q in range(m):
        x[q] = end[q]
    keep(elements.stretches, motion.laws, room.saved)


@unfolded
def add_work(flows: Flows, plant: Plant, level: int, h: float, share: float, motion: Motion, room: Room) -> None:
    """Work of the loads and of the damping over a step, from the powers and two derivatives at three points of it."""
    x, work, inputs, m = motion.x, motion.work, room.inputs, motion.x.size
    n_loads = motion.loads.size
    for i in range(n_loads):
        inputs[m + 2 * i + 1] *= 0.5
    for q in range(m):
        room.point[q] = 0.0
    add_columns(flows.free[level + 1], inputs, room.point)
    halve(room.rest, room.half)
    add_columns(flows.rests[level + 1], room.half, room.point)
    for i in range(n_loads):
        inputs[m + 2 * i + 1] *= 2.0
    for k in range(3):
        for q in range(m):
            room.now[q] = x[q] if k == 0 else room.point[q] if k == 1 else room.end[q]
        add_powers(plant, h, share, 0.5 * k, 1.0 - k, room.now, room, work)


@unfolded
def add_powers(
    plant: Plant, h: float, share: float, s: float, side: float, x: FloatArray, room: Room, work: FloatArray
) -> None:
    """The part of one point, at the share s of the step, in the integrals of the powers.

    Weights of values and two derivatives at begin, middle and end: exact for polynomials of degree 8.
    """
    n, n_loads, n_elements = x.size // 2, room.loads.shape[1], room.own.size
    value, first, second = (
        (64.0 / 105.0, 0.0, 2.0 / 315.0) if side == 0.0 else (41.0 / 210.0, side / 70.0, 1.0 / 2520.0)
    )
    a, j = room.speeds[0], room.speeds[1]
    derivatives(plant.A, x, x[n:], a)
    for i in range(n_loads):
        load = room.loads[1, i] + s * share * room.loads[0, i]
        for q in range(n):
            a[q] += load * plant.loads[i, n + q]
    for e in range(n_elements):
        c0, c1, c2, c3 = room.rest[4 * e], room.rest[4 * e + 1], room.rest[4 * e + 2], room.rest[4 * e + 3]
        load = c0 + s * (c1 + s * (c2 + s * c3))
        for q in range(n):
            a[q] += load * plant.loads[n_loads + e, n + q]
    derivatives(plant.A, x[n:], a, j)
    for i in range(n_loads):
        for q in range(n):
            j[q] += share * room.loads[0, i] / h * plant.loads[i, n + q]
    for e in range(n_elements):
        c1, c2, c3 = room.rest[4 * e + 1], room.rest[4 * e + 2], room.rest[4 * e + 3]
        for q in range(n):
            j[q] += (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / h * plant.loads[n_loads + e, n + q]
    for i in range(n_loads):
        load, slope = room.loads[1, i] + s * share * room.loads[0, i], share * room.loads[0, i] / h
        rate = change = bend = 0.0
        for q in range(n):
            weight = plant.directions[i, q]
            rate, change, bend = rate + weight * x[n + q], change + weight * a[q], bend + weight * j[q]
        work[0] += h * value * load * rate + h * h * first * (slope * rate + load * change)
        work[0] += h * h * h * second * (2.0 * slope * change + load * bend)
    for q in range(n):
        force = rise = 0.0
        for p in range(n):
            force += plant.damping[q, p] * x[n + p]
            rise += plant.damping[q, p] * a[p]
        work[1] += h * value * force * x[n + q] + 2.0 * h * h * first * force * a[q]
        work[1] += 2.0 * h * h * h * second * (rise * a[q] + force * j[q])


@uncounted
def derivatives(A: FloatArray, x: FloatArray, v: FloatArray, out: FloatArray) -> None:
    """Accelerations of the linear part without loads at displacements x and velocities v."""
    n = out.size
    for q in range(n):
        total = 0.0
        for p in range(n):
            total += A[n + q, p] * x[p] + A[n + q, n + p] * v[p]
        out[q] = total


@unfolded
def move_on(elements: Elements, flows: Flows, plant: Plant, steps: Steps, motion: Motion, room: Room) -> None:
    """Move along by a sample, in which the loads rise."""
    rise, begin, first = room.loads[0], room.loads[1], motion.loads
    n_loads = first.size
    tolerance = steps.tolerance if steps.halvings > 0 else OF_MOMENTS
    total = 2**steps.halvings
    for j in range(steps.base):
        done = 0
        while done < total:
            level = min(int(motion.division[0]), steps.halvings)
            size = total >> level
            share = size / (total * steps.base)
            at = (j + done / total) / steps.base
            h = steps.sample_time * share
            for i in range(n_loads):
                begin[i] = first[i] + at * rise[i]
            apart = try_step(elements, flows, level, h, share, steps.rate, steps.halvings > 0, tolerance, motion, room)
            if apart > 1.0 and level < steps.halvings:
                motion.division[0] = level + 1.0
                continue
            take_step(elements, flows, level, h, share, motion, plant, room)
            done += size
            if apart < _EASY and level > 0 and done % (2 * size) == 0:
                motion.division[0] = level - 1.0


@unfolded
def add_accelerations(elements: Elements, plant: Plant, n_loads: int, motion: Motion, peaks: FloatArray) -> None:
    """Largest accelerations so far, absolute ones under a moving base."""
    n, m = elements.k0.size, motion.x.size
    for q in range(m // 2):
        total = 0.0
        for p in range(m):
            total += plant.A[m // 2 + q, p] * motion.x[p]
        for i in range(n_loads):
            total += plant.pushing[i] * motion.loads[i] * plant.loads[i, m // 2 + q]
        for e in range(n):
            total += plant.loads[n_loads + e, m // 2 + q] * (elements.k0[e] * motion.carry[2, e] - motion.carry[0, e])
        peaks[q] = max(peaks[q], abs(total))


@unfolded
def write(motion: Motion, k: int, tracks: Tracks) -> None:
    """The present sample into its row, or into the only one, if there is any."""
    if tracks.x.shape[0] == 0:
        return
    row = min(k, tracks.x.shape[0] - 1)
    put(motion.x, tracks.x[row])
    for i in range(motion.carry.shape[0]):
        put(motion.carry[i], tracks.carry[row, i])
    put(motion.peaks, tracks.peaks[row])
    put(motion.work, tracks.work[row])
    if tracks.laws.shape[0] > 0:
        put(motion.laws, tracks.laws[min(k, tracks.laws.shape[0] - 1)])


@uncounted
def put(values: FloatArray, out: FloatArray) -> None:
    """Copy a vector."""
    for q in range(values.size):
        out[q] = values[q]


@kernel
def follow(
    elements: Elements, flows: Flows, plant: Plant, steps: Steps, is_first: bool, loads: FloatArray, motion: Motion,
    room: Room, tracks: Tracks,
) -> int:  # fmt: skip
    """Motion under `loads`, (n_samples, n_loads), linear between samples: the first one that is not finite, or -1.

    With `is_first` the motion begins at the first sample, else one sample before it.
    """
    return walk(elements, flows, plant, steps, is_first, loads, motion, room, tracks)


@uncounted
def walk(
    elements: Elements, flows: Flows, plant: Plant, steps: Steps, is_first: bool, loads: FloatArray, motion: Motion,
    room: Room, tracks: Tracks,
) -> int:  # fmt: skip
    """As `follow`, of arrays that the caller holds."""
    rise = room.loads[0]
    keep(elements.stretches, motion.laws, room.saved)
    for k in range(loads.shape[0]):
        if k > 0 or not is_first:
            for i in range(rise.size):
                rise[i] = loads[k, i] - motion.loads[i]
            move_on(elements, flows, plant, steps, motion, room)
        for i in range(rise.size):
            motion.loads[i] = loads[k, i]
        n, m = elements.k0.size, motion.x.size
        if motion.peaks.size > 2 * n + m // 2:
            add_accelerations(elements, plant, rise.size, motion, motion.peaks[2 * n + m // 2 :])
        write(motion, k, tracks)
        for q in range(m):
            if not math.isfinite(motion.x[q]):
                return k
    return -1
