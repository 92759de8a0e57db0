"""Numbers of a law as coordinates of a filter: their logarithms where the law refuses negative ones."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels.adaptation.copies import step_each
from hysim.kernels.stepping import START, STEP, by_address
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.law import Law
from hysim.models.tables import tables_of


class Coordinates(NamedTuple):
    """Free numbers of a law, and which of them are tracked by their logarithms."""

    names: tuple[str, ...]
    values: FloatArray
    log: npt.NDArray[np.bool_]

    def encode(self, values: FloatArray) -> FloatArray:
        """Coordinates (..., n_names) of values."""
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)

    def decode(self, x: FloatArray) -> FloatArray:
        """Values (..., n_names) of coordinates."""
        return np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)

    def spread(self, changes: FloatArray) -> FloatArray:
        """Standard deviations of the coordinates for those of the values."""
        return np.where(self.log, changes / np.where(self.log, self.values, 1.0), changes)


def coordinates_of(law: Law, free: Sequence[str]) -> Coordinates:
    """The coordinates of some numbers; ValueError if a name is unknown or decides which step the law has."""
    if isinstance(free, str):
        raise TypeError(f"free must be a sequence of names, got the string {free!r}")
    if unknown := [name for name in free if name not in law.scalars]:
        raise ValueError(f"free has {unknown[0]!r}: a {type(law).__name__} has {', '.join(law.scalars)}")
    if initial := [name for name in free if name in law.initial_names]:
        raise ValueError(f"{initial[0]} is the memory at the first sample, which does not drift: leave it out of free")
    if not free:
        raise ValueError("free must name at least one number that drifts")
    values = np.array([law.scalars[name] for name in free])
    return Coordinates(tuple(free), values, np.array([_must_be_positive(law, name) for name in free]))


def _must_be_positive(law: Law, name: str) -> bool:
    value = law.scalars[name]
    try:
        law.with_scalars({name: -abs(value)})
    except ValueError:
        return value > 0.0
    return False


def _place(name: str) -> tuple[str, int]:
    """Field of a number, and its place there."""
    field, _, place = name.partition("[")
    return field, int(place[:-1]) if place else 0


class Copies:
    """Copies of a law with other numbers, moved sample by sample.

    Parameters
    ----------
    law : Law
        The law; numbers that are not tracked are its own.
    coordinates : Coordinates
        The numbers that differ from copy to copy.
    """

    def __init__(self, law: Law, coordinates: Coordinates) -> None:
        self._law, self._coordinates = law, coordinates
        self._step = by_address(compiled_step(law.step), STEP.signature)
        self._start = by_address(compiled_start(law.start), START.signature)
        self.memory = law.packed[1].copy()
        self._state = np.zeros(self.memory.size + law.workspace)
        self._one, _ = tables_of(type(law).__name__, law.arguments, {}, np.zeros(1))
        self._places = [_place(name) for name in coordinates.names]

    def begun(self, u0: float) -> FloatArray:
        """The memory before a first sample at `u0`."""
        return np.array(self._law.state_at(u0))

    def moved(self, x: FloatArray, memory: FloatArray, before: float, u: float) -> FloatArray:
        """Outputs (n,) at the input `u` of copies with coordinates `x` (n, n_names); `memory` (n, n_memory) moves."""
        y = np.empty(len(x))
        with np.errstate(all="ignore"):
            step_each(self._step, self._start, self._packed(x), memory, self._state, before, u, y)
        return y

    def _packed(self, x: FloatArray) -> FloatArray:
        law = self._law
        tables = self._tables(len(x))
        for place, column in zip(self._places, self._coordinates.decode(x).T, strict=True):
            field, k = place
            tables[field][:, k] = column
        with np.errstate(all="ignore"):
            return read_only(law.pack(law.completed(tables)).parameters, finite=False)

    def _tables(self, n_copies: int) -> dict[str, FloatArray]:
        """Tables of every field, to be written to."""
        return {name: np.repeat(table, n_copies, axis=0) for name, table in self._one.items()}
