"""Searches on other data, with samples left out or records drawn anew, from the optima of the whole record."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.identification._descent import Descent
from hysim.identification._noise import Gaussian, Noise
from hysim.identification._problem import Problem

_AT_FOLD = 4  # a fold of the cross-validation begins from this many of the best optima
_SAMPLES_AT_ONCE = 1_000_000  # of all sets that descend together, to bound the memory
_TOLERANCE = 1e-9


def left_out_errors(
    problem: Problem, noise: Noise, optima: FloatArray, left_out: Sequence[npt.NDArray[np.intp]]
) -> FloatArray:
    """Error of each sample, shape (n,), in the fit that leaves it out; nan where none does, inf where it diverged."""
    errors_of_all = np.full(problem.y.size, np.nan)
    if not left_out:
        return errors_of_all
    starts = optima[:_AT_FOLD]
    at_once = max(1, _SAMPLES_AT_ONCE // (len(starts) * problem.y.size))
    groups = [left_out[k : k + at_once] for k in range(0, len(left_out), at_once)]
    errors = [_left_out_errors(problem, noise, starts, group) for group in groups]
    errors_of_all[np.concatenate(left_out)] = np.concatenate(errors)
    return errors_of_all


def rms_of_known(errors: FloatArray) -> float:
    known = errors[~np.isnan(errors)]
    if not np.isfinite(known).all():
        return float("inf")
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def _left_out_errors(
    problem: Problem, noise: Noise, starts: FloatArray, left_out: Sequence[npt.NDArray[np.intp]]
) -> FloatArray:
    weights = np.ones((len(left_out), problem.y.size))
    for fold, samples in enumerate(left_out):
        weights[fold, samples] = 0.0
    descent = Descent(problem, noise, problem.y[np.newaxis], np.repeat(weights, len(starts), axis=0))
    reached = descent.run(np.tile(starts, (len(left_out), 1)), tolerance=_TOLERANCE)
    best = np.arange(len(left_out)) * len(starts) + reached.loss.reshape(len(left_out), -1).argmin(axis=1)
    errors = (problem.y - problem.model(reached.theta[best]))[weights == 0.0]
    return np.where(np.isfinite(errors), errors, np.inf)  # nan is for samples that no fold has


def bootstrap(
    problem: Problem, noise: Noise, theta: FloatArray, residual: FloatArray, sigma: float, *, draws: int, seed: int
) -> FloatArray:
    """Theta (draws, n_theta) of records drawn anew: residuals enlarged by sqrt(N / (N - d)), or other noise."""
    rng = np.random.default_rng(seed)
    y_model = np.broadcast_to(problem.y - residual, (draws, residual.size))
    freedom = residual.size - len(problem.space.names)
    if isinstance(noise, Gaussian):
        enlarged = (residual - residual.mean()) * np.sqrt(residual.size / freedom)
        targets = y_model + rng.choice(enlarged, (draws, residual.size))
    else:
        targets = noise.draw(y_model, sigma * np.sqrt(residual.size / freedom), rng)
    at_once = max(1, _SAMPLES_AT_ONCE // problem.y.size)
    weights = np.ones((1, residual.size))
    descents = [
        Descent(problem, noise, targets[k : k + at_once], weights).run(
            np.tile(theta, (len(targets[k : k + at_once]), 1))
        )
        for k in range(0, draws, at_once)
    ]
    return np.concatenate([reached.theta[np.isfinite(reached.loss)] for reached in descents])
