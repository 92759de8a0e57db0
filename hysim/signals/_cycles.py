"""Periodic signals, whose cycles have the same bits, and signals with nested loops."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_finite, check_positive_and_finite, read_only


def staircase(low: float, high: float, step: float, *, cycles: int = 1, samples_per_step: int = 1) -> FloatArray:
    """Steps from low to high and back.

    Every level of the rise occurs again on the fall, so that both extremes occur twice in a row. `step` is the height
    of a step [unit of u], which divides the span. The result has shape (2 * cycles * levels * samples_per_step,) [unit
    of u]. ValueError if high is not above low, the step does not divide the span, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.staircase(0, 10, 5).tolist()
    [0.0, 5.0, 10.0, 10.0, 5.0, 0.0]
    """
    span = checked_span(low, high)
    check_positive_and_finite(step=step)
    n_steps = round(span / step)
    if n_steps < 1 or not math.isclose(n_steps * step, span, rel_tol=1e-9):
        raise ValueError(f"step must divide the span {span}, got {step}: {span / step:.6g} steps")
    up = np.linspace(low, high, n_steps + 1)
    cycle = np.repeat(np.append(up, up[::-1]), checked_count("samples_per_step", samples_per_step))
    return np.tile(cycle, checked_count("cycles", cycles))


def triangle(low: float, high: float, *, cycles: int, samples_per_cycle: int) -> FloatArray:
    """Straight lines from low to high and back, sampled evenly.

    `low` and `high` are both hit exactly [unit of u]. The result, shape (cycles * samples_per_cycle + 1,) [unit of u],
    starts and ends at low. ValueError if high is not above low, `cycles` below 1, `samples_per_cycle` odd or below 2.

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

    `amplitude` is half the span, `mean` its middle [unit of u]. With `samples_per_cycle` a multiple of 4 both extremes
    are hit. A loop needs two `cycles`: it is measured from extreme to extreme. The result has shape (cycles *
    samples_per_cycle + 1,) [unit of u]. ValueError if the amplitude is not positive or a count is below 1.

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
    one step. Both extremes are hit exactly [unit of u]; a line has `samples_per_cycle` samples with both ends. The
    result (cycles * samples_per_cycle,) starts at low. ValueError if high is not above low, or a count is too small.

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
    cycle = np.repeat([float(low), float(high)], checked_count("samples_per_half", samples_per_half))
    return np.tile(cycle, checked_count("cycles", cycles))


_MOST_SAMPLES = 100_000_000  # of lines between extremes: 0.8 GB
_ROUNDING = 1e-12  # of a number of steps


def reversal_curves(low: float, high: float, *, curves: int, samples_per_step: int = 1) -> FloatArray:
    """First-order reversal curves: from low up to one level after the other, and back each time.

    Both extremes are hit exactly [unit of u]. The levels above low divide the span evenly into N = `curves` parts. With
    m = `samples_per_step` from one level to the next, curve k = 1 ... N takes 2 k m samples. The result (N (N + 1) m +
    1,) starts and ends at low [unit of u]. A ValueError is raised if high is not above low, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.reversal_curves(0.0, 1.0, curves=2).tolist()
    [0.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0]
    """
    checked_span(low, high)
    m = checked_count("samples_per_step", samples_per_step)
    up = np.linspace(low, high, checked_count("curves", curves) * m + 1)
    ways = [np.append(up[: k * m], up[k * m : 0 : -1]) for k in range(1, curves + 1)]
    return np.append(np.concatenate(ways), low)


def decaying_sine(
    amplitude: float, *, mean: float = 0.0, cycles: int, samples_per_cycle: int, ratio: float | None = None
) -> FloatArray:
    """Cycles of a sine, each smaller than the one before: nested loops, which also erase a memory.

    Cycle k = 0 ... N - 1 is mean + a_k sin(2 pi j / samples_per_cycle). The amplitude changes where the sine crosses
    its mean, and with it the slope there, but not the value.

    Parameters
    ----------
    amplitude, mean : float
        Amplitude a_0 of the first cycle, and value in the middle of the cycles [unit of u].
    cycles, samples_per_cycle : int
        Number N of cycles, and of their samples; a multiple of 4 hits both extremes of every cycle exactly.
    ratio : float, optional
        a_k / a_(k-1), above 0 and at most 1. By default the amplitudes fall evenly, a_k = a_0 (N - k) / N.

    Returns
    -------
    array, shape (cycles * samples_per_cycle + 1,) [unit of u]
        Starts and ends at the mean.

    Raises
    ------
    ValueError
        If the amplitude is not positive, the ratio is not in its range, or a count is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.decaying_sine(2.0, cycles=2, samples_per_cycle=4).tolist()
    [0.0, 2.0, 0.0, -2.0, 0.0, 1.0, 0.0, -1.0, 0.0]
    """
    return _swings(_amplitudes(amplitude, cycles, ratio), mean, samples_per_cycle)


def growing_sine(
    amplitude: float, *, mean: float = 0.0, cycles: int, samples_per_cycle: int, ratio: float | None = None
) -> FloatArray:
    """Cycles of a sine, each larger than the one before: the amplitudes of `decaying_sine` in reverse order.

    Arguments, shape and errors are those of `decaying_sine`; `amplitude` is the last one, `ratio` a_k / a_(k+1).

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.growing_sine(2.0, cycles=2, samples_per_cycle=4, ratio=0.25).tolist()
    [0.0, 0.5, 0.0, -0.5, 0.0, 2.0, 0.0, -2.0, 0.0]
    """
    return _swings(_amplitudes(amplitude, cycles, ratio)[::-1], mean, samples_per_cycle)


def extremes(
    levels: npt.ArrayLike, *, samples_per_line: int | Sequence[int] | None = None, max_step: float | None = None
) -> FloatArray:
    """Any turning points, joined by straight lines that are sampled evenly.

    Parameters
    ----------
    levels : array, shape (n_levels,)
        Turning points in the order of time, each hit exactly [unit of u]. Two equal ones are a rest.
    samples_per_line : int or sequence of int, length n_levels - 1, optional
        Samples from a level to the next, the same for all lines or for each.
    max_step : float, optional
        Instead of it, the largest step from sample to sample [unit of u]: a rate times the sample time. A line has as
        many even steps as it needs, a rest has one.

    Returns
    -------
    array, shape (1 + sum of the samples of all lines,) [unit of u]
        Starts at the first level and ends at the last.

    Raises
    ------
    ValueError
        If there are fewer than two levels, one is not finite, not exactly one of `samples_per_line` and `max_step` is
        given, a count is below 1, the step is not positive, or more than 1e8 samples would result.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.extremes([0.0, 1.0, 0.5], samples_per_line=2).tolist()
    [0.0, 0.5, 1.0, 0.75, 0.5]
    """
    turns = read_only(levels, "levels", ndim=1)
    if turns.size < 2:
        raise ValueError(f"a line needs two levels, got {turns.size}")
    counts = _samples_of_lines(turns, samples_per_line, max_step)
    lines = [np.linspace(a, b, m + 1)[1:] for a, b, m in zip(turns[:-1], turns[1:], counts, strict=True)]
    return np.concatenate([turns[:1], *lines])


def _amplitudes(largest: float, cycles: int, ratio: float | None) -> FloatArray:
    check_positive_and_finite(amplitude=largest)
    k = np.arange(checked_count("cycles", cycles))
    if ratio is None:
        return largest * ((cycles - k) / cycles)
    if not 0.0 < ratio <= 1.0:
        raise ValueError(f"ratio must be above 0 and at most 1, got {ratio}")
    return np.asarray(largest * ratio**k)


def _swings(amplitudes: FloatArray, mean: float, samples_per_cycle: int) -> FloatArray:
    check_finite(mean=mean)
    period = unit_sine(checked_count("samples_per_cycle", samples_per_cycle))
    return np.append(mean + np.outer(amplitudes, period).ravel(), mean)


def _samples_of_lines(turns: FloatArray, samples: int | Sequence[int] | None, max_step: float | None) -> list[int]:
    if max_step is not None and samples is None:
        check_positive_and_finite(max_step=max_step)
        lengths = [abs(float(rise)) / max_step for rise in np.diff(turns)]
        if sum(lengths) > _MOST_SAMPLES:
            raise ValueError(
                f"the lines would take {sum(lengths):.3g} steps, more than {_MOST_SAMPLES:.0e}: enlarge max_step"
            )
        return [max(1, math.ceil(length * (1 - _ROUNDING))) for length in lengths]
    if max_step is not None or samples is None:
        raise ValueError("give either samples_per_line or max_step")
    counts = list(samples) if isinstance(samples, Sequence) else [samples] * (turns.size - 1)
    if len(counts) != turns.size - 1:
        raise ValueError(f"samples_per_line must be one for each of {turns.size - 1} lines, got {len(counts)}")
    return [checked_count("samples_per_line", m) for m in counts]


def unit_sine(n: int) -> FloatArray:
    """One period from 0, n samples; symmetric to the bit."""
    from_zero = n / 4 - np.abs((np.arange(n) + n / 4) % n - n / 2)  # the phase, mapped to the middle half turn
    return np.asarray(np.sin(2 * np.pi * from_zero / n))


def checked_span(low: float, high: float) -> float:
    """The span between two extremes, which must be finite and in order."""
    if not (math.isfinite(high - low) and high > low):
        raise ValueError(f"high must be above low, and both finite, got low {low} and high {high}")
    return high - low


def checked_count(name: str, value: int) -> int:
    if not isinstance(value, int | np.integer):
        raise TypeError(f"{name} must be a whole number, got {value!r}")
    if value < 1:
        raise ValueError(f"{name} must be at least 1, got {value}")
    return value
