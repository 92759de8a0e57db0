"""A family of which some parameters are held by default."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hysim._frozen import FloatArray
from hysim.models.protocols import Identifiable
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


@dataclass(frozen=True)
class Holding:
    """Something identifiable, some of its parameters held at values unless the user says more of them."""

    whole: Identifiable
    values: Mapping[str, float]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """That of the whole, in less space."""
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        return self.whole.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Those of the whole."""
        return self.whole.regressors(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The model from the user's parameters."""
        return self.whole.assemble(parameters)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """Initial memory with which a periodic record ends as it began."""
        return self.whole.steady(parameters, record)

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Remarks on the identified model."""
        return self.whole.notes(record, model)
