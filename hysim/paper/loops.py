"""The closed loops behind the paper's 90 % and 97 %, on its linear models and on one that has memory.

Hysteresis: a triangle of 52 s. The plants are equation (1), whose loop is lag, and the identified Bouc-Wen
law followed by the dynamics of (7) at a static gain of one.

Vibration: steps and square waves on (4) and (6), in their own unit of time, which is the sample. They are
models of deviations, with a negative gain: a step of -1 um takes positive voltages, one of either sign takes
voltages about the middle, 34 V, of Table 2's 18 and 50 V.

The paper prints no gains. They come from `hysim.tune`, but for one PID: `FAST_ON_EQUATION_1`.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import frozen
from hysim.control import (
    PID,
    HysteresisAssessment,
    LinearLoop,
    SquareWaveAssessment,
    StepAssessment,
    Tuning,
    assess_hysteresis,
    assess_square_wave,
    assess_step,
    tune,
)
from hysim.metrics import VibrationReduction
from hysim.paper.equations import EQUATION_1, EQUATION_4, EQUATION_6, EQUATION_7
from hysim.plants.actuator import Actuator
from hysim.plants.transfer_function import TransferFunction
from hysim.signals import triangle

Limits = tuple[float, float] | None
Row = dict[str, Any]

PERIOD = 52.0  # of the triangle [s]: Table 1's staircase at one second a step
SAMPLE_TIME = 0.01  # of the hysteresis loops [s]
SUPPLY = (0.0, 125.0)  # Table 1's voltages [V]

UNIT_STEP = 0.025  # sample time of the vibration loops, in samples of Table 2
ABOUT_34_V = (-16.0, 16.0)  # Table 2's voltages about their middle [V]
DURATION = 400.0  # of a step's record, in samples of Table 2
SQUARE_PERIODS = {4.0: "Table 2", 40.65: "10 s of .246 s a sample", 10.0: "the unit read as the second"}
"""Periods in samples of Table 2, and which reading of the paper each is."""

FAST_ON_EQUATION_1 = PID.standard(
    34.0,
    Ti=0.0361,
    Td=5.86,
    derivative_filter=0.003,
    limits=SUPPLY,
    setpoint_weight=0.852,
    derivative_weight=0.258,
)
"""From the global search of experiments/02_lag_of_equation_1.py: what a PID can do when robustness is given up."""

DYNAMICS_7 = TransferFunction(num=EQUATION_7.den[-1:], den=EQUATION_7.den)
"""Equation (7), its static gain made one."""


@frozen
class HysteresisCase:
    """One triangle on one plant."""

    plant: str
    reference: str
    limits: tuple[float, ...] | None
    max_sensitivity: float
    loops_tried: int
    assessment: HysteresisAssessment


@frozen
class StepCase:
    """One step on one plant."""

    plant: str
    reference: str
    limits: tuple[float, ...] | None
    max_sensitivity: float
    loops_tried: int
    assessment: StepAssessment


@frozen
class SquareCase:
    """One square wave on one plant."""

    plant: str
    reference: str
    period: float
    limits: tuple[float, ...] | None
    max_sensitivity: float
    loops_tried: int
    assessment: SquareWaveAssessment


@frozen
class Loops:
    """Every loop that was closed."""

    hysteresis: tuple[HysteresisCase, ...]
    steps: tuple[StepCase, ...]
    squares: tuple[SquareCase, ...]


def loops(law: Any) -> Loops:
    """Tune and close every loop.

    Parameters
    ----------
    law : law
        The hysteresis, from voltage [V] to displacement [um], bounded over repeated cycles.
    """
    vibration = {name: (plant, _vibration_tuning(plant)) for name, plant in _VIBRATING.items()}
    return Loops(
        hysteresis=(*_on_the_law(law), *_on_equation_1()),
        steps=(
            *(case for name, (plant, tuned) in vibration.items() for case in _steps(name, plant, tuned)),
            _step_on_equation_1(),
        ),
        squares=tuple(case for name, (plant, tuned) in vibration.items() for case in _squares(name, plant, tuned)),
    )


def control_measures(loops: Loops) -> dict[str, list[Row]]:
    """The entries about control in `summary.json`: a row for each loop, under "hysteresis" and "vibration"."""
    return {
        "hysteresis": [
            _head(case, case.assessment.closed.conditions) | _hysteresis_row(case.assessment)
            for case in loops.hysteresis
        ],
        "vibration": [
            *(
                _head(case, case.assessment.closed.conditions) | _step_row(case.assessment.reduction)
                for case in loops.steps
            ),
            *(_head(case, case.assessment.closed.conditions) | _square_row(case.assessment) for case in loops.squares),
        ],
    }


def words(pid: PID) -> str:
    """A PID in the paper's standard form."""
    return (
        f"PID Kp {pid.kp:.4g} V/um, Ti {pid.kp / pid.ki:.3g}, Td {pid.kd / pid.kp:.3g}, "
        f"derivative filter {pid.derivative_filter:.2g}, setpoint weight {pid.setpoint_weight:.2g}"
    )


_VIBRATING: Mapping[str, TransferFunction] = {"eq4": EQUATION_4, "eq6": EQUATION_6}


def _on_the_law(law: Any) -> list[HysteresisCase]:
    plant = Actuator(hysteresis=law, vibration=DYNAMICS_7)
    tuned = _triangle_tuning(plant)
    return [
        _triangle("bouc-wen+eq7", plant, tuned, low, limits)
        for low, limits in ((0.1, SUPPLY), (0.0, SUPPLY), (0.0, None))
    ]


def _on_equation_1() -> list[HysteresisCase]:
    plant = Actuator(vibration=EQUATION_1)
    tuned = _triangle_tuning(plant)
    fast = LinearLoop(plant, SAMPLE_TIME).max_sensitivity(FAST_ON_EQUATION_1)
    return [
        *(_triangle("eq1", plant, tuned, 0.0, limits) for limits in (SUPPLY, None)),
        _followed("eq1", plant, FAST_ON_EQUATION_1, 0.0, fast),
    ]


def _triangle_tuning(plant: Actuator) -> Tuning:
    samples = round(PERIOD / SAMPLE_TIME)
    reference = triangle(0.1, 2.5, cycles=1, samples_per_cycle=samples)
    t = SAMPLE_TIME * np.arange(reference.size)
    return tune(
        plant,
        t,
        reference,
        objective="rms",
        limits=SUPPLY,
        transient=0.2 * PERIOD,
    )


def _triangle(name: str, plant: Actuator, tuned: Tuning, low: float, limits: Limits) -> HysteresisCase:
    pid = replace(tuned.controller, limits=limits)
    return _followed(name, plant, pid, low, tuned.max_sensitivity, len(tuned.trials))


def _followed(
    name: str, plant: Actuator, pid: PID, low: float, max_sensitivity: float, loops_tried: int = 0
) -> HysteresisCase:
    return HysteresisCase(
        plant=name,
        reference=f"triangle {low:g} to 2.5 um, {PERIOD:g} s, 10 cycles",
        limits=pid.limits,
        max_sensitivity=max_sensitivity,
        loops_tried=loops_tried,
        assessment=assess_hysteresis(plant, pid, low=low, high=2.5, period=PERIOD, sample_time=SAMPLE_TIME),
    )


def _vibration_tuning(plant: TransferFunction) -> Tuning:
    """One PID for both kinds of limits; a low bound on the sensitivity keeps its voltages small."""
    t = UNIT_STEP * np.arange(round(60.0 / UNIT_STEP))
    return tune(plant, t, -np.ones(t.size), limits=[ABOUT_34_V, SUPPLY], max_sensitivity=1.4)


def _steps(name: str, plant: TransferFunction, tuned: Tuning) -> list[StepCase]:
    cases = ((-1.0, SUPPLY), (-1.0, ABOUT_34_V), (1.0, ABOUT_34_V), (-1.0, None))
    return [_step(name, plant, tuned, size, limits, DURATION, UNIT_STEP) for size, limits in cases]


def _step_on_equation_1() -> StepCase:
    t = SAMPLE_TIME * np.arange(round(20.0 / SAMPLE_TIME))
    tuned = tune(EQUATION_1, t, np.ones(t.size), limits=SUPPLY, max_sensitivity=1.4)
    return _step("eq1", EQUATION_1, tuned, 1.0, SUPPLY, 60.0, SAMPLE_TIME)


def _step(
    name: str, plant: TransferFunction, tuned: Tuning, size: float, limits: Limits, duration: float, sample_time: float
) -> StepCase:
    pid = replace(tuned.controller, limits=limits)
    return StepCase(
        plant=name,
        reference=f"step {size:+g} um",
        limits=limits,
        max_sensitivity=tuned.max_sensitivity,
        loops_tried=len(tuned.trials),
        assessment=assess_step(plant, pid, step=size, duration=duration, sample_time=sample_time),
    )


def _squares(name: str, plant: TransferFunction, tuned: Tuning) -> list[SquareCase]:
    pid = replace(tuned.controller, limits=ABOUT_34_V)
    return [
        SquareCase(
            plant=name,
            reference=f"square wave -0.5 to 0.5 um, period {period:g} samples",
            period=period,
            limits=ABOUT_34_V,
            max_sensitivity=tuned.max_sensitivity,
            loops_tried=len(tuned.trials),
            assessment=assess_square_wave(
                plant,
                pid,
                low=-0.5,
                high=0.5,
                period=period,
                sample_time=UNIT_STEP,
                periods=round(DURATION / period),
            ),
        )
        for period in SQUARE_PERIODS
    ]


def _head(case: HysteresisCase | StepCase | SquareCase, conditions: Mapping[str, Any]) -> Row:
    """Under which the loop ran, in plain values."""
    pid = conditions["controller"]
    return {
        "plant": case.plant,
        "reference": case.reference,
        "controller": words(pid),
        "limits": list(case.limits) if case.limits else "unlimited",
        "conditions": {
            "gains": {
                "kp": pid.kp,
                "ki": pid.ki,
                "kd": pid.kd,
                "derivative_filter": pid.derivative_filter,
                "setpoint_weight": pid.setpoint_weight,
                "derivative_weight": pid.derivative_weight,
            },
            "max_sensitivity": case.max_sensitivity,
            "time_unit": "s" if case.plant in ("eq1", "bouc-wen+eq7") else "sample of Table 2",
            **{key: conditions[key] for key in ("sample_time", "delay", "sensor_quantum", "noise", "seed")},
            "lowest_u_V": conditions["lowest_u"],
            "highest_u_V": conditions["highest_u"],
        },
    }


def _hysteresis_row(assessment: HysteresisAssessment) -> Row:
    return {
        "hysteresis_reduction_percent": assessment.hysteresis_reduction_percent,
        "lag_reduction_percent": assessment.lag_reduction_percent,
        "open_max_width_um": assessment.open_width,
        "closed_max_width_um": assessment.closed_width,
        "open_lag_width_um": assessment.open_lag_width,
        "lag_width_um": assessment.lag_width,
        "tracking_rms_um": assessment.tracking_rms,
        "closure_gap_um": assessment.closure_gap,
        "secant_gain_um_per_V": assessment.secant_gain,
    }


def _step_row(assessment: VibrationReduction | None) -> Row:
    if assessment is None:
        names = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")
        return dict.fromkeys((*names, "t98_open", "t98_closed"))
    return {
        "overshoot_reduction_percent": assessment.overshoot_reduction_percent,
        "residual_rms_reduction_percent": assessment.residual_rms_reduction_percent,
        "settling_time_reduction_percent": assessment.settling_time_reduction_percent,
        "t98_open": assessment.open.t98,
        "t98_closed": assessment.closed.t98,
        "overshoot_open_percent": assessment.open.overshoot,
        "overshoot_closed_percent": assessment.closed.overshoot,
        "settling_time_open": assessment.open.settling_time,
        "settling_time_closed": assessment.closed.settling_time,
    }


def _square_row(assessment: SquareWaveAssessment) -> Row:
    return _step_row(assessment.reduction) | {
        "tracking_rms_open_um": assessment.open_tracking_rms,
        "tracking_rms_um": assessment.tracking_rms,
        "peak_excess_open_percent": assessment.open_peak_excess_percent,
        "peak_excess_percent": assessment.peak_excess_percent,
    }
