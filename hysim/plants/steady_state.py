"""Steady motion of an oscillator under an input that repeats itself, where it settles slowly.

With P the map of the state (y, y', z) over one period, a steady motion is a fixed point of P. It attracts if the
multipliers, the eigenvalues of J = dP/dx, lie within the unit circle. Going through the period again and again shrinks
a deviation only by the largest of them in a period; Newton's method needs a few steps of four periods:

    x <- x + (I - J)^-1 (P(x) - x),        J by forward differences, three periods

A multiplier of 1 belongs to a quantity that the motion conserves, such as the offset of a memory without hysteresis:
Newton's method leaves it as it is. A fixed point is used only if

    1. every other multiplier is below 1 - 1e-5 in size, so that the motion attracts, and
    2. the linear map there predicts the change over the last period that was gone through, so that it is the motion in
       which the plant settles, where there are several.

Source: R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, chapter 7.
"""

from collections.abc import Callable

import numpy as np

from hysim._frozen import FloatArray
from hysim.errors import SimulationError

ATTEMPTS = (16, 32, 64, 128, 256)  # periods gone through before each search for a fixed point, and before giving up
MARGIN = 1e-5  # below 1, of a multiplier that attracts: differences find it to about 1e-6
_DIFFERENCE = 1e-6  # of the largest value of each state
_MOST_STEPS = 8
_SHARES = (1.0, 0.5, 0.25, 0.125)  # of a Newton step, the first that lowers the mismatch
_PREDICTED = 0.3  # largest part of the last change that the linear map may miss

Period = Callable[[FloatArray], FloatArray]
"""State (3,) after a period, from that before; SimulationError if it diverges."""


def attracting_state(period: Period, state: FloatArray, scale: FloatArray, tolerance: float) -> FloatArray | None:
    """State (3,) of the steady motion near `state`, or None if Newton's method finds none that may be used.

    `scale` holds the largest value of each state, and `tolerance` is the largest change in a period in units of it.

    Raises SimulationError if the plant goes round the steady motion without coming nearer.
    """
    units = np.where(scale > 0.0, scale, 1.0)

    def change(x: FloatArray) -> FloatArray:
        return period(x * units) / units - x

    try:
        start = state / units
        before = change(start)
        solution = _newton(change, start, before, tolerance)
    except (SimulationError, np.linalg.LinAlgError):
        return None
    if solution is None:
        return None
    x, slopes, multipliers = solution
    is_near = np.linalg.norm(before - slopes @ (start - x)) <= _PREDICTED * np.linalg.norm(before)
    sizes = np.abs(multipliers[_moves(multipliers)])
    if is_near and np.all(sizes < 1.0 - MARGIN):
        return x * units
    if is_near and np.all(sizes < 1.0 + MARGIN):
        raise SimulationError(
            f"the motion has not settled and does not come nearer to a steady one: a deviation keeps "
            f"{100.0 * sizes.max():.4f} % of its size in a period; the plant needs damping"
        )
    return None


def _newton(
    change: Period, x: FloatArray, mismatch: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Fixed point, J - I and the multipliers there."""
    for _ in range(_MOST_STEPS):
        slopes = np.column_stack([(change(x + _DIFFERENCE * axis) - mismatch) / _DIFFERENCE for axis in np.eye(3)])
        multipliers, modes = np.linalg.eig(slopes + np.eye(3))
        moves = _moves(multipliers)
        step = (modes[:, moves] @ (np.linalg.solve(modes, mismatch)[moves] / (1.0 - multipliers[moves]))).real
        if np.all(np.abs(mismatch) <= tolerance):
            return x + step, slopes, multipliers
        for share in _SHARES:
            trial = change(x + share * step)
            if np.linalg.norm(trial) < np.linalg.norm(mismatch):
                break
        else:
            return None
        x, mismatch = x + share * step, trial
    return None


def _moves(multipliers: FloatArray) -> np.ndarray:
    """Which multipliers do not belong to a conserved quantity."""
    return np.abs(multipliers - 1.0) > MARGIN
