"""`hysim simulate`: a model in a file, driven by an input or a ground motion in a file."""

import argparse
from typing import Any, Protocol, runtime_checkable

from hysim.cli import models, outputs, records
from hysim.cli.options import MODEL_IN, Command


@runtime_checkable
class _Shaken(Protocol):
    """A plant that a force or its base moves."""

    excitation: str


def run(options: argparse.Namespace) -> int:
    """Simulate and write."""
    from hysim.simulation import columns_of

    if options.model == options.file == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    if options.file.endswith(".json") and options.model.endswith((".csv", ".tsv", ".txt", ".npz", ".mat", ".h5")):
        raise ValueError(f"the model stands before the record: hysim simulate {options.file} {options.model}")
    model, units = models.read(options.model)
    record = records.read_input(options, of_the_ground=isinstance(model, _Shaken) and model.excitation == "base")
    units |= dict(options.unit) | {signal: unit for signal, unit in record.units.items() if signal != "y"}
    simulation = models.simulated(model, record, units)
    columns = simulation.columns
    labels = {
        column: units[name]
        for name, values in simulation.signals.items()
        if name in units
        for column in columns_of(name, values)
    }

    def document() -> dict[str, Any]:
        values = {name: column.tolist() for name, column in columns.items()}
        return {"units": {name: labels[name] for name in columns if name in labels}, "columns": values}

    files: dict[str | None, Any] = {options.plot: lambda: outputs.picture_of(simulation)}
    if options.out is not None or not options.json:
        path = options.out or records.STANDARD
        files[path] = lambda: outputs.table(path, columns, labels)
    outputs.write(options, files, (lambda: "") if options.json else None, document)
    return 0


COMMAND = Command(
    "simulate",
    "drive a model with the input in a file of your own",
    "Simulate a model in free run, and write its signals as columns: t if there is a time, u, y, the memory z of a law "
    "and further signals of a plant, those of a structure as drift_0, drift_1, ... for its elements and "
    "displacement_1, ... for its nodes. An AT2 file of PEER is read as the acceleration of the ground in m/s^2; so is, "
    "for a plant that its base moves, a file without a column u; --unit u=g says the unit if it states none.",
    f"""
{MODEL_IN}
{records.OPTIONS_OF_AN_INPUT}
--out OUT  the columns (default: the standard output)
--plot LOOP.svg  draw the loop; of a structure, the loops of its elements
--json  print the columns as JSON, beside a file if --out is used
""",
    run,
    """
hysim simulate law.json drive.csv --out response.csv
hysim simulate frame.json quake.at2 --out response.csv --plot loops.svg
hysim simulate law.json loop.csv | hysim plot - --out loop.svg
""",
)
