"""The global search: many starts descend together, and the best are polished.

The best points of a scrambled Sobol sequence that lie apart from each other, and the family's own starts, descend by
projected Levenberg-Marquardt steps in one batch. The best distinct optima descend to the end.
"""

import math
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.identification._descent import Descent, Reached
from hysim.identification._noise import Gaussian
from hysim.identification._problem import Problem
from hysim.models.search_space import SearchSpace

N_SCREENED = 4096
N_DESCENDING = 64
N_STEPS = 40
N_POLISHED = 8
N_POLISHING = 200
N_POLISHED_WHOLE = 3  # optima of a thinned record that descend on all samples
N_BRIEF_SCREENED = 512
N_BRIEF_DESCENDING = 12
_LONG = 512  # samples beyond which fewer points are tried: each costs more, and longer records have fewer optima
_SHORT = 250  # samples of a thinned record beside its reversals
_APART = 0.05  # distance of two starts, in units of the box, under which the better one stands for both
_SAME = 0.01  # likewise of two points after the descent
_GAIN = 1e-5  # share of the sum of squares: a descent that gains less rests
_TOLERANCE = 2e-8  # likewise of a polish
PERFECT = 1e-14  # smallest sigma, in units of the output's size


class Optimum(NamedTuple):
    """Local optimum: coordinates (n_x,), sum of squares, and whether the polish converged."""

    x: FloatArray
    cost: float
    converged: bool


def optima(problem: Problem, *, seed: int, progress: Progress | None = None) -> list[Optimum]:
    """Distinct local optima, best first; empty if every parameter set diverges."""
    space = problem.space
    if not space.coordinates:
        return polish(problem, np.empty((1, 0)))
    if problem.y.size > _LONG and (short := problem.thinned(_SHORT)) is not None:
        likely = optima(short, seed=seed, progress=progress)[:N_POLISHED_WHOLE]
        return _distinct(polish(problem, np.array([each.x for each in likely]))) if likely else []
    share = min(1.0, _LONG / problem.y.size)
    screened = max(256, round(N_SCREENED * share)) if space.screened is None else space.screened
    n_starts = max(16, round(N_DESCENDING * share))
    starts = _starts(problem, screened, seed, n_starts, len(space.starts))
    if not len(starts):
        return []
    reached = _descended(problem, starts, exact=False)
    best = _apart(space, reached.theta[:, : problem.n_x], reached.loss, _SAME, N_POLISHED)
    report = progress or (lambda done, total: None)
    report(1, 2)
    polished = polish(problem, best) if len(best) else []
    report(2, 2)
    return _distinct(polished)


def brief_cost(problem: Problem) -> float:
    """Sum of squares that a short search reaches; inf if every parameter set diverges."""
    return brief_optimum(problem)[1]


def brief_optimum(problem: Problem) -> tuple[FloatArray, float]:
    """Coordinates (n_x,) at which a short search ends, and the sum of squares there; inf if every set diverges."""
    space = problem.space
    if not space.coordinates:
        return np.empty(0), float(problem.costs(np.empty((1, 0)))[0])
    if problem.y.size > _LONG and (short := problem.thinned(_SHORT)) is not None:
        x, cost = brief_optimum(short)
        return x, cost * problem.y.size / short.y.size
    screened = N_BRIEF_SCREENED if space.screened is None else min(space.screened, N_BRIEF_SCREENED)
    best = _starts(problem, screened, 0, N_BRIEF_DESCENDING)
    if not len(best):
        return 0.5 * (space.lower + space.upper), math.inf
    ends = _descended(problem, best, exact=False).theta[:, : problem.n_x]
    costs = problem.costs(ends)
    return ends[np.argmin(costs)], float(costs.min())


def polish(problem: Problem, starts: FloatArray) -> list[Optimum]:
    reached = _descended(problem, starts, exact=True)
    x = reached.theta[:, : starts.shape[1]]
    costs = problem.costs(x)
    return [
        Optimum(x[k], float(costs[k]), bool(reached.at_rest[k])) for k in np.flatnonzero(np.isfinite(costs)).tolist()
    ]


def _descended(problem: Problem, starts: FloatArray, *, exact: bool) -> Reached:
    noise, everything = Gaussian(floor=PERFECT * problem.scale), np.ones((1, problem.y.size))
    descent = Descent(problem, noise, problem.y[np.newaxis], everything, projected=not problem.space.bounds)
    gain, steps = (_TOLERANCE, N_POLISHING) if exact else (_GAIN, N_STEPS)
    return descent.run(problem.completed(starts), tolerance=0.5 * problem.y.size * gain, steps=steps)


def _starts(problem: Problem, screened: int, seed: int, most: int, n_given: int = 0) -> FloatArray:
    candidates = np.concatenate([problem.space.starts, _uniform(problem.space, screened, seed)])
    return _apart(problem.space, candidates, problem.costs(candidates), _APART, most, n_given)


def _uniform(space: SearchSpace, n: int, seed: int) -> FloatArray:
    from scipy.stats import qmc

    sequence = qmc.Sobol(space.lower.size, rng=np.random.default_rng(seed))
    unit = sequence.random_base2(math.ceil(math.log2(max(n, 1))))[:n]
    lower, upper = space.drawn or (space.lower, space.upper)
    return np.asarray(np.clip(lower + unit * (upper - lower), space.lower, space.upper))


def _apart(
    space: SearchSpace, points: FloatArray, cost: FloatArray, distance: float, most: int, n_given: int = 0
) -> FloatArray:
    """The first `n_given` points, and the best others that are apart from those already chosen."""
    unit = (points - space.lower) / (space.upper - space.lower)
    ranked = np.concatenate([np.arange(n_given), n_given + np.argsort(cost[n_given:], kind="stable")])
    chosen: list[int] = []
    for k in ranked[np.isfinite(cost[ranked])]:
        if len(chosen) == most:
            break
        if not chosen or np.abs(unit[chosen] - unit[k]).max(axis=1).min() > distance:
            chosen.append(int(k))
    return points[chosen]


def _distinct(optima: list[Optimum]) -> list[Optimum]:
    distinct: list[Optimum] = []
    for optimum in sorted(optima, key=lambda candidate: candidate.cost):
        if not distinct or optimum.cost > distinct[-1].cost * (1.0 + 1e-6):
            distinct.append(optimum)
    return distinct
