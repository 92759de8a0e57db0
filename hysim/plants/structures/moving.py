"""The motion of a structure: tables of its samples and the signals that follow; the force of a loop is held."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.parallel import in_pieces
from hysim._basics.progress import along
from hysim.errors import SimulationError
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Steps, Tracks
from hysim.kernels.structure_loop import close
from hysim.kernels.structure_path import follow
from hysim.kernels.structure_pointers import addresses
from hysim.models.protocols import CompiledController, needed_time, positive_time
from hysim.plants.chain import Signals
from hysim.plants.stages import Amplifier, Sensor
from hysim.plants.structures import assembly
from hysim.plants.structures.assembly import AssembledStructure
from hysim.plants.structures.parts import parted

_IMBALANCE = 0.05  # share of the largest work that may be missing


class StructureState(NamedTuple):
    """State of a simulation: what moves along, `started` after the first sample, and the energies at the start."""

    motion: Motion
    started: bool
    stored: float


class MovingStructure(AssembledStructure):
    """A structure that moves sample by sample."""

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
            (n_samples, n_elements) [m], [N]; ``"peak_drift"``, ``"peak_force"``, ``"peak_displacement"``,
            ``"peak_acceleration"``, the largest sizes so far, those of drifts and displacements also between samples;
            and energies since the start [J]: ``"kinetic"``, ``"elastic"`` (of `stiffness`), ``"damping_loss"``,
            ``"input_work"``, ``"element_work"`` (n_samples, n_elements), which is stored and dissipated, and
            ``"dissipated"``, without what elastic unloading would return, force^2 / (2 k) with the slope k at the
            start; ``"imbalance"`` is the input less all others, the error of the method.
        """
        return self.advance(u, sample_time=sample_time)[0]

    def memories(self, u: npt.ArrayLike, sample_time: float) -> tuple[FloatArray, ...]:
        """State of each element's law at the samples of `u`, (n_samples, n_numbers) each: last input and memory."""
        states = self._followed(read_only(u, "u", ndim=1), sample_time, with_laws=True)[1].laws
        ends = np.cumsum([each.state.size for each in self.laws.steppers])[:-1]
        parts = np.split(states, ends, axis=1) if self.elements else []
        return tuple(part[:, place] for part, place in zip(parts, self.laws.places, strict=True))

    def start(self) -> StructureState:
        """The state before the first sample."""
        x = np.array(self.initial_state or np.zeros(2 * self.n_nodes))
        motion = assembly.motion_at(self.kernel_elements, self.laws, x, len(self.force_directions))
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
        inputs, room = np.ascontiguousarray(u[:, np.newaxis]), assembly.room_for(motion)

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
        A, loads, rates = assembly.linear_parts(self.matrices._replace(directions=directions[np.newaxis]))
        plant = Plant(A[0], loads[0], np.array(self.damping_matrix), np.array(directions), np.array(pushing))
        steps = assembly.steps_of(float(rates[0]), sample_time, self.substeps, self.tolerance)
        return self.kernel_elements, assembly.flows_of(self.kernel_elements, plant, steps), plant, steps

    def check_resolved(self, motion: Motion) -> None:
        """Refuse a motion with steps whose sweeps do not agree, which could not be divided further."""
        errors, peaks = motion.carry[4][np.newaxis], motion.peaks[np.newaxis, : len(self.elements)]
        apart = float(assembly.uncertainty(errors, peaks)[0])
        if not apart <= assembly.LEAST_CERTAIN:
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
            returned = np.where(slopes > 0.0, (force**2 - self._first_forces**2) / (2.0 * slopes), 0.0)
        imbalance = tracks.work[:, 0] - tracks.work[:, 1] - work.sum(axis=1) - (kinetic + elastic - state.stored)
        viscous = rate * self.viscosities
        signals = {
            "displacement": x[:, :n],
            "velocity": x[:, n:],
            "acceleration": self._accelerations(x, force, u),
            "drift": drift,
            "force": force + viscous,
            **assembly.peaks_by_name(tracks.peaks, len(self.elements), n),
            "kinetic": kinetic,
            "elastic": elastic,
            "damping_loss": tracks.work[:, 1],
            "input_work": tracks.work[:, 0],
            "element_work": work,
            "dissipated": work - returned,
            "imbalance": imbalance,
        }
        largest = float(np.abs(tracks.work).max(initial=0.0))
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


def moved(
    run: Callable[[slice, Tracks], int], n: int, motion: Motion, *, with_laws: bool = False
) -> tuple[int, Tracks]:
    """The first sample that is lost, or -1, and all `n` samples, which `run` computes piece by piece."""
    tracks = assembly.empty_tracks(n, motion, with_laws=with_laws)
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
        (address,), follow = addresses([controller.step], CONTROLLER), assembly.follow_address()
        inputs = np.column_stack([reference] if self.ground is None else [reference, self.ground])
        samples, room = np.empty((n, 3)), assembly.room_for(motion)

        def run(k: slice, rows: Tracks) -> int:
            lost = close(
                address, controller.parameters, controller.state, follow, *self.arguments,
                k.start == 0, self.weights, inputs[k], motion, room, samples[k], rows,
            )  # fmt: skip
            return int(lost)

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
