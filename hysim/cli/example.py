"""`hysim example`: a file to try the other commands on."""

import argparse
import os

from hysim.cli import outputs
from hysim.cli.options import Command
from hysim.cli.records import STANDARD


def run(options: argparse.Namespace) -> int:
    """Write the record, and print what can be done with it."""
    import numpy as np

    from hysim.datasets import table1
    from hysim.files import Notes, packed

    record = table1(dwell=1.0)
    columns = {"t": np.asarray(record.t), "u": record.u, "y": record.y}
    notes = Notes(record.units, record.resolution, record.name)
    path = options.path
    if path != STANDARD and os.path.exists(path):
        raise ValueError(f"{path} is there already: give another name")
    content = packed(columns, "example.csv" if path == STANDARD else path, notes)
    text = (
        f"{path}: {len(record)} samples of t [s], u [V] and y [um], measured on a piezo stack. Try:\n"
        f"  hysim metrics {path}\n"
        f"  hysim identify {path} --model bouc-wen --plot fit.svg"
    )
    outputs.write(options, {path: lambda: content}, lambda: text)
    return 0


COMMAND = Command(
    "example",
    "write a file to try the other commands on",
    "Write 52 samples that a paper of 2016 measured on a piezo stack, as a file like one of your own. The paper prints "
    "no times: one second a sample is an assumption.",
    """
path OUT  file to write
""",
    run,
)
