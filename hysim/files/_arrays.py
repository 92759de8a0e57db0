"""Arrays with names, as a table: the content of NPZ, NPY, MAT and HDF5 files.

A column is an array with one axis that is longer than one; of an array with more, the columns are those along its
first axis: ``x[2]`` of shape (n, 3), ``x[0,1]`` of shape (n, 3, 2). A name leads into structs and groups with a
point or a slash. Text arrays ``u_units``, ``name`` and ``channels`` and a number `resolution` hold what is known
beside the columns.
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
from hysim.files._table import Column, Notes, channels_in, damaged, listed, number_of, positive, require, shown

MOST_BYTES = 2_000_000_000
"""Most bytes of one array's numbers; a larger one is refused before it is read."""

_INDEXED = re.compile(r"(.+)\[(\d{1,9}(?:, ?\d{1,9})*)\]", re.DOTALL)
_LONGEST_TEXT = 10_000  # bytes of a unit or a name
UNITS = "_units"
"""Ends the name of a text that is the unit of an array."""


NUMBERS, TEXT = "numbers", "text"
KINDS = {
    "b": NUMBERS, "i": NUMBERS, "u": NUMBERS, "f": NUMBERS, "U": TEXT, "S": "bytes", "c": "complex numbers",
    "m": "time spans", "M": "dates", "O": "pickled objects", "V": "records",
}  # fmt: skip
"""Contents of an array by the kind of its NumPy type."""

NOTES = ("name", "resolution", "channels")
"""Arrays or attributes that hold a note about the record."""


@dataclass(frozen=True)
class Array:
    """An array of a file: its name, its shape, the kind of its content, and how its values or its text are read."""

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
    def is_vector(self) -> bool:
        """Whether at most one axis is longer than one."""
        return sum(length != 1 for length in self.shape) <= 1

    @property
    def description(self) -> str:
        """Name and shape, or the kind of the content where that is no number."""
        shape = " x ".join(map(str, self.shape)) if self.shape else "one value"
        return f"{listed([self.label])} ({shape if self.kind == NUMBERS else self.kind})"

    def column(self, text: str | None = None) -> Column:
        """The column with these numbers of the axes after the first, or the whole array if it has one long axis."""
        name, most = f"array {shown(self.label)}", MOST_BYTES // 8
        require(self.kind == NUMBERS, f"{name} holds {self.kind}: a column must hold real numbers")
        is_small = self.size * max(self.item_bytes, 8) <= MOST_BYTES
        require(is_small, f"{name} is too large: it says it has {self.size:,} numbers, at most {most:,} are read")
        name, rule = f"{name} has shape {self.shape}", "samples run along the first axis"
        if text is None:
            first = f"{self.label}[{','.join('0' for _ in self.shape[1:])}]"
            require(self.is_vector, f"{name}: name one of its columns, such as {first!r}; {rule}")
            return Column((self, ()), self.label, self.unit or "")
        index = tuple(map(int, text.split(",")))
        has_column = not self.is_vector and len(index) == len(self.shape) - 1
        has_column = has_column and bool(np.less(index, self.shape[1:]).all()) and min(index) >= 0
        require(has_column, f"{name}: it has no column [{text}]; {rule}, and each of the others takes a number from 0")
        return Column((self, index), f"{self.label}[{text}]", self.unit or "")

    def numbers(self) -> FloatArray:
        """All numbers, as one column if there is one long axis."""
        with np.errstate(all="ignore"):
            values = np.asarray(self.read(), dtype=np.float64)
        return values.reshape(-1) if self.is_vector else values


@dataclass(frozen=True)
class Arrays:
    """The arrays of a file, in its order."""

    arrays: Sequence[Array]
    notes: Notes
    format: str

    @property
    def labels(self) -> Sequence[str]:
        """Names of the arrays."""
        return [array.label for array in self.arrays]

    def column(self, key: str | int) -> Column:
        """The column of this name, or of this number: of the arrays in order, of the columns of a single array."""
        array, index = None, None
        if isinstance(key, str):
            array = self._called(key)
            if array is None and (parts := _INDEXED.fullmatch(key)):
                array, index = self._called(parts[1]), parts[2]
        elif len(self.arrays) == 1 and not self.arrays[0].is_vector:
            array, index = self.arrays[0], f"{operator.index(key)}"
        elif 0 <= operator.index(key) < len(self.arrays):
            array = self.arrays[key]
        if array is None:
            raise ValueError(f"no array {key!r}, {self._overview()}")
        return array.column(index)

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        with damaged(self.format):
            numbers = {id(array): array.numbers() for array in {id(c.place[0]): c.place[0] for c in columns}.values()}
        values = [numbers[id(array)][(slice(None), *index)] for array, index in (column.place for column in columns)]
        if len({column.size for column in values}) > 1:
            sizes = ", ".join(f"{shown(c.label)} {v.size}" for c, v in zip(columns, values, strict=True))
            raise ValueError(f"the columns have unequal numbers of samples: {sizes}")
        for column, each in zip(columns, values, strict=True):
            if np.isinf(each).any():
                k = int(np.argmax(np.isinf(each)))
                raise ValueError(
                    f"{self.place(k)}, column {shown(column.label)}: expected a finite number, got {each[k]}"
                )
        return np.stack(values)

    def place(self, sample: int) -> str:
        """The sample's number from 0."""
        return f"sample {sample}"

    def _called(self, key: str) -> Array | None:
        number = number_of(key, "arrays", self.labels)
        if number is None:
            number = number_of(_path(key), "arrays", [_path(label) for label in self.labels])
        return None if number is None else self.arrays[number]

    def _overview(self) -> str:
        if not self.arrays:
            return "the file holds no array"
        if len(self.arrays) == 1 and len(self.arrays[0].shape) == 2 and not self.arrays[0].is_vector:
            only = self.arrays[0]
            return f"there is one array, {only.description}: choose its columns by the numbers 0 to {only.shape[1] - 1}"
        return f"the arrays are: {listed([f'{k}: {array.description}' for k, array in enumerate(self.arrays)])}"


def with_notes(arrays: list[Array], form: str, attributes: Mapping[str, Any] | None = None) -> Arrays:
    """The table of these arrays, with the units and notes in some of them or in attributes of the file."""
    notes = dict(attributes or {})
    with damaged(form):
        for array in arrays:
            if array.label in NOTES or array.label.endswith(UNITS):
                notes.setdefault(array.label, _short_value(array))
    units = {name.removesuffix(UNITS): text for name, text in notes.items() if name.endswith(UNITS)}
    units |= {array.label: array.unit for array in arrays if array.unit is not None}
    name, resolution = notes.get("name"), notes.get("resolution")
    return Arrays(
        arrays,
        Notes(
            units={label: unit for label, unit in units.items() if isinstance(unit, str)},
            resolution=positive(resolution) if isinstance(resolution, float) else None,
            name=name if isinstance(name, str) else None,
            channels=channels_in(notes.get("channels")),
        ),
        form,
    )


def _short_value(array: Array) -> str | float | None:
    """The text or the number in an array that holds a short one."""
    if array.size * array.item_bytes > _LONGEST_TEXT:
        return None
    if array.kind == TEXT:
        return str(array.read())
    return float(np.asarray(array.read()).item()) if array.kind == NUMBERS and array.size == 1 else None


def _path(name: str) -> str:
    return name.strip("/").replace("/", ".")
