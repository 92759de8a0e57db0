"""`hysim plot`: records in files as pictures, and models over them."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from hysim.cli import models, outputs, records
from hysim.cli.options import OWN, Command

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.simulation import Simulation


_MANY = 100
_AMPLITUDES = 50


class Contents(NamedTuple):
    """Contents of a picture: records, models by name, and their free runs over the input of the first record."""

    measured: "list[Record]"
    laws: dict[str, Any]
    simulated: "list[Simulation]"

    @property
    def results(self) -> "list[Record | Simulation]":
        """Records, and the runs of models by their names."""
        named = zip(self.laws, self.simulated, strict=True)
        return [*self.measured, *(replace(run, name=name) for name, run in named)]


class Kind(NamedTuple):
    """A kind of picture: its description, its drawing, and bounds of the numbers of records and models."""

    shows: str
    draw: "Callable[[Any, Figure, Contents], object]"
    records: tuple[int, int] = (1, _MANY)
    models: tuple[int, int] = (0, _MANY)


def _history(plot: Any, canvas: "Figure", contents: Contents) -> None:
    panels = plot.panels(canvas, 2)
    for result in contents.results:
        plot.history(result, panels)
        panels[0].lines[-1].set_label(result.name)
    if len(contents.results) > 1:
        panels[0].legend()


def _minor_loops(plot: Any, canvas: "Figure", contents: Contents) -> None:
    for result, ax in zip(contents.results, plot.panels(canvas, len(contents.results)), strict=True):
        plot.minor_loops(result, ax)
        ax.set_title(result.name)


def _cycles(plot: Any, canvas: "Figure", contents: Contents) -> None:
    for result, ax in zip(contents.results, plot.panels(canvas, len(contents.results)), strict=True):
        plot.cycles(result, ax)
        ax.set_title(result.name)


def _describing_function(plot: Any, canvas: "Figure", contents: Contents) -> None:
    import numpy as np

    record = contents.measured[0]
    lowest, highest = float(record.u.min()), float(record.u.max())
    amplitudes = np.linspace(0.0, 0.5 * (highest - lowest), _AMPLITUDES + 1)[1:]
    middle = 0.5 * (lowest + highest)
    plot.describing_function(contents.laws, amplitudes, plot.panels(canvas, 2), mean=middle, units=record.units)


KINDS = {
    "loop": Kind("output against input", lambda plot, canvas, c: plot.loop(*c.results, ax=canvas.add_subplot())),
    "history": Kind("output and input against time", _history),
    "width": Kind(
        "width of the last cycle against the input",
        lambda plot, canvas, c: plot.width(*c.results, ax=canvas.add_subplot()),
    ),
    "cycles": Kind("each cycle in a colour, from the first, dark, to the last, light", _cycles),
    "minor-loops": Kind("each cycle as a loop, the smaller the darker", _minor_loops),
    "residual-map": Kind(
        "measured minus model over input and cycles; one file, one model",
        lambda plot, canvas, c: plot.residual_map(c.measured[0], c.simulated[0], canvas.subplots(1, 2, sharey=True)),
        records=(1, 1),
        models=(1, 1),
    ),
    "forc": Kind(
        "density of relays, from first-order reversal curves; one file",
        lambda plot, canvas, c: plot.forc(c.measured[0], canvas.add_subplot()),
        records=(1, 1),
        models=(0, 0),
    ),
    "describing-function": Kind(
        "gain and phase of models over the amplitudes in the file", _describing_function, models=(1, _MANY)
    ),
}
"""Kinds of pictures that `--kind` takes."""


def run(options: argparse.Namespace) -> int:
    """Draw and write."""
    kind, files = KINDS[options.kind], [options.file, *options.others]
    for name, paths, (least, most) in (("file", files, kind.records), ("--model", options.model, kind.models)):
        if not least <= len(paths) <= most:
            number = str(least) if least == most else f"at least {least}"
            raise ValueError(f"--kind {options.kind} takes {number} {name}, got {len(paths)}")
    if [*files, *options.model].count(records.STANDARD) > 1:
        raise ValueError("the standard input holds one record or one model, not both: give files for the others")
    from hysim import plot

    contents = _contents(options, files)
    outputs.write(options, {options.out: lambda: outputs.drawn(lambda canvas: kind.draw(plot, canvas, contents))})
    return 0


def _contents(options: argparse.Namespace, files: list[str]) -> Contents:
    measured = [records.read(options, file) for file in files]
    read = {models.name_of(path): models.read(path) for path in options.model}
    simulated = [models.simulated(model, measured[0], {**measured[0].units, **units}) for model, units in read.values()]
    laws = {name: model for name, (model, _) in read.items()}
    return Contents(measured, laws if len(laws) > 1 else {type(law).__name__: law for law in laws.values()}, simulated)


COMMAND = Command(
    "plot",
    "draw files of your own",
    "Draw records over each other, and the free run of models over the input of the first.",
    f"""
{records.OPTIONS}
others FILE...  more files with the same columns
--kind {"|".join(KINDS)}  {". ".join(f"{name}: {kind.shows}" for name, kind in KINDS.items())} [default: loop]
--model MODEL...  model file as identify writes it, - for the standard input, or {OWN}; once or more
--out LOOP.svg  the picture [required]
""",
    run,
    """
hysim plot loop.csv --u voltage --y displacement --out loop.svg
hysim plot loop.csv --model law.json --out both.pdf
hysim plot curves.csv --kind forc --out forc.svg
""",
)
