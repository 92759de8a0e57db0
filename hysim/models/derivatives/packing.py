"""Parameters and first memory of a law's step, with their derivatives by the law's numbers.

`Law.pack` runs once on symbols (`hysim.models.tracing`); the record of its arithmetic is differentiated operation by
operation.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import digamma, gammaln

from hysim._frozen import FloatArray
from hysim.models.tracing.symbols import OPERATIONS, Number, Symbol, Tape, UntraceableError
from hysim.models.tracing.traced import traced

_MOST_TERMS = 20_000  # of the series of the incomplete gamma function


class PackedRates(NamedTuple):
    """Parameters (n_parameters,) and memory (n_memory,) of a step, and their rates by each number, one a row."""

    parameters: FloatArray
    memory: FloatArray
    parameter_rates: FloatArray
    memory_rates: FloatArray


def packed_rates(law: Any, names: Sequence[str]) -> PackedRates:
    """The array of `law.pack` for the law's numbers, and its derivatives by those in `names`.

    Raises ValueError if the parameters of the step are no arithmetic expressions of a number.
    """
    tape = Tape(tuple(names))
    columns = {name: traced(tape.field(k)) for k, name in enumerate(names)}
    try:
        with np.errstate(all="ignore"):
            parameters, memory = law.pack(law.completed(law.exchanged(columns)))
    except UntraceableError as error:
        which = ", ".join(error.names)
        raise ValueError(f"the output of this {type(law).__name__} has no derivative by {which} here") from None
    numbers = [*parameters[0].tolist(), *memory[0].tolist()]
    values, rates = slopes(tape, numbers, [law.scalars[name] for name in names])
    size = parameters.shape[1]
    return PackedRates(values[:size], values[size:], rates[:, :size], rates[:, size:])


def slopes(tape: Tape, numbers: Sequence[Number], fields: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """The numbers for these values of the fields, (n,), and their derivatives by each field, (n_fields, n)."""
    n_fields = len(fields)
    values: dict[int, Any] = {}
    rates: dict[int, FloatArray] = {}

    def value(number: Number) -> Any:
        return values[number.place] if isinstance(number, Symbol) else number

    with np.errstate(all="ignore"):
        for place, operation, operands in tape.operations(numbers):
            if operation == "field":
                values[place], rates[place] = np.float64(fields[place]), np.eye(n_fields)[place]
                continue
            inputs = [value(each) for each in operands]
            values[place] = OPERATIONS[operation].evaluate(*inputs)
            moving = [rates[each.place] if isinstance(each, Symbol) else None for each in operands]
            rates[place] = _rate(operation, inputs, values[place], moving, n_fields)
    zero = np.zeros(n_fields)
    found = [rates[each.place] if isinstance(each, Symbol) else zero for each in numbers]
    return np.array([float(value(each)) for each in numbers]), np.array(found).reshape(len(numbers), n_fields).T.copy()


def _rate(operation: str, inputs: list[Any], result: Any, moving: list[FloatArray | None], n_fields: int) -> FloatArray:
    total = np.zeros(n_fields)
    partials = _PARTIALS.get(operation)
    for k, rate in enumerate(moving):
        if partials is not None and rate is not None and rate.any():
            partial = partials[k](*inputs, result)
            total = total + np.where(rate == 0.0, 0.0, partial * rate)
    return total


def _gamma_by_order(a: float, x: float, _: float) -> float:
    """Derivative of the regularised incomplete gamma function P(a, x) by a, by its power series."""
    if not 0.0 < x < np.inf:
        return 0.0
    n = np.arange(min(_MOST_TERMS, int(x + 12.0 * np.sqrt(x)) + 80))
    terms = np.exp((a + n) * np.log(x) - x - gammaln(a + n + 1.0))
    return float(np.sum(terms * (np.log(x) - digamma(a + n + 1.0))))


def _gamma_by_place(a: float, x: float, _: float) -> float:
    return float(np.exp((a - 1.0) * np.log(x) - x - gammaln(a))) if x > 0.0 else 0.0


_LN2 = float(np.log(2.0))
_ONE: Callable[..., Any] = lambda *_: 1.0  # noqa: E731
_PARTIALS: dict[str, tuple[Callable[..., Any], ...]] = {
    "add": (_ONE, _ONE),
    "subtract": (_ONE, lambda *_: -1.0),
    "multiply": (lambda a, b, r: b, lambda a, b, r: a),
    "divide": (lambda a, b, r: 1.0 / b, lambda a, b, r: -r / b),
    "negative": (lambda a, r: -1.0,),
    "square": (lambda a, r: 2.0 * a,),
    "reciprocal": (lambda a, r: -r * r,),
    "power": (lambda a, b, r: b * a ** (b - 1.0), lambda a, b, r: r * np.log(np.abs(a)) if a != 0.0 else 0.0),
    "absolute": (lambda a, r: np.sign(a),),
    "sqrt": (lambda a, r: 0.5 / r,),
    "exp": (lambda a, r: r,),
    "exp2": (lambda a, r: r * _LN2,),
    "expm1": (lambda a, r: r + 1.0,),
    "log": (lambda a, r: 1.0 / a,),
    "log2": (lambda a, r: 1.0 / (a * _LN2),),
    "log1p": (lambda a, r: 1.0 / (1.0 + a),),
    "tanh": (lambda a, r: (1.0 - r) * (1.0 + r),),
    "maximum": (lambda a, b, r: float(a >= b), lambda a, b, r: float(b > a)),
    "minimum": (lambda a, b, r: float(a <= b), lambda a, b, r: float(b < a)),
    "ldexp": (lambda a, k, r: np.ldexp(1.0, np.int32(k)), lambda a, k, r: 0.0),
    "gammainc": (_gamma_by_order, _gamma_by_place),
    "where": (lambda c, a, b, r: 0.0, lambda c, a, b, r: float(bool(c)), lambda c, a, b, r: float(not c)),
}
"""Derivatives of an operation by its operands; what is not here, such as rounding, has the derivative zero."""
