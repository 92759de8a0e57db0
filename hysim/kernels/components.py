"""Loading paths of structural components, in the direction in which they are loaded.

An excursion begins where the force changes its sign. Its loading path is fixed there: the force is a function of the
input v alone, until the excursion ends. A component that is unloaded and loaded again comes back to its path.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner


@inner
def oriented(v: float, begin: float, peak: float, top: float, inner_peak: float, inner_top: float) -> float:
    """Force on the way from (begin, 0) to the peak (peak, top), by way of an inner peak if that is steeper."""
    low = 0.0
    if begin < inner_peak and 0.0 < inner_top < top and inner_top * (peak - begin) > top * (inner_peak - begin):
        if v < inner_peak:
            peak, top = inner_peak, inner_top
        else:
            begin, low = inner_peak, inner_top
    return low + (top - low) * (v - begin) / (peak - begin)


@inner
def lengthened(state: FloatArray, k: int, v: float, end: float, force: float) -> None:
    """Lengthen a path of straight lines to the point (end, force) if that lies ahead, but not beyond v.

    ``state[k : k + 3]`` is where the path has come to, the force there, and its integral.
    """
    a, low = state[k], state[k + 1]
    if a < end and a < v:
        if v < end:
            force, end = low + (force - low) * (v - a) / (end - a), v
        state[k], state[k + 1] = end, force
        state[k + 2] += 0.5 * (low + force) * (end - a)


@inner
def dissipated(area: float, force: float, stiffness: float) -> float:
    """Energy of an excursion whose force falls to zero; below 1e-12 of its work it is rounding, and counts as zero.

    Below c = 1 the shares of elastic excursions would grow out of rounding.
    """
    energy = area - 0.5 * force * force / stiffness if stiffness > 0.0 else 0.0
    return energy if energy > 1e-12 * area else 0.0


@inner
def lost_share(energy: float, spent: float, capacity: float, exponent: float) -> float:
    """Share of a strength that an excursion takes; `spent` is the energy of all; a capacity of 0 means no loss."""
    if capacity <= 0.0 or energy <= 0.0:
        return 0.0
    return float((energy / (capacity - spent)) ** exponent) if energy < capacity - spent else 1.0


@inner
def envelope(p: FloatArray, v: float) -> float:
    """Envelope of Foschi, an exponential knee on a line, and a line that falls to zero, over the stiffness."""
    t = min(v, p[3])
    force = (p[1] + p[4] * t) * -math.expm1(-t / p[1]) + p[5] * (v - t)
    return float(max(force, 0.0))


@inner
def on_envelope(p: FloatArray, v: float, largest: float) -> float:
    """Force at v over the stiffness: on the pinched line, then on the way to the envelope, then on the envelope."""
    line = p[2] + p[7] * v
    if largest == 0.0:
        return float(min(line, envelope(p, p[10]))) if v < p[10] else envelope(p, v)
    target = p[9] * largest
    if v >= target:
        return envelope(p, v)
    top = envelope(p, target)
    slope = min(1.0, (p[1] / target) ** p[8])
    return float(min(top, max(line, top - slope * (target - v))))
