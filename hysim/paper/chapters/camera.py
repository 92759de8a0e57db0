"""The report's section on the camera in the loop, and the sentence that answers the paper."""

import math
from collections.abc import Sequence

from hysim.datasets import PIXEL
from hysim.paper import markup
from hysim.paper.camera import SENSORS, CameraLoop
from hysim.paper.periods import PERIODS, PeriodCurve, bounds

TARGETS = {"bouc-wen+eq7": ("90 % of the hysteresis", 89.5), "eq4": ("97 % of the vibration", 96.5)}
_PLANTS = {"bouc-wen+eq7": "Bouc-Wen and (7)", "eq4": "(4)"}


def answer(cameras: Sequence[CameraLoop]) -> str:
    """Which sensor the two headline figures need, in a sentence each."""
    return " ".join(needed(plant, cameras) for plant in TARGETS)


def camera_section(cameras: Sequence[CameraLoop], curves: Sequence[PeriodCurve], drawn: markup.Drawn) -> str:
    """The loops behind the camera, and the curves of period and sample time."""
    least, most = bounds(curves)
    return (
        markup.heading("The camera in the loop")
        + markup.paragraph(answer(cameras))
        + markup.paragraph(
            "The loops above read the displacement without error. The paper has a camera: a frame at a time, "
            f"read one frame late, in whole pixels of {PIXEL:g} µm, of an image that shakes by 0.31 pixel (rms). "
            "The controller runs once a frame, searched for each camera in the loop with that noise; no loop "
            "has a maximum sensitivity above 2, the frame of delay included. Another noise than the search's is "
            "measured. Hysteresis: the mean width of the last five of ten cycles of 52 s, 0.1 to 2.5 µm, 0 to "
            "125 V. Vibration: a step of −1 µm within ±16 V, the least of the three reductions, the median of "
            "five noises; a dash where the loop does not settle within 2 %. The searches are short: a longer "
            "one may find somewhat more."
        )
        + markup.figure(
            drawn["camera"],
            "True reduction against the camera's frame rate, each curve a sensor: quantum and shake in pixels. Dashed: "
            "the paper's figures. Loops that do not settle, or are worse than none, lie on the axis.",
        )
        + markup.folded("Every camera", _table(cameras))
        + markup.heading("Period and sample time")
        + markup.paragraph(
            f"The same controller, sampled every 10 ms, takes {least:.1f} to {most:.1f} % of the hysteresis away when "
            f"the triangle's period goes from {PERIODS[0]:g} to {PERIODS[-1]:g} s: the width that remains is the "
            "triangle's rate in the corner times the time of the loop. A reduction without its period says nothing."
        )
        + markup.figure(
            drawn["periods"],
            "Reduction of the hysteresis against the period of the triangle, ideal sensor without delay, for the 10 ms "
            "controller above and those searched for ideal cameras.",
        )
    )


def needed(plant: str, cameras: Sequence[CameraLoop]) -> str:
    """The slowest and coarsest sensor tried that reaches a headline figure, in a sentence."""
    name, least = TARGETS[plant]
    rows = [each for each in cameras if each.plant == plant]
    quantum, shake = SENSORS[-1]
    own = [each for each in rows if _is(each, quantum, shake) and math.isfinite(each.true_reduction_percent)]
    best = max(own, key=lambda each: each.true_reduction_percent, default=None)
    enough = [each for each in rows if each.true_reduction_percent >= least and each.quantum > 0.0]
    if not enough:
        ideal = [each.frame_rate for each in rows if each.true_reduction_percent >= least]
        what = f"an ideal sensor of {min(ideal):g} Hz" if ideal else "more than any sensor tried"
    else:
        slowest = min(each.frame_rate for each in enough)
        worst = max(
            (each for each in enough if each.frame_rate == slowest), key=lambda each: (each.shake, each.quantum)
        )
        shaking = (
            f"of an image that shakes by {worst.shake:g} pixel" if worst.shake else "of an image that does not shake"
        )
        what = (
            f"readings in steps of {worst.quantum:.4f} µm ({worst.quantum / PIXEL:g} pixel), "
            f"{slowest:g} times a second, {shaking}"
        )
    camera = (
        f"reach {best.true_reduction_percent:.0f} % at best, at {best.frame_rate:g} frames a second"
        if best
        else "let no loop settle"
    )
    return f"{name} needs {what}; the paper's own pixels and shake {camera}."


def _is(each: CameraLoop, quantum: float, shake: float) -> bool:
    return abs(each.quantum - quantum * PIXEL) < 1e-12 and each.shake == shake


def _table(cameras: Sequence[CameraLoop]) -> str:
    rows = [
        [
            _PLANTS[each.plant], f"{each.frame_rate:g}", f"{each.quantum / PIXEL:g}", f"{each.shake:g}",
            markup.number(each.true_reduction_percent, 1), markup.number(each.measured_reduction_percent, 1),
            f"{each.tracking_rms:.4f}", f"{each.saturated_percent:.1f}", f"{each.found.max_sensitivity:.2f}",
        ]
        for each in cameras
    ]  # fmt: skip
    header = [
        "plant", "frames a second", "quantum [pixels]", "shake [pixels]", "true reduction [%]",
        "measured reduction [%]", "rms error [µm]", "samples at a limit [%]", "maximum sensitivity",
    ]  # fmt: skip
    return markup.table(header, rows)
