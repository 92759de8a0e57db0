"""The memory of a law in a steady cycle."""

from collections.abc import Callable

import numpy as np

from hysim._frozen import FloatArray

_PASSES = 40  # secant steps


def fixed_point(passed: Callable[[FloatArray], FloatArray], before: FloatArray, z: FloatArray) -> FloatArray:
    """Memory that one pass through a period does not change, nan where it diverges, from ``z = passed(before)``."""
    drift_before = z - before
    for _ in range(_PASSES):
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            drift = passed(z) - z
            if not (np.abs(drift) > 1e-15 * np.abs(z)).any():
                break
            secant = z - drift * (z - before) / (drift - drift_before)
        before, drift_before, z = z, drift, np.where(np.isfinite(secant), secant, z + drift)
    return np.where(np.isfinite(z), z, np.nan)
