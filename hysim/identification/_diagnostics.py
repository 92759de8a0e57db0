"""Measures of a fit, whiteness of residuals, error of the loop width, cross-validation from the optima of all data."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._columns.turning import TOLERANCE
from hysim.identification._descent import Descent
from hysim.identification._noise import Gaussian, Noise
from hysim.identification._problem import Problem
from hysim.identification._uncertainty import output_slopes
from hysim.metrics.rows import LoopRows
from hysim.records import Record

Samples = npt.NDArray[np.intp]
Folds = Sequence[Samples]

_MOST_LAGS = 20


def fit_measures(y: FloatArray, residual: FloatArray, n_parameters: int) -> dict[str, Any]:
    """Measures of a fit of `n_parameters` to outputs `y` (n,) with this residual (n,)."""
    return {
        "fit_percent": metrics.fit_percent(y, y - residual),
        "rmse": metrics.rmse(residual, 0.0 * residual),
        "fpe": metrics.fpe(residual, n_parameters),
        "aic": metrics.aic(residual, n_parameters),
        "bic": metrics.bic(residual, n_parameters),
        "whiteness": whiteness(residual, n_parameters),
    }


def whiteness(residual: FloatArray, n_parameters: int) -> float:
    """Probability of residuals at least as correlated as these if they were white (Ljung and Box 1978).

    Q = N (N + 2) sum_k r_k^2 / (N - k) against chi^2, lags k to N / 5 or 20; nan if samples are too few or all equal.
    """
    from scipy.stats import chi2

    n = residual.size
    lags = min(_MOST_LAGS, n // 5)
    centred = residual - residual.mean()
    power = float(centred @ centred)
    if lags < 2 or power == 0.0 or n <= n_parameters:
        return float("nan")
    correlation = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / power
    statistic = n * (n + 2) * np.sum(correlation**2 / (n - np.arange(1, lags + 1)))
    return float(chi2.sf(statistic, lags))


def loop_widths(descent: Descent, theta: FloatArray) -> FloatArray:
    record = descent.problem.parts[0].record
    outputs = descent.problem.model(theta)[:, : len(record)]
    finite = outputs[np.isfinite(outputs).all(axis=1)]
    try:
        return LoopRows(record.u).max_width(finite)
    except ValueError:  # there is no complete cycle
        return np.empty(0)


def width_stderr(problem: Problem, theta: FloatArray, of_theta: FloatArray, slopes: FloatArray | None = None) -> float:
    """Standard error of the largest width by the linearised model, nan without a loop; `slopes` are dy/dtheta."""
    record = problem.parts[0].record
    slopes = (output_slopes(problem, theta) if slopes is None else slopes)[: len(record)]
    output = problem.model(theta[np.newaxis])[0, : len(record)]
    if not (np.isfinite(slopes).all() and np.isfinite(output).all()):
        return float("nan")
    slope = LoopRows(record.u).max_width_slopes(output, slopes.T)
    return float(np.sqrt(np.maximum(slope @ of_theta @ slope, 0.0)))


_AT_FOLD = 4  # a fold of the cross-validation begins from this many of the best optima
_SAMPLES_AT_ONCE = 1_000_000  # of all sets that descend together, to bound the memory
_TOLERANCE = 1e-9


def folds(count: str | int, n: int, *, name: str = "folds") -> list[Samples]:
    """Samples of each fold of `n`: ``"loo"`` is one at a time, an int that many blocks; else a ValueError."""
    number = n if count == "loo" else count
    if not isinstance(number, int) or isinstance(number, bool) or not 2 <= number <= n:
        raise ValueError(f'{name} must be "loo" or a number of blocks from 2 to {n}, got {count!r}')
    return np.array_split(np.arange(n), number)


def left_out(cross_validate: str | int | None, records: Sequence[Record]) -> list[Samples]:
    """Samples of each fold of records that follow each other, by `cross_validate` of `identify`; else a ValueError."""
    if cross_validate is None:
        return []
    cuts = [0, *np.cumsum([len(record) for record in records]).tolist()]
    if cross_validate == "records":
        if len(records) < 2:
            raise ValueError('cross_validate="records" needs at least 2 records')
        return np.split(np.arange(cuts[-1]), cuts[1:-1])
    if cross_validate == "cycles":
        return _cycles(records, cuts)
    return folds(cross_validate, cuts[-1], name="cross_validate")


def _cycles(records: Sequence[Record], cuts: Sequence[int]) -> list[Samples]:
    cycles = []
    for record, begin in zip(records, cuts, strict=False):
        turns = record.reversals(TOLERANCE)[1::2]
        cycles += [begin + samples for samples in np.split(np.arange(len(record)), turns)[1:]]
    if not cycles:
        raise ValueError('cross_validate="cycles" needs at least 2 cycles of the input')
    return cycles


def left_out_errors(problem: Problem, noise: Noise, optima: FloatArray, every_fold: Folds) -> FloatArray:
    """Error of each sample, shape (n,), in the fit that leaves it out; inf if it diverged.

    It is nan without such a fit, and of samples that have no weight in any.
    """
    errors_of_all = np.full(problem.y.size, np.nan)
    if not every_fold:
        return errors_of_all
    starts = optima[:_AT_FOLD]
    at_once = max(1, _SAMPLES_AT_ONCE // (len(starts) * problem.y.size))
    groups = [every_fold[k : k + at_once] for k in range(0, len(every_fold), at_once)]
    errors = [_left_out_errors(problem, noise, starts, group) for group in groups]
    errors_of_all[np.concatenate(every_fold)] = np.concatenate(errors)
    errors_of_all[problem.weights == 0.0] = np.nan
    return errors_of_all


def rms_of_known(errors: FloatArray) -> float:
    known = errors[~np.isnan(errors)]
    if not np.isfinite(known).all():
        return float("inf")
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def _left_out_errors(problem: Problem, noise: Noise, starts: FloatArray, every_fold: Folds) -> FloatArray:
    weights = np.ones((len(every_fold), problem.y.size))
    for fold, samples in enumerate(every_fold):
        weights[fold, samples] = 0.0
    descent = Descent(problem, noise, problem.y[np.newaxis], np.repeat(weights, len(starts), axis=0))
    reached = descent.run(np.tile(starts, (len(every_fold), 1)), tolerance=_TOLERANCE)
    best = np.arange(len(every_fold)) * len(starts) + reached.loss.reshape(len(every_fold), -1).argmin(axis=1)
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
    reached = Descent(problem, noise, targets, np.ones((1, residual.size))).run(np.tile(theta, (draws, 1)))
    return reached.theta[np.isfinite(reached.loss)]
