"""Results of a controller's design, as `hysim control` prints, writes and draws them."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from hysim._prefixes import label
from hysim._printing import extent, folded, quantity
from hysim.cli import outputs
from hysim.cli.designs import CYCLES, Task
from hysim.control import HysteresisAssessment, StepAssessment, Tuning, driven_by
from hysim.metrics import rmse
from hysim.models.model import in_brief
from hysim.models.storage import to_document
from hysim.plants.actuator import Actuator
from hysim.simulation import Simulation

if TYPE_CHECKING:
    from hysim.plot import Figure

_TUNED = ("success", "message", "objective", "max_sensitivity", "gain_margin", "phase_margin", "voltage_noise")


class Design(NamedTuple):
    """A controller, its tuning if it has gains, and its achievements."""

    actuator: Actuator
    controller: Any
    tuning: Tuning | None
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
        """Samples of the triangle's last cycle."""
        return slice(-self.task.samples_per_cycle - 1, None)

    @property
    def open_tracking_rms(self) -> float:
        """Rms error of the open loop, driven by reference / secant gain, over the last cycle of the triangle."""
        return rmse(self.triangle.closed.reference[self.last_cycle], self.triangle.open_y[self.last_cycle])


def document(design: Design) -> dict[str, Any]:
    """All results, for JSON."""
    triangle, reduction, task = design.triangle, design.step.reduction, design.task
    return {
        "plant": to_document(design.actuator),
        "controller": to_document(design.controller),
        "units": design.units,
        "record_fit_percent": design.fit_percent,
        "tuning": design.tuning and outputs.fields_of(design.tuning, _TUNED),
        "triangle": {
            "low": task.low, "high": task.high, "period": task.period, "cycles": CYCLES,
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
    """All results, in words."""
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
    """The quantity of the input or the output with its unit."""
    text = label(design.units, name)
    return text[0].lower() + text[1:]


def _triangle(design: Design) -> Iterator[str]:
    result, task, y = design.triangle, design.task, design.units.get("y", "")
    driven = driven_by(result.closed)
    is_lag = result.is_lag
    reduction = result.lag_reduction_percent if is_lag else result.hysteresis_reduction_percent
    yield f"triangle    {task.low:.4g} to {quantity(task.high, y)}, {1.0 / task.period:.4g} Hz, cycle {CYCLES}"
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
    """The conditions of all results, with the model as the plant."""
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


def picture(design: Design) -> "Figure":
    """Displacement against reference in open and closed loop, and both steps against time."""
    from hysim import plot

    triangle, last, units = design.triangle, design.last_cycle, {"t": "s", **design.units}
    reference = triangle.closed.reference[last]
    both = {"u": units["y"], "y": units["y"]} if "y" in units else {}
    t = design.step.closed.t
    driven = {"closed": "closed loop"}.get(driven_by(triangle.closed), "inverse")
    loops = {"open loop": triangle.open_y, driven: triangle.closed.y}
    steps = {"open loop": (t, design.step.open_y), driven: (t, design.step.closed.y)}

    def draw(canvas: "Figure") -> None:
        upper, lower = canvas.subplots(2)
        curves = (Simulation(u=reference, y=y[last], units=both, name=name) for name, y in loops.items())
        plot.loop(*curves, ax=upper)
        upper.set_xlabel("Reference" + "".join(upper.get_ylabel().partition(" [")[1:]))
        plot.traces(steps, lower, units=units)

    return outputs.drawn(draw, height=6.4)
