"""Masses on friction: against SciPy's solvers, against the laws that friction contains, and in a control loop."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from friction_laws import FAMILIES
from scipy.integrate import solve_ivp
from strategies import COMPILED, assert_refused, needs_compiled

import hysim as hs

H = 0.01
T = H * np.arange(801 if COMPILED else 41)
FORCE = 3.0 * np.sin(2.0 * T) * (1.0 + 0.5 * np.sin(0.7 * T)) + 0.3 * np.sin(9.0 * T)
CURVE = {"coulomb": 1.0, "breakaway": 1.6, "stribeck_velocity": 0.1}
LAWS = {
    "LuGre": hs.LuGre(sigma0=400.0, sigma1=4.0, sigma2=0.3, **CURVE),
    "LuGre, damping that falls": hs.LuGre(sigma0=4e3, sigma1=40.0, sigma2=0.3, damping_velocity=0.05, **CURVE),
    "StribeckFriction": hs.StribeckFriction(breakaway_velocity=0.1, viscous=0.2),
    "GeneralizedMaxwellSlip": hs.GeneralizedMaxwellSlip(
        stiffness=(600.0, 200.0, 80.0), weights=(0.3, 0.3, 0.4), attraction=20.0, viscous=0.2, **CURVE
    ),
    "ElasticBacklash": hs.ElasticBacklash(stiffness=200.0, damping=2.0, half_gap=0.1, center=0.02),
}
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
ARTICLE = hs.LuGre(sigma0=1e5, sigma1=np.sqrt(1e5), sigma2=0.4, coulomb=1.0, breakaway=1.5, stribeck_velocity=0.001)


def mass_on(*laws, **options):
    """One kilogram on a spring and on friction to the ground, under a force."""
    elements = [hs.Element(law, between=(0, 1)) for law in laws]
    return hs.Structure(elements=elements, **{"mass": 1.0, "stiffness": 5.0, "excitation": "force", **options})


def reference(law, t, force, stiffness):
    """Displacement of a mass on LuGre friction by LSODA, from sample to sample."""

    def slope(now, s):
        x, v, z = s
        bristles = v - law.sigma0 * abs(v) * z / float(law.friction(v))
        damping = law.sigma1 * (np.exp(-((v / law.damping_velocity) ** 2)) if law.damping_velocity else 1.0)
        friction = law.sigma0 * z + damping * bristles + law.sigma2 * v
        return [v, np.interp(now, t, force) - stiffness * x - friction, bristles]

    s, x = np.zeros(3), [0.0]
    for begin, end in pairwise(t):
        s = solve_ivp(slope, (begin, end), s, method="LSODA", rtol=1e-11, atol=1e-14).y[:, -1]
        x.append(s[0])
    return np.array(x)


def off(x, expected):
    return float(np.abs(x - expected).max() / np.ptp(expected))


def test_every_friction_law_is_tried():
    assert {type(law) for law in LAWS.values()} == set(FAMILIES)


@every_law
def test_tolerances_and_finer_samples_agree_and_energies_balance(law):
    plant = mass_on(law, tolerance=1e-9)
    signals = plant.signals(FORCE, H)
    assert np.abs(signals["imbalance"]).max() < 3e-7 * signals["input_work"].max()
    tight = replace(plant, tolerance=1e-10).response(FORCE, H)
    fine = np.interp(np.arange(2 * T.size - 1) / 2.0, np.arange(T.size), FORCE)
    # errors accumulate over the slips, each of which begins where the error of the one before allows
    assert off(signals["y"], tight) < 3e-6
    assert off(plant.response(fine, H / 2.0)[::2], tight) < 3e-6
    first, state = plant.advance(FORCE[:30], sample_time=H)
    second, _ = plant.advance(FORCE[30:], state, sample_time=H)
    assert np.concatenate([first["y"], second["y"]]).tolist() == signals["y"].tolist()


@pytest.mark.parametrize("name", ["LuGre", "LuGre, damping that falls"])
def test_a_mass_on_bristles_moves_as_its_equations_say(name):
    n = 301 if COMPILED else 21
    expected = reference(LAWS[name], T[:n], FORCE[:n], 5.0)
    assert off(mass_on(LAWS[name], tolerance=1e-10).response(FORCE[:n], H), expected) < 1e-6
    assert off(mass_on(LAWS[name]).response(FORCE[:n], H), expected) < 1e-5


def test_the_slips_of_a_pulled_mass_are_those_of_the_equations():
    """The stick-slip motion of Canudas de Wit, Olsson, Astrom and Lischinsky (1995): 1 kg, 2 N/m, 0.1 m/s."""
    t = 0.01 * np.arange(1001 if COMPILED else 101)
    x = mass_on(ARTICLE, stiffness=2.0, tolerance=1e-10).response(0.2 * t, 0.01)
    expected = reference(ARTICLE, t, 0.2 * t, 2.0)
    # bristles bend by 1e-5 of the way: an error of 1e-10 of the way is one of 1e-5 of the friction
    assert np.abs(x - expected).max() < 1e-5
    if COMPILED:
        velocity = np.diff(x) / 0.01
        assert 0.5 < (velocity < 1e-3).mean() < 0.95
        assert velocity.max() > 0.2


def test_bristles_without_rates_are_dahls_law_in_structures():
    law = hs.LuGre(sigma0=400.0, coulomb=1.2, breakaway=1.2)
    dahl = hs.Dahl(stiffness=400.0, coulomb=1.2)
    x, expected = (mass_on(each).signals(FORCE, H) for each in (law, dahl))
    # nodes and error estimates are the same, the roundings are not
    assert off(x["y"], expected["y"]) < 1e-7
    assert off(x["force"], expected["force"]) < 1e-7


def test_an_even_friction_is_maxwell_slip_in_structures():
    stiffness, weights = (600.0, 100.0), (0.4, 0.6)
    law = hs.GeneralizedMaxwellSlip(stiffness=stiffness, weights=weights, coulomb=1.2, breakaway=1.2)
    plain = hs.MaxwellSlip.from_limits(stiffness=stiffness, limits=1.2 * np.array(weights))
    assert off(mass_on(law).response(FORCE, H), mass_on(plain).response(FORCE, H)) < 1e-5


def test_a_shaft_without_a_gap_is_a_spring_and_a_dashpot():
    law = hs.ElasticBacklash(stiffness=200.0, damping=2.0)
    spring = hs.Line(slope=200.0) + hs.Dashpot(c=2.0)
    assert off(mass_on(law).response(FORCE, H), mass_on(spring).response(FORCE, H)) < 1e-8


def test_slow_motions_have_the_friction_of_rest():
    law = hs.LuGre(sigma0=400.0, sigma1=4.0, sigma2=9.0, **CURVE)
    control = np.array([0.0, 0.002, 0.02, 0.01, -0.02])
    slow, dahl = (mass_on(each).pushover([1.0], control).force for each in (law, hs.Dahl(stiffness=400.0, coulomb=1.6)))
    np.testing.assert_allclose(slow, dahl, rtol=0, atol=1e-12)


def test_many_structures_are_those_one_by_one():
    plant = mass_on(LAWS["LuGre"])
    values = {"elements.0.sigma0": [300.0, 500.0], "elements.0.sigma2": [0.1, 0.4]}
    signals = {"peak_drift": "peak_drift", "peak_force": "peak_force", "energy": "element_work"}
    many = {name: plant.responses(values, FORCE, sample_time=H, reduce=name) for name in signals}
    for k in range(2):
        one = plant.assemble({name: column[k] for name, column in values.items()}).signals(FORCE, H)
        for name, signal in signals.items():
            assert many[name][k, 0] == one[signal][-1, 0], name


def test_friction_stands_in_an_element_of_its_own():
    assert_refused("takes a LuGre by itself", hs.Element, ARTICLE + hs.Line(slope=1.0), error=TypeError, between=(0, 1))
    assert_refused("takes friction and dashpots only", hs.Element, hs.mode(1.0, 0.1), error=TypeError, between=(0, 1))


@needs_compiled
def test_a_controller_with_an_integral_hunts_and_one_without_stops_short():
    """The position loop of Canudas de Wit, Olsson, Astrom and Lischinsky (1995): Kp = 3, Ki = 4, Kd = 6."""
    plant = mass_on(ARTICLE, stiffness=0.0, tolerance=1e-9)
    t = 1e-3 * np.arange(30_000)
    gains = {"kp": 3.0, "kd": 6.0, "derivative_filter": 1e-3}
    hunting = hs.close_loop(plant, hs.PID(ki=4.0, **gains), t, np.ones(t.size)).y[5000:]
    assert np.count_nonzero(np.diff(np.sign(hunting - 1.0))) >= 3
    assert hunting.min() < 0.97
    assert hunting.max() > 1.03
    short = hs.close_loop(plant, hs.PID(**gains), t[:20_000], np.ones(20_000)).y
    assert np.ptp(short[-2000:]) < 1e-6
    assert abs(short[-1] - 1.0) > 0.1
