"""Slopes of the output along the input, branch by branch.

A rate-independent law has no use for time: its independent variable is the loading length L, dL = |du|. On
each branch, from one reversal of the input to the next, the output is smoothed by a polynomial in L whose
degree is the lowest within 1 % of the best leave-one-out error, and dy/dL is the slope of that. Nothing is
ever smoothed across a reversal, where the slope jumps. Samples between which the input rests count as
one, with the mean of their outputs. Branches of fewer than MIN_SAMPLES such points say nothing certain
about a slope and are left out.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from hysim._frozen import FloatArray

MIN_SAMPLES = 4
MAX_DEGREE = 12
_NEAR = 1.01  # a lower degree whose leave-one-out error is within 1 % of the best is taken


@dataclass(frozen=True)
class Branch:
    """One monotone stretch of a record: inputs, smoothed outputs, dy/dL, each (n,), and the sign of du."""

    u: FloatArray
    y: FloatArray
    slope: FloatArray
    direction: float

    @property
    def length(self) -> FloatArray:
        """Loading length from the first sample, strictly increasing."""
        return np.asarray(np.abs(self.u - self.u[0]))


def branches(u: FloatArray, y: FloatArray) -> list[Branch]:
    """The branches of a record that have enough samples, smoothed."""
    u, y = _without_rests(u, y)
    direction = np.sign(np.diff(u))
    reversals = np.flatnonzero(direction[1:] != direction[:-1]) + 1
    edges = [0, *reversals.tolist(), u.size - 1]
    pieces = [slice(first, last + 1) for first, last in itertools.pairwise(edges)]
    return [smoothed(u[piece], y[piece]) for piece in pieces if u[piece].size >= MIN_SAMPLES]


def smoothed(u: FloatArray, y: FloatArray) -> Branch:
    """The branch through the samples of one monotone stretch."""
    length = np.abs(u - u[0])
    x = 2.0 * length / length[-1] - 1.0
    series = _polynomial(x, y)
    slope = chebyshev.chebval(x, chebyshev.chebder(series)) * 2.0 / length[-1]
    return Branch(u, chebyshev.chebval(x, series), slope, float(np.sign(u[-1] - u[0])))


def _without_rests(u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    starts = np.flatnonzero(np.concatenate([[True], np.diff(u) != 0.0]))
    counts = np.diff(np.append(starts, u.size))
    return u[starts], np.add.reduceat(y, starts) / counts


def _polynomial(x: FloatArray, y: FloatArray) -> FloatArray:
    """Chebyshev coefficients of the smoothing polynomial on -1 <= x <= 1."""
    highest = min(MAX_DEGREE, x.size - 2)
    basis, triangle = np.linalg.qr(chebyshev.chebvander(x, highest))
    weights = basis.T @ y
    fits = np.cumsum(basis * weights, axis=1)
    leverages = np.cumsum(basis**2, axis=1)
    left_out = (y[:, np.newaxis] - fits) / np.maximum(1.0 - leverages, 1e-12)
    errors = np.sqrt(np.mean(left_out**2, axis=0))
    degree = int(np.argmax(errors <= _NEAR * errors.min()))
    return np.linalg.solve(triangle[: degree + 1, : degree + 1], weights[: degree + 1])
