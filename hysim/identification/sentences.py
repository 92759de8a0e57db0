"""Warnings for users of a result."""

from collections.abc import Mapping

import numpy as np

CONSTANT = "the output is constant: the fit in percent is not defined, and the output shows no effect of the input"
SWAPPED = "the input and the output may be swapped"
_CORRELATED = 1e-3  # probability of white residuals
_RESTING = 1e-6  # of the output's standard deviation: smaller residuals are the end of a descent
_ROUNDING = 1e-12  # of the output's size


def sentences(
    *,
    spread: float,
    size: float,
    rmse: float,
    whiteness: float,
    stderr: Mapping[str, float],
    reasons: tuple[str, ...],
    success: bool,
) -> tuple[str, ...]:
    """Warnings; `spread` and `size` are the output's standard deviation and largest magnitude."""
    warnings = [] if success else ["the search did not converge: better parameters may exist"]
    if spread == 0.0:
        warnings.append(CONSTANT)
    if unknown := [name for name, value in stderr.items() if np.isnan(value)]:
        why = f": {'; '.join(reasons)}" if reasons else ""
        warnings.append(f"no standard error for {', '.join(unknown)}{why}")
    if stderr and whiteness < _CORRELATED and rmse > max(_RESTING * spread, _ROUNDING * size):
        warnings.append("residuals are correlated (p < 0.001): the intervals are too narrow")
    return tuple(warnings)
