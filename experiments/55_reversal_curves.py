"""Are first-order reversal curves predicted that were left out, and is their density the true one?

Every fifth curve is left out. The law of the others, `hs.Preisach.from_reversal_curves(..., smoothing="auto")`, is
compared at its samples with a polynomial of the second degree by least squares around each of them, over four
distances of curves, as the field does by hand. Simulated curves are those of two ridges, one narrow, with noise in
parts of the range; the density of `hs.forc` stands beside the true one, and beside the best of seven fixed smoothings.
Measured ones are files of a magnetometer in a folder that the command names; their density stands beside that of the
polynomial:

    python experiments/55_reversal_curves.py [FOLDER]
"""

import itertools
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "reversal_curves"
NOISES = (0.0, 1e-4, 1e-3, 5e-3)  # of the range
CURVES, EVERY = 80, 5
REACH = 4.0  # distances of curves: a smoothing factor of 3
FROM_DIAGONAL = 1.5  # distances of curves, within which a density is of one side only
SMOOTHINGS = (1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)
Row = dict[str, Any]
Array = NDArray[np.float64]


def density(a: Array, b: Array) -> Array:
    """Weight of relays per area."""
    return np.exp(-20.0 * (a + b) ** 2 - 8.0 * (a - b - 0.6) ** 2) + 0.3 * np.exp(-3.0 * (a - b - 1.0) ** 2)


def simulated(noise: float, curves: int) -> hs.Record:
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=curves, samples_per_step=2)
    y = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 2 * curves + 1), density).response(u)
    return hs.Record(u=u, y=y + noise * np.ptp(y) * np.random.default_rng(0).standard_normal(u.size))


def by_regression(known: Array, a: Array, b: Array, spacing: float) -> tuple[Array, Array]:
    """Outputs and densities at (a, b) from rows (turning point, input, output)."""
    found = []
    for x, z in zip(a, b, strict=True):
        p, q = (known[:, 0] - x) / (REACH * spacing), (known[:, 1] - z) / (REACH * spacing)
        near = (np.abs(p) < 1.0) & (np.abs(q) < 1.0)
        p, q = p[near], q[near]
        root = ((1.0 - np.abs(p) ** 3) * (1.0 - np.abs(q) ** 3)) ** 1.5
        columns = np.stack([np.ones(p.size), p, q, p * p, p * q, q * q], axis=1)
        best = np.linalg.lstsq(columns * root[:, np.newaxis], known[near, 2] * root, rcond=1e-10)[0]
        found.append((best[0], 0.5 * best[4] / (REACH * spacing) ** 2))
    return tuple(np.array(found).T)  # type: ignore[return-value]


def curves_of(record: hs.Record) -> list[tuple[hs.Record, hs.Record]]:
    """Rises and falls, of a record turned by 180 degrees where its curves rise."""
    up = record if record.u[0] < record.u.mean() else hs.Record(u=-record.u, y=-record.y)
    parts = up.branches(1e-3)
    return [(rise, fall) for rise, fall in itertools.pairwise(parts) if fall.u[0] > fall.u[-1]]


def row(name: str, record: hs.Record, is_true: bool = False) -> Row:
    """Errors at curves left out, over the range of outputs, and correlations of densities."""
    begin = time.process_time()
    diagram = hs.forc(record)
    seconds = time.process_time() - begin
    curves, size = curves_of(record), diagram.stroke
    rest = [part for k, pair in enumerate(curves) if k % EVERY != 2 for part in pair]
    sign = 1.0 if record.u[0] < record.u.mean() else -1.0
    path = hs.Record(u=np.concatenate([part.u for part in rest]), y=np.concatenate([part.y for part in rest]))
    law = hs.Preisach.from_reversal_curves(hs.Record(u=sign * path.u, y=sign * path.y), smoothing="auto")
    spacing = float(np.median(np.diff(sorted(fall.u[0] for _, fall in curves))))
    jumps = [len(fall) - (fall.u[-2] - fall.u[-1] > 3.0 * spacing) for _, fall in curves]
    every = [
        np.stack([np.full(n, fall.u[0]), fall.u[:n], fall.y[:n]], axis=1)
        for (_, fall), n in zip(curves, jumps, strict=True)
    ]
    known = np.concatenate([curve for k, curve in enumerate(every) if k % EVERY != 2])
    errors: list[Array] = []
    for a, b, y in (curve.T for curve in every[2 : len(every) - 1 : EVERY]):
        of_law = law.response(sign * np.append(path.u.min(), b))[1:] * sign
        found = (of_law, by_regression(known, a, b, spacing)[0])
        errors.append(np.array([(each - each[0] - y + y[0]) / size for each in found]))
    of_law, of_regression = np.sqrt(np.mean(np.concatenate(errors, axis=1) ** 2, axis=1)).tolist()
    a, b = np.meshgrid(diagram.levels, diagram.levels, indexing="ij")
    rows, columns = np.nonzero(np.isfinite(diagram.density) & (a - b > FROM_DIAGONAL * spacing))
    a, b = diagram.levels[rows], diagram.levels[columns]
    turned = (a, b) if sign > 0.0 else (-b, -a)
    beside = density(a, b) if is_true else by_regression(np.concatenate(every), *turned, spacing)[1]
    reached = {"correlation": float(np.corrcoef(diagram.density[rows, columns], beside)[0, 1])}
    if is_true:
        fixed = [hs.forc(record, smoothing=s).density[rows, columns] for s in SMOOTHINGS]
        reached["best_correlation"] = max(float(np.corrcoef(each, beside)[0, 1]) for each in fixed)
    return {
        "record": name,
        "curves": len(curves),
        "smoothing": diagram.smoothing,
        "growth": diagram.growth,
        "law_error_percent": 100.0 * of_law,
        "regression_error_percent": 100.0 * of_regression,
        "ratio": of_law / of_regression,
        **reached,
        "drift_percent": 100.0 * diagram.drift / size,
        "seconds": seconds,
    }


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """All records; unless it is a smoke run, write table, figure and result."""
    if smoke:
        return [row("simulated", simulated(1e-3, 12), is_true=True)]
    rows = [row(f"simulated, noise {100.0 * noise:g} %", simulated(noise, CURVES), is_true=True) for noise in NOISES]
    files = [] if folder is None else sorted((folder / "forc").glob("*.forc"))
    measured = {file.stem: hs.load(file) for file in files}
    rows += [row(name, record) for name, record in measured.items()]
    worst = {
        "worst_ratio": max(each["ratio"] for each in rows),
        "least_correlation": min(each["correlation"] for each in rows),
    }
    return write_results(RESULTS, rows, lambda _: draw(simulated(NOISES[-1], 24)), worst)


def draw(record: hs.Record) -> Figure:
    """The density from the noisiest curves, without smoothing and with it."""
    canvas = figure(height=4.0)
    for ax, smoothing in zip(canvas.subplots(1, 2), (None, "auto"), strict=True):
        hs.plot.forc(record, ax, coordinates="centre", smoothing=smoothing)
    return canvas


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]) if len(sys.argv) > 1 else None)
