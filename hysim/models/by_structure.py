"""Models that are identified by a structure of their own, beginning with their own values."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hysim._basics.frozen import FloatArray
from hysim.models.protocols import Numbered, Searched, Subject, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Simpler, Stage
from hysim.records import Record


class ByStructure(Searched, ABC):
    """A model that passes `hysim.identify` on to a structure."""

    @abstractmethod
    def as_structure(self) -> Subject:
        """The structure that is searched, beginning with this model."""

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        return self.as_structure().search_space(record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        return self.as_structure().regressors(parameters, record)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        return self.as_structure().steady(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return self.as_structure().assemble(parameters)

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        return self.as_structure().notes(record, model)

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        return self.as_structure().assumed_states(record)

    def variants(self) -> tuple[Variant, ...]:
        return self.as_structure().variants()

    def in_one_step(self) -> Any | None:
        return self.as_structure().in_one_step()

    def longer_past(self) -> Any | None:
        return self.as_structure().longer_past()

    def forgotten(self, record: Record, space: SearchSpace) -> int:
        return self.as_structure().forgotten(record, space)


@dataclass(frozen=True)
class Holding(ByStructure):
    """A structure that holds some parameters at values unless the user frees them."""

    structure: Any
    values: Mapping[str, float]

    def as_structure(self) -> Any:
        return self.structure

    @property
    def scalars(self) -> Mapping[str, float]:
        return {**(self.structure.scalars if isinstance(self.structure, Numbered) else {}), **self.values}

    def freed_in_turn(self) -> tuple[Stage, ...]:
        return tuple(self.structure.freed_in_turn())

    def simpler(self) -> Simpler | None:
        simple: Simpler | None = self.structure.simpler()
        return simple and simple._replace(family=Holding(simple.family, simple.carried(self.values)))

    def known_to(self, tolerance: float) -> Any:
        known = self.structure.known_to(tolerance)
        return self if known is self.structure else replace(self, structure=known)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        space: SearchSpace = self.structure.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))
        return space


@dataclass(frozen=True)
class _Foreign(ByStructure):
    """A subject of a user's own class, which says nothing of its search."""

    subject: Any

    assumed_states, variants, forgotten = Searched.assumed_states, Searched.variants, Searched.forgotten
    in_one_step, longer_past = Searched.in_one_step, Searched.longer_past

    def as_structure(self) -> Any:
        return self.subject


def searched(subject: Any) -> Any:
    """A subject of `identify` that says all of `Searched`."""
    return subject if isinstance(subject, Searched) else _Foreign(subject)
