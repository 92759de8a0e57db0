"""Significance of the differences between the errors of models on left-out samples.

With a and b the errors of two models at N samples that neither was fitted to, d = |a| - |b|, and s the signed ranks of
d, the rank of |d| with the sign of d: one huge error counts as the largest, and no more. Neighbours along a loop are
correlated, so that the mean of s is less certain than N independent samples would make it. Its variance is estimated
twice, and the larger of the two probabilities counts. With r_1 the correlation of neighbours in s, corrected for its
bias, and sd the standard deviation of s,

    r = r_1 + (1 + 4 r_1) / N, from 0 to 0.99,    M = N (1 - r) / (1 + r), at least 5,
    T = mean(s) sqrt(M - 1) / sd,    M - 1 degrees of freedom,

right if the correlation falls by one factor per lag. Without this assumption, by the slowest J cosines of the record,

    B_j = sqrt(2 / N) sum_k s_k cos(pi j (k + 1/2) / N),    J = N^(2/3) / 4, at least 3,
    T = mean(s) sqrt(N) / sqrt(mean of B_j^2),    J degrees of freedom.

If d is as often positive as negative, and as large, T has about Student's distribution. With fewer than 5 independent
samples no difference could be shown, however large; a model whose median error is 10 times that of the best one is
worse all the same. Differences below a thousandth of the typical error count as none. Several models are compared with
the best one by Holm's correction. That was chosen by the same errors, which makes a small probability less remarkable.

A mean of squared errors with 3 to 6 lags (Diebold and Mariano 1995) fails where one error is huge. Sources: F.
Wilcoxon, Biometrics Bull. 1 (1945) 80 for signed ranks; F. W. Zwiers and H. von Storch, J. Climate 8 (1995) 336 for M;
F. H. C. Marriott and J. A. Pope, Biometrika 41 (1954) 390 for the bias; S. Holm, Scand. J. Stat. 6 (1979) 65; E.
Lazarus, D. J. Lewis, J. H. Stock and M. W. Watson, J. Bus. Econ. Stat. 36 (2018) 541 for the cosines.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hysim._basics.frozen import FloatArray, frozen

LEVEL = 0.05
"""Two models differ significantly if the probability is below this."""

DIVERGED = 10.0
"""A fitted model diverged if a left-out error is larger than so many ranges of the measured output."""

FAR = 10.0
"""A model whose median absolute error is so many times that of the best one is worse, whatever the probability."""

_MOST_CORRELATED = 0.99
_INDEPENDENT = 5.0  # samples at least, where there are as many
_COSINES = 0.25, 2.0 / 3.0  # factor and power of the number of samples
_FEWEST_COSINES = 3
_FEWEST = 4  # samples: with fewer no correlation of neighbours can be estimated
_TIE = 1e-3  # of the typical error
_ROUNDING = 1e-9  # of the output's range


@frozen
class Contrast:
    """A model compared with the best one, by their errors at samples that were left out of both.

    `rmse_ratio` and `typical_ratio` are its cross-validated rmse and its median absolute error over those of the best
    model. `probability` is the two-sided one of equally one-sided signed ranks if both predicted equally well, after
    Holm's correction. Both are nan if errors are unknown. `has_larger_errors` is the verdict of the signed ranks;
    `diverged` is whether an error is not finite, or more than 10 times the range of the measured output.
    """

    name: str
    rmse_ratio: float
    typical_ratio: float
    probability: float
    has_larger_errors: bool
    diverged: bool

    @property
    def is_worse(self) -> bool:
        """Whether the model is significantly worse than the best one at 5 %, or far worse, or diverged."""
        return self.diverged or (self.has_larger_errors and (self.probability < LEVEL or self.typical_ratio > FAR))

    @property
    def contradicts(self) -> bool:
        """Whether its errors are significantly smaller by their ranks, although its rmse is larger."""
        return not self.diverged and self.probability < LEVEL and not self.has_larger_errors


def contrasts(
    others: Mapping[str, FloatArray], best: FloatArray, rmses: Mapping[str, float], best_rmse: float, *,
    span: float, fitted: Sequence[str],
) -> tuple[Contrast, ...]:  # fmt: skip
    """Each of the others compared with the best model by left-out errors (n,); `span` is the output's range."""
    tests = {name: _tested(errors, best, _ROUNDING * span) for name, errors in others.items()}
    adjusted = holm({name: p for name, (p, _) in tests.items()})
    return tuple(
        Contrast(
            name=name,
            rmse_ratio=_ratio(rmses[name], best_rmse),
            typical_ratio=_typical_ratio(errors, best),
            probability=adjusted[name],
            has_larger_errors=tests[name][1] > 0.0,
            diverged=name in fitted and diverged(errors, span),
        )
        for name, errors in others.items()
    )


def diverged(errors: FloatArray, span: float) -> bool:
    """Whether a known error is infinite, or far beyond the output's range."""
    known = errors[~np.isnan(errors)]
    return bool(known.size and np.abs(known).max() > DIVERGED * span > 0.0)


def probability(a: FloatArray, b: FloatArray, *, tie: float = 0.0) -> float:
    """Two-sided probability of equally one-sided signed ranks if both models predicted equally well.

    nan if fewer than 4 samples have both errors, 1 if no difference exceeds `tie` [unit of y] and 0.001 typical errors.
    """
    return _tested(a, b, tie)[0]


def holm(probabilities: Mapping[str, float]) -> dict[str, float]:
    """The probabilities after Holm's correction for their number; nan stays nan."""
    known = sorted((p, name) for name, p in probabilities.items() if not math.isnan(p))
    adjusted, largest = dict(probabilities), 0.0
    for k, (p, name) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - k) * p))
        adjusted[name] = largest
    return adjusted


def _tested(a: FloatArray, b: FloatArray, tie: float) -> tuple[float, float]:
    """The probability, and the mean signed rank of |a| - |b|."""
    from scipy.special import stdtr
    from scipy.stats import rankdata

    if a.shape != b.shape:
        return math.nan, math.nan
    known = ~np.isnan(a) & ~np.isnan(b)
    first, second = (np.minimum(np.abs(errors[known]), 1e300) for errors in (a, b))
    if first.size < _FEWEST:
        return math.nan, math.nan
    d = first - second
    d[np.abs(d) <= max(tie, _TIE * 0.5 * float(np.median(first + second)))] = 0.0
    signed = np.sign(d) * rankdata(np.abs(d))
    mean = float(signed.mean())
    off = signed - mean
    if not off.any():
        return float(mean == 0.0), mean
    statistics = _by_neighbours(off, mean), _by_cosines(off, mean)
    return max(float(2.0 * stdtr(freedom, -statistic)) for statistic, freedom in statistics), mean


def _by_neighbours(off: FloatArray, mean: float) -> tuple[float, float]:
    """Student's statistic and its degrees of freedom, from the correlation of neighbours."""
    n, squares = off.size, float(off @ off)
    neighbours = float(off[1:] @ off[:-1]) / squares
    r = min(max(neighbours + (1.0 + 4.0 * neighbours) / n, 0.0), _MOST_CORRELATED)
    freedom = max(n * (1.0 - r) / (1.0 + r), min(_INDEPENDENT, n)) - 1.0
    return abs(mean) * math.sqrt(freedom * n / squares), freedom


def _by_cosines(off: FloatArray, mean: float) -> tuple[float, float]:
    """Student's statistic and its degrees of freedom, from the slowest cosines."""
    from scipy.fft import dct

    n = off.size
    count = max(int(_COSINES[0] * n ** _COSINES[1]), _FEWEST_COSINES)
    spread = float(np.sqrt(np.mean(dct(off, norm="ortho")[1 : count + 1] ** 2)))
    return (abs(mean) * math.sqrt(n) / spread if spread > 0.0 else math.inf), float(count)


def _typical_ratio(a: FloatArray, b: FloatArray) -> float:
    if a.shape != b.shape:
        return math.nan
    known = ~np.isnan(a) & ~np.isnan(b)
    return _ratio(float(np.median(np.abs(a[known]))), float(np.median(np.abs(b[known])))) if known.any() else math.nan


def _ratio(value: float, best: float) -> float:
    return value / best if best > 0.0 else 1.0 if value == 0.0 else math.inf
