"""Claims of sections 2.7 and 3: what the terms of the controller do, and what its figures show."""

import math

import numpy as np

from hysim.control import to_control
from hysim.paper.claims._claim import Claim, decided, unseen
from hysim.paper.equations import EQUATION_1, EQUATION_4, pid_standard
from hysim.paper.step_reading import StepReading, step_reading

LOOP_GAIN = 0.5
"""Gain at zero frequency of the loops that show the effect of each term: (1) is stable with any one of them."""

INTEGRAL_TIME = 2.0
DERIVATIVE_TIME = 0.2
DERIVATIVE_FILTER = 0.01
TRACKS_WITHIN = 0.02
"""A reference is tracked where the steady error is at most this part of it."""

_GAINS = "the gains of the controller"


def controller_claims() -> tuple[Claim, ...]:
    """Claims of section 2.7 about the controller, decided on (1)."""
    return (_standard_form(), *_terms(), *_open_loop(), *_unseen())


def _standard_form() -> Claim:
    gain, integral, derivative = 2.0, 3.0, 0.5
    at = 1j * np.geomspace(0.01, 100.0, 25)
    terms = gain + gain / (integral * at) + gain * derivative * at
    apart = float(np.max(np.abs(pid_standard(gain, integral, derivative)(at) / terms - 1.0)))
    return decided(
        "eq17-three-terms",
        "Section 2.7, equation (17)",
        "The controller is the sum of a proportional, an integral and a derivative term.",
        holds=apart < 1e-12,
        method="the transfer function of (17) against Kp + Ki/s + Kd s with Ki = Kp/Ti and Kd = Kp Td, "
        "over four decades of frequency, to rounding",
        recomputed=round(apart, 12) + 0.0,
    )


def _terms() -> tuple[Claim, ...]:
    none, alone = _open_step(), _loop_step(math.inf, 0.0)
    integral, derivative = _loop_step(INTEGRAL_TIME, 0.0), _loop_step(math.inf, DERIVATIVE_TIME)
    loop = f"step response of (1) in a loop of static gain {LOOP_GAIN:g}"
    return (
        decided(
            "proportional-rise-time",
            "Section 2.7",
            "Proportional action shortens the rise time.",
            holds=alone.rise_time < none.rise_time,
            method=f"{loop}, against (1) alone: time from the first 10 % to the first 90 % of the final value",
            recomputed=alone.rise_time,
            unit="s",
            note=f"Without control {none.rise_time:.3f} s.",
        ),
        decided(
            "proportional-error",
            "Section 2.7",
            "Proportional action leaves a steady error.",
            holds=abs(1.0 - alone.final) > TRACKS_WITHIN,
            method=f"{loop}: steady error, which has to exceed {TRACKS_WITHIN:.0%} of the reference",
            recomputed=100.0 * (1.0 - alone.final),
            unit="%",
        ),
        decided(
            "integral-error",
            "Section 2.7",
            "Integral action removes the steady error for a step.",
            holds=abs(1.0 - integral.final) < 1e-9,
            method=f"{loop} with Ti = {INTEGRAL_TIME:g} s: steady error, zero to rounding",
            recomputed=100.0 * round(1.0 - integral.final, 12) + 0.0,
            unit="%",
            note=f"The rise time grows to {integral.rise_time:.2f} s, as the paper allows.",
        ),
        decided(
            "derivative-overshoot",
            "Section 2.7",
            "Derivative action reduces the overshoot and improves the transient.",
            holds=derivative.overshoot_percent < alone.overshoot_percent
            and derivative.settling_time < alone.settling_time,
            method=f"{loop} with Td = {DERIVATIVE_TIME:g} s against Td = 0: overshoot and settling time both fall",
            recomputed=derivative.overshoot_percent,
            unit="%",
            note=f"Without it {alone.overshoot_percent:.1f} %; settling in {derivative.settling_time:.1f} s against "
            f"{alone.settling_time:.1f} s.",
        ),
    )


def _open_loop() -> tuple[Claim, ...]:
    return tuple(
        decided(
            f"open-loop-does-not-track-eq{number}",
            where,
            f"Without a controller, ({number}) does not track the reference.",
            holds=abs(1.0 - model.dc_gain) > TRACKS_WITHIN,
            method="steady output for a reference of one, applied as the voltage, "
            f"which has to miss it by more than {TRACKS_WITHIN:.0%}",
            recomputed=model.dc_gain,
            note="A reference in micrometres taken as volts: the gain alone makes it miss.",
        )
        for number, model, where in (
            (1, EQUATION_1, "Section 2.7.1, Figure 12"),
            (4, EQUATION_4, "Section 2.7.2, Figures 13 and 14"),
        )
    )


def _unseen() -> tuple[Claim, ...]:
    return (
        unseen(
            "figure12-tracks", "Figure 12, sections 2.7.1 and 3",
            "With the controller, the step response of (1) tracks the reference.", needs=_GAINS,
        ),
        unseen(
            "figure13-tracks", "Figure 13, sections 2.7.2 and 3",
            "With the controller, (4) follows a square wave.", needs=f"{_GAINS} and the square wave's period",
        ),
        unseen(
            "figure14-tracks", "Figure 14, sections 2.7.2 and 3",
            "With the controller, (4) settles at the desired displacement after a step.", needs=_GAINS,
        ),
        unseen(
            "simulation-validates-experiment", "Abstract and section 4",
            "Simulation validates the experiment.", needs="a measurement under control",
        ),
    )  # fmt: skip


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
