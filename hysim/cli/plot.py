"""`hysim plot`: the loop in a file, and a model's loop over it."""

import argparse
from typing import Any

from hysim.cli import models, outputs, records


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "plot",
        help="draw the loop in a file of your own",
        description="Draw output against input as an SVG picture, with a model's free run over it if one is given.",
    )
    records.add_to(parser)
    parser.add_argument("--model", metavar="MODEL.json", help="as identify writes it, or - for the standard input")
    parser.add_argument("--out", metavar="LOOP.svg", required=True, help="the picture, - for the standard output")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Draw and write."""
    outputs.check(pictures=[options.out])
    if options.model == options.file == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    results: list[Any] = [records.read(options)]
    if options.model is not None:
        model, units = models.read(options.model)
        results.append(models.simulated(model, results[0], units))
    outputs.write({options.out: outputs.loop_svg(*results)})
    return 0
