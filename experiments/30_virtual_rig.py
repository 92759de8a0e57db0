"""What does the camera of Table 1 cost, and what does a part of a pixel give back?

The simulated rig of Table 1 climbs the table's staircase under textures and noises of 20 seeds. From the frames of each
come three tables of 52 rows: by whole pixels as the paper's, by parts of a pixel, and by whole pixels where the
microscope shakes by 0.28 pixel from frame to frame, which is what the paper's table has beyond its rounding. On each
the law is identified, by the likelihood of rounded data where it is rounded; fit, residual and FPE are those of least
squares, as they are printed for the paper's table, and of its transfer function of 4 poles and 1 zero. Each law's
inverse then drives the true actuator along ten cycles of a triangle of 1 Hz from 0.1 to 2.5 um.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Axes, Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "virtual_rig"
PIXEL = hs.datasets.PIXEL
SEEDS = 20
FIRST = 100  # texture: none of those that the measurement was made with
SHAKE = 0.28  # pixel
START = hs.PolynomialBoucWen(input_coefficients=(0.02, 0.0))
LINEAR = hs.TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
H = 1.0 / 20e3  # s
COLOURS = {"truth": "black", "subpixel": "#0072B2", "whole-pixel": "#E69F00", "shaken": "#CC79A7", "Table 1": "#009E73"}

Row = dict[str, Any]


def tables(seeds: int, step: float) -> Iterator[tuple[str, int, hs.Record, float | None]]:
    """What is measured, the seed, the table, and the rms error of its displacements [pixel]."""
    drive = hs.rig.staircase_drive(step=step)
    truth = hs.rig.table1().run(drive).record("truth")
    yield "truth", 0, truth, 0.0
    for seed in range(seeds):
        rig = hs.rig.table1(texture=FIRST + seed, seed=seed)
        still = rig.run(drive)
        shaken = replace(rig, camera=replace(rig.camera, jitter=SHAKE)).run(drive)
        for name, experiment, method in (
            ("subpixel", still, "subpixel"),
            ("whole-pixel", still, "whole-pixel"),
            ("shaken", shaken, "whole-pixel"),
        ):
            table = experiment.record(method)
            yield name, seed, table, float(hs.metrics.rmse(truth.y, table.y)) / PIXEL
    if seeds > 1:
        yield "Table 1", 0, hs.datasets.table1(), None


def row(name: str, seed: int, table: hs.Record, error: float | None, true: hs.Record, cycles: int) -> Row:
    """What is identified on one table, and what its law is good for."""
    squares = hs.identify(START, table, fixed={"n": 1.0})
    rounded = table.resolution is not None
    fit = hs.identify(START, table, fixed={"n": 1.0}, noise="quantised") if rounded else squares
    linear = hs.identify(LINEAR, replace(table, t=np.arange(float(len(table)))))
    width, of_truth = fit.loop_width, hs.loop_metrics(true.u, true.y).max_width
    return {
        "measured": name,
        "seed": seed,
        "error_rms_pixels": error,
        "fit_percent": squares.fit_percent,
        "residual_rms_pixels": squares.rmse / PIXEL,
        "largest_residual_pixels": float(np.abs(squares.residual).max()) / PIXEL,
        "fpe": squares.fpe,
        "linear_fit_percent": linear.fit_percent,
        "linear_fpe": linear.fpe,
        "width_um": width.value,
        "width_lower_um": width.lower,
        "width_upper_um": width.upper,
        "width_error_percent": 100.0 * (width.value / of_truth - 1.0),
        "width_covers": bool(width.lower <= of_truth <= width.upper),
        "hysteresis_reduction_percent": reduction(fit.model, cycles),
        "law_um": (fit.model.response(true.u) - fit.model.response(true.u)[0]).tolist(),
    }


def reduction(law: Any, cycles: int) -> float:
    """Hysteresis that the inverse of a law takes away from the true actuator [%]."""
    plant = hs.rig.table1().actuator
    samples = round(1.0 / H)
    reference = hs.signals.triangle(0.1, 2.5, cycles=cycles, samples_per_cycle=samples)
    opened = hs.control.open_loop(plant, reference, H, samples)
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=plant.amplifier.limits)
    return float(opened.reduction_percent(hs.close_loop(plant, controller, opened.t, reference).y))


def summary(rows: list[Row]) -> list[Row]:
    """Medians and extremes over the seeds, and how often the interval of the width holds the truth."""
    keys = [key for key in rows[0] if key not in ("measured", "seed", "law_um", "width_covers")]
    found = []
    for name in dict.fromkeys(row["measured"] for row in rows):
        own = [row for row in rows if row["measured"] == name]
        line: Row = {"measured": name, "tables": len(own), "covered": sum(row["width_covers"] for row in own)}
        for key in keys:
            values = [row[key] for row in own if row[key] is not None]
            if values:
                line[key] = {"median": float(np.median(values)), "least": min(values), "most": max(values)}
        found.append(line)
    return found


def main(smoke: bool = False) -> list[Row]:
    """Identify on all tables, print and write."""
    made = list(tables(1 if smoke else SEEDS, 25.0 if smoke else 5.0))
    true = made[0][2]
    if smoke:
        return [{"measured": name, "error_rms_pixels": error} for name, _, _, error in made]
    rows = [row(*each, true, 10) for each in made]
    lines = summary(rows)
    for line in lines:
        print(f"{line['measured']}: {line['covered']} of {line['tables']} intervals hold the true width")
        for key, found in line.items():
            if isinstance(found, dict):
                print(f"  {key:<30} {found['median']:10.5g}  [{found['least']:.5g}, {found['most']:.5g}]")
    laws = [(each["measured"], np.array(each.pop("law_um"))) for each in rows]
    write_results(RESULTS, rows, lambda rows: draw(rows, laws, true), {"shake_pixels": SHAKE, "summary": lines})
    return rows


def draw(rows: list[Row], laws: list[tuple[str, np.ndarray]], true: hs.Record) -> Figure:
    """A frame, the laws' errors, the widths with their intervals, and what the inverses leave."""
    canvas = figure(height=6.0)
    frame, error, width, left = canvas.subplots(2, 2).flat
    frame.imshow(hs.rig.table1(texture=FIRST).camera.frame(0.0), cmap="gray", vmin=0, vmax=255)
    frame.set(title="A frame of the camera", xticks=[], yticks=[])
    for name, law in laws:
        if name in ("subpixel", "whole-pixel"):
            error.plot(true.t, (law - true.y) / PIXEL, color=COLOURS[name], linewidth=0.7)
    error.set(title="Identified law minus the truth", xlabel="Time [s]", ylabel="Error [pixel]")
    names = [name for name in COLOURS if name != "truth"]
    places = np.array([names.index(row["measured"]) if row["measured"] in names else -1 for row in rows]) * (SEEDS + 2.0)
    places += [float(row["seed"]) for row in rows]
    for name in names:
        own = [k for k, row in enumerate(rows) if row["measured"] == name]
        show_widths(width, name, places[own], [rows[k] for k in own])
        remains = [100.0 - rows[k]["hysteresis_reduction_percent"] for k in own]
        left.plot(places[own], remains, "o", color=COLOURS[name], markersize=4)
    width.axhline(rows[0]["width_um"], color="black", linewidth=0.8)
    left.axhline(100.0 - rows[0]["hysteresis_reduction_percent"], color="black", linewidth=0.8)
    width.set(title="Width of the loop", ylabel="Largest width [um]", xticks=[])
    left.set(title="Hysteresis left by the law's inverse", ylabel="Hysteresis left [%]", xticks=[], yscale="log")
    handles, labels = width.get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside lower center", ncols=4)
    return canvas


def show_widths(ax: Axes, name: str, places: np.ndarray, rows: list[Row]) -> None:
    """Widths of one kind of table with their intervals."""
    values = np.array([[row[f"width{end}_um"] for row in rows] for end in ("_lower", "", "_upper")])
    ax.errorbar(places, values[1], yerr=np.abs(values[[0, 2]] - values[1]), fmt="o", markersize=4, linewidth=0.8,
                color=COLOURS[name], label=name)  # fmt: skip


if __name__ == "__main__":
    main()
