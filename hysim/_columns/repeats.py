"""The cycle with which a record begins and which its input repeats, whole or cut short.

The path of the input is its turning points. It repeats itself after q of them, an even number, if

1. the turning points behind are those q before, to 5 % of the branch that leads there, as far as the record goes, and
2. the branch after q turning points comes back to the first input.

The least such q is the cycle. A record of 2.5 cycles repeats itself after 1, and one of 1.2 cycles too; where the
record ends one step before its first input, all of it is one cycle. Turning points are those beyond the noise of the
input, so that a measured input has a cycle as well.
"""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.input_noise import MOST_IGNORED, input_noise, reach
from hysim._columns.turning import NEAR, ROUNDING, TOLERANCE, turns

_CLOSING = 2.0  # largest steps of the input, by which a record may end before its first input


def repeated_cycle(u: FloatArray) -> int | None:
    """Number of samples of the cycle with which `u` (n,) begins, or None."""
    span = float(np.ptp(u))
    if span == 0.0:
        return None
    tolerance = max(TOLERANCE, min(reach(input_noise(u)) / span, MOST_IGNORED))
    plateaus = turns(u, tolerance).plateaus
    levels = u[[first for first, _ in plateaus]]
    inner = levels[1:-1]
    branches = np.abs(np.diff(levels[:-1]))
    near, rising = NEAR * span, bool(levels[1] > levels[0])
    for q in range(2, len(plateaus), 2):
        if (np.abs(inner[q:] - inner[:-q]) > np.maximum(NEAR * branches[q:], tolerance * span)).any():
            continue
        if (sample := _return(u, plateaus[q][0], _end(plateaus, q), near=near, rising=rising)) is not None:
            return sample
    return None


def _end(plateaus: list[tuple[int, int]], q: int) -> int:
    return plateaus[min(q + 1, len(plateaus) - 1)][1]


def _return(u: FloatArray, begin: int, end: int, *, near: float, rising: bool) -> int | None:
    """Sample from `begin` to `end`, on one branch, at which the input is back at its first value, or would be next."""
    ahead = (u[begin : end + 1] - u[0]) * (1.0 if rising else -1.0)
    rounding = ROUNDING * float(np.ptp(u))
    back = np.flatnonzero(ahead >= -rounding)
    if back.size and (back[0] > 0 or ahead[0] <= rounding):
        return begin + int(back[0])
    closing = _CLOSING * float(np.abs(np.diff(u)).max())
    if end == u.size - 1 and np.abs(ahead).min() <= min(closing, near) and (begin == end or not back.size):
        return u.size
    return begin if ahead[0] > 0.0 and ahead[0] <= near else None  # it turns a little beyond its first value
