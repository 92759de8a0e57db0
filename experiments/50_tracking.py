"""Can numbers of a law that drift be followed along a record, and does an inverse that follows them keep its worth?

The law is a Bouc-Wen law (beta = 0.8, gamma = -0.2, a feedthrough of 0.3, told), whose gain falls evenly by 20 % along
40 cycles of a triangle and whose exponent jumps from 1.5 to 2.2 at 60 % of them; the output has white noise of 0.3 %
of its range (told).

1. `hs.track_parameters` by sigma points and by particles, told that the exponent may jump by 0.5: with the most likely
   sizes of the drift, which is the default, and told a drift of 0.2 of the gain and 0.1 of the exponent; beside them
   recursive least squares with a forgetting factor, of what is linear (gain, feedthrough, offset)
   with the memory of the law at the beginning, the factor being the best of a few for the error of the gain (told).
2. 12 records of 20 cycles on which both numbers do walk at random, from the law on, by 0.2 and by 7 % (in the
   logarithm), without jumps: coverage of the bands with the most likely sizes.
3. The same drift in a loop: the inverse of the law at the beginning, and `hs.AdaptiveInverse`, along 40 cycles of a
   triangle in the displacement. The reduction of hysteresis is that of the last cycle, beside the same plant driven
   with reference / secant gain.

    python experiments/50_tracking.py
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure, panels

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "tracking"
N_SEEDS, CYCLES, SAMPLES, REACH = 5, 40, 40, 1.5
FALL, BEFORE, AFTER, JUMP_AT, NOISE_PERCENT = 0.2, 1.5, 2.2, 0.6, 0.3
DRIFT, JUMP = {"gain": 0.2, "n": 0.1}, {"gain": 0.0, "n": 0.5}
N_WALKS, WALK_CYCLES, WALK = 12, 20, {"gain": 0.2, "n": 0.07}
FORGETTING = (0.9, 0.95, 0.98, 0.99, 0.995, 0.999)
SETTLED = 2  # cycles after the jump that are left out where the paths are judged between jumps
SAMPLE_TIME = 0.01
LAW = hs.BoucWen(beta=0.8, gamma=-0.2, n=BEFORE, feedthrough=0.3)
LOOP_LAW, LOOP_REACH = hs.BoucWen(beta=0.5, gamma=0.1, n=BEFORE, feedthrough=1.5, gain=-0.7), 3.0
Row = dict[str, float | str | None]


def paths(n_samples: int) -> dict[str, np.ndarray]:
    """Gain, in parts of the first, and exponent at each sample."""
    place = np.arange(n_samples) / n_samples
    return {"gain": 1.0 - FALL * place, "n": np.where(place < JUMP_AT, BEFORE, AFTER)}


class DriftingPlant:
    """A law whose numbers are others at each sample; its memory goes on."""

    def __init__(self, law: Any, truth: dict[str, np.ndarray]) -> None:
        self.law, self.truth, self.k, self.state = law, truth, 0, law.state_at(0.0)

    def moved(self, u: float) -> float:
        """The output at the next input."""
        gain, n = (float(self.truth[name][self.k]) for name in ("gain", "n"))
        law = self.law.with_scalars({"gain": gain * self.law.gain, "n": n})
        y, state = law.advance([u], self.state)
        self.state, self.k = state, self.k + 1
        return float(y[0])


def walks(n_samples: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Gain and exponent that walk at random."""
    gain, n = (np.cumsum(size * rng.standard_normal(n_samples)) / np.sqrt(n_samples) for size in WALK.values())
    return {"gain": 1.0 + gain, "n": BEFORE * np.exp(n)}


def record(truth: dict[str, np.ndarray], cycles: int, seed: int) -> tuple[hs.Record, float]:
    """A record of the law that drifts, and the standard deviation of its noise."""
    u = hs.signals.triangle(-REACH, REACH, cycles=cycles, samples_per_cycle=SAMPLES)
    plant = DriftingPlant(LAW, truth)
    plant.state = LAW.state_at(float(u[0]))
    y = np.array([plant.moved(float(each)) for each in u])
    noise = 0.01 * NOISE_PERCENT * float(np.ptp(y))
    return hs.Record(u=u, y=y + noise * np.random.default_rng(seed).standard_normal(u.size)), noise


def recursive_least_squares(rec: hs.Record, forgetting: float) -> tuple[np.ndarray, np.ndarray]:
    """Gain at each sample, and the errors of predictions one sample ahead."""
    rows = np.column_stack([LAW.memory(rec.u), rec.u, np.ones(rec.u.size)])
    theta, P = np.array([LAW.gain, LAW.feedthrough, 0.0]), np.eye(3)
    gains, errors = np.empty(rec.u.size), np.empty(rec.u.size)
    for k, (row, y) in enumerate(zip(rows, rec.y, strict=True)):
        errors[k] = y - row @ theta
        gain = P @ row / (forgetting + row @ P @ row)
        theta, P = theta + gain * errors[k], (P - np.outer(gain, row @ P)) / forgetting
        gains[k] = theta[0]
    return gains, errors


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def followed(cycles: int, seed: int) -> tuple[list[Row], Any]:
    """What each method makes of one record."""
    truth = paths(cycles * SAMPLES + 1)
    rec, noise = record(truth, cycles, seed)
    place = np.arange(len(rec)) - int(JUMP_AT * len(rec))
    calm = (place < 0) | (place >= SETTLED * SAMPLES)
    rows: list[Row] = []
    tracks = {}
    for method in ("sigma-point", "particle"):
        for told, drift in (("most likely", None), ("told", DRIFT)):
            track = hs.track_parameters(
                LAW, rec, ("gain", "n"), drift=drift, jump=JUMP, noise=noise, method=method, seed=seed
            )
            tracks[method, told] = track
            rows.append(
                {
                    "part": "tracking",
                    "method": method,
                    "drift": told,
                    "seed": seed,
                    **judged(track, truth),
                    "n_error_calm": rms((track["n"] - truth["n"])[calm]),
                    "prediction_rms_noise": rms(track.residual) / noise,
                }
            )
    least = {each: recursive_least_squares(rec, each) for each in FORGETTING}
    best = min(FORGETTING, key=lambda each: rms(least[each][0] - truth["gain"]))
    sharpest = min(FORGETTING, key=lambda each: rms(least[each][1]))
    rows.append(
        {
            **dict.fromkeys(rows[0]),
            "part": "tracking",
            "method": "recursive least squares",
            "seed": seed,
            "gain_error_percent": 100.0 * rms(least[best][0] - truth["gain"]),
            "prediction_rms_noise": rms(least[sharpest][1]) / noise,
        }
    )
    return rows, (truth, tracks["sigma-point", "most likely"], least[best][0])


def judged(track: hs.ParameterTrack, truth: dict[str, np.ndarray]) -> Row:
    """Errors of the paths, share of the samples at which the bands hold the truth, and sizes of the drift."""
    held = {name: (track.band(name)[0] <= truth[name]) & (truth[name] <= track.band(name)[1]) for name in truth}
    return {
        "gain_error_percent": 100.0 * rms(track["gain"] - truth["gain"]),
        "n_error": rms(track["n"] - truth["n"]),
        "coverage_gain_percent": 100.0 * float(held["gain"].mean()),
        "coverage_n_percent": 100.0 * float(held["n"].mean()),
        "drift_gain": track.drift["gain"],
        "drift_n": track.drift["n"],
    }


def walked(cycles: int, seed: int) -> Row:
    """What sigma points make of numbers that walk at random."""
    rng = np.random.default_rng(100 + seed)
    truth = walks(cycles * SAMPLES + 1, rng)
    rec, noise = record(truth, cycles, seed)
    track = hs.track_parameters(LAW, rec, ("gain", "n"), jump=dict.fromkeys(JUMP, 0.0), noise=noise)
    return {"part": "walk", "method": "sigma-point", "drift": "most likely", "seed": seed, **judged(track, truth)}


# ---------------------------------------------------------------------------------- in a loop


def in_loop(cycles: int, seed: int, jumps: bool) -> list[Row]:
    """Reduction of hysteresis in the last cycle, by the fixed and by the adaptive inverse."""
    reference = hs.signals.triangle(-LOOP_REACH, LOOP_REACH, cycles=cycles, samples_per_cycle=SAMPLES)
    truth = paths(reference.size)
    if not jumps:
        truth["n"] = np.full(reference.size, BEFORE)
    noise = 0.01 * NOISE_PERCENT * 2.0 * LOOP_REACH
    adaptive = hs.AdaptiveInverse(law=LOOP_LAW, free=("gain", "n"), drift=(0.02, 0.2), noise=noise, limits=(-9.0, 9.0))
    final = LOOP_LAW.with_scalars({"gain": float(truth["gain"][-1]) * LOOP_LAW.gain, "n": float(truth["n"][-1])})
    secant = hs.control.secant_gain(hs.control.as_actuator(final), reference[:SAMPLES])
    y = {"open": driven(reference / secant, truth)}
    for name, controller in (("fixed", hs.InverseFeedforward(law=LOOP_LAW)), ("adaptive", adaptive)):
        y[name] = controlled(controller, reference, truth, noise, seed)
    last = slice(-SAMPLES - 1, None)
    width = {name: hs.loop_metrics(reference[last], each[last]).relative_width for name, each in y.items()}
    return [
        {
            "part": "loop, gain and exponent" if jumps else "loop, gain alone",
            "method": name,
            "seed": seed,
            "reduction_percent": 100.0 * (1.0 - width[name] / width["open"]),
            "tracking_rms_percent": 100.0 * rms(y[name][last] - reference[last]) / (2.0 * LOOP_REACH),
        }
        for name in ("fixed", "adaptive")
    ]


def driven(u: np.ndarray, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Outputs of the plant that drifts."""
    plant = DriftingPlant(LOOP_LAW, truth)
    return np.array([plant.moved(each) for each in u.tolist()])


def controlled(
    controller: Any, reference: np.ndarray, truth: dict[str, np.ndarray], noise: float, seed: int
) -> np.ndarray:
    """Outputs of the plant under a controller, which sees the last one with noise."""
    plant, rng, y = DriftingPlant(LOOP_LAW, truth), np.random.default_rng(seed), []
    state, seen = controller.initial(SAMPLE_TIME), 0.0
    for r in reference.tolist():
        u, state = controller.step(state, r, seen)
        y.append(plant.moved(u))
        seen = y[-1] + noise * rng.standard_normal()
    return np.array(y)


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    seeds, cycles = (range(1), 1) if smoke else (range(N_SEEDS), CYCLES)
    results = [followed(cycles, seed) for seed in seeds]
    rows = [row for found, _ in results for row in found]
    walking = [walked(1 if smoke else WALK_CYCLES, seed) for seed in range(1 if smoke else N_WALKS)]
    loops = [row for seed in seeds for jumps in (False, True) for row in in_loop(cycles, seed, jumps)]
    columns = dict.fromkeys([*rows[0], *loops[0]])
    rows = [{**columns, **row} for row in (*rows, *walking, *loops)]
    write_results(RESULTS, rows, lambda _: draw(results[0][1]), {"noise_percent": NOISE_PERCENT}, smoke=smoke)
    for row in rows:
        print({name: value for name, value in row.items() if value is not None})
    return rows


def draw(first: tuple[Any, ...]) -> Figure:
    """Both paths with their bands, and the gain by recursive least squares."""
    truth, track, least = first
    canvas = figure(height=4.6)
    upper, lower = panels(canvas, 2)
    hs.plot.track(track, "gain", upper, truth=truth["gain"])
    upper.plot(least, color="#777777", linewidth=0.8, label="recursive least squares")
    upper.legend()
    hs.plot.track(track, "n", lower, truth=truth["n"])
    return canvas


if __name__ == "__main__":
    main()
