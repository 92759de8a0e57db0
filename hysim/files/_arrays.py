"""Arrays with names, as a table: the content of NPZ, NPY, MAT, HDF5 and MicroMag files.

A column is an array with one axis that is longer than one; of an array with more, the columns are those along its first
axis: ``x[2]`` of shape (n, 3), ``x[0,1]`` of shape (n, 3, 2). A name leads into structs and groups with a point or a
slash. Text arrays ``u_units``, ``name``, ``channels`` and a number `resolution` stand beside the columns.

NumPy reads NPZ and NPY, SciPy each variable of a MAT file of version 5. What they do not check is checked before: the
sizes that a file states, and structs, into which hysim goes itself, because `scipy.io.loadmat` follows cells in cells
without a limit: 15 000 of them crash the process. No array of objects is read: it is a pickle, which could run any
code. Nothing is written to the disk: the name of an array is not used as a path.
"""

import math
import operator
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from typing import IO, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.files._table import Column, Notes, damaged, listed, notes_in, number_of, require, shown

MOST_BYTES = 2_000_000_000
"""Most bytes of one array's numbers; a larger one is refused before it is read."""

UNITS = "_units"
"""Ends the name of a text that is the unit of an array."""

NOTES = ("name", "resolution", "channels")
"""Arrays or attributes that hold a note about the record."""

NUMBERS, TEXT = "numbers", "text"
KINDS = {
    "b": NUMBERS, "i": NUMBERS, "u": NUMBERS, "f": NUMBERS, "U": TEXT, "S": "bytes", "c": "complex numbers",
    "m": "time spans", "M": "dates", "O": "pickled objects", "V": "records",
}  # fmt: skip
"""Contents of an array by the kind of its NumPy type."""

_SAMPLE = re.compile(r"[+-][\d.]")
_MEASURED = ("u", "y", "adjusted_u", "adjusted_y")  # field and moment, and what the instrument made of them
_MICROMAG_UNITS = {"hybrid": ("T", "A m^2"), "si": ("A/m", "A m^2"), "cgs": ("Oe", "emu")}
_INDEXED = re.compile(r"(.+)\[(\d{1,9}(?:, ?\d{1,9})*)\]", re.DOTALL)
_LONGEST_TEXT = 10_000  # bytes of a unit or a name
_ENDING = ".npy"
_LONGEST_HEADER = 10_000  # bytes, as in NumPy

_MAT_HEAD, _MAT_TITLE = 128, b"MATLAB 5.0 MAT-file".ljust(124)
_BEGINNING = 8192  # bytes that hold the properties of a variable
_DEEPEST = 16  # structs in structs
_MATRIX, _COMPRESSED = 14, 15  # types of elements
_NAMELESS = "__function_workspace__"  # what SciPy calls a variable without a name
_MAT_NUMBERS = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
_MAT_KINDS = {"cell": "cells", "struct": "several structs", "sparse": "a sparse matrix", "function": "a function"}


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
        return math.prod(self.shape)

    @property
    def is_vector(self) -> bool:
        """Whether at most one axis is longer than one."""
        return sum(length != 1 for length in self.shape) <= 1

    @property
    def description(self) -> str:
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
        values = np.asarray(self.read())
        kind = KINDS.get(values.dtype.kind, "no numbers")
        require(kind == NUMBERS, f"array {shown(self.label)} holds {kind}: a column must hold real numbers")
        with np.errstate(all="ignore"):
            values = values.astype(np.float64, copy=False)
        return values.reshape(-1) if self.is_vector else values


@dataclass(frozen=True)
class Arrays:
    """The arrays of a file, in its order."""

    arrays: Sequence[Array]
    notes: Notes
    format: str

    @property
    def labels(self) -> Sequence[str]:
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
        with damaged(self.format):
            numbers = {id(array): array.numbers() for array in {id(c.place[0]): c.place[0] for c in columns}.values()}
        values = [numbers[id(array)][(slice(None), *index)] for array, index in (column.place for column in columns)]
        sizes = ", ".join(f"{shown(c.label)} {v.size}" for c, v in zip(columns, values, strict=True))
        is_even = len({column.size for column in values}) == 1
        require(is_even, f"the columns have unequal numbers of samples: {sizes}")
        numbers_of = np.stack(values)
        for sample, k in np.argwhere(np.isinf(numbers_of).T)[:1]:
            place = f"{self.place(sample)}, column {shown(columns[k].label)}"
            raise ValueError(f"{place}: expected a finite number, got {numbers_of[k, sample]}")
        return numbers_of

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
        only = self.arrays[0]
        if len(self.arrays) == 1 and len(only.shape) == 2 and not only.is_vector:
            return f"there is one array, {only.description}: choose its columns by the numbers 0 to {only.shape[1] - 1}"
        return f"the arrays are: {listed([f'{k}: {array.description}' for k, array in enumerate(self.arrays)])}"


def with_notes(arrays: list[Array], form: str, attributes: Mapping[str, Any] | None = None) -> Arrays:
    """The table of these arrays, with the units and notes in some of them or in attributes of the file."""
    notes = dict(attributes or {})
    for array in arrays:
        if array.label in NOTES or array.label.endswith(UNITS):
            notes.setdefault(array.label, _short_value(array))
    units = {name.removesuffix(UNITS): text for name, text in notes.items() if name.endswith(UNITS)}
    units |= {array.label: array.unit for array in arrays if array.unit is not None}
    return Arrays(arrays, notes_in(notes, units), form)


def _short_value(array: Array) -> str | float | None:
    if array.size * array.item_bytes > _LONGEST_TEXT:
        return None
    if array.kind == TEXT:
        return str(array.read())
    return float(array.numbers()[0]) if array.kind == NUMBERS and array.size == 1 else None


def _path(name: str) -> str:
    return name.strip("/").replace("/", ".")


def micromag(file: BinaryIO) -> Arrays:
    """Field `u` and moment `y` that a MicroMag 2900 or 3900 measured, and further columns, in their order.

    Of reversal curves these are points at the calibrating field, each followed by a curve. The header says the units.
    """
    lines = file.read().decode("latin-1").splitlines()
    ends = any(line.startswith("MicroMag") and line.rstrip().endswith("ends") for line in lines[-3:])
    require(ends, "the end of the data is missing: the file is cut")
    rows = [line.split(",") for line in lines if _SAMPLE.match(line)]
    require(bool(rows), "there are no samples")
    widths = {len(row) for row in rows}
    require(len(widths) == 1 and 2 <= min(widths) <= len(_MEASURED), "its samples must have the same 2 to 4 numbers")
    values = np.array(rows, dtype=float)
    system = next((line for line in lines if line.startswith("Units of measure")), "").split()
    units = next((each for name, each in _MICROMAG_UNITS.items() if name in map(str.lower, system)), (None, None))
    unit_of = dict(zip(_MEASURED, units * 2, strict=True))
    names = (*_MEASURED[:2], "temperature") if values.shape[1] == 3 else _MEASURED
    columns = zip(names, values.T, strict=False)
    arrays = [Array(name, (len(each),), NUMBERS, 8, each.copy, unit_of.get(name)) for name, each in columns]
    return with_notes(arrays, "a MicroMag file")


def npz(file: BinaryIO) -> Arrays:
    archive = zipfile.ZipFile(file)
    entries = [entry for entry in archive.infolist() if entry.filename.endswith(_ENDING)]
    names = shown(", ".join(archive.namelist()[:3]))
    advice = "save a workbook as CSV, and take the files out of an archive"
    require(entries, f"the zip archive holds no array of NumPy but {names}; {advice}")
    return with_notes([_entry(archive, entry) for entry in entries], "NPZ")


def npy(file: BinaryIO) -> Arrays:
    def rewound() -> AbstractContextManager[IO[bytes]]:
        file.seek(0)
        return nullcontext(file)

    array, length, rest = _array("array", rewound, file.seek(0, 2))
    is_complete = array.kind != NUMBERS or length <= rest
    require(is_complete, f"the file is cut: its array has {length:,} bytes, there are {rest:,}")
    return with_notes([array], "NPY")


def _entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Array:
    label = entry.filename.removesuffix(_ENDING)
    is_plain = entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # which are unpacked piece by piece
    is_plain = is_plain and not entry.flag_bits & 1
    require(is_plain, f"array {shown(label)} is encrypted or packed in another way than NumPy does: save it anew")
    array, length, rest = _array(label, partial(archive.open, entry), entry.file_size)
    sizes = f"its header says {length:,} bytes of numbers, the archive {rest:,}"
    require(array.kind != NUMBERS or length == rest, f"array {shown(label)} is damaged: {sizes}")
    return array


def _array(label: str, opener: Callable[[], AbstractContextManager[IO[bytes]]], size: int) -> tuple[Array, int, int]:
    """The array in a file of this size, the bytes that its header promises, and those after the header."""
    with opener() as file:
        header = BytesIO(file.read(_LONGEST_HEADER))
    is_old = np.lib.format.read_magic(header)[0] == 1
    read_header = np.lib.format.read_array_header_1_0 if is_old else np.lib.format.read_array_header_2_0
    with warnings.catch_warnings(action="ignore"):  # about headers that Python 2 wrote
        shape, is_fortran, dtype = read_header(header, max_header_size=_LONGEST_HEADER)
    require(dtype.names is None, f"array {shown(label)} has fields: save each as an array of its own")
    require(min(shape, default=0) >= 0, f"array {shown(label)} is damaged: it has a negative length")
    start, length = header.tell(), math.prod(shape) * dtype.itemsize
    kind = "several texts" if dtype.kind == "U" and math.prod(shape) != 1 else KINDS.get(dtype.kind, "no numbers")

    def read() -> npt.NDArray[Any] | str:
        with opener() as file:
            content = file.read(start + length)
        values: npt.NDArray[Any] = np.ndarray(shape, dtype, content, start, order="F" if is_fortran else "C")
        return str(values.flat[0]) if kind == TEXT else values

    return Array(label, shape, kind, dtype.itemsize, read), length, size - start


def mat(file: BinaryIO) -> Arrays:
    """The arrays of a MAT file of version 5, also those in structs as ``label.field``."""
    return with_notes(list(_MatReader(file).variables()), "MAT")


class _MatReader:
    """Reader of variables, which are elements: a type, a length, and as many bytes."""

    def __init__(self, file: BinaryIO) -> None:
        head = file.read(_MAT_HEAD)
        require(len(head) == _MAT_HEAD, "the MAT file is cut: its header is incomplete")
        self.file, self.in_structs = file, 0
        self.order, version = ("<", b"\0\1IM") if head.endswith(b"IM") else (">", b"\1\0MI")
        self.head = _MAT_TITLE + version

    def variables(self) -> Iterator[Array]:
        end, at = self.file.seek(0, 2), _MAT_HEAD
        while at < end:
            self.file.seek(at)
            kind, length = self.tag(self.file.read(8))
            rest = end - at - 8
            require(length <= rest, f"the MAT file is cut: a variable has {length:,} bytes, there are {rest:,}")
            is_known = kind in (_MATRIX, _COMPRESSED)
            require(is_known, f"the MAT file is damaged: a variable is an element of type {kind}")
            yield from self.arrays(partial(self.matrix, at, 8 + length))
            at += 8 + length

    def tag(self, data: bytes | memoryview) -> tuple[int, int]:
        """The type of an element, and the number of bytes after these eight."""
        kind, length = np.frombuffer(data, f"{self.order}u4", 2).tolist()
        return kind, length

    def matrix(self, at: int, length: int, most: int = MOST_BYTES) -> bytes:
        """The matrix in the element of this place and length, unpacked, or so many bytes of it."""
        self.file.seek(at)
        content = self.file.read(min(length, most))
        if self.tag(content)[0] == _MATRIX:
            return content
        stream = zlib.decompressobj()
        tag = stream.decompress(content[8:], 8)
        length = self.tag(tag)[1]
        inside = stream.decompress(stream.unconsumed_tail, min(length + 1, most))
        is_whole = len(inside) == length or most == _BEGINNING
        require(is_whole, f"the MAT file is damaged: a compressed variable does not have the {length:,} bytes it says")
        return tag + inside

    def arrays(self, matrix: Callable[..., bytes | memoryview], struct: str = "", depth: int = 0) -> Iterator[Array]:
        from scipy.io import whosmat

        beginning = matrix(most=_BEGINNING)
        [(name, shape, kind)] = whosmat(BytesIO(self.head + beginning))
        label, length, size = struct or str(name), self.tag(beginning)[1], math.prod(shape)
        if kind == "struct" and size == 1 and depth <= _DEEPEST:
            self.in_structs += 0 if struct else length
            is_small = self.in_structs <= MOST_BYTES
            require(is_small, f"the structs have more than {MOST_BYTES:,} bytes: save their fields alone")
            for field, content in self.fields(memoryview(matrix())):
                yield from self.arrays(partial(_beginning, content), f"{label}.{field}", depth + 1)
        elif kind == "char" and size <= 1:
            yield Array(label, (1,), TEXT, length, partial(self.value, matrix))
        elif label != _NAMELESS:  # which belongs to an object
            kind = NUMBERS if kind in _MAT_NUMBERS else _MAT_KINDS.get(kind, "an object")
            is_sound = kind != NUMBERS or length <= _BEGINNING + 16 * size
            require(is_sound, f"the MAT file is damaged: {shown(label)} has {length:,} bytes for {size:,} values")
            yield Array(label, shape, kind, 8, partial(self.value, matrix))

    def fields(self, struct: memoryview) -> Iterator[tuple[str, memoryview]]:
        """Names and matrices of a struct's fields, which follow its flags, dimensions and name."""
        parts, at = [], 8
        while at < len(struct):
            kind, length = self.tag(struct[at : at + 8])
            is_short = kind >> 16 > 0  # the length is in the first four bytes, the content in the other four
            start, length = (at + 4, kind >> 16) if is_short else (at + 8, length)
            is_inside = start + length <= (at + 8 if is_short else len(struct))
            require(is_inside, f"the MAT file is damaged: an element of {length:,} bytes does not fit where it is")
            parts.append(struct[at if kind == _MATRIX else start : start + length])
            at = at + 8 if is_short else start + length + (-length % 8 if kind != _MATRIX else 0)
        _, _, _, width, names, *matrices = parts
        step = int.from_bytes(width, "little" if self.order == "<" else "big")
        for k, matrix in enumerate(matrices):
            if len(matrix) > 8:  # an empty array has nothing behind its tag
                yield str(names[k * step : (k + 1) * step], "latin-1").rstrip("\0"), matrix

    def value(self, matrix: Callable[..., bytes | memoryview]) -> npt.NDArray[Any] | str:
        from scipy.io import loadmat

        with warnings.catch_warnings(action="error"):  # SciPy warns of what it cannot read
            *_, values = loadmat(BytesIO(self.head + matrix())).values()
        return "".join(values.flat) if values.dtype.kind == "U" else values


def _beginning(content: memoryview, most: int = MOST_BYTES) -> memoryview:
    return content[:most]
