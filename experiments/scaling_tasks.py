"""The tasks of the scaling experiment, in a module that the workers of a cluster can import.

``python experiments/scaling_tasks.py N STORE`` computes a study of N short tasks and prints its memory [MB].
"""

import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import hysim as hs

HELD = {"A": 1.0, "n": 1.0, "gain": 1.0, "feedthrough": 0.0, "offset": 0.0, "z0": 0.0}


@cache
def wave(n_samples: int) -> np.ndarray:
    """A sine of 32 cycles."""
    return np.sin(np.linspace(0.0, 200.0, n_samples))


def product(a: float, b: float) -> float:
    """Less than a microsecond."""
    return a * b


def millisecond(a: float, b: float) -> float:
    """In a kernel that keeps no array."""
    return _driven(a, b, 20_000)


def ten_milliseconds(a: float, b: float) -> float:
    """In a kernel that keeps no array."""
    return _driven(a, b, 200_000)


def two_seconds(a: float, b: float) -> float:
    """In many calls of a kernel."""
    return sum(ten_milliseconds(a, b) for _ in range(300))


def with_arrays(a: float, b: float) -> float:
    """Some 10 ms, a part of them with arrays of a megabyte made anew in each call."""
    u = np.sin(np.linspace(0.0, 200.0, 125_000))
    return float(hs.BoucWen(A=1.0 + a, beta=0.5 + b, n=1.5).response(u)[-1])


def fit(a: float, b: float) -> float:
    """A law with two free parameters, some 0.2 s."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=100)
    rec = hs.Record(u=u, y=hs.BoucWen(beta=0.5 + a, gamma=0.1 * b).response(u))
    return hs.identify(hs.BoucWen(n=1.0), rec, free=("beta", "gamma"), fixed=HELD).rmse


def _driven(a: float, b: float, n_samples: int) -> float:
    law = {"A": 1.0 + a, "beta": 0.5 + b, "n": 1.5}
    return float(hs.BoucWen.responses(law, wave(n_samples), reduce="final", workers=1)[0])


def numbers(a: float, b: float) -> dict[str, float]:
    """Two numbers, or columns of them."""
    return {"product": a * b, "sum": a + b}


numbers.batch = numbers  # type: ignore[attr-defined]


def loop(task: Callable[..., Any], n_tasks: int) -> None:
    """So many calls without a sweep."""
    for k in range(n_tasks):
        task(0.5, k / n_tasks)


if __name__ == "__main__":
    import resource

    n_tasks, store = sys.argv[1:]
    hs.sweep(numbers, {"a": np.linspace(0.0, 1.0, int(n_tasks) // 10), "b": range(10)}, store=store)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
