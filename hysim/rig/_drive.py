"""Voltages of the supply and times of the camera's frames: the paper's staircase and its square waves."""

import operator

import numpy as np

from hysim import signals
from hysim._basics.frozen import FloatArray, Positive, checked
from hysim.rig._camera import Camera

SQUARE_WAVES = {"slow": 0.1, "fast": 1.01626}
"""Frequencies of the paper's square waves [Hz]: its program switches every 5 s, its Table 2 says the other."""


@checked
class Drive:
    """A command that is held between its samples, and when frames are taken.

    Parameters
    ----------
    u : array, shape (n,)
        Command at the samples [V].
    sample_time : float
        Time between two samples [s].
    dwell : float, optional
        Time of each level at whose end frames are taken [s]; None films without a pause.
    frames_per_step : int
        Frames of each level.

    Raises
    ------
    ValueError
        If there is no command, a time is not positive, a count is below 1, or the levels do not fill the command.

    Examples
    --------
    >>> import hysim as hs
    >>> drive = hs.rig.Drive(u=[0.0, 0.0, 5.0, 5.0], sample_time=0.5, dwell=1.0)
    >>> drive.exposures(hs.rig.Camera(frame_rate=10.0, exposure=0.05)).round(3).tolist()  # at the end of each second
    [0.4, 1.4]
    """

    u: FloatArray
    sample_time: Positive
    dwell: float | None = None
    frames_per_step: int = 1

    def __post_init__(self) -> None:
        if self.u.ndim != 1 or self.u.size < 2:
            raise ValueError(f"u must have one axis and at least 2 samples, got shape {self.u.shape}")
        if operator.index(self.frames_per_step) < 1:
            raise ValueError(f"frames_per_step must be at least 1, got {self.frames_per_step}")
        if self.dwell is not None:
            samples = self._samples_of_level
            if samples < 1 or abs(samples * self.sample_time - self.dwell) > 1e-9 * self.dwell:
                raise ValueError(f"dwell must be a whole number of samples of {self.sample_time:g} s, got {self.dwell}")
            if self.u.size % samples:
                raise ValueError(
                    f"the command must be a whole number of levels of {samples} samples, got {self.u.size} samples"
                )

    @property
    def t(self) -> FloatArray:
        """Times of the samples, shape (n,) [s]."""
        return self.sample_time * np.arange(float(self.u.size))

    def exposures(self, camera: Camera) -> FloatArray:
        """Times at which the camera's exposures begin, shape (n_frames,) [s].

        Those of a level end a sample before the next level.

        Raises
        ------
        ValueError
            If the frames of a level take longer than the level.
        """
        if self.dwell is None:
            last = (self.t[-1] - camera.exposure) * camera.frame_rate
            return np.arange(np.floor(last + 1e-9) + 1.0) / camera.frame_rate
        before = (np.arange(self.frames_per_step, 0.0, -1.0)) / camera.frame_rate + self.sample_time
        if before[0] > self.dwell:
            raise ValueError(
                f"{self.frames_per_step} frames at {camera.frame_rate:g} Hz need {before[0]:g} s of a level that lasts "
                f"{self.dwell:g} s: take a longer dwell or fewer frames"
            )
        ends = self.dwell * np.arange(1.0, self.u.size // self._samples_of_level + 1.0)
        return np.asarray((ends[:, np.newaxis] - before).ravel())

    @property
    def _samples_of_level(self) -> int:
        return round((self.dwell or 0.0) / self.sample_time)


def staircase_drive(
    low: float = 0.0,
    high: float = 125.0,
    step: float = 5.0,
    *,
    dwell: float = 1.0,
    frames_per_step: int = 1,
    cycles: int = 1,
    sample_time: float = 5e-4,
) -> Drive:
    """The staircase of Table 1: up and down in steps, with frames at the end of each.

    Parameters
    ----------
    low, high, step : float
        Extremes and height of a step, as `hysim.signals.staircase` has them [V]. The highest level comes twice.
    dwell : float
        Time of a level [s]; the paper prints none.
    frames_per_step : int
        Frames of each level.
    cycles : int
        Number of ways up and down.
    sample_time : float
        Of the simulation [s]; a whole number of samples makes a level.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        As `hysim.signals.staircase` and `Drive`.

    Examples
    --------
    >>> import hysim as hs
    >>> drive = hs.rig.staircase_drive(sample_time=1.0)
    >>> bool((drive.u == hs.datasets.table1().u).all())
    True
    """
    levels = signals.staircase(low, high, step, cycles=cycles)
    u = np.repeat(levels, max(round(dwell / sample_time), 1))
    return Drive(u=u, sample_time=sample_time, dwell=dwell, frames_per_step=frames_per_step)


def square_drive(
    low: float = 1.8,
    high: float = 5.0,
    *,
    frequency: float = SQUARE_WAVES["fast"],
    cycles: int = 5,
    sample_time: float = 5e-4,
) -> Drive:
    """The square waves of the vibration experiment, filmed without a pause.

    Parameters
    ----------
    low, high : float
        Levels of the command [V]; the op-amp makes 18 and 50 V of 1.8 and 5 V.
    frequency : float
        Of the wave [Hz]; `SQUARE_WAVES` has the paper's two.
    cycles : int
        Number of periods, each of which begins low.
    sample_time : float
        Of the simulation [s]; the command switches at the sample that is nearest.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        If the frequency is not positive, or half a period is shorter than a sample; or as `Drive`.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.rig.square_drive(frequency=0.1, cycles=1, sample_time=2.5).u.tolist()  # 5 s on, 5 s off
    [1.8, 1.8, 5.0, 5.0]
    """
    if not 0.0 < 2.0 * frequency * sample_time <= 1.0:
        raise ValueError(f"frequency must be from above 0 to {0.5 / sample_time:g} Hz, got {frequency}")
    if operator.index(cycles) < 1:
        raise ValueError(f"cycles must be at least 1, got {cycles}")
    phase = 2.0 * frequency * sample_time * np.arange(round(cycles / (frequency * sample_time)))
    halves = np.floor(phase + 1e-9).astype(int)
    return Drive(u=np.where(halves % 2, high, low), sample_time=sample_time)
