"""How many first-order reversal curves predict what a law with a smooth Preisach density does on any other input?

The truth is a bank of relays whose density is a ridge along a - b = 0.4 that fades away from u = 0, on a grid of 80
intervals. Its reversal curves are measured with noise of 0.2 % of the range. From them come three laws: one by reading
the Everett function off the curves, on the levels of all samples; one by least squares with weights of one sign on the
levels at which the curves turn; and one of a smooth density. All are then asked for the output of a random input.

A second question: is the smoothness that the default chooses, from what is left out of the records, the one that
predicts best? Triangles of four sizes, 400 samples each, drive random densities: a ridge of any width from .05 to .8
beside a flat part, with noise of 0 to 1 % of the range. The error on a random input that no fit has seen stands over
that of the best strength of `STRENGTHS`, chosen by this error itself, which no record tells.
"""

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import cpu_timed, write_results

RESULTS = Path(__file__).parent / "results" / "preisach"
CURVES = (4, 6, 8, 10, 12)
NOISE = 0.002  # of the range
SAMPLES = 120  # from the lowest input to the highest
SEEN = np.array([-1.0, 0.8, -0.6, 0.5, -0.3, 0.2])  # turning points of the input that is drawn
SIZES = (0.25, 0.5, 0.75, 1.0)  # of the triangles
N_DENSITIES, SAMPLES_OF_SIZE = 30, 400
NOISES = (0.0, 0.001, 0.01)  # of the range
STRENGTHS = 10.0 ** np.arange(-10.0, 4.5, 1.0 / 1.5)  # every second one of those that the default chooses from
Row = dict[str, Any]


def density(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of the relays (a, b) per area."""
    return np.exp(-(((a - b - 0.4) / 0.3) ** 2) - (a + b) ** 2 / 2.0)


TRUTH = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 81), density)


def row(curves: int, seeds: int) -> Row:
    """Root mean square error of the laws on a random input, in percent of the range, over the noise's seeds."""
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=curves, samples_per_step=SAMPLES // curves)
    walk = np.append(-1.0, np.random.default_rng(0).uniform(-1.0, 1.0, 500))
    y, wanted = TRUTH.response(u), TRUTH.response(walk)
    scale = float(np.ptp(y))
    errors = []
    for seed in range(seeds):
        noise = NOISE * scale * np.random.default_rng(1 + seed).normal(size=u.size)
        record = hs.Record(u=u, y=y + noise)
        read = hs.Preisach.from_reversal_curves(record)
        fitted = hs.identify(hs.Preisach.structure(levels=np.linspace(-1.0, 1.0, curves + 1)), record).model
        smooth = hs.Preisach.smoothed(record)
        errors.append([100.0 * np.std(law.response(walk) - wanted) / scale for law in (read, fitted, smooth)])
    by_reading, by_fitting, by_smoothing = np.median(errors, axis=0).tolist()
    return {
        "curves": curves,
        "weights": curves * (curves + 1) // 2,
        "samples": u.size,
        "read_error_percent": by_reading,
        "fitted_error_percent": by_fitting,
        "smooth_error_percent": by_smoothing,
        "worst_smooth_error_percent": float(np.max(errors, axis=0)[2]),
    }


def smoothness(seed: int, strengths: NDArray[np.float64] = STRENGTHS, samples: int = SAMPLES_OF_SIZE) -> Row:
    """Error with the smoothness that the default chooses over that with the best one, for one random density."""
    rng = np.random.default_rng([23, seed])
    width = 10.0 ** rng.uniform(np.log10(0.05), np.log10(0.8))
    place, flat = rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.3)
    noise = NOISES[seed % len(NOISES)]

    def ridge(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return flat + np.exp(-(((a - b - place) / width) ** 2) - (a + b) ** 2 / 2.0)

    truth = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 161), ridge)
    records = []
    for size in SIZES:
        u = hs.signals.triangle(-size, size, cycles=2, samples_per_cycle=samples // 2)[:samples]
        y = truth.response(u)
        records.append(hs.Record(u=u, y=y + noise * np.ptp(y) * rng.normal(size=u.size)))
    walk = np.append(-1.0, rng.uniform(-1.0, 1.0, 500))
    wanted = truth.response(walk)

    def error(law: hs.Preisach) -> float:
        return float(np.std(law.response(walk) - wanted) / np.ptp(wanted))

    chosen, seconds = cpu_timed(hs.Preisach.smoothed, records)
    own = error(chosen)
    best = min(own, *(error(hs.Preisach.smoothed(records, strength=float(each))) for each in strengths))
    return {"seed": seed, "width": width, "noise": noise, "seconds": seconds, "error_percent": 100.0 * own,
            "over_best_strength": own / best}  # fmt: skip


def main(smoke: bool = False) -> list[Row]:
    """Measure, identify and predict; print the table and write it."""
    rows = [row(curves, 1 if smoke else 5) for curves in (CURVES[:1] if smoke else CURVES)]
    for line in rows:
        print(
            f"{line['curves']:>3} curves, {line['weights']:>3} weights: read {line['read_error_percent']:.2f} %, "
            f"fitted {line['fitted_error_percent']:.2f} %, smooth {line['smooth_error_percent']:.2f} % of the range"
        )
    chosen = [smoothness(0, STRENGTHS[:1], 100)] if smoke else [smoothness(seed) for seed in range(N_DENSITIES)]
    for line in chosen:
        print(
            f"ridge {line['width']:.2f} wide, noise {100 * line['noise']:.1f} %: chosen in {line['seconds']:.2f} s, "
            f"{line['error_percent']:.3f} % wrong, {line['over_best_strength']:.2f} times the best strength"
        )
    return write_results(RESULTS, rows, draw, {"noise": NOISE, "smoothness": chosen}, smoke=smoke)


def draw(_: list[Row]) -> Figure:
    """The relays' plane with the staircase that an input has left, beside the loops of that input."""
    canvas = figure(height=3.4)
    plane, loop = canvas.subplots(1, 2)
    edges = np.linspace(-1.0, 1.0, 41)
    centre = 0.5 * (edges[:-1] + edges[1:])
    b, a = np.meshgrid(centre, centre)
    weight = np.ma.masked_where(a < b, density(a, b))
    plane.contourf(centre, centre, weight, levels=8, cmap="Greys", vmax=1.6 * weight.max())
    plane.plot([-1.0, 1.0], [-1.0, 1.0], color="#777777", linewidth=0.8)
    staircase = TRUTH.staircase(SEEN)
    plane.plot(staircase[:, 1], staircase[:, 0], color="#D55E00")
    plane.annotate("up", (-0.95, -0.55))
    plane.annotate("down", (-0.95, 0.87))
    plane.set(xlim=(-1, 1), ylim=(-1, 1), xlabel="Lower threshold b", ylabel="Upper threshold a", aspect="equal")
    u = np.concatenate([np.linspace(*pair, 60) for pair in itertools.pairwise(SEEN)])
    loop.plot(u, TRUTH.response(u), color="#0072B2")
    loop.plot(SEEN, TRUTH.response(SEEN), "o", color="#D55E00", markersize=4)
    loop.set(xlabel="Input u", ylabel="Output y")
    return canvas


if __name__ == "__main__":
    main()
