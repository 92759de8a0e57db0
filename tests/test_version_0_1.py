"""Files that version 0.1 wrote are read as they were meant; `tests/data/version_0_1/generate.py` wrote them."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import hysim as hs

FOLDER = Path(__file__).parent / "data" / "version_0_1"
STORED = json.loads((FOLDER / "models.json").read_text())
U = np.array(STORED["u"])


@pytest.mark.parametrize("stored", STORED["models"], ids=lambda stored: json.loads(stored["text"])["family"])
def test_a_stored_model_loads_and_responds_as_it_did(stored, tmp_path):
    path = tmp_path / "model.json"
    path.write_text(stored["text"])
    model = hs.load_model(path)
    hs.save(model, path, units={"u": "V", "y": "um"})
    assert json.loads(path.read_text())["parameters"] == json.loads(stored["text"])["parameters"]
    if stored["y"] is not None:
        y = hs.simulate(model, 1e-3 * np.arange(U.size), U).y
        assert y == pytest.approx(stored["y"], rel=0.0, abs=1e-10 * np.ptp(stored["y"]))  # an integrated law's promise


def test_a_stored_identification_comes_back():
    fit = hs.Identification.from_json((FOLDER / "identification.json").read_text())
    assert fit.model == hs.BoucWen(**fit.estimates)
    assert fit.estimates["beta"] == pytest.approx(0.7, rel=0.01)
    stored = json.loads((FOLDER / "identification.json").read_text())
    stored["identification"]["fields"] |= {"unsafe": "", "choice": None}  # for which 0.1 did not look
    assert json.loads(fit.to_json()) == stored | {"hysim": hs.__version__}


def test_a_stored_study_is_read(tmp_path):
    path = shutil.copy(FOLDER / "study.sqlite", tmp_path)
    study = hs.load_sweep(path)
    assert study["height"].ravel() == pytest.approx(np.outer([1.0, 2.0], np.exp([-0.0, -0.25, -1.0])).ravel())
