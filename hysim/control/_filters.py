"""Linear filters of a sampled controller, of second order and less.

    notch     (s^2 + 2 zeta w s + w^2) / (s^2 + 2 zeta' w s + w^2)
    damping   gain w / (s + w)                              integral resonant control
              gain w^2 / (s^2 + 2 zeta w s + w^2)           positive position feedback

Each is discretised by s = w / tan(w h / 2) (z - 1) / (z + 1), which keeps its response at the frequency w.

Sources: A. J. Fleming, S. S. Aphale and S. O. R. Moheimani, IEEE Trans. Nanotechnology 9 (2010); J. L. Fanson and
T. K. Caughey, AIAA Journal 28 (1990).
"""

import math
from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_not_negative, check_positive
from hysim.control._sampled import Feedback
from hysim.models.model import family


class _Filter(ABC):
    """(b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2)."""

    @abstractmethod
    def coefficients(self, sample_time: float) -> FloatArray:
        """Coefficients (b0, b1, b2, a1, a2) of the discrete form."""

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Response of the discrete form at frequencies [rad/s], in their shape."""
        back = np.exp(-1j * np.asarray(frequency, dtype=float) * sample_time)
        b0, b1, b2, a1, a2 = self.coefficients(sample_time)
        return np.asarray((b0 + (b1 + b2 * back) * back) / (1.0 + (a1 + a2 * back) * back))

    def linear(self, sample_time: float) -> Feedback:
        """The filter as a system with two states."""
        b0, b1, b2, a1, a2 = self.coefficients(sample_time)
        return Feedback(
            np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([b1 - a1 * b0, b2 - a2 * b0]), np.array([1.0, 0.0]), float(b0)
        )


@family
class Notch(_Filter):
    """Filter that cancels a resonance in the feedback's command.

    Parameters
    ----------
    natural_frequency, damping_ratio : float
        Resonance, on whose poles the filter's zeros lie: positive [rad/s], and not negative.
    new_damping_ratio : float
        Damping ratio of the filter's poles, positive.

    Raises
    ------
    ValueError
        If a number is outside its range.

    Examples
    --------
    >>> import hysim as hs
    >>> notch = hs.Notch(natural_frequency=100.0, damping_ratio=0.01)
    >>> abs(notch.frequency_response([1.0, 100.0], sample_time=1e-3)).round(3).tolist()
    [1.0, 0.01]
    """

    natural_frequency: float
    damping_ratio: float
    new_damping_ratio: float = 1.0

    def __post_init__(self) -> None:
        check_positive(natural_frequency=self.natural_frequency, new_damping_ratio=self.new_damping_ratio)
        check_not_negative(damping_ratio=self.damping_ratio)

    def coefficients(self, sample_time: float) -> FloatArray:
        w = self.natural_frequency
        numerator, denominator = (
            (w**2, 2.0 * ratio * w, 1.0) for ratio in (self.damping_ratio, self.new_damping_ratio)
        )
        return _discrete(numerator, denominator, w, sample_time)


@family
class DampingLoop(_Filter):
    """Positive feedback of the displacement through a low-pass filter, which damps a resonance.

    It acts on the measurement minus the wanted displacement: without vibration its output is zero.

    Parameters
    ----------
    gain : float
        Static gain, of the plant's sign; its product with the plant's gain must be below one [unit of u / unit of y].
    frequency : float
        Corner of the filter, positive [rad/s].
    damping_ratio : float, optional
        Positive, for a filter of second order (positive position feedback); None for first order (integral resonant
        control).

    Raises
    ------
    ValueError
        If a number is outside its range.

    Examples
    --------
    >>> import hysim as hs
    >>> irc = hs.DampingLoop(gain=2.0, frequency=100.0)
    >>> ppf = hs.DampingLoop(gain=0.2, frequency=100.0, damping_ratio=0.5)
    >>> [abs(loop.frequency_response(100.0, sample_time=1e-3)).round(6).item() for loop in (irc, ppf)]
    [1.414214, 0.2]
    """

    gain: float
    frequency: float
    damping_ratio: float | None = None

    def __post_init__(self) -> None:
        check_positive(frequency=self.frequency, damping_ratio=self.damping_ratio)

    def coefficients(self, sample_time: float) -> FloatArray:
        w = self.frequency
        if self.damping_ratio is None:
            return _discrete((self.gain * w, 0.0, 0.0), (w, 1.0, 0.0), w, sample_time)
        numerator, denominator = (self.gain * w**2, 0.0, 0.0), (w**2, 2.0 * self.damping_ratio * w, 1.0)
        return _discrete(numerator, denominator, w, sample_time)


def _discrete(
    numerator: tuple[float, ...], denominator: tuple[float, ...], frequency: float, sample_time: float
) -> FloatArray:
    if not frequency * sample_time < math.pi:
        raise ValueError(
            f"a filter's frequency must be below pi / sample_time, {math.pi / sample_time:g} rad/s, got {frequency:g}"
        )
    c = frequency / math.tan(0.5 * frequency * sample_time)
    if denominator[2] == 0.0:
        d = denominator[0] + c * denominator[1]
        return np.array([numerator[0], numerator[0], 0.0, denominator[0] - c * denominator[1], 0.0]) / d
    (b0, b1, b2), (a0, a1, a2) = (
        (p + c * q + c * c * r, 2.0 * (p - c * c * r), p - c * q + c * c * r) for p, q, r in (numerator, denominator)
    )
    return np.array([b0, b1, b2, a1, a2]) / a0
