"""Are law, creep, mode and delay of a stage found at once from a few records, and how well does the whole predict?

50 simulated stages: the law of Table 1 (a quadratic Bouc-Wen law, whose beta, gamma and gain are drawn about it) or a
Prandtl-Ishlinskii law with 10 plays, a creep of 0.5 to 3 % a decade, a mode of 200 to 2 000 Hz with a damping ratio of
0.005 to 0.05, a delay of up to three samples of 50 us, and a sensor of 12 bits or with the pixels of the paper's
camera. Each is identified from two or three records: slow triangles with two holds (44 s), steps at 20 kHz (0.2 s), and
in every other block of four draws triangles at 1 000 V/s (0.7 s). The structure is told: the family of the law with its
number of plays, one mode, a creep bank, a delay, and the sensor's quantum. A sine of 17 Hz between 10 and 100 V, which
no record holds, is predicted; its error is that against the true displacement, in units of the sensor's noise.

Beside it stand, on the first draws, the law alone, identified on all records, and the law with a transfer function of
two poles and a delay behind it, identified on the steps, the one record that shows a mode.

    python experiments/46_whole_actuator.py    continues a run that was ended early
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import median_and_worst, stored_cases, write_results
from simulated_stages import RANGE, STRUCTURE, drawn_law, noise_of, record

RESULTS = Path(__file__).parent / "results" / "whole_actuator"
N_DRAWS, N_PLAYS = 50, 10
N_OF_ALONE, N_OF_CASCADE = 25, 5
FAST, MEDIUM, SLOW = 1.0 / 20e3, 1e-3, 0.02  # sample times [s]
HIGHEST = 125.0  # V
WHOLE, CASCADE, ALONE = "whole actuator", "law >> transfer function", "law alone"
Row = dict[str, Any]


# ---------------------------------------------------------------------------------- simulated stages


def triangles(*corners: float, rate: float, step: float) -> np.ndarray:
    """A path through these voltages at a rate [V/s]."""
    t = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))]) / rate
    return np.interp(step * np.arange(round(t[-1] / step)), t, corners)


def commands(rng: np.random.Generator, n_records: int) -> list[tuple[np.ndarray, float]]:
    """Commands [V] and their sample times [s]."""
    slow = [triangles(0.0, HIGHEST, 0.0, 90.0, rate=17.0, step=SLOW), np.full(600, 90.0)]
    slow += [triangles(90.0, 30.0, rate=15.0, step=SLOW), np.full(400, 30.0)]
    medium = triangles(0.0, 100.0, 0.0, 80.0, 20.0, 120.0, 0.0, 90.0, 40.0, rate=1000.0, step=MEDIUM)
    fast = np.repeat(np.append(0.0, rng.uniform(10.0, 110.0, 19)), 200)
    chosen = [(np.concatenate(slow), SLOW), (fast, FAST), (medium, MEDIUM)]
    return chosen[:n_records]


def law_of(draw: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """The true law of a draw, and what is identified."""
    if draw % 2:
        thresholds = 0.5 * HIGHEST / N_PLAYS * np.arange(N_PLAYS)
        weights = np.exp(-thresholds / 25.0) * rng.uniform(0.5, 1.5, N_PLAYS)
        weights[0] = 6.0
        law = hs.PrandtlIshlinskii(thresholds=tuple(thresholds), weights=tuple(0.02 * weights / weights.sum()))
        return law, hs.PrandtlIshlinskii.structure(plays=N_PLAYS)
    return drawn_law(rng), STRUCTURE


def stage(draw: int) -> tuple[hs.Actuator, Any, list[hs.Record], dict[str, float]]:
    """The truth, the law to be identified, the records, and the true values of the parameters."""
    rng = np.random.default_rng(draw)
    law, structure = law_of(draw, rng)
    frequency = 2.0 * np.pi * np.exp(rng.uniform(np.log(200.0), np.log(2000.0)))
    damping_ratio = np.exp(rng.uniform(np.log(0.005), np.log(0.05)))
    percent, delay = rng.uniform(0.5, 3.0), rng.uniform(0.0, 3.0) * FAST
    has_pixels = draw // 2 % 2 == 1
    quantum = hs.datasets.PIXEL if has_pixels else RANGE / 2**12
    sensor = hs.Sensor(quantum=quantum, noise=(0.4 if has_pixels else 1.0) * quantum)
    truth = hs.Actuator(
        hysteresis=law,
        creep=hs.Creep.per_decade(percent),
        vibration=hs.mode(frequency, damping_ratio, delay=delay),
        sensor=sensor,
    )
    records = []
    for k, (u, step) in enumerate(commands(rng, 2 + draw // 4 % 2)):
        read = replace(truth, sensor=replace(sensor, seed=10 * draw + k))
        records.append(record(read, u, step))
    values = {f"hysteresis.{name}": value for name, value in law.scalars.items() if not name.startswith("z0")}
    values |= {
        "creep.percent": percent,
        "vibration.natural_frequencies[0]": frequency,
        "vibration.damping_ratios[0]": damping_ratio,
        "vibration.delay": delay,
    }
    return truth, structure, records, {name: float(value) for name, value in values.items()}


# ---------------------------------------------------------------------------------- one case


def prediction_error(truth: hs.Actuator, model: Any) -> float:
    """Error of the prediction of a sine, in units of the sensor's noise."""
    step = 2e-4
    t = step * np.arange(1500)
    u = np.append(0.0, 55.0 - 45.0 * np.cos(2.0 * np.pi * 17.0 * t) - 10.0 * np.maximum(1.0 - t / 0.05, 0.0))
    predicted = model.response(u, step) if isinstance(model, hs.Actuator | hs.Cascade) else model.response(u)
    return float(np.sqrt(np.mean((predicted - truth.response(u, step)) ** 2))) / noise_of(truth.sensor)


def case(draw: int, model: str) -> Row:
    """One model of one draw."""
    truth, structure, records, values = stage(draw)
    subject, own = structure, records
    if model == WHOLE:
        subject = hs.Actuator.structure(structure, sensor=hs.Sensor(quantum=truth.sensor.quantum))
    elif model == CASCADE:
        poles = hs.TransferFunction.structure(poles=2, zeros=0, delay="free", initial="free")
        subject, own = hs.Cascade.structure(structure, poles), [records[1]]
    begin, wall = time.process_time(), time.perf_counter()
    fit = hs.identify(subject, own)
    seconds, wall = time.process_time() - begin, time.perf_counter() - wall
    known = {name: fit.intervals[name] for name in fit.free_names if name in values}
    return {
        "draw": draw,
        "model": model,
        "law": type(structure).__name__.replace("BankStructure", "PrandtlIshlinskii"),
        "n_records": len(own),
        "error_in_noise": prediction_error(truth, fit.model.placed(None)),
        "cpu_seconds": seconds,
        "wall_seconds": wall,
        "success": fit.success,
        "n_parameters": fit.n_parameters,
        "message": fit.message,
        "intervals": {
            name: [values[name], fit.estimates[name], low, high] for name, (low, high) in known.items() if low == low
        } if model == WHOLE else {},
        "without_interval": [name for name, (low, _) in known.items() if low != low] if model == WHOLE else [],
    }  # fmt: skip


def computed() -> list[Row]:
    """All cases, all whole actuators first."""
    counts = ((WHOLE, N_DRAWS), (ALONE, N_OF_ALONE), (CASCADE, N_OF_CASCADE))
    keys = {(draw, model): (draw, model) for model, n in counts for draw in range(n)}
    rows = stored_cases(RESULTS, ("draw", "model"), keys, lambda key: case(*key))
    return sorted(rows, key=lambda row: (row["draw"], row["model"]))


# ---------------------------------------------------------------------------------- results


def summary(cases: list[Row], model: str) -> Row:
    """One row of the table."""
    own = [each for each in cases if each["model"] == model]
    return {
        "model": model,
        "draws": len(own),
        **median_and_worst("error_in_noise", (each["error_in_noise"] for each in own)),
        **median_and_worst("cpu_seconds", (each["cpu_seconds"] for each in own)),
        "worst_wall_seconds": max(each["wall_seconds"] for each in own),
        "converged": sum(each["success"] for each in own),
    }


def coverage(cases: list[Row]) -> dict[str, Any]:
    """How often the intervals at 95 % hold the truth, pooled and by part."""
    own = [each for each in cases if each["model"] == WHOLE]
    held: dict[str, list[bool]] = {}
    for each in own:
        for name, (value, _, low, high) in each["intervals"].items():
            part = "law" if name.startswith("hysteresis.") else name.partition("[")[0]
            held.setdefault(part, []).append(low <= value <= high)
    every = [value for values in held.values() for value in values]
    return {
        "intervals": len(every),
        "intervals_that_hold_percent": 100.0 * float(np.mean(every)),
        "intervals_that_hold_percent_by_part": {part: 100.0 * float(np.mean(each)) for part, each in held.items()},
        "without_interval": sum(len(each["without_interval"]) for each in own),
        "draws_with_something_held": sum("held at" in each["message"] or "left out" in each["message"] for each in own),
    }


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        truth, structure, records, _ = stage(1)
        subject = hs.Actuator.structure(structure, creep=False, sensor=hs.Sensor(quantum=truth.sensor.quantum))
        fit = hs.identify(subject, [records[0][:900:3], records[1][:400]], noise="gaussian")
        return [{"model": WHOLE, "fit_percent": fit.fit_percent}]
    cases = computed()
    rows = [summary(cases, model) for model in (WHOLE, CASCADE, ALONE)]
    numbers = coverage(cases)
    write_results(RESULTS, rows, lambda _: draw(cases), numbers)
    for row in rows:
        print(row)
    return rows


def draw(cases: list[Row]) -> Figure:
    """Errors of the predictions in the order of their sizes, and the creep that was found against the true one."""
    canvas = figure(height=3.6)
    upper, lower = canvas.subplots(1, 2)
    for model, colour in ((ALONE, "#999999"), (CASCADE, "#E69F00"), (WHOLE, "#0072B2")):
        errors = sorted(each["error_in_noise"] for each in cases if each["model"] == model)
        upper.plot(np.arange(1, len(errors) + 1), errors, ".-", color=colour, label=model, markersize=4, linewidth=0.8)
    upper.axhline(1.5, color="#D55E00", linewidth=0.8, linestyle="dashed", label="1.5 times the noise")
    upper.set(yscale="log", xlabel="draws, in the order of the error", ylabel="error / sensor's noise")
    upper.set_ylim(top=1e3)
    upper.legend(fontsize=7, loc="upper right")
    for each in cases:
        if each["model"] == WHOLE and "creep.percent" in each["intervals"]:
            value, found, low, high = each["intervals"]["creep.percent"]
            lower.errorbar(value, found, [[found - low], [high - found]], fmt=".", color="#0072B2", markersize=4)
    lower.plot([0.5, 3.0], [0.5, 3.0], color="#D55E00", linewidth=0.8, linestyle="dashed")
    lower.set(xlabel="true creep [% a decade]", ylabel="identified [% a decade]")
    return canvas


if __name__ == "__main__":
    main()
