"""Templates of the reference, a patch under a window, and the scores by which a shift is estimated.

A patch whose content has moved by a little e more than expected, under a gain a and with an offset and a slope of the
light, is

    p(x) = a W (r - e . grad r) + W (b0 + b1 x + b2 y) + W noise .

Each template h_i is W dr/dx_i of a slightly smoothed r, made orthogonal to W r, W, W x and W y: gain, offset and slope
drop out of the scores phi_i = <h_i, p>, and e follows from phi_i = -a sum_j J_ij e_j with J_ij = <h_i, W dr/dx_j>.
Where the window is moved by less than the patch, by a little d, there is a sum_j Q_ij d_j more in the score, with
Q_ij = <h_i, r dW/dx_j>. White noise of variance s^2 gives e the covariance (s / a)^2 J^-1 M J^-T with
M_ij = <W h_i, W h_j>.

The products with the templates are sums over spectra, where a shift by any fraction of a pixel is a phase.

Windows move with the picture. A patch of the reference r, weighted by a window, is W(x) r(x). In a frame whose content
has moved by d it is W(x - d) r(x - d): the same patch, moved by d, whatever enters or leaves at the borders. A window
that stays where it is would pull every shift towards zero. Along each axis the window is flat with sine-squared flanks,
and is known between the pixels. Where the content has moved out of the picture, the reference is cut back by whole
steps on the side that is missing.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from hysim._basics.frozen import FloatArray

Picture = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]

_THUMBNAIL = 128  # pixels of an axis in which a shift is looked for at first
_SMOOTHING = 1.5  # of the templates [pixel]
_SLOPE = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0  # derivative over unit steps, of the sixth order
_NOISE_SLOPE = 1.0 / (8.0 * np.pi * _SMOOTHING**4)  # energy of the smoothed slope of white noise of unit variance
_NOISE_OR_FINE = 0.5  # of the structure across: what is stronger is no noise, but as fine as noise
_FAINT = 1e-3  # of the structure across, the least: what digits and pixels make of a straight edge is less
_TEMPLATES = 8  # kept at a time
_MARGIN = 1.0  # kept free at both ends, so that shifts up to a pixel need no cut [pixel]
_FLANK = 0.25  # of the window's length
_STEPS = 64  # cuts of one axis


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
    """The reference under one window; the spectra are conjugated and weighted for sums over the half plane.

    `patch` is W r, r without its plane, and has some `energy`; `slopes` are the h_i; `inverse` is J^-1 where the region
    has structure and zero across; `flanks` is Q, `spread` is J^-1 M J^-T, and `weight` is the sum of W^2.
    """

    patch: Spectrum
    slopes: list[Spectrum]
    thumbnail: Spectrum
    energy: float
    weight: float
    inverse: FloatArray
    flanks: FloatArray
    spread: FloatArray


class Grid:
    """Frequencies of patches of one shape, padded to lengths that transform fast."""

    def __init__(self, height: int, width: int) -> None:
        self.shape = fft.next_fast_len(height, True), fft.next_fast_len(width, True)
        self.small = min(self.shape[0], _THUMBNAIL), min(self.shape[1], _THUMBNAIL)
        self.down = 2.0 * np.pi * np.fft.fftfreq(self.shape[0])
        self.right = 2.0 * np.pi * np.fft.rfftfreq(self.shape[1])
        half = np.where((self.right > 0.0) & (self.right < np.pi), 2.0, 1.0)
        self.weights = (half / np.prod(self.shape)).astype(np.float32)

    def spectrum(self, patch: Picture) -> Spectrum:
        """Half plane of a real patch."""
        return np.asarray(fft.rfft2(patch, self.shape), dtype=np.complex64)

    def thumbnail(self, spectrum: Spectrum) -> Spectrum:
        """The low frequencies in both half planes."""
        height, width = self.small
        rows = np.r_[0 : (height + 1) // 2, -(height // 2) : 0]
        return np.asarray(fft.fft2(fft.irfft2(spectrum[rows, : width // 2 + 1], self.small)), dtype=np.complex64)

    def phases(self, shift: FloatArray) -> tuple[Spectrum, Spectrum]:
        """Factors along both axes that move a patch back by a shift."""
        down, right = (np.exp(1j * s * k) for s, k in zip(shift, (self.down, self.right), strict=True))
        return down.astype(np.complex64), right.astype(np.complex64)


class Reference:
    """A picture, the region of it that is looked for, and its templates."""

    def __init__(self, picture: Picture, region: Region) -> None:
        smooth = ndimage.gaussian_filter(picture, _SMOOTHING)
        self._patch = region.of(picture)
        self._slopes = [region.of(ndimage.correlate1d(picture, _SLOPE, axis=axis)) for axis in (0, 1)]
        self._smooth = [region.of(ndimage.correlate1d(smooth, _SLOPE, axis=axis)) for axis in (0, 1)]
        self.region = region
        self.grid = Grid(region.height, region.width)
        self.template = lru_cache(maxsize=_TEMPLATES)(self._template)
        self.visible = self._visible()

    def windows(self, cuts: tuple[int, int], shift: FloatArray) -> tuple[Picture, Picture]:
        """The window along a column and along a row, moved by a shift."""
        down = window(self.region.height, cuts[0], shift[0])
        right = window(self.region.width, cuts[1], shift[1])
        return down.astype(np.float32)[:, None], right.astype(np.float32)

    def _template(self, cuts: tuple[int, int]) -> Template:
        down, right = self.windows(cuts, np.zeros(2))
        W, r = down * right, without_plane(self._patch, down, right)
        light = [W * r, W, W * _centred(down[:, 0])[:, None], W * _centred(right)]
        h = _without([W * slope for slope in self._smooth], light)
        flanks = [r * np.gradient(down, axis=0) * right, r * down * np.gradient(right)]
        steepness = self.visible @ _products(h, [W * slope for slope in self._slopes]) @ self.visible
        inverse = np.asarray(np.linalg.pinv(steepness), dtype=np.float64)
        noise = [W * one for one in h]
        spectrum, weights = self.grid.spectrum(W * r), self.grid.weights
        return Template(
            patch=weights * spectrum.conj(),
            slopes=[weights * self.grid.spectrum(one).conj() for one in h],
            thumbnail=self.grid.thumbnail(spectrum),
            energy=float(np.vdot(W * r, W * r)),
            weight=float(np.vdot(W, W)),
            inverse=inverse,
            flanks=_products(h, flanks),
            spread=inverse @ _products(noise, noise) @ inverse.T,
        )

    def _visible(self) -> FloatArray:
        """Projector on the directions in which the region has more structure than noise."""
        down, right = self.windows((0, 0), np.zeros(2))
        W = down * right
        slopes = [W * slope for slope in self._smooth]
        values, vectors = np.linalg.eigh(_products(slopes, slopes))
        if not values[1] > 0.0:
            raise ValueError("the region of the reference is of one grey: there is nothing that can be seen to move")
        noise = _NOISE_SLOPE * _noise_variance(self._patch) * float(np.vdot(W, W))
        floor = max(2.0 * noise, _FAINT * values[1])
        kept = vectors[:, values > min(floor, _NOISE_OR_FINE * values[1])]
        return np.asarray(kept @ kept.T)


def without_plane(patch: Picture, down: Picture, right: Picture) -> Picture:
    """The patch without the plane that is nearest to it under the window."""
    rows, columns = down[:, 0] ** 2, right**2
    y, x = _centred(rows), _centred(columns)
    sums = np.stack([rows, rows * y]) @ patch @ np.stack([columns, columns * x], axis=1)
    up = sums[1, 0] / (rows @ y**2 * columns.sum())
    along = sums[0, 1] / (rows.sum() * (columns @ x**2))
    plane: Picture = (sums[0, 0] / (rows.sum() * columns.sum()) + up * y)[:, None] + along * x
    return np.asarray(patch - plane)


def _without(pictures: list[Picture], light: list[Picture]) -> list[Picture]:
    """The parts of the pictures that are orthogonal to what the light can do."""
    amounts = np.linalg.solve(_products(light, light), _products(light, pictures))
    return [
        picture - sum(np.float32(amount) * other for amount, other in zip(column, light, strict=True))
        for picture, column in zip(pictures, amounts.T, strict=True)
    ]


def _products(left: list[Picture], right: list[Picture]) -> FloatArray:
    return np.array([[float(np.vdot(a, b)) for b in right] for a in left])


def _centred(weights: Picture) -> Picture:
    """Places along an axis from the centre of the weights [pixel]."""
    places = np.arange(weights.size, dtype=np.float32)
    return np.asarray(places - np.float32(weights @ places / weights.sum()))


def _noise_variance(patch: Picture) -> float:
    """Variance of white noise, by the median of the mixed differences of neighbours, which a smooth picture lacks."""
    mixed = np.diff(np.diff(patch, axis=0), axis=1)
    return float(np.median(np.abs(mixed)) / 0.6745) ** 2 / 4.0


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
