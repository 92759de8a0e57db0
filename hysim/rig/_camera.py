"""A camera on a microscope: what its frames show of a displacement, and with what noise.

    light     = (1 + gain_drift s) scene(moved by shift) + offset_drift s,    s = sin(2 pi t / drift_period)
    electrons = Poisson(full_well <light>) + read_noise gauss                 < > the mean over the exposure
    counts    = the nearest integer to (2^bits - 1) electrons / full_well, within 0 and 2^bits - 1

A frame's noise is a function of the seed and the frame's number alone: frames can be had in any order.

The scene under the microscope is the textured end of an actuator, shifted by any fraction of a pixel:

    s(r) = sum_k c_k exp(2 pi i f_k . r)          r in pixels, frequencies f_k below half a cycle per pixel
    c_k  = H(f_k) b_k,    H = exp(-2 pi^2 blur^2 |f|^2)

The optics pass no frequency that the pixels could not follow, so that the picture is a trigonometric polynomial. Moved
by d it has the coefficients c_k exp(-2 pi i f_k . d), exactly and for every d. Whole pixels of d move the window
instead: a motion by whole pixels moves the same bits. The period is longer than the picture.
"""

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from scipy import fft, special

from hysim._basics.frozen import FloatArray, NotNegative, Positive, checked, read_only
from hysim.datasets import PIXEL

Counts = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

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


@checked
class Camera:
    """A camera on a microscope, and the textured end of the actuator that it looks at.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of a frame.
    scale : float
        Displacement of a pixel [um]; the paper's is 0.0763.
    direction : float
        Of a growing displacement: 0 to the right, 90 down [degree].
    blur : float
        Standard deviation of the point spread, of optics and pixel together [pixel].
    grain, contrast : float
        Size of the texture's grains [pixel], and their rms brightness in parts of the full scale.
    bits : {8, 12}
        Of a count.
    full_well : float
        Electrons of the largest count.
    shot_noise : bool
        Whether electrons come one by one.
    read_noise : float
        Its rms value [electron].
    frame_rate : float
        Frames in a second.
    exposure : float
        Time in which a frame collects light, at most a frame's [s].
    subsamples : int
        Moments of an exposure whose pictures are averaged.
    gain_drift, offset_drift, drift_period : float
        Amplitudes of the illumination's slow change, of the light and of stray light in parts of the full scale, and
        the period of both [s].
    jitter : float
        Rms motion of the microscope from frame to frame, in each direction [pixel].
    texture, seed : int
        Seeds of the texture and of the noise.

    Raises
    ------
    TypeError, ValueError
        If a number is outside its range.

    Examples
    --------
    >>> import hysim as hs
    >>> camera = hs.rig.Camera(shape=(64, 96), bits=12)
    >>> frame = camera.frame(0.5 * camera.scale, number=7)  # half a pixel to the right
    >>> frame.shape, frame.dtype.name, bool((frame == camera.frame(0.5 * camera.scale, number=7)).all())
    ((64, 96), 'uint16', True)
    """

    shape: tuple[int, int] = (256, 256)
    scale: Positive = PIXEL
    direction: float = 0.0
    blur: NotNegative = 1.5
    grain: NotNegative = 2.0
    contrast: NotNegative = 0.12
    bits: Literal[8, 12] = 8
    full_well: Positive = 10_000.0
    shot_noise: bool = True
    read_noise: NotNegative = 10.0
    frame_rate: Positive = 30.0
    exposure: NotNegative = 0.01
    subsamples: int = 8
    gain_drift: float = 0.0
    offset_drift: float = 0.0
    drift_period: Positive = 60.0
    jitter: NotNegative = 0.0
    texture: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        if len(self.shape) != 2 or min(operator.index(size) for size in self.shape) < 1:
            raise ValueError(f"shape must be (rows, columns), got {self.shape}")
        if self.exposure * self.frame_rate > 1.0:
            raise ValueError(f"exposure must be at most a frame's time, {1 / self.frame_rate:g} s, got {self.exposure}")
        for name, least in (("subsamples", 1), ("texture", 0), ("seed", 0)):
            if operator.index(vars(self)[name]) < least:
                raise ValueError(f"{name} must be at least {least}, got {vars(self)[name]}")

    @cached_property
    def _scene(self) -> Scene:
        return Scene.textured_edge(
            self.shape,
            direction=self._direction,
            blur=self.blur,
            grain=self.grain,
            contrast=self.contrast,
            seed=self.texture,
        )

    @property
    def _direction(self) -> tuple[float, float]:
        """Unit vector (down, right), whose zeros are zero."""
        angle = math.radians(self.direction)
        return round(math.sin(angle), 15), round(math.cos(angle), 15)

    def light(self, y: npt.ArrayLike, t: float = 0.0) -> FloatArray:
        """The picture of a frame without noise, counts or jitter.

        Parameters
        ----------
        y : float, or array, shape (m,)
            Displacement, or those of the moments of an exposure, of whose pictures this is the mean [um].
        t : float
            Time, which the illumination's drift depends on [s].

        Returns
        -------
        array, shape `shape`
            In parts of the full scale.
        """
        return self._lit(np.outer(read_only(np.atleast_1d(y), "y", ndim=1) / self.scale, self._direction), t)

    def frame(self, y: npt.ArrayLike, number: int = 0, t: float = 0.0) -> Counts:
        """One frame.

        Parameters
        ----------
        y : float, or array, shape (m,)
            Displacement, or those of the moments of an exposure [um].
        number : int
            Of the frame, not negative: with the seed it determines the noise.
        t : float
            Time, which the illumination's drift depends on [s].

        Returns
        -------
        array of uint8 or uint16, shape `shape`
        """
        rng = np.random.default_rng((self.seed, number))
        shifts = np.outer(read_only(np.atleast_1d(y), "y", ndim=1) / self.scale, self._direction)
        if self.jitter:
            shifts = shifts + self.jitter * rng.standard_normal(2)
        electrons = self.full_well * np.maximum(self._lit(shifts, t), 0.0)
        if self.shot_noise:
            electrons = rng.poisson(electrons).astype(float)
        if self.read_noise:
            electrons += self.read_noise * rng.standard_normal(self.shape)
        largest = 2**self.bits - 1
        counts: FloatArray = np.clip(np.floor(electrons * (largest / self.full_well) + 0.5), 0, largest)
        return counts.astype(np.uint8) if self.bits == 8 else counts.astype(np.uint16)

    def frames(self, t: npt.ArrayLike, y: npt.ArrayLike, at: npt.ArrayLike | None = None) -> "Frames":
        """Frames of a displacement in time, each rendered when it is asked for.

        Parameters
        ----------
        t, y : array, shape (n,)
            Increasing times [s] and displacements, linear between them [um].
        at : array, shape (n_frames,), optional
            Times at which exposures begin [s]; by default the frame rate's, as long as exposures end within `t`.

        Returns
        -------
        Frames

        Raises
        ------
        ValueError
            If lengths differ, the times do not increase, an exposure is not within them, or the motion is so long that
            the scene repeats.

        Examples
        --------
        >>> import hysim as hs
        >>> frames = hs.rig.Camera(shape=(32, 32), frame_rate=10.0).frames([0.0, 1.0], [0.0, 0.3])
        >>> len(frames), frames[-1].shape
        (10, (32, 32))
        """
        times, displacements = read_only(t, "t", ndim=1), read_only(y, "y", ndim=1)
        if times.size != displacements.size or not times.size or not (np.diff(times) > 0.0).all():
            raise ValueError(
                f"t must increase and be as long as y, got {times.size} times and {displacements.size} displacements"
            )
        if at is None:
            last = math.floor((times[-1] - times[0] - self.exposure) * self.frame_rate + 1e-9)
            at = times[0] + np.arange(last + 1.0) / self.frame_rate
        starts = read_only(at, "at", ndim=1)
        if starts.size and (starts.min() < times[0] or starts.max() + self.exposure > times[-1] + 1e-9):
            raise ValueError(
                f"exposures must be within {times[0]:g} to {times[-1]:g} s, got {starts.min():g} to "
                f"{starts.max() + self.exposure:g} s"
            )
        span = float(np.ptp(np.interp(starts, times, displacements))) if starts.size else 0.0
        if span > self._reach * (1.0 + 1e-9):
            raise ValueError(
                f"displacements may span {self._reach:.4g} um, {self._reach / self.scale:.0f} pixels, before the scene "
                f"repeats, got {span:.4g} um: take a larger scale or a smaller motion"
            )
        return Frames(self, times, displacements, starts)

    @property
    def _reach(self) -> float:
        """The longest motion whose pictures show nothing twice [um]."""
        spare = [period - view for period, view in zip(self._scene.period, self.shape, strict=True)]
        return self.scale * min(n / abs(part) for n, part in zip(spare, self._direction, strict=True) if part)

    @property
    def signal_to_noise(self) -> float:
        """Rms of the picture about its mean over the rms noise of a pixel, with that of its count [dB]."""
        light = self.light(0.0)
        electrons = self.full_well * float(light.mean()) if self.shot_noise else 0.0
        count = self.full_well / (2**self.bits - 1)
        noise = math.sqrt(electrons + self.read_noise**2 + count**2 / 12.0)
        return 20.0 * math.log10(self.full_well * float(light.std()) / noise)

    def _lit(self, shifts: FloatArray, t: float) -> FloatArray:
        """Light of the scene moved by shifts, shape (m, 2) [pixel]."""
        swing = math.sin(2.0 * math.pi * t / self.drift_period)
        return (1.0 + self.gain_drift * swing) * self._scene.shifted(shifts) + self.offset_drift * swing


class Frames:
    """Frames of a displacement, rendered one at a time: a sequence whose memory does not grow with its length.

    Parameters
    ----------
    camera : Camera
        That takes them.
    t, y : array, shape (n,)
        Times [s] and displacements [um].
    at : array, shape (n_frames,)
        Times at which exposures begin [s].
    """

    def __init__(self, camera: Camera, t: FloatArray, y: FloatArray, at: FloatArray) -> None:
        self.camera, self.t, self.y, self.at = camera, t, y, at

    def __len__(self) -> int:
        return self.at.size

    def __getitem__(self, number: int) -> Counts:
        k = range(len(self))[operator.index(number)]
        return self.camera.frame(self._exposed(k), k, float(self.at[k]))

    def __iter__(self) -> Iterator[Counts]:
        return (self[k] for k in range(len(self)))

    @property
    def exposed_y(self) -> FloatArray:
        """Mean displacement of each exposure, shape (n_frames,) [um]: what a perfect measurement would find."""
        return np.array([self._exposed(k).mean() for k in range(len(self))])

    def _exposed(self, k: int) -> FloatArray:
        """Displacements at the moments of an exposure."""
        moments = (np.arange(self.camera.subsamples) + 0.5) / self.camera.subsamples
        return np.asarray(np.interp(self.at[k] + self.camera.exposure * moments, self.t, self.y))


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
