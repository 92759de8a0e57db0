"""Normal numbers between ends, as functions of normal numbers that have none.

With Phi the distribution of the standard normal one, x = Phi^-1(Phi(low) + Phi(e) (Phi(high) - Phi(low))) is normal
between its ends where e is standard normal. All is computed by logarithms, so that ends may lie far out on one side.
"""

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from hysim._frozen import FloatArray

_FAR = 9.0  # from which on an end cuts off nothing that is seen in 64 bits


def solved_within(
    triangle: FloatArray, best: FloatArray, e: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The w with R w - best normal between the ends low <= w <= high, and ln |dw/de|.

    `triangle` are the R (n_sets, n, n), of which no diagonal is zero; the others are (n_sets, n), and e is standard
    normal. From the last number up each has its ends given those below.
    """
    w, log_volume = np.empty_like(e), np.zeros(len(e))
    for k in reversed(range(e.shape[1])):
        scale = triangle[:, k, k]
        mean = best[:, k] - np.einsum("sj,sj->s", triangle[:, k, k + 1 :], w[:, k + 1 :])
        ends = np.sort([scale * low[:, k] - mean, scale * high[:, k] - mean], axis=0)
        x, log_slope = between(e[:, k], *ends)
        w[:, k] = np.clip((mean + x) / scale, low[:, k], high[:, k])
        log_volume += log_slope - np.log(np.abs(scale))
    return w, log_volume


def between(e: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The x between low < high whose quantile there is that of e, and ln dx/de, (n_sets,)."""
    if (low < -_FAR).all() and (high > _FAR).all():
        return e, np.zeros(len(e))
    is_above = low + high > 0.0  # the tail on the other side keeps the digits
    least, most = np.where(is_above, -high, low), np.where(is_above, -low, high)
    below, above = log_ndtr(least), log_ndtr(most)
    mass = above + np.log1p(-np.exp(np.minimum(below - above, -1e-300)))
    x = np.clip(ndtri_exp(np.logaddexp(below, log_ndtr(np.where(is_above, -e, e)) + mass)), least, most)
    return np.where(is_above, -x, x), mass + 0.5 * (x**2 - e**2)
