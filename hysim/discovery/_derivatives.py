"""Two forms of the law's slope that a regression can use, both along the loading length L, dL = |du|.

A rate-independent law has no use for time. With s = sgn(du) and z = y - feedthrough u - offset, it is

    dz/dL = sum c_k phi_k(u, z, s)                        smoothed form
    int psi dz = sum c_k int psi phi_k(u, z, s) dL        weak form, psi a bump that ends at zero

**Smoothed.** On each branch, from one reversal of the input to the next, the output is smoothed by a polynomial
in L whose degree is the lowest within 1 % of the best leave-one-out error, and dy/dL is the slope of that. Nothing
is ever smoothed across a reversal, where the slope jumps. Samples between which the input rests count as one, with
the mean of their outputs. Branches of fewer than MIN_SAMPLES such points say nothing certain about a slope and are
left out.

**Weak.** By parts, int psi dz = -int z dpsi: no slope of the output is taken at all, and a window may reach across
reversals. Where a branch is long enough the features take its smoothed output, elsewhere the measured one.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import chebyshev

from hysim._frozen import FloatArray

MIN_SAMPLES = 4
MAX_DEGREE = 12
_NEAR = 1.01  # a lower degree whose leave-one-out error is within 1 % of the best is taken
_SHORTEST = 6  # intervals of a window
_WINDOWS = 400
_OVERLAP = 4

Feature = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Of input, memory and direction at n points, the value of one term or of several, (n,) or (n, n_terms)."""


@dataclass(frozen=True)
class Branch:
    """One monotone stretch of a record: inputs, smoothed outputs, dy/dL, each (n,), and the sign of du."""

    u: FloatArray
    y: FloatArray
    slope: FloatArray
    direction: float


@dataclass(frozen=True)
class Rows:
    """The rows of a regression: points (n_points,) of the path, and what makes rows of them.

    `slope` (n_rows,) is the left side for z = y. `window` (n_window,) sums values at points into rows, every `stride`
    points one, each times `length`; with None, each point is a row.
    """

    u: FloatArray
    y: FloatArray
    direction: FloatArray
    slope: FloatArray
    length: FloatArray
    window: FloatArray | None = None
    stride: int = 1

    def columns(self, feature: Feature, feedthrough: float = 0.0, offset: float = 0.0) -> FloatArray:
        """The right side, shape (n_rows, n_terms)."""
        values = feature(self.u, self.y - feedthrough * self.u - offset, self.direction)
        return self._summed(values * self.length[:, np.newaxis])

    def left(self, feedthrough: float = 0.0) -> FloatArray:
        """The left side for z = y - feedthrough u, shape (n_rows,)."""
        return self.slope - feedthrough * self._summed((self.direction * self.length)[:, np.newaxis])[:, 0]

    def _summed(self, values: FloatArray) -> FloatArray:
        if self.window is None:
            return values
        return np.asarray(sliding_window_view(values, self.window.size, axis=0)[:: self.stride] @ self.window)


def smoothed_rows(u: FloatArray, y: FloatArray) -> Rows | None:
    """The smoothed form, or None where no branch is long enough."""
    found = branches(u, y)
    if not found:
        return None
    ends = [np.concatenate([getattr(branch, name) for branch in found]) for name in ("u", "y", "slope")]
    direction = np.concatenate([np.full(branch.u.size, branch.direction) for branch in found])
    return Rows(ends[0], ends[1], direction, ends[2], np.ones(direction.size))


def weak_rows(u: FloatArray, y: FloatArray) -> Rows | None:
    """The weak form, or None where there are too few samples for a window."""
    u, y = without_rests(u, y)
    n = u.size - 1
    if n < _SHORTEST:
        return None
    size = max(_SHORTEST, min(n // _WINDOWS, n // len(pieces(u))))
    stride = max(1, size // _OVERLAP)
    x = np.linspace(-1.0, 1.0, size + 1)
    bump = (1.0 - x**2) ** 2
    shares = 0.5 * (bump[1:] + bump[:-1])  # with these the sum by parts is exact, whatever the steps of the input
    du, smooth = np.diff(u), _smoothed_where_long(u, y)
    mean_y = 0.5 * (y[1:] + y[:-1])
    slope = -sliding_window_view(mean_y, size)[::stride] @ np.diff(bump)
    points = [0.5 * (values[1:] + values[:-1]) for values in (u, smooth)]
    return Rows(points[0], points[1], np.sign(du), slope, np.abs(du), shares, stride)


def branches(u: FloatArray, y: FloatArray) -> list[Branch]:
    """The branches of a record that have enough samples, smoothed."""
    u, y = without_rests(u, y)
    return [smoothed(u[piece], y[piece]) for piece in pieces(u) if u[piece].size >= MIN_SAMPLES]


def smoothed(u: FloatArray, y: FloatArray) -> Branch:
    """The branch through the samples of one monotone stretch."""
    length = np.abs(u - u[0])
    x = 2.0 * length / length[-1] - 1.0
    series = _polynomial(x, y)
    slope = chebyshev.chebval(x, chebyshev.chebder(series)) * 2.0 / length[-1]
    return Branch(u, chebyshev.chebval(x, series), slope, float(np.sign(u[-1] - u[0])))


def without_rests(u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Samples between which the input moves, each with the mean of the outputs while it rests there."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(u) != 0.0]))
    counts = np.diff(np.append(starts, u.size))
    return u[starts], np.add.reduceat(y, starts) / counts


def pieces(u: FloatArray) -> list[slice]:
    """Where the branches of an input without rests lie, each with both its ends."""
    direction = np.sign(np.diff(u))
    reversals = np.flatnonzero(direction[1:] != direction[:-1]) + 1
    return [slice(first, last + 1) for first, last in itertools.pairwise([0, *reversals.tolist(), u.size - 1])]


def _smoothed_where_long(u: FloatArray, y: FloatArray) -> FloatArray:
    out = y.copy()
    for piece in pieces(u):
        if u[piece].size >= MIN_SAMPLES:
            out[piece] = smoothed(u[piece], y[piece]).y
    return out


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
