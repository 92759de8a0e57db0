"""Periodic signals; every cycle has the same bits."""

import math

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.signals._parts import checked_count, checked_span, unit_sine


def staircase(low: float, high: float, step: float, *, cycles: int = 1, samples_per_step: int = 1) -> FloatArray:
    """Steps from low to high and back.

    Every level of the rise occurs again on the fall, so that both extremes occur twice in a row: 0, 5, ..., 125, 125,
    ..., 5, 0. `step` is the height of a step [unit of u], which divides the span. The result has shape (2 * cycles *
    levels * samples_per_step,) [unit of u]. A ValueError is raised if high is not above low, the step does not divide
    the span, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.staircase(0, 10, 5).tolist()
    [0.0, 5.0, 10.0, 10.0, 5.0, 0.0]
    """
    span = checked_span(low, high)
    if not (math.isfinite(step) and step > 0):
        raise ValueError(f"step must be positive and finite, got {step}")
    n_steps = round(span / step)
    if n_steps < 1 or not math.isclose(n_steps * step, span, rel_tol=1e-9):
        raise ValueError(f"step must divide the span {span}, got {step}: {span / step:.6g} steps")
    up = np.linspace(low, high, n_steps + 1)
    cycle = np.repeat(np.append(up, up[::-1]), checked_count("samples_per_step", samples_per_step))
    return np.tile(cycle, checked_count("cycles", cycles))


def triangle(low: float, high: float, *, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Straight lines from low to high and back, sampled evenly.

    `low` and `high` are both hit exactly [unit of u]. The result has shape (cycles * samples_per_cycle + 1,) [unit of
    u], and starts and ends at low. A ValueError is raised if high is not above low, `cycles` is below 1, or
    `samples_per_cycle` is odd or below 2.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=4).tolist()
    [0.0, 0.5, 1.0, 0.5, 0.0]
    """
    checked_span(low, high)
    if checked_count("samples_per_cycle", samples_per_cycle) % 2:
        raise ValueError(f"samples_per_cycle must be even, so that a sample lies on the peak, got {samples_per_cycle}")
    up = np.linspace(low, high, samples_per_cycle // 2 + 1)
    return np.append(np.tile(np.append(up[:-1], up[:0:-1]), checked_count("cycles", cycles)), low)


def sine(amplitude: float, *, mean: float = 0.0, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Samples of mean + amplitude sin(2 pi k / samples_per_cycle), from the mean to the mean.

    `amplitude` is half the span, and `mean` the value in its middle [unit of u]. With a multiple of 4 as
    `samples_per_cycle` both extremes are hit. A loop needs two `cycles`: it is measured from extreme to extreme. The
    result has shape (cycles * samples_per_cycle + 1,) [unit of u]. A ValueError is raised if the amplitude is not
    positive, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.sine(2.0, mean=1.0, cycles=1, samples_per_cycle=4).tolist()
    [1.0, 3.0, 1.0, -1.0, 1.0]
    """
    if not (math.isfinite(amplitude) and amplitude > 0 and math.isfinite(mean)):
        raise ValueError(f"amplitude must be positive, and it and the mean finite, got {amplitude} and {mean}")
    period = mean + amplitude * unit_sine(checked_count("samples_per_cycle", samples_per_cycle))
    return np.append(np.tile(period, checked_count("cycles", cycles)), mean)


def sawtooth(low: float, high: float, *, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Straight lines from low to high, and back in one step, sampled evenly.

    The step back takes as long as any other step. Reversed, ``[::-1]``, the signal falls along the lines and rises in
    one step. `low` and `high` are both hit exactly [unit of u]; a line has `samples_per_cycle` samples, at least 2,
    with both ends among them. The result has shape (cycles * samples_per_cycle,), starts at low and ends at high [unit
    of u]. A ValueError is raised if high is not above low, or a count is too small.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.sawtooth(0.0, 1.0, cycles=2, samples_per_cycle=3).tolist()
    [0.0, 0.5, 1.0, 0.0, 0.5, 1.0]
    """
    checked_span(low, high)
    if checked_count("samples_per_cycle", samples_per_cycle) < 2:
        raise ValueError("samples_per_cycle must be at least 2, one for each end of the line, got 1")
    return np.tile(np.linspace(low, high, samples_per_cycle), checked_count("cycles", cycles))


def square(low: float, high: float, *, cycles: int, samples_per_half: int) -> FloatArray:
    """Low and high in turn, each held for `samples_per_half` samples.

    `low` and `high` are the two values [unit of u]. The result has shape (2 * cycles * samples_per_half,), starts at
    low and ends at high [unit of u]. A ValueError is raised if high is not above low, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.square(18.0, 50.0, cycles=2, samples_per_half=2).tolist()
    [18.0, 18.0, 50.0, 50.0, 18.0, 18.0, 50.0, 50.0]
    """
    checked_span(low, high)
    return np.tile(
        np.repeat([low, high], checked_count("samples_per_half", samples_per_half)), checked_count("cycles", cycles)
    )
