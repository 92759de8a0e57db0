"""The scene under the microscope: the textured end of an actuator, shifted by any fraction of a pixel.

    s(r) = sum_k c_k exp(2 pi i f_k . r)          r in pixels, frequencies f_k below half a cycle per pixel
    c_k  = H(f_k) b_k,    H = exp(-2 pi^2 blur^2 |f|^2)

The optics pass no frequency that the pixels could not follow, so that the picture is a trigonometric polynomial. Moved
by d it has the coefficients c_k exp(-2 pi i f_k . d), exactly and for every d. Whole pixels of d move the window
instead: a motion by whole pixels moves the same bits. The period is longer than the picture.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy import fft, special

from hysim._frozen import FloatArray

MARGIN = 128  # pixels of the period outside the picture, half of them on each side
_DARK, _BRIGHT = 0.12, 0.55  # of the full scale: behind the actuator, and its mean
_BLOTCH = 8.0  # size, in grains, of what the texture has besides them
_RIM = 0.2  # more light on the edge
_EDGE = 0.6  # of the picture: where the actuator ends
_SHARPNESS = 0.7  # standard deviation of the edge before the optics [pixel]
_ROUGHNESS = 1.5  # rms, of the edge [pixel]
_RUN = 12.0  # along the edge, of its roughness [pixel]


@dataclass(frozen=True)
class Scene:
    """A periodic picture by its Fourier coefficients, as `scipy.fft.rfft2` orders them."""

    coefficients: npt.NDArray[np.complex128]
    period: tuple[int, int]
    shape: tuple[int, int]

    @classmethod
    def textured_edge(
        cls,
        shape: tuple[int, int],
        *,
        direction: tuple[float, float],
        blur: float,
        grain: float,
        contrast: float,
        seed: int,
    ) -> Self:
        """The end of an actuator that moves in a direction (down, right), in parts of the full scale."""
        period = (_period(shape[0]), _period(shape[1]))
        down, right = (np.arange(float(n)) - MARGIN / 2 - _EDGE * view for n, view in zip(period, shape, strict=True))
        along = down[:, np.newaxis] * direction[0] + right * direction[1]
        across = right * direction[0] - down[:, np.newaxis] * direction[1]
        rng = np.random.default_rng(seed)
        grains, blotches = (_smooth(rng.standard_normal(period), size) for size in (grain, _BLOTCH * grain))
        profile = _ROUGHNESS * _smooth(rng.standard_normal(sum(period) * 2), _RUN)
        beyond = along + profile[np.rint(across).astype(int)]
        covered = special.ndtr(-beyond / _SHARPNESS)
        texture = contrast * (0.8 * grains + 0.6 * blotches)
        rim = _RIM * np.exp(-((beyond / 2.0) ** 2))
        light = _DARK + (_BRIGHT - _DARK + texture) * covered + rim
        transfer = _gaussian_transfer(period, blur)
        for axis, n in enumerate(period):
            if n % 2 == 0:  # at half a cycle per pixel a part of a pixel has no meaning
                transfer[(n // 2,) if axis == 0 else (slice(None), n // 2)] = 0.0
        return cls(coefficients=transfer * fft.rfft2(np.clip(light, 0.0, 1.0)), period=period, shape=shape)

    def shifted(self, shifts: FloatArray) -> FloatArray:
        """Mean of the picture shifted by each of some shifts, shape (m, 2), rows down and columns right [pixel]."""
        whole_pixels = np.floor(shifts.mean(axis=0) + 0.5)
        rest, times = np.unique(shifts - whole_pixels, axis=0, return_counts=True)
        frequencies = fft.fftfreq(self.period[0]), fft.rfftfreq(self.period[1])
        down, right = (np.exp(-2j * np.pi * np.outer(part, f)) for part, f in zip(rest.T, frequencies, strict=True))
        transfer = (down * (times / times.sum())[:, np.newaxis]).T @ right
        picture = fft.irfft2(self.coefficients * transfer, s=self.period)
        rows, columns = (
            np.arange(size) + MARGIN // 2 - int(far) for size, far in zip(self.shape, whole_pixels, strict=True)
        )
        return np.asarray(picture.take(rows, axis=0, mode="wrap").take(columns, axis=1, mode="wrap"))


def _period(size: int) -> int:
    return int(fft.next_fast_len(size + MARGIN, real=True))


def _gaussian_transfer(shape: tuple[int, ...], width: float) -> FloatArray:
    """Fourier transform of a gaussian of this standard deviation [pixel], at the frequencies of `scipy.fft.rfftn`."""
    *others, last = shape
    frequencies = np.meshgrid(*(fft.fftfreq(n) for n in others), fft.rfftfreq(last), indexing="ij", sparse=True)
    squared = sum(f**2 for f in frequencies)
    return np.asarray(np.exp(-2.0 * (np.pi * width) ** 2 * squared))


def _smooth(noise: FloatArray, width: float) -> FloatArray:
    """White noise made as smooth as a gaussian of this width [pixel], of mean zero and variance one."""
    field = fft.irfftn(_gaussian_transfer(noise.shape, width) * fft.rfftn(noise), s=noise.shape)
    return np.asarray((field - field.mean()) / field.std())
