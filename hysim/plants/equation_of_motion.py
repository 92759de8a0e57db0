"""A mass on springs along a displacement: its equation, the nearest linear plant, and records at other rates.

    m y'' + c y' + k y + z = F

Both sides go through 1/D(s), D = m s^2 + c s + K of a linear plant: noise is not differentiated, and the equation's
error becomes about one of the displacement (Sanathanan and Koerner 1963, Steiglitz and McBride 1965). The nearest
linear plant is that without z, D its last result. A period is filtered by its spectrum, others in time from rest.

A periodic input that holds no line above half its rate is brought to a higher one by its spectrum. So is one from rest,
which goes on at both ends as linear prediction continues it (J. P. Burg, 1967), and fades. The output comes back by
stages of a symmetric 31-tap Hamming low-pass each, with the cutoff at half of the new rate, without delay, every r-th
sample kept. There a periodic signal goes on with itself beyond its ends, any other with its point mirror image.
"""

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np
from scipy.signal import cont2discrete, firwin, lfilter, upfirdn

from hysim._basics.frozen import FloatArray

Excitation = Literal["force", "base"]
Method = Literal["split", "runge-kutta", "newmark", "strang"]
METHODS: tuple[Method, ...] = get_args(Method)
"""Ways to step an oscillator."""

_ROUNDS = 20  # of the linear fit: it settles in five to ten
_SETTLED = 1e-9
_DAMPING = (1e-3, 2.0)  # damping ratio of D
_HIGHEST = 3.0  # lines up to this multiple of the highest excited one are compared
_EXCITED = 1e-3  # share of the largest line of the input
HALF_FILTER = 15
_BEYOND = 128  # samples by which a record is continued at either end
_PREDICTING = 32  # samples from which the next one is predicted


class Motion(NamedTuple):
    """Force and displacement, (n_samples,), every `sample_time`: one period, or all since rest."""

    force: FloatArray
    y: FloatArray
    sample_time: float
    periodic: bool


class Linear(NamedTuple):
    """The linear plant nearest to a record."""

    mass: float
    damping: float
    stiffness: float


Filter = Callable[[FloatArray, int], FloatArray]
"""Signals (..., n_samples) and a power k to s^k mass / D(s) of them, shape (..., n_compared)."""


def linear_plant(motion: Motion) -> Linear | None:
    """The linear plant nearest to the record; None if its mass or stiffness is not positive."""
    frequency = _resonance(motion)
    plant = Linear(1.0, 0.2 * frequency, frequency**2)
    for _ in range(_ROUNDS):
        filtered = filtering(motion, plant)
        columns = np.stack([filtered(motion.y, power) for power in (2, 1, 0)], axis=1)
        mass, damping, stiffness = regression(columns, filtered(motion.force, 0))
        if not (mass > 0.0 and stiffness > 0.0):
            return None
        last, plant = plant, checked_plant(mass, damping, stiffness)
        if np.allclose(plant, last, rtol=_SETTLED, atol=0.0):
            break
    return plant


def checked_plant(mass: float, damping: float, stiffness: float) -> Linear:
    """The plant with a damping ratio that a filter can have."""
    critical = 2.0 * math.sqrt(mass * stiffness)
    return Linear(mass, min(max(damping, _DAMPING[0] * critical), _DAMPING[1] * critical), stiffness)


def regression(columns: FloatArray, target: FloatArray) -> list[float]:
    size = np.linalg.norm(columns, axis=0)
    solution: list[float] = (np.linalg.lstsq(columns / size, target, rcond=None)[0] / size).tolist()
    return solution


def filtering(motion: Motion, plant: Linear) -> Filter:
    """mass / D(s) of a plant: on the spectrum of one period, real parts before imaginary ones, or in time from rest."""
    denominator = [each / plant.mass for each in plant]  # else a light plant and a heavy one overflow
    if motion.periodic:
        s = 2j * np.pi * np.fft.rfftfreq(motion.y.size, motion.sample_time)
        force = np.abs(np.fft.rfft(motion.force))
        highest = np.flatnonzero(force > _EXCITED * force[1:].max())[-1]
        s = s[1 : int(_HIGHEST * highest) + 1]

        def by_spectrum(signals: FloatArray, power: int) -> FloatArray:
            spectrum = np.fft.rfft(signals)[..., 1 : s.size + 1] * (s**power / np.polyval(denominator, s))
            return np.concatenate([spectrum.real, spectrum.imag], axis=-1)

        return by_spectrum

    numerators, poles, _ = cont2discrete((np.eye(3)[::-1], denominator), motion.sample_time, "foh")

    def in_time(signals: FloatArray, power: int) -> FloatArray:
        return np.asarray(lfilter(numerators[power], poles, signals, axis=-1))

    return in_time


def _resonance(motion: Motion) -> float:
    """Angular frequency at which the output is largest for its input, among the lines that are excited [rad/s]."""
    force, y = (np.abs(np.fft.rfft(signal - signal.mean())) for signal in (motion.force, motion.y))
    excited = np.flatnonzero(force > 0.1 * force.max())
    line = excited[np.argmax(y[excited] / force[excited])]
    return float(2.0 * np.pi * max(line, 1) / (motion.y.size * motion.sample_time))


def interpolated(period: FloatArray, factor: int) -> FloatArray:
    """One period (n,) at `factor` times the rate; a line at half the old rate is shared by both of its signs."""
    if factor == 1:
        return period
    spectrum = np.fft.rfft(period)
    if period.size % 2 == 0:
        spectrum[-1] *= 0.5
    return np.asarray(np.fft.irfft(spectrum, factor * period.size) * factor)


def interpolated_record(u: FloatArray, factor: int) -> FloatArray:
    """A record (n,) at `factor` times the rate, from its first to its last sample, shape ((n - 1) factor + 1,)."""
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, _BEYOND + 1) / _BEYOND)
    weights = _prediction(u, min(_PREDICTING, u.size // 3))
    behind = _continued(u, weights) * fade
    before = _continued(u[::-1], weights) * fade
    fine = interpolated(np.concatenate([before[::-1], u, behind]), factor)
    return fine[_BEYOND * factor : (_BEYOND + u.size - 1) * factor + 1]


def _prediction(u: FloatArray, order: int) -> FloatArray:
    """Weights of the last samples, the latest first, that predict the next one, by Burg's method; they are stable."""
    ahead, behind, weights = u[1:], u[:-1], np.empty(0)
    for _ in range(order):
        power = float(ahead @ ahead + behind @ behind)
        k = 2.0 * float(ahead @ behind) / power if power > 0.0 else 0.0
        weights = np.append(weights - k * weights[::-1], k)
        ahead, behind = (ahead - k * behind)[1:], (behind - k * ahead)[:-1]
    return weights


def _continued(u: FloatArray, weights: FloatArray) -> FloatArray:
    """The samples after the last one as far as they can be predicted."""
    values = np.concatenate([u[u.size - weights.size :], np.zeros(_BEYOND)])
    for k in range(weights.size, values.size):
        values[k] = weights @ values[k - weights.size : k][::-1]
    return values[weights.size :]


def decimated(y: FloatArray, stages: Sequence[int], *, periodic: bool = False) -> FloatArray:
    """Every (product of stages)-th sample of `y`, filtered stage by stage, with more than 15 samples at each."""
    for factor in stages:
        y = _stage(y, factor, periodic)
    return y


def _stage(y: FloatArray, factor: int, periodic: bool) -> FloatArray:
    taps = firwin(2 * HALF_FILTER + 1, 1.0 / factor)
    if periodic:
        before, after = y[-HALF_FILTER:], y[:HALF_FILTER]
    else:
        before, after = 2.0 * y[0] - y[HALF_FILTER:0:-1], 2.0 * y[-1] - y[-2 : -2 - HALF_FILTER : -1]
    # the first of the filtered outputs is number 2 * HALF_FILTER of the convolution: zeros move it onto the grid
    lead = np.zeros(-2 * HALF_FILTER % factor)
    filtered = upfirdn(taps, np.concatenate([lead, before, y, after]), down=factor)
    first = (lead.size + 2 * HALF_FILTER) // factor
    return np.asarray(filtered[first : first - (-y.size // factor)])
