"""Reduction of the hysteresis against the triangle's period and the controller's sample time: a curve, not a number.

The largest closed width sits in the corner where the triangle turns, and is about the reference's rate times the time
that the loop needs. So a slower triangle, or a faster loop, gives any reduction.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hysim import signals
from hysim._frozen import frozen
from hysim.control import PID, RestingPlant, open_loop
from hysim.metrics import loop_metrics, reduction_percent
from hysim.paper.camera import LOW, CameraLoop
from hysim.paper.loops import HIGH, SAMPLE_TIME, HysteresisCase, law_plant

PERIODS = (13.0, 26.0, 52.0, 104.0, 260.0, 520.0)
CYCLES = 3  # the last one is steady: no loop needs more than a second
_OPEN_SAMPLES = 1300  # of a cycle in open loop


@frozen
class PeriodCurve:
    """Reductions of one controller.

    Parameters
    ----------
    sample_time : float
        [s]
    max_sensitivity : float
        Of its loop.
    reductions : tuple of float
        At each of `PERIODS`, ideal sensor, no delay [%].
    """

    sample_time: float
    max_sensitivity: float
    reductions: tuple[float, ...]


def period_curves(law: Any, fast: HysteresisCase, cameras: Sequence[CameraLoop]) -> tuple[PeriodCurve, ...]:
    """Curves of the 10 ms controller, and of those that were searched for ideal cameras of up to 100 Hz."""
    plant = law_plant(law)
    opened = []
    for period in PERIODS:
        reference = signals.triangle(LOW, HIGH, cycles=CYCLES, samples_per_cycle=_OPEN_SAMPLES)
        opened.append(open_loop(plant, reference, period / _OPEN_SAMPLES, _OPEN_SAMPLES).loop.relative_width)

    def reduction(pid: PID, sample_time: float, period: float, before: float) -> float:
        samples = 2 * round(0.5 * period / sample_time)
        reference = signals.triangle(LOW, HIGH, cycles=CYCLES, samples_per_cycle=samples)
        y = RestingPlant(plant, sample_time).run(pid, reference).y
        last = slice(-samples - 1, None)
        return reduction_percent(before, loop_metrics(reference[last], y[last]).relative_width)

    ideal = [each for each in cameras if each.plant == fast.plant and not (each.quantum or each.shake)]
    controllers = [
        (SAMPLE_TIME, fast.found),
        *((1.0 / each.frame_rate, each.found) for each in ideal if each.frame_rate <= 100.0),
    ]
    return tuple(
        PeriodCurve(
            sample_time=sample_time,
            max_sensitivity=found.max_sensitivity,
            reductions=tuple(
                reduction(found.controller, sample_time, period, before)
                for period, before in zip(PERIODS, opened, strict=True)
            ),
        )
        for sample_time, found in controllers
    )


def period_rows(curves: Sequence[PeriodCurve]) -> list[dict[str, float]]:
    """The points of the curves, for a table."""
    return [
        {"sample_time_s": curve.sample_time, "period_s": period, "reduction_percent": reduction}
        for curve in curves
        for period, reduction in zip(PERIODS, curve.reductions, strict=True)
    ]


def bounds(curves: Sequence[PeriodCurve]) -> tuple[float, float]:
    """The least and the largest reduction of the first controller over all periods."""
    return float(np.min(curves[0].reductions)), float(np.max(curves[0].reductions))
