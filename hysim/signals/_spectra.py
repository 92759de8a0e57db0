"""Signals with a chosen spectrum: multisine, sweep, and a synthetic earthquake; and the times of samples.

The earthquake is filtered white noise under an envelope, which leaves the ground at rest where it was.
"""

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, check_not_negative, check_positive, check_positive_and_finite
from hysim.signals._cycles import checked_count


def multisine(
    lines: npt.ArrayLike,
    *,
    rms: float,
    periods: int = 1,
    samples_per_period: int,
    mean: float = 0.0,
    phases: Literal["random", "schroeder"] = "random",
    seed: int | np.random.Generator = 0,
) -> FloatArray:
    """Sum of cosines of equal amplitudes at some multiples of one frequency.

    ::

        u_j = mean + c sum over k in lines of cos(2 pi k j / n + phi_k)

    with n samples a period. At a sample time T line k is the frequency k / (n T).

    Parameters
    ----------
    lines : array of int, shape (n_lines,)
        Increasing multiples, from 1 to below n / 2.
    rms : float
        Root mean square about the mean, which determines c [unit of u].
    periods, samples_per_period : int
        Number of periods, and n.
    mean : float
        [unit of u]
    phases : {"random", "schroeder"}
        Uniformly random phases phi_k; or Schroeder's, -pi m (m - 1) / n_lines for the m-th line, which keep peaks low.
    seed : int or numpy.random.Generator
        Seed of random phases.

    Returns
    -------
    array, shape (periods * samples_per_period,) [unit of u]
        Every period has the same bits.

    Raises
    ------
    ValueError, TypeError
        If the lines do not increase, lie outside their range or are not whole, the rms is not positive, the mean is not
        finite, a count is below 1, or `phases` is another word.

    References
    ----------
    M. R. Schroeder, Synthesis of low-peak-factor signals and binary sequences with low autocorrelation, IEEE Trans.
    Inf. Theory 16 (1970) 85.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> u = hs.signals.multisine([1, 3, 5], rms=2.0, samples_per_period=64, seed=1)
    >>> np.flatnonzero(np.abs(np.fft.rfft(u)) > 1e-12).tolist(), round(float(u.std()), 12)
    ([1, 3, 5], 2.0)
    """
    n = checked_count("samples_per_period", samples_per_period)
    excited = _lines(lines, n)
    if not (0.0 < rms < math.inf and math.isfinite(mean)):
        raise ValueError(f"rms must be positive, and it and the mean finite, got {rms} and {mean}")
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    if phases == "random":
        spectrum[excited] = np.exp(2j * np.pi * np.random.default_rng(seed).random(excited.size))
    elif phases == "schroeder":
        m = np.arange(excited.size)
        spectrum[excited] = np.exp(-1j * np.pi * (m * (m + 1) % (2 * excited.size)) / excited.size)
    else:
        raise ValueError(f'phases must be "random" or "schroeder", got {phases!r}')
    period = np.fft.irfft(spectrum, n)
    return np.tile(mean + rms * (period / period.std()), checked_count("periods", periods))


def sweep(
    start: float,
    stop: float,
    *,
    amplitude: float,
    mean: float = 0.0,
    n_samples: int,
    sample_time: float,
    spacing: Literal["linear", "logarithmic"] = "linear",
) -> FloatArray:
    """A sine whose frequency runs from `start` to `stop`.

    ::

        u(t) = mean + amplitude sin(2 pi p(t)),    t = 0, T, 2 T, ...,    D = n_samples T

        linear         p(t) = start t + (stop - start) t^2 / (2 D)
        logarithmic    p(t) = start D ((stop / start)^(t / D) - 1) / ln(stop / start)

    The phase p is in turns. The frequency would be `stop` one sample after the last. Extremes lie between samples.

    Parameters
    ----------
    start, stop : float
        Frequencies from 0 to below 1 / (2 T) [1 / unit of t]; positive and different for ``"logarithmic"``.
    amplitude, mean : float
        Half the span, and the value in its middle [unit of u].
    n_samples, sample_time : int, and float
        Number of samples, and T [unit of t].
    spacing : {"linear", "logarithmic"}
        Whether the frequency grows by equal steps or by equal factors in equal times.

    Returns
    -------
    array, shape (n_samples,) [unit of u]
        Starts at the mean, rising.

    Raises
    ------
    ValueError
        If a number is not finite or outside its range, or `spacing` is another word.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.sweep(1.0, 3.0, amplitude=2.0, n_samples=5, sample_time=0.125).round(6).tolist()
    [0.0, 1.618034, 1.618034, -1.175571, -1.175571]
    """
    n = checked_count("n_samples", n_samples)
    t, duration = sample_times(n, sample_time), n * sample_time
    if not (0.0 < amplitude < math.inf and math.isfinite(mean)):
        raise ValueError(f"amplitude must be positive, and it and the mean finite, got {amplitude} and {mean}")
    for name, frequency in (("start", start), ("stop", stop)):
        if not 0.0 <= frequency < 0.5 / sample_time:
            raise ValueError(f"{name} must be from 0 to below half the sampling rate, got {frequency}")
    if spacing == "linear":
        turns = start * t + (stop - start) / (2.0 * duration) * t**2
    elif spacing == "logarithmic":
        if start == 0.0 or stop == 0.0 or start == stop:
            raise ValueError(f"a logarithmic sweep has two different positive frequencies, got {start} and {stop}")
        growth = math.log(stop / start)
        turns = start * duration * np.expm1(growth * (t / duration)) / growth
    else:
        raise ValueError(f'spacing must be "linear" or "logarithmic", got {spacing!r}')
    return np.asarray(mean + amplitude * np.sin(2.0 * np.pi * turns))


def sample_times(n_samples: int, sample_time: float) -> FloatArray:
    """Times 0, T, 2 T, ... of samples, shape (n_samples,), each rounded once: errors do not grow along the record.

    If the sample time T is one over a whole number, as 0.1 or 0.001, the times are k over that number: 0.3, not
    0.30000000000000004. A ValueError is raised if `n_samples` is below 1, or `sample_time` is not positive and finite.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signals.sample_times(4, 0.1).tolist()
    [0.0, 0.1, 0.2, 0.3]
    """
    check_positive_and_finite(sample_time=sample_time)
    k, rate = np.arange(float(checked_count("n_samples", n_samples))), max(1.0, np.rint(1.0 / sample_time))
    return k / rate if 1.0 / rate == sample_time else k * sample_time


def _lines(lines: npt.ArrayLike, n: int) -> npt.NDArray[np.intp]:
    excited = np.asarray(lines)
    if excited.dtype.kind not in "iu":
        raise TypeError(f"lines must be whole numbers, got {excited.dtype}")
    if excited.ndim != 1 or not excited.size or not (np.diff(excited) > 0).all():
        raise ValueError(f"lines must be increasing numbers, at least one, got shape {excited.shape}")
    if excited[0] < 1 or excited[-1] >= n / 2:
        raise ValueError(f"lines must be from 1 to below half of {n} samples, got {excited[0]} to {excited[-1]}")
    return excited.astype(np.intp)


ENVELOPES = ("saragoni-hart", "jennings", "none")

_MOST_SAMPLES = 10_000_000  # the spectrum of their noise and its inverse take 1.5 GB
_FEWEST_SAMPLES = 16
_ROUNDING = 1e-9  # of a number of steps


def ground_motion(
    peak: float,
    *,
    duration: float,
    sample_time: float,
    seed: int | np.random.Generator = 0,
    ground_frequency: float = 15.0,
    ground_damping: float = 0.6,
    corner_frequency: float = 1.5,
    corner_damping: float = 0.6,
    envelope: Literal["saragoni-hart", "jennings", "none"] = "saragoni-hart",
    rise: float = 0.2,
    plateau: float = 0.3,
    end: float = 0.05,
) -> FloatArray:
    """Synthetic acceleration of the ground in an earthquake.

    White noise passes a soil layer, the filter of Kanai and Tajimi with w_g = `ground_frequency` and
    zeta_g = `ground_damping`; an envelope lets it grow and fade; and the high pass of Clough and Penzien, with
    w_c = `corner_frequency` and zeta_c = `corner_damping`, takes away the slow motion that the first filter lets pass.
    Without the envelope its density is, at the circular frequency w up to pi / `sample_time`,

    ::

        S(w) = S_0 (w_g^4 + (2 zeta_g w_g w)^2) / ((w_g^2 - w^2)^2 + (2 zeta_g w_g w)^2)
                   w^4 / ((w_c^2 - w^2)^2 + (2 zeta_c w_c w)^2)

    and S_0 follows from the peak. A small baseline c_0 + c_1 t under the same envelope is subtracted at last, so that
    velocity and displacement of the ground, for an acceleration that is linear between samples, are zero at the end.

    The envelope is 1 at its highest, and with D = `duration` one of

    ::

        saragoni-hart   (s exp(1 - s))^b,   s = t / (rise D),    b such that it is `end` at t = D
        jennings        (t / (rise D))^2 up to t = rise D, then 1 for plateau D, then exponential down to `end` at t = D
        none            1

    Parameters
    ----------
    peak : float
        Largest size of the acceleration, hit exactly [unit of u, m/s^2 for a structure].
    duration, sample_time : float
        D, and time between two samples [s].
    seed : int or numpy.random.Generator
        Seed of the noise. The same arguments and seed give the same bits.
    ground_frequency, ground_damping : float
        Circular frequency of the soil [rad/s] and its damping ratio. The defaults are firm soil; Der Kiureghian and
        Neuenhofer have 15 and 0.6 for firm, 10 and 0.4 for medium, 5 and 0.2 for soft soil.
    corner_frequency, corner_damping : float
        Circular frequency of the high pass [rad/s], 1.5, 1 and 0.5 for these soils, and its damping ratio.
    envelope : {"saragoni-hart", "jennings", "none"}
        Shape of the motion in time; ``"none"`` cuts a piece out of a stationary motion.
    rise, plateau, end : float
        Where the envelope reaches 1, and how long ``"jennings"`` stays there, in parts of the duration; its last value.

    Returns
    -------
    array, shape (n,) [unit of u]
        Samples at 0, T, 2 T, ... up to the duration, n = floor(duration / sample_time) + 1 (see `sample_times`).

    Raises
    ------
    ValueError
        If a number is outside its range, a frequency is not below half the sampling rate, rise and plateau leave no
        time for the end, `envelope` is another word, or there are fewer than 16 or more than 1e7 samples.

    References
    ----------
    K. Kanai, Semi-empirical formula for the seismic characteristics of the ground, Bull. Earthq. Res. Inst. 35 (1957)
    309. H. Tajimi, A statistical method of determining the maximum response of a building structure during an
    earthquake, Proc. 2nd World Conf. Earthq. Eng. (1960) 781. R. W. Clough and J. Penzien, Dynamics of Structures,
    McGraw-Hill (1975). P. C. Jennings, G. W. Housner and N. C. Tsai, Simulated earthquake motions, Caltech EERL (1968).
    G. R. Saragoni and G. C. Hart, Simulation of artificial earthquakes, Earthq. Eng. Struct. Dyn. 2 (1974) 249.
    A. Der Kiureghian and A. Neuenhofer, Response spectrum method for multi-support seismic excitations, Earthq. Eng.
    Struct. Dyn. 21 (1992) 713.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> a = hs.signals.ground_motion(3.0, duration=20.0, sample_time=0.01, seed=1)
    >>> a.size, float(np.abs(a).max()), bool(abs(np.trapezoid(a, dx=0.01)) < 1e-12)
    (2001, 3.0, True)
    """
    from scipy.signal import freqs  # loading it takes longer than all other signals together

    n, highest = _n_samples(duration, sample_time), math.pi / sample_time
    check_positive(peak=peak, ground_frequency=ground_frequency, ground_damping=ground_damping)
    check_positive(corner_frequency=corner_frequency, corner_damping=corner_damping)
    for name, value in {"peak": peak, "ground_damping": ground_damping, "corner_damping": corner_damping}.items():
        if math.isinf(value):
            raise ValueError(f"{name} must be finite, got {value}")
    for name, value in {"ground_frequency": ground_frequency, "corner_frequency": corner_frequency}.items():
        if not value < highest:
            raise ValueError(f"{name} must be below half the sampling rate, {highest:g} rad/s, got {value}")
    shape = _envelope(envelope, np.arange(float(n)) * (sample_time / duration), rise, plateau, end)
    n_noise = 1 << (2 * n - 1).bit_length()  # twice the motion, so that its end does not know its begin
    noise = np.random.default_rng(seed).standard_normal(n_noise)
    # the filter of Kanai and Tajimi, by its spectrum: a recursion would bend it at high frequencies
    own = [2.0 * ground_damping * ground_frequency, ground_frequency**2]
    w = 2.0 * np.pi * np.fft.rfftfreq(n_noise, sample_time)
    soil = np.fft.irfft(np.fft.rfft(noise) * freqs(own, [1.0, *own], worN=w)[1], n_noise)
    if envelope == "none":  # the high pass has settled when the motion begins
        motion = _high_passed(soil, sample_time, corner_frequency, corner_damping)[-n:]
    else:
        motion = _high_passed(soil[-n:] * shape, sample_time, corner_frequency, corner_damping)
    motion = _without_drift(motion, shape)
    top = int(np.argmax(np.abs(motion)))
    scaled = np.clip(motion * (peak / abs(motion[top])), -peak, peak)
    scaled[top] = math.copysign(peak, motion[top])
    return np.asarray(scaled)


def _n_samples(duration: float, sample_time: float) -> int:
    check_positive_and_finite(duration=duration, sample_time=sample_time)
    n_steps = duration / sample_time * (1.0 + _ROUNDING)
    if not _FEWEST_SAMPLES <= n_steps + 1.0 < _MOST_SAMPLES:
        raise ValueError(
            f"duration / sample_time must give from {_FEWEST_SAMPLES} to {_MOST_SAMPLES:.0e} samples, got "
            f"{n_steps + 1.0:.6g}"
        )
    return int(n_steps) + 1


def _envelope(name: str, time: FloatArray, rise: float, plateau: float, end: float) -> FloatArray:
    check_choice("envelope", name, ENVELOPES)
    check_not_negative(plateau=plateau)
    for word, value in {"rise": rise, "end": end}.items():
        if not 0.0 < value < 1.0:
            raise ValueError(f"{word} must be between 0 and 1, got {value}")
    if name == "none":
        return np.ones(time.size)
    if name == "saragoni-hart":
        exponent = math.log(end) / (1.0 - 1.0 / rise - math.log(rise))
        s = time / rise
        return np.asarray((s * np.exp(1.0 - s)) ** exponent)
    fall = rise + plateau
    if not fall < 1.0:
        raise ValueError(f"rise + plateau must be below 1, got {rise} + {plateau}")
    fading = np.exp(math.log(end) * np.maximum(0.0, (time - fall) / (1.0 - fall)))
    return np.asarray(np.minimum(1.0, (time / rise) ** 2) * fading)


def _high_passed(motion: FloatArray, sample_time: float, frequency: float, damping: float) -> FloatArray:
    """A motion filtered by s^2 / (s^2 + 2 zeta w s + w^2), from rest, by the bilinear transform."""
    from scipy.signal import bilinear, lfilter

    poles = [1.0, 2.0 * damping * frequency, frequency**2]
    numerator, denominator = bilinear([1.0, 0.0, 0.0], poles, fs=1.0 / sample_time)
    return np.asarray(lfilter(numerator, denominator, motion))


def _without_drift(motion: FloatArray, shape: FloatArray) -> FloatArray:
    """The motion less a straight line under the envelope, with which velocity and displacement end at zero."""
    tilted = shape * np.linspace(0.0, 1.0, motion.size)
    ends = np.stack([_at_the_end(shape), _at_the_end(tilted)], axis=1)
    for _ in range(2):  # the second time takes away the rounding of the first
        level, slope = np.linalg.solve(ends, _at_the_end(motion)).tolist()
        motion = motion - (level * shape + slope * tilted)
    return motion


def _at_the_end(acceleration: FloatArray) -> FloatArray:
    """Velocity and displacement at the end for steps of time 1, each over the number of samples to its power."""
    n, inner = acceleration.size, acceleration.copy()
    inner[[0, -1]] *= 0.5
    remaining = np.arange(n - 1.0, -1.0, -1.0)
    displacement = math.fsum(inner * remaining) + (acceleration[-1] - acceleration[0]) / 6.0
    return np.array([math.fsum(inner) / n, displacement / n**2])
