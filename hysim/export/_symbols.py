"""Arithmetic on symbols, recorded on a `Tape` while it runs, each operation once, and written in C99 and JavaScript."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammainc


class Operation(NamedTuple):
    """An operation in Python and in C99; its operands are ``{0}``, ``{1}`` and ``{2}``, helpers begin with ``@``."""

    evaluate: Callable[..., Any]
    text: str


class UntraceableError(ValueError):
    """A number that arithmetic alone cannot compute from the fields: the code branches on it or counts by it."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        super().__init__(f"{', '.join(names)} cannot be traced")


_FUNCTIONS = (np.sqrt, np.exp, np.expm1, np.log, np.log2, np.log1p, np.tanh, np.floor, np.trunc)
_SIGNS: dict[np.ufunc, str] = {
    **{np.add: "+", np.subtract: "-", np.multiply: "*", np.divide: "/"},
    **{np.less: "<", np.less_equal: "<=", np.greater: ">", np.greater_equal: ">=", np.equal: "==", np.not_equal: "!="},
    **{np.logical_and: "&&", np.logical_or: "||"},
}
OPERATIONS: dict[str, Operation] = {
    **{function.__name__: Operation(function, f"{function.__name__}({{0}})") for function in _FUNCTIONS},
    **{function.__name__: Operation(function, f"({{0}} {sign} {{1}})") for function, sign in _SIGNS.items()},
    "negative": Operation(np.negative, "(-{0})"),
    "square": Operation(np.square, "({0} * {0})"),
    "reciprocal": Operation(np.reciprocal, "(1.0 / {0})"),
    "power": Operation(np.power, "pow({0}, {1})"),
    "absolute": Operation(np.absolute, "fabs({0})"),
    "sign": Operation(np.sign, "({0} > 0.0 ? 1.0 : {0} < 0.0 ? -1.0 : {0} == 0.0 ? 0.0 : {0})"),
    "maximum": Operation(np.maximum, "@larger({0}, {1})"),
    "minimum": Operation(np.minimum, "@smaller({0}, {1})"),
    "gammainc": Operation(gammainc, "@gamma_share({0}, {1})"),
    "isfinite": Operation(np.isfinite, "(fabs({0}) < INFINITY)"),
    "isinf": Operation(np.isinf, "({0} - {0} != 0.0 && {0} == {0})"),
    "isnan": Operation(np.isnan, "({0} != {0})"),
    "signbit": Operation(np.signbit, "@is_negative({0})"),
    "logical_not": Operation(np.logical_not, "(!{0})"),
    "where": Operation(lambda which, yes, no: yes if which else no, "({0} ? {1} : {2})"),
}

_COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
_TESTS = ("isfinite", "isinf", "isnan", "signbit", "logical_and", "logical_or", "logical_not")
TRUTH_VALUES = frozenset((*_COMPARISONS, *_TESTS))
"""Operations whose result is a truth value."""

Number = Any
"""A symbol, a float or a truth value."""


class Symbol:
    """A number that is known where the program runs: an operation on the tape."""

    __slots__ = ("place", "tape")

    def __init__(self, tape: "Tape", place: int) -> None:
        self.tape, self.place = tape, place

    def _refused(self, *_: Any) -> Any:
        raise UntraceableError(self.tape.fields_of(self))

    __float__ = __bool__ = __int__ = __index__ = __complex__ = _refused

    def __repr__(self) -> str:
        return self.tape.texts((self,))[1][0]


class Tape:
    """Operations on the fields `names`, in an order in which they can be computed."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._entries: list[tuple[str, tuple[Number, ...]]] = [("field", (k,)) for k in range(len(names))]
        self._places: dict[Any, int] = {}

    def field(self, k: int) -> Symbol:
        return Symbol(self, k)

    def record(self, operation: str, *operands: Number) -> Symbol:
        key = operation, *(_key(operand) for operand in operands)
        if key not in self._places:
            self._places[key] = len(self._entries)
            self._entries.append((operation, operands))
        return Symbol(self, self._places[key])

    def needed(self, numbers: Iterable[Number]) -> list[int]:
        seen: set[int] = set()
        waiting = [number.place for number in numbers if isinstance(number, Symbol)]
        while waiting:
            place = waiting.pop()
            if place not in seen:
                seen.add(place)
                waiting += [operand.place for operand in self._entries[place][1] if isinstance(operand, Symbol)]
        return sorted(seen)

    def fields_of(self, number: Number) -> tuple[str, ...]:
        return tuple(self.names[place] for place in self.needed((number,)) if place < len(self.names))

    def evaluate(self, numbers: Sequence[Number], values: Sequence[float]) -> list[float]:
        results: dict[int, Any] = {}

        def value(number: Number) -> Any:
            return results[number.place] if isinstance(number, Symbol) else number

        with np.errstate(all="ignore"):
            for place in self.needed(numbers):
                operation, operands = self._entries[place]
                if operation == "field":
                    results[place] = np.float64(values[place])
                else:
                    results[place] = OPERATIONS[operation].evaluate(*map(value, operands))
        return [float(value(number)) for number in numbers]

    def texts(self, numbers: Sequence[Number]) -> tuple[list[tuple[str, str]], list[str]]:
        """Names and texts of what occurs more than once, in order, and texts of the numbers; ``@`` marks helpers."""
        places = self.needed(numbers)
        uses = dict.fromkeys(places, 0)
        for number in (*numbers, *(operand for place in places for operand in self._operands(place))):
            if isinstance(number, Symbol):
                uses[number.place] += 1
        written: dict[int, str] = {}
        locals_: list[tuple[str, str]] = []

        def text(number: Number) -> str:
            return written[number.place] if isinstance(number, Symbol) else literal(number)

        for place in places:
            operation, operands = self._entries[place]
            if operation == "field":
                written[place] = f"fields[{place}]"
                continue
            template = OPERATIONS[operation].text
            written[place] = template.format(*map(text, operands))
            if uses[place] > 1 or any(template.count(f"{{{k}}}") > 1 for k in range(len(operands))):
                locals_.append((f"t{place}", written[place]))
                written[place] = f"t{place}"
        return locals_, [text(number) for number in numbers]

    def truth_values(self) -> frozenset[str]:
        return frozenset(f"t{k}" for k, (operation, _) in enumerate(self._entries) if operation in TRUTH_VALUES)

    def _operands(self, place: int) -> tuple[Number, ...]:
        """The symbols of an operation, as often as its text names them."""
        operation, operands = self._entries[place]
        if operation == "field":
            return ()
        times = OPERATIONS[operation].text.count
        return tuple(operand for k, operand in enumerate(operands) for _ in range(times(f"{{{k}}}")))


def _key(number: Number) -> Any:
    if isinstance(number, Symbol):
        return number.place
    return number if isinstance(number, (bool, np.bool_)) else float(number).hex()


def literal(number: Number) -> str:
    """A constant as C99 has it."""
    if isinstance(number, (bool, np.bool_)):
        return "1" if number else "0"
    x = float(number)
    if math.isnan(x):
        return "NAN"
    if math.isinf(x):
        return "INFINITY" if x > 0.0 else "(-INFINITY)"
    text = format(x, ".17g")
    text = text if any(mark in text for mark in ".e") else f"{text}.0"
    return f"({text})" if text.startswith("-") else text


_GAMMA_SHARE = """\
/* Regularised lower incomplete gamma function P(a, x), a > 0. */
static double @gamma_share(double a, double x)
{
    double shifted = a + 1.0, product = 1.0, term = 1.0, sum = 1.0;
    if (!(x > 0.0)) return x == 0.0 ? 0.0 : NAN;
    if (x - x != 0.0) return 1.0;
    while (shifted < 12.0) {
        product *= shifted;
        shifted += 1.0;
    }
    double r = 1.0 / (shifted * shifted);
    double series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r * (1.0 / 1680.0 - r * (1.0 / 1188.0
        - r * (691.0 / 360360.0 - r / 156.0)))))) / shifted;
    double log_gamma = (shifted - 0.5) * log(shifted) - shifted + 0.91893853320467274 + series - log(product);
    double front = exp(a * log(x) - x - log_gamma);
    if (x < a + 1.0) {
        for (int k = 1; k < 10000 && term > 1e-17 * sum; k++) {
            term *= x / (a + k);
            sum += term;
        }
        return front * sum;
    }
    double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, fraction = d;
    for (int k = 1; k < 10000; k++) {
        double numerator = -k * (k - a);
        b += 2.0;
        d = numerator * d + b;
        d = 1.0 / (d == 0.0 ? 1e-300 : d);
        c = b + numerator / c;
        c = c == 0.0 ? 1e-300 : c;
        fraction *= c * d;
        if (fabs(c * d - 1.0) < 1e-16) break;
    }
    return 1.0 - front * a * fraction;
}
"""
HELPERS: Mapping[str, str] = {
    "larger": "static double @larger(double a, double b)\n{\n    return a >= b || a != a ? a : b;\n}\n",
    "smaller": "static double @smaller(double a, double b)\n{\n    return a <= b || a != a ? a : b;\n}\n",
    "is_negative": "static int @is_negative(double x)\n{\n    return copysign(1.0, x) < 0.0;\n}\n",
    "gamma_share": _GAMMA_SHARE,
}
"""Functions that the texts of operations call."""

_JS_HELPERS: Mapping[str, str] = {
    "is_negative": "const @is_negative = (x) => x < 0.0 || 1.0 / x < 0.0;\n",
}
"""Those that JavaScript has no words for in common with C."""

_IN_JS = (
    (r"\(void\)fields;", ""),
    (r"\b(const )?double \*|(?<=\()double |(?<=, )double ", ""),  # of arguments
    (r"\bstatic \w+ ", "function "),
    (r"\bconst (double|int) ", "const "),
    (r"\b(double|int) ", "let "),
    (r"\b(exp|expm1|floor|log|log1p|log2|pow|sqrt|tanh|trunc)\(", r"Math.\1("),
    (r"\bfabs\(", "Math.abs("),
    (r"\bINFINITY\b", "Infinity"),
    (r"\bNAN\b", "NaN"),
)


def helper(name: str, language: str) -> str:
    if language == "c":
        return HELPERS[name]
    return _JS_HELPERS.get(name) or in_javascript(HELPERS[name])


def in_javascript(text: str) -> str:
    """Functions of numbers and arrays in C99, as JavaScript has them: the operators are the same."""
    for pattern, replacement in _IN_JS:
        text = re.sub(pattern, replacement, text)
    return text
