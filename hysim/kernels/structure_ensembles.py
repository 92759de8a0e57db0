"""Many structures of one kind at once: their peaks, and their last sample."""

import math
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner, kernel, uncounted
from hysim.kernels.structure_flows import N_POWERS, fill_flows, put
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Room, Steps, Tracks
from hysim.kernels.structure_moments import IntArray
from hysim.kernels.structure_pointers import follow_at, start_at, step_at

_PROBES = 13  # strokes of 1, 0.1, 0.01, ...


class Sets(NamedTuple):
    """Structures that differ in numbers, one a row.

    `A` is (n_sets, m, m), `loads` (n_sets, 1 + n_elements, m), `rates` (n_sets,), `slopes` and `viscosities`
    (n_sets, n_elements), `parameters` and `states` those of the laws, `starts` the addresses of their starts; `scales`
    (n_sets,) multiply the input `u`, (1, n_samples) or (n_sets, n_samples), from the state `x` on. Base steps without a
    number are as many as have at most the `phase` of the fastest mode.
    """

    A: FloatArray
    loads: FloatArray
    rates: FloatArray
    slopes: FloatArray
    viscosities: FloatArray
    parameters: FloatArray
    states: FloatArray
    starts: IntArray
    scales: FloatArray
    u: FloatArray
    x: FloatArray
    phase: float


class Results(NamedTuple):
    """Results of each structure.

    `peaks` as of `path.Motion`; `drifts` and `work` of the elements after the last sample, `errors` the largest
    uncertainty of the drifts in a step, each (n_sets, n_elements).
    """

    peaks: FloatArray
    drifts: FloatArray
    work: FloatArray
    errors: FloatArray


@kernel
def fill_slopes(
    steps: IntArray, starts: IntArray, parameters: FloatArray, parameter_ends: IntArray, states: FloatArray,
    state_ends: IntArray, slopes: FloatArray,
) -> None:  # fmt: skip
    """Elastic slopes of laws at their start: the limit of secants of shorter and shorter strokes.

    Of all secants that one is taken which differs least, relatively, from the one before. A law that falls in both
    directions has the steeper slope, that of unloading; one that only falls ahead, beyond its saturation, has none. The
    laws are those of each row of parameters (n_sets, n_parameters) and states.
    """
    spare = np.empty(states.shape[1])
    for i in range(slopes.shape[0]):
        numbers, memories = parameters[i], states[i]
        for e in range(slopes.shape[1]):
            own = numbers[parameter_ends[e] : parameter_ends[e + 1]]
            begin, end = state_ends[e], state_ends[e + 1]
            step, start = step_at(steps[e]), start_at(starts[e])
            slope, behind = 0.0, 0.0
            for way in (-1.0, 1.0):
                before, least, behind = math.nan, math.inf, slope
                for k in range(_PROBES):
                    stroke = way * 10.0**-k
                    for q in range(begin, end):
                        spare[q] = memories[q]
                    start(own, spare[begin:end], 0.0)
                    f0 = step(own, spare[begin:end], 0.0)
                    secant = (step(own, spare[begin:end], stroke) - f0) / stroke
                    size = max(abs(secant), abs(before))
                    change = 0.0 if size == 0.0 else abs(secant - before) / size
                    if change < least:
                        least, slope = change, secant
                    before = secant
            slopes[i, e] = min(behind, slope) if max(behind, slope) < 0.0 else max(slope, 0.0)


@kernel
def start_motion(elements: Elements, starts: IntArray, state: FloatArray, x: FloatArray, motion: Motion) -> None:
    """Put a structure at its first sample."""
    n, n_nodes = elements.k0.size, x.size // 2
    put(x, motion.x)
    put(state, motion.laws)
    for q in range(motion.peaks.size):
        motion.peaks[q] = 0.0
    for q in range(motion.work.size):
        motion.work[q] = 0.0
    motion.division[0] = 0.0
    for e in range(n):
        drift = rate = 0.0
        for q in range(elements.node_ends[e], elements.node_ends[e + 1]):
            drift += elements.weights[q] * x[elements.nodes[q]]
            rate += elements.weights[q] * x[n_nodes + elements.nodes[q]]
        own = elements.parameters[elements.parameter_ends[e] : elements.parameter_ends[e + 1]]
        law = motion.laws[elements.state_ends[e] : elements.state_ends[e + 1]]
        step, start = step_at(elements.steps[e]), start_at(starts[e])
        start(own, law, drift)
        if elements.rated[e] > 0.0:
            law[1], law[2] = 0.0, rate
        force = step(own, law, drift)
        motion.carry[0, e], motion.carry[1, e], motion.carry[2, e] = force, 0.0, drift
        motion.carry[3, e], motion.carry[4, e] = rate, 0.0
        motion.peaks[e], motion.peaks[n + e] = abs(drift), abs(force + elements.viscosity[e] * rate)
    for q in range(n_nodes):
        motion.peaks[2 * n + q] = abs(x[q])


@inner
def same(one: FloatArray, two: FloatArray) -> bool:
    """Whether two matrices are equal."""
    equal = True
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            equal = equal and one[i, j] == two[i, j]
    return equal


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


@kernel
def fill_structure(
    elements: Elements, A: FloatArray, loads: FloatArray, rate: float, h: float, E: FloatArray, P: FloatArray,
    flows: Flows,
) -> None:  # fmt: skip
    """Flows of a structure over a base step and its parts."""
    m = A.shape[0]
    spare, past = np.empty((2, m, m)), np.empty((2, loads.shape[0], N_POWERS, m))
    fill_flows(A, loads, rate, h, E, P, spare, past)
    n_elements = elements.k0.size
    n_loads = loads.shape[0] - n_elements
    for level in range(E.shape[0]):
        for q in range(m):
            for i in range(m):
                flows.free[level, i, q] = E[level, i, q]
            for i in range(n_loads):
                for j in range(2):
                    flows.free[level, m + 2 * i + j, q] = P[level, i, j, q]
            for i in range(n_elements):
                for j in range(N_POWERS):
                    flows.rests[level, N_POWERS * i + j, q] = P[level, n_loads + i, j, q]
    project(elements, flows.free, flows.free_drifts)
    project(elements, flows.rests, flows.drifts)


@kernel
def follow_each(
    follow: Any, elements: Elements, sets: Sets, plant: Plant, steps: Steps,
    parts: tuple[FloatArray, FloatArray, Flows], motion: Motion, room: Room, tracks: Tracks, results: Results,
) -> None:  # fmt: skip
    """Results of every set; inf where the motion diverges.

    `follow` is the address of `path.follow`, and `parts` are as of `fill_structure`.
    """
    E, P, flows = parts
    u = sets.u
    n, walk = elements.k0.size, follow_at(follow)
    loads = np.empty((u.shape[1], 1))
    for i in range(sets.A.shape[0]):
        one = Elements(
            elements.nodes, elements.weights, elements.node_ends, sets.slopes[i], sets.viscosities[i], elements.steps,
            elements.rated, sets.parameters[i], elements.parameter_ends, elements.state_ends, elements.stretches,
            elements.stretch_ends,
        )  # fmt: skip
        A, rate = sets.A[i], sets.rates[i]
        base = steps.base
        if base == 0:
            base = max(1, math.ceil(steps.sample_time * rate / sets.phase))
        if i == 0 or not (same(A, sets.A[i - 1]) and same(sets.loads[i], sets.loads[i - 1])):
            fill_structure(one, A, sets.loads[i], rate, steps.sample_time / base, E, P, flows)
        row = u[min(i, u.shape[0] - 1)]
        for k in range(row.size):
            loads[k, 0] = sets.scales[i] * row[k]
        start_motion(one, sets.starts, sets.states[i], sets.x, motion)
        own = Plant(A, sets.loads[i], plant.damping, plant.directions, plant.pushing)
        divided = Steps(steps.sample_time, rate, base, steps.halvings, steps.tolerance)
        lost = walk(one, flows, own, divided, True, loads, motion, room, tracks)
        for q in range(motion.peaks.size):
            results.peaks[i, q] = math.inf if lost >= 0 else motion.peaks[q]
        for e in range(n):
            results.drifts[i, e] = math.inf if lost >= 0 else motion.carry[2, e]
            results.work[i, e] = math.inf if lost >= 0 else motion.work[2 + e]
            results.errors[i, e] = math.inf if lost >= 0 else motion.carry[4, e]
