"""`hysim measure`: the displacement in camera frames, and with a voltage log the record of both."""

import argparse
from typing import TYPE_CHECKING, Any

from hysim.cli import outputs
from hysim.cli.options import JSON, Command, positive

if TYPE_CHECKING:
    from hysim._frozen import FloatArray
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.vision import Displacement


def run(options: argparse.Namespace) -> int:
    """Measure, write the table and the picture, and print the summary."""
    from hysim.vision import displacement

    log = _log(options)
    motion = displacement(
        options.frames,
        options.scale,
        **outputs.fields_of(options, ("region", "direction", "reference", "method", "unit")),
    )
    columns, units = _table(options, motion, log)
    files: outputs.Files = {
        options.out: lambda: outputs.table(options.out, columns, units),
        options.plot: lambda: _picture(motion),
    }
    outputs.write(options, files, motion.summary, lambda: _document(motion))
    return 0


def _log(options: argparse.Namespace) -> "Record | None":
    """The voltages as a record, whose output is of no interest."""
    from hysim.files import load

    if options.frame_rate is not None:
        positive("--frame-rate", options.frame_rate)
    if options.voltage is None and (options.u is not None or options.t is not None):
        raise ValueError("--u and --t are columns of a file with voltages: give --voltage FILE")
    if options.voltage is not None and options.u is None:
        raise ValueError("--voltage needs --u COLUMN")
    return None if options.voltage is None else load(options.voltage, u=options.u, y=options.u, t=options.t)


def _table(
    options: argparse.Namespace, motion: "Displacement", log: "Record | None"
) -> tuple[dict[str, "FloatArray"], dict[str, str]]:
    """Columns and their units."""
    import numpy as np

    times = None if options.frame_rate is None else np.arange(len(motion)) / options.frame_rate
    quality = {"uncertainty": motion.uncertainty, "quality": motion.quality}
    units = {"t": "s", "y": options.unit, "uncertainty": options.unit}
    columns: dict[str, FloatArray | None] = {"t": times, "y": motion.y, **quality}
    if log is not None:
        record = motion.record(
            log.u,
            t=log.t if times is None else None,
            frame_times=times,
            u_times=None if times is None else log.t,
            on_lost=options.on_lost,
            units={signal: unit for signal, unit in log.units.items() if signal != "y"},
        )
        measured = np.isfinite(motion.y)
        columns = {"t": record.t, "u": record.u, "y": record.y}
        columns |= {name: values[measured] for name, values in quality.items()}
        units |= dict(record.units)
    return {name: values for name, values in columns.items() if values is not None}, units


def _picture(motion: "Displacement") -> "Figure":
    from hysim import plot

    return outputs.drawn(lambda canvas: plot.displacement(motion, ax=canvas.add_subplot()))


def _document(motion: "Displacement") -> dict[str, Any]:
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


COMMAND = Command(
    "measure",
    "measure the displacement in camera frames",
    "Measure the displacement of the picture in each frame, to a fraction of a pixel, and write it as columns: t if "
    "there is a time, u if there are voltages, y, its standard error and the correlation with the reference.",
    f"""
frames FRAMES  folder of PNG or TIFF files, TIFF file of many pages, AVI or MP4 file
--scale LENGTH  length of a pixel [unit of y] [required]
--unit UNIT  unit of the scale [default: um]
--region T,B,L,R  rows and columns of the moving part [pixel]
--direction x|y|DEGREES  direction of positive y (default: that of the motion)
--reference first|running|NUMBER  frame from which displacements are measured [default: first]
--method subpixel|whole-pixel  whether fractions of a pixel are measured [default: subpixel]
--frame-rate HERTZ  frames per second: frame k is at the time k / HERTZ [Hz]

voltages:
--voltage FILE  text file: one line a frame, or a log with times
--u COLUMN  voltage: name of its column, or its number from 0
--t COLUMN  time; with --frame-rate, the voltages are interpolated at the frames
--on-lost error|drop  frames that are lost [default: error]

--out OUT  the table [required]
--plot DISPLACEMENT.svg  draw the displacement
{JSON}
""",
    run,
    """
hysim measure frames --scale 0.25 --out motion.csv
hysim measure film.avi --scale 0.25 --frame-rate 30 --voltage log.csv --u voltage --t time --out loop.csv
""",
)
