"""What `hysim control` designs with: the plant, the template of its controller, and what the loop is asked to follow.

Unless they are given, the triangle is slow beside the plant, a step lasts until the slowest mode has come to rest, and
the range is what the plant reaches within the limits, a tenth of it left free at either end.
"""

import argparse
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from hysim import metrics, signals
from hysim._frozen import FloatArray, read_only
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
from hysim.models.actuator import Actuator
from hysim.models.creep import Creep
from hysim.models.modes import mode
from hysim.models.protocols import needs_time
from hysim.models.sensor import Sensor
from hysim.records import Record

Pair = tuple[float, float]

INVERTING = ("inverse", "tracking", "model-following")
"""Kinds of controllers that begin with the inverse of the plant."""

CYCLES = 10
"""Of the triangle, the last of which is measured."""

_MARGIN = 0.1  # of what is reached, left free at either end
_SAMPLES = 1000  # of a cycle and of a step, at least
_MOST_SAMPLES = 500_000
_SLOWER_THAN_LAG, _SLOWER_THAN_MODE = 20.0, 200.0  # periods of the slowest pole in a cycle
_AT_REST = 12.0  # of its time constants in a step
_DOUBLINGS = 40  # of a voltage, until it brackets the one that is looked for
_SMOOTHING = 0.3  # of a mode's period, in which a step of the reference becomes a motion


class Task(NamedTuple):
    """What a loop is asked to follow: a triangle and a step [unit of y] from a voltage, with their times [s]."""

    low: float
    high: float
    period: float
    u0: float
    step: float
    duration: float
    sample_time: float

    @property
    def samples_per_cycle(self) -> int:
        """Of the triangle."""
        return round(self.period / self.sample_time)


def plant(model: Any, options: argparse.Namespace) -> Actuator:
    """The model as an actuator, with the stages that the options add to it or put in place of its own."""
    actuator = as_actuator(model)
    stages: dict[str, Any] = {}
    if options.mode is not None:
        frequency, ratio = options.mode
        stages["vibration"] = mode(2.0 * math.pi * frequency, ratio)
    if options.creep is not None:
        stages["creep"] = Creep.per_decade(options.creep)
    given = {name: getattr(options, name) for name in ("noise", "quantum", "delay")}
    if sensed := {name: value for name, value in given.items() if value is not None}:
        stages["sensor"] = replace(actuator.sensor or Sensor(), **sensed)
    return replace(actuator, **stages)


def variations(actuator: Actuator, percent: float | None) -> list[Actuator]:
    """The plant with its only mode lower and higher."""
    if percent is None:
        return []
    if not 0.0 < percent < 100.0:
        raise ValueError(f"--vary-mode must be above 0 and below 100, got {percent}")
    frequency, ratio = _only_mode(actuator, "--vary-mode")
    gain = 1.0 if actuator.vibration is None else actuator.vibration.dc_gain
    factors = 1.0 - percent / 100.0, 1.0 + percent / 100.0
    return [replace(actuator, vibration=mode(factor * frequency, ratio, gain)) for factor in factors]


def limits(options: argparse.Namespace, record: Record | None) -> Pair | None:
    """The controller's: those given, or the extremes of the measured input."""
    if options.limits is not None:
        low, high = options.limits
        if not low < high:
            raise ValueError(f"--limits must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
        return low, high
    return None if record is None else (float(record.u.min()), float(record.u.max()))


def task(actuator: Actuator, options: argparse.Namespace, within: Pair | None) -> Task:
    """What the loop is asked to follow.

    Raises
    ------
    ValueError
        If nothing says how far, or a number is outside its range.
    """
    h = _positive("--sample-time", options.sample_time)
    low, high = options.range or _reach(actuator, within)
    if not low < high:
        raise ValueError(f"the range must be LOW,HIGH with LOW below HIGH, got {low:g},{high:g}")
    frequency = min(1.0 / (_SAMPLES * h), _slow(actuator)) if options.frequency is None else options.frequency
    half = max(1, round(0.5 / (_positive("--frequency", frequency) * h)))
    rests = max(_SAMPLES * h, _AT_REST / _slowest_decay(actuator))
    duration = rests if options.duration is None else options.duration
    longest = max(CYCLES * 2 * half, _positive("--duration", duration) / h)
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
    """Where the plant is at rest at a command."""
    return float(replace(actuator, amplifier=None).dc_gain * actuator.level([u])[0])


def fit_percent(model: Any, record: Record | None) -> float:
    """Of the model's free run along the record; nan without one, or for a model that takes time."""
    if record is None or needs_time(model):
        return math.nan
    return metrics.fit_percent(record.y, model.response(record.u))


def file_rms(actuator: Actuator, controller: Any, wanted: "Reference", kind: str) -> float:
    """Tracking rms along the reference of a file; nan for the others, which are measured by themselves."""
    if kind in ("triangle", "step"):
        return math.nan
    return metrics.rmse(wanted.values, close_loop(actuator, controller, wanted.t, wanted.values).y)


class Reference(NamedTuple):
    """What a controller is tuned for: times [s], values, what of them does not count [s], and the objective."""

    t: FloatArray
    values: FloatArray
    transient: float
    objective: str


def reference(asked: Task, rest: float, kind: str) -> Reference:
    """The triangle, the step from a displacement at rest, or what a file holds."""
    h = asked.sample_time
    if kind == "step":
        samples = round(asked.duration / h) + 1
        return _evenly(np.full(samples, rest + asked.step), h, 0.0, "itae")
    if kind == "triangle":
        values = signals.triangle(asked.low, asked.high, cycles=2, samples_per_cycle=asked.samples_per_cycle)
        return _evenly(values, h, asked.period, "rms")
    return _evenly(load(kind, t=0, u=1, y=1).resample(h).u, h, 0.0, "rms")


def _evenly(values: FloatArray, sample_time: float, transient: float, objective: str) -> Reference:
    return Reference(read_only(sample_time * np.arange(values.size)), values, transient, objective)


def feedback(actuator: Actuator, kind: str, within: Pair | None) -> PID | TrackingController | None:
    """What of a controller is tuned, with the gains that are not zero free; None for what `tune` takes by itself.

    What is put before it knows the plant, so that a simulation finds no use in feedback beside it: it is tuned alone.
    """
    if kind == "pid":
        return None
    if kind != "notch":
        return PID(ki=1.0, limits=within)
    frequency, ratio = _only_mode(actuator, "the controller notch")
    notch = Notch(natural_frequency=frequency, damping_ratio=ratio)
    return TrackingController(feedback=PID(ki=1.0), notch=notch, limits=within)


def whole(actuator: Actuator, kind: str, within: Pair | None, tuned: Any, *, preview: bool) -> Any:
    """The controller of a kind, with a feedback that is tuned.

    Raises
    ------
    TypeError, ValueError
        If the plant has no inverse where one is needed, or more than one mode; or a preview is wanted without one.
    """
    if kind not in INVERTING:
        if preview:
            raise ValueError(f"--preview is for {', '.join(INVERTING)}: the controller {kind} has no inverse")
        return tuned
    inverse = InverseFeedforward.of(actuator)
    controller = TrackingController(feedforward=inverse, preview=preview, limits=within)
    if kind == "inverse":
        return controller
    controller = replace(controller, feedback=replace(tuned, limits=None))
    return controller if kind == "tracking" else _following(controller, actuator)


def _following(controller: TrackingController, actuator: Actuator) -> TrackingController:
    """With the plant as its model; before a mode the reference becomes a smooth motion that is known ahead."""
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
    """What is reached at rest within the limits, the margins left out."""
    span = within or (actuator.amplifier.limits if actuator.amplifier else None)
    if span is None or not np.isfinite(span).all():
        raise ValueError(
            "nothing says how far the loop shall go: give --range LOW,HIGH, or --limits LOW,HIGH, or --record FILE"
        )
    u = signals.triangle(float(span[0]), float(span[1]), cycles=2, samples_per_cycle=2 * _SAMPLES)
    behind = replace(actuator, amplifier=None).dc_gain
    y = behind * actuator.level(u)[-2 * _SAMPLES :]
    margin = _MARGIN * float(np.ptp(y))
    return float(y.min()) + margin, float(y.max()) - margin


def _modes(actuator: Actuator) -> list[tuple[float, float]]:
    """Natural frequencies [rad/s] and damping ratios."""
    poles = np.empty(0) if actuator.vibration is None else actuator.vibration.poles
    return [(float(abs(pole)), float(-pole.real / abs(pole))) for pole in poles if pole.imag > 0.0]


def _resting_voltage(actuator: Actuator, displacement: float, within: Pair | None) -> float:
    """The command at which the plant is at rest at a displacement; none where there is no such command."""

    def excess(u: float) -> float:
        return rest(actuator, u) - displacement

    for low, high in [within] if within else ((-(2.0**k), 2.0**k) for k in range(_DOUBLINGS)):
        if excess(low) * excess(high) <= 0.0:
            return float(brentq(excess, low, high))
    return 0.0


def _only_mode(actuator: Actuator, what: str) -> tuple[float, float]:
    found = _modes(actuator)
    if len(found) != 1:
        raise ValueError(
            f"{what} needs a plant with one mode, this one has {len(found)}: give --mode FREQUENCY,DAMPING"
        )
    return found[0]


def _slow(actuator: Actuator) -> float:
    """A frequency beside which the plant is fast [Hz]; infinite where nothing moves."""
    poles = np.empty(0) if actuator.vibration is None else actuator.vibration.poles
    slower = np.where(poles.imag == 0.0, _SLOWER_THAN_LAG, _SLOWER_THAN_MODE)
    return float((np.abs(poles) / (2.0 * math.pi * slower)).min()) if poles.size else math.inf


def _slowest_decay(actuator: Actuator) -> float:
    """The least rate at which a free motion dies out [1/s]; infinite where nothing moves."""
    poles = np.empty(0) if actuator.vibration is None else actuator.vibration.poles
    rates = -poles.real[poles.real < 0.0]
    return float(rates.min()) if rates.size else math.inf


def _positive(name: str, value: float) -> float:
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} must be positive, got {value:g}")
    return value
