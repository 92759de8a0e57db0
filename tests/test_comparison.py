"""`compare` judges every model by the same measures and the same splits, and says what the record cannot decide."""

import csv
import dataclasses
import io
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal, stats
from strategies import assert_refused, refused

import hysim as hs
from hysim.cli import main
from hysim.comparison._verdict import contrasts, holm, probability
from hysim.errors import Interrupted
from hysim.models import model as registry
from hysim.models.model import FAMILIES


@pytest.fixture(scope="module")
def comparison(table1) -> hs.Comparison:
    law = hs.PolynomialBoucWen(beta=0.004, gamma=0.06, gain=-0.0076, z0=-8.8, input_coefficients=(0.028, -4e-5))
    fit = hs.identify(law, table1, fixed={"n": 1.0}, cross_validate="loo")
    subjects = {
        "given": law,
        "fitted": fit,
        "class": hs.Line,
        "structure": hs.TransferFunction.structure(poles=1, zeros=0),
    }
    return hs.compare(subjects, table1)


def test_rows_stand_in_the_order_given(comparison):
    assert [row.name for row in comparison.rows] == ["given", "fitted", "class", "structure"]
    assert comparison["class"].model == hs.identify(hs.Line, comparison.record).model
    assert_refused("there are given, fitted", comparison.__getitem__, "other", error=KeyError)


def test_every_measure_is_that_of_the_metrics(comparison, table1):
    for row in comparison.rows:
        loop = hs.loop_metrics(table1.u, row.y)
        assert row.fit_percent == hs.metrics.fit_percent(table1.y, row.y)
        assert row.rmse == hs.metrics.rmse(table1.y, row.y)
        assert row.max_residual == np.abs(table1.y - row.y).max()
        assert (row.max_width, row.max_width_at, row.area) == (loop.max_width, loop.max_width_at, loop.area)
        assert row.width_rmse == hs.metrics.width_rmse(comparison.loop, loop)


def test_what_was_not_fitted_has_no_parameters_and_nothing_to_cross_validate(comparison):
    given = comparison["given"]
    assert given.n_parameters == 0
    assert given.cv_rmse == given.rmse
    assert math.isnan(given.fpe)
    fitted = comparison["fitted"]
    assert fitted.n_parameters == 7
    assert fitted.rmse < fitted.cv_rmse < 1.5 * fitted.rmse


def test_a_fit_is_the_model_it_reports(comparison):
    """The free run of the model is the residual of the identification."""
    fit = hs.identify(hs.TransferFunction.structure(poles=1, zeros=0), comparison.record)
    assert comparison["structure"].y == pytest.approx(comparison.record.y - fit.residual, abs=1e-9)  # rounding


def test_a_discovery_can_be_compared(table1, discovered_table1):
    found = discovered_table1
    row = hs.compare({"sindy": found}, table1)["sindy"]
    assert row.model == found.model
    assert row.n_parameters == found.n_parameters == len(found.coefficients)  # y0 is held at rest
    assert row.fit_percent == pytest.approx(found.scores["fit_percent"], abs=1e-9)


def test_tables_hold_every_row(comparison):
    rows = list(csv.DictReader(io.StringIO(comparison.to_csv())))
    assert [row["model"] for row in rows] == ["given", "fitted", "class", "structure"]
    assert float(rows[1]["fit [%]"]) == comparison["fitted"].fit_percent
    assert rows[1]["max residual [quanta]"]
    text, markdown = comparison.to_text().splitlines(), comparison.to_markdown().splitlines()
    assert len(text) > len(markdown) == 6
    assert len({len(line) for line in text[:6]}) == 1
    assert " ".join(line.strip() for line in text[6:]) == comparison.verdict
    assert all(line.count("|") == markdown[0].count("|") for line in markdown)
    latex = comparison.to_latex().splitlines()
    cells = latex[0].count("r") - 1  # of "tabular"
    assert [line.count(" & ") for line in latex if line.endswith(r"\\")] == [cells] * 5
    assert r"fit [\%]" in latex[2]


def test_the_order_of_records_chooses_no_other_winner():
    """A block that holds the beginning of a record would be predicted from a state that nothing tells."""
    k, law, rng = np.arange(240), hs.BoucWen(beta=1.2, gamma=0.4, gain=1.5, feedthrough=0.1), np.random.default_rng(0)
    u = np.sin(2.0 * np.pi * k / 60.0) * (0.5 + 0.5 * k / 240.0)
    records = [hs.Record(u=x, y=law.response(x) + 0.03 * rng.standard_normal(x.size)) for x in (u, 0.7 * u[:180])]
    models = {"bouc-wen": hs.BoucWen, "dahl": hs.Dahl, "plays": hs.PrandtlIshlinskii}
    assert {hs.compare(models, each).winner for each in (records, records[::-1])} == {"bouc-wen"}


def test_long_records_are_cross_validated_by_blocks():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=80)
    record = hs.Record(u=u, y=hs.BoucWen(beta=2.0, gamma=0.5).response(u))
    row = hs.compare({"line": hs.Line}, record)["line"]
    assert row.cv_rmse == hs.identify(hs.Line, record, cross_validate=10).cv_rmse


def test_without_a_resolution_there_are_no_quanta(table1):
    bare = hs.Record(u=table1.u, y=table1.y)
    header = hs.compare({"line": hs.Line}, bare).to_csv().splitlines()[0]
    assert "quanta" not in header
    assert "[" not in header.replace("[%]", "")


test_wrong_arguments_are_named = refused(
    ({}, hs.datasets.table1(), "nothing to compare"),
    ({"line": hs.Line}, hs.datasets.table1()[:26], "cycle"),
    ({"line": hs.Line}, [1.0, 2.0], TypeError, "takes a Record"),
    ({"word": "bouc-wn"}, hs.datasets.table1(), "no family 'bouc-wn'"),
    ({"number": 3}, hs.datasets.table1(), TypeError, "takes a model"),
    ({"class": hs.Sensor}, hs.datasets.table1(), TypeError, "takes a model"),
    (3, hs.datasets.table1(), TypeError, "takes a mapping"),
    call=hs.compare,
)


QUICK = ("Line", "SingleValued", "Play", "Dahl")


@pytest.fixture(scope="module")
def quick(table1) -> hs.Comparison:
    return hs.compare({name: getattr(hs, name) for name in QUICK} | {"untold": hs.Sum}, table1)


@pytest.fixture
def few(monkeypatch):
    """A registry of the families that are quick to identify."""
    monkeypatch.setattr(registry, "every_family", lambda: {name: FAMILIES[name] for name in QUICK[:3]})


def test_every_family_of_the_registry_is_a_candidate_in_the_public_order():
    found = registry.candidates()
    assert {"BoucWen", "PrandtlIshlinskii", "TransferFunction", "Line"} <= found.keys()
    assert "Sensor" not in found
    assert [name for name in hs.__all__ if name in found] == [name for name in found if name in hs.__all__]
    assert all(registry.is_identifiable(subject) for subject in found.values())
    public = [name for name in hs.__all__ if name in FAMILIES]
    alone = [name for name in public if registry.is_identifiable(FAMILIES[name])]
    named = {name for name in alone if FAMILIES[name].__module__.startswith("hysim.laws.components")}
    assert len(named) == 9
    assert not named & found.keys()
    assert all(registry.candidates_named(name) for name in named)
    assert set(alone) - named <= {name for name in public if name in found or hasattr(FAMILIES[name], "candidates")}


def test_a_family_says_itself_what_is_tried(monkeypatch, few):
    class Declared:
        candidates = staticmethod(lambda: {"gentle": hs.Line(slope=0.1), "steep": hs.Line(slope=9.0)})

    families = {"BoucWen": Declared} | {name: FAMILIES[name] for name in QUICK}
    monkeypatch.setattr(registry, "every_family", lambda: families)
    assert list(registry.candidates()) == ["gentle", "steep", "Play", "Dahl", "Line", "SingleValued"]


@pytest.mark.parametrize("models", [None, "all"])
def test_without_models_all_families_are_compared(table1, quick, few, models):
    table = hs.compare(models, table1)
    assert {row.name for row in table.rows} == set(QUICK[:3])
    assert all(table[name] == quick[name] for name in QUICK[:3])


def test_the_number_of_threads_does_not_change_a_bit(table1, quick):
    done = []
    again = hs.compare(
        {name: getattr(hs, name) for name in QUICK} | {"untold": hs.Sum},
        table1,
        workers=1,
        progress=lambda *at: done.append(at),
    )
    assert again == quick
    assert again.to_csv() == quick.to_csv()
    assert done == [(k, 5) for k in range(1, 6)]
    assert_refused("workers", hs.compare, {"line": hs.Line}, table1, workers=0)


def test_an_interrupt_keeps_the_models_that_were_compared(table1):
    def interrupt(done, total):
        if done == 2:
            raise KeyboardInterrupt

    models = {"line": hs.Line, "curve": hs.SingleValued, "play": hs.Play}
    with pytest.raises(Interrupted, match="models were compared") as caught:
        hs.compare(models, table1, workers=1, progress=interrupt)
    finished = caught.value.finished
    assert [row.name for row in finished.rows][:2] == ["line", "curve"]
    assert finished["line"] == hs.compare({"line": hs.Line}, table1)["line"]
    with pytest.raises(KeyboardInterrupt) as caught:
        hs.compare({"line": hs.Line}, table1, announce=lambda name: interrupt(2, 2))
    assert not isinstance(caught.value, Interrupted)


def test_the_command_line_prints_the_models_that_were_compared(monkeypatch, capsys, tmp_path, table1):
    def interrupted(*_, **__):
        raise Interrupted("1 of 2", hs.Comparison(record=table1, loop=hs.loop_metrics(table1.u, table1.y), rows=()))

    hs.save_record(table1, tmp_path / "loop.csv")
    monkeypatch.setattr("hysim.compare", interrupted)
    assert main(["compare", str(tmp_path / "loop.csv")]) == 130
    printed = capsys.readouterr()
    assert printed.out.startswith("model")
    assert printed.err == "hysim: interrupted\n"


def test_what_cannot_be_identified_is_a_row_with_its_reason(quick):
    assert quick.failed == {"untold": "Sum has no defaults for parts: pass an instance as the start, or use discover"}
    assert "not compared: untold: Sum has no defaults" in quick.to_text()
    assert "| untold | Sum has no defaults" in quick.to_markdown()
    assert r"untold & \multicolumn" in quick.to_latex()
    last = list(csv.DictReader(io.StringIO(quick.to_csv())))[-1]
    assert (last["model"], last["fit [%]"], last["converged"]) == ("untold", "", "no")
    assert_refused("could not be compared: Sum", quick.__getitem__, "untold", error=KeyError)


def test_a_model_that_escapes_is_a_row_with_its_reason(table1):
    escaping = hs.BoucWen(beta=-1.0, gamma=-1.0, n=2.0)
    table = hs.compare({"line": hs.Line(), "escaping": escaping}, table1)
    assert list(table.failed) == ["escaping"]
    assert [row.name for row in table.rows] == ["line"]


def test_no_result_holds_a_time(quick):
    assert "seconds" not in {field.name for field in dataclasses.fields(quick["Line"])}
    for form in ("text", "csv", "markdown", "latex"):
        assert "time [s]" not in getattr(quick, f"to_{form}")()


def test_width_and_area_errors_are_percent_of_the_records_and_negative_for_the_other_sense():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=80)
    play, stop = hs.Play(threshold=0.25), hs.Stop(threshold=0.25)
    record = hs.Record(u=u, y=play.response(u))
    double = hs.Play(threshold=0.25, gain=2.0)
    table = hs.compare({"same": play, "double": double, "reversed": stop}, record)
    errors = [(row.width_error_percent, row.area_error_percent) for row in table.rows]
    # The stop is u minus the play: the same width the other way round.
    assert errors == [pytest.approx(pair, abs=1e-9) for pair in ((0, 0), (100, 100), (-200, -200))]


def test_rates_are_tried_and_not_taken_on_trust(table1):
    lag = hs.TransferFunction(num=(0.02,), den=(5.0, 1.0))
    table = hs.compare({"law": hs.BoucWen(gain=0.02), "lag": lag, "line": hs.Line(slope=0.02)}, table1)
    assert [row.is_rate_independent for row in table.rows] == [True, False, True]
    assert table["lag"].rate_deviation > 0.01
    assert table["law"].rate_deviation < 1e-12
    uneven = dataclasses.replace(table1, t=np.arange(52.0) ** 2)
    assert hs.compare({"law": hs.BoucWen(gain=0.02)}, uneven)["law"].is_rate_independent


def test_the_winner_predicts_best_and_the_undecided_are_near(quick, table1):
    ranked = quick.ranked()
    assert [row.cv_rmse for row in ranked] == sorted(row.cv_rmse for row in quick.rows)
    assert quick.winner == ranked[0].name == "Play"
    best = quick["Play"].cv_residual
    assert math.sqrt(np.mean(best**2)) == quick["Play"].cv_rmse
    tie = 1e-9 * np.ptp(table1.y)
    alone = {row.name: probability(row.cv_residual, best, tie=tie) for row in ranked[1:]}
    assert quick.probabilities == holm(alone)
    assert quick.undecided == tuple(name for name, value in quick.probabilities.items() if value >= 0.05)
    assert f"Play predicts samples left out best, cross-validated rmse {quick['Play'].cv_rmse:.4g} um" in quick.verdict
    assert "The BIC prefers Play." in quick.verdict
    assert all(name in quick.verdict for name in quick.undecided)


def test_a_twin_of_the_winner_is_undecided_and_a_poor_model_is_not(table1):
    table = hs.compare({"one": hs.Play, "two": hs.Play, "poor": hs.Line(slope=1.0)}, table1)
    assert table.undecided == ("two",)
    assert "52 samples show no significant difference to two (" in table.verdict
    told = hs.compare({"one": hs.Play, "poor": hs.Line(slope=1.0)}, table1)
    assert "all others are significantly worse, the nearest poor, rmse" in told.verdict


def test_what_was_not_cross_validated_has_no_verdict_on_it(table1):
    table = hs.compare({"a": hs.Line, "b": hs.SingleValued}, table1, cross_validate=None)
    assert table.winner is None
    assert table.probabilities == {}
    assert table.verdict == "The BIC prefers b."
    given = hs.compare({"a": hs.Line, "given": hs.Line(slope=0.02)}, table1, cross_validate=None)
    assert (given.winner, given.verdict) == (None, "")  # the one model that has an error would win by default
    assert_refused("criterion must be", table.ranked, "r2")


@pytest.mark.parametrize("n", [60, 400])
def test_the_paired_probability_is_that_of_the_formula(n):
    a, b = np.cumsum(np.random.default_rng(3).standard_normal((2, n + 3)), axis=1)
    a, b = a[3:] - a[:-3], b[3:] - b[:-3]  # correlated with their neighbours
    d = [abs(x) - abs(y) for x, y in zip(a, b, strict=True)]
    typical = np.median(np.abs(a) + np.abs(b)) / 2
    d = [0.0 if abs(x) <= 1e-3 * typical else x for x in d]
    s = [np.sign(x) * sum(abs(x) >= abs(other) for other in d) for x in d]
    m = sum(s) / n
    g0, g1 = (sum((s[t] - m) * (s[t + k] - m) for t in range(n - k)) / n for k in (0, 1))
    r = g1 / g0 + (1 + 4 * g1 / g0) / n
    assert 0.2 < r < 0.9
    free = n * (1 - r) / (1 + r) - 1
    by_neighbours = 2 * stats.t.sf(abs(m) * math.sqrt(free / g0), free)
    J = max(int(n ** (2 / 3) / 4), 3)
    waves = [
        math.sqrt(2 / n) * sum((s[k] - m) * math.cos(math.pi * j * (k + 0.5) / n) for k in range(n))
        for j in range(1, J + 1)
    ]
    by_cosines = 2 * stats.t.sf(abs(m) * math.sqrt(n / np.mean(np.square(waves))), J)
    expected = max(by_neighbours, by_cosines)
    assert probability(a, b) == pytest.approx(expected, rel=1e-10)  # rounding
    assert probability(a, a) == 1.0
    assert probability(a, a * (1.0 + 1e-4)) == 1.0  # two descents to one optimum
    assert probability(a, b) == probability(b, a)
    a[: n - 3] = np.nan
    assert math.isnan(probability(a, b))


def correlated(rng, n, correlation, draw):
    """Records (800, n) of first-order autoregressive noise."""
    return signal.lfilter([1.0], [1.0, -correlation], draw((800, n + 200)), axis=1)[:, 200:]


@pytest.mark.parametrize("n", [52, 400])
@pytest.mark.parametrize("shared", [0.0, 1.0])
@pytest.mark.parametrize(("correlation", "heavy"), [(0.0, False), (0.9, False), (0.9, True)])
def test_equal_models_are_called_unequal_no_more_often_than_in_8_percent(n, shared, correlation, heavy):
    """White noise that both errors share hides how long their difference stays."""
    rng = np.random.default_rng(0)
    draw = (lambda shape: rng.standard_t(2, shape)) if heavy else rng.standard_normal
    a, b = (correlated(rng, n, correlation, draw) for _ in range(2))
    noise = shared * rng.standard_normal(a.shape)
    share = np.mean([probability(*pair) < 0.05 for pair in zip(a + noise, b + noise, strict=True)])
    assert 0.005 <= share <= 0.08  # of 800 pairs, whose share scatters by 0.009


def test_a_model_that_is_worse_by_a_third_is_seen_in_four_hundred_samples():
    rng = np.random.default_rng(1)
    a, b = 1.3 * rng.standard_normal((100, 400)), rng.standard_normal((100, 400))
    assert np.mean([probability(*pair) < 0.05 for pair in zip(a, b, strict=True)]) > 0.9


def test_a_test_in_other_units_is_refused_and_one_in_the_same_is_printed(table1):
    other = hs.Record(u=table1.u, y=1e3 * table1.y, units={"u": "V", "y": "nm"})
    assert_refused("same units, got y in nm and um", hs.compare, {"line": hs.Line}, table1, test=other)
    times = [hs.Record(u=table1.u, y=table1.y, t=np.arange(52.0), units={"t": unit}) for unit in ("s", "ms")]
    assert_refused("identify takes records in the same units, got t in ms and s", hs.identify, hs.Line, times)
    assert "test rmse" in str(hs.compare({"line": hs.Line, "play": hs.Play}, table1, test=table1, cross_validate=None))


def test_a_record_that_is_given_twice_counts_once(table1):
    once = hs.compare({"line": hs.Line, "play": hs.Play}, table1, cross_validate=5)
    copy = hs.Record(u=table1.u, y=table1.y)
    twice = hs.compare({"line": hs.Line, "play": hs.Play}, [copy, table1], cross_validate=5)
    assert twice.probabilities == once.probabilities
    assert twice["line"].cv_rmse == once["line"].cv_rmse
    fit = hs.identify(hs.Play, [table1, copy])
    assert_refused("give each record once", hs.compare, {"line": hs.Line, "play": fit}, [table1, copy])


def test_a_verdict_on_hundreds_of_models_names_the_first_ones(quick):
    row = quick["Play"]
    table = dataclasses.replace(quick, rows=tuple(dataclasses.replace(row, name=f"m{k}") for k in range(300)))
    assert len(table.undecided) == 299
    assert "difference to m1, m2, m3, m4, m5 and 294 others (" in table.verdict
    assert len(table.verdict) < 300
    assert_refused("there are m0, m1, m2, m3, m4, m5, 294 others", table.__getitem__, "two", error=KeyError)


def test_one_outlier_does_not_hide_that_a_model_is_worse():
    """Squared errors made of one huge error have a variance that swallows their mean."""
    rng = np.random.default_rng(2)
    best, other = 0.01 * rng.standard_normal(400), 0.1 * rng.standard_normal(400)
    for value in (0.1, 1e4, np.inf):
        other[200] = value
        assert probability(other, best) < 1e-8


def side_by_side(other, best, span=1.0, fitted=("other",)):
    rmses = [float(np.sqrt(np.mean(errors**2))) for errors in (other, best)]
    (found,) = contrasts({"other": other}, best, {"other": rmses[0]}, rmses[1], span=span, fitted=fitted)
    return found


def test_a_model_that_diverged_where_it_was_left_out_is_worse():
    best, other = np.random.default_rng(4).standard_normal((2, 400)) * 0.1
    assert not side_by_side(other, best).is_worse
    for value in (80.0, np.inf):
        other[7] = value
        assert side_by_side(other, best).diverged
        assert side_by_side(other, best).is_worse
    assert not side_by_side(other, best, fitted=()).diverged  # it was not fitted: it is far off, and that is all


def test_smaller_typical_errors_with_a_larger_rmse_are_said():
    rng = np.random.default_rng(5)
    best, other = rng.standard_normal(400), 0.5 * rng.standard_normal(400)
    other[:4] = 30.0
    found = side_by_side(other, best, span=10.0)
    assert found.rmse_ratio > 1.0 > found.typical_ratio
    assert found.contradicts
    assert not found.is_worse


def test_the_verdict_says_what_diverged_and_where_ranks_and_rmse_disagree(quick, table1):
    rng = np.random.default_rng(6)
    errors = {
        "Play": 0.2 * rng.standard_normal(52),
        "Dahl": np.r_[2.0, -2.0, 0.01 * rng.standard_normal(50)],
        "Line": np.r_[np.inf, 0.2 * rng.standard_normal(51)],
        "SingleValued": np.full(52, 5.0),
    }
    rows = tuple(
        dataclasses.replace(row, cv_residual=errors[row.name], cv_rmse=float(np.sqrt(np.mean(errors[row.name] ** 2))))
        for row in quick.rows
    )
    table = dataclasses.replace(quick, rows=rows)
    assert "Line diverged on samples left out." in table.verdict
    assert "Dahl has significantly smaller typical errors than Play but a larger rmse" in table.verdict
    assert "all others but Dahl are significantly worse" in table.verdict
    assert table.undecided == ("Dahl",)
    frame = {row["model"]: row for row in csv.DictReader(io.StringIO(table.to_csv()))}
    assert (frame["Line"]["diverged"], frame["Dahl"]["diverged"]) == ("yes", "no")
    assert float(frame["Dahl"]["typical error / best"]) < 1.0 < float(frame["Dahl"]["cv rmse / best"])
    assert (frame["Play"]["cv rmse / best"], frame["Play"]["p"]) == ("1.0", "")


def test_several_models_are_held_against_the_best_by_holms_correction():
    found = holm({"a": 0.01, "b": 0.04, "c": 0.03, "d": math.nan})
    assert [found[name] for name in "abc"] == pytest.approx([0.03, 0.06, 0.06])
    assert math.isnan(found["d"])
    assert holm({"a": 0.9, "b": 0.8}) == {"a": 1.0, "b": 1.0}


def test_the_last_cycles_are_kept_from_every_fit():
    u = hs.signals.triangle(0.0, 1.0, cycles=4, samples_per_cycle=40)
    law = hs.Play(threshold=0.1, gain=2.0)
    y = law.response(u) + np.where(np.arange(u.size) > 120, 0.3, 0.0)
    table = hs.compare({"play": hs.Play, "line": hs.Line}, hs.Record(u=u, y=y), test=1, cross_validate=4)
    assert (len(table.record), len(table.test)) == (121, 40)
    assert table["play"].rmse == pytest.approx(0.0, abs=1e-9)
    assert table["play"].test_rmse == pytest.approx(0.3, abs=1e-9)
    assert "test rmse" in table.to_text()
    assert float(next(csv.DictReader(io.StringIO(table.to_csv())))["test rmse"]) == table["play"].test_rmse
    assert_refused("asked for 9", hs.compare, {"line": hs.Line}, hs.Record(u=u, y=y), test=9)
    assert_refused("test takes", hs.compare, {"line": hs.Line}, hs.Record(u=u, y=y), error=TypeError, test="last")


def test_a_growing_protocol_is_compared_and_its_last_cycle_kept():
    turns = [0.0, 1.0, -1.0, 2.0, -2.0, 0.0]
    u = np.interp(np.linspace(0.0, 5.0, 201), np.arange(6.0), turns)
    rec = hs.Record(u=u, y=hs.Play(threshold=0.25).response(u))
    table = hs.compare({"line": hs.Line}, rec, test=1)
    begin = int(hs.cycle_metrics(rec.u, rec.y).stop[0])  # the last one begins where the one before ends
    assert len(table.record) == begin
    assert table.loop == hs.loop_metrics(rec.u[:begin], rec.y[:begin])
    assert table["line"].test_rmse > 0.0


def test_another_record_begins_with_a_state_of_its_own():
    """The state at the first sample is the record's and not the model's; all else is from the training."""
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=40)
    start = {"threshold": 0.1, "gain": 2.0}
    train = hs.Record(u=u, y=hs.Play(**start, z0=0.05).response(u))
    other = hs.Record(u=0.5 * u, y=hs.Play(**start, z0=-0.08).response(0.5 * u))
    subjects = {"identified": hs.Play, "given": hs.Play(**start, z0=0.05), "line": hs.Line}
    table = hs.compare(subjects, train, test=other)
    assert table["identified"].test_rmse == pytest.approx(0.0, abs=1e-9)
    assert table["given"].test_rmse > 0.01
    line = table["line"].model
    assert table["line"].test_rmse == hs.metrics.rmse(other.y, line.response(other.u))
    assert table.test == other


def test_a_frame_holds_the_columns_of_the_csv(quick, monkeypatch):
    class Frame(dict):
        def __init__(self, columns, index):
            super().__init__(columns)
            assert index is None

    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=Frame))
    frame = quick.to_frame()
    assert list(frame) == next(csv.reader(io.StringIO(quick.to_csv())))
    assert frame["model"] == [*(row.name for row in quick.rows), "untold"]
    assert frame["fit [%]"] == [*(row.fit_percent for row in quick.rows), None]


def test_a_missing_pandas_is_named_with_the_extra_that_brings_it(quick, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert_refused(r"needs pandas: pip install 'hysim\[tables\]'", quick.to_frame, error=ImportError)


def test_the_picture_has_a_row_for_each_of_the_best_models(quick):

    grid = hs.plot.comparison(quick)
    assert grid.shape == (4, 3)
    names = [ax.get_title(loc="left").split(":")[0] for ax in grid[:, 0]]
    assert names == [row.name for row in quick.ranked()]
    chosen = hs.plot.comparison(quick, ["Line"])
    np.testing.assert_array_equal(chosen[0, 0].lines[1].get_ydata(), quick["Line"].y)
    np.testing.assert_array_equal(chosen[0, 2].lines[1].get_ydata(), quick["Line"].loop.width)
    assert_refused("no model to draw", hs.plot.comparison, quick, [])


def test_a_model_that_could_not_be_compared_is_named_in_print():
    u = hs.signals.triangle(-3.0, 3.0, cycles=2, samples_per_cycle=40)
    diverging = hs.BoucWen(A=1.0, beta=-1.0, gamma=-1.0, n=2.0)
    tab = hs.compare({"bad": diverging, "line": hs.Line}, hs.Record(u=u, y=u), cross_validate=None)
    assert set(tab.failed) == {"bad"}
    assert "Not compared: bad." in str(tab)
