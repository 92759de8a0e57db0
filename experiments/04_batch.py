"""How fast is a batch, and how does the cost grow? One law over longer and longer inputs, and more and more laws.

The throughput is that of 100 000 laws on a 52-point staircase: n = 1, n = 2, one other n, 64 values of n, all n
different; as rows, and reduced to the sum of squares. The growth is measured from 1e3 to 1e7 samples of one law and
from 1 to 1e6 laws, whose rows are never held together. Sums of 16 to 1024 plays run on a sine, on a sine with noise of
1 % and on noise alone, beside a loop of the law's step, which clamps all plays at each sample. Times are medians over
repeats in one run, with the spread between the quartiles; beside them that of `np.exp` on as many numbers. A law is
identified on a million noisy samples in a process of its own, for its largest memory.
"""

import multiprocessing
import resource
import statistics
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.models.law import Law
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "batch"
Row = dict[str, float | str]
each_step = Law.path.__func__  # which is that of every law without a path of its own


def staircase() -> np.ndarray:
    """The 52 voltages of the paper's first table, over a span of 2."""
    u = hs.datasets.table1().u
    return 2.0 * u / np.ptp(u)


def two_tone(n_samples: int) -> np.ndarray:
    """Two sines of incommensurate frequencies, 1 000 samples in each unit of time."""
    t = np.arange(n_samples) / 1000.0
    return np.sin(2.1 * t) + 0.6 * np.sin(7.3 * t)


def laws(n_sets: int, exponents: str) -> dict[str, np.ndarray]:
    """Random laws of class I or II."""
    rng = np.random.default_rng(0)
    few = rng.choice(rng.uniform(0.5, 5.0, 64), n_sets)
    n = {"1": 1.0, "2": 2.0, "1.5": 1.5, "64 values": few, "all differ": rng.uniform(0.5, 5.0, n_sets)}[exponents]
    return {
        "A": rng.uniform(0.5, 2.0, n_sets),
        "beta": rng.uniform(0.2, 2.0, n_sets),
        "gamma": rng.uniform(-0.2, 1.0, n_sets),
        "n": np.broadcast_to(n, n_sets),
    }


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Median time and the distance between its quartiles [s], the first call not counted."""
    work()
    times = []
    for _ in range(max(2, repeats)):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    low, _, high = statistics.quantiles(times, n=4, method="inclusive")
    return statistics.median(times), high - low


def row(kind: str, law: str, n_sets: int, n_samples: int, time_and_spread: tuple[float, float]) -> Row:
    """One measurement, beside `np.exp` on as many numbers."""
    seconds, spread = time_and_spread
    size = n_sets * n_samples
    numbers = np.linspace(-1.0, 1.0, min(size, 1_000_000))
    exponential = timed(lambda: np.exp(numbers), 5)[0] / numbers.size
    return {
        "kind": kind,
        "law": law,
        "sets": n_sets,
        "samples": n_samples,
        "seconds": seconds,
        "spread": spread,
        "million_samples_per_second": size / seconds / 1e6,
        "times_exp": seconds / size / exponential,
    }


def throughput(n_sets: int, repeats: int) -> list[Row]:
    """Rows and sums of squares of many laws on the staircase."""
    u, rows = staircase(), []
    target = hs.BoucWen().response(u)
    for exponents in ("1", "2", "1.5", "64 values", "all differ"):
        sets = laws(n_sets, exponents)
        plain = timed(lambda sets=sets: hs.BoucWen.responses(sets, u), repeats)
        rows.append(row("rows", f"n: {exponents}", n_sets, u.size, plain))
        sse = timed(lambda sets=sets: hs.BoucWen.responses(sets, u, reduce="sse", target=target), repeats)
        rows.append(row("sse", f"n: {exponents}", n_sets, u.size, sse))
    return rows


def growth(most_samples: int, most_sets: int, repeats: int) -> list[Row]:
    """One law on longer inputs, and more laws on the staircase."""
    rows = []
    for exponents in ("1", "1.5"):
        law = hs.BoucWen(beta=0.6, gamma=0.3, n=float(exponents))
        for n_samples in 10 ** np.arange(3, 1 + round(np.log10(most_samples))):
            u = two_tone(int(n_samples))
            rows.append(
                row("samples", f"n: {exponents}", 1, u.size, timed(lambda law=law, u=u: law.response(u), repeats))
            )
        u = staircase()
        for n_sets in 10 ** np.arange(0, 1 + round(np.log10(most_sets))):
            sets = laws(int(n_sets), exponents)
            final = timed(lambda sets=sets, u=u: hs.BoucWen.responses(sets, u, reduce="final"), repeats)
            rows.append(row("sets", f"n: {exponents}", int(n_sets), u.size, final))
    return rows


def many_plays(n_samples: int, repeats: int) -> list[Row]:
    """One sum of plays, and a loop of its step."""
    rng, rows = np.random.default_rng(0), []
    sine, noise = np.sin(np.arange(n_samples) / 300.0), rng.standard_normal(n_samples)
    inputs = {"sine": sine, "sine and noise": sine + 0.01 * noise, "noise": 0.5 * noise}
    for count in (16, 64, 256, 1024):
        thresholds, weights = np.linspace(0.0, 1.0, count, endpoint=False), rng.uniform(0.1, 1.0, count) / count
        law = hs.PrandtlIshlinskii(thresholds=tuple(thresholds), weights=tuple(weights))
        for name, u in inputs.items():
            y = np.empty(n_samples)
            seconds = timed(lambda law=law, u=u: law.response(u), repeats)
            rows.append(row("path", f"{count} plays, {name}", 1, n_samples, seconds))
            steps = timed(lambda law=law, u=u, y=y: each_step(type(law), law.compiled(u[0]), u, y), repeats)
            rows.append(row("steps", f"{count} plays, {name}", 1, n_samples, steps))
    return rows


def long_fit(n_samples: int) -> dict[str, float]:
    """CPU seconds of a fit of so many noisy samples, compiled before; memory of the process before and at most [MB]."""
    u = two_tone(n_samples)
    y = hs.BoucWen(beta=0.6, gamma=0.3).response(u)
    record = hs.Record(u=u, y=y + 1e-3 * np.random.default_rng(0).standard_normal(u.size))
    hs.identify(hs.BoucWen, record[: n_samples // 500])
    before, begin = resource.getrusage(resource.RUSAGE_SELF), time.process_time()
    hs.identify(hs.BoucWen, record)
    after = resource.getrusage(resource.RUSAGE_SELF)
    megabytes = {"before": before.ru_maxrss / 1024.0, "at_most": after.ru_maxrss / 1024.0}
    return {"samples": n_samples, "cpu_seconds": time.process_time() - begin, **megabytes}


def alone(n_samples: int) -> dict[str, float]:
    """`long_fit` in a new process."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(long_fit, n_samples).result()


def slopes(rows: list[Row]) -> dict[str, float]:
    """Slopes of log time over log size, by least squares over the sizes beside which a call's own cost is small."""
    fits = {}
    for kind, least in (("samples", 1e4), ("sets", 1e3)):
        for exponents in ("1", "1.5"):
            chosen = [
                line
                for line in rows
                if (line["kind"], line["law"]) == (kind, f"n: {exponents}") and line[kind] >= least
            ]
            sizes, seconds = (np.log([line[name] for line in chosen]) for name in (kind, "seconds"))
            fits[f"{kind}, n = {exponents}"] = float(np.polyfit(sizes, seconds, 1)[0])
    return fits


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        long_fit(25_000)
        return throughput(500, 1) + growth(1000, 10, 1) + many_plays(100, 1)
    fitted = alone(10**6)  # before this process is large: its largest memory would count
    rows = throughput(100_000, 7) + growth(10**7, 10**6, 5) + many_plays(100_000, 7)
    write_results(RESULTS, rows, draw, {"slopes": slopes(rows), "long_fit": fitted})
    return rows


def draw(rows: list[Row]) -> Figure:
    """Time against the number of samples, and of sets, with lines of slope 1."""
    canvas = figure(height=4.4)
    for place, kind in enumerate(("samples", "sets")):
        ax = canvas.add_subplot(1, 2, place + 1)
        for exponents, marker in (("1", "o"), ("1.5", "s")):
            chosen = [line for line in rows if line["kind"] == kind and line["law"] == f"n: {exponents}"]
            sizes, seconds = ([float(line[name]) for line in chosen] for name in (kind, "seconds"))
            (points,) = ax.loglog(sizes, seconds, marker, label=f"n = {exponents}")
            ax.loglog(sizes, [seconds[-1] * size / sizes[-1] for size in sizes], "-", color=points.get_color(), lw=0.8)
        ax.set(xlabel=f"Number of {kind}", ylabel="Time [s]")
        ax.set_title("One law" if kind == "samples" else "52 samples each")
        ax.legend(loc="upper left")
    return canvas


if __name__ == "__main__":
    for line in main():
        print(
            f"{line['kind']:8} {line['law']:26} {line['sets']:>8} sets x {line['samples']:>8} samples"
            f" {line['million_samples_per_second']:8.1f} million samples a second"
            f" +- {100 * float(line['spread']) / float(line['seconds']):.0f} %, {line['times_exp']:.1f} times np.exp"
        )
