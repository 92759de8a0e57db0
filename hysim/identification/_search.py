"""The global search: many starts descend together, the best are polished.

A scrambled Sobol sequence covers the box. Its best points that lie apart from each other, and the family's
own starts, descend by projected Levenberg-Marquardt steps, all of them in one batch. The distinct optima
that come out best are polished one by one by SciPy's trust-region method.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.identification._problem import Problem
from hysim.models.search_space import SearchSpace

N_SCREENED = 4096
N_DESCENDING = 64
N_STEPS = 40
N_POLISHED = 8
_LONG = 512  # samples beyond which fewer points are tried: each costs more, and longer records have fewer optima
_APART = 0.05  # distance of two starts, in units of the box, under which the better one stands for both
_SAME = 0.01  # likewise of two points after the descent
_STUCK = 1e8  # damping beyond which no step can help
_GAIN = 1e-5
_TOLERANCE = 1e-10
_FLAT = 1e-15

Flags = npt.NDArray[np.bool_]


class Optimum(NamedTuple):
    """A local optimum: coordinates (n_x,), sum of squares, and whether the polish converged."""

    x: FloatArray
    cost: float
    converged: bool


def optima(problem: Problem, *, seed: int, progress: Progress | None = None) -> list[Optimum]:
    """Distinct local optima of `problem`, best first; empty if nothing in the box stays finite."""
    space = problem.space
    if not space.coordinates:
        return [polish(problem, np.empty(0))]
    share = min(1.0, _LONG / problem.y.size)
    screened = max(256, round(N_SCREENED * share)) if space.screened is None else space.screened
    candidates = np.concatenate([space.starts, _uniform(space, screened, seed)])
    n_starts = max(16, round(N_DESCENDING * share))
    starts = _apart(space, candidates, problem.costs(candidates), _APART, n_starts, len(space.starts))
    reached, cost = _descend(problem, starts)
    found = []
    best = _apart(space, reached, cost, _SAME, N_POLISHED)
    for done, start in enumerate(best):
        found.append(polish(problem, start))
        if progress is not None:
            progress(done + 1, len(best))
    return _distinct(found)


def _descend(problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, n_x) after projected Levenberg-Marquardt steps from `x` (n, n_x), and their sums of squares.

    A point rests when a step lowers its sum by less than the share `_GAIN`, and all after `N_STEPS`.
    """
    x = x.copy()
    lower, upper = problem.space.lower, problem.space.upper
    damping = np.full(len(x), 1e-2)
    residual = problem.solve(x)[1]
    cost = np.sum(residual**2, axis=1)
    moving = np.flatnonzero(np.isfinite(cost))
    for _ in range(N_STEPS if x.shape[1] else 0):
        if not moving.size:
            break
        slopes = (upper - lower) * problem.rough_jacobians(x[moving], residual[moving])
        step = _damped_step(slopes, residual[moving], damping[moving], x[moving] <= lower, x[moving] >= upper)
        trial = np.clip(x[moving] + step * (upper - lower), lower, upper)
        trial_residual = problem.solve(trial)[1]
        trial_cost = np.sum(trial_residual**2, axis=1)
        better = trial_cost < cost[moving]
        gained = 1.0 - np.divide(trial_cost, cost[moving], out=np.zeros_like(cost[moving]), where=better)
        won = moving[better]
        x[won], residual[won], cost[won] = trial[better], trial_residual[better], trial_cost[better]
        damping[moving] *= np.where(better, 0.2, 5.0)
        moving = moving[(gained >= _GAIN) & (damping[moving] <= _STUCK)]
    return x, cost


def _damped_step(
    slopes: FloatArray, residual: FloatArray, damping: FloatArray, at_lower: Flags, at_upper: Flags
) -> FloatArray:
    """Steps (n, n_x) that solve (J^T J + damping diag(J^T J)) step = -J^T r; none leads out of the box at a side."""
    slopes = np.nan_to_num(slopes, posinf=0.0, neginf=0.0)
    gradient = np.einsum("snk,sn->sk", slopes, residual)
    held = (at_lower & (gradient > 0.0)) | (at_upper & (gradient < 0.0))
    slopes = np.where(held[:, np.newaxis], 0.0, slopes)
    normal = slopes.transpose(0, 2, 1) @ slopes
    diagonal = np.einsum("sii->si", normal)
    # a coordinate without slope keeps its place instead of making the matrix singular
    floor = np.where(diagonal > 0.0, 1e-12 * diagonal.max(axis=1, keepdims=True), 1.0)
    damped = normal + (damping[:, np.newaxis] * diagonal + floor)[..., np.newaxis] * np.eye(diagonal.shape[1])
    return np.asarray(np.linalg.solve(damped, -np.where(held, 0.0, gradient)[..., np.newaxis])[..., 0])


def polish(problem: Problem, start: FloatArray) -> Optimum:
    """The local optimum that is reached from `start`."""
    from scipy.optimize import least_squares

    space = problem.space
    if not start.size:
        return Optimum(start, float(np.sum(problem.residual(start) ** 2)), True)
    width = space.upper - space.lower
    scale = float(np.linalg.norm(problem.y - problem.y.mean())) or 1.0  # makes gtol free of units
    result = least_squares(
        lambda x: problem.residual(x) / scale,
        np.clip(start, space.lower + 1e-9 * width, space.upper - 1e-9 * width),
        jac=lambda x: problem.jacobian(x) / scale,
        bounds=(space.lower, space.upper),
        x_scale=width,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_FLAT,
        max_nfev=200,
    )
    return Optimum(result.x, 2.0 * float(result.cost) * scale**2, result.status > 0)


def _uniform(space: SearchSpace, n: int, seed: int) -> FloatArray:
    """Spread `n` points over the box by a scrambled Sobol sequence."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(space.lower.size, rng=np.random.default_rng(seed))
    unit = sequence.random_base2(math.ceil(math.log2(max(n, 1))))[:n]
    return np.asarray(space.lower + unit * (space.upper - space.lower))


def _apart(
    space: SearchSpace, points: FloatArray, cost: FloatArray, distance: float, most: int, n_given: int = 0
) -> FloatArray:
    """The first `n_given` points, and the best others that are apart from those already taken."""
    unit = (points - space.lower) / (space.upper - space.lower)
    ranked = np.concatenate([np.arange(n_given), n_given + np.argsort(cost[n_given:], kind="stable")])
    chosen: list[int] = []
    for k in ranked[np.isfinite(cost[ranked])]:
        if len(chosen) == most:
            break
        if not chosen or np.abs(unit[chosen] - unit[k]).max(axis=1).min() > distance:
            chosen.append(int(k))
    return points[chosen]


def _distinct(found: list[Optimum]) -> list[Optimum]:
    """Optima of different cost, best first: the same cost to 1e-6 is the same optimum."""
    kept: list[Optimum] = []
    for optimum in sorted(found, key=lambda candidate: candidate.cost):
        if not kept or optimum.cost > kept[-1].cost * (1.0 + 1e-6):
            kept.append(optimum)
    return kept
