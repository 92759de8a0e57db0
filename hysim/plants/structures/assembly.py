"""A structure, or many of one kind, as the kernels take them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray, read_only, whole_substeps
from hysim.kernels.stepping import START
from hysim.kernels.structures.ensembles import fill_slopes, fill_structure, start_motion
from hysim.kernels.structures.flows import N_POWERS
from hysim.kernels.structures.layout import Elements, Flows, Motion, Plant, Room, Steps, Tracks, make_room
from hysim.kernels.structures.path import follow
from hysim.kernels.structures.pointers import FOLLOW, addresses
from hysim.kernels.structures.sweeps import LEAST_DRIFT
from hysim.models.compiled_step import startable
from hysim.models.protocols import Rated, Startable, Stretched

PHASE = 2.0  # largest phase of the fastest mode in a base step: above it the sweeps of a slipping element diverge
HALVINGS = 12
LEAST_CERTAIN = 0.05  # share of the largest drift by which that of a step may be uncertain


class Laws(NamedTuple):
    """The laws of a structure; their steps are held here, since the kernel knows the addresses only.

    Those that are `rated` depend on the rate of the drift.
    """

    steppers: tuple[Startable, ...]
    stretches: tuple[tuple[tuple[int, int], ...], ...]
    rated: tuple[bool, ...]

    @property
    def places(self) -> tuple[Any, ...]:
        """Places of each law's memory in its own state."""
        return tuple(np.concatenate([np.arange(first, first + n) for first, n in each]) for each in self.stretches)

    @property
    def parameters(self) -> FloatArray:
        """Parameters of all laws, one behind the other."""
        return read_only(joined([each.parameters for each in self.steppers]), finite=False)

    @property
    def states(self) -> FloatArray:
        """States of all laws before their start."""
        return read_only(joined([each.state for each in self.steppers]), finite=False)

    @property
    def starts(self) -> Any:
        """Addresses of the starts."""
        return addresses([each.start for each in self.steppers], START)

    def slopes(self, parameters: FloatArray, states: FloatArray) -> FloatArray:
        """Elastic slopes at the start, (n_sets, n_elements), for rows of parameters and states."""
        slopes = np.zeros((len(parameters), len(self.steppers)))
        with np.errstate(all="ignore"):
            fill_slopes(
                addresses([each.step for each in self.steppers]), self.starts, parameters, self.parameter_ends,
                states, self.state_ends, slopes,
            )  # fmt: skip
        return np.nan_to_num(slopes, nan=0.0, posinf=0.0)

    @property
    def parameter_ends(self) -> Any:
        """Places at which the parameters of the laws begin, and the end."""
        return ends([each.parameters.size for each in self.steppers])

    @property
    def state_ends(self) -> Any:
        """Places at which the states of the laws begin, and the end."""
        return ends([each.state.size for each in self.steppers])


class Matrices(NamedTuple):
    """Linear parts, one structure a row: mass, damping and stiffness (n_sets, n, n).

    The stiffness has the elastic slopes of the elements. `rows` is (n_elements, n), the drifts; `directions`
    (n_sets, n_loads, n), the forces of unit loads.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    rows: FloatArray
    directions: FloatArray


def laws_of(models: Sequence[Any]) -> Laws:
    """Steps and memories of laws."""
    rated = tuple(isinstance(model, Rated) for model in models)
    steppers = tuple(model.rated() if isinstance(model, Rated) else startable(model) for model in models)
    stretches = tuple(
        model.memory_places if isinstance(model, Stretched) else ((0, each.state.size),)
        for model, each in zip(models, steppers, strict=True)
    )
    return Laws(steppers, stretches, rated)


def elements_of(laws: Laws, rows: FloatArray, slopes: FloatArray) -> Elements:
    """The elements as the kernel takes them."""
    nodes = [np.flatnonzero(row) for row in rows]
    begins = zip(laws.stretches, laws.state_ends, strict=False)
    stretches = [np.array([(begin + a, n) for a, n in each], dtype=np.int64).reshape(-1, 2) for each, begin in begins]
    return Elements(
        nodes=joined(nodes, np.int64),
        weights=read_only(joined([row[each] for row, each in zip(rows, nodes, strict=True)])),
        node_ends=ends([each.size for each in nodes]),
        k0=read_only(slopes),
        steps=addresses([each.step for each in laws.steppers]),
        rated=np.array(laws.rated, dtype=float),
        parameters=laws.parameters,
        parameter_ends=laws.parameter_ends,
        state_ends=laws.state_ends,
        stretches=np.concatenate([np.zeros((0, 2), dtype=np.int64), *stretches]),
        stretch_ends=ends([len(each) for each in stretches]),
    )


def joined(parts: Sequence[Any], kind: Any = np.float64) -> Any:
    """Vectors one behind the other."""
    return np.concatenate([np.zeros(0, dtype=kind), *parts]).astype(kind)


def ends(sizes: Sequence[int]) -> Any:
    """Places at which parts of these sizes begin, and the end of the last one."""
    return np.concatenate([[0], np.cumsum(np.array(sizes, dtype=np.int64))]).astype(np.int64)


def linear_parts(matrices: Matrices) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A (n_sets, 2 n, 2 n), the loads (n_sets, n_loads + n_elements, 2 n), and rates of the fastest modes (n_sets,)."""
    n_sets, n, _ = matrices.stiffness.shape
    mass = np.broadcast_to(matrices.mass, (n_sets, n, n))
    rows = np.broadcast_to(matrices.rows, (n_sets, *matrices.rows.shape))
    forces = np.concatenate([np.broadcast_to(matrices.directions, (n_sets, *matrices.directions.shape[1:])), rows], 1)
    A, loads = np.zeros((n_sets, 2 * n, 2 * n)), np.zeros((n_sets, forces.shape[1], 2 * n))
    A[:, :n, n:] = np.eye(n)
    with np.errstate(over="ignore", invalid="ignore"):
        A[:, n:, :n] = -np.linalg.solve(mass, matrices.stiffness)
        A[:, n:, n:] = -np.linalg.solve(mass, np.broadcast_to(matrices.damping, (n_sets, n, n)))
    if not np.isfinite(A).all():
        raise ValueError("stiffness or damping over mass is beyond the largest number: check their units")
    loads[:, :, n:] = np.swapaxes(np.linalg.solve(mass, np.swapaxes(forces, 1, 2)), 1, 2)
    rates = np.abs(np.linalg.eigvals(A)).max(axis=1)
    return A, loads, rates


def follow_address() -> Any:
    """The address of `hysim.kernels.structures.path.follow`, which is compiled where it has not been yet."""
    (address,) = addresses([follow], FOLLOW)
    return address


def steps_of(rate: float, sample_time: float, substeps: int | None, tolerance: float) -> Steps:
    """How a sample is divided: as told, or by the tolerance from the phase on which the sweeps converge with."""
    if substeps is not None:
        return Steps(float(sample_time), rate, substeps, 0, tolerance)
    return Steps(float(sample_time), rate, whole_substeps(sample_time * rate / PHASE), HALVINGS, tolerance)


def empty_flows(halvings: int, m: int, n_loads: int, n_elements: int) -> tuple[FloatArray, FloatArray, Flows]:
    """Room for `fill_structure`: two tables of its own, and the flows."""
    n_levels, n_free = halvings + 2, m + 2 * n_loads
    return (
        np.empty((n_levels, m, m)),
        np.empty((n_levels, n_loads + n_elements, N_POWERS, m)),
        Flows(
            np.empty((n_levels, n_free, m)),
            np.empty((n_levels, N_POWERS * n_elements, m)),
            np.empty((n_levels, n_free, 2 * n_elements)),
            np.empty((n_levels, N_POWERS * n_elements, 2 * n_elements)),
        ),
    )


def flows_of(elements: Elements, plant: Plant, steps: Steps) -> Flows:
    """The flows over the base step and its parts."""
    n_elements = elements.k0.size
    E, P, flows = empty_flows(steps.halvings, len(plant.A), len(plant.loads) - n_elements, n_elements)
    fill_structure(elements, plant.A, plant.loads, steps.rate, steps.sample_time / steps.base, E, P, flows)
    return flows


def empty_motion(m: int, n_state: int, n_elements: int, n_loads: int = 1, *, with_accelerations: bool = True) -> Motion:
    """Room for what moves."""
    return Motion(
        x=np.zeros(m),
        laws=np.zeros(n_state),
        carry=np.zeros((5, n_elements)),
        peaks=np.zeros(2 * n_elements + (m if with_accelerations else m // 2)),
        work=np.zeros(2 + n_elements),
        division=np.zeros(1),
        loads=np.zeros(n_loads),
    )


def empty_tracks(n: int, motion: Motion, *, with_laws: bool = False) -> Tracks:
    """Room for `n` samples."""
    x, carry, peaks, work = (np.empty((n, *part.shape)) for part in (motion.x, motion.carry, motion.peaks, motion.work))
    return Tracks(x, carry, peaks, work, np.empty((n if with_laws else 0, motion.laws.size)))


def room_for(motion: Motion) -> Room:
    """Room for the work of the kernel."""
    return make_room(motion.carry.shape[1], motion.x.size, motion.laws.size, motion.loads.size)


def motion_at(elements: Elements, laws: Laws, x: FloatArray, n_loads: int) -> Motion:
    """The motion at its start, every law at its first sample."""
    motion = empty_motion(len(x), laws.states.size, len(laws.steppers), n_loads)
    with np.errstate(all="ignore"):
        start_motion(elements, laws.starts, laws.states, read_only(x), motion)
    return motion


def uncertainty(errors: FloatArray, peaks: FloatArray) -> FloatArray:
    """Largest error of a drift in one step as a share of its size, (n_sets,), from rows (n_sets, n_elements)."""
    sizes = np.maximum(peaks, LEAST_DRIFT * peaks.max(axis=1, initial=0.0, keepdims=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.nan_to_num(errors / sizes, nan=0.0, posinf=np.inf)
    return np.asarray(shares.max(axis=1, initial=0.0))
