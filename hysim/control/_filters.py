"""Filters of the reference (shaping, the inverse of a mode), and of the feedback.

**Shaping.** Impulses A_i at the samples t_i leave no vibration of a mode with the poles p = -zeta w +- j w_d if

    sum A_i exp(-p t_i) = 0,    sum A_i = 1

Half a period pi / w_d is seldom a whole number of samples: impulses at 0 and at the two samples around it satisfy
both equations exactly (zero vibration, ZV). Applied twice, the derivative by the frequency vanishes too (ZVD), three
times the second one (ZVDD). Zeros at Chebyshev's points of a band make the largest residual in it smallest
(extra-insensitive, EI). Two moving averages in a row turn a step into constant acceleration and deceleration.

**Inverse.** A mode under the hold is A(z) y = B(z) w, B(z) = b_1 z + b_2, whose zero -b_2 / b_1 close to -1 makes its
inverse ring. With the reference known two samples ahead

    w = A(z) B(1/z) / B(1)^2 r        gives       y = B(z) B(1/z) / B(1)^2 r

without phase and vibration: y is the reference through the weights b_1 b_2, b_1^2 + b_2^2, b_1 b_2.

**Feedback.** Linear filters of second order and less:

    notch     (s^2 + 2 zeta w s + w^2) / (s^2 + 2 zeta' w s + w^2)
    damping   gain w / (s + w)                              integral resonant control
              gain w^2 / (s^2 + 2 zeta w s + w^2)           positive position feedback

Each is discretised by s = w / tan(w h / 2) (z - 1) / (z + 1), which keeps its response at the frequency w. Sources: N.
C. Singer and W. P. Seering, J. Dyn. Sys. Meas. Control 112 (1990); W. E. Singhose, W. P. Seering and N. C. Singer, J.
Mech. Design 116 (1994), EI; M. Tomizuka, J. Dyn. Sys. Meas. Control 109 (1987), inverse; A. J. Fleming, S. S. Aphale,
S. O. R. Moheimani, IEEE Trans. Nanotechnology 9 (2010); J. L. Fanson, T. K. Caughey, AIAA Journal 28 (1990).
"""

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import Count, FloatArray, NotNegative, Positive, check_count, check_lengths, check_positive
from hysim.control._controller import Feedback
from hysim.models.model import family
from hysim.plants.stages import sampled, vibration_stage
from hysim.plants.transfer_function import mode


class _Filter(ABC):
    """(b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2)."""

    @abstractmethod
    def coefficients(self, sample_time: float) -> FloatArray:
        """Coefficients (b0, b1, b2, a1, a2) of the discrete form."""

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Response of the discrete form at frequencies [rad/s] for a sample time [s], of the shape of `frequency`."""
        back = np.exp(-1j * np.asarray(frequency, dtype=float) * sample_time)
        b0, b1, b2, a1, a2 = self.coefficients(sample_time)
        return np.asarray((b0 + (b1 + b2 * back) * back) / (1.0 + (a1 + a2 * back) * back))

    def linear(self, sample_time: float) -> Feedback:
        """The discrete form as a linear controller."""
        b0, b1, b2, a1, a2 = self.coefficients(sample_time)
        A, B = np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([b1 - a1 * b0, b2 - a2 * b0])
        return Feedback(A, B, np.array([1.0, 0.0]), float(b0))


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

    natural_frequency: Positive
    damping_ratio: NotNegative
    new_damping_ratio: Positive = 1.0

    def coefficients(self, sample_time: float) -> FloatArray:
        w = self.natural_frequency
        zeros, poles = 2.0 * self.damping_ratio * w, 2.0 * self.new_damping_ratio * w
        return _discrete((w**2, zeros, 1.0), (w**2, poles, 1.0), w, sample_time)


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
        Positive, for second order (positive position feedback); None for first order (integral resonant control).

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
    frequency: Positive
    damping_ratio: Positive | None = None

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


_BOXES = 2  # moving averages in a row: their motion has a bounded acceleration, that of a mode in least time


@family
class Shaper:
    """Filter of the reference that excites no vibration of some modes.

    Parameters
    ----------
    natural_frequencies, damping_ratios : sequence of float
        Modes, positive [rad/s] and from 0 to below 1; none for smoothing alone.
    repeats : int
        How often each mode's shaper is applied: more repeats tolerate a larger error of its frequency.
    smoothing : float
        Duration of the moving averages together [s]; 0 for none.

    Raises
    ------
    ValueError
        If lengths differ or a number is outside its range.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> hs.Shaper.zv(np.pi, 0.0).impulses(sample_time=0.5).round(6).tolist()
    [0.5, 0.0, 0.5]
    """

    natural_frequencies: tuple[float, ...] = ()
    damping_ratios: tuple[float, ...] = ()
    repeats: Count = 1
    smoothing: NotNegative = 0.0

    def __post_init__(self) -> None:
        check_lengths(natural_frequencies=self.natural_frequencies, damping_ratios=self.damping_ratios)
        check_positive(natural_frequencies=min(self.natural_frequencies, default=None))
        if not all(0.0 <= ratio < 1.0 for ratio in self.damping_ratios):
            raise ValueError(f"damping_ratios must be from 0 to below 1, got {self.damping_ratios}")

    @classmethod
    def zv(cls, natural_frequencies: npt.ArrayLike, damping_ratios: npt.ArrayLike) -> Self:
        """Zero vibration of one mode or several: numbers or sequences [rad/s] and [1], as in the constructor."""
        return cls(
            natural_frequencies=tuple(np.atleast_1d(natural_frequencies)),
            damping_ratios=tuple(np.atleast_1d(damping_ratios)),
        )

    @classmethod
    def zvd(cls, natural_frequencies: npt.ArrayLike, damping_ratios: npt.ArrayLike) -> Self:
        """As `zv`, with zero derivative of the vibration by the frequency."""
        return replace(cls.zv(natural_frequencies, damping_ratios), repeats=2)

    @classmethod
    def zvdd(cls, natural_frequencies: npt.ArrayLike, damping_ratios: npt.ArrayLike) -> Self:
        """As `zvd`, with zero second derivative."""
        return replace(cls.zv(natural_frequencies, damping_ratios), repeats=3)

    @classmethod
    def ei(cls, natural_frequency: float, damping_ratio: float, tolerance: float = 0.1, zeros: int = 2) -> Self:
        """Smallest residual of one mode, [rad/s] and [1], whose frequency lies in a band.

        `tolerance` is the half width of the band relative to the frequency, from 0 to below 1, `zeros` the number of
        frequencies in it without vibration, at least 1, half a period each. Other numbers raise ValueError.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.Shaper.ei(100.0, 0.01, tolerance=0.1, zeros=1) == hs.Shaper.zv(100.0, 0.01)
        True
        """
        if not 0.0 <= tolerance < 1.0:
            raise ValueError(f"tolerance must be from 0 to below 1, got {tolerance}")
        check_count("zeros", zeros)
        places = np.sin(np.pi * (np.arange(zeros) - 0.5 * (zeros - 1)) / zeros)
        return cls.zv(natural_frequency * (1.0 + tolerance * places), np.full(zeros, damping_ratio))

    def impulses(self, sample_time: float) -> FloatArray:
        """Weights of the reference now, a sample ago, and so on; a ValueError if half a period is below a sample."""
        total = np.ones(1)
        for frequency, ratio in zip(self.natural_frequencies, self.damping_ratios, strict=True):
            one = _zero_vibration(frequency, ratio, sample_time)
            for _ in range(self.repeats):
                total = np.convolve(total, one)
        samples = max(1, round(self.smoothing / (_BOXES * sample_time)))
        for _ in range(_BOXES):
            total = np.convolve(total, np.full(samples, 1.0 / samples))
        return total


@family
class ModeInverse:
    """Inverse of a resonance, for a smooth reference that is known two samples ahead.

    A step of one in the reference makes an output of about 1 / (natural_frequency sample_time)^2.

    Parameters
    ----------
    natural_frequency, damping_ratio : float
        Positive [rad/s], and not negative; otherwise a ValueError.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> weights = hs.ModeInverse(natural_frequency=100.0, damping_ratio=0.0).weights(sample_time=1e-3)
    >>> ramp = np.array([2.0, 1.0, 0.0, -1.0])  # the output is held: right in the middle of the sample
    >>> round(float(weights @ ramp), 9), round(float(weights.sum()), 9)
    (0.5, 1.0)
    """

    natural_frequency: Positive
    damping_ratio: NotNegative

    def weights(self, sample_time: float) -> FloatArray:
        """Weights of the reference two samples ahead, one ahead, now, and one ago."""
        stage = sampled(vibration_stage(mode(self.natural_frequency, self.damping_ratio), sample_time), sample_time)
        C, A = stage.output[3:], stage.A
        a1, a2 = -np.trace(A), np.linalg.det(A)
        b1 = C @ stage.B[0]
        b2 = C @ A @ stage.B[0] + a1 * b1
        return np.asarray(np.convolve([1.0, a1, a2], [b2, b1]) / (b1 + b2) ** 2)


def _zero_vibration(frequency: float, ratio: float, sample_time: float) -> FloatArray:
    damped = frequency * math.sqrt(1.0 - ratio**2)
    samples = math.floor(math.pi / (damped * sample_time) + 1e-9)
    if samples < 1:
        raise ValueError(f"half a period of {frequency:g} rad/s must not be shorter than a sample, {sample_time:g} s")
    places = np.array([0, samples, samples + 1])
    residual = np.exp(complex(ratio * frequency, -damped) * sample_time * places)
    weights = np.linalg.solve([residual.real, residual.imag, np.ones(3)], [0.0, 0.0, 1.0])
    impulses = np.zeros(samples + 2)
    impulses[places] = weights
    return np.trim_zeros(np.where(np.abs(impulses) < 1e-15, 0.0, impulses), "b")
