"""Margins and bandwidths of sampled loops are those of their frequency responses; unstable loops have none.

Dense grids are the slow reference of the maximum sensitivity: a million frequencies over four decades are 1e-5 of a
frequency apart, a hundredth of the half width of the sharpest mode.
"""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.optimize import brentq
from strategies import assert_refused

import hysim as hs
from hysim.control import _tune as tuning
from hysim.control import assess_hysteresis, assess_loop, assess_square_wave, assess_step, bandwidth
from hysim.paper.equations import EQUATION_1

H = 0.05
PLANTS = [
    hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)),
    hs.TransferFunction(num=(1.0,), den=(1.0, 0.3, 1.0), delay=0.12),
    hs.TransferFunction(num=(0.2, 1.0), den=(1.0, 0.8)),
]


@given(
    st.sampled_from(PLANTS),
    st.floats(0.01, 30.0),  # python-control warns of gains that are nearly nothing
    st.sampled_from([0.0, 0.3, 2.0, 9.0, 30.0]),
    st.sampled_from([0.0, 0.05, 0.4, 3.0]),
    st.floats(0.0, 1.0),
    st.floats(0.2, 2.0),
)
def test_stability_is_that_of_the_closed_loops_poles(plant, kp, ki, kd, derivative_filter, slope):
    pid = hs.PID(kp=kp, ki=ki, kd=kd, derivative_filter=derivative_filter)
    loop = slope * hs.to_control(plant, H) * control.ss(hs.to_control(pid, H))
    largest = np.abs(control.feedback(loop).poles()).max(initial=0.0)
    if abs(largest - 1.0) > 1e-6:  # poles near the circle depend on rounding
        assert hs.control.LinearLoop(plant, H).is_stable(pid, slope) == (largest < 1.0)


def densely(plant, h, controller, slope):
    """The largest sensitivity of a million frequencies."""
    angles = np.geomspace(1e-4 * np.pi, np.pi, 1_000_000)
    loop = signal.freqz(*discrete(plant, h), angles)[1] * controller.frequency_response(angles / h, h)
    return float(np.max(1.0 / np.abs(1.0 + slope * loop)))


def discrete(plant, h):
    """Numerator and denominator in 1 / z, from the system's matrices."""
    system = hs.to_control(plant, h)
    num, den = signal.ss2tf(system.A, system.B, system.C, system.D)
    return num[0], den


@settings(max_examples=6)
@given(
    st.lists(st.tuples(st.floats(0.02, 2.5), st.floats(-3.0, np.log10(0.5))), min_size=1, max_size=2),
    st.sampled_from([0.0, 1.0, 1.4]),
    st.floats(-2.0, -0.05),
    st.sampled_from([(0.0, 1.0, 0.0), (0.3, 1.0, 0.0), (0.05, 1.0, 0.05)]),
    st.booleans(),
)
def test_the_maximum_sensitivity_is_that_of_a_million_frequencies(modes, delay, margin, shape, notched):
    """Modes of any damping from 0.001, and gains from next to nothing to nearly unstable."""
    frequencies, exponents = np.transpose(modes)
    vibration = hs.Modes(natural_frequencies=frequencies, damping_ratios=10.0**exponents, gains=np.ones(len(modes)))
    plant = hs.Actuator(vibration=vibration, sensor=hs.Sensor(delay=delay))
    loop = hs.control.LinearLoop(plant, 1.0)
    (kp, ki, kd), notch = shape, hs.Notch(natural_frequency=modes[0][0], damping_ratio=0.01) if notched else None

    def scaled(factor):
        pid = hs.PID(kp=kp * factor, ki=ki * factor, kd=kd * factor)
        return hs.TrackingController(feedback=pid, notch=notch)

    stable, unstable = 0.0, 1e3
    for _ in range(30):
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if loop.is_stable(scaled(middle)) else (stable, middle)
    controller = scaled(10.0**margin * stable)
    found = loop.max_sensitivity(controller)
    assert found == pytest.approx(densely(plant, 1.0, controller, 1.0), rel=1e-3) if found < 50.0 else found < math.inf


def test_the_gain_of_the_noise_is_that_of_long_loops():
    plant = hs.Actuator(
        amplifier=hs.Amplifier(gain=2.0), vibration=hs.mode(1.0, 0.05), sensor=hs.Sensor(noise=0.1, delay=H)
    )
    controller = hs.TrackingController(
        feedback=hs.PID(kp=0.1, ki=0.02, kd=0.1),
        notch=hs.Notch(natural_frequency=1.0, damping_ratio=0.05),
        damping=hs.DampingLoop(gain=0.05, frequency=1.0),
    )
    run = hs.close_loop(plant, controller, H * np.arange(400_000), np.zeros(400_000))
    expected = 2.0 * 0.1 * hs.control.LinearLoop(plant, H).noise_gain(controller)
    assert run.conditions["voltage_noise_rms"] == pytest.approx(expected, rel=0.02)  # of some 1e4 independent samples
    assert hs.control.LinearLoop(plant, H).noise_gain(hs.PID(kp=50.0)) == math.inf
    assert hs.control.LinearLoop(plant, H).noise_gain(hs.PID()) == 0.0


@pytest.mark.parametrize("plant", PLANTS)
def test_the_maximum_sensitivity_is_the_distance_from_minus_one(plant):
    pid = hs.PID(kp=0.4, ki=0.3, kd=0.05, derivative_filter=0.1)
    linear = hs.control.LinearLoop(plant, H)
    loop = np.asarray((hs.to_control(plant, H) * hs.to_control(pid, H))(np.exp(1j * linear.frequencies * H)))
    assert linear.response(pid) == pytest.approx(loop, rel=1e-9)  # two ways of multiplying polynomials
    assert linear.max_sensitivity(pid) == pytest.approx(densely(plant, H, pid, 1.0), rel=1e-3)  # as promised
    assert linear.max_sensitivity(pid, 1e6) == math.inf


def test_margins_do_not_end_with_the_frequencies():
    """The lag's gain margin is that at z = -1; the crossover of a slow integral is at its gain."""
    whole, part = (hs.control.LinearLoop(LAG, H, each) for each in (None, np.geomspace(0.1, 20.0, 300)))
    assert part.margins(hs.PID(kp=5.0)) == pytest.approx(whole.margins(hs.PID(kp=5.0)), rel=1e-4)  # interpolated
    assert whole.margins(hs.PID(ki=1e-4))[1] == pytest.approx(90.0 - np.degrees(1e-4 * (1.0 + H)), abs=1e-3)
    late = hs.control.LinearLoop(hs.Actuator(vibration=hs.mode(20.0, 0.01), sensor=hs.Sensor(delay=4.0 * H)), H)
    assert 90.0 < late.margins(hs.PID(kp=0.047, ki=0.004))[1] < 93.0  # at the resonance 98 degrees of lead are left
    unstable, pid = hs.TransferFunction(num=(1.0,), den=(1.0, -1.0)), hs.PID(kp=30.0, ki=0.5)  # 1 / 30 is farther off
    assert hs.control.LinearLoop(unstable, H).margins(pid)[0] == pytest.approx(1.0 / (30.0 * np.tanh(H / 2)), rel=1e-3)


def test_a_controller_of_parts_has_the_margins_of_its_feedback():
    w, pid, fast = 2.0 * np.pi * 500.0, hs.PID(ki=30.0), hs.PID(ki=300.0)
    loop = hs.control.LinearLoop(hs.Actuator(vibration=hs.mode(w, 0.01), sensor=hs.Sensor(delay=5e-5)), 5e-5)
    alone = loop.max_sensitivity(pid)
    assert loop.max_sensitivity(hs.TrackingController(feedback=pid)) == alone
    assert alone == pytest.approx(1.0 / (1.0 - 30.0 / (2.0 * 0.01 * w)), rel=0.05)  # at the resonance
    notched = hs.TrackingController(feedback=fast, notch=hs.Notch(natural_frequency=w, damping_ratio=0.01))
    damped = hs.TrackingController(feedback=fast, damping=hs.DampingLoop(gain=0.5, frequency=w / 3.0))
    assert loop.max_sensitivity(fast) == np.inf
    assert loop.max_sensitivity(notched) < 1.3
    assert loop.max_sensitivity(damped) < 3.0


# ------------------------------------------------------------------------ the bandwidth that is found by running a loop


LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
SINE = {"sample_time": 0.01, "amplitude": 0.5, "lowest": 0.2, "transient": 10.0}


def test_it_is_that_of_the_frequency_response():
    pid = hs.PID(kp=9.0, ki=9.0)

    def gain(frequency):
        loop = hs.control.LinearLoop(LAG, 0.01, [frequency]).response(pid)[0]
        return abs(loop / (1.0 + loop)) - math.sqrt(0.5)

    # ten halvings of a 24th of a decade
    assert bandwidth(LAG, pid, **SINE) == pytest.approx(brentq(gain, 1.0, 50.0), rel=1e-4)


def test_a_resonance_leaves_the_band_upwards():
    passed_on = hs.TrackingController(feedforward=hs.InverseFeedforward())
    found = bandwidth(hs.mode(5.0, 0.05), passed_on, **(SINE | {"transient": 40.0}))
    # |1 - r^2 + 2 j zeta r|^2 = 1 / 2; the hold's gain there is within 1e-4 of one
    r = brentq(lambda r: (1.0 - r**2) ** 2 + (0.1 * r) ** 2 - 0.5, 0.1, 1.0)
    assert found == pytest.approx(5.0 * r, rel=1e-3)


def test_a_perfect_inverse_has_no_end_and_a_poor_gain_no_begin():
    law = hs.BoucWen(feedthrough=1.0, gain=0.5)
    inverse = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law))
    assert bandwidth(law, inverse, **SINE) == math.inf
    half = hs.TrackingController(feedforward=hs.InverseFeedforward(law=hs.Line(slope=2.0)))
    assert bandwidth(hs.Line(slope=1.0), half, **SINE) == 0.0


def test_noise_is_left_out():
    noisy, pid = hs.Actuator(vibration=LAG, sensor=hs.Sensor(noise=0.5)), hs.PID(kp=2.0, ki=2.0)
    assert bandwidth(noisy, pid, **SINE) == bandwidth(LAG, pid, **SINE)


@pytest.mark.parametrize("name", ["amplitude", "lowest"])
def test_what_is_not_positive_is_refused(name):
    assert_refused(name, bandwidth, LAG, hs.PID(ki=1.0), **SINE | {name: 0.0})


def test_each_gain_is_fitted_to_four_periods_or_64_samples_behind_the_transient(monkeypatch):
    """By the references that the loop is given: their lengths, and the sines themselves."""
    tried, run = [], hs.control.RestingPlant.run

    def spied(plant, controller, reference, *others):
        tried.append(reference - plant.y0)
        return run(plant, controller, reference, *others)

    monkeypatch.setattr(hs.control.RestingPlant, "run", spied)
    assert bandwidth(LAG, hs.PID(kp=9.0, ki=9.0), **(SINE | {"transient": 1.0})) == pytest.approx(9.0, rel=0.1)
    sines = [sine for sine in tried if abs(sine[0]) < 1e-12 and sine.size >= 164]
    frequencies = [math.asin(sine[1] / 0.5) / 0.01 for sine in sines]
    assert min(frequencies) == pytest.approx(0.2)
    assert len(sines) > 30
    for sine, frequency in zip(sines, frequencies, strict=True):
        samples = 2.0 * math.pi * 4.0 / (frequency * 0.01)
        assert sine.size == pytest.approx(100 + max(64.0, samples), abs=1.0)
    inverse = hs.TrackingController(feedforward=hs.InverseFeedforward())
    assert bandwidth(hs.Line(slope=1.0), inverse, **(SINE | {"transient": 0.0})) == math.inf
    assert tried[-1].size == 64  # the highest frequency has 2.5 samples in a period


# --------------------------------------------------- no figure of a loop that is unstable or in a limit cycle is quoted


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
    assert (step.reduction.open.overshoot > 0.0) == (rate > 0.05), "the slowest amplifier still rises at the end"


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
    assert np.isnan(hs.control.LinearLoop(MODE, H).margins(hs.PID(ki=3.0))).all()
    sine = {"sample_time": H, "amplitude": 1.0, "lowest": 0.1, "transient": 5.0, "error": hs.SimulationError}
    for pid in (hs.PID(ki=3.0), hs.PID(ki=3.0, limits=(-2.0, 2.0))):
        assert_refused("unstable: it has no bandwidth", bandwidth, MODE, pid, **sine)
    assert_refused("limit cycle", bandwidth, slewing(1.0), PI, **sine)


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
