"""Intervals are exact where theory is, end where the box ends, and are nan where the data cannot tell."""

import dataclasses

import numpy as np
import pytest
from scipy import optimize, stats

import hysim as hs

LAW = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5)
KINDS = ("linear", "profile", "bootstrap")
INPUT = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40), [-0.4, 0.3, -0.2, 0.9]])


def line_record(n=20, noise=0.3, seed=0):
    u = np.linspace(-1.0, 3.0, n)
    return hs.Record(u=u, y=1.0 + 2.0 * u + noise * np.random.default_rng(seed).standard_normal(n))


def students(record):
    """Estimates, covariance and half the width of the intervals, by the textbook."""
    design = np.column_stack([np.ones(len(record)), record.u])
    estimates, squares = np.linalg.lstsq(design, record.y, rcond=None)[:2]
    covariance = np.linalg.inv(design.T @ design) * squares[0] / (len(record) - 2)
    return design, estimates, covariance, stats.t.ppf(0.975, len(record) - 2) * np.sqrt(np.diag(covariance))


def noisy(sigma=0.01, seed=0):
    y = LAW.response(INPUT) + sigma * np.random.default_rng(seed).standard_normal(INPUT.size)
    return hs.Record(u=INPUT, y=y)


@pytest.mark.parametrize("n", [5, 20, 200])
def test_intervals_of_a_line_are_those_of_student(n):
    record = line_record(n)
    design, estimates, covariance, reach = students(record)
    exact = np.column_stack([estimates - reach, estimates + reach])
    fits = {kind: hs.identify(hs.Line, record, intervals=kind) for kind in KINDS}
    found = {kind: np.array([fit.intervals[name] for name in ("offset", "slope")]) for kind, fit in fits.items()}
    np.testing.assert_allclose(found["linear"], exact, rtol=1e-11)
    # the ends of a profile are found to 1 % of sqrt(D), which is a little more of half the width
    np.testing.assert_allclose(found["profile"], exact, atol=0.02 * reach.max())
    if n == 200:  # 500 draws: a quantile at 2.5 % scatters by 7 % of the standard error, and residuals are few
        np.testing.assert_allclose(found["bootstrap"], exact, atol=0.2 * reach.max())
    linear = fits["linear"]
    np.testing.assert_allclose(linear.covariance, covariance, rtol=1e-10)
    np.testing.assert_allclose(linear.correlation, covariance / np.sqrt(np.outer(*[np.diag(covariance)] * 2)))
    np.testing.assert_allclose(linear.condition, np.linalg.cond(design / np.linalg.norm(design, axis=0)), rtol=1e-10)
    band = np.sqrt(np.einsum("nk,kl,nl->n", design, covariance, design))
    np.testing.assert_allclose(linear.response_stderr, band, rtol=1e-10)


def test_covariance_is_the_scatter_of_repeated_experiments():
    """300 records, fitted by SciPy from the truth: a standard deviation scatters by 4 %, a correlation by 0.06."""
    names = ("beta", "gamma", "feedthrough", "gain")
    truth = np.array([getattr(LAW, name) for name in names])

    def response(values):
        return hs.BoucWen(**dict(zip(names, values, strict=True))).response(INPUT)

    rng = np.random.default_rng(5)
    found = np.empty((300, 4))
    for k in range(300):
        y = LAW.response(INPUT) + 0.01 * rng.standard_normal(INPUT.size)
        found[k] = optimize.least_squares(lambda values, y=y: response(values) - y, truth).x
    outputs = np.array([response(values) for values in found])
    widths = np.array([hs.loop_metrics(INPUT, y).max_width for y in outputs])
    held = {"n": 1.0, "z0": 0.0, "offset": 0.0}
    fits = [hs.identify(hs.BoucWen, noisy(seed=seed), fixed=held) for seed in range(9)]
    assert fits[0].free_names == names
    # the standard errors of one record scatter by 11 % with its sigma, their median by 5 %
    stderr = np.median([list(fit.stderr.values()) for fit in fits], axis=0)
    np.testing.assert_allclose(stderr, np.std(found, axis=0), rtol=0.25)
    np.testing.assert_allclose(np.median([fit.correlation for fit in fits], axis=0), np.corrcoef(found.T), atol=0.25)
    band = np.median([fit.response_stderr for fit in fits], axis=0)
    np.testing.assert_allclose(band, np.std(outputs, axis=0), rtol=0.25, atol=1e-6)
    half = np.median([fit.loop_width.upper - fit.loop_width.value for fit in fits])
    assert half == pytest.approx(stats.t.ppf(0.975, INPUT.size - 4) * np.std(widths), rel=0.25)


def test_the_band_of_the_output_is_that_of_the_delta_method():
    fit = hs.identify(LAW, noisy(), fixed={"n": 1.0})
    slopes = np.empty((INPUT.size, fit.n_parameters))
    for place, name in enumerate(fit.free_names):
        ends = [
            dataclasses.replace(fit.model, **{name: fit.estimates[name] + step}).response(INPUT)
            for step in (1e-6, -1e-6)
        ]
        slopes[:, place] = (ends[0] - ends[1]) / 2e-6
    by_hand = np.sqrt(np.einsum("nk,kl,nl->n", slopes, fit.covariance, slopes))
    np.testing.assert_allclose(fit.response_stderr, by_hand, rtol=1e-5)  # differences of 1e-9, condition 1e2 to 1e3


def test_a_profile_ends_at_the_bound_of_its_parameter_and_says_so():
    record = line_record()
    free = hs.identify(hs.Line, record, intervals="profile")
    for bounds, side in (((0.0, 2.0), 1), ((1.95, np.inf), 0)):
        fit = hs.identify(hs.Line, record, bounds={"slope": bounds}, intervals="profile")
        assert fit.intervals["slope"][side] == pytest.approx(bounds[side], abs=1e-3)
        assert fit.intervals["slope"][1 - side] == pytest.approx(free.intervals["slope"][1 - side], rel=1e-3)
        assert fit.profiles["slope"].at_box == (side == 0, side == 1)
        assert "the interval of slope ends at its search bound" in fit.message


def test_a_linear_parameter_at_its_bound_is_named():
    fit = hs.identify(hs.Line, line_record(), bounds={"slope": (0.0, 1.5)}, intervals="profile")
    assert fit.estimates["slope"] == 1.5
    assert fit.intervals["slope"][1] == 1.5
    assert "slope is at its given bound 1.5" in fit.message


def test_an_exponent_at_the_side_of_its_box_is_taken_as_known():
    fit = hs.identify(LAW, noisy(), bounds={"n": (2.0, 3.0)})
    given = hs.identify(LAW, noisy(), fixed={"n": fit.estimates["n"]})
    assert fit.estimates["n"] == pytest.approx(2.0)
    assert np.isnan([fit.stderr["n"], *fit.intervals["n"]]).all()
    assert "n is at its given bound 2" in fit.message
    factor = np.sqrt((INPUT.size - given.n_parameters) / (INPUT.size - fit.n_parameters))
    assert fit.stderr["beta"] == pytest.approx(factor * given.stderr["beta"], rel=1e-3)  # of two descents


@pytest.mark.parametrize("kind", KINDS)
def test_a_redundant_pair_has_no_numbers_but_words(kind):
    fit = hs.identify(LAW, noisy(), free=("A", "gain"), fixed={"n": 1.0}, intervals=kind)
    for name in ("A", "gain"):
        assert np.isnan([fit.stderr[name], *fit.intervals[name]]).all()
        assert name not in fit.profiles
    assert "the data determine only the product of A and gain" in fit.message
    assert any({"A", "gain"} <= set(group) for group in fit.redundant)
    assert np.isfinite([fit.stderr["beta"], *fit.intervals["beta"]]).all()
    assert fit.condition > 1e7


def test_a_bootstrap_of_data_that_rounding_alone_disturbs_is_not_trusted():
    quantum = 0.1
    rounded = hs.Record(u=INPUT, y=quantum * np.round(LAW.response(INPUT) / quantum), resolution=quantum)
    drawn, profile = (
        hs.identify(LAW, rounded, fixed={"n": 1.0, "z0": 0.0}, noise="quantised", intervals=kind)
        for kind in ("bootstrap", "profile")
    )
    assert 'use "profile"' in drawn.message
    assert "ask for profiles" not in profile.message
    for name in profile.free_names:
        lower, upper = profile.intervals[name]
        assert lower < getattr(LAW, name) < upper
        assert upper - lower > np.ptp(drawn.intervals[name])


def test_one_of_a_redundant_pair_can_be_chosen():
    fit = hs.identify(LAW, noisy(), free=("A",), fixed={"n": 1.0})
    assert "A" in fit.free_names
    assert "gain" not in fit.free_names
    assert np.isfinite(list(fit.stderr.values())).all()
