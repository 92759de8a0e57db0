"""Fragility curves recover simulated ones, their intervals cover these, and both figures have the numbers."""

import math

import numpy as np
import pytest
from scipy.special import ndtr
from strategies import assert_refused

import hysim as hs

MEDIAN, DISPERSION = 0.7, 0.4
LEVELS = np.linspace(0.2, 1.6, 8)


def test_a_curve_through_two_shares_has_the_closed_form():
    curve = hs.fragility([1.0, math.e], [16, 84], 100)
    quantile = 0.994457883  # of 84 %
    density = math.exp(-0.5 * quantile**2) / math.sqrt(2.0 * math.pi)
    error = 1.959964 * math.sqrt(0.16 * 0.84 / 200.0) / density / (2.0 * quantile)
    assert (curve.median, curve.dispersion) == pytest.approx((math.exp(0.5), 0.5 / quantile), rel=1e-8)
    assert np.log(curve.median_interval) == pytest.approx([0.5 - error, 0.5 + error], rel=1e-6)
    assert curve.probability([1.0, math.e]) == pytest.approx([0.16, 0.84], rel=1e-8)
    far = hs.fragility([1e-9, 1.0, math.e, 1e9], [0, 16, 84, 100], 100)  # where counts say nothing more
    assert (far.median, far.dispersion) == pytest.approx((curve.median, curve.dispersion), rel=1e-6)


@pytest.mark.parametrize("same_records", [False, True])
def test_estimates_recover_the_truth_and_intervals_and_bands_cover_it(same_records):
    rng, x, estimates, covered = np.random.default_rng(3), np.array([0.4, 0.7, 1.2]), [], []
    truth = ndtr(np.log(x / MEDIAN) / DISPERSION)
    for _ in range(400):
        capacity = MEDIAN * np.exp(DISPERSION * rng.normal(size=(40, 1 if same_records else LEVELS.size)))
        curve = hs.fragility(LEVELS, (capacity < LEVELS).sum(axis=0), 40, same_records=same_records)
        limits = np.transpose([curve.median_interval, curve.dispersion_interval, *curve.band(x).T])
        estimates.append((curve.median, curve.dispersion))
        covered.append((limits[0] <= (MEDIAN, DISPERSION, *truth)) & ((MEDIAN, DISPERSION, *truth) <= limits[1]))
    assert np.mean(estimates, axis=0) == pytest.approx((MEDIAN, DISPERSION), rel=0.03)  # 40 records: 2 % too small
    assert np.mean(covered, axis=0) == pytest.approx(0.945, abs=0.035)  # three standard errors of a share of 400


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0, 2.0], [0, 0], 5), "no record exceeds"),
        (([1.0, 2.0], [5, 5], 5), "every record exceeds"),
        (([1.0, 2.0, 3.0], [0, 2, 5], 5), "below the intensity 2, and all do above it"),
        (([1.0, 2.0, 3.0], [4, 2, 1], 5), "falls with the intensity"),
        (([1.0, 1.0], [1, 2], 5), "two must differ"),
        (([1.0, 2.0], [1, 6], 5), "whole numbers from 0 to n_records"),
    ],
)
def test_counts_that_determine_no_curve_are_refused(arguments, words):
    assert_refused(words, hs.fragility, *arguments)
    assert_refused("one number at all intensities", hs.fragility, [1.0, 2.0], [1, 2], [4, 5], same_records=True)


def test_the_figures_have_the_numbers():
    space = {"record": [0, 1, 2], "scale": [2.0, 1.0]}
    study = hs.sweep(lambda record, scale: math.inf if record * scale > 3.0 else (1.0 + record) * scale, space)
    ax = hs.plot.ida(study, "value", hs.plot.figure().add_subplot(), limit=2.5)
    assert [line.get_xdata().tolist() for line in ax.lines[:4]] == [[1, 2], [2, 4], [3, math.inf], [1, 2]]
    assert [line.get_label() for line in ax.lines[3:]] == ["16%", "50%", "84%", "limit"]
    assert_refused("a grid with the parameter pga", hs.plot.ida, study, "value", intensity="pga")
    curve = hs.fragility(study.axes["scale"], [2, 1], 3)
    points = hs.plot.fragility(curve, hs.plot.figure().add_subplot()).lines[1]
    assert points.get_xydata() == pytest.approx(np.array([[2.0, 2 / 3], [1.0, 1 / 3]]))
