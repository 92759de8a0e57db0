"""An actuator with several inputs and one output, such as one axis of a mirror on three piezos.

    y = sum_i y_i,        y_i the displacement that the input i makes: amplifier, law, creep and vibration of its own

What is behind the laws is linear, so that parts that the inputs have in common may stand behind each of them.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._channels import Channels, checked_channels, value_in
from hysim._frozen import FloatArray, read_only
from hysim.models.dependent import AlongRecord
from hysim.models.model import family
from hysim.models.parts import check_parts, response_of
from hysim.models.protocols import Placeable, placed
from hysim.records import Record

_MAIN = "u"


@family
class MultiInputActuator:
    """An actuator with several inputs, whose displacements are added.

    Parameters
    ----------
    inputs : tuple of str
        Names of the inputs, each once: ``"u"`` is the input of a record, the others are its channels.
    actuators : tuple of models
        For each input an `Actuator`, or another model with a response; their sensors are not read.

    Raises
    ------
    ValueError
        If lengths differ, a name occurs twice, or ``"u"`` is not among them.
    TypeError
        If a name is no text, or an actuator is not a model with a response.

    See Also
    --------
    hysim.Actuator.structure : What `hysim.identify` takes.

    Examples
    --------
    >>> import hysim as hs
    >>> first = hs.Actuator(hysteresis=hs.Play(threshold=0.5))
    >>> stage = hs.MultiInputActuator(inputs=("u", "u2"), actuators=(first, hs.Line(slope=2.0)))
    >>> stage.response([0.0, 1.0, 0.0], channels={"u2": [0.0, 0.0, 1.0]}).tolist()
    [0.0, 0.5, 2.5]
    """

    inputs: tuple[str, ...]
    actuators: tuple[Any, ...]

    def __post_init__(self) -> None:
        names = tuple(self.inputs)
        if not all(isinstance(name, str) for name in names):
            raise TypeError(f"inputs must be names, got {names!r}")
        object.__setattr__(self, "inputs", names)
        object.__setattr__(self, "actuators", check_parts(self.actuators, "actuators"))
        if len(names) != len(self.actuators):
            raise ValueError(f"each input needs an actuator, got {len(names)} inputs and {len(self.actuators)}")
        if len(set(names)) < len(names) or _MAIN not in names:
            raise ValueError(f'inputs must be different names, "u" among them, got {", ".join(names)}')

    @property
    def u0(self) -> float | None:
        """Input ``"u"`` at which the memory of its law holds; None for the first sample."""
        main = self.actuators[self.inputs.index(_MAIN)]
        return main.u0 if isinstance(main, Placeable) else None

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input ``"u"`` of the identified record; None if unknown."""
        main = self.actuators[self.inputs.index(_MAIN)]
        return main.u_range if isinstance(main, Placeable) else None

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "MultiInputActuator":
        """This model with the memory of the law of ``"u"`` at the input `u0`."""
        pairs = zip(self.inputs, self.actuators, strict=True)
        actuators = [placed(each, u0, u_range) if name == _MAIN else each for name, each in pairs]
        return replace(self, actuators=tuple(actuators))

    @property
    def dynamic(self) -> bool:
        """True: `hysim.identify` and plots pass the sample time, which a response needs only if an actuator does."""
        return True

    def response(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, channels: Channels | None = None
    ) -> FloatArray:
        """Displacement at the samples of the inputs, each at rest at its first one.

        Parameters
        ----------
        u : array, shape (n,)
            The input ``"u"``.
        sample_time : float, optional
            Time between two samples [s]; actuators that do not depend on time need none.
        channels : mapping
            The other inputs by their names, each one number or of shape (n,); further channels are ignored.

        Returns
        -------
        array, shape (n,)

        Raises
        ------
        ValueError
            If an input is missing, not finite or of another length, or no time is given where one is needed.
        SimulationError
            If an actuator diverges.
        """
        return np.asarray(np.sum([*self.contributions(u, sample_time, channels=channels).values()], axis=0))

    def contributions(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, channels: Channels | None = None
    ) -> dict[str, FloatArray]:
        """The displacement that each input makes, by its name, shape (n,); arguments and errors as of `response`.

        Examples
        --------
        >>> import hysim as hs
        >>> stage = hs.MultiInputActuator(inputs=("u", "u2"), actuators=(hs.Line(slope=1.0), hs.Line(slope=2.0)))
        >>> {name: y.tolist() for name, y in stage.contributions([1.0, 2.0], channels={"u2": 3.0}).items()}
        {'u': [1.0, 2.0], 'u2': [6.0, 6.0]}
        """
        inputs = read_only(u, "u", ndim=1)
        others = checked_channels(channels or {}, inputs.size)
        seen = {name: inputs if name == _MAIN else value_in(others, name, "the input") for name in self.inputs}
        return {
            name: response_of(part, read_only(np.broadcast_to(seen[name], inputs.shape)), sample_time)
            for name, part in zip(self.inputs, self.actuators, strict=True)
        }

    def on(self, record: Record) -> AlongRecord:
        """The actuator of the record's input alone, its other inputs those of the record."""
        return AlongRecord(self, record)

    def response_of(self, record: Record) -> FloatArray:
        """Displacement (n,) for the inputs of a record, its channels among them; errors as of `response`.

        Examples
        --------
        >>> import hysim as hs
        >>> stage = hs.MultiInputActuator(inputs=("u", "u2"), actuators=(hs.Line(slope=1.0), hs.Line(slope=2.0)))
        >>> stage.response_of(hs.Record(u=[0.0, 1.0], y=[0.0, 0.0], channels={"u2": [0.0, 0.5]})).tolist()
        [0.0, 2.0]
        """
        step = None if record.t is None else record.sample_time
        return self.response(record.u, step, channels=record.channels)
