"""A synthetic earthquake: filtered white noise under an envelope, which leaves the ground at rest where it was."""

import math
from typing import Literal

import numpy as np

from hysim._basics.frozen import FloatArray, check_choice, check_not_negative, check_positive

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

    n = _n_samples(duration, sample_time)
    check_positive(peak=peak, ground_frequency=ground_frequency, ground_damping=ground_damping)
    check_positive(corner_frequency=corner_frequency, corner_damping=corner_damping)
    for name, value in {"peak": peak, "ground_damping": ground_damping, "corner_damping": corner_damping}.items():
        if math.isinf(value):
            raise ValueError(f"{name} must be finite, got {value}")
    for name, value in {"ground_frequency": ground_frequency, "corner_frequency": corner_frequency}.items():
        if not value < math.pi / sample_time:
            raise ValueError(
                f"{name} must be below half the sampling rate, {math.pi / sample_time:g} rad/s, got {value}"
            )
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
    for name, value in {"duration": duration, "sample_time": sample_time}.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, got {value}")
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

    numerator, denominator = bilinear(
        [1.0, 0.0, 0.0], [1.0, 2.0 * damping * frequency, frequency**2], fs=1.0 / sample_time
    )
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
