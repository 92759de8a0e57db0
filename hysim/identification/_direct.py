"""A family that is fitted in one step (`hysim.models.protocols.Direct`): the fit, and its result.

Its number of parameters is that of its degrees of freedom, rounded; it has none by name, and no standard errors.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.identification._diagnostics import fit_measures
from hysim.identification._resampling import rms_of_known
from hysim.identification._result import Identification, Width
from hysim.identification.sentences import CONSTANT
from hysim.metrics.rows import LoopRows
from hysim.models.protocols import Direct
from hysim.models.search_space import Freedom
from hysim.records import Record


def refuse(family: Direct, freedom: Freedom, noise: str, intervals: str, weights: Sequence[FloatArray] | None) -> None:
    name = family.__name__ if isinstance(family, type) else type(family).__name__
    if freedom.fixed or freedom.free or freedom.bounds:
        raise ValueError(f"{name} has no parameters by name: leave out fixed=, free= and bounds=")
    if weights is not None:
        raise ValueError(f"{name} is fitted without weights: leave out weights=, and cut samples off the record")
    if noise != "gaussian":
        raise ValueError(f'{name} is fitted by least squares: noise must be "gaussian", got {noise!r}')
    if intervals != "linear":
        raise ValueError(f'{name} has no parameters by name: intervals must be "linear", got {intervals!r}')


def identified(
    family: Direct, records: Sequence[Record], folds: Sequence[npt.NDArray[np.intp]], seed: int
) -> Identification:
    u = np.concatenate([record.u for record in records])
    y = np.concatenate([record.y for record in records])
    fit = family.fitted(u, y)
    residual, n_parameters = y - fit.model.response(u), max(1, round(fit.degrees_of_freedom))
    measures = fit_measures(y, residual, n_parameters)
    freedom = y.size - fit.degrees_of_freedom
    sigma = float(np.sqrt(np.sum(residual**2) / freedom)) if freedom > 0.5 else float("nan")
    errors = _left_out_errors(family, u, y, folds)
    return Identification(
        model=fit.model,
        models=(fit.model,) * len(records),
        n_parameters=n_parameters,
        **measures,
        sigma=measures["rmse"],
        log_likelihood=-0.5 * metrics.aic(residual, 0) - 0.5 * y.size,
        residual=residual,
        resolution=records[0].resolution,
        response_stderr=sigma * fit.spread,
        loop_width=_no_width(records[0]),
        success=True,
        message="fitted in one step",
        cv_residual=errors,
        cv_rmse=rms_of_known(errors),
        seed=seed,
        warnings=() if np.ptp(y) else (CONSTANT,),
    )


def _left_out_errors(family: Direct, u: FloatArray, y: FloatArray, folds: Sequence[npt.NDArray[np.intp]]) -> FloatArray:
    errors = np.full(y.size, np.nan)
    for fold in folds:
        training = np.ones(y.size, dtype=bool)
        training[fold] = False
        errors[fold] = y[fold] - family.fitted(u[training], y[training]).model.response(u[fold])
    return errors


def _no_width(record: Record) -> Width | None:
    try:
        LoopRows(record.u)
    except ValueError:  # there is no complete cycle
        return None
    return Width(value=0.0, lower=0.0, upper=0.0)
