"""The Bayesian information criterion of a mean square, for searches that know no residual."""

import math


def information(mean_square: float, n_samples: int, n_parameters: int, *, floor: float = 0.0) -> float:
    """BIC N ln(V + floor^2) + d ln N of a mean squared residual V; -inf where it is zero.

    Residuals below `floor` [unit of the residual] are no evidence for one model over another.
    """
    variance = mean_square + floor**2
    if not variance > 0.0:
        return -math.inf
    return n_samples * math.log(variance) + n_parameters * math.log(n_samples)
