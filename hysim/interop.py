"""Tables of other libraries: pandas, polars, Arrow and xarray, read and made without depending on any of them.

They are recognised by their attributes, so that no library is imported: a frame (pandas, polars, cuDF, modin) has
`columns` and `shape`, a table of Arrow `column_names`, a dataset of xarray `data_vars`. Anything else that offers an
Arrow stream (DuckDB, Ibis) is read by pyarrow. pandas deprecates ``__dataframe__``: it is not used.

A missing value, such as None, NA, NaT or an Arrow null, is nan. Dates and time spans become seconds from the first one.
"""

import datetime
import importlib
import math
import numbers
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._basics.libraries import optional
from hysim._basics.prefixes import is_known

__all__ = ["ForeignTable", "channels_of", "dataset", "frame", "heading", "table_in", "told_by"]

TIME = "t"
_TIME_NAMES = ("t", "time")
_HEADING = re.compile(r"(?P<name>.*[^\s/])[\s/]*[\[(](?P<unit>[^\[\]()]*)[\])]")
_QUOTIENT = re.compile(r"(?!d\w*\s*/\s*d)(?P<name>[^\d\s/][^/]*?)\s*/\s*(?P<unit>\S+)")  # dQ/dV is a derivative
_SYMBOLS = ("C", "F", "H", "T", "s")  # of capacitance, force, field, temperature and path, beside units: F/N is a force
_MISSING = ("<NA>", "NaT", "None")  # as their texts

_Numbers = tuple[FloatArray, str]
"""Numbers, nan where one is missing, and their unit or an empty text."""


@runtime_checkable
class _Frame(Protocol):
    """A frame of pandas, polars, cuDF, modin."""

    columns: Any
    shape: Any
    dtypes: Any

    def __getitem__(self, label: Any, /) -> Any: ...


@runtime_checkable
class _ArrowTable(Protocol):
    column_names: Any

    def column(self, label: Any, /) -> Any: ...


@runtime_checkable
class _ArrowStream(Protocol):
    def __arrow_c_stream__(self, requested_schema: object = None) -> object: ...


@runtime_checkable
class _Labelled(Protocol):
    """A DataArray or a dataset of xarray."""

    dims: Any
    coords: Any

    def get_index(self, key: Any, /) -> Any: ...


@runtime_checkable
class _Dataset(_Labelled, Protocol):
    data_vars: Any

    def __getitem__(self, label: Any, /) -> Any: ...


@runtime_checkable
class _Indexed(Protocol):
    """A frame or a Series of pandas."""

    index: Any


@runtime_checkable
class _Typed(Protocol):
    """An index of pandas, a column."""

    name: Any
    dtype: Any


@runtime_checkable
class _Noted(Protocol):
    attrs: Any


@runtime_checkable
class _Convertible(Protocol):
    """A column of pandas, polars, Arrow or cuDF."""

    def to_numpy(self) -> Any: ...


@dataclass(frozen=True)
class ForeignTable:
    """Columns by the names of their headings, with the units and notes that the table states.

    `read` gives the numbers of a column by its place among the `labels`, and their unit. An index of times is the last
    column, called t, unless there is a column of this name.
    """

    kind: str
    labels: tuple[str, ...]
    units: Mapping[str, str]
    notes: Mapping[str, Any]
    read: Callable[[int], _Numbers]


def table_in(value: Any) -> ForeignTable | None:
    kind = type(value).__name__
    if isinstance(value, type):
        return None
    if isinstance(value, _ArrowTable):
        return _table(value, value.column_names, value.column, None)
    if isinstance(value, _Dataset):
        names = [name for name, variable in value.data_vars.items() if len(variable.dims) == 1]
        axes = {value[name].dims[0] for name in names}
        if len(axes) != 1:
            raise ValueError(f"the {kind} must have variables along one axis, got the axes {sorted(axes)}")
        return _table(value, names, value.__getitem__, _times_of(value[names[0]]))
    if isinstance(value, _Frame):
        return _table(value, value.columns, value.__getitem__, _times_of(value))
    if isinstance(value, _ArrowStream):
        advice = f"a {kind} is an Arrow stream, which pyarrow reads: pip install pyarrow"
        try:
            return table_in(importlib.import_module("pyarrow").table(value))
        except ImportError:
            raise TypeError(advice) from None
    return None


def _table(value: Any, labels: Iterable[Any], column: Callable[[Any], Any], times: _Numbers | None) -> ForeignTable:
    own = [*labels]
    headings = [heading(str(label)) for label in own]
    notes, names = _notes(value), [name for name, _ in headings]
    stated = notes.get("units")
    units = {name: unit for name, unit in headings if unit}
    if isinstance(value, _Dataset):
        units |= {str(label): unit for label in own if (unit := _unit_of(column(label))) is not None}
    units |= dict(stated) if isinstance(stated, Mapping) else {}
    if times is not None and TIME not in names:
        names.append(TIME)
        units = ({TIME: times[1]} if times[1] else {}) | units

    def read(place: int) -> _Numbers:
        name = names[place]
        if names.count(name) > 1:
            raise ValueError(f"{names.count(name)} columns are called {name!r}: rename them")
        values, unit = times if times is not None and place == len(own) else _numbers(column(own[place]), name)
        return values, units.get(name, unit)

    return ForeignTable(type(value).__name__, tuple(names), units, notes, read)


def channels_of(table: ForeignTable) -> dict[str, Any]:
    """Channels that the notes of a table name, each a number or the numbers of its column."""
    stated = table.notes.get("channels")
    return {
        str(name): table.read(table.labels.index(place))[0] if isinstance(place, str) else place
        for name, place in (stated.items() if isinstance(stated, Mapping) else ())
        if not isinstance(place, str) or place in table.labels
    }


def told_by(u: Any, y: Any, t: Any, units: Mapping[str, str]) -> tuple[Any, dict[str, str]]:
    """Times and units of two columns, given or as the columns state them; ValueError if the stated times differ."""
    columns = {"u": u, "y": y}
    stated = {name: unit for name, column in columns.items() if (unit := _unit_of(column)) is not None}
    times = [known for column in columns.values() if (known := _times_of(column)) is not None] if t is None else []
    if times:
        t, unit = times[0]
        if not np.array_equal(t, times[-1][0]):
            advice = 'align them first, as by pandas.concat({"u": u, "y": y}, axis=1).dropna()'
            raise ValueError(f"u and y must have the same times, got two indexes that differ: {advice}")
        stated |= {"t": unit} if unit else {}
    return t, {**stated, **units}


def heading(label: str) -> tuple[str, str]:
    """Name and unit of a heading: ``voltage [V]``, ``voltage (V)``, or ``voltage/V`` with a known unit; else a name."""
    parts = _HEADING.fullmatch(label.strip()) or _QUOTIENT.fullmatch(label.strip())
    is_unit = parts and (parts.re is _HEADING or is_known(parts["unit"]))
    if not parts or not is_unit or (is_known(label.strip()) and parts["name"] not in _SYMBOLS):  # such as N/m
        return label.strip(), ""
    return parts["name"], parts["unit"].strip()


def _notes(value: Any) -> Mapping[str, Any]:
    return value.attrs if isinstance(value, _Noted) and isinstance(value.attrs, Mapping) else {}


def _unit_of(column: Any) -> str | None:
    """The unit in the notes of a column, ``attrs["units"]``: a text, or a mapping that has the column's name."""
    noted = _notes(column).get("units")
    unit = noted.get(column.name) if isinstance(noted, Mapping) else noted
    return unit if isinstance(unit, str) else None


def _times_of(value: Any) -> _Numbers | None:
    """Times that the index of a frame, a Series or a DataArray holds, and their unit; None if it is not one of times.

    An index is of times if it holds dates or time spans, is called t or time, or has no name and holds floats.
    """
    if isinstance(value, _Labelled) and len(value.dims) == 1:
        index, unit = value.get_index(value.dims[0]), _unit_of(value.coords.get(value.dims[0]))
    else:
        index, unit = value.index if isinstance(value, _Indexed) else None, None
    if not isinstance(index, _Typed):
        return None
    kind = _array(index).dtype.kind
    name, own_unit = heading("" if index.name is None else str(index.name))
    is_called = name.lower() in _TIME_NAMES or (index.name is None and kind == "f")
    if kind not in "mM" and not (kind in "biuf" and is_called):
        return None
    times, plain = _numbers(index, name)
    return times, plain or own_unit if unit is None else unit


def _numbers(column: Any, label: str) -> _Numbers:
    """The numbers of a column, shape (n,); seconds of dates and time spans, ValueError if it holds something else."""
    array = _array(column)
    if array.ndim != 1:
        raise ValueError(f"column {label!r} must have one axis, got shape {array.shape}")
    if array.dtype.kind in "biuf":
        return array.astype(np.float64), ""
    if array.dtype.kind not in "mM":
        return np.array([_number(each, label) for each in array], dtype=np.float64), ""
    if array.dtype.kind == "M":
        known = array[~np.isnat(array)]
        array = array - known[0] if known.size else array.view("timedelta64[ns]")
    steps = array.astype("timedelta64[ns]")
    return np.where(np.isnat(steps), np.nan, steps.astype(np.int64) * 1e-9), "s"


def _array(column: Any) -> npt.NDArray[Any]:
    """The values of a column; dates and time spans as NumPy has them, in coordinated universal time."""
    array = np.asarray(column.to_numpy() if isinstance(column, _Convertible) else column)
    first = next((each for each in array.flat if str(each) not in _MISSING), None) if array.dtype.kind == "O" else None
    if not isinstance(first, (datetime.date, datetime.timedelta)):
        return array
    kind = "timedelta64[ns]" if isinstance(first, datetime.timedelta) else "datetime64[ns]"
    return np.array([_without_zone(each) for each in array], dtype=kind)


def _without_zone(value: Any) -> Any:
    if str(value) in _MISSING:
        return "NaT"
    is_zoned = isinstance(value, datetime.datetime) and value.tzinfo is not None
    return value.astimezone(datetime.UTC).replace(tzinfo=None) if is_zoned else value


def _number(value: Any, label: str) -> float:
    if str(value) in _MISSING:
        return math.nan
    if isinstance(value, numbers.Real) or type(value).__name__ == "Decimal":
        return float(value)
    raise ValueError(f"column {label!r} must hold numbers, got {value!r}: convert it first")


def frame(
    columns: Mapping[str, Any],
    *,
    index: tuple[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Any:
    """A `pandas.DataFrame`; ImportError without pandas.

    `index` is a name and its values. `attrs` holds the `units` and those `notes` that can be written as JSON.
    """
    pandas = optional("pandas", "to_frame", "tables")
    rows = None if index is None else pandas.Index(index[1], name=index[0])
    made = pandas.DataFrame(dict(columns), index=rows)
    told = {"units": dict(units or {}), **(notes or {})}.items()
    known = {name: value for name, value in told if value not in (None, "", {})}
    made.attrs = {name: value for name, value in known.items() if not isinstance(value, float) or math.isfinite(value)}
    return made


def dataset(signals: Mapping[str, Any], coordinates: Mapping[str, Any], units: Mapping[str, str]) -> Any:
    """An `xarray.Dataset` of signals, each its axes and values, with ``attrs["units"]``; ImportError without xarray."""
    made = optional("xarray", "to_xarray", "tables").Dataset(dict(signals), dict(coordinates))
    for name in made.variables.keys() & units.keys():
        made[name].attrs["units"] = units[name]
    return made
