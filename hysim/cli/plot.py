"""`hysim plot`: records in files as pictures, and models over them."""

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.simulation import Simulation


class Kind(NamedTuple):
    """A kind of picture: what it shows, and how it is drawn."""

    shows: str
    draw: "Callable[[Figure, list[Record], list[Simulation]], None]"


def _loop(canvas: "Figure", measured: "list[Record]", simulated: "list[Simulation]") -> None:
    from hysim import plot

    plot.loop(*measured, *simulated, ax=canvas.add_subplot())


def _history(canvas: "Figure", measured: "list[Record]", simulated: "list[Simulation]") -> None:
    from hysim import plot

    panels = plot.panels(canvas, 2)
    each: Any
    for each in (*measured, *simulated):
        plot.history(each, panels)


KINDS = {
    "loop": Kind("output against input", _loop),
    "history": Kind("output and input against time", _history),
}
"""What `--kind` takes."""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "plot",
        help="draw files of your own",
        description="Draw records over each other, and the free run of models over the input of the first.",
    )
    records.add_to(parser)
    parser.add_argument("others", metavar="FILE", nargs="*", help="more files with the same columns")
    shown = "; ".join(f"{name}: {kind.shows}" for name, kind in KINDS.items())
    parser.add_argument("--kind", choices=tuple(KINDS), default="loop", help=f"{shown} (default: %(default)s)")
    parser.add_argument(
        "--model",
        metavar="MODEL.json",
        action="append",
        default=[],
        help="as identify writes it, or - for the standard input; once or more",
    )
    parser.add_argument("--out", metavar="LOOP.svg", required=True, help=f"the picture, {outputs.PICTURE}")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Draw and write."""
    outputs.check(pictures=[options.out])
    files = [options.file, *options.others]
    if [*files, *options.model].count(records.STANDARD) > 1:
        raise ValueError("the standard input holds one record or one model, not both: give files for the others")
    measured = [records.read(argparse.Namespace(**{**vars(options), "file": file})) for file in files]
    simulated = [models.simulated(model, measured[0], units) for model, units in map(models.read, options.model)]
    from hysim import plot

    with plot.house_style():
        canvas = plot.figure()
        KINDS[options.kind].draw(canvas, measured, simulated)
    outputs.write({options.out: canvas})
    return 0
