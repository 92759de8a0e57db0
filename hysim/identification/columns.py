"""Whether the columns of a record show by themselves that the input and the output were swapped.

They do where the output is a waveform that a generator makes, a triangle of equal steps or one sine, and the input is
none. Measured outputs are not so regular.
"""

from collections.abc import Sequence

import numpy as np

from hysim._frozen import FloatArray
from hysim.identification.sentences import SWAPPED
from hysim.records import Record

_FEWEST = 20  # samples in which a waveform can be recognised
_SAME = 1e-6  # of a step: steps of a generator are equal but for rounding
_MOSTLY = 0.9  # of the steps are equal in a triangle; its turns may be samples of their own
_SMOOTH = 1e-3  # of the second differences: a sine's follow from its samples, noise adds to them


def swapped_columns(records: Sequence[Record]) -> str:
    """A sentence where the output of each record is a generator's waveform and the input none; else the empty text."""
    if not all(_is_generated(record.y) and _moves(record.u) and not _is_generated(record.u) for record in records):
        return ""
    return (
        f"{SWAPPED}: y is a regular waveform, as a generator makes it, and u is not; check the columns, unless u was "
        "computed so that y is regular"
    )


def _moves(signal: FloatArray) -> bool:
    """Whether a signal changes in most samples; a step or a square wave does not."""
    return bool(np.mean(np.diff(signal) != 0.0) >= _MOSTLY)


def _is_generated(signal: FloatArray) -> bool:
    """Whether a signal is a triangle or staircase of equal steps, or one sine, with hardly any noise."""
    steps = np.diff(signal)
    if signal.size < _FEWEST or not np.any(steps):
        return False
    length = float(np.median(np.abs(steps)))
    if np.mean(np.abs(np.abs(steps) - length) <= _SAME * length) >= _MOSTLY and length > 0.0:
        return True
    bends = np.diff(steps)  # of a sine: an affine function of the sample in the middle
    middle = np.stack([signal[1:-1], np.ones(bends.size)], axis=1)
    rest = bends - middle @ np.linalg.lstsq(middle, bends, rcond=None)[0]
    return bool(np.std(rest) <= _SMOOTH * np.std(bends) > 0.0)
