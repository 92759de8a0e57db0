"""Least squares by Levenberg's and Marquardt's steps, where the slopes cost more than the residual."""

from collections.abc import Callable

import numpy as np

from hysim._frozen import FloatArray

_ROUNDS = 40
_TRIALS = 10  # of the damping in one round
_SETTLED = 1e-7  # relative fall of the cost below which the descent ends
_FIRST, _FAILURE, _SUCCESS, _LEAST = 1e-3, 5.0, 0.1, 1e-12  # damping at the beginning, its factors, its end


def descended(
    left: Callable[[FloatArray], FloatArray | None],
    slopes: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    x: FloatArray,
) -> FloatArray:
    """The optimum below `x` (n,), where `left` is not None.

    `left(x)` is the residual (n_rows,), None out of bounds; `slopes(x)` what the residual loses along each unknown,
    shape (n_rows, n), and the sizes of the unknowns' effects (n,), which scale the steps.
    """
    residual, damping = left(x), _FIRST
    for _ in range(_ROUNDS):
        if residual is None:
            return x
        J, sizes = slopes(x)
        if not (sizes > 0.0).all():  # the slope along an unknown diverges, or is none
            return x
        J, cost = J / sizes, float(residual @ residual)
        for _ in range(_TRIALS):
            tried = x + np.linalg.solve(J.T @ J + damping * np.eye(x.size), J.T @ residual) / sizes
            ahead = left(tried)
            if ahead is not None and float(ahead @ ahead) < cost:
                break
            damping *= _FAILURE
        else:
            return x
        x, residual, damping = tried, ahead, max(_SUCCESS * damping, _LEAST)
        if ahead is None or cost - float(ahead @ ahead) < _SETTLED * cost:
            return x
    return x
