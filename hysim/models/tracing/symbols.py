"""Arithmetic that is recorded while it runs, and written down in C99 and in JavaScript.

A `Tape` holds the operations that were done on symbols, each once, in an order in which they can be computed. The
operations are those of numpy; a symbol stands for a number or for a truth value.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammainc


class Operation(NamedTuple):
    """An operation in Python, in C99 and in JavaScript; its operands are ``{0}``, ``{1}`` and ``{2}``."""

    evaluate: Callable[..., Any]
    c: str
    js: str


class UntraceableError(ValueError):
    """A number that arithmetic alone cannot compute from the fields: the code branches on it or counts by it."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        super().__init__(f"{', '.join(names)} cannot be traced")


def _same(text: str) -> tuple[str, str]:
    return text, text


def _call(name: str, n: int = 1) -> tuple[str, str]:
    arguments = ", ".join(f"{{{k}}}" for k in range(n))
    return f"{name}({arguments})", f"Math.{name}({arguments})"


OPERATIONS: dict[str, Operation] = {
    "add": Operation(np.add, *_same("({0} + {1})")),
    "subtract": Operation(np.subtract, *_same("({0} - {1})")),
    "multiply": Operation(np.multiply, *_same("({0} * {1})")),
    "divide": Operation(np.divide, *_same("({0} / {1})")),
    "negative": Operation(np.negative, *_same("(-{0})")),
    "square": Operation(np.square, *_same("({0} * {0})")),
    "reciprocal": Operation(np.reciprocal, *_same("(1.0 / {0})")),
    "power": Operation(np.power, *_call("pow", 2)),
    "absolute": Operation(np.absolute, "fabs({0})", "Math.abs({0})"),
    "sqrt": Operation(np.sqrt, *_call("sqrt")),
    "exp": Operation(np.exp, *_call("exp")),
    "exp2": Operation(np.exp2, "exp2({0})", "Math.pow(2.0, {0})"),
    "expm1": Operation(np.expm1, *_call("expm1")),
    "log": Operation(np.log, *_call("log")),
    "log2": Operation(np.log2, *_call("log2")),
    "log1p": Operation(np.log1p, *_call("log1p")),
    "tanh": Operation(np.tanh, *_call("tanh")),
    "floor": Operation(np.floor, *_call("floor")),
    "trunc": Operation(np.trunc, *_call("trunc")),
    "rint": Operation(np.rint, "rint({0})", "@rounded({0})"),
    "sign": Operation(np.sign, *_same("({0} > 0.0 ? 1.0 : {0} < 0.0 ? -1.0 : {0} == 0.0 ? 0.0 : {0})")),
    "maximum": Operation(np.maximum, "@larger({0}, {1})", "Math.max({0}, {1})"),
    "minimum": Operation(np.minimum, "@smaller({0}, {1})", "Math.min({0}, {1})"),
    "single": Operation(np.float32, "(double)(float){0}", "Math.fround({0})"),
    "exponent": Operation(lambda x: np.float64(np.frexp(x)[1]), *_same("@exponent({0})")),
    "ldexp": Operation(lambda x, k: np.ldexp(x, np.int32(k)), *_same("@scaled({0}, {1})")),
    "gammainc": Operation(gammainc, *_same("@gamma_share({0}, {1})")),
    "less": Operation(np.less, *_same("({0} < {1})")),
    "less_equal": Operation(np.less_equal, *_same("({0} <= {1})")),
    "greater": Operation(np.greater, *_same("({0} > {1})")),
    "greater_equal": Operation(np.greater_equal, *_same("({0} >= {1})")),
    "equal": Operation(np.equal, "({0} == {1})", "({0} === {1})"),
    "not_equal": Operation(np.not_equal, "({0} != {1})", "({0} !== {1})"),
    "isfinite": Operation(np.isfinite, "(fabs({0}) < INFINITY)", "Number.isFinite({0})"),
    "isinf": Operation(np.isinf, *_same("({0} - {0} != 0.0 && {0} == {0})")),
    "isnan": Operation(np.isnan, *_same("({0} != {0})")),
    "signbit": Operation(np.signbit, "(copysign(1.0, {0}) < 0.0)", "({0} < 0.0 || 1.0 / {0} < 0.0)"),
    "both": Operation(np.logical_and, *_same("({0} && {1})")),
    "either": Operation(np.logical_or, *_same("({0} || {1})")),
    "not": Operation(np.logical_not, *_same("(!{0})")),
    "where": Operation(lambda which, yes, no: yes if which else no, *_same("({0} ? {1} : {2})")),
}

_COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
_TESTS = ("isfinite", "isinf", "isnan", "signbit")
TRUTH_VALUES = frozenset((*_COMPARISONS, *_TESTS, "both", "either", "not"))
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
        return self.tape.texts((self,), "c")[1][0]


class Tape:
    """Operations on fields, in an order in which they can be computed.

    Parameters
    ----------
    names : tuple of str
        The fields.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._entries: list[tuple[str, tuple[Number, ...]]] = [("field", (k,)) for k in range(len(names))]
        self._places: dict[Any, int] = {}

    def field(self, k: int) -> Symbol:
        """The field number `k`."""
        return Symbol(self, k)

    def record(self, operation: str, *operands: Number) -> Symbol:
        """The result of an operation."""
        key = operation, *(_key(operand) for operand in operands)
        if key not in self._places:
            self._places[key] = len(self._entries)
            self._entries.append((operation, operands))
        return Symbol(self, self._places[key])

    def is_truth_value(self, number: Number) -> bool:
        """Whether a number is true or false."""
        if isinstance(number, Symbol):
            return self._entries[number.place][0] in TRUTH_VALUES
        return isinstance(number, (bool, np.bool_))

    def needed(self, numbers: Iterable[Number]) -> list[int]:
        """Places of the operations that lead to these numbers, in their order."""
        seen: set[int] = set()
        waiting = [number.place for number in numbers if isinstance(number, Symbol)]
        while waiting:
            place = waiting.pop()
            if place not in seen:
                seen.add(place)
                waiting += [operand.place for operand in self._entries[place][1] if isinstance(operand, Symbol)]
        return sorted(seen)

    def fields_of(self, number: Number) -> tuple[str, ...]:
        """Names of the fields on which a number depends."""
        return tuple(self.names[place] for place in self.needed((number,)) if place < len(self.names))

    def operations(self, numbers: Iterable[Number]) -> Iterator[tuple[int, str, tuple[Number, ...]]]:
        """Place, name and operands of each operation that leads to these numbers, in their order."""
        for place in self.needed(numbers):
            yield (place, *self._entries[place])

    def evaluate(self, numbers: Sequence[Number], values: Sequence[float]) -> list[float]:
        """The numbers for these values of the fields."""
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

    def texts(self, numbers: Sequence[Number], language: str) -> tuple[list[tuple[str, str]], list[str]]:
        """Names and texts of what occurs more than once, in an order to compute them in, and the texts of the numbers.

        Names of helping functions begin with ``@``.
        """
        places = self.needed(numbers)
        uses = dict.fromkeys(places, 0)
        for number in (*numbers, *(operand for place in places for operand in self._operands(place))):
            if isinstance(number, Symbol):
                uses[number.place] += 1
        written: dict[int, str] = {}
        locals_: list[tuple[str, str]] = []

        def text(number: Number) -> str:
            return written[number.place] if isinstance(number, Symbol) else literal(number, language)

        for place in places:
            operation, operands = self._entries[place]
            if operation == "field":
                written[place] = f"fields[{place}]"
                continue
            template = OPERATIONS[operation].c if language == "c" else OPERATIONS[operation].js
            written[place] = template.format(*map(text, operands))
            if uses[place] > 1 or any(template.count(f"{{{k}}}") > 1 for k in range(len(operands))):
                locals_.append((f"t{place}", written[place]))
                written[place] = f"t{place}"
        return locals_, [text(number) for number in numbers]

    def truth_values(self) -> frozenset[str]:
        """Names in `texts` of what is true or false."""
        return frozenset(f"t{k}" for k, (operation, _) in enumerate(self._entries) if operation in TRUTH_VALUES)

    def _operands(self, place: int) -> tuple[Number, ...]:
        """The symbols of an operation, as often as its text names them."""
        operation, operands = self._entries[place]
        if operation == "field":
            return ()
        times = OPERATIONS[operation].c.count
        return tuple(operand for k, operand in enumerate(operands) for _ in range(times(f"{{{k}}}")))


def _key(number: Number) -> Any:
    if isinstance(number, Symbol):
        return number.place
    return number if isinstance(number, (bool, np.bool_)) else float(number).hex()


def literal(number: Number, language: str) -> str:
    """A constant as C99 or JavaScript has it."""
    if isinstance(number, (bool, np.bool_)):
        return ("1" if number else "0") if language == "c" else ("true" if number else "false")
    x = float(number)
    if math.isnan(x):
        return "NAN" if language == "c" else "NaN"
    if math.isinf(x):
        name = "INFINITY" if language == "c" else "Infinity"
        return name if x > 0.0 else f"(-{name})"
    text = format(x, ".17g")
    text = text if any(mark in text for mark in ".e") else f"{text}.0"
    return f"({text})" if text.startswith("-") else text


_GAMMA_LINES = """\
    {let} shifted = a + 1.0, product = 1.0, term = 1.0, sum = 1.0;
    if (!(x > 0.0)) return x === 0.0 ? 0.0 : {nan};
    if (x - x !== 0.0) return 1.0;
    while (shifted < 12.0) {{
        product *= shifted;
        shifted += 1.0;
    }}
    {let} r = 1.0 / (shifted * shifted);
    {let} series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r * (1.0 / 1680.0 - r * (1.0 / 1188.0
        - r * (691.0 / 360360.0 - r / 156.0)))))) / shifted;
    {let} log_gamma = (shifted - 0.5) * {log}(shifted) - shifted + 0.91893853320467274 + series - {log}(product);
    {let} front = {exp}(a * {log}(x) - x - log_gamma);
    if (x < a + 1.0) {{
        for ({int} k = 1; k < 10000 && term > 1e-17 * sum; k++) {{
            term *= x / (a + k);
            sum += term;
        }}
        return front * sum;
    }}
    {let} b = x + 1.0 - a, c = 1e300, d = 1.0 / b, fraction = d;
    for ({int} k = 1; k < 10000; k++) {{
        {let} numerator = -k * (k - a);
        b += 2.0;
        d = numerator * d + b;
        d = 1.0 / (d === 0.0 ? 1e-300 : d);
        c = b + numerator / c;
        c = c === 0.0 ? 1e-300 : c;
        fraction *= c * d;
        if ({abs}(c * d - 1.0) < 1e-16) break;
    }}
    return 1.0 - front * a * fraction;
"""
_C_WORDS = {"let": "double", "nan": "NAN", "log": "log", "exp": "exp", "abs": "fabs", "int": "int"}
_JS_WORDS = {"let": "let", "nan": "NaN", "log": "Math.log", "exp": "Math.exp", "abs": "Math.abs", "int": "let"}

HELPERS: Mapping[str, Mapping[str, str]] = {
    "c": {
        "larger": "static double @larger(double a, double b)\n{\n    return a >= b || a != a ? a : b;\n}\n",
        "smaller": "static double @smaller(double a, double b)\n{\n    return a <= b || a != a ? a : b;\n}\n",
        "exponent": "static double @exponent(double x)\n{\n    int k = 0;\n    (void)frexp(x, &k);\n    return k;\n}\n",
        "scaled": "static double @scaled(double x, double k)\n{\n"
        "    return ldexp(x, k > 10000.0 ? 10000 : k > -10000.0 ? (int)k : -10000);\n}\n",
        "gamma_share": "/* Regularised lower incomplete gamma function P(a, x), a > 0. */\n"
        "static double @gamma_share(double a, double x)\n{\n"
        + _GAMMA_LINES.format(**_C_WORDS).replace("===", "==").replace("!==", "!=")
        + "}\n",
    },
    "js": {
        "rounded": "function @rounded(x) {\n    const low = Math.floor(x), part = x - low;\n"
        "    return part < 0.5 || (part === 0.5 && low % 2.0 === 0.0) || !Number.isFinite(x) ? "
        "(part < 0.5 ? low : Number.isFinite(x) ? low : x) : low + 1.0;\n}\n",
        "exponent": "function @exponent(x) {\n    if (x === 0.0 || !Number.isFinite(x)) return 0.0;\n"
        "    let size = Math.abs(x), k = 0.0;\n"
        "    while (size >= 1.0) { size *= 0.5; k += 1.0; }\n"
        "    while (size < 0.5) { size *= 2.0; k -= 1.0; }\n    return k;\n}\n",
        "scaled": "function @scaled(x, k) {\n    let left = Math.max(-4000.0, Math.min(4000.0, k));\n"
        "    while (left > 1000.0) { x *= 2.0 ** 1000.0; left -= 1000.0; }\n"
        "    while (left < -1000.0) { x *= 2.0 ** -1000.0; left += 1000.0; }\n"
        "    return x * 2.0 ** left;\n}\n",
        "gamma_share": "// Regularised lower incomplete gamma function P(a, x), a > 0.\n"
        "function @gamma_share(a, x) {\n" + _GAMMA_LINES.format(**_JS_WORDS) + "}\n",
    },
}
"""Functions that the texts of operations call, by language and name."""
