"""The equation of motion of a mass on springs along a measured displacement, and the linear plant nearest to it.

    m y'' + c y' + k y + z = F

Both sides go through 1/D(s), D = m s^2 + c s + K of a linear plant, so that derivatives need not be taken of noise and
the equation's error becomes about one of the displacement (Sanathanan and Koerner 1963, Steiglitz and McBride 1965).
The nearest linear plant is that of the equation without z, D its last result. A period is filtered by its spectrum,
any other record in time from rest.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

from hysim._frozen import FloatArray

METHODS = ("split", "runge-kutta", "newmark", "strang")
"""Ways to step an oscillator."""

_ROUNDS = 20  # of the linear fit: it settles in five to ten
_SETTLED = 1e-9
_DAMPING = (1e-3, 2.0)  # damping ratio of D
_HIGHEST = 3.0  # lines up to this multiple of the highest excited one are compared
_EXCITED = 1e-3  # share of the largest line of the input


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
    """Least-squares coefficients of `columns` (n, n_columns) of any sizes."""
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
