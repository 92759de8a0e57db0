"""What does a study lose that is divided into twenty shards that are killed several times?

Each shard is the command ``hysim sweep 57_shards.toml --shard K/20`` in a process of its own, two at a time. It is
killed with SIGKILL at a random moment after its store is there, and begun again, three times at most; then it may end.
In the end the command merges the stores. The table is compared, to the bit, with that of a study that was not divided
and that nobody disturbed. Every task notes that it was computed, so that what was computed twice can be counted.

Beside it stand the memory of a process that computes a million tasks with two numbers each, with a store; and the time
of a sweep on two processes over that of the same calls, which these two processes share without a sweep, in turns.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
import scaling_tasks
from results_folder import one_panel, wall_timed, write_results

RESULTS = Path(__file__).parent / "results" / "shards"
STUDY = Path(__file__).with_suffix(".toml")
N_SHARDS, KILLS, LATEST = 20, 3, 1.5  # s after a store is there
MANY = 1_000_000
SHARED = (
    (scaling_tasks.two_seconds, 40, 3),
    (scaling_tasks.millisecond, 60_000, 5),
)  # tasks, their number, and repeats
NOTES = "HYSIM_EXPERIMENT_NOTES"
Row = dict[str, Any]


def task(k: float, seed: int) -> dict[str, object]:
    """Some 20 ms of random numbers, and a note that task k was computed."""
    path = np.random.default_rng(seed).standard_normal(1_000_000).cumsum()
    if NOTES in os.environ:
        with open(os.environ[NOTES], "a", encoding="ascii") as notes:
            notes.write(f"{k}\n")
    return {"largest": path.max(), "last": path[-1], "path": path[::100_000]}


def killed(folder: Path, k: int, n: int, delay: float | None) -> bool:
    """Run a shard of the study, and kill it so long after it has opened its store; whether that was in time."""
    store, begin = folder / f"walks.{k:0{len(str(n - 1))}d}-of-{n}.sqlite", time.time()
    words = ["sweep", str(STUDY), "--out", str(folder / "walks.sqlite"), "--shard", f"{k}/{n}", "--workers", "1"]
    environment = {**os.environ, NOTES: str(folder / f"{k}.notes")}
    with subprocess.Popen([sys.executable, "-m", "hysim", *words], env=environment, stdout=subprocess.DEVNULL) as child:
        while child.poll() is None and not (store.exists() and store.stat().st_mtime > begin):
            time.sleep(0.01)
        try:
            child.wait(delay)
        except subprocess.TimeoutExpired:
            child.kill()
    return child.returncode < 0


def shard(folder: Path, n: int, most_kills: int, k: int) -> Row:
    """One shard, killed and begun again until it ends."""
    rng, kills = np.random.default_rng(k), 0
    while kills < most_kills and killed(folder, k, n, rng.uniform(0.0, LATEST)):
        kills += 1
    if kills == most_kills:
        killed(folder, k, n, None)
    computed = (folder / f"{k}.notes").read_text().split()
    return {"shard": k, "kills": kills, "tasks": len({*computed}), "computed_twice": len(computed) - len({*computed})}


def differences(table: hs.Sweep, other: hs.Sweep) -> int:
    """Number of columns, but for the seconds, that are not the same to the bit."""
    names = [*table.parameters, *table.outputs, *table.arrays, "seed"]
    differing = sum(table[name].tobytes() != other[name].tobytes() for name in names)
    return differing + (table.errors != other.errors) + (table.task.tolist() != other.task.tolist())


def megabytes(n_tasks: int) -> float:
    """Most memory of a process with a study of so many tasks and a store."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "scaling_tasks.py", str(n_tasks), f"{folder}/many.sqlite"]
        done = subprocess.run(words, cwd=Path(__file__).parent, capture_output=True, text=True, check=True)
    return float(done.stdout)


def shared(task: Callable[..., Any], n_tasks: int, repeats: int) -> Row:
    """Times of two processes that divide these calls, and of a sweep on them [s], and the median of their ratio."""
    space = {"a": [0.5], "b": np.linspace(0.0, 1.0, n_tasks)}
    with ProcessPoolExecutor(2) as pool:
        ways = (
            lambda: list(pool.map(scaling_tasks.loop, 2 * [task], 2 * [n_tasks // 2])),
            lambda: hs.sweep(task, space, executor=pool),
        )
        list(pool.map(task, [0.5] * 4, [0.5] * 4))  # compiles
        plain, swept = zip(*([wall_timed(way)[1] for way in ways] for _ in range(repeats)), strict=True)
    efficiency = 100.0 * float(np.median(np.divide(plain, swept)))
    return {"tasks": n_tasks, "loop_seconds": plain, "sweep_seconds": swept, "efficiency_percent": efficiency}


def main(smoke: bool = False) -> list[Row]:
    """Kill, go on, merge and compare, and unless it is a smoke run write table, figure and JSON."""
    n, most_kills = (300, 1) if smoke else (N_SHARDS, KILLS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with ThreadPoolExecutor(2) as pool:
            rows = list(pool.map(partial(shard, folder, n, most_kills), range(1 if smoke else n)))
        if smoke:
            return [*rows, shared(scaling_tasks.product, 20, 1)]
        words = ["sweep", str(STUDY), "--out", str(folder / "walks.sqlite"), "--merge"]
        subprocess.run([sys.executable, "-m", "hysim", *words], check=True)
        merged = hs.load_sweep(folder / "walks.sqlite")
    whole = hs.sweep(task, {"k": np.arange(len(merged), dtype=float)}, seed=1)
    numbers = {"columns_that_differ": differences(merged, whole), "n_tasks": len(whole), "many": MANY}
    numbers |= {"megabytes_of_many": megabytes(MANY), "shared": [shared(*each) for each in SHARED]}
    return write_results(RESULTS, rows, draw, numbers)


def draw(rows: list[Row]) -> Figure:
    """Kills of each shard, and the tasks that were computed twice for them."""
    canvas, ax = one_panel(3.0)
    for name, label in (("kills", "kills"), ("computed_twice", "tasks computed twice")):
        ax.plot([row["shard"] for row in rows], [row[name] for row in rows], "o", label=label)
    ax.set(xlabel="Shard", ylabel="Number", xticks=range(0, len(rows), 5))
    canvas.legend(loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    print(json.dumps(main()[-1]))
