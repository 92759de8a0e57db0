"""Records of structures with several sensors, and such a record as one output.

`hysim.identify` fits one output for each record. The sensors' outputs are laid one behind the other, each in units of
its noise; the input is repeated for each of them.
"""

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, checked, frozen, read_only
from hysim._printing import printed, summary_text
from hysim.records import Record, check_increasing, even_step

OF_NODES = ("displacement", "velocity", "acceleration")
OF_ELEMENTS = ("drift", "force")
_LEAST = 1e-6  # of the size of a signal: its residual is not taken for smaller, however exact the fit

Sensor = tuple[str, int]
"""Name of a signal, and its column."""


@printed
@frozen
class StructureRecord:
    """Input of a structure, and what several sensors measured.

    Parameters
    ----------
    t : array, shape (n,)
        Times of the samples, evenly spaced [s].
    u : array, shape (n,)
        Acceleration of the base [m/s^2], or force [N].
    displacement, velocity, acceleration : array, shape (n, n_nodes), optional
        Relative to the ground, the accelerations absolute, as `hysim.simulate` has them [m], [m/s], [m/s^2]. A column
        of nan is a sensor that is not there.
    drift, force : array, shape (n, n_elements), optional
        Of the elements [m], [N]; likewise.
    name : str, optional
        Name of the record in tables.

    Raises
    ------
    ValueError
        If shapes do not fit, times are not evenly spaced, a column is partly nan, or nothing was measured.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> t = 0.01 * np.arange(100)
    >>> top = np.column_stack([np.full(100, np.nan), np.sin(t)])
    >>> hs.StructureRecord(t=t, u=np.cos(t), acceleration=top).sensors
    (('acceleration', 1),)
    """

    t: FloatArray
    u: FloatArray
    displacement: FloatArray | None = None
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None
    drift: FloatArray | None = None
    force: FloatArray | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name, values in (("t", self.t), ("u", self.u)):
            if values.ndim != 1 or values.size != self.t.size:
                raise ValueError(f"{name} must have the shape ({self.t.size},), got {values.shape}")
            read_only(values, name)  # finite
        if self.t.size < 2:
            raise ValueError(f"a record needs at least 2 samples, got {self.t.size}")
        check_increasing(self.t)
        even_step(self.t)
        for name, values in self.signals.items():
            if values.ndim != 2 or len(values) != self.t.size:
                raise ValueError(f"{name} must have the shape ({self.t.size}, number of columns), got {values.shape}")
            missing = np.isnan(values)
            if (missing.any(axis=0) & ~missing.all(axis=0)).any() or np.isinf(values).any():
                raise ValueError(f"a column of {name} must be finite, or nan as a whole where there is no sensor")
        if not self.sensors:
            raise ValueError(f"a record needs one of {', '.join((*OF_NODES, *OF_ELEMENTS))}")

    def __len__(self) -> int:
        return self.t.size

    def __str__(self) -> str:
        names = ", ".join(f"{signal}[:, {column}]" for signal, column in self.sensors)
        return summary_text(
            [f"StructureRecord {self.name}".rstrip() + f": {len(self)} samples every {self.sample_time:.4g} s"],
            {"sensors": names},
        )

    @property
    def signals(self) -> dict[str, FloatArray]:
        """The measured signals by name."""
        every = {name: vars(self)[name] for name in (*OF_NODES, *OF_ELEMENTS)}
        return {name: values for name, values in every.items() if values is not None}

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """Name of the signal, and the column, of each sensor that is there."""
        return tuple(
            (name, column)
            for name, values in self.signals.items()
            for column in range(values.shape[1])
            if not np.isnan(values[:, column]).any()
        )

    @property
    def sample_time(self) -> float:
        """Time between two samples [s]."""
        return even_step(self.t)


@checked
class SensorRecord(Record):
    """Outputs of several sensors one behind the other, each divided by its scale; the input as often."""

    sensors: Any = ()
    scales: tuple[float, ...] = ()
    sizes: tuple[float, ...] = field(default_factory=tuple)  # rms of each output

    @property
    def input(self) -> FloatArray:
        """The input once."""
        return self.u[: self.u.size // len(self.sensors)]

    def noise(self, residual: FloatArray) -> FloatArray:
        """Size of this residual (n,) at each sensor in its present units, shape (n_sensors,)."""
        errors = np.sqrt(np.mean(residual.reshape(len(self.sensors), -1) ** 2, axis=1))
        return np.asarray(np.maximum(errors, _LEAST * np.array(self.sizes) / np.array(self.scales)))

    def rescaled(self, residual: FloatArray) -> "SensorRecord":
        """The record in units of the noise that this residual (n,) shows of each sensor."""
        ratios = self.noise(residual)
        scales = tuple((np.array(self.scales) * ratios).tolist())
        return replace(self, y=self.y / np.repeat(ratios, self.input.size), scales=scales)


def laid(record: Record | StructureRecord, widths: Mapping[str, int], output: Sensor) -> SensorRecord:
    """One output of all sensors, each in units of its rms.

    `widths` are the numbers of columns that signals must have, `output` is the sensor of a plain record.

    Raises ValueError if a signal has another number of columns.
    """
    if isinstance(record, Record):
        outputs: list[FloatArray] = [record.y]
        sensors: tuple[Sensor, ...] = (output,)
    else:
        for name, values in record.signals.items():
            if values.shape[1] != widths[name]:
                what = "masses" if name in OF_NODES else "elements"
                raise ValueError(
                    f"{name} must have a column for each of the {widths[name]} {what}, got {values.shape[1]}; "
                    "fill the columns without a sensor with nan"
                )
        outputs, sensors = [record.signals[name][:, column] for name, column in record.sensors], record.sensors
    sizes = [float(np.sqrt(np.mean(y**2))) or 1.0 for y in outputs]
    n = len(record) * len(sensors)
    return SensorRecord(
        t=record.sample_time * np.arange(float(n)),
        u=np.tile(record.u, len(sensors)),
        y=np.concatenate([y / size for y, size in zip(outputs, sizes, strict=True)]),
        name=record.name,
        sensors=sensors,
        scales=tuple(sizes),
        sizes=tuple(sizes),
    )
