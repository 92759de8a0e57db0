"""A structure whose force is a controller's, held between samples."""

from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim._parallel import in_pieces
from hysim._progress import Progress
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.structures.layout import Motion, Plant, Tracks
from hysim.kernels.structures.loop import close
from hysim.kernels.structures.pointers import addresses
from hysim.models.protocols import CompiledController
from hysim.plants.structures import assembly
from hysim.plants.structures._moving import StructureState
from hysim.plants.structures.element import parted
from hysim.plants.structures.structure import Structure


class Controlled(NamedTuple):
    """Command before and after the controller's limits, output, each (n,), and all signals of the structure.

    They are those just before each new command. `lost` is the first sample that is not finite, or -1; the signals are
    empty then.
    """

    command: FloatArray
    drive: FloatArray
    y: FloatArray
    signals: dict[str, FloatArray]
    lost: int


class ControlledStructure:
    """A structure at a sample time [s], as a loop takes it; the force before the first sample is zero."""

    def __init__(self, structure: Structure, sample_time: float, ground_acceleration: FloatArray | None) -> None:
        if structure.excitation != "force":
            raise ValueError(
                'a structure in a loop is moved by the controller\'s force: its excitation must be "force", got '
                f'"{structure.excitation}"; an earthquake is given as ground_acceleration'
            )
        self.structure, self.ground = structure, ground_acceleration
        directions = [structure.force_directions[0]]
        if ground_acceleration is not None:
            directions.append(-structure.mass_matrix.sum(axis=1))
        A, loads, rates = assembly.linear_parts(structure.matrices._replace(directions=np.array([directions])))
        pushing = np.array([1.0, 0.0][: len(directions)])
        self.plant = Plant(A[0], loads[0], np.array(structure.damping_matrix), np.array(directions), pushing)
        self.steps = assembly.steps_of(float(rates[0]), sample_time, structure.substeps, structure.tolerance)
        self.weights = measured(structure)
        before = structure.start()
        self.begin = StructureState(before.motion._replace(loads=np.zeros(len(directions))), False, before.stored)

    @property
    def y0(self) -> float:
        """The output at the start."""
        motion = self.begin.motion
        return float(self.weights @ np.concatenate([motion.x, motion.carry[0], [0.0]]))

    def run(self, controller: CompiledController, reference: FloatArray, progress: Progress | None) -> Controlled:
        """The loop with a controller, whose state moves along."""
        n, motion = reference.size, Motion(*(part.copy() for part in self.begin.motion))
        elements, room = self.structure.kernel_elements, assembly.room_for(motion)
        flows = assembly.flows_of(elements, self.plant, self.steps)
        (address,), follow = addresses([controller.step], CONTROLLER), assembly.follow_address()
        inputs = np.column_stack([reference] if self.ground is None else [reference, self.ground])
        samples, tracks = np.empty((n, 3)), assembly.empty_tracks(n, motion)

        def run(k: slice) -> int:
            lost = close(
                address, controller.parameters, controller.state, follow, elements, flows, self.plant, self.steps,
                k.start == 0, self.weights, inputs[k], motion, room, samples[k], Tracks(*(part[k] for part in tracks)),
            )  # fmt: skip
            if progress is not None:
                progress(k.stop, n)
            return int(lost)

        with np.errstate(all="ignore"):
            lost = in_pieces(run, n)
        command, drive, y = samples.T.copy()
        if lost >= 0:
            return Controlled(command, drive, y, {}, lost)
        self.structure.check_resolved(motion)
        state = StructureState(motion, True, self.begin.stored)
        signals = self.structure.signals_of(np.append(0.0, drive[:-1]), state, tracks)
        return Controlled(command, drive, y, signals, lost)


def measured(structure: Structure) -> FloatArray:
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
