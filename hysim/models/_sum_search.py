"""The search for the parameters of a sum: the parts' own spaces side by side.

What is linear in a part is linear in the sum. A part that cannot be identified adds an output that is known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, checked, items
from hysim.models.composable import Composable, composed
from hysim.models.joint_space import combined_variants, common_states, declared, together, without_repetition
from hysim.models.parts import checked_tuple, exchanged, labels, own, response_of
from hysim.models.protocols import Identifiable, Responding, Variant, needs_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


def started(parts: Any, what: str) -> tuple[Any, ...]:
    """Models and structures as a tuple, of a class the model with its defaults."""
    members = tuple(part() if isinstance(part, type) else part for part in checked_tuple(parts, what))
    for member in members:
        if not isinstance(member, Identifiable | Responding):
            raise TypeError(f"{what} must hold models or structures, got {type(member).__name__}")
    return members


def time_of(part: Any, record: Record) -> float | None:
    """The sample time where the part needs one."""
    return record.sample_time if needs_time(part) else None


def assembled(members: Sequence[Any], searched: Mapping[str, Any], parameters: Parameters) -> tuple[Any, ...]:
    """The models of the members, those that are searched by their labels with their parameters."""
    parts = zip(labels(members), members, strict=True)
    return tuple(
        searched[label].assemble(own(parameters, label)) if label in searched else part for label, part in parts
    )


@checked
class SumStructure(Identifiable, Composable):
    """Parts to be identified side by side; see `hysim.Sum.structure`."""

    parts: tuple[Any, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", started(self.parts, "parts"))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The parts' spaces side by side; of columns that repeat each other one is free."""
        found = self._identified
        spaces = declared(
            {label: lambda free, part=part: part.search_space(record, free) for label, part in found.items()},  # type: ignore[misc]
            freedom,
        )
        joint = together(spaces)
        return without_repetition(
            joint,
            lambda x: self.regressors(joint.parameters(x), record)[..., :-1],
            self._values(joint.columns),
            freedom,
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The parts' columns one after the other, and the sum of what is known."""
        found = self._identified
        known = [part for part in self.parts if not isinstance(part, Identifiable)]
        fixed = sum((response_of(part, record.u, time_of(part, record)) for part in known), np.zeros(len(record)))
        blocks = [part.regressors(own(parameters, label), record) for label, part in found.items()]
        n_sets = max([len(block) for block in blocks], default=1)
        joint = [np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks]
        last = sum((block[..., -1:] for block in joint), np.broadcast_to(fixed[:, np.newaxis], (n_sets, fixed.size, 1)))
        return np.concatenate([*(block[..., :-1] for block in joint), last], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the parts' states in the steady cycle of which `record` is one period or more."""
        states: dict[str, Any] = {}
        moving = record if np.ptp(record.u) else replace(record, u=record.u + np.arange(len(record)))
        for label, part in self._identified.items():
            if part.search_space(moving).state:  # which does not depend on how the input moves, but needs it to
                try:
                    found = part.steady(own(parameters, label), record)
                except ValueError as error:
                    raise ValueError(f"{label}: {error}") from None
                states |= {f"{label}.{name}": value for name, value in found.items()}
        return {**parameters, **states}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The sum with these parameters."""
        return composed("+", assembled(self.parts, self._identified, parameters))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Remarks of the laws among the parts."""
        return tuple(
            f"{label}: {note}"
            for label, part, found in zip(labels(self.parts), self.parts, model.parts, strict=True)
            if isinstance(part, Identifiable) and not needs_time(found)
            for note in part.notes(record, found)
        )

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """The states that all parts with a memory leave to the record."""
        return common_states(self._identified, record)

    def variants(self) -> tuple[Variant, ...]:
        """The choices of the parts, in every combination."""
        return combined_variants(self._identified, lambda others: replace(self, parts=exchanged(self.parts, others)))

    @property
    def _identified(self) -> dict[str, Identifiable]:
        return {
            label: part
            for label, part in zip(labels(self.parts), self.parts, strict=True)
            if isinstance(part, Identifiable)
        }

    def _values(self, columns: Sequence[str]) -> dict[str, float]:
        """The numbers that models have for linear parameters of theirs."""
        return {
            f"{label}.{name}": value
            for label, part in self._identified.items()
            for name in own(dict.fromkeys(columns), label)
            if isinstance(value := items(part).get(name), float)
        }
