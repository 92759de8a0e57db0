"""numpy on symbols: `Law.pack` on arrays of them records its arithmetic.

The functions of numpy that laws take are those of `Traced`; another one raises an `UntraceableError`, and so does a
branch or a count that depends on a symbol.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.special import gammainc

from hysim._frozen import FloatArray
from hysim.models.tracing.symbols import OPERATIONS, Number, Symbol, UntraceableError


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
        """Rounded as numbers of this type."""
        kind = np.dtype(dtype)
        if not _has_symbols(self):
            return _plain(self).astype(kind)
        if kind == np.float64:
            return self
        return _elementwise(_recorder("single" if kind == np.float32 else "trunc"), (self,))


def traced(number: Symbol) -> FloatArray:
    """A table of one law and one number, (1, 1)."""
    table = np.empty((1, 1), dtype=object)
    table[0, 0] = number
    return table.view(Traced)


_UFUNCS: dict[np.ufunc, str] = {
    **{np.add: "add", np.subtract: "subtract", np.multiply: "multiply", np.divide: "divide", np.power: "power"},
    **{np.negative: "negative", np.absolute: "absolute", np.sign: "sign", np.square: "square", np.sqrt: "sqrt"},
    **{np.exp: "exp", np.exp2: "exp2", np.expm1: "expm1", np.log: "log", np.log2: "log2", np.log1p: "log1p"},
    **{np.tanh: "tanh", np.floor: "floor", np.trunc: "trunc", np.rint: "rint", np.reciprocal: "reciprocal"},
    **{np.maximum: "maximum", np.minimum: "minimum", np.ldexp: "ldexp"},
    **{np.less: "less", np.less_equal: "less_equal", np.greater: "greater", np.greater_equal: "greater_equal"},
    **{np.equal: "equal", np.not_equal: "not_equal", np.signbit: "signbit"},
    **{np.isfinite: "isfinite", np.isinf: "isinf", np.isnan: "isnan"},
    **{np.bitwise_and: "both", np.logical_and: "both", np.bitwise_or: "either", np.logical_or: "either"},
    **{np.invert: "not", np.logical_not: "not", gammainc: "gammainc"},
}
_POWERS = {1.0: "", 2.0: "square", 0.5: "sqrt", -1.0: "reciprocal"}
"""How numpy computes the power of an array to a plain number."""


def _called(ufunc: np.ufunc, inputs: tuple[Any, ...]) -> Any:
    """The result of a function on arrays element by element, at least one of them with symbols."""
    if ufunc is np.frexp:
        exponents = _elementwise(_recorder("exponent"), inputs)
        return np.ldexp(inputs[0], -exponents), exponents
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
    """The fields on which arrays depend."""
    symbols = [
        number
        for each in inputs
        if isinstance(each, np.ndarray) and each.dtype == object
        for number in each.ravel().tolist()
        if isinstance(number, Symbol)
    ]
    return tuple(dict.fromkeys(name for symbol in symbols for name in symbol.tape.fields_of(symbol)))
