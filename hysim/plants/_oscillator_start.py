"""Starts of the search for an oscillator's parameters, from its input and output alone.

With the displacement y known, the equation of motion is linear in what multiplies known signals,

    m y'' + c y' + k y + A w(y) = F,    dw/dy = 1 - |w|^n (g + b sign(w y')),

where w is the memory of a law with A = 1, exact along the measured y. Both sides are filtered as in
`hysim.plants.equation_of_motion`. What is left to search is (b, g, n), which costs no simulation of the plant.
"""

from collections.abc import Mapping

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.kernels import boucwen as kernels
from hysim.models.search_space import SearchSpace
from hysim.plants.equation_of_motion import Linear, Motion, checked_plant, filtering, linear_plant, regression

_FREQUENCIES = 8  # tried where no linear plant is near
_SCREENED = 256
_IMPROVED = 3  # of the screened points
_APART, _SAME = 0.1, 0.03  # distances in units of the box: of points to be improved, and of what becomes of them


def start(motion: Motion, laws: SearchSpace, wanted: int) -> tuple[Linear, list[dict[str, float]]]:
    """The plant of small motions, and the best sets of mass, damping, stiffness, A, beta, gamma, n."""
    nearest = linear_plant(motion)
    starts = _starts(motion, nearest, laws, wanted) if nearest else _starts_from_afar(motion, laws, wanted)
    sets = [each for _, each in starts]
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
    return checked_plant(values["mass"], values["damping"], values["stiffness"] + values["A"])


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
        self.laws, self.filtered, self.periodic = laws, filtering(motion, plant), motion.periodic
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
        mass, damping, stiffness, A = regression(columns, self.target)
        law = {name: float(value[0]) for name, value in self.laws.parameters(x[np.newaxis]).items()}
        unit = abs(A) ** (1.0 - law["n"]) if A else 1.0  # z = A w
        shape = {"beta": law["beta"] * unit, "gamma": law["gamma"] * unit, "n": law["n"]}
        return {"mass": mass, "damping": damping, "stiffness": stiffness, "A": A, **shape}


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
