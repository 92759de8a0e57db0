"""`hysim example`: a file to try the other commands on."""

import argparse
import os
from collections.abc import Callable
from typing import NamedTuple

from hysim.cli import outputs
from hysim.cli.options import Command
from hysim.cli.records import STANDARD
from hysim.records import Record

_SEED = 1


class Device(NamedTuple):
    """A device whose record is written: what it is, the record, and commands to try on the file."""

    what: str
    record: Callable[[], Record]
    tries: tuple[str, ...]


def _piezo() -> Record:
    from hysim.datasets import table1

    return table1(dwell=1.0)


def _damper() -> Record:
    """Cycles of growing amplitude on a steel damper, whose load cell has noise."""
    import numpy as np

    import hysim

    phase = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    u = np.concatenate([*(amplitude * np.sin(phase) for amplitude in (2.0, 4.0, 6.0, 8.0, 10.0, 10.0)), [0.0]])
    law = hysim.BoucWen(A=1.0, beta=0.35, gamma=0.15, n=1.5, feedthrough=1.2, gain=18.0)
    noise = 0.1 * np.random.default_rng(_SEED).standard_normal(u.size)
    t = 0.1 * np.arange(float(u.size))
    units = {"t": "s", "u": "mm", "y": "kN"}
    return Record(t=t, u=u, y=law.response(u) + noise, units=units, name="steel damper, simulated")


def _magnet() -> Record:
    """First-order reversal curves of relays with two bells of thresholds."""
    import numpy as np

    import hysim

    def density(up: "np.ndarray", down: "np.ndarray") -> "np.ndarray":
        return np.asarray(np.exp(-((up + down) ** 2) / 800.0 - ((up - down - 80.0) ** 2) / 1800.0))

    law = hysim.Preisach.from_density(np.linspace(-100.0, 100.0, 41), density)
    u = hysim.signals.reversal_curves(-100.0, 100.0, curves=20, samples_per_step=2)
    y = law.response(u)
    units = {"u": "kA/m", "y": "T"}
    return Record(u=u, y=1.5 * y / np.abs(y).max(), units=units, name="magnet, simulated")


DEVICES = {
    "piezo": Device(
        "voltages and displacements measured on a piezo stack",
        _piezo,
        ("metrics {}", "identify {} --model polynomial-bouc-wen --plot fit.svg"),
    ),
    "damper": Device(
        "simulated test of a steel damper, displacements and forces in cycles of growing amplitude",
        _damper,
        ("metrics {} --cycles", "identify {} --model bouc-wen --plot fit.svg"),
    ),
    "magnet": Device(
        "simulated first-order reversal curves of a magnet, fields and flux densities",
        _magnet,
        ("plot {} --kind minor-loops --out loops.svg", "plot {} --kind forc --out forc.svg"),
    ),
}
"""Devices that `--device` takes."""


def run(options: argparse.Namespace) -> int:
    """Write the record, and print what can be done with it."""
    import numpy as np

    from hysim.files import Notes, packed

    device = DEVICES[options.device]
    path = f"{options.device}.csv" if options.path is None else options.path
    if path != STANDARD and os.path.exists(path):
        raise ValueError(f"{path} is there already: give another name, as in hysim example mine.csv")
    record = device.record()
    columns = {} if record.t is None else {"t": np.asarray(record.t)}
    columns |= {"u": record.u, "y": record.y}
    notes = Notes(record.units, record.resolution, record.name)
    content = packed(columns, "example.csv" if path == STANDARD else path, notes)
    names = ", ".join(f"{name} [{record.units[name]}]" for name in columns)
    lines = [f"{path}: {len(record)} samples of {names}: {device.what}. Try:"]
    text = "\n".join([*lines, *(f"  hysim {line.format(path)}" for line in device.tries)])
    outputs.write(options, {path: lambda: content}, lambda: text)
    return 0


COMMAND = Command(
    "example",
    "write a file to try the other commands on",
    "Write a record as a file like one of your own. The piezo's 52 samples were measured for a paper of 2016, which "
    "prints no times: one second a sample is an assumption. The other devices are simulated.",
    f"""
path [OUT]  file to write (default: the device's name with the ending .csv)
--device {"|".join(DEVICES)}  {"; ".join(f"{name}: {device.what}" for name, device in DEVICES.items())}
    [default: piezo]
""",
    run,
    """
hysim example
hysim example damper.csv --device damper
hysim example curves.mat --device magnet
""",
)
