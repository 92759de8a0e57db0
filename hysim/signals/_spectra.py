"""Signals with a chosen spectrum: the multisine and the sweep; and the times of samples."""

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
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
    if not 0.0 < sample_time < math.inf:
        raise ValueError(f"sample_time must be positive and finite, got {sample_time}")
    if not (0.0 < amplitude < math.inf and math.isfinite(mean)):
        raise ValueError(f"amplitude must be positive, and it and the mean finite, got {amplitude} and {mean}")
    for name, frequency in (("start", start), ("stop", stop)):
        if not 0.0 <= frequency < 0.5 / sample_time:
            raise ValueError(f"{name} must be from 0 to below half the sampling rate, got {frequency}")
    t, duration = sample_times(n, sample_time), n * sample_time
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
    if not 0.0 < sample_time < math.inf:
        raise ValueError(f"sample_time must be positive and finite, got {sample_time}")
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
