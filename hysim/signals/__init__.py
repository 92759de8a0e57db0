"""Inputs for loop studies, exact to the bit at their extremes.

Each returns the samples of a signal in the unit of the values that it is given, without time: a cycle starts at its
lowest value (a sine at its mean), and every cycle of one amplitude has the same bits. A rate-independent law needs no
time. Where one is needed, `sample_times` has it.
"""

from hysim.signals._cycles import sawtooth, sine, square, staircase, triangle
from hysim.signals._nested import decaying_sine, extremes, growing_sine, reversal_curves
from hysim.signals._spectra import multisine, sample_times, sweep

__all__ = [
    "decaying_sine",
    "extremes",
    "growing_sine",
    "multisine",
    "reversal_curves",
    "sample_times",
    "sawtooth",
    "sine",
    "square",
    "staircase",
    "sweep",
    "triangle",
]
