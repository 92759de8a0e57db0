"""What is left of the vibration after a step, by size of the step and controller?

Three plants through the same code: the compensation matrix's actuator, from 0.5 um, and the paper's linear plants (4)
and (6), of negative gain, from rest, their unit of time the sample of Table 2. Nothing is known ahead of the step. All
three figures are printed, as one alone says little; a figure that does not exist is empty. The linear plants are within
0 to 125 V, with the PID that `hysim.tune` finds for a step of one at a maximum sensitivity of at most 1.4, and with the
zero-vibration shaper of their own mode in front of their static gain.
"""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.paper.equations import EQUATION_4, EQUATION_6
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import loop_columns, words, write_results
from table1_actuator import REST, H, controllers, reference_plant, resting_voltage, robust_controllers

RESULTS = Path(__file__).parent / "results" / "vibration"
UNIT_STEP = 0.025  # sample time on the linear plants, in samples of Table 2
SUPPLY = (0.0, 125.0)  # V
SIZES = (0.1, 0.5, 1.0, 1.5)  # um
LINEAR_SIZES = (0.5, 1.0, 2.0, 4.0)  # um
STEP = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")

Row = dict[str, float | str | bool | None]


def on_the_actuator(sizes: tuple[float, ...], names: tuple[str, ...], duration: float) -> list[Row]:
    """Rows of Table 1's actuator."""
    plant = reference_plant()
    known = controllers(plant) | robust_controllers(plant)
    step = {"duration": duration, "sample_time": H, "u0": resting_voltage(plant, REST)}
    return [row("Table 1", plant, name, known[name], size, step) for name in names for size in sizes]


def on_a_linear_plant(name: str, plant: hs.TransferFunction, sizes: tuple[float, ...], duration: float) -> list[Row]:
    """Rows of one of the paper's plants, which steps down to take positive voltages."""
    t = UNIT_STEP * np.arange(round(60.0 / UNIT_STEP))
    pid = hs.tune(plant, t, -np.ones(t.size), limits=SUPPLY, max_sensitivity=1.4).controller
    mode = max(plant.poles, key=lambda pole: pole.imag / abs(pole))
    static = hs.InverseFeedforward(law=hs.Line(slope=plant.dc_gain))
    shaper = hs.Shaper.zv(abs(mode), -mode.real / abs(mode))
    shaped = hs.TrackingController(feedforward=static, shaper=shaper, limits=SUPPLY)
    step = {"duration": duration, "sample_time": UNIT_STEP}
    return [
        row(name, plant, label, controller, -size, step)
        for label, controller in (("PID", pid), ("ZV shaping", shaped))
        for size in sizes
    ]


def row(plant_name: str, plant: Any, name: str, controller: Any, size: float, step: dict[str, float]) -> Row:
    """One step of one loop."""
    found = hs.control.assess_step(plant, controller, step=size, **step)
    figures = {measure: getattr(found.reduction, measure) for measure in STEP}
    return {
        "plant": plant_name,
        "controller": name,
        "step_um": size,
        **{measure: value if math.isfinite(value) else None for measure, value in figures.items()},
        "highest_voltage": found.closed.conditions["highest_u"],
        "limited_samples": found.closed.conditions["limited_samples"],
        **loop_columns(found.loop),
    }


def main(smoke: bool = False) -> list[Row]:
    """Step, print and write table, figure and result."""
    names = ("PID", "inverse + creep inverse", "... + PID + damping", "... + PID + ZV shaping + preview",
             "model-following", "robust, EI")  # fmt: skip
    if smoke:
        rows = on_the_actuator((0.5,), names[-1:], 0.3)
    else:
        rows = on_the_actuator(SIZES, names, 1.0)
        for name, plant in (("(4)", EQUATION_4), ("(6)", EQUATION_6)):
            rows += on_a_linear_plant(name, plant, LINEAR_SIZES, 400.0)
    for each in rows:
        overshoot, residual, settling = (math.nan if each[name] is None else each[name] for name in STEP)
        print(
            f"{each['plant']:<8} {each['controller']:<34} {each['step_um']:+4.1f} um: overshoot {overshoot:7.2f} %, "
            f"residual {residual:7.2f} %, settling {settling:7.2f} %; {each['highest_voltage']:6.1f} V, "
            f"{words(each)}"
        )
    return write_results(RESULTS, rows, draw, {}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Residual vibration that is left against the size of the step, a panel for each plant."""
    canvas = figure(height=4.0)
    names = list(dict.fromkeys(str(each["plant"]) for each in rows))
    colours = {label: f"C{k}" for k, label in enumerate(dict.fromkeys(each["controller"] for each in rows))}
    shown = {}
    for ax, name in zip(canvas.subplots(1, len(names), sharey=True), names, strict=True):
        on_plant = [each for each in rows if each["plant"] == name]
        for label in dict.fromkeys(each["controller"] for each in on_plant):
            line = [each for each in on_plant if each["controller"] == label]
            left = [math.nan if each[STEP[1]] is None else 100.0 - float(each[STEP[1]]) for each in line]
            sizes = [abs(float(each["step_um"])) for each in line]
            (shown[label],) = ax.plot(sizes, left, "o-", color=colours[label], markersize=4)
        ax.set(yscale="log", title=name, xlabel="Step [um]")
    canvas.axes[0].set_ylabel("Residual vibration left [%]")
    canvas.legend(list(shown.values()), list(shown), loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main()
