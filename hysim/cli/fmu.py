"""`hysim fmu`: a model in a file as a functional mock-up unit."""

import argparse

from hysim.cli import models
from hysim.cli.options import MODEL_IN, Command, positive


def run(options: argparse.Namespace) -> int:
    """Write the unit."""
    from hysim.export import to_fmu

    model, units = models.read(options.model)
    sample_time = None if options.sample_time is None else positive("--sample-time", options.sample_time)
    to_fmu(
        model, options.out, options.version, sample_time, name=options.name, units={**units, **dict(options.unit)},
        platforms=options.platforms, u0=options.u0, y0=options.y0,
    )  # fmt: skip
    return 0


COMMAND = Command(
    "fmu",
    "write a model as a functional mock-up unit for Simulink, Modelica and other tools",
    "Write a model as a functional mock-up unit (FMU) for co-simulation: its description, its C sources, and shared "
    "libraries. The output is one communication step late. A value that begins with a minus sign is joined by an "
    "equals sign: --u0=-10.",
    f"""
{MODEL_IN}
--out MODEL.fmu  the file to write [required]
--version 2.0|3.0  version of FMI [default: 2.0]
--sample-time TIME  time between two samples of a plant or a controller [s]
--name NAME  name of the model, a name in C (default: that of its class)
--unit SIGNAL=UNIT...  unit of u or y, such as u=V (default: those in the model's file)
--u0 VALUE  input at which a law rests before the simulation, command at which a controller starts [unit of u]
    [default: 0]
--y0 VALUE  displacement at which a controller starts [unit of y] [default: 0]
--platforms PLATFORMS  linux, windows, mac, with commas between them, for which it holds a shared library, or none
    (default: this machine, if it has a C compiler)
""",
    run,
    """
hysim fmu law.json --out law.fmu
hysim fmu actuator.json --sample-time 1e-4 --version 3.0 --out actuator.fmu
""",
)
