"""Frames of pandas and datasets of xarray from columns, with units in their notes."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy.typing as npt

from hysim._versions import optional


def frame(
    columns: Mapping[str, Any],
    *,
    index: tuple[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Any:
    """A `pandas.DataFrame`; ImportError without pandas.

    `index` is a name and its values. The notes of the frame, `attrs`, hold `units` by name, where there are any, and
    the `notes` that are neither None, nor empty, nor infinite or nan; they can be written as JSON.
    """
    pandas = optional("pandas", "to_frame", "tables")
    rows = None if index is None else pandas.Index(index[1], name=index[0])
    made = pandas.DataFrame(dict(columns), index=rows)
    told = {"units": dict(units or {})} | dict(notes or {})
    made.attrs = {name: value for name, value in told.items() if not _is_empty(value)}
    return made


def _is_empty(value: Any) -> bool:
    """Whether a note says nothing, or is a number that JSON cannot hold."""
    return value is None or value in ("", {}) or (isinstance(value, float) and not math.isfinite(value))


def dataset(
    signals: Mapping[str, tuple[Sequence[str], npt.NDArray[Any]]],
    coordinates: Mapping[str, Any],
    *,
    units: Mapping[str, str],
    notes: Mapping[str, Any] | None = None,
) -> Any:
    """An `xarray.Dataset` of signals with the names of their axes; ImportError without xarray.

    Each variable and coordinate has its unit in ``attrs["units"]``, where xarray's plots read it.
    """
    xarray = optional("xarray", "to_xarray", "tables")
    made = xarray.Dataset(
        {name: (tuple(axes), values) for name, (axes, values) in signals.items()},
        coords=dict(coordinates),
        attrs=dict(notes or {}),
    )
    for name in made.variables:
        if name in units:
            made[name].attrs["units"] = units[name]
    return made
