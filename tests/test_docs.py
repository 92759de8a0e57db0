"""The Python blocks of the documentation run, page by page, without what builds the pages."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(DOCS.glob("*.md"))
NEEDS = {"camera": pytest.mark.extra("skimage")}

_spec = importlib.util.spec_from_file_location("page_runs", DOCS / "page_runs.py")
page_runs = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(page_runs)


@pytest.mark.parametrize("page", [pytest.param(page, id=page.stem, marks=NEEDS.get(page.stem, ())) for page in PAGES])
def test_python_blocks_of_a_page_run_in_order_and_print_and_draw_what_it_shows(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = page_runs.printed_by(page)
    assert blocks
    for printed, shown in blocks:
        if shown is not None:
            words, numbers = page_runs.words_and_numbers(printed)
            shown_words, shown_numbers = page_runs.words_and_numbers(shown)
            assert words == shown_words
            np.testing.assert_allclose(numbers, shown_numbers, rtol=1e-2, atol=1e-9)  # other machines round otherwise
    for name, figure in page_runs.figures_of(page).items():
        assert page_runs.labels(tmp_path / name) == page_runs.labels(figure)
