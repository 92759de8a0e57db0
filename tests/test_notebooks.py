"""Notebooks are run cell by cell, and what is shown is what Jupyter would show."""

import json
from pathlib import Path

import pytest
from strategies import loaded

from hysim.cli import main
from hysim.cli.learn import example

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted((DOCS / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def notebook_cells():
    pytest.importorskip("docutils", reason="the extra docs has it")
    return loaded(DOCS / "notebook_cells.py")


CELLS = [
    ("markdown", "# A page"),
    ("code", "import hysim as hs\n\nlaw = hs.Line(slope=2.0)\nlaw"),
    ("markdown", "Words."),
    ("code", "print('printed')\nhs.plot.loop(hs.simulate(law, None, [0.0, 1.0, 0.0]));"),
    ("code", "hs.Record(u=[0.0, 1.0], y=[0.0, 2.0])"),
]


@pytest.mark.extra("docutils")
def test_cells_run_in_one_namespace_and_show_values_text_and_figures(notebook_cells, tmp_path):
    page = tmp_path / "page.ipynb"
    page.write_text(json.dumps({"cells": [{"cell_type": kind, "source": [text]} for kind, text in CELLS]}))
    assert notebook_cells.cells(page.read_text()) == CELLS
    value, drawn, record = notebook_cells.executed(page)
    assert (value.text, value.page, value.figures) == ("Line: offset = 0, slope = 2", "", ())
    assert (drawn.printed, drawn.text, len(drawn.figures)) == ("printed\n", "", 1)
    assert "<table>" in record.page
    stored = json.loads(notebook_cells.notebook(page))
    assert [cell["cell_type"] for cell in stored["cells"]] == [kind for kind, _ in CELLS]
    assert list(stored["cells"][3]["outputs"][1]["data"]) == ["image/svg+xml"]
    assert list(stored["cells"][4]["outputs"][0]["data"]) == ["text/plain", "text/html"]
    assert not list(tmp_path.glob("*.svg"))


@pytest.mark.extra("docutils")
def test_a_cell_that_fails_ends_the_build(notebook_cells):
    with pytest.raises(ZeroDivisionError):
        notebook_cells.run("1 / 0", {})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_notebook_is_listed_written_by_the_command_without_outputs_and_compiles(page, tmp_path, monkeypatch):
    assert f"notebooks/{page.stem}\n" in (DOCS / "index.md").read_text()
    monkeypatch.chdir(tmp_path)
    assert main(["example", page.name]) == 0
    assert Path(page.name).read_bytes() == page.read_bytes()
    assert page.stem in example.__doc__
    code = [cell for cell in json.loads(page.read_text())["cells"] if cell["cell_type"] == "code"]
    assert len(code) >= 3
    for cell in code:
        assert not cell["outputs"]
        compile("".join(cell["source"]), page.name, "exec")


def test_a_notebook_of_another_name_is_refused_with_the_names(capsys):
    assert main(["example", "mine.ipynb"]) == 2
    assert "the notebooks are compensate.ipynb, discover.ipynb, first_fit.ipynb, study.ipynb" in capsys.readouterr().err
