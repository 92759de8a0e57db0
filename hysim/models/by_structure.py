"""Models that are identified by a structure of their own, beginning with their own values."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hysim._basics.frozen import FloatArray
from hysim.models.protocols import Forgetting, Identifiable, LongerPast, Staged, Undecided, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Simpler, Stage
from hysim.records import Record


class ByStructure(ABC):
    """A model that passes `hysim.identify` on to a structure."""

    @abstractmethod
    def as_structure(self) -> Identifiable:
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
        structure = self.as_structure()
        return structure.assumed_states(record) if isinstance(structure, Undecided) else ()

    def variants(self) -> tuple[Variant, ...]:
        structure = self.as_structure()
        return structure.variants() if isinstance(structure, Undecided) else ()

    def longer_past(self) -> Any | None:
        structure = self.as_structure()
        return structure.longer_past() if isinstance(structure, LongerPast) else None

    def forgotten(self, record: Record, space: SearchSpace) -> int:
        structure = self.as_structure()
        return structure.forgotten(record, space) if isinstance(structure, Forgetting) else len(record)


@dataclass(frozen=True)
class Holding(ByStructure):
    """A structure of which some parameters are held at values unless the user frees them."""

    structure: Identifiable
    values: Mapping[str, float]

    def as_structure(self) -> Identifiable:
        return self.structure

    @property
    def scalars(self) -> Mapping[str, float]:
        return {**self.structure.scalars, **self.values} if isinstance(self.structure, Staged) else self.values

    @property
    def stages(self) -> tuple[Stage, ...]:
        return self.structure.stages if isinstance(self.structure, Staged) else ()

    def simpler(self) -> Simpler | None:
        simple = self.structure.simpler() if isinstance(self.structure, Staged) else None
        return simple and simple._replace(family=Holding(simple.family, simple.carried(self.values)))

    def rough(self) -> Identifiable:
        rough = self.structure.rough() if isinstance(self.structure, Staged) else self.structure
        return self if rough is self.structure else replace(self, structure=rough)

    def close(self) -> Identifiable:
        close = self.structure.close() if isinstance(self.structure, Staged) else self.structure
        return self if close is self.structure else replace(self, structure=close)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        return self.structure.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))
