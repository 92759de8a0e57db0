"""`hysim metrics`: the width, area and orientation of a measured loop, or a table of every cycle."""

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from hysim._printing import folded, quantity
from hysim.cli import outputs, records
from hysim.cli.options import JSON, Command

if TYPE_CHECKING:
    from hysim.metrics import LoopMetrics
    from hysim.records import Record


def run(options: argparse.Namespace) -> int:
    """Measure and print."""
    from hysim.metrics import cycle_metrics, loop_metrics

    if options.csv is not None and options.cycles is not None:
        raise ValueError("--csv writes the table of every cycle: give --cycles without a number too")
    record = records.read(options)
    tolerance = {} if options.tolerance is None else {"tolerance": options.tolerance}
    files: dict[str | None, Any] = {options.plot: lambda: outputs.loop(record)}
    if options.cycles is None:
        table = cycle_metrics(record.u, record.y, **tolerance)
        lines = [table.to_text(record.units)]
        document = {"cycles": table.rows(), "level": table.level, "energy_outside": table.energy_outside}
        convention = table.sign_convention
        files[options.csv] = lambda: table.to_csv(record.units)
    else:
        loop = loop_metrics(record.u, record.y, cycles=options.cycles, **tolerance)
        lines = [*_lines(loop, record.units)]
        lobes = [lobe._asdict() for lobe in loop.lobes]
        document = outputs.scalars(loop) | {"crossings": list(loop.crossings), "lobes": lobes}
        convention = loop.sign_convention

    def text() -> str:
        return "\n".join([*lines, *_step(record)])

    def with_units() -> dict[str, Any]:
        return document | {"sign_convention": convention, "units": record.units}

    files[options.out] = lambda: outputs.printed(options, text, with_units)
    outputs.write(options, files, text, with_units)
    return 0


def _lines(loop: "LoopMetrics", units: Mapping[str, str]) -> Iterator[str]:
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


def _step(record: "Record") -> Iterator[str]:
    """The resolution that the outputs show, if none was given."""
    if record.resolution is None and (step := record.detect_resolution()) is not None:
        unit = record.units.get("y", "")
        yield f"the output has steps of {f'{step:.6g} {unit}'.rstrip()}: --resolution {records.DETECT} takes them"


COMMAND = Command(
    "metrics",
    "measure the loop in a file of your own",
    "Measure the loop of the input's last complete cycle, the average loop of the last few, or every cycle: of growing "
    "protocols, and of 0, max, min, 0.",
    f"""
{records.OPTIONS}
--cycles [CYCLES]  print a table with one row a cycle; with a number, the average loop of so many last cycles
    [default: 1]
--tolerance SHARE  reversals smaller than this fraction of the input's span are noise [1] (default: 0.01)
--out COPY  write the printed result into a file too
--csv PATH  with --cycles, write the table; - writes it to the standard output
--plot LOOP.svg  draw the loop
{JSON}
""",
    run,
    """
hysim metrics loop.csv --u voltage --y displacement
hysim metrics damper.csv --cycles --csv cycles.csv
hysim metrics loop.csv --from 2s --to 4s --plot loop.svg
""",
)
