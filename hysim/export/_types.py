"""The types of the translator: numbers, vectors of doubles, functions known in advance, and tuples of numbers."""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple


class Scalar(IntEnum):
    """A number; of two types that meet, the later one holds both."""

    BOOL = 0
    INT = 1
    DOUBLE = 2

    @property
    def c_type(self) -> str:
        """Type in C."""
        return "double" if self is Scalar.DOUBLE else "int"


class Vector(NamedTuple):
    """A contiguous array of doubles with this number of axes."""

    rank: int = 1

    def length(self, name: str, axis: int) -> str:
        """Name in C of the length of an axis."""
        return f"{name}_size" if self.rank == 1 else f"{name}_shape{axis}"


class Known(NamedTuple):
    """A value that is known when the program is translated: a function, or None."""

    value: Callable[..., Any] | None


class Several(NamedTuple):
    """Numbers that a function returns together."""

    members: tuple[Scalar, ...]

    @property
    def c_type(self) -> str:
        """Name of the struct in C."""
        return "several_" + "".join("d" if member is Scalar.DOUBLE else "i" for member in self.members)


Type = Scalar | Vector | Known | Several


def joined(first: Type | None, second: Type) -> Type | None:
    """The type that holds values of both, None where there is none."""
    if first is None or first == second:
        return second
    if isinstance(first, Scalar) and isinstance(second, Scalar):
        return max(first, second)
    if isinstance(first, Several) and isinstance(second, Several) and len(first.members) == len(second.members):
        return Several(tuple(max(pair) for pair in zip(first.members, second.members, strict=True)))
    return None
