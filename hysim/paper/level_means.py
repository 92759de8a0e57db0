"""The bound of all models without memory on Table 1: the mean displacement at each voltage.

No curve that gives one displacement for each voltage has a smaller sum of squares. It is the bound, not a model that
one would fit: `hysim.identify` fits a smooth curve instead, which stays below it.
"""

import math

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.laws.static import SingleValued
from hysim.records import Record


@frozen
class LevelMeans:
    """The curve through the means, as `hysim.compare` takes a result.

    Parameters
    ----------
    model : SingleValued
        The curve.
    n_parameters : int
        Its number of means.
    cv_residual : array, shape (n,)
        Measured minus the mean of the other outputs at the same input, nan where there is none [unit of y]; empty if it
        was not asked for.
    cv_rmse : float
        Root mean square of those that are known [unit of y].
    """

    model: SingleValued
    n_parameters: int
    cv_residual: FloatArray
    cv_rmse: float


def level_means(record: Record, *, leave_one_out: bool) -> LevelMeans:
    """The means of a record, and how well each predicts the sample that is left out of it."""
    curve = SingleValued.through_means(record)
    level = np.abs(record.u[:, np.newaxis] - curve.u).argmin(axis=1)
    count = np.bincount(level)[level]
    residual = record.y - curve.y[level]
    errors = np.where(count > 1, residual * count / np.maximum(count - 1, 1), np.nan) if leave_one_out else np.empty(0)
    known = errors[~np.isnan(errors)]
    return LevelMeans(
        model=curve,
        n_parameters=curve.u.size,
        cv_residual=errors,
        cv_rmse=float(np.sqrt(np.mean(known**2))) if known.size else math.nan,
    )
