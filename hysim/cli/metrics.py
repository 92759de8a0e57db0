"""`hysim metrics`: the width, area and orientation of a measured loop, or a table of every cycle."""

import argparse
import dataclasses
import textwrap
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from hysim._words import LETTERS
from hysim.cli import outputs, records

if TYPE_CHECKING:
    from hysim.metrics import CycleMetrics, LoopMetrics
    from hysim.records import Record

_TABLE = 0  # what --cycles holds without a number


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "metrics",
        help="measure the loop in a file of your own",
        description="Measure the loop of the input's last complete cycle, the average loop of the last few, or every "
        "cycle: of growing protocols, and of 0, max, min, 0.",
    )
    records.add_to(parser)
    parser.add_argument(
        "--cycles",
        metavar="N",
        type=_number,
        nargs="?",
        const=_TABLE,
        default=1,
        help="print a table with one row a cycle; with N, the average loop of the last N cycles (default: 1)",
    )
    parser.add_argument(
        "--tolerance",
        metavar="FRACTION",
        type=float,
        help="of the input's span: reversals smaller than that are noise [1] (default: 0.01)",
    )
    parser.add_argument("--out", metavar="PATH", help="write what is printed into a file too")
    parser.add_argument("--csv", metavar="PATH", help="with --cycles, write the table there, - for the standard output")
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the loop; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print them as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Measure and print."""
    from hysim.metrics import cycle_metrics, loop_metrics

    if options.csv is not None and options.cycles != _TABLE:
        raise ValueError("--csv writes the table of every cycle: give --cycles without a number too")
    if options.json and options.csv == records.STANDARD:
        raise ValueError("--json and --csv - both write to the standard output: give --csv a path")
    is_taken = outputs.check(options.out, options.csv, inputs=[options.file], pictures=[options.plot])
    record = records.read(options)
    tolerance = {} if options.tolerance is None else {"tolerance": options.tolerance}
    contents: dict[str | None, Any] = {options.plot: outputs.loop(record) if options.plot else ""}
    if options.cycles == _TABLE:
        table = cycle_metrics(record.u, record.y, **tolerance)
        lines = [table.to_text(record.units)]
        document = _rows(table, record.units)
        contents[options.csv] = table.to_csv(record.units)
    else:
        loop = loop_metrics(record.u, record.y, cycles=options.cycles, **tolerance)
        lines = [*_lines(loop, record.units)]
        document = _document(loop, record.units)
    text = outputs.to_json(document) if options.json else "\n".join([*lines, *_step(record)])
    told = text.rstrip("\n") + "\n"
    contents[options.out] = told
    if not is_taken:
        contents[records.STANDARD] = told
    outputs.write(contents)
    return 0


def _number(text: str) -> int:
    """A number of cycles to average."""
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(
            f"expected a number of cycles, at least 1, got {text!r}; for the table put the file before --cycles"
        )
    return int(text)


def _document(loop: "LoopMetrics", units: Mapping[str, str]) -> dict[str, Any]:
    values = {field.name: getattr(loop, field.name) for field in dataclasses.fields(loop)}
    plain = {name: value for name, value in values.items() if isinstance(value, (float, int, str))}
    return plain | {"sign_convention": loop.sign_convention, "units": units}


def _rows(table: "CycleMetrics", units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "cycles": table.rows(),
        "level": table.level,
        "energy_outside": table.energy_outside,
        "sign_convention": table.sign_convention,
        "units": units,
    }


def _lines(loop: "LoopMetrics", units: Mapping[str, str]) -> Iterator[str]:
    u, y = (units.get(signal, "") for signal in ("u", "y"))
    at = f"{loop.max_width_at:.6g} {u}".rstrip()
    values = {
        "max width": f"{loop.max_width:.4g} {y}".rstrip() + f" at {at}",
        "mean width": f"{loop.mean_width:.4g} {y}",
        "width at mid span": f"{loop.mid_width:.4g} {y}",
        "relative width": f"{100 * loop.relative_width:.2f} % of the stroke",
        "stroke": f"{loop.stroke:.4g} {y}",
        "area": f"{loop.area:.4g} {y} {u}" if u and y else f"{loop.area:.4g}",
        "orientation": loop.orientation,
        "closure gap": f"{loop.closure_gap:.4g} {y}",
        "energy": f"{loop.energy:.4g} {y} {u}" if u and y else f"{loop.energy:.4g}",
        "secant stiffness": f"{loop.secant_stiffness:.4g} {y}/{u}" if u and y else f"{loop.secant_stiffness:.4g}",
        "equivalent damping": f"{100 * abs(loop.equivalent_damping):.2f} %",
        "cycles": f"{loop.n_cycles}",
    }
    width = max(map(len, values))
    yield from (f"{name:<{width}}  {value.rstrip()}" for name, value in values.items())
    if loop.orientation == "counterclockwise":
        yield from textwrap.wrap(loop.sign_convention, LETTERS)


def _step(record: "Record") -> Iterator[str]:
    """What the outputs show of the sensor, where nothing is said of it."""
    if record.resolution is None and (step := record.detect_resolution()) is not None:
        unit = record.units.get("y", "")
        yield f"the output has steps of {f'{step:.6g} {unit}'.rstrip()}: --resolution {records.DETECT} takes them"
