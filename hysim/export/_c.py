"""C99 for the translator: types, numbers and tables as text, and the functions of Python that C lacks.

Types are numbers, vectors of doubles, functions known in advance, and tuples of numbers.
"""

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

HELPERS = MappingProxyType(
    {
        "smaller": "static double smaller(double a, double b) { return b < a ? b : a; }",
        "larger": "static double larger(double a, double b) { return b > a ? b : a; }",
        "smaller_int": "static int smaller_int(int a, int b) { return b < a ? b : a; }",
        "larger_int": "static int larger_int(int a, int b) { return b > a ? b : a; }",
        "absolute_int": "static int absolute_int(int a) { return a < 0 ? -a : a; }",
        "below": "static int below(int a, int b) { return a % b != 0 && (a < 0) != (b < 0); }",
        "floor_quotient": "static int floor_quotient(int a, int b) { return a / b - below(a, b); }",
        "floor_rest": "static int floor_rest(int a, int b) { return a % b + below(a, b) * b; }",
        "power_2": "static double power_2(double x) { return x * x; }",
        "power_3": "static double power_3(double x) { return x * (x * x); }",
        "power_4": "static double power_4(double x) { return (x * x) * (x * x); }",
    }
)
"""Functions of Python that C lacks; `min` and `max` keep the first of two that are not ordered."""

RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long main
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    NAN INFINITY NULL errno
    """.split()  # noqa: SIM905
)
"""Words that are no names in C."""

HEADERS = frozenset(
    """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef stdint
    stdio stdlib string tgmath time wchar wctype
    """.split()  # noqa: SIM905
)
"""Headers of C99: a file of this name could hide one."""

MATHEMATICS = frozenset(
    """
    acos acosh asin asinh atan atan2 atanh copysign cos cosh erf erfc exp expm1 fabs fmod hypot lgamma log log10 log1p
    log2 pow sin sinh sqrt tan tanh ceil floor trunc
    """.split()  # noqa: SIM905
)
"""Functions of `math` that C has; the last three are whole numbers in Python, as doubles they do not overflow."""
TESTS = frozenset(("isfinite", "isinf", "isnan"))
"""Functions of `math` with a truth value."""


def number(value: float) -> str:
    """A double in C, with all its digits."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    text = repr(float(value))
    return text if "." in text or "e" in text else text + ".0"


def table(name: str, values: Sequence[float]) -> str:
    """A vector of constants in C; a vector without numbers has one, since C has no empty arrays."""
    numbers = [number(value) for value in values] or ["0.0"]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    return f"static const double {name}[{len(numbers)}] = {{\n    " + ",\n    ".join(rows) + "\n};"


def is_table(value: Any) -> bool:
    """Whether a value is a vector of doubles."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and value.dtype == np.float64
    return isinstance(value, tuple) and bool(value) and all(isinstance(each, float) for each in value)


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
