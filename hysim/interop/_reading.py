"""Tables of other libraries as named columns: known by what they offer, so that no library is imported.

A frame has `columns` and `shape` (pandas, polars, cuDF, modin), a table of Arrow `column_names`, a dataset of xarray
`data_vars`. Whatever else hands its columns out as an Arrow stream (DuckDB, Ibis) is read by pyarrow. The interchange
protocol ``__dataframe__`` is not used: pandas deprecates it, and polars 2 has removed it.
"""

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from hysim._frozen import FloatArray
from hysim.interop._series import along_axis, unit_of
from hysim.interop._values import column_numbers, heading, index_times, is_dated

TIME = "t"


@runtime_checkable
class _Frame(Protocol):
    """A frame of pandas, polars, cuDF, modin."""

    @property
    def columns(self) -> Any: ...
    @property
    def shape(self) -> Any: ...
    @property
    def dtypes(self) -> Any: ...
    def __getitem__(self, label: Any, /) -> Any: ...


@runtime_checkable
class _Indexed(Protocol):
    @property
    def index(self) -> Any: ...


@runtime_checkable
class _ArrowTable(Protocol):
    """A table of Arrow."""

    @property
    def column_names(self) -> Any: ...
    def column(self, label: Any, /) -> Any: ...


@runtime_checkable
class _Dataset(Protocol):
    """A dataset of xarray."""

    @property
    def data_vars(self) -> Any: ...
    def get_index(self, key: Any, /) -> Any: ...


@runtime_checkable
class _ArrowStream(Protocol):
    def __arrow_c_stream__(self, requested_schema: object = None) -> object: ...


@runtime_checkable
class _Noted(Protocol):
    @property
    def attrs(self) -> Any: ...


@dataclass(frozen=True)
class ForeignTable:
    """Columns by the names of their headings, with the units and notes that the table states.

    `read` gives the numbers of a column by its place among the `labels`, shape (n,), nan where one is missing;
    `is_dated` says whether these are seconds, made of dates or time spans. An index of times is the last column,
    called t, unless there is a column of this name.
    """

    kind: str
    labels: tuple[str, ...]
    units: Mapping[str, str]
    read: Callable[[int], FloatArray]
    is_dated: Callable[[int], bool]
    notes: Mapping[str, Any] = field(default_factory=dict)


def table_in(value: Any) -> ForeignTable | None:
    """The table that a value is; None if it is none."""
    if isinstance(value, type):
        return None
    if isinstance(value, _ArrowTable):
        return _table(value, value.column_names, value.column)
    if isinstance(value, _Dataset):
        return _of_dataset(value)
    if isinstance(value, _Frame):
        times = index_times(value.index) if isinstance(value, _Indexed) else None
        return _table(value, value.columns, value.__getitem__, times)
    if isinstance(value, _ArrowStream):
        table = _pyarrow(value).table(value)
        return _table(value, table.column_names, table.column)
    return None


def _pyarrow(value: Any) -> Any:
    try:
        return importlib.import_module("pyarrow")
    except ImportError:
        kind = type(value).__name__
        raise TypeError(f"a {kind} is an Arrow stream, which pyarrow reads: pip install pyarrow") from None


def _of_dataset(value: Any) -> ForeignTable:
    """The variables of one axis; the index of this axis is that of the table."""
    one_axis = [name for name, variable in value.data_vars.items() if len(variable.dims) == 1]
    axes = {value[name].dims[0] for name in one_axis}
    if len(axes) != 1:
        raise ValueError(f"the {type(value).__name__} must have variables along one axis, got the axes {sorted(axes)}")
    return _table(value, one_axis, value.__getitem__, along_axis(value, axes.pop()))


def _table(
    value: Any, labels: Iterable[Any], column: Callable[[Any], Any], index: tuple[FloatArray, str] | None = None
) -> ForeignTable:
    own = [*labels]
    headings = [heading(str(label)) for label in own]
    notes = value.attrs if isinstance(value, _Noted) and isinstance(value.attrs, Mapping) else {}
    stated = notes.get("units")
    units = {name: unit for name, unit in headings if unit}
    if isinstance(value, _Dataset):
        units |= {str(label): unit for label in own if (unit := unit_of(column(label))) is not None}
    units |= dict(stated) if isinstance(stated, Mapping) else {}
    names = [name for name, _ in headings]
    times = None if TIME in names else index
    if times is not None:
        names.append(TIME)
        units = ({TIME: times[1]} if times[1] else {}) | units

    def read(place: int) -> FloatArray:
        if times is not None and place == len(own):
            return times[0]
        if names.count(names[place]) > 1:
            raise ValueError(f"{names.count(names[place])} columns are called {names[place]!r}: rename them")
        return column_numbers(column(own[place]), names[place])

    def dated(place: int) -> bool:
        return place < len(own) and names.count(names[place]) == 1 and is_dated(column(own[place]))

    return ForeignTable(type(value).__name__, tuple(names), units, read, dated, notes)


def unit_in(table: ForeignTable, place: int) -> str:
    """The unit of a column, "s" of dates and time spans; empty if it has none."""
    return table.units.get(table.labels[place], "s" if table.is_dated(place) else "")


def channels_of(table: ForeignTable) -> dict[str, Any]:
    """Channels that the notes of a table name, each a number or the numbers of its column."""
    stated = table.notes.get("channels")
    places = dict(stated) if isinstance(stated, Mapping) else {}
    return {
        str(name): table.read(table.labels.index(place)) if isinstance(place, str) else place
        for name, place in places.items()
        if not isinstance(place, str) or place in table.labels
    }
