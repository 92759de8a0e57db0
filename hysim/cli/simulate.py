"""`hysim simulate`: a model in a file, driven by an input in a file."""

import argparse
from typing import Any

from hysim.cli import models, outputs, records


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "simulate",
        help="drive a model with the input in a file of your own",
        description="Simulate a model in free run, and write its signals as columns: t if there is a time, u, y, the "
        "memory z of a law, and what else a plant has. The ending of the file says its format: .csv, .tsv, .npz, "
        ".mat, .h5; the standard output gets comma-separated text.",
    )
    parser.add_argument("model", metavar="MODEL.json", help="as identify writes it, or - for the standard input")
    records.add_to(parser, output=False)
    parser.add_argument("--out", metavar="OUT", default=records.STANDARD, help="default: the standard output")
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the loop; {outputs.PICTURE}")
    parser.add_argument(
        "--json", action="store_true", help="print the columns as JSON, beside a file if --out is given"
    )
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Simulate and write."""
    from hysim.files import Notes, columns_as, ending

    outputs.check(options.out, pictures=[options.plot])
    if options.out != records.STANDARD:
        ending(options.out)
    if options.model == options.file == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    model, units = models.read(options.model)
    record = records.read(options)
    known = units | {signal: unit for signal, unit in record.units.items() if signal != "y"} | dict(options.unit)
    run = models.simulated(model, record, known)
    columns = {name: run.signals[name] for name in ("t", "u", "y", "z") if name in run.signals}
    columns |= dict(run.signals)
    labels = {name: known[name] for name in columns if name in known}
    texts: dict[str | None, Any] = {options.plot: outputs.loop(run) if options.plot else ""}
    if options.out != records.STANDARD:
        texts[options.out] = columns_as(columns, options.out, Notes(labels))
    elif not options.json:
        texts[options.out] = outputs.to_csv(columns, known)
    if options.json:
        values = {name: column.tolist() for name, column in columns.items()}
        texts[records.STANDARD] = outputs.to_json({"units": labels, "columns": values})
    outputs.write(texts)
    return 0
