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
from hysim.tracking._filters import Filtered

_STEPS = (1.0, 0.5, 0.25)  # decades
_LEAST, _MOST = -4.0, 1.0  # decades beside the first sizes


def most_likely(
    filtered: Callable[[FloatArray], Filtered], sizes: FloatArray, searched: npt.NDArray[np.bool_]
) -> tuple[FloatArray, Filtered]:
    """The most likely sizes (n_names,), of which only some are searched, and the filter with them."""
    exponents = np.zeros(sizes.size)
    best = filtered(sizes)
    for step in _STEPS:
        moved = True
        while moved:
            moved = False
            for k in np.flatnonzero(searched):
                for direction in (-step, step):
                    trial = exponents.copy()
                    trial[k] = min(max(trial[k] + direction, _LEAST), _MOST)
                    found = best if trial[k] == exponents[k] else filtered(sizes * 10.0**trial)
                    if found.log_likelihood > best.log_likelihood:
                        exponents, best, moved = trial, found, True
    return sizes * 10.0**exponents, best
