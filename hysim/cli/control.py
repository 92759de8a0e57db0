"""`hysim control`: a controller for a model in a file, and what its loop achieves."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim.cli.achievements import Design
    from hysim.control import CSource
    from hysim.records import Record

SUCCESS, NOT_WITHIN_BOUNDS = 0, 1
CONTROLLERS = {
    "pid": "with filter and setpoint weight",
    "integral": "integral action alone",
    "notch": "integral action behind a notch at the mode",
    "inverse": "of law, creep and amplifier, without feedback",
    "tracking": "that inverse and integral action",
    "model-following": "that inverse, the mode's, and integral action on what the model does not know",
}
"""What `--controller` takes."""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "control",
        help="design a controller for a model, and say what it achieves",
        description="Tune a sampled controller on a model's simulated loop, and measure what it takes away: of the "
        "hysteresis along a slow triangle, of the vibration after a step. A value that begins with a minus sign is "
        "joined by an equals sign: --limits=-10,10. Exit code 1: no controller within the bounds was found.",
    )
    parser.add_argument(
        "model", metavar="MODEL.json", help="law, linear plant or actuator, as identify writes it; - is standard input"
    )
    _add_plant(parser.add_argument_group("plant", "stages around the model, in place of its own"))
    _add_controller(parser.add_argument_group("controller"))
    _add_task(parser.add_argument_group("what the loop shall follow"))
    parser.add_argument("--out", metavar="CONTROLLER.json", help="write the controller, - for the standard output")
    parser.add_argument("--c", metavar="CONTROLLER.c", help="write it as C99, and its header beside it")
    parser.add_argument(
        "--single", action="store_true", help="the C code in single precision (default: double precision)"
    )
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the loops and the steps; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    parser.set_defaults(command=run)


def _add_plant(group: Any) -> None:
    group.add_argument(
        "--mode", metavar="FREQUENCY,DAMPING", type=_pair,
        help="a resonance behind the law: natural frequency [Hz], damping ratio [1]",
    )  # fmt: skip
    group.add_argument("--creep", metavar="PERCENT", type=float, help="growth in a decade of time [%%]")
    group.add_argument("--noise", metavar="RMS", type=float, help="of the sensor [unit of y]")
    group.add_argument("--quantum", metavar="STEP", type=float, help="of the sensor's readings [unit of y]")
    group.add_argument("--delay", metavar="TIME", type=float, help="age of what the sensor reads [s]")


def _add_controller(group: Any) -> None:
    kinds = "; ".join(f"{name}: {what}" for name, what in CONTROLLERS.items())
    group.add_argument(
        "--controller", choices=tuple(CONTROLLERS), default="pid", help=f"{kinds} (default: %(default)s)"
    )
    group.add_argument("--sample-time", metavar="TIME", type=float, required=True, help="of the controller [s]")
    group.add_argument(
        "--limits", metavar="LOW,HIGH", type=_pair,
        help="of the command [unit of u] (default: the record's extremes, else none)",
    )  # fmt: skip
    group.add_argument(
        "--max-sensitivity", metavar="BOUND", type=float, default=2.0,
        help="largest |1/(1 + L)| at any frequency and slope of the law [1] (default: %(default)s)",
    )  # fmt: skip
    group.add_argument(
        "--max-voltage-noise", metavar="RMS", type=float, help="that the sensor's noise may cause [unit of u]"
    )
    group.add_argument(
        "--vary-mode", metavar="PERCENT", type=float,
        help="by which the mode may be off either way, where the bounds hold too [%%]",
    )  # fmt: skip
    group.add_argument(
        "--preview", action="store_true", help="the reference is known ahead, as long as the inverse takes"
    )


def _add_task(group: Any) -> None:
    group.add_argument(
        "--reference", metavar="triangle|step|FILE", default="triangle",
        help="what the gains are tuned for; a text file has times [s] and values [unit of y] in its first two columns "
        "(default: %(default)s)",
    )  # fmt: skip
    group.add_argument(
        "--range", metavar="LOW,HIGH", type=_pair,
        help="of the triangle [unit of y] (default: the middle 80 %% of what the limits let the model reach)",
    )  # fmt: skip
    group.add_argument(
        "--frequency", metavar="HERTZ", type=float,
        help="of the triangle [Hz] (default: 1000 samples, 200 periods of a mode or 20 of a lag in a cycle)",
    )  # fmt: skip
    group.add_argument(
        "--step",
        metavar="HEIGHT",
        type=float,
        help="from a quarter of the range, or from three [unit of y] (default: half the range)",
    )
    group.add_argument(
        "--duration", metavar="TIME", type=float, help="of the step [s] (default: until the slowest mode is at rest)"
    )
    group.add_argument(
        "--record", metavar="FILE", help="measured loop, whose input's extremes are the limits; the model is compared"
    )
    group.add_argument("--u", metavar="COLUMN", help="input of the record: name or number (default: u)")
    group.add_argument("--y", metavar="COLUMN", help="output of the record: name or number (default: y)")


def run(options: argparse.Namespace) -> int:
    """Design, write the files that are asked for, and print what is achieved."""
    from hysim.cli import achievements

    is_taken = _check(options)
    found = _designed(options)
    contents: dict[str | None, Any] = {options.out: achievements.controller_json(found)}
    if options.c:
        code = _c_code(options, found.controller)
        contents |= {options.c: code.source, str(Path(options.c).with_suffix(".h")): code.header}
    if options.plot:
        contents[options.plot] = achievements.picture(found)
    if not is_taken:
        told = outputs.to_json(achievements.document(found)) if options.json else achievements.text(found)
        contents[records.STANDARD] = told
    outputs.write(contents)
    return SUCCESS if found.tuning is None or found.tuning.success else NOT_WITHIN_BOUNDS


def _check(options: argparse.Namespace) -> bool:
    """Refuse what cannot be written; whether the standard output is taken."""
    if options.c is not None and Path(options.c).suffix != ".c":
        raise ValueError(f"C code is a file and its header beside it: call the file .c, got {options.c}")
    header = None if options.c is None else str(Path(options.c).with_suffix(".h"))
    inputs = [options.model, options.record, options.reference]
    return outputs.check(options.out, options.c, header, inputs=inputs, pictures=[options.plot], printed=options.json)


def _designed(options: argparse.Namespace) -> "Design":
    from hysim.cli import designs
    from hysim.cli.achievements import Design
    from hysim.control import PID, assess_hysteresis, assess_step, tune

    model, units = models.read(options.model)
    record = _record(options)
    actuator = designs.plant(model, options)
    within = designs.limits(options, record)
    asked = designs.task(actuator, options, within)
    template = designs.feedback(actuator, options.controller, within)

    def whole(feedback: Any) -> Any:
        return designs.whole(actuator, options.controller, within, feedback, preview=options.preview)

    untuned = whole(template or PID(kp=1.0, limits=within))
    if options.c:
        _c_code(options, untuned)  # what cannot be exported is said before the search
    wanted = designs.reference(asked, designs.rest(actuator, asked.u0), options.reference)
    tuning = None
    if options.controller != "inverse":
        tuning = tune(
            actuator, wanted.t, wanted.values, controller=template, objective=wanted.objective, limits=within,
            max_sensitivity=options.max_sensitivity, max_voltage_noise=options.max_voltage_noise,
            variations=designs.variations(actuator, options.vary_mode), transient=wanted.transient,
            u0=asked.u0 if options.reference == "step" else 0.0,
        )  # fmt: skip
    chosen = whole(tuning.controller) if tuning else untuned
    h = asked.sample_time
    return Design(
        actuator=actuator,
        controller=chosen,
        tuning=tuning,
        task=asked,
        triangle=assess_hysteresis(
            actuator, chosen, low=asked.low, high=asked.high, period=asked.period, sample_time=h, cycles=designs.CYCLES
        ),
        step=assess_step(actuator, chosen, step=asked.step, duration=asked.duration, sample_time=h, u0=asked.u0),
        file_rms=designs.file_rms(actuator, chosen, wanted, options.reference),
        fit_percent=designs.fit_percent(model, record),
        units={**units, **({} if record is None else record.units)},
    )


def _record(options: argparse.Namespace) -> "Record | None":
    from hysim.files import load

    if options.record is None:
        return None
    return load(options.record, u=records.column(options.u), y=records.column(options.y))


def _c_code(options: argparse.Namespace, controller: Any) -> "CSource":
    from hysim.control import to_c

    precision: Any = "float" if options.single else "double"
    return to_c(controller, options.sample_time, name=Path(options.c).stem, precision=precision)


def _pair(text: str) -> tuple[float, float]:
    try:
        first, second = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected two numbers with a comma between them, got {text!r}") from None
    return first, second
