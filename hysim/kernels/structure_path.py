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

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import uncounted, uncounted_kernel, unfolded
from hysim.kernels.structure_flows import add_columns, put
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Room, Steps, Tracks
from hysim.kernels.structure_moments import crest, set_clock
from hysim.kernels.structure_pointers import step_at
from hysim.kernels.structure_sweeps import halve, keep, try_step


@unfolded
def add_work(
    elements: Elements, flows: Flows, plant: Plant, level: int, h: float, share: float, motion: Motion, room: Room
) -> None:
    """Work of loads, damping and dashpots over a step, from the powers and two derivatives at three points of it."""
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
        put(x if k == 0 else room.point if k == 1 else room.end, room.now)
        add_powers(elements, plant, h, share, 0.5 * k, 1.0 - k, room.now, room, work)


@unfolded
def add_powers(
    elements: Elements, plant: Plant, h: float, share: float, s: float, side: float, x: FloatArray, room: Room,
    work: FloatArray,
) -> None:  # fmt: skip
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
    for e in range(n_elements):
        if elements.viscosity[e] != 0.0:
            rate = change = bend = 0.0
            for i in range(elements.node_ends[e], elements.node_ends[e + 1]):
                q, weight = elements.nodes[i], elements.weights[i]
                rate, change, bend = rate + weight * x[n + q], change + weight * a[q], bend + weight * j[q]
            power = h * value * rate * rate + 2.0 * h * h * first * rate * change
            power += 2.0 * h * h * h * second * (change * change + rate * bend)
            work[2 + e] += elements.viscosity[e] * power


@uncounted
def derivatives(A: FloatArray, x: FloatArray, v: FloatArray, out: FloatArray) -> None:
    """Accelerations of the linear part without loads at displacements x and velocities v."""
    n = out.size
    for q in range(n):
        total = 0.0
        for p in range(n):
            total += A[n + q, p] * x[p] + A[n + q, n + p] * v[p]
        out[q] = total


_EASY = 1.0 / 64.0  # share of the tolerance below which steps of twice the length are tried
OF_MOMENTS = 1.0e-9  # tolerance of the moments where the steps have none
_NEAREST = 1.0e-3  # of the step: a last node closer to its end has no slope but that of rounding


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
        peaks[n + e] = max(peaks[n + e], abs(f + elements.viscosity[e] * room.drifts[n + e]))
        carry[4, e] = max(carry[4, e], room.errors[e])
    for q in range(n_nodes):
        size = abs(end[q])
        if x[n_nodes + q] * end[n_nodes + q] < 0.0:
            size = max(size, crest(x[q], h * x[n_nodes + q], end[q], h * end[n_nodes + q]))
        peaks[2 * n + q] = max(peaks[2 * n + q], size)
    if plant.directions.shape[0] > 0:
        add_work(elements, flows, plant, level, h, share, motion, room)
    put(end, x)
    keep(elements.stretches, motion.laws, room.saved)


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


@uncounted_kernel
def follow(
    elements: Elements, flows: Flows, plant: Plant, steps: Steps, is_first: bool, loads: FloatArray, motion: Motion,
    room: Room, tracks: Tracks,
) -> int:  # fmt: skip
    """Motion under `loads`, (n_samples, n_loads), linear between samples: the first one that is not finite, or -1.

    With `is_first` the motion begins at the first sample, else one sample before it. Kernels call it by its address,
    `pointers.FOLLOW`: it takes a quarter of a minute to compile, which is done once.
    """
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
