"""One column of another library with its index or coordinate: a Series of pandas, a DataArray of xarray."""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from hysim._frozen import FloatArray
from hysim.interop._values import index_times


@runtime_checkable
class _Series(Protocol):
    """A Series of pandas."""

    @property
    def index(self) -> Any: ...
    @property
    def dtype(self) -> Any: ...
    def to_numpy(self) -> Any: ...


@runtime_checkable
class _DataArray(Protocol):
    """A DataArray of xarray."""

    @property
    def dims(self) -> Any: ...
    def get_index(self, key: Any) -> Any: ...


@runtime_checkable
class _Noted(Protocol):
    """A table that has notes: a Series, a DataArray, a frame."""

    @property
    def attrs(self) -> Any: ...
    @property
    def name(self) -> Any: ...


def time_of(column: Any) -> tuple[FloatArray, str] | None:
    """Times of a column's index or coordinate, and their unit; None if it has none."""
    if isinstance(column, _DataArray):
        return along_axis(column, column.dims[0]) if len(column.dims) == 1 else None
    return index_times(column.index) if isinstance(column, _Series) else None


def along_axis(labelled: Any, axis: Any) -> tuple[FloatArray, str] | None:
    """Times along an axis of a DataArray or a dataset of xarray, and their unit; None if it has none."""
    times = index_times(labelled.get_index(axis))
    unit = unit_of(labelled.coords[axis]) if axis in labelled.coords else None
    return times if times is None or unit is None else (times[0], unit)


def unit_of(column: Any) -> str | None:
    """The unit in the notes of a column, ``attrs["units"]``: a text, or a mapping that has the column's name."""
    noted = column.attrs.get("units") if isinstance(column, _Noted) and isinstance(column.attrs, Mapping) else None
    unit = noted.get(column.name) if isinstance(noted, Mapping) else noted
    return unit if isinstance(unit, str) else None


def told_by(u: Any, y: Any, t: Any, units: Mapping[str, str]) -> tuple[Any, dict[str, str]]:
    """Times and units of two columns: those given, or else those that the columns state.

    Raises ValueError if both columns state times, and these differ.
    """
    columns = {"u": u, "y": y}
    stated = {name: unit for name, column in columns.items() if (unit := unit_of(column)) is not None}
    times = [found for column in columns.values() if (found := time_of(column)) is not None] if t is None else []
    if times:
        t, unit = times[0]
        if not np.array_equal(t, times[-1][0]):
            raise ValueError(
                "u and y must have the same times, got two indexes that differ: align them first, as by "
                'pandas.concat({"u": u, "y": y}, axis=1).dropna()'
            )
        stated |= {"t": unit} if unit else {}
    return t, {**stated, **units}
