"""How much of the package does a call cross? Files and functions of hysim that run, counted by a profiler.

    python .ci/walks.py           files and functions of each walk
    python .ci/walks.py identify  the functions of one walk, file by file

A call is made once before it is counted: what is imported, compiled and prepared at the first call is no part of the
walk. Compiled kernels, comprehensions and lambdas do not count.
"""

import contextlib
import io
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import hysim as hs
from hysim.cli import main as command

PACKAGE = str(Path(hs.__file__).parent)


def crossed(walk: Callable[[], Any]) -> Counter[str]:
    """Number of functions that the second call of a walk runs, by the file."""
    codes: set[CodeType] = set()

    def see(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            codes.add(frame.f_code)

    walk()
    threading.setprofile_all_threads(see) if sys.version_info >= (3, 12) else threading.setprofile(see)
    sys.setprofile(see)
    try:
        walk()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return Counter(
        str(Path(code.co_filename).relative_to(PACKAGE))
        for code in codes
        if code.co_filename.startswith(PACKAGE) and not code.co_name.startswith("<")
    )


def walks(folder: Path) -> dict[str, Callable[[], Any]]:
    """The walks, by name; `folder` is for the files that they read and write."""
    record = hs.datasets.table1()
    few = hs.Record(u=record.u[::4], y=record.y[::4], t=None)
    hs.save_record(few, folder / "loop.csv")
    plant = hs.Actuator(hysteresis=hs.Dahl())
    t = 0.01 * np.arange(20)

    def by_command() -> None:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            command(["identify", str(folder / "loop.csv"), "--model", "dahl"])

    return {
        "response": lambda: hs.BoucWen().response(few.u),
        "identify": lambda: hs.identify(hs.Dahl, few, progress=False),
        "close_loop": lambda: hs.close_loop(plant, hs.PID(ki=1.0), t, np.sin(t), progress=False),
        "discover": lambda: hs.discover(few, progress=False),
        "hysim identify": by_command,
    }


def main() -> None:
    """Print the files and functions of every walk, or of the named one."""
    with tempfile.TemporaryDirectory() as folder:
        named = walks(Path(folder))
        chosen = sys.argv[1:] or list(named)
        for name in chosen:
            functions = crossed(named[name])
            print(f"{name:16s} {len(functions):4d} files {sum(functions.values()):5d} functions", flush=True)
            if sys.argv[1:]:
                print("\n".join(f"  {count:4d} {file}" for file, count in sorted(functions.items())))


if __name__ == "__main__":
    main()
