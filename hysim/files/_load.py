"""The verb `load`: a record from a text file.

A file is read in three steps: bytes become text, the text's lines become columns of cells, and the cells of the
chosen columns become numbers, or gaps where a value is missing.
"""

import operator
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, overload

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.files._cells import numbers, table
from hysim.files._layout import DECIMALS, Column, Layout, layout
from hysim.files._text import Source, read
from hysim.records import Record

ON_MISSING = ("error", "drop", "split")


@overload
def load(
    path: Source,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["error", "drop"] = "error",
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> Record: ...
@overload
def load(
    path: Source,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["split"],
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> tuple[Record, ...]: ...
def load(
    path: Source,
    *,
    u: str | int,
    y: str | int,
    t: str | int | None = None,
    on_missing: Literal["error", "drop", "split"] = "error",
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | None = None,
    name: str | None = None,
) -> Record | tuple[Record, ...]:
    """Load a record from a text file with one sample a line.

    Blank lines and lines that begin with ``#`` or ``%`` are skipped. The delimiter and the decimal sign are those
    under which most cells of the file are numbers. A first line of text over columns of numbers is the header; if
    there is none, a comment right above the samples that names as many columns is taken for it, as
    `numpy.savetxt` writes one. A unit in brackets is split off: under ``voltage [V]`` or ``voltage (V)`` the
    column is `voltage`, and its unit V. A second line of text holds the units of all columns. Only the chosen
    columns have to be numbers. Cells may be quoted; a quoted cell ends on its line. Missing values are empty
    cells, nan, na, n/a, null and none.

    Parameters
    ----------
    path : str, path or open file
        Windows and old Macintosh line ends are read as well.
    u, y, t : str or int
        Columns of input, output and time, by name or by number from 0. Without `t` the record has no time.
    on_missing : {"error", "drop", "split"}
        What to do where a chosen column has no value: raise, leave the sample out, or cut the record there
        into several.
    delimiter : str, optional
        One character between the cells, or a blank for any white space. By default found among tab, semicolon,
        comma and white space.
    decimal : {".", ","}, optional
        Sign before the decimals; by default found. There is none between thousands.
    encoding : str, optional
        By default UTF-8, or UTF-16 or UTF-32 where the file begins with their byte order mark.
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
        a cell is not a finite number, a value is missing or the time does not increase. The message is one line
        that names the file, the line and the column, and says what to do.

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
    if decimal is not None and decimal not in DECIMALS:
        raise ValueError(f'decimal must be "." or ",", got {decimal!r}')
    source, text = read(path, encoding)
    wanted = {"u": u, "y": y} if t is None else {"u": u, "y": y, "t": t}
    try:
        found = layout(text, delimiter, decimal)
        lines = found.numbers
        chosen = {signal: _column(found.columns, key) for signal, key in wanted.items()}
        values = _values(found, list(chosen.values()))
        is_gap = np.asarray(np.isnan(values).any(axis=0))
        if on_missing == "error" and is_gap.any():
            raise ValueError(_gap(lines, list(chosen.values()), values))
        pieces = _pieces(is_gap, cut=on_missing == "split")
        if t is not None:
            _check_time(lines, values[-1], pieces)
        labels = {signal: column.unit for signal, column in chosen.items() if column.unit} | dict(units or {})
        title = Path(source).stem if name is None else name
        records = tuple(
            Record(**dict(zip(chosen, values[:, piece], strict=True)), units=labels, resolution=resolution, name=title)
            for piece in pieces
        )
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None
    return records if on_missing == "split" else records[0]


def _column(header: list[Column], key: str | int) -> Column:
    if not isinstance(key, str):
        place = operator.index(key)
        if not 0 <= place < len(header):
            raise ValueError(f"no column {place}, there are columns 0 to {len(header) - 1}")
        return header[place]
    found = [column for column in header if key in (column.label, f"{column.label} [{column.unit}]")]
    if len(found) == 1:
        return found[0]
    if found:
        places = ", ".join(str(column.place) for column in found)
        raise ValueError(f"{len(found)} columns are called {key!r}: choose one of the numbers {places}")
    there = ", ".join(column.label for column in header)
    raise ValueError(f"no column {key!r}, the columns are: {there}")


def _values(found: Layout, columns: list[Column]) -> FloatArray:
    """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
    quick = table(found.lines, [column.place for column in columns], found.delimiter, found.decimal)
    if quick is not None:
        return quick
    rows = found.rows()
    return np.stack([numbers([row[c.place] for row in rows], found.numbers, c.label, found.decimal) for c in columns])


def _gap(lines: list[int], columns: list[Column], values: FloatArray) -> str:
    k, j = np.argwhere(np.isnan(values.T))[0]
    return (
        f'line {lines[k]}, column {columns[j].label!r}: the value is missing; on_missing="drop" leaves '
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


def _check_time(lines: list[int], times: FloatArray, pieces: list[npt.NDArray[np.intp]]) -> None:
    for piece in pieces:
        back = np.flatnonzero(np.diff(times[piece]) <= 0)
        if back.size:
            before, k = piece[back[0]], piece[back[0] + 1]
            raise ValueError(
                f"line {lines[k]}: time must increase, got {times[k]} after {times[before]}; sort the lines, leave "
                "repeated ones out, or load without t"
            )
