"""The verb `displacement`: frames in, displacements out.

The region is found frame after frame. A running reference is renewed from the last good frame when the picture has
changed or moved away; the error of that frame's own place then adds to those of the frames after it.

The shifts in pixels become a displacement along one direction. Directions are angles in the picture: 0 to the right, 90
down it. A straight edge shows its motion in one direction only, across itself; what moves along another one, d, is seen
there through the cosine between the two.
"""

import itertools
import math
import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.progress import Reports, reports
from hysim.vision._frames import Picture, grey_pictures, read_frames
from hysim.vision._locate import LOST, Location, locate
from hysim.vision._result import Displacement
from hysim.vision._template import Reference, Region

METHODS = ("subpixel", "whole-pixel")
REFERENCES = ("first", "running")
_SMALLEST = 16  # side of a region [pixel]
_FOUND = 0.5  # correlation: below it, half of the content is another
_CHANGED = 0.9  # of the best correlation with a running reference
_LEFT_OVER = 0.75  # of the region's length that is still in the frame
_AXES = {"x": 0.0, "y": 90.0}
_BESIDE_VERTICAL = 10.0  # within it, a direction that is found is positive down the picture [degree]
_LEAST_COSINE = 0.1
_SHARP = 0.8  # curvature of the correlation's peak, of the median one


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
    correlation is less than 0.8 times as sharp as in the median frame.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> rows, columns = np.mgrid[0.0:64.0, 0.0:64.0]
    >>> frames = [np.exp(-((rows - 30.0) ** 2 + (columns - 30.0 - d) ** 2) / 50.0) for d in (0.0, 0.25, 1.5)]
    >>> hs.vision.displacement(frames, scale=0.0763, direction="x").y[1:].round(4).tolist()
    [0.0191, 0.1144]
    """
    check_choice("method", method, METHODS)
    if isinstance(scale, (str, bool)) or not 0.0 < float(scale) < math.inf:
        raise ValueError(f"scale must be the length of a pixel, a positive number, got {scale}")
    angle = _angle_of(direction, whole_pixels=method == "whole-pixel")
    source, total = _source(frames)
    first, pictures = _pictures(source, reference)
    start = Reference(first, _region(region, first.shape))
    follow = _running if isinstance(reference, str) and reference == "running" else _against
    places = []
    for place in follow(start, pictures):
        places.append(place)
        if progress:
            progress(len(places), total)
    return _along(places, start.visible, angle, float(scale), unit, whole_pixels=method == "whole-pixel")


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


def _against(reference: Reference, pictures: Iterable[Picture]) -> Iterator[Location]:
    """The place of the reference's region in each picture."""
    guess = np.zeros(2)
    for picture in pictures:
        location = _find(reference, picture, guess)
        if location.is_located:
            guess = location.shift
        yield location


def _running(reference: Reference, pictures: Iterable[Picture]) -> Iterator[Location]:
    """The same, with references that are renewed; the first picture is the first reference."""
    region, guess, best = reference.region, np.zeros(2), 0.0
    start = replace(LOST, shift=np.zeros(2), covariance=np.zeros((2, 2)))
    last: tuple[Picture, Location] | None = None
    for k, picture in enumerate(pictures):
        location = _find(reference, picture, guess)
        if last is not None and (location.quality < _CHANGED * best or location.overlap < _LEFT_OVER):
            renewed = Reference(last[0], _shifted(region, last[1], last[0]))
            again = _find(renewed, picture, np.zeros(2))
            if again.is_located:
                reference, start, location, best, last = renewed, last[1], again, 0.0, None
        if location.is_located:
            guess = location.shift
            location = replace(
                location, shift=start.shift + location.shift, covariance=start.covariance + location.covariance
            )
            if k > 0:  # the first picture is like itself, noise and all
                best, last = max(best, location.quality), (picture, location)
        yield location


def _find(reference: Reference, picture: Picture, guess: FloatArray) -> Location:
    for start in (guess, np.zeros(2)):
        location = locate(reference, picture, start)
        if location.quality >= _FOUND:
            return location
    return replace(LOST, quality=location.quality)


def _shifted(region: Region, place: Location, picture: Picture) -> Region:
    """The region where its content now is, as far as the picture goes."""
    top, left = np.rint(np.add((region.top, region.left), place.shift)).astype(int)
    return replace(
        region,
        top=int(np.clip(top, 0, picture.shape[0] - region.height)),
        left=int(np.clip(left, 0, picture.shape[1] - region.width)),
    )


def _along(
    located: Sequence[Location],
    visible: FloatArray,
    angle: float | None,
    scale: float,
    unit: str,
    *,
    whole_pixels: bool,
) -> Displacement:
    """The displacements of located frames; `visible` projects on the directions in which there is structure."""
    shift = np.array([place.shift[::-1] for place in located])
    covariance = np.array([place.covariance[::-1, ::-1] for place in located])
    visible = visible[::-1, ::-1]
    if angle is None:
        angle = _best_direction(shift, covariance, visible)
        angle = 90.0 * round(angle / 90.0) if whole_pixels else angle
    unit_vector = _unit(angle)
    across = _unit(angle + 90.0)
    towards = _towards(unit_vector, visible)
    displacement, variance = shift @ towards, np.einsum("i,nij,j->n", towards, covariance, towards)
    beside = shift @ across if np.trace(visible) > 1.5 else np.full(len(shift), np.nan)
    if whole_pixels:
        shift, displacement, beside = np.rint(shift) + 0.0, np.rint(displacement) + 0.0, np.rint(beside) + 0.0
        variance = variance + 1.0 / 12.0
    return Displacement(
        y=scale * displacement,
        uncertainty=scale * np.sqrt(variance),
        shift=shift,
        across=scale * beside,
        quality=np.array([place.quality for place in located]),
        status=_statuses(located, towards / np.linalg.norm(towards)),
        scale=scale,
        direction=angle,
        resolution=scale if whole_pixels else None,
        units={"y": unit},
    )


def _angle_of(direction: float | str | None, *, whole_pixels: bool) -> float | None:
    """The angle of a direction; None if it must be estimated."""
    if direction is None:
        return None
    if isinstance(direction, str) and direction in _AXES:
        return _AXES[direction]
    if isinstance(direction, (str, bool)) or not math.isfinite(direction):
        raise ValueError(f'direction must be "x", "y", an angle in degrees or None, got {direction!r}')
    if whole_pixels and direction % 90.0:
        raise ValueError(f"whole pixels are counted along rows or columns: direction must be x or y, got {direction}")
    return float(direction)


def _best_direction(shift: FloatArray, covariance: FloatArray, visible: FloatArray) -> float:
    """Direction in which the shifts spread more than their noise does; by default to the right."""
    if np.trace(visible) < 1.5:
        vector = np.linalg.eigh(visible)[1][:, 1]
    else:
        is_located = np.isfinite(shift[:, 0])
        if not is_located.any():
            return 0.0
        off, noise = shift[is_located] - shift[is_located].mean(axis=0), covariance[is_located].mean(axis=0)
        values, vectors = np.linalg.eigh(off.T @ off / is_located.sum() - noise)
        if values[1] <= np.trace(noise):
            return 0.0
        vector = vectors[:, 1]
    angle = math.degrees(math.atan2(vector[1], vector[0]))
    return (angle + 90.0 - _BESIDE_VERTICAL) % 180.0 - 90.0 + _BESIDE_VERTICAL


def _unit(angle: float) -> npt.NDArray[np.float64]:
    """Unit vector of an angle, without rounding where it is along an axis."""
    turned = angle % 360.0
    axes = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    return np.array(axes.get(turned, (math.cos(math.radians(angle)), math.sin(math.radians(angle)))))


def _towards(direction: FloatArray, visible: FloatArray) -> FloatArray:
    """The vector whose product with a shift is the displacement along the direction."""
    if np.trace(visible) > 1.5:
        return direction
    shown = visible @ direction
    cosine = float(np.linalg.norm(shown))
    if cosine < _LEAST_COSINE:
        normal = np.linalg.eigh(visible)[1][:, 1]
        raise ValueError(
            f"the picture is a straight edge, which shows no motion along {direction[0]:.2g}, {direction[1]:.2g} "
            f"(right, down), only along {normal[0]:.2g}, {normal[1]:.2g}"
        )
    return shown / cosine**2


def _statuses(located: Sequence[Location], direction: FloatArray) -> tuple[str, ...]:
    """Blurred is a frame whose correlation has a flatter peak along the motion than the median one's."""
    sharpness = np.array([direction @ place.sharpness[::-1, ::-1] @ direction for place in located])
    is_located = np.isfinite(sharpness)
    least = _SHARP * np.median(sharpness[is_located]) if is_located.any() else 0.0
    return tuple("ok" if value >= least else "blurred" if value < least else "lost" for value in sharpness)
