"""What does the camera of Table 1 cost, and what does a displacement to parts of a pixel improve?

The simulated rig of Table 1 climbs the table's staircase under the textures and noises of 20 seeds. Its frames give
tables of 52 rows: by parts of a pixel, at 30 and at 20 dB; by whole pixels, as the paper's; and by whole pixels where
the microscope shakes by 0.31 pixel rms from frame to frame, which is what the paper's residual has beyond rounding.
On each the law is identified, by the likelihood of rounded data where it is rounded; fit, residual and FPE are those
of least squares, as they are for the paper's table, and of its transfer function of 4 poles and 1 zero. The inverse of
each law then drives the true actuator along ten cycles of a triangle of 1 Hz from 0.1 to 2.5 um.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import PIXEL, loop_columns, write_results

RESULTS = Path(__file__).parent / "results" / "virtual_rig"
SEEDS = 20
FIRST = 100  # texture: none of those that the measurement was made with
SHAKE = 0.31  # pixel
DIM = 1000.0  # electrons of the largest count: 20 dB
START = hs.PolynomialBoucWen(input_coefficients=(0.02, 0.0))
LINEAR = hs.TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
H = 1.0 / 20e3  # s
COLOURS = {
    "parts of a pixel": "#0072B2",
    "parts of a pixel, 20 dB": "#56B4E9",
    "whole pixels": "#E69F00",
    "whole pixels, shaken": "#CC79A7",
    "Table 1": "#009E73",
}

Row = dict[str, Any]

NOTHING = dict.fromkeys(
    ("hysteresis_reduction_percent", "stable", "period_s", "tracking_rms_um", "limited_percent",
     "max_sensitivity_with_delay", "volts_per_pixel")
)  # fmt: skip


def measurements(seed: int) -> dict[str, tuple[hs.rig.Rig, str]]:
    """Rig and method of each kind of table but the paper's."""
    rig = hs.rig.table1(texture=FIRST + seed, seed=seed)
    dim, shaken = (
        replace(rig, camera=replace(rig.camera, **change)) for change in ({"full_well": DIM}, {"jitter": SHAKE})
    )
    asked = ((rig, "subpixel"), (dim, "subpixel"), (rig, "whole-pixel"), (shaken, "whole-pixel"))
    return dict(zip(COLOURS, asked, strict=False))


def tables(seeds: int, drive: hs.rig.Drive) -> Iterator[tuple[str, int, hs.Record]]:
    """What is measured, the seed, and the table."""
    for seed in range(seeds):
        for name, (rig, method) in measurements(seed).items():
            yield name, seed, rig.run(drive).record(method)
    yield "Table 1", 0, hs.datasets.table1()


def row(name: str, seed: int, table: hs.Record, truth: hs.Record, cycles: int = 10) -> Row:
    """What is identified on one table and, where the truth is known, how far it is off and what it is good for."""
    squares = hs.identify(START, table, fixed={"n": 1.0})
    rounded = table.resolution is not None
    fit = hs.identify(START, table, fixed={"n": 1.0}, noise="quantised") if rounded else squares
    linear = hs.identify(LINEAR, replace(table, t=np.arange(float(len(table)))))
    width, true_width = fit.loop_width, hs.loop_metrics(truth.u, truth.y).max_width
    known = name != "Table 1"
    return {
        "measured": name,
        "seed": seed,
        "error_rms_pixels": float(hs.metrics.rmse(truth.y, table.y)) / PIXEL if known else None,
        "fit_percent": squares.fit_percent,
        "residual_rms_pixels": squares.rmse / PIXEL,
        "largest_residual_pixels": float(np.abs(squares.residual).max()) / PIXEL,
        "fpe": squares.fpe,
        "linear_fit_percent": linear.fit_percent,
        "linear_fpe": linear.fpe,
        "width_um": width.value,
        "width_lower_um": width.lower,
        "width_upper_um": width.upper,
        "width_error_percent": 100.0 * (width.value / true_width - 1.0) if known else None,
        "width_covers": bool(width.lower <= true_width <= width.upper) if known else None,
        "law_rms_pixels": float(np.std(fit.model.response(truth.u) - truth.y)) / PIXEL if known else None,
        **(reduction(fit.model, cycles) if known else NOTHING),
    }


def reduction(law: Any, cycles: int) -> Row:
    """Hysteresis that the inverse of a law takes away from the true actuator [%], and figures of that loop."""
    plant = hs.rig.table1().actuator
    samples = round(1.0 / H)
    reference = hs.signals.triangle(0.1, 2.5, cycles=cycles, samples_per_cycle=samples)
    opened = hs.control.open_loop(plant, reference, H, samples)
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=plant.amplifier.limits)
    loop = hs.control.assess_loop(plant, controller, opened.t, reference, period=1.0)
    left = opened.reduction_percent(loop.closed.y) if loop.stable else None
    return {"hysteresis_reduction_percent": left, **loop_columns(loop)}


def summary(rows: list[Row]) -> list[Row]:
    """Medians and extremes over the seeds, and how often the interval of the width holds the truth."""
    found = []
    for name in COLOURS:
        own = [row for row in rows if row["measured"] == name]
        line: Row = {"measured": name, "tables": len(own)}
        for key, first in own[0].items():
            values = [row[key] for row in own]
            if isinstance(first, bool):
                line[key] = sum(values)
            elif isinstance(first, float):
                line[key] = {"median": float(np.median(values)), "least": min(values), "most": max(values)}
        found.append(line)
    return found


def main(smoke: bool = False) -> list[Row]:
    """Measure, identify, print and write."""
    drive = hs.rig.staircase_drive(step=12.5 if smoke else 5.0)
    truth = hs.rig.table1().run(drive).record("truth")
    if smoke:
        return [row(*next(tables(1, drive)), truth, cycles=1)]
    rows = [row(*each, truth) for each in tables(SEEDS, drive)]
    best, lines = reduction(hs.rig.LAW, 10)["hysteresis_reduction_percent"], summary(rows)
    print(f"the inverse of the true law takes {best:.2f} % of the hysteresis away")
    for line in lines:
        print(f"{line['measured']}: {line['tables']} tables, {line.get('width_covers')} intervals hold the true width")
        for key, found in line.items():
            if isinstance(found, dict):
                print(f"  {key:<30} {found['median']:10.5g}  [{found['least']:.5g}, {found['most']:.5g}]")
    true_width = hs.loop_metrics(truth.u, truth.y).max_width
    numbers = {"true_width_um": true_width, "true_law_reduction_percent": best, "summary": lines}
    return write_results(RESULTS, rows, lambda rows: draw(rows, true_width, best), numbers)


def draw(rows: list[Row], true_width: float, best: float) -> Figure:
    """A frame, fits of the tables, widths with their intervals, and what the inverses leave."""
    canvas = figure(height=6.0)
    frame, fits, widths, left = canvas.subplots(2, 2).flat
    frame.imshow(hs.rig.table1(texture=FIRST).camera.frame(0.0), cmap="gray", vmin=0, vmax=255)
    frame.set(title="A frame of the camera", xticks=[], yticks=[])
    for name, colour in COLOURS.items():
        own = [row for row in rows if row["measured"] == name]
        places = list(COLOURS).index(name) + np.linspace(-0.35, 0.35, len(own)) * (len(own) > 1)
        style = {"color": colour, "markersize": 3.5, "linestyle": "none", "marker": "o"}
        fits.plot(places, [row["residual_rms_pixels"] for row in own], **style)
        lower, value, upper = (np.array([row[f"width{end}_um"] for row in own]) for end in ("_lower", "", "_upper"))
        widths.errorbar(places, value, yerr=(value - lower, upper - value), elinewidth=0.8, label=name, **style)
        if name != "Table 1":
            left.plot(places, [100.0 - row["hysteresis_reduction_percent"] for row in own], **style)
    fits.axhline(1.0 / np.sqrt(12.0), color="black", linewidth=0.8)
    fits.set(title="Residual of the identified law", ylabel="Rms [pixel]", xticks=[], yscale="log")
    widths.axhline(true_width, color="black", linewidth=0.8)
    widths.set(title="Identified loop, with its interval", ylabel="Largest width [um]", xticks=[])
    left.axhline(100.0 - best, color="black", linewidth=0.8)
    left.set(title="Left by the law's inverse", ylabel="Hysteresis left [%]", xticks=[], yscale="log")
    canvas.legend(*widths.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return canvas


if __name__ == "__main__":
    main()
