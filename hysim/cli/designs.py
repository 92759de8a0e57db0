"""A design by `hysim control`: the plant, the controller before its tuning, the task of the loop, and its results.

By default the triangle is slow beside the plant, a step lasts until the slowest mode has come to rest, and the range is
the middle 80 % of the displacements that the plant reaches within the limits.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

import hysim as hs
from hysim._basics.frozen import FloatArray
from hysim._basics.prefixes import label
from hysim._basics.printing import extent, folded, quantity
from hysim.cli import models, outputs
from hysim.cli.models import DesignOptions
from hysim.cli.options import Pair, positive
from hysim.control import HysteresisAssessment, StepAssessment, as_actuator, assess_hysteresis, assess_step, driven_by
from hysim.models.model import in_brief
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


class Task(NamedTuple):
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

    actuator: hs.Actuator
    controller: Any
    tuning: hs.Tuning | None
    task: Task
    triangle: HysteresisAssessment
    step: StepAssessment
    file_rms: float
    fit_percent: float
    units: Mapping[str, str]
    reference: str
    limits_from: str | None

    @property
    def last_cycle(self) -> slice:
        return slice(-self.task.samples_per_cycle - 1, None)

    @property
    def open_tracking_rms(self) -> float:
        """Rms error of the open loop, driven by reference / secant gain, over the last cycle of the triangle."""
        return hs.metrics.rmse(self.triangle.closed.reference[self.last_cycle], self.triangle.open_y[self.last_cycle])


def designed(path: str, options: DesignOptions, exported: Callable[[Any], object]) -> Design:
    """The controller for the model in a file; `exported` is called before the search with a controller of its kind."""
    model, units = models.read(path)
    record = None if options.record is None else hs.load(options.record, u=options.u, y=options.y)
    if record is not None:
        signals_in = {name: unit for name, unit in units.items() if name in ("u", "y")}
        record = in_units(record, signals_in, str(options.record))
        units = {**units, **record.units}
    actuator, kind = plant(model, options), options.controller
    within = limits(options, record)
    todo = task(actuator, options, within)
    template = feedback(actuator, kind, within)
    made = controller(actuator, kind, within, template or hs.PID(kp=1.0, limits=within), preview=options.preview)
    exported(made)
    values, transient, objective = reference(todo, rest(actuator, todo.u0), options.reference, units.get("y"))
    low, high, period, u0, step, duration, h = todo
    t = h * np.arange(values.size)
    tuning = None
    if kind != "inverse":
        tuning = hs.tune(
            actuator, t, values, controller=template, objective=objective, limits=within,
            max_sensitivity=options.max_sensitivity, max_voltage_noise=options.max_voltage_noise,
            variations=variations(actuator, options.vary_mode), transient=transient,
            u0=u0 if options.reference == "step" else 0.0,
        )  # fmt: skip
        made = controller(actuator, kind, within, tuning.controller, preview=options.preview)
    is_file = options.reference not in ("triangle", "step")  # which have measures of their own
    rms = hs.metrics.rmse(values, hs.close_loop(actuator, made, t, values).y) if is_file else math.nan
    return Design(
        actuator=actuator,
        controller=made,
        tuning=tuning,
        task=todo,
        triangle=assess_hysteresis(actuator, made, low=low, high=high, period=period, sample_time=h, cycles=_CYCLES),
        step=assess_step(actuator, made, step=step, duration=duration, sample_time=h, u0=u0),
        file_rms=rms,
        fit_percent=fit_percent(model, record),
        units=units,
        reference=Path(options.reference).name,
        limits_from=Path(options.record).name if options.record and options.limits is None else None,
    )


def plant(model: Any, options: DesignOptions) -> hs.Actuator:
    actuator = as_actuator(model)
    stages: dict[str, Any] = {}
    if options.mode is not None:
        frequency, ratio = options.mode
        stages["vibration"] = hs.mode(2.0 * math.pi * frequency, ratio)
    if options.creep is not None:
        stages["creep"] = hs.Creep.per_decade(options.creep)
    settings = {name: vars(options)[name] for name in ("noise", "quantum", "delay") if vars(options)[name] is not None}
    if settings:
        stages["sensor"] = replace(actuator.sensor or hs.Sensor(), **settings)
    return replace(actuator, **stages)


def variations(actuator: hs.Actuator, percent: float | None) -> list[hs.Actuator]:
    if percent is None:
        return []
    if not 0.0 < percent < 100.0:
        raise ValueError(f"--vary-mode must be above 0 and below 100, got {percent}")
    frequency, ratio = _only_mode(actuator, "--vary-mode")
    gain = 1.0 if actuator.vibration is None else actuator.vibration.dc_gain
    factors = 1.0 - percent / 100.0, 1.0 + percent / 100.0
    return [replace(actuator, vibration=hs.mode(factor * frequency, ratio, gain)) for factor in factors]


def limits(options: DesignOptions, record: hs.Record | None) -> Pair | None:
    """Limits of the command: those of the options, or the extremes of the measured input."""
    if options.limits is not None:
        low, high = options.limits
        if not low < high:
            raise ValueError(f"--limits must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
        return low, high
    return None if record is None else (float(record.u.min()), float(record.u.max()))


def task(actuator: hs.Actuator, options: DesignOptions, within: Pair | None) -> Task:
    """The task of the loop; a ValueError if no option limits the range, or a number is outside its bounds."""
    h = positive("--sample-time", options.sample_time)
    low, high = options.range or _reach(actuator, within)
    if not low < high:
        raise ValueError(f"the range must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
    frequency = min(1.0 / (_SAMPLES * h), _slow(actuator)) if options.frequency is None else options.frequency
    half = max(1, round(0.5 / (positive("--frequency", frequency) * h)))
    rests = max(_SAMPLES * h, _AT_REST / _slowest_decay(actuator))
    duration = rests if options.duration is None else options.duration
    longest = max(_CYCLES * 2 * half, positive("--duration", duration) / h)
    if longest > _CYCLES * _MOST_SAMPLES:
        raise ValueError(
            f"the loop would take {longest:.2g} samples: the plant is slow beside the sample time; give --frequency "
            "and --duration, or a longer --sample-time"
        )
    step = 0.5 * (high - low) if options.step is None else options.step
    if not step or not math.isfinite(step):
        raise ValueError(f"--step must be a number that is not zero, got {step}")
    begin = low + (0.25 if step > 0.0 else 0.75) * (high - low)
    return Task(low, high, 2 * half * h, _resting_voltage(actuator, begin, within), step, duration, h)


def rest(actuator: hs.Actuator, u: float) -> float:
    """Displacement at which the plant rests at a command [unit of y]."""
    return float(replace(actuator, amplifier=None).dc_gain * actuator.level([u])[0])


def fit_percent(model: Any, record: hs.Record | None) -> float:
    """Fit of the model's free run to the record; nan without a record, or without the even times that a model needs."""
    if record is None or (needs_time(model) and (record.t is None or step_if_even(record.t) is None)):
        return math.nan
    return hs.metrics.fit_percent(record.y, free_run(model, record).y)


def in_units(record: hs.Record, units: Mapping[str, str], source: str) -> hs.Record:
    """The record in these units, where it has others; ValueError if they differ by more than a prefix."""
    other = {name: unit for name, unit in units.items() if record.units.get(name, unit) != unit}
    try:
        return record.convert(other) if other else record
    except ValueError as error:
        raise ValueError(f"{source} is not in the units of the model: {error}") from None


def reference(task: Task, rest: float, kind: str, unit: str | None) -> tuple[FloatArray, float, str]:
    """Triangle, step from rest or reference in a file [unit of y]; seconds that do not count; and the objective."""
    h = task.sample_time
    if kind == "step":
        return np.full(round(task.duration / h) + 1, rest + task.step), 0.0, "itae"
    if kind == "triangle":
        values = hs.signals.triangle(task.low, task.high, cycles=2, samples_per_cycle=task.samples_per_cycle)
        return values, task.period, "rms"
    units = {} if unit is None else {"u": unit}
    return in_units(hs.load(kind, t=0, u=1, y=1), units, kind).resample(h).u, 0.0, "rms"


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
    inverse = hs.InverseFeedforward.of(actuator)
    open_loop = hs.TrackingController(feedforward=inverse, preview=preview, limits=within)
    if kind == "inverse":
        return open_loop
    tracking = replace(open_loop, feedback=replace(tuned, limits=None))
    return tracking if kind == "tracking" else _following(tracking, actuator)


def _following(controller: hs.TrackingController, actuator: hs.Actuator) -> hs.TrackingController:
    """A controller with the plant as its model; before a mode, the reference is smoothed and known ahead."""
    if actuator.vibration is None:
        return replace(controller, model=actuator)
    frequency, ratio = _only_mode(actuator, "the controller model-following")
    return replace(
        controller,
        model=actuator,
        shaper=hs.Shaper(smoothing=_SMOOTHING * 2.0 * math.pi / frequency),
        mode_inverse=hs.ModeInverse(natural_frequency=frequency, damping_ratio=ratio),
        preview=True,
    )


def _reach(actuator: hs.Actuator, within: Pair | None) -> Pair:
    """The range that is reached at rest within the limits, less the margins."""
    span = within or (actuator.amplifier.limits if actuator.amplifier else None)
    if span is None or not np.isfinite(span).all():
        raise ValueError(
            "the range of the loop is unknown: give --range LOW,HIGH, or --limits LOW,HIGH, or --record FILE"
        )
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
            return float(brentq(excess, low, high))
    return 0.0


def _only_mode(actuator: hs.Actuator, user: str) -> tuple[float, float]:
    """Natural frequency [rad/s] and damping ratio of the only mode, which the `user` of this function needs."""
    modes = [(float(abs(pole)), float(-pole.real / abs(pole))) for pole in _poles(actuator) if pole.imag > 0.0]
    if len(modes) != 1:
        number = f"a plant with one mode, this one has {len(modes)}"
        raise ValueError(f"{user} needs {number}: give --mode FREQUENCY,DAMPING")
    return modes[0]


def _slow(actuator: hs.Actuator) -> float:
    """A frequency beside which the plant is fast [Hz]; infinite for a plant without vibration."""
    slower = {True: _SLOWER_THAN_LAG, False: _SLOWER_THAN_MODE}
    frequencies = (abs(pole) / (2.0 * math.pi * slower[pole.imag == 0.0]) for pole in _poles(actuator))
    return float(min(frequencies, default=math.inf))


def _slowest_decay(actuator: hs.Actuator) -> float:
    """The smallest decay rate of a free motion [1/s]; infinite for a plant without vibration."""
    return float(min((-pole.real for pole in _poles(actuator) if pole.real < 0.0), default=math.inf))


def document(design: Design) -> dict[str, Any]:
    triangle, reduction, task = design.triangle, design.step.reduction, design.task
    return {
        "plant": to_document(design.actuator),
        "controller": to_document(design.controller),
        "units": design.units,
        "record_fit_percent": design.fit_percent,
        "tuning": design.tuning and outputs.fields_of(design.tuning, _TUNED),
        "triangle": {
            "low": task.low, "high": task.high, "period": task.period, "cycles": _CYCLES,
            **outputs.scalars(triangle), "open_tracking_rms": design.open_tracking_rms, "stable": triangle.loop.stable,
        },
        "step": {
            "u0": task.u0, "height": task.step, "duration": task.duration,
            **outputs.scalars(reduction), "open": asdict(reduction.open), "closed": asdict(reduction.closed),
            "stable": design.step.loop.stable,
        },
        "reference_tracking_rms": design.file_rms,
        "conditions": {name: value for name, value in triangle.closed.conditions.items() if not is_dataclass(value)},
    }  # fmt: skip


def text(design: Design) -> str:
    lines = [*_head(design), *_triangle(design), *_step(design), *_conditions(design)]
    return "\n".join(part for line in lines for part in folded(line, indent=12 * " "))


def _head(design: Design) -> Iterator[str]:
    yield f"plant       {in_brief(design.actuator)}"
    yield f"controller  {in_brief(design.controller)}"
    if not math.isnan(design.fit_percent):
        yield f"record      the model fits the {_signal(design, 'y')} by {design.fit_percent:.2f} %"
    if (tuning := design.tuning) is not None:
        bounds = "within the bounds" if tuning.success else "NOT within the bounds"
        yield f"tuning      {bounds}: {tuning.message}"
        margins = f"gain {tuning.gain_margin:.4g}, phase {tuning.phase_margin:.4g} degrees"
        yield f"margins     {margins}, maximum sensitivity {tuning.max_sensitivity:.4g}"
    source = f"{design.reference}, second column" if not math.isnan(design.file_rms) else design.reference
    rms = f", tracking rms {quantity(design.file_rms, design.units.get('y', ''))}"
    yield f"reference   {_signal(design, 'y')}: {source}{rms * (not math.isnan(design.file_rms))}"
    if (limits := design.triangle.closed.conditions["limits"]) is not None:
        extremes = f", the extremes of {design.limits_from}" * (design.limits_from is not None)
        yield f"command     {_signal(design, 'u')}: {extent(limits, design.units.get('u', ''))}{extremes}"


def _signal(design: Design, name: str) -> str:
    text = label(design.units, name)
    return text[0].lower() + text[1:]


def _triangle(design: Design) -> Iterator[str]:
    result, task, y = design.triangle, design.task, design.units.get("y", "")
    driven = driven_by(result.closed)
    is_lag = result.is_lag
    reduction = result.lag_reduction_percent if is_lag else result.hysteresis_reduction_percent
    yield f"triangle    {task.low:.4g} to {quantity(task.high, y)}, {1.0 / task.period:.4g} Hz, cycle {_CYCLES}"
    yield _row(
        f"{'lag' if is_lag else 'hysteresis'} reduction",
        f"{reduction:.2f} %" if result.loop.stable else f"none: {result.loop.message}",
    )
    yield _row("width", f"open {result.open_width:.4g}, {driven} {quantity(result.closed_width, y)}")
    if not is_lag:
        yield _row(
            "width without the memory", f"open {result.open_lag_width:.4g}, {driven} {quantity(result.lag_width, y)}"
        )
    yield _row("tracking rms", f"open {design.open_tracking_rms:.4g}, {driven} {quantity(result.tracking_rms, y)}")
    yield _row("closure gap", quantity(result.closure_gap, y))


def _step(design: Design) -> Iterator[str]:
    reduction, u = design.step.reduction, design.units.get("u", "")
    height = quantity(design.task.step, design.units.get("y", ""))
    yield f"step        {height} from rest at {quantity(design.task.u0, u)}"
    if design.step.loop.message:
        yield _row("no reduction", design.step.loop.message)
    for name, value in outputs.scalars(reduction).items():
        percent = "does not exist" if math.isnan(value) else f"{value:.2f} %"
        yield _row(name.removesuffix("_percent").replace("_", " "), percent)
    for name, response in (("open", reduction.open), (driven_by(design.step.closed), reduction.closed)):
        times = f"98 % after {response.t98:.4g} s, settled after {response.settling_time:.4g} s"
        yield _row(name, f"overshoot {response.overshoot:.2f} %, {times}")


def _row(name: str, value: str) -> str:
    return f"  {name:<27}{value}"


def _conditions(design: Design) -> Iterator[str]:
    conditions, u, y = design.triangle.closed.conditions, design.units.get("u", ""), design.units.get("y", "")
    limits = "none" if conditions["limits"] is None else extent(conditions["limits"], u)
    times = ", ".join(
        f"{name.replace('_', ' ')} {conditions[name]:.4g} s" for name in ("sample_time", "delay", "preview")
    )
    noise = f"sensor noise {quantity(conditions['noise'], y)} rms (seed {conditions['seed']})"
    yield "conditions  simulated, with the model as the plant"
    yield f"            {times}, limits {limits}"
    yield f"            {noise}, quantum {quantity(conditions['sensor_quantum'], y)}"
    for name, closed in (("triangle", design.triangle.closed), ("step", design.step.closed)):
        limited = f"limited at {closed.conditions['limited_samples']} of {closed.t.size} samples"
        rms = quantity(closed.conditions["voltage_noise_rms"], u)
        yield f"            {name}: voltage {extent(closed.u, u)}, {limited}, noise {rms} rms"


def picture(design: Design) -> Any:
    """Displacement against reference in open and closed loop, and both steps against time."""
    triangle, last, units = design.triangle, design.last_cycle, {"t": "s", **design.units}
    reference = triangle.closed.reference[last]
    both = {"u": units["y"], "y": units["y"]} if "y" in units else {}
    t = design.step.closed.t
    driven = {"closed": "closed loop"}.get(driven_by(triangle.closed), "inverse")
    loops = {"open loop": triangle.open_y, driven: triangle.closed.y}
    steps = {"open loop": (t, design.step.open_y), driven: (t, design.step.closed.y)}

    def draw(canvas: Any) -> None:
        upper, lower = canvas.subplots(2)
        curves = (hs.Simulation(u=reference, y=y[last], units=both, name=name) for name, y in loops.items())
        hs.plot.loop(*curves, ax=upper)
        upper.set_xlabel("Reference" + "".join(upper.get_ylabel().partition(" [")[1:]))
        hs.plot.traces(steps, lower, units=units)

    return outputs.drawn(draw, height=6.4)
