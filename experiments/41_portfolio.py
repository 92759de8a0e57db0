"""What do a million buildings in 25 earthquakes cost, and how wrong are they?

2^20 one-storey buildings of four classes, each in 25 synthetic earthquakes of 4 001 samples, are a study in 1 024
shards. Eight shards are computed, each by a process of its own with a store, two at a time. The rest is extrapolated,
which is allowed since every shard covers the portfolio evenly. The stores are merged. From them follow fragility
curves, the share of buildings of a class that reach a state of damage over the peak of the ground acceleration, and the
share of its value that a class loses.

In turns with the shards, OpenSees computes a sample of the same buildings (`uniaxialMaterial BoucWen`, Newmark,
Newton) with one step a sample and with eight, and so does a plain compiled loop of Verlet with hysim's own step. Of
OpenSees the analysis alone is timed, without building its model; of all it is the processor time of one core. The truth
is hysim at a tolerance of 1e-10; that of the other methods is the largest drift at the samples.
"""

import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from subprocess import run
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
import portfolio_tasks as tasks
from peers import structures as peers
from peers.contest import peer
from results_folder import cpu_timed, write_results
from structure_cases import Case

RESULTS = Path(__file__).parent / "results" / "portfolio"
N_BUILDINGS, N_SHARDS, TURNS = 1 << 20, 1024, 4  # two shards in each turn
N_CHECKED, N_SAMPLED = 64, 8  # buildings: of errors, and of the other methods
TOLERANCES = (1e-3, 1e-4, 1e-6)
PGA = tasks.PEAKS / 9.81  # g
Array = np.ndarray
Row = dict[str, Any]


def shard(folder: Path, k: int) -> None:
    """Compute a shard in a process of its own."""
    words = [tasks.__file__, N_BUILDINGS, N_SHARDS, k, folder / f"{k}.sqlite"]
    run([sys.executable, *map(str, words)], check=True)


def some(n: int) -> dict[str, Array]:
    """Springs of the first buildings."""
    return tasks.springs(**{name: values[:n] for name, values in tasks.buildings(N_BUILDINGS).draw().items()})[0]


def cases(n: int, n_samples: int | None) -> list[Case]:
    """The first buildings in all motions, as the other methods take them."""
    columns = {name.rpartition(".")[2]: values.tolist() for name, values in some(n).items()}
    laws = [hs.BoucWen(n=2.0, **dict(zip(columns, each, strict=True))) for each in zip(*columns.values(), strict=True)]
    ends = (1.0,), (0.0,)
    return [
        Case("building", *ends, (((0, 1), law),), (law.gain + law.feedthrough,), a, tasks.SAMPLE_TIME, tasks.DAMPING)
        for law in laws
        for a in tasks.motions(n_samples)
    ]


def others(smoke: bool) -> dict[str, Any]:
    """Of each other method a function of a case, which returns its drifts at the samples, and one of its seconds."""
    methods: dict[str, Any] = {}
    for count in (1, 8):
        drift = partial(peers.plain, loop=peers.verlet, count=count, smoke=smoke)
        methods[f"Verlet, {count} steps a sample"] = drift, lambda case, drift=drift: cpu_timed(drift, case)[1]
    if (ops := peer("openseespy.opensees")) is not None:
        for count in (1, 8):
            options: dict[str, Any] = {"options": peers.OPENSEES["Newmark, Newton"], "count": count}
            two = (partial(each, ops, **options) for each in (peers.opensees_drift, peers.opensees_seconds))
            methods[f"OpenSees, {count} steps a sample"] = tuple(two)
    return methods


def row(method: str, seconds: float, found: Array, truth: Array) -> Row:
    """One method: processor time of a history, and of a million on two cores, and errors of the largest drift."""
    each, errors = seconds / found.size, np.abs(found / truth - 1.0)
    return {
        "method": method,
        "histories": found.size,
        "milliseconds_a_history": 1e3 * each,
        "minutes_a_million": 1e6 * each / 2.0 / 60.0,
        "median_error": float(np.median(errors)),
        "worst_error": float(errors.max()),
    }


def judged(n: int, chosen: list[Case], times: dict[str, list[float]], smoke: bool) -> list[Row]:
    """hysim by its tolerance on n buildings, and the other methods, whose times are given, on the chosen cases."""
    columns, n_samples = some(n), chosen[0].ground.size
    truth, rows = tasks.drifts(columns, 1e-10, n_samples), []
    for tolerance in TOLERANCES:
        found, seconds = cpu_timed(tasks.drifts, columns, tolerance, n_samples)
        rows.append(row(f"hysim, tolerance {tolerance:g}", seconds, found, truth))
    exact = (case.structure(tolerance=1e-10).signals(case.ground, case.sample_time) for case in chosen)
    truth = np.array([np.abs(signals["drift"]).max() for signals in exact])
    for method, (drift, _) in others(smoke).items():
        found = np.array([np.abs(drift(case)).max() for case in chosen])
        rows.append(row(method, float(np.median(times[method])), found, truth))
    return rows


def damages(merged: hs.Sweep) -> Row:
    """By class: the numbers of buildings that reach each state of damage, their curves, and the share that is lost."""
    found: Row = {}
    for k, (name, kind) in enumerate(tasks.KINDS.items()):
        ductility = merged["ductility"][merged["kind"].astype(int) == k]
        reached, n = np.array([(ductility >= limit).sum(axis=0) for limit in kind.limits]), len(ductility)
        curves = [hs.fragility(PGA, state, n) for state in reached]
        loss = np.diff(tasks.SHARES, prepend=0.0) @ reached / n
        medians, dispersions = ([vars(each)[key] for each in curves] for key in ("median", "dispersion"))
        found[name] = {"n": n, "reached": reached.tolist(), "loss": loss.tolist()}
        found[name] |= {"medians": medians, "dispersions": dispersions}
    return found


def main(smoke: bool = False) -> list[Row]:
    """Compute shards and the others in turns, merge, and unless it is a smoke run write table, figure and JSON."""
    chosen, methods = cases(1 if smoke else N_SAMPLED, 60 if smoke else None), others(smoke)
    times = {method: [clock(chosen[0])] for method, (_, clock) in methods.items()}  # compiles
    if smoke:
        return judged(2, chosen, times, smoke)
    turns: list[float] = []
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        for turn in range(TURNS):
            begin = time.perf_counter()
            list(pool.map(partial(shard, Path(name)), (2 * turn, 2 * turn + 1)))
            turns.append(time.perf_counter() - begin)
            times = {method: [*times[method][turn == 0 :], sum(map(methods[method][1], chosen))] for method in methods}
        merged = hs.sweep(tasks.ductility, tasks.buildings(N_BUILDINGS), merge=Path(name).iterdir(), time_limit=0.0)
    numbers = {
        "shards": N_SHARDS,
        "samples": tasks.motions()[0].size,
        "computed_shards": 2 * TURNS,
        "computed_buildings": len(merged),
        "minutes_a_million": [each / 60.0 * 1e6 / (2 * N_BUILDINGS // N_SHARDS * tasks.N_MOTIONS) for each in turns],
        "hours_of_all": float(np.median(turns)) * N_SHARDS / 2.0 / 3600.0,
        "damage": damages(merged),
    }
    return write_results(RESULTS, judged(N_CHECKED, chosen, times, smoke), partial(draw, numbers["damage"]), numbers)


def draw(damage: Row, rows: list[Row]) -> Figure:
    """Fragility curves of the third state of damage, and losses, over the peak of the acceleration; cost and error."""
    canvas = figure(height=8.4)
    above, middle, below = canvas.subplots(3)
    fine = np.geomspace(PGA[0], PGA[-1], 200)
    for k, (name, each) in enumerate(damage.items()):
        z = np.log(fine / each["medians"][2]) / each["dispersions"][2]
        above.semilogx(fine, 100.0 * tasks.stats.norm.cdf(z), color=f"C{k}", label=name)
        above.semilogx(PGA, 100.0 * np.divide(each["reached"][2], each["n"]), ".", color=f"C{k}")
        middle.semilogx(PGA, 100.0 * np.array(each["loss"]), ".-", color=f"C{k}")
    above.set(ylabel="Extensive damage [% of buildings]")
    above.legend()
    middle.set(xlabel="Peak of the ground acceleration [g]", ylabel="Loss [% of the value]")
    for tool, marker in (("hysim", "o"), ("OpenSees", "s"), ("Verlet", "v")):
        chosen = [each for each in rows if each["method"].startswith(tool)]
        x, y = ([each[key] for each in chosen] for key in ("minutes_a_million", "worst_error"))
        below.loglog(x, y, marker + "-", label=tool)
    below.set(xlabel="A million histories on two cores [min]", ylabel="Worst error of the largest drift")
    below.legend()
    return canvas


if __name__ == "__main__":
    for line in main():
        print({name: value if isinstance(value, str) else float(f"{value:.3g}") for name, value in line.items()})
