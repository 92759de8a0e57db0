"""MAT files of version 5, which MATLAB writes by ``save -v6`` and, compressed, by ``save -v7``.

A file is a header of 128 bytes and a matrix for each variable. They are read here and not by `scipy.io.loadmat`,
because that trusts the file: cells in cells, 100 000 deep, end its process.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import MOST_BYTES, NUMBERS, TEXT, Array, Arrays, with_notes
from hysim.files._mat_elements import CHAR, COMPRESSED, MATRIX, STRUCT, Matrix, Reader
from hysim.files._table import UnreadableError, damaged, shown

_HEADER_BYTES = 128
_BEGINNING = 8192  # bytes that hold what a matrix says of itself
_DEEPEST = 16  # structs in structs
_KINDS = {1: "cells", 2: "several structs", 3: "an object", 5: "a sparse matrix", 16: "a function", 17: "an object"}


def mat(file: BinaryIO) -> Arrays:
    """The arrays of a file, those in structs among them.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    with damaged("MAT"):
        header = file.read(_HEADER_BYTES)
        if len(header) < _HEADER_BYTES:
            raise UnreadableError("the MAT file is cut: it has no whole header")
        reader = Reader("<" if header[126:] == b"IM" else ">")
        return with_notes(list(_variables(file, reader)), "MAT")


def _variables(file: BinaryIO, reader: Reader) -> Iterator[Array]:
    end, at, spent = file.seek(0, 2), _HEADER_BYTES, 0
    while at < end:
        file.seek(at)
        kind, length = reader.words(file.read(8))
        if at + 8 + length > end:
            raise UnreadableError(f"the MAT file is cut: a variable has {length:,} bytes, there are {end - at - 8:,}")
        beginning = file.read(min(length, _BEGINNING))
        if kind == COMPRESSED:
            whole, view = reader.beginning(beginning, _BEGINNING)
        elif kind == MATRIX:
            whole, view = length, memoryview(beginning)
        else:
            raise UnreadableError(f"the MAT file is damaged: an element of type {kind} where a variable begins")
        matrix = reader.matrix(view)
        content = partial(_content, file, reader, at + 8, length, kind)
        at += 8 + length
        if matrix.kind == STRUCT and matrix.size == 1:
            spent += whole
            if spent > MOST_BYTES:
                raise UnreadableError(
                    f"the structs have more than {MOST_BYTES:,} bytes: save their fields as variables"
                )
            yield from _struct(reader, content(), matrix, matrix.name, 0)
        elif matrix.name:  # what has none belongs to an object
            yield _array(reader, matrix, matrix.name, whole, content)


def _content(file: BinaryIO, reader: Reader, at: int, length: int, kind: int) -> memoryview:
    """The content of the variable in this place of the file."""
    file.seek(at)
    data = file.read(length)
    return reader.inflated(data) if kind == COMPRESSED else memoryview(data)


def _struct(reader: Reader, data: memoryview, matrix: Matrix, label: str, depth: int) -> Iterator[Array]:
    """The arrays of a struct's fields, as ``label.field``."""
    for field, content in reader.fields(data, matrix.start):
        if not content.nbytes:  # an empty array
            continue
        inner, name = reader.matrix(content), f"{label}.{field}"
        if inner.kind == STRUCT and inner.size == 1 and depth < _DEEPEST:
            yield from _struct(reader, content, inner, name, depth + 1)
        else:
            yield _array(reader, inner, name, content.nbytes, partial(_same, content))


def _same(content: memoryview) -> memoryview:
    return content


def _array(reader: Reader, matrix: Matrix, label: str, length: int, content: Callable[[], memoryview]) -> Array:
    kind = _KINDS.get(matrix.kind, "complex numbers" if matrix.is_complex else NUMBERS)
    if matrix.kind == CHAR:
        kind = TEXT if matrix.size in matrix.shape or not matrix.size else "several texts"
    if kind in (NUMBERS, TEXT) and length > _BEGINNING + 8 * matrix.size:
        raise UnreadableError(
            f"the MAT file is damaged: variable {shown(label)} has {length:,} bytes for {matrix.size:,} values"
        )
    read = partial(_text if matrix.kind == CHAR else _numbers, reader, label, content)
    return Array(label, matrix.shape, kind, 8, read)


def _text(reader: Reader, label: str, content: Callable[[], memoryview]) -> str:
    data = content()
    matrix = reader.matrix(data)
    return reader.text(reader.element(data, matrix.start)[0]) if matrix.size else ""


def _numbers(reader: Reader, label: str, content: Callable[[], memoryview]) -> npt.NDArray[np.generic]:
    data = content()
    matrix = reader.matrix(data)
    values = reader.numbers(reader.element(data, matrix.start)[0]) if matrix.size else np.empty(0)
    if values.size != matrix.size:
        raise UnreadableError(
            f"the MAT file is damaged: variable {shown(label)} has {values.size:,} numbers for the shape {matrix.shape}"
        )
    return values.reshape(matrix.shape, order="F")
