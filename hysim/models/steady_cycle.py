"""The memory of a law in a steady cycle.

One pass through the cycle contracts the memory, componentwise by the secant method to a fixed point. Most passes go
through the turning points alone, which cost next to nothing and for a law that is exact on monotone stretches leave the
memory of a full pass. The last ones go through all samples, so that any other law is steady too: for an exact law it
is one pass, which changes nothing.

The secant method alone would also find cycles that lead away from themselves, in which no repetition of the input ends.
It is used where a memory that is off is less so after a pass, and elsewhere the pass itself.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray

Pass = Callable[[FloatArray], FloatArray]
"""Memory (n_sets, n_memory) after a pass, from that before it; nan where it diverges."""

PassOf = Callable[[npt.NDArray[np.intp]], Pass]
"""The pass of some of the sets, by their numbers."""

_COARSE, _FULL = 20, 8  # passes at most
_OVERSHOOTING = -2.0  # slope of the drift from which on a pass leads farther away, to the other side
_STILL = 1e-13  # of the largest memory met: a change by a pass that is rounding


def fixed_point(passes: PassOf, before: FloatArray, coarse: PassOf | None = None) -> FloatArray:
    """Memory that a pass does not change, from `before` on, nan if it diverges; `coarse` passes take turning points."""
    z = before
    if coarse is not None:
        z = _secant(coarse, before, _COARSE)
        z = np.where(np.isfinite(z), z, before)
    z = _secant(passes, z, _FULL)
    return np.where(np.isfinite(z), z, np.nan)


def _secant(passes: PassOf, before: FloatArray, most: int) -> FloatArray:
    """The secant method on each component where passes contract; a set takes part until a pass changes nothing."""
    moving = np.arange(len(before))
    result = passes(moving)(before)
    z, drift_before = result, result - before
    size = np.fmax(np.abs(z), np.abs(before))
    for _ in range(most - 1):
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            still_moves = (np.abs(drift_before) > _STILL * size).any(axis=1)
            if not still_moves.any():
                break
            before, z, drift_before, size = (each[still_moves] for each in (before, z, drift_before, size))
            moving = moving[still_moves]
            after = passes(moving)(z)
            drift = after - z
            slope = (drift - drift_before) / (z - before)
            secant = np.where((slope < 0.0) & (slope > _OVERSHOOTING), z - drift / slope, after)
            size = np.fmax(size, np.abs(after))
        before, drift_before, z = z, drift, np.where(np.isfinite(secant), secant, after)
        result[moving] = z
    return result
