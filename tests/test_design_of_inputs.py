"""Inputs that tell most of a law, within limits."""

import dataclasses

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs

LIMITS = hs.InputLimits(amplitude=2.0, slew=4.0, duration=8.0, sample_time=0.05)
FEW = {"candidates": 40, "moves": 100}
LAW, FREE, NOISE = hs.Dahl(stiffness=3.0, coulomb=0.5), ("stiffness", "coulomb", "offset"), 0.02


@pytest.fixture(scope="module")
def design():
    return hs.design_input(LAW, limits=LIMITS, free=FREE, noise=NOISE, **FEW)


def test_the_input_keeps_its_limits_and_tells_more_than_the_usual_ones(design):
    for u in (design.u, *design.beside.values()):
        assert u.shape == design.t.shape == (161,)
        assert np.abs(u).max() <= 2.0
        assert np.abs(np.diff(u)).max() <= 0.2 * (1.0 + 1e-9)  # the rounding of the times
    assert design.u[0] == 0.0
    assert set(design.efficiency) == {"triangle", "fading triangle", "multisine"}
    assert max(design.efficiency.values()) < 0.95


def test_no_limit_of_the_slew_makes_no_more_strokes_than_samples():
    assert hs.design_input(LAW, limits=dataclasses.replace(LIMITS, slew=1e12), free=FREE, **FEW).u.size == 161


def test_a_fit_to_such_a_record_has_the_expected_standard_errors(design):
    """Its noise is estimated from 161 samples: 6 % off; and so are the derivatives, at the estimates."""
    y = LAW.response(design.u) + NOISE * np.random.default_rng(4).standard_normal(design.u.size)
    fit = hs.identify(hs.Dahl, hs.Record(u=design.u, y=y), fixed={"z0": 0.0})
    for name in FREE:
        assert fit.stderr[name] == pytest.approx(design.expected_stderr[name], rel=0.25), name


@pytest.mark.parametrize("criterion", ["A", "E"])
def test_each_criterion_is_best_by_its_own_measure(design, criterion):
    other = hs.design_input(LAW, limits=LIMITS, free=FREE, noise=NOISE, criterion=criterion)
    sizes = np.array([3.0, 0.5, np.std(LAW.response(design.beside["triangle"]))])

    def variances(u):
        scaled = LAW.response_jacobian(u, FREE).matrix * sizes / NOISE
        return np.linalg.eigvalsh(np.linalg.inv(scaled.T @ scaled))

    own, before = variances(other.u), variances(design.u)
    measure = (lambda v: v.sum()) if criterion == "A" else (lambda v: v[-1])
    assert measure(own) < measure(before)


def test_a_design_is_the_same_for_the_same_seed_in_any_units(design):
    law = hs.Dahl(stiffness=3.0 * 2.0**60, coulomb=0.5 * 2.0**40)  # powers of 2: without rounding
    limits = {"amplitude": 2.0 * 2.0**-20, "slew": 4.0 * 2.0**-20, "duration": 8.0, "sample_time": 0.05}
    again = hs.design_input(law, limits=limits, free=(*FREE, "offset"), noise=NOISE * 2.0**40, **FEW)
    np.testing.assert_array_equal(again.u * 2.0**20, design.u)
    assert "D-efficiency of" in str(again)


def test_arguments_are_checked():
    assert_refused("free has 'slope': a Dahl has stiffness", hs.design_input, LAW, limits=LIMITS, free=("slope",))
    assert_refused("criterion must be one of D, A, E", hs.design_input, LAW, limits=LIMITS, free=FREE, criterion="G")
    assert_refused("limits must be a mapping, got NoneType", hs.design_input, LAW, error=TypeError, limits=None)
    assert_refused("whole number, got 2.5", hs.design_input, LAW, error=TypeError, limits=LIMITS, candidates=2.5)
    assert_refused("slew must be positive", hs.InputLimits, amplitude=1.0, slew=0.0, duration=1.0, sample_time=0.01)
    assert_refused("at least 10 samples, got 6", hs.InputLimits, amplitude=1.0, slew=1.0, duration=0.5, sample_time=0.1)
    with pytest.raises(ValueError, match="no input within the limits tells A, gain, beta, gamma apart"):
        hs.design_input(hs.BoucWen(), limits=LIMITS, free=("A", "gain", "beta", "gamma"), candidates=4, moves=2)
    assert_refused(r"or an Actuator\.structure", hs.design_input, hs.PID(kp=1.0), error=TypeError, limits=LIMITS)
