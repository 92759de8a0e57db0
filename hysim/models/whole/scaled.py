"""A law that is known but for its gain and offset, for the search of what stands behind it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.parts import response_of
from hysim.models.protocols import Identifiable, law_at, needs_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

_COLUMNS = ("gain", "offset")


@dataclass(frozen=True)
class Scaled(Identifiable):
    """The output of `law`, or of None the input itself, times a gain, and an offset."""

    law: Any

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """No coordinates: both parameters are linear."""
        return SearchSpace.without_coordinates(_COLUMNS)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The law's output, one, and zero, (1, n_samples, 3)."""
        y = record.u if self.law is None else self._response(record)
        return np.stack([y, np.ones_like(y), np.zeros_like(y)], axis=-1)[np.newaxis]

    def _response(self, record: Record) -> FloatArray:
        law = law_at(self.law, record.sample_time) if needs_time(self.law) else self.law
        return response_of(law, record.u, record.sample_time if needs_time(law) else None)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The law itself."""
        return self.law
