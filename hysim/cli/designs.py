"""Parts of a design by `hysim control`: the plant, the controller before its tuning, and the task of the loop.

By default the triangle is slow beside the plant, a step lasts until the slowest mode has come to rest, and the range is
the middle 80 % of the displacements that the plant reaches within the limits.
"""

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from hysim import metrics, signals
from hysim._frozen import FloatArray, read_only
from hysim.cli.options import positive
from hysim.control import (
    PID,
    InverseFeedforward,
    ModeInverse,
    Notch,
    Shaper,
    TrackingController,
    as_actuator,
    close_loop,
)
from hysim.files import load
from hysim.models.protocols import needs_time
from hysim.plants.actuator import Actuator
from hysim.plants.creep import Creep
from hysim.plants.sensor import Sensor
from hysim.plants.state_space import mode
from hysim.records import Record, step_if_even
from hysim.simulation import free_run

Pair = tuple[float, float]

INVERTING = ("inverse", "tracking", "model-following")
"""Kinds of controllers that begin with the inverse of the plant."""

CYCLES = 10
"""Number of cycles of the triangle, of which the last one is measured."""

_MARGIN = 0.1  # of the reachable range, kept free at either end
_SAMPLES = 1000  # of a cycle and of a step, at least
_MOST_SAMPLES = 500_000
_SLOWER_THAN_LAG, _SLOWER_THAN_MODE = 20.0, 200.0  # periods of the slowest pole in a cycle
_AT_REST = 12.0  # of its time constants in a step
_DOUBLINGS = 40  # of a voltage, until it brackets the resting voltage
_SMOOTHING = 0.3  # of a mode's period, in which a step of the reference becomes a motion


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
        """Samples of a cycle of the triangle."""
        return round(self.period / self.sample_time)


def plant(model: Any, options: argparse.Namespace) -> Actuator:
    """The model as an actuator, with the stages that the options add or replace."""
    actuator = as_actuator(model)
    stages: dict[str, Any] = {}
    if options.mode is not None:
        frequency, ratio = options.mode
        stages["vibration"] = mode(2.0 * math.pi * frequency, ratio)
    if options.creep is not None:
        stages["creep"] = Creep.per_decade(options.creep)
    settings = {name: vars(options)[name] for name in ("noise", "quantum", "delay") if vars(options)[name] is not None}
    if settings:
        stages["sensor"] = replace(actuator.sensor or Sensor(), **settings)
    return replace(actuator, **stages)


def variations(actuator: Actuator, percent: float | None) -> list[Actuator]:
    """The plant with its only mode at a lower and at a higher frequency."""
    if percent is None:
        return []
    if not 0.0 < percent < 100.0:
        raise ValueError(f"--vary-mode must be above 0 and below 100, got {percent}")
    frequency, ratio = _only_mode(actuator, "--vary-mode")
    gain = 1.0 if actuator.vibration is None else actuator.vibration.dc_gain
    factors = 1.0 - percent / 100.0, 1.0 + percent / 100.0
    return [replace(actuator, vibration=mode(factor * frequency, ratio, gain)) for factor in factors]


def limits(options: argparse.Namespace, record: Record | None) -> Pair | None:
    """Limits of the command: those of the options, or the extremes of the measured input."""
    if options.limits is not None:
        low, high = options.limits
        if not low < high:
            raise ValueError(f"--limits must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
        return low, high
    return None if record is None else (float(record.u.min()), float(record.u.max()))


def task(actuator: Actuator, options: argparse.Namespace, within: Pair | None) -> Task:
    """The task of the loop; a ValueError if no option limits the range, or a number is outside its bounds."""
    h = positive("--sample-time", options.sample_time)
    low, high = options.range or _reach(actuator, within)
    if not low < high:
        raise ValueError(f"the range must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
    frequency = min(1.0 / (_SAMPLES * h), _slow(actuator)) if options.frequency is None else options.frequency
    half = max(1, round(0.5 / (positive("--frequency", frequency) * h)))
    rests = max(_SAMPLES * h, _AT_REST / _slowest_decay(actuator))
    duration = rests if options.duration is None else options.duration
    longest = max(CYCLES * 2 * half, positive("--duration", duration) / h)
    if longest > CYCLES * _MOST_SAMPLES:
        raise ValueError(
            f"the loop would take {longest:.2g} samples: the plant is slow beside the sample time; give --frequency "
            "and --duration, or a longer --sample-time"
        )
    step = 0.5 * (high - low) if options.step is None else options.step
    if not step or not math.isfinite(step):
        raise ValueError(f"--step must be a number that is not zero, got {step}")
    begin = low + (0.25 if step > 0.0 else 0.75) * (high - low)
    return Task(low, high, 2 * half * h, _resting_voltage(actuator, begin, within), step, duration, h)


def rest(actuator: Actuator, u: float) -> float:
    """Displacement at which the plant rests at a command [unit of y]."""
    return float(replace(actuator, amplifier=None).dc_gain * actuator.level([u])[0])


def fit_percent(model: Any, record: Record | None) -> float:
    """Fit of the model's free run to the record; nan without a record, or without the even times that a model needs."""
    if record is None or (needs_time(model) and (record.t is None or step_if_even(record.t) is None)):
        return math.nan
    return metrics.fit_percent(record.y, free_run(model, record).y)


def in_units(record: Record, units: Mapping[str, str], source: str) -> Record:
    """The record in these units, where it has others; ValueError if they differ by more than a prefix."""
    other = {name: unit for name, unit in units.items() if record.units.get(name, unit) != unit}
    try:
        return record.convert(other) if other else record
    except ValueError as error:
        raise ValueError(f"{source} is not in the units of the model: {error}") from None


def file_rms(actuator: Actuator, controller: Any, reference: "Reference", kind: str) -> float:
    """Tracking rms along the reference in a file; nan for the triangle and the step, which have other measures."""
    if kind in ("triangle", "step"):
        return math.nan
    return metrics.rmse(reference.values, close_loop(actuator, controller, reference.t, reference.values).y)


class Reference(NamedTuple):
    """Reference of the tuning: evenly sampled values, the first seconds that do not count, and the objective."""

    sample_time: float
    values: FloatArray
    transient: float
    objective: str

    @property
    def t(self) -> FloatArray:
        """Times of the values [s]."""
        return read_only(self.sample_time * np.arange(self.values.size))


def reference(task: Task, rest: float, kind: str, unit: str | None) -> Reference:
    """The triangle, the step from a displacement at rest, or the reference in a file, in the unit of the output."""
    h = task.sample_time
    if kind == "step":
        return Reference(h, np.full(round(task.duration / h) + 1, rest + task.step), 0.0, "itae")
    if kind == "triangle":
        values = signals.triangle(task.low, task.high, cycles=2, samples_per_cycle=task.samples_per_cycle)
        return Reference(h, values, task.period, "rms")
    units = {} if unit is None else {"u": unit}
    return Reference(h, in_units(load(kind, t=0, u=1, y=1), units, kind).resample(h).u, 0.0, "rms")


def feedback(actuator: Actuator, kind: str, within: Pair | None) -> PID | TrackingController | None:
    """The feedback before its tuning, whose nonzero gains are free; None for the default of `tune`.

    It is tuned without the inverse: the inverse knows the simulated plant exactly, and would leave it nothing to do.
    """
    if kind == "pid":
        return None
    if kind != "notch":
        return PID(ki=1.0, limits=within)
    frequency, ratio = _only_mode(actuator, "the controller notch")
    notch = Notch(natural_frequency=frequency, damping_ratio=ratio)
    return TrackingController(feedback=PID(ki=1.0), notch=notch, limits=within)


def controller(actuator: Actuator, kind: str, within: Pair | None, tuned: Any, *, preview: bool) -> Any:
    """The controller of a kind, with a tuned feedback.

    A TypeError or ValueError is raised if the plant lacks the inverse or the single mode that the kind needs, or a
    preview has no inverse to serve.
    """
    if kind not in INVERTING:
        if preview:
            raise ValueError(f"--preview is for {', '.join(INVERTING)}: the controller {kind} has no inverse")
        return tuned
    inverse = InverseFeedforward.of(actuator)
    open_loop = TrackingController(feedforward=inverse, preview=preview, limits=within)
    if kind == "inverse":
        return open_loop
    tracking = replace(open_loop, feedback=replace(tuned, limits=None))
    return tracking if kind == "tracking" else _following(tracking, actuator)


def _following(controller: TrackingController, actuator: Actuator) -> TrackingController:
    """A controller with the plant as its model; before a mode, the reference is smoothed and known ahead."""
    if actuator.vibration is None:
        return replace(controller, model=actuator)
    frequency, ratio = _only_mode(actuator, "the controller model-following")
    return replace(
        controller,
        model=actuator,
        shaper=Shaper(smoothing=_SMOOTHING * 2.0 * math.pi / frequency),
        mode_inverse=ModeInverse(natural_frequency=frequency, damping_ratio=ratio),
        preview=True,
    )


def _reach(actuator: Actuator, within: Pair | None) -> Pair:
    """The range that is reached at rest within the limits, less the margins."""
    span = within or (actuator.amplifier.limits if actuator.amplifier else None)
    if span is None or not np.isfinite(span).all():
        raise ValueError(
            "the range of the loop is unknown: give --range LOW,HIGH, or --limits LOW,HIGH, or --record FILE"
        )
    u = signals.triangle(float(span[0]), float(span[1]), cycles=2, samples_per_cycle=2 * _SAMPLES)
    y = replace(actuator, amplifier=None).dc_gain * actuator.level(u)[-2 * _SAMPLES :]
    margin = _MARGIN * float(np.ptp(y))
    return float(y.min()) + margin, float(y.max()) - margin


def _poles(actuator: Actuator) -> Any:
    return np.empty(0) if actuator.vibration is None else actuator.vibration.poles


def _resting_voltage(actuator: Actuator, displacement: float, within: Pair | None) -> float:
    """The command at which the plant rests at a displacement; 0 if there is no such command."""

    def excess(u: float) -> float:
        return rest(actuator, u) - displacement

    for low, high in [within] if within else ((-(2.0**k), 2.0**k) for k in range(_DOUBLINGS)):
        if excess(low) * excess(high) <= 0.0:
            return float(brentq(excess, low, high))
    return 0.0


def _only_mode(actuator: Actuator, user: str) -> tuple[float, float]:
    """Natural frequency [rad/s] and damping ratio of the only mode, which the `user` of this function needs."""
    modes = [(float(abs(pole)), float(-pole.real / abs(pole))) for pole in _poles(actuator) if pole.imag > 0.0]
    if len(modes) != 1:
        number = f"a plant with one mode, this one has {len(modes)}"
        raise ValueError(f"{user} needs {number}: give --mode FREQUENCY,DAMPING")
    return modes[0]


def _slow(actuator: Actuator) -> float:
    """A frequency beside which the plant is fast [Hz]; infinite for a plant without vibration."""
    slower = {True: _SLOWER_THAN_LAG, False: _SLOWER_THAN_MODE}
    frequencies = (abs(pole) / (2.0 * math.pi * slower[pole.imag == 0.0]) for pole in _poles(actuator))
    return float(min(frequencies, default=math.inf))


def _slowest_decay(actuator: Actuator) -> float:
    """The smallest decay rate of a free motion [1/s]; infinite for a plant without vibration."""
    return float(min((-pole.real for pole in _poles(actuator) if pole.real < 0.0), default=math.inf))
