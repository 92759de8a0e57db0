"""On which parameter of a Bouc-Wen law do the width and the area of its loop depend most?

The study is in the file beside this one, and is computed by the command line: 1 024 laws of a Sobol sequence, of each
the last of three cycles of a triangle with 0.5 % of noise on its output. The answer is the rank correlation of each
measure with each parameter.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy import stats

import hysim as hs
from hysim import cli
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "sweep_study"
STUDY = Path(__file__).with_suffix(".toml")
MEASURES = ("width", "area")
Row = dict[str, float | str]


def loop(beta: float, gamma: float, n: float, seed: int) -> dict[str, float]:
    """Width and area of one law's loop, measured with noise."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=80)
    y = hs.BoucWen(beta=beta, gamma=gamma, n=n).response(u)
    noise = 0.005 * np.ptp(y) * np.random.default_rng(seed).standard_normal(u.size)
    measured = hs.loop_metrics(u, y + noise)
    return {"width": measured.max_width, "area": measured.area}


def computed(folder: Path) -> hs.Sweep:
    """The study's table, by way of the command line."""
    store = folder / "loops.sqlite"
    assert cli.main(["sweep", str(STUDY), "--out", str(store)]) == 0
    return hs.load_sweep(store)


def correlations(table: hs.Sweep) -> list[Row]:
    """Rank correlation of each measure with each parameter."""
    return [
        {
            "measure": measure,
            "parameter": name,
            "rank_correlation": float(stats.spearmanr(table[name], table[measure]).statistic),
        }
        for measure in MEASURES
        for name in table.parameters
    ]


def main(smoke: bool = False) -> list[Row]:
    """Compute, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        few = hs.Sample(distributions={"beta": (0.1, 2.0), "gamma": (-0.1, 1.0), "n": (1.0, 3.0)}, n=16)
        return correlations(hs.sweep(loop, few, seed=1))
    with tempfile.TemporaryDirectory() as folder:
        table = computed(Path(folder))
    rows = correlations(table)
    return write_results(RESULTS, rows, lambda _: draw(table), {"n_tasks": len(table)})


def draw(table: hs.Sweep) -> Figure:
    """The width over each parameter."""
    canvas = figure(height=3.4)
    for place, name in enumerate(table.parameters):
        ax = canvas.add_subplot(1, 3, place + 1)
        ax.plot(table[name], table["width"], ".", markersize=2)
        ax.set(xlabel=name, ylabel="" if place else "Width of the loop")
    return canvas


if __name__ == "__main__":
    for row in main():
        print(f"{row['measure']:6} {row['parameter']:6} {row['rank_correlation']:+.2f}")
