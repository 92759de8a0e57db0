"""One period of a sine, and the checks of the signals' arguments."""

import math
import operator

import numpy as np

from hysim._basics.frozen import FloatArray


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
    if operator.index(value) < 1:
        raise ValueError(f"{name} must be at least 1, got {value}")
    return value
