"""What do a million oscillators in an earthquake cost?

Masses on Bouc-Wen springs (n = 2, post-yield 5 %, damping 2 %) of random period and strength in one synthetic ground
motion of 4 000 samples; the largest drift of each, turning points between the samples included. 20 000 are run and the
time of 1 000 000 is extrapolated, which is allowed if the cost grows in proportion to number and length: the powers are
measured. The truth of 500 of them is the same method at a tolerance of 1e-11. Beside it, in the same run and on as many
threads, a compiled loop of Newmark's constant average acceleration on the exact law, at two lengths of its step.
"""

import math
import resource
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from numba import njit

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "structure_ensembles"
SAMPLE_TIME, N_SAMPLES, N_SETS = 0.02, 4000, 20_000
N_CHECKED = 500
THREADS = 2
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
STRENGTH, POST_YIELD, RATIO = 0.15 * 9.81, 0.05, 0.02
Row = dict[str, float | str]


def ground_motion(n_samples: int = N_SAMPLES) -> np.ndarray:
    """A synthetic earthquake of firm ground."""
    duration = SAMPLE_TIME * (n_samples - 1)
    return hs.signals.ground_motion(3.0, duration=duration, sample_time=SAMPLE_TIME, seed=3)[:n_samples]


def oscillators(n_sets: int) -> dict[str, np.ndarray]:
    """Parameters of random oscillators by name: periods from 0.3 to 2 s, weaker the slower they are."""
    period = np.random.default_rng(0).uniform(0.3, 2.0, n_sets)
    stiffness = (2.0 * math.pi / period) ** 2
    yielding = STRENGTH * np.sqrt(0.5 / period) / stiffness
    return {
        "elements.0.beta": 0.5 / yielding**2,
        "elements.0.gamma": 0.5 / yielding**2,
        "elements.0.gain": (1.0 - POST_YIELD) * stiffness,
        "elements.0.feedthrough": POST_YIELD * stiffness,
    }


def oscillator(tolerance: float) -> hs.Structure:
    """The oscillator that the sets differ from."""
    damping = hs.ModalDamping(ratio=RATIO)
    return hs.shear_frame([1.0], laws=hs.BoucWen(n=2.0), damping=damping, tolerance=tolerance)


def peaks(parameters: dict[str, np.ndarray], a: np.ndarray, tolerance: float) -> np.ndarray:
    """Largest drifts, shape (n_sets,)."""
    return oscillator(tolerance).responses(parameters, a, sample_time=SAMPLE_TIME, workers=THREADS)[:, 0]


@njit(nogil=True, error_model="numpy")
def newmark(stiffness, beta, post, a, substeps, h, out):  # type: ignore[no-untyped-def]
    """Largest drift at the steps, by constant average acceleration and the exact law of n = 2, to rounding."""
    for i in range(out.size):
        k, b = stiffness[i], 2.0 * beta[i]
        damping = 2.0 * RATIO * math.sqrt(k)
        root = math.sqrt(b)
        x = v = z = largest = 0.0
        acceleration = -a[0]
        for s in range(1, a.size):
            for j in range(substeps):
                force = a[s - 1] + (a[s] - a[s - 1]) * (j + 1) / substeps
                dx, last = h * v, math.inf
                for _ in range(30):
                    end_z = z
                    if dx * z < 0.0:  # unloading of the law with beta = gamma is elastic
                        back = min(abs(dx), abs(z))
                        end_z += math.copysign(back, dx)
                        left = math.copysign(abs(dx) - back, dx)
                    else:
                        left = dx
                    if left != 0.0:
                        t = math.tanh(root * left)
                        end_z = (end_z + t / root) / (1.0 + root * end_z * t)
                    slope = post * k + (1.0 - post) * k * (1.0 if dx * end_z < 0.0 else 1.0 - b * end_z * end_z)
                    new_v = 2.0 * dx / h - v
                    new_a = 4.0 * dx / (h * h) - 4.0 * v / h - acceleration
                    miss = new_a + damping * new_v + post * k * (x + dx) + (1.0 - post) * k * end_z + force
                    change = miss / (4.0 / (h * h) + 2.0 * damping / h + slope)
                    dx -= change
                    if abs(change) <= 1e-12 * (abs(x) + abs(dx)) or not abs(change) < last:
                        break
                    last = abs(change)
                x, v, acceleration, z = x + dx, 2.0 * dx / h - v, new_a, end_z
                largest = max(largest, abs(x))
        out[i] = largest


def newmark_peaks(parameters: dict[str, np.ndarray], a: np.ndarray, substeps: int) -> np.ndarray:
    """As `peaks`, by the compiled loop, on as many threads."""
    stiffness = parameters["elements.0.gain"] / (1.0 - POST_YIELD)
    out = np.empty(stiffness.size)
    edges = np.linspace(0, out.size, THREADS + 1).astype(int).tolist()

    def work(begin: int, end: int) -> None:
        beta = parameters["elements.0.beta"][begin:end]
        newmark(stiffness[begin:end], beta, POST_YIELD, a, substeps, SAMPLE_TIME / substeps, out[begin:end])

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(work, edges[:-1], edges[1:]))
    return out


def timed(work, repeats: int) -> tuple[float, float, np.ndarray]:  # type: ignore[no-untyped-def]
    """Median time [s], processor time of that many threads [s], and the result."""
    walls, cpus = [], []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return float(np.median(walls)), float(np.median(cpus)), result


def row(method: str, seconds: float, cpu: float, n_sets: int, n_samples: int, errors: np.ndarray) -> Row:
    """One measurement; `million_minutes` is the time of 1 000 000 oscillators on 4 000 samples."""
    each = seconds / (n_sets * n_samples)
    return {
        "method": method,
        "sets": n_sets,
        "samples": n_samples,
        "seconds": seconds,
        "cpu_seconds": cpu,
        "ns_per_oscillator_sample": each * 1e9,
        "million_minutes": each * 1e6 * 4000 / 60.0,
        "median_error": float(np.median(errors)),
        "worst_error": float(errors.max()),
    }


def measure(n_sets: int, n_samples: int, n_checked: int, repeats: int) -> list[Row]:
    """All methods in turn on the same oscillators."""
    a, sets = ground_motion(n_samples), oscillators(n_sets)
    few = {name: values[:n_checked] for name, values in sets.items()}
    truth = peaks(few, a, 1e-11)
    methods = {f"hysim, tolerance {each:g}": partial(peaks, tolerance=each) for each in TOLERANCES}
    methods |= {f"Newmark, {count} steps a sample": partial(newmark_peaks, substeps=count) for count in (1, 8)}
    rows = []
    for method, run in methods.items():
        run(few, a[:100])
        seconds, cpu, found = timed(partial(run, sets, a), repeats)
        errors = np.abs(found[:n_checked] / truth - 1.0)
        rows.append(row(method, seconds, cpu, n_sets, n_samples, errors))
    return rows


def growth(n_sets: int, n_samples: int, repeats: int) -> dict[str, float]:
    """Powers of the time by number and length, and the further memory [MB] that four times as many oscillators take."""
    a, sets = ground_motion(n_samples), oscillators(n_sets)
    part = {name: values[: n_sets // 4] for name, values in sets.items()}
    peaks(oscillators(4), a[:100], 1e-5)  # compiles
    quarter, _, _ = timed(lambda: peaks(part, a, 1e-5), repeats)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    whole, _, _ = timed(lambda: peaks(sets, a, 1e-5), repeats)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    short, _, _ = timed(lambda: peaks(sets, a[: n_samples // 4], 1e-5), repeats)
    return {
        "power_of_number": math.log(whole / quarter) / math.log(4.0),
        "power_of_length": math.log(whole / short) / math.log(n_samples / (n_samples // 4)),
        "further_memory_mb": (after - before) / 1024.0,
        "sets": n_sets,
    }


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    grown = growth(16, 80, 1) if smoke else growth(N_SETS, N_SAMPLES, 1)
    rows = measure(8, 80, 4, 1) if smoke else measure(N_SETS, N_SAMPLES, N_CHECKED, 1)
    if not smoke:
        write_results(RESULTS, rows, draw, {"growth": grown, "threads": THREADS, "checked": N_CHECKED})
        print(", ".join(f"{name} {value:.3g}" for name, value in grown.items()))
    return rows


def draw(rows: list[Row]) -> Figure:
    """Error over cost."""
    canvas, ax = one_panel(3.6)
    for method, marker in (("hysim", "o"), ("Newmark", "s")):
        chosen = [line for line in rows if str(line["method"]).startswith(method)]
        for name, style in (("median_error", "-"), ("worst_error", "--")):
            label = f"{method}, {name.removesuffix('_error')}"
            x, y = ([float(line[key]) for line in chosen] for key in ("million_minutes", name))
            ax.loglog(x, y, style, marker=marker, label=label, color="C0" if method == "hysim" else "C1")
    ax.set(xlabel="Time of a million oscillators, 4 000 samples [min]", ylabel="Relative error of the largest drift")
    ax.legend()
    return canvas


if __name__ == "__main__":
    for line in main():
        print(
            f"{line['method']:26} {line['ns_per_oscillator_sample']:7.0f} ns, a million in "
            f"{line['million_minutes']:6.1f} min ({line['cpu_seconds'] / line['seconds']:.1f} threads), "
            f"error {line['median_error']:.1e} in the median, {line['worst_error']:.1e} at worst"
        )
