"""Settings of the whole test suite."""

import contextlib
import hashlib
import os
import pickle
import sqlite3
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# numba's cache does not see an edit in another file: it is kept apart for each state of the kernels.
kernels = b"".join(path.read_bytes() for path in sorted((ROOT / "hysim" / "kernels").glob("*.py")))
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".numba_cache" / hashlib.sha256(kernels).hexdigest()[:16]))
os.environ.setdefault("MPLBACKEND", "agg")

import hypothesis  # noqa: E402  numba must not be imported before the cache folder is set
import pytest  # noqa: E402

uncompiled = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")  # a hundred times slower
hypothesis.settings.register_profile("hysim", deadline=None, derandomize=True, max_examples=2 if uncompiled else 30)
hypothesis.settings.load_profile("hysim")


def pytest_collection_modifyitems(items):
    """A test that is marked as needing optional packages is skipped where one is missing."""
    for item in items:
        wanted = {package for mark in item.iter_markers("extra") for package in mark.args}
        if missing := sorted(package for package in wanted if find_spec(package) is None):
            item.add_marker(pytest.mark.skip(reason=f"needs {', '.join(missing)}"))


@pytest.fixture(autouse=True)
def pyplot_keeps_no_figure():
    """A figure that a test leaves open would count in whichever test draws the twenty-first."""
    yield
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close("all")


def once_for_all_processes(tmp_path_factory, name, compute):
    """The result of `compute` for a folder of its own: the first process computes it, and the others read it."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # which all processes share
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
def paper_study(reproduction):
    """The models of Table 1."""
    return reproduction.findings.study


@pytest.fixture(scope="session")
def discovered_table1():
    """The law of Table 1, discovered once for all tests."""
    import hysim as hs

    return hs.discover(hs.datasets.table1())
