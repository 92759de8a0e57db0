"""A law that runs away on smaller cycles is not returned as a success."""

import json

import numpy as np
import pytest

import hysim as hs
from hysim.cli import main
from hysim.identification._admissible import effective_samples, excursion

TRUE = hs.BoucWen(beta=0.01, gamma=0.005, feedthrough=0.03, gain=-0.012)


def outer_loop(seed: int) -> hs.Record:
    """One loop of a stack of piezoelectric elements, with noise of 1 % of the stroke."""
    u = np.concatenate([np.linspace(0.0, 150.0, 31), np.linspace(150.0, 0.0, 31)[1:]])
    y = TRUE.response(u)
    noise = 0.01 * np.ptp(y) * np.random.default_rng(seed).standard_normal(u.size)
    return hs.Record(u=u, y=y + noise, units={"u": "V", "y": "um"})


@pytest.fixture(scope="module")
def record() -> hs.Record:
    return outer_loop(0)


@pytest.fixture(scope="module")
def default(record) -> hs.Identification:
    return hs.identify(hs.BoucWen, record, fixed={"n": 1.0}, cross_validate="loo")


@pytest.fixture(scope="module")
def unrestricted(record) -> hs.Identification:
    return hs.identify(hs.BoucWen, record, fixed={"n": 1.0}, admissible=False)


@pytest.fixture(scope="module")
def only_unsafe() -> hs.Identification:
    return hs.identify(hs.BoucWen, hs.datasets.table1(), fixed={"n": 1.0})


@pytest.fixture(scope="module")
def only_safe() -> hs.Identification:
    return hs.identify(hs.BoucWen, hs.datasets.table1(), fixed={"n": 1.0}, admissible=True)


def small_cycles(record: hs.Record) -> np.ndarray:
    """Inputs from the end of the record on, within its range: other than those of the trials."""
    turns = np.random.default_rng(7).uniform(record.u.min(), record.u.max(), 300)
    return np.concatenate([record.u, np.interp(np.arange(0.0, 299.0, 0.2), np.arange(300), turns)])


def test_the_default_is_an_admissible_law_where_it_fits_as_well_within_the_noise(record, default, unrestricted):
    u = small_cycles(record)
    truth = TRUE.response(u)
    best, safe = (np.abs(fit.model.response(u) - truth).max() / np.ptp(record.y) for fit in (unrestricted, default))
    assert best > 1.0  # one loop does not determine what the memory does on others
    assert safe < 0.1
    assert default.success
    assert default.unsafe == ""
    assert default.model.admissible
    assert "unsafe on smaller cycles" in default.message
    assert unrestricted.rmse < default.rmse


def test_the_law_that_was_not_returned_is_kept(record, default, unrestricted):
    other = default.regions["unrestricted"]
    assert other.fit_percent == pytest.approx(unrestricted.fit_percent, abs=1e-6)
    assert other.model.response(record.u) == pytest.approx(unrestricted.model.response(record.u), abs=1e-6)
    assert unrestricted.regions["admissible"].fit_percent == pytest.approx(default.fit_percent, abs=1e-6)


def test_every_number_is_that_of_the_law_that_is_returned(record, default):
    y = default.model.response(record.u)
    assert default.residual == pytest.approx(record.y - y, abs=1e-12)
    assert default.fit_percent == pytest.approx(hs.metrics.fit_percent(record.y, y), abs=1e-9)
    assert default.rmse == pytest.approx(np.sqrt(np.mean((record.y - y) ** 2)), rel=1e-9)
    assert default.loop_width.value == pytest.approx(hs.loop_metrics(record.u, y).max_width, rel=1e-6)
    for name, value in default.estimates.items():
        assert default.model.scalars[name] == value
    assert default.cv_rmse == pytest.approx(np.sqrt(np.nanmean(default.cv_residual**2)), rel=1e-9)
    assert default.cv_rmse < 1.5 * default.rmse  # the folds are fitted inside the same region
    assert default.response_stderr.max() < 0.05 * np.ptp(record.y)
    lower, upper = default.intervals["feedthrough"]
    assert lower < default.estimates["feedthrough"] < upper


def test_the_unrestricted_optimum_is_returned_where_it_is_asked_for_and_says_that_it_is_unsafe(unrestricted):
    assert unrestricted.success
    assert unrestricted.summary().startswith("UNSAFE on smaller cycles: within 0 to 150 V this law runs away.")


@pytest.mark.parametrize("intervals", ["profile", "bootstrap"])
def test_intervals_of_every_kind_stay_inside_the_admissible_region(record, intervals):
    fit = hs.identify(hs.BoucWen, record, fixed={"n": 1.0}, intervals=intervals)
    assert fit.success
    assert fit.model.admissible
    assert "unrestricted" in fit.regions
    assert fit.intervals["beta"][0] >= -1e-9


def test_a_law_that_is_safe_is_the_optimum_whatever_its_region():
    """With a quadratic input Table 1's optimum lies outside -beta <= gamma <= beta, and is bounded none the less."""
    fit = hs.identify(hs.PolynomialBoucWen, hs.datasets.table1(), fixed={"n": 1.0})
    assert fit.success
    assert fit.fit_percent == pytest.approx(96.3107, abs=1e-3)
    assert not fit.model.admissible
    assert fit.model.memory_bound < np.inf
    assert fit.regions["admissible"].fit_percent == pytest.approx(95.982, abs=1e-3)
    assert "best admissible: fit 95.98 % (admissible=True)" in fit.summary()
    inside = hs.identify(hs.PolynomialBoucWen, hs.datasets.table1(), fixed={"n": 1.0}, admissible=True)
    assert inside.model.admissible
    assert inside.model == fit.regions["admissible"].model
    assert inside.success
    assert "that is not admissible" in inside.message


def test_where_only_an_unsafe_law_fits_the_first_line_says_so(only_unsafe):
    first = "UNSAFE on smaller cycles: within 0 to 125 V this law runs away."
    assert not only_unsafe.success
    assert only_unsafe.unsafe.startswith(first)
    assert "Take hs.PrandtlIshlinskii, or admissible=True (fit 93.51 %)." in only_unsafe.unsafe
    for text in (str(only_unsafe), only_unsafe.summary()):
        assert text.startswith(first)
    assert "NOT converged" not in str(only_unsafe)
    assert hs.Identification.from_json(only_unsafe.to_json()).unsafe == only_unsafe.unsafe
    document = json.loads(only_unsafe.to_json())
    del document["identification"]["fields"]["unsafe"]
    assert hs.Identification.from_json(json.dumps(document)).unsafe == ""  # a file of an earlier version


def test_the_admissible_law_is_returned_where_it_is_asked_for_whatever_its_fit(only_unsafe, only_safe):
    table, fit = hs.datasets.table1(), only_safe
    assert fit.success
    assert fit.unsafe == ""
    assert fit.fit_percent == pytest.approx(only_unsafe.regions["admissible"].fit_percent, abs=1e-9)
    assert fit.model == only_unsafe.regions["admissible"].model
    assert excursion([fit.model], [table]).is_safe
    assert not excursion([fit.regions["unrestricted"].model], [table]).is_safe
    assert "reached its search bound" not in fit.message
    assert "at the edge of the admissible ones" in fit.message


def test_a_family_without_a_region_has_an_admissible_law_too(only_safe):
    """The generalised law's optimum on one thin loop diverges on others."""
    table = hs.datasets.table1()
    best = hs.identify(hs.GeneralizedBoucWen, table, fixed={"n": 1.0}, admissible=False)
    safe = hs.identify(hs.GeneralizedBoucWen, table, fixed={"n": 1.0}, admissible=True)
    assert best.unsafe != ""
    assert safe.unsafe == ""
    assert safe.success
    assert only_safe.rmse < np.inf
    assert safe.rmse < only_safe.rmse  # it contains that law, and begins there
    assert safe.residual == pytest.approx(table.y - safe.model.response(table.u), abs=1e-12)


def test_several_records_have_one_admissible_law(record):
    both = [record, outer_loop(3)]
    fit = hs.identify(hs.BoucWen, both, fixed={"n": 1.0}, admissible=True)
    assert fit.model.admissible or excursion(fit.models, both).is_safe
    outputs = [model.response(each.u) for model, each in zip(fit.models, both, strict=True)]
    assert fit.residual == pytest.approx(np.concatenate([each.y for each in both]) - np.concatenate(outputs), abs=1e-12)


def test_tables_of_several_laws_mark_the_unsafe_ones(only_unsafe):
    table = hs.datasets.table1()
    selection = hs.select({"unsafe": hs.BoucWen, "line": hs.Line}, table).to_text()
    assert "unsafe (UNSAFE)" in selection
    fits = {"bouc-wen": only_unsafe, "line": hs.identify(hs.Line, table)}
    comparison = hs.compare(fits, table)
    assert "bouc-wen (UNSAFE)" in comparison.to_text()
    assert comparison["bouc-wen"].unsafe == fits["bouc-wen"].unsafe
    assert any(each.startswith("bouc-wen: UNSAFE on smaller cycles") for each in comparison.warnings)
    assert comparison["line"].unsafe == ""


def test_the_command_line_has_the_same_option(tmp_path, capsys):
    table = hs.datasets.table1()
    path = str(tmp_path / "table.csv")
    np.savetxt(path, np.column_stack([table.u, table.y]), delimiter=",", header="u,y", comments="")
    command = ["identify", path, "--model", "bouc-wen", "--fix", "n=1"]
    assert main(command) == 1
    text = capsys.readouterr().out
    assert text.startswith("UNSAFE on smaller cycles: within 0 to 125 this law runs away.")
    assert "Take prandtl-ishlinskii, or --admissible yes (fit 93.51 %)." in text
    assert main([*command, "--admissible", "no"]) == 0
    assert "fit 95.71 %" in capsys.readouterr().out
    assert main([*command, "--admissible", "yes", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["unsafe"] == ""
    assert document["fit_percent"] == pytest.approx(93.511, abs=1e-3)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlated_residuals_count_as_fewer_samples(rho):
    rng = np.random.default_rng(1)
    residual = np.zeros(20_000)
    for k, noise in enumerate(rng.standard_normal(20_000 - 1), 1):
        residual[k] = rho * residual[k - 1] + noise
    # the variance of a mean of an autoregression; 20 000 samples give the correlation time to some per cent
    assert effective_samples(residual) == pytest.approx(20_000 * (1.0 - rho) / (1.0 + rho), rel=0.15)


def test_a_residual_of_nothing_has_all_its_samples():
    assert effective_samples(np.zeros(10)) == 10.0
    assert effective_samples(np.array([1.0, -1.0, 1.0])) == 3.0


def test_a_wrong_family_is_not_excused_by_its_correlated_residual():
    """Dahl's law follows Table 1 from a memory far from rest, to which it drifts in small cycles."""
    table = hs.datasets.table1()
    fit = hs.identify(hs.Dahl, table)
    assert not fit.success
    assert fit.unsafe.startswith("UNSAFE")
    other = fit.regions["admissible"]
    assert effective_samples(fit.residual) * 2.0 * np.log(other.rmse / fit.rmse) < 10.0
    assert other.rmse > 1.25 * fit.rmse
    assert excursion([other.model], [table]).is_safe


def test_a_verb_that_drives_a_device_warns_of_an_unsafe_law(only_unsafe):
    for drive in (hs.InverseFeedforward.of, hs.to_c, lambda fit: hs.Actuator.of(fit)):
        with pytest.warns(hs.HysimWarning, match="UNSAFE on smaller cycles"):
            drive(only_unsafe)


def test_a_law_of_which_all_coordinates_are_held_is_judged_too(record, unrestricted):
    fixed = {name: unrestricted.estimates[name] for name in ("A", "beta", "gamma", "n", "z0")}
    assert "UNSAFE" in str(hs.identify(hs.BoucWen, record, fixed=fixed)).splitlines()[0]
