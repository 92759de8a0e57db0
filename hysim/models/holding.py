"""A family of which some parameters are held by default."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from hysim.models.by_structure import ByStructure
from hysim.models.protocols import Identifiable
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.records import Record


@dataclass(frozen=True)
class Holding(ByStructure):
    """A structure of which some parameters are held at values unless the user frees them."""

    structure: Identifiable
    values: Mapping[str, float]

    def as_structure(self) -> Identifiable:
        return self.structure

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        return self.structure.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))
