"""`hysim plot`: records in files as pictures, and models over them."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hysim.cli import models, outputs, records
from hysim.cli.outputs import Curve

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.simulation import Simulation


_MANY = 100
_AMPLITUDES = 50


class Drawn(NamedTuple):
    """What a picture is made of: records, models by name, and their free runs over the input of the first record."""

    measured: "list[Record]"
    laws: dict[str, Any]
    simulated: "list[Simulation]"

    @property
    def results(self) -> "list[Record | Curve]":
        """Records, and the runs of models by their names."""
        named = zip(self.laws, self.simulated, strict=True)
        return [*self.measured, *(Curve(run.u, run.y, run.t, name, run.units) for name, run in named)]


class Kind(NamedTuple):
    """A kind of picture: what it shows, of how many records and models at least and at most, and how it is drawn."""

    shows: str
    draw: "Callable[[Figure, Drawn], None]"
    records: tuple[int, int] = (1, _MANY)
    models: tuple[int, int] = (0, _MANY)


def _loop(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    plot.loop(*drawn.results, ax=canvas.add_subplot())


def _history(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    panels = plot.panels(canvas, 2)
    for result in drawn.results:
        plot.history(result, panels)
        panels[0].lines[-1].set_label(result.name)
    if len(drawn.results) > 1:
        panels[0].legend()


def _width(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    plot.width(*drawn.results, ax=canvas.add_subplot())


def _minor_loops(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    for result, ax in zip(drawn.results, plot.panels(canvas, len(drawn.results)), strict=True):
        plot.minor_loops(result, ax)


def _residual_map(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    plot.residual_map(drawn.measured[0], drawn.simulated[0], canvas.subplots(1, 2, sharey=True))


def _forc(canvas: "Figure", drawn: Drawn) -> None:
    from hysim import plot

    plot.forc(drawn.measured[0], canvas.add_subplot())


def _describing_function(canvas: "Figure", drawn: Drawn) -> None:
    import numpy as np

    from hysim import plot

    record = drawn.measured[0]
    lowest, highest = float(record.u.min()), float(record.u.max())
    amplitudes = np.linspace(0.0, 0.5 * (highest - lowest), _AMPLITUDES + 1)[1:]
    middle = 0.5 * (lowest + highest)
    plot.describing_function(drawn.laws, amplitudes, plot.panels(canvas, 2), mean=middle, units=record.units)


KINDS = {
    "loop": Kind("output against input", _loop),
    "history": Kind("output and input against time", _history),
    "width": Kind("width of the last cycle against the input", _width),
    "minor-loops": Kind("each cycle as a loop, the smaller the darker", _minor_loops),
    "residual-map": Kind(
        "measured minus model over input and cycles; one file, one model", _residual_map, records=(1, 1), models=(1, 1)
    ),
    "forc": Kind("density of relays, from first-order reversal curves; one file", _forc, records=(1, 1), models=(0, 0)),
    "describing-function": Kind(
        "gain and phase of models over the amplitudes in the file", _describing_function, models=(1, _MANY)
    ),
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
    shown = ". ".join(f"{name}: {kind.shows}" for name, kind in KINDS.items())
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
    kind, files = KINDS[options.kind], [options.file, *options.others]
    outputs.check(inputs=[*files, *options.model], pictures=[options.out])
    for what, number, (least, most) in (("file", files, kind.records), ("--model", options.model, kind.models)):
        if not least <= len(number) <= most:
            wanted = str(least) if least == most else f"at least {least}"
            raise ValueError(f"--kind {options.kind} takes {wanted} {what}, got {len(number)}")
    if [*files, *options.model].count(records.STANDARD) > 1:
        raise ValueError("the standard input holds one record or one model, not both: give files for the others")
    from hysim import plot

    drawn = _drawn(options, files)
    with plot.house_style():
        canvas = plot.figure()
        kind.draw(canvas, drawn)
    outputs.write({options.out: canvas})
    return 0


def _drawn(options: argparse.Namespace, files: list[str]) -> Drawn:
    measured = [records.read(argparse.Namespace(**{**vars(options), "file": file})) for file in files]
    read = {Path(path).stem: models.read(path) for path in options.model}
    simulated = [models.simulated(model, measured[0], {**measured[0].units, **units}) for model, units in read.values()]
    laws = {name: model for name, (model, _) in read.items()}
    return Drawn(measured, laws if len(laws) > 1 else {type(law).__name__: law for law in laws.values()}, simulated)
