"""The parameters of a step as expressions of a law's numbers.

`Law.pack` turns the fields of laws into what their step takes, in numpy. It is run once on arrays of symbols, which
record the arithmetic on a `Tape`, each operation once; the record is written as a function in C99 or JavaScript, for
programs whose numbers may still be changed where they run. The functions of numpy that laws take are those of `Traced`;
another one raises an `UntraceableError`, and so does a branch or a count that depends on a symbol.
"""

import functools
import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammainc

from hysim._basics.frozen import FloatArray
from hysim.export import _c
from hysim.models.law import Law

_MANY = 8  # equal numbers in a row

Number = Any
"""A symbol, a float or a truth value."""


class Operation(NamedTuple):
    """An operation in Python and in C99; its operands are ``{0}``, ``{1}`` and ``{2}``, helpers begin with ``@``."""

    evaluate: Callable[..., Any]
    text: str

    @property
    def c_type(self) -> str:
        tests = isinstance(self.evaluate, np.ufunc) and f"{'d' * self.evaluate.nin}->?" in self.evaluate.types
        return "int" if tests else "double"


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
_UFUNCS: dict[np.ufunc, str] = {
    **{each.evaluate: name for name, each in OPERATIONS.items() if isinstance(each.evaluate, np.ufunc)},
    **{np.bitwise_and: "logical_and", np.bitwise_or: "logical_or", np.invert: "logical_not"},
}
_POWERS = {1.0: "", 2.0: "square", 0.5: "sqrt", -1.0: "reciprocal"}
"""How numpy computes the power of an array to a plain number."""

_HELPERS = Path(__file__).with_name("c").joinpath("pack.c").read_text(encoding="utf-8").split("\n\n")
HELPERS = {text.partition("@")[2].partition("(")[0]: f"{text.strip()}\n" for text in _HELPERS}
"""Functions that the texts of operations call."""

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
"""C99 as JavaScript has it, in which the operators are the same: patterns and their replacements."""


class UntraceableError(ValueError):
    """A number that arithmetic alone cannot compute from the fields: the code branches on it or counts by it."""

    def __init__(self, numbers: Sequence["Symbol"]) -> None:
        self.names = tuple(dict.fromkeys(name for symbol in numbers for name in symbol.tape.fields_of(symbol)))
        super().__init__(f"{', '.join(self.names)} cannot be traced")


class Symbol:
    """A number that is known where the program runs: an operation on the tape."""

    __slots__ = ("place", "tape")

    def __init__(self, tape: "Tape", place: int) -> None:
        self.tape, self.place = tape, place

    def _refused(self, *_: Any) -> Any:
        raise UntraceableError((self,))

    __float__ = __bool__ = __int__ = __index__ = __complex__ = _refused

    def __repr__(self) -> str:
        return self.tape.texts((self,))[1][0]


class Tape:
    """Operations on the fields `names`, which stand first, in an order in which they can be computed."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.entries: list[tuple[str, tuple[Number, ...]]] = [("field", ()) for _ in names]
        self._places: dict[Any, int] = {}

    def record(self, operation: str, *operands: Number) -> Symbol:
        key = operation, *(_key(operand) for operand in operands)
        if key not in self._places:
            self._places[key] = len(self.entries)
            self.entries.append((operation, operands))
        return Symbol(self, self._places[key])

    def needed(self, numbers: Iterable[Number]) -> list[int]:
        """Places of the operations on which numbers depend, in order."""
        places = {number.place for number in numbers if isinstance(number, Symbol)}
        for place in reversed(range(len(self.entries))):
            if place in places:
                places |= {operand.place for operand in self.entries[place][1] if isinstance(operand, Symbol)}
        return sorted(places)

    def fields_of(self, number: Number) -> tuple[str, ...]:
        return tuple(self.names[place] for place in self.needed((number,)) if place < len(self.names))

    def texts(self, numbers: Sequence[Number]) -> tuple[list[str], list[str]]:
        """Declarations of what occurs more than once, in order, and texts of the numbers; ``@`` marks helpers."""
        written = {k: f"fields[{k}]" for k in range(len(self.names))}
        operations = {place: self.entries[place] for place in self.needed(numbers) if place not in written}
        uses = Counter(number.place for number in numbers if isinstance(number, Symbol))
        for operation, operands in operations.values():
            for k, operand in enumerate(operands):
                if isinstance(operand, Symbol):
                    uses[operand.place] += OPERATIONS[operation].text.count(f"{{{k}}}")

        def text(number: Number) -> str:
            return written[number.place] if isinstance(number, Symbol) else literal(number)

        declarations: list[str] = []
        for place, (operation, operands) in operations.items():
            template = OPERATIONS[operation].text
            written[place] = template.format(*map(text, operands))
            if uses[place] > 1 or any(template.count(f"{{{k}}}") > 1 for k in range(len(operands))):
                c_type, value = OPERATIONS[operation].c_type, _without_outer_parentheses(written[place])
                declarations.append(f"    const {c_type} t{place} = {value};")
                written[place] = f"t{place}"
        return declarations, [text(number) for number in numbers]


def _key(number: Number) -> Any:
    if isinstance(number, Symbol):
        return number.place
    return number if isinstance(number, (bool, np.bool_)) else float(number).hex()


def literal(number: Number) -> str:
    """A constant as C99 has it, as an operand of any operator."""
    text = str(int(number)) if isinstance(number, (bool, np.bool_)) else _c.number(number)
    return f"({text})" if text.startswith("-") else text


class Packing(NamedTuple):
    """Parameters and first memory of a law's step, as expressions of its numbers.

    `fields` are the numbers that may be changed, in the order of the law's `scalars`. `parameters` and `memory` are
    floats, and symbols on the `tape` that depend on the fields; `memory` begins with the last input, zero.
    """

    fields: tuple[str, ...]
    parameters: tuple[Number, ...]
    memory: tuple[Number, ...]
    tape: Tape

    def to_c(self, name: str) -> str:
        """C99 text of ``static void name(const double *fields, double *parameters, double *state)``."""
        declarations, texts = self.tape.texts((*self.parameters, *self.memory))
        size = len(self.parameters)
        lines = [*declarations, *_assignments("parameters", texts[:size]), *_assignments("state", texts[size:])]
        unused = () if any("fields[" in line for line in lines) else ("    (void)fields;",)
        head = f"static void {name}(const double *fields, double *parameters, double *state)\n{{"
        text = "\n".join((head, *unused, *lines, "}\n"))
        helpers = (helper for each, helper in HELPERS.items() if f"@{each}(" in text)
        return "\n".join((*helpers, text)).replace("@", f"{name}_")

    def to_js(self, name: str) -> str:
        """A function ``name(fields, parameters, state)`` in JavaScript that fills the last two."""
        text = self.to_c(name)
        for pattern, replacement in _IN_JS:
            text = re.sub(pattern, replacement, text)
        return text


def packing(law: Law, free: Iterable[str] | None = None) -> Packing:
    """Parameters of a law's step as expressions of its numbers.

    `free` names the numbers that may be changed, by default all `law.scalars` but `law.structural`; others are
    constants. A ValueError is raised if a name is unknown, or the step cannot be computed from it by arithmetic alone.
    """
    scalars, family = law.scalars, type(law).__name__
    names = [name for name in scalars if name not in law.structural] if free is None else list(free)
    if unknown := [name for name in names if name not in scalars]:
        raise ValueError(f"free names {unknown[0]!r}: a {family} has {', '.join(scalars)}")
    if chosen := [name for name in names if name in law.structural]:
        raise ValueError(f"{chosen[0]} of this {family} decides which step it has and cannot be free: leave it out")
    fields = tuple(name for name in scalars if name in names)
    tape = Tape(fields)
    columns: dict[str, Any] = {name: np.array([[Symbol(tape, k)]]).view(Traced) for k, name in enumerate(fields)}
    try:
        parameters, memory = law.pack(law.completed(law.exchanged(columns)))
        return Packing(fields, _row(parameters), _row(memory), tape)
    except UntraceableError as error:
        which = ", ".join(error.names)
        words = f"a page needs the parameters of this {family} as expressions of {which}: pack must not branch on them"
        raise ValueError(f"{words}, and relays must have no z0") from None


def _row(table: FloatArray) -> tuple[Number, ...]:
    return tuple(number if isinstance(number, Symbol) else float(number) for number in table[0].tolist())


def _assignments(target: str, texts: list[str]) -> list[str]:
    """Statements that fill an array; many equal numbers in a row are a loop."""
    lines, k = [], 0
    for text, run in itertools.groupby(texts):
        count, value = len(list(run)), _without_outer_parentheses(text)
        if count < _MANY:
            lines += [f"    {target}[{i}] = {value};" for i in range(k, k + count)]
        else:
            lines.append(f"    for (int k = {k}; k < {k + count}; k++) {target}[k] = {value};")
        k += count
    return lines


def _without_outer_parentheses(text: str) -> str:
    depths = list(itertools.accumulate((character == "(") - (character == ")") for character in text))
    return text[1:-1] if text.endswith(")") and all(depth > 0 for depth in depths[:-1]) else text


class Traced(np.ndarray[Any, np.dtype[np.object_]]):
    """An array of symbols and plain numbers, on which numpy's functions record what they do."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **others: Any) -> Any:
        if not _symbols(*inputs):
            methods: dict[str, Any] = {
                "__call__": ufunc, "reduce": ufunc.reduce, "accumulate": ufunc.accumulate, "outer": ufunc.outer,
            }  # fmt: skip
            return methods[method](*map(_plain, inputs), **{k: v for k, v in others.items() if k != "out"})
        if method == "accumulate" and ufunc is np.add:  # one after the other, as numpy adds
            rows = np.moveaxis(np.asarray(inputs[0]), axis := others.get("axis", 0), 0)
            sums = list(itertools.accumulate(rows, functools.partial(_elementwise, "add")))
            return np.moveaxis(np.array(sums, dtype=object), 0, axis).view(Traced)
        if method == "__call__" and ufunc is np.power and isinstance(inputs[1], (int, float)) and inputs[1] in _POWERS:
            operation = _POWERS[inputs[1]]
            return _elementwise(operation, inputs[0]) if operation else inputs[0]
        if method != "__call__" or ufunc not in _UFUNCS:
            raise UntraceableError(_symbols(*inputs))
        return _elementwise(_UFUNCS[ufunc], *inputs)

    def __array_function__(self, function: Any, types: Any, arguments: Any, others: Any) -> Any:
        if function is np.where:
            return _elementwise("where", *arguments)
        if function is np.clip:
            values, low, high = arguments
            return np.minimum(np.maximum(values, low), high)
        return _again(super().__array_function__(function, types, arguments, others))

    def any(self, *_: Any, **__: Any) -> Any:
        """Whether a number is not zero; one that may be changed may be that."""
        return any(isinstance(number, Symbol) or bool(number) for number in self.ravel().tolist())

    def astype(self, dtype: Any, *_: Any, **__: Any) -> Any:
        kind = np.dtype(dtype)
        if not _symbols(self):
            return _plain(self).astype(kind)
        if kind == np.float64:
            return self
        if kind.kind == "f":
            raise UntraceableError(_symbols(self))
        return _elementwise("trunc", self)


def _recorder(operation: str) -> Any:
    """A ufunc that records the operation if one of its numbers is a symbol, and computes it otherwise."""
    evaluate, text = OPERATIONS[operation]

    def apply(*operands: Number) -> Number:
        tapes = [operand.tape for operand in operands if isinstance(operand, Symbol)]
        is_choice = operation == "where"
        if not tapes or (is_choice and not isinstance(operands[0], Symbol)):
            return evaluate(*operands)
        if is_choice and operands[1] is operands[2]:
            return operands[1]
        kinds = (Symbol, bool, np.bool_)
        return tapes[0].record(operation, *(each if isinstance(each, kinds) else float(each) for each in operands))

    return np.frompyfunc(apply, sum(f"{{{k}}}" in text for k in range(3)), 1)


def _elementwise(operation: str, *arguments: Any) -> Any:
    """The result of an operation on arrays element by element, as an array of symbols."""
    arrays = [np.asarray(each, dtype=object) for each in arguments]
    return np.asarray(_recorder(operation)(*arrays), dtype=object).view(Traced)


def _again(result: Any) -> Any:
    """Arrays of symbols as such, where numpy returns plain ones."""
    if isinstance(result, (list, tuple)):
        return type(result)(_again(each) for each in result)
    plain = isinstance(result, np.ndarray) and result.dtype == object and not isinstance(result, Traced)
    return result.view(Traced) if plain else result


def _symbols(*inputs: Any) -> list[Symbol]:
    arrays = (each for each in inputs if isinstance(each, np.ndarray) and each.dtype == object)
    return [number for array in arrays for number in array.ravel().tolist() if isinstance(number, Symbol)]


def _plain(values: Any) -> Any:
    """Numbers as numpy has them, where none of them is a symbol."""
    if not isinstance(values, np.ndarray) or values.dtype != object:
        return values
    numbers = values.ravel().tolist()
    if all(isinstance(number, (bool, np.bool_)) for number in numbers):
        return np.array(numbers, dtype=bool).reshape(values.shape)
    all_integers = all(isinstance(number, (int, np.integer)) for number in numbers)
    return np.array(numbers, dtype=np.int32 if all_integers else float).reshape(values.shape)
