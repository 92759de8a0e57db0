"""A free memory of plays is that of former turning points, and samples that have forgotten it are few rows."""

from dataclasses import replace

import numpy as np
import pytest

import hysim as hs
from hysim.identification._descent import Descent
from hysim.identification._diagnostics import loop_widths, width_stderr
from hysim.identification._noise import Gaussian
from hysim.identification._problem import problem
from hysim.identification.marquardt import least_squares
from hysim.models.search_space import ALL_FREE, Freedom

THRESHOLDS = tuple((0.1 * np.arange(10)).tolist())
LAW = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=(3.0, *(0.8 ** np.arange(9)).tolist()), offset=0.5)
STRUCTURE = hs.PrandtlIshlinskii.structure(thresholds=THRESHOLDS)
NOISE = 1e-3


def through(*corners, samples=30):
    places = np.arange((len(corners) - 1) * samples + 1) / samples
    return np.interp(places, np.arange(len(corners)), corners)


def record_after(past, path, seed=0, noise=NOISE):
    """What is measured on a path, after the law went from rest through the past."""
    y = LAW.response(np.concatenate([past, path]))[len(past) :]
    return hs.Record(u=path, y=y + noise * np.random.default_rng(seed).standard_normal(path.size))


FADING = record_after((-0.95, 0.2), through(0.05, 0.5, -0.3, 0.6, -0.9, 1.0, -1.0, 0.7, -0.6))


def test_a_past_of_two_turns_is_found_by_default():
    fit = hs.identify(STRUCTURE, FADING)
    assert "identified, by 2 numbers (else the BIC is" in fit.message
    assert fit.rmse < 1.05 * NOISE  # of 241 samples, without which the BIC would not be so much lower
    assert fit.estimates["turn"] == pytest.approx(0.2, abs=0.01)
    assert fit.estimates["turn_2"] == pytest.approx(-0.95, abs=0.01)
    assert fit.stderr["turn_2"] < 0.01
    before = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=fit.model.weights)
    past = [fit.estimates["turn_2"], fit.estimates["turn"]]
    assert fit.model.z0 == pytest.approx(before.memory(past)[-1], abs=1e-15)


def test_no_more_turns_than_the_record_shows():
    past = record_after((-0.9,), FADING.u)
    fit = hs.identify(STRUCTURE, past)
    assert fit.estimates["turn"] == pytest.approx(-0.9, abs=0.01)
    assert "turn_2" not in fit.estimates
    assert "numbers" not in fit.message


def test_the_user_may_say_that_the_state_is_free():
    fit = hs.identify(STRUCTURE, FADING, initial="free")
    assert fit.rmse == pytest.approx(hs.identify(STRUCTURE, FADING).rmse, rel=1e-6)  # where the polish ends
    held = hs.identify(STRUCTURE, FADING, initial="free", fixed={"turn": 0.2})
    assert "turn_2" not in held.estimates


@pytest.mark.parametrize("family", [hs.PrandtlIshlinskii, hs.MaxwellSlip])
def test_what_is_forgotten_is_forgotten_to_the_bit(family):
    structure = family.structure(**{"slips" if family is hs.MaxwellSlip else "thresholds": (0.2, 0.5, 0.9)})
    space = structure.search_space(FADING, Freedom(initial="free"))
    first = structure.forgotten(FADING, space)
    ends = np.array([space.lower, space.upper])
    below, above = structure.regressors(space.parameters(ends), FADING)
    assert np.array_equal(below[first:], above[first:])
    assert not np.array_equal(below[first - 1], above[first - 1])
    searched = structure.search_space(FADING, Freedom(free=(f"{family.thresholds_name}[1]",)))
    assert structure.forgotten(FADING, searched) == len(FADING)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("initial", ["free", "rest", "periodic"])
def test_few_rows_have_the_sums_of_squares_of_all_samples(weighted, initial):
    records = [FADING, record_after((0.3,), through(0.2, 1.1, -1.0, 0.5, -0.5, 0.5), seed=2)]
    rng = np.random.default_rng(3)
    family = replace(STRUCTURE, one_signed=False, turns=2)
    whole = problem(family, records, Freedom(fixed={"weights[1]": 0.9}), initial)
    whole = whole.weighted([rng.uniform(0.0, 2.0, len(each)) for each in records]) if weighted else whole
    short = whole.condensed()
    assert short.y.size < 0.7 * whole.y.size
    space = whole.space
    x = space.lower + rng.uniform(size=(20, whole.n_x)) * (space.upper - space.lower)
    assert short.costs(x) == pytest.approx(whole.costs(x), rel=1e-9)
    assert short.completed(x) == pytest.approx(whole.completed(x), rel=1e-9, abs=1e-9)
    shared = problem(replace(family, turns=1), records, Freedom(fixed={"weights[1]": 0.9}), initial)
    again = replace(whole, settled=None).with_settled(whole.with_settled().settled)
    assert again.condensed().costs(x) == pytest.approx(whole.costs(x), rel=1e-9)
    assert shared.space.linear == whole.space.linear


def test_families_without_it_keep_their_samples():
    for family in (hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=LAW.weights), hs.BoucWen()):
        free = Freedom(free=("thresholds[1]",)) if isinstance(family, hs.PrandtlIshlinskii) else ALL_FREE
        whole = problem(family, [FADING], free, None)
        assert whole.condensed() is whole


@pytest.mark.parametrize("rank", [9, 12])
def test_triangles_give_the_shortest_solutions(rank):
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3, 40, rank)) @ rng.standard_normal((3, rank, 12))
    columns[1, 20:] = 0.0
    columns /= np.linalg.norm(columns, axis=1, keepdims=True)
    target = rng.standard_normal((3, 40))
    expected = [np.linalg.lstsq(c, t, rcond=1e-11)[0] for c, t in zip(columns, target, strict=True)]
    assert least_squares(columns, target) == pytest.approx(np.array(expected), abs=1e-10)  # conditions up to 1e4
    few = least_squares(columns[:, :7], target[:, :7])
    expected = [np.linalg.lstsq(c, t, rcond=1e-11)[0] for c, t in zip(columns[:, :7], target[:, :7], strict=True)]
    assert few == pytest.approx(np.array(expected), abs=1e-9)


def test_the_stderr_of_the_width_is_that_of_small_steps():
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=60)
    y = hs.BoucWen(beta=1.2, gamma=0.3, gain=2.0).response(u)
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=y)], ALL_FREE, None)
    theta = whole.completed(whole.space.starts[-1:])[0]
    rng = np.random.default_rng(0)
    root = 1e-3 * rng.standard_normal((theta.size, theta.size))
    descent = Descent(whole, Gaussian(1e-14), whole.y[np.newaxis], np.ones((1, whole.y.size)))
    steps = 1e-5 * np.eye(theta.size)
    slope = (loop_widths(descent, theta + steps) - loop_widths(descent, theta - steps)) / 2e-5
    expected = float(np.sqrt(slope @ root @ root.T @ slope))
    assert width_stderr(whole, theta, root @ root.T) == pytest.approx(expected, rel=1e-4)  # of the differences
