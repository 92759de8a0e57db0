"""A structure as its kernels take it: tables of numbers, and room for their work."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels.structure_flows import N_POWERS
from hysim.kernels.structure_moments import IntArray

BoolArray = npt.NDArray[np.bool_]


class Elements(NamedTuple):
    """Elements with memory, one after the other.

    Element e has the nodes ``nodes[node_ends[e]:node_ends[e + 1]]`` with the weights of the drift, its elastic slope
    ``k0[e]``, its dashpots' coefficient ``viscosity[e]``, the address of its step, which leaves these out, in
    ``steps[e]``; likewise its parameters, its state, and the stretches of the state that are memory. Where ``rated[e]``
    is 1, not 0, the step depends on the rate of the drift, and its state begins as `hysim.kernels.friction_rates` says.
    """

    nodes: IntArray
    weights: FloatArray
    node_ends: IntArray
    k0: FloatArray
    viscosity: FloatArray
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

    `x` is the state (x, v), `laws` are the laws' states, `carry` is (5, n_elements): force without dashpots, slope of
    the rest over time, drift, its rate, and the largest error of the drift in a step. `peaks` are the largest sizes so
    far of drifts, forces with dashpots, displacements and, where there is room, accelerations; `work` is that of the
    loads, of the damping and of each element; `division`, (1,), the present number of halvings; `loads` the last ones.
    """

    x: FloatArray
    laws: FloatArray
    carry: FloatArray
    peaks: FloatArray
    work: FloatArray
    division: FloatArray
    loads: FloatArray


class Tracks(NamedTuple):
    """Tables of the samples, a row each; with one row the last sample only, without rows no sample."""

    x: FloatArray
    carry: FloatArray
    peaks: FloatArray
    work: FloatArray
    laws: FloatArray


class Plant(NamedTuple):
    """The linear part: A, (m, m), and the loads, (n_loads + n_elements, m), of s' = A s + loads, for accelerations.

    `damping`, without dashpots, is (n_nodes, n_nodes) and `directions` (n_loads, n_nodes), for energies; the latter has
    no rows where these are not wanted. `pushing`, (n_loads,), is 1 for a force, and 0 for a moving base, whose
    acceleration is not counted.
    """

    A: FloatArray
    loads: FloatArray
    damping: FloatArray
    directions: FloatArray
    pushing: FloatArray


class Steps(NamedTuple):
    """How a sample is divided.

    Length [s], rate of the fastest mode [1/s], equal base steps, most halvings of these, tolerance (share of drifts).
    """

    sample_time: float
    rate: float
    base: int
    halvings: int
    tolerance: float


def room_for(motion: Motion) -> Room:
    """Room for the work on a structure."""
    m, n_elements, n_loads = motion.x.size, motion.carry.shape[1], motion.loads.size
    shapes = {
        "inputs": m + 2 * n_loads,
        **dict.fromkeys(("free_drifts", "free_middle", "drifts", "middle", "before"), 2 * n_elements),
        **dict.fromkeys(("scales", "own", "allowed", "errors", "forces"), n_elements),
        **dict.fromkeys(("rest", "half"), N_POWERS * n_elements),
        "sums": (n_elements, 9),
        **dict.fromkeys(("saved", "spare"), motion.laws.size),
        **dict.fromkeys(("end", "point", "now"), m),
        "speeds": (2, m // 2),
        "loads": (2, n_loads),
    }
    vectors = {name: np.zeros(shape) for name, shape in shapes.items()}
    return Room(**vectors, is_at_end=np.zeros(1, dtype=np.bool_))
