"""The verb `simulate`: what a plant gives for an input in time."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._words import extent, printed, words
from hysim.models.protocols import needs_time
from hysim.records import Record


@printed
@frozen
class Simulation:
    """What was simulated.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    t : array, shape (n,), or None
        Times of the samples; None for a rate-independent law without a time.
    z : array, shape (n,), or None
        Memory of a law that has one.
    signals : mapping
        Every signal by its name, those above among them.
    units : mapping
        Labels of the units, by the signals' names.
    """

    u: FloatArray
    y: FloatArray
    t: FloatArray | None = None
    z: FloatArray | None = None
    signals: Mapping[str, FloatArray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        known = {"t": self.t, "u": self.u, "y": self.y, "z": self.z, **self.signals}
        return words(
            [f"Simulation: {self.u.size} samples"],
            {name: extent(values, self.units.get(name, "")) for name, values in known.items() if values is not None},
        )


def simulate(
    plant: Any, t: npt.ArrayLike | None, u: npt.ArrayLike, *, units: Mapping[str, str] | None = None
) -> Simulation:
    """Simulate a law or a plant, free running.

    Parameters
    ----------
    plant : model
        A law such as `hysim.BoucWen`, whose output does not depend on time, or a plant with dynamics, such as
        a `hysim.TransferFunction` or a `hysim.BoucWenOscillator`.
    t : array, shape (n,), or None
        Increasing times of the samples [s]; evenly spaced for a plant with dynamics. A law needs none.
    u : array, shape (n,)
        Input. A law takes it as linear between the samples, a plant with dynamics by its own `hold`.
    units : mapping, optional
        Labels to carry along.

    Returns
    -------
    Simulation

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, or a plant with dynamics is given no even time.
    SimulationError
        If the output leaves the finite numbers; the message names the sample.

    Examples
    --------
    >>> import hysim as hs
    >>> sim = hs.simulate(hs.BoucWen(), None, [0.0, 1.0, 0.0])
    >>> sim.y.round(6).tolist()
    [0.0, 0.632121, -0.307799]
    """
    if not callable(getattr(plant, "response", None)):
        raise TypeError(f"simulate takes a model with a response, got {type(plant).__name__}")
    inputs = read_only(u, "u", ndim=1)
    times = None if t is None else read_only(t, "t", ndim=1)
    own = _signals(plant, inputs, times)
    z = own["z"] if "z" in own else plant.memory(inputs) if callable(getattr(plant, "memory", None)) else None
    signals = {"t": times, "u": inputs, "z": z, **own}
    return Simulation(
        u=inputs,
        y=own["y"],
        t=times,
        z=z,
        signals={name: values for name, values in signals.items() if values is not None},
        units=units or {},
    )


def _signals(plant: Any, u: FloatArray, t: FloatArray | None) -> Mapping[str, FloatArray]:
    """The plant's own signals: its output at least."""
    time: tuple[float, ...] = ()
    if needs_time(plant):
        time = (Record(u=u, y=np.zeros_like(u), t=t).sample_time,)
    elif t is not None:
        Record(u=u, y=np.zeros_like(u), t=t)
    signals_of = getattr(plant, "signals", None)
    own: Mapping[str, FloatArray] = signals_of(u, *time) if signals_of else {"y": plant.response(u, *time)}
    return own
