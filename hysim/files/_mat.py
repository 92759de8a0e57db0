"""MAT files of version 5, which MATLAB writes by ``save -v6`` and, compressed, by ``save -v7``.

A file is a header of 128 bytes and an element for each variable. An element is a type, a number of bytes, and these
bytes, padded to a multiple of eight; up to four bytes may stand in the tag itself. A matrix is an element that holds
elements: flags with its class, its dimensions, its name, and its values. They are read here because
`scipy.io.loadmat` follows any nesting: cells in cells, 100 000 deep, crash the process. Here every length is compared
with the bytes that remain, a variable is unpacked no further than its stated length, and only structs are entered.

Source: MathWorks, MAT-File Format.
"""

import math
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import MOST_BYTES, NUMBERS, TEXT, Array, Arrays, with_notes
from hysim.files._table import damaged, require, shown

_HEADER_BYTES = 128
_BEGINNING = 8192  # bytes that hold the properties of a matrix
_DEEPEST = 16  # structs in structs
_MOST_AXES = 32

_MATRIX, _COMPRESSED = 14, 15  # types of elements
_STRUCT, _CHAR, _OPAQUE = 2, 4, 17  # classes of matrices
_COMPLEX = 0x800
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_LETTERS = {1: "latin-1", 2: "latin-1", 4: "utf-16-{}", 16: "utf-8", 17: "utf-16-{}", 18: "utf-32-{}"}
_KINDS = {1: "cells", 2: "several structs", 3: "an object", 5: "a sparse matrix", 16: "a function", 17: "an object"}


class _Element(NamedTuple):
    """The type of an element, its bytes, and the byte order ``"<"`` or ``">"`` of its numbers."""

    type: int
    content: memoryview
    order: str

    def parts(self) -> Iterator["_Element"]:
        """The elements in this one; an error where one does not fit, or there is none."""
        at = 0
        while True:
            kind, length = _tag(self.content[at : at + 8], self.order)
            start, stop = at + 8, at + 8 + length + (-length % 8 if kind != _MATRIX else 0)
            if kind >> 16:  # both in the first four bytes, and the content in the other four
                kind, length, start, stop = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            is_inside = start + length <= min(stop, len(self.content))
            require(is_inside, f"the MAT file is damaged: an element of {length:,} bytes does not fit where it is")
            yield _Element(kind, self.content[start : start + length], self.order)
            at = stop

    def numbers(self) -> npt.NDArray[np.generic]:
        """The content as numbers."""
        require(self.type in _NUMBERS, f"the MAT file is damaged: numbers in an element of type {self.type}")
        return np.frombuffer(self.content, self.order + _NUMBERS[self.type])

    def text(self) -> str:
        """The content as text."""
        require(self.type in _LETTERS, f"the MAT file is damaged: letters in an element of type {self.type}")
        encoding = _LETTERS[self.type].format("le" if self.order == "<" else "be")
        return str(self.content, encoding, "replace").rstrip("\0")


class _Matrix(NamedTuple):
    """The properties of a matrix, and the elements behind them: its values, or the fields of a struct."""

    kind: int
    is_complex: bool
    shape: tuple[int, ...]
    name: str
    values: Iterator[_Element]

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def is_struct(self) -> bool:
        return self.kind == _STRUCT and self.size == 1


def mat(file: BinaryIO) -> Arrays:
    """The arrays of a file, also those in structs; ValueError if it is damaged."""
    with damaged("MAT"):
        header = file.read(_HEADER_BYTES)
        require(len(header) == _HEADER_BYTES, "the MAT file is cut: its header is incomplete")
        return with_notes(list(_variables(file, "<" if header[126:] == b"IM" else ">")), "MAT")


def _variables(file: BinaryIO, order: str) -> Iterator[Array]:
    end, at, in_structs = file.seek(0, 2), _HEADER_BYTES, 0
    while at < end:
        file.seek(at)
        kind, length = _tag(file.read(8), order)
        at += 8
        rest = end - at
        require(length <= rest, f"the MAT file is cut: a variable has {length:,} bytes, there are {rest:,}")
        require(kind in (_MATRIX, _COMPRESSED), f"the MAT file is damaged: a variable is an element of type {kind}")
        content = partial(_content, file, at, length, kind == _COMPRESSED, order)
        unpacked, beginning = content(_BEGINNING)
        matrix = _matrix(beginning)
        in_structs += unpacked * matrix.is_struct
        require(in_structs <= MOST_BYTES, f"the structs have more than {MOST_BYTES:,} bytes: save their fields alone")
        if matrix.name:  # what has none belongs to an object
            yield from _arrays(matrix, matrix.name, unpacked, content)
        at += length


def _content(
    file: BinaryIO, start: int, length: int, is_compressed: bool, order: str, most: int | None = None
) -> tuple[int, _Element]:
    """The length, unpacked, of the variable in this place of a file, and its content or so many bytes of it."""
    file.seek(start)
    content = file.read(length if most is None else min(length, most))
    if is_compressed:
        stream = zlib.decompressobj()
        kind, length = _tag(stream.decompress(content, 8), order)
        require(kind == _MATRIX, f"the MAT file is damaged: an element of type {kind} is compressed")
        content = stream.decompress(stream.unconsumed_tail, length + 1 if most is None else most)
        is_whole = most is not None or len(content) == length
        require(is_whole, f"the MAT file is damaged: a compressed variable does not have the {length:,} bytes it says")
    return length, _Element(_MATRIX, memoryview(content), order)


def _arrays(
    matrix: _Matrix, label: str, length: int, content: Callable[[], tuple[int, _Element]], depth: int = 0
) -> Iterator[Array]:
    """The array of a matrix, or those in a struct as ``label.field``."""
    if matrix.is_struct and depth <= _DEEPEST:
        for name, field in _fields(_matrix(content()[1]).values):
            if length := len(field.content):  # an empty array has none
                inner = partial(_unchanged, length, field)
                yield from _arrays(_matrix(field), f"{label}.{name}", length, inner, depth + 1)
        return
    kind = _KINDS.get(matrix.kind, "complex numbers" if matrix.is_complex else NUMBERS)
    if matrix.kind == _CHAR:
        kind = TEXT if matrix.size in matrix.shape or not matrix.size else "several texts"
    require(
        kind not in (NUMBERS, TEXT) or length <= _BEGINNING + 8 * matrix.size,
        f"the MAT file is damaged: variable {shown(label)} has {length:,} bytes for {matrix.size:,} values",
    )
    yield Array(label, matrix.shape, kind, 8, partial(_values, content))


def _unchanged(length: int, field: _Element) -> tuple[int, _Element]:
    return length, field


def _fields(parts: Iterator[_Element]) -> Iterator[tuple[str, _Element]]:
    """Names and matrices of a struct's fields."""
    width, names = int(next(parts).numbers()[0]), next(parts)
    require(width > 0, "the MAT file is damaged: the fields of a struct have no names")
    for start in range(0, len(names.content) // width * width, width):
        field = next(parts)
        require(field.type == _MATRIX, f"the MAT file is damaged: a field is an element of type {field.type}")
        yield names._replace(type=1, content=names.content[start : start + width]).text(), field


def _values(content: Callable[[], tuple[int, _Element]]) -> npt.NDArray[np.generic] | str:
    """The numbers of a matrix, or its text."""
    matrix = _matrix(content()[1])
    if not matrix.size:
        return "" if matrix.kind == _CHAR else np.empty(matrix.shape)
    values = next(matrix.values)
    return values.text() if matrix.kind == _CHAR else values.numbers().reshape(matrix.shape, order="F")


def _matrix(element: _Element) -> _Matrix:
    parts = element.parts()
    flags, _ = _tag(next(parts).content, element.order)
    if flags & 0xFF == _OPAQUE:  # it has no dimensions
        return _Matrix(_OPAQUE, False, (), next(parts).text(), parts)
    shape = tuple(next(parts).numbers().tolist())
    is_shape = 0 < len(shape) <= _MOST_AXES and min(shape) >= 0
    require(is_shape, "the MAT file is damaged: a variable has no dimensions, or negative ones")
    return _Matrix(flags & 0xFF, bool(flags & _COMPLEX), shape, next(parts).text(), parts)


def _tag(data: bytes | memoryview, order: str) -> tuple[int, int]:
    """The two numbers with which an element begins."""
    require(len(data) >= 8, "the MAT file is cut: the tag of an element is incomplete")
    first, second = np.frombuffer(data, f"{order}u4", 2).tolist()
    return first, second
