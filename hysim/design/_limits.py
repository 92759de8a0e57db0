"""Limits of an actuator and its amplifier."""

import math

import numpy as np

from hysim._frozen import FloatArray, check_positive, checked


@checked
class InputLimits:
    """Limits of an input.

    Parameters
    ----------
    amplitude : float
        Largest distance of the input from the centre [unit of u].
    slew : float
        Largest size of its rate [unit of u / s].
    duration : float
        Length of the record [s].
    sample_time : float
        Time between two samples [s].
    centre : float
        Where the input begins [unit of u].

    Raises
    ------
    ValueError
        If a number is not positive, or the record holds fewer than ten samples.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.InputLimits(amplitude=2.0, slew=4.0, duration=10.0, sample_time=0.1).samples
    101
    """

    amplitude: float
    slew: float
    duration: float
    sample_time: float
    centre: float = 0.0

    def __post_init__(self) -> None:
        check_positive(amplitude=self.amplitude, slew=self.slew, duration=self.duration, sample_time=self.sample_time)
        if self.samples < 10:
            raise ValueError(f"the record must hold at least 10 samples, got {self.samples}")

    @property
    def samples(self) -> int:
        """Number of samples."""
        return 1 + math.floor(self.duration / self.sample_time * (1.0 + 1e-12))

    @property
    def t(self) -> FloatArray:
        """Times of the samples [s], shape (samples,)."""
        return np.asarray(np.arange(self.samples) * self.sample_time, dtype=float)

    @property
    def stride(self) -> float:
        """Largest change of the input from sample to sample [unit of u]."""
        return self.slew * self.sample_time

    def fitted(self, u: FloatArray) -> FloatArray:
        """An input (samples,) within the limits that follows `u` as fast as the slew allows, from the centre on."""
        low, high = self.centre - self.amplitude, self.centre + self.amplitude
        inside, kept, last = np.clip(u, low, high), np.empty(u.size), self.centre
        for k, wanted in enumerate(inside.tolist()):
            last = min(max(wanted, last - self.stride), last + self.stride)
            kept[k] = last
        return kept
