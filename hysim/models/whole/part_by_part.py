"""The role of a plant that is identified part by part before all parts are searched at once."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

from hysim._frozen import FloatArray
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


class Doubt(NamedTuple):
    """A parameter that records may not determine, and what is to be done then.

    It is not determined if its standard error is above `largest`, or unknown; the plant is then searched `without` it,
    of which the remarks of that plant tell.
    """

    name: str
    largest: float
    without: Any


@runtime_checkable
class PartByPart(Protocol):
    """A subject of `identify` with a law, and parts behind and before it that move in time."""

    law: Any
    """The law, which is searched alone on one record at first."""

    def over(self, records: Sequence[Record], freedom: Freedom) -> tuple[Self, Sequence[Record]]:
        """The plant for these records, and the records as its sensor has them; ValueError if they do not fit it."""

    @property
    def noise(self) -> str:
        """The noise that its sensor makes, as `identify` names it."""

    @property
    def slowest(self) -> int:
        """The record on which the law is searched alone."""

    @property
    def fastest(self) -> int:
        """The record on which the parts that grow are searched."""

    def static(self, record: Record) -> Record:
        """The record as the law sees it where nothing takes time."""

    def with_law(self, law: Any) -> Self:
        """The plant with another law, or another start of it."""

    inputs: tuple[str, ...]
    """Names of its inputs, each with a law."""

    def behind(self, law: Any) -> Self:
        """The plant behind a law that is known but for its gain, or behind its inputs as they are."""

    def solved(self, estimates: Mapping[str, float]) -> Mapping[str, float]:
        """Coordinates by name of what was solved for behind the inputs as they are, and is a coordinate behind laws."""

    def begins(self) -> Mapping[str, float] | None:
        """Coordinates of the parts that grow, where the user lets the search begin at them; else None."""

    @property
    def names(self) -> frozenset[str]:
        """Names of the parameters of the parts beside the law."""

    def growing(self) -> Sequence[Self]:
        """The plant with more and more of its parts but for slow ones; each contains the one before."""

    def points(self, space: SearchSpace, known: Sequence[Mapping[str, float]]) -> FloatArray:
        """Points of a space of this plant, spread over its last part, beside coordinates `known` of a smaller one."""

    def finer(self, space: SearchSpace, best: FloatArray) -> FloatArray:
        """Points about the best of `points`, and these."""

    def beyond(self, space: SearchSpace, end: FloatArray) -> FloatArray:
        """The end (1, n_x) of a descent that may rest too early, and points (n, n_x) from which others may go on."""

    def trials(self) -> Sequence[Self]:
        """The plant with each value of what no descent finds; itself alone where there is nothing of the kind."""

    def begun(self, starts: Sequence[Mapping[str, float]]) -> Self:
        """The plant with a search that begins at these coordinates by name."""

    def smaller(self, freedom: Freedom) -> tuple[Self, str] | None:
        """The plant without its last part that the user does not insist on, and a remark that says so."""

    def doubts(self, estimates: Mapping[str, float], freedom: Freedom) -> Sequence[Doubt]:
        """Parameters that the records may not determine at these values of all parameters."""

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """As of `Identifiable`."""

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """As of `Identifiable`."""
