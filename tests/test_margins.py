"""The margins of a sampled linear loop are those that python-control finds, and unstable loops have none."""

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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


@pytest.mark.parametrize("plant", PLANTS)
def test_the_maximum_sensitivity_is_the_distance_from_minus_one(plant):
    pid = hs.PID(kp=0.4, ki=0.3, kd=0.05, derivative_filter=0.1)
    linear = hs.control.LinearLoop(plant, H)
    loop = np.asarray((hs.to_control(plant, H) * hs.to_control(pid, H))(np.exp(1j * linear.frequencies * H)))
    assert linear.response(pid) == pytest.approx(loop, rel=1e-9)  # two ways of multiplying polynomials
    assert linear.max_sensitivity(pid) == pytest.approx(np.max(1.0 / np.abs(1.0 + loop)), rel=1e-9)
    assert linear.max_sensitivity(pid, 1e6) == math.inf


def test_a_controller_of_parts_has_the_margins_of_its_feedback():
    plant = hs.Actuator(vibration=hs.mode(2.0 * np.pi * 500.0, 0.01), sensor=hs.Sensor(delay=5e-5))
    pid = hs.PID(ki=30.0)
    around = np.union1d(np.geomspace(1.0, 6e4, 200), 2.0 * np.pi * 500.0 * np.linspace(0.9, 1.1, 201))
    loop = hs.control.LinearLoop(plant, 5e-5, around)
    alone = loop.max_sensitivity(pid)
    assert loop.max_sensitivity(hs.TrackingController(feedback=pid)) == alone
    assert alone == pytest.approx(1.0 / (1.0 - 30.0 / (2.0 * 0.01 * 2.0 * np.pi * 500.0)), rel=0.05)  # at the resonance
    assert hs.control.LinearLoop(plant, 5e-5).max_sensitivity(pid) < 0.9 * alone  # which the default passes by
    notched = hs.TrackingController(
        feedback=hs.PID(ki=300.0), notch=hs.Notch(natural_frequency=2.0 * np.pi * 500.0, damping_ratio=0.01)
    )
    damped = hs.TrackingController(
        feedback=hs.PID(ki=300.0), damping=hs.DampingLoop(gain=0.5, frequency=2.0 * np.pi * 500.0 / 3.0)
    )
    assert loop.max_sensitivity(hs.PID(ki=300.0)) == np.inf
    assert loop.max_sensitivity(notched) < 1.3
    assert loop.max_sensitivity(damped) < 3.0
