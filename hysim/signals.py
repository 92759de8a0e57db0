"""Inputs for loop studies, exact to the bit at their extremes.

Each returns the samples of a signal, without time: a cycle starts at its lowest value (a sine at its mean),
and every cycle has the same bits.
"""

import math
import operator

import numpy as np

from hysim._frozen import FloatArray


def staircase(low: float, high: float, step: float, *, cycles: int = 1, samples_per_step: int = 1) -> FloatArray:
    """Steps from low to high and back.

    Every level of the way up comes again on the way down, so that both extremes occur twice in a row:
    0, 5, ..., 125, 125, ..., 5, 0.

    Parameters
    ----------
    low, high, step : float
        Extremes, and height of a step, of which the span has a whole number [unit of u].
    cycles : int
        Number of ways up and down.
    samples_per_step : int
        How often each level is sampled.

    Returns
    -------
    array, shape (2 * cycles * levels * samples_per_step,) [unit of u]

    Raises
    ------
    ValueError
        If high is not above low, the step does not divide the span, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.staircase(0, 10, 5).tolist()
    [0.0, 5.0, 10.0, 10.0, 5.0, 0.0]
    """
    span = _span(low, high)
    if not (math.isfinite(step) and step > 0):
        raise ValueError(f"step must be positive and finite, got {step}")
    n_steps = round(span / step)
    if n_steps < 1 or not math.isclose(n_steps * step, span, rel_tol=1e-9):
        raise ValueError(f"step must divide the span {span}, got {step}: {span / step:.6g} steps")
    up = np.linspace(low, high, n_steps + 1)
    cycle = np.repeat(np.append(up, up[::-1]), _count("samples_per_step", samples_per_step))
    return np.tile(cycle, _count("cycles", cycles))


def triangle(low: float, high: float, *, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Straight lines from low to high and back, sampled evenly.

    Parameters
    ----------
    low, high : float
        Extremes, both hit exactly [unit of u].
    cycles : int
        Number of ways up and down.
    samples_per_cycle : int
        Even number of samples of a cycle.

    Returns
    -------
    array, shape (cycles * samples_per_cycle + 1,) [unit of u]
        Starts and ends at low.

    Raises
    ------
    ValueError
        If high is not above low, `cycles` is below 1, or `samples_per_cycle` is odd or below 2.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=4).tolist()
    [0.0, 0.5, 1.0, 0.5, 0.0]
    """
    _span(low, high)
    if _count("samples_per_cycle", samples_per_cycle) % 2:
        raise ValueError(f"samples_per_cycle must be even, so that a sample lies on the peak, got {samples_per_cycle}")
    up = np.linspace(low, high, samples_per_cycle // 2 + 1)
    return np.append(np.tile(np.append(up[:-1], up[:0:-1]), _count("cycles", cycles)), low)


def sine(amplitude: float, *, mean: float = 0.0, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Samples of mean + amplitude sin(2 pi k / samples_per_cycle).

    Parameters
    ----------
    amplitude, mean : float
        Half the span, and the value in its middle [unit of u].
    cycles : int
        Number of periods. A loop needs two: it is cut from extreme to extreme.
    samples_per_cycle : int
        Samples of a period; with a multiple of 4 both extremes are hit.

    Returns
    -------
    array, shape (cycles * samples_per_cycle + 1,) [unit of u]
        Starts and ends at the mean.

    Raises
    ------
    ValueError
        If the amplitude is not positive, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.sine(2.0, mean=1.0, cycles=1, samples_per_cycle=4).tolist()
    [1.0, 3.0, 1.0, -1.0, 1.0]
    """
    if not (math.isfinite(amplitude) and amplitude > 0 and math.isfinite(mean)):
        raise ValueError(f"amplitude must be positive, and it and the mean finite, got {amplitude} and {mean}")
    n = _count("samples_per_cycle", samples_per_cycle)
    from_zero = n / 4 - np.abs((np.arange(n) + n / 4) % n - n / 2)  # the phase, folded into the middle half turn
    period = mean + amplitude * np.sin(2 * np.pi * from_zero / n)
    return np.append(np.tile(period, _count("cycles", cycles)), mean)


def reversal_curves(low: float, high: float, *, curves: int, samples_per_step: int = 1) -> FloatArray:
    """First-order reversal curves: up from low to one level after the other, and back each time.

    The levels divide the span evenly, and the highest one is last. With N curves and m samples for the way from
    one level to the next, sampled evenly, curve k = 1 ... N takes 2 k m samples.

    Parameters
    ----------
    low, high : float
        Extremes, both hit exactly [unit of u].
    curves : int
        Number N of levels above low from which a curve falls.
    samples_per_step : int
        Samples m from level to level; every level is hit exactly.

    Returns
    -------
    array, shape (curves * (curves + 1) * samples_per_step + 1,) [unit of u]
        Starts and ends at low.

    Raises
    ------
    ValueError
        If high is not above low, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.reversal_curves(0.0, 1.0, curves=2).tolist()
    [0.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0]
    """
    _span(low, high)
    m = _count("samples_per_step", samples_per_step)
    up = np.linspace(low, high, _count("curves", curves) * m + 1)
    ways = [np.append(up[: k * m], up[k * m : 0 : -1]) for k in range(1, curves + 1)]
    return np.append(np.concatenate(ways), low)


def _span(low: float, high: float) -> float:
    if not (math.isfinite(high - low) and high > low):
        raise ValueError(f"high must be above low, and both finite, got low {low} and high {high}")
    return high - low


def _count(name: str, value: int) -> int:
    if operator.index(value) < 1:
        raise ValueError(f"{name} must be at least 1, got {value}")
    return value
