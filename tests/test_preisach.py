"""Relays under a staircase: closed forms, the properties that define the family, the exact inverse, reversal curves."""

import dataclasses
import functools
import json
import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from strategies import (
    COMPILED,
    assert_batch_has_the_bits_of_its_laws,
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    outputs_of_compiled_steps,
    refused,
    short_inputs,
)

import hysim as hs
from hysim.cli import main
from hysim.models.search_space import Freedom

FAMILIES = [hs.Preisach, hs.PreisachRelays]
LEVELS = (-1.0, -0.6, -0.1, 0.1, 0.45, 1.0)
WEIGHTS = tuple(np.random.default_rng(5).uniform(0.1, 1.0, 15).tolist())
ROUNDING = 1e-13  # a few hundred roundings of numbers of order one


def a_law(family, **others):
    return family(levels=LEVELS, weights=WEIGHTS, offset=0.3, **others)


@st.composite
def laws(draw, family=hs.Preisach, lowest: float = 0.05):
    """One to six intervals over -1 ... 1, the weights of one sign, at least `lowest` on the diagonal."""
    lengths = np.array(draw(st.lists(st.floats(0.2, 1.0), min_size=1, max_size=6)))
    levels = -1.0 + 2.0 * np.cumsum([0.0, *lengths]) / lengths.sum()
    rows, columns = np.tril_indices(lengths.size)
    weights = np.array(draw(st.lists(st.floats(0.0, 1.0), min_size=rows.size, max_size=rows.size)))
    weights[rows == columns] += lowest
    sign = draw(st.sampled_from([1.0, -1.0]))
    past = draw(short_inputs(1.0))
    return family(levels=levels, weights=sign * weights, offset=draw(st.floats(-1.0, 1.0)), z0=past)


def relay_bank(law, u) -> np.ndarray:
    """The definition, one relay after the other."""
    rows, columns = np.tril_indices(len(law.levels) - 1)
    a, b = np.array(law.levels)[rows + 1], np.array(law.levels)[columns]
    state, y = -np.ones(a.size), []
    for value in [*law.z0, *u]:
        state = np.where(value >= a, 1.0, np.where(value <= b, -1.0, state))
        y.append(law.offset + np.array(law.weights) @ state)
    return np.array(y[len(law.z0) :])


def fine_bank(law, u, shares: int = 60) -> np.ndarray:
    """The spread relays as many single ones, each in the middle of its part of two intervals."""
    middles = (np.arange(shares) + 0.5) / shares
    lengths, y = np.diff(law.levels), np.full(len(u), law.offset)
    for weight, i, j in zip(law.weights, *np.tril_indices(lengths.size), strict=True):
        a = law.levels[i] + lengths[i] * middles
        b = a if i == j else (law.levels[j] + lengths[j] * middles)[:, np.newaxis]
        state = -np.ones(np.broadcast_shapes(np.shape(a), np.shape(b)))
        for k, value in enumerate([*law.z0, *u]):
            state = np.where(value >= a, 1.0, np.where(value <= b, -1.0, state))
            if k >= len(law.z0):
                y[k - len(law.z0)] += weight * state.mean()
    return y


# ---------------------------------------------------------------------------------- closed forms


def test_relays_go_up_and_down_at_their_own_levels():
    law = hs.PreisachRelays(levels=(0.0, 1.0), weights=(2.0,), offset=1.0)
    assert law.response([0.0, 0.999, 1.0, 0.001, 0.0, 0.5]).tolist() == [-1.0, -1.0, 3.0, 3.0, -1.0, -1.0]


def test_a_constant_density_has_the_area_of_its_triangles_as_everett_function():
    levels = np.linspace(-1.0, 1.0, 9)
    law = hs.Preisach.from_density(levels, lambda a, b: np.ones_like(a))
    area = 0.5 * np.maximum(levels[:, np.newaxis] - levels, 0.0) ** 2
    assert law.everett == pytest.approx(area, abs=1e-14)
    turns = levels[[0, 7, 2, 5, 3]]
    exact = np.cumsum([-area[-1, 0], *(np.sign(np.diff(turns)) * np.diff(turns) ** 2)])
    assert law.response(turns) == pytest.approx(exact, abs=1e-14)


def test_a_density_is_integrated_over_its_part_of_the_diagonal():
    """3 a^2 b over the triangle below (1, 1): the integral of 3 a^2 a^2 / 2 is 3/10; over the square beside it 7/2."""
    law = hs.Preisach.from_density((0.0, 1.0, 2.0), lambda a, b: 3.0 * a**2 * b)
    assert law.weights[:2] == pytest.approx((0.3, 3.5), abs=1e-14)


@given(st.lists(st.integers(0, 16), min_size=2, max_size=30), st.integers(0, 1000))
def test_plays_between_the_levels_of_their_thresholds(places, seed):
    rng = np.random.default_rng(seed)
    levels = np.linspace(-4.0, 4.0, 17)
    plays = hs.PrandtlIshlinskii(
        thresholds=0.25 * np.arange(4), weights=rng.uniform(0.1, 1.0, 4), offset=0.2, z0=levels[0] + 0.25 * np.arange(4)
    )
    u = np.append(levels[0], levels[places])
    assert hs.Preisach.from_plays(levels, plays).response(u) == pytest.approx(plays.response(u), abs=ROUNDING)


def test_fine_levels_follow_plays_everywhere_to_second_order():
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.5))
    u = np.append(-1.0, np.sin(np.linspace(0.0, 20.0, 300)) * np.linspace(1.0, 0.2, 300))
    errors = [
        np.abs(hs.Preisach.from_plays(np.linspace(-1.0, 1.0, n + 1), plays).response(u) - plays.response(u)).max()
        for n in (50, 200)
    ]
    assert errors[1] < 0.3 * errors[0]  # the kink of E at a - b = 2 r is cut off within one interval
    assert errors[1] < 0.01


# ---------------------------------------------------------------------------------- the definition


@given(laws(hs.PreisachRelays), short_inputs(1.5))
def test_relays_are_the_literal_bank(law, u):
    assert law.response(u) == pytest.approx(relay_bank(law, u), abs=ROUNDING)


@pytest.mark.parametrize("levels", [(-1.0, np.nextafter(1.0, 2.0)), (-1e300, -1e-300, 1e300)])
def test_a_relay_does_not_switch_one_rounding_before_its_level(levels):
    law = hs.PreisachRelays(levels=levels, weights=(0.05, 0.1, 0.2)[: 2 * len(levels) - 3])
    up = np.sort(np.concatenate([np.nextafter(levels, -np.inf), levels, np.nextafter(levels, np.inf)]))
    for path in (np.append(up, up[::-1]), np.append(up[::-1], up)):
        assert law.response(path) == pytest.approx(relay_bank(law, path), abs=ROUNDING)


@given(laws(hs.PreisachRelays), st.lists(st.integers(0, 6), min_size=1, max_size=20))
def test_relays_switch_at_the_level_itself(law, places):
    u = np.array(law.levels)[np.minimum(places, len(law.levels) - 1)]
    assert law.response(u) == pytest.approx(relay_bank(law, u), abs=ROUNDING)


@given(laws(hs.PreisachRelays), st.lists(st.integers(0, 6), min_size=1, max_size=20))
def test_where_the_input_stops_at_levels_both_laws_agree(law, places):
    relays = dataclasses.replace(law, z0=())
    spread = hs.Preisach(levels=law.levels, weights=law.weights, offset=law.offset)
    u = np.array(law.levels)[np.minimum(places, len(law.levels) - 1)]
    assert spread.response(u) == pytest.approx(relays.response(u), abs=ROUNDING)


def test_spread_relays_are_many_single_ones():
    law = a_law(hs.Preisach, z0=(0.7, -0.3))
    u = np.array([0.2, 0.9, -0.5, 0.33, -0.2, 0.28, -0.9, 0.5])
    # the staircase cuts off a part of two intervals along its edge: half a share of each weight that is cut
    assert law.response(u) == pytest.approx(fine_bank(law, u), abs=sum(WEIGHTS) / 60)


@given(laws())
def test_the_everett_function_is_half_of_a_fall(law):
    levels = np.array(law.levels)
    for m in range(1, levels.size):
        y = dataclasses.replace(law, z0=()).response([levels[0], levels[m], *levels[m::-1]])
        assert 0.5 * (y[1] - y[2:]) == pytest.approx(law.everett[m, m::-1], abs=ROUNDING)
    again = hs.Preisach.from_everett(levels, law.everett, offset=law.offset)
    assert again.weights == pytest.approx(law.weights, abs=ROUNDING)


# ---------------------------------------------------------------------------------- the operators' properties


@pytest.mark.parametrize("family", FAMILIES)
@given(past=short_inputs(0.5), loop=short_inputs(0.4))
def test_a_return_to_an_extreme_wipes_out_what_came_since_to_the_bit(family, past, loop):
    law = a_law(family)
    with_loop, state = law.advance([*past, -0.5, 0.5, *loop, 0.5])
    without, other = law.advance([*past, -0.5, 0.5])
    assert with_loop[-1] == without[-1]
    assert state == other


@pytest.mark.parametrize("family", FAMILIES)
@given(first=short_inputs(1.0), second=short_inputs(1.0))
def test_loops_between_the_same_inputs_are_congruent(family, first, second):
    law, loop = a_law(family), np.array([0.3, -0.2, 0.1, -0.1, 0.3])
    a, b = (law.response(np.concatenate([past, [0.3, -0.2], loop]))[-loop.size :] for past in (first, second))
    assert a - a[0] == pytest.approx(b - b[0], abs=ROUNDING)


@given(short_inputs(1.0), st.integers(1, 5), st.integers(0, 1000))
def test_a_symmetric_density_is_odd(u, n, seed):
    """w(a, b) = w(-b, -a): from all relays down, the mirrored input from all up has the mirrored output."""
    weights = np.random.default_rng(seed).uniform(size=(n, n))
    weights = np.tril(weights + weights[::-1, ::-1].T)
    law = hs.Preisach(levels=np.linspace(-1.0, 1.0, n + 1), weights=weights[np.tril_indices(n)])
    up = dataclasses.replace(law, z0=(1.0,))
    assert law.response(u) == pytest.approx(-up.response(-u), abs=ROUNDING)


@pytest.mark.parametrize("family", FAMILIES)
@given(u=short_inputs(1.2), data=st.data())
def test_cut_or_stepped_it_has_the_same_bits(family, u, data):
    law = a_law(family, z0=(0.8, -0.4))
    assert_cut_or_stepped_it_has_the_same_bits(law, u, data.draw(st.integers(0, u.size)))
    assert outputs_of_compiled_steps(law, u)[1][0] == u[-1]


def test_a_compiled_loop_forgets_the_smallest_of_too_many_extremes():
    """A ringing of 1500 half cycles: an extreme that is forgotten lies within the next one's reach."""
    law = a_law(hs.Preisach)
    u = np.array([1.0, -1.0] * 750) * np.linspace(0.95, 0.05, 1500)
    u = np.concatenate([u, u[::-1][:1200]])
    y, _ = outputs_of_compiled_steps(law, u)
    step = 0.9 / 1499  # of the amplitude from one extreme to the next: two of them and the densest relays bound it
    densest = max(WEIGHTS) / np.diff(LEVELS).min() ** 2
    assert 0.0 < np.abs(y - law.response(u)).max() < 500 * 2.0 * densest * (4.0 * step) ** 2


def test_the_extremes_that_are_forgotten_close_the_smallest_rectangle():
    """Four extremes nearly repeat each other: the corner between them is the one that the output may lose."""
    law = a_law(hs.Preisach)
    falls = np.full(999, 5e-4)  # of the amplitude, from one extreme to the next
    falls[400:403] = 1e-7
    u = (0.95 - np.cumsum([0.0, *falls])) * np.resize([1.0, -1.0], 1000)
    u = np.concatenate([u, u[::-1]])
    y, _ = outputs_of_compiled_steps(law, u)
    densest = max(WEIGHTS) / np.diff(LEVELS).min() ** 2
    assert np.abs(y - law.response(u)).max() < 2.0 * densest * 2e-7**2 + ROUNDING


@given(short_inputs(1.2), st.integers(0, 1000), st.booleans())
def test_batch_is_the_path_to_the_bit(u, seed, own_inputs):
    rng = np.random.default_rng(seed)
    sets = {
        "levels": np.cumsum(rng.uniform(0.1, 0.6, (3, 4)), axis=1) - 0.8,
        "weights": rng.normal(size=(3, 6)),
        "offset": rng.normal(size=3),
        "z0": rng.normal(size=(3, 2)),
    }
    for family in FAMILIES:
        assert_batch_has_the_bits_of_its_laws(family, sets, u, own_inputs)


def test_reductions_are_the_measures_of_the_rows():
    weights = np.random.default_rng(0).uniform(0.1, 1.0, (300, 15))
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)
    rows = hs.Preisach.responses({"levels": LEVELS, "weights": weights}, u)
    areas = hs.Preisach.responses({"levels": LEVELS, "weights": weights}, u, reduce="area")
    assert areas[7] == hs.loop_metrics(u, rows[7]).area
    assert hs.loop_metrics(u, rows[7]).orientation == "counterclockwise"


def test_beyond_the_levels_the_law_is_saturated():
    law = a_law(hs.Preisach)
    assert law.response([-9.0, 9.0]) == pytest.approx([0.3 - sum(WEIGHTS), 0.3 + sum(WEIGHTS)], abs=ROUNDING)
    assert law.response([-9.0, 9.0, 1.0, 0.2])[-1] == law.response([-1.0, 1.0, 0.2])[-1]


@given(short_inputs(1.0), st.integers(0, 1000))
def test_the_staircase_divides_the_relays_that_are_up_from_those_that_are_down(u, seed):
    b, a = np.sort(np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 50)), axis=0)
    up = np.zeros(50, dtype=bool)
    for value in u:
        up = np.where(value >= a, True, np.where(value <= b, False, up))
    corners = a_law(hs.Preisach).staircase(u)
    assert np.array_equal(((a <= corners[:, :1]) & (b < corners[:, 1:])).any(axis=0), up)


# ---------------------------------------------------------------------------------- the inverse


@given(laws(), short_inputs(1.0))
@example(hs.Preisach(levels=(-1.0, 0.0, 1.0), weights=(0.35, 0.0, 0.35)), [2.2e-126, 0.0])
def test_the_inverse_undoes_the_response(law, u):
    y = law.response(u)
    found = law.inverse_response(y)
    assert np.abs(found - u).max() <= 1e-11 * 2.0  # of the span of the levels; the slope is above 0.05
    terms = abs(law.offset) + np.abs(law.weights).sum()  # which may cancel: an output is known to their rounding
    assert np.abs(law.response(found) - y).max() <= ROUNDING * terms
    assert (np.diff(found)[np.diff(y) == 0.0] == 0.0).all()


@given(laws(), short_inputs(1.0), short_inputs(1.0))
def test_the_inverse_continues_from_a_state(law, past, u):
    _, state = law.advance(past)
    y, _ = law.advance(u, state)
    assert np.abs(law.inverse_response(y, state=state) - u).max() <= 2e-11
    rested = law.response([0.5, *u])[1:]
    assert np.abs(law.inverse_response(rested, u0=0.5) - u).max() <= 2e-11


def test_a_long_record_of_plateaus_and_small_steps_both_ways():
    rng = np.random.default_rng(1)
    n = 10_000 if COMPILED else 100
    steps = rng.normal(size=n) * rng.choice([0.0, 1e-9, 1e-3, 0.1, 1.0], size=n)
    u = np.clip(np.sin(np.cumsum(steps)), -0.999, 0.999)
    law = a_law(hs.Preisach)
    y = law.response(u)
    found = law.inverse_response(y)
    assert np.abs(found - u).max() < 1e-11
    assert np.abs(law.response(found) - y).max() < 1e-11


def test_both_ends_of_the_levels_are_reached():
    law = a_law(hs.Preisach)
    u = [-1.0, 1.0, -1.0, 0.3, 1.0]
    assert law.inverse_response(law.response(u)) == pytest.approx(u, abs=ROUNDING)


@given(laws(), short_inputs(1.0))
def test_slopes_lie_between_their_bounds(law, u):
    fine = np.append(np.linspace(u[:-1], u[1:], 7, endpoint=False, axis=1).ravel(), u[-1])
    steps, low, high = np.diff(fine), *law.slope_bounds()
    moves = np.abs(steps) > 1e-6
    slopes = np.diff(law.response(fine))[moves] / steps[moves]
    assert ((slopes >= low - 1e-8) & (slopes <= high + 1e-8)).all()  # rounding of order 1e-15 over 1e-6
    assert law.is_invertible()


def one_weight(weight, y):
    return hs.Preisach(levels=(0, 1), weights=(weight,), offset=1.0).inverse_response(y)


def of_curves(*u, **options):
    return hs.Preisach.from_reversal_curves(hs.Record(u=u, y=np.zeros(len(u))), **options)


test_wrong_arguments_are_named = refused(
    (lambda: hs.Preisach(levels=(0, 1), weights=(0,)).inverse_response([0.0]), "from 0 to 0"),
    (lambda: hs.Preisach(levels=(0, 1, 2), weights=(1, -2, 1)).inverse_response([0.0]), "it goes from -2 to 2"),
    (lambda: hs.Preisach().inverse_response([0.0]), "slope must have one sign"),
    (lambda: one_weight(2, [0.0, 3.5]), hs.SimulationError, r"sample 1 \(y = 3.5\): its outputs lie between -1 and 3"),
    (lambda: one_weight(-2, [-1.5]), hs.SimulationError, r"sample 0 \(y = -1.5\): its outputs lie between -1 and 3"),
    (lambda: a_law(hs.Preisach).inverse_response([0.0], u0=0.0, state=(0.0,)), "not both"),
    (lambda: hs.Preisach(levels=(0, 1, 2), weights=(1, 2)), "N \\(N \\+ 1\\) / 2 numbers, got 3 and 2"),
    (lambda: hs.Preisach(levels=(0,)), "got 1 and 0"),
    (lambda: hs.Preisach(levels=(0, 1, 1), weights=(1, 1, 1)), "levels must increase"),
    (lambda: hs.Preisach.from_everett((0, 1), [[0.0]]), "shape"),
    (lambda: hs.Preisach.responses({"relays": 1.0}, [0.0]), TypeError, "unknown parameter 'relays'"),
    (lambda: hs.Preisach.responses({"offset": [[1.0]]}, [0.0]), "too many axes"),
    (lambda: hs.Preisach.responses({"offset": [1, 2], "z0": [[1]] * 3}, [0.0]), "one length"),
    (lambda: hs.Preisach.structure(intervals=0), "at least 1"),
    (lambda: hs.Preisach.structure(intervals=2.0), TypeError, "intervals must be a whole number"),
    (lambda: hs.Preisach.structure(levels=(1, 0)), "increase"),
    (lambda: hs.identify(hs.Preisach, hs.Record(u=[1, 1], y=[0, 1])), "the input is constant"),
    (lambda: hs.identify(hs.Preisach, hs.datasets.table1(), free="levels[1]"), r"'levels\[1\]' is not searched"),
    (lambda: of_curves(0, 1), "never falls"),
    (lambda: of_curves(0, 1, 0, levels=(0.5, 1.0)), r"levels must begin at the lowest input 0 or below, got \[0.5\]"),
)


# ---------------------------------------------------------------------------------- from data


def bent(a, b):
    return (1.2 + a + b) * np.exp(-((a + b) ** 2) - 2.0 * (a - b - 0.5) ** 2)


def test_curves_that_rise_tell_the_same_law():
    law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 13), bent, offset=0.3)
    u = -hs.signals.reversal_curves(-1.0, 1.0, curves=12, samples_per_step=2)
    y = law.response(np.append(1.0, u))[1:]  # after saturation
    found = hs.Preisach.from_reversal_curves(hs.Record(u=u, y=y), levels=law.levels)
    assert found.weights == pytest.approx(law.weights, abs=1e-12)
    assert found.offset == pytest.approx(law.offset, abs=1e-12)


def test_a_curve_that_ends_early_goes_on_as_its_neighbour():
    law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 13), bent, offset=0.3)
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=12, samples_per_step=2)[:-8]  # the last ends 4 intervals above -1
    found = hs.Preisach.from_reversal_curves(hs.Record(u=u, y=law.response(u)), levels=law.levels)
    rows, columns = np.tril_indices(12)
    unknown = (rows == 11) & (columns < 4)
    assert np.array(found.weights)[~unknown] == pytest.approx(np.array(law.weights)[~unknown], abs=1e-12)
    assert np.array(found.weights)[unknown] == pytest.approx(0.0, abs=1e-12)


def test_the_reversal_curves_turn_at_every_level():
    u = hs.signals.reversal_curves(-1.0, 2.0, curves=3, samples_per_step=2)
    assert u.size == 3 * 4 * 2 + 1
    assert u[[2, 8, 18]].tolist() == [0.0, 1.0, 2.0]
    assert np.abs(np.diff(u)) == pytest.approx(0.5)
    for wrong in ({"curves": 0}, {"curves": 1, "samples_per_step": 0}):
        assert_refused("at least 1", hs.signals.reversal_curves, 0.0, 1.0, **wrong)


@given(laws(), short_inputs(1.0), st.integers(1, 3))
def test_reversal_curves_tell_the_whole_law(law, u, samples):
    """Measured at the law's own levels; any other input is then predicted."""
    levels = np.array(law.levels)
    k = hs.signals.reversal_curves(0.0, levels.size - 1.0, curves=levels.size - 1, samples_per_step=samples)
    curves = np.interp(k, np.arange(levels.size), levels)
    start = dataclasses.replace(law, z0=())
    record = hs.Record(u=curves, y=start.response(curves))
    known = hs.Preisach.from_reversal_curves(record, levels=levels)
    assert known.weights == pytest.approx(law.weights, abs=ROUNDING)
    for found in (known, hs.Preisach.from_reversal_curves(record)):
        assert found.response(u) == pytest.approx(start.response(u), abs=ROUNDING)


@pytest.mark.parametrize("sign", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_reversal_curves_without_a_common_grid_tell_a_smooth_law(sign, seed):
    """Turning points and samples at random; between curves E is off by the second order of their distance."""

    def density(a, b):  # of one sign, and of both, whose output rises and falls on the way up
        return (1.0 - sign + sign * (a + b)) * np.exp(-4.0 * ((a + b) / 2.0) ** 2 - 6.0 * ((a - b) / 2.0 - 0.4) ** 2)

    rng = np.random.default_rng(seed)
    truth = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 81), density)
    ways = [np.array([-1.0])]
    for turn in [*np.sort(rng.uniform(-0.9, 0.95, 7)), 1.0]:
        n = int(rng.integers(20, 60))
        ways += [np.linspace(-1.0, turn, n)[1:], np.linspace(turn, -1.0, n + 7)[1:]]
    u = np.concatenate(ways)
    y = truth.response(u)
    found = hs.Preisach.from_reversal_curves(hs.Record(u=u, y=y))
    assert np.std(found.response(u) - y) < 1e-3 * np.ptp(y)  # on four to six intervals between turning points 2e-2
    walk = np.append(-1.0, rng.uniform(-1.0, 1.0, 200))
    wanted = truth.response(walk)
    assert np.std(found.response(walk) - wanted) < 2e-2 * np.ptp(wanted)
    turns = np.unique(u[hs.Record(u=u, y=y).reversals(0.01)])
    coarse = hs.Preisach.from_reversal_curves(hs.Record(u=u, y=y), levels=turns)
    assert np.std(found.response(walk) - wanted) < 0.5 * np.std(coarse.response(walk) - wanted)


def test_coarse_reversal_curves_predict_a_random_input_of_a_smooth_law():
    """A Lorentzian density; E is interpolated, with an error of the second order in the distance of the levels."""

    def density(a, b):
        return 1.0 / ((1.0 + (a - b - 0.4) ** 2 / 0.1) * (1.0 + (a + b) ** 2))

    truth = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 81), density)
    u = np.append(-1.0, np.random.default_rng(3).uniform(-1.0, 1.0, 200))
    y = truth.response(u)
    errors = []
    for curves in (5, 10, 20):
        sweep = hs.signals.reversal_curves(-1.0, 1.0, curves=curves, samples_per_step=4)
        found = hs.Preisach.from_reversal_curves(hs.Record(u=sweep, y=truth.response(sweep)))
        errors.append(np.abs(found.response(u) - y).max() / np.ptp(y))
    assert errors[0] < 0.05
    assert errors[2] < 0.3 * errors[1] < 0.1 * errors[0]


def test_weights_come_back_from_a_record_with_inner_loops():
    law = a_law(hs.Preisach)
    u = np.interp(hs.signals.reversal_curves(0.0, 5.0, curves=5, samples_per_step=4), np.arange(6), LEVELS)
    fit = hs.identify(hs.Preisach.structure(levels=LEVELS), hs.Record(u=u, y=law.response(u)))
    assert fit.model.weights == pytest.approx(WEIGHTS, abs=1e-11)  # rounding times the condition, 1e2
    assert fit.n_parameters == 16
    again = hs.identify(law, hs.Record(u=u, y=3.0 * law.response(u)))
    assert again.model.weights == pytest.approx(np.multiply(3.0, WEIGHTS), abs=1e-11)


def test_noise_leaves_weights_of_one_sign():
    law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 7), lambda a, b: np.exp(-5.0 * (a - b)))
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=6, samples_per_step=5)
    record = hs.Record(u=u, y=law.response(u) + 0.01 * np.random.default_rng(2).normal(size=u.size))
    fit = hs.identify(hs.Preisach.structure(levels=law.levels), record)
    assert fit.model.is_invertible()
    rough = hs.Preisach.from_reversal_curves(record)
    walk = np.append(-1.0, np.random.default_rng(4).uniform(-1.0, 1.0, 300))
    errors = [np.std(model.response(walk) - law.response(walk)) for model in (fit.model, rough)]
    assert errors[0] < 0.5 * errors[1]


def test_one_loop_tells_two_weights_for_each_interval_but_one():
    fit = hs.identify(hs.Preisach, hs.datasets.table1())
    assert fit.n_parameters == 8
    assert fit.fit_percent > 96.4
    assert fit.model.is_invertible()
    assert np.isfinite([fit.stderr[name] for name in fit.free_names]).all()
    assert "3 of the 10 weights cannot be estimated separately" in fit.message
    assert "a smooth density predicts parts left out not clearly better" in fit.message
    wide = hs.identify(hs.Preisach, hs.datasets.table1(), free="weights[6]")
    assert wide.n_parameters == 9
    assert wide.rmse == pytest.approx(fit.rmse, rel=1e-9)  # it adds nothing


@pytest.mark.parametrize("width", [0.3, 1.2])
def test_a_single_loop_of_any_width_is_fitted(width):
    """Held weights take nothing away from the fit: those that the loop needs are free."""
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, width / 2.0), weights=(0.2, 1.0))
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=80)
    law = hs.Preisach.from_plays(np.linspace(-1.0, 1.0, 9), plays)
    fit = hs.identify(hs.Preisach.structure(intervals=8), hs.Record(u=u, y=law.response(u)))
    assert fit.rmse < 1e-12
    assert fit.n_parameters <= 16


def test_a_clockwise_loop_gets_weights_of_the_other_sign():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    law = hs.MaxwellSlip(stiffness=(1.0,), slips=(0.25,), feedthrough=0.5)
    record = hs.Record(u=u, y=law.response(u))
    fit = hs.identify(hs.Preisach, record)
    assert min(fit.model.weights) < 0.0 < fit.model.slope_bounds()[0]
    free = hs.identify(hs.Preisach.structure(one_signed=False), record)
    assert max(fit.rmse, free.rmse) < 1e-14  # thresholds of half an interval are exact at these levels


def test_the_former_turning_point_comes_back():
    law = a_law(hs.Preisach)
    u = np.interp(np.arange(0.0, 5.01, 0.1), np.arange(6), [0.1, 0.4, -0.6, 0.2, -0.4, 0.3])
    _, state = law.advance([-1.0, 0.8, 0.1])
    record = hs.Record(u=u, y=law.advance(u, state)[0])
    fit = hs.identify(hs.Preisach.structure(levels=LEVELS), record, initial="free")
    assert fit.rmse < 1e-6  # where the polish ends
    assert fit.estimates["turn"] > 0.4
    assert fit.model.z0 == (fit.estimates["turn"],)


def test_the_steady_memory_repeats():
    law = a_law(hs.Preisach)
    period = np.array([0.0, 0.9, 0.2, 0.5, -0.7])
    record = hs.Record(u=period, y=np.zeros(5))
    space = law.search_space(record, Freedom(initial="periodic"))
    steady = law.steady(space.parameters(np.zeros((1, 0))), record)
    numbers = {name: float(np.ravel(value)[0]) for name, value in steady.items()} | dict.fromkeys(space.columns, 1.0)
    assert np.array_equal(*law.assemble(numbers).response(np.tile(period, 2)).reshape(2, -1))
    fit = hs.identify(law, hs.Record(u=np.tile(period, 6), y=law.response(np.tile(period, 7))[5:]), initial="periodic")
    assert fit.rmse < 1e-12


def test_a_law_is_a_plant_of_a_loop_and_of_an_actuator():
    law = hs.Preisach.from_density(np.linspace(-4.0, 4.0, 9), lambda a, b: np.exp(b - a))
    t = np.arange(200) / 100.0
    run = hs.close_loop(law, hs.PID(ki=20.0), t, 0.3 * np.sin(3.0 * t))
    assert run.y[1:] == pytest.approx(law.response([0.0, *run.u])[1:-1], abs=1e-12)
    actuator = hs.Actuator(hysteresis=law, vibration=hs.mode(100.0, 0.1))
    assert np.isfinite(actuator.response(np.sin(t), 0.01)).all()


def test_nothing_in_nothing_out():
    law = a_law(hs.Preisach, z0=(0.5, 0.2))
    assert law.response([]).size == 0
    assert law.advance([], (9.0, 1.0))[1] == (9.0, 1.0)
    assert law.advance([])[1] == (0.2, 0.5, 0.2)
    assert law.inverse_response([]).size == 0
    assert hs.Preisach(offset=2.0).response([0.0, 1.0, -3.0]).tolist() == [2.0, 2.0, 2.0]


@pytest.mark.parametrize("law", [hs.Preisach(), hs.PreisachRelays()])
def test_a_memory_of_any_length_is_not_offered_as_an_array(law):
    """The arrays of other laws have no room for extremes: filling them wrote beyond their end."""
    assert law.memory is None
    assert law.remembered is None


# --------------------------------------------- density and drift of reversal curves, and the law of the smoothed curves


CURVES = 40
U = hs.signals.reversal_curves(-1.0, 1.0, curves=CURVES, samples_per_step=2)


def true(a, b):
    return np.exp(-20.0 * (a + b) ** 2 - 8.0 * (a - b - 0.6) ** 2) + 0.3 * np.exp(-3.0 * (a - b - 1.0) ** 2)


LAW = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 4 * CURVES // 2 + 1), true)
Y = LAW.response(U)
SIZE = np.ptp(Y)


def measured(noise, drift=0.0, seed=0):
    late = np.arange(U.size) / U.size
    return hs.Record(u=U, y=Y + SIZE * (noise * np.random.default_rng(seed).standard_normal(U.size) + drift * late))


def correlation(diagram):
    known = np.isfinite(diagram.density)
    a, b = np.meshgrid(diagram.levels, diagram.levels, indexing="ij")
    return np.corrcoef(diagram.density[known], true(a, b)[known])[0, 1]


@functools.cache
def by_itself(noise):
    return hs.forc(measured(noise))


@pytest.mark.parametrize(("noise", "least"), [(0.0, 0.995), (1e-3, 0.985), (5e-3, 0.95)])
def test_the_chosen_smoothing_is_about_the_best_one(noise, least):
    record = measured(noise)
    given = [correlation(hs.forc(record, smoothing=s)) for s in (1.5, 3.0, 5.0, 7.0)]
    assert correlation(by_itself(noise)) > max(least, max(given) - 0.015)


def test_a_polynomial_of_the_second_degree_is_met_to_rounding():
    """On curves that fall from a to b, y = 3 (1 + a) (1 + b): the density is half of 3."""
    turn = np.maximum.accumulate(U)  # of each fall; a rise to a turning point passes no curve
    y = 3.0 * (1.0 + np.where(np.append(np.diff(U) > 0.0, False), U, turn)) * (1.0 + U)
    known = np.isfinite((diagram := hs.forc(hs.Record(u=U, y=y), smoothing=2.0)).density)
    expected = np.outer([1.5, 0.0], np.ones(known.sum()))
    np.testing.assert_allclose([diagram.density[known], diagram.stderr[known]], expected, atol=1e-9)


@pytest.mark.parametrize("y", [2.0 * U, 3.0 * U**2, np.tanh(2.0 * U)], ids=["line", "parabola", "tanh"])
def test_no_density_is_named_where_none_is_above_its_standard_error_and_rounding(y):
    diagram = hs.forc(hs.Record(u=U, y=y), smoothing=2.0)
    assert diagram.ridge.shape == (0, 4)
    assert re.search(r"largest density +none above three standard errors", str(diagram))
    ridge = next(line for line in hs.plot.forc(diagram).lines if line.get_label() == "ridge")
    assert ridge.get_linestyle() == "None"  # the largest densities at neighbouring distances may lie far apart


def test_curves_that_rise_have_the_density_of_the_record_turned():
    record = measured(1e-3)
    falls, rises = (hs.forc(each, smoothing=3.0) for each in (record, hs.Record(u=-record.u, y=-record.y)))
    np.testing.assert_allclose(rises.density, falls.density[::-1, ::-1].T, rtol=1e-9)
    np.testing.assert_allclose(rises.ridge[:, 1], -falls.ridge[:, 1], atol=1e-12)


def test_a_drift_is_told_from_noise_and_subtracted():
    still, moves = (hs.forc(measured(2e-4, drift), smoothing=3.0) for drift in (0.0, 0.02))
    assert [still.drift, still.noise] == pytest.approx([0.0, 2e-4 * SIZE], rel=0.3)
    assert [moves.drift, moves.noise] == pytest.approx([0.02 * SIZE, 4e-4 * SIZE], rel=0.3)
    assert correlation(moves) > correlation(still) - 0.005
    assert ["none above" in str(each) for each in (still, moves)] == [True, False]


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_the_law_of_smoothed_curves_predicts_those_left_out(noise):
    """Every fifth one; without noise it is better than the law between the samples, and with noise near the truth."""
    record = measured(noise)
    falls = [part for part in record.branches(1e-6) if part.u[0] > part.u[-1]]
    rest = [part for k, part in enumerate(falls) if k % 5 != 2]
    path = [np.concatenate([getattr(part, name) for part in rest]) for name in "uy"]
    laws = {s: hs.Preisach.from_reversal_curves(hs.Record(u=path[0], y=path[1]), smoothing=s) for s in (None, "auto")}
    left = np.concatenate([np.append(part.u, -1.0) for part in falls[2::5]])
    errors = {s: np.sqrt(np.mean((law.response(left) - LAW.response(left)) ** 2)) / SIZE for s, law in laws.items()}
    assert errors["auto"] < min(errors[None], 6e-4 + 0.7 * noise)


def test_standard_errors_are_those_of_many_draws():
    drawn = [hs.forc(measured(5e-3, seed=k), smoothing=5.0) for k in range(12)]
    spread = np.std([each.density for each in drawn], axis=0, ddof=1)
    assert 0.85 < np.nanmedian(np.mean([each.stderr for each in drawn], axis=0) / spread) < 1.3


def smoothed(case):
    u = hs.signals.reversal_curves(0.0, 1.0, curves=case[0])
    return hs.forc(hs.Record(u=u, y=0.0 * u), smoothing=case[1])


test_what_cannot_be_smoothed_is_refused = refused(
    ((5, "auto"), "at least 10 reversal curves, the record has 5"),
    ((20, 0.0), "smoothing must be positive"),
    ((20, "all"), 'a number or "auto"'),
    ((2, 2.0), "too few or too short"),
    call=smoothed,
)


def test_the_command_line_measures_and_draws_it(tmp_path, capsys):
    file = tmp_path / "curves.csv"
    record = measured(1e-3)
    np.savetxt(file, np.column_stack([record.u, record.y]), delimiter=",", header="u,y", comments="")
    assert main(["metrics", str(file), "--forc", "--json", "--plot", str(tmp_path / "density.svg")]) == 0
    assert json.loads(capsys.readouterr().out)["peak"] == pytest.approx(list(by_itself(1e-3).peak))
    assert "ridge" in (tmp_path / "density.svg").read_text()
    assert main(["metrics", str(file), "--forc", "--cycles"]) != 0
    hs.save_record(hs.Record(u=U, y=2.0 * U), file)
    assert main(["metrics", str(file), "--forc", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["peak"] is None
