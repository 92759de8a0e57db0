"""Classes, units, starts and names that a verb would take for something else are refused, or said."""

import numpy as np
import pytest
from strategies import refused

import hysim as hs

T = 1e-3 * np.arange(400)
U = 20.0 * np.sin(40.0 * T)
IN_MS = hs.Record(t=1e3 * T, u=U, y=0.1 * U, units={"t": "ms"})
IN_V, IN_MV = hs.Record(u=U, y=U, units={"u": "V"}), hs.Record(u=1e3 * U, y=U, units={"u": "mV"})
FRAME = hs.shear_frame([1.0, 1.0], laws=[hs.Line(slope=9.0)] * 2, damping=hs.ModalDamping(ratio=0.03))
ACTUATOR = hs.Actuator(hysteresis=hs.Line(slope=0.02), vibration=hs.mode(20.0, 0.02))

test_a_class_is_no_model = refused(
    (lambda: hs.simulate(hs.BoucWen, T, U), "got the class BoucWen"),
    (lambda: hs.close_loop(hs.Dahl, hs.PID(ki=1.0), T, U), "got the class Dahl"),
    (lambda: hs.close_loop(hs.Dahl(), hs.PID, T, U), "got the class PID"),
    (lambda: hs.InverseFeedforward(law=hs.Chan), "got the class Chan"),
    (lambda: hs.Actuator(hysteresis=hs.Tellinen), "got the class Tellinen"),
    (lambda: hs.Element(hs.Play, between=(0, 1)), "got the class Play"),
    (lambda: hs.to_c(hs.LuGre), "got the class LuGre"),
    (lambda: hs.plot.loop(IN_V, hs.Line), "got the class Line"),
    error=TypeError,
)

test_units_that_differ_are_refused = refused(
    (lambda: hs.plot.loop(IN_V, IN_MV), "one axis cannot show u in V and mV"),
    (lambda: hs.identify(hs.Actuator.structure(hs.BoucWen), IN_MS), "creep is searched on times in s, .* in ms"),
    (lambda: hs.to_fmu(ACTUATOR, "k.fmu", sample_time=1.0, units={"t": "ms"}), "time of a unit is in s, got ms"),
    (lambda: hs.load_ground_motion("none.csv", units={"u": "g"}), TypeError, "units is that of the accelerations"),
)


def test_one_unit_in_two_spellings_and_an_unknown_one_are_drawn():
    units = {"y": "um"}, {"y": "\u00b5m"}, {"y": "\u03bcm"}, {"y": ""}, {"t": "s"}, {"t": "ms"}
    hs.plot.loop(*(hs.Record(t=T, u=U, y=U, units=each) for each in units), ax=hs.plot.figure().add_subplot())


test_numbers_without_a_meaning_are_refused = refused(
    (lambda: FRAME.responses({"mass": [1.0, -0.1]}, U, sample_time=1e-3), "mass must be positive, got -0.1"),
    (lambda: FRAME.responses({"damping": [-0.1]}, U, sample_time=1e-3), "damping must not be negative, got -0.1"),
    (lambda: hs.to_c(hs.BoucWen(), u0=7.0), "a BoucWen begins at the u0 of its law"),
    (
        lambda: hs.identify(hs.Line, IN_V, fixed={"slope": 1.0}, bounds={"slope": (0.0, 2.0)}),
        "'slope' is fixed, and has bounds",
    ),
    (
        lambda: hs.compare_evidence({"line": hs.Line}, IN_V, priors={"lin": {"slope": (0.0, 2.0)}}),
        "priors are for 'lin', .*; did you mean 'line'",
    ),
)


def test_times_in_ms_are_taken_where_no_creep_is_searched():
    structure = hs.Actuator.structure(hs.Line, creep=False)
    with pytest.raises(ValueError, match=r"rad/ms \(.* cycles/ms\) is beyond half the highest"):
        hs.identify(structure, IN_MS, fixed={"vibration.natural_frequencies[0]": 9.0})
    assert hs.identify(structure, IN_MS).fit_percent > 99.0


@pytest.mark.parametrize(("units", "to"), [({"y": "m/s^2"}, "mm/s^2"), ({"y": "kA/m"}, "A/m")])
def test_a_quotient_has_the_prefix_above(units, to):
    np.testing.assert_allclose(hs.Record(u=U, y=U, units=units).convert({"y": to}).y, 1e3 * U)


def test_a_loop_that_jumps_between_its_limits_is_not_called_out_of_reach():
    plant = hs.Actuator(hysteresis=hs.Line(slope=0.02), sensor=hs.Sensor(delay=1e-3))
    with pytest.warns(hs.HysimWarning, match="it jumps from one to the other, as an unstable loop does"):
        hs.close_loop(plant, hs.PID(ki=2e5, limits=(0.0, 100.0)), T, 0.5 + 0.3 * np.sin(20.0 * T))
    with pytest.warns(hs.HysimWarning, match="the reference is out of reach"):
        hs.close_loop(plant, hs.PID(ki=100.0, limits=(0.0, 100.0)), T, 5.0 * np.sin(20.0 * T))
    with pytest.warns(hs.HysimWarning, match="the reference is out of reach"):
        hs.close_loop(plant, hs.PID(kp=1e3, limits=(0.0, 100.0)), T, np.full(T.size, 50.0))


def test_an_offset_within_bounds_is_not_said_to_be_missing():
    record = hs.Record(u=U, y=hs.Dahl(stiffness=0.1, coulomb=0.5).response(U))
    fit = hs.identify(hs.Dahl, record, bounds={"offset": (0.3, 0.4)})
    assert any("that the model lacks, or holds within bounds" in each for each in fit.warnings)


def test_rounding_is_not_compared():
    u = hs.signals.triangle(0.0, 10.0, cycles=4, samples_per_cycle=50)
    found = hs.discover(hs.Record(u=u, y=2.0 * u + 1.0))
    assert "as well as a model with memory (rmse 0 against 0)" in " ".join(found.warnings)
