"""Whether held-out samples tell two models apart.

With a and b the errors of two models at N samples that neither was fitted to, d = a^2 - b^2 has the mean m, and
neighbours along a loop are correlated, so that the variance of m is

    v = (g_0 + 2 sum_(k=1)^L (1 - k / (L + 1)) g_k) / N,    L = floor(4 (N / 100)^(2/9))

with g_k the autocovariance of d at the lag k. If both predict equally well, m / sqrt(v) has about Student's
distribution with N - 1 degrees of freedom. The model with the least error was chosen after the fact, and several are
held against it; both make a small probability less remarkable than it looks.

Sources: F. X. Diebold and R. S. Mariano, J. Bus. Econ. Stat. 13 (1995) 253; the weights and L: W. K. Newey and
K. D. West, Econometrica 55 (1987) 703 and Rev. Econ. Stud. 61 (1994) 631; Student's distribution: D. Harvey,
S. Leybourne and P. Newbold, Int. J. Forecast. 13 (1997) 281.
"""

import math

import numpy as np

from hysim._frozen import FloatArray

LEVEL = 0.05
"""Two models are told apart where the probability is below this."""


def probability(a: FloatArray, b: FloatArray) -> float:
    """Two-sided probability of a mean difference as large as this if both models predicted equally well.

    It is nan where fewer than 2 samples have both errors, and 1 where the squared errors are the same.
    """
    from scipy.stats import t

    d = (a**2 - b**2)[~np.isnan(a) & ~np.isnan(b)]
    if d.size < 2:
        return math.nan
    mean = float(d.mean())
    variance = _variance_of_mean(d - mean)
    if mean == 0.0 or variance <= 0.0:
        return float(mean == 0.0)
    return float(2.0 * t.sf(abs(mean) / math.sqrt(variance), d.size - 1))


def _variance_of_mean(d: FloatArray) -> float:
    """Of a series without its mean, by Bartlett's weights, which never make it negative."""
    n = d.size
    lags = min(math.floor(4.0 * (n / 100.0) ** (2.0 / 9.0)), n - 1)
    covariances = [float(d[k:] @ d[: n - k]) / n for k in range(lags + 1)]
    weights = [1.0, *(2.0 * (1.0 - k / (lags + 1)) for k in range(1, lags + 1))]
    return math.fsum(weight * covariance for weight, covariance in zip(weights, covariances, strict=True)) / n
