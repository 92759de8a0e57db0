"""A structure, or many of one kind, as the kernels take them, and the base class with its matrices and its motion.

The motion is a table of samples, from which the signals follow; the force of a loop is held.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from hysim._basics.frozen import Count, FloatArray, check_one_each, checked, read_only, whole_substeps
from hysim._basics.parallel import in_pieces
from hysim._basics.progress import along
from hysim.errors import SimulationError
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.stepping import START
from hysim.kernels.structure_ensembles import fill_slopes, fill_structure, start_motion
from hysim.kernels.structure_flows import N_POWERS
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Steps, Tracks, room_for
from hysim.kernels.structure_loop import close
from hysim.kernels.structure_path import follow
from hysim.kernels.structure_pointers import FOLLOW, addresses
from hysim.kernels.structure_sweeps import LEAST_DRIFT
from hysim.laws.friction.rated_law import RatedLaw
from hysim.models.compiled_step import startable
from hysim.models.protocols import CompiledController, Startable, Stretched, needed_time, positive_time
from hysim.plants.chain import Signals
from hysim.plants.stages import Amplifier, Sensor
from hysim.plants.structures.parts import OF_ELEMENTS, OF_NODES, ModalDamping, Rayleigh, dissipates, parted

PHASE = 2.0  # largest phase of the fastest mode in a base step: above it the sweeps of a slipping element diverge
HALVINGS = 12
LEAST_CERTAIN = 0.05  # share of the largest drift by which that of a step may be uncertain
OUTPUTS = (*OF_NODES, *OF_ELEMENTS)
_IMBALANCE = 0.05  # share of the largest work that may be missing


class Laws(NamedTuple):
    """Laws of a structure, with their steps, which the kernel knows by address; `rated` ones depend on drift rates."""

    steppers: tuple[Startable, ...]
    stretches: tuple[tuple[tuple[int, int], ...], ...]
    rated: tuple[bool, ...]

    @property
    def places(self) -> tuple[Any, ...]:
        """Places of each law's memory in its own state."""
        return tuple(np.concatenate([np.arange(first, first + n) for first, n in each]) for each in self.stretches)

    @property
    def parameters(self) -> FloatArray:
        return read_only(joined([each.parameters for each in self.steppers]), finite=False)

    @property
    def states(self) -> FloatArray:
        return read_only(joined([each.state for each in self.steppers]), finite=False)

    @property
    def starts(self) -> Any:
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

    The stiffness has the elastic slopes of the elements, the damping their dashpots, which are also apart,
    `viscosities` (n_sets, n_elements). `rows` (n_elements, n) give drifts, `directions` (n_sets, n_loads, n) forces.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    rows: FloatArray
    directions: FloatArray
    viscosities: FloatArray


def laws_of(models: Sequence[Any]) -> Laws:
    rated = tuple(isinstance(model, RatedLaw) for model in models)
    steppers = tuple(model.rated() if isinstance(model, RatedLaw) else startable(model) for model in models)
    stretches = tuple(
        model.memory_places if isinstance(model, Stretched) else ((0, each.state.size),)
        for model, each in zip(models, steppers, strict=True)
    )
    return Laws(steppers, stretches, rated)


def elements_of(laws: Laws, rows: FloatArray, slopes: FloatArray, viscosity: FloatArray) -> Elements:
    nodes = [np.flatnonzero(row) for row in rows]
    begins = zip(laws.stretches, laws.state_ends, strict=False)
    stretches = [np.array([(begin + a, n) for a, n in each], dtype=np.int64).reshape(-1, 2) for each, begin in begins]
    return Elements(
        nodes=joined(nodes, np.int64),
        weights=read_only(joined([row[each] for row, each in zip(rows, nodes, strict=True)])),
        node_ends=ends([each.size for each in nodes]),
        k0=read_only(slopes),
        viscosity=read_only(viscosity),
        steps=addresses([each.step for each in laws.steppers]),
        rated=np.array(laws.rated, dtype=float),
        parameters=laws.parameters,
        parameter_ends=laws.parameter_ends,
        state_ends=laws.state_ends,
        stretches=np.concatenate([np.zeros((0, 2), dtype=np.int64), *stretches]),
        stretch_ends=ends([len(each) for each in stretches]),
    )


def joined(parts: Sequence[Any], kind: Any = np.float64) -> Any:
    return np.concatenate([np.zeros(0, dtype=kind), *parts]).astype(kind)


def ends(sizes: Sequence[int]) -> Any:
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
    return A, loads, np.abs(np.linalg.eigvals(A)).max(axis=1)


def follow_address() -> Any:
    """The address of `hysim.kernels.structure_path.follow`, which is compiled where it has not been yet."""
    (address,) = addresses([follow], FOLLOW)
    return address


def empty_flows(halvings: int, m: int, n_loads: int, n_elements: int) -> tuple[FloatArray, FloatArray, Flows]:
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


def empty_motion(m: int, n_state: int, n_elements: int, n_loads: int = 1, *, with_accelerations: bool = True) -> Motion:
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
    x, carry, peaks, work = (np.empty((n, *part.shape)) for part in (motion.x, motion.carry, motion.peaks, motion.work))
    return Tracks(x, carry, peaks, work, np.empty((n if with_laws else 0, motion.laws.size)))


def peaks_by_name(peaks: FloatArray, n_elements: int, n_nodes: int) -> dict[str, FloatArray]:
    """Largest sizes by their names, of rows (n, n_peaks) of `Motion.peaks`."""
    parts = np.split(peaks, np.cumsum([n_elements, n_elements, n_nodes]), axis=1)
    return dict(zip(("peak_drift", "peak_force", "peak_displacement", "peak_acceleration"), parts, strict=True))


def uncertainty(errors: FloatArray, peaks: FloatArray) -> FloatArray:
    """Largest error of a drift in one step as a share of its size, (n_sets,), from rows (n_sets, n_elements)."""
    sizes = np.maximum(peaks, LEAST_DRIFT * peaks.max(axis=1, initial=0.0, keepdims=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.nan_to_num(errors / sizes, nan=0.0, posinf=np.inf)
    return np.asarray(shares.max(axis=1, initial=0.0))


class StructureState(NamedTuple):
    """State of a simulation: what moves along, `started` after the first sample, and the energies at the start."""

    motion: Motion
    started: bool
    stored: float


@checked
class MovingStructure:
    """Masses on elements that move sample by sample: their matrices, small motions and the places of outputs."""

    mass: FloatArray
    damping: Any = 0.0
    stiffness: FloatArray = 0.0  # type: ignore[assignment]
    elements: Any = ()
    excitation: Literal["base", "force"] = "base"
    influence: tuple[float, ...] = ()
    output: str = "displacement"
    substeps: Count | None = None
    tolerance: float = 1e-8
    initial_state: tuple[float, ...] = ()

    @cached_property
    def n_nodes(self) -> int:
        """Number of masses."""
        damping = () if isinstance(self.damping, Rayleigh | ModalDamping) else np.shape(self.damping)
        shapes = (np.shape(self.mass), damping, np.shape(self.stiffness))
        return int(max([1, *(shape[0] for shape in shapes if shape), *(each.highest_node for each in self.elements)]))

    @cached_property
    def mass_matrix(self) -> FloatArray:
        """Mass, shape (n, n) [kg]."""
        return _matrix(self.mass, "mass", self.n_nodes)

    @cached_property
    def stiffness_matrix(self) -> FloatArray:
        """Linear stiffness without the elements, shape (n, n) [N/m]."""
        return _matrix(self.stiffness, "stiffness", self.n_nodes)

    @cached_property
    def drift_matrix(self) -> FloatArray:
        """Drifts by displacements, shape (n_elements, n)."""
        rows = [element.drift_row(self.n_nodes) for element in self.elements]
        return read_only(np.array(rows).reshape(-1, self.n_nodes))

    @cached_property
    def laws(self) -> Laws:
        """Steps and memories of the elements, without their dashpots."""
        return laws_of([parted(element.law).law for element in self.elements])

    @cached_property
    def elastic_slopes(self) -> FloatArray:
        """Slope of each element at its start, zero where it falls in one direction, shape (n_elements,) [N/m]."""
        rows = (read_only(each[np.newaxis], finite=False) for each in (self.laws.parameters, self.laws.states))
        return read_only(self.laws.slopes(*rows)[0])

    @cached_property
    def initial_stiffness(self) -> FloatArray:
        """Stiffness with the elastic slopes of the elements, shape (n, n) [N/m]."""
        rows = self.drift_matrix
        return read_only(self.stiffness_matrix + rows.T @ (self.elastic_slopes[:, np.newaxis] * rows))

    @cached_property
    def own_damping(self) -> FloatArray:
        """Damping without the dashpots of the elements, shape (n, n) [N s/m]."""
        if isinstance(self.damping, Rayleigh | ModalDamping):
            return read_only(self.damping.matrix(self.mass_matrix, self.initial_stiffness))
        return _matrix(self.damping, "damping", self.n_nodes)

    @cached_property
    def viscosities(self) -> FloatArray:
        """Coefficient of each element's dashpots, shape (n_elements,) [N s/m]."""
        return read_only([parted(element.law).viscosity for element in self.elements])

    @cached_property
    def damping_matrix(self) -> FloatArray:
        """Damping with the dashpots of the elements, shape (n, n) [N s/m]."""
        rows = self.drift_matrix
        return read_only(self.own_damping + rows.T @ (self.viscosities[:, np.newaxis] * rows))

    @cached_property
    def force_directions(self) -> FloatArray:
        """Force at each mass under an input of one, shape (1, n)."""
        if self.excitation == "base":
            return read_only(-(self.mass_matrix @ np.array(self.influence or np.ones(self.n_nodes)))[np.newaxis])
        last = np.arange(self.n_nodes) == self.n_nodes - 1
        return read_only(np.array(self.influence or last.astype(float))[np.newaxis])

    @cached_property
    def matrices(self) -> Matrices:
        """The linear part, as one row."""
        parts = (self.mass_matrix, self.damping_matrix, self.initial_stiffness, self.force_directions, self.viscosities)
        mass, damping, stiffness, directions, viscosities = (part[np.newaxis] for part in parts)
        return Matrices(mass, damping, stiffness, self.drift_matrix, directions, viscosities)

    @cached_property
    def kernel_elements(self) -> Elements:
        return elements_of(self.laws, self.drift_matrix, self.elastic_slopes, self.viscosities)

    @property
    def fastest_rate(self) -> float:
        """Rate of the fastest mode at the start [rad/s]."""
        return float(linear_parts(self.matrices)[2][0])

    def dissipative(self, strokes: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each element is no source of energy in cycles between plus and minus its stroke [m]."""
        pairs = zip(self.elements, strokes.tolist(), strict=True)
        return np.array([dissipates(element.law, stroke) for element, stroke in pairs])

    @property
    def widths(self) -> dict[str, int]:
        """Number of columns of each signal."""
        return {name: self._column_count(name) for name in OUTPUTS}

    def place_of(self, output: str) -> tuple[str, int]:
        """Name and column of an output; ValueError if there is none of this name."""
        name, _, place = output.partition(".")
        first, count = int(name not in OF_ELEMENTS), self._column_count(name)
        if name not in OUTPUTS or not (place.isdecimal() or not place):
            raise ValueError(f'output must be a name such as "displacement" or "drift.0", got {output!r}')
        column = int(place) - first if place else count - 1
        if not 0 <= column < count:
            raise ValueError(f"output {output!r} names none of the {count} {'elements' if not first else 'masses'}")
        return name, column

    def _column_count(self, signal: str) -> int:
        return len(self.elements) if signal in OF_ELEMENTS else self.n_nodes

    def periods(self) -> FloatArray:
        """Periods (n,) [s] of small motions at the start, longest first, inf if free; ValueError if one is unstable."""
        squares = eigh(self.initial_stiffness, self.mass_matrix, eigvals_only=True)
        if squares[0] < -1e-9 * np.abs(squares).max():
            raise ValueError("the stiffness at the start is negative: small motions have no periods")
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * np.pi / np.sqrt(np.maximum(squares, 0.0)))

    def modes(self) -> FloatArray:
        """Shapes (n, n) of small motions, one a column in the order of `periods`, with modal masses of one."""
        shapes = eigh(self.initial_stiffness, self.mass_matrix)[1]
        largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(self.n_nodes)]
        return np.asarray(shapes * np.sign(largest))

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Output (n_samples,) that `output` names, at the samples of an input that is linear between them.

        `u` (n_samples,) is the acceleration of the base [m/s^2] or a force [N], whose samples are `sample_time` apart
        [s]; at the first one the structure has its initial state. Raises SimulationError with the time if the motion
        diverges or cannot be resolved; ValueError if `u` is not finite or has several axes, or sample_time <= 0.
        """
        return self.signals(u, sample_time)["y"]

    def signals(self, u: npt.ArrayLike, sample_time: float) -> dict[str, FloatArray]:
        """Every signal at the samples of `u`, by name; arguments and errors as of `response`.

        Returns
        -------
        mapping
            ``"y"``; ``"displacement"``, ``"velocity"`` (n_samples, n), relative to the ground [m], [m/s];
            ``"acceleration"``, absolute under a moving base of influence 1 [m/s^2]; ``"drift"``, ``"force"``
            (n_samples, n_elements) [m], [N], with dashpots; ``"peak_drift"``, ``"peak_force"``,
            ``"peak_displacement"``, ``"peak_acceleration"``, the largest sizes so far, those of drifts and
            displacements also between samples; and energies since the start [J]: ``"kinetic"``, ``"elastic"`` (of
            `stiffness`), ``"damping_loss"`` (of `damping`), ``"input_work"``, ``"element_work"``
            (n_samples, n_elements), that of ``"force"``, which is stored and dissipated, and ``"dissipated"``, without
            what elastic unloading would return, force^2 / (2 k) of the force without dashpots and the slope k at the
            start; ``"imbalance"``, an error, is the input less kinetic and elastic energy, damping_loss, element_work.
        """
        return self.advance(u, sample_time=sample_time)[0]

    def memories(self, u: npt.ArrayLike, sample_time: float) -> tuple[FloatArray, ...]:
        """State of each element's law at the samples of `u`, (n_samples, n_numbers) each: last input and memory."""
        states = self._followed(read_only(u, "u", ndim=1), sample_time, with_laws=True)[1].laws
        parts = np.split(states, self.laws.state_ends[1:-1], axis=1) if self.elements else []
        return tuple(part[:, place] for part, place in zip(parts, self.laws.places, strict=True))

    def start(self) -> StructureState:
        """The state before the first sample."""
        x = np.array(self.initial_state or np.zeros(2 * self.n_nodes))
        motion = empty_motion(x.size, self.laws.states.size, len(self.elements), len(self.force_directions))
        with np.errstate(all="ignore"):
            start_motion(self.kernel_elements, self.laws.starts, self.laws.states, read_only(x), motion)
        return StructureState(motion, False, float(np.sum(self._energies(x[np.newaxis]))))

    def advance(
        self,
        u: npt.ArrayLike,
        state: StructureState | None = None,
        *,
        sample_time: float | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> tuple[dict[str, FloatArray], StructureState]:
        """As `signals`, continued from `state` with the bits of one input, and the state after the last sample."""
        inputs = read_only(u, "u", ndim=1)
        with along(progress):
            begun, tracks = self._followed(inputs, needed_time(self, sample_time), state)
        return self.signals_of(inputs, begun, tracks), begun

    def _followed(
        self, u: FloatArray, sample_time: float, state: StructureState | None = None, *, with_laws: bool = False
    ) -> tuple[StructureState, Tracks]:
        positive_time(sample_time)
        before = state or self.start()
        motion = Motion(*(part.copy() for part in before.motion))
        arguments = self.kernel_arguments(self.force_directions, [float(self.excitation == "force")], sample_time)
        inputs, room = np.ascontiguousarray(u[:, np.newaxis]), room_for(motion)

        def run(k: slice, rows: Tracks) -> int:
            is_first = k.start == 0 and not before.started
            return int(follow(*arguments, is_first, inputs[k], motion, room, rows))

        lost, tracks = moved(run, u.size, motion, with_laws=with_laws)
        if lost >= 0:
            hint = "; if it should not, use more substeps, or substeps=None" if self.substeps else ""
            raise SimulationError(f"the motion diverges at t = {lost * sample_time:g}{hint}")
        self.check_resolved(motion)
        return StructureState(motion, before.started or u.size > 0, before.stored), tracks

    def kernel_arguments(
        self, directions: FloatArray, pushing: Sequence[float], sample_time: float
    ) -> tuple[Elements, Flows, Plant, Steps]:
        """Tables by which the kernels move the structure, under loads in the directions (n_loads, n_nodes)."""
        A, loads, rates = linear_parts(self.matrices._replace(directions=directions[np.newaxis]))
        plant = Plant(A[0], loads[0], np.array(self.own_damping), np.array(directions), np.array(pushing))
        n, halvings = self.substeps, 0
        if n is None:  # by the tolerance, from the phase on with which the sweeps converge
            n, halvings = whole_substeps(sample_time * float(rates[0]) / PHASE), HALVINGS
        steps = Steps(float(sample_time), float(rates[0]), n, halvings, self.tolerance)
        E, P, flows = empty_flows(halvings, len(A[0]), len(directions), len(self.elements))
        fill_structure(self.kernel_elements, A[0], loads[0], steps.rate, steps.sample_time / n, E, P, flows)
        return self.kernel_elements, flows, plant, steps

    def check_resolved(self, motion: Motion) -> None:
        """Refuse a motion with steps whose sweeps do not agree, which could not be divided further."""
        errors, peaks = motion.carry[4][np.newaxis], motion.peaks[np.newaxis, : len(self.elements)]
        apart = float(uncertainty(errors, peaks)[0])
        if not apart <= LEAST_CERTAIN:
            raise SimulationError(
                f"the motion is not resolved: the drift of a step is uncertain by {apart:.2g} of the largest one; "
                + ("use more substeps, or substeps=None" if self.substeps else "use a smaller sample_time")
            )

    def signals_of(self, u: FloatArray, state: StructureState, tracks: Tracks) -> dict[str, FloatArray]:
        """Signals by name of tracks under the inputs `u`, which end in `state`."""
        n, x, (force, _, drift, rate, _) = self.n_nodes, tracks.x, np.moveaxis(tracks.carry, 1, 0)
        kinetic, elastic = self._energies(x)
        work = tracks.work[:, 2:]
        slopes = self.elastic_slopes
        with np.errstate(divide="ignore", invalid="ignore"):
            returned = np.where(slopes != 0.0, (force**2 - self._first_forces**2) / (2.0 * slopes), 0.0)
        imbalance = tracks.work[:, 0] - tracks.work[:, 1] - work.sum(axis=1) - (kinetic + elastic - state.stored)
        viscous = rate * self.viscosities
        signals = {
            "displacement": x[:, :n],
            "velocity": x[:, n:],
            "acceleration": self._accelerations(x, force, u),
            "drift": drift,
            "force": force + viscous,
            **peaks_by_name(tracks.peaks, len(self.elements), n),
            "kinetic": kinetic,
            "elastic": elastic,
            "damping_loss": tracks.work[:, 1],
            "input_work": tracks.work[:, 0],
            "element_work": work,
            "dissipated": work - returned,
            "imbalance": imbalance,
        }
        largest = float(np.abs(np.append(tracks.work, [kinetic, elastic])).max(initial=0.0))
        if (wrong := float(np.abs(imbalance).max(initial=0.0))) > _IMBALANCE * largest:
            raise SimulationError(
                f"the motion is not resolved: {wrong / largest:.2g} of the energy is missing; "
                + ("use more substeps, or substeps=None" if self.substeps else "use a smaller tolerance")
            )
        name, place = self.place_of(self.output)
        arrays = {"y": signals[name][:, place], **signals}
        return {each: np.ascontiguousarray(values) for each, values in arrays.items()}

    def _energies(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        n = self.n_nodes
        kinetic = 0.5 * np.einsum("ki,ij,kj->k", x[:, n:], self.mass_matrix, x[:, n:])
        elastic = 0.5 * np.einsum("ki,ij,kj->k", x[:, :n], self.stiffness_matrix, x[:, :n])
        return kinetic, elastic

    @cached_property
    def _first_forces(self) -> FloatArray:
        return np.asarray(self.start().motion.carry[0])

    def _accelerations(self, x: FloatArray, force: FloatArray, u: FloatArray) -> FloatArray:
        """Accelerations (k, n): under a moving base without that of the base, which is added to have absolute ones."""
        n = self.n_nodes
        inner = x[:, :n] @ self.stiffness_matrix.T + x[:, n:] @ self.damping_matrix.T + force @ self.drift_matrix
        outer = u[:, np.newaxis] * self.force_directions if self.excitation == "force" else 0.0
        return np.asarray(np.linalg.solve(self.mass_matrix, (outer - inner).T).T)


def _matrix(values: FloatArray, name: str, n_nodes: int) -> FloatArray:
    """A number for each mass, one for all, or a symmetric matrix, as a matrix."""
    if values.ndim < 2:
        if values.ndim:
            check_one_each(name, values, n_nodes, "masses")
        return read_only(np.diag(np.broadcast_to(values, n_nodes)))
    if values.shape != (n_nodes, n_nodes):
        raise ValueError(f"{name} must have the shape ({n_nodes}, {n_nodes}), got {values.shape}")
    if not np.allclose(values, values.T, rtol=1e-12, atol=1e-12 * np.abs(values).max()):
        raise ValueError(f"{name} must be a symmetric matrix")
    return read_only(0.5 * (values + values.T))


def moved(
    run: Callable[[slice, Tracks], int], n: int, motion: Motion, *, with_laws: bool = False
) -> tuple[int, Tracks]:
    """The first sample that is lost, or -1, and all `n` samples, which `run` computes piece by piece."""
    tracks = empty_tracks(n, motion, with_laws=with_laws)
    with np.errstate(all="ignore"):
        return in_pieces(lambda k: run(k, Tracks(*(part[k] for part in tracks))), n), tracks


class ControlledStructure:
    """A structure at a sample time [s], in place of a `Chain`; the force before the first sample is zero."""

    amplifier, hysteresis, sensor, delay = Amplifier(), None, Sensor(), 0.0

    def __init__(self, structure: MovingStructure, sample_time: float, ground_acceleration: FloatArray | None) -> None:
        if structure.excitation != "force":
            raise ValueError(
                'a structure in a loop is moved by the controller\'s force: its excitation must be "force", got '
                f'"{structure.excitation}"; an earthquake is given as ground_acceleration'
            )
        self.structure, self.ground = structure, ground_acceleration
        directions = [structure.force_directions[0]]
        if ground_acceleration is not None:
            directions.append(-structure.mass_matrix.sum(axis=1))
        pushing = [1.0, 0.0][: len(directions)]
        self.arguments = structure.kernel_arguments(np.array(directions), pushing, sample_time)
        self.weights = measured(structure)
        before = structure.start()
        self.begin = StructureState(before.motion._replace(loads=np.zeros(len(directions))), False, before.stored)
        self.substeps = structure.substeps

    def rest(self, u0: float) -> StructureState:
        return self.begin

    def displacement(self, state: StructureState) -> float:
        return float(self.weights @ np.concatenate([state.motion.x, state.motion.carry[0], [0.0]]))

    def run(
        self, controller: CompiledController, state: StructureState, reference: FloatArray
    ) -> tuple[Signals, StructureState]:
        """As `Chain.run`; the signals are those just before each new command."""
        n, motion = reference.size, Motion(*(part.copy() for part in state.motion))
        (address,), follow = addresses([controller.step], CONTROLLER), follow_address()
        stepped = address, controller.parameters, controller.state
        inputs = np.column_stack([reference] if self.ground is None else [reference, self.ground])
        samples, room = np.empty((n, 3)), room_for(motion)

        def run(k: slice, rows: Tracks) -> int:
            begins = k.start == 0
            return int(
                close(stepped, follow, self.arguments, begins, self.weights, inputs[k], motion, room, samples[k], rows)
            )

        lost, tracks = moved(run, n, motion)
        command, drive, y = samples.T.copy()
        end = StructureState(motion, True, state.stored)
        signals = Signals(command, drive, drive, drive, tracks.carry, y, y, lost)
        if lost >= 0:
            return signals, end
        self.structure.check_resolved(motion)
        others = self.structure.signals_of(np.append(0.0, drive[:-1]), end, tracks)
        del others["y"]
        return signals._replace(others=others), end


def measured(structure: MovingStructure) -> FloatArray:
    """Weights of the output by displacements, velocities, forces of the elements without dashpots, and the force."""
    name, place = structure.place_of(structure.output)
    n, rows = structure.n_nodes, structure.drift_matrix
    parts: dict[str, Any] = {"x": np.zeros(n), "v": np.zeros(n), "f": np.zeros(len(rows)), "u": np.zeros(1)}
    if name == "displacement":
        parts["x"][place] = 1.0
    elif name == "velocity":
        parts["v"][place] = 1.0
    elif name == "drift":
        parts["x"] = rows[place]
    elif name == "force":
        parts["f"][place] = 1.0
        parts["v"] = parted(structure.elements[place].law).viscosity * rows[place]
    else:
        forces = (-structure.stiffness_matrix, -structure.damping_matrix, -rows.T, structure.force_directions.T)
        inverse = np.linalg.inv(structure.mass_matrix)[place]
        parts = dict(zip(parts, (inverse @ force for force in forces), strict=True))
    return np.concatenate(list(parts.values()))
