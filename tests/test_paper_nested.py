"""The stored errors of repeated searches are those of the experiment, and those that the report quotes."""

import json
from pathlib import Path

import pytest

from hysim.paper.preference import nested_errors, of_discovered

RESULT = Path(__file__).parent.parent / "experiments" / "results" / "nested_table1" / "result.json"


def test_the_stored_errors_are_those_of_the_experiment():
    rows = json.loads(RESULT.read_text(encoding="utf-8"))["rows"]
    stored = nested_errors()
    assert [(each.model, each.start) for each in stored] == [(row["model"], row["start"]) for row in rows]
    for each, row in zip(stored, rows, strict=True):
        assert (each.left_out_rmse, each.behind) == (row["left_out_rmse_um"], row["behind_in_stderr"])
        assert all(
            each._asdict()[name] == row[name] for name in ("n_parameters", "folds", "same_structure", "terms_kept")
        )


def test_rows_stand_in_the_order_of_their_errors_and_the_best_that_was_searched_again_is_behind_none():
    stored = nested_errors()
    assert [each.left_out_rmse for each in stored] == sorted(each.left_out_rmse for each in stored)
    assert next(each for each in stored if not each.terms_kept).behind == 0.0
    assert all(each.behind >= 0.0 for each in stored if not each.terms_kept)
    assert all(each.folds == 50 for each in stored)


def test_the_report_quotes_the_nested_error_of_the_law_that_it_shows(reproduction, paper_study):
    page = (reproduction.folder / "report.html").read_text(encoding="utf-8")
    nested = of_discovered()
    assert f"errs by {nested.left_out_rmse:.4f} µm at the point left out" in page
    assert f"has the terms above in {nested.same_structure} of 50 searches" in page
    assert "predicts best" not in page
    assert nested.n_parameters == paper_study.discovery.n_parameters
    assert nested.fit_percent == pytest.approx(paper_study.discovery.scores["fit_percent"], abs=1e-4)  # one law
    models = json.loads((reproduction.folder / "summary.json").read_text(encoding="utf-8"))["models"]
    assert models["sindy"]["cv_rmse_um"] == pytest.approx(nested.left_out_rmse, rel=1e-8)  # nine digits are written
