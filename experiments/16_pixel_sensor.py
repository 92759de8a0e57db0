"""What does the paper's camera allow, whose pixel is 0.0763 um?

The compensation matrix's actuator, triangle, step and controllers, but the sensor gives whole pixels, a sample late and
without noise. The true figures are those of the displacement, the measured ones those of the pixels, in both loops. The
camera is as fast as the controller here, which the paper's is not: what is lost is lost to the pixels alone.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import PIXEL, loop_columns, name_rows, words, write_results
from table1_actuator import DAMPING, FREQUENCY, REST, H, controllers, reference_plant, resting_voltage, triangle

RESULTS = Path(__file__).parent / "results" / "pixel_sensor"
STEP = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")

Row = dict[str, float | str | None]


def seen(y: np.ndarray) -> np.ndarray:
    """The displacement in whole pixels, a sample late."""
    late = np.append(y[0], y[:-1])
    return PIXEL * np.floor(late / PIXEL + 0.5)


def rows_of(chosen: dict[str, hs.TrackingController], period: float, cycles: int, duration: float) -> list[Row]:
    """True and measured figures of every controller."""
    plant = replace(reference_plant(), sensor=hs.Sensor(quantum=PIXEL, delay=H))
    reference, samples = triangle(period, cycles)
    opened = hs.control.open_loop(plant, reference, H, samples)
    measured = replace(opened, y=seen(opened.y))
    step = {"step": 1.0, "duration": duration, "sample_time": H, "u0": resting_voltage(plant, REST)}
    rows: list[Row] = []
    for name, controller in chosen.items():
        loop = hs.control.assess_loop(plant, controller, opened.t, reference, period=period)
        run = loop.closed
        moved = hs.control.assess_step(plant, controller, **step)
        both = seen(moved.open_y), moved.closed.measurement
        pixels = hs.metrics.vibration_reduction(moved.closed.t, *both, decay_rate=DAMPING * FREQUENCY)
        rows.append(
            {
                "controller": name,
                "hysteresis_reduction_percent": opened.reduction_percent(run.y) if loop.stable else None,
                "measured_hysteresis_reduction_percent": (
                    measured.reduction_percent(run.measurement) if loop.stable else None
                ),
                **loop_columns(loop),
                "measured_tracking_rms_um": float(hs.metrics.rmse(opened.cycle, opened.last(run.measurement))),
                **{measure: getattr(moved.reduction, measure) for measure in STEP},
                **{f"measured_{measure}": getattr(pixels, measure) for measure in STEP},
            }
        )
    return [{key: None if value != value else value for key, value in row.items()} for row in rows]


def main(smoke: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    chosen = controllers(reference_plant())
    if smoke:
        chosen = {name: chosen[name] for name in ("inverse + creep inverse", "model-following")}
    rows = rows_of(chosen, *((0.02, 2, 0.3) if smoke else (1.0, 10, 1.0)))
    for row in rows:
        shown = {key: math.nan if value is None else value for key, value in row.items()}
        print(f"{shown['controller']}: {words(row)}")
        for measure in ("hysteresis_reduction_percent", "tracking_rms_um", *STEP):
            print(f"  {measure:<34} true {shown[measure]:9.4f}, measured {shown[f'measured_{measure}']:9.4f}")
    return write_results(RESULTS, rows, draw, {"pixel_um": PIXEL}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """True and measured hysteresis and residual vibration that are left."""
    canvas = figure(height=4.5)
    left, right = canvas.subplots(1, 2, sharey=True)
    places = np.arange(len(rows))
    for ax, measure, label in (
        (left, "hysteresis_reduction_percent", "Width left [%]"),
        (right, "residual_rms_reduction_percent", "Residual left [%]"),
    ):
        for prefix, style, name in (("", "full", "true"), ("measured_", "none", "measured")):
            values = [row[prefix + measure] for row in rows]
            remains = [math.nan if value is None else 100.0 - float(value) for value in values]
            ax.plot(remains, places, "o", color="#0072B2", markersize=5, fillstyle=style, label=name)
        ax.set(xscale="log", xlim=(1.0, 200.0), xlabel=label)
        ax.tick_params(axis="x", which="minor", labelbottom=False)
    name_rows(left, [str(row["controller"]) for row in rows])
    canvas.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main()
