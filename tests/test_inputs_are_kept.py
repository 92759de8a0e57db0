"""No command writes its results over one of its inputs, by whatever path it is called."""

import io
import os
import shutil
import sys

import numpy as np
import pytest

import hysim as hs
from hysim.cli import COMMANDS, main

COLUMNS = ("--u", "voltage", "--y", "displacement")
STUDY = 'task = "width.py:width"\n[grid]\nbeta = [0.1, 0.2]\n'
RESPONSE = '[response]\nlaw="law.json"\nrecord="loop.csv"\nu="voltage"\ny="displacement"\n[grid]\nbeta=[0.1, 0.2]\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """One file of each kind that commands read, under names with every ending that they write."""
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
    law = hs.BoucWen(beta=2.0, feedthrough=1.0)
    rows = zip(u.tolist(), law.response(u).tolist(), strict=True)
    (tmp_path / "loop.csv").write_text("voltage,displacement\n" + "".join(f"{a},{b}\n" for a, b in rows))
    hs.save(law, tmp_path / "law.json")
    for name in ("loop.svg", "loop.json", "loop.c", "loop.h", "loop.html", "samples.csv"):
        shutil.copy(tmp_path / "loop.csv", tmp_path / name)
    for name in ("law.svg", "law.c", "law.h", "law.csv", "law.fmu", "law.html", "posterior.json"):
        shutil.copy(tmp_path / "law.json", tmp_path / name)
    (tmp_path / "width.py").write_text("def width(beta):\n    return beta\n")
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "response.toml").write_text(RESPONSE)
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0.png").write_bytes(b"a picture")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and "__pycache__" not in str(path)}


CASES = [
    ("metrics", "loop.csv", *COLUMNS, "--out", "loop.csv"),
    ("metrics", "loop.svg", *COLUMNS, "--plot", "loop.svg"),
    ("identify", "loop.csv", *COLUMNS, "--model", "line", "--out", "loop.csv"),
    ("identify", "loop.csv", *COLUMNS, "--model", "law.json", "--out", "law.json"),
    ("identify", "loop.svg", *COLUMNS, "--model", "line", "--plot", "loop.svg"),
    ("posterior", "samples.csv", *COLUMNS, "--model", "line", "--out", "."),
    ("posterior", "loop.csv", *COLUMNS, "--model", "posterior.json", "--out", "."),
    ("discover", "loop.csv", *COLUMNS, "--out", "loop.csv"),
    ("discover", "loop.svg", *COLUMNS, "--plot", "loop.svg"),
    ("compare", "loop.csv", *COLUMNS, "--model", "line", "--csv", "loop.csv"),
    ("compare", "loop.csv", *COLUMNS, "--model", "law.json", "--out", "law.json"),
    ("compare", "loop.csv", *COLUMNS, "--model", "line", "--test", "loop.json", "--latex", "loop.json"),
    ("simulate", "law.json", "loop.csv", "--u", "voltage", "--out", "loop.csv"),
    ("simulate", "law.svg", "loop.csv", "--u", "voltage", "--plot", "law.svg"),
    ("control", "law.json", "--sample-time", "0.1", "--range", "0,1", "--out", "law.json"),
    ("control", "law.c", "--sample-time", "0.1", "--range", "0,1", "--c", "law.c"),
    ("control", "law.h", "--sample-time", "0.1", "--range", "0,1", "--c", "law.c"),
    ("control", "law.json", "--sample-time", "0.1", "--record", "loop.csv", *COLUMNS, "--out", "loop.csv"),
    ("control", "law.json", "--sample-time", "0.1", "--range", "0,1", "--reference", "loop.csv", "--out", "loop.csv"),
    ("c", "law.c", "--out", "law.c"),
    ("c", "law.h", "--out", "law.c"),
    ("fmu", "law.fmu", "--out", "law.fmu"),
    ("page", "law.html", "--out", "law.html"),
    ("page", "law.json", "--data", "loop.html", *COLUMNS, "--out", "loop.html"),
    ("plot", "loop.svg", *COLUMNS, "--out", "loop.svg"),
    ("plot", "loop.csv", "loop.svg", *COLUMNS, "--out", "loop.svg"),
    ("plot", "loop.csv", *COLUMNS, "--model", "law.svg", "--out", "law.svg"),
    ("sweep", "study.toml", "--out", "study.toml", "--resume"),
    ("sweep", "study.toml", "--out", "new.sqlite", "--csv", "study.toml"),
    ("sweep", "study.toml", "--out", "new.sqlite", "--csv", "width.py"),
    ("sweep", "response.toml", "--out", "new.sqlite", "--csv", "loop.csv"),
    ("sweep", "response.toml", "--out", "new.sqlite", "--csv", "law.json"),
    ("sweep", "--show", "loop.csv", "--csv", "loop.csv"),
    ("measure", "frames", "--scale", "1", "--out", "table.csv", "--plot", "frames/0.png"),
    ("measure", "loop.csv", "--scale", "1", "--out", "loop.csv"),
    ("measure", "frames", "--scale", "1", "--voltage", "loop.csv", "--u", "voltage", "--out", "loop.csv"),
]


def refused(folder, capsys, *arguments):
    before = contents(folder)
    assert main([*arguments]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "is an input of this command, and would be overwritten" in err
    assert contents(folder) == before


@pytest.mark.parametrize("arguments", CASES, ids=" ".join)
def test_a_result_in_the_place_of_an_input_is_refused(folder, capsys, arguments):
    refused(folder, capsys, *arguments)


def test_every_command_that_reads_files_is_among_them():
    others = {"reproduce", "explore", "example", "columns", "completion", "warm-up"}
    assert {arguments[0] for arguments in CASES} == COMMANDS.keys() - others


@pytest.mark.parametrize("how", ["spelling", "symbolic", "hard", "upward"])
def test_another_path_to_the_input_is_refused_too(folder, capsys, how):
    other = {"spelling": "./frames/../loop.csv", "symbolic": "soft.csv", "hard": "hard.csv", "upward": "frames/up.csv"}
    if how == "symbolic":
        (folder / "soft.csv").symlink_to("loop.csv")
    if how == "hard":
        os.link("loop.csv", "hard.csv")
    if how == "upward":
        (folder / "frames" / "up.csv").symlink_to("../loop.csv")
    refused(folder, capsys, "metrics", "loop.csv", *COLUMNS, "--out", other[how])
    refused(folder, capsys, "metrics", other[how], *COLUMNS, "--out", "loop.csv")


def test_what_the_standard_input_is_read_from_is_an_input(folder, capsys, monkeypatch):
    with open("loop.csv", encoding="utf-8") as file:
        monkeypatch.setattr(sys, "stdin", file)
        refused(folder, capsys, "metrics", "-", *COLUMNS, "--out", "loop.csv")
    monkeypatch.setattr(sys, "stdin", io.StringIO((folder / "loop.csv").read_text()))  # which has no file
    assert main(["metrics", "-", *COLUMNS, "--out", "loop.csv"]) == 0


def test_another_file_may_be_overwritten(folder, capsys):
    (folder / "kept.csv").write_text("before")
    assert main(["metrics", "loop.csv", *COLUMNS, "--out", "kept.csv"]) == 0
    assert (folder / "kept.csv").read_text() == capsys.readouterr().out
    assert np.genfromtxt(folder / "loop.csv", delimiter=",", names=True).size == 41
