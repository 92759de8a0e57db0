"""Diagnostics of chains, shape (n_draws, n_chains), of one number.

The numbers are replaced by the normal quantiles of their ranks, Phi^-1((rank - 3/8) / (n m + 1/4)), so that a
parameter, its logarithm and a distribution without variance are judged alike. With W the mean variance within the
chains, B/n the variance of their means and var = (n - 1)/n W + B/n,

    R-hat = sqrt(var / W),    each chain cut into halves, which count as chains,
    rho_t = 1 - (W - mean of the autocovariances at lag t) / var,    tau = 1 + 2 sum rho_t,    effective = m n / tau.

The sum ends before the first pair rho_2k + rho_2k+1 that is not positive, and pairs do not grow (Geyer).

Sources: A. Gelman and others, Bayesian Data Analysis, 3rd edition, 2013, sections 11.4 and 11.5; A. Vehtari, A.
Gelman, D. Simpson, B. Carpenter and P.-C. Buerkner, Bayesian Anal. 16 (2021) 667, for the ranks ("bulk" effective
samples).
"""

import numpy as np

from hysim._frozen import FloatArray

_FEWEST = 8  # draws of a chain
_ROUNDING = 1e-14  # of a variance


def split_rhat(chains: FloatArray) -> float:
    """R-hat over the halves of the chains; nan for fewer than 8 draws, inf where chains stand at different values."""
    half = len(chains) // 2
    if len(chains) < _FEWEST:
        return float("nan")
    halves = _ranked(np.concatenate([chains[:half], chains[-half:]], axis=1))
    within, total = _variances(halves)
    if within <= _ROUNDING * total:
        return 1.0 if total == 0.0 else float("inf")
    return float(np.sqrt(total / within))


def effective_samples(chains: FloatArray) -> float:
    """Number of independent draws whose mean rank would be as sure; nan for fewer than 8 draws."""
    n, m = chains.shape
    if n < _FEWEST:
        return float("nan")
    chains = _ranked(chains)
    within, total = _variances(chains)
    if total == 0.0:
        return float(n * m)
    lags = _autocovariance(chains).mean(axis=1)
    rho = 1.0 - (within - lags * n / (n - 1.0)) / total
    rho[0] = 1.0
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    pairs = np.minimum.accumulate(pairs[: ends[0] if ends.size else None])
    tau = max(2.0 * float(pairs.sum()) - 1.0, 1.0 / np.log10(n * m))
    return float(n * m / tau)


def _ranked(chains: FloatArray) -> FloatArray:
    """Normal quantiles of the ranks among all draws; equal draws have their mean rank."""
    from scipy.special import ndtri

    distinct, places, counts = np.unique(chains, return_inverse=True, return_counts=True)
    ranks = np.cumsum(counts) - 0.5 * (counts - 1)
    normal = ndtri((ranks - 0.375) / (chains.size + 0.25)) if distinct.size > 1 else np.zeros(1)
    return np.asarray(normal[places.reshape(chains.shape)])


def _variances(chains: FloatArray) -> tuple[float, float]:
    """Variance within the chains, and that of all draws from both parts."""
    n, m = chains.shape
    within = float(chains.var(axis=0, ddof=1).mean())
    between = float(chains.mean(axis=0).var(ddof=1)) if m > 1 else 0.0
    return within, (n - 1.0) / n * within + between


def _autocovariance(chains: FloatArray) -> FloatArray:
    """Autocovariance at the lags 0 to n - 1 of each chain, (n, n_chains)."""
    n = len(chains)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(chains - chains.mean(axis=0), size, axis=0)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[:n] / n)
