"""Numbers and tables in C99, and the functions of Python that C lacks."""

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

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
