"""Base class of sums and cascades of models."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.errors import warn_beyond
from hysim.models.by_structure import ByStructure
from hysim.models.composable import Composable
from hysim.models.inverse_search import inverse_at_rest, inverse_response
from hysim.models.parts import compiled_law, exchanged, labels, own
from hysim.models.protocols import CompiledLaw, Continuable, Numbered, Placeable, Startable, Stretched, needs_time

State = tuple[Any, ...]
"""The state of each member."""


class Composite(ByStructure, Composable):
    """Models that make one model: a law, rate-independent, unless one of them depends on time."""

    @property
    @abstractmethod
    def members(self) -> tuple[Any, ...]:
        """The models."""

    @abstractmethod
    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        """Output (n,) at the samples of `u` (n,), as each member takes it between them.

        Only what depends on time needs the `sample_time` [s]. Raises SimulationError if a member diverges, and
        ValueError if `u` is not finite or has not one axis, or no time is given where one is needed.
        """

    @abstractmethod
    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        """As `response`, continued from `state`, the states of the members, and the state after the last sample.

        The bits are those of one uncut input. Raises TypeError if a member cannot be continued.
        """

    @abstractmethod
    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        """As compiled loops take it, after a first sample at `u0`, or at rest there as far as it depends on time.

        Only what depends on time needs the `sample_time` [s], and raises ValueError without it; TypeError if a member
        cannot be stepped.
        """

    @abstractmethod
    def startable(self, sample_time: float | None = None) -> Startable:
        """As exports take it, from any first input; TypeError if a member cannot be stepped."""

    @property
    def u0(self) -> float | None:
        """Input at which the initial memories hold, that of the first member; None for the first sample."""
        return self.members[0].u0 if isinstance(self.members[0], Placeable) else None

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input of the record that the composite was identified on; None if unknown."""
        return self.members[0].u_range if isinstance(self.members[0], Placeable) else None

    @abstractmethod
    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> Any:
        """The composite with the initial memories at the input `u0`, as far as its members have such an input."""

    @property
    def dynamic(self) -> bool:
        """Whether a member depends on time."""
        return any(needs_time(member) for member in self.members)

    @property
    def memory_places(self) -> tuple[tuple[int, int], ...]:
        """First place and length of each stretch of the compiled state that is memory, member after member."""
        places: list[tuple[int, int]] = []
        end = 0
        for member in self.members:
            size = compiled_law(member, 0.0, None).state.size
            own = member.memory_places if isinstance(member, Stretched) else ((0, size),)
            for first, count in own:
                if places and sum(places[-1]) == end + first:
                    places[-1] = places[-1][0], places[-1][1] + count
                else:
                    places.append((end + first, count))
            end += size
        return tuple(places)

    @property
    def scalars(self) -> dict[str, float]:
        """Numbers of the members that have names for them, behind their labels, as in ``"bouc_wen.beta"``."""
        named = zip(labels(self.members), self.members, strict=True)
        return {
            f"{label}.{name}": value
            for label, member in named
            if isinstance(member, Numbered)
            for name, value in member.scalars.items()
        }

    def with_scalars(self, scalars: Mapping[str, float]) -> Any:
        """The composite with other numbers, by their names in `scalars`."""
        numbered = {
            label: member.with_scalars(others)
            for label, member in zip(labels(self.members), self.members, strict=True)
            if isinstance(member, Numbered) and (others := own(scalars, label))
        }
        return self.with_members(exchanged(self.members, numbered))

    @abstractmethod
    def with_members(self, members: tuple[Any, ...]) -> Any:
        """The composite of other members."""

    @property
    @abstractmethod
    def known_slopes(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input, as far as the members know theirs; else infinite."""

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None) -> FloatArray:
        """Input that gives the output `y`, monotone between the samples; see `hysim.Law.inverse_response`.

        It is computed by a bracket in compiled code. Raises TypeError if a member is not a law that can be stepped, and
        ValueError also if a member depends on time.
        """
        outputs = read_only(y, "y", ndim=1)
        if self.dynamic:
            raise ValueError("what moves in time has no inverse that depends on the output alone")
        if not outputs.size:
            return outputs
        u = inverse_response(inverse_at_rest(self, float(outputs[0]), self.u0 if u0 is None else u0), outputs)
        warn_beyond(self.u_range, u, type(self).__name__, stacklevel=3)
        return u


def continued(part: Any, u: FloatArray, sample_time: float | None, state: Any) -> tuple[FloatArray, Any]:
    """Output of a part from `state` on, None for its first sample, and the state after it."""
    if not isinstance(part, Continuable):
        raise TypeError(f"a {type(part).__name__} cannot be continued")
    time = {"sample_time": sample_time} if isinstance(part, Composite) or needs_time(part) else {}
    y, end = part.advance(u, state, **time)
    return np.asarray(y["y"] if isinstance(y, dict) else y), end


def known_slopes(members: tuple[Any, ...]) -> list[tuple[float, float]]:
    """Lowest and highest slope of each member, infinite where they are not known."""
    return [member.known_slopes if isinstance(member, Stretched) else (-math.inf, math.inf) for member in members]
