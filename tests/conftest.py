"""Settings of the whole test suite."""

import contextlib
import gc
import hashlib
import importlib
import io
import os
import pickle
import signal
import sqlite3
import subprocess
import sys
import tomllib
import zlib
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "experiments"))  # whose helpers several tests take
ONE_BY_ONE = "test_experiments.py", "test_docs.py"
STRUCTURES = (
    "test_structure",
    "plants/structures/",
    "[structures",
    "_structures",
    "_frame]",
    "_ensembles]",
    "[friction]",
)

# numba's cache does not see an edit in another file: it is kept apart for each state of what is compiled.
compiled = [path for room in ("kernels", "laws") for path in sorted((ROOT / "hysim" / room).rglob("*.py"))]
kernels = b"".join(path.read_bytes() for path in [*compiled, ROOT / "hysim" / "models" / "slope.py"])
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".numba_cache" / hashlib.sha256(kernels).hexdigest()[:16]))
os.environ.setdefault("MPLBACKEND", "agg")
os.environ.setdefault("NUMBA_OPT", "1")  # the same bits and speed; the first circle takes a twentieth less, to compile
# Workers of the tests share the cores: threads of a BLAS that wait for each other would take most of the time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Some thirty tests start a Python of their own, which without bytecode would compile every module anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

gc.set_threshold(20_000, 20, 20)  # with the usual ones, kernels take longer to compile

for name, usual in {"SIGINT": signal.default_int_handler, "SIGHUP": signal.SIG_DFL}.items():
    number = getattr(signal, name, None)  # Windows has no SIGHUP
    # Ignored, as under nohup: what the tests start would not hear of it either.
    if number is not None and signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, usual)

import hypothesis  # noqa: E402  numba must not be imported before the cache folder is set
import pytest  # noqa: E402

pytest.register_assert_rewrite("strategies")
collect_ignore = ["data", "strangers"]  # scripts, which a search for doctests would run
if sys.platform == "win32":
    collect_ignore += ["test_ending_early.py", "test_kernel_cache.py"]  # signals and limits that Windows lacks

uncompiled = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")  # a hundred times slower
hypothesis.settings.register_profile("hysim", deadline=None, derandomize=True, max_examples=2 if uncompiled else 30)
hypothesis.settings.load_profile("hysim")


def pytest_configure(config):
    config.option.maxworkerrestart = "0"  # pytest-xdist would wait for ever when one has crashed among divided files


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Divide the tests among the workers, whatever ``--dist`` says: pytest 9.2 does not see the groups of loadgroup.

    The tests of a file run in one worker, because they share fixtures and kernels; the experiments and the pages of
    the documentation, which take seconds each, are divided one by one; they and the doctests come last and even out the
    ends. All that moves structures runs in one worker, whose kernels take half a minute to compile.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Files(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.partition("::")[0]
            if any(part in nodeid for part in STRUCTURES):
                return "structures"
            return nodeid if file.endswith(ONE_BY_ONE) else file

    config.option.loadscopereorder = False  # which would put files of many tests before those of long ones
    return Files(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    """Load kernels and tests in every second worker from the last to the first, when the whole suite is collected.

    All workers load all of them, and what is compiled while they are loaded comes from a cache where another worker
    has compiled it. From both ends each compiles a half; in the same order all would compile everything. The kernels of
    closed loops, to which both ends lead soon, are left to the second worker, which begins with them.
    """
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    if number.isdigit() and session.config.args_source is session.config.ArgsSource.TESTPATHS:
        step = -1 if int(number) % 2 else 1
        paths = sorted((ROOT / "hysim" / "kernels").rglob("[a-z]*.py"))[::step]
        kernels = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths]
        for kernel in (["hysim.kernels.loop"] if step < 0 else []) + kernels:
            importlib.import_module(kernel)
        if step < 0:
            for file in sorted((ROOT / "tests").glob("test_*.py"), reverse=True):
                with contextlib.suppress(Exception, pytest.skip.Exception):  # the collection reports them
                    importlib.import_module(file.stem)


def pytest_collection_finish():
    """Take what is loaded out of the collector's sight: each full collection would go through all kernels and tests.

    The reader of films asks for one at the end of each file, and took seconds for it.
    """
    gc.collect()
    gc.freeze()


CIRCLES = tomllib.loads((ROOT / "tests" / "circles.toml").read_text())
purposes = {name: purpose for purpose, names in CIRCLES.items() for name in names}
DRAWN, SHARE = ("page", "digits", "search", "slow"), 3  # of these purposes `--draw` leaves one test of so many
begun = pytest.StashKey[float]()


def pytest_addoption(parser):
    parser.addoption("--draw", metavar="TEXT", help="run a third of the longest tests, which TEXT decides")


def purpose_of(nodeid):
    """Why a test stands in the second circle; None in the first one."""
    return purposes.get(nodeid.partition("[")[0].removeprefix("tests/"))


def is_drawn(text, nodeid):
    """Whether a text, by which the gate names the state of all files, leaves a test in."""
    return purpose_of(nodeid) not in DRAWN or zlib.crc32(f"{text} {nodeid}".encode()) % SHARE == 0


def cpu_seconds():
    """Of this process and of those that it has waited for."""
    return sum(os.times()[:4])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    item.stash[begun] = cpu_seconds()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_makereport(item, call):
    """Report the CPU seconds of a test with its fixtures; what it is the first to call is compiled in them, too."""
    if call.when == "teardown":
        item.user_properties.append(("cpu", cpu_seconds() - item.stash[begun]))


def pytest_terminal_summary(terminalreporter):
    """Say which tests belong into the second circle."""
    slow = defaultdict(float)
    for report in (each for reports in terminalreporter.stats.values() for each in reports):
        name = getattr(report, "nodeid", "").partition("[")[0].removeprefix("tests/")
        cpu = [seconds for key, seconds in getattr(report, "user_properties", ()) if key == "cpu"]
        slow[name] = max([slow[name], *cpu]) if name not in purposes else 0.0
    for name in [name for name in sorted(slow, key=slow.__getitem__, reverse=True) if slow[name] > 2.0][:10]:
        terminalreporter.write_line(f"{slow[name]:5.1f} CPU s  {name}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark the second circle, skip tests that need missing packages, and put those last that are divided one by one."""
    if (text := config.getoption("draw")) is not None:
        left = [item for item in items if not is_drawn(text, item.nodeid)]
        items[:] = [item for item in items if is_drawn(text, item.nodeid)]
        config.hook.pytest_deselected(items=left)
    items.sort(key=lambda item: item.path.name in ONE_BY_ONE or ROOT / "hysim" in item.path.parents)
    for item in items:
        if purpose := purpose_of(item.nodeid):
            item.add_marker(purpose)
        wanted = {package for mark in item.iter_markers("extra") for package in mark.args}
        if missing := sorted(package for package in wanted if find_spec(package) is None):
            item.add_marker(pytest.mark.skip(reason=f"needs {', '.join(missing)}"))


@pytest.fixture(autouse=True)
def pyplot_keeps_no_figure():
    """A figure that a test leaves open would count in whichever test draws the twenty-first."""
    yield
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close("all")


@pytest.fixture(autouse=True)
def no_call_is_long_enough_to_report(monkeypatch):
    """A slow machine would write progress where a test expects nothing on the standard error."""
    monkeypatch.setattr("hysim._basics.progress._SILENT", float("inf"))


@pytest.fixture
def shell(monkeypatch, capsys):
    """Run hysim's command line with these words: exit code, standard output, standard error."""
    from hysim.cli import main

    def run(*words, stdin=None):
        if stdin is not None:
            monkeypatch.setattr("sys.stdin", io.StringIO(stdin))
        try:
            code = main([*map(str, words)])
        except SystemExit as exit_:
            code = exit_.code
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def folder(tmp_path):
    """The folder in which commands are run; files of tests have others, with records in them."""
    return tmp_path


@pytest.fixture
def run(folder, monkeypatch, shell):
    """Run a command in the folder: exit code, standard output, standard error."""
    monkeypatch.chdir(folder)
    return shell


def shared_folder(tmp_path_factory):
    """Of what all processes compute once: that of HYSIM_SHARED, where several sessions test one state, or a new one."""
    own = tmp_path_factory.getbasetemp()
    return Path(os.environ.get("HYSIM_SHARED") or (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own))


def once_for_all_processes(tmp_path_factory, name, compute):
    """The result of `compute`, called with a folder by the first process that asks; the others read a file."""
    folder = shared_folder(tmp_path_factory)
    with contextlib.closing(sqlite3.connect(folder / f"{name}.lock", timeout=600.0)) as lock:
        lock.execute("BEGIN EXCLUSIVE")  # waits until no other process holds it
        stored = folder / f"{name}.pickle"
        if not stored.exists():
            stored.write_bytes(pickle.dumps(compute(folder / name)))
        return pickle.loads(stored.read_bytes())


@pytest.fixture(scope="session")
def reproduction(tmp_path_factory):
    """The paper, reproduced once for all its tests, those that another process runs among them."""
    from hysim.paper import reproduce

    return once_for_all_processes(tmp_path_factory, "reproduction", reproduce)


@pytest.fixture(scope="session")
def again(tmp_path_factory):
    """The command in a process of its own: folder, stdout, stderr. The gate has run it from a wheel."""
    folder = shared_folder(tmp_path_factory) / "again"
    if not folder.exists():
        folder.mkdir()
        command = [sys.executable, "-W", "error", "-m", "hysim", "reproduce", "--out", str(folder / "out")]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        (folder / "stdout").write_text(done.stdout)
        (folder / "stderr").write_text(done.stderr)
    return folder / "out", (folder / "stdout").read_text(), (folder / "stderr").read_text()


@pytest.fixture(scope="session")
def paper_study(reproduction):
    """The models of Table 1."""
    return reproduction.findings.study


@pytest.fixture(scope="session")
def discovered_table1(tmp_path_factory):
    """The law of Table 1, discovered once for all tests."""
    import hysim as hs

    return once_for_all_processes(tmp_path_factory, "discovered_table1", lambda _: hs.discover(hs.datasets.table1()))


@pytest.fixture(scope="session")
def table1():
    """The record of Table 1."""
    import hysim as hs

    return hs.datasets.table1()
