"""A store touches no file but its own, and one that is damaged or made by somebody else is refused in one line."""

import contextlib
import json
import math
import sqlite3

import numpy as np
import pytest
from strategies import assert_refused
from test_sweep import bits

import hysim as hs
from hysim.cli import main

SPACE = {"a": [1.0, 2.0, 3.0]}


def squares(a):
    return {"square": a * a, "both": [a, a * a]}


def cubes(a):
    return {"cube": a**3, "both": [a, a**3]}


@pytest.fixture
def path(tmp_path):
    hs.sweep(squares, SPACE, store=tmp_path / "study.sqlite", workers=1)
    return tmp_path / "study.sqlite"


@pytest.fixture
def shards(path):
    return path.with_name(f"{path.name}.arrays")


def change(path, statement, *values):
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        assert database.execute(statement, values).rowcount != 0


def refused(path, *words):
    """A store that cannot be used: what is said when it is read, gone on with, and shown by the command."""
    for use in (lambda: hs.load_sweep(path), lambda: hs.sweep(squares, SPACE, store=path)):
        with pytest.raises(ValueError, match=r"study\.sqlite") as caught:
            use()
        assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize("name", ["mine.npz", "000000000.npz", "0123456789abcdef-000000000.npz"])
@pytest.mark.parametrize("how", ["new", "restart"])
def test_arrays_of_others_are_never_deleted(path, shards, name, how):
    (shards / name).write_bytes(b"precious")
    if how == "new":
        path.unlink()
    options = {"on_change": "restart"} if how == "restart" else {}
    before = None if how == "new" else bits(hs.load_sweep(path))
    with pytest.raises(ValueError, match="does not belong to this study: move it") as caught:
        hs.sweep(cubes, SPACE, store=path, **options)
    assert str(shards) in str(caught.value)
    assert (shards / name).read_bytes() == b"precious"
    if how == "restart":
        assert bits(hs.load_sweep(path)) == before  # the study that was to go is still whole
        assert bits(hs.sweep(squares, SPACE, store=path)) == before  # and nothing keeps it from going on
    assert (shards / name).read_bytes() == b"precious"


def test_a_study_that_begins_anew_takes_its_own_arrays_away_and_nothing_else(path, shards):
    own = {file.name for file in shards.iterdir()}
    (shards / "notes.txt").write_text("mine")
    anew = hs.sweep(cubes, SPACE, store=path, on_change="restart")
    assert not own & {file.name for file in shards.iterdir()}
    assert (shards / "notes.txt").read_text() == "mine"
    assert bits(hs.load_sweep(path)) == bits(anew)


def test_the_arrays_stay_until_the_study_that_follows_is_in_the_database(path, shards, monkeypatch):
    from hysim.sweeps._store import Store

    def fail(*_):
        raise OSError("the disk is full")

    before = bits(hs.load_sweep(path))
    with monkeypatch.context() as patch:
        patch.setattr(Store, "_commit", fail)
        assert_refused("full", hs.sweep, cubes, SPACE, error=OSError, store=path, on_change="restart")
    assert bits(hs.load_sweep(path)) == before


@pytest.mark.parametrize("shard", ["../outside.npz", "/etc/outside.npz", "sub/../../outside.npz", "..", 7, b"\xff"])
def test_no_file_outside_the_folder_is_read(path, shards, shard):
    np.savez(shards.parent / "outside.npz", task=np.arange(3), output_both=np.zeros((3, 2)))
    change(path, "UPDATE results SET shard = ?", shard)
    refused(path, "is not the name of one of its files with arrays")


def test_a_link_in_the_folder_is_neither_read_nor_written_through(path, shards):
    (file, *_) = shards.iterdir()
    outside = shards.parent / "outside.npz"
    file.rename(outside)
    file.symlink_to(outside)
    refused(path, "is a link")
    before = outside.read_bytes()
    change(path, "DELETE FROM results")
    for link in shards.iterdir():
        link.unlink()
    digits = file.name.partition("-")[0]
    for k in range(3):
        (shards / f"{digits}-{k:09d}.npz").symlink_to(outside)
    change(
        path,
        "INSERT INTO results (task, seconds, shard, error) VALUES (2, 0.0, ?, 'failed')",
        f"{digits}-000000000.npz",
    )
    assert_refused("is a link", hs.sweep, squares, SPACE, store=path, workers=1)
    assert outside.read_bytes() == before


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


ROWS = ("identity", "n_tasks", "parameters", "kinds", "axes", "layout", "shards")
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
        ("UPDATE results SET shard = NULL", "the arrays of the task 0 are missing"),
    ],
)
def test_a_damaged_row_of_the_results_is_one_line(path, statement, word):
    change(path, statement)
    refused(path, "damaged store", word)


def test_a_row_without_its_parameter_is_not_read_as_nan(path):
    change(path, "UPDATE results SET a = NULL WHERE task = 1")
    assert_refused("a row has no 'a'", hs.load_sweep, path)


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "shape", "tasks", "names"])
def test_a_damaged_file_with_arrays_is_one_line(path, shards, damage):
    (file, *_) = sorted(shards.iterdir())
    content = file.read_bytes()
    if damage in ("cut", "empty", "text"):
        file.write_bytes({"cut": content[: len(content) // 2], "empty": b"", "text": b"no archive"}[damage])
    else:
        arrays = {"task": np.arange(3), "output_both": np.zeros((3, 2))}
        arrays |= {"shape": {"output_both": np.zeros((3, 7))}, "tasks": {"task": np.arange(3) + math.inf}}.get(
            damage, {}
        )
        np.savez(file, **({} if damage == "names" else arrays))
    refused(path, "damaged store")


def test_a_file_with_arrays_that_is_gone_is_named(path, shards):
    (file, *_) = sorted(shards.iterdir())
    file.unlink()
    assert_refused(file.name, hs.load_sweep, path, error=FileNotFoundError)


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
