"""The size of a drift for which the errors of predictions one sample ahead are most likely.

A walk that is too large follows the noise, and one that is too small comes late: both make these errors larger than the
filter expects, or smaller. The logarithm of their likelihood (the prediction-error decomposition; A. C. Harvey,
Forecasting, Structural Time Series Models and the Kalman Filter, 1989, section 3.4) is maximised over the sizes by
steps along one size at a time, on a logarithmic scale.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray

_STEPS = (1.0, 0.5, 0.25)  # decades
_LEAST, _MOST = -4.0, 1.0  # decades beside the first sizes


def most_likely(
    log_likelihood: Callable[[FloatArray], float], sizes: FloatArray, searched: npt.NDArray[np.bool_]
) -> FloatArray:
    """The most likely sizes (n_names,), of which only some are searched."""
    if not searched.any():
        return sizes
    exponents, best = np.zeros(sizes.size), log_likelihood(sizes)
    for step in _STEPS:
        moved = True
        while moved:
            moved = False
            for k in np.flatnonzero(searched):
                for direction in (-step, step):
                    trial = exponents.copy()
                    trial[k] = min(max(trial[k] + direction, _LEAST), _MOST)
                    value = best if trial[k] == exponents[k] else log_likelihood(sizes * 10.0**trial)
                    if value > best:
                        exponents, best, moved = trial, value, True
    return np.asarray(sizes * 10.0**exponents)
