"""`hysim simulate`: a model in a file, driven by an input in a file."""

import argparse
from typing import Any

from hysim.cli import models, outputs, records
from hysim.cli.options import MODEL_IN, Command


def run(options: argparse.Namespace) -> int:
    """Simulate and write."""
    if options.model == options.file == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    model, units = models.read(options.model)
    record = records.read(options)
    units |= {signal: unit for signal, unit in record.units.items() if signal != "y"} | dict(options.unit)
    simulation = models.simulated(model, record, units)
    signals = simulation.signals
    columns = {name: signals[name] for name in ("t", "u", "y", "z") if name in signals} | dict(signals)

    def document() -> dict[str, Any]:
        values = {name: column.tolist() for name, column in columns.items()}
        return {"units": {name: units[name] for name in columns if name in units}, "columns": values}

    files: outputs.Files = {
        options.out: lambda: outputs.table(options.out, columns, units),
        options.plot: lambda: outputs.loop(simulation),
    }
    outputs.write(options, files, lambda: outputs.table(records.STANDARD, columns, units).decode(), document)
    return 0


COMMAND = Command(
    "simulate",
    "drive a model with the input in a file of your own",
    "Simulate a model in free run, and write its signals as columns: t if there is a time, u, y, the memory z of a law "
    "and further signals of a plant.",
    f"""
{MODEL_IN}
{records.OPTIONS_OF_AN_INPUT}
--out OUT  the columns (default: the standard output)
--plot LOOP.svg  draw the loop
--json  print the columns as JSON, beside a file if --out is used
""",
    run,
)
