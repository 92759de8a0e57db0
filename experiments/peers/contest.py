"""One way to solve a problem, and how it is timed: in turns with hysim's own, on a machine that others use too."""

import ctypes
import importlib
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

Run = Callable[[], np.ndarray]


@dataclass(frozen=True)
class Contestant:
    """A method at one setting; `smooth` if it is given the input's formula, not its samples."""

    tool: str
    method: str
    setting: str
    run: Run
    smooth: bool = False


def steps(count: int) -> str:
    """The setting of a method of fixed steps."""
    return f"{count} step{'s' if count > 1 else ''} a sample"


def clock(run: Callable[[], Any], timer: Callable[[], float] = time.perf_counter) -> float:
    """Time of a call [s]; of a short one the median of several."""
    times: list[float] = []
    while not times or (sum(times) < 5e-3 and len(times) < 15):
        begin = timer()
        run()
        times.append(timer() - begin)
    return statistics.median(times)


def in_turns(
    timed: Callable[[], float], own: Callable[[], float], least: int, most: int, enough: float = 3.0
) -> np.ndarray:
    """Times [s] that both return, shape (repeats, 2): at least `least` turns, then until `most` or `enough` seconds."""
    turns: list[tuple[float, float]] = []
    while len(turns) < least or (len(turns) < most and sum(map(sum, turns)) < enough):
        turns.append((timed(), own()))
    return np.array(turns)


def spread(name: str, values: np.ndarray) -> dict[str, float]:
    """Median under `name`, and the quartiles beside it."""
    low, median, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
    return {name: median, f"{name}_q1": low, f"{name}_q3": high}


@cache
def peer(name: str) -> ModuleType | None:
    """A module of the extra `bench`, or None and a printed line."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError, RuntimeError):  # the last from OpenSeesPy, where its libraries are missing
        print(f"{name.partition('.')[0]} cannot be imported (extra bench): left out")
        return None


def compiled_c(source: Path, folder: Path) -> ctypes.CDLL | None:
    """A C source compiled for this machine, or None and a printed line where there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print(f"no C compiler: {source.name} is left out")
        return None
    library = folder / source.with_suffix(".so").name
    command = [compiler, "-O3", "-march=native", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))
