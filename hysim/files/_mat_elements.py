"""The elements of MAT files of version 5.

An element is a type, a number of bytes, and these, padded to eight; four bytes or fewer may stand in the tag itself.
A matrix is an element that holds elements: flags with its class, its dimensions, its name, and what is in it. Every
length is checked against what is left around it before anything is taken.

Source: MathWorks, MAT-File Format.
"""

import math
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import MOST_BYTES
from hysim.files._table import UnreadableError

MATRIX, COMPRESSED = 14, 15
STRUCT, CHAR = 2, 4

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_LETTERS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_COMPLEX = 0x800
_MOST_AXES = 32


class Element(NamedTuple):
    """The type and the bytes of an element."""

    type: int
    content: memoryview


class Matrix(NamedTuple):
    """What a matrix says of itself, and where its numbers or fields begin."""

    kind: int
    is_complex: bool
    shape: tuple[int, ...]
    name: str
    start: int

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


class Reader(NamedTuple):
    """Reads elements with numbers in the byte order ``"<"`` or ``">"``."""

    order: str

    def words(self, data: bytes | memoryview) -> tuple[int, int]:
        """The two numbers of a tag."""
        if len(data) < 8:
            raise UnreadableError("the MAT file is cut: an element has no whole tag")
        first, second = np.frombuffer(data, f"{self.order}u4", 2).tolist()
        return first, second

    def element(self, data: memoryview, at: int) -> tuple[Element, int]:
        """The element that begins there, and where the next one does."""
        kind, length = self.words(data[at : at + 8])
        if kind >> 16:  # both in the first four bytes, and the content in the other four
            kind, length = kind & 0xFFFF, kind >> 16
            start, stop = at + 4, at + 8
        else:
            start = at + 8
            stop = start + length + (-length % 8 if kind != MATRIX else 0)
        if start + length > min(stop, len(data)):
            raise UnreadableError(f"the MAT file is damaged: an element of {length:,} bytes does not fit where it is")
        return Element(kind, data[start : start + length]), stop

    def matrix(self, data: memoryview) -> Matrix:
        """What the matrix with this content, or the beginning of it, says of itself."""
        flags, at = self.element(data, 0)
        word = self.words(flags.content)[0]
        if word & 0xFF == 17:  # an object: it has no dimensions
            name, at = self.element(data, at)
            return Matrix(17, False, (), self.text(name), at)
        axes, at = self.element(data, at)
        shape = tuple(self.numbers(axes).tolist())
        if not 0 < len(shape) <= _MOST_AXES or min(shape) < 0:
            raise UnreadableError("the MAT file is damaged: a variable has no dimensions, or negative ones")
        name, at = self.element(data, at)
        return Matrix(word & 0xFF, bool(word & _COMPLEX), shape, self.text(name), at)

    def fields(self, data: memoryview, at: int) -> Iterator[tuple[str, memoryview]]:
        """The names and contents of a struct's fields, which begin there."""
        width, at = self.element(data, at)
        names, at = self.element(data, at)
        step = int(self.numbers(width)[0])
        if step < 1:
            raise UnreadableError("the MAT file is damaged: the fields of a struct have no names")
        for start in range(0, len(names.content) // step * step, step):
            inner, at = self.element(data, at)
            if inner.type != MATRIX:
                raise UnreadableError(f"the MAT file is damaged: a field is an element of type {inner.type}")
            yield self.text(Element(1, names.content[start : start + step])), inner.content

    def numbers(self, element: Element) -> npt.NDArray[np.generic]:
        """The numbers of an element."""
        if element.type not in _NUMBERS:
            raise UnreadableError(f"the MAT file is damaged: numbers in an element of type {element.type}")
        return np.frombuffer(element.content, self.order + _NUMBERS[element.type])

    def text(self, element: Element) -> str:
        """The text of an element."""
        if element.type not in _LETTERS:
            raise UnreadableError(f"the MAT file is damaged: letters in an element of type {element.type}")
        encoding = _LETTERS[element.type]
        if encoding in ("utf-16", "utf-32"):
            encoding += "-le" if self.order == "<" else "-be"
        return bytes(element.content).decode(encoding, "replace").rstrip("\0")

    def inflated(self, data: bytes) -> memoryview:
        """The content of the matrix that is compressed so."""
        stream = zlib.decompressobj()
        kind, length = self.words(stream.decompress(data, 8))
        if kind != MATRIX:
            raise UnreadableError(f"the MAT file is damaged: an element of type {kind} is compressed")
        if length > MOST_BYTES:
            raise UnreadableError(f"a variable of {length:,} bytes is too large: at most {MOST_BYTES:,} are read")
        content = stream.decompress(stream.unconsumed_tail, length + 1)
        if len(content) != length:
            raise UnreadableError(
                f"the MAT file is damaged: a compressed variable does not have the {length:,} bytes it says"
            )
        return memoryview(content)

    def beginning(self, data: bytes, most: int) -> tuple[int, memoryview]:
        """The length of the matrix whose compressed form begins so, and its first bytes."""
        content = zlib.decompressobj().decompress(data, most)
        kind, length = self.words(content)
        if kind != MATRIX:
            raise UnreadableError(f"the MAT file is damaged: an element of type {kind} is compressed")
        return length, memoryview(content)[8:]
