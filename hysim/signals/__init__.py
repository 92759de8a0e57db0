"""Inputs for loop studies, exact to the bit at their extremes.

Each function returns a signal's samples without times (`sample_times`), in the unit of its arguments. A cycle starts at
its lowest value (a sine at its mean); all of one amplitude have the same bits. A rate-independent law needs no times.
"""

from hysim.signals._cycles import (
    decaying_sine,
    extremes,
    growing_sine,
    reversal_curves,
    sawtooth,
    sine,
    square,
    staircase,
    triangle,
)
from hysim.signals._spectra import ground_motion, multisine, sample_times, sweep

__all__ = ["decaying_sine", "extremes", "ground_motion", "growing_sine", "multisine", "reversal_curves"]
__all__ += ["sample_times", "sawtooth", "sine", "square", "staircase", "sweep", "triangle"]
