"""Readings of step responses are those of the exact response, whatever the samples."""

import math

import control
import numpy as np
import pytest
from scipy.optimize import brentq
from strategies import refused

from hysim.control import to_control
from hysim.metrics import step_metrics
from hysim.paper import claim_values, equations
from hysim.paper.equations import (
    EQUATION_1,
    EQUATION_4,
    EQUATION_6,
    EQUATION_7,
    characteristics,
    second_order,
    step_fit,
    unit_step,
)
from hysim.paper.step_reading import step_reading

PRINTED = {"1": EQUATION_1, "4": EQUATION_4, "6": EQUATION_6, "7": EQUATION_7}
NAMES = {
    "rise_time": "RiseTime",
    "overshoot_percent": "Overshoot",
    "peak_time": "PeakTime",
    "settling_time": "SettlingTime",
}


def test_the_rise_times_of_the_report_are_those_of_a_fine_grid():
    """0.714 in the loop and 0.916 alone; python-control's own coarse samples give 0.663 and 0.862."""
    claim = claim_values.proportional_rise(None)
    assert claim.value == pytest.approx(0.714, abs=5e-4)
    assert claim.facts["open"] == pytest.approx(0.916, abs=5e-4)


@pytest.mark.parametrize("name", PRINTED)
def test_every_reading_is_that_of_python_control_on_a_fine_grid(name):
    system = to_control(PRINTED[name])
    found = step_reading(system)
    step = 0.01
    expected = control.step_info(system, T=step * np.arange(8001))
    # times are samples there, two for the rise; a peak lies half a step from one at most, where |eta''| < 10
    apart = {"rise_time": 2 * step, "overshoot_percent": 100.0 * 10.0 * step**2 / 8}
    for ours, theirs in NAMES.items():
        assert getattr(found, ours) == pytest.approx(expected[theirs], abs=apart.get(ours, step))
    assert found.final == pytest.approx(PRINTED[name].dc_gain, rel=1e-12)
    table = characteristics(PRINTED[name])
    assert (table.overshoot_percent, table.peak_time) == (found.overshoot_percent, found.peak_time)


@pytest.mark.parametrize("zeta", [0.1, 0.25, 0.7, 0.95])
def test_a_second_order_system_has_its_closed_forms(zeta):
    found = step_reading(to_control(second_order(8.0, natural_frequency=2.0, damping_ratio=zeta)))
    damped = 2.0 * math.sqrt(1.0 - zeta**2)

    def eta(t):
        return 1.0 - math.exp(-2.0 * zeta * t) * (math.cos(damped * t) + 2.0 * zeta / damped * math.sin(damped * t))

    rise = [brentq(lambda t, level=level: eta(t) - level, 0.0, math.pi / damped, xtol=1e-14) for level in (0.1, 0.9)]
    window = math.log(1e6) / (2.0 * zeta)
    exact = 1e-10 * window  # roots to 1e-12 of the window, with the rounding of a slope near its zero
    assert found.rise_time == pytest.approx(rise[1] - rise[0], abs=exact)
    assert found.peak_time == pytest.approx(math.pi / damped, abs=1e-8 * window)  # where the response is flat
    assert found.overshoot_percent == pytest.approx(100.0 * math.exp(-2.0 * math.pi * zeta / damped), abs=1e-9)
    assert abs(eta(found.settling_time) - 1.0) == pytest.approx(0.02, abs=1e-9)
    later = np.linspace(found.settling_time + 1e-9, 3.0 * window, 2000)
    assert max(abs(eta(t) - 1.0) for t in later) <= 0.02


@pytest.mark.parametrize("name", PRINTED)
def test_a_finer_grid_changes_no_reading(name):
    system = to_control(PRINTED[name])
    coarse, fine = (step_reading(system, per_time_constant=count) for count in (5, 13))
    for reading in NAMES:
        assert getattr(coarse, reading) == pytest.approx(getattr(fine, reading), rel=1e-9)  # of roots to 1e-12


@pytest.mark.parametrize(("name", "step", "duration"), [("4", 0.025, 400.0), ("6", 0.025, 400.0), ("1", 0.01, 60.0)])
def test_the_reports_sampled_responses_read_like_the_exact_ones(name, step, duration):
    """The loops of the report are measured at these steps: 2e-4 of the unit of time, 1e-3 % of overshoot."""
    found = step_reading(to_control(PRINTED[name]))
    t = np.linspace(0.0, duration, round(duration / step) + 1)
    sampled = step_metrics(t, unit_step(PRINTED[name], t))
    assert sampled.rise_time == pytest.approx(found.rise_time, abs=2e-4)
    assert sampled.settling_time == pytest.approx(found.settling_time, abs=2e-4)
    assert sampled.overshoot == pytest.approx(found.overshoot_percent, abs=1e-3)


def test_a_finer_grid_changes_no_fit_of_a_step(monkeypatch):
    pairs = (EQUATION_1, EQUATION_7), (EQUATION_4, EQUATION_6)
    coarse = [step_fit(*pair) for pair in pairs]
    monkeypatch.setattr(equations, "_INTERVALS", 4 * equations._INTERVALS)
    assert coarse == pytest.approx([step_fit(*pair) for pair in pairs], abs=1e-3)


def test_a_response_that_creeps_has_no_overshoot_and_a_jump_no_time():
    creeping = step_reading(control.tf([3.0], [1.0, 3.0, 2.0]))
    assert creeping.overshoot_percent == 0.0
    assert creeping.peak_time == pytest.approx(math.log(1e6))  # the last time evaluated
    jump = step_reading(control.tf([1.0, 2.0], [1.0, 1.0]))  # begins at half of its final value
    assert jump.rise_time == pytest.approx(math.log(0.5 / 0.1))
    assert jump.settling_time == pytest.approx(math.log(0.5 / 0.02))


test_a_system_without_a_final_value_is_refused = refused(
    ([1.0], [1.0, -1.0], "needs a stable system"),
    ([1.0, 0.0], [1.0, 1.0], "a gain at zero frequency, got 0"),
    call=lambda num, den: step_reading(control.tf(num, den)),
)


def test_the_claims_read_with_the_filter_of_the_derivative():
    """Its pole at 100 rad/s is the fastest mode, which sets the samples."""
    found = claim_values._loop_step(math.inf, claim_values.DERIVATIVE_TIME)
    assert found.overshoot_percent == pytest.approx(54.1714, abs=1e-4)
    assert found.settling_time == pytest.approx(16.6630, abs=1e-4)
