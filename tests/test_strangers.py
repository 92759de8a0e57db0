"""The first hour of four strangers, in an empty folder each, by the scripts in tests/strangers.

The commands of a script run in this process, which has loaded what they need; other lines run in a shell. Outside of
the tests, `bash -e piezo.sh` does the same.
"""

import csv
import runpy
import shlex
import shutil
import subprocess
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

import hysim as hs
from hysim.cli import main

SCRIPTS = Path(__file__).with_name("strangers")


@pytest.fixture
def walk(tmp_path, monkeypatch):
    """Run a script in an empty folder, and return the names of the files that it leaves there."""
    monkeypatch.chdir(tmp_path)

    def run(name):
        lines = (SCRIPTS / f"{name}.sh").read_text().splitlines()
        for is_command, part in groupby(lines, key=lambda line: line.startswith("hysim ")):
            if is_command:
                for line in part:
                    assert main(shlex.split(line)[1:]) == 0, line
            else:
                subprocess.run(["bash", "-e", "-c", "\n".join(part)], check=True, cwd=tmp_path)
        return {path.name for path in tmp_path.iterdir()}

    return run


def energies(path):
    with open(path) as file:
        return np.array([float(row["energy [kN mm]"]) for row in csv.DictReader(file)])


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_piezo_loop_becomes_a_compensator_in_c(walk, tmp_path, capfd):
    files = walk("piezo")
    assert {"loop.svg", "fit.svg", "controller.json", "compensator.h", "compensator"} <= files
    wanted = np.loadtxt(tmp_path / "wanted.txt")
    reached = hs.load(tmp_path / "reached.csv", u="u", y="y")
    assert 0.0 <= reached.u.min() < reached.u.max() <= 125.0
    np.testing.assert_allclose(reached.y, wanted, atol=1e-12)  # the program prints every digit
    assert "reduction" in capfd.readouterr().out


def test_a_damper_test_becomes_a_model_with_the_energies_of_its_cycles(walk, tmp_path):
    assert {"fit.svg", "residuals.svg"} <= walk("damper")
    measured, modelled = energies(tmp_path / "measured.csv"), energies(tmp_path / "modelled.csv")
    assert measured.size == 6
    np.testing.assert_allclose(modelled, measured, rtol=5e-3)  # the noise of the load cell


def test_a_thesis_gets_its_minor_loops_and_relays(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(SCRIPTS / "figure.py"))
    text = (tmp_path / "figure.svg").read_text()
    assert all(words in text for words in ("Lower threshold b [kA/m]", "Amplitude [kA/m]", "minor loops"))
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")
    law = hs.Preisach.from_reversal_curves(hs.load(tmp_path / "curves.csv"))
    assert len(law.weights) > 20


def test_a_thousand_simulations_are_drawn(walk, tmp_path):
    assert {"rows.sqlite", "rows.svg"} <= walk("study")
    with open(tmp_path / "rows.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1000
    best = min(rows, key=lambda row: float(row["rmse"]))
    assert float(best["rmse"]) < 0.5 < max(float(row["rmse"]) for row in rows)  # kN
    assert float(best["beta"]) == pytest.approx(0.35, abs=0.05)
