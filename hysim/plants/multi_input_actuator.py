"""An actuator with several inputs and one output, such as one axis of a mirror on three piezos.

    y = sum_i y_i,        y_i the displacement that the input i makes: amplifier, law, creep and vibration of its own

What is behind the laws is linear, so that parts that the inputs have in common may stand behind each of them.

`InputSum` are its laws in a search, one for each input, w_i = law_i(u_i), where u_i is the record's input for the name
"u", for others its channel of that name. `ModalGains` stands for them while the modes are searched: each input as it
is, with a gain in each mode, which are solved for. No record with a resonance shows a law alone, and a law is a line
and little beside it. Of one input `Scaled` does, a law that is known but for its gain and offset.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._columns.channels import Channels, checked_channels, value_in
from hysim.laws.static import Line
from hysim.models import protocols as roles
from hysim.models.by_structure import searched
from hysim.models.dependent import AlongRecord
from hysim.models.joint_space import columns_beside, declared, together, without_repetition
from hysim.models.model import family
from hysim.models.parameters import space_of
from hysim.models.parts import check_parts, own, response_of
from hysim.models.protocols import Subject, first_input, input_range, law_at, needs_time, placed, with_law
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

MAIN = "u"
"""Name of the input that every record has; the others are channels."""


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
    ValueError, TypeError
        If lengths differ, a name is no text or occurs twice, ``"u"`` is not among them, or an actuator is no model.

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
        if len(set(names)) < len(names) or MAIN not in names:
            raise ValueError(f'inputs must be different names, "u" among them, got {", ".join(names)}')

    @property
    def u0(self) -> float | None:
        """Input ``"u"`` at which the memory of its law holds; None for the first sample."""
        return first_input(self._main)

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input ``"u"`` of the identified record; None if unknown."""
        return input_range(self._main)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "MultiInputActuator":
        """This model with the memory of the law of ``"u"`` at the input `u0`."""
        return self._with_main(placed(self._main, u0, u_range))

    @property
    def input_gain(self) -> float:
        """That of the actuator of ``"u"``."""
        return self._main.input_gain if isinstance(self._main, roles.Containing) else 1.0

    def with_law(self, changed: Callable[[Any], Any]) -> "MultiInputActuator":
        """This model with the law of ``"u"`` changed by a function."""
        return self._with_main(with_law(self._main, changed))

    @property
    def _main(self) -> Any:
        return self.actuators[self.inputs.index(MAIN)]

    def _with_main(self, actuator: Any) -> "MultiInputActuator":
        pairs = zip(self.inputs, self.actuators, strict=True)
        return replace(self, actuators=tuple(actuator if name == MAIN else each for name, each in pairs))

    @property
    def dynamic(self) -> bool:
        """True: `hysim.identify` and plots pass the sample time, which a response needs only if an actuator does."""
        return True

    def response(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, channels: Channels | None = None
    ) -> FloatArray:
        """Displacement (n,) at the samples of the inputs, each at rest at its first one.

        `u` (n,) is the input ``"u"``, `channels` are the others by name, each one number or (n,); further ones are
        ignored. Actuators that depend on time need the `sample_time` [s]. Raises ValueError if an input is missing, not
        finite or of another length, or no time is given where one is needed; SimulationError if an actuator diverges.
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
        input_of = {name: inputs if name == MAIN else value_in(others, name, "the input") for name in self.inputs}
        return {
            name: response_of(part, read_only(np.broadcast_to(input_of[name], inputs.shape)), sample_time)
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


@dataclass(frozen=True)
class InputSum(Subject):
    """Laws by the names of their inputs, in their order; their outputs are added."""

    laws: Mapping[str, Any]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The laws' spaces side by side; of offsets only the last is free."""
        spaces = {name: partial(law.search_space, seen_by(record, name)) for name, law in self.laws.items()}
        joint = together(declared(spaces, freedom))
        return without_repetition(joint, lambda x: self.regressors(joint.parameters(x), record)[..., :-1], {}, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        blocks = [law.regressors(own(parameters, name), seen_by(record, name)) for name, law in self.laws.items()]
        return columns_beside(blocks)

    def assemble(self, parameters: Mapping[str, float]) -> "InputSum":
        return InputSum({name: law.assemble(own(parameters, name)) for name, law in self.laws.items()})

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The laws' memories after inputs that stood still at their first values."""
        states: dict[str, Any] = {}
        for name, law in self.laws.items():
            law_record = seen_by(record, name)
            still = replace(law_record, u=np.full(len(law_record), law_record.u[0]))
            states |= {f"{name}.{state}": value for state, value in law.steady(own(parameters, name), still).items()}
        return states


@dataclass(frozen=True)
class ModalGains(Subject):
    """Inputs in place of their laws, each with a gain in each of so many modes, and one offset."""

    inputs: tuple[str, ...]
    modes: int

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        columns = (*(self._name(k, name) for k in range(max(self.modes, 1)) for name in self.inputs), "offset")
        return space_of((), columns, dict.fromkeys(columns, 0.0), {}, {})

    def shares(self, gains: Mapping[str, float]) -> dict[str, float]:
        """The gains of each input but in the first mode, relative to their sum, by mode and input."""
        sums = {name: sum(gains[self._name(k, name)] for k in range(self.modes)) for name in self.inputs}
        return {
            self._name(k, name): gains[self._name(k, name)] / (sums[name] or 1.0)
            for k in range(1, self.modes)
            for name in self.inputs
        }

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """One input in front of one mode, one, and zero, (1, n_samples, 3)."""
        return np.stack([record.u, np.ones(len(record)), np.zeros(len(record))], axis=-1)[np.newaxis]

    def assemble(self, parameters: Mapping[str, float]) -> InputSum:
        return InputSum({name: Line(slope=1.0) for name in self.inputs})

    def _name(self, k: int, name: str) -> str:
        return f"gains[{k}].{name}"


def checked_laws(laws: Mapping[str, Any]) -> InputSum:
    """Laws by name as `InputSum`; ValueError or TypeError if a name or a law is not valid."""
    if MAIN not in laws:
        names = ", ".join(map(repr, laws))
        raise ValueError(
            f'hysteresis must have a law for the input "{MAIN}" of the record, got laws for {names}: name one of them '
            f"{MAIN!r}, the others are channels of the record"
        )
    begun = {name: law() if isinstance(law, type) else law for name, law in laws.items()}
    for name, law in begun.items():
        if not isinstance(law, roles.Identifiable):
            raise TypeError(f"hysteresis[{name!r}] must be a law that can be identified, got {type(law).__name__}")
    return InputSum({name: _widest(law) for name, law in begun.items()})


def _widest(law: Any) -> Any:
    """The law with the widest of its choices, such as weights of both signs: no loop of one input alone decides."""
    variants = searched(law).variants()
    return variants[-1].family if variants else law


def seen_by(record: Record, name: str) -> Record:
    """The record with the input of this name as its input; ValueError if it has no such input."""
    if name == MAIN:
        return record
    values = value_in(record.channels, name, f"the record {record.name!r}" if record.name else "the record")
    return replace(record, u=read_only(np.broadcast_to(values, len(record))))


@dataclass(frozen=True)
class Scaled(Subject):
    """The output of `law`, or of None the input itself, times a gain, and an offset."""

    law: Any

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        return space_of((), ("gain", "offset"), {"gain": 0.0, "offset": 0.0}, {}, {})

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The law's output, one, and zero, (1, n_samples, 3)."""
        y = record.u
        if self.law is not None:
            law = law_at(self.law, record.sample_time) if needs_time(self.law) else self.law
            y = response_of(law, record.u, record.sample_time if needs_time(law) else None)
        return np.stack([y, np.ones_like(y), np.zeros_like(y)], axis=-1)[np.newaxis]

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return self.law
