"""The result of `displacement`."""

import warnings
from collections.abc import Mapping
from dataclasses import field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, frozen, read_only
from hysim.errors import HysimWarning
from hysim.records import Record, check_increasing

STATUSES = ("ok", "blurred", "lost")
_ROUNDING = 1e-9  # of a log's span: a frame at the very time of a switch sees the new voltage


@frozen
class Displacement:
    """Displacement of the picture in each frame.

    Parameters
    ----------
    y : array, shape (n,)
        Displacement along the direction from where the reference is [``units["y"]``]; nan where a frame is lost.
    uncertainty : array, shape (n,)
        Its standard error, from the noise in both frames [``units["y"]``].
    shift : array, shape (n, 2)
        The same to the right and down [pixel].
    across : array, shape (n,)
        Displacement across the direction, a quarter turn on [``units["y"]``]; nan where the picture cannot show it.
    quality : array, shape (n,)
        Correlation with the reference, 1 where the frame is the same but for gain, offset and slope of the light.
    status : tuple of str
        ``"ok"``, ``"blurred"`` or ``"lost"``, for each frame.
    scale : float
        Length of a pixel [``units["y"]``].
    direction : float
        Direction in which `y` is positive: 0 to the right, 90 down the picture [degree].
    resolution : float or None
        The scale, where shifts are whole pixels; None where they are not.
    units : mapping
        Label of the unit of ``"y"``.

    Raises
    ------
    ValueError
        If the lengths differ.
    """

    y: FloatArray
    uncertainty: FloatArray
    shift: FloatArray
    across: FloatArray
    quality: FloatArray
    status: tuple[str, ...]
    scale: float
    direction: float
    resolution: float | None = None
    units: Mapping[str, str] = field(default_factory=lambda: {"y": "um"})

    def __post_init__(self) -> None:
        lengths = {name: len(vars(self)[name]) for name in ("y", "uncertainty", "shift", "across", "quality", "status")}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"a displacement has one value of each kind for each frame, got {lengths}")

    def __len__(self) -> int:
        return self.y.size

    def figures(self) -> dict[str, Any]:
        """Frames in all and by status, and extremes and median standard error of the displacement, if any is known."""
        is_located = np.isfinite(self.y)
        y, error = self.y[is_located], self.uncertainty[is_located]
        return {
            "frames": len(self),
            **{status: self.status.count(status) for status in STATUSES},
            "direction": self.direction, "scale": self.scale, "resolution": self.resolution,
            "lowest": float(y.min()) if y.size else None,
            "highest": float(y.max()) if y.size else None,
            "uncertainty": float(np.median(error)) if y.size else None,
            "units": dict(self.units),
        }  # fmt: skip

    def summary(self) -> str:
        """Frames by status, the range of the displacement and its median standard error, in words."""
        known, unit = self.figures(), self.units["y"]
        counts = ", ".join(f"{known[status]} {status}" for status in STATUSES if known[status])
        lines = [f"{len(self)} frames: {counts}", f"direction {self.direction:.2f} degrees from the right, downwards"]
        if (error := known["uncertainty"]) is not None:
            lines += [
                f"displacement from {known['lowest']:.6g} to {known['highest']:.6g} {unit}",
                f"standard error {error:.2g} {unit}, {error / self.scale:.2g} pixel",
            ]
        return "\n".join(lines)

    def record(
        self,
        u: npt.ArrayLike,
        t: npt.ArrayLike | None = None,
        *,
        frame_times: npt.ArrayLike | None = None,
        u_times: npt.ArrayLike | None = None,
        on_lost: Literal["error", "drop"] = "error",
        units: Mapping[str, str] | None = None,
        name: str = "",
    ) -> Record:
        """Join the voltages that were applied, frame by frame or by the time of a log.

        Parameters
        ----------
        u : array, shape (n,) or (m,)
            Voltages: one for each frame, or those of a log.
        t : array, shape (n,), optional
            Times of the frames for the record [``units["t"]``].
        frame_times : array, shape (n,), optional
            Times of the frames in the clock of the log [``units["t"]``]; the record's times too, unless `t` is given.
        u_times : array, shape (m,), optional
            Increasing times of the log. A frame has the last voltage that was logged at or before its time. A
            `hysim.HysimWarning` counts the frames that come after its end by more than its last step.
        on_lost : {"error", "drop"}
            What to do where a frame is lost: raise, or leave it out.
        units : mapping, optional
            Labels of the units of ``"t"`` and ``"u"``; by default s and V.
        name : str, optional
            Name of the record.

        Returns
        -------
        Record
            With the displacement's unit and resolution.

        Raises
        ------
        ValueError
            If there are fewer or more voltages than frames, a frame comes before the log begins, or a frame is lost.

        Examples
        --------
        >>> import hysim as hs
        >>> moved = hs.vision.Displacement(
        ...     y=[0.0, 0.1, 0.3], uncertainty=[0.0, 0.01, 0.01], shift=[[0, 0], [1, 0], [3, 0]], across=[0, 0, 0],
        ...     quality=[1, 0.99, 0.99], status=("ok", "ok", "ok"), scale=0.1, direction=0.0,
        ... )
        >>> rec = moved.record(u=[0.0, 5.0], u_times=[0.0, 1.0], frame_times=[0.5, 1.0, 1.5])
        >>> rec.u.tolist(), rec.t.tolist()
        ([0.0, 5.0, 5.0], [0.5, 1.0, 1.5])
        """
        check_choice("on_lost", on_lost, ("error", "drop"))
        at = None if frame_times is None else self._per_frame(frame_times, "frame_times")
        voltages = self._voltages(u, at, u_times)
        times = at if t is None else self._per_frame(t, "t")
        is_located = np.isfinite(self.y)
        if on_lost == "error" and not is_located.all():
            raise ValueError(
                f"frame {int(np.argmin(is_located))} is lost, and {int((~is_located).sum())} of {len(self)} are: "
                'on_lost="drop" leaves them out'
            )
        return Record(
            u=voltages[is_located],
            y=self.y[is_located],
            t=None if times is None else times[is_located],
            units={"u": "V", "t": "s", **(units or {}), **self.units},
            resolution=self.resolution,
            name=name,
        )

    def columns(
        self, log: Record | None, times: FloatArray | None, on_lost: Literal["error", "drop"]
    ) -> tuple[dict[str, FloatArray], dict[str, str]]:
        """Columns of a table, with the voltages of a log if there is one, and their units."""
        columns: dict[str, Any] = {"t": times, "y": self.y}
        units = {"t": "s", "y": self.units["y"], "uncertainty": self.units["y"]}
        is_kept = np.isfinite(self.y) | (on_lost == "error")
        if log is None:
            columns = {signal: values[is_kept] for signal, values in columns.items() if values is not None}
        else:
            at: dict[str, Any] = {"t": log.t} if times is None else {"frame_times": times, "u_times": log.t}
            labels = {signal: unit for signal, unit in log.units.items() if signal != "y"}
            record = self.record(log.u, **at, on_lost=on_lost, units=labels)
            columns = {"t": record.t, "u": record.u, "y": record.y}
            units |= record.units
        columns |= {"uncertainty": self.uncertainty[is_kept], "quality": self.quality[is_kept]}
        return {name: values for name, values in columns.items() if values is not None}, units

    def _per_frame(self, values: npt.ArrayLike, name: str) -> FloatArray:
        array = read_only(values, name, ndim=1)
        if array.size != len(self):
            raise ValueError(f"{name} must have one value for each of the {len(self)} frames, got {array.size}")
        return array

    def _voltages(self, u: npt.ArrayLike, at: FloatArray | None, u_times: npt.ArrayLike | None) -> FloatArray:
        voltages = read_only(u, "u", ndim=1)
        if u_times is None:
            if voltages.size != len(self):
                raise ValueError(
                    f"there are {voltages.size} voltages for {len(self)} frames: give one for each frame, or the times "
                    "of both as u_times and frame_times"
                )
            return voltages
        if at is None:
            raise ValueError("u_times are given without frame_times: give both to join by time")
        log = read_only(u_times, "u_times", ndim=1)
        if log.size != voltages.size:
            raise ValueError(f"u and u_times must have equal lengths, got {voltages.size} and {log.size}")
        check_increasing(log)
        place = np.searchsorted(log, at + _ROUNDING * (log[-1] - log[0]), side="right") - 1
        if (place < 0).any():
            k = int(np.argmax(place < 0))
            raise ValueError(f"frame {k} at {at[k]:g} is before the voltages, which begin at {log[0]:g}")
        last_step = log[-1] - log[-2] if log.size > 1 else np.inf
        if beyond := int((at > log[-1] + (1.0 + _ROUNDING) * last_step).sum()):
            words = f"{beyond} of {len(self)} frames come after the log of voltages, which ends at {log[-1]:g}"
            warnings.warn(f"{words}: they have its last voltage, {voltages[-1]:g}", HysimWarning, stacklevel=3)
        return np.asarray(voltages[place])
