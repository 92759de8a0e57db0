"""Records from text files: columns of numbers under a header line.

A file is read in three steps: its lines become rows of cells, the header's cells become columns (a name and a
unit each), and the cells of the chosen columns become numbers, or gaps where a value is missing.
"""

import csv
import itertools
import math
import operator
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple, TextIO, overload

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.records import Record

MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Cells that stand for a missing value, in upper or lower case."""

ON_MISSING = ("error", "drop", "split")

_HEADING = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
_WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[\]()]*[\])])?|\S+")


class _Row(NamedTuple):
    line: int
    cells: list[str]


class _Column(NamedTuple):
    place: int
    label: str
    unit: str


@overload
def load(
    path: str | os.PathLike[str] | TextIO,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["error", "drop"] = "error",
    delimiter: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> Record: ...
@overload
def load(
    path: str | os.PathLike[str] | TextIO,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["split"],
    delimiter: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> tuple[Record, ...]: ...
def load(
    path: str | os.PathLike[str] | TextIO,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["error", "drop", "split"] = "error",
    delimiter: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> Record | tuple[Record, ...]:
    """Load a record from a text file with one sample a line.

    Blank lines and lines that begin with ``#`` are skipped. The first line left holds the names of the columns;
    if it is all numbers it is a sample, and the columns are chosen by number. A unit in brackets is split off:
    under ``voltage [V]`` or ``voltage (V)`` the column is `voltage`, and its unit V. Only the chosen columns
    have to be numbers. Missing values are empty cells, nan, na, n/a, null and none.

    Parameters
    ----------
    path : str, path or open text file
        UTF-8, with or without a byte order mark.
    u, y, t : str or int
        Columns of input, output and time, by name or by number from 0. Without `t` the record has no time.
    on_missing : {"error", "drop", "split"}
        What to do where a chosen column has no value: raise, leave the sample out, or cut the record there
        into several.
    delimiter : str, optional
        One character between the cells, or a blank for any white space. By default the first of tab, semicolon
        and comma that the first line has, else white space.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``, before those of the header.
    resolution : float, optional
        Quantum of the output's sensor [unit of y].
    name : str, optional
        Name of the record; by default the file's name without its ending.

    Returns
    -------
    Record, or tuple of Record
        A tuple with ``on_missing="split"``: the pieces between the gaps that have at least 2 samples.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is not text, is empty or has no samples; a column is unknown; or a row is too long or short,
        a cell is not a finite number, a value is missing or the time does not increase, with the line number.

    Examples
    --------
    >>> import io
    >>> import hysim as hs
    >>> text = io.StringIO("voltage [V], displacement [um]\\n0, 0.0\\n5, 0.079\\n10, 0.152\\n")
    >>> rec = hs.load(text, u="voltage", y="displacement")
    >>> rec.u.tolist(), dict(rec.units)
    ([0.0, 5.0, 10.0], {'u': 'V', 'y': 'um'})
    """
    if on_missing not in ON_MISSING:
        raise ValueError(f"on_missing must be one of {', '.join(ON_MISSING)}, got {on_missing!r}")
    if delimiter is not None and len(delimiter) != 1:
        raise ValueError(f"delimiter must be one character, got {delimiter!r}")
    source, text = _read(path)
    wanted = {"u": u, "y": y} if t is None else {"u": u, "y": y, "t": t}
    try:
        header, rows = _table(text, delimiter)
        columns = {signal: _column(header, key) for signal, key in wanted.items()}
        values = np.array([[_number(row, column) for column in columns.values()] for row in rows])
        is_gap = np.isnan(values).any(axis=1)
        if on_missing == "error" and is_gap.any():
            raise ValueError(_gap(rows, list(columns.values()), values))
        pieces = _pieces(is_gap, cut=on_missing == "split")
        if t is not None:
            _check_time(rows, values[:, -1], pieces)
        labels = {signal: column.unit for signal, column in columns.items() if column.unit} | dict(units or {})
        title = Path(source).stem if name is None else name
        records = tuple(
            Record(**dict(zip(columns, values[piece].T, strict=True)), units=labels, resolution=resolution, name=title)
            for piece in pieces
        )
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None
    return records if on_missing == "split" else records[0]


def _read(path: str | os.PathLike[str] | TextIO) -> tuple[str, str]:
    """What to call the file, and its text."""
    if isinstance(path, (str, os.PathLike)):
        source = Path(path).name
        try:
            text = Path(path).read_text(encoding="utf-8-sig")
        except UnicodeDecodeError as error:
            raise ValueError(f"{source} is not a UTF-8 text file: {error.reason} at byte {error.start}") from None
    else:
        source = Path(str(getattr(path, "name", "stream"))).name
        text = path.read()
        if not isinstance(text, str):
            raise TypeError("the stream gives bytes: open the file as text")
    if "\0" in text:
        raise ValueError(f"{source} is not a text file: it holds zero bytes")
    return source, text.removeprefix("\ufeff")


def _table(text: str, delimiter: str | None) -> tuple[list[_Column], list[_Row]]:
    lines = [(number, line.strip("\r ")) for number, line in enumerate(text.split("\n"), start=1)]
    lines = [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise ValueError("the file is empty, there is no header and no sample")
    separator = delimiter or _detect(lines[0][1])
    rows = [_Row(number, _split(line, separator)) for number, line in lines]
    if _is_sample(rows[0].cells):
        header = [_Column(place, str(place), "") for place in range(len(rows[0].cells))]
    else:
        header = [_heading(place, cell) for place, cell in enumerate(rows[0].cells)]
        rows = rows[1:]
    if not rows:
        raise ValueError("there is a header, but no sample")
    for row in rows:
        if len(row.cells) != len(header):
            raise ValueError(f"line {row.line}: expected {len(header)} cells, got {len(row.cells)}")
    return header, rows


def _detect(line: str) -> str:
    return next((separator for separator in "\t;," if separator in line), " ")


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return _WORD.findall(line)
    quoted = '"' in line
    cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True)) if quoted else line.split(separator)
    return [cell.strip() for cell in cells]


def _heading(place: int, cell: str) -> _Column:
    parts = _HEADING.fullmatch(cell)
    return _Column(place, parts["name"], parts["unit"].strip()) if parts else _Column(place, cell, "")


def _is_sample(cells: list[str]) -> bool:
    numbers = [cell for cell in cells if cell.lower() not in MISSING]
    return bool(numbers) and all(_parse(cell) is not None for cell in numbers)


def _column(header: list[_Column], key: str | int) -> _Column:
    if not isinstance(key, str):
        place = operator.index(key)
        if not 0 <= place < len(header):
            raise ValueError(f"no column {place}, there are columns 0 to {len(header) - 1}")
        return header[place]
    found = [column for column in header if key in (column.label, f"{column.label} [{column.unit}]")]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{len(found)} columns are called {key!r}, choose one by its number")
    there = ", ".join(column.label for column in header)
    raise ValueError(f"no column {key!r}, the columns are: {there}")


def _number(row: _Row, column: _Column) -> float:
    """Value of a cell, nan where it is missing."""
    cell = row.cells[column.place]
    if cell.lower() in MISSING:
        return math.nan
    value = _parse(cell)
    if value is None or not math.isfinite(value):
        hint = " (write decimals with a point)" if re.fullmatch(r"[+-]?\d+,\d+", cell) else ""
        raise ValueError(f"line {row.line}, column {column.label!r}: expected a finite number, got {cell!r}{hint}")
    return value


def _parse(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _gap(rows: list[_Row], columns: list[_Column], values: FloatArray) -> str:
    k, j = np.argwhere(np.isnan(values))[0]
    return (
        f'line {rows[k].line}, column {columns[j].label!r}: the value is missing; on_missing="drop" leaves '
        'such samples out, on_missing="split" cuts the record there'
    )


def _pieces(is_gap: npt.NDArray[np.bool_], *, cut: bool) -> list[npt.NDArray[np.intp]]:
    """Places of the samples of each record."""
    kept = np.flatnonzero(~is_gap)
    cuts = np.flatnonzero(np.diff(kept) > 1) + 1 if cut else kept[:0]
    pieces = np.split(kept, cuts)
    long_enough = [piece for piece in pieces if piece.size >= 2]
    if not long_enough:
        longest = max(piece.size for piece in pieces)
        raise ValueError(f"a record needs at least 2 samples, there are {longest}{' in a row' if cut else ''}")
    return long_enough


def _check_time(rows: list[_Row], times: FloatArray, pieces: list[npt.NDArray[np.intp]]) -> None:
    for piece in pieces:
        for before, k in itertools.pairwise(piece.tolist()):
            if times[k] <= times[before]:
                raise ValueError(f"line {rows[k].line}: time must increase, got {times[k]} after {times[before]}")
