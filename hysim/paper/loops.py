"""The closed loops for the paper's 90 % and 97 %, on its linear models and on one that has memory.

Hysteresis: a triangle of 52 s. The plants are equation (1), whose loop is lag, and the identified Bouc-Wen law followed
by the dynamics of (7) at a static gain of one.

Vibration: steps and square waves on (4) and (6), in their own unit of time, which is the sample. They are models of
deviations, with a negative gain: a step of -1 um takes positive voltages, one of either sign takes voltages about the
middle, 34 V, of Table 2's 18 and 50 V.

The paper prints no gains: they come from `hysim.paper.search`, one search for each plant and each pair of limits.
"""

import math
from dataclasses import replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from hysim._basics.frozen import frozen
from hysim.control import (
    PID,
    HysteresisAssessment,
    SquareWaveAssessment,
    StepAssessment,
    assess_hysteresis,
    assess_square_wave,
    assess_step,
)
from hysim.metrics import VibrationReduction, loop_metrics, reduction_percent
from hysim.paper.equations import EQUATION_1, EQUATION_4, EQUATION_6, EQUATION_7
from hysim.paper.search import Found, Limits, Starts, Task, optimum, step_task, triangle_task, volts_per_pixel
from hysim.plants.actuator import Actuator
from hysim.plants.transfer_function import TransferFunction

Row = dict[str, Any]
Assessment = TypeVar("Assessment")

PERIOD = 52.0  # of the triangle [s]: Table 1's staircase at one second a step
SAMPLE_TIME = 0.01  # of the hysteresis loops [s]
SUPPLY = (0.0, 125.0)  # Table 1's voltages [V]
HIGH = 2.5  # of the triangle [um]

UNIT_STEP = 0.025  # sample time of the vibration loops, in samples of Table 2
ABOUT_34_V = (-16.0, 16.0)  # Table 2's voltages about their middle [V]
DURATION = 400.0  # of a step's record, in samples of Table 2
SQUARE_PERIODS = {4.0: "Table 2", 40.65: "10 s of .246 s a sample", 10.0: "the unit read as the second"}
"""Periods in samples of Table 2, and which reading of the paper each is."""

DYNAMICS_7 = TransferFunction(num=EQUATION_7.den[-1:], den=EQUATION_7.den)
"""Equation (7), its static gain made one."""

GAINS = ("kp", "ki", "kd", "derivative_filter", "setpoint_weight", "derivative_weight")
REDUCTIONS = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")
"""The three figures of `hysim.metrics.vibration_reduction`, never one without the others."""


class Case(NamedTuple, Generic[Assessment]):
    """One reference on one plant.

    Parameters
    ----------
    plant, reference : str
        Their names.
    period : float or None
        Of the reference [the plant's unit of time]; None for a step.
    found : Found
        The search that gave the controller.
    limits : tuple or None
        Under which the loop ran [V].
    assessment : HysteresisAssessment, StepAssessment or SquareWaveAssessment
        Its figures.
    """

    plant: str
    reference: str
    period: float | None
    found: Found
    limits: tuple[float, ...] | None
    assessment: Assessment


HysteresisCase = Case[HysteresisAssessment]
StepCase = Case[StepAssessment]
SquareCase = Case[SquareWaveAssessment]


@frozen
class Loops:
    """Every loop that was closed.

    Parameters
    ----------
    hysteresis, steps, squares : tuple of Case
    law_width : float
        Largest width of the law's loop, alone and quasi-static, over the triangle of the first case [um].
    """

    hysteresis: tuple[HysteresisCase, ...]
    steps: tuple[StepCase, ...]
    squares: tuple[SquareCase, ...]
    law_width: float


def on_equations(starts: Starts) -> Loops:
    """Search the controllers of (1), (4) and (6), and close their loops; there is no law."""
    steps, squares = [], []
    for name, plant in (("eq4", EQUATION_4), ("eq6", EQUATION_6)):
        about, supply = (
            step_task(plant, step=-1.0, limits=limits, duration=0.5 * DURATION, sample_time=UNIT_STEP)
            for limits in (ABOUT_34_V, SUPPLY)
        )
        within = optimum(replace(about, name=f"{name}, step within 16 V"), starts)
        supply = replace(supply, name=f"{name}, step within the supply")
        beyond = optimum(supply, starts, **(_longer(seed=2) if name == "eq4" else {}))
        cases = ((-1.0, SUPPLY, beyond), (-1.0, ABOUT_34_V, within), (1.0, ABOUT_34_V, within), (-1.0, None, within))
        steps += [_step(name, plant, best, size, limits, DURATION, UNIT_STEP) for size, limits, best in cases]
        squares += [_square(name, plant, within, period) for period in SQUARE_PERIODS]
    task = step_task(EQUATION_1, step=1.0, limits=SUPPLY, duration=40.0, sample_time=SAMPLE_TIME)
    best = optimum(replace(task, name="eq1, step"), starts, **_longer(seed=6))
    steps.append(_step("eq1", EQUATION_1, best, 1.0, SUPPLY, 60.0, SAMPLE_TIME))
    alone = Actuator(vibration=EQUATION_1)
    best = optimum(_triangle_task("eq1", alone, 0.0, cycles=3), starts, **_longer(seed=3, generations=60))
    triangles = tuple(_triangle("eq1", alone, best, 0.0, limits) for limits in (SUPPLY, None))
    return Loops(hysteresis=triangles, steps=tuple(steps), squares=tuple(squares), law_width=math.nan)


def with_law(others: Loops, law: Any, starts: Starts) -> Loops:
    """Search the controller of a law, and close its loops in front of those of the equations.

    The law gives the displacement [um] for the voltage [V], bounded over repeated cycles.
    """
    plant = law_plant(law)
    best = optimum(_triangle_task("bouc-wen+eq7", plant, 0.1, cycles=2), starts)
    on_law = tuple(_triangle("bouc-wen+eq7", plant, best, low, SUPPLY) for low in (0.1, 0.0))
    width = _width_of_law(law, on_law[0].assessment)
    return replace(others, hysteresis=(*on_law, *others.hysteresis), law_width=width)


def control_measures(loops: Loops) -> dict[str, list[Row]]:
    """The entries about control in `summary.json`: a row for each loop, under "hysteresis" and "vibration"."""
    return {
        "hysteresis": [_head(case) | _hysteresis_row(case, loops.law_width) for case in loops.hysteresis],
        "vibration": [
            *(_head(case) | _step_row(case.assessment) for case in loops.steps),
            *(_head(case) | _square_row(case) for case in loops.squares),
        ],
    }


def words(pid: PID) -> str:
    """All numbers of a PID."""
    return (
        f"PID kp {pid.kp:.5g} V/um, ki {pid.ki:.5g}, kd {pid.kd:.5g}, derivative filter {pid.derivative_filter:.3g}, "
        f"setpoint weight {pid.setpoint_weight:.3g}, derivative weight {pid.derivative_weight:.3g}"
    )


def law_plant(law: Any) -> Actuator:
    """The plant of the hysteresis loops: a law, followed by the dynamics of (7)."""
    return Actuator(hysteresis=law, vibration=DYNAMICS_7)


def _longer(seed: int, generations: int = 40) -> dict[str, int]:
    """Effort from one of several seeds, whose results differ by some percent on (1), by hundredths for steps of (4)."""
    return {"generations": generations, "polish": 600, "seed": seed}


def _triangle_task(name: str, plant: Actuator, low: float, cycles: int) -> Task:
    """Within the supply only: beyond the measured voltages a polynomial law means nothing."""
    task = triangle_task(
        plant, low=low, high=HIGH, period=PERIOD, limits=SUPPLY, sample_time=SAMPLE_TIME, cycles=cycles
    )
    return replace(task, name=f"{name}, triangle")


def _triangle(name: str, plant: Actuator, best: Found, low: float, limits: Limits) -> HysteresisCase:
    pid = replace(best.controller, limits=limits)
    assessment = assess_hysteresis(plant, pid, low=low, high=HIGH, period=PERIOD, sample_time=SAMPLE_TIME)
    return Case(name, f"triangle {low:g} to {HIGH:g} um, {PERIOD:g} s, 10 cycles", PERIOD, best, limits, assessment)


def _width_of_law(law: Any, assessment: HysteresisAssessment) -> float:
    """Width of the law alone along the open loop's voltage; without dynamics each sample is its own answer."""
    samples = round(PERIOD / SAMPLE_TIME) + 1
    return loop_metrics(assessment.open_u[-samples:], law.response(assessment.open_u)[-samples:]).max_width


def _step(
    name: str, plant: TransferFunction, best: Found, size: float, limits: Limits, duration: float, sample_time: float
) -> StepCase:
    pid = replace(best.controller, limits=limits)
    assessment = assess_step(plant, pid, step=size, duration=duration, sample_time=sample_time)
    return Case(name, f"step {size:+g} um", None, best, limits, assessment)


def _square(name: str, plant: TransferFunction, best: Found, period: float) -> SquareCase:
    periods = round(DURATION / period)
    assessment = assess_square_wave(
        plant, best.controller, low=-0.5, high=0.5, period=period, sample_time=UNIT_STEP, periods=periods
    )
    reference = f"square wave -0.5 to 0.5 um, period {period:g} samples"
    return Case(name, reference, period, best, ABOUT_34_V, assessment)


def _head(case: Case[Any]) -> Row:
    """Conditions under which the loop ran, in plain values."""
    closed = case.assessment.closed
    conditions = closed.conditions
    pid = conditions["controller"]
    return {
        "plant": case.plant,
        "reference": case.reference,
        "period": case.period,
        "controller": words(pid),
        "limits": list(case.limits) if case.limits else "unlimited",
        "saturated_percent": 100.0 * float(conditions["limited_samples"]) / float(closed.t.size),
        "volts_per_pixel": volts_per_pixel(pid, conditions["sample_time"]),
        "max_sensitivity": case.found.max_sensitivity,
        "max_sensitivity_with_delay": case.found.with_delay,
        "searched": case.found.searched,
        "conditions": {
            "gains": {name: vars(pid)[name] for name in GAINS},
            "max_sensitivity": case.found.max_sensitivity,
            "box": case.found.box,
            "time_unit": "s" if case.plant in ("eq1", "bouc-wen+eq7") else "sample of Table 2",
            **{key: conditions[key] for key in ("sample_time", "delay", "sensor_quantum", "noise", "seed")},
            "lowest_u_V": conditions["lowest_u"],
            "highest_u_V": conditions["highest_u"],
        },
    }


def _hysteresis_row(case: HysteresisCase, law_width: float) -> Row:
    assessment, has_law = case.assessment, case.plant != "eq1"
    return {
        "hysteresis_reduction_percent": assessment.hysteresis_reduction_percent,
        "lag_reduction_percent": assessment.lag_reduction_percent,
        "law_width_reduction_percent": reduction_percent(law_width, assessment.closed_width) if has_law else None,
        "open_max_width_um": assessment.open_width,
        "closed_max_width_um": assessment.closed_width,
        "law_width_um": law_width if has_law else None,
        "open_lag_width_um": assessment.open_lag_width,
        "lag_width_um": assessment.lag_width,
        "tracking_rms_um": assessment.tracking_rms,
        "closure_gap_um": assessment.closure_gap,
        "secant_gain_um_per_V": assessment.secant_gain,
    }


def _step_row(assessment: StepAssessment) -> Row:
    closed = assessment.closed
    error, tail = closed.reference - closed.y, slice(-(closed.y.size // 10), None)
    step = closed.reference[-1] - closed.y[0]
    return {
        **_figures(assessment.reduction),
        "steady_error_percent": 100.0 * float(np.abs(error[tail]).max() / abs(step)),
        "tracking_rms_um": float(np.sqrt(np.mean(error**2))),
    }


def _square_row(case: SquareCase) -> Row:
    assessment, closed = case.assessment, case.assessment.closed
    half = round(0.5 * (case.period or 0.0) / UNIT_STEP)
    ends = (closed.reference - closed.y)[[-half - 1, -1]]
    return {
        **_figures(assessment.reduction),
        "steady_error_percent": 100.0 * float(np.abs(ends).max() / np.ptp(closed.reference)),
        "tracking_rms_open_um": assessment.open_tracking_rms,
        "tracking_rms_um": assessment.tracking_rms,
        "peak_excess_open_percent": assessment.open_peak_excess_percent,
        "peak_excess_percent": assessment.peak_excess_percent,
    }


def _figures(reduction: VibrationReduction | None) -> Row:
    if reduction is None:
        return dict.fromkeys((*REDUCTIONS, "t98_open", "t98_closed"))
    return {
        **{name: vars(reduction)[name] for name in REDUCTIONS},
        "t98_open": reduction.open.t98,
        "t98_closed": reduction.closed.t98,
        "overshoot_open_percent": reduction.open.overshoot,
        "overshoot_closed_percent": reduction.closed.overshoot,
        "settling_time_open": reduction.open.settling_time,
        "settling_time_closed": reduction.closed.settling_time,
    }
