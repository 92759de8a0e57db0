"""Long calls report on the standard error what is done and how long the rest may take, and the outermost alone does."""

import inspect
import io
import os
import sys
from types import SimpleNamespace

import numba
import numpy as np
import pytest
import sweep_tasks

import hysim as hs
from hysim._basics import progress as _progress
from hysim.cli import main
from hysim.paper import reproduce

RECORD = hs.Record(u=[0, 1, 2, 1, 0], y=[0, 1, 2, 1.5, 0.5])
VERBS = [
    name
    for name in hs.__all__
    if inspect.isfunction(verb := getattr(hs, name)) and "progress" in inspect.signature(verb).parameters
]

SILENT = _progress._SILENT  # before the fixture of all tests


class Stream(io.StringIO):
    is_terminal = False

    def isatty(self):
        return self.is_terminal


@pytest.fixture
def stream(monkeypatch):
    stream = Stream()
    monkeypatch.setattr(_progress, "sys", SimpleNamespace(stderr=stream, modules=sys.modules))
    return stream


@pytest.fixture
def clock(monkeypatch):
    """The seconds that the reports see."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(_progress, "_SILENT", SILENT)
    monkeypatch.setattr(_progress, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def at_once(monkeypatch):
    """Report from the begin of a call on, and every time."""
    for name in ("_SILENT", "_IN_FILE", "_ON_TERMINAL"):
        monkeypatch.setattr(_progress, name, 0.0)


def work(clock, seconds):
    """Four pieces of work that take so many seconds each, as a verb."""

    @_progress.reports
    def measure(*, progress=None):
        for done in range(5):
            progress(done, 4)
            clock.now += seconds

    return measure


FEW_LINES = "measure: 1 of 4, 0:00:18 left\nmeasure: 3 of 4, 0:00:06 left\n"


@pytest.mark.parametrize(("seconds", "reported"), [(0.4, ""), (6.0, FEW_LINES)], ids=["short", "long"])
def test_a_short_call_reports_nothing_and_a_long_one_few_lines_to_a_file(stream, clock, seconds, reported):
    work(clock, seconds)()
    assert stream.getvalue() == reported


def test_a_long_call_overwrites_its_line_on_a_terminal(stream, clock):
    stream.is_terminal = True
    work(clock, 6.0)()
    left = [f"measure: {k} of 4, 0:00:{6 * (4 - k):02d} left" for k in (1, 2, 3)]
    assert stream.getvalue().split("\r\x1b[K") == ["", *left, "measure: 4 of 4", ""]


def test_what_is_at_work_is_named_and_an_unknown_total_is_none(stream, clock):
    with _progress.Line("compare") as line:
        clock.now = 3.0
        line.announce("play")
        clock.now = 13.0
        line(7, 0)
    assert stream.getvalue() == "compare: play\ncompare: play: 7\n"


def test_an_estimate_begins_anew_with_another_search(stream, clock):
    with _progress.Line("identify") as line:
        for clock.now, done in ((0.0, 0), (100.0, 50), (200.0, 0), (210.0, 5)):
            line(done, 10 if clock.now > 100.0 else 100)
    assert stream.getvalue().splitlines()[-1] == "identify: 5 of 10, 0:00:10 left"


@pytest.mark.parametrize("progress", [False, lambda done, total: None])
def test_no_line_is_written_where_none_is_asked_for(stream, at_once, progress):
    hs.identify(hs.Play, RECORD, progress=progress)
    hs.sweep(lambda k: hs.identify(hs.Line, RECORD).rmse, {"k": [1, 2]}, progress=progress)
    assert stream.getvalue() == ""


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_only_the_outermost_verb_reports(capfd, at_once, executor):
    hs.sweep(sweep_tasks.identified, {"k": [1.0, 2.0]}, executor=executor, workers=2)
    lines = capfd.readouterr().err.splitlines()
    assert lines
    assert {line.partition(":")[0] for line in lines} == {"sweep"}
    hs.compare({"line": hs.Line, "play": hs.Play}, RECORD, cross_validate=2, workers=2)
    out, err = capfd.readouterr()
    assert out == ""
    assert {line.partition(":")[0] for line in err.splitlines()} == {"compare"}
    assert "compare: play: " in err


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"), reason="nothing is compiled")
def test_a_compilation_is_named(stream, at_once):
    hs.sweep(lambda k: numba.njit(lambda x: x + 1.0)(k), {"k": [1.0]}, workers=1)
    assert "sweep: compiling, once\n" in stream.getvalue()


def test_every_verb_with_progress_reports_by_default():
    assert {"identify", "compare", "discover", "sweep", "load", "simulate", "close_loop"} <= {*VERBS}
    for name, verb in {"reproduce": reproduce, **{name: getattr(hs, name) for name in VERBS}}.items():
        assert inspect.signature(verb).parameters["progress"].default is None, name
        assert verb.__code__ is _progress.reports(len).__code__, name


def test_a_sweep_says_at_its_start_that_its_table_will_need_pandas(stream, at_once, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    hs.sweep(lambda k: k, {"k": [1]}, workers=1)
    warning = "sweep: pandas is not installed: the result has no to_frame (pip install 'hysim[tables]')"
    assert stream.getvalue().splitlines() == [warning, "sweep: 0 of 1", "sweep: 1 of 1"]
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(__spec__=True))
    hs.sweep(lambda k: k, {"k": [1]}, workers=1)
    assert stream.getvalue().splitlines()[-1] == "sweep: 1 of 1"


def test_a_simulation_reports_its_samples(monkeypatch):
    monkeypatch.setattr("hysim._basics.parallel._STRETCH", 2)
    calls = []
    hs.simulate(hs.Play(), None, [0.0, 1.0, 2.0, 1.0, 0.0], progress=lambda *at: calls.append(at))
    assert calls[:3] == [(2, 5), (4, 5), (5, 5)]


def test_a_file_reports_its_bytes(tmp_path):
    hs.save_record(RECORD, tmp_path / "loop.csv")
    calls = []
    assert hs.load(tmp_path / "loop.csv", progress=lambda *at: calls.append(at)) == RECORD
    assert calls == sorted(calls)
    assert calls[-1] == (total := 3 * (tmp_path / "loop.csv").stat().st_size, total)


def test_the_shell_reports_until_it_is_told_to_be_quiet(tmp_path, capsys, at_once):
    hs.save_record(RECORD, path := tmp_path / "loop.csv")
    assert main(["identify", str(path), "--model", "play"]) == 0
    assert "identify: " in capsys.readouterr().err
    assert main(["identify", str(path), "--model", "play", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_a_loop_that_the_callers_function_closes_is_not_reported_to_it():
    plant, t, calls = hs.Actuator(hysteresis=hs.BoucWen()), 0.01 * np.arange(100.0), []

    def seen(done, total):
        calls.append(done)
        hs.close_loop(plant, hs.PID(ki=1.0), t, t)

    hs.close_loop(plant, hs.PID(ki=1.0), t, t, progress=seen)
    assert calls == [100]
