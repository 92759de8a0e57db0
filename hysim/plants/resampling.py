"""From a record's rate to that of an integration and back.

A periodic input that holds no line above half its rate is brought to a higher one by its spectrum. The output comes
back by stages of a symmetric 31-tap Hamming low-pass each, with the cutoff at half of the new rate, without delay,
every r-th sample kept. Beyond the ends a periodic signal goes on with itself, any other with its point mirror image.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import firwin, upfirdn

from hysim._frozen import FloatArray

HALF_FILTER = 15


def interpolated(period: FloatArray, factor: int) -> FloatArray:
    """One period (n,) at `factor` times the rate; a line at half the old rate is shared by both of its signs."""
    if factor == 1:
        return period
    spectrum = np.fft.rfft(period)
    if period.size % 2 == 0:
        spectrum[-1] *= 0.5
    return np.asarray(np.fft.irfft(spectrum, factor * period.size) * factor)


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
