"""The report's chapter on control: the loops behind the paper's two headline numbers."""

from collections.abc import Sequence
from typing import Any

from hysim.metrics import VibrationReduction, reduction_percent
from hysim.paper import markup
from hysim.paper.camera import CameraLoop
from hysim.paper.chapters.camera import camera_section
from hysim.paper.loops import (
    ABOUT_34_V,
    SUPPLY,
    Case,
    HysteresisCase,
    Loops,
    SquareCase,
    StepCase,
    limited_percent,
    tracking_rms,
)
from hysim.paper.periods import PeriodCurve
from hysim.paper.search import volts_per_pixel

_PLANTS = {"bouc-wen+eq7": "Bouc-Wen and (7)", "eq1": "(1)", "eq4": "(4)", "eq6": "(6)"}


def control_chapter(
    loops: Loops, cameras: Sequence[CameraLoop], periods: Sequence[PeriodCurve], drawn: markup.Drawn
) -> str:
    """The loops behind the two headline numbers, with an ideal sensor and with a camera."""
    return (
        _hysteresis(loops, drawn)
        + _vibration(loops.steps, drawn)
        + camera_section(cameras, periods, drawn)
        + markup.folded("Square waves", _squares(loops.squares, drawn))
    )


def definitions() -> list[str]:
    """The measures of control."""
    return [
        "hysteresis reduction = 100 (1 − W closed / W open) %, W the largest width over the stroke of the true "
        "displacement against the reference, in the last of 10 cycles. The open loop drives the plant with "
        "reference / secant gain. Of a plant without memory the same figure is called lag reduction.",
        "reduction against the law's own width = 100 (1 − closed width / width of the law's loop alone) %, since the "
        "open loop's width holds the lag of (7) too.",
        "lag width: the width of the same loop with the law replaced by a line of its secant gain.",
        "volts per pixel: jump of the command when the measurement moves by one camera pixel, |kp| + |kd| / "
        "(derivative filter + sample time) times 0.0763 µm.",
        "after a step, always together, with η = (y − y0)/(yf − y0) and yf the mean of the last tenth: overshoot "
        "reduction; residual reduction, of the rms of η − 1 from the time at which the open loop first reaches "
        "98 %, for 2 ln 50 / (ζ ωn) of its least damped mode; settling time reduction, to 2 % and staying.",
        "square waves: rms error and peak excess over the levels, in the last period.",
        "maximum sensitivity: the largest |1 / (1 + L)| of the sampled loop, at the least and the largest slope of "
        "the law; its inverse is the distance of L from −1.",
    ]


def _hysteresis(loops: Loops, drawn: markup.Drawn) -> str:
    cases = loops.hysteresis
    first, lag = cases[0].assessment, next(case for case in cases if case.plant == "eq1")
    return (
        markup.heading("Hysteresis")
        + markup.paragraph(
            "A triangle of 52 s, ten cycles, the last measured. The plants are the identified Bouc-Wen law (with the "
            "quadratic input, whose memory stays bounded over repeated cycles) followed by the dynamics of (7) at a "
            "static gain of one, and Equation (1). The controllers come from one global search over all gains, the "
            "filter and both weights: the loop is sampled every 10 ms within its limits, its maximum sensitivity is at "
            "most 2, and at most 2.5 with one sample more of delay. The sensor is ideal; the camera follows below."
        )
        + _triangle_table(loops)
        + markup.figure(
            drawn["hysteresis"],
            "The triangle's last cycle on the Bouc-Wen plant: displacement and its deviation from the reference, in "
            "open and in closed loop, 0 to 125 V.",
        )
        + markup.paragraph(
            f"The open loop is {first.open_width:.3f} µm wide: {loops.law_width:.3f} µm are the law's own, and with "
            f"the law replaced by a line {first.open_lag_width:.3f} µm are left, which (7) lags. In closed loop "
            f"{first.closed_width:.4f} µm remain, nearly all of it the lag that the feedback itself has in the corner "
            "where the triangle turns: the figure measures the sampling and the period of the triangle, as the curves "
            "below show. On (1) there is no hysteresis to reduce, only lag, and its four poles leave a PID little "
            f"phase: {lag.assessment.lag_reduction_percent:.0f} % is the best found with a maximum sensitivity of 2. "
            "experiments/02_lag_of_equation_1.py gives what larger ones would allow."
        )
        + _gains(cases)
        + markup.figure(
            drawn["figure12"],
            "The paper's Figure 12, regenerated: in words, the step responses of the non-dynamic model with PID, "
            "which follows the reference, and without, which does not. Ours shows a step of 1 µm on (1), 0 to 125 V; "
            "without control the voltage is the reference over the static gain, where the paper feeds the reference "
            "itself as a voltage and so reaches a fiftieth of it.",
        )
    )


def _vibration(cases: Sequence[StepCase], drawn: markup.Drawn) -> str:
    return (
        markup.heading("Vibration: steps")
        + markup.paragraph(
            "Steps on (4) and (6) in their own unit of time, the sample of Table 2. Their static gain is negative and "
            "they are models of deviations: a step of −1 µm takes voltages from 0 up, one of either sign takes "
            "16 V either side of the middle, 34 V, of Table 2's voltages. A search for each plant and each pair of "
            "limits, by the least of the three reductions; the sensor is ideal."
        )
        + _step_table(cases)
        + _gains(cases)
        + markup.figure(
            drawn["figure14"],
            "The paper's Figure 14, regenerated: in words, the step response of the dynamic model with PID, which "
            "takes the desired displacement, and without, which does not. Ours shows a step of −1 µm on (4) within 0 "
            "to 125 V, and the voltage that it takes.",
        )
    )


def _squares(cases: Sequence[SquareCase], drawn: markup.Drawn) -> str:
    return (
        markup.heading("Vibration: square waves")
        + markup.paragraph(
            "The same PIDs follow square waves of ±0.5 µm within ±16 V, in the periodic steady state. The period of "
            "4 samples is Table 2's, 40.65 samples are the program's 10 s, and 10 is what 10 s would be if the unit "
            "were the second. No half period is long enough for the step's figures, which need five of the plant's "
            "own periods."
        )
        + _square_table(cases)
        + markup.figure(
            drawn["figure13"],
            "The paper's Figure 13, regenerated: in words, a square wave from a pulse generator, which the output "
            "with PID follows and the one without does not. Ours shows (4) within ±16 V at the three periods: at "
            "Table 2's own the voltage does not suffice, at the program's 10 s the loop follows.",
        )
    )


def _triangle_table(loops: Loops) -> str:
    rows = [
        [
            _PLANTS[case.plant], case.reference.split(",")[0].removeprefix("triangle ").removesuffix(" um"),
            *_conditions(case), f"{_reduction(case):.1f}{'' if case.plant != 'eq1' else ' (lag)'}",
            "–" if case.plant == "eq1" else f"{reduction_percent(loops.law_width, case.assessment.closed_width):.1f}",
            *(f"{round(value, 4) + 0.0:.4f}" for value in (
                case.assessment.tracking_rms, case.assessment.open_width, case.assessment.closed_width,
                case.assessment.open_lag_width, case.assessment.lag_width, case.assessment.closure_gap,
            )),
        ]
        for case in loops.hysteresis
    ]  # fmt: skip
    header = [
        "plant", "triangle [µm]", *_CONDITIONS, "reduction [%]", "reduction against the law's own width [%]",
        "rms error [µm]", "open width [µm]", "closed width [µm]", "of which lag, open [µm]",
        "of which lag, closed [µm]", "closure gap [µm]",
    ]  # fmt: skip
    return markup.table(header, rows)


def _step_table(cases: Sequence[StepCase]) -> str:
    rows = [
        [
            _PLANTS[case.plant], case.reference.removeprefix("step ").removesuffix(" um"), *_conditions(case),
            *(f"{value:.1f}" for value in _figures(case.assessment.reduction)), f"{tracking_rms(case.assessment):.4f}",
            f"{case.assessment.reduction.open.t98:.2f}", f"{case.assessment.reduction.closed.t98:.2f}",
        ]
        for case in cases
    ]  # fmt: skip
    header = [
        "plant", "step [µm]", *_CONDITIONS, "overshoot reduction [%]", "residual rms reduction [%]",
        "settling time reduction [%]", "rms error [µm]", "open 98 % at", "closed 98 % at",
    ]  # fmt: skip
    return markup.table(header, rows)


def _square_table(cases: Sequence[SquareCase]) -> str:
    rows = [
        [
            _PLANTS[case.plant], *_conditions(case), f"{case.assessment.open_tracking_rms:.3f}",
            f"{case.assessment.tracking_rms:.3f}", f"{case.assessment.open_peak_excess_percent:.1f}",
            f"{case.assessment.peak_excess_percent:.1f}",
        ]
        for case in cases
    ]  # fmt: skip
    header = [
        "plant", *_CONDITIONS, "rms error, open [µm]", "closed [µm]", "peak excess, open [%]", "closed [%]",
    ]  # fmt: skip
    return markup.table(header, rows)


def _gains(cases: Sequence[HysteresisCase] | Sequence[StepCase]) -> str:
    """The controllers, one for each search, folded."""
    found = {case.found.controller: case for case in cases}
    rows = [
        [
            _PLANTS[case.plant], _limits(pid.limits),
            *(f"{value:.4g}" for value in (pid.kp, pid.ki, pid.kd, pid.derivative_filter)),
            f"{pid.setpoint_weight:.3f}", f"{pid.derivative_weight:.3f}", f"{case.found.controllers}",
            f"{case.found.simulations}",
        ]
        for pid, case in found.items()
    ]  # fmt: skip
    header = [
        "plant", "searched within [V]", "kp [V/µm]", "ki", "kd", "derivative filter", "setpoint weight",
        "derivative weight", "controllers judged", "of which simulated",
    ]  # fmt: skip
    return markup.folded("Gains", markup.table(header, rows))


_CONDITIONS = (
    "voltage [V]", "period of the reference", "samples at a limit [%]", "maximum sensitivity",
    "with one sample of delay", "volts per pixel",
)  # fmt: skip


def _conditions(case: Case[Any]) -> list[str]:
    """Cells under `_CONDITIONS`."""
    closed, found = case.assessment.closed, case.found
    return [
        _limits(case.limits), "–" if case.period is None else f"{case.period:g}", f"{limited_percent(closed):.1f}",
        f"{found.max_sensitivity:.2f}", f"{found.with_delay:.2f}",
        f"{volts_per_pixel(found.controller, closed.conditions['sample_time']):.0f}",
    ]  # fmt: skip


def _figures(assessment: VibrationReduction) -> tuple[float, float, float]:
    return (
        assessment.overshoot_reduction_percent,
        assessment.residual_rms_reduction_percent,
        assessment.settling_time_reduction_percent,
    )


def _reduction(case: HysteresisCase) -> float:
    assessment = case.assessment
    return assessment.lag_reduction_percent if case.plant == "eq1" else assessment.hysteresis_reduction_percent


def _limits(limits: tuple[float, ...] | None) -> str:
    names = {SUPPLY: "0 to 125", ABOUT_34_V: "±16 about 34"}
    return "unlimited" if limits is None else names.get((limits[0], limits[1]), f"{limits[0]:g} to {limits[1]:g}")
