"""`hysim control`: a controller for a model in a file, and the achievements of its loop."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs
from hysim.cli.options import JSON, MODEL_IN, Command

if TYPE_CHECKING:
    from hysim.cli.achievements import Design
    from hysim.export import CSource

SUCCESS, NOT_WITHIN_BOUNDS = 0, 1
CONTROLLERS = {
    "pid": "with filter and setpoint weight",
    "integral": "integral action alone",
    "notch": "integral action behind a notch at the mode",
    "inverse": "of law, creep and amplifier, without feedback",
    "tracking": "that inverse and integral action",
    "model-following": "that inverse, the mode's, and integral action on the errors of the model",
}
"""Controllers that `--controller` takes."""


def run(options: argparse.Namespace) -> int:
    """Design, write the files that are asked for, and print the achievements."""
    from hysim.cli import achievements
    from hysim.models.storage import to_json

    header = _header(options)
    design = _designed(options)
    files: dict[str | None, Any] = {options.out: lambda: to_json(design.controller, units=design.units)}
    if header:
        code = _c_code(options, design.controller)
        files |= {options.c: lambda: code.source, header: lambda: code.header}
    files[options.plot] = lambda: achievements.picture(design)
    outputs.write(options, files, lambda: achievements.text(design), lambda: achievements.document(design))
    return SUCCESS if design.tuning is None or design.tuning.success else NOT_WITHIN_BOUNDS


def _header(options: argparse.Namespace) -> str | None:
    """Path of the header beside the C code, which must not overwrite an input either."""
    if options.c is None:
        return None
    if Path(options.c).suffix != ".c":
        raise ValueError(f"C code is a file and its header beside it: call the file .c, got {options.c}")
    header = str(Path(options.c).with_suffix(".h"))
    outputs.keep([options.model, options.record, options.reference], [header])
    return header


def _designed(options: argparse.Namespace) -> "Design":
    from hysim.cli import designs
    from hysim.cli.achievements import Design
    from hysim.control import PID, assess_hysteresis, assess_step, tune
    from hysim.files import load

    model, units = models.read(options.model)
    record = None if options.record is None else load(options.record, u=options.u, y=options.y)
    if record is not None:
        signals = {name: unit for name, unit in units.items() if name in ("u", "y")}
        record = designs.in_units(record, signals, options.record)
        units = {**units, **record.units}
    actuator = designs.plant(model, options)
    limits = designs.limits(options, record)
    task = designs.task(actuator, options, limits)
    template = designs.feedback(actuator, options.controller, limits)

    def with_feedback(feedback: Any) -> Any:
        return designs.controller(actuator, options.controller, limits, feedback, preview=options.preview)

    controller = with_feedback(template or PID(kp=1.0, limits=limits))
    if options.c:
        _c_code(options, controller)  # a controller that cannot be exported is an error before the search
    reference = designs.reference(task, designs.rest(actuator, task.u0), options.reference, units.get("y"))
    tuning = None
    if options.controller != "inverse":
        tuning = tune(
            actuator, reference.t, reference.values, controller=template, objective=reference.objective, limits=limits,
            max_sensitivity=options.max_sensitivity, max_voltage_noise=options.max_voltage_noise,
            variations=designs.variations(actuator, options.vary_mode), transient=reference.transient,
            u0=task.u0 if options.reference == "step" else 0.0,
        )  # fmt: skip
        controller = with_feedback(tuning.controller)
    h = task.sample_time
    return Design(
        actuator=actuator,
        controller=controller,
        tuning=tuning,
        task=task,
        triangle=assess_hysteresis(
            actuator, controller, low=task.low, high=task.high, period=task.period, sample_time=h, cycles=designs.CYCLES
        ),
        step=assess_step(actuator, controller, step=task.step, duration=task.duration, sample_time=h, u0=task.u0),
        file_rms=designs.file_rms(actuator, controller, reference, options.reference),
        fit_percent=designs.fit_percent(model, record),
        units=units,
        reference=Path(options.reference).name,
        limits_from=Path(options.record).name if options.record and options.limits is None else None,
    )


def _c_code(options: argparse.Namespace, controller: Any) -> "CSource":
    from hysim.export import to_c

    return to_c(controller, options.sample_time, name=Path(options.c).stem)


COMMAND = Command(
    "control",
    "design a controller for a model, and print what it achieves",
    "Tune a sampled controller on a model's simulated loop, and measure how far it reduces the hysteresis along a slow "
    "triangle and the vibration after a step. A value that begins with a minus sign is joined by an equals sign: "
    "--limits=-10,10. Exit code 1: no controller within the bounds was found.",
    f"""
{MODEL_IN}

plant: stages around the model, which replace its own
--mode FREQUENCY,DAMPING  a resonance behind the law: natural frequency [Hz], damping ratio [1]
--creep PERCENT  growth in a decade of time [%]
--noise RMS  noise of the sensor [unit of y]
--quantum STEP  step of the sensor's readings [unit of y]
--delay TIME  age of the sensor's readings [s]

controller:
--controller {"|".join(CONTROLLERS)}  {"; ".join(map(": ".join, CONTROLLERS.items()))} [default: pid]
--sample-time TIME  sample time of the controller [s] [required]
--limits LOW,HIGH  limits of the command [unit of u] (default: the record's extremes, else none)
--max-sensitivity BOUND  largest |1/(1 + L)| at any frequency and slope of the law [1] [default: 2.0]
--max-voltage-noise RMS  largest voltage noise that the sensor's noise may cause [unit of u]
--vary-mode PERCENT  keep the bounds also where the mode's frequency is lower or higher by this [%]
--preview  the reference is known ahead, for as long as the inverse needs

task of the loop:
--reference triangle|step|FILE  reference for which the gains are tuned; a text file has times [s] and values
    [unit of y] in its first two columns [default: triangle]
--range LOW,HIGH  range of the triangle [unit of y] (default: the middle 80 % of the range that the limits allow)
--frequency HERTZ  frequency of the triangle [Hz] (default: 1000 samples, 200 periods of a mode or 20 of a lag a cycle)
--step HEIGHT  step from a quarter of the range, or downwards from three [unit of y] (default: half the range)
--duration TIME  duration of the step [s] (default: until the slowest mode is at rest)
--record FILE  measured loop: its input's extremes are the limits, and its output is compared with the model's
--u COLUMN  input of the record: name or number of its column (default: u)
--y COLUMN  output of the record: name or number of its column (default: y)

--out CONTROLLER.json  write the controller; - writes it to the standard output
--c CONTROLLER.c  write it as C99, and its header beside it
--plot LOOP.svg  draw the loops and the steps
{JSON}
""",
    run,
    """
hysim control law.json --record loop.csv --sample-time 1e-4
hysim control law.json --limits 0,100 --sample-time 1e-4 --mode 300,0.02 --controller tracking --out c.json
hysim control law.json --limits 0,100 --sample-time 1e-4 --controller inverse --c stage.c
""",
)
