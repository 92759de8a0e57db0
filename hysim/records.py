"""Measured or simulated records: an input, an output, and what is known about them.

The sample axis is axis 0. A record never changes; a slice of it carries its units, resolution and name.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Self

import numpy as np

from hysim._frozen import FloatArray, checked


@checked
class Record:
    """An input-output record.

    Parameters
    ----------
    u : array, shape (n,)
        Input, for instance a voltage [``units["u"]``].
    y : array, shape (n,)
        Output, for instance a displacement [``units["y"]``].
    t : array, shape (n,), optional
        Strictly increasing times of the samples [``units["t"]``]; None where no time is known, which is
        enough for rate-independent laws.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``. They are carried along, not checked.
    resolution : float, optional
        Quantum of the output's sensor, in the unit of `y`.
    name : str, optional
        What the record is called in tables and figures.

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite or the time does not increase; the message names the sample.
    TypeError
        If the values are not numbers.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.Record(u=[0.0, 1.0, 0.0], y=[0.0, 0.9, 0.2], units={"u": "V", "y": "um"})
    >>> len(rec), rec[1:].u.tolist(), rec[1:].units["y"]
    (3, [1.0, 0.0], 'um')
    """

    u: FloatArray
    y: FloatArray
    t: FloatArray | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    resolution: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name in ("u", "y", "t"):
            values = getattr(self, name)
            if values is not None and values.ndim != 1:
                raise ValueError(f"{name} must have one axis, got shape {values.shape}")
        if self.u.size < 2:
            raise ValueError(f"a record needs at least 2 samples, got {self.u.size}")
        for name, values in (("y", self.y), ("t", self.t)):
            if values is not None and values.size != self.u.size:
                raise ValueError(f"u and {name} must have equal lengths, got {self.u.size} and {values.size}")
        if self.t is not None and not (np.diff(self.t) > 0).all():
            k = int(np.argmax(np.diff(self.t) <= 0)) + 1
            raise ValueError(
                f"time must increase from sample to sample, got {self.t[k]} after {self.t[k - 1]} at sample {k}"
            )
        if unknown := set(self.units) - {"t", "u", "y"}:
            raise ValueError(f'units are labels of "t", "u" and "y", got {sorted(unknown)}')
        if self.resolution is not None and self.resolution <= 0:
            raise ValueError(f"resolution must be positive, got {self.resolution}")

    def __len__(self) -> int:
        return self.u.size

    def __getitem__(self, samples: slice) -> Self:
        if not isinstance(samples, slice):
            raise TypeError(f"a record is cut by a slice, got {samples!r}; take single values from its arrays")
        return type(self)(
            u=self.u[samples],
            y=self.y[samples],
            t=None if self.t is None else self.t[samples],
            units=self.units,
            resolution=self.resolution,
            name=self.name,
        )

    @property
    def sample_time(self) -> float:
        """The constant step of the time [``units["t"]``].

        Raises
        ------
        ValueError
            If the record has no time, or its steps differ by more than 1e-6 of their mean.
        """
        if self.t is None:
            raise ValueError("the record has no time: give t, or use a rate-independent law")
        steps = np.diff(self.t)
        mean = float(steps.mean())
        if np.ptp(steps) > 1e-6 * mean:
            raise ValueError(
                f"the time must be evenly spaced, got steps from {steps.min()} to {steps.max()}: resample first"
            )
        return mean
