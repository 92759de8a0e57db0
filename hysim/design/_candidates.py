"""Inputs by their turning points, and the usual ones beside which a design is judged."""

from collections.abc import Sequence

import numpy as np

from hysim._frozen import FloatArray
from hysim.design._limits import InputLimits

_TONES = (1, 3, 5, 7, 11)  # multiples of the lowest frequency of a multisine


def through(levels: Sequence[float] | FloatArray, limits: InputLimits) -> FloatArray:
    """The input (samples,) from zero to each level in turn at the full slew, held at the last one.

    A level after which no time is left is cut off.
    """
    corners = np.concatenate([[0.0], np.asarray(levels)])
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))]) / limits.slew
    return np.asarray(np.interp(limits.t, times, corners))


def usual(limits: InputLimits) -> dict[str, FloatArray]:
    """A triangle, one that fades and a multisine, each as large and as fast as the limits allow."""
    period = 4.0 * limits.amplitude / limits.slew
    cycles = max(1.0, limits.duration / period)
    count = max(2, round(2.0 * cycles))
    signs = np.where(np.arange(2 * count) % 2 == 0, 1.0, -1.0)
    fading = np.linspace(1.0, 0.0, 2 * count, endpoint=False)
    time, reach = limits.t / limits.duration, np.zeros(limits.samples)
    for k, tone in enumerate(_TONES):
        reach = reach + np.sin(2.0 * np.pi * max(1, round(cycles / 2.0)) * tone * time + np.pi * k**2 / len(_TONES))
    return {
        "triangle": through(limits.amplitude * signs, limits),
        "fading triangle": through(limits.amplitude * signs * fading, limits),
        "multisine": limits.fitted(limits.amplitude * reach / float(np.abs(reach).max())),
    }


def random_levels(count: int, limits: InputLimits, rng: np.random.Generator) -> FloatArray:
    """Turning points to alternate sides of each other, uniform between the limits."""
    levels = rng.uniform(-1.0, 1.0, count)
    for k in range(1, count):
        before = levels[k - 1]
        upwards = k % 2 == 0
        levels[k] = rng.uniform(before, 1.0) if upwards else rng.uniform(-1.0, before)
    return np.asarray(limits.amplitude * levels)


def most_levels(limits: InputLimits) -> int:
    """Number of turning points of strokes of half the range, for the time that there is."""
    return max(4, int(2.0 * limits.duration * limits.slew / limits.amplitude))
