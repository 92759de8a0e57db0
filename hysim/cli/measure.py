"""`hysim measure`: the displacement in camera frames, and with a voltage log the record of both."""

import argparse
from typing import TYPE_CHECKING, Any

from hysim.cli import outputs, records

if TYPE_CHECKING:
    from hysim._frozen import FloatArray
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.vision import Displacement

_FRAMES = "folder of PNG or TIFF files, TIFF file of many pages, AVI or MP4 file"


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "measure",
        help="measure the displacement in camera frames",
        description="Measure how far the picture has moved in each frame, to a fraction of a pixel, and write it as "
        "columns: t if there is a time, u if there are voltages, y, its standard error and the "
        "correlation with the reference.",
    )
    parser.add_argument("frames", metavar="FRAMES", help=_FRAMES)
    parser.add_argument("--scale", metavar="LENGTH", type=float, required=True, help="length of a pixel [unit of y]")
    parser.add_argument("--unit", metavar="UNIT", default="um", help="of the scale (default: %(default)s)")
    parser.add_argument("--region", metavar="T,B,L,R", type=_region, help="rows and columns of the moving part [pixel]")
    parser.add_argument(
        "--direction", metavar="x|y|DEGREES", type=_direction, help="in which y is positive; else that of the motion"
    )
    parser.add_argument(
        "--reference",
        metavar="first|running|NUMBER",
        type=_reference,
        default="first",
        help="frame from which displacements are measured (default: %(default)s)",
    )
    parser.add_argument(
        "--method", choices=("subpixel", "whole-pixel"), default="subpixel", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--frame-rate", metavar="HZ", type=float, help="frames in a second: frame k is at the time k / HZ [Hz]"
    )
    log = parser.add_argument_group("voltages")
    log.add_argument("--voltage", metavar="FILE", help="text file: a line for each frame, or a log with times")
    log.add_argument("--u", metavar="COLUMN", help="voltage: name of its column, or number from 0")
    log.add_argument("--t", metavar="COLUMN", help="time; with --frame-rate, frames are joined by it")
    log.add_argument(
        "--on-lost", choices=("error", "drop"), default="error", help="frames that are lost (default: %(default)s)"
    )
    parser.add_argument("--out", metavar="OUT", required=True, help=f"table, {outputs.TABLE}")
    parser.add_argument("--plot", metavar="DISPLACEMENT.svg", help=f"draw the displacement; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Measure, write the table and the picture, and print the summary."""
    from hysim.vision import displacement

    is_taken = outputs.check(
        table=options.out, inputs=[options.frames, options.voltage], pictures=[options.plot], printed=options.json
    )
    log = _log(options)
    try:
        moved = displacement(
            options.frames,
            options.scale,
            region=options.region,
            direction=options.direction,
            reference=options.reference,
            method=options.method,
            unit=options.unit,
            progress=outputs.progress(),
        )
    except ImportError as error:
        raise ValueError(str(error)) from None
    contents: dict[str | None, Any] = {options.out: outputs.table(options.out, *_table(options, moved, log))}
    if options.plot:
        contents[options.plot] = _picture(moved)
    if not is_taken:
        told = outputs.to_json(_document(moved)) if options.json else moved.summary() + "\n"
        contents[records.STANDARD] = told
    outputs.write(contents)
    return 0


def _log(options: argparse.Namespace) -> "Record | None":
    from hysim.files import load

    if options.frame_rate is not None and not 0.0 < options.frame_rate < float("inf"):
        raise ValueError(f"--frame-rate must be positive, got {options.frame_rate}")
    if options.voltage is None:
        if options.u is not None or options.t is not None:
            raise ValueError("--u and --t are columns of a file with voltages: give --voltage FILE")
        return None
    if options.u is None:
        raise ValueError("--voltage needs --u COLUMN")
    u, t = records.column(options.u), None if options.t is None else records.column(options.t)
    record: Record = load(options.voltage, u=u, y=u, t=t)
    return record


def _table(
    options: argparse.Namespace, moved: "Displacement", log: "Record | None"
) -> tuple[dict[str, "FloatArray"], dict[str, str]]:
    """Columns and their units."""
    import numpy as np

    times = None if options.frame_rate is None else np.arange(len(moved)) / options.frame_rate
    further = {"uncertainty": moved.uncertainty, "quality": moved.quality}
    units = {"t": "s", "y": options.unit, "uncertainty": options.unit}
    if log is None:
        columns = {"y": moved.y, **further}
        return (columns if times is None else {"t": times, **columns}), units
    by_time = log.t is not None and times is not None
    joined = moved.record(
        log.u,
        t=log.t if times is None else None,
        frame_times=times,
        u_times=log.t if by_time else None,
        on_lost=options.on_lost,
        units={signal: unit for signal, unit in log.units.items() if signal != "y"},
    )
    signals: dict[str, FloatArray | None] = {"t": joined.t, "u": joined.u, "y": joined.y}
    found = np.isfinite(moved.y)
    kept = {name: values[found] for name, values in further.items()}
    columns = {name: values for name, values in signals.items() if values is not None}
    return columns | kept, units | dict(joined.units)


def _picture(moved: "Displacement") -> "Figure":
    from hysim import plot

    with plot.house_style():
        canvas = plot.figure()
        plot.displacement(moved, ax=canvas.add_subplot())
    return canvas


def _document(moved: "Displacement") -> dict[str, Any]:
    import numpy as np

    found = np.isfinite(moved.y)
    return {
        "frames": len(moved),
        **{status: moved.status.count(status) for status in ("ok", "blurred", "lost")},
        "direction": moved.direction,
        "scale": moved.scale,
        "resolution": moved.resolution,
        "lowest": float(np.min(moved.y, where=found, initial=np.inf)),
        "highest": float(np.max(moved.y, where=found, initial=-np.inf)),
        "uncertainty": float(np.median(moved.uncertainty[found])) if found.any() else None,
        "units": dict(moved.units),
    }


def _region(text: str) -> tuple[int, ...]:
    sides = text.split(",")
    if len(sides) != 4 or not all(side.strip().isdigit() for side in sides):
        raise argparse.ArgumentTypeError(f"expected top,bottom,left,right in pixels, got {text!r}")
    return tuple(int(side) for side in sides)


def _direction(text: str) -> str | float:
    try:
        return text if text in ("x", "y") else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected x, y or an angle in degrees, got {text!r}") from None


def _reference(text: str) -> str | int:
    if text not in ("first", "running") and not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected first, running or the number of a frame, got {text!r}")
    return int(text) if text.isdigit() else text
