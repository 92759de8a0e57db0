"""Windows that move with the picture.

A patch of the reference r, weighted by a window, is W(x) r(x). In a frame whose content has moved by d it is
W(x - d) r(x - d): the same patch, moved by d, whatever enters or leaves at the borders. A window that stays where it
is would pull every shift towards zero.

Along each axis the window is flat with sine-squared flanks, and is known between the pixels. Where the content has
moved out of the picture, the reference is cut back by whole steps on the side that is missing.
"""

import math

import numpy as np

from hysim._frozen import FloatArray

_MARGIN = 1.0  # kept free at both ends, so that shifts up to a pixel need no cut [pixel]
_FLANK = 0.25  # of the window's length
_STEPS = 64  # cuts of one axis


def cut(shift: float, length: int) -> int:
    """By how much the reference is cut back for content that moves by `shift` inside `length` pixels [pixel].

    Positive cuts are at the end of the axis: content that moves towards the end leaves there.
    """
    step = math.ceil(length / _STEPS)
    return int(math.copysign(step * math.ceil(max(abs(shift) - _MARGIN, 0.0) / step), shift))


def window(length: int, cut: int, shift: float) -> FloatArray:
    """Weights of the pixels of one axis for content that has moved by `shift`, shape (length,)."""
    low = _MARGIN + max(-cut, 0) + shift
    high = length - 1 - _MARGIN - max(cut, 0) + shift
    x = np.arange(length)
    inside = np.minimum(x - low, high - x) / (_FLANK * (high - low))
    return np.asarray(np.sin(0.5 * np.pi * inside.clip(0.0, 1.0)) ** 2)
