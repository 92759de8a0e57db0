"""What is stored is never lost, and never taken for another study."""

import concurrent.futures
import errno
import itertools
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
import sweep_tasks
from strategies import assert_refused
from test_sweep import bits

import hysim as hs
from hysim.sweeps import _store, _sweep

GRID = {"a": [1.0, 2.0, 3.0, 4.0], "b": [1, 2]}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "study.sqlite"


@pytest.fixture(scope="module")
def uninterrupted():
    return hs.sweep(sweep_tasks.long, sweep_tasks.LONG, workers=2)


def in_another_process(code, **options):
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=os.path.dirname(__file__),
        env={**os.environ, "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])},
        **options,
    )


def test_what_is_stored_is_what_was_computed_to_the_bit(path):
    computed = hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, store=path)
    assert bits(computed) == bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE))
    stored = hs.load_sweep(path)
    assert bits(stored) == bits(computed)
    assert np.array_equal(stored["seconds"], computed["seconds"])
    assert {name: axis.tolist() for name, axis in stored.axes.items()} == {
        name: axis.tolist() for name, axis in computed.axes.items()
    }


calls = itertools.count(1)


def counted(a, b):
    return next(calls)


def test_a_second_call_computes_nothing(path):
    first, second = (hs.sweep(counted, GRID, store=path, workers=1) for _ in range(2))
    assert first["value"].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    assert bits(first) == bits(second)
    assert np.array_equal(first["seconds"], second["seconds"])


def test_the_rows_are_plain_sql(path):
    hs.sweep(sweep_tasks.failing, GRID, store=path)
    with sqlite3.connect(path) as database:
        rows = database.execute('SELECT task, a, "b", "value", error FROM results WHERE a >= 2').fetchall()
    database.close()
    assert rows == [
        (2, 2.0, 1, 2.0, None), (3, 2.0, 2, 1.0, None), (4, 3.0, 1, None, "ValueError: no 3.0"),
        (5, 3.0, 2, None, "ValueError: no 3.0"), (6, 4.0, 1, 4.0, None), (7, 4.0, 2, 2.0, None),
    ]  # fmt: skip


def test_names_that_sql_cannot_tell_apart_stay_apart(path):
    space = {"A": [1.0, 2.0], "a": [3.0], "Seed": [5.0]}
    result = hs.sweep(lambda **given: {"B": given["A"], "b": given["a"], 'x "y"': 1.0}, space, store=path)
    assert bits(hs.load_sweep(path)) == bits(result)
    assert result["B"].tolist() == [1.0, 2.0]


def test_failed_tasks_are_rows_that_stay(path):
    result = hs.sweep(sweep_tasks.failing, GRID, store=path)
    assert result.errors == hs.load_sweep(path).errors == {4: "ValueError: no 3.0", 5: "ValueError: no 3.0"}
    assert bits(hs.sweep(sweep_tasks.failing, GRID, store=path)) == bits(result)


def test_a_killed_study_goes_on_and_loses_nothing(path, uninterrupted):
    rng = np.random.default_rng(10)
    for n_done in (1, 40, 90):
        run = f"sweep_tasks.run_until_killed({str(path)!r}, {n_done}, {rng.uniform(0.0, 0.01)})"
        child = in_another_process(f"import sweep_tasks; {run}")
        assert child.wait() == -signal.SIGKILL
        assert n_done <= len(hs.load_sweep(path)) < len(uninterrupted)
    resumed = hs.sweep(sweep_tasks.long, sweep_tasks.LONG, workers=2, store=path)
    assert bits(resumed) == bits(uninterrupted) == bits(hs.load_sweep(path))


def test_an_interrupt_keeps_what_is_finished(path, uninterrupted):
    def interrupt(done, total):
        if done >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path, workers=2, progress=interrupt)
    assert 30 <= len(hs.load_sweep(path)) < len(uninterrupted)
    assert bits(hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path)) == bits(uninterrupted)


def other(a, b):
    return a * b + 0.0


@pytest.mark.parametrize(
    ("task", "space", "seed", "words"),
    [
        (other, GRID, 0, "the task's source or a value bound to it has changed"),
        (sweep_tasks.product, {**GRID, "b": [1, 3]}, 0, r"other values of the parameters \(8 tasks of a, b, as before"),
        (sweep_tasks.product, {**GRID, "b": [1]}, 0, "the space was 8 tasks of a, b .* and is 4 tasks"),
        (sweep_tasks.product, GRID, 1, "the seed was 0 and is 1"),
    ],
)
def test_another_study_is_refused(path, task, space, seed, words):
    first = hs.sweep(sweep_tasks.product, GRID, store=path)
    assert_refused(rf"{path} holds another study: {words}.*restart", hs.sweep, task, space, seed=seed, store=path)
    assert bits(hs.load_sweep(path)) == bits(first)
    if task is not other:
        assert_refused("holds another study", hs.sweep, task, space, seed=seed, store=path, on_change="keep")
    anew = hs.sweep(task, space, seed=seed, store=path, on_change="restart")
    assert bits(anew) == bits(hs.load_sweep(path)) == bits(hs.sweep(task, space, seed=seed))


def test_another_version_is_refused_or_kept(path, monkeypatch):
    first = hs.sweep(sweep_tasks.product, GRID, store=path)
    monkeypatch.setattr(_sweep, "__version__", "9.9")
    with pytest.raises(ValueError, match=rf"the hysim was {re.escape(hs.__version__)} and is 9\.9.*keep"):
        hs.sweep(sweep_tasks.product, GRID, store=path)
    for _ in range(2):  # the second time it is the same study
        kept = hs.sweep(sweep_tasks.product, GRID, store=path, on_change="keep")
        assert np.array_equal(kept["seconds"], first["seconds"])


def bound_to_itself():
    def factorial(n):
        return n * factorial(n - 1) if n else 1

    return factorial


def test_what_is_bound_to_a_task_belongs_to_its_study(path):
    def times(factor):
        return lambda a, b: factor * a * b

    hs.sweep(times(2.0), GRID, store=path)
    hs.sweep(times(2.0), GRID, store=path)
    assert_refused("a value bound to it has changed", hs.sweep, times(3.0), GRID, store=path)
    factorial = path.with_name("factorial.sqlite")
    for _ in range(2):
        hs.sweep(bound_to_itself(), {"n": [3, 4]}, store=factorial)
    u = np.linspace(0.0, 1.0, 5)
    laws = path.with_name("laws.sqlite")
    for _ in range(2):
        hs.sweep(hs.response_task(hs.BoucWen, u, measure="final"), {"beta": [0.5]}, store=laws)
    with pytest.raises(ValueError, match="a value bound to it has changed"):
        hs.sweep(hs.response_task(hs.BoucWen, 2.0 * u, measure="final"), {"beta": [0.5]}, store=laws)


def test_a_locked_store_is_refused_and_can_be_read(path):
    seen = []

    def second(done, total):
        if done == total:
            with pytest.raises(OSError, match="locked: another process is writing") as caught:
                hs.sweep(sweep_tasks.product, GRID, store=path)
            seen.append((caught.value.filename, len(hs.load_sweep(path))))

    hs.sweep(sweep_tasks.product, GRID, store=path, progress=second)
    assert seen == [(str(path), 8)]


@pytest.mark.parametrize("exists", [True, False])
def test_a_store_that_cannot_be_written_says_so(path, exists, monkeypatch):
    if exists:
        hs.sweep(sweep_tasks.product, GRID, store=path)
        connected = _store._connected
        monkeypatch.setattr(_store, "_connected", lambda path, mode: connected(path, "ro"))
    with pytest.raises(PermissionError, match="read-only" if exists else "cannot be opened or made there") as caught:
        hs.sweep(other, GRID, store=path if exists else path / "inside.sqlite", on_change="restart")
    assert caught.value.filename.startswith(str(path))
    assert not exists or len(hs.load_sweep(path)) == 8


def test_another_file_is_never_touched(path):
    path.write_text("no database at all" * 100)
    assert_refused("is not a store of hysim", hs.sweep, sweep_tasks.product, GRID, store=path)
    assert path.read_text() == "no database at all" * 100
    path.unlink()
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE mine (x)")
    database.close()
    assert_refused("it has other tables", hs.sweep, sweep_tasks.product, GRID, store=path, on_change="restart")
    with pytest.raises(FileNotFoundError):
        hs.load_sweep(path.with_name("none.sqlite"))


def test_a_full_disk_loses_no_row_that_was_reported(path, uninterrupted, monkeypatch):
    connected, reported = _store._connected, []

    def on_a_small_disk(path, mode):
        database = connected(path, mode)
        database.execute("PRAGMA max_page_count = 6")  # 4 KiB each
        return database

    with monkeypatch.context() as patch:
        patch.setattr(_store, "_connected", on_a_small_disk)
        with pytest.raises(OSError, match="the disk is full; every row that was reported is kept") as caught:
            hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path, progress=lambda done, total: reported.append(done))
    assert caught.value.errno == errno.ENOSPC
    assert len(hs.load_sweep(path)) == reported[-1] > 0
    assert bits(hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path)) == bits(uninterrupted)


def test_a_disk_that_is_full_for_the_arrays_leaves_no_half_of_a_row(path, uninterrupted, monkeypatch):
    savez, calls = np.savez, []

    def full_at_the_fourth(file, **arrays):
        calls.append(1)
        if len(calls) == 4:
            file.write(b"half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        savez(file, **arrays)

    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", full_at_the_fourth)
        assert_refused("No space left", hs.sweep, sweep_tasks.long, sweep_tasks.LONG, error=OSError, store=path)
    folder = path.with_name(f"{path.name}.arrays")
    assert len(list(folder.iterdir())) == 3
    digits = next(folder.iterdir()).name.partition("-")[0]
    unnamed = [folder / f"{digits}-000000999.npz", folder / f".{digits}-000000998.npz.{16 * '0'}"]
    for file in unnamed:
        file.write_bytes(b"of a transaction that never came")
    assert bits(hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path)) == bits(uninterrupted)
    assert not any(file.exists() for file in unnamed)


class Fragile(concurrent.futures.ThreadPoolExecutor):
    """Fails with the fifth chunk."""

    sent = 0

    def submit(self, function, /, *args, **kwargs):
        self.sent += 1
        return super().submit(function, *args, **kwargs) if self.sent < 5 else super().submit(divmod, 1, 0)


def test_an_executor_that_fails_loses_no_row(path, uninterrupted):
    with Fragile(1) as pool, pytest.raises(OSError, match=r"lost a chunk of .* ZeroDivisionError.*tasks are done"):
        hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path, executor=pool)
    assert len(hs.load_sweep(path)) >= 1
    assert bits(hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path)) == bits(uninterrupted)


def fatal(k):
    return os._exit(1) if k == 50 else k


def test_a_process_that_dies_is_said(path):
    with pytest.raises(OSError, match="lost a chunk"):
        hs.sweep(fatal, {"k": range(100)}, executor="processes", workers=2, store=path)
    assert not set(hs.load_sweep(path)["k"]) & {50}


STUDY = """
seed = 3
task = "task.py:task"

[grid]
k = {from = 0, to = 99, number = 100}
"""
TASK = """
def task(k, seed):
    if k == 7:
        raise ValueError("seven")
    return sum(i * i % 7 for i in range(100_000)) + k
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "task.py").write_text(TASK)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


def command(*arguments):
    return [sys.executable, "-m", "hysim", "sweep", *map(str, arguments)]


def test_the_command_is_interrupted_and_goes_on(study, path, shell):
    with subprocess.Popen(
        command(study, "--out", path, "--workers", 1), stderr=subprocess.PIPE, start_new_session=True, text=True
    ) as child:
        while not (path.exists() and rows(path) > 5):
            assert child.poll() is None
        os.killpg(child.pid, signal.SIGINT)
        assert child.communicate()[1] == "hysim: interrupted\n"
    assert child.returncode == 130
    n_kept = rows(path)
    assert 5 < n_kept < 100
    code, _, err = shell("sweep", study, "--out", path)
    assert (code, "continue it with --resume" in err) == (2, True)
    code, out, err = shell("sweep", study, "--out", path, "--resume", "--processes")
    assert (code, err) == (1, "")  # no terminal, no progress
    assert out.startswith("100 of 100 tasks: 99 succeeded, 1 failed\n  1 x ValueError: seven\n")
    code, out, _ = shell("sweep", "--show", path, "--csv", "-")
    assert (code, out.count("\n")) == (0, 101)
    (study.parent / "task.py").write_text(TASK.replace("seven", "sieben"))
    code, _, err = shell("sweep", study, "--out", path, "--resume")
    assert (code, "the task's source" in err) == (2, True)


def rows(path):
    try:
        return len(hs.load_sweep(path))
    except (ValueError, OSError):  # not yet made, or just being written
        return 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("task = 'none'", "give one of grid, list, sample"),
        ("task = 'none'\n[grid]\na = [1]", "file.py:function"),
        ("tusk = 'none'\n[grid]\na = [1]", "a study has no tusk"),
        ("task = 'math:hippo'\n[grid]\na = [1]", "has no attribute 'hippo'"),
        ("[response]\nlaw = 'bouc-wen'\n[grid]\nbeta = [1]", "'record' is missing"),
        ("task = 'math:sin'\n[sample]\nn = 3\ndistributions.x = [0, 1]", "take 2 or 4"),
        ("task = ", "study.toml"),
    ],
)
def test_a_wrong_study_is_one_line(text, words, study, path, shell):
    study.write_text(text)
    code, _, err = shell("sweep", study, "--out", path)
    assert (code, err.count("\n")) == (2, 1)
    assert words in err
    assert not path.exists()


def test_a_study_of_a_law_on_a_record(study, path, shell):
    study.write_text(
        "[response]\nlaw = 'bouc-wen'\nrecord = 'table1'\nmeasure = 'rmse'\n[sample]\nn = 8\n"
        "distributions.beta = [0.1, 0.5]\ndistributions.n = {name = 'norm', loc = 2.0, scale = 0.1}"
    )
    code, out, _ = shell("sweep", study, "--out", path)
    assert (code, "8 of 8 tasks" in out) == (0, True)
    assert len(hs.load_sweep(path)["rmse"]) == 8


def test_a_store_that_moved_is_the_same_store(path, tmp_path):
    first = hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, store=path)
    (tmp_path / "there").mkdir()
    moved = tmp_path / "there" / path.name
    shutil.move(path, moved)
    shutil.move(f"{path}.arrays", f"{moved}.arrays")
    assert bits(hs.load_sweep(moved)) == bits(first)
