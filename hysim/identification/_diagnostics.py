"""Measures of a fit, whether its residuals are white, and how uncertain the loop width is."""

from typing import TypedDict

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.identification._descent import Descent
from hysim.identification._problem import Problem
from hysim.identification._uncertainty import output_slopes
from hysim.metrics.rows import LoopRows

_MOST_LAGS = 20


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
