"""A structure as its kernel takes it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim.kernels.structures.flows import N_POWERS, fastest, fill_flows
from hysim.kernels.structures.path import Elements, Flows, Motion, Plant, Steps, project
from hysim.kernels.structures.pointers import addresses
from hysim.models.compiled_step import startable
from hysim.models.protocols import CompiledLaw, Startable, Stretched

_PHASE = 2.0  # largest phase of the stiffest mode in a base step: above it the sweeps of a slipping element diverge
_HALVINGS = 12
_PROBES = 10.0 ** -np.arange(0.0, 13.0)


class Laws(NamedTuple):
    """The laws of a structure; their steps are held here, since the kernel knows the addresses only."""

    steppers: tuple[Startable, ...]
    stretches: tuple[tuple[tuple[int, int], ...], ...]
    slopes: FloatArray


class Matrices(NamedTuple):
    """The linear part: mass, damping and stiffness (n, n), with the elastic slopes of the elements in the last.

    `rows` is (n_elements, n), the drifts; `directions` (n_loads, n), the forces of unit loads.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    rows: FloatArray
    directions: FloatArray


def laws_of(models: Sequence[Any]) -> Laws:
    """Steps, memories and elastic slopes of laws that do not depend on time."""
    steppers = tuple(startable(model) for model in models)
    stretches = tuple(
        model.memory_places if isinstance(model, Stretched) else ((0, each.state.size),)
        for model, each in zip(models, steppers, strict=True)
    )
    return Laws(steppers, stretches, np.array([elastic_slope(each) for each in steppers]))


def elastic_slope(law: Startable) -> float:
    """Slope of a law at its start, zero where there is none: the limit of secants of shorter and shorter strokes."""
    secants = []
    for probe in _PROBES:
        begun = law.started(0.0)
        with np.errstate(all="ignore"):
            f0 = begun.step(begun.parameters, begun.state, 0.0)
            secants.append((begun.step(begun.parameters, begun.state, probe) - f0) / probe)
    slopes = np.array(secants)
    with np.errstate(invalid="ignore", divide="ignore"):
        changes = np.abs(np.diff(slopes)) / np.maximum(np.abs(slopes[1:]), np.abs(slopes[:-1]))
    changes[(slopes[1:] == 0.0) & (slopes[:-1] == 0.0)] = 0.0
    if np.isnan(changes).all():
        return 0.0
    return max(0.0, float(slopes[1 + np.nanargmin(changes)]))


def elements_of(laws: Laws, rows: FloatArray) -> Elements:
    """The elements as the kernel takes them."""
    nodes = [np.flatnonzero(row) for row in rows]
    stretches = [np.array(each, dtype=np.int64).reshape(-1, 2) for each in laws.stretches]
    return Elements(
        nodes=_joined(nodes, np.int64),
        weights=read_only(_joined([row[each] for row, each in zip(rows, nodes, strict=True)], np.float64)),
        node_ends=_ends([each.size for each in nodes]),
        k0=read_only(laws.slopes),
        steps=addresses([each.step for each in laws.steppers]),
        parameters=read_only(_joined([each.parameters for each in laws.steppers], np.float64), finite=False),
        parameter_ends=_ends([each.parameters.size for each in laws.steppers]),
        state_ends=_ends([each.state.size for each in laws.steppers]),
        stretches=np.concatenate([np.zeros((0, 2), dtype=np.int64), *stretches]),
        stretch_ends=_ends([len(each) for each in stretches]),
    )


def _joined(parts: Sequence[Any], kind: Any) -> Any:
    return np.concatenate([np.zeros(0, dtype=kind), *parts]).astype(kind)


def _ends(sizes: Sequence[int]) -> Any:
    return np.concatenate([[0], np.cumsum(np.array(sizes, dtype=np.int64))]).astype(np.int64)


def plant_of(matrices: Matrices, *, with_energies: bool) -> Plant:
    """The linear part as the kernel takes it."""
    n = len(matrices.mass)
    A, loads = np.zeros((2 * n, 2 * n)), np.zeros((len(matrices.directions) + len(matrices.rows), 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n] = -np.linalg.solve(matrices.mass, matrices.stiffness)
    A[n:, n:] = -np.linalg.solve(matrices.mass, matrices.damping)
    forces = np.concatenate([matrices.directions, matrices.rows])
    loads[:, n:] = np.linalg.solve(matrices.mass, forces.T).T
    directions = matrices.directions if with_energies else np.zeros((0, n))
    return Plant(A, loads, np.ascontiguousarray(matrices.damping), np.ascontiguousarray(directions))


def steps_of(plant: Plant, sample_time: float, substeps: int | None, tolerance: float) -> Steps:
    """How a sample is divided: as told, or by the tolerance from the phase on which the sweeps converge with."""
    rate = fastest(plant.A)
    if substeps is not None:
        return Steps(sample_time, rate, substeps, 0, tolerance)
    return Steps(sample_time, rate, max(1, int(np.ceil(sample_time * rate / _PHASE))), _HALVINGS, tolerance)


def flows_of(elements: Elements, plant: Plant, steps: Steps) -> Flows:
    """The flows over the base step and its parts."""
    n_levels, m, n_elements = steps.halvings + 2, len(plant.A), elements.k0.size
    n_loads = len(plant.loads) - n_elements
    E, P = np.empty((n_levels, m, m)), np.empty((n_levels, len(plant.loads), N_POWERS, m))
    fill_flows(plant.A, plant.loads, steps.rate, steps.sample_time / steps.base, E, P)
    free = np.concatenate([E, P[:, :n_loads, :2].reshape(n_levels, -1, m)], axis=1)
    rests = np.ascontiguousarray(P[:, n_loads:].reshape(n_levels, -1, m))
    drifts = [np.empty((*columns.shape[:2], 2 * n_elements)) for columns in (free, rests)]
    for columns, out in zip((free, rests), drifts, strict=True):
        project(elements, columns, out)
    return Flows(free, rests, *drifts)


def motion_at(laws: Laws, rows: FloatArray, x: FloatArray, n_loads: int) -> Motion:
    """The motion at its start, every law at its first sample."""
    n_nodes, drifts = len(x) // 2, rows @ x[: len(x) // 2]
    begun = [law.started(float(drift)) for law, drift in zip(laws.steppers, drifts, strict=True)]
    forces = [_first_force(law, float(drift)) for law, drift in zip(begun, drifts, strict=True)]
    zeros = np.zeros(len(rows))
    carry = np.stack([np.array(forces), zeros, drifts, rows @ x[n_nodes:], zeros])
    peaks = np.concatenate([np.abs(drifts), np.abs(forces), np.abs(x[:n_nodes]), np.zeros(n_nodes)])
    states = _joined([law.state for law in begun], np.float64)
    return Motion(x.copy(), states, carry, peaks, np.zeros(2 + len(rows)), np.zeros(1), np.zeros(n_loads))


def _first_force(law: CompiledLaw, drift: float) -> float:
    with np.errstate(all="ignore"):
        return float(law.step(law.parameters, law.state, drift))
