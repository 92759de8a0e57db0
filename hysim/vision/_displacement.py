"""The verb `displacement`: frames in, displacements out."""

import itertools
import math
import operator
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hysim._progress import Reports, reports
from hysim.vision._direction import along, angle_of
from hysim.vision._frames import Picture, grey_pictures, read_frames
from hysim.vision._result import Displacement
from hysim.vision._template import Reference, Region
from hysim.vision._tracking import against, running

METHODS = ("subpixel", "whole-pixel")
REFERENCES = ("first", "running")
_SMALLEST = 16  # side of a region [pixel]


@reports
def displacement(
    frames: Any,
    scale: float,
    *,
    region: tuple[int, int, int, int] | None = None,
    direction: float | Literal["x", "y"] | None = None,
    reference: Any = "first",
    method: Literal["subpixel", "whole-pixel"] = "subpixel",
    unit: str = "um",
    progress: Reports = None,
) -> Displacement:
    """Measure the displacement of the picture in each frame.

    Parameters
    ----------
    frames : array, iterable, str or path
        An array of shape (n, height, width), or (n, height, width, 3 or 4) in colour; anything that gives one frame
        after the other; or what `read_frames` takes. One frame is kept at a time.
    scale : float
        Length of a pixel [unit].
    region : (top, bottom, left, right), optional
        Rows and columns of the reference that are looked for, the last ones not included [pixel]; by default all. What
        it holds has to move as one: leave a background that stands still outside.
    direction : float, "x" or "y", optional
        Direction in which the displacement is positive: 0 or ``"x"`` to the right, 90 or ``"y"`` down the picture
        [degree]. By default that of the motion, positive to the right; within 10 degrees of the vertical, down.
    reference : {"first", "running"}, int or array, shape (height, width)
        What displacements are measured from: the first frame; the frame with this number, from 0; a picture of your
        own. ``"running"`` begins with the first frame and goes on from the last good one whenever less than 3/4 of the
        region is left in the frame or the correlation falls below 0.9 of its best: for light that drifts and motion
        that is large. The errors of these frames then add up.
    method : {"subpixel", "whole-pixel"}
        Shifts as they are, or rounded to whole pixels along the rows or the columns.
    unit : str
        Label of the unit of length.
    progress : callable or False, optional
        Called as ``progress(done, total)`` after each frame; total is 0 where it is not known.
        By default calls beyond 2 s report on the standard error; False turns this off.

    Returns
    -------
    Displacement

    Raises
    ------
    ValueError
        If the scale is not positive, there are no frames, their sizes differ, the region is not inside them or has
        nothing to see, or an argument is another word than those above.
    TypeError
        If frames are not numbers.
    ImportError
        If scikit-image is not installed.

    Notes
    -----
    Upsampled cross-correlation (M. Guizar-Sicairos, S. T. Thurman, J. R. Fienup, Optics Letters 33, 2008, as
    `skimage.registration.phase_cross_correlation` has it) finds the shift to a fraction of a pixel. Least squares over
    the shift and over gain, offset and slope of the light go on from there, with windows that move with the picture,
    so that what enters and leaves at the borders does not count. The standard error is that of the least squares under
    white noise in both frames. A frame is lost where the correlation is below 0.5, and blurred where the peak of the
    correlation is less than 0.7 times as sharp as in the median frame.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> rows, columns = np.mgrid[0.0:64.0, 0.0:64.0]
    >>> frames = [np.exp(-((rows - 30.0) ** 2 + (columns - 30.0 - d) ** 2) / 50.0) for d in (0.0, 0.25, 1.5)]
    >>> hs.vision.displacement(frames, scale=0.0763, direction="x").y[1:].round(4).tolist()
    [0.0191, 0.1144]
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if isinstance(scale, (str, bool)) or not 0.0 < float(scale) < math.inf:
        raise ValueError(f"scale must be the length of a pixel, a positive number, got {scale}")
    angle = angle_of(direction, whole=method == "whole-pixel")
    source, total = _source(frames)
    first, pictures = _pictures(source, reference)
    start = Reference(first, _region(region, first.shape))
    follow = running if isinstance(reference, str) and reference == "running" else against
    places = []
    for place in follow(start, pictures):
        places.append(place)
        if progress:
            progress(len(places), total)
    return along(places, start.visible, angle, float(scale), unit, whole=method == "whole-pixel")


def _source(frames: Any) -> tuple[Iterable[Any], int]:
    """The frames and their number, which is 0 if it is unknown."""
    if isinstance(frames, (str, Path)):
        frames = read_frames(frames)
    if isinstance(frames, np.ndarray) and frames.ndim not in (3, 4):
        raise ValueError(
            f"frames must have the shape (n, height, width) or (n, height, width, 3 or 4), got {frames.shape}"
        )
    if not isinstance(frames, Iterable):
        raise TypeError(f"frames must be an array, a path or give one frame after the other, got {frames!r}")
    return frames, operator.length_hint(frames)


def _pictures(frames: Iterable[Any], reference: Any) -> tuple[Picture, Iterator[Picture]]:
    """The picture that is the reference, and all frames."""
    if isinstance(reference, str) and reference not in REFERENCES:
        raise ValueError(f'reference must be "first", "running", the number of a frame or a picture, got {reference!r}')
    if not isinstance(reference, str) and np.ndim(reference) > 0:
        pictures = grey_pictures(itertools.chain([reference], frames), lambda k: _name(k - 1) if k else "the reference")
        return next(pictures), pictures
    place = 0 if isinstance(reference, str) else operator.index(reference)
    if place and iter(frames) is frames:
        raise ValueError("frames that come only once cannot be searched for a reference: give its picture")
    pictures = grey_pictures(frames, _name)
    first = next(itertools.islice(pictures, place, None), None) if place >= 0 else None
    if first is None:
        raise ValueError(f"there is no frame {place} to be the reference" if place else "there are no frames")
    return first, grey_pictures(frames, _name) if place else itertools.chain([first], pictures)


def _region(sides: tuple[int, int, int, int] | None, shape: tuple[int, int]) -> Region:
    inside = (0, shape[0], 0, shape[1]) if sides is None else tuple(map(operator.index, sides))
    top, bottom, left, right = inside if len(inside) == 4 else (-1, 0, 0, 0)
    if not (0 <= top < bottom <= shape[0] and 0 <= left < right <= shape[1]):
        raise ValueError(
            f"region must be (top, bottom, left, right) inside {shape[0]} x {shape[1]} pixels, got {inside}"
        )
    if min(bottom - top, right - left) < _SMALLEST:
        raise ValueError(
            f"a region must have at least {_SMALLEST} x {_SMALLEST} pixels, got {bottom - top} x {right - left}"
        )
    return Region(top, left, bottom - top, right - left)


def _name(k: int) -> str:
    return f"frame {k}"
