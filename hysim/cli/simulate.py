"""`hysim simulate`: a model in a file, driven by an input in a file."""

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim._frozen import FloatArray


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "simulate",
        help="drive a model with the input in a file of your own",
        description="Simulate a model in free run, and write its signals as columns: t if there is a time, u, y, the "
        "memory z of a law, and what else a plant has.",
    )
    parser.add_argument("model", metavar="MODEL.json", help="as identify writes it, or - for the standard input")
    records.add_to(parser, output=False)
    parser.add_argument(
        "--out", metavar="OUT", default=records.STANDARD, help=f"{outputs.TABLE} (default: %(default)s)"
    )
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the loop; {outputs.PICTURE}")
    parser.add_argument(
        "--json", action="store_true", help="print the columns as JSON, beside a file if --out is given"
    )
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Simulate and write."""
    outputs.check(table=options.out, inputs=[options.model, options.file], pictures=[options.plot])
    if options.model == options.file == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    model, units = models.read(options.model)
    record = records.read(options)
    known = units | {signal: unit for signal, unit in record.units.items() if signal != "y"} | dict(options.unit)
    run = models.simulated(model, record, known)
    columns = {name: run.signals[name] for name in ("t", "u", "y", "z") if name in run.signals}
    columns |= dict(run.signals)
    contents: dict[str | None, Any] = {options.out: outputs.table(options.out, columns, known)}
    if options.json:
        contents[records.STANDARD] = _json(columns, known)
    if options.plot:
        contents[options.plot] = outputs.loop(run)
    outputs.write(contents)
    return 0


def _json(columns: Mapping[str, "FloatArray"], known: Mapping[str, str]) -> str:
    values = {name: column.tolist() for name, column in columns.items()}
    return outputs.to_json({"units": {name: known[name] for name in columns if name in known}, "columns": values})
