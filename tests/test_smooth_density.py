"""A Preisach law of a smooth density from records, as smooth as predicts best what is left out."""

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.laws.operators._densities import linear_between, parts_of, roughness
from hysim.models.protocols import Smoother

CYCLE = np.sin(np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False))
LEVELS = np.linspace(-1.3, 1.3, 41)


def positive(a, b):
    return np.exp(-8.0 * ((a + b) / 2.0) ** 2 - 6.0 * ((a - b) / 2.0 - 0.4) ** 2)


def butterfly(a, b):
    """Of both signs, as the strain of a ferroelectric has it."""
    return (a + b) * np.exp(-3.0 * ((a + b) / 2.0) ** 2 - 6.0 * ((a - b) / 2.0 - 0.4) ** 2)


def steady(law, amplitude, noise=0.0, seed=0):
    u = amplitude * CYCLE
    y = law.response(np.tile(u, 2))[u.size :]
    return hs.Record(u=u, y=y + noise * np.random.default_rng(seed).normal(size=u.size))


def relative_error(law, record):
    model = law.response(np.tile(record.u, 2))[len(record) :]
    return float(np.sqrt(np.mean((record.y - model) ** 2)) / np.ptp(record.y))


@pytest.mark.parametrize("density", [positive, butterfly])
def test_loops_of_four_amplitudes_tell_one_between_them(density):
    law = hs.Preisach.from_density(LEVELS, density)
    size = float(np.ptp(steady(law, 1.2).y))
    records = [steady(law, amplitude, 5e-3 * size, k) for k, amplitude in enumerate((0.4, 0.6, 0.9, 1.2))]
    between = steady(law, 0.75)
    own = relative_error(hs.Preisach.smoothed(records, intervals=16), between)
    others = [relative_error(hs.Preisach.smoothed(records, intervals=16, strength=s), between) for s in (1e-9, 1e4)]
    assert own < 0.012
    assert own < 0.75 * min(others)  # than without smoothness, and than with nothing else


def test_reversal_curves_give_every_weight_of_a_smooth_density():
    law = hs.Preisach.from_density(LEVELS[::4], positive)
    u = hs.signals.reversal_curves(-1.3, 1.3, curves=10, samples_per_step=4)
    found = hs.Preisach.smoothed(hs.Record(u=u, y=law.response(u)), intervals=10)
    assert found.weights == pytest.approx(law.weights, abs=5e-3 * max(law.weights))
    assert found.z0 == ()  # all relays down, as the curves begin


def test_the_past_is_the_one_that_predicts_better():
    law = hs.Preisach.from_density(LEVELS, positive)
    assert hs.Preisach.smoothed([steady(law, 0.9), steady(law, 1.2)], intervals=8).z0 != ()
    u = np.concatenate([np.linspace(-1.3, 0.2, 40), 0.9 * CYCLE])
    assert hs.Preisach.smoothed(hs.Record(u=u, y=law.response(u)), intervals=8).z0 == ()


def test_a_record_beyond_the_others_is_not_left_out():
    small, large = hs.Record(u=CYCLE, y=CYCLE), hs.Record(u=2.0 * CYCLE, y=CYCLE)
    whole, quarters = parts_of([small, large])
    assert [part.tolist() for part in whole] == [list(range(CYCLE.size))]  # the small one
    assert sum(part.size for part in quarters) == 2 * CYCLE.size


def test_a_density_that_is_linear_in_both_thresholds_is_smooth():
    """Second differences vanish, and what is left is the ridge, on the diagonal and off it."""
    rows, columns = np.tril_indices(7)
    linear = np.where(rows == columns, 5.0 - 0.5 * rows, 1.0 + 2.0 * rows - 3.0 * columns)
    ridge = 1e-3 * float(linear @ linear)
    assert linear @ roughness(7) @ linear == pytest.approx(ridge, rel=1e-9)
    bent = np.where(rows == columns, 0.0, (rows - columns) ** 2.0)
    assert bent @ roughness(7) @ bent > 10.0


def test_coarse_cells_hold_a_density_that_is_linear_in_both_thresholds():
    """Its weights off the diagonal are those of the density itself, on any number of finer intervals."""
    coarse, fine = (
        np.array(hs.Preisach.from_density(np.linspace(-1.0, 1.0, n + 1), lambda a, b: 3.0 + a - 2.0 * b).weights)
        for n in (5, 12)
    )
    off = np.not_equal(*np.tril_indices(12))
    table = linear_between(5, 12)
    assert (table @ coarse)[off] == pytest.approx(fine[off], rel=1e-12)
    along = np.equal(*np.tril_indices(5)).astype(float)
    assert (table @ along)[~off] == pytest.approx(np.full(12, 5.0 / 12.0), rel=1e-12)  # an even slope stays even


def test_a_clean_record_is_not_made_too_smooth():
    """Without a record the gap is twice as wide as between two: errors added up as they are choose 5e-3 here."""
    law = hs.Preisach.from_density(
        np.linspace(-1.3, 1.3, 81), lambda a, b: np.exp(-((((a - b) / 2.0 - 0.3) / 0.1) ** 2) - (a + b) ** 2 / 2.0)
    )
    found = hs.Preisach.smoothed([steady(law, amplitude) for amplitude in (0.4, 0.6, 0.9, 1.2)])
    assert relative_error(found, steady(law, 0.75)) < 4e-3


test_wrong_options_are_refused = refused(
    ({"intervals": 2.0}, TypeError, "intervals must be a whole number"),
    ({"intervals": 0}, "intervals must be at least 1"),
    ({"strength": -1.0}, "strength must be finite and not negative"),
    ({"strength": np.inf}, "strength must be finite and not negative"),
    call=lambda arguments: hs.Preisach.smoothed(hs.Record(u=CYCLE, y=CYCLE), **arguments),
)


def test_a_constant_input_is_refused():
    assert_refused("the input is constant", hs.Preisach.smoothed, hs.Record(u=np.ones(5), y=np.arange(5.0)))


def loops_of(law, amplitudes, noise):
    size = float(np.ptp(steady(law, max(amplitudes)).y))
    return [steady(law, amplitude, noise * size, k) for k, amplitude in enumerate(amplitudes)]


@pytest.mark.parametrize("density", [positive, butterfly])
def test_the_density_is_returned_where_it_predicts_better_than_the_grid(density):
    law = hs.Preisach.from_density(LEVELS, density)
    records, between = [each[::3] for each in loops_of(law, (0.4, 0.6, 0.9, 1.2), 5e-3)], steady(law, 0.75)
    fit, grid = hs.identify(hs.Preisach, records), hs.identify(hs.Preisach.structure(intervals=4), records)
    assert "predicts parts left out better than a grid" in fit.message
    assert fit.success
    assert relative_error(fit.model, between) < 0.5 * relative_error(grid.model, between)
    for record, model, residual in zip(records, fit.models, np.split(fit.residual, len(records)), strict=True):
        assert record.y - model.response(record.u) == pytest.approx(residual, abs=0.0)
    truth = np.concatenate([steady(law, amplitude).y[::3] for amplitude in (0.4, 0.6, 0.9, 1.2)])
    output = np.concatenate([record.y for record in records]) - fit.residual
    assert np.mean(np.abs(output - truth) < 2.0 * fit.response_stderr) > 0.7


def test_a_line_a_hundred_times_the_loop_is_free_of_the_penalty():
    loops = loops_of(hs.Preisach.from_density(LEVELS, positive), (0.4, 0.6, 0.9, 1.2), 1e-3)
    size = float(np.ptp(loops[-1].y))
    records = [hs.Record(u=each.u, y=each.y + 100.0 * size * each.u) for each in loops]
    family = hs.Preisach.structure(smoothness=10.0)
    alone, on_line = (np.std(hs.identify(family, each).residual) for each in (loops, records))
    assert alone < 0.1 * size
    assert on_line == pytest.approx(alone, rel=1e-6)


def test_errors_of_left_out_samples_are_those_of_fits_without_them():
    rng = np.random.default_rng(0)
    columns, y, weights = rng.normal(size=(30, 6)), rng.normal(size=30), rng.uniform(0.5, 2.0, 30)
    weights[7] = 0.0
    penalty = np.diag([0.0, 0.0, 0.3, 1.0, 2.0, 5.0])

    def solved(shares):
        return np.linalg.solve(columns.T @ (shares[:, np.newaxis] * columns) + penalty, columns.T @ (shares * y))

    inverse = np.linalg.inv(columns.T @ (weights[:, np.newaxis] * columns) + penalty)
    samples = np.arange(0, 60, 2)  # of 60, of which the fit takes every second
    smoother = Smoother(samples, columns @ np.linalg.cholesky(inverse), weights)
    residual = np.full(60, 9.0)
    residual[samples] = y - columns @ solved(weights)
    folds = np.array_split(np.arange(60), 4)
    errors = smoother.left_out(residual, folds)
    for fold in folds:
        inside = np.isin(samples, fold)
        own = y - columns @ solved(np.where(inside, 0.0, weights))
        assert errors[samples[inside & (weights > 0.0)]] == pytest.approx(own[inside & (weights > 0.0)], rel=1e-9)
    assert np.isnan(errors[[1, 14]]).all()
    hat = columns @ inverse @ columns.T * weights
    assert smoother.degrees_of_freedom == pytest.approx(np.trace(hat))
    covariance = columns @ inverse @ columns.T @ np.diag(weights) @ columns @ inverse @ columns.T
    assert smoother.spread(60)[samples] == pytest.approx(np.sqrt(np.diag(covariance)))


def test_samples_of_no_weight_have_no_part_in_the_fit():
    record = steady(hs.Preisach.from_density(LEVELS, positive), 1.2, 1e-3)
    spoiled = hs.Record(u=record.u, y=np.where(np.arange(120) % 7 == 3, 5.0, record.y))
    weights = np.where(np.arange(120) % 7 == 3, 0.0, 2.0)
    family = hs.Preisach.structure(smoothness="auto")
    own, others = hs.identify(family, spoiled, weights=weights), hs.identify(family, record, weights=weights)
    assert own.model.weights == pytest.approx(others.model.weights, abs=1e-9)
    assert own.rmse == pytest.approx(others.rmse)


def test_a_density_is_made_smoother_until_it_is_safe_on_smaller_cycles():
    u = np.sin(0.2 * np.arange(300))
    u[:150] *= 0.2  # nothing is known of amplitudes between two
    record = hs.Record(u=u, y=np.tanh(15.0 * np.gradient(u)) + 0.3 * u)
    family = hs.Preisach.structure(smoothness="auto")
    wild, safe = hs.identify(family, record, admissible=False), hs.identify(family, record)
    assert wild.unsafe
    assert not safe.unsafe
    assert safe.success
    assert safe.rmse > wild.rmse
