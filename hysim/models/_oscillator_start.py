"""Where to begin the search for an oscillator's parameters, from its input and output alone.

With the displacement y known, the equation of motion is linear in what multiplies known signals,

    m y'' + c y' + k y + A w(y) = F,    dw/dy = 1 - |w|^n (g + b sign(w y')),

where w is the memory of a law with A = 1, exact along the measured y. Both sides go through 1/D(s), D = m s^2 +
c s + K of the best linear plant, so that derivatives need not be taken of noise and the equation's error becomes
about one of the displacement (Sanathanan and Koerner 1963, Steiglitz and McBride 1965). The linear plant is
the same equation without w, D its last result. A periodic record is averaged over its periods and filtered by its
spectrum, another in time from rest. What is left to search is (b, g, n), which costs no simulation of the plant.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.kernels import boucwen as kernels
from hysim.models.search_space import SearchSpace

_ROUNDS = 20  # of the linear fit: it settles in five to ten
_DAMPING = (1e-3, 2.0)  # damping ratio of D
_FREQUENCIES = 8  # tried where no linear plant is near
_SCREENED = 256
_IMPROVED = 3  # of the screened points
_APART, _SAME = 0.1, 0.03  # distances in units of the box: of points to be improved, and of what becomes of them
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
"""Signals (..., n_samples) and a power k to s^k / D(s) of them, shape (..., n_compared)."""


def start(motion: Motion, laws: SearchSpace, wanted: int) -> tuple[Linear, list[dict[str, float]]]:
    """The plant of small motions, and the best sets of mass, damping, stiffness, A, beta, gamma, n.

    `laws` is the box of the laws with A = 1 along `motion.y`. Where no law is found the plant is the nearest linear
    one. A law that yields and drifts may be near no linear plant: filters of several frequencies are tried then.

    Raises
    ------
    ValueError
        If no plant with a positive mass and stiffness is near.
    """
    nearest = _linear_plant(motion)
    found = _starts(motion, nearest, laws, wanted) if nearest else _starts_from_afar(motion, laws, wanted)
    sets = [each for _, each in found]
    if sets:
        return _small_motions(sets[0]), sets
    if nearest is None:
        raise ValueError(
            "the record is not that of a mass on springs: no plant with a positive mass is near; check the sign of u "
            "and y, the time, and excitation="
        )
    return nearest, sets


def _starts_from_afar(motion: Motion, laws: SearchSpace, wanted: int) -> list[tuple[float, dict[str, float]]]:
    """As `_starts`, with the filter that the best set asks for which is found with any filter."""
    frequencies = np.geomspace(4.0 / motion.y.size, 1.0, _FREQUENCIES) / motion.sample_time
    tried = [each for w in frequencies for each in _starts(motion, Linear(1.0, 0.2 * w, w**2), laws, 1)]
    best = sorted(tried, key=lambda each: each[0])[:1]
    return [again for _, each in best for again in _starts(motion, _small_motions(each), laws, wanted)] or best


def _small_motions(values: Mapping[str, float]) -> Linear:
    return _checked(values["mass"], values["damping"], values["stiffness"] + values["A"])


def _linear_plant(motion: Motion) -> Linear | None:
    """The linear plant nearest to the record; None if its mass or stiffness is not positive."""
    frequency = _resonance(motion)
    plant = Linear(1.0, 0.2 * frequency, frequency**2)
    for _ in range(_ROUNDS):
        filtered = _filter(motion, plant)
        columns = np.stack([filtered(motion.y, power) for power in (2, 1, 0)], axis=1)
        mass, damping, stiffness = _regression(columns, filtered(motion.force, 0))
        if not (mass > 0.0 and stiffness > 0.0):
            return None
        plant = _checked(mass, damping, stiffness)
    return plant


def _checked(mass: float, damping: float, stiffness: float) -> Linear:
    """The plant with a damping ratio that a filter can have."""
    critical = 2.0 * math.sqrt(mass * stiffness)
    return Linear(mass, min(max(damping, _DAMPING[0] * critical), _DAMPING[1] * critical), stiffness)


def _regression(columns: FloatArray, target: FloatArray) -> list[float]:
    size = np.linalg.norm(columns, axis=0)
    solution: list[float] = (np.linalg.lstsq(columns / size, target, rcond=None)[0] / size).tolist()
    return solution


def _starts(motion: Motion, plant: Linear, laws: SearchSpace, wanted: int) -> list[tuple[float, dict[str, float]]]:
    """The best sets with the share of the force that each leaves unexplained, in the order of these."""
    from scipy.optimize import minimize

    equation = _Equation(motion, plant, laws)

    def error(x: FloatArray) -> float:
        return float(equation.errors(np.clip(x, laws.lower, laws.upper)[np.newaxis])[0])

    points = np.concatenate([laws.starts, _spread(laws)])
    chosen = _apart(laws, points, equation.errors(points), _APART)[:_IMPROVED]
    options = {"xatol": 3e-3, "fatol": 1e-5 * equation.linear_error, "maxfev": 100}
    reached = [minimize(error, points[k], method="Nelder-Mead", options=options) for k in chosen]
    ends = np.clip([each.x for each in reached], laws.lower, laws.upper).reshape(-1, laws.lower.size)
    errors = np.array([each.fun for each in reached])
    sets = [(float(errors[k]), equation.parameters(ends[k])) for k in _apart(laws, ends, errors, _SAME)]
    return [each for each in sets if _is_a_plant(each[1])][:wanted]


def _is_a_plant(values: Mapping[str, float]) -> bool:
    return values["mass"] > 0.0 and values["A"] > 0.0 and values["stiffness"] + values["A"] > 0.0


class _Equation:
    """The equation of motion along a measured displacement, for many laws at once."""

    def __init__(self, motion: Motion, plant: Linear, laws: SearchSpace) -> None:
        self.laws, self.filtered, self.periodic = laws, _filter(motion, plant), motion.periodic
        self.along = read_only(np.tile(motion.y, 2) if motion.periodic else motion.y)
        self.known = np.stack([self.filtered(motion.y, power) for power in (2, 1, 0)], axis=1)
        self.basis = np.linalg.qr(self.known)[0]
        self.target = self.filtered(motion.force, 0)
        self.left = self.target - self.basis @ (self.basis.T @ self.target)
        self.size = float(self.target @ self.target)
        self.linear_error = float(self.left @ self.left) / self.size or 1.0

    def memories(self, x: FloatArray) -> FloatArray:
        """Filtered memories (n_sets, n_compared) of the laws at the coordinates x."""
        law = self.laws.parameters(x)
        names = ("A", "beta", "gamma", "n", "z0")
        memory = read_only(np.stack([np.broadcast_to(law[name], len(x)) for name in names], axis=1))
        output = read_only(np.tile([1.0, 0.0, 0.0], (len(x), 1)))
        w = np.empty((len(x), self.along.size))
        in_chunks(
            lambda begin, end: kernels.batch(memory, output, self.along[np.newaxis], w, begin, end),
            len(x),
            minimum=8,
        )
        if self.periodic:
            w = w[:, self.along.size // 2 :]
        with np.errstate(invalid="ignore", over="ignore"):
            return self.filtered(w, 0)

    def errors(self, x: FloatArray) -> FloatArray:
        """Share of the force's sum of squares that the best mass, damping, stiffness and A leave, (n_sets,)."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            w = self.memories(x)
            w = w - (w @ self.basis) @ self.basis.T
            errors = self.linear_error - (w @ self.left) ** 2 / np.sum(w**2, axis=1) / self.size
        return np.where(np.isfinite(errors), errors, np.inf)

    def parameters(self, x: FloatArray) -> dict[str, float]:
        """The user's parameters at one point (n_x,)."""
        columns = np.column_stack([self.known, self.memories(x[np.newaxis])[0]])
        mass, damping, stiffness, A = _regression(columns, self.target)
        law = {name: float(value[0]) for name, value in self.laws.parameters(x[np.newaxis]).items()}
        unit = abs(A) ** (1.0 - law["n"]) if A else 1.0  # z = A w
        shape = {"beta": law["beta"] * unit, "gamma": law["gamma"] * unit, "n": law["n"]}
        return {"mass": mass, "damping": damping, "stiffness": stiffness, "A": A, **shape}


def _resonance(motion: Motion) -> float:
    """Angular frequency at which the output is largest for its input, among the lines that are excited [rad/s]."""
    force, y = (np.abs(np.fft.rfft(signal - signal.mean())) for signal in (motion.force, motion.y))
    excited = np.flatnonzero(force > 0.1 * force.max())
    line = excited[np.argmax(y[excited] / force[excited])]
    return float(2.0 * np.pi * max(line, 1) / (motion.y.size * motion.sample_time))


def _filter(motion: Motion, plant: Linear) -> Filter:
    denominator = list(plant)
    if motion.periodic:
        s = 2j * np.pi * np.fft.rfftfreq(motion.y.size, motion.sample_time)
        force = np.abs(np.fft.rfft(motion.force))
        highest = np.flatnonzero(force > _EXCITED * force[1:].max())[-1]
        s = s[1 : int(_HIGHEST * highest) + 1]

        def by_spectrum(signals: FloatArray, power: int) -> FloatArray:
            spectrum = np.fft.rfft(signals)[..., 1 : s.size + 1] * (s**power / np.polyval(denominator, s))
            return np.concatenate([spectrum.real, spectrum.imag], axis=-1)

        return by_spectrum

    powers = [1.0], [1.0, 0.0], [1.0, 0.0, 0.0]
    discrete = [cont2discrete((power, denominator), motion.sample_time, "foh") for power in powers]

    def in_time(signals: FloatArray, power: int) -> FloatArray:
        b, a, _ = discrete[power]
        return np.asarray(lfilter(np.ravel(b), a, signals, axis=-1))

    return in_time


def _spread(laws: SearchSpace) -> FloatArray:
    from scipy.stats import qmc

    unit = qmc.Sobol(laws.lower.size, scramble=False).random(_SCREENED)
    return np.asarray(laws.lower + unit * (laws.upper - laws.lower))


def _apart(laws: SearchSpace, points: FloatArray, errors: FloatArray, distance: float) -> list[int]:
    """Finite points, best first, that are farther from each other than `distance`, in units of the box."""
    unit = (points - laws.lower) / (laws.upper - laws.lower)
    ranked = np.argsort(errors, kind="stable")
    chosen: list[int] = []
    for k in ranked[np.isfinite(errors[ranked])].tolist():
        if all(np.abs(unit[k] - unit[other]).max() > distance for other in chosen):
            chosen.append(k)
    return chosen
