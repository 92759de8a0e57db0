"""Friction laws: closed forms against obvious transcriptions, invariants, and what is derived from declarations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from friction_laws import FAMILIES, backlash, decades, drawn, lugre, maxwell, walk
from scipy.integrate import solve_ivp
from strategies import (
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    needs_compiler,
    printed_by_main,
    refused,
)

import hysim as hs
from hysim.models.model import candidates

every_family = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
N_LAWS = 12
PASSIVE = hs.LuGre(sigma0=40.0, sigma1=0.4, sigma2=0.3, coulomb=1.0, breakaway=1.6, stribeck_velocity=0.1)


def laws_of(family, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(N_LAWS):
        law, length, time = drawn(family, rng)
        yield law, walk(rng, length, 40), time


def size(y):
    return max(float(np.ptp(y)), float(np.abs(y).max()), 1e-300)


# ---------------------------------------------------------------------------------- against transcriptions


def test_lugre_is_the_solution_of_its_equation_where_bristles_are_soft():
    rng = np.random.default_rng(1)
    for _ in range(8):
        law, length, time = drawn(hs.LuGre, rng)
        u = np.clip(np.diff(walk(rng, length, 9)), -length, length).cumsum()  # DOP853 needs many steps for long strokes
        # the error of DOP853 at its tolerance of 1e-12, from eight strokes
        expected = lugre(law, u, time)
        np.testing.assert_allclose(law.response(u, time), expected, rtol=0, atol=1e-10 * size(expected))


def test_maxwell_slip_is_the_solution_of_its_equations():
    rng = np.random.default_rng(2)
    law = hs.GeneralizedMaxwellSlip(
        stiffness=(6.0, 2.0, 0.5), weights=(0.3, 0.3, 0.4), stribeck_velocity=0.8, attraction=2.0, viscous=0.1,
        z0=(0.1, -0.2, 0.3),
    )  # fmt: skip
    u = np.cumsum(rng.normal(size=12))
    exact = law.response(u, 1.0)
    coarse, fine = (np.abs(maxwell(law, u, 1.0, n) - exact).max() for n in (250, 1000))
    assert fine < 1e-2  # Euler's error, which falls with the step
    assert fine < 0.4 * coarse


@pytest.mark.parametrize("damping", [0.03, 0.3, 3.0])
def test_backlash_is_the_solution_of_its_equation(damping):
    rng = np.random.default_rng(3)
    law = hs.ElasticBacklash(stiffness=1.0, damping=damping, half_gap=0.7, center=0.2)
    u = 0.5 * np.cumsum(rng.normal(size=25))
    torque, part = backlash(law, u, 1.0)
    assert np.abs(law.memory(u, 1.0) - part).max() < 2e-3  # Euler's error
    inside = (np.abs(part) < 0.69) | (np.abs(part) == 0.7)  # the torque ends at a jump, which Euler's method may miss
    assert np.abs(law.response(u, 1.0) - torque)[inside].max() < 3e-3
    assert 2 < np.count_nonzero(np.abs(part) < 0.69) < 20


def test_stribecks_curve_passes_its_breakaway():
    law = hs.StribeckFriction(coulomb=20.0, breakaway=25.0, breakaway_velocity=0.1, viscous=3.0, offset=1.0)
    v = np.linspace(-2.0, 2.0, 81)
    u = np.concatenate([[0.0], np.cumsum(v)])
    # sums of 80 numbers of size 40 in the displacement, and the steepest slope of the curve, 2000
    np.testing.assert_allclose(law.response(u, 1.0)[1:], law.steady_force(v), rtol=0, atol=1e-9)
    assert law.steady_force([0.1]).item() == pytest.approx(25.0 + 0.3 + 1.0, abs=1e-6)
    dry = law.steady_force(np.linspace(0.0, 1.0, 10_001)) - 3.0 * np.linspace(0.0, 1.0, 10_001) - 1.0
    assert dry.max() == pytest.approx(25.0, rel=1e-3)


def test_the_error_of_a_smooth_motion_falls_with_the_square_of_the_sample_time():
    """Between samples the velocity is that of the chord: of order 2, and 1e-10 where it does not matter."""
    duration = 2.0 * math.pi / 3.0

    def slope(t, z):
        v = np.cos(3.0 * t)
        return v - PASSIVE.sigma0 * abs(v) * z / PASSIVE.friction(v)

    ends = math.pi / 6.0 * np.array([1, 3])  # where the velocity turns, at samples
    z, begin = [0.0], 0.0
    for end in (*ends, duration):
        z = solve_ivp(slope, (begin, end), z, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        begin = end
    errors = []
    for n in (768, 1536, 3072):
        t = np.linspace(0.0, duration, n + 1)
        errors.append(abs(PASSIVE.memory(np.sin(3.0 * t) / 3.0, duration / n)[-1] - z.item()))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
    assert abs((4.0 * errors[2] - errors[1]) / 3.0) < 1e-9  # by extrapolation


# ---------------------------------------------------------------------------------- invariants


@every_family
def test_more_samples_on_an_even_stroke_change_nothing(family):
    for law, u, time in laws_of(family):
        fine = np.interp(np.arange(4 * u.size - 3) / 4.0, np.arange(u.size), u)
        y = law.response(u, time)
        slope = 0.0
        if family is hs.StribeckFriction:  # whose slope amplifies the roundings of the finer strokes
            slope = 10.0 * law.coulomb / law.breakaway_velocity * np.abs(u).max() / time / size(y)
        np.testing.assert_allclose(
            law.response(fine, time / 4.0)[::4],
            y,
            rtol=0,
            atol=(1e-12 + 1e-15 * slope) * size(y) + 1e-11 * stiff(law, u),
        )


def stiff(law, u):
    """Force that the rounding of the input is worth, in units of that of the elongation of contacts."""
    if isinstance(law, hs.ElasticBacklash):
        return law.stiffness * float(np.abs(u).max()) * 1e-3
    return 0.0


@every_family
def test_a_cut_changes_no_bit(family):
    for law, u, time in laws_of(family, 1):
        assert_cut_or_stepped_it_has_the_same_bits(law, u, 17, sample_time=time)
        assert law.responses({"offset": [0.0, 1.0]} if "offset" in law.scalars else {}, u, time).shape[1] == u.size


@every_family
def test_friction_has_no_preferred_direction(family):
    for law, u, time in laws_of(family, 2):
        changes = {"offset": 0.0} | ({"center": 0.0} if family is hs.ElasticBacklash else {})
        there = replace(law, **changes)
        back = there
        if "z0" in vars(law):
            back = replace(there, z0=-law.z0 if isinstance(law.z0, float) else tuple(-each for each in law.z0))
        assert (-back.response(-u, time)).tolist() == there.response(u, time).tolist()


@pytest.mark.parametrize("sigma0", [1e5, 1e7, 1e9])
def test_stiff_bristles_neither_chatter_nor_lag(sigma0):
    """Each stroke is 1e4 to 1e9 times as long as the bristles, and explicit steps would be unstable by as much."""
    law = hs.LuGre(sigma0=sigma0, sigma1=0.1 * math.sqrt(sigma0), sigma2=0.4)
    u = np.concatenate([[0.0], np.cumsum(np.repeat([0.1, -0.1, 0.0005, -2.0], 25))])
    force = law.response(u, 1.0)[1:]
    # rounding of the strokes
    np.testing.assert_allclose(force, law.steady_force(np.diff(u)), rtol=1e-13)
    resting = law.response(np.append(u, [u[-1]] * 3), 1.0)[-3:]
    np.testing.assert_allclose(resting, -float(law.friction(2.0)), rtol=1e-13)


def test_lugre_without_rates_is_dahls_law():
    rng = np.random.default_rng(5)
    for _ in range(N_LAWS):
        force, length = decades(rng, -6, 6), decades(rng, -8, 2)
        law = hs.LuGre(sigma0=force / length, coulomb=force, breakaway=force, z0=0.3 * length)
        dahl = hs.Dahl(stiffness=force / length, coulomb=force, z0=0.3 * force)
        u = walk(rng, length, 60)
        # both are exponentials of the stroke, computed in another order
        np.testing.assert_allclose(law.response(u, 1.0), dahl.response(u), rtol=0, atol=1e-13 * force)
        assert law.response(u, 1.0).tolist() == law.response(u, 1e-3).tolist()


def test_maxwell_slip_with_an_even_friction_is_the_law_of_that_name():
    rng = np.random.default_rng(6)
    for _ in range(N_LAWS):
        n, force, length = int(rng.integers(1, 6)), decades(rng, -6, 6), decades(rng, -8, 2)
        stiffness, weights = force / length * decades(rng, -1, 1, n), rng.uniform(0.1, 1.0, n)
        law = hs.GeneralizedMaxwellSlip(stiffness=stiffness, weights=weights, coulomb=force, breakaway=force)
        plain = hs.MaxwellSlip.from_limits(stiffness=stiffness, limits=weights * force)
        u = walk(rng, length, 60)
        # positions of blocks there, forces here: roundings of the input
        atol = 1e-13 * (force + float(stiffness.max() * np.abs(u).max()))
        np.testing.assert_allclose(law.response(u, 1.0), plain.response(u), rtol=0, atol=atol)


def test_forces_that_follow_at_once_are_stribecks_curve_on_long_strokes():
    law = hs.GeneralizedMaxwellSlip(
        stiffness=(1e4, 3e4), weights=(0.25, 0.75), stribeck_velocity=0.5, attraction=1e9, viscous=0.2
    )
    v = np.array([0.1, 1.0, 0.3, 0.01, -0.2, -3.0])
    u = np.concatenate([[0.0], np.cumsum(v)])
    np.testing.assert_allclose(law.response(u, 1.0)[1:], law.steady_force(v), rtol=1e-12)


def test_backlash_without_damping_is_a_dead_zone():
    law = hs.ElasticBacklash(stiffness=3.0, half_gap=0.5, center=0.1)
    u = np.cumsum(np.random.default_rng(7).normal(size=200))
    expected = 3.0 * (u - 0.1 - np.clip(u - 0.1, -0.5, 0.5))
    np.testing.assert_allclose(law.response(u, 1.0), expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    alone = replace(law, half_gap=0.0, damping=2.0)
    np.testing.assert_allclose(alone.response(u, 1.0)[1:], 3.0 * (u[1:] - 0.1) + 2.0 * np.diff(u), rtol=1e-12)


def test_no_side_of_a_gap_pulls():
    for law, u, time in laws_of(hs.ElasticBacklash, 3):
        if law.half_gap == 0.0:
            continue
        part = law.memory(u, time)
        torque = law.response(u, time)
        assert (torque[part < law.half_gap] <= 0.0).all()
        assert (torque[part > -law.half_gap] >= 0.0).all()


# ---------------------------------------------------------------------------------- energy


def work_and_store(law, u, h, parts=400):
    """Work of the friction, the samples being divided, and the change of the energy of the bristles."""
    fine = np.interp(np.arange(parts * (u.size - 1) + 1) / parts, np.arange(u.size), u)
    force, rises = law.response(fine, h / parts), np.diff(fine)
    z = law.memory(fine, h / parts)
    # within a part the velocity is even: the trapezoidal rule on the force behind the jump at its begin
    first = z[:-1]
    velocity = rises / (h / parts)
    damping = law.viscosity * velocity
    bristles = law.sigma0 * first - law.sigma1 * law.sigma0 * np.abs(velocity) * first / law.friction(velocity)
    return float(np.sum(0.5 * (force[1:] + bristles + damping) * rises)), 0.5 * law.sigma0 * (z[-1] ** 2 - z[0] ** 2)


def test_a_passive_law_never_returns_more_than_the_bristles_hold():
    rng = np.random.default_rng(8)
    law = replace(PASSIVE, sigma2=0.25)
    assert law.is_passive()
    for _ in range(5):
        u = 0.05 * np.cumsum(rng.normal(size=15) * decades(rng, -1, 1, 15))
        work, stored = work_and_store(law, u, 0.1)
        assert work > stored


def test_a_law_that_is_not_passive_pushes():
    """Bent slowly to the breakaway force, then moved fast: the bristles relax, and their damping pushes."""
    law = replace(PASSIVE, sigma1=40.0, sigma2=0.0)
    assert not law.is_passive()
    pushed = replace(law, z0=law.advance(np.linspace(0.0, 0.4, 41), sample_time=100.0)[1][1])
    work, stored = work_and_store(pushed, np.array([0.0, 0.01]), 1e-3)
    assert work < stored
    assert replace(law, damping_velocity=0.05).is_passive()
    assert replace(law, coulomb=1.6).is_passive()


# ---------------------------------------------------------------------------------- what is derived


@every_family
def test_every_number_is_identified(family):
    rng = np.random.default_rng(9)
    t = 0.02 * np.arange(120)
    u = 0.3 * np.sin(2.0 * t) * (1.0 + 0.5 * np.sin(0.7 * t)) + 0.02 * np.sin(9.0 * t)
    laws = {
        hs.LuGre: PASSIVE,
        hs.StribeckFriction: hs.StribeckFriction(breakaway_velocity=0.1, viscous=0.2),
        hs.GeneralizedMaxwellSlip: hs.GeneralizedMaxwellSlip(stiffness=(60.0, 8.0), weights=(0.3, 0.7), attraction=20.0,
                                                             stribeck_velocity=0.1, viscous=0.2),
        hs.ElasticBacklash: hs.ElasticBacklash(stiffness=20.0, damping=0.7, half_gap=0.1, center=0.02),
    }  # fmt: skip
    law = laws[family]
    y = law.response(u, 0.02)
    record = hs.Record(t=t, u=u, y=y + 1e-4 * size(y) * rng.normal(size=y.size))
    start = family(stiffness=(1.0, 1.0), weights=law.weights) if family is hs.GeneralizedMaxwellSlip else family
    fit = hs.identify(start, record, seed=0)
    assert fit.success
    assert {"offset"} < set(fit.free_names)
    for name in fit.free_names:
        value = law.scalars[name]
        # six standard errors of noise, one in a thousand for numbers that hardly matter
        assert abs(fit.estimates[name] - value) < 6.0 * fit.stderr[name] + 1e-3 * abs(value), name
    assert_refused("has no time", hs.identify, start, hs.Record(u=u, y=y))


@every_family
def test_laws_are_composed_and_simulated(family):
    law, _, time = drawn(family, np.random.default_rng(10))
    u = np.linspace(0.0, 1.0, 7)
    both = law + hs.Line(slope=2.0)
    np.testing.assert_array_equal(both.response(u, time), law.response(u, time) + 2.0 * u)
    simulation = hs.simulate(law, time * np.arange(7), u)
    # times are k h, whose differences are h to rounding
    np.testing.assert_allclose(simulation.y, law.response(u, time), rtol=1e-9)
    assert ("z" in simulation.signals) is (family is not hs.StribeckFriction)
    assert_refused("moves in time: give sample_time", law.compiled, 0.0)
    assert_refused("sample_time must be positive", law.response, u, 0.0)
    assert_refused("that a loop can step", hs.InverseFeedforward, error=TypeError, law=law)


@needs_compiler
@every_family
def test_c_computes_the_same(family, tmp_path):
    law, length, time = drawn(family, np.random.default_rng(11))
    u = walk(np.random.default_rng(12), length, 200)
    in_c = printed_by_main(hs.to_c(law, sample_time=time), tmp_path, u)
    # the same operations; exponentials of another library
    np.testing.assert_allclose(in_c, law.response(u, time), rtol=0, atol=1e-13 * size(law.response(u, time)))


test_what_is_no_friction_is_refused = refused(
    (hs.LuGre, {"sigma0": 0.0}, "sigma0 must be positive"),
    (hs.LuGre, {"breakaway": -1.0}, "breakaway must be positive"),
    (hs.LuGre, {"damping_velocity": -1.0}, "damping_velocity must not be negative"),
    (hs.StribeckFriction, {"breakaway_velocity": 0.0}, "breakaway_velocity must be positive"),
    (hs.GeneralizedMaxwellSlip, {"stiffness": (1.0, 2.0)}, "must be equally long"),
    (hs.GeneralizedMaxwellSlip, {"stiffness": (), "weights": ()}, "not empty"),
    (hs.GeneralizedMaxwellSlip, {"z0": (0.0, 1.0)}, "z0 must hold one number for each of 1 elements"),
    (hs.GeneralizedMaxwellSlip, {"attraction": 0.0}, "attraction must be positive"),
    (hs.ElasticBacklash, {"stiffness": -1.0}, "stiffness must be positive"),
    (hs.ElasticBacklash, {"half_gap": -1.0}, "half_gap must not be negative"),
    call=lambda family, arguments: family(**arguments),
)


def test_friction_is_compared_by_name_where_the_record_has_time():
    t = 0.02 * np.arange(226)
    u = 0.3 * np.sin(2.0 * np.pi * t / 2.0)
    y = hs.StribeckFriction(breakaway_velocity=0.1, viscous=0.2).response(u, 0.02)
    record = hs.Record(t=t, u=u, y=y + 1e-3 * np.random.default_rng(0).normal(size=u.size))
    table = hs.compare({"curve": hs.StribeckFriction, "line": hs.Line}, record, cross_validate=None)
    assert table.rows[0].name == "curve"
    assert not {family.__name__ for family in FAMILIES} & set(candidates())
