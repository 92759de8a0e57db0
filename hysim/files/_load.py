"""The verb `load`: a record from a file.

A file is read in three steps: its first bytes say its format; the format gives a table of named columns; and the
numbers of the chosen columns become a record, or several, with gaps where a value is missing.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_choice
from hysim._progress import Progress, Reports, reports
from hysim._resolution import output_quantum
from hysim.files._cells import THOUSANDS
from hysim.files._delimited import delimited
from hysim.files._frames import Frame
from hysim.files._hdf5 import hdf5
from hysim.files._layout import DECIMALS
from hysim.files._mat import mat
from hysim.files._npz import npy, npz
from hysim.files._source import Opened, Source, opened
from hysim.files._table import Column, Table, shown
from hysim.files._text import Text
from hysim.records import Record

_TIMES = 3
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
    `numpy.savetxt` writes it. ``voltage [V]`` or ``voltage (V)`` is a name with a unit; a second line of text holds
    the units of all columns. Missing values are empty cells, nan, na, n/a, null and none.

    In the other formats a column is an array by its name: a variable, a field of a struct (``rec.u``), a dataset
    (``group/displacement``). Samples run along the first axis; a column of an array with several axes is ``x[2]`` or
    ``x[0,1]``. Its unit is an attribute `units` in HDF5, or a text beside it called ``u_units``. A missing value is
    nan. HDF5, and MATLAB's ``-v7.3``, need h5py. A file of `hysim.save_record` needs no further arguments.

    A table in memory is a frame of pandas, polars or the like, a table of Arrow or a dataset of xarray. Its columns are
    taken by name; ``voltage [V]`` is a name with a unit here, too, and ``attrs["units"]`` of pandas and xarray holds
    units by name. An index of dates, of time spans, of floats without a name, or with the name t or time is the column
    t; dates and time spans become seconds. None, NA and NaT are missing values.

    Parameters
    ----------
    path : str, path, open file or table
        An open file of text or of bytes is read from its current position. A text, or an open file, may have 0.5 GB;
        an array 2 GB.
    u, y : str or int, optional
        Columns of input and output, by name or by number from 0: the number of a column of a text or of a single array,
        else of an array (in HDF5 in the order of the names). By default those called u and y.
    t : str or int, optional
        Column of time; by default that called t, if there is one; False for a record without time.
    on_missing : {"error", "drop", "split"}
        Where a chosen column has no value: raise, leave the sample out, or cut the record there into several.
    delimiter : str, optional
        One character between the cells of a text, or a blank for any white space; by default tab, semicolon, comma or
        white space is detected.
    decimal : {".", ","}, optional
        Decimal sign of a text; detected by default.
    thousands : str, optional
        Sign between thousands in a text. It need not be given if it is an apostrophe or a space, nor where a number can
        mean nothing else: ``1.000,5`` is 1000.5, but ``1.000`` is one unless ``thousands="."``.
    skip : int, optional
        Number of lines at the top of a text that are neither samples nor names of columns, such as the header of
        LabVIEW.
    encoding : str, optional
        Encoding of a text; by default UTF-8, or UTF-16 or UTF-32 after their byte order mark.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"``, ``"y"`` and the channels; they replace those of the file.
    resolution : float or "detect", optional
        Quantum of the output's sensor [unit of y], in place of the file's; or ``"detect"`` it from the values.
    name : str, optional
        Name of the record; by default the one in the file or in the table's ``attrs``, or the file's name without its
        ending.
    channels : sequence of str, or mapping, optional
        Further columns by their names, or names of channels to columns, by name or by number; a float is the value of a
        channel that is constant: ``{"T": "temp", "current": 0.5}``. By default those that the file of
        `hysim.save_record` names.
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
    >>> import io
    >>> import hysim as hs
    >>> text = io.StringIO("voltage [V], displacement [um]\\n0, 0.0\\n5, 0.079\\n10, 0.152\\n")
    >>> rec = hs.load(text, u="voltage", y="displacement")
    >>> rec.u.tolist(), dict(rec.units)
    ([0.0, 5.0, 10.0], {'u': 'V', 'y': 'um'})
    """
    check_choice("on_missing", on_missing, ON_MISSING)
    if delimiter is not None and len(delimiter) != 1:
        raise ValueError(f"delimiter must be one character, got {delimiter!r}")
    if decimal is not None and decimal not in DECIMALS:
        raise ValueError(f'decimal must be "." or ",", got {decimal!r}')
    if isinstance(resolution, str) and resolution != "detect":
        raise ValueError(f'resolution must be a number or "detect", got {resolution!r}')
    for_text = options_of_a_text(delimiter, decimal, thousands, skip, encoding)
    with opened(path) as source, file_named(source):
        with table_of(source, for_text, progress) as table:
            columns = _columns(table, {"u": u, "y": y, "t": t})
            signals, places = [*columns], _channels(table, channels)
            constants = {label: place for label, place in places.items() if isinstance(place, float)}
            columns |= {label: place for label, place in places.items() if isinstance(place, Column)}
            labels = _units(table, columns, constants) | dict(units or {})
            values = table.values([*columns.values()])
        parts = _parts(table, columns, values, on_missing)
        if resolution == "detect":
            resolution = output_quantum(values[1, np.concatenate(parts)])
        elif resolution is None and columns["y"].label == "y":
            resolution = table.notes.resolution
        if name is None:
            unstated = "" if isinstance(source.content, Frame) else Path(source.name).stem
            name = unstated if table.notes.name is None else table.notes.name
        records = tuple(
            _record(signals, places, dict(zip(columns, values[:, part], strict=True)), labels, resolution, name)
            for part in parts
        )
    return records if on_missing == "split" else records[0]


def options_of_a_text(
    delimiter: str | None, decimal: str | None, thousands: str | None, skip: int, encoding: str | None
) -> dict[str, Any]:
    """Options for a text by name, None where nothing is asked for; ValueError if one is no option for any text."""
    if skip < 0:
        raise ValueError(f"skip must be a number of lines, got {skip}")
    if thousands is not None and (thousands not in tuple(THOUSANDS) or thousands == decimal):
        raise ValueError(
            "thousands must be a point, a comma, an apostrophe or a space that is not the decimal sign, got "
            f"{thousands!r}"
        )
    return {
        "delimiter": delimiter, "decimal": decimal, "thousands": thousands, "skip": skip or None, "encoding": encoding,
    }  # fmt: skip


@contextmanager
def file_named(source: Opened) -> Iterator[None]:
    """Make every message about a file one line that begins with its name."""
    try:
        yield
    except ValueError as error:
        line = " ".join(str(error).split())
        raise ValueError(line if line.startswith(source.name) else f"{source.name}: {line}") from None


@contextmanager
def table_of(source: Opened, for_text: Mapping[str, Any], progress: Reports = None) -> Iterator[Table]:
    """The table that a source holds, open to be read from."""
    if source.format == "text":
        reading = _Reading(progress or None, source.content)
        text = Text(source.content, source.name, for_text["encoding"], for_text.get("skip") or 0, reading)
        yield delimited(text, for_text["delimiter"], for_text["decimal"], for_text.get("thousands"))
        return
    if source.format == "model":
        raise ValueError(f"{source.name} is a model: read it with hs.load_model")
    for argument, value in for_text.items():
        if value is not None:
            form = source.name if isinstance(source.content, Frame) else f"a file of the format {source.format}"
            raise ValueError(f"{argument} is for text, this is {form}: leave it out")
    if isinstance(source.content, Frame):
        yield source.content
    elif source.format in ("hdf5", "mat7.3"):
        with hdf5(source.content, source.path, matlab=source.format != "hdf5") as table:
            yield table
    else:
        yield _READERS[source.format](source.content)


class _Reading:
    """Progress by the bytes of a text that is read `_TIMES` times: its layout is found and checked, then it is read."""

    def __init__(self, progress: Progress | None, content: Any) -> None:
        self.progress, self.done = progress, 0
        self.total = 0 if progress is None or isinstance(content, str) else _TIMES * content.seek(0, 2)

    def __call__(self, n_bytes: int) -> None:
        self.done += n_bytes
        if self.progress is not None:
            self.progress(min(self.done, self.total), self.total)


_READERS = {"npz": npz, "npy": npy, "mat": mat}


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
    """Places of the samples of each record."""
    is_missing = np.isnan(values)
    if on_missing == "error" and is_missing.any():
        k, j = np.argwhere(is_missing.T)[0]
        raise ValueError(
            f"{table.place(k)}, column {shown([*columns.values()][j].label)}: the value is missing; "
            'on_missing="drop" leaves such samples out, on_missing="split" cuts the record there'
        )
    samples = np.flatnonzero(~is_missing.any(axis=0))
    is_cut = on_missing == "split"
    parts = np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1 if is_cut else [])
    long_enough = [part for part in parts if part.size >= 2]
    if not long_enough:
        longest = max(part.size for part in parts)
        raise ValueError(f"a record needs at least 2 samples, there are {longest}{' in a row' if is_cut else ''}")
    if "t" in columns:
        for part in long_enough:
            _check_time(table, values[[*columns].index("t")], part)
    return long_enough


def _check_time(table: Table, times: FloatArray, part: npt.NDArray[np.intp]) -> None:
    wrong = np.flatnonzero(np.diff(times[part]) <= 0)
    if wrong.size:
        before, k = part[wrong[0]], part[wrong[0] + 1]
        raise ValueError(
            f"{table.place(k)}: time must increase, got {times[k]} after {times[before]}; sort the samples, remove "
            "repeated ones, or load without time: t=False"
        )


def _channels(
    table: Table, channels: Sequence[str] | Mapping[str, str | int | float] | None
) -> dict[str, Column | float]:
    """The column of each channel, or its number where it is constant; by default those that the file names."""
    if channels is None:
        keys: Mapping[str, str | int | float] = table.notes.channels
    elif isinstance(channels, Mapping):
        keys = channels
    else:
        keys = dict(zip(*[(channels,) if isinstance(channels, str) else channels] * 2, strict=True))
    return {label: key if isinstance(key, float) else table.column(key) for label, key in keys.items()}


def _record(
    signals: Sequence[str],
    channels: Mapping[str, Column | float],
    values: Mapping[str, FloatArray],
    units: Mapping[str, str],
    resolution: float | None,
    name: str,
) -> Record:
    return Record(
        **{signal: values[signal] for signal in signals},
        channels={label: values.get(label, place) for label, place in channels.items()},
        units=units,
        resolution=resolution,
        name=name,
    )


def _units(table: Table, columns: Mapping[str, Column], constants: Iterable[str]) -> dict[str, str]:
    """Units of the signals and channels where the file states them."""
    units = {signal: table.notes.units.get(c.label, c.unit or None) for signal, c in columns.items()}
    units |= {label: table.notes.units.get(label) for label in constants}
    if "t" not in columns and "t" not in table.labels:
        units["t"] = table.notes.units.get("t")
    return {signal: unit for signal, unit in units.items() if unit is not None}
