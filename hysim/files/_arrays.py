"""Arrays with names, as a table: what NPZ, NPY, MAT and HDF5 files hold.

A column is an array with one axis that is longer than one; of an array with more, the columns are those along its
first axis: ``x[2]`` of shape (n, 3), ``x[0,1]`` of shape (n, 3, 2). A name leads into structs and groups with a
point or a slash. Two conventions carry what is known beside the numbers: text arrays ``u_units`` and ``name``, and a
number `resolution`.
"""

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.files._table import Column, Notes, damaged, listed, quantum, shown

MOST_BYTES = 2_000_000_000
"""Most bytes of one array's numbers; a file that says it has more is refused before they are read."""

_INDEXED = re.compile(r"(.+)\[(\d{1,9}(?:, ?\d{1,9})*)\]", re.DOTALL)
_LONGEST_TEXT = 10_000  # bytes of a unit or a name
_UNITS = "_units"  # ends the name of a text that is the unit of an array

NUMBERS, TEXT = "numbers", "text"
KINDS = {
    "b": NUMBERS, "i": NUMBERS, "u": NUMBERS, "f": NUMBERS, "U": TEXT, "S": "bytes", "c": "complex numbers",
    "m": "time spans", "M": "dates", "O": "pickled objects", "V": "records",
}  # fmt: skip
"""Contents of an array by the kind of its NumPy type."""

NOTES = ("name", "resolution")
"""Arrays or attributes that say something of the record."""


@dataclass(frozen=True)
class Array:
    """An array of a file: what it is called, its shape, what it holds, and how its values or its text are read."""

    label: str
    shape: tuple[int, ...]
    kind: str
    item_bytes: int
    read: Callable[[], npt.NDArray[Any] | str]
    unit: str | None = None

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    @property
    def described(self) -> str:
        """Name and shape, or what it holds where that is no number."""
        shape = " x ".join(map(str, self.shape)) if self.shape else "one value"
        return f"{listed([self.label])} ({shape if self.kind == NUMBERS else self.kind})"


@dataclass(frozen=True)
class Arrays:
    """The arrays of a file, in its order."""

    arrays: Sequence[Array]
    notes: Notes
    format: str

    def column(self, key: str | int) -> Column:
        """The column of this name, or of this number: of the arrays in order, of the columns of a single array."""
        if not isinstance(key, str):
            place = operator.index(key)
            if len(self.arrays) == 1 and len(self.arrays[0].shape) > 1 and not _is_vector(self.arrays[0]):
                return _indexed(self.arrays[0], f"{place}")
            if not 0 <= place < len(self.arrays):
                raise ValueError(f"no array {place}, {self._there()}")
            return _whole(self.arrays[place])
        if found := self._called(key):
            return _whole(found)
        if (parts := _INDEXED.fullmatch(key)) and (found := self._called(parts[1])):
            return _indexed(found, parts[2])
        raise ValueError(f"no array {key!r}, {self._there()}")

    def has(self, label: str) -> bool:
        """Whether an array is called so."""
        return any(array.label == label for array in self.arrays)

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        read = {id(column.place[0]): column.place[0] for column in columns}
        with damaged(self.format):
            whole = {key: _numbers(array) for key, array in read.items()}
        values = [whole[id(array)][(slice(None), *index)] for array, index in (column.place for column in columns)]
        if len({column.size for column in values}) > 1:
            sizes = ", ".join(f"{shown(c.label)} {v.size}" for c, v in zip(columns, values, strict=True))
            raise ValueError(f"the columns have unequal numbers of samples: {sizes}")
        for column, numbers in zip(columns, values, strict=True):
            if np.isinf(numbers).any():
                k = int(np.argmax(np.isinf(numbers)))
                raise ValueError(
                    f"{self.place(k)}, column {shown(column.label)}: expected a finite number, got {numbers[k]}"
                )
        return np.stack(values)

    def place(self, sample: int) -> str:
        """The sample's number from 0."""
        return f"sample {sample}"

    def _called(self, key: str) -> Array | None:
        found = [array for array in self.arrays if array.label == key]
        found = found or [array for array in self.arrays if _path(array.label) == _path(key)]
        if len(found) > 1:
            places = listed([str(k) for k, array in enumerate(self.arrays) if array in found])
            raise ValueError(f"{len(found)} arrays are called {key!r}: choose one of the numbers {places}")
        return found[0] if found else None

    def _there(self) -> str:
        if not self.arrays:
            return "the file holds no array"
        if len(self.arrays) == 1 and len(self.arrays[0].shape) == 2 and not _is_vector(self.arrays[0]):
            last = self.arrays[0].shape[1] - 1
            return f"there is one array, {self.arrays[0].described}: choose its columns by the numbers 0 to {last}"
        return f"the arrays are: {listed([f'{k}: {array.described}' for k, array in enumerate(self.arrays)])}"


def with_notes(arrays: list[Array], form: str, attributes: Mapping[str, Any] | None = None) -> Arrays:
    """The table of these arrays, with the units and notes that some of them, or attributes of the file, say."""
    said = dict(attributes or {})
    with damaged(form):
        for array in arrays:
            if array.label in NOTES or array.label.endswith(_UNITS):
                said.setdefault(array.label, _said(array))
    units = {name.removesuffix(_UNITS): text for name, text in said.items() if name.endswith(_UNITS)}
    units |= {array.label: array.unit for array in arrays if array.unit is not None}
    name, resolution = said.get("name"), said.get("resolution")
    notes = Notes(
        units={label: unit for label, unit in units.items() if isinstance(unit, str)},
        resolution=quantum(resolution) if isinstance(resolution, float) else None,
        name=name if isinstance(name, str) else None,
    )
    return Arrays(arrays, notes, form)


def _said(array: Array) -> str | float | None:
    """The text or the number of an array that holds a short one."""
    if array.size * array.item_bytes > _LONGEST_TEXT:
        return None
    if array.kind == TEXT:
        return str(array.read())
    return float(np.asarray(array.read()).item()) if array.kind == NUMBERS and array.size == 1 else None


def _numbers(array: Array) -> FloatArray:
    """All numbers of an array, as one column if it has one long axis."""
    with np.errstate(all="ignore"):
        numbers = np.asarray(array.read(), dtype=np.float64)
    return numbers.reshape(-1) if _is_vector(array) else numbers


def _path(name: str) -> str:
    return name.strip("/").replace("/", ".")


def _is_vector(array: Array) -> bool:
    return sum(length != 1 for length in array.shape) <= 1


def _whole(array: Array) -> Column:
    _check(array)
    if not _is_vector(array):
        inner = ",".join("0" for _ in array.shape[1:])
        raise ValueError(
            f"array {shown(array.label)} has shape {array.shape}: name one of its columns, such as "
            f"{f'{array.label}[{inner}]'!r}; samples run along the first axis"
        )
    return Column((array, ()), array.label, array.unit or "")


def _indexed(array: Array, text: str) -> Column:
    _check(array)
    index = tuple(map(int, text.split(",")))
    within = len(index) == len(array.shape) - 1 and all(
        0 <= k < length for k, length in zip(index, array.shape[1:], strict=True)
    )
    if not within or _is_vector(array):
        raise ValueError(
            f"array {shown(array.label)} has shape {array.shape}: it has no column [{text}]; samples run along the "
            "first axis, and each of the others takes a number from 0"
        )
    return Column((array, index), f"{array.label}[{text}]", array.unit or "")


def _check(array: Array) -> None:
    if array.kind != NUMBERS:
        raise ValueError(f"array {shown(array.label)} holds {array.kind}: a column must hold real numbers")
    if array.size * max(array.item_bytes, 8) > MOST_BYTES:
        raise ValueError(
            f"array {shown(array.label)} is too large: it says it has {array.size:,} numbers, at most "
            f"{MOST_BYTES // 8:,} are read"
        )
