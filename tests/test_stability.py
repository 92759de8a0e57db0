"""No figure of a loop that is unstable or in a limit cycle is quoted, and `tune` returns no such loop."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs
from hysim.control import _tune as tuning
from hysim.control import assess_hysteresis, assess_loop, assess_square_wave, assess_step
from hysim.paper.equations import EQUATION_1

H = 0.05
T, STEP = H * np.arange(400), np.ones(400)
MODE = hs.TransferFunction(num=(1.0,), den=(1.0, 0.4, 1.0))
PI = hs.PID(kp=4.0, ki=3.0, kd=4.0, derivative_filter=0.1)  # maximum sensitivity 1.54 on MODE
SUPPLY = (0.0, 125.0)  # V


def slewing(rate):
    """The mode behind an amplifier whose slew rate no linear theory shows."""
    return hs.Actuator(amplifier=hs.Amplifier(slew_rate=rate), vibration=MODE)


def rests(plant, controller, reference):
    """Whether the loop is still where the reference has stopped for long, judged by the whole range."""
    reference = np.append(reference, np.full(8000, reference[-1]))
    y = hs.close_loop(plant, controller, H * np.arange(reference.size), reference).y
    return np.ptp(y[-2000:]) < 1e-3


@pytest.mark.parametrize("factor", [0.5, 0.95, 1.05, 1.5])
def test_a_loop_is_stable_where_the_poles_of_python_control_say_so(factor):
    """The gain is a part of the one at which a pole crosses the unit circle."""
    loop = control.ss(hs.to_control(MODE, H)) * control.ss(hs.to_control(hs.PID(ki=1.0), H))
    low, high = 0.0, 10.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        stable = np.abs(control.feedback(middle * loop, 1.0).poles()).max() < 1.0
        low, high = (middle, high) if stable else (low, middle)
    found = assess_loop(MODE, hs.PID(ki=factor * low, limits=(0.0, 3.0)), T, STEP)
    assert found.stable == (factor < 1.0)
    assert math.isfinite(found.max_sensitivity) == (factor < 1.0)
    assert ("outside the unit circle" in found.message) == (factor > 1.0)


@pytest.mark.parametrize(
    "pid",
    [
        hs.PID(kp=4417.02, ki=1054.88, kd=192.56, derivative_filter=0.00380203, setpoint_weight=0.377809,
               derivative_weight=0.990575, limits=SUPPLY),
        hs.PID(kp=26.3694, ki=1615.49, kd=407.638, derivative_filter=0.000185317, setpoint_weight=0.841153,
               derivative_weight=0.127791, limits=SUPPLY),
    ],
    ids=["from limit to limit", "within the limits"],
)  # fmt: skip
def test_a_limit_cycle_along_the_triangle_is_no_reduction(pid):
    """More than 90 % narrower than the open loop; the first one is at a limit in 98 % of the samples."""
    found = assess_hysteresis(EQUATION_1, pid, low=0.0, high=2.5, period=52.0, sample_time=0.01, cycles=3)
    relative = found.closed_width / np.ptp(found.closed.y[-5201:])
    assert relative < 0.1 * found.open_width / np.ptp(found.open_y[-5201:])
    assert (found.loop.limited_percent > 98.0) == (pid.kp > 1000.0)
    assert not found.loop.stable
    assert math.isnan(found.lag_reduction_percent)
    assert "unstable" in str(found)


@pytest.mark.parametrize(("rate", "stable"), [(0.05, False), (1.0, False), (5.0, True)])
def test_a_limit_cycle_that_linear_theory_does_not_show_is_no_reduction(rate, stable):
    """Of a few samples or of some thousand; a fast amplifier has none."""
    plant = slewing(rate)
    step = assess_step(plant, PI, step=1.0, duration=20.0, sample_time=H)
    wave = assess_square_wave(plant, PI, low=0.0, high=1.0, period=80.0, sample_time=H, periods=2)
    assert rests(plant, PI, STEP) == stable
    for found in (step, wave):
        assert found.loop.max_sensitivity < 1.6
        assert found.loop.stable == stable
        assert ("limit cycle" in str(found)) == (not stable)
    assert math.isnan(step.reduction.settling_time_reduction_percent) == (not stable)
    assert (wave.reduction is None) == (not stable)
    assert step.reduction.open.overshoot > 0.0


def test_a_limit_cycle_on_the_steps_of_the_sensor_is_one():
    """Of a coarse sensor each step moves the command from limit to limit; on a fine one it hunts within a quantum."""
    pid = replace(PI, kp=10.0, derivative_filter=0.05, limits=(-20.0, 20.0))
    coarse, fine = (
        assess_loop(hs.Actuator(vibration=MODE, sensor=hs.Sensor(quantum=quantum)), pid, T, 0.97 * STEP)
        for quantum in (0.5, 0.02)
    )
    assert max(coarse.max_sensitivity, fine.max_sensitivity) < 1.6
    assert (coarse.stable, fine.stable) == (False, True)
    assert "limit cycle" in coarse.message
    assert np.ptp(fine.closed.y[-100:]) < 0.02


def test_a_saturated_loop_a_slow_drift_and_noise_are_no_limit_cycles():
    law = hs.BoucWen(beta=0.5, gamma=0.3, gain=0.5, feedthrough=1.0)
    creeping = hs.Actuator(hysteresis=law, creep=hs.Creep.per_decade(5.0), sensor=hs.Sensor(noise=0.01))
    for plant, pid in (
        (MODE, replace(PI, limits=(0.0, 1.05), tracking_time=1e3)),
        (MODE, replace(PI, limits=(0.0, 0.5))),  # out of reach
        (MODE, hs.PID(ki=1e-4)),
        (creeping, hs.PID(ki=1.0)),
        (creeping, hs.TrackingController(feedforward=hs.InverseFeedforward(law=law))),
        (hs.mode(2.0, 0.001), hs.TrackingController(feedforward=hs.InverseFeedforward())),  # decays in 3000 s
    ):
        assert assess_loop(plant, pid, T, STEP).message == "", (plant, pid)


def test_a_row_has_what_a_reduction_is_worth():
    plant = hs.Actuator(vibration=MODE, sensor=hs.Sensor(quantum=1e-4))
    pid = replace(PI, limits=(0.0, 1.2))
    found = assess_loop(plant, pid, T, STEP, period=2.0)
    delayed = hs.Actuator(vibration=MODE, sensor=hs.Sensor(delay=H))
    run, last = hs.close_loop(plant, pid, T, STEP), slice(-40, None)
    assert found.row() == {
        "stable": True,
        "period": 2.0,
        "tracking_rms": pytest.approx(np.sqrt(np.mean((1.0 - run.y[last]) ** 2))),
        "limited_percent": pytest.approx(100.0 * np.mean(run.drive != run.command)),
        "max_sensitivity": pytest.approx(hs.control.LinearLoop(MODE, H).max_sensitivity(pid)),
        "max_sensitivity_with_delay": pytest.approx(hs.control.LinearLoop(delayed, H).max_sensitivity(pid)),
        "volts_per_quantum": pytest.approx(1e-4 * (4.0 + 4.0 / 0.15)),
    }
    assert found.row(0.1)["volts_per_quantum"] == pytest.approx(0.1 * (4.0 + 4.0 / 0.15))
    unstable = assess_loop(MODE, hs.PID(ki=3.0, limits=(0.0, 2.0)), T, STEP).row()
    assert (unstable["stable"], unstable["max_sensitivity"], unstable["period"]) == (False, None, None)


def test_a_period_longer_than_the_reference_is_named():
    assert_refused(r"period must be .* got 30.0 s", assess_loop, MODE, PI, T, STEP, period=30.0)


def test_an_unstable_loop_has_no_margins_and_no_bandwidth():
    loop = hs.control.LinearLoop(MODE, H)
    assert np.isnan(loop.margins(hs.PID(ki=3.0))).all()
    sine = {"sample_time": H, "amplitude": 1.0, "lowest": 0.1, "transient": 5.0}
    with pytest.raises(hs.SimulationError, match="unstable: it has no bandwidth"):
        hs.control.bandwidth(MODE, hs.PID(ki=3.0, limits=(-2.0, 2.0)), **sine)
    assert_refused("limit cycle", hs.control.bandwidth, slewing(1.0), PI, error=hs.SimulationError, **sine)


def test_tune_returns_loops_that_come_to_rest():
    plant, template = slewing(0.3), PI
    assert not rests(plant, PI, STEP)  # one of its starts
    found = hs.tune(plant, T, STEP, controller=template)
    assert found.success
    assert all(rests(plant, each.controller, STEP) for each in found.trade_off)
    assert rests(plant, found.controller, STEP)


def test_tune_leaves_out_what_is_in_a_limit_cycle(monkeypatch):
    """As if every loop of a larger gain than this were in one."""
    task = MODE, T[:200], STEP[:200]
    options = {"controller": hs.PID(ki=0.1), "objective": "rms"}
    free = hs.tune(*task, **options)
    bound = 0.7 * free.controller.ki
    monkeypatch.setattr(tuning, "limit_cycle", lambda _, pid, *__, **___: "cycles" if pid.ki > bound else "")
    found = hs.tune(*task, **options)
    assert found.objective > free.objective
    assert found.controller.ki <= bound
    assert all(each.controller.ki <= bound for each in found.trade_off)
    assert min(each.objective for each in found.trials) == found.objective
    monkeypatch.setattr(tuning, "limit_cycle", lambda *_, **__: "cycles")
    assert_refused("every loop that was simulated is in a limit cycle", hs.tune, *task, **options)
