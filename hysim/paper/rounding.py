"""Printed numbers as the intervals that they stand for, and functions of them.

A printed number stands for everything that rounds to it: half a unit of its last digit either way. A function
of printed numbers has a value, at the numbers as printed, and a range, over everything that they stand for. A
printed result is reproduced when what it stands for and that range have a number in common.

    half_unit("0.07962") = 0.000005
    spread(f, inputs):  up to 6 inputs that are rounded, f at every corner of their box;
                        of more, f(inputs) -+ sum_i max |f(..., x_i -+ h_i, ...) - f(inputs)|

Corners give the range of a function that is monotonic in each input; the sum is its first order, and never
less than the effect of one input. Boxes are a few parts in a thousand wide, so that both hold for what the
claims compute. What is given as a float is exact: a table's set points, a constant.
"""

from collections.abc import Callable, Sequence
from decimal import Decimal, InvalidOperation
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, frozen

Number = str | float
"""A printed number as text, or an exact one."""

MAX_CORNERS = 6
_SLACK = 1e-12  # of the larger magnitude: touching ends of intervals agree although floats round


@frozen
class Spread:
    """A value with the range that the rounding of its inputs leaves, elementwise.

    Parameters
    ----------
    value, low, high : array, any one shape
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray

    def agrees(self, other: "Spread") -> bool:
        """Whether the ranges have a number in common, in every element."""
        scale = _SLACK * np.maximum(np.abs(self.value), np.abs(other.value))
        return bool(np.all((self.low <= other.high + scale) & (other.low <= self.high + scale)))


def half_unit(text: str) -> float:
    """Half a unit of the last digit of a printed number.

    Raises
    ------
    ValueError
        If the text is not a finite decimal number.

    Examples
    --------
    >>> half_unit("0.07962"), half_unit("-2.430"), half_unit("9")
    (5e-06, 0.0005, 0.5)
    """
    try:
        exponent = Decimal(text).as_tuple().exponent
    except InvalidOperation:
        exponent = "n"  # as that of nan
    if isinstance(exponent, str):
        raise ValueError(f"a printed number is a finite decimal, got {text!r}")
    return float(Decimal(5).scaleb(exponent - 1))


def stands_for(printed: Any) -> Spread:
    """The ranges of values that printed numbers stand for: one, or nested sequences of one shape.

    Examples
    --------
    >>> spread = stands_for("91.5")
    >>> float(spread.low), float(spread.high)
    (91.45, 91.55)
    """
    value, half = _values(printed), _halves(printed)
    return Spread(value=value, low=value - half, high=value + half)


def spread(function: Callable[[FloatArray], npt.ArrayLike], inputs: Sequence[Number]) -> Spread:
    """A function of printed numbers, and its range over what they stand for.

    Parameters
    ----------
    function : callable
        Takes an array of the inputs' numbers and returns a real number or an array of one shape.
    inputs : sequence of str or float
        Printed numbers, rounded, and exact ones.

    Examples
    --------
    >>> ratio = spread(lambda x: x[0] / x[1], ["1.0", "2.0"])
    >>> float(ratio.value), float(ratio.low).__round__(3), float(ratio.high).__round__(3)
    (0.5, 0.463, 0.538)
    """
    centre, halves = _values(inputs), _halves(inputs)
    steps = np.diag(halves)[np.flatnonzero(halves)]

    def at(offset: FloatArray | float) -> FloatArray:
        return np.asarray(function(centre + offset), dtype=float)

    value = at(0.0)
    if len(steps) <= MAX_CORNERS:
        corners = [at(np.array(signs) @ steps) for signs in product((-1.0, 1.0), repeat=len(steps))]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    else:
        radius = sum((np.maximum(np.abs(at(-step) - value), np.abs(at(step) - value)) for step in steps), 0.0 * value)
        low, high = value - radius, value + radius
    return Spread(value=value, low=np.minimum(low, value), high=np.maximum(high, value))


def exactly(value: npt.ArrayLike) -> Spread:
    """A number, or an array, that no rounding touches."""
    return Spread(value=value, low=value, high=value)  # type: ignore[arg-type]


def _values(printed: Any) -> FloatArray:
    return np.array(_nested(printed, float))


def _halves(printed: Any) -> FloatArray:
    return np.array(_nested(printed, lambda number: half_unit(number) if isinstance(number, str) else 0.0))


def _nested(printed: Any, read: Callable[[Any], float]) -> Any:
    if isinstance(printed, (str, float, int)):
        return read(printed)
    return [_nested(item, read) for item in printed]
