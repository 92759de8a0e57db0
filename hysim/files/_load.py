"""The verb `load`: a record from a file.

A file is read in three steps: its first bytes say its format; the format gives a table of named columns; and the
numbers of the chosen columns become a record, or several, with gaps where a value is missing.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, overload

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim._quanta import output_quantum
from hysim.files._delimited import delimited
from hysim.files._hdf5 import hdf5
from hysim.files._layout import DECIMALS
from hysim.files._mat import mat
from hysim.files._npz import npy, npz
from hysim.files._source import Opened, Source, opened
from hysim.files._table import Column, Table, check_gaps, check_time, pieces
from hysim.files._text import text_of
from hysim.records import Record

ON_MISSING = ("error", "drop", "split")
SIGNALS = {"u": "input", "y": "output"}


@overload
def load(
    path: Source,
    *,
    u: str | int | None = None,
    y: str | int | None = None,
    t: str | int | None = None,
    on_missing: Literal["error", "drop"] = "error",
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | Literal["detect"] | None = None,
    name: str | None = None,
) -> Record: ...
@overload
def load(
    path: Source,
    *,
    u: str | int | None = None,
    y: str | int | None = None,
    t: str | int | None = None,
    on_missing: Literal["split"],
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | Literal["detect"] | None = None,
    name: str | None = None,
) -> tuple[Record, ...]: ...
def load(
    path: Source,
    *,
    u: str | int | None = None,
    y: str | int | None = None,
    t: str | int | None = None,
    on_missing: Literal["error", "drop", "split"] = "error",
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | Literal["detect"] | None = None,
    name: str | None = None,
) -> Record | tuple[Record, ...]:
    """Load a record from a file: text, NPZ, NPY, MAT or HDF5.

    The format is read from the file's first bytes. In text, one sample a line, blank lines and lines that begin
    with ``#`` or ``%`` are skipped. The delimiter and the decimal sign are those under which most cells of the file
    are numbers. A first line of text over columns of numbers is the header; if there is none, a comment right above
    the samples that names as many columns is taken for it, as `numpy.savetxt` writes one. A unit in brackets is
    split off: under ``voltage [V]`` or ``voltage (V)`` the column is `voltage`, and its unit V. A second line of
    text holds the units of all columns. Only the chosen columns have to be numbers. Cells may be quoted; a quoted
    cell ends on its line. Missing values are empty cells, nan, na, n/a, null and none.

    In the other formats a column is an array, called by its name: a variable, a field of a struct (``rec.u``), a
    dataset (``group/displacement``). Of an array with several axes the first is that of the samples, and a column
    is called ``x[2]`` or ``x[0,1]``. Its unit is an attribute `units` in HDF5, or a text beside it called
    ``u_units``. A missing value is nan. Files of HDF5, and MATLAB's ``-v7.3``, need h5py.

    What `hysim.save_record` wrote comes back whole, resolution and name too, without further arguments.

    Parameters
    ----------
    path : str, path or open file
        An open file of text or of bytes is read from where it stands. A text, or an open file, may have 0.5 GB; an
        array 2 GB.
    u, y : str or int, optional
        Columns of input and output, by name or by number from 0: of the columns of a text or of a single array, of
        the arrays in their order otherwise (HDF5: of their names). By default those called u and y.
    t : str or int, optional
        Column of time. By default that called t, if there is one; False leaves it out. A record without it has
        no time.
    on_missing : {"error", "drop", "split"}
        What to do where a chosen column has no value: raise, leave the sample out, or cut the record there
        into several.
    delimiter : str, optional
        One character between the cells of a text, or a blank for any white space. By default found among tab,
        semicolon, comma and white space.
    decimal : {".", ","}, optional
        Sign before the decimals of a text; by default found. There is none between thousands.
    encoding : str, optional
        Of a text; by default UTF-8, or UTF-16 or UTF-32 where the file begins with their byte order mark.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``, before those of the file.
    resolution : float or "detect", optional
        Quantum of the output's sensor [unit of y], before that of the file; ``"detect"`` takes what
        `Record.detect_resolution` finds in the output.
    name : str, optional
        Name of the record; by default what the file says, or the file's name without its ending.

    Returns
    -------
    Record, or tuple of Record
        A tuple with ``on_missing="split"``: the pieces between the gaps that have at least 2 samples.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    TypeError
        If `path` is neither a path nor an open file.
    ValueError
        If the file is damaged, too large, empty or has no samples; a column is unknown; or a row is too long or
        short, a value is missing or not finite, columns have unequal lengths, or the time does not increase. The
        message is one line that names the file, the line or sample, and the column, and says what to do. Also if an
        argument that is for text comes with another format.

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
    if isinstance(resolution, str) and resolution != "detect":
        raise ValueError(f'resolution must be a number or "detect", got {resolution!r}')
    said = {"delimiter": delimiter, "decimal": decimal, "encoding": encoding}
    with opened(path) as source, _line_named(source):
        with _table(source, said) as table:
            chosen = _chosen(table, {"u": u, "y": y, "t": t})
            labels = _units(table, chosen) | dict(units or {})
            values = table.values(list(chosen.values()))
        parts = _parts(table, chosen, values, on_missing)
        if resolution == "detect":
            resolution = output_quantum(values[1, np.concatenate(parts)])
        elif resolution is None and chosen["y"].label == "y":
            resolution = table.notes.resolution
        if name is None:
            name = Path(source.name).stem if table.notes.name is None else table.notes.name
        records = tuple(
            Record(**dict(zip(chosen, values[:, part], strict=True)), units=labels, resolution=resolution, name=name)
            for part in parts
        )
    return records if on_missing == "split" else records[0]


@contextmanager
def _line_named(source: Opened) -> Iterator[None]:
    """What is wrong with a file is said in one line that names it."""
    try:
        yield
    except ValueError as error:
        line = " ".join(str(error).split())
        raise ValueError(line if line.startswith(source.name) else f"{source.name}: {line}") from None


@contextmanager
def _table(source: Opened, said: Mapping[str, str | None]) -> Iterator[Table]:
    """The table that a source holds, open to be read from."""
    if isinstance(source.content, (str, bytes)):
        text = text_of(source.content, source.name, said["encoding"])
        yield delimited(text, said["delimiter"], said["decimal"])
        return
    for argument, value in said.items():
        if value is not None:
            raise ValueError(f"{argument} is for text, this is a file of the format {source.format}: leave it out")
    if source.format in ("hdf5", "mat7.3"):
        with hdf5(source.content, source.path, matlab=source.format != "hdf5") as table:
            yield table
    else:
        yield _READERS[source.format](source.content)


_READERS = {"npz": npz, "npy": npy, "mat": mat}


def _chosen(table: Table, asked: Mapping[str, str | int | None]) -> dict[str, Column]:
    """The columns of the signals: those asked for, or those called like them."""
    chosen = {signal: _column(table, signal, asked[signal]) for signal in ("u", "y")}
    key = "t" if asked["t"] is None and table.has("t") else asked["t"]
    if key is not None and key is not False:
        chosen["t"] = table.column(key)
    return chosen


def _column(table: Table, signal: str, key: str | int | None) -> Column:
    if key is not None or table.has(signal):
        return table.column(signal if key is None else key)
    try:
        return table.column(signal)
    except ValueError as error:
        raise ValueError(f"{error}; say which one is the {SIGNALS[signal]} by {signal}=") from None


def _parts(
    table: Table, chosen: Mapping[str, Column], values: FloatArray, on_missing: str
) -> list[npt.NDArray[np.intp]]:
    """The samples of each record, checked."""
    if on_missing == "error":
        check_gaps(table, list(chosen.values()), values)
    parts = pieces(np.asarray(np.isnan(values).any(axis=0)), cut=on_missing == "split")
    if "t" in chosen:
        check_time(table, values[-1], parts)
    return parts


def _units(table: Table, chosen: Mapping[str, Column]) -> dict[str, str]:
    """Units of the signals where the file has any."""
    said = table.notes.units
    units = {signal: said.get(column.label, column.unit or None) for signal, column in chosen.items()}
    if "t" not in chosen and not table.has("t"):
        units["t"] = said.get("t")
    return {signal: unit for signal, unit in units.items() if unit is not None}
