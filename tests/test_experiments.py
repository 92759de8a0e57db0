"""Every experiment runs in its smoke mode, and its committed results are complete."""

import json
from pathlib import Path

import pytest
from browser import BROWSER
from strategies import loaded

EXPERIMENTS = sorted((Path(__file__).parent.parent / "experiments").glob("[0-9]*.py"))
NEEDS = dict.fromkeys(("29_registration", "30_virtual_rig"), pytest.mark.extra("skimage"))
NEEDS["48_posterior"] = pytest.mark.extra("emcee")
NEEDS["49_evidence"] = pytest.mark.extra("emcee", "dynesty")
NEEDS["53_page_redraw"] = (
    pytest.mark.extra("websockets"),
    pytest.mark.skipif(BROWSER is None, reason="no chromium is installed"),
)


@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.stem, marks=NEEDS.get(path.stem, ())) for path in EXPERIMENTS]
)
def test_smoke(path, monkeypatch, tmp_path):
    module = loaded(path)
    monkeypatch.setattr(module, "RESULTS", tmp_path)
    assert module.main(smoke=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_results_are_committed_whole(path):
    folder = path.parent / "results" / path.stem.split("_", 1)[1]
    assert {file.name for file in folder.iterdir()} == {"table.csv", "figure.svg", "result.json"}
    json.loads((folder / "result.json").read_text())
