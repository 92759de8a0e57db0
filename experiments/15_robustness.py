"""How far can a controller be trusted on an actuator that is not quite the one it was made for?

Every parameter of the law, the creep, and the mode's frequency and damping ratio are drawn uniformly within 10 % of
what the controller believes; each drawn actuator is compared with its own open loop. The triangle is the compensation
matrix's, ten cycles of 1 Hz from 0.1 to 2.5 um, and so is the step of 1 um, after 0.3 s at 0.5 um. A step is measured
twice: as one that nobody knows of before it comes, and as one that a controller with preview knows ahead.

The robust rows follow the model with a damping loop (Fleming, Aphale and Moheimani 2010) and a PID behind a broad
notch, within a maximum sensitivity of 2 with the mode 10 % off. Its gains were chosen by hand on other draws than
these; they turn the sensor's 1 nm into about 1 V at the actuator. The rows differ in how the reference moves: through
the mode's inverse (Tomizuka 1987), or by input shaping (ZV, ZVD, ZVDD: Singer and Seering 1990; extra-insensitive, EI:
Singhose, Seering and Singer 1994).
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import loop_columns, name_rows, one_panel, write_results
from table1_actuator import (
    REST,
    H,
    controllers,
    drawn,
    reference_plant,
    resting_voltage,
    robust_controllers,
    triangle,
)

RESULTS = Path(__file__).parent / "results" / "robustness"
SPREAD, SEED = 0.1, 2
PERCENTILES = (5, 50, 95)
STEP = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")
MEASURES = ("hysteresis_reduction_percent", "tracking_rms_um", *STEP, *(f"{name}_known_ahead" for name in STEP))
BEST = "robust, EI"
UNSTABLE = np.full(len(MEASURES), np.nan)

Row = dict[str, float | str | None]


def measured(
    plant: hs.Actuator, chosen: list[hs.TrackingController], period: float, cycles: int, duration: float
) -> np.ndarray:
    """The measures of each controller on one plant; nan where the loop is not stable."""
    reference, samples = triangle(period, cycles)
    opened = hs.control.open_loop(plant, reference, H, samples)
    step = {"step": 1.0, "duration": duration, "sample_time": H, "u0": resting_voltage(plant, REST), "hold": 0.3}

    def measures(controller: hs.TrackingController) -> np.ndarray:
        try:
            loop = hs.control.assess_loop(plant, controller, opened.t, reference, period=period)
            steps = [hs.control.assess_step(plant, controller, known_ahead=known, **step) for known in (False, True)]
        except hs.SimulationError:
            return UNSTABLE
        if not (loop.stable and all(found.loop.stable for found in steps)):
            return UNSTABLE
        figures = [getattr(found.reduction, name) for found in steps for name in STEP]
        return np.array([opened.reduction_percent(loop.closed.y), loop.tracking_rms, *figures])

    return np.array([measures(controller) for controller in chosen])


def rows_of(names: list[str], draws: int, exponent: bool, period: float, cycles: int, duration: float) -> list[Row]:
    """A row for each controller, over the same drawn plants; the exponent n of the law is drawn too or held."""
    nominal = reference_plant()
    known = controllers(nominal) | robust_controllers(nominal)
    chosen = [known[name] for name in names]
    factors = np.random.default_rng(SEED).uniform(1.0 - SPREAD, 1.0 + SPREAD, (draws, 11 if exponent else 10))
    with ThreadPoolExecutor() as pool:
        found = list(pool.map(lambda each: measured(drawn(nominal, each), chosen, period, cycles, duration), factors))
    reference, _ = triangle(period, cycles)
    t = H * np.arange(reference.size)
    loops = [hs.control.assess_loop(nominal, controller, t, reference, period=period) for controller in chosen]
    return [
        row(name, np.array(values), exponent) | {f"nominal_{key}": value for key, value in loop_columns(loop).items()}
        for name, values, loop in zip(names, np.swapaxes(found, 0, 1), loops, strict=True)
    ]


def row(name: str, values: np.ndarray, exponent: bool) -> Row:
    """Percentiles of the measures over the stable loops."""
    stable = np.isfinite(values[:, 0])
    percentiles = np.percentile(values[stable], PERCENTILES, axis=0)
    return {
        "controller": name,
        "exponent": "drawn" if exponent else "held",
        "draws": len(values),
        "unstable": int(np.count_nonzero(~stable)),
        **{
            f"{measure}_p{percentile}": float(percentiles[i, k])
            for k, measure in enumerate(MEASURES)
            for i, percentile in enumerate(PERCENTILES)
        },
    }


def main(smoke: bool = False) -> list[Row]:
    """Draw, measure, print and write table, figure and result."""
    shape = (0.02, 2, 0.3) if smoke else (1.0, 10, 1.0)
    plant = reference_plant()
    fixed = ["PID", "inverse + creep inverse", "model-following", "model-following, damped"]
    others = [*fixed, *(name for name in robust_controllers(plant) if name != BEST)]
    few, some, many = (1, 1, 2) if smoke else (40, 200, 1000)
    rows = [
        *rows_of(others[-1:] if smoke else others, few, False, *shape),
        *rows_of([BEST], many, False, *shape),
        *rows_of([BEST], some, True, *shape),
    ]
    for each in rows:
        print(f"{each['controller']}, n {each['exponent']}: {each['draws']} draws, {each['unstable']} unstable")
        for measure in MEASURES:
            low, median, high = (each[f"{measure}_p{percentile}"] for percentile in PERCENTILES)
            print(f"  {measure:<46} {low:9.4f} {median:9.4f} {high:9.4f}")
    return write_results(RESULTS, rows, draw, {"spread_percent": 100.0 * SPREAD}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Fifth to ninety-fifth percentile of what is left of hysteresis and residual vibration."""
    canvas, ax = one_panel(4.5)
    places = np.arange(len(rows))
    for shift, mark, measure, label in (
        (-0.2, "o", "hysteresis_reduction_percent", "width of the loop"),
        (0.0, "s", "residual_rms_reduction_percent", "residual vibration, step unknown"),
        (0.2, "D", "residual_rms_reduction_percent_known_ahead", "residual vibration, step known ahead"),
    ):
        most, median, least = (
            np.array([100.0 - float(each[f"{measure}_p{percentile}"]) for each in rows]) for percentile in PERCENTILES
        )
        spans = [median - least, most - median]
        ax.errorbar(median, places + shift, xerr=spans, fmt=mark, markersize=4, capsize=2, label=label)
    ax.axvline(5.0, color="0.6", linewidth=0.8)
    ax.set_xscale("log")
    names = [f"{each['controller']}{', n drawn' if each['exponent'] == 'drawn' else ''}" for each in rows]
    name_rows(ax, names)
    ax.set_xlabel("Left of the open loop's, 5th to 95th percentile [%]")
    canvas.legend(loc="outside lower center", ncols=1)
    return canvas


if __name__ == "__main__":
    main()
