"""Fragility curves: the share of ground motions that exceed a limit, over the intensity of the motion.

    P(exceeds | x) = Phi(ln(x / median) / dispersion)

Median and dispersion have the greatest binomial likelihood: J. W. Baker, Efficient analytical fragility function
fitting using dynamic structural analysis, Earthquake Spectra 31 (2015) 579. Their logarithms have the covariance
I^-1 S I^-1 with the Fisher information I and the covariance S of the score, which is I where each intensity has records
of its own. If the same ones are scaled, one that exceeds at an intensity exceeds at higher ones: counts are correlated.
"""

import math

import numpy as np
import numpy.typing as npt
from scipy import optimize, special

from hysim._basics.frozen import FloatArray, vectors
from hysim._basics.printing import frozen_result, summary_text

_FLAT = 1e-6  # slope of a curve that does not rise, with rounding; by hand


@frozen_result
class Fragility:
    """Result of `hysim.fragility`: a lognormal fragility curve, and the counts that it is fitted to.

    Parameters
    ----------
    median, dispersion : float
        Intensity at which half of the records exceed the limit, and standard deviation of the logarithm of the
        intensity at which a record begins to exceed it.
    median_interval, dispersion_interval : array, shape (2,)
        Confidence limits of both.
    level : float
        Confidence of the intervals and of `band`.
    intensities, n_exceeding, n_records : array, shape (n,)
        Intensities, numbers of records above the limit, and numbers of records.
    covariance : array, shape (2, 2)
        Covariance of the logarithms of the median and of the dispersion.
    """

    median: float
    dispersion: float
    median_interval: FloatArray
    dispersion_interval: FloatArray
    level: float
    intensities: FloatArray
    n_exceeding: FloatArray
    n_records: FloatArray
    covariance: FloatArray

    def __str__(self) -> str:
        rows = {
            "median": (self.median, *self.median_interval),
            "dispersion": (self.dispersion, *self.dispersion_interval),
        }
        words = {name: f"{value:.3g} ({low:.3g} to {high:.3g})" for name, (value, low, high) in rows.items()}
        return summary_text([f"Fragility: {self.intensities.size} intensities, {self.level:.0%} intervals"], words)

    def probability(self, intensities: npt.ArrayLike) -> FloatArray:
        """The curve at positive intensities."""
        return np.asarray(special.ndtr(np.log(np.divide(intensities, self.median)) / self.dispersion))

    def band(self, intensities: npt.ArrayLike) -> FloatArray:
        """Confidence limits of the curve, shape (2, n), at each of n positive intensities."""
        eta = np.log(np.divide(intensities, self.median)) / self.dispersion
        slopes = np.array([np.full_like(eta, -1.0 / self.dispersion), -eta])
        error = special.ndtri(0.5 + 0.5 * self.level) * np.sqrt((slopes * (self.covariance @ slopes)).sum(axis=0))
        return np.asarray(special.ndtr([eta - error, eta + error]))


def fragility(
    intensities: npt.ArrayLike,
    n_exceeding: npt.ArrayLike,
    n_records: npt.ArrayLike,
    *,
    same_records: bool = False,
    level: float = 0.95,
) -> Fragility:
    """Fit a lognormal fragility curve to the numbers of records that exceed a limit.

    Parameters
    ----------
    intensities : array, shape (n,)
        Intensities of the ground motion, positive.
    n_exceeding, n_records : array, shape (n,), and int or array, shape (n,)
        Number of records whose response exceeds the limit, or that collapse, and of all records, at each intensity.
    same_records : bool
        Whether the same records are scaled to each intensity: then the counts are correlated, and the intervals wider.
    level : float
        Confidence of the intervals.

    Returns
    -------
    Fragility

    Raises
    ------
    ValueError
        If an argument is out of its range, or the counts determine no rising curve.

    Examples
    --------
    >>> import hysim as hs
    >>> print(hs.fragility([0.2, 0.4, 0.6, 0.8, 1.0], [0, 4, 11, 15, 19], 20))
    Fragility: 5 intensities, 95% intervals
      median      0.574 (0.505 to 0.652)
      dispersion  0.392 (0.274 to 0.561)
    """
    all_records = np.broadcast_to(np.asarray(n_records), np.shape(intensities))
    x, z, n = vectors(intensities=intensities, n_exceeding=n_exceeding, n_records=all_records)
    _check(x, z, n, level, same_records)
    logs = np.log(x) - np.log(x).mean()
    rows = np.array([np.ones(x.size), logs / logs.std()])

    def loss(line: FloatArray) -> tuple[float, FloatArray]:
        below, above = special.log_ndtr([line @ rows, -line @ rows])
        slopes = _score(line @ rows) * (n * np.exp(below) - z)
        return -float(z @ below + (n - z) @ above) / n.sum(), rows @ slopes / n.sum()

    line = optimize.minimize(loss, [0.0, 1.0], jac=True, method="BFGS", options={"gtol": 1e-10}).x
    if line[1] <= _FLAT:
        raise ValueError("the share above the limit does not rise with the intensity: are the counts in its order?")
    dispersion = logs.std() / line[1]
    covariance = _covariance(line @ rows, n, dispersion, same_records)
    numbers = np.array([np.exp(np.log(x).mean() - line[0] * dispersion), dispersion])
    factors = np.exp(special.ndtri(0.5 + 0.5 * level) * np.sqrt(np.diag(covariance)))
    low_high = np.transpose([numbers / factors, numbers * factors])
    return Fragility(
        median=numbers[0],
        dispersion=dispersion,
        median_interval=low_high[0],
        dispersion_interval=low_high[1],
        level=level,
        covariance=covariance,
        intensities=x,
        n_exceeding=z,
        n_records=n,
    )


def _score(eta: FloatArray) -> FloatArray:
    """Slope of the log likelihood of a count over its distance from the mean, phi / (Phi (1 - Phi))."""
    log_variance = special.log_ndtr([eta, -eta]).sum(axis=0)
    return np.asarray(np.exp(-0.5 * eta**2 - log_variance) / math.sqrt(2.0 * math.pi))


def _covariance(eta: FloatArray, n: FloatArray, dispersion: float, same_records: bool) -> FloatArray:
    """Covariance of the logarithms of the median and of the dispersion, shape (2, 2)."""
    below, above = special.ndtr([eta, -eta])
    directions = _score(eta) * np.array([np.full_like(eta, -1.0 / dispersion), -eta])
    inverse = np.linalg.inv(directions * (n * below * above) @ directions.T)
    counts = n * np.minimum.outer(below, below) * np.minimum.outer(above, above)
    return np.asarray(inverse @ directions @ counts @ directions.T @ inverse if same_records else inverse)


def _check(x: FloatArray, z: FloatArray, n: FloatArray, level: float, same_records: bool) -> None:
    if (x <= 0.0).any() or np.unique(x).size < 2 or not 0.0 < level < 1.0:
        raise ValueError("intensities must be positive, at least two must differ, and level must be between 0 and 1")
    if (z % 1.0).any() or (n % 1.0).any() or (z < 0.0).any() or (z > n).any() or (n < 1.0).any():
        raise ValueError("n_exceeding must be whole numbers from 0 to n_records, which must be at least 1")
    if same_records and np.ptp(n) > 0.0:
        raise ValueError("the same records have one number at all intensities; leave same_records=False")
    if not z.any():
        raise ValueError("no record exceeds the limit at any intensity: go on to higher ones")
    if (z == n).all():
        raise ValueError("every record exceeds the limit at every intensity: begin at lower ones")
    if not x[z > 0.0].min() < x[z < n].max():
        words = f"no record exceeds the limit below the intensity {x[z > 0.0].min():g}, and all do above it"
        raise ValueError(f"the dispersion is not determined: {words}; take more intensities near it")
