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
import time
from pathlib import Path

import numpy as np
import pytest
import sweep_tasks
from strategies import assert_refused
from test_sweep import bits

import hysim as hs
from hysim.sweeps import _chunks, _store, _sweep

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
    for n_done in (1, 90):
        run = f"sweep_tasks.run_until_killed({str(path)!r}, {n_done}, {rng.uniform(0.0, 0.01)})"
        assert in_another_process(f"import sweep_tasks; {run}").wait() == -signal.SIGKILL
        assert n_done <= len(hs.load_sweep(path)) < len(uninterrupted)
    resumed = hs.sweep(sweep_tasks.long, sweep_tasks.LONG, workers=2, store=path)
    assert bits(resumed) == bits(uninterrupted) == bits(hs.load_sweep(path))


def shards(folder, task, space, n, **options):
    """The stores of all shards of a study, each computed without the others."""
    stores = [folder / f"{k}.sqlite" for k in range(n)]
    for k, store in enumerate(stores):
        hs.sweep(task, space, store=store, shard=(k, n), **options)
    return stores


@pytest.mark.parametrize("n", [1, 7, 40])
@pytest.mark.parametrize(("task", "space"), [(sweep_tasks.noisy, sweep_tasks.SPACE), (sweep_tasks.failing, GRID)])
def test_merged_shards_are_the_study_that_nobody_divided(task, space, n, path, tmp_path):
    stores = shards(tmp_path, task, space, n, seed=1)
    sizes = [len(hs.load_sweep(store)) for store in stores]
    whole = hs.sweep(task, space, seed=1)
    assert max(sizes) - min(sizes) <= 1
    assert sum(sizes) == len(whole)
    rng = np.random.default_rng(n)
    merged = hs.sweep(task, space, seed=1, store=path, merge=rng.permutation(stores), time_limit=0.0)
    assert bits(merged) == bits(whole) == bits(hs.load_sweep(path))


def test_what_a_shard_lacks_is_computed_by_whoever_merges(path, tmp_path):
    first, _, last = shards(tmp_path, sweep_tasks.noisy, sweep_tasks.SPACE, 3)
    part = hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, merge=[first, last], time_limit=0.0)
    assert part.task.tolist() == [*range(40), *range(80, 120)]
    assert part["a"].tolist() == hs.load_sweep(first)["a"].tolist() + hs.load_sweep(last)["a"].tolist()
    whole = hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, store=path, merge=[first, last])
    assert bits(whole) == bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE))


def test_a_time_limit_ends_at_a_chunk_and_the_next_call_goes_on(path):
    def slow(a, b):
        time.sleep(0.01)
        return a * b

    space = {"a": range(50), "b": [1.0, 2.0]}
    first = hs.sweep(slow, space, store=path, workers=1, time_limit=0.3)
    assert 0 < len(first) < 100
    assert bits(first) == bits(hs.load_sweep(path))
    assert bits(hs.sweep(slow, space, store=path)) == bits(hs.sweep(sweep_tasks.product, space))


@pytest.mark.parametrize(
    ("task", "options", "words"),
    [
        (lambda a, b: a * b, {}, "another study: the task's source .* leave it out"),
        (sweep_tasks.product, {"seed": 1}, "another study: the seed was 1 and is 0; leave it out"),
        (lambda a, b: a * b + 1.0, {"on_change": "keep"}, "outputs of task 0 are others than those of a store"),
        (
            lambda a, b: {"x": a},
            {"on_change": "keep"},
            "returned the number x, those before the number value",
        ),
    ],
)
def test_stores_that_contradict_each_other_are_not_merged(task, options, words, path, tmp_path):
    kept = hs.sweep(sweep_tasks.product, GRID, store=path)
    hs.sweep(task, GRID, store=tmp_path / "other.sqlite", seed=options.get("seed", 0))
    with pytest.raises(ValueError, match=rf"other.sqlite.*{words}"):
        hs.sweep(sweep_tasks.product, GRID, store=path, merge=[tmp_path / "other.sqlite"], **options | {"seed": 0})
    assert bits(hs.load_sweep(path)) == bits(kept)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 0.99])
def test_a_shard_that_was_cut_is_named_and_the_others_can_be_merged(share, path, tmp_path):
    cut, whole = shards(tmp_path, sweep_tasks.noisy, sweep_tasks.SPACE, 2)
    cut.write_bytes(cut.read_bytes()[: int(share * cut.stat().st_size)])
    with pytest.raises(ValueError, match=re.escape(str(cut))):
        hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, store=path, merge=[whole, cut])
    merged = hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, store=path, merge=[whole])
    assert bits(merged) == bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE))


def test_a_clock_that_jumps_changes_nothing(path, uninterrupted, monkeypatch):
    ticks = itertools.cycle([1e9, -1e9])
    monkeypatch.setattr(time, "time", lambda: next(ticks))
    assert bits(hs.sweep(sweep_tasks.long, sweep_tasks.LONG, store=path, time_limit=600.0)) == bits(uninterrupted)


def test_of_two_merges_at_once_the_second_is_refused(path, tmp_path):
    stores = shards(tmp_path, sweep_tasks.product, GRID, 2)

    def second(done, total):
        with pytest.raises(OSError, match="the store is locked"):
            hs.sweep(sweep_tasks.product, GRID, store=path, merge=stores)

    first = hs.sweep(sweep_tasks.product, GRID, store=path, merge=stores, progress=second)
    assert bits(first) == bits(hs.load_sweep(path)) == bits(hs.sweep(sweep_tasks.product, GRID))


@pytest.mark.parametrize(
    ("shard", "words"),
    [
        ((3, 3), "shards are counted from 0: of 3 the last is 2, got 3"),
        ((-1, 3), "negative"),
        ((0, 0), "at least 1"),
        (3, "a pair"),
        ((1, 2, 3), "a pair"),
    ],
)
def test_a_shard_that_there_is_not_is_refused(shard, words):
    with pytest.raises((TypeError, ValueError), match=words):
        hs.sweep(sweep_tasks.product, GRID, shard=shard)


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
    digests = {
        _sweep.identity(times(kind(order)), _chunks.space_of(GRID), 0)["task"]
        for kind in (set, frozenset)
        for order in ([0, 8], [8, 0])
    }  # of one place in a table of eight
    assert len(digests) == 1
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
    assert 5 < rows(path) < 100
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


def test_an_array_of_jobs_computes_shards_and_the_command_merges_them(study, path, shell, monkeypatch):
    monkeypatch.setenv("SLURM_ARRAY_TASK_MIN", "10")
    monkeypatch.setenv("SLURM_ARRAY_TASK_STEP", "5")
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "3")
    assert "no shard of" in shell("sweep", study, "--out", path, "--merge")[2]
    assert shell("sweep", study, "--out", path, "--shard", "auto")[0] == 2
    for job, code in (("10", 1), ("20", 0)):
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", job)
        assert shell("sweep", study, "--out", path, "--shard", "auto")[0] == code
    code, out, err = shell("sweep", study, "--out", path, "--merge")
    assert (code, err) == (3, "hysim: not finished: 33 tasks remain, the first is 33\n")
    assert shell("sweep", study, "--out", path, "--shard", "1/3", "--time-limit", 0)[0] == 3
    assert shell("sweep", study, "--out", path, "--shard", "1/3")[0] == 0
    code, out, err = shell("sweep", study, "--out", path, "--merge")
    assert (code, out.partition(",")[0], err) == (1, "100 of 100 tasks: 99 succeeded", "")
    assert sorted(each.name for each in path.parent.glob("*.sqlite")) == [
        *(f"study.{k}-of-3.sqlite" for k in range(3)),
        "study.sqlite",
    ]
    whole = path.with_name("whole.sqlite")
    shell("sweep", study, "--out", whole)
    assert bits(hs.load_sweep(path)) == bits(hs.load_sweep(whole))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--shard", "3/3"], "of 3 the last is 2, got 3"),
        (["--shard", "auto"], "none of SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX, PBS_ARRAY_INDEX is set"),
        (["--shard", "1"], "--shard takes K/N"),
        (["--shard", "1/3", "--merge"], "--shard and --merge exclude each other"),
    ],
)
def test_a_wrong_shard_is_one_line(words, said, study, path, shell):
    code, _, err = shell("sweep", study, "--out", path, *words)
    assert (code, err.count("\n"), said in err) == (2, 1, True)


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
    assert bits(hs.load_sweep(moved)) == bits(first)


CLUSTER = Path(__file__).parent.parent / "examples" / "cluster"


def test_the_job_array_of_the_examples_computes_what_one_process_does(path, tmp_path, shell, monkeypatch):
    for file in CLUSTER.iterdir():
        shutil.copy(file, tmp_path)
    for name, line in (("hysim", f'exec "{sys.executable}" -m hysim "$@"'), ("scontrol", 'echo "$@" > asked')):
        (tmp_path / "bin" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{line}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    root = os.path.dirname(os.path.dirname(__file__))
    array = {"SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_MIN": "0", "SLURM_ARRAY_TASK_COUNT": "2", "PYTHONPATH": root}

    def job(k):
        paths = {"PATH": os.pathsep.join([str(tmp_path / "bin"), os.environ["PATH"]]), "SLURM_ARRAY_TASK_ID": str(k)}
        return subprocess.run(
            ["bash", "slurm_array.sh"], cwd=tmp_path, env={**os.environ, **array, **paths}, capture_output=True
        ).returncode

    script = (tmp_path / "slurm_array.sh").read_text()
    (tmp_path / "slurm_array.sh").write_text(script.replace("3300", "0"))
    assert (job(1), (tmp_path / "asked").read_text()) == (3, "requeue 7_1\n")
    (tmp_path / "slurm_array.sh").write_text(script)
    assert job(1) == 0
    monkeypatch.chdir(tmp_path)
    assert shell("sweep", "study.toml", "--out", "rows.sqlite", "--shard", "0/2")[0] == 0
    assert shell("sweep", "study.toml", "--out", "rows.sqlite", "--merge")[0] == 0
    assert shell("sweep", "study.toml", "--out", path)[0] == 0
    assert bits(hs.load_sweep("rows.sqlite")) == bits(hs.load_sweep(path))


def test_the_other_recipes_have_the_form_of_what_reads_them():
    for file in CLUSTER.glob("*.py"):
        compile(file.read_text(), file, "exec")
    for file in CLUSTER.glob("*.sh"):
        assert subprocess.run(["bash", "-n", file], capture_output=True).returncode == 0
    job = pytest.importorskip("yaml").safe_load((CLUSTER / "kubernetes_job.yaml").read_text())
    assert job["spec"]["completionMode"] == "Indexed"
    assert f"auto/{job['spec']['completions']}" in job["spec"]["template"]["spec"]["containers"][0]["args"]
