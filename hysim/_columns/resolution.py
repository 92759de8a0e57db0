"""The quantum of a sensor, estimated from its values.

Values that are whole multiples of q, shifted by a constant, have one phase in a wave of length q:

    |mean of exp(2 pi i v / q)| = 1,

and this stays near 1 if each is off by a few hundredths of q, from rounding or an uneven sensor. The wave of the lowest
frequency 1/q with such phases is searched on a grid by one Fourier transform; then q and the shift are those of a
straight line through the values against their whole numbers.

A small enough step fits any values, and any step fits two. A step is accepted if chance would hardly fit as well: m
values within a fraction e of q from whole steps are so with probability about (2 e)^(m - 2) for each of some span/q.
"""

import math

import numpy as np

from hysim._basics.frozen import FloatArray

MOST_LEVELS = 65_536
"""Most steps in the span of the values: finer ones are not searched."""

_FARTHEST = 0.1  # how far from a whole step a value may be, in steps
_COHERENT = 0.8  # of 1: least mean for values within that distance, on a grid that misses the frequency by half a cell
_BY_CHANCE = 1e-3  # largest probability of a step that is accepted
_BINS = 8 * MOST_LEVELS  # of the values: a quarter of the finest wave is one
_FINER = 4  # cells of the grid in a cycle over the span
_AT_ONCE = 200_000  # values against waves
_DIGITS = 1e-12  # of the step: precision of the sums
_SMALLEST = 1e-280  # span: below it numbers lose digits


def output_quantum(values: FloatArray) -> float | None:
    """The greatest step whose multiples, plus a constant, are all values, rounded to its certain digits; or None."""
    levels = np.unique(values)
    with np.errstate(over="ignore"):
        span = float(np.ptp(levels)) if levels.size else 0.0
    rounding = 4.0 * float(np.finfo(float).eps * np.abs(levels).max(initial=0.0))
    if levels.size < 3 or not max(MOST_LEVELS * rounding, _SMALLEST) < span < math.inf:
        return None
    places = (levels - levels[0]) / span
    waves = _candidates(places)
    batch = max(1, _AT_ONCE // places.size)
    for first in range(0, waves.size, batch):
        steps, errors, farthest = _fitted(places, waves[first : first + batch])
        farthest = np.maximum(farthest, rounding / (steps * span))
        # logarithm of the probability that values without a quantum fit as well
        log_chance = (levels.size - 2) * np.log(2.0 * farthest) + 2.0 * np.log(1.0 / steps)
        likely = (farthest <= _FARTHEST) & (log_chance < math.log(_BY_CHANCE))
        if likely.any():
            k = int(np.argmax(likely))
            return _shortest(float(steps[k]) * span, max(float(errors[k]), _DIGITS * float(steps[k])) * span)
    return None


def _candidates(places: FloatArray) -> FloatArray:
    """Numbers of waves over the span that have the places in phase, the lowest first."""
    counts = np.bincount(np.minimum((places * _BINS).astype(int), _BINS - 1), minlength=_BINS)
    coherence = np.abs(np.fft.rfft(counts, _FINER * _BINS))[: _FINER * MOST_LEVELS + 2] / places.size
    inner = coherence[1:-1]
    is_peak = (inner >= coherence[:-2]) & (inner > coherence[2:]) & (inner > _COHERENT)
    cells = np.flatnonzero(is_peak) + 1
    return cells[cells >= _FINER] / float(_FINER)


def _fitted(places: FloatArray, waves: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Near each number of waves the step, its standard error, and how far from a whole step a place is, in steps."""
    phases = np.angle(np.exp(2j * math.pi * np.outer(waves, places)).mean(axis=1)) / (2.0 * math.pi)
    steps, shifts = 1.0 / waves, phases / waves
    for _ in range(3):  # the whole numbers change at most while the line does
        multiples = np.round((places - shifts[:, None]) / steps[:, None])
        centred = multiples - multiples.mean(axis=1, keepdims=True)
        weights = np.maximum((centred**2).sum(axis=1), 1e-300)  # no step is fitted to one whole number
        steps = np.maximum(centred @ places / weights, 1e-300)
        shifts = (places - steps[:, None] * multiples).mean(axis=1)
    off = places - shifts[:, None] - steps[:, None] * multiples
    errors = np.sqrt((off**2).sum(axis=1) / (places.size - 2) / weights)
    return steps, errors, np.abs(off).max(axis=1) / steps


def _shortest(value: float, error: float) -> float:
    rounded = (float(f"{value:.{digits}g}") for digits in range(1, 18))
    return next(short for short in rounded if abs(short - value) <= error or short == value)
