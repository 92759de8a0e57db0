"""Measures of a fit, whether its residuals are white, and how uncertain the loop width is."""

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim._input_noise import noise_level
from hysim.errors import SimulationError
from hysim.identification._descent import Descent
from hysim.identification._problem import Problem
from hysim.identification._uncertainty import output_slopes
from hysim.metrics.rows import LoopRows
from hysim.models.protocols import needs_time
from hysim.records import Record

_MOST_LAGS = 20
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

    Q = N (N + 2) sum over lags k of r_k^2 / (N - k) against chi^2; the lags are a fifth of the samples and at most 20.
    nan where they are too few or all equal.
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


def rate_noise_warning(models: Sequence[Any], records: Sequence[Record]) -> str:
    """A sentence where noise of the input explains residuals of models that depend on time; else the empty text.

    The noise is added to each input once more: what the output of its model then changes by, the noise that is in the
    input already has done to the residuals.
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
    """Standard error of the largest width, by the linearised model; nan where there is no loop.

    `slopes` are those of the output by theta, where they are known.
    """
    record = problem.parts[0].record
    slopes = (output_slopes(problem, theta) if slopes is None else slopes)[: len(record)]
    output = problem.model(theta[np.newaxis])[0, : len(record)]
    if not (np.isfinite(slopes).all() and np.isfinite(output).all()):
        return float("nan")
    slope = LoopRows(record.u).max_width_slopes(output, slopes.T)
    return float(np.sqrt(np.maximum(slope @ of_theta @ slope, 0.0)))
