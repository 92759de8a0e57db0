"""Numbers and times in the columns of other libraries.

A missing value, such as None, NA, NaT or an Arrow null, is nan. Dates and time spans become seconds from the first one.
"""

import datetime
import math
import numbers
import re
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray

_TIME_NAMES = ("t", "time")
_HEADING = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
_MISSING = ("<NA>", "NaT", "None")


@runtime_checkable
class _Convertible(Protocol):
    """A column of pandas, polars, Arrow or cuDF."""

    def to_numpy(self) -> Any: ...


@runtime_checkable
class _Index(Protocol):
    """An index of pandas, which xarray uses too."""

    @property
    def name(self) -> Any: ...
    @property
    def dtype(self) -> Any: ...


def heading(label: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``voltage [V]`` or ``voltage (V)``; an empty unit if it has none."""
    parts = _HEADING.fullmatch(label.strip())
    return (parts["name"], parts["unit"].strip()) if parts else (label.strip(), "")


def is_dated(column: Any) -> bool:
    """Whether a column or an index holds dates or time spans."""
    array = _array(column)
    first = next((each for each in array.flat if str(each) not in _MISSING), None) if array.dtype.kind == "O" else None
    return array.dtype.kind in "mM" or isinstance(first, (datetime.date, datetime.timedelta))


def seconds(column: Any) -> FloatArray:
    """Dates or time spans as seconds, dates from the first one; nan where one is missing."""
    array = _array(column)
    if array.dtype.kind == "O":
        first = next(each for each in array.flat if str(each) not in _MISSING)
        kind = "timedelta64[ns]" if isinstance(first, datetime.timedelta) else "datetime64[ns]"
        array = np.array([_without_zone(each) for each in array], dtype=kind)
    if array.dtype.kind == "M":
        known = array[~np.isnat(array)]
        array = array - known[0] if known.size else array.view("timedelta64[ns]")
    steps = array.astype("timedelta64[ns]")
    return np.where(np.isnat(steps), np.nan, steps.astype(np.int64) * 1e-9)


def column_numbers(column: Any, label: str) -> FloatArray:
    """The numbers of a column, shape (n,), nan where one is missing; ValueError if it holds something else."""
    array = _array(column)
    if array.ndim != 1:
        raise ValueError(f"column {label!r} must have one axis, got shape {array.shape}")
    if array.dtype.kind in "biuf":
        return array.astype(np.float64)
    if is_dated(array):
        return seconds(array)
    return np.array([_number(each, label) for each in array], dtype=np.float64)


def index_times(index: Any) -> tuple[FloatArray, str] | None:
    """Times that an index holds, and their unit; None if it is not one of times.

    An index is one of times if it holds dates or time spans, is called t or time, or has no name and holds floats.
    Other indexes number or name the rows.
    """
    if not isinstance(index, _Index):
        return None
    if is_dated(index):
        return seconds(index), "s"
    name, unit = heading("" if index.name is None else str(index.name))
    is_numeric = np.dtype(_array(index).dtype).kind in "biuf"
    if is_numeric and (name.lower() in _TIME_NAMES or (index.name is None and _array(index).dtype.kind == "f")):
        return column_numbers(index, name or "index"), unit
    return None


def _array(column: Any) -> npt.NDArray[Any]:
    return np.asarray(column.to_numpy() if isinstance(column, _Convertible) else column)


def _number(value: Any, label: str) -> float:
    if str(value) in _MISSING:
        return math.nan
    if isinstance(value, numbers.Real) or type(value).__name__ == "Decimal":
        return float(value)
    raise ValueError(f"column {label!r} must hold numbers, got {value!r}: convert it first")


def _without_zone(value: Any) -> Any:
    """A date in coordinated universal time, which NumPy takes; others as they are."""
    if str(value) in _MISSING:
        return np.datetime64("NaT") if not isinstance(value, datetime.timedelta) else np.timedelta64("NaT")
    if isinstance(value, datetime.datetime) and value.tzinfo is not None:
        return value.astimezone(datetime.UTC).replace(tzinfo=None)
    return value
