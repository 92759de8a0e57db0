"""The values of claims about controllers: the effect of each term, and what the best loops reach.

The paper prints no gains. So a claim about a closed loop asks whether a controller exists, and is judged by the best of
the loops of `hysim.paper.loops`: those within voltage limits, whose maximum sensitivity is at most 2.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hysim.control import to_control
from hysim.paper import printed
from hysim.paper.claims._evidence import Evidence, Loop
from hysim.paper.claims._judge import Value
from hysim.paper.claims.rounding import half_unit
from hysim.paper.equations import EQUATION_1, pid_standard
from hysim.paper.search import MAX_SENSITIVITY
from hysim.paper.step_reading import StepReading, step_reading

LOOP_GAIN = 0.5
"""Gain at zero frequency of the loops that show the effect of each term: (1) is stable with any one of them."""
INTEGRAL_TIME = 2.0
DERIVATIVE_TIME = 0.2
DERIVATIVE_FILTER = 0.01
TRACKS_WITHIN = 0.02
"""A reference is tracked where the steady error is at most this part of it."""
VIBRATION_MEASURES = {
    "overshoot": "overshoot_reduction_percent",
    "residual rms": "residual_rms_reduction_percent",
    "settling time": "settling_time_reduction_percent",
}


# -- the terms of the controller


def sum_of_terms(_: Evidence) -> Value:
    """Largest relative distance of (17) from the sum of its three terms."""
    gain, integral, derivative = 2.0, 3.0, 0.5
    at = 1j * np.geomspace(0.01, 100.0, 25)
    terms = gain + gain / (integral * at) + gain * derivative * at
    apart = float(np.max(np.abs(pid_standard(gain, integral, derivative)(at) / terms - 1.0)))
    return Value(round(apart, 12) + 0.0, apart < 1e-12)


def proportional_rise(_: Evidence) -> Value:
    """Rise time with proportional action, against that without."""
    none, alone = _open_step(), _loop_step(math.inf, 0.0)
    return Value(alone.rise_time, alone.rise_time < none.rise_time, {"open": none.rise_time, "gain": LOOP_GAIN})


def proportional_error(_: Evidence) -> Value:
    """Steady error with proportional action."""
    error = 1.0 - _loop_step(math.inf, 0.0).final
    return Value(100.0 * error, abs(error) > TRACKS_WITHIN, {"gain": LOOP_GAIN, "least": 100.0 * TRACKS_WITHIN})


def integral_error(_: Evidence) -> Value:
    """Steady error with integral action."""
    loop = _loop_step(INTEGRAL_TIME, 0.0)
    facts = {"gain": LOOP_GAIN, "integral": INTEGRAL_TIME, "rise": loop.rise_time}
    return Value(100.0 * round(1.0 - loop.final, 12) + 0.0, abs(1.0 - loop.final) < 1e-9, facts)


def derivative_overshoot(_: Evidence) -> Value:
    """Overshoot with derivative action, against that without; the settling time has to fall too."""
    without, loop = _loop_step(math.inf, 0.0), _loop_step(math.inf, DERIVATIVE_TIME)
    better = loop.overshoot_percent < without.overshoot_percent and loop.settling_time < without.settling_time
    facts = {"gain": LOOP_GAIN, "derivative": DERIVATIVE_TIME, "without": without, "loop": loop}
    return Value(loop.overshoot_percent, better, facts)


def _open_step() -> StepReading:
    return step_reading(to_control(EQUATION_1))


def _loop_step(integral_time: float, derivative_time: float) -> StepReading:
    import control

    controller = pid_standard(
        LOOP_GAIN / EQUATION_1.dc_gain,
        integral_time,
        derivative_time,
        derivative_filter=DERIVATIVE_FILTER if derivative_time else 0.0,
    )
    return step_reading(control.feedback(controller * to_control(EQUATION_1)))


# -- the best loops


def tracks(of: Evidence, plant: str, reference: str) -> Value | None:
    """Steady error of the best loop on a plant for a reference, in percent of the step."""
    rows = [row for row in _of_plant(of.control.get("vibration", ()), plant) if row["reference"].startswith(reference)]
    errors = [(_number(row.get("steady_error_percent")), row) for row in rows]
    if not errors:
        return None
    error, row = min(errors, key=lambda pair: pair[0])
    return Value(error, error <= 100.0 * TRACKS_WITHIN, {"least": 100.0 * TRACKS_WITHIN, "loop": conditions(row)})


def loop_reduction(of: Evidence, plant: str, key: str) -> Value | None:
    """Reduction of the loop's relative width, of the best loop on a plant."""
    best = _best(of.control.get("hysteresis", ()), plant, (key,))
    return None if best is None else _reached(printed.HYSTERESIS_REDUCTION, *best)


def vibration(of: Evidence, plant: str, measure: str) -> Value | None:
    """A measure of the best loop on a plant, or the least of its three; one is never shown without the others."""
    best = _best(of.control.get("vibration", ()), plant, tuple(VIBRATION_MEASURES.values()))
    if best is None:
        return None
    least, row = best
    figures = {name: _number(row[key]) for name, key in VIBRATION_MEASURES.items()}
    together = ", ".join(f"{name} {figure:.1f} %" for name, figure in figures.items())
    return _reached(printed.VIBRATION_REDUCTION, figures.get(measure, least), row, {"together": together})


def _reached(text: str, value: float, row: Loop, facts: Mapping[str, Any] | None = None) -> Value:
    enough = value >= float(text) - half_unit(text)
    said = conditions(row) if enough else f"{row.get('searched', '')} Best: {conditions(row)}".strip()
    return Value(value, enough, {"loop": said, **(facts or {})})


def _best(loops: Sequence[Loop], plant: str, keys: tuple[str, ...]) -> tuple[float, Loop] | None:
    """The loop on this plant whose least figure is the greatest, and that figure."""
    figures = [(float(np.min([_number(row.get(key)) for key in keys])), row) for row in _of_plant(loops, plant)]
    return max((pair for pair in figures if not math.isnan(pair[0])), key=lambda pair: pair[0], default=None)


def _of_plant(loops: Sequence[Loop], plant: str) -> list[Loop]:
    """Loops on a plant that count: within voltage limits, and robust."""
    return [
        row
        for row in loops
        if row["plant"] == plant
        and row["limits"] != "unlimited"
        and row["max_sensitivity"] <= 1.001 * MAX_SENSITIVITY  # to which the sensitivity is known
    ]


def conditions(row: Loop) -> str:
    """The controller of a loop, and the conditions under which it ran, in words."""
    low, high = row["limits"]
    under = row["conditions"]
    return (
        f"{row['controller']}; {row['reference']}; {low:g} to {high:g} V; sampled every {under['sample_time']:g} "
        f"{under['time_unit']}; maximum sensitivity {row['max_sensitivity']:.2f}"
    )


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


FUNCTIONS: Mapping[str, Callable[..., Value | None]] = {
    function.__name__: function
    for function in (
        sum_of_terms, proportional_rise, proportional_error, integral_error, derivative_overshoot, tracks,
        loop_reduction, vibration,
    )
}  # fmt: skip
"""Every function by the name that the table gives it."""
