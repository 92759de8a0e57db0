"""The Prandtl-Ishlinskii law of a parametric density: the law, its memory, and its identification."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from strategies import refused

import hysim as hs
from hysim.laws.operators._bank_search import conditioned, dominant_extremes

LAW = hs.ParametricPrandtlIshlinskii(
    exponent=-0.6, decay=0.15, weight=0.3, weight_slope=0.1, offset=0.2, input_coefficients=(2.0, 0.1, -0.05), reach=2.0
)
LOOP = np.concatenate([np.linspace(-1.0, 1.0, 30), np.linspace(0.9, -1.0, 29), np.linspace(-0.9, 1.0, 17)])
INSIDE = np.array([0.0, 0.7, -0.5, 0.5, -0.3, 0.2, -0.1, 0.05, 0.9, 0.4, 0.6, -0.8])


def obvious(law, u):
    """The sum over plays of shares that are integrated numerically, sample by sample."""

    def density(r):
        return r**law.exponent * np.exp(-r / law.decay)

    n, edge = int(law.plays), lambda k: law.reach * (k / law.plays) ** 2
    shares = np.array([quad(density, edge(k), edge(k + 1), epsabs=0.0)[0] for k in range(n)])
    r, z, y = np.array([(edge(k) + edge(k + 1)) / 2 for k in range(n)]), np.full(n, law.z0[0]), []
    for value in (*law.z0, *u):
        z = np.array([min(max(z[k], value - r[k]), value + r[k]) for k in range(n)])
        static = law.offset + sum(c * value**k for k, c in enumerate(law.input_coefficients, 1))
        lag = np.sum(shares / shares.sum() * (z - value))
        y.append(static + (law.weight + law.weight_slope * value) * lag)
    return np.array(y[len(law.z0) :])


@pytest.mark.parametrize("exponent", [-0.6, 0.0, 2.5])
@pytest.mark.parametrize("z0", [(0.0,), (1.0, -1.0), (-1.0, 1.0, -0.5)])
def test_response_is_the_sum_over_the_plays(exponent, z0):
    law = replace(LAW, exponent=exponent, z0=z0, plays=7.0)
    assert law.response(INSIDE) == pytest.approx(obvious(law, INSIDE), abs=1e-7)  # quad at a singular end


def test_more_plays_converge_to_the_density():
    finest = replace(LAW, plays=5000.0).response(LOOP)
    errors = [np.abs(replace(LAW, plays=n).response(LOOP) - finest).max() for n in (20.0, 40.0, 80.0, 160.0)]
    assert errors[1] < 5e-3 * (LAW.weight + LAW.weight_slope)  # of the largest lag of 1
    assert np.all(np.array(errors[:-1]) / errors[1:] > 1.8)  # 4 for a smooth density, 2 where a sample meets a kink


@given(weight=st.floats(-0.9, 0.9), slope=st.floats(-0.5, 0.5), u=st.lists(st.floats(-1, 1), min_size=2, max_size=20))
def test_a_return_to_a_turning_point_returns_to_its_output(weight, slope, u):
    """Wiping out: a minor loop closes to rounding, whatever the common weight does."""
    law = hs.ParametricPrandtlIshlinskii(
        exponent=-0.3, decay=0.4, weight=weight, weight_slope=slope, reach=2.0, z0=(-1.5, 1.5)
    )
    past = np.array([-1.5, 1.5, -1.2, 1.0, *u, -1.0, 1.0])  # all that is between 1 and 1 is a minor loop
    y = law.response(past)
    assert y[-1] == pytest.approx(y[3], abs=1e-13)


def test_the_slope_after_a_reversal_is_that_of_the_polynomial_less_the_weight():
    """The common weight, 0.4 at u = 1, falls with the input and multiplies the lag of all plays after a long rise."""
    y = LAW.response([-1.0, 1.0, 1.0 - 1e-7])
    lag = -float(LAW.shares @ np.minimum(LAW.thresholds, 1.0))  # plays beyond the amplitude stand at zero
    assert (y[1] - y[2]) / 1e-7 == pytest.approx(2.0 + 0.2 - 0.15 - 0.4 + 0.1 * lag, abs=2e-5)


def test_laws_of_different_numbers_of_plays_and_histories_are_rows_of_one_batch():
    sets = {"plays": [3.0, 40.0, 1.0], "weight": [0.2, 0.3, -0.1], "exponent": [-0.5, 1.0, 0.0]}
    others = {"reach": 2.0, "z0": [[1.0, -1.0], [0.0, 0.5], [0.0, 0.0]]}
    rows = hs.ParametricPrandtlIshlinskii.responses(sets | others, INSIDE)
    for k, row in enumerate(rows):
        one = {name: values[k] for name, values in sets.items()} | {"reach": 2.0, "z0": others["z0"][k]}
        assert np.array_equal(row, hs.ParametricPrandtlIshlinskii(**one).response(INSIDE))


def test_memory_is_the_positions():
    z = LAW.memory(INSIDE)
    assert z.shape == (INSIDE.size, 40)
    lag = np.sum(LAW.shares * (z - INSIDE[:, np.newaxis]), axis=1)
    static = np.polynomial.polynomial.polyval(INSIDE, (LAW.offset, *LAW.input_coefficients))
    assert static + (LAW.weight + LAW.weight_slope * INSIDE) * lag == pytest.approx(LAW.response(INSIDE), abs=1e-14)


def test_densities_at_the_edge_of_the_numbers_have_shares_that_sum_to_one():
    for exponent, decay in itertools.product((-0.99, 0.0, 300.0), (1e-300, 1e-3, 1.0, 1e3, 1e300)):
        law = hs.ParametricPrandtlIshlinskii(exponent=exponent, decay=decay, weight=1.0, reach=1.0)
        assert law.shares.sum() == pytest.approx(1.0, abs=1e-12)
        assert (law.shares >= 0.0).all()


test_what_is_no_density_is_refused = refused(
    ({"exponent": -1.0}, "exponent must be above -1"),
    ({"decay": 0.0}, "decay must be positive"),
    ({"weight": 1.0}, "reach must be positive if a weight is not zero"),
    ({"reach": -1.0}, "reach must be positive if a weight is not zero"),
    ({"plays": 2.5}, "plays must be whole and positive"),
    ({"plays": 0.0}, "plays must be whole and positive"),
    ({"z0": ()}, "z0 must hold at least one input"),
    call=lambda arguments: hs.ParametricPrandtlIshlinskii(**arguments),
)


# ---------------------------------------------------------------------------------- the past before a record


def test_the_cycle_before_a_record_is_on_the_branch_of_its_first_motion():
    assert conditioned(np.array([0.0, 0.0, 1.0, -2.0])) == (1.0, -2.0)
    assert conditioned(np.array([0.0, -2.0, 1.0])) == (-2.0, 1.0)


@given(st.lists(st.integers(-4, 4), min_size=1, max_size=30))
def test_dominant_extremes_leave_every_play_where_the_whole_input_leaves_it(u):
    thresholds = np.arange(0.0, 9.0, 0.25)

    def after(inputs):
        z = np.full(thresholds.size, inputs[0])
        for value in inputs:
            z = np.minimum(np.maximum(z, value - thresholds), value + thresholds)
        return z

    past = (5.0, -5.0, *u)
    extremes = dominant_extremes(np.array(past, dtype=float))
    assert np.array_equal(after(extremes), after(past))
    assert extremes[:2] == [5.0, -5.0]
    assert (np.diff(np.abs(np.diff(extremes[1:]))) < 0.0).all()


# ---------------------------------------------------------------------------------- identification


def record(law, u, noise=0.0):
    return hs.Record(u=u, y=law.response(u) + noise * np.random.default_rng(5).normal(size=u.size))


def test_identify_finds_a_law_and_its_intervals_in_the_cycle_of_its_record():
    truth = replace(LAW, z0=conditioned(LOOP))
    fit = hs.identify(hs.ParametricPrandtlIshlinskii, record(truth, LOOP, noise=1e-4))
    assert fit.n_parameters == 8
    assert fit.model.z0 == truth.z0
    assert fit.model.reach == 2.0
    for name in fit.free_names:
        assert abs(fit.estimates[name] - truth.scalars[name]) < 4.0 * fit.stderr[name]
    minor = np.concatenate([[-1.0], INSIDE])
    assert fit.model.response(minor) == pytest.approx(truth.response(minor), abs=2e-3)  # 1e-3 of the range


def test_one_loop_tells_the_inner_ones():
    """The purpose of a density with two parameters: inner loops are predicted from the outer one."""
    truth = replace(LAW, z0=conditioned(LOOP))
    fading = np.array([1.0, -0.8, 0.7, -0.6, 0.5, -0.4, 0.3, -0.2, 0.1, 0.0])
    y = truth.response(fading)
    for family, most in ((hs.ParametricPrandtlIshlinskii, 1e-5), (hs.PrandtlIshlinskii, np.inf)):
        error = np.abs(hs.identify(family, record(truth, LOOP)).model.response(fading) - y).max()
        assert error < most
    assert error > 1e-3  # of plays with a weight each


@pytest.mark.parametrize("first", [0.0, 3.0])
def test_a_record_that_begins_with_a_virgin_curve_is_found_to(first):
    """A stroke from rest, and growing cycles after it, as tests of materials have them."""
    u = first + np.interp(np.arange(0.0, 6.0, 0.1), np.arange(7), [0.0, 0.3, -0.3, 0.6, -0.6, 1.0, -1.0])
    fit = hs.identify(hs.ParametricPrandtlIshlinskii, record(replace(LAW, z0=(first, first)), u, noise=1e-4))
    assert fit.model.z0 == (first, first)
    assert fit.rmse < 1.2e-4


def test_every_start_is_an_option():
    virgin = record(LAW, np.concatenate([[0.0], LOOP]))
    assert hs.identify(hs.ParametricPrandtlIshlinskii, virgin, initial="rest").model.z0 == (0.0, 0.0)
    turned = replace(LAW, z0=(0.0, 0.8))
    free = hs.identify(hs.ParametricPrandtlIshlinskii, record(turned, LOOP * 0.6), initial="free")
    assert free.fit_percent > 99.9
    assert free.n_parameters == 9
    u = np.array([0.3, 0.5, 0.1, 1.0, -1.0, 0.4, 0.0, 0.2, *np.linspace(0.25, 0.29, 9)])
    periodic = hs.Record(u=u, y=LAW.response(np.tile(u, 3))[-u.size :])
    fit = hs.identify(hs.ParametricPrandtlIshlinskii, periodic, initial="periodic")
    assert fit.fit_percent > 99.99
    assert fit.model.response(u) == pytest.approx(periodic.y, abs=1e-3)
    assert hs.identify(turned, record(turned, LOOP * 0.6)).model.z0 == turned.z0


def test_records_share_the_law_and_a_sum_takes_it():
    pair = [record(LAW, LOOP), record(LAW, 0.5 * LOOP)]
    assert hs.identify(hs.ParametricPrandtlIshlinskii, pair, initial="rest").fit_percent > 99.99
    total = LAW + hs.Dahl(stiffness=2.0, coulomb=0.1)
    assert np.array_equal(total.response(INSIDE), LAW.response(INSIDE) + total.parts[1].response(INSIDE))
