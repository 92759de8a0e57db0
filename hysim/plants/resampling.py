"""From a record's rate to that of an integration and back.

A periodic input that holds no line above half its rate is brought to a higher one by its spectrum. So is one from rest,
which goes on at both ends as linear prediction continues it (J. P. Burg, 1967), and fades. The output comes back by
stages of a symmetric 31-tap Hamming low-pass each, with the cutoff at half of the new rate, without delay, every r-th
sample kept. There a periodic signal goes on with itself beyond its ends, any other with its point mirror image.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import firwin, upfirdn

from hysim._frozen import FloatArray

HALF_FILTER = 15
_BEYOND = 128  # samples by which a record is continued at either end
_PREDICTING = 32  # samples from which the next one is predicted


def interpolated(period: FloatArray, factor: int) -> FloatArray:
    """One period (n,) at `factor` times the rate; a line at half the old rate is shared by both of its signs."""
    if factor == 1:
        return period
    spectrum = np.fft.rfft(period)
    if period.size % 2 == 0:
        spectrum[-1] *= 0.5
    return np.asarray(np.fft.irfft(spectrum, factor * period.size) * factor)


def interpolated_record(u: FloatArray, factor: int) -> FloatArray:
    """A record (n,) at `factor` times the rate, from its first to its last sample, shape ((n - 1) factor + 1,)."""
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, _BEYOND + 1) / _BEYOND)
    weights = _prediction(u, min(_PREDICTING, u.size // 3))
    behind = _continued(u, weights) * fade
    before = _continued(u[::-1], weights) * fade
    fine = interpolated(np.concatenate([before[::-1], u, behind]), factor)
    return fine[_BEYOND * factor : (_BEYOND + u.size - 1) * factor + 1]


def _prediction(u: FloatArray, order: int) -> FloatArray:
    """Weights of the last samples, the latest first, that predict the next one, by Burg's method; they are stable."""
    ahead, behind, weights = u[1:], u[:-1], np.empty(0)
    for _ in range(order):
        power = float(ahead @ ahead + behind @ behind)
        k = 2.0 * float(ahead @ behind) / power if power > 0.0 else 0.0
        weights = np.append(weights - k * weights[::-1], k)
        ahead, behind = (ahead - k * behind)[1:], (behind - k * ahead)[:-1]
    return weights


def _continued(u: FloatArray, weights: FloatArray) -> FloatArray:
    """The samples behind the last one as far as they can be predicted."""
    values = np.concatenate([u[u.size - weights.size :], np.zeros(_BEYOND)])
    for k in range(weights.size, values.size):
        values[k] = weights @ values[k - weights.size : k][::-1]
    return values[weights.size :]


def decimated(y: FloatArray, stages: Sequence[int], *, periodic: bool = False) -> FloatArray:
    """Every (product of stages)-th sample of `y`, filtered stage by stage, with more than 15 samples at each."""
    for factor in stages:
        y = _stage(y, factor, periodic)
    return y


def _stage(y: FloatArray, factor: int, periodic: bool) -> FloatArray:
    taps = firwin(2 * HALF_FILTER + 1, 1.0 / factor)
    if periodic:
        before, after = y[-HALF_FILTER:], y[:HALF_FILTER]
    else:
        before, after = 2.0 * y[0] - y[HALF_FILTER:0:-1], 2.0 * y[-1] - y[-2 : -2 - HALF_FILTER : -1]
    # the first of the filtered outputs is number 2 * HALF_FILTER of the convolution: zeros move it onto the grid
    lead = np.zeros(-2 * HALF_FILTER % factor)
    filtered = upfirdn(taps, np.concatenate([lead, before, y, after]), down=factor)
    first = (lead.size + 2 * HALF_FILTER) // factor
    return np.asarray(filtered[first : first - (-y.size // factor)])
