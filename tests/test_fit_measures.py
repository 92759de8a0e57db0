"""The fit measures are the formulas that they quote."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused

from hysim import metrics

ROUNDING = 1e-12  # relative; a handful of operations
Y = np.array([0.0, 1.0, 4.0, 9.0])
MODEL = np.array([0.5, 1.0, 3.0, 9.0])
E = Y - MODEL


def test_the_errors_are_root_mean_squares():
    assert metrics.rmse(Y, MODEL) == pytest.approx(math.sqrt(1.25 / 4), rel=ROUNDING)
    assert metrics.nrmse(Y, MODEL) == pytest.approx(math.sqrt(1.25 / 4) / 9, rel=ROUNDING)


def test_the_fit_is_100_for_the_truth_0_for_the_mean_and_negative_beyond():
    assert metrics.fit_percent(Y, Y) == 100.0
    assert metrics.fit_percent(Y, np.full(4, Y.mean())) == 0.0
    assert metrics.fit_percent(Y, 2 * Y.mean() - Y) == pytest.approx(-100.0, rel=ROUNDING)
    expected = 100 * (1 - np.linalg.norm(E) / np.linalg.norm(Y - Y.mean()))
    assert metrics.fit_percent(Y, MODEL) == pytest.approx(expected, rel=ROUNDING)


def test_a_constant_output_has_no_fit():
    assert math.isnan(metrics.fit_percent([0.1, 0.1, 0.1], [0.1, 0.2, 0.3]))
    assert math.isnan(metrics.nrmse([0.1, 0.1, 0.1], [0.1, 0.2, 0.3]))


def test_the_criteria_are_their_formulas():
    v, n, d = np.mean(E**2), 4, 2
    assert metrics.fpe(E, d) == pytest.approx(v * (1 + d / n) / (1 - d / n), rel=ROUNDING)
    assert metrics.aic(E, d) == pytest.approx(n * math.log(v) + 2 * d, rel=ROUNDING)
    assert metrics.bic(E, d) == pytest.approx(n * math.log(v) + d * math.log(n), rel=ROUNDING)


@pytest.mark.parametrize("criterion", [metrics.fpe, metrics.aic, metrics.bic])
def test_criteria_do_not_exist_with_as_many_parameters_as_samples(criterion):
    assert math.isfinite(criterion(E, 3))
    assert math.isnan(criterion(E, 4))
    assert math.isnan(criterion(np.zeros(4), 5))


def test_a_residual_of_zero_is_infinitely_good():
    assert metrics.fpe(np.zeros(4), 1) == 0.0
    assert metrics.aic(np.zeros(4), 1) == -math.inf
    assert metrics.bic(np.zeros(4), 1) == -math.inf


@given(st.lists(st.integers(-100, 100), min_size=3, max_size=20), st.sampled_from([1e-300, 3.0, 9.0, 1e300]))
def test_the_fit_does_not_depend_on_the_unit(values, factor):
    y = np.array(values, dtype=float)
    model = y[::-1]
    fits = metrics.fit_percent(y, model), metrics.fit_percent(factor * y, factor * model)
    # The fit is a difference from 100: its error is relative to that, times a ratio of norms of at most 2.
    assert fits[1] == pytest.approx(fits[0], abs=100 * 2 * ROUNDING, nan_ok=True)


@pytest.mark.parametrize("measure", [metrics.rmse, metrics.nrmse, metrics.fit_percent])
def test_what_cannot_be_compared_is_refused(measure):
    assert_refused("equal lengths, got 4 and 3", measure, Y, Y[:3])
    assert_refused("y_model must be finite, got nan at index 1", measure, [1.0, 2.0], [1.0, math.nan])
    assert_refused("y must have 1 axis, got shape", measure, [[1.0]], [[1.0]])
    assert_refused("at least 1 sample", measure, [], [])


@pytest.mark.parametrize("criterion", [metrics.fpe, metrics.aic, metrics.bic])
def test_a_criterion_of_nothing_is_refused(criterion):
    assert_refused("at least 1 residual", criterion, [], 0)
    assert_refused("must not be negative, got -1", criterion, E, -1)
    assert_refused("residual must be finite, got inf at index 0", criterion, [math.inf], 0)


def test_residuals_below_a_floor_are_no_evidence():
    assert metrics.bic(np.zeros(4), 1, floor=0.5) == pytest.approx(4 * math.log(0.25) + math.log(4), rel=ROUNDING)
    assert metrics.bic(E, 2, floor=0.1) == pytest.approx(4 * math.log(1.25 / 4 + 0.01) + 2 * math.log(4), rel=ROUNDING)
