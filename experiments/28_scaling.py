"""What does a sweep cost beside its tasks, and how well do two workers share them?

Tasks of a microsecond, of some 10 ms in kernels, and fits of some 0.1 s, on one and on two threads and processes; the
microsecond task also with a store; and a million laws on the paper's first table, down to their rmse. The time of the
same calls in a plain loop is measured beside them. Efficiency is that time over workers times the time of the sweep.
Medians over repeats. With distributed installed, a local dask cluster of two processes is measured too.

From the time that a chunk takes to go there and back, c, and the chunk's own time T follows what a cluster can do: W
workers compute for T and wait for c, so that their efficiency is T / (T + c) as long as the scheduler, which needs s
for each chunk, has W s < T. Chunks are of 75 ms, and beyond 37 workers of W / 500 seconds, which keeps it so.
"""

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "scaling"
Row = dict[str, Any]
N_SAMPLES = 100_000


def product(a: float, b: float) -> float:
    """A microsecond or less."""
    return a * b


def simulated(a: float, b: float) -> float:
    """Some 10 ms in a kernel."""
    u = np.sin(np.linspace(0.0, 200.0, N_SAMPLES))
    return float(hs.BoucWen(A=1.0 + a, beta=0.5 + b, n=1.5).response(u)[-1])


def fitted(a: float, b: float) -> float:
    """A fit of a law with two free parameters."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=100)
    rec = hs.Record(u=u, y=hs.BoucWen(beta=0.5 + a, gamma=0.1 * b).response(u))
    return hs.identify(hs.BoucWen(n=1.0), rec, free=("beta", "gamma"), fixed=HELD).rmse


HELD = {"A": 1.0, "n": 1.0, "gain": 1.0, "feedthrough": 0.0, "offset": 0.0, "z0": 0.0}


def space(n_tasks: int) -> dict[str, Any]:
    """A grid of so many tasks."""
    return {"a": np.linspace(0.1, 1.0, n_tasks // 2), "b": [0.2, 0.4]}


def timed(work: Callable[[], object], repeats: int) -> float:
    """Median time [s], the first call not counted."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def in_a_loop(task: Callable[..., Any], n_tasks: int) -> None:
    """The same calls without a sweep."""
    axes = space(n_tasks)
    for a in axes["a"].tolist():
        for b in axes["b"]:
            task(a, b)


def measured(kind: str, task: Callable[..., Any], n_tasks: int, executors: dict[str, Any], repeats: int) -> list[Row]:
    """Times of one kind of task on every executor, with one and two workers."""
    plain, rows = timed(partial(in_a_loop, task, n_tasks), repeats), []
    for name, executor in executors.items():
        for workers in (1, 2) if isinstance(executor, str) else (2,):
            run = partial(hs.sweep, task, space(n_tasks), executor=executor, workers=workers)
            rows.append(row(kind, name, workers, n_tasks, timed(run, repeats), plain))
    return rows


def row(kind: str, executor: str, workers: int, n_tasks: int, seconds: float, plain: float) -> Row:
    """One measurement; where one loop is the rival, the overhead is what a task costs beyond it."""
    return {
        "kind": kind,
        "executor": executor,
        "workers": workers,
        "tasks": n_tasks,
        "seconds": seconds,
        "efficiency_percent": 100.0 * plain / (workers * seconds),
        "overhead_microseconds": 1e6 * (seconds - plain / workers) / n_tasks,
    }


def stored(n_tasks: int, repeats: int) -> Row:
    """The microsecond task with a new store each time."""
    with tempfile.TemporaryDirectory() as folder:
        stores = (f"{folder}/{k}.sqlite" for k in range(repeats + 1))
        seconds = timed(lambda: hs.sweep(product, space(n_tasks), workers=2, store=next(stores)), repeats)
        plain = timed(partial(in_a_loop, product, n_tasks), repeats)
    return row("microsecond, stored", "threads", 2, n_tasks, seconds, plain)


def million(n_laws: int, repeats: int) -> Row:
    """Laws on the paper's first table, to their rmse; the rival is `responses` with all cores."""
    rec = hs.datasets.table1()
    limits = {"A": (0.01, 0.04), "beta": (0.0, 0.05), "gamma": (-0.02, 0.02), "feedthrough": (0.0, 0.04)}
    sample = hs.Sample(distributions=limits, n=n_laws, method="latin_hypercube")
    task = hs.response_task(hs.BoucWen(n=1.0), rec.u, rec.y)
    seconds = timed(lambda: hs.sweep(task, sample, workers=2), repeats)
    sets = sample.draw()
    plain = timed(
        lambda: hs.BoucWen.responses({**sets, "n": 1.0}, rec.u, reduce="sse", target=rec.y, workers=1), repeats
    )
    return row("laws on Table 1", "threads", 2, n_laws, seconds, plain)


@contextmanager
def cluster() -> Iterator[dict[str, Any]]:
    """A local dask cluster of two processes, if distributed is installed."""
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        yield {}
        return
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local, Client(local) as client:
        yield {"dask": client}


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    own = {"threads": "threads", "processes": "processes"}
    if smoke:
        return [*measured("microsecond", product, 20, {"threads": "threads"}, 1), million(100, 1)]
    with cluster() as dask:
        everywhere = {**own, **dask}
        rows = [
            *measured("microsecond", product, 100_000, everywhere, 3),
            *measured("10 ms in kernels", simulated, 100, everywhere, 3),
            *measured("fit", fitted, 12, everywhere, 2),
        ]
    rows += [stored(100_000, 3), million(1_000_000, 3)]
    write_results(RESULTS, rows, draw, {"cores": os.cpu_count()})
    return rows


def draw(rows: list[Row]) -> Figure:
    """Efficiency of the tasks that take their time, and overhead of those that do not."""
    canvas = figure(height=5.5)
    for place, (kinds, column, label) in enumerate(
        (
            (("10 ms in kernels", "fit", "laws on Table 1"), "efficiency_percent", "Efficiency [%]"),
            (("microsecond", "microsecond, stored"), "overhead_microseconds", "Overhead [us a task]"),
        )
    ):
        ax = canvas.add_subplot(2, 1, place + 1)
        chosen = [line for line in rows if line["kind"] in kinds]
        ax.barh(
            [f"{line['kind']}, {line['workers']} {line['executor']}" for line in chosen],
            [line[column] for line in chosen],
        )
        ax.set(xlabel=label)
        ax.invert_yaxis()
    return canvas


if __name__ == "__main__":
    for line in main():
        print(
            f"{line['kind']:20} {line['workers']} {line['executor']:10} {line['tasks']:>8} tasks"
            f" {line['seconds']:7.3f} s,"
            f" efficiency {line['efficiency_percent']:4.0f} %, overhead {line['overhead_microseconds']:7.1f} us a task"
        )
