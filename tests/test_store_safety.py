"""A store touches no file but its own, and one that is damaged or made by somebody else is refused in one line."""

import contextlib
import json
import math
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from strategies import assert_refused
from test_sweep import bits

import hysim as hs
from hysim.cli import main

VERSION_0_2 = Path(__file__).parent / "data" / "version_0_2"
SPACE = {"a": [1.0, 2.0, 3.0]}


def squares(a):
    return {"square": a * a, "both": [a, a * a]}


@pytest.fixture
def path(tmp_path):
    hs.sweep(squares, SPACE, store=tmp_path / "study.sqlite", workers=1)
    return tmp_path / "study.sqlite"


def change(path, statement, *values):
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        assert database.execute(statement, values).rowcount != 0


def refused(path, *words):
    """A store that cannot be used: what is said when it is read, gone on with, and shown by the command."""
    for use in (lambda: hs.load_sweep(path), lambda: hs.sweep(squares, SPACE, store=path)):
        with pytest.raises(ValueError, match=r"study\.sqlite") as caught:
            use()
        assert all(word in str(caught.value) for word in words)


@pytest.fixture
def old(tmp_path):
    """A study whose arrays are in files, as version 0.2 wrote it, and such a file."""
    for each in sorted(VERSION_0_2.glob("study.*")):
        (shutil.copytree if each.is_dir() else shutil.copy)(each, tmp_path / each.name)
    return tmp_path / "study.sqlite", min((tmp_path / "study.sqlite.arrays").iterdir())


def test_arrays_in_files_are_read_and_a_study_with_them_is_not_continued(old):
    path, _ = old
    study = hs.load_sweep(path)
    assert study["square"].tolist()[::2] == [1.0, 9.0]
    assert study["both"].tolist()[::2] == [[1.0, 1.0], [3.0, 9.0]]
    assert study.errors == {1: "ValueError: two"}
    for on_change in ("error", "keep"):
        assert_refused("arrays are in files", hs.sweep, squares, SPACE, store=path, on_change=on_change)
    assert bits(hs.load_sweep(path)) == bits(study)
    anew = hs.sweep(squares, SPACE, store=path, on_change="restart")
    assert bits(hs.load_sweep(path)) == bits(anew)


@pytest.mark.parametrize("shard", ["../outside.npz", "/etc/outside.npz", "sub/../../outside.npz", "..", 7, b"\xff"])
def test_no_file_outside_the_folder_is_read(old, shard):
    path, _ = old
    change(path, "UPDATE results SET shard = ?", shard)
    assert_refused("damaged store.*is not the name of one of its files", hs.load_sweep, path)


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "shape", "tasks", "names"])
def test_a_damaged_file_with_arrays_is_one_line(old, damage):
    path, file = old
    content = file.read_bytes()
    if damage in ("cut", "empty", "text"):
        file.write_bytes({"cut": content[: len(content) // 2], "empty": b"", "text": b"no archive"}[damage])
    else:
        arrays = {"task": np.arange(1), "output_both": np.zeros((1, 2))}
        arrays |= {"shape": {"output_both": np.zeros((1, 7))}, "tasks": {"task": np.ones(1) + math.inf}}.get(damage, {})
        np.savez(file, **({} if damage == "names" else arrays))
    assert_refused("damaged store", hs.load_sweep, path)


def test_a_file_with_arrays_that_is_gone_is_named(old):
    path, file = old
    file.unlink()
    assert_refused(file.name, hs.load_sweep, path, error=FileNotFoundError)


NAMES = ['a"b', 'a"; DROP TABLE results; --', "a b", "select", "ä", "a'b", "[a]", "(SELECT 1)", "task_"]


def test_any_name_is_a_column_and_no_statement(tmp_path):
    space = {name: [float(k)] for k, name in enumerate(NAMES)}
    computed = hs.sweep(lambda **given: {f"{name}!": value for name, value in given.items()}, space,
                        store=tmp_path / "names.sqlite")  # fmt: skip
    assert bits(hs.load_sweep(tmp_path / "names.sqlite")) == bits(computed)
    assert [computed[f"{name}!"].tolist() for name in NAMES] == [[float(k)] for k in range(len(NAMES))]


def test_what_a_store_calls_a_column_is_no_statement_either(path):
    for column in ["(SELECT name FROM sqlite_master)", 'a" FROM results; --', "nothing"]:
        change(path, "UPDATE study SET value = ? WHERE name = 'parameters'", json.dumps({"a": column}))
        refused(path, "damaged store", "no column", repr(column))


ROWS = ("identity", "n_tasks", "parameters", "kinds", "axes", "layout")
VALUES = [
    "null", "{}", "[]", "1e400", "-1e400", "NaN", "-1", "true", '"text"', '{"a": null}', '{"seed": "1e400"}', "[[]]",
    '[["a", 1e400]]', '[["both", [1e400], "both"]]', "1" + 400 * "0", 900 * "[" + 900 * "]", 10**5 * "[", "", "{", None,
    b"\xff", 1e300,
]  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_a_damaged_row_of_the_study_is_one_line(path, name, capsys):
    harmless = []
    for value in VALUES:
        change(path, "UPDATE study SET value = ? WHERE name = ?", value, name)
        code = main(["sweep", "--show", str(path)])
        err = capsys.readouterr().err
        if code == 0:
            harmless.append(value)
        else:
            assert code == 2
            assert err.startswith(f"hysim: error: {path}")
            assert err.count("\n") == 1
    assert harmless == (["null"] if name == "axes" else [])  # the axes of what is no grid
    change(path, "DELETE FROM study WHERE name = ?", name)
    if name != "layout":  # without one there are no outputs
        refused(path, "damaged store", f"'{name}' is missing")


@pytest.mark.parametrize(
    ("statement", "word"),
    [
        ("UPDATE results SET task = 10 WHERE task = 2", "a row of the task 10"),
        ("UPDATE results SET task = -1 WHERE task = 0", "a row of the task -1"),
        ("UPDATE results SET square = 'much'", "could not convert"),
        ("UPDATE results SET seconds = 'much'", "could not convert"),
        ("UPDATE results SET seconds = NULL WHERE task = 1", "a row has no 'seconds'"),
        ("UPDATE results SET both = NULL", "both of the task 0 is missing"),
        ("UPDATE results SET both = 1.5 WHERE task = 1", "a bytes-like object is required"),
        ("UPDATE results SET both = x'00'", "buffer size must be a multiple"),
        ("UPDATE results SET both = zeroblob(8)", "cannot reshape"),
    ],
)
def test_a_damaged_row_of_the_results_is_one_line(path, statement, word):
    change(path, statement)
    refused(path, "damaged store", word)


def test_a_row_without_its_parameter_is_not_read_as_nan(path):
    change(path, "UPDATE results SET a = NULL WHERE task = 1")
    assert_refused("a row has no 'a'", hs.load_sweep, path)


@pytest.mark.parametrize("kept", [("-wal", "-shm"), ("-wal",), ("-shm",), ("-journal",)], ids="".join)
@pytest.mark.parametrize("is_damaged", [False, True])
def test_what_sqlite_has_left_beside_a_deleted_store_does_not_matter(tmp_path, kept, is_damaged):
    """A study begins anew where the store alone was deleted, with the files of a killed writer still there."""
    old, path = tmp_path / "old.sqlite", tmp_path / "study.sqlite"
    with contextlib.closing(sqlite3.connect(old)) as database:
        database.execute("PRAGMA journal_mode = wal" if "-journal" not in kept else "PRAGMA journal_mode = persist")
        database.execute("CREATE TABLE results (task)")
        database.executemany("INSERT INTO results VALUES (?)", [(k,) for k in range(3000)])
        database.commit()
        for end in kept:
            left = old.with_name(old.name + end).read_bytes()
            path.with_name(path.name + end).write_bytes(left[::-1] if is_damaged else left)
    computed = hs.sweep(squares, SPACE, store=path, workers=1)
    assert bits(hs.load_sweep(path)) == bits(computed)
    assert bits(hs.sweep(squares, SPACE, store=path, workers=1)) == bits(computed)
