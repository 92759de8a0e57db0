"""Times of samples: increasing, and evenly spaced where a plant needs it."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only

_UNEVEN = 1e-6  # difference of steps, in their mean


def increasing_times(t: npt.ArrayLike, n_samples: int, name: str = "t") -> FloatArray:
    """Times of `n_samples` samples, shape (n_samples,), read-only.

    Raises
    ------
    TypeError
        If the times are not numbers.
    ValueError
        If their number is another one, one is not finite, or they do not increase; the message names the sample.
    """
    times = read_only(t, name, ndim=1)
    check_times(times, n_samples, name)
    return times


def check_times(times: FloatArray, n_samples: int, name: str = "t") -> None:
    """Raise a ValueError unless there are `n_samples` times and they increase."""
    if times.ndim != 1:
        raise ValueError(f"{name} must have one axis, got shape {times.shape}")
    if times.size != n_samples:
        raise ValueError(f"u and {name} must have equal lengths, got {n_samples} and {times.size}")
    if not (np.diff(times) > 0).all():
        k = int(np.argmax(np.diff(times) <= 0)) + 1
        raise ValueError(f"time must increase from sample to sample, got {times[k]} after {times[k - 1]} at sample {k}")


def even_step(times: FloatArray) -> float:
    """The constant step of at least two times; ValueError if steps differ by more than 1e-6 of their mean."""
    if times.size < 2:
        raise ValueError(f"a time step needs at least 2 samples, got {times.size}")
    steps = np.diff(times)
    mean = float(steps.mean())
    if np.ptp(steps) > _UNEVEN * mean:
        low, high = steps.min(), steps.max()
        raise ValueError(f"the time must be evenly spaced, got steps from {low} to {high}: resample first")
    return mean
