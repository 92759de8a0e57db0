"""The parameters of a step as expressions of a law's numbers.

`Law.pack` turns the fields of laws into what their step takes, in numpy. It is run once on arrays of symbols, which
record the arithmetic; the record is written as a function in C99 or JavaScript, for programs whose numbers may still be
changed where they run. The functions of numpy that laws take are those of `Traced`; another one raises an
`UntraceableError`, and so does a branch or a count that depends on a symbol.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.export._symbols import HELPERS, OPERATIONS, Number, Symbol, Tape, UntraceableError, helper, in_javascript
from hysim.models.law import Law

_MANY = 8  # equal numbers in a row


class Packing:
    """Parameters and first memory of a law's step, as expressions of its numbers.

    `fields` are the numbers that may be changed, in the order of the law's `scalars`. `parameters` and `memory` are
    floats, and symbols on the `tape` that depend on the fields; `memory` begins with the last input, zero.
    """

    def __init__(
        self, fields: tuple[str, ...], parameters: tuple[Number, ...], memory: tuple[Number, ...], tape: Tape
    ) -> None:
        self.fields, self.parameters, self.memory, self._tape = fields, parameters, memory, tape

    def evaluate(self, values: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Parameters and memory for `values` of the fields, in their order, as `Law.packed` has them."""
        if len(values) != len(self.fields):
            raise ValueError(f"expected {len(self.fields)} values, got {len(values)}")
        numbers = self._tape.evaluate((*self.parameters, *self.memory), values)
        size = len(self.parameters)
        return np.array(numbers[:size]), np.array(numbers[size:])

    def to_c(self, name: str) -> str:
        """C99 text of ``static void name(const double *fields, double *parameters, double *state)``."""
        function, helpers = self._function(name)
        return "\n".join((*(helper(each, "c") for each in helpers), function)).replace("@", f"{name}_")

    def to_js(self, name: str) -> str:
        """A function ``name(fields, parameters, state)`` in JavaScript that fills the last two."""
        function, helpers = self._function(name)
        texts = (*(helper(each, "js") for each in helpers), in_javascript(function))
        return "\n".join(texts).replace("@", f"{name}_")

    def _function(self, name: str) -> tuple[str, list[str]]:
        locals_, texts = self._tape.texts((*self.parameters, *self.memory))
        truths, size = self._tape.truth_values(), len(self.parameters)
        lines = [
            f"    const {'int' if local in truths else 'double'} {local} = {_bare(text)};" for local, text in locals_
        ]
        lines += _assignments("parameters", texts[:size]) + _assignments("state", texts[size:])
        unused = () if any("fields[" in line for line in lines) else ("    (void)fields;",)
        head = f"static void {name}(const double *fields, double *parameters, double *state)\n{{"
        text = "\n".join((head, *unused, *lines, "}\n"))
        return text, [each for each in HELPERS if f"@{each}(" in text]


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
    columns = {name: traced(tape.field(k)) for k, name in enumerate(fields)}
    try:
        parameters, memory = law.pack(law.completed(law.exchanged(columns)))
        return Packing(fields, _row(parameters), _row(memory), tape)
    except UntraceableError as error:
        which = ", ".join(error.names)
        raise ValueError(
            f"the parameters of this {family} are no expressions of {which}: leave {which} out of free"
        ) from None


def _row(table: FloatArray) -> tuple[Number, ...]:
    return tuple(number if isinstance(number, Symbol) else float(number) for number in table[0].tolist())


def _assignments(target: str, texts: list[str]) -> list[str]:
    """Statements that fill an array; many equal numbers in a row are a loop."""
    lines, k = [], 0
    for text, run in itertools.groupby(texts):
        count = len(list(run))
        if count < _MANY:
            lines += [f"    {target}[{i}] = {_bare(text)};" for i in range(k, k + count)]
        else:
            lines.append(f"    for (int k = {k}; k < {k + count}; k++) {target}[k] = {_bare(text)};")
        k += count
    return lines


def _bare(text: str) -> str:
    """A text without the parentheses around the whole of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for place, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth == 0 and place < len(text) - 1:
            return text
    return text[1:-1]


class Traced(np.ndarray[Any, np.dtype[np.object_]]):
    """An array of symbols and plain numbers, on which numpy's functions record what they do."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **others: Any) -> Any:
        if not any(_has_symbols(each) for each in inputs):
            methods: dict[str, Callable[..., Any]] = {
                "__call__": ufunc,
                "reduce": ufunc.reduce,
                "accumulate": ufunc.accumulate,
                "outer": ufunc.outer,
            }
            return methods[method](*map(_plain, inputs), **{k: v for k, v in others.items() if k != "out"})
        if method == "__call__":
            return _called(ufunc, inputs)
        if method == "accumulate" and ufunc is np.add:
            return _cumulated(np.asarray(inputs[0], dtype=object), int(others.get("axis", 0)))
        raise UntraceableError(_names(inputs))

    def __array_function__(self, function: Any, types: Any, arguments: Any, others: Any) -> Any:
        if function is np.where:
            return _elementwise(_chosen, arguments)
        if function is np.clip:
            values, low, high = arguments
            return np.minimum(np.maximum(values, low), high)
        if function is np.any:
            return arguments[0].any()
        return _again(super().__array_function__(function, types, arguments, others))

    def any(self, *_: Any, **__: Any) -> Any:
        """Whether a number is not zero; one that may be changed may be that."""
        return any(isinstance(number, Symbol) or bool(number) for number in self.ravel().tolist())

    def astype(self, dtype: Any, *_: Any, **__: Any) -> Any:
        kind = np.dtype(dtype)
        if not _has_symbols(self):
            return _plain(self).astype(kind)
        if kind == np.float64:
            return self
        if kind.kind == "f":
            raise UntraceableError(_names((self,)))
        return _elementwise(_recorder("trunc"), (self,))


def traced(number: Symbol) -> FloatArray:
    """A table of one law and one number, (1, 1)."""
    table = np.empty((1, 1), dtype=object)
    table[0, 0] = number
    return table.view(Traced)


_UFUNCS: dict[np.ufunc, str] = {
    **{each.evaluate: name for name, each in OPERATIONS.items() if isinstance(each.evaluate, np.ufunc)},
    **{np.bitwise_and: "logical_and", np.bitwise_or: "logical_or", np.invert: "logical_not"},
}
_POWERS = {1.0: "", 2.0: "square", 0.5: "sqrt", -1.0: "reciprocal"}
"""How numpy computes the power of an array to a plain number."""


def _called(ufunc: np.ufunc, inputs: tuple[Any, ...]) -> Any:
    """The result of a function on arrays element by element, at least one of them with symbols."""
    if ufunc is np.power and isinstance(inputs[1], (int, float)) and (name := _POWERS.get(inputs[1])) is not None:
        return _elementwise(_recorder(name), inputs[:1]) if name else inputs[0]
    if ufunc not in _UFUNCS:
        raise UntraceableError(_names(inputs))
    return _elementwise(_recorder(_UFUNCS[ufunc]), inputs)


def _recorder(operation: str) -> Callable[..., Number]:
    """A function of numbers that records the operation where one of them is a symbol, and does it where none is."""

    def apply(*operands: Number) -> Number:
        tapes = [operand.tape for operand in operands if isinstance(operand, Symbol)]
        if not tapes:
            return OPERATIONS[operation].evaluate(*operands)
        kinds = (Symbol, bool, np.bool_)
        return tapes[0].record(operation, *(each if isinstance(each, kinds) else float(each) for each in operands))

    return apply


def _chosen(which: Number, yes: Number, no: Number) -> Number:
    if not isinstance(which, Symbol):
        return yes if which else no
    return yes if yes is no else _recorder("where")(which, yes, no)


def _elementwise(function: Callable[..., Number], arguments: Sequence[Any]) -> Any:
    arrays = np.broadcast_arrays(*(np.asarray(each, dtype=object) for each in arguments))
    result = np.empty(arrays[0].shape, dtype=object)
    for place in np.ndindex(result.shape):
        result[place] = function(*(array[place] for array in arrays))
    return result.view(Traced)


def _cumulated(values: Any, axis: int) -> Any:
    """Sums up to each element along an axis, one after the other as numpy adds."""
    result, add = np.moveaxis(values.copy(), axis, 0), _recorder("add")
    for k in range(1, len(result)):
        result[k] = _elementwise(add, (result[k - 1], result[k]))
    return np.moveaxis(result, 0, axis).view(Traced)


def _again(result: Any) -> Any:
    """Arrays of symbols as such, where numpy returns plain ones."""
    if isinstance(result, (list, tuple)):
        return type(result)(_again(each) for each in result)
    plain = isinstance(result, np.ndarray) and result.dtype == object and not isinstance(result, Traced)
    return result.view(Traced) if plain else result


def _has_symbols(values: Any) -> bool:
    return (
        isinstance(values, np.ndarray)
        and values.dtype == object
        and any(isinstance(number, Symbol) for number in values.ravel().tolist())
    )


def _plain(values: Any) -> Any:
    """Numbers as numpy has them, where none of them is a symbol."""
    if not isinstance(values, np.ndarray) or values.dtype != object:
        return values
    numbers = values.ravel().tolist()
    if all(isinstance(number, (bool, np.bool_)) for number in numbers):
        return np.array(numbers, dtype=bool).reshape(values.shape)
    whole = all(isinstance(number, (int, np.integer)) for number in numbers)
    return np.array(numbers, dtype=np.int32 if whole else float).reshape(values.shape)


def _names(inputs: Sequence[Any]) -> tuple[str, ...]:
    symbols = [
        number
        for each in inputs
        if isinstance(each, np.ndarray) and each.dtype == object
        for number in each.ravel().tolist()
        if isinstance(number, Symbol)
    ]
    return tuple(dict.fromkeys(name for symbol in symbols for name in symbol.tape.fields_of(symbol)))
