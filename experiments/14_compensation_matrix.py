"""What does each part of a controller add, on an actuator with its physics in?

The plant is that of `table1_actuator`. The reference is ten cycles of a triangle of 1 Hz from 0.1 to 2.5 um, then a
step from 0.5 to 1.5 um of which nothing is known ahead. All displacements are the true ones. Each row is also run on
plants whose mode is 10 % lower and higher than the controller believes; the maximum sensitivity is the largest of the
three, at both extreme slopes of the law. A loop that is not stable on one of the plants has no worst figure. The
bandwidth is that of a sine of 0.1 um about 1.3 um, followed by the whole
loop without its noise. Last, every parameter of the inverse of law and creep is drawn within 5 %, and put at all
corners: without the exponent n, which the identification holds; with it; and with it in the law's normalised form.
"""

import itertools
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import loop_columns, name_rows, one_panel, open_loop_columns, words, write_results
from table1_actuator import (
    CREEP,
    DAMPING,
    FREQUENCY,
    HIGH,
    LIMITS,
    LOW,
    REST,
    H,
    controllers,
    drawn_law,
    drawn_normalised,
    extreme_slopes,
    reference_plant,
    resting_voltage,
    triangle,
)

RESULTS = Path(__file__).parent / "results" / "compensation_matrix"
DETUNED = (1.0, 0.9, 1.1)
SINE, MIDDLE = 0.1, 1.3  # um
REDUCTIONS = tuple(
    f"{name}_reduction_percent"
    for name in ("hysteresis", "worst_hysteresis", "overshoot", "residual_rms", "worst_residual_rms", "settling_time")
)
FORMS = ("n held", "n drawn", "normalised")

Row = dict[str, float | str | None]


def detuned(plant: hs.Actuator, factor: float) -> hs.Actuator:
    """The plant with its mode elsewhere."""
    return replace(plant, vibration=hs.mode(factor * FREQUENCY, DAMPING))


def max_sensitivity(plants: list[hs.Actuator], controller: hs.TrackingController, slopes: tuple[float, float]) -> float:
    """The largest of all plants and slopes."""
    loops = [hs.control.LinearLoop(plant, H) for plant in plants]
    return max(loop.max_sensitivity(controller, slope) for loop in loops for slope in slopes)


def matrix(
    plant: hs.Actuator, chosen: dict[str, hs.TrackingController], period: float, cycles: int, duration: float
) -> list[Row]:
    """The measures of every controller."""
    wave = {"low": LOW, "high": HIGH, "period": period, "sample_time": H, "cycles": cycles}
    step = {"step": 1.0, "duration": duration, "sample_time": H, "u0": resting_voltage(plant, REST)}
    slopes = extreme_slopes(plant)
    plants = [detuned(plant, factor) for factor in DETUNED]
    rows: list[Row] = []
    for name, controller in chosen.items():
        found = [hs.control.assess_hysteresis(each, controller, **wave) for each in plants]
        steps = [hs.control.assess_step(each, controller, **step) for each in plants]
        if not rows:
            rows.append(open_loop(plant, found[0], steps[0], round(period / H), duration))
        vibration, conditions = steps[0].reduction, found[0].closed.conditions
        rows.append(
            {
                "controller": name,
                "hysteresis_reduction_percent": found[0].hysteresis_reduction_percent,
                "worst_hysteresis_reduction_percent": worst([each.hysteresis_reduction_percent for each in found]),
                **loop_columns(found[0].loop),
                "stable_mode_off": all(each.loop.stable for each in (*found, *steps)),
                "width_um": found[0].closed_width,
                "overshoot_reduction_percent": vibration.overshoot_reduction_percent,
                "residual_rms_reduction_percent": vibration.residual_rms_reduction_percent,
                "worst_residual_rms_reduction_percent": worst(
                    [each.reduction.residual_rms_reduction_percent for each in steps]
                ),
                "settling_time_reduction_percent": vibration.settling_time_reduction_percent,
                "settling_time_s": vibration.closed.settling_time,
                "t98_s": vibration.closed.t98,
                "peak_voltage": max(conditions["highest_u"], steps[0].closed.conditions["highest_u"]),
                "voltage_noise_rms": conditions["voltage_noise_rms"],
                "max_sensitivity": max_sensitivity(plants, controller, slopes),
                "bandwidth_hz": bandwidth(plant, controller, duration),
            }
        )
    return [{key: None if value != value else value for key, value in row.items()} for row in rows]


def worst(reductions: list[float]) -> float:
    """The least; nan if a loop is not stable."""
    return float(np.min(reductions))


def bandwidth(plant: hs.Actuator, controller: hs.TrackingController, duration: float) -> float:
    """Up to which a small sine is followed within 3 dB [Hz]; the first fifth of the duration does not count."""
    sine = {"amplitude": SINE, "lowest": 2.0 * math.pi * 10.0, "transient": duration / 5.0}
    rest = resting_voltage(plant, MIDDLE)
    return float(hs.control.bandwidth(plant, controller, sample_time=H, u0=rest, **sine)) / (2.0 * math.pi)


def open_loop(
    plant: hs.Actuator,
    found: hs.control.HysteresisAssessment,
    step: hs.control.StepAssessment,
    samples: int,
    duration: float,
) -> Row:
    """The row that the others are judged against; `samples` are those of a cycle."""
    reference, moved = found.closed.reference[-samples:], step.reduction.open
    driven = hs.TrackingController(feedforward=hs.InverseFeedforward(law=hs.Line(slope=found.secant_gain)))
    return {
        "controller": "open loop",
        **dict.fromkeys(REDUCTIONS, 0.0),
        **open_loop_columns(found.loop.period, float(hs.metrics.rmse(reference, found.open_y[-samples:]))),
        "stable_mode_off": True,
        "width_um": found.open_width,
        "settling_time_s": moved.settling_time,
        "t98_s": moved.t98,
        "peak_voltage": float(found.open_u.max()),
        "voltage_noise_rms": 0.0,
        "max_sensitivity": 1.0,
        "bandwidth_hz": bandwidth(plant, driven, duration),
    }


def uncertain(
    plant: hs.Actuator, form: str, draws: int, corners: int, period: float, cycles: int
) -> dict[str, float | str]:
    """Hysteresis reduction of the inverse of law and creep, every parameter of it within 5 %.

    The exponent n, which the identification holds at one, is held or drawn too; then also in the `normalised` form.
    """
    quiet = replace(plant, sensor=None)
    reference, samples = triangle(period, cycles)
    t, last = H * np.arange(reference.size), slice(-samples - 1, None)
    wave = {"low": LOW, "high": HIGH, "period": period, "sample_time": H, "cycles": cycles}
    known = hs.control.assess_hysteresis(quiet, controllers(plant)["inverse + creep inverse"], **wave)
    before = hs.loop_metrics(reference[last], known.open_y[last]).relative_width

    def reduction(factors: np.ndarray) -> float:
        wrong = (drawn_normalised if form == "normalised" else drawn_law)(plant.hysteresis, factors[:-1])
        inverse = hs.InverseFeedforward(law=wrong, creep=hs.Creep.per_decade(CREEP * factors[-1]))
        controller = hs.TrackingController(feedforward=inverse, limits=LIMITS)
        run = hs.close_loop(quiet, controller, t, reference)
        after = hs.loop_metrics(reference[last], run.y[last]).relative_width
        return float(hs.metrics.reduction_percent(before, after))

    rng, n = np.random.default_rng(0), 8 if form == "n held" else 9
    found = np.array([reduction(rng.uniform(0.95, 1.05, n)) for _ in range(draws)])
    at_corners = [reduction(np.array(c)) for c in itertools.islice(itertools.product((0.95, 1.05), repeat=n), corners)]
    return {
        "form": form,
        "parameters": n,
        "draws": draws,
        "nominal": known.hysteresis_reduction_percent,
        "median": float(np.median(found)),
        "fifth_percentile": float(np.percentile(found, 5.0)),
        "lowest": float(found.min()),
        "worst_corner": min(at_corners),
    }


def main(smoke: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    plant = reference_plant()
    period, cycles, duration = (0.02, 2, 0.02) if smoke else (1.0, 10, 1.0)
    chosen = controllers(plant)
    if smoke:
        chosen = {name: chosen[name] for name in ("PID", "model-following, damped")}
    rows = matrix(plant, chosen, period, cycles, duration)
    many = (2, 2) if smoke else (200, 512)
    draws = [uncertain(plant, form, *many, period, cycles) for form in FORMS]
    for row in rows:
        shown = {key: math.nan if value is None else value for key, value in row.items()}
        print(
            f"{shown['controller']:<36} hysteresis {shown['hysteresis_reduction_percent']:6.2f} %, mode off by 10 %: "
            f"{shown['worst_hysteresis_reduction_percent']:6.2f} %, rms {1e3 * shown['tracking_rms_um']:6.2f} nm; "
            f"overshoot {shown['overshoot_reduction_percent']:6.2f} %, residual "
            f"{shown['residual_rms_reduction_percent']:6.2f} % "
            f"({shown['worst_residual_rms_reduction_percent']:6.2f} %), settling "
            f"{shown['settling_time_reduction_percent']:6.2f} %; {shown['peak_voltage']:5.1f} V, "
            f"noise {shown['voltage_noise_rms']:.3f} V; sensitivity {shown['max_sensitivity']:.2f}; "
            f"{shown['bandwidth_hz']:.0f} Hz; {words(row)}"
        )
    print(*draws, sep="\n")
    return write_results(RESULTS, rows, draw, {"parameters_within_5_percent": draws}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """What is left of the hysteresis and of the residual vibration, by controller."""
    canvas, ax = one_panel(4.5)
    places = np.arange(len(rows))
    for key, mark, label in (
        ("hysteresis_reduction_percent", "o", "width of the loop"),
        ("worst_hysteresis_reduction_percent", "o", "its largest, the mode off by 10 %"),
        ("residual_rms_reduction_percent", "s", "residual vibration"),
        ("worst_residual_rms_reduction_percent", "s", "its largest, the mode off by 10 %"),
    ):
        left = [math.nan if row[key] is None else 100.0 - float(row[key]) for row in rows]
        ax.plot(left, places, mark, markersize=5, label=label, fillstyle="none" if "worst" in key else "full")
    ax.set_xscale("log")
    name_rows(ax, [str(row["controller"]) for row in rows])
    ax.set_xlabel("Left of the open loop's [%]")
    canvas.legend(loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main()
