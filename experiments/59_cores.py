"""How well is the field of a core predicted from its flux density, and the voltage of a cell from its charge?

Sequences of cores are simulated as power converters drive them: sines, triangles and trapezoids of changing amplitude
with a bias, at 16 MHz and four temperatures. A core is one that hysim fits by another law: cells of dry friction whose
saturation and pinning forces fall with the temperature, eddy currents, excess losses, and noise of 2 % of the rms
field. Its five numbers differ from sequence to sequence by a normal factor. 40 sequences are fitted. Of 20 others the
first tenth is known, and the rest is predicted. The error is the relative one of a sequence; that of the noise alone
is 2 %. Beside it: the law without the update, and the law without lags, which is static.

Cells are simulated with random branches, rates and noise; the law is identified from two partial cycles and predicts a
third one, whose initial state alone is fitted.

``python experiments/59_cores.py FOLDER`` takes measured data that are not part of hysim. Sequences in the layout of the
MagNet Challenge 2 are files with one sequence a row and no header, NAME_B.csv [T], NAME_H.csv [A/m] and NAME_T.csv
[degC], sampled at 16 MHz; every third row is predicted. Otherwise it is the folder of `measured_cores`: one law is
fitted to the loops of all amplitudes of a core, and another to a cell, whose error is relative to the range.
"""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from measured_cores import AMPLITUDES, core_loops
from results_folder import cpu_timed, median_and_worst, stored_result, write_files, write_results

RESULTS = Path(__file__).parent / "results" / "cores"
STEP, SAMPLES, FITTED, PREDICTED, NOISE, KNOWN = 62.5e-9, 4000, 40, 20, 0.02, 0.1
DIFFER = 0.0, 0.01, 0.03
CELLS, VOLTS = 100, 1e-3  # simulated cells, and their noise
Row = dict[str, Any]


def waveform(rng: np.random.Generator) -> np.ndarray:
    """Flux density [T]: some periods each of several shapes, amplitudes and frequencies about a bias."""
    largest, bias, parts = rng.uniform(0.03, 0.3), rng.uniform(-0.05, 0.05), list[np.ndarray]()
    while sum(each.size for each in parts) < SAMPLES:
        phase = np.arange(0.0, 1.0, rng.uniform(5e4, 5e5) * STEP)
        shapes = (
            np.sin(2.0 * np.pi * phase),
            np.interp(phase, [0.0, 0.2, 0.8, 1.0], [0.0, 1.0, -1.0, 0.0]),
            np.interp(phase, [0.0, 0.1, 0.25, 0.35, 0.6, 0.75, 0.9, 1.0], [0.0, 1.0, 1.0, 0.3, -1.0, -1.0, -0.3, 0.0]),
        )
        parts.append(np.tile(largest * rng.uniform(0.3, 1.0) * shapes[rng.integers(3)], rng.integers(2, 6)))
    return np.asarray(bias + np.concatenate(parts)[:SAMPLES])


def sequence(rng: np.random.Generator, differ: float) -> hs.Record:
    """A sequence of one core."""
    u, T, factor = waveform(rng), float(rng.choice([25.0, 50.0, 70.0, 90.0])), 1.0 + differ * rng.standard_normal(5)
    pinning = np.linspace(0.0, 40.0, 31)
    share = np.exp(-0.5 * ((pinning - 12.0) / 8.0) ** 2)
    cells = hs.EnergyPlays(
        thresholds=tuple(factor[0] * pinning * (1.0 - 0.005 * (T - 25.0))),
        weights=tuple(factor[1] * 0.48 * (1.0 - 0.003 * (T - 25.0)) * share / share.sum()),
        field=30.0 * factor[2],
        feedthrough=4e-5,
    )
    losses = hs.Dashpot(c=1.5e-5 * factor[3]), hs.ExcessLoss(c=6e-3 * factor[4])
    y = cells.inverse_response(u) + sum(each.response(u, STEP) for each in losses)
    y += NOISE * np.sqrt(np.mean(y**2)) * rng.standard_normal(u.size)
    return hs.Record(u=u, y=y, t=STEP * np.arange(u.size), channels={"T": T})


def predicted(records: Sequence[hs.Record], others: Sequence[hs.Record]) -> list[Row]:
    """Relative errors [%] over other sequences, and the CPU seconds of the fit."""
    rows, shares = [], [np.full(len(each), 1.0 / np.mean(each.y**2)) for each in records]
    for static in (True, False):
        kind = hs.CoreField.structure(channel="T", known=KNOWN, lags=() if static else None)
        fit, seconds = cpu_timed(hs.identify, kind, records, weights=shares)
        for told in (False, True):
            errors = []
            for record in others:
                n = int(KNOWN * len(record))
                law = hs.condition(fit, record[:n]) if told else fit.model.at(T=record.channels["T"])
                y = law.response(record.u, record.sample_time)
                errors.append(round(float(hs.metrics.sequence_relative_error(record.y[n:], y[n:])), 5))
            name = f"{'static' if static else 'with lags'}{', told the begin' if told else ''}"
            rows.append({"model": name, "seconds": seconds, "errors": errors} | summary(errors))
    return rows


def summary(errors: Sequence[float]) -> Row:
    """Median, mean, 95th percentile and largest error [%]."""
    percent = 100.0 * np.array(errors)
    measures = {"median": np.median, "mean": np.mean, "high": partial(np.percentile, q=95.0, method="hazen")}
    return {f"{name}_percent": float(of(percent)) for name, of in {**measures, "worst": np.max}.items()}


def cell(rng: np.random.Generator) -> Row:
    """A cell from two partial cycles: the error of a third over the noise, and whether the interval has the rate."""
    charge = np.linspace(0.0, 1.0, 12)
    falling = 3.2 + 0.6 * charge + rng.uniform(0.05, 0.2) * np.tanh(rng.uniform(5.0, 20.0) * (charge - 0.1))
    rising = falling + rng.uniform(0.02, 0.08, 2) @ [1.0 - charge, charge]
    law = hs.TabulatedDahl.from_branches(charge, rising, falling, rate=rng.uniform(8.0, 40.0))
    records = []
    for ends in ([0.0, 0.9, 0.2, 0.8], [1.0, 0.1, 0.7, 0.2], [0.15, 0.75, 0.4, 0.7, 0.3]):
        u = hs.signals.extremes(ends, max_step=0.01)
        records.append(hs.Record(u=u, y=law.response(u) + VOLTS * rng.standard_normal(u.size)))
    fit = hs.identify(hs.TabulatedDahl.over(*records[:2], nodes=12), records[:2])
    known = {name: fit.estimates[name] for name in fit.free_names if "z0" not in name}
    third = hs.identify(fit.model, records[2], fixed=known)
    low, high = fit.intervals["rate"]
    return {"error_over_noise": third.rmse / VOLTS, "has_rate": bool(low <= law.rate <= high)}


def measured(folder: Path) -> list[Row]:
    """The errors on sequences or loops of a folder."""
    rows = []
    for path in sorted(folder.glob("*_B.csv")):
        names = (path, *(path.with_name(path.name.replace("_B.csv", f"_{x}.csv")) for x in "HT"))
        B, H, T = (np.loadtxt(name, delimiter=",", ndmin=2) for name in names)
        t = STEP * np.arange(B.shape[1])
        pairs = zip(B, H, T.ravel(), strict=True)
        records = [hs.Record(u=u, y=y, t=t, channels={"T": value}) for u, y, value in pairs]
        others = records[::3]
        found = predicted([each for k, each in enumerate(records) if k % 3], others)
        rows += [{"core": path.name.removesuffix("_B.csv"), **row} for row in found]
    for material in () if rows else AMPLITUDES:
        loops = [(np.tile(each.y, 2), np.tile(each.u, 2)) for each in core_loops(folder, material)]
        records = [hs.Record(u=B, y=H, t=np.arange(float(B.size))) for B, H in loops]
        shares = [np.repeat([0.0, 1.0 / np.mean(H**2)], H.size // 2) for _, H in loops]  # the second cycle is steady
        kind = hs.CoreField.structure(lags=(), known=0.5)
        fit, seconds = cpu_timed(hs.identify, kind, records, weights=shares)
        pairs = [(each.y, fit.model.response(each.u, 1.0)) for each in records]
        halves = [[values[values.size // 2 :] for values in pair] for pair in pairs]
        errors = [round(float(hs.metrics.sequence_relative_error(*half)), 5) for half in halves]
        rows.append({"core": material, "model": "static", "seconds": seconds, "errors": errors} | summary(errors))
    file = folder / "cell_pocv" / "Tesla_4680_pOCV.txt"
    if file.exists():  # a charge and a discharge, at rest
        capacity, current = (hs.load(file, u=name, y="Ewe/V", t=False) for name in ("Capacity/mA.h", "I/mA"))
        record = hs.Record(u=hs.signed_charge(capacity.u, current.u), y=capacity.y)
        fit, seconds = cpu_timed(hs.identify, hs.TabulatedDahl.over(record, nodes=24), record)
        error = fit.rmse / float(np.ptp(record.y))
        rows.append({"core": "cell", "model": "24 nodes", "seconds": seconds, "errors": [error]} | summary([error]))
    return rows


def main(smoke: bool = False) -> list[Row]:
    """Simulate, fit and predict, and unless it is a smoke run write table, figure and JSON."""
    rng, rows = np.random.default_rng(59), []
    for differ in DIFFER[1:2] if smoke else DIFFER:
        records = [sequence(rng, differ) for _ in range(3 if smoke else FITTED + PREDICTED)]
        split = 2 if smoke else FITTED
        found = predicted(records[:split], records[split:])
        rows += [{"differ_percent": 100.0 * differ, **row} for row in found]
    cells = [cell(rng) for _ in range(1 if smoke else CELLS)]
    numbers = median_and_worst("cell_error_over_noise", [each["error_over_noise"] for each in cells])
    return write_results(
        RESULTS, rows, draw, numbers | {"rates_in_interval": sum(each["has_rate"] for each in cells)}, smoke=smoke
    )


def draw(rows: list[Row]) -> Figure:
    """How errors are distributed where cores differ most."""
    canvas = figure(width=10.0, height=3.0)
    most = [row for row in rows if row["differ_percent"] == 100.0 * DIFFER[-1]]
    hs.plot.core_error({row["model"]: row["errors"] for row in most}, canvas.subplots(1, 4, sharey=True))
    return canvas


if __name__ == "__main__":
    if len(sys.argv) > 1:  # the measured records alone, beside what is stored
        found = measured(Path(sys.argv[1]))
        for row in found:
            print({name: value for name, value in row.items() if name != "errors"})
        if not any(Path(sys.argv[1]).glob("*_B.csv")):
            stored = stored_result(RESULTS) | {"measured": found}
            write_files(RESULTS, stored.pop("rows"), draw, stored)
    else:
        main()
