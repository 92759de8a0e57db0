"""Options by which every command reads a record from a file."""

import argparse
import io
import os
import sys
from collections.abc import Callable
from typing import Any

from hysim._frozen import FloatArray
from hysim.cli.options import positive
from hysim.cli.shell.ranges import cut
from hysim.records import Record

STANDARD = "-"
"""Stands for the standard input or output."""

DETECT = "detect"
"""Stands for the resolution that the outputs show."""

_DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blank": " "}

FILE = "file FILE  text with one sample a line, NPZ, NPY, MAT or HDF5; or - for the standard input"
FILES = f"{FILE}\nothers FILE...  further records with the same columns, such as those of other rates"
_INPUT = "--u COLUMN  input: name of its column, or its number from 0 (default: u)"
_OUTPUT = "--y COLUMN  output: name or number of its column (default: y)"
OF_A_TEXT = f"""--delimiter SIGN  sign between cells of a text, or {", ".join(_DELIMITERS)} (default: detected)
--decimal .|,  sign before the decimals of a text (default: detected)
--thousands SIGN  sign between thousands of a text (default: none, but where a number can mean nothing else)
--skip N  number of lines at the top of a text that are neither samples nor names of columns
--encoding NAME  encoding of a text, such as latin-1 (default: UTF-8, -16 or -32)"""
"""Options for a file of text."""

_OTHERS = f"""
either --t COLUMN  time: name or number of its column (default: t, if there is one)
or --no-t  read no time from the file
--sample-time STEP  time between two samples of a file without time [unit of t]; with --t, the record is interpolated
    linearly to even times with this step
--on-missing error|drop  samples without a value [default: error]
{OF_A_TEXT}
--resolution QUANTUM  resolution of the output's sensor [unit of y]; or detect: the step of which all outputs are
    multiples
--unit SIGNAL=UNIT...  label of the unit of t, u or y, as in u=V; no value is converted
--from PLACE  first sample to use: its number from 0, or its time with a unit, as in 2.5s
--to PLACE  first sample behind those to use, likewise
--every COUNT  use each N-th of these samples only: a turn between two of them is lost
"""
WEIGHTS = (
    "--weights COLUMN  weight of each sample in the sum of squares, 0 to leave it out: name or number of its column"
)
_SECOND = """--y-file FILE_OF_Y  file of the output, if the first holds the input only; if both have a time, the input
    is interpolated linearly at the times of the output"""
OPTIONS_WITHOUT_FILE = f"record:\n{_INPUT}\n{_OUTPUT}\n{_SECOND}{_OTHERS}"
"""Options for a record whose file is named by an option of the command."""

OPTIONS = f"{FILE}\n\n{OPTIONS_WITHOUT_FILE}"
OPTIONS_WITH_WEIGHTS = f"""{OPTIONS.rstrip()}
--weights COLUMN  weight of each sample in the sum of squares, 0 to leave it out: name or number of its column
--channel CHANNEL=COLUMN...  further quantity, such as a temperature, and its column: T=temp (default: those of a file
    that hysim has saved)
"""
OPTIONS_OF_AN_INPUT = f"{FILE}\n\nrecord:\n{_INPUT}{_OTHERS}"
"""Options for a file that needs no column of the output."""


def read(options: argparse.Namespace, file: str | None = None, *, uncut: bool = False) -> Record:
    """The record that the options describe, or that of another `file`; without an output column, y is u.

    With `uncut` all samples are used, whatever `--from`, `--to` and `--every` say.
    """
    path = options.file if file is None else file
    y = options.y if "y" in options else None
    return _read(options, path, source_of(path), y, options.resolution, uncut=uncut)


def read_input(options: argparse.Namespace, *, of_the_ground: bool) -> Record:
    """The input that the options describe, as a record with y = u.

    A ground motion in m/s^2 is read from an AT2 file, and with `of_the_ground` from a file that has no column u where
    none is named.
    """
    from hysim.files import column_names, is_at2

    source = _repeatable(options.file)
    if is_at2(source(), options.encoding):
        if options.u is not None or options.t is not None or options.no_t:
            raise ValueError(f"{options.file} is an AT2 file, which has no columns: leave out --u, --t and --no-t")
        return cut(_ground_motion(options, source), options)
    if of_the_ground and options.u is None and not options.no_t:
        try:
            names = column_names(source(), **text_options(options))
        except ValueError:
            names = ()  # a list, or a fault that is named where the file is read
        if "u" not in names:
            return cut(_ground_motion(options, source), options)
    if options.u is None:
        options.u = _only_column(options, source(), "u")
    return _read(options, options.file, source(), None, options.resolution)


def _ground_motion(options: argparse.Namespace, source: Callable[[], Any]) -> Record:
    """A ground motion; a step is that of a list without times, or new even steps for one with times."""
    from hysim.files import load_ground_motion

    arguments = {"t": options.t, "units": dict(options.unit).get("u"), **text_options(options)}
    del arguments["thousands"]
    if options.sample_time is None:
        return _of_the_ground(*load_ground_motion(source(), **arguments))
    step = positive("--sample-time", options.sample_time)
    try:
        motion = load_ground_motion(source(), **arguments)
    except ValueError:
        return _of_the_ground(*load_ground_motion(source(), sample_time=step, **arguments))
    return _of_the_ground(*motion).resample(step)


def _of_the_ground(t: FloatArray, acceleration: FloatArray) -> Record:
    return Record(t=t, u=acceleration, y=acceleration, units={"t": "s", "u": "m/s^2"})


def text_options(options: argparse.Namespace) -> dict[str, Any]:
    """The options of `OF_A_TEXT`, as `hysim.load` takes them."""
    delimiter = _DELIMITERS.get(options.delimiter, options.delimiter)
    others = {name: vars(options)[name] for name in ("decimal", "thousands", "encoding")}
    return {"delimiter": delimiter, "skip": options.skip or 0, **others}


def _repeatable(path: str) -> Callable[[], Any]:
    """A function that returns the file, or all that a stream holds, from its begin each time."""
    if path != STANDARD and (os.path.isfile(path) or not os.path.exists(path)):
        return lambda: path
    if path == STANDARD:
        content = source_of(path).read()
    else:  # a pipe
        with open(path, "rb") as pipe:
            content = pipe.read()
    content = content.encode() if isinstance(content, str) else content

    def begin() -> Any:
        stream: Any = io.BytesIO(content)
        stream.name = "<stdin>" if path == STANDARD else path
        return stream

    return begin


def read_with_weights(options: argparse.Namespace) -> tuple[Record, FloatArray | None]:
    """The record that the options describe, and the column of weights that they name.

    Columns of sensors are channels of the record, the first of them the output unless another one is named.
    """
    for name, column in options.sensor:
        options.channel = [*options.channel, (name, column)]
        options.y = column if options.y is None else options.y
    if options.weights is None:
        return read(options), None
    source = _repeatable(options.file)
    record = _read(options, options.file, source(), options.y, options.resolution)
    return record, _read(options, options.file, source(), options.weights, None).y


def source_of(path: str) -> Any:
    """The path, or the standard input."""
    if path != STANDARD:
        return path
    return sys.stdin.buffer if isinstance(sys.stdin, io.TextIOWrapper) else sys.stdin


def _read(
    options: argparse.Namespace, path: str, source: Any, y: str | None, resolution: Any, *, uncut: bool = False
) -> Record:
    from dataclasses import replace

    import numpy as np

    u = options.u if "y" in options or options.u is not None else "u"
    if "y_file" in options and options.y_file is not None:
        record = _from_two_files(options, path, source, y, resolution)
    else:
        names = ("u" if u is None else u, "y" if y is None else y)
        if "y" in options and names[0] == names[1]:
            raise ValueError(f"the input and the output are both the column {names[0]}: name them by --u and --y")
        record = _loaded(options, path, source, u, y if "y" in options else u, resolution)
    step = None if options.sample_time is None else positive("--sample-time", options.sample_time)
    if step is not None and record.t is None:
        record, step = replace(record, t=step * np.arange(float(len(record)))), None
    record = record if uncut else cut(record, options)
    return record if step is None else record.resample(step)


def _loaded(options: argparse.Namespace, path: str, source: Any, u: Any, y: Any, resolution: Any) -> Record:
    from hysim.files import load

    record: Record = load(
        source,
        u=u,
        y=y,
        t=False if options.no_t else options.t,
        units=dict(options.unit),
        name="record" if path == STANDARD else None,
        on_missing=options.on_missing,
        resolution=resolution,
        channels=dict(options.channel) or None if "channel" in options else None,
        **text_options(options),
    )
    return record


def _from_two_files(options: argparse.Namespace, path: str, source: Any, y: Any, resolution: Any) -> Record:
    """The record of an input in one file and an output in another; a file's only column need not be named."""
    from hysim.files import join_records

    first, second = _repeatable(path) if path == STANDARD else lambda: source, _repeatable(options.y_file)
    u = _only_column(options, first(), "u") if options.u is None else options.u
    y = _only_column(options, second(), "y") if y is None else y
    drive = _loaded(options, path, first(), u, u, None)
    return join_records(drive, _loaded(options, options.y_file, second(), y, y, resolution))


def _only_column(options: argparse.Namespace, source: Any, name: str) -> str:
    """This name, or that of the only column beside the time; a ValueError if there are several others."""
    from hysim.files import column_names

    others = [each for each in column_names(source, **text_options(options)) if each not in ("t", options.t)]
    if name in others or not others:
        return name
    if len(others) > 1:
        raise ValueError(f"no column is called {name}, the columns are: {', '.join(others)}; name it by --{name}")
    return others[0]
