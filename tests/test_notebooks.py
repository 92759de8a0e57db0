"""Notebooks as text are run cell by cell, and what is shown is what a notebook would show."""

import importlib.util
import json
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted((DOCS / "notebooks").glob("*.md"))


@pytest.fixture(scope="module")
def notebook_cells():
    pytest.importorskip("docutils", reason="the extra docs has it")
    spec = importlib.util.spec_from_file_location("notebook_cells", DOCS / "notebook_cells.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TEXT = """---
file_format: mystnb
---

# A page

```{code-cell} ipython3
import hysim as hs

law = hs.Line(slope=2.0)
law
```

Words.

```{code-cell}
print("printed")
hs.plot.loop(hs.simulate(law, None, [0.0, 1.0, 0.0]));
```

```{code-cell}
hs.Record(u=[0.0, 1.0], y=[0.0, 2.0])
```
"""


@pytest.mark.extra("docutils")
def test_cells_run_in_one_namespace_and_show_values_text_and_figures(notebook_cells, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(TEXT)
    kinds = [kind for kind, _ in notebook_cells.cells(TEXT)]
    assert kinds == ["markdown", "code", "markdown", "code", "code"]
    value, drawn, record = notebook_cells.executed(page)
    assert (value.text, value.page, value.figures) == ("Line: offset = 0, slope = 2", "", ())
    assert (drawn.printed, drawn.text, len(drawn.figures)) == ("printed\n", "", 1)
    assert "<table>" in record.page
    stored = json.loads(notebook_cells.notebook(page))
    assert [cell["cell_type"] for cell in stored["cells"]] == kinds
    assert stored["cells"][0]["source"] == ["# A page"]
    assert list(stored["cells"][3]["outputs"][1]["data"]) == ["image/svg+xml"]
    assert list(stored["cells"][4]["outputs"][0]["data"]) == ["text/plain", "text/html"]
    assert not list(tmp_path.glob("*.svg"))


@pytest.mark.extra("docutils")
def test_a_cell_that_fails_ends_the_build(notebook_cells):
    with pytest.raises(ZeroDivisionError):
        notebook_cells.run("1 / 0", {})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_notebook_is_listed_can_be_downloaded_and_compiles(page):
    assert f"notebooks/{page.stem}\n" in (DOCS / "index.md").read_text()
    text = page.read_text()
    assert f'<a href="{page.stem}.ipynb" download>' in text
    assert text.count("```{code-cell}") >= 3
