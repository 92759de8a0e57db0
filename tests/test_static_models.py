"""The yardsticks: a line, and the best function of the input alone."""

import time
import tracemalloc

import numpy as np
import pytest
from scipy import interpolate, stats
from strategies import assert_refused, refused

import hysim as hs


def test_no_function_of_the_voltage_beats_the_curve_through_the_means():
    rec = hs.datasets.table1()
    curve = hs.SingleValued.through_means(rec)
    assert hs.metrics.fit_percent(rec.y, curve.response(rec.u)) == pytest.approx(90.2745, abs=1e-4)
    assert curve.u.tolist() == np.unique(rec.u).tolist()
    pairs = [rec.y[rec.u == level] for level in curve.u]
    assert curve.y == pytest.approx([pair.mean() for pair in pairs])
    best = sum(np.var(pair) * pair.size for pair in pairs)
    assert np.sum((rec.y - curve.response(rec.u)) ** 2) == pytest.approx(best)
    assert np.sum(hs.identify(hs.SingleValued, rec).residual ** 2) > best


def test_inputs_that_rounding_alone_tells_apart_are_one_level():
    once = np.sin(2.0 * np.pi * np.arange(40) / 40)
    u = np.concatenate([once, np.sin(2.0 * np.pi * np.arange(40, 80) / 40)])
    assert np.unique(u).size > 40  # the same sine, computed twice
    assert hs.SingleValued.through_means(hs.Record(u=u, y=np.arange(80.0))).u.size == 21


@pytest.mark.parametrize(("period", "cycles"), [(47, 5), (50, 2), (65, 5), (71, 3), (83, 10)])
def test_sines_whose_extremes_differ_by_a_rounding_are_fitted(period, cycles):
    u = np.sin(2.0 * np.pi * np.arange(period * cycles) / period)
    curve = hs.identify(hs.SingleValued, hs.Record(u=u, y=u**3)).model
    assert (np.diff(curve.u) > 0.0).all()
    assert curve.response(u) == pytest.approx(u**3, abs=0.02)  # a spline of the noise-free cubic, hardly smoothed


def test_the_lowest_inputs_may_be_one_rounding_apart():
    u = np.array([-1.0, np.nextafter(-1.0, 0.0), 0.0, 0.3, 0.5, 1.0])
    assert hs.SingleValued.fitted([hs.Record(u=u, y=u)]).models[0].u[[0, -1]].tolist() == [-1.0, 1.0]


def a_play(n=400, noise=0.01):
    u = np.sin(2 * np.pi * (np.arange(n) + 0.137) / 200)
    y = hs.Play(threshold=0.3).response(u) + noise * np.random.default_rng(0).standard_normal(n)
    return hs.Record(u=u, y=y)


def test_a_fitted_curve_lies_between_loading_and_unloading_and_loses_against_the_law():
    """A curve that read each left-out sample from its neighbour would follow both branches by turns, and win."""
    record = a_play()
    table = hs.compare({"curve": hs.SingleValued, "play": hs.Play, "line": hs.Line}, record)
    curve = table["curve"]
    assert table.winner == "play"
    assert curve.cv_rmse > 10.0 * table["play"].cv_rmse
    assert (curve.max_width, curve.area) == (0.0, 0.0)
    assert curve.n_parameters <= 12
    middle = np.abs(record.u) < 0.6
    centre = np.interp(record.u[middle], curve.model.u, curve.model.y)
    # the play's branches are u +- 0.3; the record begins inside its threshold, which draws the mean aside
    assert centre == pytest.approx(record.u[middle], abs=0.1)


def test_a_smooth_curve_without_a_loop_is_found_in_noise():
    rng = np.random.default_rng(1)
    u = rng.uniform(-1.0, 1.0, 500)
    truth = np.tanh(4.0 * u)
    fit = hs.identify(hs.SingleValued, hs.Record(u=u, y=truth + 0.1 * rng.standard_normal(500)))
    # 0.1 sqrt(d / n) is the standard error of a curve with d degrees of freedom; its bias adds as much at the most
    assert fit.rmse == pytest.approx(0.1, rel=0.1)
    error = np.sqrt(np.mean((fit.model.response(u) - truth) ** 2))
    assert error < 2.0 * 0.1 * np.sqrt(fit.n_parameters / 500)
    assert np.sqrt(np.mean(fit.response_stderr**2)) == pytest.approx(0.1 * np.sqrt(fit.n_parameters / 500), rel=0.25)


def test_the_spline_is_that_of_scipy():
    """The same strength and a knot at every group: the penalised problem of make_smoothing_spline."""
    from hysim.laws import static

    rng = np.random.default_rng(2)
    x = np.sort(rng.uniform(0.0, 1.0, 30))
    x[0], x[-1] = 0.0, 1.0
    y = np.sin(7.0 * x) + 0.1 * rng.standard_normal(30)
    chosen = static._STRENGTHS
    for strength in (1e-5, 1e-3, 1.0):
        static._STRENGTHS = np.array([strength])
        try:
            smooth = static.smoothing_spline(x, y, np.ones(x.size))
        finally:
            static._STRENGTHS = chosen
        reference = interpolate.make_smoothing_spline(x, y, lam=30 * strength)(x)
        # 29 even intervals stand for knots at 30 uneven inputs
        assert smooth.y == pytest.approx(reference, abs=2e-3)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_few_inputs_give_a_curve_too(n):
    u = np.tile(np.arange(float(n)), 2)
    line = hs.identify(hs.SingleValued, hs.Record(u=u, y=3.0 * u - 1.0))
    assert line.model.response([0.5, n - 1.5]) == pytest.approx([0.5, 3.0 * (n - 1.5) - 1.0])
    assert line.n_parameters == 2
    assert line.model.response(u) == pytest.approx(3.0 * u - 1.0)


def test_ten_thousand_samples_are_compared_in_seconds_and_no_matrix_of_their_square_is_held():
    record = a_play(10_000)
    tracemalloc.start()
    begin = time.process_time()
    fit = hs.identify(hs.SingleValued, record, cross_validate=10)
    seconds = time.process_time() - begin
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert fit.model.u.size <= 1002
    assert peak < 30e6
    assert seconds < 10.0  # it takes 0.5 s; a column for each input took more than 150 s


def test_a_left_out_sample_is_predicted_by_a_fit_that_has_not_seen_it():
    record = a_play(60)
    fit = hs.identify(hs.SingleValued, record, cross_validate=3)
    other = hs.identify(hs.SingleValued, record[:40]).model
    assert fit.cv_residual[40:] == pytest.approx(record.y[40:] - other.response(record.u[40:]))
    assert fit.cv_rmse == pytest.approx(np.sqrt(np.mean(fit.cv_residual[20:] ** 2)))


test_what_a_curve_cannot_do_is_refused = refused(
    ({"fixed": {"y(2.5)": 7.0}}, "no parameters by name: leave out fixed="),
    ({"bounds": {"y": (0.0, 1.0)}}, "no parameters by name"),
    ({"noise": "robust"}, 'noise must be "gaussian"'),
    ({"intervals": "profile"}, 'intervals must be "linear"'),
    ({"cross_validate": "lots"}, "cross_validate must be"),
    call=lambda options: hs.identify(hs.SingleValued, a_play(60), **options),
)


def test_a_curve_of_several_records_is_that_of_all_samples():
    record = a_play(120)
    parts = hs.identify(hs.SingleValued, [record[:50], record[50:]], cross_validate="records")
    assert parts.model == hs.identify(hs.SingleValued, record).model
    assert len(parts.models) == 2
    assert hs.Identification.from_json(parts.to_json()) == parts


def test_the_line_is_the_regression_with_its_textbook_errors():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.Line, rec)
    (slope, offset), covariance = np.polyfit(rec.u, rec.y, 1, cov=True)
    assert (fit.model.offset, fit.model.slope) == pytest.approx((offset, slope))
    assert fit.fit_percent == pytest.approx(88.17, abs=5e-3)
    through_zero = hs.identify(hs.Line, rec, fixed={"offset": 0.0})
    assert through_zero.fit_percent == pytest.approx(87.5, abs=0.05)
    assert fit.stderr["slope"] == pytest.approx(np.sqrt(covariance[0, 0]))
    assert fit.stderr["offset"] == pytest.approx(np.sqrt(covariance[1, 1]))


def test_a_static_curve_is_constant_outside_its_knots():
    curve = hs.SingleValued(u=[0.0, 1.0], y=[1.0, 3.0])
    assert curve.response([-1.0, 0.25, 2.0]).tolist() == [1.0, 1.5, 3.0]


@pytest.mark.parametrize(("u", "y"), [([0, 0], [1, 2]), ([1, 0], [1, 2]), ([0], [1, 2]), ([], [])])
def test_knots_that_make_no_function_are_refused(u, y):
    assert_refused("u", hs.SingleValued, u=u, y=y)


def test_the_yardsticks_have_no_memory():
    u = np.array([0.0, 1.0, 0.5, 1.0, 0.0, 0.5])
    for model in (hs.Line(offset=0.3, slope=2.0), hs.SingleValued(u=[0.0, 1.0], y=[0.3, -1.0])):
        assert model.response(u).tolist() == [float(model.response([value])[0]) for value in u]


@pytest.mark.parametrize("family", [hs.SingleValued, hs.Line, hs.Play])
def test_the_log_likelihood_is_that_of_normal_residuals_of_the_best_sigma(family):
    """A fit in one step and a search say the same of the same residuals; the constant is left out."""
    u = np.linspace(-1.0, 1.0, 60)
    record = hs.Record(u=u, y=u**3 + 0.1 * np.random.default_rng(3).standard_normal(60))
    fit = hs.identify(family, record)
    logarithms = stats.norm.logpdf(fit.residual, scale=np.sqrt(np.mean(fit.residual**2)))
    assert fit.log_likelihood == pytest.approx(logarithms.sum() + 30.0 * np.log(2.0 * np.pi), rel=1e-10)


def test_a_weight_counts_samples_of_a_curve():
    rng = np.random.default_rng(0)
    u = np.linspace(0.0, 1.0, 40)
    y = np.sin(3.0 * u) + 0.05 * rng.normal(size=u.size)
    twice = np.where(np.arange(40) % 3 == 0, 2, 1)
    own = hs.identify(hs.SingleValued, hs.Record(u=u, y=y), weights=twice)
    repeated = hs.identify(hs.SingleValued, hs.Record(u=np.repeat(u, twice), y=np.repeat(y, twice)))
    assert own.model.response(u) == pytest.approx(repeated.model.response(u), rel=1e-9)
    left_out = np.where(np.arange(40) == 20, 0.0, 1.0)
    without = hs.identify(hs.SingleValued, hs.Record(u=u[left_out > 0.0], y=y[left_out > 0.0]))
    spoiled = hs.identify(hs.SingleValued, hs.Record(u=u, y=np.where(left_out > 0.0, y, 9.0)), weights=left_out)
    assert spoiled.model.response(u) == pytest.approx(without.model.response(u), rel=1e-12)
    assert spoiled.rmse == pytest.approx(without.rmse)
