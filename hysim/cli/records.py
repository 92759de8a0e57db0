"""Options by which every command reads a record from a file."""

import io
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from typing import Any, Literal

import hysim as hs
from hysim._basics.prefixes import power_of_ten
from hysim.cli import options
from hysim.cli.options import STANDARD

_ROUNDING = 1e-9  # of the record's time: 0.3 s is found among times that were added up
_OF_NODES, _OF_ELEMENTS = (("displacement", "velocity", "acceleration"), ("drift", "force"))


@dataclass(kw_only=True)
class TextOptions:
    """Options for a file of text.

    text
    ----
    delimiter : sign between cells of a text, or tab, semicolon, comma, blank (default: detected)
    decimal : sign before the decimals of a text (default: detected)
    thousands : sign between thousands of a text (default: none, but where a number can mean nothing else)
    skip : number of lines at the top of a text that are neither samples nor names of columns
    encoding : encoding of a text, such as latin-1 (default: UTF-8, -16 or -32)
    """

    delimiter: options.Delimiter | None = None
    decimal: Literal[".", ","] | None = None
    thousands: str | None = None
    skip: int = 0
    encoding: str | None = None


@dataclass(kw_only=True)
class InputOptions(TextOptions):
    """Options for a file that needs no column of the output.

    record
    ------
    u : input: name of its column, or its number from 0 (default: u)
    t : time: name or number of its column (default: t, if there is one)
    no_t : read no time from the file
    sample_time : time between two samples of a file without time [unit of t]; with --t, the record is interpolated
        linearly to even times with this step
    on_missing : samples without a value
    resolution : resolution of the output's sensor [unit of y]; or detect: the step of which all outputs are multiples
    units : label of the unit of t, u or y, as in u=V; no value is converted
    from_ : first sample to use: its number from 0, or its time with a unit, as in 2.5s
    to : first sample behind those to use, likewise
    every : use each N-th of these samples only: a turn between two of them is lost
    """

    u: options.Column | None = None
    t: options.Column | None = None
    no_t: bool = False
    sample_time: options.Positive | None = None
    on_missing: Literal["error", "drop"] = "error"
    resolution: options.Quantum | None = None
    units: options.Units | None = None
    from_: options.PlaceIn | None = None
    to: options.PlaceIn | None = None
    every: options.Count | None = None

    def __post_init__(self) -> None:
        options.exclusive(t=self.t, no_t=self.no_t)


@dataclass(kw_only=True)
class RecordOptions(InputOptions):
    """Options for a record.

    record
    ------
    u : input: name of its column, or its number from 0 (default: u)
    y : output: name or number of its column (default: y)
    y_file : file of the output, if the first holds the input only; if both have a time, the input is interpolated
        linearly at the times of the output
    """

    y: options.Column | None = None
    y_file: options.RecordIn | None = None


@dataclass(kw_only=True)
class WeighedOptions(RecordOptions):
    """Options for a record with further columns.

    record
    ------
    weights : weight of each sample in the sum of squares, 0 to leave it out: name or number of its column
    channels : further quantity, such as a temperature, and its column: T=temp (default: those of a file that hysim has
        saved)
    sensor : what a sensor on a structure measured, by the names of hysim simulate, and its column: drift_0, or
        acceleration_2=roof (default: the structure's own output, in the column --y)
    """

    weights: options.Column | None = None
    channels: options.Channels | None = None
    sensor: options.Sensors | None = None


Source = Callable[[], Any]
"""A function that returns a file, or all that a stream holds, from its begin each time."""


def source_of(path: str) -> Source:
    if path != STANDARD and (os.path.isfile(path) or not os.path.exists(path)):
        return lambda: path
    standard = sys.stdin.buffer if isinstance(sys.stdin, io.TextIOWrapper) else sys.stdin
    with nullcontext(standard) if path == STANDARD else open(path, "rb") as stream:  # else a pipe
        content = stream.read()

    def begin() -> Any:
        copy: Any = io.BytesIO(content.encode() if isinstance(content, str) else content)
        copy.name = "<stdin>" if path == STANDARD else path
        return copy

    return begin


def read(settings: InputOptions, path: str, source: Source | None = None, *, uncut: bool = False) -> "hs.Record":
    """The record that the settings describe, y = u without an output; `uncut` ignores --from, --to and --every."""
    import numpy as np

    source, step = source or source_of(path), settings.sample_time
    u = "u" if settings.u is None else settings.u
    if not isinstance(settings, RecordOptions):
        record = _loaded(settings, path, source(), u=u, y=u)
    elif settings.y_file is not None:
        other = source_of(settings.y_file)  # the only column of either file need not be named
        u = _only_column(settings, source(), "u") if settings.u is None else u
        y = _only_column(settings, other(), "y") if settings.y is None else settings.y
        drive = _loaded(settings, path, source(), u=u, y=u, resolution=None)
        record = hs.join_records(drive, _loaded(settings, settings.y_file, other(), u=y, y=y))
    elif u == ("y" if settings.y is None else settings.y):
        raise ValueError(f"the input and the output are both the column {u}: name them by --u and --y")
    else:
        record = _loaded(settings, path, source())
    if step is not None and record.t is None:
        record, step = replace(record, t=step * np.arange(float(len(record)))), None
    record = record if uncut else cut(record, settings)
    return record if step is None else record.resample(step)


def read_input(settings: InputOptions, path: str, *, of_the_ground: bool) -> "hs.Record":
    """The input as a record with y = u; a ground motion [m/s^2] from AT2, or `of_the_ground` from a file without u."""
    from hysim.files import is_at2

    source, may_be_motion = source_of(path), of_the_ground and settings.u is None and not settings.no_t
    if is_at2(source(), settings.encoding):
        if settings.u is not None or settings.t is not None or settings.no_t:
            raise ValueError(f"{path} is an AT2 file, which has no columns: leave out --u, --t and --no-t")
        return cut(_ground_motion(settings, source), settings)
    with suppress(ValueError):  # a list, or a fault that is named where the file is read
        may_be_motion = may_be_motion and "u" not in _columns(settings, source())
    if may_be_motion:
        return cut(_ground_motion(settings, source), settings)
    if settings.u is None:
        settings.u = _only_column(settings, source(), "u")
    return read(settings, path, source)


def read_with_weights(settings: WeighedOptions, path: str) -> "tuple[hs.Record, Any]":
    """The record, with columns of sensors as channels (by default the first is y), and the column of weights."""
    if settings.sensor and settings.y is None:
        settings.y = next(iter(settings.sensor.values()))
    settings.channels = {**(settings.channels or {}), **(settings.sensor or {})} or None
    source, weights = source_of(path), None
    if settings.weights is not None:
        weights = read(replace(settings, y=settings.weights, resolution=None), path, source).y
    return read(settings, path, source), weights


def cut(record: "hs.Record", settings: InputOptions) -> "hs.Record":
    """The part of the record that the settings name; a ValueError if fewer than two samples are in it."""
    part = slice(_sample(record, settings.from_, "--from"), _sample(record, settings.to, "--to"), settings.every)
    n = len(range(*part.indices(len(record))))
    if n < 2:
        t, unit = record.t, record.units.get("t", "")
        extent = "" if t is None else f" between {t[0]:g} and {t[-1]:g} {unit}".rstrip()
        remaining = f"{n} of {len(record)} samples{extent} remain by --from, --to and --every"
        raise ValueError(f"{remaining}: a record needs at least 2")
    return record if part == slice(None) else record[part]


def _sample(record: "hs.Record", place: options.Place | None, option: str) -> int | None:
    import numpy as np

    if place is None or not place[1]:
        return None if place is None else int(place[0])
    value, unit = place
    if record.t is None:
        raise ValueError(f"{option} {value:g}{unit} needs a time: name its column by --t, or give a number")
    seconds: Any = 10.0 ** power_of_ten(unit, record.units.get("t", "s"))
    tolerance = _ROUNDING * float(record.t[-1] - record.t[0])
    return int(np.searchsorted(record.t, value * seconds - tolerance))


def of_structure(structure: Any, record: "hs.Record", columns: Iterable[str]) -> "hs.StructureRecord":
    """The record of a structure with these channels as sensors; ValueError if a name or the time is missing."""
    import numpy as np

    from hysim.simulation import columns_of

    if not isinstance(structure, hs.Structure):
        name = structure.__name__ if isinstance(structure, type) else type(structure).__name__
        raise ValueError(f"--sensor is for structures in a file, got a {name}: name its output by --y")
    if record.t is None:
        raise ValueError("a structure needs the times of its record: name their column by --t, or use --sample-time")
    sizes = dict.fromkeys(_OF_NODES, structure.n_nodes) | dict.fromkeys(_OF_ELEMENTS, len(structure.elements))
    signals = {name: np.full((len(record), size), np.nan) for name, size in sizes.items()}
    places = {signal: columns_of(signal, values) for signal, values in signals.items()}
    for name in columns:
        signal = name.rpartition("_")[0]
        if name not in places.get(signal, ()):
            known = ", ".join(" to ".join([*names][:: max(len(names) - 1, 1)]) for names in places.values())
            raise ValueError(f"the structure has no signal {name!r}: its signals are {known}")
        places[signal][name][:] = record.channel(name)
    measured = {name: values for name, values in signals.items() if not np.isnan(values).all()}
    return hs.StructureRecord(t=record.t, u=record.u, name=record.name, **measured)


def _ground_motion(settings: InputOptions, source: Source) -> "hs.Record":
    """A ground motion; a step is that of a list without times, or new even steps for one with times."""
    step, unit = settings.sample_time, (settings.units or {}).get("u")
    arguments = options.taken(hs.load_ground_motion, settings) | {"units": unit, "sample_time": None}
    try:
        t, acceleration = hs.load_ground_motion(source(), **arguments)
    except ValueError:
        if step is None:
            raise
        t, acceleration = hs.load_ground_motion(source(), **arguments | {"sample_time": step})
        step = None
    motion = hs.Record(t=t, u=acceleration, y=acceleration, units={"t": "s", "u": "m/s^2"})
    return motion if step is None else motion.resample(step)


def _loaded(settings: InputOptions, path: str, source: Any, **changed: Any) -> "hs.Record":
    own = {"t": False if settings.no_t else settings.t, "name": "record" if path == STANDARD else None, **changed}
    record: hs.Record = hs.load(source, **options.taken(hs.load, settings) | own)
    return record


def _columns(settings: InputOptions, source: Any) -> tuple[str, ...]:
    from hysim.files import column_names

    return column_names(source, **options.taken(hs.list_columns, settings))


def _only_column(settings: InputOptions, source: Any, name: str) -> str:
    """This name, or that of the only column apart from the time; a ValueError if there are several others."""
    others = [each for each in _columns(settings, source) if each not in ("t", settings.t)]
    if name in others or not others:
        return name
    if len(others) > 1:
        raise ValueError(f"no column is called {name}, the columns are: {', '.join(others)}; name it by --{name}")
    return others[0]
