"""`hysim columns`, `metrics`, `plot` and `measure`: what files and camera frames hold."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, NamedTuple

import hysim as hs
from hysim.cli import models, options, outputs, records

_MANY, _AMPLITUDES = 100, 50


def columns(file: options.RecordIn, *, settings: records.TextOptions, json: bool = False) -> int:
    """List what a file holds.

    List the columns of a file, with units, numbers of samples and ranges.

    Their names and numbers are what --u, --y and --t take.

    Parameters
    ----------

    Examples
    --------
    hysim columns loop.csv
    hysim columns rig.mat
    hysim columns export.csv --encoding latin-1
    """
    listed = hs.list_columns(records.source_of(file), **settings.for_load())
    width = max((len(column.name) for column in listed), default=0)
    lines = [
        f"{'' if column.number is None else column.number:>3}  {column.name:<{width}}  {_content(column)}"
        for column in listed
    ]
    text = "\n".join(lines) or "the file holds no columns"
    outputs.write({}, lambda: text, lambda: {"columns": [column._asdict() for column in listed]})
    return 0


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
    tolerance: float | None = None,
    out: options.Copy | None = None,
    csv: options.Result | None = None,
    plot: options.Picture | None = None,
    json: bool = False,
) -> int:
    """Measure the loop in a file of your own.

    Measure the loop of the input's last complete cycle, the average loop of the last few, or every cycle.

    The table of every cycle is of growing protocols, and of 0, max, min, 0.

    Parameters
    ----------
    cycles : print a table with one row a cycle; with a number, the average loop of so many last cycles
    tolerance : reversals smaller than this fraction of the input's span are noise [1] (default: 0.01)
    out : write the printed result into a file too
    csv : with --cycles, write the table; - writes it to the standard output
    plot : draw the loop

    Examples
    --------
    hysim metrics loop.csv --u voltage --y displacement
    hysim metrics damper.csv --cycles --csv cycles.csv
    hysim metrics loop.csv --from 2s --to 4s --plot loop.svg
    """
    if csv is not None and cycles:
        raise ValueError("--csv writes the table of every cycle: give --cycles without a number too")
    record = records.read(settings, file)
    accuracy = {} if tolerance is None else {"tolerance": tolerance}
    files: dict[str | None, Any] = {plot: lambda: outputs.loop(record)}
    measured: Any
    if cycles:
        measured = hs.loop_metrics(record.u, record.y, cycles=cycles, **accuracy)
        lines = [*_lines(measured, record.units)]
        lobes = [lobe._asdict() for lobe in measured.lobes]
        document = outputs.scalars(measured) | {"crossings": list(measured.crossings), "lobes": lobes}
    else:
        measured = hs.cycle_metrics(record.u, record.y, **accuracy)
        lines = [measured.to_text(record.units)]
        document = {"cycles": measured.rows(), "level": measured.level, "energy_outside": measured.energy_outside}
        files[csv] = lambda: measured.to_csv(record.units)
    document |= {"sign_convention": measured.sign_convention, "units": record.units}

    def text() -> str:
        return "\n".join([*lines, *_step(record)])

    files[out] = lambda: outputs.printed(text, lambda: document)
    outputs.write(files, text, lambda: document)
    return 0


def _lines(loop: "hs.LoopMetrics", units: Mapping[str, str]) -> Iterator[str]:
    from hysim._basics.printing import folded, quantity

    u, y = (units.get(signal, "") for signal in ("u", "y"))
    product, ratio = (f"{y} {u}", f"{y}/{u}") if u and y else ("", "")
    values = {
        "max width": f"{quantity(loop.max_width, y)} at {loop.max_width_at:.6g} {u}",
        "mean width": quantity(loop.mean_width, y),
        "width at mid span": quantity(loop.mid_width, y),
        "relative width": f"{100 * loop.relative_width:.2f} % of the stroke",
        "stroke": quantity(loop.stroke, y),
        "area": quantity(loop.area, product),
        "orientation": loop.orientation,
        "crosses itself": f"at {', '.join(f'{at:.6g}' for at in loop.crossings)} {u}" if loop.crossings else "",
    }
    for k, lobe in enumerate(loop.lobes if loop.crossings else (), 1):
        values[f"lobe {k}"] = (
            f"{lobe.orientation}, area {quantity(lobe.area, product)}, max width {quantity(lobe.max_width, y)}, "
            f"from {lobe.low:.6g} to {lobe.high:.6g} {u}"
        )
    values |= {
        "closure gap": quantity(loop.closure_gap, y),
        "energy": quantity(loop.energy, product),
        "secant stiffness": f"{loop.secant_stiffness:.4g} {ratio}",
        "equivalent damping": f"{100 * abs(loop.equivalent_damping):.2f} %",
        "cycles": f"{loop.n_cycles}",
    }
    width = max(map(len, values))
    yield from (f"{name:<{width}}  {value.rstrip()}" for name, value in values.items() if value)
    if loop.orientation == "counterclockwise":
        yield from folded(loop.sign_convention)


def _step(record: "hs.Record") -> Iterator[str]:
    if record.resolution is None and (step := record.detect_resolution()) is not None:
        unit = record.units.get("y", "")
        yield f"the output has steps of {f'{step:.6g} {unit}'.rstrip()}: --resolution detect takes them"


class Contents(NamedTuple):
    """Contents of a picture: records, models by name, and their free runs over the input of the first record."""

    measured: "list[hs.Record]"
    laws: dict[str, Any]
    simulated: "list[hs.Simulation]"

    @property
    def results(self) -> "list[Any]":
        named = zip(self.laws, self.simulated, strict=True)
        return [*self.measured, *(replace(run, name=name) for name, run in named)]


class Kind(NamedTuple):
    """A kind of picture: its description, its drawing, and bounds of the numbers of records and models."""

    shows: str
    draw: Callable[[Any, Contents], object]
    records: tuple[int, int] = (1, _MANY)
    models: tuple[int, int] = (0, _MANY)


def _history(canvas: Any, contents: Contents) -> None:
    panels = hs.plot.panels(canvas, 2)
    for result in contents.results:
        hs.plot.history(result, panels)
        panels[0].lines[-1].set_label(result.name)
    if len(contents.results) > 1:
        panels[0].legend()


def _each(name: str) -> Callable[[Any, Contents], None]:
    def draw(canvas: Any, contents: Contents) -> None:
        for result, ax in zip(contents.results, hs.plot.panels(canvas, len(contents.results)), strict=True):
            vars(hs.plot)[name](result, ax)
            ax.set_title(result.name)

    return draw


def _describing_function(canvas: Any, contents: Contents) -> None:
    import numpy as np

    record = contents.measured[0]
    lowest, highest = float(record.u.min()), float(record.u.max())
    amplitudes = np.linspace(0.0, 0.5 * (highest - lowest), _AMPLITUDES + 1)[1:]
    middle, axes = 0.5 * (lowest + highest), hs.plot.panels(canvas, 2)
    hs.plot.describing_function(contents.laws, amplitudes, axes, mean=middle, units=record.units)


def _residual_map(canvas: Any, contents: Contents) -> None:
    hs.plot.residual_map(contents.measured[0], contents.simulated[0], canvas.subplots(1, 2, sharey=True))


KINDS = {
    "loop": Kind("output against input", lambda canvas, c: hs.plot.loop(*c.results, ax=canvas.add_subplot())),
    "history": Kind("output and input against time", _history),
    "width": Kind(
        "width of the last cycle against the input",
        lambda canvas, c: hs.plot.width(*c.results, ax=canvas.add_subplot()),
    ),
    "cycles": Kind("each cycle in a colour, from the first, dark, to the last, light", _each("cycles")),
    "minor-loops": Kind("each cycle as a loop, the smaller the darker", _each("minor_loops")),
    "residual-map": Kind(
        "measured minus model over input and cycles; one file, one model", _residual_map, (1, 1), (1, 1)
    ),
    "forc": Kind(
        "density of relays, from first-order reversal curves; one file",
        lambda canvas, c: hs.plot.forc(c.measured[0], canvas.add_subplot()),
        records=(1, 1),
        models=(0, 0),
    ),
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
) -> int:
    """Draw files of your own.

    Draw records over each other, and the free run of models over the input of the first.

    Parameters
    ----------
    others : more files with the same columns
    model : model file as identify writes it, - for the standard input, or module:name of your own, which executes
        ./module.py or an installed module; once or more
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
    if [*files, *model].count(records.STANDARD) > 1:
        raise ValueError("the standard input holds one record or one model, not both: give files for the others")
    measured = [records.read(settings, path) for path in files]
    read = {models.name_of(path): models.read(path) for path in model}
    runs = [models.simulated(law, measured[0], {**measured[0].units, **units}) for law, units in read.values()]
    laws = {name: law for name, (law, _) in read.items()}
    named = laws if len(laws) > 1 else {type(law).__name__: law for law in laws.values()}
    contents = Contents(measured, named, runs)
    outputs.write({out: lambda: outputs.drawn(lambda canvas: chosen.draw(canvas, contents))})
    return 0


def measure(
    frames: Annotated[str, options.file("FRAMES", options.INPUT)],
    *,
    scale: float,
    unit: str = "um",
    region: options.Region | None = None,
    direction: options.Angle | None = None,
    reference: options.Frame = "first",
    method: Literal["subpixel", "whole-pixel"] = "subpixel",
    frame_rate: float | None = None,
    voltage: options.RecordIn | None = None,
    u: options.Column | None = None,
    t: options.Column | None = None,
    on_lost: Literal["error", "drop"] = "error",
    out: options.Table,
    plot: options.Picture | None = None,
    json: bool = False,
) -> int:
    """Measure the displacement in camera frames.

    Measure the displacement of the picture in each frame, to a fraction of a pixel, and write it as columns.

    The columns are t if there is a time, u if there are voltages, y, its standard error and the correlation with the
    reference.

    Parameters
    ----------
    frames : folder of PNG or TIFF files, TIFF file of many pages, AVI or MP4 file
    scale : length of a pixel [unit of y]
    unit : unit of the scale
    region : rows and columns of the moving part [pixel]
    direction : direction of options.positive y (default: that of the motion)
    reference : frame from which displacements are measured
    method : whether fractions of a pixel are measured
    frame_rate : frames per second: frame k is at the time k / frame rate [Hz]

    voltages
    --------
    voltage : text file: one line a frame, or a log with times
    u : voltage: name of its column, or its number from 0
    t : time; with --frame-rate, the voltages are interpolated at the frames
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

    if frame_rate is not None:
        options.positive("--frame-rate", frame_rate)
    if voltage is None and (u is not None or t is not None):
        raise ValueError("--u and --t are columns of a file with voltages: give --voltage FILE")
    if voltage is not None and u is None:
        raise ValueError("--voltage needs --u COLUMN")
    log = None if voltage is None else hs.load(voltage, u=u, y=u, t=t)
    motion = hs.vision.displacement(
        frames, scale, region=region, direction=direction, reference=reference, method=method, unit=unit
    )
    times = None if frame_rate is None else np.arange(len(motion)) / frame_rate
    table, units = _table(motion, log, times, on_lost)

    files: outputs.Files = {
        out: lambda: outputs.table(out, table, units),
        plot: lambda: outputs.drawn(lambda canvas: hs.plot.displacement(motion, ax=canvas.add_subplot())),
    }
    outputs.write(files, motion.summary, lambda: _document(motion))
    return 0


def _table(motion: Any, log: "hs.Record | None", times: Any, on_lost: Any) -> tuple[dict[str, Any], dict[str, str]]:
    import numpy as np

    unit = motion.units["y"]
    quality = {"uncertainty": motion.uncertainty, "quality": motion.quality}
    units = {"t": "s", "y": unit, "uncertainty": unit}
    columns: dict[str, Any] = {"t": times, "y": motion.y, **quality}
    if log is not None:
        record = motion.record(
            log.u,
            t=log.t if times is None else None,
            frame_times=times,
            u_times=None if times is None else log.t,
            on_lost=on_lost,
            units={signal: unit for signal, unit in log.units.items() if signal != "y"},
        )
        measured = np.isfinite(motion.y)
        columns = {"t": record.t, "u": record.u, "y": record.y}
        columns |= {name: values[measured] for name, values in quality.items()}
        units |= dict(record.units)
    return {name: values for name, values in columns.items() if values is not None}, units


def _document(motion: Any) -> dict[str, Any]:
    import numpy as np

    measured = np.isfinite(motion.y)
    return {
        "frames": len(motion),
        **{status: motion.status.count(status) for status in ("ok", "blurred", "lost")},
        **outputs.fields_of(motion, ("direction", "scale", "resolution")),
        "lowest": float(np.min(motion.y, where=measured, initial=np.inf)),
        "highest": float(np.max(motion.y, where=measured, initial=-np.inf)),
        "uncertainty": float(np.median(motion.uncertainty[measured])) if measured.any() else None,
        "units": dict(motion.units),
    }
