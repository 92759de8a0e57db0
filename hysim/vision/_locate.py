"""The shift of one frame.

scikit-image's upsampled cross-correlation finds the shift in thumbnails to a fraction of a pixel. The windows follow
it, and Gauss-Newton steps on the scores of the template, each with the windows where the last one ended, go on from
there until they are too small to matter.
"""

import math
from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray
from hysim.vision._template import Picture, Reference, Spectrum, Template, weighted
from hysim.vision._windows import cut

_ROUNDS = 8
_SETTLED = 0.02  # a step that is smaller leaves less than a thousandth [pixel]
_FAR = 0.5  # what the thumbnails say beyond it moves the windows before any step [pixel]
_UPSAMPLED = 16.0  # parts of a pixel in which the thumbnails look
_OVERLAP = 0.25  # of the region's length, the least


@dataclass(frozen=True)
class Location:
    """Where the region's content is in a frame, in rows and columns; nan where it is not found."""

    shift: FloatArray
    covariance: FloatArray
    quality: float
    sharpness: float
    overlap: float

    @property
    def is_found(self) -> bool:
        return bool(np.isfinite(self.shift[0]))


LOST = Location(np.full(2, np.nan), np.full((2, 2), np.nan), 0.0, np.nan, 0.0)


@dataclass(frozen=True)
class _View:
    """A frame's patch under the windows moved to a guess."""

    template: Template
    spectrum: Spectrum
    energy: float
    rest: FloatArray


def locate(reference: Reference, frame: Picture, guess: FloatArray) -> Location:
    """The shift of the reference's region in the frame, looked for within half the region of the guess."""
    shift, is_near = reference.seen @ guess, False
    for _ in range(_ROUNDS):
        view = _view(reference, frame, shift)
        if view is None or view.energy <= 0.0:
            return LOST
        if not is_near:
            jump = reference.seen @ _jump(reference, view)
            is_near = bool(np.abs(jump).max() < _FAR)
            if not is_near:
                shift = shift + jump
                continue
        step, found = _step(reference, view, shift)
        if not np.abs(step).max() < 1.0:
            return LOST
        shift = shift + step
        if np.abs(step).max() < _SETTLED:
            return found
    return LOST


def _view(reference: Reference, frame: Picture, shift: FloatArray) -> _View | None:
    region, (height, width) = reference.region, frame.shape
    down = int(np.clip(round(shift[0]), -region.top, height - region.height - region.top))
    right = int(np.clip(round(shift[1]), -region.left, width - region.width - region.left))
    rest = shift - (down, right)
    cuts = cut(rest[0], region.height), cut(rest[1], region.width)
    if abs(cuts[0]) > (1 - _OVERLAP) * region.height or abs(cuts[1]) > (1 - _OVERLAP) * region.width:
        return None
    patch = weighted(region.of(frame, (down, right)), *reference.weights(cuts, rest))
    return _View(reference.template(cuts), reference.grid.spectrum(patch), float(np.vdot(patch, patch)), rest)


def _jump(reference: Reference, view: _View) -> FloatArray:
    try:
        from skimage.registration import phase_cross_correlation
    except ImportError:
        raise ImportError("measuring displacements needs scikit-image: pip install 'hysim[vision]'") from None
    grid = reference.grid
    scale = np.divide(grid.shape, grid.small)
    moved, _, _ = phase_cross_correlation(
        view.template.thumbnail,
        grid.thumbnail(view.spectrum),
        upsample_factor=math.ceil(4 * scale.max()),
        space="fourier",
        normalization=None,
    )
    return -np.asarray(moved, dtype=np.float64) * scale - view.rest


def _step(reference: Reference, view: _View, shift: FloatArray) -> tuple[FloatArray, Location]:
    grid, template = reference.grid, view.template
    down, right = grid.phases(view.rest)
    bent = np.stack([right, 1j * grid.right * right], axis=1).astype(np.complex64)
    correlation = float((down @ ((template.patch * view.spectrum) @ right)).real)
    products = [(slope * view.spectrum) @ bent for slope in template.slopes]
    scores = np.array([float((down @ product[:, 0]).real) for product in products])
    gain = correlation / template.energy
    if not gain > 0.0:
        return np.full(2, np.nan), LOST
    inverse = reference.seen @ np.linalg.pinv(reference.seen @ template.jacobian @ reference.seen)
    step = -inverse @ scores / gain
    curvature = float(((1j * grid.down * down) @ products[0][:, 0]).real + (down @ products[1][:, 1]).real)
    quality = correlation / math.sqrt(template.energy * view.energy)
    variance = max(view.energy - correlation**2 / template.energy, 0.0) / template.weight / gain**2
    covariance = variance * inverse @ template.noise @ inverse.T
    found = Location(shift + step, covariance, quality, curvature / correlation, 1.0)
    return step, found
