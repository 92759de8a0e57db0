"""The field of a core by its flux density: against parts of other laws, its fit, and the update by a known stretch."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.signal
from strategies import assert_refused

import hysim as hs

STEP = 1e-6
THRESHOLDS, LAGS, SIZES = (0.02, 0.1, 0.3), (3e-6, 2e-5), (0.05, 0.2)


def drawn(rng):
    weights = tuple(rng.normal(size=3 * (3 + 2 * 2) + 6))
    return hs.CoreField(size=0.4, thresholds=THRESHOLDS, lags=LAGS, lag_sizes=SIZES, weights=weights)


def path(rng, n_turns=12):
    return hs.signals.extremes([0.0, *rng.uniform(-0.4, 0.4, n_turns)], max_step=0.01)


def record_of(core, u, noise=0.0, rng=None, **channels):
    y = core.response(u, STEP)
    noisy = y if rng is None else y + noise * np.sqrt(np.mean(y**2)) * rng.standard_normal(u.size)
    return hs.Record(u=u, y=noisy, t=STEP * np.arange(u.size), channels=channels)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_sum_of_stops_and_lags_times_powers(seed):
    """Stops by themselves, lags by their differential equation in small steps."""
    rng = np.random.default_rng(seed)
    core, u = drawn(rng), path(rng)
    x = u / core.size
    parts = [hs.Stop(threshold=r).response(u) / r for r in THRESHOLDS]
    fine = np.interp(np.arange(0.0, u.size - 1.0 + 1e-9, 1e-2), np.arange(u.size), u)
    for tau, size in zip(LAGS, SIZES, strict=True):
        rate = 0.5e-2 * STEP / tau
        behind = scipy.signal.lfilter([rate, rate], [1.0 + rate, rate - 1.0], fine)  # the trapezoidal rule
        parts.append((u - behind[::100]) / size)
    parts += [np.copysign(np.sqrt(np.abs(each)), each) for each in parts[3:]]
    alone = [x**power for power in (0, 1, 3, 5, 7, 9)]
    last = [each**2 for each in parts[:3]] + 4 * [x**4]
    pairs = zip(parts, last, strict=True)
    columns = alone + [each * factor for each, own in pairs for factor in (np.ones_like(x), x**2, own)]
    np.testing.assert_allclose(core.response(u, STEP), np.array(columns).T @ core.weights, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(core.terms(record_of(core, u)) @ core.weights, core.response(u, STEP), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_more_samples_on_a_stroke_change_nothing(seed):
    rng = np.random.default_rng(seed)
    core, u = drawn(rng), path(rng)
    finer = np.interp(np.arange(0.0, u.size - 0.75, 0.25), np.arange(u.size), u)
    np.testing.assert_allclose(core.response(finer, STEP / 4)[::4], core.response(u, STEP), rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(core.response(-u, STEP) - core.weights[0], core.weights[0] - core.response(u, STEP))


def measured(rng, differ):
    """A sequence of a core of another kind: cells of dry friction, eddy currents, excess losses, and noise of 2 %."""
    T, (gain, width) = rng.choice([25.0, 60.0, 90.0]), 1.0 + differ * rng.standard_normal(2)
    cells = hs.EnergyPlays(
        thresholds=tuple(width * np.linspace(0.0, 30.0, 20)),
        weights=(gain * 0.025 * (1.0 - 0.002 * T),) * 20,
        field=30.0,
        feedthrough=4e-5,
    )
    u = path(rng, 20) * rng.uniform(0.3, 0.7)
    y = cells.inverse_response(u) + hs.Dashpot(c=2e-4).response(u, STEP) + hs.ExcessLoss(c=0.02).response(u, STEP)
    noise = 0.02 * np.sqrt(np.mean(y**2)) * rng.standard_normal(u.size)
    return hs.Record(u=u, y=y + noise, t=STEP * np.arange(u.size), channels={"T": T})


def test_a_known_stretch_corrects_the_weights():
    """Of cores that differ by a twentieth it takes away much of the error; the noise alone is 2 %."""
    rng = np.random.default_rng(3)
    records = [measured(rng, 0.05) for _ in range(24)]
    fit = hs.identify(
        hs.CoreField.structure(channel="T", known=0.15),
        records[:18],
        weights=[np.full(len(each), 1.0 / np.mean(each.y**2)) for each in records[:18]],
    )
    errors = []
    for record in records[18:]:
        n = int(0.15 * len(record))
        laws = fit.model.at(T=record.channels["T"]), hs.condition(fit, record[:n])
        rest = [(record.y - law.response(record.u, STEP))[n:] for law in laws]
        errors.append([np.sqrt(np.mean(each**2) / np.mean(record.y[n:] ** 2)) for each in rest])
    plain, conditioned = np.mean(errors, axis=0)
    assert conditioned < 0.05
    assert plain > 1.4 * conditioned


def test_a_gain_alone_is_found_from_few_samples():
    rng = np.random.default_rng(0)
    core, u = drawn(rng), path(rng)
    record = record_of(core, u)
    louder = hs.Record(u=u, y=1.3 * record.y, t=record.t)
    np.testing.assert_allclose(hs.condition(core, louder[:80]).weights, 1.3 * np.array(core.weights), rtol=1e-9)


def test_without_noise_it_is_found_again():
    """Where it has the thresholds and lags of the fit; the memory of the first strokes is not known to the fit."""
    rng = np.random.default_rng(1)
    u, structure = path(rng, 40), hs.CoreField.structure(stops=4, lags=LAGS)
    begun = hs.identify(structure, hs.Record(u=u, y=u, t=STEP * np.arange(u.size))).model
    core = begun.with_scalars({f"weights[{k}]": value for k, value in enumerate(rng.normal(size=len(begun.weights)))})
    fit = hs.identify(structure, record_of(core, u))
    np.testing.assert_allclose(fit.residual[200:], 0.0, atol=1e-4)
    assert hs.compare({"core": fit.model}, record_of(core, u))["core"].max_width > 0.0
    np.testing.assert_array_equal(fit.model.response(u[9:], STEP), replace(fit.model, u0=None).response(u[9:], STEP))


def test_sequences_in_the_layout_of_the_magnet_challenge_are_predicted(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "experiments")
    experiment, rng = importlib.import_module("59_cores"), np.random.default_rng(0)
    records = [experiment.sequence(rng, 0.0) for _ in range(6)]
    columns = {"B": [each.u for each in records], "H": [each.y for each in records]}
    for name, rows in (columns | {"T": [[each.channels["T"]] for each in records]}).items():
        np.savetxt(tmp_path / f"3C90_1_{name}.csv", rows, delimiter=",")
    found = {row["model"]: row for row in experiment.measured(tmp_path)}
    assert found["with lags, told the begin"]["worst_percent"] < 40.0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"weights": (1.0,)}, "0 stops and 0 lags need 6 weights, got 1"),
        ({"lags": (1e-6,)}, "lag_sizes must hold one number for each of 1 lags, got 0"),
        ({"thresholds": (0.2, 0.1), "weights": (0.0,) * 12}, "thresholds must increase"),
        ({"size": 0.0}, "size must be positive"),
    ],
)
def test_numbers_that_are_no_law_are_refused(fields, words):
    assert_refused(words, hs.CoreField, **fields)


def test_records_that_tell_nothing_are_refused():
    rest = hs.Record(u=np.ones(50), y=np.ones(50), t=STEP * np.arange(50))
    assert_refused("the input is constant", hs.identify, hs.CoreField, rest)
    with pytest.raises(ValueError, match="the record has no channel 'T'"):
        hs.identify(hs.CoreField.structure(channel="T"), record_of(hs.CoreField(), path(np.random.default_rng(0))))
    assert_refused("takes a CoreField at a constant channel", hs.condition, hs.Dahl(), rest, error=TypeError)
    assert_refused("condition takes a Record", hs.condition, hs.CoreField(), rest.u, error=TypeError)
    with pytest.raises(ValueError, match="tell too little of"):
        hs.identify(hs.CoreField, hs.Record(u=rest.t, y=rest.y, t=rest.t), weights=np.eye(50)[0])
