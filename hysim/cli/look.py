"""`hysim columns`, `metrics`, `plot` and `measure`: what files and camera frames hold."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Literal, NamedTuple

import hysim as hs
from hysim.cli import models, options, outputs, records

_MANY, _AMPLITUDES = 100, 50


def columns(file: options.RecordIn, *, settings: records.TextOptions) -> options.Result:
    """List what a file holds.

    List the columns of a file, with units, numbers of samples and ranges.

    Their names and numbers are what --u, --y and --t take.

    Examples
    --------
    hysim columns loop.csv
    hysim columns rig.mat
    hysim columns export.csv --encoding latin-1
    """
    listed = hs.list_columns(records.source_of(file)(), **options.taken(hs.list_columns, settings))
    width = max((len(column.name) for column in listed), default=0)
    lines = [
        f"{'' if column.number is None else column.number:>3}  {column.name:<{width}}  {_content(column)}"
        for column in listed
    ]
    text = "\n".join(lines) or "the file holds no columns"
    return options.Result({}, lambda: text, lambda: {"columns": [column._asdict() for column in listed]})


def _content(column: Any) -> str:
    if column.problem:
        return str(column.problem)
    span = f"{column.lowest:.6g} to {column.highest:.6g} {column.unit}" if column.n_samples else "no values"
    missing = f", {column.n_missing} missing" if column.n_missing else ""
    return f"{column.n_samples} samples{missing}, {span.rstrip()}{', increases throughout' if column.increases else ''}"


def metrics(
    file: options.RecordIn,
    *,
    settings: records.RecordOptions,
    cycles: options.Cycles = 1,
    forc: bool = False,
    magnetic: bool = False,
    tolerance: float = 0.01,
    out: options.Copy | None = None,
    csv: options.ResultFile | None = None,
    plot: options.Picture | None = None,
) -> options.Result:
    """Measure the loop in a file of your own.

    Measure the loop of the input's last complete cycle, the average loop of the last few, or every cycle. The table of
    every cycle is of growing protocols, and of 0, max, min, 0. First-order reversal curves have a density.

    Parameters
    ----------
    cycles : print a table with one row a cycle; with a number, the average loop of so many last cycles
    magnetic : measure coercivity, remanence, permeability, and whether the loop is open, drifts or closes
    forc : measure the density of first-order reversal curves, and their drift
    tolerance : reversals smaller than this fraction of the input's span are noise [1]
    out : write the printed result into a file too
    csv : with --cycles, write the table; - writes it to the standard output
    plot : draw the loop

    Examples
    --------
    hysim metrics loop.csv --u voltage --y displacement
    hysim metrics damper.csv --cycles --csv cycles.csv
    hysim metrics loop.csv --from 2s --to 4s --plot loop.svg
    hysim metrics sample.forc --forc --plot density.svg
    hysim metrics core.hys --magnetic
    """
    from hysim._basics.printing import quantity

    if forc + magnetic + (not cycles) > 1:
        raise ValueError("--forc measures curves, --magnetic a loop, and --cycles every cycle: give one of them")
    if csv is not None and cycles:
        raise ValueError("--csv writes the table of every cycle: give --cycles without a number too")
    record = records.read(settings, file)
    limits: dict[str, Any] = {"cycles": cycles, "tolerance": tolerance}
    files: dict[str | None, Any] = {plot: lambda: outputs.on_axes(hs.plot.loop, record)}
    measured: Any
    if forc:
        measured = hs.forc(record, tolerance=tolerance)
        peak = list(measured.peak) if measured.ridge.size else None
        document = outputs.scalars(measured) | {"peak": peak, "ridge": measured.ridge.tolist()}
        files[plot] = lambda: outputs.on_axes(hs.plot.forc, measured, units=record.units)
    elif magnetic:
        measured = hs.magnetic_metrics(record.u, record.y, **limits)
        document = measured.to_dict() | {"closure": measured.closure}
    elif cycles:
        measured = hs.loop_metrics(record.u, record.y, **limits)
        lobes = [lobe._asdict() for lobe in measured.lobes]
        document = outputs.scalars(measured) | {"crossings": list(measured.crossings), "lobes": lobes}
    else:
        measured = hs.cycle_metrics(record.u, record.y, tolerance=tolerance)
        document = {"cycles": measured.rows(), **outputs.fields_of(measured, ("level", "energy_outside"))}
        files[csv] = lambda: measured.to_csv(record.units)
    document |= {} if forc or magnetic else {"sign_convention": measured.sign_convention}
    document |= {"units": record.units}

    def text() -> str:
        step = record.detect_resolution() if record.resolution is None else None
        advice = step and f"the output has steps of {quantity(step, record.units.get('y', ''))}: --resolution detect"
        return "\n".join([measured.to_text(record.units), *([f"{advice} takes them"] if advice else [])])

    files[out] = lambda: outputs.printed(text, lambda: document)
    return options.Result(files, text, lambda: document)


Results = list[Any]
"""Records, and named free runs of models over the input of the first."""
Draw = Callable[[Any, Results, dict[str, Any]], object]
"""A function that draws results, or models by name, on a figure."""


class Kind(NamedTuple):
    """A kind of picture: its description, its drawing, and bounds of the numbers of records and models."""

    shows: str
    draw: Draw
    records: tuple[int, int] = (1, _MANY)
    models: tuple[int, int] = (0, _MANY)


def _together(name: str) -> Draw:
    return lambda canvas, results, _: vars(hs.plot)[name](*results, ax=canvas.add_subplot())


def _each(name: str) -> Draw:
    def draw(canvas: Any, results: Results, _: dict[str, Any]) -> None:
        for result, ax in zip(results, hs.plot.panels(canvas, len(results)), strict=True):
            vars(hs.plot)[name](result, ax)
            ax.set_title(result.name)

    return draw


def _history(canvas: Any, results: Results, _: dict[str, Any]) -> None:
    panels = hs.plot.panels(canvas, 2)
    for result in results:
        hs.plot.history(result, panels)
        panels[0].lines[-1].set_label(result.name)
    if len(results) > 1:
        canvas.legend(loc="outside upper center", ncols=3)


def _residual_map(canvas: Any, results: Results, _: dict[str, Any]) -> None:
    hs.plot.residual_map(results[0], results[1], canvas.subplots(1, 2, sharey=True))


def _describing_function(canvas: Any, results: Results, laws: dict[str, Any]) -> None:
    low, high = float(results[0].u.min()), float(results[0].u.max())
    amplitudes = [0.5 * (high - low) * k / _AMPLITUDES for k in range(1, _AMPLITUDES + 1)]
    axes = hs.plot.panels(canvas, 2)
    hs.plot.describing_function(laws, amplitudes, axes, mean=0.5 * (low + high), units=results[0].units)


KINDS = {
    "loop": Kind("output against input", _together("loop")),
    "history": Kind("output and input against time", _history),
    "width": Kind("width of the last cycle against the input", _together("width")),
    "cycles": Kind("each cycle in a colour, from the first, dark, to the last, light", _each("cycles")),
    "minor-loops": Kind("each cycle as a loop, the smaller the darker", _each("minor_loops")),
    "residual-map": Kind(
        "measured minus model over input and cycles; one file, one model", _residual_map, (1, 1), (1, 1)
    ),
    "forc": Kind("density of relays, from first-order reversal curves; one file", _together("forc"), (1, 1), (0, 0)),
    "describing-function": Kind(
        "gain and phase of models over the amplitudes in the file", _describing_function, models=(1, _MANY)
    ),
}
"""Kinds of pictures that `--kind` takes."""


def plot(
    file: options.RecordIn,
    others: tuple[options.RecordIn, ...] = (),
    *,
    settings: records.RecordOptions,
    kind: Annotated[str, options.one_of({name: kind.shows for name, kind in KINDS.items()})] = "loop",
    model: tuple[options.ModelIn, ...] = (),
    out: options.Picture,
) -> None:
    """Draw files of your own.

    Draw records over each other, and the free run of models over the input of the first.

    Parameters
    ----------
    others : more files with the same columns
    out : the picture

    Examples
    --------
    hysim plot loop.csv --u voltage --y displacement --out loop.svg
    hysim plot loop.csv --model law.json --out both.pdf
    hysim plot curves.csv --kind forc --out forc.svg
    """
    chosen, files = KINDS[kind], [file, *others]
    for name, paths, (least, most) in (("file", files, chosen.records), ("--model", model, chosen.models)):
        if not least <= len(paths) <= most:
            number = str(least) if least == most else f"at least {least}"
            raise ValueError(f"--kind {kind} takes {number} {name}, got {len(paths)}")
    measured = [records.read(settings, path) for path in files]
    laws, runs = {}, []
    for path in model:
        law, units = models.read(path)
        measured = [models.in_units(record, units, file) for record in measured]
        name = models.name_of(path) if len(model) > 1 else type(law).__name__
        laws[name] = law
        runs.append(replace(models.simulated(law, measured[0], {**measured[0].units, **units}), name=name))
    outputs.write({out: lambda: outputs.drawn(lambda canvas: chosen.draw(canvas, [*measured, *runs], laws))})


def measure(
    frames: Annotated[str, options.Value("FRAMES", role=options.INPUT)],
    *,
    scale: float,
    unit: str = "um",
    region: options.Region | None = None,
    direction: options.Angle | None = None,
    reference: options.Frame = "first",
    method: Literal["subpixel", "whole-pixel"] = "subpixel",
    frame_rate: options.Positive | None = None,
    voltage: options.RecordIn | None = None,
    u: options.Column | None = None,
    t: options.Column | None = None,
    on_lost: Literal["error", "drop"] = "error",
    out: options.Table,
    plot: options.Picture | None = None,
) -> options.Result:
    """Measure the displacement in camera frames.

    Measure the displacement of the picture in each frame, to a fraction of a pixel, and write it as columns.

    The columns are t if there is a time, u if there are voltages, y, its standard error, and the correlation of images.

    Parameters
    ----------
    frames : folder of PNG or TIFF files, TIFF file of many pages, AVI or MP4 file
    scale : length of a pixel [unit of y]
    unit : unit of the scale
    region : rows and columns of the moving part [pixel]
    direction : direction of positive y (default: that of the motion)
    reference : frame from which displacements are measured
    method : whether fractions of a pixel are measured
    frame_rate : frames per second: frame k is at the time k / frame rate [Hz]

    voltages
    --------
    voltage : text file: one line a frame, or a log with times
    u : voltage: name of its column, or its number from 0
    t : time; with --frame-rate, a frame has the last voltage before it
    on_lost : frames that are lost

    Results
    -------
    out : the table
    plot : draw the displacement

    Examples
    --------
    hysim measure frames --scale 0.25 --out motion.csv
    hysim measure film.avi --scale 0.25 --frame-rate 30 --voltage log.csv --u voltage --t time --out loop.csv
    """
    import numpy as np

    if voltage is None and (u is not None or t is not None):
        raise ValueError("--u and --t are columns of a file with voltages: give --voltage FILE")
    if voltage is not None and u is None:
        raise ValueError("--voltage needs --u COLUMN")
    log = None if voltage is None else hs.load(voltage, u=u, y=u, t=t)
    motion = hs.vision.displacement(
        frames, scale, region=region, direction=direction, reference=reference, method=method, unit=unit
    )
    times = None if frame_rate is None else np.arange(len(motion)) / frame_rate
    table, units = motion.columns(log, times, on_lost)
    files: options.Files = {
        out: lambda: outputs.table(out, table, units),
        plot: lambda: outputs.on_axes(hs.plot.displacement, motion),
    }
    return options.Result(files, motion.summary, motion.figures)
