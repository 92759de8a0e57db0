"""What `hysim control` prints, writes and draws of a controller that it designed."""

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hysim._words import LETTERS, extent, quantity
from hysim.cli.designs import CYCLES, Task
from hysim.cli.outputs import Curve
from hysim.control import HysteresisAssessment, StepAssessment, Tuning
from hysim.metrics import StepMetrics, rmse
from hysim.models.actuator import Actuator
from hysim.models.model import in_brief
from hysim.models.storage import to_document, to_json

if TYPE_CHECKING:
    from hysim.plot import Figure

_TUNED = ("success", "message", "objective", "max_sensitivity", "gain_margin", "phase_margin", "voltage_noise")
_TRIANGLE = (
    "hysteresis_reduction_percent", "lag_reduction_percent", "open_width", "closed_width", "open_lag_width",
    "lag_width", "tracking_rms", "closure_gap", "secant_gain",
)  # fmt: skip
_STEP = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")


class Design(NamedTuple):
    """A controller, how it was tuned if it has gains, and what it achieves."""

    actuator: Actuator
    controller: Any
    tuning: Tuning | None
    task: Task
    triangle: HysteresisAssessment
    step: StepAssessment
    file_rms: float
    fit_percent: float
    units: Mapping[str, str]

    @property
    def open_tracking_rms(self) -> float:
        """Over the last cycle of the triangle, driven by reference / secant gain."""
        last = slice(-self.task.samples_per_cycle - 1, None)
        return rmse(self.triangle.closed.reference[last], self.triangle.open_y[last])


def controller_json(design: Design) -> str:
    """The controller as `hysim.save` writes it."""
    return to_json(design.controller, units=design.units)


def document(design: Design) -> dict[str, Any]:
    """Everything, for machines."""
    triangle, reduction, asked = design.triangle, design.step.reduction, design.task
    conditions = {
        name: value for name, value in triangle.closed.conditions.items() if not hasattr(value, "__dataclass_fields__")
    }
    return {
        "plant": to_document(design.actuator),
        "controller": to_document(design.controller),
        "units": design.units,
        "record_fit_percent": design.fit_percent,
        "tuning": design.tuning and {name: getattr(design.tuning, name) for name in _TUNED},
        "triangle": {
            "low": asked.low, "high": asked.high, "period": asked.period, "cycles": CYCLES,
            **{name: getattr(triangle, name) for name in _TRIANGLE}, "open_tracking_rms": design.open_tracking_rms,
        },
        "step": {
            "u0": asked.u0, "height": asked.step, "duration": asked.duration,
            **{name: getattr(reduction, name) for name in _STEP},
            "open": asdict(reduction.open), "closed": asdict(reduction.closed),
        },
        "reference_tracking_rms": design.file_rms,
        "conditions": conditions,
    }  # fmt: skip


def text(design: Design) -> str:
    """What is achieved, in words."""
    lines = [*_head(design), *_triangle(design), *_step(design), *_conditions(design)]
    return "\n".join(wrap for line in lines for wrap in _wrapped(line)) + "\n"


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, LETTERS, subsequent_indent=12 * " ", break_on_hyphens=False)


def _head(design: Design) -> Iterator[str]:
    yield f"plant       {in_brief(design.actuator)}"
    yield f"controller  {in_brief(design.controller)}"
    if not math.isnan(design.fit_percent):
        yield f"record      the model fits it by {design.fit_percent:.2f} %"
    if (tuning := design.tuning) is not None:
        bounds = "within the bounds" if tuning.success else "NOT within the bounds"
        yield f"tuning      {bounds}: {tuning.message}"
        yield (
            f"margins     gain {tuning.gain_margin:.4g}, phase {tuning.phase_margin:.4g} degrees, maximum sensitivity "
            f"{tuning.max_sensitivity:.4g}"
        )
    if not math.isnan(design.file_rms):
        yield f"reference   tracking rms {quantity(design.file_rms, design.units.get('y', ''))}"


def _triangle(design: Design) -> Iterator[str]:
    found, asked, y = design.triangle, design.task, design.units.get("y", "")
    is_lag = math.isnan(found.hysteresis_reduction_percent)
    what = "lag" if is_lag else "hysteresis"
    reduction = found.lag_reduction_percent if is_lag else found.hysteresis_reduction_percent
    yield f"triangle    {asked.low:.4g} to {quantity(asked.high, y)}, {1.0 / asked.period:.4g} Hz, cycle {CYCLES}"
    yield f"  {what} reduction".ljust(29) + f"{reduction:.2f} %"
    yield f"  width                      open {found.open_width:.4g}, closed {quantity(found.closed_width, y)}"
    if not is_lag:
        yield f"  width without the memory   open {found.open_lag_width:.4g}, closed {quantity(found.lag_width, y)}"
    yield f"  tracking rms               open {design.open_tracking_rms:.4g}, closed {quantity(found.tracking_rms, y)}"
    yield f"  closure gap                {quantity(found.closure_gap, y)}"


def _step(design: Design) -> Iterator[str]:
    found, u = design.step.reduction, design.units.get("u", "")
    height = quantity(design.task.step, design.units.get("y", ""))
    yield f"step        {height} from rest at {quantity(design.task.u0, u)}"
    for name in _STEP:
        value = getattr(found, name)
        words = name.removesuffix("_percent").replace("_", " ")
        yield f"  {words:<27}" + ("does not exist" if math.isnan(value) else f"{value:.2f} %")
    for name, response in (("open", found.open), ("closed", found.closed)):
        yield f"  {name:<27}{_response(response)}"


def _response(response: StepMetrics) -> str:
    return (
        f"overshoot {response.overshoot:.2f} %, 98 % after {response.t98:.4g} s, settled after "
        f"{response.settling_time:.4g} s"
    )


def _conditions(design: Design) -> Iterator[str]:
    """What all of this holds for, the model being the plant."""
    known, u, y = design.triangle.closed.conditions, design.units.get("u", ""), design.units.get("y", "")
    within = "none" if known["limits"] is None else extent(known["limits"], u)
    yield "conditions  simulated, with the model as the plant"
    yield (
        f"            sample time {known['sample_time']:.4g} s, delay {known['delay']:.4g} s, preview "
        f"{known['preview']:.4g} s, limits {within}"
    )
    yield (
        f"            sensor noise {quantity(known['noise'], y)} rms (seed {known['seed']}), quantum "
        f"{quantity(known['sensor_quantum'], y)}"
    )
    for name, closed in (("triangle", design.triangle.closed), ("step", design.step.closed)):
        found = closed.conditions
        yield (
            f"            {name}: voltage {extent(closed.u, u)}, limited at {found['limited_samples']} of "
            f"{closed.t.size} samples, noise {quantity(found['voltage_noise_rms'], u)} rms"
        )


def picture(design: Design) -> "Figure":
    """Displacement against reference in open and closed loop, and both steps against time."""
    from hysim import plot

    found, units = design.triangle, {"t": "s", **design.units}
    last = slice(-design.task.samples_per_cycle - 1, None)
    reference = found.closed.reference[last]
    own = {"u": units["y"], "y": units["y"]} if "y" in units else {}
    pairs = (("open loop", found.open_y), ("closed loop", found.closed.y))
    with plot.house_style():
        canvas = plot.figure(height=6.4)
        upper, lower = canvas.subplots(2)
        plot.loop(*(Curve(reference, np.asarray(y)[last], None, name, own) for name, y in pairs), ax=upper)
        upper.set_xlabel("Reference" + "".join(upper.get_ylabel().partition(" [")[1:]))
        t = design.step.closed.t
        steps = {"open loop": (t, design.step.open_y), "closed loop": (t, design.step.closed.y)}
        plot.traces(steps, lower, units=units)
    return canvas
