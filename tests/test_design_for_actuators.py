"""Inputs that tell law, creep and mode of a whole actuator apart."""

import numpy as np
import pytest
from strategies import refused

import hysim as hs

CREEP, DELAY = "creep.percent", "vibration.delay"
FREQUENCY, DAMPING = "vibration.natural_frequencies[0]", "vibration.damping_ratios[0]"
VALUES = {CREEP: 2.0, FREQUENCY: 600.0, DAMPING: 0.03, DELAY: 0.7e-3}
LAW = hs.Play(threshold=0.2, gain=1.5)
STRUCTURE = hs.Actuator.structure(LAW, sensor=hs.Sensor(noise=2e-3))
LIMITS = hs.InputLimits(amplitude=1.0, centre=0.5, slew=100.0, duration=0.4, sample_time=1e-3)
FEW = {"candidates": 20, "moves": 10}


def stage(**changed):
    values = {"hysteresis.threshold": 0.2, "hysteresis.gain": 1.5, **VALUES, **changed}
    return hs.Actuator(
        hysteresis=hs.Play(threshold=values["hysteresis.threshold"], gain=values["hysteresis.gain"]),
        creep=hs.Creep.per_decade(values[CREEP]),
        vibration=hs.mode(values[FREQUENCY], values[DAMPING], delay=values[DELAY]),
    )


@pytest.fixture(scope="module")
def design():
    return hs.design_input(STRUCTURE, limits=LIMITS, values=VALUES, **FEW)


def test_the_input_keeps_its_limits_and_is_no_worse_than_the_usual_ones(design):
    assert design.u[0] == 0.5
    for u in (design.u, *design.beside.values()):
        assert u.shape == design.t.shape == (401,)
        assert np.abs(u - 0.5).max() <= 1.0 + 1e-12
        assert np.abs(np.diff(u)).max() <= 0.1 * (1.0 + 1e-9)  # the rounding of the times
    assert set(design.efficiency) == {"triangle", "fading triangle", "multisine"}
    assert max(design.efficiency.values()) < 1.0
    assert design.noise == 2e-3
    assert design.remarks == ("no input within the limits determines hysteresis.z0; it is taken as known, 0",)
    assert np.abs(design.correlation).max() == pytest.approx(1.0)
    assert "creep" in str(design)


def test_expected_errors_are_those_of_differences_of_the_response(design):
    """Sums of squares of central differences of whole responses, some of them to a part in a thousand."""
    values = {"hysteresis.threshold": 0.2, "hysteresis.gain": 1.5, **VALUES}
    slopes = {}
    for name, value in values.items():
        step = 1e-4 * value
        ends = (stage(**{name: value + side * step}).response(design.u, 1e-3) for side in (1.0, -1.0))
        slopes[name] = np.subtract(*ends) / (2.0 * step)
    slopes["hysteresis.offset"] = np.full(design.u.size, hs.Creep.per_decade(2.0).dc_gain)
    names = list(design.expected_stderr)
    jacobian = np.column_stack([slopes[name] for name in names]) / 2e-3
    lengths = np.linalg.norm(jacobian, axis=0)
    covariance = np.linalg.inv((jacobian / lengths).T @ (jacobian / lengths)) / np.outer(lengths, lengths)
    np.testing.assert_allclose(list(design.expected_stderr.values()), np.sqrt(np.diag(covariance)), rtol=1e-3)


def test_a_fit_to_such_a_record_has_the_expected_standard_errors(design):
    """Its noise is estimated from 401 samples, 4 % off, and the derivatives are those at the estimates."""
    y = stage().response(design.u, 1e-3) + 2e-3 * np.random.default_rng(3).standard_normal(design.u.size)
    record = hs.Record(u=design.u, y=y, t=design.t)
    fit = hs.identify(hs.Actuator.structure(hs.Play), record, fixed={"hysteresis.z0": 0.0},
                      bounds={FREQUENCY: (400.0, 900.0)})  # fmt: skip
    assert fit.message == "converged"
    for name, error in design.expected_stderr.items():
        assert fit.stderr[name] == pytest.approx(error, rel=0.3), name
    for name, value in VALUES.items():
        assert abs(fit.estimates[name] - value) < 4.0 * design.expected_stderr[name], name
    again = hs.design_input(
        STRUCTURE, limits=LIMITS, values=fit.estimates, free=fit.free_names, candidates=0, moves=0,
        beside={"before": design.u},
    )  # fmt: skip
    assert set(again.expected_stderr) == set(design.expected_stderr)
    assert again.beside_stderr["before"][CREEP] == pytest.approx(design.expected_stderr[CREEP], rel=0.3)


def test_numbers_that_are_not_free_are_known():
    some = hs.design_input(STRUCTURE, limits=LIMITS, values=VALUES, free=(CREEP, "hysteresis.gain"), noise=0.01, **FEW)
    assert set(some.expected_stderr) == {CREEP, "hysteresis.gain"}
    assert some.noise == 0.01


def test_what_no_input_within_the_limits_shows_is_said():
    slow = hs.InputLimits(amplitude=1.0, slew=4.0, duration=0.4, sample_time=1e-3)
    weak = hs.design_input(STRUCTURE, limits=slow, values=VALUES, noise=0.5, **FEW)
    said = "; ".join(weak.remarks)
    for name in (FREQUENCY, CREEP):
        assert f"no input within the limits determines {name}" in said
        assert name not in weak.expected_stderr
    assert "hysteresis.gain" in weak.expected_stderr
    coarse = hs.InputLimits(amplitude=1.0, slew=100.0, duration=2.0, sample_time=6e-3)
    free = ("hysteresis.gain", CREEP, FREQUENCY)
    without = hs.design_input(STRUCTURE, limits=coarse, values=VALUES, free=free, **FEW)
    assert any("no input shows this mode, and it is left out" in remark for remark in without.remarks)
    assert set(without.expected_stderr) == {"hysteresis.gain", CREEP}


def test_a_rounding_sensor_has_the_noise_of_its_rounding():
    rounding = hs.Actuator.structure(LAW, sensor=hs.Sensor(noise=3e-3, quantum=4e-3))
    rounded = hs.design_input(rounding, limits=LIMITS, values=VALUES, free=(CREEP,), candidates=0, moves=0)
    assert rounded.noise == pytest.approx(np.sqrt(9e-6 + 16e-6 / 12.0))


WITHOUT_NUMBERS = hs.Actuator.structure(hs.PrandtlIshlinskii.structure(plays=3))
test_arguments_are_checked = refused(
    (STRUCTURE, {"values": None}, r"values must give vibration.natural_frequencies\[0\] \[rad/s\]"),
    (STRUCTURE, {"values": VALUES | {"creep.growth": 1.0}}, r"values names 'creep\.growth'"),
    (STRUCTURE, {"free": ("creep.growth",)}, r"free names 'creep\.growth'"),
    (
        STRUCTURE,
        {"values": VALUES | {DAMPING: 5.0}},
        r"damping_ratios.* = 5 is outside the range that identify searches",
    ),
    (STRUCTURE, {"highest_frequency": 600.0}, "highest_frequency must be positive and at most 500 Hz"),
    (STRUCTURE, {"beside": {"mine": np.zeros(3)}}, r"beside\['mine'\] must hold 401 samples, got 3"),
    (WITHOUT_NUMBERS, {}, TypeError, "hysteresis must be a law with its numbers"),
    (LAW, {"free": ("threshold",)}, "values are for the structure of an actuator"),
    (STRUCTURE, {"noise": 0.0}, "noise must be positive"),
    call=lambda subject, options: hs.design_input(subject, **{"limits": LIMITS, "values": VALUES, **FEW, **options}),
)
