"""Least squares where many evaluations together cost little more than one.

    minimise ||r(x)||^2,    (J^T J + lambda diag(J^T J)) step = -J^T r

Levenberg and Marquardt's step, at several dampings lambda at once: the best of them is taken, and sets the next ones.
The Jacobian is a difference, its columns one batch. Coordinates at a bound that the gradient pushes against stand
still.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray

_DAMPINGS = np.array([1e-3, 1e-1, 1.0, 10.0])  # of those tried together, over the last one that was best
_LEAST, _MOST = 1e-12, 1e8
_FIRST = 1e-3
_CENTRAL = 1e-6  # truncation and rounding of a central difference are both near 1e-10
_ONE_SIDED = 1e-7  # of a one-sided one 1e-7, at half the cost

Residuals = Callable[[FloatArray], FloatArray]
"""From points (n_sets, n_x) to residuals (n_sets, n_samples)."""


class Reached(NamedTuple):
    """Where a descent ended: the point (n_x,), the Jacobian (n_samples, n_x) and the residuals (n_samples,) there."""

    x: FloatArray
    jacobian: FloatArray
    residual: FloatArray


def descend(
    residuals: Residuals,
    x: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    *,
    tolerance: float,
    steps: int,
    central: bool,
    hopeless: float = np.inf,
) -> Reached:
    """Descend from `x` until a step lowers the sum of squares by less than `tolerance` of it.

    The descent also ends where the remaining steps, each lowering the sum by as much as the last one, would not bring
    it below `hopeless`: steps become smaller near an optimum.
    """
    damping = _FIRST
    here = linearised(residuals, x, central)
    for remaining in range(steps - 1, -1, -1):
        cost = float(here.residual @ here.residual)
        trials = _trials(here, damping * _DAMPINGS, lower, upper)
        squares = np.sum(residuals(trials) ** 2, axis=1)
        best = int(np.argmin(squares))
        if not squares[best] < cost:
            damping *= 10.0 / _DAMPINGS[0]
            if damping > _MOST:
                break
            continue
        damping = float(np.clip(damping * _DAMPINGS[best], _LEAST, _MOST))
        here = linearised(residuals, trials[best], central)
        fall = cost - float(squares[best])
        if fall <= tolerance * cost or cost - (1 + remaining) * fall > hopeless:
            break
    return here


def linearised(residuals: Residuals, x: FloatArray, central: bool) -> Reached:
    """Residual and Jacobian at `x` (n_x,), by central or one-sided differences."""
    width = _CENTRAL if central else _ONE_SIDED
    steps = width * np.eye(x.size)
    around = residuals(np.concatenate([x[np.newaxis], x + steps, *([x - steps] if central else [])]))
    here, ahead, behind = around[0], around[1 : 1 + x.size], around[1 + x.size :]
    columns = (ahead - behind) / (2.0 * width) if central else (ahead - here) / width
    return Reached(x, columns.T, here)


def _trials(here: Reached, dampings: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The points (n_dampings, n_x) that the damped steps lead to, inside the bounds."""
    gradient, normal = here.jacobian.T @ here.residual, here.jacobian.T @ here.jacobian
    still = ((here.x <= lower) & (gradient > 0.0)) | ((here.x >= upper) & (gradient < 0.0))
    scale = np.sqrt(np.diag(normal))
    still |= scale == 0.0
    scale[still] = 1.0
    scaled = normal / np.outer(scale, scale)
    scaled[still, :], scaled[:, still] = 0.0, 0.0
    descent = np.where(still, 0.0, -gradient / scale)
    damped = scaled + (dampings[:, np.newaxis, np.newaxis] + 1e-15) * np.eye(scale.size)
    damped[:, still, still] = 1.0
    steps = np.linalg.solve(damped, np.broadcast_to(descent[:, np.newaxis], (len(dampings), scale.size, 1)))[..., 0]
    return np.clip(here.x + steps / scale, lower, upper)
