"""Every experiment runs in its smoke mode, and the committed results are those that the README quotes."""

import importlib.util
import json
from pathlib import Path

import pytest

EXPERIMENTS = sorted((Path(__file__).parent.parent / "experiments").glob("[0-9]*.py"))


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_smoke(path, monkeypatch, tmp_path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "RESULTS", tmp_path)
    rows = module.main(smoke=True)
    assert rows
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_results_are_committed_whole(path):
    folder = path.parent / "results" / path.stem.split("_", 1)[1]
    assert {file.name for file in folder.iterdir()} == {"table.csv", "figure.svg", "result.json"}
    json.loads((folder / "result.json").read_text())


def test_exact_step_is_exact():
    result = json.loads((EXPERIMENTS[0].parent / "results" / "exact_step" / "result.json").read_text())
    own = [row for row in result["rows"] if row["method"] == "hysim"]
    assert {row["n"] for row in own} == {1.0, 1.5, 2.0}
    assert all(row["error"] < 1e-14 for row in own)
