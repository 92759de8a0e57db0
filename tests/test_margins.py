"""The margins of a sampled linear loop are those that python-control finds, and unstable loops have none.

Dense grids are the slow reference of the maximum sensitivity: a million frequencies over four decades are 1e-5 of a
frequency apart, a hundredth of the half width of the sharpest mode.
"""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

import hysim as hs

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
    plant = hs.Modes(
        natural_frequencies=[w for w, _ in modes],
        damping_ratios=[10.0**exponent for _, exponent in modes],
        gains=np.ones(len(modes)),
    )
    plant = hs.Actuator(vibration=plant, sensor=hs.Sensor(delay=delay))
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


def test_a_controller_of_parts_has_the_margins_of_its_feedback():
    plant = hs.Actuator(vibration=hs.mode(2.0 * np.pi * 500.0, 0.01), sensor=hs.Sensor(delay=5e-5))
    pid = hs.PID(ki=30.0)
    loop = hs.control.LinearLoop(plant, 5e-5)
    alone = loop.max_sensitivity(pid)
    assert loop.max_sensitivity(hs.TrackingController(feedback=pid)) == alone
    assert alone == pytest.approx(1.0 / (1.0 - 30.0 / (2.0 * 0.01 * 2.0 * np.pi * 500.0)), rel=0.05)  # at the resonance
    notched = hs.TrackingController(
        feedback=hs.PID(ki=300.0), notch=hs.Notch(natural_frequency=2.0 * np.pi * 500.0, damping_ratio=0.01)
    )
    damped = hs.TrackingController(
        feedback=hs.PID(ki=300.0), damping=hs.DampingLoop(gain=0.5, frequency=2.0 * np.pi * 500.0 / 3.0)
    )
    assert loop.max_sensitivity(hs.PID(ki=300.0)) == np.inf
    assert loop.max_sensitivity(notched) < 1.3
    assert loop.max_sensitivity(damped) < 3.0
