"""The measures of a fit.

With the residual e = y - y_model of N samples, V = mean(e^2) and d fitted parameters (without the noise level):

    rmse = sqrt(V),    nrmse = rmse / (max y - min y),    fit = 100 (1 - ||e|| / ||y - mean(y)||) %
    FPE = V (1 + d/N) / (1 - d/N),    AIC = N ln V + 2 d,    BIC = N ln V + d ln N

A measure that does not exist is nan: a fit to a constant y, a criterion with d >= N.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_not_negative, read_only, vectors


def information(mean_square: float, n_samples: int, n_parameters: int, *, floor: float = 0.0) -> float:
    """BIC N ln(V + floor^2) + d ln N of a mean squared residual V; -inf where it is zero.

    Residuals below `floor` [unit of the residual] are no evidence for one model over another.
    """
    variance = mean_square + floor**2
    if not variance > 0.0:
        return -math.inf
    return n_samples * math.log(variance) + n_parameters * math.log(n_samples)


def rmse(y: npt.ArrayLike, y_model: npt.ArrayLike) -> float:
    """Root mean square of y - y_model [unit of y].

    `y` and `y_model` are the measured and the modelled output, shape (N,) [unit of y]. A ValueError is raised if
    lengths differ, a value is not finite or there is no sample.

    Examples
    --------
    >>> rmse([0.0, 2.0], [1.0, 1.0])
    1.0
    """
    return _rms(np.subtract(*_measured_and_model(y, y_model)))


def nrmse(y: npt.ArrayLike, y_model: npt.ArrayLike) -> float:
    """Root mean square error over the range of y, rmse / (max y - min y); nan for a constant y.

    Arguments and errors are those of `rmse`.

    Examples
    --------
    >>> nrmse([0.0, 2.0], [1.0, 1.0])
    0.5
    """
    measured, model = _measured_and_model(y, y_model)
    span = float(np.ptp(measured))
    return _rms(measured - model) / span if span > 0 else math.nan


def fit_percent(y: npt.ArrayLike, y_model: npt.ArrayLike) -> float:
    """Fit 100 (1 - ||y - y_model|| / ||y - mean(y)||) [%]; nan for a constant y.

    100 is a perfect model, 0 is as good as the mean of y, a worse one is negative. Arguments and errors: `rmse`.

    Examples
    --------
    >>> fit_percent([0.0, 2.0, 4.0], [0.0, 2.0, 4.0]), fit_percent([0.0, 2.0, 4.0], [2.0, 2.0, 2.0])
    (100.0, 0.0)
    """
    measured, model = _measured_and_model(y, y_model)
    if np.ptp(measured) == 0:
        return math.nan
    return 100.0 * (1.0 - _rms(measured - model) / _rms(measured - measured.mean()))


def fpe(residual: npt.ArrayLike, n_parameters: int) -> float:
    """Final prediction error V (1 + d/N) / (1 - d/N) [unit of y, squared]; nan where d >= N.

    `residual` is measured minus model, shape (N,) [unit of y], `n_parameters` the number d. ValueError without samples,
    or if a value is not finite or d is negative. Source: H. Akaike, Ann. Inst. Statist. Math. 21 (1969) 243.

    Examples
    --------
    >>> fpe([1.0, -1.0, 1.0, -1.0], 2)
    3.0
    """
    v, n, d = _mean_square(residual, n_parameters)
    return v * (1 + d / n) / (1 - d / n) if d < n else math.nan


def aic(residual: npt.ArrayLike, n_parameters: int) -> float:
    """Akaike's information criterion N ln V + 2 d; nan where d >= N, -inf where the residual is zero.

    Arguments and errors as in `fpe`. Source: H. Akaike, IEEE Trans. Autom. Control 19 (1974) 716, without the constant.

    Examples
    --------
    >>> aic([1.0, -1.0, 1.0, -1.0], 2)
    4.0
    """
    v, n, d = _mean_square(residual, n_parameters)
    return information(v, n, 0) + 2 * d if d < n else math.nan


def bic(residual: npt.ArrayLike, n_parameters: int, *, floor: float = 0.0) -> float:
    """Bayesian information criterion N ln(V + floor^2) + d ln N; nan where d >= N, -inf where V + floor^2 is zero.

    Arguments and errors are those of `fpe`; residuals below `floor` are no evidence for one model over another
    [unit of y]. Source: G. Schwarz, Ann. Statist. 6 (1978) 461, without the constant that all models share.

    Examples
    --------
    >>> round(bic([1.0, -1.0, 1.0, -1.0], 2), 6)
    2.772589
    """
    v, n, d = _mean_square(residual, n_parameters)
    return information(v, n, d, floor=floor) if d < n else math.nan


def rms_of_known(*parts: FloatArray) -> float:
    """Root mean square of errors that are known, thus not nan; inf if one is infinite, nan without any."""
    errors = np.concatenate([np.empty(0), *parts])
    known = errors[~np.isnan(errors)]
    if not np.isfinite(known).all():
        return math.inf
    return _rms(known) if known.size else math.nan


def _measured_and_model(y: npt.ArrayLike, y_model: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    measured, model = vectors(y=y, y_model=y_model)
    if measured.size == 0:
        raise ValueError("a fit needs at least 1 sample, got 0")
    return measured, model


def _mean_square(residual: npt.ArrayLike, n_parameters: int) -> tuple[float, int, int]:
    e = read_only(residual, "residual", ndim=1)
    if e.size == 0:
        raise ValueError("a criterion needs at least 1 residual, got 0")
    check_not_negative(n_parameters=n_parameters)
    return float(np.mean(e**2)), e.size, n_parameters


def _rms(values: FloatArray) -> float:
    _, power = np.frexp(np.abs(values).max())  # by which the squares are neither too large nor too small for numbers
    return math.ldexp(math.sqrt(np.mean(np.ldexp(values, -power) ** 2)), int(power))
