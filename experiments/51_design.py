"""Does an input that is designed for a whole actuator tell its law, creep and mode better than the usual inputs?

Simulated stages: the law of Table 1 (a quadratic Bouc-Wen law, whose beta, gamma and gain are drawn about it), a creep
of 0.5 to 3 % a decade, a mode of 100 to 400 Hz with a damping ratio of 0.01 to 0.05, a delay of up to three samples,
and a sensor of 12 bits with noise of one bit rms. A first record has slow triangles of three sizes, 221 samples in
2.2 s. For the second one, of 0.6 s at 2 kHz, from 0 to 100 V at up to 20 000 V/s, there are four inputs: one that is
designed for parameters that are 10 % off (frequency: 5 %), a triangle and a fading triangle, each the best of several
speeds for these parameters, and the better of two random-phase multisines with all tones up to twice the frequency of
the mode.

Each stage is identified from the first record with each of the four others, with the same options; the family of the
law, its n = 1, its memory of zero at the first samples and the number of modes are told. The errors of the parameters
are given in units of the standard errors that are expected with the designed input at the true parameters, and of those
expected with the record's own input: both from differences of whole responses. A further record, which no fit sees, is
predicted: a sine of 17 Hz, then steps held for 0.1 s; its error is in units of the sensor's noise.

    python experiments/51_design.py    continues a run that was ended early
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

RESULTS = Path(__file__).parent / "results" / "design"
N_DRAWS = 5
DESIGNED = "designed"
INPUTS = (DESIGNED, "triangle", "fading triangle", "multisine")
LIMITS = hs.InputLimits(amplitude=50.0, centre=50.0, slew=2e4, duration=0.6, sample_time=0.5e-3)
FREQUENCY, DAMPING = "vibration.natural_frequencies[0]", "vibration.damping_ratios[0]"
FREE = (
    *(f"hysteresis.{name}" for name in ("beta", "gamma", "gain", "offset")),
    *(f"hysteresis.input_coefficients[{k}]" for k in range(2)),
    *("creep.percent", FREQUENCY, DAMPING, "vibration.delay"),
)
FIXED = {"hysteresis.n": 1.0, "hysteresis.z0": 0.0}
SLOW_STEP, CORNERS = 0.01, (0.0, 100.0, 0.0, 60.0, 20.0, 80.0, 0.0)  # s, V
SLOW = np.interp(2.0 * np.arange(221), np.cumsum(np.abs(np.diff(CORNERS, prepend=0.0))), CORNERS)  # 200 V/s
CANDIDATES, MOVES = 100, 100
PREDICTED_STEP = 0.5e-3
Row = dict[str, Any]


# ---------------------------------------------------------------------------------- simulated stages


def stage(draw: int) -> tuple[hs.Actuator, dict[str, float]]:
    """The true actuator, and its parameters beside those of the law."""
    rng = np.random.default_rng(draw)
    law = replace(drawn_law(rng), z0=0.0)
    parts = {
        "creep.percent": rng.uniform(0.5, 3.0),
        FREQUENCY: 2.0 * np.pi * np.exp(rng.uniform(np.log(100.0), np.log(400.0))),
        DAMPING: np.exp(rng.uniform(np.log(0.01), np.log(0.05))),
        "vibration.delay": rng.uniform(0.0, 3.0) * LIMITS.sample_time,
    }
    quantum = RANGE / 2**12
    truth = hs.Actuator(
        hysteresis=law,
        creep=hs.Creep.per_decade(parts["creep.percent"]),
        vibration=hs.mode(parts[FREQUENCY], parts[DAMPING], delay=parts["vibration.delay"]),
        sensor=hs.Sensor(quantum=quantum, noise=quantum, seed=3000 + draw),
    )
    return truth, {name: float(value) for name, value in parts.items()}


def structure_of(truth: hs.Actuator, law: Any) -> Any:
    sensor = hs.Sensor(quantum=truth.sensor.quantum, noise=truth.sensor.noise)
    return hs.Actuator.structure(law, sensor=sensor)


def designs(draw: int) -> tuple[dict[str, np.ndarray], float]:
    """The four inputs, designed for parameters that are off, and the processor time of the design [s]."""
    truth, parts = stage(draw)
    rng = np.random.default_rng(1000 + draw)

    def off(values: dict[str, float], share: float) -> dict[str, float]:
        return {name: value * np.exp(share * rng.standard_normal()) for name, value in values.items()}

    law = truth.hysteresis.with_scalars(off({name: truth.hysteresis.scalars[name] for name in ("beta", "gain")}, 0.1))
    begin = time.process_time()
    design = hs.design_input(
        structure_of(truth, law),
        limits=LIMITS,
        free=FREE,
        values=off(parts, 0.1) | off({FREQUENCY: parts[FREQUENCY]}, 0.05),
        candidates=CANDIDATES,
        moves=MOVES,
        seed=5000 + draw,
    )
    return {DESIGNED: design.u, **design.beside}, time.process_time() - begin


def predicted_input(rng: np.random.Generator) -> np.ndarray:
    """A sine of 17 Hz about 55 V, then steps held for 0.1 s, reached at the full slew."""
    t = PREDICTED_STEP * np.arange(1000)
    sine = 55.0 - 45.0 * np.cos(2.0 * np.pi * 17.0 * t)
    steps = np.repeat(rng.uniform(5.0, 95.0, 10), 200)
    u, last = np.concatenate([[10.0], sine, steps]), 10.0
    for k, wanted in enumerate(u.tolist()):
        last = u[k] = min(max(wanted, last - 2e4 * PREDICTED_STEP), last + 2e4 * PREDICTED_STEP)
    return u


def moved(truth: hs.Actuator, parts: dict[str, float], name: str, step: float) -> hs.Actuator:
    """The actuator with one parameter that is larger by a step."""
    law, own = truth.hysteresis, parts | ({name: parts[name] + step} if name in parts else {})
    if name not in parts:
        short = name.removeprefix("hysteresis.")
        law = law.with_scalars({short: law.scalars[short] + step})
    return replace(
        truth,
        hysteresis=law,
        creep=hs.Creep.per_decade(own["creep.percent"]),
        vibration=hs.mode(own[FREQUENCY], own[DAMPING], delay=own["vibration.delay"]),
    )


def expected(truth: hs.Actuator, parts: dict[str, float], u: np.ndarray) -> dict[str, float]:
    """Standard errors that are expected from the first record and this input, by differences of whole responses."""
    inputs = ((SLOW, SLOW_STEP), (u, LIMITS.sample_time))
    columns = {}
    for name in FREE:
        value = parts[name] if name in parts else truth.hysteresis.scalars[name.removeprefix("hysteresis.")]
        step = 1e-5 * (abs(value) or 1.0)
        ends = [moved(truth, parts, name, side * step) for side in (1.0, -1.0)]
        slopes = [np.subtract(*(end.response(*each) for end in ends)) / (2.0 * step) for each in inputs]
        columns[name] = np.concatenate(slopes)
    jacobian = np.column_stack(list(columns.values())) / noise_of(truth.sensor)
    size = np.linalg.norm(jacobian, axis=0)
    covariance = np.linalg.inv((jacobian / size).T @ (jacobian / size)) / np.outer(size, size)
    return dict(zip(columns, np.sqrt(np.diag(covariance)).tolist(), strict=True))


# ---------------------------------------------------------------------------------- one draw


def cases(draw: int, inputs: dict[str, np.ndarray], design_seconds: float) -> list[Row]:
    """One row for each input of a draw."""
    truth, parts = stage(draw)
    errors_of = {name: expected(truth, parts, u) for name, u in inputs.items()}
    first = record(replace(truth, sensor=replace(truth.sensor, seed=4000 + draw)), SLOW, SLOW_STEP)
    values = {f"hysteresis.{name}": value for name, value in truth.hysteresis.scalars.items()} | parts
    unseen = predicted_input(np.random.default_rng(2000 + draw))
    rows = []
    for name in INPUTS:
        own, best = errors_of[name], errors_of[DESIGNED]
        begin = time.process_time()
        structure = structure_of(truth, STRUCTURE)
        fit = hs.identify(structure, [first, record(truth, inputs[name], LIMITS.sample_time)], fixed=FIXED)
        seconds = time.process_time() - begin
        errors = {each: abs(fit.estimates[each] - values[each]) for each in FREE if each in fit.free_names}
        model = fit.model.placed(None)  # its memory holds at the first sample, as that of the stage
        apart = model.response(unseen, PREDICTED_STEP) - truth.response(unseen, PREDICTED_STEP)
        rows.append(
            {
                "draw": draw,
                "input": name,
                "error_in_noise": float(np.sqrt(np.mean(apart**2))) / noise_of(truth.sensor),
                "in_designed": {each: error / best[each] for each, error in errors.items()},
                "in_own": {each: error / own[each] for each, error in errors.items()},
                "expected_ratio": {each: own[each] / best[each] for each in FREE},
                "not_determined": [each for each in FREE if each not in fit.free_names],
                "success": fit.success,
                "design_cpu_seconds": design_seconds,
                "fit_cpu_seconds": seconds,
                "message": fit.message,
            }
        )
    return rows


def computed() -> list[Row]:
    """All cases."""

    def of_draw(draw: int) -> Row:
        return {"draw": draw, "rows": cases(draw, *designs(draw))}

    draws = stored_cases(RESULTS, ("draw",), {(draw,): draw for draw in range(N_DRAWS)}, of_draw)
    return [row for each in draws for row in each["rows"]]


# ---------------------------------------------------------------------------------- results


def summary(rows: list[Row], name: str) -> Row:
    """One row of the table."""
    own = [row for row in rows if row["input"] == name]
    errors = {unit: [value for row in own for value in row[unit].values()] for unit in ("in_designed", "in_own")}
    parts = {}
    for part in ("hysteresis", "creep", "vibration"):
        ratios = [value for row in own for each, value in row["expected_ratio"].items() if each.startswith(part)]
        parts[f"median_expected_ratio_{part}"] = float(np.median(ratios))
    return {
        "input": name,
        "draws": len(own),
        **median_and_worst("error_in_expected_of_designed", errors["in_designed"]),
        **median_and_worst("error_in_own_expected", errors["in_own"]),
        **parts,
        "not_determined": sum(len(row["not_determined"]) for row in own),
        **median_and_worst("prediction_in_noise", (row["error_in_noise"] for row in own)),
        "converged": sum(row["success"] for row in own),
        "median_fit_cpu_seconds": float(np.median([row["fit_cpu_seconds"] for row in own])),
    }


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        limits = replace(LIMITS, duration=0.2)
        truth, parts = stage(0)
        design = hs.design_input(
            structure_of(truth, truth.hysteresis), limits=limits, values=parts, free=FREE, candidates=5, moves=2
        )
        return [{"input": name, "efficiency": value} for name, value in design.efficiency.items()]
    rows = computed()
    table = [summary(rows, name) for name in INPUTS]
    inputs, _ = designs(0)
    seconds = float(np.median([row["design_cpu_seconds"] for row in rows]))
    write_results(RESULTS, table, lambda _: draw(rows, inputs), {"median_design_cpu_seconds": seconds})
    for row in table:
        print(row)
    return table


def draw(rows: list[Row], inputs: dict[str, np.ndarray]) -> Figure:
    """The four inputs of the first draw, and the errors of parameters and predictions of all."""
    canvas = figure(height=5.2)
    grid = canvas.add_gridspec(len(INPUTS), 2)
    colours = dict(zip(INPUTS, ("#0072B2", "#999999", "#E69F00", "#CC79A7"), strict=True))
    for k, name in enumerate(INPUTS):
        axes = canvas.add_subplot(grid[k, 0])
        axes.plot(LIMITS.t, inputs[name], color=colours[name], linewidth=0.5)
        axes.set_title(name, fontsize=8)
        axes.set(ylabel="u [V]", ylim=(-5.0, 105.0), xlabel="t [s]" if k == len(INPUTS) - 1 else "")
    half = len(INPUTS) // 2
    for place, key, label in (
        (grid[:half, 1], "in_designed", "error / expected of designed"),
        (grid[half:, 1], "", "prediction error / noise"),
    ):
        axes = canvas.add_subplot(place)
        for name in INPUTS:
            own = [row for row in rows if row["input"] == name]
            values = sorted(v for row in own for v in (row[key].values() if key else [row["error_in_noise"]]))
            share = np.arange(1, len(values) + 1) / len(values)
            axes.plot(values, share, ".-", color=colours[name], markersize=2, linewidth=0.8, label=name)
        axes.set(xscale="log" if key else "linear", xlabel=label, ylabel="share of the cases")
        axes.legend(fontsize=6)
    return canvas


if __name__ == "__main__":
    main()
