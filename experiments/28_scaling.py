"""What does a sweep cost in addition to its tasks, how well do two workers share them, and what would a thousand do?

Tasks of a microsecond, of 1 and 10 ms in kernels, of 10 ms with large arrays, and fits of 0.2 s, on threads, on
processes and on a dask cluster whose scheduler and workers are processes on the loopback; against the number of workers
and, for the shortest two, of tasks. Then a million laws on the paper's first table, down to their rmse. Before each
sweep the same calls run in a plain loop: efficiency is the loop's time over workers times the sweep's. Medians of
pairs.

The model says that a sweep of N tasks of tau seconds in C chunks on W workers takes start + N tau / W + p N + s C. Its
start, p and s are fitted to the rows of each executor. On a cluster the tasks run elsewhere, while p N + s C stays with
the client and the scheduler: they are busy for a share of the time of W (p / tau + s / T), where a chunk takes T =
max(1 s, W / 500 s), and up to 5 s where they would be busy for more than a fifth of it. Above 1 they saturate, and the
efficiency is the share's inverse. Here client, scheduler and workers shared two cores, and s holds the time that a
chunk is on its way as well as the scheduler's own: p and s are too large rather than too small, and a real cluster does
better.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
import scaling_tasks
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "scaling"
Row = dict[str, Any]
Model = dict[str, float]

REPEATS = 3
SHORTEST, LONGEST, MOST_A_SECOND, BUSY = 1.0, 5.0, 500.0, 0.2  # of a chunk on a cluster, as in hysim/sweeps/_sweep.py
CLUSTERS = (10, 100, 1_000, 10_000)  # workers
DURATIONS = (1e-3, 1e-2, 1e-1, 1.0)  # s of a task


def space(n_tasks: int) -> dict[str, Any]:
    """A grid of so many tasks."""
    return {"a": np.linspace(0.1, 1.0, n_tasks // 2), "b": [0.2, 0.4]}


def loop(task: Callable[..., Any], n_tasks: int) -> None:
    """The same calls without a sweep."""
    axes = space(n_tasks)
    for a in axes["a"].tolist():
        for b in axes["b"]:
            task(a, b)


def seconds_of(work: Callable[[], object]) -> float:
    """Wall-clock time of one call."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def pairs(rival: Callable[[], object], work: Callable[[], object], repeats: int) -> tuple[float, float, float]:
    """Median times of both, one after the other, and the median of their ratios; the first pair not counted."""
    times = [(seconds_of(rival), seconds_of(work)) for _ in range(repeats + 1)][1:]
    loops, sweeps = zip(*times, strict=True)
    return statistics.median(loops), statistics.median(sweeps), statistics.median(a / b for a, b in times)


def measured(kind: str, task: Callable[..., Any], n_tasks: int, executor: Any, workers: int, repeats: int) -> Row:
    """One kind of task, so many of them, on one executor."""
    reports: list[int] = []
    run = partial(hs.sweep, task, space(n_tasks), executor=executor, workers=workers)
    times = pairs(partial(loop, task, n_tasks), lambda: run(progress=lambda done, total: reports.append(done)), repeats)
    name = executor if isinstance(executor, str) else "dask"
    return row(kind, name, workers, n_tasks, len(reports) // (repeats + 1) - 1, times)


def row(kind: str, executor: str, workers: int, n_tasks: int, chunks: int, times: tuple[float, float, float]) -> Row:
    """What is said of one measurement."""
    alone, seconds, ratio = times
    return {
        "kind": kind,
        "executor": executor,
        "workers": workers,
        "tasks": n_tasks,
        "chunks": chunks,
        "loop_seconds": alone,
        "seconds": seconds,
        "efficiency_percent": 100.0 * ratio / workers,
        "overhead_microseconds": 1e6 * (seconds - alone / workers) / n_tasks,
    }


def stored(n_tasks: int, repeats: int) -> Row:
    """The microsecond task with a new store each time."""
    with tempfile.TemporaryDirectory() as folder:
        stores = (f"{folder}/{k}.sqlite" for k in range(repeats + 1))
        run = partial(hs.sweep, scaling_tasks.product, space(n_tasks), workers=2)
        times = pairs(partial(loop, scaling_tasks.product, n_tasks), lambda: run(store=next(stores)), repeats)
    return row("microsecond, stored", "threads", 2, n_tasks, 0, times)


def laws_on_table1(n_laws: int, n: float, repeats: int) -> Row:
    """Laws of one exponent, down to their rmse; the rival is `responses` on one core."""
    rec = hs.datasets.table1()
    limits = {"A": (0.01, 0.04), "beta": (0.0, 0.05), "gamma": (-0.02, 0.02), "feedthrough": (0.0, 0.04)}
    sample = hs.Sample(distributions=limits, n=n_laws, method="latin_hypercube")
    sets = {**sample.draw(), "n": n}
    alone = partial(hs.BoucWen.responses, sets, rec.u, reduce="sse", target=rec.y, workers=1)
    run = partial(hs.sweep, hs.response_task(hs.BoucWen(n=n), rec.u, rec.y), sample, workers=2)
    return row(f"laws on Table 1, n = {n:g}", "threads", 2, n_laws, 0, pairs(alone, run, repeats))


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """A client of a dask cluster, its scheduler and workers processes of their own; None without distributed."""
    try:
        from distributed import Client
    except ImportError:
        yield None
        return
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        common = ["--scheduler-file", f"{folder}/scheduler.json", "--host", "127.0.0.1", "--no-dashboard"]
        worker = ["dask_worker", *common, "--nthreads", "1", "--no-nanny", "--local-directory", folder]
        for command in (["dask_scheduler", *common, "--port", "0"], *[worker] * workers):
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{command[0]}", *command[1:]],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)
        client = stack.enter_context(Client(scheduler_file=common[1], timeout=60))
        client.wait_for_workers(workers, timeout=60)
        yield client


def on(executor: Any, workers: int, repeats: int) -> list[Row]:
    """Every kind of task on one executor, and where all workers are there the shortest two against their number."""
    kinds = {
        "microsecond": (scaling_tasks.product, (100, 1_000, 10_000, 100_000)),
        "millisecond in a kernel": (scaling_tasks.millisecond, (20, 200, 2_000)),
        "10 ms in a kernel": (scaling_tasks.ten_milliseconds, (100,)),
        "10 ms with arrays": (scaling_tasks.with_arrays, (100,)),
        "fit": (scaling_tasks.fit, (12,)),
    }
    return [
        measured(kind, task, n_tasks, executor, workers, repeats)
        for kind, (task, numbers) in kinds.items()
        for n_tasks in (numbers if workers == 2 else numbers[-1:])
    ]


def fitted_model(rows: list[Row]) -> Model:
    """Start [s], and costs of a task and of a chunk [s], from the rows of one executor; each row counts alike."""
    alone = np.array([line["loop_seconds"] / line["workers"] for line in rows])
    seconds = np.array([line["seconds"] for line in rows])
    counts = np.array([[1.0, line["tasks"], line["chunks"]] for line in rows])
    start, of_task, of_chunk = nnls(counts / seconds[:, np.newaxis], (seconds - alone) / seconds)[0]
    errors = np.abs(counts @ [start, of_task, of_chunk] + alone - seconds) / seconds
    return {
        "start": float(start),
        "seconds_a_task": float(of_task),
        "seconds_a_chunk": float(of_chunk),
        "median_error_percent": 100.0 * float(np.median(errors)),
    }


def predicted(model: Model, duration: float, workers: float) -> float:
    """Efficiency of a cluster [%]."""
    chunk = max(SHORTEST, workers / MOST_A_SECOND, workers * model["seconds_a_chunk"] / BUSY)
    chunk = max(min(chunk, LONGEST), duration)
    busy = workers * (model["seconds_a_task"] / duration + model["seconds_a_chunk"] / chunk)
    return 100.0 / max(1.0, busy)


def saturated(model: Model, duration: float) -> float:
    """Number of workers at which client and scheduler have no time left."""
    workers = np.geomspace(1.0, 1e7, 7001)
    busy = [predicted(model, duration, each) < 100.0 for each in workers]
    return float(workers[int(np.argmax(busy))])


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        rows = [measured("microsecond", scaling_tasks.product, 20 * k, "threads", 1, 1) for k in (1, 2, 4)]
        fitted_model(rows)
        return [*rows, laws_on_table1(100, 1.0, 1)]
    rows = [line for name in ("threads", "processes") for workers in (1, 2) for line in on(name, workers, REPEATS)]
    for workers in (1, 2):
        with cluster(workers) as client:
            rows += on(client, workers, REPEATS) if client is not None else []
    rows += [stored(100_000, REPEATS), *(laws_on_table1(1_000_000, n, REPEATS) for n in (1.0, 1.5))]
    return write_results(RESULTS, rows, draw, {"cores": os.cpu_count(), **models_of(rows)})


def models_of(rows: list[Row]) -> dict[str, Any]:
    """The model of each executor, and what dask's says of larger clusters."""
    timed = [line for line in rows if line["chunks"]]
    names = dict.fromkeys(line["executor"] for line in timed)
    models = {name: fitted_model([line for line in timed if line["executor"] == name]) for name in names}
    far = models.get("dask", models["processes"])
    return {
        "models": models,
        "predicted_efficiency_percent": [
            {"task_seconds": tau, **{str(workers): predicted(far, tau, workers) for workers in CLUSTERS}}
            for tau in DURATIONS
        ],
        "workers_at_saturation": {f"{tau:g} s": saturated(far, tau) for tau in DURATIONS},
    }


def draw(rows: list[Row]) -> Figure:
    """Overhead against the number of tasks, efficiency of the longer ones, and the model beyond two workers."""
    canvas = figure(height=8.4)
    above, middle, below = canvas.subplots(3)
    short = [line for line in rows if line["kind"] == "microsecond" and line["workers"] == 2]
    for name, style in {"threads": "o-", "processes": "s--", "dask": "^:"}.items():
        chosen = [line for line in short if line["executor"] == name]
        costs = [line["overhead_microseconds"] for line in chosen]
        above.loglog([line["tasks"] for line in chosen], costs, style, label=name)
    above.set(xlabel="Tasks of less than a microsecond", ylabel="Overhead [µs a task]")
    above.legend()
    long = [line for line in rows if line["workers"] == 2 and line["loop_seconds"] > 1.0]
    middle.barh([f"{line['kind']}, {line['executor']}" for line in long], [x["efficiency_percent"] for x in long], 0.6)
    middle.axvline(90.0, color="0.3", linestyle=":")
    middle.set(xlabel="Efficiency of two workers [%]")
    middle.invert_yaxis()
    far = models_of(rows)["models"]
    workers = np.geomspace(1.0, 1e5, 400)
    for tau, dashes in zip(DURATIONS, ("-", "--", "-.", ":"), strict=True):
        model = far.get("dask", far["processes"])
        below.semilogx(workers, [predicted(model, tau, each) for each in workers], dashes, label=f"tasks of {tau:g} s")
    below.set(xlabel="Workers of a cluster (model)", ylabel="Efficiency [%]")
    below.legend()
    return canvas


if __name__ == "__main__":
    for line in main():
        print(
            f"{line['kind']:24} {line['workers']} {line['executor']:10} {line['tasks']:>8} tasks"
            f" {line['seconds']:7.3f} s, efficiency {line['efficiency_percent']:4.0f} %,"
            f" overhead {line['overhead_microseconds']:8.1f} us a task"
        )
