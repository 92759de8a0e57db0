"""Work that is interrupted or killed ends within two seconds, with all that it has started, and leaves whole files."""

import contextlib
import gc
import multiprocessing.queues
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs
from hysim._basics import atomic as _atomic
from hysim._basics import parallel as _parallel
from hysim._basics.atomic import write_all
from hysim._basics.parallel import awaited, forked, in_chunks, in_pieces, map_on_threads, processes, threads
from hysim.cli import Ended, main

ON_LINUX = sys.platform.startswith("linux")
linux = pytest.mark.skipif(not ON_LINUX, reason="processes are found by /proc, and forked on Linux alone")
PROMISED = 2.0  # seconds
BUSY = 3.0  # more of them, that a machine with other work may take


def until(condition, seconds=30.0):
    """Wait until a condition holds, and return what it gives."""
    deadline = time.monotonic() + seconds
    while not (held := condition()):
        assert time.monotonic() < deadline, "it never came to that"
        time.sleep(0.01)
    return held


def group(leader):
    """The processes of a group that have not ended."""
    members = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, its_group = status.read_text().rpartition(")")[2].split()[:3]
            if int(its_group) == leader and state != "Z":
                members.append(int(status.parent.name))
    return sorted(members)


@pytest.fixture
def started():
    """Start Python in a group of processes of its own, of which nothing is left after the test, failed or not."""
    children = []

    def start(*arguments):
        child = subprocess.Popen(
            [sys.executable, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([os.path.dirname(os.path.dirname(__file__)), *sys.path])},
        )
        children.append(child)
        return child

    yield start
    for child in children:
        with child, contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)


def ended(child, number, *, group_too=False):
    """Send a signal, and return what the process wrote, and the seconds until all of its group had ended."""
    begin = time.monotonic()
    (os.killpg if group_too else os.kill)(child.pid, number)
    out, err = child.communicate(timeout=PROMISED + BUSY)  # which needs the end of both outputs
    until(lambda: not group(child.pid), PROMISED + BUSY)
    return out, err, time.monotonic() - begin


@linux
@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGTERM, 128 + signal.SIGTERM, "hysim: ended by SIGTERM\n"),
        (signal.SIGKILL, -signal.SIGKILL, ""),
        (signal.SIGINT, 130, "hysim: interrupted\n"),
    ],
)
@pytest.mark.skipif(_parallel.cores() < 2, reason="on one core there is no second process")
def test_reproduce_ends_with_its_second_process(started, tmp_path, number, code, said):
    child = started("-m", "hysim", "reproduce", "--quick", "--out", tmp_path / "out")
    until(lambda: len(group(child.pid)) == 2)
    out, err, _ = ended(child, number, group_too=number == signal.SIGINT)
    assert (child.returncode, out, err) == (code, "", said)
    assert not list((tmp_path / "out").rglob("*"))


BUSY_TASK = """
import sys, time
import hysim as hs

def task(k):
    print("at work", flush=True)
    {body}

hs.sweep(task, {{"k": range(8)}}, executor="{executor}", workers=2)
"""
LOOP, SLEEP = "while True: k += 1", "time.sleep(600)"
ONE_CALL = "sum(range(10**12))"  # no other thread of its process runs before it ends


@linux
@pytest.mark.parametrize(
    ("executor", "body", "number"),
    [
        ("processes", ONE_CALL, signal.SIGKILL),
        ("processes", LOOP, signal.SIGTERM),
        ("processes", SLEEP, signal.SIGINT),
        ("threads", LOOP, signal.SIGINT),
        ("threads", SLEEP, signal.SIGINT),
    ],
)
def test_a_study_ends_with_its_threads_and_processes(started, executor, body, number):
    child = started("-c", BUSY_TASK.format(executor=executor, body=body))
    assert child.stdout.readline().startswith("at work")  # and maybe the other at once
    _, err, _ = ended(child, number, group_too=number == signal.SIGINT)
    assert child.returncode == -number  # as Python itself ends after an interrupt that nobody catches
    assert ("KeyboardInterrupt" in err) == (number == signal.SIGINT)
    assert err.count("Traceback") <= 1


def endless(begun, ended):
    """Calls of a kernel without end, as a search makes them; what it is and when it ended is kept."""

    def work(k):
        begun.append(k)
        try:
            while True:
                in_pieces(lambda _: -1, 1)
        finally:
            ended.append(time.monotonic())

    return work


def test_threads_at_work_are_stopped_and_those_that_wait_never_begin():
    begun, stopped, running = [], [], []

    def run():
        with threads(2) as pool:
            running.extend(pool.submit(endless(begun, stopped), k) for k in range(5))
            until(lambda: len(begun) == 2)
            raise KeyboardInterrupt

    assert_refused("^$", run, error=KeyboardInterrupt)
    until(lambda: len(stopped) == 2, BUSY)
    assert [future.cancelled() for future in running] == [False, False, True, True, True]


@pytest.mark.parametrize("wait", [lambda futures: awaited(futures[0]), lambda _: in_chunks(lambda *_: None, 1)])
def test_threads_that_a_stopped_thread_has_started_are_stopped_with_it(wait):
    begun, ended = [], []

    def start_threads():
        with threads(2) as pool:
            futures = [pool.submit(endless(begun, ended), k) for k in range(2)]
            until(lambda: len(begun) == 2)
            while True:
                wait(futures)

    def run():
        with threads(1) as pool:
            pool.submit(start_threads)
            until(lambda: len(begun) == 2)
            raise KeyboardInterrupt

    assert_refused("^$", run, error=KeyboardInterrupt)
    until(lambda: len(ended) == 2, BUSY)


def test_a_pool_takes_no_work_after_its_end_and_finishes_what_it_has():
    with threads(3) as pool:
        squares = [pool.submit(pow, k, 2) for k in range(50)]
    assert [future.result() for future in squares] == [k * k for k in range(50)]
    assert_refused("after shutdown", pool.submit, pow, 1, 2, error=RuntimeError)


def test_every_search_on_a_thread_ends_after_an_interrupt():
    """The thread that waits is interrupted, as the main thread is by Ctrl-C; a search may take a minute."""

    def interrupted(done, total):
        raise KeyboardInterrupt

    u = 10.0 * np.sin(0.1 * np.arange(20_000))
    record = hs.Record(u=u, y=hs.BoucWen(beta=0.6, gamma=0.1, n=1.4).response(u) + np.sin(0.03 * np.arange(u.size)))
    work = [lambda: None, *(partial(hs.identify, family, record) for family in (hs.BoucWen, hs.GeneralizedBoucWen))]
    before = threading.active_count()
    run = partial(map_on_threads, lambda k: work[k](), 3, workers=3, progress=interrupted)
    assert_refused("^$", run, error=KeyboardInterrupt)
    until(lambda: threading.active_count() == before)  # kernels may have to be compiled first


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_long_work_is_cut_so_that_an_interrupt_comes_through(workers, monkeypatch):
    monkeypatch.setattr(_parallel, "_PIECE", 0.002)
    pieces = []

    def work(start, stop):
        pieces.append((start, stop))
        time.sleep(1e-4 * (stop - start))

    in_chunks(work, 1000, workers=workers, minimum=10)
    covered = sorted(pieces)
    assert [start for start, _ in covered] == [0, *(stop for _, stop in covered[:-1])]
    assert covered[-1][1] == 1000
    assert 20 <= len(pieces) <= 300
    pieces.clear()
    in_chunks(work, 10, workers=workers, n_samples=_parallel._LONGEST)
    assert all(stop - start < 10 for start, stop in pieces)  # long items are worth a call each to begin with


def report_its_handlers():
    return signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), os.readlink("/proc/self/fd/1")


@linux
@pytest.mark.skipif(_parallel.cores() < 2, reason="on one core there is no second process")
def test_a_second_process_leaves_interrupts_and_the_standard_output_to_its_parent():
    with forked(1) as pool:
        on_interrupt, on_end, output = pool.submit(report_its_handlers).result()
    assert (on_interrupt, on_end, output) == (signal.SIG_IGN, signal.SIG_DFL, os.devnull)


def answer_by_half(written):
    for queue in [each for each in gc.get_objects() if isinstance(each, multiprocessing.queues.SimpleQueue)]:
        os.write(queue._writer.fileno(), struct.pack("!i", 100) + b"half")
    Path(written).touch()
    time.sleep(600)


@linux
def test_processes_that_are_no_longer_needed_are_ended_at_work_and_within_an_answer(tmp_path, monkeypatch):
    def run():
        with processes(2, int) as pool:
            pool.submit(answer_by_half, str(tmp_path / "written"))
            pool.submit(time.sleep, 600)
            pids.extend(until(lambda: (tmp_path / "written").exists() and list(pool._processes)))
            raise ValueError("mine")

    pids, threads_before = [], threading.enumerate()
    assert_refused("mine", run)
    assert len(pids) == 2
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
    assert threading.enumerate() == threads_before
    monkeypatch.setattr(os, "fork", lambda: 1 // 0)  # a process that cannot be started is what is said
    assert_refused("division", processes(1, int).__enter__, error=ZeroDivisionError)


@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130)])
def test_a_command_that_is_told_to_end_leaves_no_half_of_a_file(tmp_path, monkeypatch, capsys, name, code):
    number = signal.Signals[name]
    before = signal.getsignal(number)

    @contextlib.contextmanager
    def open_and_end(path, *arguments):
        with open(path, *arguments) as file:
            yield SimpleNamespace(write=lambda data: (file.write(data[:4]), signal.raise_signal(number)))

    (tmp_path / "law.json").write_text("before")
    monkeypatch.setattr(_atomic, "open", open_and_end, raising=False)
    (tmp_path / "loop.csv").write_text("u,y\n0,0\n1,1\n0,0.1\n1,1\n0,0.1\n")
    assert main(["metrics", str(tmp_path / "loop.csv"), "--out", str(tmp_path / "law.json")]) == code
    assert sorted(path.name for path in tmp_path.iterdir()) == ["law.json", "loop.csv"]
    assert (tmp_path / "law.json").read_text() == "before"
    assert signal.getsignal(number) == before
    out, err = capsys.readouterr()
    assert (out, err) == ("", "hysim: interrupted\n" if name == "SIGINT" else f"hysim: ended by {name}\n")


def test_a_signal_between_two_files_waits_until_both_are_renamed(tmp_path, monkeypatch):
    renamed, replace = [], os.replace

    def interrupted(source, target):
        replace(source, target)
        renamed.append(Path(target).name)
        signal.raise_signal(signal.SIGINT)

    for name in "abc":
        (tmp_path / name).write_text("before")
    monkeypatch.setattr(_atomic.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_all({tmp_path / name: "after" for name in "abc"})
    assert sorted(renamed) == ["a", "b", "c"]
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys("abc", "after")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_signals_that_somebody_else_handles_are_left_to_him(tmp_path, capsys):
    came = []
    before = signal.signal(signal.SIGTERM, lambda number, _: came.append(number))
    try:
        assert main(["metrics", str(tmp_path / "none.csv")]) == 2
        signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == [signal.SIGTERM]


def test_a_command_runs_in_another_thread_too(tmp_path, capsys):
    codes = []
    thread = threading.Thread(target=lambda: codes.append(main(["metrics", str(tmp_path / "none.csv")])))
    thread.start()
    thread.join()
    assert codes == [2]


STUCK = """
import sys, time
from hysim.cli import main

def stuck(*_, **__):
    try:
        print("at work", flush=True)
        time.sleep(600)
    except BaseException:
        time.sleep(600)  # as one call of a compiled library would go on

sys.modules["hysim.metrics"] = __import__("types").SimpleNamespace(loop_metrics=stuck, cycle_metrics=stuck)
sys.exit(main(["metrics", sys.argv[1]]))
"""


IN_EXEC = """
import signal, sys, types

def interrupted(*_, **__):
    exec("signal.raise_signal(signal.SIGINT)", {"signal": signal})

sys.modules["hysim.metrics"] = types.SimpleNamespace(loop_metrics=interrupted, cycle_metrics=interrupted)
"""


BEFORE_MAIN = """
import signal, sys

class Finder:
    def find_spec(self, name, *_):
        if name == "hysim.cli":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
"""


@pytest.mark.parametrize("moment", [IN_EXEC, BEFORE_MAIN], ids=["in exec", "before main"])
def test_an_interrupt_while_modules_are_loaded_has_the_same_exit_code(tmp_path, moment):
    (tmp_path / "sitecustomize.py").write_text(moment)  # which Python imports before it runs anything
    (tmp_path / "loop.csv").write_text("u,y\n0,0\n1,1\n0,0.1\n")
    path = os.pathsep.join([str(tmp_path), os.path.dirname(os.path.dirname(__file__)), *sys.path])
    command = [sys.executable, "-m", "hysim", "metrics", str(tmp_path / "loop.csv")]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "hysim: interrupted\n")


@pytest.mark.parametrize(("cause", "code"), [(KeyboardInterrupt(), 130), (Ended(signal.SIGTERM), 143), (None, 2)])
def test_an_interrupted_import_of_a_compiled_module_is_an_interrupt(monkeypatch, tmp_path, capsys, cause, code):
    def load(*_, **__):
        raise ImportError("initialization failed") from cause

    monkeypatch.setattr("hysim.cli.records.read", load)
    assert main(["metrics", str(tmp_path / "loop.csv")]) == code
    assert capsys.readouterr().err.count("\n") == 1


CALLED_BACK = STUCK.replace(
    "def stuck",
    """
import ctypes

@ctypes.CFUNCTYPE(None)
def called_back():  # as numba compiles; Python prints what is raised here, and goes on
    print("at work", flush=True)
    time.sleep(600)

def stuck""",
).replace('print("at work", flush=True)\n        time', "called_back()\n        time")


@linux
@pytest.mark.parametrize(("number", "said"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "ended by SIGTERM")])
@pytest.mark.parametrize("code", [CALLED_BACK, STUCK], ids=["in a callback of a compiled library", "stuck"])
def test_what_cannot_end_in_order_is_ended_with_one_line(started, tmp_path, code, number, said):
    (tmp_path / "loop.csv").write_text("u,y\n0,0\n1,1\n0,0.1\n")
    child = started("-c", code, tmp_path / "loop.csv")
    assert child.stdout.readline() == "at work\n"
    _, err, seconds = ended(child, number)
    assert (child.returncode, err) == (128 + number, f"hysim: {said}\n")
    if code == STUCK:
        assert seconds > 1.0  # it was given the time to end by itself
    else:
        assert seconds < PROMISED + BUSY


def test_a_thread_that_compiles_is_stopped_when_it_has_compiled():
    """An exception inside the compiler would leave it locked, and the next one to compile would wait for ever."""
    scope = {"__name__": "numba.some", "sleep": time.sleep, "done": []}
    exec("def compiling():\n    sleep(0.5)\n    done.append(True)", scope)
    with threads(1) as pool:
        pool.submit(scope["compiling"])
        time.sleep(0.1)
        pool.stop(1.0)
    assert scope["done"] == [True]
