"""Base class of a structure: its parts as matrices, and its laws as the kernels take them."""

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from hysim._frozen import FloatArray, read_only
from hysim.kernels.structures.layout import Elements
from hysim.plants.structures import assembly
from hysim.plants.structures.damping import ModalDamping, Rayleigh
from hysim.plants.structures.element import dissipates, parted
from hysim.plants.structures.records import OF_ELEMENTS, OF_NODES
from hysim.plants.structures.search import SearchedStructure

OUTPUTS = (*OF_NODES, *OF_ELEMENTS)


class AssembledStructure(SearchedStructure):
    """Masses on elements: their matrices, their small motions at the start, and the places of their outputs."""

    mass: FloatArray
    damping: Any
    stiffness: FloatArray
    elements: Any
    excitation: str
    influence: tuple[float, ...]
    output: str
    initial_state: tuple[float, ...]

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
    def laws(self) -> assembly.Laws:
        """Steps and memories of the elements, without their dashpots."""
        return assembly.laws_of([parted(element.law).law for element in self.elements])

    @cached_property
    def elastic_slopes(self) -> FloatArray:
        """Slope of each element at its start, zero where it is negative, shape (n_elements,) [N/m]."""
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
    def matrices(self) -> assembly.Matrices:
        """The linear part, as one row."""
        parts = (self.mass_matrix, self.damping_matrix, self.initial_stiffness, self.force_directions)
        mass, damping, stiffness, directions = (part[np.newaxis] for part in parts)
        return assembly.Matrices(mass, damping, stiffness, self.drift_matrix, directions)

    @cached_property
    def kernel_elements(self) -> Elements:
        """The elements as the kernel takes them."""
        return assembly.elements_of(self.laws, self.drift_matrix, self.elastic_slopes)

    @property
    def fastest_rate(self) -> float:
        return float(assembly.linear_parts(self.matrices)[2][0])

    def dissipative(self, strokes: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each element is no source of energy in cycles between plus and minus its stroke [m]."""
        pairs = zip(self.elements, strokes.tolist(), strict=True)
        return np.array([dissipates(element.law, stroke) for element, stroke in pairs])

    @property
    def widths(self) -> dict[str, int]:
        return {name: self._column_count(name) for name in OUTPUTS}

    @property
    def sensor(self) -> tuple[str, int]:
        return self.place_of(self.output)

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
        """Periods of small motions at the start, the longest first, shape (n,) [s]; inf for a mass that is free.

        Raises ValueError if the stiffness at the start is negative.
        """
        squares = eigh(self.initial_stiffness, self.mass_matrix, eigvals_only=True)
        if squares[0] < -1e-9 * np.abs(squares).max():
            raise ValueError("the stiffness at the start is negative: small motions have no periods")
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * np.pi / np.sqrt(np.maximum(squares, 0.0)))

    def modes(self) -> FloatArray:
        """Shapes of small motions at the start, one a column, in the order of `periods`, shape (n, n).

        They have modal masses of one; the largest displacement of each is positive.
        """
        shapes = eigh(self.initial_stiffness, self.mass_matrix)[1]
        largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(self.n_nodes)]
        return np.asarray(shapes * np.sign(largest))


def _matrix(values: FloatArray, name: str, n_nodes: int) -> FloatArray:
    """A number for each mass, one for all, or a symmetric matrix, as a matrix."""
    if values.ndim < 2:
        if values.ndim and values.size != n_nodes:
            raise ValueError(f"{name} must hold one number for each of {n_nodes} masses, got {values.size}")
        return read_only(np.diag(np.broadcast_to(values, n_nodes)))
    if values.shape != (n_nodes, n_nodes):
        raise ValueError(f"{name} must have the shape ({n_nodes}, {n_nodes}), got {values.shape}")
    if not np.allclose(values, values.T, rtol=1e-12, atol=1e-12 * np.abs(values).max()):
        raise ValueError(f"{name} must be a symmetric matrix")
    return read_only(0.5 * (values + values.T))
