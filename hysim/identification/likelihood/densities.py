"""Logarithms of the likelihood of many sets, with their constants, for each noise of `hysim.identify`.

With the residual r = y - m and a scale sigma, summed over the samples,

    gaussian    -r^2 / (2 sigma^2) - ln sigma - ln(2 pi) / 2
    quantised   ln [Phi((r + q/2) / sigma) - Phi((r - q/2) / sigma)],   q the quantum of the sensor
    robust      Student's t with 4 degrees of freedom: -(5/2) ln(1 + r^2 / (4 sigma^2)) - ln sigma + ln(3/8)

The first and the last are densities of y, the second is the probability of the rounded value.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray

NOISES = ("gaussian", "quantised", "robust")

_FREEDOM = 4.0
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)
_LOG_T = math.lgamma(0.5 * (_FREEDOM + 1.0)) - math.lgamma(0.5 * _FREEDOM) - 0.5 * math.log(_FREEDOM * math.pi)
_TINY = 1e-16  # least relative width of an interval, whose logarithm is then finite


class Density(NamedTuple):
    """A noise: `log_likelihood(residual, sigma)` of residuals (n_sets, n_samples) and scales (n_sets,) is (n_sets,).

    `spread(sigma)` is the standard deviation of normal noise that says about as much on the output, and `draw(y, sigma,
    rng)` makes measured outputs of the model's.
    """

    name: str
    log_likelihood: Callable[[FloatArray, FloatArray], FloatArray]
    spread: Callable[[FloatArray], FloatArray]
    draw: Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]


def density(noise: str, quantum: float | None = None) -> Density:
    """The noise of this name; a ValueError if it is unknown, or quantised noise has no `quantum`."""
    if noise not in NOISES:
        raise ValueError(f'noise must be "gaussian", "quantised" or "robust", got {noise!r}')
    if noise == "gaussian":
        return Density(noise, _gaussian, lambda sigma: sigma, _normal)
    if noise == "robust":
        factor = math.sqrt((_FREEDOM + 3.0) / (_FREEDOM + 1.0))  # from the information on the location
        return Density(noise, _robust, lambda sigma: factor * sigma, _student)
    if quantum is None:
        raise ValueError("quantised noise needs the sensor's quantum, the same for all records: Record(resolution=...)")
    return _rounded(float(quantum))


def _gaussian(residual: FloatArray, sigma: FloatArray) -> FloatArray:
    squares = np.einsum("sk,sk->s", residual, residual)
    return np.asarray(-0.5 * squares / sigma**2 - residual.shape[1] * (np.log(sigma) + _LOG_ROOT_2PI))


def _robust(residual: FloatArray, sigma: FloatArray) -> FloatArray:
    square = (residual / sigma[:, np.newaxis]) ** 2
    terms = 0.5 * (_FREEDOM + 1.0) * np.log1p(square / _FREEDOM).sum(axis=1)
    return np.asarray(residual.shape[1] * (_LOG_T - np.log(sigma)) - terms)


def _rounded(quantum: float) -> Density:
    def log_likelihood(residual: FloatArray, sigma: FloatArray) -> FloatArray:
        from scipy.special import log_ndtr

        size, scale = np.abs(residual), sigma[:, np.newaxis]
        above_near, above_far = log_ndtr((0.5 * quantum - size) / scale), log_ndtr((-0.5 * quantum - size) / scale)
        share = np.log1p(-np.exp(np.minimum(above_far - above_near, -_TINY)))
        return np.asarray((above_near + share).sum(axis=1))

    def spread(sigma: FloatArray) -> FloatArray:
        return np.sqrt(sigma**2 + quantum**2 / 12.0)

    def draw(y: FloatArray, sigma: FloatArray, rng: np.random.Generator) -> FloatArray:
        return np.asarray(quantum * np.round(_normal(y, sigma, rng) / quantum))

    return Density("quantised", log_likelihood, spread, draw)


def _normal(y: FloatArray, sigma: FloatArray, rng: np.random.Generator) -> FloatArray:
    return y + np.reshape(sigma, (-1, 1)) * rng.standard_normal(y.shape)


def _student(y: FloatArray, sigma: FloatArray, rng: np.random.Generator) -> FloatArray:
    return y + np.reshape(sigma, (-1, 1)) * rng.standard_t(_FREEDOM, y.shape)
