"""Place of the region, frame after frame.

A running reference is taken renewed from the last good frame when the picture has changed or moved away. The error of
that frame's own place then adds to those of the frames after it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from hysim._frozen import FloatArray
from hysim.vision._locate import LOST, Location, locate
from hysim.vision._template import Picture, Reference, Region

_FOUND = 0.5  # correlation: below it, half of the content is another
_CHANGED = 0.9  # of the best correlation with a running reference
_LEFT_OVER = 0.75  # of the region's length that is still in the frame


def against(reference: Reference, pictures: Iterable[Picture]) -> Iterator[Location]:
    """The place of the reference's region in each picture."""
    guess = np.zeros(2)
    for picture in pictures:
        location = _find(reference, picture, guess)
        if location.is_located:
            guess = location.shift
        yield location


def running(reference: Reference, pictures: Iterable[Picture]) -> Iterator[Location]:
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
