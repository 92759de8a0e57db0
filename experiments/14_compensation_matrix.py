"""What does each part of a controller add, on an actuator with its physics in?

The plant is the law of Table 1 (degree 2, n = 1: bounded, unlike the best fit of the plain law, whose memory wanders),
a creep of 1.5 % a decade, a mode of 500 Hz with a damping ratio of 0.01, 0 to 150 V, 20 kHz, one sample of delay, 1 nm
rms of noise. The reference is ten cycles of a triangle of 1 Hz from 0.1 to 2.5 um, then a step from 0.5 to 1.5 um of
which nothing is known ahead. All displacements are the true ones. Each row is also run on plants whose mode is 10 %
lower and higher than the controller believes; the maximum sensitivity is the largest of the three, at both extreme
slopes of the law. Last, every parameter of the inverse of law and creep is drawn within 5 %, and put at all corners,
without the exponent n, which the identification holds, and with it.
"""

import itertools
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "compensation_matrix"
H = 1.0 / 20e3  # s
FREQUENCY, DAMPING = 2.0 * math.pi * 500.0, 0.01
LOW, HIGH = 0.1, 2.5  # um
DETUNED = (1.0, 0.9, 1.1)
CREEP = 1.5  # % a decade
LIMITS = (0.0, 150.0)  # V
REDUCTIONS = tuple(
    f"{name}_reduction_percent"
    for name in ("hysteresis", "worst_hysteresis", "overshoot", "residual_rms", "worst_residual_rms", "settling_time")
)

Row = dict[str, float | str | None]


def reference_plant() -> hs.Actuator:
    """The actuator of the experiment, in V and um."""
    structure = hs.PolynomialBoucWen(input_coefficients=(1.0, 0.1))
    return hs.Actuator(
        hysteresis=hs.identify(structure, hs.datasets.table1(), fixed={"n": 1.0}).model,
        creep=hs.Creep.per_decade(CREEP),
        vibration=hs.mode(FREQUENCY, DAMPING),
        sensor=hs.Sensor(noise=1e-3, delay=H),
    )


def controllers(plant: hs.Actuator) -> dict[str, hs.TrackingController]:
    """One for each row, each a line more than one above it."""
    inverse = hs.InverseFeedforward.of(plant)
    mode = {"natural_frequency": FREQUENCY, "damping_ratio": DAMPING}
    slow, faster = hs.PID(ki=1000.0), hs.PID(ki=4000.0)
    alone = hs.PID(kp=1.68, ki=1.74e5, kd=0.0214)  # the largest ki within a sensitivity of 2 on all three plants
    base = hs.TrackingController(feedforward=inverse, limits=LIMITS)
    feedback = replace(base, feedback=slow)
    damped = replace(base, feedback=faster, damping=hs.DampingLoop(gain=20.0, frequency=FREQUENCY / 3.0))
    inverted = replace(feedback, shaper=hs.Shaper(smoothing=0.6e-3), mode_inverse=hs.ModeInverse(**mode), preview=True)
    return {
        "PID": hs.TrackingController(feedback=alone, limits=LIMITS),
        "inverse": replace(base, feedforward=hs.InverseFeedforward(law=plant.hysteresis)),
        "inverse + creep inverse": base,
        "... + PID": feedback,
        "... + PID + notch": replace(base, feedback=faster, notch=hs.Notch(**mode)),
        "... + PID + damping": damped,
        "... + PID + ZV shaping + preview": replace(
            feedback, shaper=hs.Shaper.zv(FREQUENCY, DAMPING), preview=True
        ),
        "... + PID + ZVD shaping + preview": replace(
            feedback, shaper=hs.Shaper.zvd(FREQUENCY, DAMPING), preview=True
        ),
        "... + PID + mode-inverse + preview": inverted,
        "model-following": replace(inverted, model=plant),
        "model-following, damped": replace(damped, shaper=inverted.shaper, mode_inverse=inverted.mode_inverse,
                                           preview=True, model=plant),
    }  # fmt: skip


def detuned(plant: hs.Actuator, factor: float) -> hs.Actuator:
    """The plant with its mode elsewhere."""
    return replace(plant, vibration=hs.mode(factor * FREQUENCY, DAMPING))


def resting_voltage(plant: hs.Actuator, displacement: float) -> float:
    """At which the plant, its creep included, rests at a displacement."""
    return float(brentq(lambda u: plant.creep.dc_gain * plant.hysteresis.response([u])[0] - displacement, *LIMITS))


def max_sensitivity(plants: list[hs.Actuator], controller: hs.TrackingController, slopes: tuple[float, float]) -> float:
    """The largest of all plants and slopes."""
    loops = [hs.control.LinearLoop(plant, H) for plant in plants]
    return max(loop.max_sensitivity(controller, slope) for loop in loops for slope in slopes)


def matrix(plant: hs.Actuator, period: float, cycles: int, duration: float) -> list[Row]:
    """The measures of every controller."""
    wave = {"low": LOW, "high": HIGH, "period": period, "sample_time": H, "cycles": cycles}
    step = {"step": 1.0, "duration": duration, "sample_time": H, "u0": resting_voltage(plant, 0.5)}
    slopes = extreme_slopes(plant)
    plants = [detuned(plant, factor) for factor in DETUNED]
    rows: list[Row] = []
    for name, controller in controllers(plant).items():
        found = [hs.control.assess_hysteresis(each, controller, **wave) for each in plants]
        steps = [hs.control.assess_step(each, controller, **step) for each in plants]
        if not rows:
            rows.append(open_loop(found[0], steps[0], round(period / H)))
        vibration, conditions = steps[0].reduction, found[0].closed.conditions
        rows.append(
            {
                "controller": name,
                "hysteresis_reduction_percent": found[0].hysteresis_reduction_percent,
                "worst_hysteresis_reduction_percent": min(each.hysteresis_reduction_percent for each in found),
                "width_um": found[0].closed_width,
                "tracking_rms_um": found[0].tracking_rms,
                "overshoot_reduction_percent": vibration.overshoot_reduction_percent,
                "residual_rms_reduction_percent": vibration.residual_rms_reduction_percent,
                "worst_residual_rms_reduction_percent": min(
                    each.reduction.residual_rms_reduction_percent for each in steps
                ),
                "settling_time_reduction_percent": vibration.settling_time_reduction_percent,
                "settling_time_s": vibration.closed.settling_time,
                "t98_s": vibration.closed.t98,
                "peak_voltage": max(conditions["highest_u"], steps[0].closed.conditions["highest_u"]),
                "voltage_noise_rms": conditions["voltage_noise_rms"],
                "max_sensitivity": max_sensitivity(plants, controller, slopes),
            }
        )
    return [{key: None if value != value else value for key, value in row.items()} for row in rows]


def open_loop(found: hs.control.HysteresisAssessment, step: hs.control.StepAssessment, samples: int) -> Row:
    """The row that the others are judged against; `samples` are those of a cycle."""
    reference, moved = found.closed.reference[-samples:], step.reduction.open
    return {
        "controller": "open loop",
        **dict.fromkeys(REDUCTIONS, 0.0),
        "width_um": found.open_width,
        "tracking_rms_um": float(hs.metrics.rmse(reference, found.open_y[-samples:])),
        "settling_time_s": moved.settling_time,
        "t98_s": moved.t98,
        "peak_voltage": float(found.open_u.max()),
        "voltage_noise_rms": 0.0,
        "max_sensitivity": 1.0,
    }


def extreme_slopes(plant: hs.Actuator) -> tuple[float, float]:
    """The least and the largest slope of the law along two cycles of the limits' lower four fifths."""
    u = np.tile(hs.signals.triangle(0.0, 0.8 * LIMITS[1], cycles=1, samples_per_cycle=2400)[:-1], 2)
    slopes = np.diff(plant.hysteresis.response(u)) / np.diff(u)
    return float(slopes.min()), float(slopes.max())


def uncertain(
    plant: hs.Actuator, draws: int, corners: int, period: float, cycles: int, *, exponent: bool
) -> dict[str, float]:
    """Hysteresis reduction of the inverse of law and creep, every parameter of it within 5 %.

    The exponent n, which the identification holds at one, is drawn too or held.
    """
    quiet = replace(plant, sensor=None)
    samples = round(period / H)
    reference = hs.signals.triangle(LOW, HIGH, cycles=cycles, samples_per_cycle=samples)
    t, last = H * np.arange(reference.size), slice(-samples - 1, None)
    wave = {"low": LOW, "high": HIGH, "period": period, "sample_time": H, "cycles": cycles}
    known = hs.control.assess_hysteresis(quiet, controllers(plant)["inverse + creep inverse"], **wave)
    before = hs.loop_metrics(reference[last], known.open_y[last]).relative_width

    def reduction(factors: np.ndarray) -> float:
        law, (first, second) = plant.hysteresis, plant.hysteresis.input_coefficients
        names = ("beta", "gamma", "gain", "offset", "z0", "n")
        wrong = replace(
            law,
            **{name: factor * getattr(law, name) for name, factor in zip(names, factors[:-3], strict=False)},
            input_coefficients=(first * factors[-3], second * factors[-2]),
        )
        inverse = hs.InverseFeedforward(law=wrong, creep=hs.Creep.per_decade(CREEP * factors[-1]))
        controller = hs.TrackingController(feedforward=inverse, limits=LIMITS)
        run = hs.close_loop(quiet, controller, t, reference)
        after = hs.loop_metrics(reference[last], run.y[last]).relative_width
        return float(hs.metrics.reduction_percent(before, after))

    rng, n = np.random.default_rng(0), 9 if exponent else 8
    found = np.array([reduction(rng.uniform(0.95, 1.05, n)) for _ in range(draws)])
    at_corners = [reduction(np.array(c)) for c in itertools.islice(itertools.product((0.95, 1.05), repeat=n), corners)]
    return {
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
    rows = matrix(plant, period, cycles, duration)
    many = (2, 2) if smoke else (200, 512)
    draws = [uncertain(plant, *many, period, cycles, exponent=exponent) for exponent in (False, True)]
    for row in rows:
        shown = {key: math.nan if value is None else value for key, value in row.items()}
        print(
            f"{shown['controller']:<36} hysteresis {shown['hysteresis_reduction_percent']:6.2f} %, mode off by 10 %: "
            f"{shown['worst_hysteresis_reduction_percent']:6.2f} %, rms {1e3 * shown['tracking_rms_um']:6.2f} nm; "
            f"overshoot {shown['overshoot_reduction_percent']:6.2f} %, residual "
            f"{shown['residual_rms_reduction_percent']:6.2f} % "
            f"({shown['worst_residual_rms_reduction_percent']:6.2f} %), settling "
            f"{shown['settling_time_reduction_percent']:6.2f} %; {shown['peak_voltage']:5.1f} V, "
            f"noise {shown['voltage_noise_rms']:.3f} V; sensitivity {shown['max_sensitivity']:.2f}"
        )
    print(*draws, sep="\n")
    if not smoke:
        write_results(RESULTS, rows, draw, {"parameters_within_5_percent": draws})
    return rows


def draw(rows: list[Row]) -> Figure:
    """What is left of the hysteresis and of the residual vibration, by controller."""
    canvas = figure(height=4.5)
    ax = canvas.add_subplot()
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
    ax.set_yticks(places, [str(row["controller"]) for row in rows])
    ax.invert_yaxis()
    ax.set_xlabel("Left of the open loop's [%]")
    canvas.legend(loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main()
