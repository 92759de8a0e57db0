"""A family of which some parameters are held by default."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from hysim.models.by_structure import ByStructure
from hysim.models.protocols import Identifiable, Staged
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.models.stages import Simpler, Stage
from hysim.records import Record


@dataclass(frozen=True)
class Holding(ByStructure):
    """A structure of which some parameters are held at values unless the user frees them."""

    structure: Identifiable
    values: Mapping[str, float]

    def as_structure(self) -> Identifiable:
        return self.structure

    @property
    def scalars(self) -> Mapping[str, float]:
        """Every parameter of a staged structure by name, with the values that are held."""
        return {**self.structure.scalars, **self.values} if isinstance(self.structure, Staged) else self.values

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages of the structure."""
        return self.structure.stages if isinstance(self.structure, Staged) else ()

    def simpler(self) -> Simpler | None:
        """The structure's simpler family, with the same parameters held."""
        simple = self.structure.simpler() if isinstance(self.structure, Staged) else None
        return simple and simple._replace(family=Holding(simple.family, simple.carried(self.values)))

    def rough(self) -> Identifiable:
        """The structure's rough law, with the same parameters held; itself where there is none."""
        rough = self.structure.rough() if isinstance(self.structure, Staged) else self.structure
        return self if rough is self.structure else replace(self, structure=rough)

    def close(self) -> Identifiable:
        """The structure's close law, with the same parameters held; itself where there is none."""
        close = self.structure.close() if isinstance(self.structure, Staged) else self.structure
        return self if close is self.structure else replace(self, structure=close)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        return self.structure.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))
