"""Densities of the measured output y about the model's output m, r = y - m, each of scale sigma.

    gaussian    y = m + sigma e,  e normal:        -ln p = r^2 / (2 sigma^2) + ln sigma
    quantised   y is the nearest multiple of q:    -ln p = -ln [Phi((r + q/2) / sigma) - Phi((r - q/2) / sigma)]
    robust      e of Student's t, nu = 4:          -ln p = (nu + 1)/2 ln(1 + r^2 / (nu sigma^2)) + ln sigma

Constants are left out of the first and the last. `scale` is the most likely sigma (n_sets, 1) for residuals
(n_sets, n_samples), so that only the model's parameters are searched. `terms` are, for each sample, -ln p and its slope
and non-negative curvature in m: a descent is a sequence of weighted regressions. `draw` makes measured outputs, and
`spread` is the standard deviation of normal noise that says about as much on the output.

`log_likelihood` (n_sets,) of residuals and scales (n_sets,) has the constants, and is summed over the samples:

    gaussian    -r^2 / (2 sigma^2) - ln sigma - ln(2 pi) / 2
    quantised   ln [Phi((r + q/2) / sigma) - Phi((r - q/2) / sigma)],   the probability of the rounded value
    robust      Student's t with 4 degrees of freedom: -(5/2) ln(1 + r^2 / (4 sigma^2)) - ln sigma + ln(3/8)
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, check_choice

_FREEDOM = 4.0  # of Student's t: a compromise between efficiency on normal noise and indifference to outliers
_FINEST = 0.1  # smallest sigma of rounded data, in quanta: with less noise intervals are on the safe side
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)
_LOG_T = math.lgamma(0.5 * (_FREEDOM + 1.0)) - math.lgamma(0.5 * _FREEDOM) - 0.5 * math.log(_FREEDOM * math.pi)
_TINY = 1e-16  # least relative width of an interval, whose logarithm is then finite
Scale = float | FloatArray


class Terms(NamedTuple):
    """-ln p of each sample, its slope and its curvature in the model's output, (n_sets, n_samples).

    For outliers the curvature is that of a parabola above the loss, which a descent may trust.
    """

    loss: FloatArray
    slope: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class Gaussian:
    """Normal noise; `floor` is the smallest sigma [unit of y]."""

    floor: float
    name: str = "gaussian"

    def scale(self, residual: FloatArray, weights: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(_rms(residual, weights), self.floor))

    def terms(self, residual: FloatArray, sigma: FloatArray) -> Terms:
        normal = residual / sigma
        return Terms(0.5 * normal**2 + np.log(sigma), -normal / sigma, np.broadcast_to(sigma**-2.0, residual.shape))

    def log_likelihood(self, residual: FloatArray, sigma: FloatArray) -> FloatArray:
        squares = np.einsum("sk,sk->s", residual, residual)
        return np.asarray(-0.5 * squares / sigma**2 - residual.shape[1] * (np.log(sigma) + _LOG_ROOT_2PI))

    def spread(self, sigma: FloatArray) -> FloatArray:
        return sigma

    def draw(self, y: FloatArray, sigma: Scale, rng: np.random.Generator) -> FloatArray:
        return np.asarray(y + _by_set(sigma) * rng.standard_normal(y.shape))


@dataclass(frozen=True)
class Robust:
    """Student's t, for records with outliers; `floor` is the smallest sigma [unit of y]."""

    floor: float
    name: str = "robust"

    def scale(self, residual: FloatArray, weights: FloatArray) -> FloatArray:
        total = weights.sum(axis=1, keepdims=True)
        square = np.sum(weights * residual**2, axis=1, keepdims=True) / total
        for _ in range(30):  # expectation and maximisation, which contracts by about a half each time
            square = np.maximum(square, self.floor**2)
            trust = (_FREEDOM + 1.0) / (_FREEDOM + residual**2 / square)
            square = np.sum(weights * trust * residual**2, axis=1, keepdims=True) / total
        return np.asarray(np.maximum(np.sqrt(square), self.floor))

    def terms(self, residual: FloatArray, sigma: FloatArray) -> Terms:
        square = (residual / sigma) ** 2
        trust = (_FREEDOM + 1.0) / (_FREEDOM + square) / sigma**2
        loss = 0.5 * (_FREEDOM + 1.0) * np.log1p(square / _FREEDOM) + np.log(sigma)
        return Terms(loss, -trust * residual, trust)

    def log_likelihood(self, residual: FloatArray, sigma: FloatArray) -> FloatArray:
        square = (residual / sigma[:, np.newaxis]) ** 2
        terms = 0.5 * (_FREEDOM + 1.0) * np.log1p(square / _FREEDOM).sum(axis=1)
        return np.asarray(residual.shape[1] * (_LOG_T - np.log(sigma)) - terms)

    def spread(self, sigma: FloatArray) -> FloatArray:
        return math.sqrt((_FREEDOM + 3.0) / (_FREEDOM + 1.0)) * sigma  # from the information on the location

    def draw(self, y: FloatArray, sigma: Scale, rng: np.random.Generator) -> FloatArray:
        return np.asarray(y + _by_set(sigma) * rng.standard_t(_FREEDOM, y.shape))


@dataclass(frozen=True)
class Quantised:
    """Normal noise before a sensor that rounds to multiples of `quantum`; sigma is at least `floor` [unit of y].

    The most likely sigma is too small for few samples. The mean squared residual s^2 on N - d degrees of freedom, less
    the variance of rounding (Sheppard), is not: sigma^2 = s^2 - quantum^2 / 12.
    """

    quantum: float
    floor: float = 0.0
    name: str = "quantised"

    def at_least(self, sum_of_squares: float, freedom: int) -> "Quantised":
        """With the floor that the least sum of squares on so many degrees of freedom leaves."""
        variance = sum_of_squares / max(freedom, 1) - self.quantum**2 / 12.0
        return Quantised(self.quantum, float(np.sqrt(max(variance, 0.0))))

    def scale(self, residual: FloatArray, weights: FloatArray) -> FloatArray:
        """Bisection on ln sigma: ln p is concave in 1 / sigma, so that its slope changes sign once."""
        low = np.full((len(residual), 1), np.log(max(self.floor, _FINEST * self.quantum)))
        high = np.maximum(np.log(_rms(residual, weights) + self.quantum), low)
        for _ in range(26):
            middle = 0.5 * (low + high)
            falls = np.sum(weights * self._scale_slope(residual, np.exp(middle)), axis=1, keepdims=True) < 0.0
            low, high = np.where(falls, middle, low), np.where(falls, high, middle)
        return np.asarray(np.exp(0.5 * (low + high)))

    def terms(self, residual: FloatArray, sigma: FloatArray) -> Terms:
        near, far, log_p, near_share, far_share = self._interval(residual, sigma)
        slope = (near_share - far_share) / sigma
        curvature = slope**2 + (far * far_share - near * near_share) / sigma**2
        return Terms(-log_p, np.sign(residual) * -slope, np.maximum(curvature, 0.0))

    def log_likelihood(self, residual: FloatArray, sigma: FloatArray) -> FloatArray:
        from scipy.special import log_ndtr

        size, scale, half = np.abs(residual), sigma[:, np.newaxis], 0.5 * self.quantum
        above_near, above_far = log_ndtr((half - size) / scale), log_ndtr((-half - size) / scale)
        share = np.log1p(-np.exp(np.minimum(above_far - above_near, -_TINY)))
        return np.asarray((above_near + share).sum(axis=1))

    def spread(self, sigma: FloatArray) -> FloatArray:
        return np.sqrt(sigma**2 + self.quantum**2 / 12.0)

    def draw(self, y: FloatArray, sigma: Scale, rng: np.random.Generator) -> FloatArray:
        drawn = y + _by_set(sigma) * rng.standard_normal(y.shape)
        return np.asarray(self.quantum * np.round(drawn / self.quantum))

    def _scale_slope(self, residual: FloatArray, sigma: FloatArray) -> FloatArray:
        near, far, _, near_share, far_share = self._interval(residual, sigma)
        return far * far_share - near * near_share

    def _interval(self, residual: FloatArray, sigma: FloatArray) -> tuple[FloatArray, ...]:
        """Ends of the interval in sigma, mirrored to the upper side; ln P; and the density at the ends over P."""
        from scipy.special import log_ndtr

        size = np.abs(residual)
        near, far = (size - 0.5 * self.quantum) / sigma, (size + 0.5 * self.quantum) / sigma
        above_near, above_far = log_ndtr(-near), log_ndtr(-far)
        log_p = above_near + np.log1p(-np.exp(np.minimum(above_far - above_near, -1e-16)))
        most = np.abs(near) + sigma / self.quantum + 1.0  # bound of a share, for residuals beyond all digits
        shares = [np.minimum(np.exp(np.minimum(-0.5 * end**2 - _LOG_ROOT_2PI - log_p, 700.0)), most)
                  for end in (near, far)]  # fmt: skip
        return near, far, log_p, *shares


Noise = Gaussian | Robust | Quantised


def density(noise: str, quantum: float | None = None, floor: float = 0.0) -> Noise:
    """The noise of this name; a ValueError if it is unknown, or quantised noise has no `quantum`."""
    check_choice("noise", noise, ("gaussian", "quantised", "robust"))
    if noise == "gaussian":
        return Gaussian(floor)
    if noise == "robust":
        return Robust(floor)
    if quantum is None:
        raise ValueError("quantised noise needs the sensor's quantum, the same for all records: Record(resolution=...)")
    return Quantised(float(quantum))


def _by_set(sigma: Scale) -> FloatArray:
    return np.asarray(sigma)[..., np.newaxis]


def _rms(residual: FloatArray, weights: FloatArray) -> FloatArray:
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.sum(weights * residual**2, axis=1, keepdims=True) / total))
