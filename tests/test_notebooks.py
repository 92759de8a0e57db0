"""Notebooks are run cell by cell, and show a table and a small figure of a result, with every name escaped."""

import base64
import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from strategies import loaded

import hysim as hs
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


# ---------------------------------------------------------------------------------- what a notebook shows of a result


NAME = '<b>"loop" & more</b>'
U = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
T = 0.1 * np.arange(U.size)
UNITS = {"t": "s", "u": "V", "y": "<m>"}
RECORD = hs.Record(t=T, u=U, y=U + 0.1 * np.sin(T), units=UNITS, name=NAME, resolution=0.01, channels={"T": 20.0})
LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
STRUCTURE = hs.Structure(mass=2.0, stiffness=8.0, elements=[hs.Element(hs.Line(slope=10.0), between=(0, 1))])

RESULTS = {
    "record": lambda: RECORD,
    "record without time": lambda: hs.Record(u=U, y=U),
    "simulation": lambda: hs.simulate(hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0)), T, U, units=UNITS),
    "loop": lambda: hs.close_loop(LAG, hs.PID(ki=2.0), T, U, units=UNITS),
    "fit": lambda: replace(hs.identify(hs.Line, RECORD, fixed={"offset": 0.0}), warnings=(NAME,)),
    "comparison": lambda: hs.compare({NAME: hs.Line, "curve": hs.SingleValued}, RECORD),
    "selection": lambda: hs.select({NAME: hs.Line, "curve": hs.SingleValued}, RECORD),
    "study": lambda: hs.sweep(lambda a: a, {"a": [1.0, 2.0]}, executor="threads"),
    "structure": lambda: STRUCTURE,
}
WITHOUT_FIGURE = ("selection", "study", "structure")


def parsed(page):
    """The page as a tree: it must be well formed, and hold no script and nothing from elsewhere."""
    assert "<script" not in page
    assert "http" not in re.sub(r'src="data:[^"]*"', "", page)
    return ElementTree.fromstring(re.sub(r"(<img [^>]*[^/])>", r"\1/>", page))


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_a_table_and_a_figure(name):
    result = RESULTS[name]()
    tree = parsed(result._repr_html_())
    assert NAME not in result._repr_html_()
    images = list(tree.iter("img"))
    assert len(images) == (0 if name in WITHOUT_FIGURE else 1)
    for image in images:
        kind, _, code = image.get("src").partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert base64.b64decode(code).startswith(b"<svg")
        assert image.get("alt")
        assert "background:#fff" in image.get("style")
    assert list(tree.iter("td"))
    assert result._repr_mimebundle_() == {"text/plain": str(result)}


def test_tables_hold_the_lines_of_the_printed_text():
    for name, result in ((name, make()) for name, make in RESULTS.items() if name != "comparison"):
        title, *lines = (line for line in str(result).splitlines() if line.strip("-"))
        tree = parsed(result._repr_html_())
        assert tree.find("div/strong").text == title
        rows = [[cell.text for cell in row] for row in tree.iter("tr")]
        assert [" ".join(row).split() for row in rows] == [line.split() for line in lines], name
    cells = [cell.text for cell in parsed(RECORD._repr_html_()).iter("td")]
    assert cells[:2] == ["t", "0 to 4 s, every 0.1 s"]
    assert cells[-2:] == ["T", "20"]


def test_large_records_stay_small_pages():
    t = np.linspace(0.0, 100.0, 100_000)
    assert len(hs.Record(u=np.sin(t), y=np.cos(t), t=t)._repr_html_()) < 400_000


def test_a_law_has_its_text_only_and_no_pyplot_is_left():
    assert hs.BoucWen()._repr_html_() is None
    before = "matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums()
    RECORD._repr_html_()
    assert before == ("matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums())
