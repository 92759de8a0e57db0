"""Fits in one step, of families that are not searched for, and the choice between such a fit and a search.

A law of few parameters with names and standard errors stands against a smooth one of many. Both predict what is left
out of the fit; the smooth one is returned where its rms error is lower by a clear part. It is made smoother until it
is safe on cycles that the record does not have.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim.identification._admissible import excursion
from hysim.identification._diagnostics import fit_measures, left_out_errors, rms_of_known
from hysim.identification._noise import Noise
from hysim.identification._problem import Problem
from hysim.identification._result import Identification, Width
from hysim.identification.forms import CONSTANT
from hysim.metrics.rows import LoopRows
from hysim.models.protocols import Direct, DirectFit
from hysim.models.search_space import Freedom
from hysim.records import Record
from hysim.simulation import free_run

_CLEARLY = 0.9  # of the left-out error of the search: a law without names and standard errors must gain more than that
_NORMAL = 1.959964  # standard errors on either side of an interval at 95 %

Folds = Sequence[npt.NDArray[np.intp]]


def refuse(family: Direct, freedom: Freedom, noise: str, intervals: str) -> None:
    """Refuse options that such a fit does not have."""
    name = family.__name__ if isinstance(family, type) else type(family).__name__
    if freedom.fixed or freedom.free or freedom.bounds:
        raise ValueError(f"{name} has no parameters by name: leave out fixed=, free= and bounds=")
    if noise != "gaussian":
        raise ValueError(f'{name} is fitted by least squares: noise must be "gaussian", got {noise!r}')
    if intervals != "linear":
        raise ValueError(f'{name} has no parameters by name: intervals must be "linear", got {intervals!r}')


def in_one_step(
    family: Direct,
    records: Sequence[Record],
    weights: Sequence[FloatArray] | None,
    folds: Folds,
    seed: int,
    admissible: bool | None,
) -> Identification:
    """The fit, and its errors at samples that are left out."""
    return _described(family, _fitted(family, records, weights, admissible), records, weights, folds, seed)


def better(
    fit: Identification,
    search: Problem,
    noise: Noise,
    optima: FloatArray,
    rival: Any,
    folds: Folds,
    admissible: bool | None,
) -> Identification:
    """The `fit` of a search from its `optima`, or that of the `rival` where it predicts left-out parts better."""
    records, weights = [part.record for part in search.parts], [part.weights for part in search.parts]
    shares = [each for each in weights if each is not None] or None
    smooth = _fitted(rival, records, shares, admissible)
    if (smoother := smooth.smoother) is None:
        raise TypeError(f"{rival!r} does not say how its fit depends on the outputs")
    samples, residual = smoother.samples, _residual(smooth, records)
    short = search.at(samples)
    kinds = rival.parts([part.record for part in short.parts])
    own = np.concatenate([left_out_errors(short, noise, optima, kind) for kind in kinds])
    others = np.concatenate([smoother.left_out(residual, [samples[each] for each in kind]) for kind in kinds])
    of_search, of_rival = rms_of_known(own), rms_of_known(others)
    told = f"{of_rival:.3g} against {of_search:.3g}"
    if not of_rival < _CLEARLY * of_search:
        return replace(
            fit, message=f"{fit.message}; a smooth density predicts parts left out not clearly better, {told}"
        )
    result = _described(rival, smooth, records, shares, folds, fit.seed)
    return replace(result, message=f"{result.message}; it predicts parts left out better than a grid, {told}")


def _fitted(
    family: Direct, records: Sequence[Record], weights: Sequence[FloatArray] | None, admissible: bool | None
) -> DirectFit:
    """The fit, the next smoother one as long as it is not safe on smaller cycles."""
    shares = None if weights is None else np.concatenate(weights)
    fit = family.fitted(records, shares)
    while admissible is not False and fit.smoother_family is not None:
        off = excursion(fit.models, records)
        if off is None or off.is_safe:
            break
        fit = fit.smoother_family.fitted(records, shares)
    return fit


def _described(
    family: Direct,
    fit: DirectFit,
    records: Sequence[Record],
    weights: Sequence[FloatArray] | None,
    folds: Folds,
    seed: int,
) -> Identification:
    y, residual = np.concatenate([record.y for record in records]), _residual(fit, records)
    kept = np.ones(y.size, dtype=bool) if weights is None else np.concatenate(weights) > 0.0
    n_parameters = max(1, round(fit.degrees_of_freedom))
    freedom = np.count_nonzero(kept) - fit.degrees_of_freedom
    sigma = float(np.sqrt(np.sum(residual[kept] ** 2) / freedom)) if freedom > 0.5 else float("nan")
    if fit.smoother is None:
        errors = _fitted_again(family, records, weights, folds)
    else:
        errors = fit.smoother.left_out(residual, folds)
    measures = fit_measures(y[kept], residual[kept], n_parameters)
    return Identification(
        model=fit.models[0],
        models=fit.models,
        n_parameters=n_parameters,
        **measures,
        sigma=measures["rmse"],
        log_likelihood=-0.5 * metrics.aic(residual[kept], 0) - 0.5 * np.count_nonzero(kept),
        residual=residual,
        resolution=records[0].resolution,
        response_stderr=sigma * fit.spread,
        loop_width=_width(fit, records[0], sigma),
        success=True,
        message="; ".join(filter(None, ("fitted in one step", fit.words))),
        cv_residual=errors,
        cv_rmse=rms_of_known(errors),
        seed=seed,
        warnings=() if np.ptp(y) else (CONSTANT,),
    )


def _residual(fit: DirectFit, records: Sequence[Record]) -> FloatArray:
    pairs = zip(fit.models, records, strict=True)
    return np.concatenate([record.y - free_run(model, record).y for model, record in pairs])


def _fitted_again(
    family: Direct, records: Sequence[Record], weights: Sequence[FloatArray] | None, folds: Folds
) -> FloatArray:
    """Errors at samples that are left out, by fits to the rest; nan elsewhere."""
    shares = np.ones(sum(map(len, records))) if weights is None else np.concatenate(weights)
    errors = np.full(shares.size, np.nan)
    for fold in folds:
        rest = shares.copy()
        rest[fold] = 0.0
        errors[fold] = _residual(family.fitted(records, rest), records)[fold]
    return errors


def _width(fit: DirectFit, record: Record, sigma: float) -> Width | None:
    """The largest width of the loop, zero of a law without memory; None without a loop."""
    rows, output = LoopRows(record.u), free_run(fit.models[0], record).y
    try:
        value = float(rows.max_width(output[np.newaxis])[0])
    except ValueError:  # there is no complete cycle
        return None
    if fit.smoother is None:
        return Width(value=0.0, lower=0.0, upper=0.0)
    own = fit.smoother.samples < len(record)
    places, every = fit.smoother.samples[own], np.arange(len(record))
    slope = rows.max_width_slopes(
        output, np.array([np.interp(every, places, each) for each in fit.smoother.rows[own].T])
    )
    reach = _NORMAL * sigma * float(np.sqrt(np.maximum(slope @ fit.smoother.gram @ slope, 0.0)))
    return Width(value=value, lower=value - reach, upper=value + reach)
