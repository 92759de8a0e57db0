"""The bandwidth that is found by running a loop is where its frequency response leaves 3 dB."""

import math

import pytest
from scipy.optimize import brentq
from strategies import assert_refused

import hysim as hs
from hysim.control import bandwidth

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
    pid = hs.PID(kp=2.0, ki=2.0)
    noisy = hs.Actuator(vibration=LAG, sensor=hs.Sensor(noise=0.5))
    assert bandwidth(noisy, pid, **SINE) == bandwidth(LAG, pid, **SINE)


def test_an_unstable_loop_is_said_to_be_one():
    assert_refused("unstable", bandwidth, LAG, hs.PID(kp=1e3), error=hs.SimulationError, **SINE | {"transient": 100.0})


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
