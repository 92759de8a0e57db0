"""Models side by side under one input, and the base class of compositions; the parts' search spaces are joined."""

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked, items, read_only
from hysim.errors import warn_beyond
from hysim.kernels.stepping import side_by_side
from hysim.models import protocols as roles
from hysim.models.by_structure import ByStructure
from hysim.models.compiled_step import startable
from hysim.models.composable import Composable
from hysim.models.inverse_search import inverse_at_rest, inverse_response
from hysim.models.joint_space import (
    columns_beside,
    combined_variants,
    common_states,
    declared,
    together,
    without_repetition,
)
from hysim.models.model import family, not_offered
from hysim.models.parts import (
    check_parts,
    checked_tuple,
    compiled_law,
    compiled_pair,
    exchanged,
    labelled,
    labels,
    own,
    response_of,
    startable_pair,
)
from hysim.models.protocols import (
    CompiledLaw,
    Startable,
    Subject,
    Variant,
    first_input,
    input_range,
    needs_time,
    placed,
)
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[Any, ...]
"""The state of each member."""
Driven = Callable[[FloatArray], FloatArray]
"""Output of a member for its input."""


class Composite(ByStructure, Composable):
    """Models that make one model: a law, rate-independent, unless one of them depends on time."""

    members_are: ClassVar[str]
    """Name of the field with the models."""

    def __post_init__(self) -> None:
        object.__setattr__(self, self.members_are, check_parts(self.members, self.members_are))

    candidates = not_offered  # a composite has the members that it is given

    @property
    def members(self) -> tuple[Any, ...]:
        members: tuple[Any, ...] = vars(self)[self.members_are]
        return members

    @abstractmethod
    def _driven(self, u: FloatArray, members: Sequence[Driven]) -> tuple[FloatArray, list[FloatArray]]:
        """The output for an input, and those of the members, each by a function of the member's own input."""

    def _responses(self, u: npt.ArrayLike, sample_time: float | None) -> tuple[FloatArray, list[FloatArray]]:
        members = [partial(response_of, member, sample_time=sample_time) for member in self.members]
        return self._driven(read_only(u, "u", ndim=1), members)

    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        """Output (n,) at the samples of `u` (n,), as each member takes it between them.

        Only what depends on time needs the `sample_time` [s]. Raises SimulationError if a member diverges, and
        ValueError if `u` is not finite or has not one axis, or no time is given where one is needed.
        """
        return self._responses(u, sample_time)[0]

    def signals(self, u: npt.ArrayLike, sample_time: float | None = None) -> dict[str, FloatArray]:
        """Output ``"y"`` and those of the members by name, such as ``"bouc_wen"``; see `response`."""
        y, outputs = self._responses(u, sample_time)
        return {"y": y, **dict(zip(labels(self.members), outputs, strict=True))}

    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        """As `response`, continued from the members' `state`, and the state after it; TypeError if one cannot be."""
        inputs = read_only(u, "u", ndim=1)
        states: State = (None,) * len(self.members) if state is None else state
        if not inputs.size:
            return inputs, states
        ends: list[Any] = []

        def follow(member: Any, begin: Any, v: FloatArray) -> FloatArray:
            y, end = continued(member, v, sample_time, begin)
            ends.append(end)
            return y

        members = [partial(follow, *each) for each in zip(self.members, states, strict=True)]
        return self._driven(inputs, members)[0], tuple(ends)

    @abstractmethod
    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        """As compiled loops take it, after a first sample at `u0`, or at rest there as far as it depends on time.

        Only what depends on time needs `sample_time` [s], else ValueError; TypeError if a member cannot be stepped.
        """

    @abstractmethod
    def startable(self, sample_time: float | None = None) -> Startable:
        """As exports take it, from any first input; TypeError if a member cannot be stepped."""

    @property
    def u0(self) -> float | None:
        """Input at which the initial memories hold, that of the first member; None for the first sample."""
        return first_input(self.members[0])

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input of the record that the composite was identified on; None if unknown."""
        return input_range(self.members[0])

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
            own = member.memory_places if isinstance(member, roles.Stretched) else ((0, size),)
            for first, count in own:
                if places and sum(places[-1]) == end + first:
                    places[-1] = places[-1][0], places[-1][1] + count
                else:
                    places.append((end + first, count))
            end += size
        return tuple(places)

    @property
    def scalars(self) -> dict[str, float]:
        """Numbers of the members that have names for them, with the label first, as in ``"bouc_wen.beta"``."""
        return {
            f"{label}.{name}": value
            for label, member in labelled(self.members).items()
            if isinstance(member, roles.Numbered)
            for name, value in member.scalars.items()
        }

    def with_scalars(self, scalars: Mapping[str, float]) -> Any:
        """The composite with other numbers, by their names in `scalars`."""
        numbered = {
            label: member.with_scalars(others)
            for label, member in labelled(self.members).items()
            if isinstance(member, roles.Numbered) and (others := own(scalars, label))
        }
        family: Any = type(self)
        return family(**{self.members_are: exchanged(self.members, numbered)})

    @property
    @abstractmethod
    def known_slopes(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input, as far as the members know theirs; else infinite."""

    @property
    def output_bounds(self) -> tuple[float, float]:
        """Lowest and highest output, which are not known."""
        return -math.inf, math.inf

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
    if not isinstance(part, roles.Continuable):
        raise TypeError(f"a {type(part).__name__} cannot be continued")
    time = {"sample_time": sample_time} if isinstance(part, Composite) or needs_time(part) else {}
    y, end = part.advance(u, state, **time)
    return np.asarray(y["y"] if isinstance(y, dict) else y), end


def known_slopes(members: tuple[Any, ...]) -> list[tuple[float, float]]:
    """Lowest and highest slope of each member, infinite where they are not known."""
    return [member.known_slopes if isinstance(member, roles.Stretched) else (-math.inf, math.inf) for member in members]


def started(parts: Any, what: str) -> tuple[Any, ...]:
    """Models and structures as a tuple, of a class the model with its defaults."""
    members = tuple(part() if isinstance(part, type) else part for part in checked_tuple(parts, what))
    for member in members:
        if not isinstance(member, roles.Identifiable | roles.Responding):
            raise TypeError(f"{what} must hold models or structures, got {type(member).__name__}")
    return members


def time_of(part: Any, record: Record) -> float | None:
    return record.sample_time if needs_time(part) else None


def assembled(members: Sequence[Any], searched: Mapping[str, Any], parameters: Parameters) -> tuple[Any, ...]:
    return tuple(
        searched[label].assemble(own(parameters, label)) if label in searched else part
        for label, part in labelled(members).items()
    )


@checked
class SumStructure(Subject, Composable):
    """Parts to be identified side by side; see `hysim.Sum.structure`."""

    parts: tuple[Any, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", started(self.parts, "parts"))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The parts' spaces side by side; of columns that repeat each other one is free."""
        spaces = {label: partial(part.search_space, record) for label, part in self._identified.items()}
        joint = together(declared(spaces, freedom))
        values = self._values(joint.columns)
        return without_repetition(
            joint, lambda x: self.regressors(joint.parameters(x), record)[..., :-1], values, freedom
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        identified = self._identified
        known = [part for part in self.parts if not isinstance(part, roles.Identifiable)]
        fixed = sum((response_of(part, record.u, time_of(part, record)) for part in known), np.zeros(len(record)))
        blocks = [part.regressors(own(parameters, label), record) for label, part in identified.items()]
        return columns_beside(blocks, fixed[np.newaxis, :, np.newaxis])

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        states: dict[str, Any] = {}
        moving = record if np.ptp(record.u) else replace(record, u=record.u + np.arange(len(record)))
        for label, part in self._identified.items():
            if part.search_space(moving).state:  # which does not depend on how the input moves, but needs it to
                try:
                    states_of_part = part.steady(own(parameters, label), record)
                except ValueError as error:
                    raise ValueError(f"{label}: {error}") from None
                states |= {f"{label}.{name}": value for name, value in states_of_part.items()}
        return {**parameters, **states}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return Sum(parts=assembled(self.parts, self._identified, parameters))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        return tuple(
            f"{label}: {note}"
            for label, part, fitted in zip(labels(self.parts), self.parts, model.parts, strict=True)
            if isinstance(part, roles.Identifiable) and not needs_time(fitted)
            for note in part.notes(record, fitted)
        )

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        return common_states(self._identified, record)

    def variants(self) -> tuple[Variant, ...]:
        return combined_variants(self._identified, lambda others: replace(self, parts=exchanged(self.parts, others)))

    @property
    def _identified(self) -> dict[str, roles.Identifiable]:
        return {label: part for label, part in labelled(self.parts).items() if isinstance(part, roles.Identifiable)}

    def _values(self, columns: Sequence[str]) -> dict[str, float]:
        return {
            f"{label}.{name}": value
            for label, part in self._identified.items()
            for name in own(dict.fromkeys(columns), label)
            if isinstance(value := items(part).get(name), float)
        }


@family
class Sum(Composite):
    """Models side by side, whose outputs are added; ``first + second`` is short for it.

    Magnetorheological dampers are a Bouc-Wen law, a dashpot and a spring (Spencer et al., J. Eng. Mech. 123, 1997).

    Parameters
    ----------
    parts : tuple of models
        Laws, such as `BoucWen` or `Line`, and plants that depend on time, such as `Dashpot` or `TransferFunction`.

    Raises
    ------
    TypeError, ValueError
        If a part is not a model with a response, or the sum is empty.

    Examples
    --------
    >>> import hysim as hs
    >>> damper = hs.BoucWen() + hs.Dashpot(c=2.0)
    >>> damper.response([0.0, 1.0, 1.0], sample_time=0.5).round(6).tolist()
    [0.0, 4.632121, 0.632121]
    """

    parts: tuple[Any, ...]

    members_are: ClassVar[str] = "parts"

    @classmethod
    def structure(cls, *parts: Any) -> SumStructure:
        """Parts for `hysim.identify` and `hysim.compare`: classes, structures, and models as starts.

        A model that cannot be identified is taken as it is.

        Examples
        --------
        >>> import hysim as hs
        >>> fit = hs.identify(hs.Sum.structure(hs.Play, hs.Line), hs.datasets.table1())
        >>> fit.free_names
        ('play.threshold', 'play.gain', 'play.z0', 'line.offset', 'line.slope')
        """
        return SumStructure(parts=parts)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Sum":
        return Sum(parts=tuple(placed(part, u0, u_range) for part in self.parts))

    def _driven(self, u: FloatArray, members: Sequence[Driven]) -> tuple[FloatArray, list[FloatArray]]:
        outputs = [member(u) for member in members]
        return np.asarray(reduce(np.add, outputs)), outputs

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        laws = [compiled_law(part, u0, sample_time) for part in self.parts]
        return reduce(lambda first, second: compiled_pair(side_by_side, first, second), laws)

    def startable(self, sample_time: float | None = None) -> Startable:
        parts = [startable(part, sample_time) for part in self.parts]
        return reduce(lambda first, second: startable_pair(side_by_side, first, second), parts)

    @property
    def known_slopes(self) -> tuple[float, float]:
        lowest, highest = map(sum, zip(*known_slopes(self.parts), strict=True))
        return lowest, highest

    def as_structure(self) -> SumStructure:
        """The structure of the same members, those that can be identified as starts."""
        return SumStructure(parts=self.parts)
