"""What does a study lose that is killed twenty times?

A process computes a study with two threads and a store, and is killed with SIGKILL at a random moment after it has
begun; then the next one goes on. In the end the table is compared, to the bit, with that of a study that nobody
disturbed. Every task notes that it was computed, so that what was computed twice can be counted.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "kill_and_resume"
N_TASKS = 1500
NOTES = "HYSIM_EXPERIMENT_NOTES"
Row = dict[str, float]


def task(k: int, seed: int) -> dict[str, object]:
    """Some milliseconds of random numbers, and a note that task k was computed."""
    path = np.random.default_rng(seed).standard_normal(100_000).cumsum()
    if NOTES in os.environ:
        with open(os.environ[NOTES], "a", encoding="ascii") as notes:
            notes.write(f"{k}\n")
    return {"largest": path.max(), "last": path[-1], "path": path[::10_000]}


def killed(n_tasks: int, folder: Path, delay: float) -> bool:
    """Go on with the study in a process and kill it `delay` seconds after it has begun; whether it was in time."""
    environment = {**os.environ, NOTES: str(folder / "notes")}
    arguments = [sys.executable, __file__, str(n_tasks), str(folder / "study.sqlite")]
    with subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE) as child:
        child.stdout.readline()
        try:
            child.wait(delay)
        except subprocess.TimeoutExpired:
            child.kill()
    return child.returncode == -signal.SIGKILL


def differences(table: hs.Sweep, other: hs.Sweep) -> int:
    """Number of columns, but for the seconds, that are not the same to the bit."""
    names = [*table.parameters, *table.outputs, *table.arrays, "seed"]
    differing = sum(table[name].tobytes() != other[name].tobytes() for name in names)
    return differing + (table.errors != other.errors) + (table.task.tolist() != other.task.tolist())


def kills(n_kills: int, n_tasks: int, longest: float) -> tuple[list[Row], int]:
    """What was there after each kill, and how many columns differ in the end."""
    rng, rows = np.random.default_rng(0), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(n_kills):
            delay = rng.uniform(0.0, longest)
            in_time = killed(n_tasks, folder, delay)
            kept = hs.load_sweep(folder / "study.sqlite")
            computed = len((folder / "notes").read_text().split()) if (folder / "notes").exists() else 0
            rows.append(
                {
                    "kill": k + 1,
                    "in_time": float(in_time),
                    "seconds": delay,
                    "kept": len(kept),
                    "computed_twice": computed - len(kept),
                }
            )
        resumed = hs.sweep(task, {"k": range(n_tasks)}, seed=1, store=folder / "study.sqlite")
    return rows, differences(resumed, hs.sweep(task, {"k": range(n_tasks)}, seed=1))


def main(smoke: bool = False) -> list[Row]:
    """Kill and go on, and unless it is a smoke run write table, figure and JSON."""
    rows, n_differences = kills(1, 60, 0.02) if smoke else kills(20, N_TASKS, 0.3)
    assert n_differences == 0
    if not smoke:
        assert all(row["in_time"] for row in rows)
        write_results(RESULTS, rows, draw, {"columns_that_differ": n_differences, "n_tasks": N_TASKS})
    return rows


def draw(rows: list[Row]) -> Figure:
    """Rows kept and tasks computed again, after each kill."""
    canvas, ax = one_panel(3.4)
    for name, label in (("kept", "rows kept"), ("computed_twice", "tasks computed again, all kills so far")):
        ax.step([row["kill"] for row in rows], [row[name] for row in rows], where="mid", label=label)
    ax.set(xlabel="Kill", ylabel="Tasks")
    ax.legend()
    return canvas


def compute(n_tasks: int, store: str) -> None:
    """The study in a process that is to be killed; it says when it begins."""
    began = []

    def say(done: int, total: int) -> None:
        if not began:
            began.append(done)
            print("begun", flush=True)

    hs.sweep(task, {"k": range(n_tasks)}, seed=1, workers=2, store=store, progress=say)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        compute(int(sys.argv[1]), sys.argv[2])
    else:
        print(json.dumps(main()[-1]))
