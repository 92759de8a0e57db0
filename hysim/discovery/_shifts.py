"""Where the memory of an output begins: z = y - feedthrough u - offset, both unknown.

The slope of z is linear in the coefficients of its law, not in the two shifts. So these are scanned, and the
coefficients solved for at each (variable projection):

    misfit(feedthrough, offset) = min over c of || dz/dL - sum c_k phi_k(u, z, s) ||

The left side loses what the term u' gains by a feedthrough, so that misfits are comparable. The best few places are
where the free runs begin.
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._library import Slopes
from hysim.discovery._selection import Start
from hysim.models.terms import Term, symmetric

_FEEDTHROUGHS = np.linspace(-1.0, 2.0, 46)  # of the slope of the chord from end to end
_OFFSETS = np.linspace(0.05, 0.95, 10)  # of the range of z
_KEPT = 3


def shifted(slopes: Slopes, terms: tuple[Term, ...], *, feedthrough: bool, offset: bool) -> tuple[Start, ...]:
    """The regressions to begin at: that of the output itself, and those at the best places of the scan."""
    trial = symmetric(terms, "odd") or terms  # about the origin of z a law is odd, or nearly
    places = sorted(
        (slopes.misfit(trial, slope, level), slope, level)
        for slope in (_slopes_tried(slopes) if feedthrough else (0.0,))
        for level in (_levels(slopes, slope) if offset else (0.0,))
    )
    chosen = [(0.0, 0.0)] if feedthrough or offset else []
    chosen += [(slope, level) for _, slope, level in places[:_KEPT]]
    return tuple(Start(slopes.regression(terms, *place), *place) for place in dict.fromkeys(chosen))


def _slopes_tried(slopes: Slopes) -> list[float]:
    """The chord of y over u, on the whole, sets the scale, and the sign."""
    chord = max((_chord(rows.u, rows.y) for rows in slopes.rows), key=abs)
    return [0.0, *(chord * _FEEDTHROUGHS).tolist()]


def _chord(u: FloatArray, y: FloatArray) -> float:
    return float(np.copysign(np.ptp(y) / np.ptp(u), np.cov(u, y)[0, 1]))


def _levels(slopes: Slopes, feedthrough: float) -> list[float]:
    memory = np.concatenate([rows.y - feedthrough * rows.u for rows in slopes.rows])
    low, high = float(memory.min()), float(memory.max())
    return [0.0, *(low + (high - low) * _OFFSETS).tolist()]
