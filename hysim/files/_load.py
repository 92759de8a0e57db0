"""The verbs `load` and `list_columns`: a record from a file, and what there is to choose from.

A file is read in three steps: its first bytes say its format; the format gives a table of named columns; and the
numbers of the chosen columns become a record, or several, with gaps where a value is missing.
"""

import itertools
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple, Protocol, TextIO, TypedDict, Unpack, overload, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.progress import Progress, Reports, reports
from hysim._basics.results import Named
from hysim._columns.resolution import output_quantum
from hysim.files._arrays import NUMBERS, Arrays, mat, micromag, npy, npz
from hysim.files._delimited import DECIMALS, THOUSANDS, Delimited, Text, delimited
from hysim.files._hdf5 import hdf5
from hysim.files._table import Column, Frame, Table, check_complete, check_increasing, damaged, require
from hysim.interop import table_in
from hysim.records import Record

Source = str | os.PathLike[str] | TextIO | BinaryIO | Any  # Any stands for tables of other libraries

MOST_TEXT = 500_000_000
"""Most bytes of a text file, and of any stream."""

_HEAD = 640  # bytes: HDF5 may begin behind a block of 512
_MODEL = re.compile(rb'\s*\{(.*[{,])?\s*"family"\s*:', re.DOTALL)
_HDF5 = b"\x89HDF\r\n\x1a\n"
_PIECE = 1 << 20  # bytes that are read of a stream at once
_TIMES = 3  # that a text is read: its layout is found, it is checked, and its numbers are read
_MOST_OF_AN_ARRAY = 100  # columns
_AT_ONCE = 5_000_000  # numbers of a text

ON_MISSING = ("error", "drop", "split")
SIGNALS = {"u": "input", "y": "output"}


class _Options(TypedDict, total=False):
    """Keyword arguments of `load` that do not change the type of its result."""

    u: str | int | None
    y: str | int | None
    t: str | int | None
    delimiter: str | None
    decimal: Literal[".", ","] | None
    thousands: str | None
    skip: int
    encoding: str | None
    units: Mapping[str, str] | None
    resolution: float | Literal["detect"] | None
    name: str | None
    channels: Sequence[str] | Mapping[str, str | int | float] | None
    progress: Reports


@overload
def load(path: Source, *, on_missing: Literal["error", "drop"] = "error", **options: Unpack[_Options]) -> Record: ...
@overload
def load(path: Source, *, on_missing: Literal["split"], **options: Unpack[_Options]) -> tuple[Record, ...]: ...
@reports
def load(
    path: Source,
    *,
    u: str | int | None = None,
    y: str | int | None = None,
    t: str | int | None = None,
    on_missing: Literal["error", "drop", "split"] = "error",
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    thousands: str | None = None,
    skip: int = 0,
    encoding: str | None = None,
    units: Mapping[str, str] | None = None,
    resolution: float | Literal["detect"] | None = None,
    name: str | None = None,
    channels: Sequence[str] | Mapping[str, str | int | float] | None = None,
    progress: Reports = None,
) -> Record | tuple[Record, ...]:
    """Load a record from a file: text, NPZ, NPY, MAT or HDF5; or from a table in memory, such as a DataFrame.

    The format is read from the file's first bytes. A text has one sample a line; blank lines and lines that begin
    with ``#`` or ``%`` are skipped. Delimiter and decimal sign are those that give the most numbers. A first line of
    text above numbers is the header; without one, a comment right above the samples with as many names is used, as
    `numpy.savetxt` writes it. ``voltage [V]``, ``voltage (V)`` or ``voltage/V`` is a name with a unit, after a slash if
    hysim knows it; a second line of text holds the units of all columns. Missing: empty, nan, na, n/a, null and none.

    In the other formats a column is an array by its name: a variable, a field of a struct (``rec.u``), a dataset
    (``group/displacement``). Samples run along the first axis; a column of an array with several axes is ``x[2]`` or
    ``x[0,1]``. Its unit is an attribute `units` in HDF5, or a text ``u_units``. A missing value is nan. HDF5, and
    MATLAB's ``-v7.3``, need h5py. A file of `hysim.save_record` needs no further arguments.

    A table in memory is a frame of pandas, polars or the like, a table of Arrow or a dataset of xarray. Its columns are
    taken by name; ``voltage [V]`` is a name with a unit here, too, and ``attrs["units"]`` of pandas and xarray holds
    units by name. An index of dates, of time spans, of floats without a name, or with the name t or time is the column
    t; dates and time spans become seconds. None, NA and NaT are missing values.

    Parameters
    ----------
    path : str, path, open file or table
        An open file of text or bytes is read from its position on. A text or open file may have 0.5 GB, an array 2 GB.
    u, y : str or int, optional
        Columns of input and output, by name or by number from 0: the number of a column of a text or of a single array,
        else of an array (in HDF5 in the order of the names). By default those called u and y.
    t : str or int, optional
        Column of time; by default that called t, if there is one; False for a record without time.
    on_missing : {"error", "drop", "split"}
        Where a chosen column has no value: raise, leave the sample out, or cut the record there into several.
    delimiter : str, optional
        Character between cells; a blank is any white space. By default tab, semicolon, comma or blank is detected.
    decimal : {".", ","}, optional
        Decimal sign of a text; detected by default.
    thousands : str, optional
        Sign between thousands in a text. It need not be given if it is an apostrophe or a space, nor where a number can
        mean nothing else: ``1.000,5`` is 1000.5, but ``1.000`` is one unless ``thousands="."``.
    skip : int, optional
        Number of lines at the top of a text that are neither samples nor column names, such as LabVIEW's header.
    encoding : str, optional
        Encoding of a text; by default UTF-8, or UTF-16 or UTF-32 after their byte order mark.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"``, ``"y"`` and the channels; they replace those of the file.
    resolution : float or "detect", optional
        Quantum of the output's sensor [unit of y], in place of the file's; or ``"detect"`` it from the values.
    name : str, optional
        Name of the record; by default that in the file or the table's ``attrs``, or the file's name without ending.
    channels : sequence of str, or mapping, optional
        Further columns by name, or names of channels to columns, by name or number; a float is the value of a constant
        channel: ``{"T": "temp", "current": 0.5}``. By default those that the file of `hysim.save_record` names.
    progress : callable or False, optional
        Called as ``progress(done, total)`` with numbers of bytes of a text, which is read three times.
        By default calls beyond 2 s report on the standard error; False turns this off.

    Returns
    -------
    Record, or tuple of Record
        A tuple with ``on_missing="split"``: the pieces between the gaps that have at least 2 samples.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    TypeError
        If `path` is neither a path, nor an open file, nor a table.
    ValueError
        If the file is damaged or too large, a column is unknown, a row is too long or short, a value is missing or not
        finite, lengths differ, the time does not increase, or an argument for text is used with another format. The
        message is one line that names the file, the line or sample, and the column.

    Examples
    --------
    >>> import io, hysim as hs
    >>> text = io.StringIO("voltage [V], displacement [um]\\n0, 0.0\\n5, 0.079\\n10, 0.152\\n")
    >>> rec = hs.load(text, u="voltage", y="displacement")
    >>> rec.u.tolist(), dict(rec.units)
    ([0.0, 5.0, 10.0], {'u': 'V', 'y': 'um'})
    """
    check_choice("on_missing", on_missing, ON_MISSING)
    is_known = not isinstance(resolution, str) or resolution == "detect"
    require(is_known, f'resolution must be a number or "detect", got {resolution!r}')
    for_text = options_of_a_text(delimiter, decimal, thousands, skip, encoding)
    with opened(path) as source:
        with table_of(source, for_text, progress or None) as table:
            columns = _columns(table, {"u": u, "y": y, "t": t})
            signals = [*columns]
            names = [channels] if isinstance(channels, str) else table.notes.channels if channels is None else channels
            keys = names if isinstance(names, Mapping) else {label: label for label in names}
            constants = {label: key for label, key in keys.items() if isinstance(key, float)}
            columns |= {label: table.column(key) for label, key in keys.items() if not isinstance(key, float)}
            labels = _units(table, columns, constants) | dict(units or {})
            values = table.values([*columns.values()])
        parts = _parts(table, columns, values, on_missing)
        if resolution == "detect":
            resolution = output_quantum(values[1, np.concatenate(parts)])
        elif resolution is None and columns["y"].label == "y":
            resolution = table.notes.resolution
        if name is None:
            unstated = "" if source.format == "frame" else Path(source.name).stem
            name = unstated if table.notes.name is None else table.notes.name
        records = list[Record]()
        for part in parts:
            chosen: dict[str, Any] = {**constants, **dict(zip(columns, values[:, part], strict=True))}
            arrays, own = {name: chosen[name] for name in signals}, {label: chosen[label] for label in keys}
            records.append(Record(**arrays, channels=own, units=labels, resolution=resolution, name=name))
    return tuple(records) if on_missing == "split" else records[0]


def options_of_a_text(
    delimiter: str | None, decimal: str | None, thousands: str | None, skip: int, encoding: str | None
) -> dict[str, Any]:
    """Options for a text by name, None where nothing is asked for; ValueError if one is no option for any text."""
    require(delimiter is None or len(delimiter) == 1, f"delimiter must be one character, got {delimiter!r}")
    require(decimal in (None, *DECIMALS), f'decimal must be "." or ",", got {decimal!r}')
    require(skip >= 0, f"skip must be a number of lines, got {skip}")
    is_sign = thousands is None or (thousands in (*THOUSANDS,) and thousands != decimal)
    signs = "a point, a comma, an apostrophe or a space that is not the decimal sign"
    require(is_sign, f"thousands must be {signs}, got {thousands!r}")
    return {
        "delimiter": delimiter, "decimal": decimal, "thousands": thousands, "skip": skip or None, "encoding": encoding,
    }  # fmt: skip


class Opened(NamedTuple):
    """Name, format, content (of a DataFrame its table) of a source, and its path and encoding if known."""

    name: str
    format: str
    content: Any
    path: Path | None = None
    encoding: str | None = None


@runtime_checkable
class _Readable(Protocol):
    def read(self, size: int, /) -> Any: ...


@contextmanager
def opened(source: Source) -> Iterator[Opened]:
    """Open a source to read from, and begin every message about it with its name; OSError, TypeError or ValueError."""
    with ExitStack() as stack:
        path, encoding, table = None, None, None
        file: BinaryIO
        if isinstance(source, (str, os.PathLike)):
            path = Path(source)
            name, file = path.name, stack.enter_context(path.open("rb"))
            if not path.is_file():  # a pipe or a device
                path, (file, encoding) = None, _content(file)
        elif isinstance(source, _Readable):
            name = Path(str(source.name)).name if isinstance(source, Named) else "stream"
            file, encoding = _content(source)
        elif (table := table_in(source)) is not None:
            name, file = f"the {table.kind}", BytesIO()
        else:
            raise TypeError(f"load takes a path, an open file or a DataFrame, got {type(source).__name__}")
        try:
            yield Opened(name, "frame", Frame(table)) if table is not None else _opened(name, file, path, encoding)
        except ValueError as error:
            line = " ".join(str(error).split())
            raise ValueError(line if line.startswith(name) else f"{name}: {line}") from None


def _content(stream: _Readable) -> tuple[BytesIO, str | None]:
    """The content of a stream, not much more than the most that is taken, and its encoding if it is text."""
    pieces, size = list[Any](), 0
    while size <= MOST_TEXT and (piece := stream.read(_PIECE)):
        pieces.append(piece)
        size += len(piece)
    is_text = bool(pieces) and isinstance(pieces[0], str)
    content = "".join(pieces).encode(errors="replace") if is_text else b"".join(pieces)
    return BytesIO(content), "utf-8" if is_text else None


def _opened(name: str, file: BinaryIO, path: Path | None, encoding: str | None) -> Opened:
    form = format_of(file.read(_HEAD))
    form = "text" if encoding and form != "model" else form
    size = file.seek(0, 2)
    is_small = size <= MOST_TEXT or (path is not None and form not in ("text", "micromag"))
    advice = "cut it, or save its columns as NPZ, MAT or HDF5 and pass the path"
    require(is_small, f"{name} is too large: a text or a stream may have {MOST_TEXT:,} bytes, got {size}; {advice}")
    file.seek(0)
    return Opened(name, form, file, path, encoding)


def format_of(head: bytes) -> str:
    """The format of a file that begins so: "npz", "npy", "mat", "mat7.3", "hdf5", "micromag", "model" or "text"."""
    if head.startswith(b"MicroMag"):
        return "micromag"
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "npz"
    if head.startswith(b"\x93NUMPY"):
        return "npy"
    if head.startswith(_HDF5) or head[512:520] == _HDF5:
        return "mat7.3" if head.startswith(b"MATLAB") else "hdf5"
    if head.startswith(b"MATLAB 5.0") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"):
        return "mat"
    return "model" if _MODEL.match(head) else "text"


@contextmanager
def table_of(source: Opened, for_text: Mapping[str, Any], progress: Progress | None = None) -> Iterator[Table]:
    if source.format == "text":
        encoding = source.encoding or for_text["encoding"]
        reading = _reading(progress, _TIMES * source.content.seek(0, 2))
        text = Text(source.content, source.name, encoding, for_text.get("skip") or 0, reading)
        yield delimited(text, for_text["delimiter"], for_text["decimal"], for_text.get("thousands"))
        return
    require(source.format != "model", f"{source.name} is a model: read it with hs.load_model")
    form = source.name if source.format == "frame" else f"a file of the format {source.format}"
    for argument, value in for_text.items():
        require(value is None, f"{argument} is for text, this is {form}: leave it out")
    if source.format == "frame":
        yield source.content
    elif source.format in ("hdf5", "mat7.3"):
        with hdf5(source.content, source.path, matlab=source.format != "hdf5") as table:
            yield table
    else:
        with damaged(source.format.upper()):
            arrays = {"npz": npz, "npy": npy, "mat": mat, "micromag": micromag}[source.format](source.content)
        yield arrays


def _reading(progress: Progress | None, total: int) -> Callable[[int], None]:
    """A function that is told how many bytes have been read since its last call, and reports them of all."""
    done = 0

    def report(n_bytes: int) -> None:
        nonlocal done
        done += n_bytes
        if progress is not None:
            progress(min(done, total), total)

    return report


def _columns(table: Table, keys: Mapping[str, str | int | None]) -> dict[str, Column]:
    """The columns of the signals by their keys, by default those with the signals' names."""
    columns = {}
    for signal, meaning in SIGNALS.items():
        key = keys[signal]
        try:
            columns[signal] = table.column(signal if key is None else key)
        except ValueError as error:
            if key is not None or signal in table.labels:
                raise
            raise ValueError(f"{error}; pass the column of the {meaning} as {signal}=") from None
    key = "t" if keys["t"] is None and "t" in table.labels else keys["t"]
    if key is not None and key is not False:
        columns["t"] = table.column(key)
    return columns


def _parts(
    table: Table, columns: Mapping[str, Column], values: FloatArray, on_missing: str
) -> list[npt.NDArray[np.intp]]:
    if on_missing == "error":
        advice = 'on_missing="drop" leaves such samples out, on_missing="split" cuts the record there'
        check_complete(table, [*columns.values()], values, advice)
    samples = np.flatnonzero(~np.isnan(values).any(axis=0))
    is_cut = on_missing == "split"
    parts = np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1 if is_cut else [])
    long_enough = [part for part in parts if part.size >= 2]
    longest = max(part.size for part in parts)
    require(long_enough, f"a record needs at least 2 samples, there are {longest}{' in a row' * is_cut}")
    times = values[[*columns].index("t")] if "t" in columns else np.arange(float(values.shape[1]))
    for part in long_enough:
        advice = "sort the samples, remove repeated ones, or load without time: t=False"
        check_increasing(table, times, part, advice)
    return long_enough


def _units(table: Table, columns: Mapping[str, Column], constants: Iterable[str]) -> dict[str, str]:
    units = {signal: table.notes.units.get(c.label, c.unit or None) for signal, c in columns.items()}
    units |= {label: table.notes.units.get(label) for label in constants}
    if "t" not in columns and "t" not in table.labels:
        units["t"] = table.notes.units.get("t")
    return {signal: unit for signal, unit in units.items() if unit is not None}


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
    >>> import io, hysim as hs
    >>> text = io.StringIO("t [s], voltage [V], note\\n0, 0.0, a\\n1, 5.0, b\\n")
    >>> [(each.name, each.unit, each.highest) for each in hs.list_columns(text)]
    [('t', 's', 1.0), ('voltage', 'V', 5.0), ('note', '', nan)]
    """
    for_text = options_of_a_text(delimiter, decimal, thousands, skip, encoding)
    with opened(path) as source, table_of(source, for_text) as table:
        keys = [*_keys(table)]  # of a text many at once, because it is split into all of its cells each time
        size = max(1, _AT_ONCE // table.n_samples) if isinstance(table, Delimited) else 1
        starts = range(0, len(keys), size)
        return tuple(each for start in starts for each in _together(table, keys[start : start + size]))


_Key = tuple[str, int | None]


def _keys(table: Table) -> Iterator[_Key]:
    """Name and number of each column, None for one of several axes."""
    if not isinstance(table, Arrays):
        yield from zip(table.labels, itertools.count())
        return
    for place, array in enumerate(table.arrays):
        if array.is_vector or array.kind != NUMBERS:
            yield array.label, place
        else:
            is_only = len(table.arrays) == 1 and len(array.shape) == 2
            for k, index in enumerate(itertools.islice(np.ndindex(array.shape[1:]), _MOST_OF_AN_ARRAY)):
                yield f"{array.label}[{','.join(map(str, index))}]", k if is_only else None


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
