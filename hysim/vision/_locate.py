"""The shift of one frame.

scikit-image's upsampled cross-correlation finds the shift in thumbnails, to a fraction of a pixel. The windows follow
it there, and Gauss-Newton steps on the scores of the template (see `hysim.vision._template`) go on until they are too
small to matter.
"""

import math
from dataclasses import dataclass

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.vision._template import Picture, Reference, Spectrum, Template, cut, without_plane

_ROUNDS = 8
_STEPS = 3  # in one position of the windows
_SETTLED = 0.02  # a step that is smaller leaves less than a thousandth [pixel]
_NEAR = 0.25  # as far as steps go before the windows follow [pixel]
_ASTRAY = 1.0  # steps that lead further go elsewhere [pixel]
_KNOWN = 2.0  # after a jump that is shorter the thumbnails have said what they can [pixel]
_PARTS = 4  # of a pixel in which the thumbnails look
_OVERLAP = 0.5  # of the region's length, the least


@dataclass(frozen=True)
class Location:
    """Place of the region's content in a frame, in rows and columns [pixel]; nan where it was not found.

    `quality` is the correlation, `sharpness` the curvature of its peak over that of the reference with itself, and
    `overlap` the part of the region's length that both have.
    """

    shift: FloatArray
    covariance: FloatArray
    quality: float
    sharpness: FloatArray
    overlap: float

    @property
    def is_located(self) -> bool:
        return bool(np.isfinite(self.shift[0]))


LOST = Location(np.full(2, np.nan), np.full((2, 2), np.nan), 0.0, np.full((2, 2), np.nan), 0.0)


@dataclass(frozen=True)
class _View:
    """A frame's patch under windows that are moved to where the content should be."""

    template: Template
    spectrum: Spectrum
    energy: float
    origin: FloatArray
    shift: FloatArray
    overlap: float

    def distance(self, shift: FloatArray) -> float:
        """From the place of the windows, along the axis on which it is larger [pixel]."""
        return float(np.abs(shift - self.origin - self.shift).max())


def locate(reference: Reference, frame: Picture, guess: FloatArray) -> Location:
    """The shift of the reference's region in the frame, looked for within half the region of the guess."""
    shift, is_near = reference.visible @ guess, False
    for _ in range(_ROUNDS):
        view = _view(reference, frame, shift)
        if view is None:
            return LOST
        if not is_near:
            jump = reference.visible @ _jump(reference, view)
            is_near = float(np.abs(jump).max()) < _KNOWN
            if np.abs(jump).max() > _NEAR:
                shift = shift + jump
                continue
        location, is_settled = _settle(reference, view, shift)
        if is_settled:
            return location
        shift = location.shift
        if not view.distance(shift) < _ASTRAY:
            return LOST
    return LOST


def _settle(reference: Reference, view: _View, shift: FloatArray) -> tuple[Location, bool]:
    """Steps until one is small enough, which is True, or the windows should follow."""
    for _ in range(_STEPS):
        location = _step(reference, view, shift)
        if np.abs(location.shift - shift).max() < _SETTLED:
            return location, True
        shift = location.shift
        if not view.distance(shift) < _NEAR:
            break
    return location, False


def _view(reference: Reference, frame: Picture, shift: FloatArray) -> _View | None:
    """None where too little of the region is in the frame, or the frame is blank."""
    region = reference.region
    lengths, edges = (region.height, region.width), (region.top, region.left)
    offset = [
        int(np.clip(round(s), -edge, size - length - edge))
        for s, edge, size, length in zip(shift, edges, frame.shape, lengths, strict=True)
    ]
    rest = shift - offset
    cuts = cut(rest[0], region.height), cut(rest[1], region.width)
    overlap = min(1.0 - abs(c) / length for c, length in zip(cuts, lengths, strict=True))
    if overlap < _OVERLAP:
        return None
    down, right = reference.windows(cuts, rest)
    patch = without_plane(region.of(frame, (offset[0], offset[1])), down, right) * down * right
    energy = float(np.vdot(patch, patch))
    if energy <= 0.0:
        return None
    spectrum = reference.grid.spectrum(patch)
    return _View(reference.template(cuts), spectrum, energy, np.array(offset, dtype=np.float64), rest, overlap)


def _jump(reference: Reference, view: _View) -> FloatArray:
    """By how much the thumbnails are further apart than the windows."""
    try:
        from skimage.registration import phase_cross_correlation
    except ImportError:
        raise ImportError("measuring displacements needs scikit-image: pip install 'hysim[vision]'") from None
    grid = reference.grid
    scale = np.divide(grid.shape, grid.small)
    thumbnails = [view.template.thumbnail.copy(), grid.thumbnail(view.spectrum)]
    for one in thumbnails:  # scikit-image takes the largest size: this constant leaves no correlation negative
        one[0, 0] = np.linalg.norm(one)
        one /= one[0, 0] or 1.0
    back, _, _ = phase_cross_correlation(
        *thumbnails,
        upsample_factor=math.ceil(_PARTS * scale.max()),
        space="fourier",
        normalization=None,
    )
    return np.asarray(-scale * back - view.shift)


def _step(reference: Reference, view: _View, shift: FloatArray) -> Location:
    """The shift after one step."""
    grid, template = reference.grid, view.template
    down, right = grid.phases(shift - view.origin)
    steep = np.stack([right, 1j * grid.right * right], axis=1).astype(np.complex64)
    correlation = float((down @ ((template.patch * view.spectrum) @ right)).real)
    rows = [(slope * view.spectrum) @ steep for slope in template.slopes]
    scores = np.array([float((down @ row[:, 0]).real) for row in rows])
    curvature = np.array([[((1j * grid.down * down) @ row[:, 0]).real, (down @ row[:, 1]).real] for row in rows])
    gain = correlation / template.energy
    if not gain > 0.0:
        return LOST
    behind = shift - view.origin - view.shift
    step = -template.inverse @ (scores / gain - template.flanks @ behind)
    variance = max(view.energy - correlation**2 / template.energy, 0.0) / template.weight / gain**2
    return Location(
        shift=shift + step,
        covariance=variance * template.spread,
        quality=min(correlation / math.sqrt(template.energy * view.energy), 1.0),
        sharpness=template.inverse @ curvature / gain,
        overlap=view.overlap,
    )
