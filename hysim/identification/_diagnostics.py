"""Measures of a fit, whiteness of residuals, error of the loop width, cross-validation from the optima of all data."""

import math
from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._columns.input_noise import noise_level
from hysim._columns.turning import TOLERANCE
from hysim.errors import SimulationError
from hysim.identification._descent import Descent
from hysim.identification._noise import Gaussian, Noise
from hysim.identification._problem import Problem
from hysim.identification._uncertainty import output_slopes
from hysim.identification.forms import RESTING, ROUNDING
from hysim.metrics.rows import LoopRows
from hysim.models.protocols import Rescalable, needs_time
from hysim.records import Record

_MOST_LAGS = 20
_ALONE = 0.5  # of the rms residual, in one sample or in the mean; by hand
_FEW = 20  # samples, too few to say so
_SHARE_OF_NOISE = 0.3  # of the residuals: below it noise of the input adds less than 5 % to them


class FitMeasures(TypedDict):
    fit_percent: float
    rmse: float
    fpe: float
    aic: float
    bic: float
    whiteness: float


def fit_measures(y: FloatArray, residual: FloatArray, n_parameters: int) -> FitMeasures:
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


def odd_residuals(problem: Problem, residual: FloatArray) -> list[str]:
    """Sentences on a sample that carries a fit, and on a record or sensor whose residual is mostly its mean."""
    counted, n = np.where(problem.weights > 0.0, residual, 0.0), np.count_nonzero(problem.weights)
    rms, k, several = float(np.sqrt(counted @ counted / n)), int(np.argmax(np.abs(counted))), len(problem.parts) > 1
    if rms <= max(RESTING * float(np.std(problem.y)), ROUNDING * problem.scale):
        return []
    told = [f'sample {k} alone makes most of the residual: leave it out by weights=, or take noise="robust"']
    told = told if n > _FEW and abs(counted[k]) > _ALONE * math.sqrt(n) * rms else []
    for place, (record, own) in enumerate(problem.pieces):
        n_sensors = len(record) // record.input.size if isinstance(record, Rescalable) else 1
        for sensor, part in enumerate(np.split(counted[own], n_sensors)):
            if part.size > _FEW and abs(part.mean()) > _ALONE * max(float(np.sqrt(np.mean(part**2))), rms):
                of = f" of sensor {sensor}" * (n_sensors > 1) + f" of record {place}" * several
                told.append(f"the residual{of} is mostly its mean {part.mean():.3g}: an offset that the model lacks")
    return told


def rate_noise_warning(models: Sequence[Any], records: Sequence[Record]) -> str:
    """A sentence where noise of the input explains residuals of models that depend on time; else the empty text.

    Noise is added to each input once more: what the output changes by, the input's own noise has done to the residuals.
    """
    rng = np.random.default_rng(0)
    for model, record in zip(models, records, strict=True):
        noise = noise_level(record.u)
        if not (noise and needs_time(model) and record.sample_time):
            continue
        try:
            outputs = [
                np.asarray(model.response(u, record.sample_time))
                for u in (record.u, record.u + noise * rng.standard_normal(len(record)))
            ]
        except SimulationError:
            continue
        share = metrics.rmse(*outputs) / max(metrics.rmse(record.y, outputs[0]), float(np.finfo(float).tiny))
        if share > _SHARE_OF_NOISE:
            return (
                f"the input has noise of about {noise:.2g} rms, {100.0 * noise / np.ptp(record.u):.2g} % of its span, "
                f"and the model depends on its rate: noise of this size changes the output by {100.0 * share:.0f} % of "
                "the residuals, and biases damping, breakaway and other parameters of the velocity. Smooth the "
                "input and identify again, such as with scipy.signal.savgol_filter over a small part of a cycle"
            )
    return ""


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


def folds(count: str | int, n: int, *, name: str = "folds") -> list[npt.NDArray[np.intp]]:
    """Samples of each fold of `n`: ``"loo"`` is one at a time, an int that many blocks; else a ValueError."""
    number = n if count == "loo" else count
    if not isinstance(number, int) or isinstance(number, bool) or not 2 <= number <= n:
        raise ValueError(f'{name} must be "loo" or a number of blocks from 2 to {n}, got {count!r}')
    return np.array_split(np.arange(n), number)


def left_out(cross_validate: str | int | None, records: Sequence[Record]) -> list[npt.NDArray[np.intp]]:
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


def _cycles(records: Sequence[Record], cuts: Sequence[int]) -> list[npt.NDArray[np.intp]]:
    cycles = []
    for record, begin in zip(records, cuts, strict=False):
        turns = record.reversals(TOLERANCE)[1::2]
        cycles += [begin + samples for samples in np.split(np.arange(len(record)), turns)[1:]]
    if not cycles:
        raise ValueError('cross_validate="cycles" needs at least 2 cycles of the input')
    return cycles


def left_out_errors(
    problem: Problem, noise: Noise, optima: FloatArray, every_fold: Sequence[npt.NDArray[np.intp]]
) -> FloatArray:
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


def _left_out_errors(
    problem: Problem, noise: Noise, starts: FloatArray, every_fold: Sequence[npt.NDArray[np.intp]]
) -> FloatArray:
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
