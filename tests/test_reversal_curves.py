"""First-order reversal curves: their density, their drift, and the law of the smoothed curves."""

import json

import numpy as np
import pytest
from strategies import refused

import hysim as hs
from hysim.cli import main

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


@pytest.mark.parametrize(("noise", "least"), [(0.0, 0.995), (1e-3, 0.985), (5e-3, 0.95)])
def test_the_chosen_smoothing_is_about_the_best_one(noise, least):
    record = measured(noise)
    given = [correlation(hs.forc(record, smoothing=s)) for s in (1.5, 3.0, 5.0, 7.0)]
    assert correlation(hs.forc(record)) > max(least, max(given) - 0.015)


def test_a_polynomial_of_the_second_degree_is_met_to_rounding():
    """On curves that fall from a to b, y = 3 (1 + a) (1 + b): the density is half of 3."""
    turn = np.maximum.accumulate(U)  # of each fall; a rise to a turning point passes no curve
    rises = np.append(np.diff(U) > 0.0, False)
    y = 3.0 * (1.0 + np.where(rises, U, turn)) * (1.0 + U)
    known = np.isfinite((diagram := hs.forc(hs.Record(u=U, y=y), smoothing=2.0)).density)
    expected = np.outer([1.5, 0.0], np.ones(known.sum()))
    np.testing.assert_allclose([diagram.density[known], diagram.stderr[known]], expected, atol=1e-9)


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
    found, diagram = json.loads(capsys.readouterr().out), hs.forc(hs.load(file))
    assert found["peak"] == pytest.approx(list(diagram.peak))
    assert "ridge" in (tmp_path / "density.svg").read_text()
    assert main(["metrics", str(file), "--forc", "--cycles"]) != 0
