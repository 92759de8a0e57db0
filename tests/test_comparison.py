"""`compare` judges every model by the same measures, whatever it is given."""

import csv
import io
import math

import numpy as np
import pytest

import hysim as hs


@pytest.fixture(scope="module")
def table1() -> hs.Record:
    return hs.datasets.table1()


@pytest.fixture(scope="module")
def comparison(table1) -> hs.Comparison:
    law = hs.PolynomialBoucWen(beta=0.004, gamma=0.06, gain=-0.0076, z0=-8.8, input_coefficients=(0.028, -4e-5))
    fit = hs.identify(law, table1, fixed={"n": 1.0}, cross_validate="loo")
    subjects = {
        "given": law,
        "fitted": fit,
        "class": hs.Line,
        "structure": hs.TransferFunction.structure(poles=2, zeros=1),
    }
    return hs.compare(subjects, table1)


def test_rows_stand_in_the_order_given(comparison):
    assert [row.name for row in comparison.rows] == ["given", "fitted", "class", "structure"]
    assert comparison["class"].model == hs.identify(hs.Line, comparison.record).model
    with pytest.raises(KeyError, match="there are given, fitted"):
        comparison["other"]


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
    fit = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1), comparison.record)
    assert comparison["structure"].y == pytest.approx(comparison.record.y - fit.residual, abs=1e-9)  # rounding


def test_a_discovery_can_be_compared(table1, discovered_table1):
    found = discovered_table1
    row = hs.compare({"sindy": found}, table1)["sindy"]
    assert row.model == found.model
    assert row.n_parameters == len(found.coefficients) + 1
    assert row.fit_percent == pytest.approx(found.scores["fit_percent"], abs=1e-9)


def test_tables_hold_every_row(comparison):
    rows = list(csv.DictReader(io.StringIO(comparison.to_csv())))
    assert [row["model"] for row in rows] == ["given", "fitted", "class", "structure"]
    assert float(rows[1]["fit [%]"]) == comparison["fitted"].fit_percent
    assert rows[1]["max residual [quanta]"]
    text, markdown = comparison.to_text().splitlines(), comparison.to_markdown().splitlines()
    assert len(text) == len(markdown) == 6
    assert len({len(line) for line in text}) == 1
    assert all(line.count("|") == markdown[0].count("|") for line in markdown)


def test_long_records_are_cross_validated_by_blocks():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=80)
    record = hs.Record(u=u, y=hs.BoucWen(beta=2.0, gamma=0.5).response(u))
    row = hs.compare({"line": hs.Line}, record)["line"]
    assert row.cv_rmse == hs.identify(hs.Line, record, cross_validate=10).cv_rmse


def test_without_a_resolution_there_are_no_quanta(table1):
    bare = hs.Record(u=table1.u, y=table1.y)
    header = hs.compare({"line": hs.Line}, bare).to_csv().splitlines()[0]
    assert "quanta" not in header
    assert "[" not in header.replace("fit [%]", "")


@pytest.mark.parametrize(
    ("subjects", "record", "error", "message"),
    [
        ({}, "table", ValueError, "nothing to compare"),
        ({"line": hs.Line}, "branch", ValueError, "cycle"),
        ({"line": hs.Line}, None, TypeError, "takes a Record"),
        ({"word": "bouc-wen"}, "table", TypeError, "takes a model"),
    ],
)
def test_wrong_arguments_are_named(table1, subjects, record, error, message):
    chosen = {"table": table1, "branch": table1[:26], None: [1.0, 2.0]}[record]
    with pytest.raises(error, match=message):
        hs.compare(subjects, chosen)
