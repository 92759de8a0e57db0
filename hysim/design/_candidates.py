"""Inputs by their turning points, and the usual ones beside which a design is judged."""

import numpy as np

from hysim._frozen import FloatArray
from hysim.design._limits import InputLimits

_HOLD = 0.02  # of the record, a pause at a turning point in the mean
_TONES = (1, 3, 5, 7, 11)  # multiples of the lowest frequency of a multisine


def through(levels: FloatArray, limits: InputLimits, holds: FloatArray | None = None) -> FloatArray:
    """The input (samples,) from zero to each level in turn at the full slew, held there for its time [s].

    What comes after the end of the record is cut off; before it the last level is held.
    """
    pauses = np.zeros(levels.size) if holds is None else holds
    strokes = np.abs(np.diff(levels, prepend=0.0)) / limits.slew
    times = np.concatenate([[0.0], np.cumsum(np.column_stack([strokes, pauses]).ravel())])
    return np.asarray(np.interp(limits.t, times, np.append(0.0, np.repeat(levels, 2))))


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


def random_strokes(limits: InputLimits, rng: np.random.Generator) -> FloatArray:
    """Turning points to alternate sides of each other, and how long each is held, (n_levels, 2), to fill the record.

    Some inputs have short strokes, and some hold most of their turning points.
    """
    strokes, bias, held = [], float(rng.uniform(0.3, 3.0)), float(rng.choice([0.0, 0.2, 0.6]))
    last, time, side = 0.0, 0.0, 1.0 if rng.random() < 0.5 else -1.0
    while time < limits.duration:
        level = last + (side * limits.amplitude - last) * float(rng.random()) ** bias
        hold = float(rng.exponential(_HOLD * limits.duration)) if rng.random() < held else 0.0
        time, last, side = time + abs(level - last) / limits.slew + hold, level, -side
        strokes.append((level, hold))
    return np.array(strokes)
