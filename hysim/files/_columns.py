"""The verb `list_columns`: names, units and ranges of what a file holds, before a record is loaded from it."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._arrays import NUMBERS, Array, Arrays
from hysim.files._delimited import Delimited
from hysim.files._load import file_named, options_of_a_text, table_of
from hysim.files._source import Source, opened
from hysim.files._table import Column, Table

_MOST_OF_AN_ARRAY = 100  # columns
_AT_ONCE = 5_000_000  # numbers of a text

_Key = tuple[str, int | None]


class FileColumn(NamedTuple):
    """A column of a file, by the name, and the number if it has one, that `hysim.load` takes.

    `n_samples` counts those with a value, `n_missing` the others. The lowest and the highest value are nan, and
    `problem` says why, where a column cannot be read; it is empty where it can.
    """

    name: str
    number: int | None
    unit: str
    n_samples: int
    n_missing: int
    lowest: float
    highest: float
    increases: bool
    problem: str = ""


def list_columns(
    path: Source,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    thousands: str | None = None,
    skip: int = 0,
    encoding: str | None = None,
) -> tuple[FileColumn, ...]:
    """List the columns of a file that `hysim.load` reads.

    Parameters
    ----------
    path : str, path or open file
        As of `hysim.load`.
    delimiter, decimal, thousands, skip, encoding : optional
        As of `hysim.load`, for a text.

    Returns
    -------
    tuple of FileColumn
        In the order of the file; of an array with several axes the first 100 columns.

    Raises
    ------
    FileNotFoundError, TypeError, ValueError
        As `hysim.load`, for the file; a column that cannot be read is listed with its problem.

    Examples
    --------
    >>> import io
    >>> import hysim as hs
    >>> text = io.StringIO("t [s], voltage [V], note\\n0, 0.0, a\\n1, 5.0, b\\n")
    >>> [(each.name, each.unit, each.highest) for each in hs.list_columns(text)]
    [('t', 's', 1.0), ('voltage', 'V', 5.0), ('note', '', nan)]
    """
    for_text = options_of_a_text(delimiter, decimal, thousands, skip, encoding)
    with opened(path) as source, file_named(source), table_of(source, for_text) as table:
        return tuple(_listed(table, list(_keys(table))))


def _keys(table: Table) -> Iterator[_Key]:
    """Name and number of each column, None for one of several axes."""
    if not isinstance(table, Arrays):
        yield from zip(table.labels, range(len(table.labels)), strict=True)
        return
    for place, array in enumerate(table.arrays):
        if array.is_vector or array.kind != NUMBERS:
            yield array.label, place
        else:
            is_only = len(table.arrays) == 1 and len(array.shape) == 2
            names = itertools.islice(_names(array), _MOST_OF_AN_ARRAY)
            yield from ((name, k if is_only else None) for k, name in enumerate(names))


def _names(array: Array) -> Iterator[str]:
    for index in np.ndindex(array.shape[1:]):
        yield f"{array.label}[{','.join(map(str, index))}]"


def _listed(table: Table, keys: list[_Key]) -> Iterator[FileColumn]:
    """The columns, read together as far as they can be: a text is split into all of its cells each time."""
    size = max(1, _AT_ONCE // table.layout.n_samples) if isinstance(table, Delimited) else 1
    for start in range(0, len(keys), size):
        yield from _together(table, keys[start : start + size])


def _together(table: Table, keys: list[_Key]) -> list[FileColumn]:
    """Columns that are read at once; where one of them cannot be read, each half of them is."""
    try:
        columns = [table.column(name if number is None else number) for name, number in keys]
        values = table.values(columns)
    except ValueError as error:
        if len(keys) > 1:
            half = len(keys) // 2
            return _together(table, keys[:half]) + _together(table, keys[half:])
        return [FileColumn(*keys[0], "", 0, 0, np.nan, np.nan, False, " ".join(str(error).split()))]
    return [_column(table, key, *column) for key, *column in zip(keys, columns, values, strict=True)]


def _column(table: Table, key: _Key, column: Column, values: FloatArray) -> FileColumn:
    name, number = key
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)
    unit = table.notes.units.get(name, column.unit)
    increases = bool(known.size > 1 and (np.diff(known) > 0.0).all())
    return FileColumn(name, number, unit, known.size, values.size - known.size, low, high, increases)
