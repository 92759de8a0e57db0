"""The laws of an actuator with several inputs: one for each, side by side, and what stands for them in a search.

    w_i = law_i(u_i)        u_i is the record's input for the name "u", for others its channel of that name

`ModalGains` stands for them while the modes are searched: each input as it is, with a gain in each mode, which are
solved for. No record with a resonance shows a law alone, and a law is a line and little beside it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hysim._channels import value_in
from hysim._frozen import FloatArray, read_only
from hysim.laws.static import Line
from hysim.models.joint_space import declared, together, without_repetition
from hysim.models.parts import own
from hysim.models.protocols import Identifiable, Undecided
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

MAIN = "u"
"""Name of the input that every record has; the others are channels."""


@dataclass(frozen=True)
class InputSum(Identifiable):
    """Laws by the names of their inputs, in their order; their outputs are added."""

    laws: Mapping[str, Any]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The laws' spaces side by side; of offsets only the last is free."""
        seen = {name: seen_by(record, name) for name in self.laws}
        spaces = {name: lambda free, name=name: self.laws[name].search_space(seen[name], free) for name in self.laws}
        joint = together(declared(spaces, freedom))
        return without_repetition(joint, lambda x: self.regressors(joint.parameters(x), record)[..., :-1], {}, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The laws' columns one after the other, (n_sets, n_samples, n_columns + 1)."""
        return side_by_side(
            [law.regressors(own(parameters, name), seen_by(record, name)) for name, law in self.laws.items()]
        )

    def assemble(self, parameters: Mapping[str, float]) -> "InputSum":
        """The laws with these parameters."""
        return InputSum({name: law.assemble(own(parameters, name)) for name, law in self.laws.items()})

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The laws' memories after inputs that stood still at their first values."""
        found: dict[str, Any] = {}
        for name, law in self.laws.items():
            seen = seen_by(record, name)
            still = replace(seen, u=np.full(len(seen), seen.u[0]))
            found |= {f"{name}.{state}": value for state, value in law.steady(own(parameters, name), still).items()}
        return found

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """None: the laws are seen only through what is behind them."""
        return ()


@dataclass(frozen=True)
class ModalGains(Identifiable):
    """Inputs in place of their laws, each with a gain in each of so many modes, and one offset."""

    inputs: tuple[str, ...]
    modes: int

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """No coordinates: all parameters are linear."""
        columns = (*(self._name(k, name) for k in range(max(self.modes, 1)) for name in self.inputs), "offset")
        return SearchSpace.without_coordinates(columns)

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
        """Lines in place of the laws."""
        return InputSum({name: Line(slope=1.0) for name in self.inputs})

    def _name(self, k: int, name: str) -> str:
        return f"gains[{k}].{name}"


def checked_laws(laws: Mapping[str, Any]) -> InputSum:
    """Laws by name as `InputSum`; ValueError or TypeError if a name or a law is none."""
    if MAIN not in laws:
        names = ", ".join(map(repr, laws))
        raise ValueError(
            f'hysteresis must have a law for the input "{MAIN}" of the record, got laws for {names}: name one of them '
            f"{MAIN!r}, the others are channels of the record"
        )
    begun = {name: law() if isinstance(law, type) else law for name, law in laws.items()}
    for name, law in begun.items():
        if not isinstance(law, Identifiable):
            raise TypeError(f"hysteresis[{name!r}] must be a law that can be identified, got {type(law).__name__}")
    return InputSum({name: _widest(law) for name, law in begun.items()})


def _widest(law: Any) -> Any:
    """The law with the widest of its choices, such as weights of both signs: no loop of one input alone decides."""
    variants = law.variants() if isinstance(law, Undecided) else ()
    return variants[-1].family if variants else law


def seen_by(record: Record, name: str) -> Record:
    """The record with the input of this name as its input; ValueError if it has none."""
    if name == MAIN:
        return record
    values = value_in(record.channels, name, f"the record {record.name!r}" if record.name else "the record")
    return replace(record, u=read_only(np.broadcast_to(values, len(record))))


def side_by_side(blocks: Sequence[FloatArray]) -> FloatArray:
    """Blocks (n_sets or 1, n_samples, n_columns + 1) of columns and an output beside them, as one block."""
    n_sets = max(len(block) for block in blocks)
    joint = [np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks]
    beside = np.sum([block[..., -1:] for block in joint], axis=0)
    return np.concatenate([*(block[..., :-1] for block in joint), beside], axis=-1)
