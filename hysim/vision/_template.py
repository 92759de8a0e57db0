"""What is known of the reference: a patch under a window, and how a shift shows in it.

A patch whose content has moved by a little e more than expected, under a gain a and with an offset and a slope of the
light, is

    p(x) = a W (r - e . grad r) + W (b0 + b1 x + b2 y) + W noise .

Each template h_i is W dr/dx_i of a slightly smoothed r, made orthogonal to W r, W, W x and W y: gain, offset and slope
drop out of the scores phi_i = <h_i, p>, and e follows from phi_i = -a sum_j J_ij e_j with J_ij = <h_i, W dr/dx_j>.
White noise of variance s^2 gives e the covariance (s / a)^2 J^-1 M J^-T with M_ij = <W h_i, W h_j>.

The products are sums over the spectra, where a shift by any fraction of a pixel is a phase.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from hysim._frozen import FloatArray
from hysim.vision._windows import window

Picture = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]

_THUMBNAIL = 128  # pixels of an axis in which a shift is looked for at first
_SMOOTHING = 1.0  # of the templates [pixel]
_SLOPE = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0  # derivative over unit steps, of the sixth order
_NOISE_SLOPE = 1.0 / (8.0 * np.pi)  # energy of the smoothed derivative of white noise of unit variance
_UNSEEN = 0.1  # a structure so much weaker than that across it may be noise
_TEMPLATES = 16  # kept at a time


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels."""

    top: int
    left: int
    height: int
    width: int

    def of(self, picture: Picture, offset: tuple[int, int] = (0, 0)) -> Picture:
        """The pixels of the rectangle, moved by an offset."""
        top, left = self.top + offset[0], self.left + offset[1]
        return picture[top : top + self.height, left : left + self.width]


@dataclass(frozen=True)
class Template:
    """The reference under one window; its spectra are conjugated and weighted for sums over the half plane."""

    cut: tuple[int, int]
    patch: Spectrum
    slopes: tuple[Spectrum, Spectrum]
    energy: float
    jacobian: FloatArray
    noise: FloatArray
    weight: float
    thumbnail: Spectrum


class Grid:
    """Frequencies of patches of one shape, padded to lengths that transform fast."""

    def __init__(self, height: int, width: int) -> None:
        self.shape = fft.next_fast_len(height, True), fft.next_fast_len(width, True)
        self.down = 2.0 * np.pi * np.fft.fftfreq(self.shape[0])
        self.right = 2.0 * np.pi * np.fft.rfftfreq(self.shape[1])
        twice = np.where(self.right > 0.0, 2.0, 1.0) * (self.right < np.pi)
        self.weights = np.outer(np.abs(self.down) < np.pi, twice / np.prod(self.shape)).astype(np.float32)
        self.small = min(self.shape[0], _THUMBNAIL), min(self.shape[1], _THUMBNAIL)

    def spectrum(self, patch: Picture) -> Spectrum:
        """Half plane of a real patch."""
        return np.asarray(fft.rfft2(patch, self.shape), dtype=np.complex64)

    def thumbnail(self, spectrum: Spectrum) -> Spectrum:
        """Whole plane of the low frequencies."""
        height, width = self.small
        rows = np.r_[0 : (height + 1) // 2, -(height // 2) : 0]
        return np.asarray(fft.fft2(fft.irfft2(spectrum[rows, : width // 2 + 1], self.small)), dtype=np.complex64)

    def phases(self, shift: FloatArray) -> tuple[Spectrum, Spectrum]:
        """Factors by which a spectrum is moved back by a shift."""
        return np.exp(1j * shift[0] * self.down).astype(np.complex64), np.exp(1j * shift[1] * self.right).astype(
            np.complex64
        )


class Reference:
    """A picture, the region of it that is looked for, and its templates."""

    def __init__(self, picture: Picture, region: Region) -> None:
        self.picture, self.region = picture, region
        self.grid = Grid(region.height, region.width)
        axes = (0, 1)
        smooth = ndimage.gaussian_filter1d(ndimage.gaussian_filter1d(picture, _SMOOTHING, axis=0), _SMOOTHING, axis=1)
        self._smooth = [region.of(ndimage.correlate1d(smooth, _SLOPE, axis=i)) for i in axes]
        self._slopes = [region.of(ndimage.correlate1d(picture, _SLOPE, axis=i)) for i in axes]
        self.template = lru_cache(maxsize=_TEMPLATES)(self._template)
        self.seen = self._seen()

    def weights(self, cut: tuple[int, int], shift: FloatArray) -> tuple[Picture, Picture]:
        """The window along both axes, moved by a shift."""
        down = window(self.region.height, cut[0], shift[0])
        right = window(self.region.width, cut[1], shift[1])
        return down.astype(np.float32)[:, None], right.astype(np.float32)

    def _template(self, cut: tuple[int, int]) -> Template:
        down, right = self.weights(cut, np.zeros(2))
        W = down * right
        patch = weighted(self.region.of(self.picture), down, right)
        nuisance = np.stack([patch, W, W * centred(self.region.width), W * centred(self.region.height)[:, None]])
        basis, _ = np.linalg.qr(nuisance.reshape(4, -1).T)
        slopes = np.stack([(W * slope).ravel() for slope in self._slopes])
        h = np.stack([(W * slope).ravel() for slope in self._smooth])
        h -= (h @ basis) @ basis.T
        weighted_h = h * W.ravel()
        shape = (self.region.height, self.region.width)
        spectrum = self.grid.spectrum(patch)
        return Template(
            cut=cut,
            patch=self.grid.weights * spectrum.conj(),
            slopes=tuple(self.grid.weights * self.grid.spectrum(one.reshape(shape)).conj() for one in h),
            energy=float(np.vdot(patch, patch)),
            jacobian=(h @ slopes.T).astype(np.float64),
            noise=(weighted_h @ weighted_h.T).astype(np.float64),
            weight=float(np.vdot(W, W)),
            thumbnail=self.grid.thumbnail(spectrum),
        )

    def _seen(self) -> FloatArray:
        """Projector on the directions in which the region has structure."""
        down, right = self.weights((0, 0), np.zeros(2))
        sides = [(down * right * slope).ravel() for slope in self._smooth]
        energy = np.array([[float(a @ b) for a in sides] for b in sides])
        values, vectors = np.linalg.eigh(energy)
        floor = (
            2.0
            * _NOISE_SLOPE
            * noise_variance(self.region.of(self.picture))
            * float((down**2).sum() * (right**2).sum())
        )
        kept = vectors[:, (values > floor) | (values > _UNSEEN * values[1])]
        return np.asarray(kept @ kept.T)


def weighted(patch: Picture, down: Picture, right: Picture) -> Picture:
    """The patch under a window, without its mean there."""
    mean = float(((down[:, 0] ** 2) @ patch) @ right**2) / float((down**2).sum() * (right**2).sum())
    return (patch - np.float32(mean)) * down * right


def centred(length: int) -> Picture:
    """Places along an axis from -1 to 1."""
    return np.linspace(-1.0, 1.0, length, dtype=np.float32)


def noise_variance(patch: Picture) -> float:
    """Variance of white noise, by the median of the mixed differences of neighbours, which a smooth picture lacks."""
    mixed = np.diff(np.diff(patch, axis=0), axis=1)
    return float(np.median(np.abs(mixed)) / 0.6745) ** 2 / 4.0
