"""Warnings about a transfer function that was fitted to a record: its lag may be hysteresis.

* A curve y = f(u) without memory fits as well. The curve is a polynomial with as many coefficients as the plant,
  on a record whose input levels repeat. It fits as well if the mean difference of both squared residuals is below
  1.96 of its standard errors, in which neighbouring samples may be correlated (Q. H. Vuong, Econometrica 57, 1989;
  W. K. Newey and K. D. West, Econometrica 55, 1987), and the plant leaves at least four fifths of the curve's rms.
  The second holds off a record of few short transients, whose mean is that of a few samples.
* The input runs at one rate. The loop of a lag widens with the rate, that of hysteresis does not; with one rate no
  one can see it. The rates are those of the branches between two reversals, in the mean, and they are one if they
  differ by less than a tenth. An input that stands still between reversals shows a lag at any rate.
"""

import numpy as np
from numpy.polynomial import chebyshev

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.records import Record

_SURE = 1.96
_LEAST = 0.8
_ONE_RATE = 1.1
_STILL = 2  # samples with one input: a staircase has its extremes twice in a row
_NOISE = 0.01  # of the input's span


def notes(record: Record, y: FloatArray, n_parameters: int) -> tuple[str, ...]:
    """Phrases on a plant with this output on the record, and so many coefficients."""
    phrases = []
    if np.unique(record.u).size <= len(record) // 2:
        curve = _static_curve(record, n_parameters)
        if _as_well((record.y - curve) ** 2, (record.y - y) ** 2):
            fit = metrics.fit_percent(record.y, curve)
            phrases.append(f"a single-valued curve of u fits {fit:.1f} %: as well as this model within the noise")
    if _one_rate(record):
        phrases.append("the record holds one rate only: lag and hysteresis cannot be told apart")
    return tuple(phrases)


def _static_curve(record: Record, n_coefficients: int) -> FloatArray:
    low, high = record.u.min(), record.u.max()
    scaled = (2.0 * record.u - low - high) / ((high - low) or 1.0)
    columns = chebyshev.chebvander(scaled, min(n_coefficients, np.unique(scaled).size) - 1)
    return np.asarray(columns @ np.linalg.lstsq(columns, record.y)[0])


def _as_well(curve: FloatArray, plant: FloatArray) -> bool:
    worse = curve - plant
    clearly = plant.mean() < _LEAST**2 * curve.mean()
    return not clearly and bool(worse.mean() <= _SURE * _stderr_of_mean(worse))


def _stderr_of_mean(values: FloatArray) -> float:
    n, off = values.size, values - values.mean()
    reach = int(np.cbrt(n))
    shares = 1.0 - np.arange(reach + 1) / (reach + 1)
    covariances = np.array([off[lag:] @ off[: n - lag] for lag in range(reach + 1)]) / n
    return float(np.sqrt(max(2.0 * shares @ covariances - covariances[0], 0.0) / n))


def _one_rate(record: Record) -> bool:
    branches = record.branches(_NOISE)
    changes = np.flatnonzero(np.append(True, np.diff(record.u) != 0.0))
    if len(branches) < 2 or np.diff(np.append(changes, len(record))).max() > _STILL:
        return False
    rates = [np.ptp(branch.u) / (len(branch) - 1) for branch in branches]
    return bool(max(rates) < _ONE_RATE * min(rates))
