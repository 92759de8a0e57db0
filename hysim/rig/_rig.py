"""The whole experiment: a drive, an actuator and a camera in, a table of voltages and displacements out."""

from dataclasses import field
from math import pi
from typing import TYPE_CHECKING, Literal

import numpy as np

from hysim._basics.frozen import FloatArray, check_choice, checked, frozen
from hysim._basics.progress import Reports
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.plants.actuator import Actuator
from hysim.plants.stages import Amplifier
from hysim.plants.transfer_function import mode
from hysim.records import Record
from hysim.rig._camera import Camera, Frames
from hysim.rig._drive import Drive
from hysim.simulation import simulate

if TYPE_CHECKING:
    from hysim.vision import Displacement

UNITS = {"t": "s", "u": "V", "y": "um"}

SUPPLY = Amplifier(limits=(0.0, 150.0))
"""The supply of the staircase; the paper prints only its voltages."""

UA741 = Amplifier.non_inverting(feedback_resistance=9e3, input_resistance=1e3, limits=(0.0, 44.0), slew_rate=0.5e6)
"""The op-amp of the square waves, equation (2). Its supplies may be 44 V apart: the paper's 50 V are beyond them."""

LAW = PolynomialBoucWen(
    beta=0.003877,
    gamma=0.0585,
    gain=-0.007646,
    offset=-0.007646 * 8.841,
    z0=-8.841,
    input_coefficients=(0.02807, -3.826e-5),
)
"""The law that `identify` finds in Table 1 with n = 1, relative to its first displacement [V, um]."""


@checked
class Rig:
    """An actuator under a microscope.

    Parameters
    ----------
    actuator : Actuator
        From the command [V] to the displacement [um].
    camera : Camera
        That looks at its end.

    Raises
    ------
    TypeError
        If they are not of their kinds.

    Examples
    --------
    >>> import hysim as hs
    >>> experiment = hs.rig.table1().run(hs.rig.staircase_drive(dwell=0.1))
    >>> table = experiment.record("truth")  # or "subpixel" or "whole-pixel": what the frames show
    >>> len(table), table.u[25:27].tolist(), table.y[25:27].round(3).tolist()
    (52, [125.0, 125.0], [2.721, 2.721])
    """

    actuator: Actuator = field(default_factory=Actuator)
    camera: Camera = field(default_factory=Camera)

    def __post_init__(self) -> None:
        for name, kind in (("actuator", Actuator), ("camera", Camera)):
            if not isinstance(vars(self)[name], kind):
                raise TypeError(f"{name} must be of {kind.__name__}, got {type(vars(self)[name]).__name__}")

    def run(self, drive: Drive) -> "Experiment":
        """Drive the actuator; frames are rendered when they are asked for.

        Parameters
        ----------
        drive : Drive
            Command, and when frames are taken.

        Returns
        -------
        Experiment

        Raises
        ------
        TypeError
            If `drive` is no Drive.
        SimulationError
            If the actuator diverges.
        ValueError
            If the frames of a level take longer than the level.
        """
        if not isinstance(drive, Drive):
            raise TypeError(f"drive must be a Drive, such as staircase_drive(), got {type(drive).__name__}")
        at = drive.exposures(self.camera)
        run = simulate(self.actuator, drive.t, drive.u, units=UNITS)
        return Experiment(
            rig=self, drive=drive, t=drive.t, u=drive.u, voltage=run.signals.get("amplifier", drive.u), y=run.y, at=at
        )


@frozen
class Experiment:
    """A run of the rig: command, voltage, true displacement and the times of the frames.

    Parameters
    ----------
    rig : Rig
        Actuator and camera.
    drive : Drive
        Voltages and exposures of the run.
    t, u, voltage, y : array, shape (n,)
        Times [s], command and voltage at the actuator [V], and true displacement [um].
    at : array, shape (n_frames,)
        Times at which the exposures begin [s].
    """

    rig: Rig
    drive: Drive
    t: FloatArray
    u: FloatArray
    voltage: FloatArray
    y: FloatArray
    at: FloatArray

    @property
    def exposed_y(self) -> FloatArray:
        """True displacement, its mean in each exposure, shape (n_frames,) [um]."""
        return Frames(self.rig.camera, self.t, self.y, self.at).exposed_y

    @property
    def voltages(self) -> FloatArray:
        """Voltage at the actuator as each exposure begins, shape (n_frames,) [V]."""
        return self.voltage[np.searchsorted(self.t, self.at + 1e-9 * self.drive.sample_time, side="right") - 1]

    def frames(self) -> Frames:
        """The camera's frames, each rendered when it is asked for."""
        return self.rig.camera.frames(self.t, self.y, self.at)

    def measure(
        self,
        method: Literal["subpixel", "whole-pixel"] = "subpixel",
        *,
        region: tuple[int, int, int, int] | None = None,
        reference: Literal["first", "running"] = "first",
        progress: Reports = None,
    ) -> "Displacement":
        """The displacement that the frames show, by `hysim.vision.displacement`; needs the extra ``vision``.

        Parameters
        ----------
        method : {"subpixel", "whole-pixel"}
            How finely frames are compared.
        region, reference, progress
            As `hysim.vision.displacement` has them. The scale and the direction are the camera's.

        Returns
        -------
        Displacement
            From the first frame on.

        Raises
        ------
        ImportError
            If the extra is not installed.
        ValueError
            As `hysim.vision.displacement`.
        """
        from hysim import vision

        camera = self.rig.camera
        return vision.displacement(
            self.frames(),
            camera.scale,
            region=region,
            direction=camera.direction,
            reference=reference,
            method=method,
            progress=progress,
        )

    def record(
        self,
        method: Literal["truth", "subpixel", "whole-pixel"] = "subpixel",
        *,
        take: Literal["mean", "last"] = "mean",
    ) -> Record:
        """The table of the experiment: voltage, displacement from the first row on, and time.

        Parameters
        ----------
        method : {"truth", "subpixel", "whole-pixel"}
            Whether the displacement is that of the actuator in each exposure, or measured as `measure` has it.
        take : {"mean", "last"}
            Which frame of a level is its row: the mean of those that could be measured, or the last one.

        Returns
        -------
        Record
            A row for each level of a drive with levels, and for each frame of one without. The resolution is a pixel
            where each row is a whole number of them.

        Raises
        ------
        ImportError
            If the extra ``vision`` is needed and not installed.
        ValueError
            If an option is unknown, or of a row no frame could be measured.
        """
        check_choice("method", method, ("truth", "subpixel", "whole-pixel"))
        check_choice("take", take, ("mean", "last"))
        frames_per_row = self.drive.frames_per_step if self.drive.dwell is not None else 1
        y = self.exposed_y if method == "truth" else self.measure(method).y
        rows = y.reshape(-1, frames_per_row)[:, 0 if take == "mean" else -1 :]
        if lost := np.flatnonzero(np.isnan(rows).all(axis=1)).tolist():
            raise ValueError(
                f"no frame of the rows {lost} could be measured: take more frames or more light, or, where the motion "
                "leaves the picture, a camera with a larger scale or shape"
            )
        means = np.nanmean(rows, axis=1)
        is_whole_pixel = method == "whole-pixel" and rows.shape[1] == 1
        return Record(
            u=self.voltages[frames_per_row - 1 :: frames_per_row],
            y=means - means[0],
            t=self.at[frames_per_row - 1 :: frames_per_row],
            units=UNITS,
            resolution=self.rig.camera.scale if is_whole_pixel else None,
            name=f"virtual rig, {method}",
        )


def table1(*, amplifier: Amplifier = SUPPLY, texture: int = 0, seed: int = 0) -> Rig:
    """The rig of Table 1: its law, a supply or the paper's op-amp, and its camera.

    The law is the one with 7 free parameters that fits the table best with a bounded memory, shifted to begin at 0 um.
    The table has the creep in it already: there is no other. The paper's modes are those of fits to one sample a second
    and slower than the steps; the mode here is one of 500 Hz.

    Parameters
    ----------
    amplifier : Amplifier
        `SUPPLY`, or `UA741` for the square waves.
    texture, seed : int
        Of the camera.

    Returns
    -------
    Rig

    Examples
    --------
    >>> import hysim as hs
    >>> rig = hs.rig.table1(amplifier=hs.rig.UA741)
    >>> moved = rig.run(hs.rig.square_drive(cycles=2))  # 1.8 and 5 V, but of 50 V the op-amp gives 44
    >>> sorted(set(moved.voltages.tolist()))
    [18.0, 44.0]
    """
    return Rig(
        actuator=Actuator(amplifier=amplifier, hysteresis=LAW, vibration=mode(2.0 * pi * 500.0, 0.01)),
        camera=Camera(gain_drift=0.02, offset_drift=0.005, texture=texture, seed=seed),
    )
