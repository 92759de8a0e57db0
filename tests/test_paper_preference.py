"""The stored evidences are those of the experiment, and those that the report quotes."""

import csv
import html
import json
from pathlib import Path

import pytest

from hysim.paper import preference as paper
from hysim.posterior import FACTORS

RESULT = Path(__file__).parent.parent / "experiments" / "results" / "evidence" / "result.json"


@pytest.fixture
def change(monkeypatch):
    """Puts other values, by the names of columns, into the first of the stored lines, and returns its model's name."""
    stored = (paper.stored_evidence, paper.by_nested_sampling)
    first, *others = paper._lines()

    def changed(**values):
        line = first | {name: str(value) for name, value in values.items()}
        monkeypatch.setattr(paper, "_lines", lambda: (line, *others))
        for each in stored:
            each.cache_clear()
        return line["model"]

    yield changed
    for each in stored:
        each.cache_clear()


def test_the_stored_evidences_are_those_of_the_experiment():
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    found = paper.stored_evidence()
    rows = {(row["model"], row["factor"], row["method"]): row for row in result["rows"]}
    assert len(found.rows) >= 8
    for row in found.rows:
        own = [rows[row.name, factor, "bridge"] for factor in FACTORS]
        assert row.log_evidence == tuple(each["log_evidence"] for each in own)
        assert row.error == tuple(each["error"] for each in own)
        assert max(row.error) < 0.3
        assert row.n_evaluations == sum(each["evaluations"] for each in own)
    assert found.sentence == result["sentence"]


def test_both_methods_agree_within_their_errors():
    found = paper.stored_evidence()
    nested = paper.by_nested_sampling()
    assert len(nested) >= 3
    for name, (value, error) in nested.items():
        row = found[name]
        place = found.factors.index(1.0)
        assert abs(value - row.log_evidence[place]) < 4.0 * (error**2 + row.error[place] ** 2) ** 0.5


def test_the_report_quotes_the_stored_evidences(reproduction):
    page = html.unescape((reproduction.folder / "report.html").read_text(encoding="utf-8"))
    assert page.count(paper.preference()) == 2  # in the lead, and in its chapter
    assert paper.beside_nested() in page
    for row in paper.stored_evidence().rows:
        for value, error in zip(row.log_evidence, row.error, strict=True):
            assert f"<td>{value:.2f} ± {error:.2f}</td>" in page


def test_the_summary_and_a_table_have_them(reproduction):
    found = paper.stored_evidence()
    summary = json.loads((reproduction.folder / "summary.json").read_text(encoding="utf-8"))["evidence"]
    assert summary["sentence"] == paper.preference()
    assert list(summary["models"]) == list(found.names)
    for name, measures in summary["models"].items():
        assert measures["log_evidence"] == pytest.approx(found[name].log_evidence, rel=1e-8)  # nine digits are written
        assert measures["probability"][1] == pytest.approx(found.probabilities()[name], rel=1e-8)
    with (reproduction.folder / "tables" / "evidence.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [row["model"] for row in table] == list(found.names)
    assert [float(row["ln_evidence_x2"]) for row in table] == pytest.approx(
        [row.log_evidence[2] for row in found.rows], rel=1e-8
    )


def test_the_sentence_follows_the_stored_figures(change):
    surely = dict.fromkeys((f"ln_evidence_x{factor:g}" for factor in FACTORS), 0.0)
    name = change(**surely)
    assert f'the data prefer "{name}"' in paper.preference() or f"the data prefer {name}," in paper.preference()
    change(**surely | {"ln_evidence_x2": -200.0})
    assert "the data do not decide between" in paper.preference()
    assert "it depends on the boxes" in paper.preference()


def test_a_model_that_cross_validation_refuses_contradicts_the_evidence(change):
    change(model="line")
    assert "which contradicts the evidence" in paper.beside_nested()
    change(model="a model of which nobody has heard")
    assert "was not run" in paper.beside_nested()
