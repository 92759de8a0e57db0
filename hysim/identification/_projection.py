"""Variable projection: the linear parameters are solved for, the others are searched.

For coordinates x the output is affine in the linear parameters b, y(x, b) = C(x) b + e(x). The best b is a
regression, b(x) = C(x)^+ (y - e(x)), and what is left to minimise is the norm of the projected residual

    r(x) = y - e(x) - C(x) b(x)

over the box of x (Golub and Pereyra 1973). Everything is evaluated for many x at once.
"""

from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.search_space import Identifiable, Parameters, SearchSpace
from hysim.records import Record

_CHUNK = 200_000  # samples that are evaluated at once, to bound the memory
_LARGEST = 1e150  # beyond it squares overflow: such a set counts as one that has escaped
_RANK = 1e-11  # singular values of the normalised columns below this are taken as zero
_DIFFERENCE = 1e-6  # step of a central difference in units of the box: truncation and rounding both ~1e-10


@dataclass(frozen=True)
class Projection:
    """The least-squares problem of one family on one record.

    Weights, shape (n_sets, n_samples), may be given to each method; a zero leaves a sample out of the fit.
    """

    family: Identifiable
    space: SearchSpace
    record: Record

    def solve(self, x: FloatArray, weights: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Linear parameters (n_sets, n_linear) and weighted residuals (n_sets, n_samples) at the coordinates `x`.

        A set that leaves the finite numbers has residuals of inf.
        """
        parts = [self._solve(x[part], None if weights is None else weights[part]) for part in self._parts(len(x))]
        linear, residuals = zip(*parts, strict=True)
        return np.concatenate(linear), np.concatenate(residuals)

    def costs(self, x: FloatArray) -> FloatArray:
        """Sums of squares (n_sets,), without holding the residuals of all sets at once."""
        return np.concatenate([np.sum(self._solve(x[part], None)[1] ** 2, axis=1) for part in self._parts(len(x))])

    def _parts(self, n_sets: int) -> list[slice]:
        size = max(1, _CHUNK // len(self.record))
        return [slice(k, k + size) for k in range(0, n_sets, size)]

    def _solve(self, x: FloatArray, weights: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        columns, fixed_part = self.split(self.space.parameters(x))
        target = self.record.y - fixed_part
        if weights is not None:
            columns, target = columns * weights[..., np.newaxis], target * weights
        broken = ~((np.abs(columns) < _LARGEST).all(axis=(1, 2)) & (np.abs(target) < _LARGEST).all(axis=1))
        columns[broken], target[broken] = 0.0, 0.0
        linear = self._regress(columns, target)
        residual = target - (columns @ linear[..., np.newaxis])[..., 0]
        residual[broken] = np.inf
        return linear, residual

    def split(self, parameters: Parameters) -> tuple[FloatArray, FloatArray]:
        """Columns of the free linear parameters, and the part of the output that does not depend on them."""
        with np.errstate(over="ignore", invalid="ignore"):
            regressors = self.family.regressors(parameters, self.record)
            fixed_part = regressors[..., -1].copy()
            for k, name in enumerate(self.space.columns):
                if name in self.space.held:
                    fixed_part += self.space.held[name] * regressors[..., k]
        free = [k for k, name in enumerate(self.space.columns) if name in self.space.linear]
        return regressors[..., free], fixed_part

    def residual(self, x: FloatArray) -> FloatArray:
        """Projected residual (n_samples,) at one point (n_x,)."""
        return np.asarray(self.solve(x[np.newaxis])[1][0])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Jacobian (n_samples, n_x) of the projected residual at one point (n_x,)."""
        return np.asarray(self.jacobians(x[np.newaxis])[0])

    def jacobians(self, x: FloatArray) -> FloatArray:
        """Jacobians (n_sets, n_samples, n_x) of the projected residual, by central differences inside the box."""
        ahead, behind, steps = self.neighbours(x)
        return self._differences(ahead, self._residuals(behind, None), steps, None)

    def rough_jacobians(self, x: FloatArray, residual: FloatArray, weights: FloatArray | None) -> FloatArray:
        """As `jacobians` by one-sided differences, at half the cost: good enough to descend by."""
        ahead, behind, _ = self.neighbours(x)
        ends = np.where((x == self.space.upper)[..., np.newaxis], behind, ahead)
        steps = np.einsum("sii->si", ends - x[:, np.newaxis])
        return self._differences(ends, residual[:, np.newaxis], steps, weights)

    def _differences(
        self, ends: FloatArray, start: FloatArray, steps: FloatArray, weights: FloatArray | None
    ) -> FloatArray:
        with np.errstate(invalid="ignore"):
            return np.asarray(((self._residuals(ends, weights) - start) / steps[..., np.newaxis]).transpose(0, 2, 1))

    def _residuals(self, x: FloatArray, weights: FloatArray | None) -> FloatArray:
        """Residuals (n_sets, n_x, n_samples) at the points (n_sets, n_x, n_x)."""
        n_x = x.shape[-1]
        repeated = None if weights is None else np.repeat(weights, n_x, axis=0)
        return self.solve(x.reshape(-1, n_x), repeated)[1].reshape(*x.shape[:2], -1)

    def neighbours(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points a small step ahead of and behind each `x` (n_sets, n_x) along each coordinate, and their distance."""
        step = np.diag(_DIFFERENCE * (self.space.upper - self.space.lower))
        ahead = np.minimum(x[:, np.newaxis] + step, self.space.upper)
        behind = np.maximum(x[:, np.newaxis] - step, self.space.lower)
        return ahead, behind, np.einsum("sii->si", ahead - behind)

    def _regress(self, columns: FloatArray, target: FloatArray) -> FloatArray:
        norms = np.linalg.norm(columns, axis=1)
        norms[norms == 0.0] = 1.0
        normalised = columns / norms[:, np.newaxis, :]
        if self.space.bounds:
            return self._bounded(normalised, target, norms)
        left, singular, right = np.linalg.svd(normalised, full_matrices=False)
        inverse = np.where(singular > _RANK, 1.0 / np.maximum(singular, _RANK), 0.0)
        projected = inverse[..., np.newaxis] * (left.transpose(0, 2, 1) @ target[..., np.newaxis])
        return np.asarray((right.transpose(0, 2, 1) @ projected)[..., 0] / norms)

    def _bounded(self, columns: FloatArray, target: FloatArray, norms: FloatArray) -> FloatArray:
        from scipy.optimize import lsq_linear

        limits = [self.space.bounds.get(name, (-np.inf, np.inf)) for name in self.space.linear]
        lower, upper = np.array(limits).T
        solutions = [
            lsq_linear(one, goal, bounds=(lower * norm, upper * norm), method="bvls").x / norm
            for one, goal, norm in zip(columns, target, norms, strict=True)
        ]
        return np.array(solutions).reshape(len(columns), len(limits))
