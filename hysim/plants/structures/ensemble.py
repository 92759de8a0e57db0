"""Many structures that differ in numbers, or in their inputs: one number or a few of each."""

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_not_negative, check_positive, read_only
from hysim.kernels.structure_ensembles import Results, Sets, follow_each
from hysim.kernels.structure_layout import Plant, Steps, room_for
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.law import Law
from hysim.models.parts import own
from hysim.models.protocols import Startable
from hysim.plants.structures import assembly
from hysim.plants.structures.parts import MATRICES, ModalDamping, Rayleigh, expanded, modal_damping

Reduction = Literal[
    "peak_drift", "residual_drift", "energy", "peak_force", "peak_displacement", "peak_acceleration"
]  # fmt: skip

REDUCTIONS = get_args(Reduction)
AT_ONCE = 2_000_000  # samples that a call of the kernel computes, or one structure

_Stack = tuple[assembly.Laws, FloatArray, FloatArray, FloatArray, assembly.Matrices]
"""Structures one a row: their laws' kernels, parameters, states and elastic slopes, and their linear parts."""


def values_by_name(structure: Any, values: Mapping[str, npt.ArrayLike] | npt.ArrayLike) -> dict[str, FloatArray]:
    """Columns (n_sets,) by names without wildcards."""
    named: Mapping[str, Any] = values if isinstance(values, Mapping) else {"scale": values}
    scales = {name: column for name, column in named.items() if name == "scale"}
    others = {name: column for name, column in named.items() if name != "scale"}
    return {
        name: read_only(np.atleast_1d(np.asarray(column, dtype=float)), name, ndim=1)
        for name, column in {**scales, **expanded(structure.scalars, others)}.items()
    }


def reduced(
    structure: Any, values: Mapping[str, FloatArray], u: FloatArray, n_sets: int, sample_time: float, reduce: Reduction
) -> FloatArray:
    laws, parameters, states, slopes, matrices = _stacked(structure, values, n_sets)
    A, loads, rates = assembly.linear_parts(matrices)
    n_elements, n = len(structure.elements), structure.n_nodes
    elements = assembly.elements_of(laws, structure.drift_matrix, slopes[0], matrices.viscosities[0])
    halvings = 0 if structure.substeps else assembly.HALVINGS
    steps = Steps(float(sample_time), 0.0, structure.substeps or 0, halvings, structure.tolerance)
    with_accelerations = reduce == "peak_acceleration"
    motion = assembly.empty_motion(2 * n, states.shape[1], n_elements, with_accelerations=with_accelerations)
    parts = assembly.empty_flows(halvings, 2 * n, 1, n_elements)
    results = Results(np.empty((n_sets, motion.peaks.size)), *(np.empty((n_sets, n_elements)) for _ in range(3)))
    sets = Sets(
        A, loads, np.ascontiguousarray(rates), slopes, read_only(matrices.viscosities), parameters, states, laws.starts,
        np.array(np.broadcast_to(values.get("scale", np.ones(1)), n_sets)), np.ascontiguousarray(u),
        read_only(structure.initial_state or np.zeros(2 * n)), assembly.PHASE,
    )  # fmt: skip
    pushing = np.array([float(structure.excitation == "force")])
    n_worked = int(reduce == "energy" and bool(matrices.viscosities.any()))  # work of dashpots comes with that of loads
    plant = Plant(A[0], loads[0], np.zeros((n, n)), np.zeros((n_worked, n)), pushing)
    with np.errstate(all="ignore"):
        follow_each(
            assembly.follow_address(), elements, sets, plant, steps, parts, motion, room_for(motion),
            assembly.empty_tracks(0, motion), results,
        )  # fmt: skip
    peaks = assembly.peaks_by_name(results.peaks, n_elements, n)
    unresolved = assembly.uncertainty(results.errors, peaks["peak_drift"]) > assembly.LEAST_CERTAIN
    measures = {**peaks, "residual_drift": results.drifts, "energy": results.work}
    return np.where(unresolved[:, np.newaxis], np.inf, measures[reduce])


def _stacked(structure: Any, values: Mapping[str, FloatArray], n_sets: int) -> _Stack:
    """All structures: by tables where only laws with tables and the three matrices vary, else one by one."""
    numbers = {name: column for name, column in values.items() if name != "scale"}
    places = {name: int(name.split(".")[1]) for name in numbers if name.startswith("elements.")}
    varied = [structure.elements[place].law for place in places.values()]
    has_table = all(isinstance(law, Law) and law.u0 is None for law in varied)  # else a law first moves from its u0
    if has_table and all(name in places or name in MATRICES for name in numbers):
        return _by_tables(structure, numbers, n_sets)
    return _one_by_one(structure, numbers, n_sets)


def _by_tables(structure: Any, numbers: Mapping[str, FloatArray], n_sets: int) -> _Stack:
    steppers, parameters, states = [], [], []
    for e, (element, law) in enumerate(zip(structure.elements, structure.laws.steppers, strict=True)):
        varied = own(numbers, f"elements.{e}")
        stepper, constants, memory = _tabled(element.law, varied) if varied else (law, law.parameters, law.state)
        steppers.append(stepper)
        parameters.append(np.broadcast_to(constants, (n_sets, constants.shape[-1])))
        states.append(np.broadcast_to(memory, (n_sets, memory.shape[-1])))
    none = np.zeros((n_sets, 0))
    laws = structure.laws._replace(steppers=tuple(steppers))
    constants = read_only(np.concatenate([none, *parameters], axis=1), finite=False)
    memories = read_only(np.concatenate([none, *states], axis=1), finite=False)
    slopes = read_only(laws.slopes(constants, memories))
    return laws, constants, memories, slopes, _matrices(structure, numbers, slopes, n_sets)


def _tabled(law: Law, varied: Mapping[str, FloatArray]) -> tuple[Startable, FloatArray, FloatArray]:
    """Laws of one family: their kernels, and the parameters and states, one a row."""
    kind = type(law)
    n_sets = max(column.size for column in varied.values())
    tables = law.exchanged({name: column[:, np.newaxis] for name, column in varied.items()})
    wide = {name: np.broadcast_to(table, (n_sets, *table.shape[1:])) for name, table in tables.items()}
    kind.check(wide := kind.completed(wide))
    packed = kind.pack(wide)
    is_general = bool(set(varied) & set(law.structural))
    step, start, workspace = (kind.step, kind.start, kind.workspace) if is_general else law.stepping
    states = np.concatenate([packed.memory, np.zeros((len(packed.memory), workspace))], axis=1)
    stepper = Startable(compiled_step(step), packed.parameters[0], states[0], compiled_start(start))
    return stepper, packed.parameters, states


def _matrices(structure: Any, numbers: Mapping[str, FloatArray], slopes: FloatArray, n_sets: int) -> assembly.Matrices:
    """Linear parts of structures whose laws have these elastic slopes (n_sets, n_elements)."""
    one, rows, damping = np.eye(structure.n_nodes), structure.drift_matrix, structure.damping

    if (masses := numbers.get("mass")) is not None:
        check_positive(mass=float(masses.min()))
    if (dampings := numbers.get("damping")) is not None:
        check_not_negative(damping=float(dampings.min()))

    def scaled(name: str, value: FloatArray, matrix: FloatArray) -> FloatArray:
        numbers_of = numbers.get(name)
        if numbers_of is None:
            return np.broadcast_to(matrix, (n_sets, *matrix.shape))
        return numbers_of[:, np.newaxis, np.newaxis] * (matrix if np.ndim(value) else one)

    mass = scaled("mass", structure.mass, structure.mass_matrix)
    stiffness = scaled("stiffness", structure.stiffness, structure.stiffness_matrix)
    stiffness = stiffness + np.swapaxes(rows[np.newaxis], 1, 2) @ (slopes[:, :, np.newaxis] * rows)
    factors = numbers.get("damping", np.ones(1))
    if isinstance(damping, Rayleigh):
        tall = factors[:, np.newaxis, np.newaxis]
        damped = (tall * damping.mass) * mass + (tall * damping.stiffness) * stiffness
    elif isinstance(damping, ModalDamping):
        several = np.ndim(damping.ratio) or "damping" not in numbers
        ratios = factors[:, np.newaxis] * np.asarray(damping.ratio) if several else factors[:, np.newaxis]
        damped = modal_damping(ratios, mass, stiffness)
    else:
        damped = scaled("damping", damping, structure.own_damping)
    full = damped + rows.T @ (structure.viscosities[:, np.newaxis] * rows)
    directions = structure.force_directions
    if structure.excitation == "base":
        directions = -(mass @ np.array(structure.influence or np.ones(structure.n_nodes)))[:, np.newaxis, :]
    directions = np.broadcast_to(directions, (n_sets, 1, structure.n_nodes))
    viscosities = np.broadcast_to(structure.viscosities, slopes.shape)
    return assembly.Matrices(mass, full, stiffness, rows, directions, viscosities)


def _one_by_one(structure: Any, numbers: Mapping[str, FloatArray], n_sets: int) -> _Stack:
    """Structures that are made by themselves, such as those with sums whose parts vary."""
    made = [
        structure.assemble({name: float(column[min(i, column.size - 1)]) for name, column in numbers.items()})
        for i in range(n_sets)
    ]
    first = made[0]
    forms = {tuple((id(law.step), law.parameters.size, law.state.size) for law in each.laws.steppers) for each in made}
    if len(forms) > 1:
        raise ValueError(f"{', '.join(numbers)} change the form of a law: compute the sets one after the other")
    if any(each.initial_state != structure.initial_state for each in made):
        raise ValueError("all sets begin with the same initial_state")
    matrices = assembly.Matrices(*map(np.concatenate, zip(*(each.matrices for each in made), strict=True)))
    constants = read_only(np.stack([each.laws.parameters for each in made]), finite=False)
    memories = read_only(np.stack([each.laws.states for each in made]), finite=False)
    slopes = read_only(np.stack([each.elastic_slopes for each in made]))
    return first.laws, constants, memories, slopes, matrices._replace(rows=first.drift_matrix)
