"""The verb `list_columns`: names, units and ranges of what a file holds, before a record is loaded from it."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hysim.files._arrays import NUMBERS, Array, Arrays
from hysim.files._load import file_named, options_of_a_text, table_of
from hysim.files._source import Source, opened
from hysim.files._table import Table

_MOST_OF_AN_ARRAY = 100  # columns


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
        return tuple(_column(table, name, number) for name, number in _keys(table))


def _keys(table: Table) -> Iterator[tuple[str, int | None]]:
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


def _column(table: Table, name: str, number: int | None) -> FileColumn:
    try:
        column = table.column(name if number is None else number)
        values = table.values([column])[0]
    except ValueError as error:
        return FileColumn(name, number, "", 0, 0, np.nan, np.nan, False, " ".join(str(error).split()))
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)
    unit = table.notes.units.get(name, column.unit)
    increases = bool(known.size > 1 and (np.diff(known) > 0.0).all())
    return FileColumn(name, number, unit, known.size, values.size - known.size, low, high, increases)
