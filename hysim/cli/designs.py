"""A design by `hysim control`: the plant, the controller before its tuning, the task of the loop, and its results.

By default the triangle is slow beside the plant, a step lasts until the slowest mode has come to rest, and the range is
the middle 80 % of the displacements that the plant reaches within the limits.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

import hysim as hs
from hysim._basics.frozen import FloatArray
from hysim._basics.prefixes import label
from hysim._basics.printing import extent, quantity, summary_text
from hysim.cli import models, outputs
from hysim.cli.models import DesignOptions
from hysim.cli.options import Pair, taken
from hysim.control import HysteresisAssessment, StepAssessment, as_actuator, assess_hysteresis, assess_step, driven_by
from hysim.models.protocols import needs_time
from hysim.models.storage import to_document
from hysim.records import step_if_even
from hysim.simulation import free_run

INVERTING = ("inverse", "tracking", "model-following")
"""Kinds of controllers that begin with the inverse of the plant."""

_CYCLES = 10  # of the triangle, of which the last one is measured
_MARGIN = 0.1  # of the reachable range, kept free at either end
_SAMPLES = 1000  # of a cycle and of a step, at least
_MOST_SAMPLES = 500_000
_SLOWER_THAN_LAG, _SLOWER_THAN_MODE = 20.0, 200.0  # periods of the slowest pole in a cycle
_AT_REST = 12.0  # of its time constants in a step
_DOUBLINGS = 40  # of a voltage, until it brackets the resting voltage
_SMOOTHING = 0.3  # of a mode's period, in which a step of the reference becomes a motion
_TUNED = ("success", "message", "objective", "max_sensitivity", "gain_margin", "phase_margin", "voltage_noise")


@dataclass(frozen=True)
class Task:
    """Task of a loop: to follow a triangle and a step [unit of y] from a voltage, with their times [s]."""

    low: float
    high: float
    period: float
    u0: float
    step: float
    duration: float
    sample_time: float

    @property
    def samples_per_cycle(self) -> int:
        return round(self.period / self.sample_time)


class Design(NamedTuple):
    """A controller, its tuning if it has gains, and its achievements."""

    controller: Any
    tuning: hs.Tuning | None
    task: Task
    triangle: HysteresisAssessment
    step: StepAssessment
    file_rms: float
    fit_percent: float
    options: DesignOptions


def designed(path: str, options: DesignOptions, exported: Callable[[Any], object]) -> Design:
    """The controller for the model in a file; `exported` is called before the search with a controller of its kind."""
    model, units = models.read_in_seconds(path)
    record, within = None, options.limits
    if options.record is not None:
        record = models.in_units(hs.load(options.record, u=options.u, y=options.y), units, options.record)
        units = {**units, **record.units}
        within = within or (float(record.u.min()), float(record.u.max()))
    actuator, kind = plant(model, options), options.controller
    todo = task(actuator, options, within)
    template = feedback(actuator, kind, within)
    made = controller(actuator, kind, within, template or hs.PID(kp=1.0, limits=within), preview=options.preview)
    exported(made)
    values, transient, objective = reference(todo, rest(actuator, todo.u0), options.reference, units.get("y"))
    t, tuning, file_rms = todo.sample_time * np.arange(values.size), None, math.nan
    if kind != "inverse":
        tuning = hs.tune(
            actuator, t, values, controller=template, objective=objective, limits=within,
            max_sensitivity=options.max_sensitivity, max_voltage_noise=options.max_voltage_noise,
            variations=variations(actuator, options.vary_mode), transient=transient,
            u0=todo.u0 if options.reference == "step" else 0.0,
        )  # fmt: skip
        made = controller(actuator, kind, within, tuning.controller, preview=options.preview)
    triangle = assess_hysteresis(actuator, made, cycles=_CYCLES, **taken(assess_hysteresis, todo))
    step = assess_step(actuator, made, **taken(assess_step, todo))
    triangle = replace(triangle, closed=replace(triangle.closed, units=units))
    step = replace(step, closed=replace(step.closed, units=units))
    if options.reference not in ("triangle", "step"):  # which have measures of their own
        file_rms = hs.metrics.rmse(values, hs.close_loop(actuator, made, t, values).y)
    return Design(made, tuning, todo, triangle, step, file_rms, fit_percent(model, record), options)


def plant(model: Any, options: DesignOptions) -> hs.Actuator:
    actuator = as_actuator(model)
    if options.mode is not None:
        frequency, ratio = options.mode
        actuator = replace(actuator, vibration=hs.mode(2.0 * math.pi * frequency, ratio))
    if options.creep is not None:
        actuator = replace(actuator, creep=hs.Creep.per_decade(options.creep))
    sensor = {name: value for name in ("noise", "quantum", "delay") if (value := vars(options)[name]) is not None}
    return replace(actuator, sensor=replace(actuator.sensor or hs.Sensor(), **sensor)) if sensor else actuator


def variations(actuator: hs.Actuator, percent: float | None) -> list[hs.Actuator]:
    if percent is None:
        return []
    frequency, ratio = _only_mode(actuator, "--vary-mode")
    gain = actuator.vibration.dc_gain if actuator.vibration else 1.0
    factors = 1.0 - percent / 100.0, 1.0 + percent / 100.0
    return [replace(actuator, vibration=hs.mode(factor * frequency, ratio, gain)) for factor in factors]


def task(actuator: hs.Actuator, options: DesignOptions, within: Pair | None) -> Task:
    """The task of the loop; a ValueError if the range is unknown, the step is zero, or the loop takes too long."""
    h, poles = options.sample_time, _poles(actuator)
    low, high = options.range or _reach(actuator, within)
    periods = [2.0 * math.pi / abs(pole) * (_SLOWER_THAN_MODE if pole.imag else _SLOWER_THAN_LAG) for pole in poles]
    period = 1.0 / options.frequency if options.frequency else float(max([_SAMPLES * h, *periods]))
    decays = [_AT_REST / -pole.real for pole in poles if pole.real < 0.0]
    duration = options.duration or float(max([_SAMPLES * h, *decays]))
    longest = max(_CYCLES * period, duration) / h
    if longest > _CYCLES * _MOST_SAMPLES:
        advice = "give --frequency and --duration, or a longer --sample-time"
        reason = "the plant is too slow for the sample time"
        raise ValueError(f"the loop would take {longest:.2g} samples: {reason}; {advice}")
    step = 0.5 * (high - low) if options.step is None else options.step
    if not step or not math.isfinite(step):
        raise ValueError(f"--step must be a number that is not zero, got {step}")
    begin = low + (0.25 if step > 0.0 else 0.75) * (high - low)
    half = max(1, round(0.5 * period / h))
    return Task(low, high, 2 * half * h, _resting_voltage(actuator, begin, within), step, duration, h)


def rest(actuator: hs.Actuator, u: float) -> float:
    """Displacement at which the plant rests at a command [unit of y]."""
    return float(replace(actuator, amplifier=None).dc_gain * actuator.level([u])[0])


def fit_percent(model: Any, record: hs.Record | None) -> float:
    """Fit of the model's free run to the record; nan without a record, or without the even times that a model needs."""
    if record is None or (needs_time(model) and (record.t is None or step_if_even(record.t) is None)):
        return math.nan
    return hs.metrics.fit_percent(record.y, free_run(model, record).y)


def reference(task: Task, rest: float, kind: str, unit: str | None) -> tuple[FloatArray, float, str]:
    """Triangle, step from rest or reference in a file [unit of y]; seconds that do not count; and the objective."""
    h = task.sample_time
    if kind == "step":
        return np.full(round(task.duration / h) + 1, rest + task.step), 0.0, "itae"
    if kind == "triangle":
        values = hs.signals.triangle(task.low, task.high, cycles=2, samples_per_cycle=task.samples_per_cycle)
        return values, task.period, "rms"
    units = {"t": "s"} | ({} if unit is None else {"u": unit})
    return models.in_units(hs.load(kind, t=0, u=1, y=1), units, kind).resample(h).u, 0.0, "rms"


def feedback(actuator: hs.Actuator, kind: str, within: Pair | None) -> hs.PID | hs.TrackingController | None:
    """Feedback before its tuning, without the inverse, which knows the plant exactly; None for the default."""
    if kind == "pid":
        return None
    if kind != "notch":
        return hs.PID(ki=1.0, limits=within)
    frequency, ratio = _only_mode(actuator, "the controller notch")
    notch = hs.Notch(natural_frequency=frequency, damping_ratio=ratio)
    return hs.TrackingController(feedback=hs.PID(ki=1.0), notch=notch, limits=within)


def controller(actuator: hs.Actuator, kind: str, within: Pair | None, tuned: Any, *, preview: bool) -> Any:
    """The controller of a kind, with a tuned feedback; TypeError or ValueError if plant or options do not allow it."""
    if kind not in INVERTING:
        if preview:
            raise ValueError(f"--preview is for {', '.join(INVERTING)}: the controller {kind} has no inverse")
        return tuned
    stages: dict[str, Any] = {"feedforward": hs.InverseFeedforward.of(actuator), "preview": preview}
    if kind != "inverse":
        stages["feedback"] = replace(tuned, limits=None)
    if kind == "model-following":
        stages["model"] = actuator
    if kind == "model-following" and actuator.vibration is not None:
        frequency, ratio = _only_mode(actuator, "the controller model-following")
        stages["mode_inverse"] = hs.ModeInverse(natural_frequency=frequency, damping_ratio=ratio)
        stages["shaper"] = hs.Shaper(smoothing=_SMOOTHING * 2.0 * math.pi / frequency)
        stages["preview"] = True  # before a mode, the reference is smoothed and known ahead
    return hs.TrackingController(limits=within, **stages)


def _reach(actuator: hs.Actuator, within: Pair | None) -> Pair:
    """The range that is reached at rest within the limits, less the margins."""
    span = within or (actuator.amplifier.limits if actuator.amplifier else None)
    if span is None or not np.isfinite(span).all():
        advice = "give --range LOW,HIGH, or --limits LOW,HIGH, or --record FILE"
        raise ValueError(f"the range of the loop is unknown: {advice}")
    u = hs.signals.triangle(float(span[0]), float(span[1]), cycles=2, samples_per_cycle=2 * _SAMPLES)
    y = replace(actuator, amplifier=None).dc_gain * actuator.level(u)[-2 * _SAMPLES :]
    margin = _MARGIN * float(np.ptp(y))
    return float(y.min()) + margin, float(y.max()) - margin


def _poles(actuator: hs.Actuator) -> Any:
    return np.empty(0) if actuator.vibration is None else actuator.vibration.poles


def _resting_voltage(actuator: hs.Actuator, displacement: float, within: Pair | None) -> float:
    """The command at which the plant rests at a displacement; 0 if there is no such command."""

    def excess(u: float) -> float:
        return rest(actuator, u) - displacement

    for low, high in [within] if within else ((-(2.0**k), 2.0**k) for k in range(_DOUBLINGS)):
        if excess(low) * excess(high) <= 0.0:
            return float(scipy.optimize.brentq(excess, low, high))
    return 0.0


def _only_mode(actuator: hs.Actuator, user: str) -> tuple[float, float]:
    """Natural frequency [rad/s] and damping ratio of the only mode, which the `user` of this function needs."""
    modes = [(float(abs(pole)), float(-pole.real / abs(pole))) for pole in _poles(actuator) if pole.imag > 0.0]
    if len(modes) != 1:
        number = f"a plant with one mode, this one has {len(modes)}"
        raise ValueError(f"{user} needs {number}: give --mode FREQUENCY,DAMPING")
    return modes[0]


def document(design: Design) -> dict[str, Any]:
    triangle, task, closed = design.triangle, design.task, design.triangle.closed
    return {
        "plant": to_document(closed.conditions["plant"]),
        "controller": to_document(design.controller),
        "units": closed.units,
        "record_fit_percent": design.fit_percent,
        "tuning": design.tuning and outputs.fields_of(design.tuning, _TUNED),
        "triangle": {
            **outputs.fields_of(task, ("low", "high", "period")), "cycles": _CYCLES,
            **outputs.scalars(triangle), "stable": triangle.loop.stable,
        },
        "step": {
            "u0": task.u0, "height": task.step, "duration": task.duration,
            **asdict(design.step.reduction), "stable": design.step.loop.stable,
        },
        "reference_tracking_rms": design.file_rms,
        "conditions": {name: value for name, value in closed.conditions.items() if not is_dataclass(value)},
    }  # fmt: skip


def text(design: Design) -> str:
    """The printed design: the task of the loop, the tuning, the results and their conditions."""
    options, task, closed, units = design.options, design.task, design.triangle.closed, design.triangle.closed.units
    u, y = (units.get(name, "") for name in "uy")
    driven, stroke = (label(units, name)[0].lower() + label(units, name)[1:] for name in "uy")
    limits = closed.conditions["limits"]
    command = "no limits" if limits is None else extent(limits, u)
    if options.record and not options.limits:
        command += f", the extremes of {Path(options.record).name}"
    followed = f", second column, tracking rms {quantity(design.file_rms, y)}"
    fit = f"the model fits the {stroke} by {design.fit_percent:.2f} %"
    rows = {
        "record": "" if math.isnan(design.fit_percent) else fit,
        "reference": f"{stroke}: {Path(options.reference).name}{'' if math.isnan(design.file_rms) else followed}",
        "command": f"{driven}: {command}",
        "triangle": f"{extent((task.low, task.high), y)}, {1.0 / task.period:.4g} Hz, cycle {_CYCLES}",
        "step": f"{quantity(task.step, y)} from rest at {quantity(task.u0, u)}",
    }
    results = filter(None, (design.tuning, design.triangle, design.step, closed))
    return "\n".join([summary_text(["Design, simulated with the model as the plant"], rows), *map(str, results)])


def picture(design: Design) -> Any:
    """Displacement against reference in open and closed loop, and both steps against time."""
    triangle, units = design.triangle, {"t": "s", **design.triangle.closed.units}
    last = slice(-design.task.samples_per_cycle - 1, None)
    both = {"u": units["y"], "y": units["y"]} if "y" in units else {}
    t = design.step.closed.t
    driven = {"closed": "closed loop"}.get(driven_by(triangle.closed), "inverse")
    loops = {"open loop": triangle.open_y, driven: triangle.closed.y}
    steps = {"open loop": (t, design.step.open_y), driven: (t, design.step.closed.y)}

    def draw(canvas: Any) -> None:
        upper, lower = canvas.subplots(2)
        reference = triangle.closed.reference[last]
        curves = (hs.Simulation(u=reference, y=y[last], units=both, name=name) for name, y in loops.items())
        hs.plot.loop(*curves, ax=upper)
        upper.set_xlabel("Reference" + "".join(upper.get_ylabel().partition(" [")[1:]))
        hs.plot.traces(steps, lower, units=units)

    return outputs.drawn(draw, height=6.4)
