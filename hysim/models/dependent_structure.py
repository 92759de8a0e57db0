"""The search for a law whose parameters are polynomials of channels, on which `hysim.identify` calls.

A parameter that is searched has one coordinate for each place of its polynomial (`hysim.models.varying`), each
in the box and on the scale that the family gives the parameter; what its box depends on otherwise has the mean of
these coordinates. A polynomial whose values have one sign does not come nearer to zero between the places than a tenth
of the smallest: a law needs some of its parameters positive. A parameter in which the output is affine remains so,

    y = ... + p(T) c = ... + sum_k p_k l_k(T) c,

and its values are solved for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked
from hysim._basics.names import check_parameters
from hysim._columns.channels import value_in
from hysim.models.by_structure import searched
from hysim.models.protocols import Identifiable, Numbered, Subject, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Simpler, Stage
from hysim.models.varying import ChannelPolynomial, check_memory_is_its_own, columns_along, names_of, places, weights
from hysim.records import Record

_HALVINGS = 60
_SCREENED = 128  # random points beside starts, which are the ends of searches themselves
Places = Mapping[str, tuple[float, ...]]
"""Places of the polynomial by parameter."""

_NEAR_ZERO = 0.1  # of the smallest value at a place
_GRID = 33  # values of the channel at which a polynomial is looked at


def expanded(
    space: SearchSpace, names: Mapping[str, tuple[str, ...]], starts: Sequence[Mapping[str, float]] = ()
) -> SearchSpace:
    """The space with `names` of values in place of parameters, each in the parameter's box, and further `starts`."""
    if not names:
        return space
    own = [(k, name) for k, each in enumerate(space.coordinates) for name in names.get(each, (each,))]
    places = [k for k, _ in own]
    several = {each: [j for j, (k, _) in enumerate(own) if space.coordinates[k] == each] for each in names}
    several = {each: columns for each, columns in several.items() if columns}

    def base(x: FloatArray) -> FloatArray:
        """The law's own coordinates, the mean where there are several values."""
        columns = [x[:, np.equal(places, i)].mean(axis=1) for i in range(len(space.coordinates))]
        return np.stack(columns, axis=1) if columns else np.empty((len(x), 0))

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        sets = np.atleast_2d(x)
        middle = base(sets)
        values = dict(space.parameters(middle))
        for each, columns in several.items():
            del values[each]
            for name, j in zip(names[each], columns, strict=True):
                at_place = middle.copy()
                at_place[:, places[j]] = sets[:, j]
                values[name] = space.parameters(at_place)[each]
        return values

    def expanded_names(known: Sequence[str]) -> tuple[str, ...]:
        return tuple(name for each in known for name in names.get(each, (each,)))

    encode = _encoder(space)
    further = [
        [float(encode(_at_place(start, names, name))[k]) for k, name in own] for start in starts if space.coordinates
    ]
    known = space.at(
        places,
        coordinates=tuple(name for _, name in own),
        names=expanded_names(space.names),
        columns=expanded_names(space.columns),
        linear=expanded_names(space.linear),
        parameters=parameters,
        bounds={name: pair for each, pair in space.bounds.items() for name in names.get(each, (each,))},
        physical={name: pair for each, pair in space.physical.items() for name in names.get(each, (each,))},
        encoded=None,
        screened=_SCREENED if starts else space.screened,
    )
    return replace(known, starts=np.concatenate([np.reshape(further, (len(further), len(own))), known.starts]))


def _at_place(start: Mapping[str, float], names: Mapping[str, tuple[str, ...]], chosen: str) -> dict[str, float]:
    """The law's parameters of a start with the chosen value of one polynomial, and the means of the others."""
    known = {name: value for name, value in start.items() if not any(name in each for each in names.values())}
    for parameter, values in names.items():
        if values[0] in start:
            at = chosen if chosen in values else None
            known[parameter] = start[at] if at else float(np.mean([start[name] for name in values]))
    return known


def _encoder(space: SearchSpace) -> Callable[[Mapping[str, float]], FloatArray]:
    """A function from the law's parameters to its coordinates inside the box."""
    if space.encoded is not None:
        return space.encoded
    middle = space.starts[0] if len(space.starts) else 0.5 * (space.lower + space.upper)

    def encoded(parameters: Mapping[str, float]) -> FloatArray:
        x = middle.copy()
        for k, name in enumerate(space.coordinates):
            if name in parameters:
                x[k] = _coordinate(space, x, k, name, parameters[name])
        return x

    return encoded


def _coordinate(space: SearchSpace, x: FloatArray, k: int, name: str, value: float) -> float:
    """The coordinate of a parameter's value, by halving the box: each is a monotone function of its own coordinate."""

    def at(c: float) -> float:
        return float(np.ravel(space.parameters(np.where(np.arange(x.size) == k, c, x)[np.newaxis])[name])[0])

    low, high = float(space.lower[k]), float(space.upper[k])
    rises = at(high) >= at(low)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (at(middle) < value) == rises else (low, middle)
    return 0.5 * (low + high)


@checked
class DependentStructure(Subject):
    """A law to be identified, some of whose parameters depend on channels; see `hysim.Dependent.structure`."""

    law: Any
    depends: Mapping[str, tuple[str, int]]
    model: type
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # by parameter, once records are known
    columns: tuple[str, ...] = ()
    starts: tuple[Mapping[str, float], ...] = ()

    def __post_init__(self) -> None:
        law, depends = self.law, self.depends
        if isinstance(law, type) or not isinstance(law, Identifiable) or not searched(law).may_depend:
            raise TypeError(f"depends is for laws and sums of them, got {law!r}")
        if not depends:
            raise ValueError('depends names no parameter: give a mapping such as {"gain": ("T", 1)}')
        for name, pair in depends.items():
            if not isinstance(pair, tuple | list) or len(pair) != 2 or not isinstance(pair[0], str):
                raise TypeError(f'depends must hold (channel, degree) such as ("T", 1), got {pair!r} for {name!r}')
            if isinstance(pair[1], bool) or not isinstance(pair[1], int) or pair[1] < 0:
                raise ValueError(f"the degree must be a whole number from 0 on, got {pair[1]!r} for {name!r}")

    def over(self, records: Sequence[Record]) -> "DependentStructure":
        """The structure with places for the channels of these records; ValueError for unknown names or few values."""
        space = self.law.search_space(max(records, key=lambda record: float(np.ptp(record.u))))
        known, spans = (*space.names, *space.held), {}
        numbers = {name: [each for each in known if each.startswith(f"{name}[")] or [name] for name in self.depends}
        depends = {each: pair for name, pair in self.depends.items() for each in numbers[name]}
        check_parameters(known, depends=depends)
        for name, (channel, degree) in depends.items():
            if name in space.state:
                raise ValueError(f"{name!r} is the state at the first sample of a record, and depends on no channel")
            owners = [f"record {k}" if len(records) > 1 else "the record" for k in range(len(records))]
            values = [value_in(record.channels, channel, owner) for record, owner in zip(records, owners, strict=True)]
            different = np.unique(np.concatenate([np.ravel(each) for each in values]))
            if different.size <= degree:
                raise ValueError(
                    f"{name!r} of degree {degree} in {channel!r} needs {degree + 1} different values of the channel, "
                    f"the records have {different.size}"
                )
            spans[name] = (float(different[0]), float(different[-1]))
        structure = replace(self, depends=depends, spans=spans, columns=space.columns)
        for record in records:
            varying = [name for name in structure.at if name in space.columns and structure._channel(name, record).ndim]
            check_memory_is_its_own(self.law, varying, record)
        return structure

    @cached_property
    def at(self) -> Places:
        return {name: places(*self.spans[name], degree) for name, (_, degree) in self.depends.items() if degree}

    @cached_property
    def names(self) -> Mapping[str, tuple[str, ...]]:
        return {name: names_of(name, self.depends[name][0], at) for name, at in self.at.items()}

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The law's space with a coordinate, or a column, for each place of a polynomial."""
        for name in self.at:
            if name in freedom.fixed:
                raise ValueError(f"{name!r} is fixed and depends on {self.depends[name][0]!r}")
        space = self.law.search_space(record, freedom)
        wished = replace(freedom, free=(*freedom.free, *(name for name in self.at if name in space.held)))
        if jointly := [name for name in self.at if name not in {*space.coordinates, *space.columns, *wished.bounds}]:
            wished = replace(wished, bounds={**wished.bounds, **dict.fromkeys(jointly, (-np.inf, np.inf))})
        if wished != freedom:
            space = self._wished_space(record, wished, jointly)
        if missing := [name for name in self.at if name not in {*space.coordinates, *space.linear}]:
            raise ValueError(
                f"{missing[0]!r} is not searched by itself: give bounds={{{missing[0]!r}: (lower, upper)}}"
            )
        return expanded(space, self.names, self.starts)

    def _wished_space(self, record: Record, freedom: Freedom, jointly: Sequence[str]) -> SearchSpace:
        """The law's space with parameters that are not searched by themselves, or not at all, as coordinates."""
        try:
            space: SearchSpace = self.law.search_space(record, freedom)
        except ValueError as error:
            if not jointly:
                raise
            needed = f"bounds={{{jointly[0]!r}: (lower, upper)}}"
            raise ValueError(f"{jointly[0]!r} is not searched by itself: give {needed} ({error})") from None
        return space

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The law's columns at the record's channels, one for each place where a parameter is affine."""
        constant, varying, diverged = self._of_record(parameters, record)
        columns = columns_along(self.law, constant, varying, record)
        if diverged.any():
            columns = np.where(diverged[:, np.newaxis, np.newaxis], np.inf, columns)
        blocks = []
        for k, name in enumerate(self.columns):
            block = columns[..., k, np.newaxis]
            blocks.append(block * self._weights(name, record) if name in self.at else block)
        return np.concatenate([*blocks, columns[..., -1:]], axis=-1)

    def _of_record(
        self, parameters: Parameters, record: Record
    ) -> tuple[dict[str, Any], dict[str, FloatArray], npt.NDArray[np.bool_]]:
        """The law's parameters on a record: constant ones, those along it, and which sets come too near to zero."""
        of_places = {name for names in self.names.values() for name in names}
        constant = {name: value for name, value in parameters.items() if name not in of_places}
        varying: dict[str, FloatArray] = {}
        diverged = np.zeros(1, dtype=bool)
        for name, at in self.at.items():
            if name in self.columns:
                continue
            values = np.stack([np.atleast_1d(parameters[each]) for each in self.names[name]], axis=-1)
            is_near = _comes_near_zero(at, values)
            diverged = diverged | is_near
            values = np.where(is_near[:, np.newaxis], values.mean(axis=1, keepdims=True), values)
            along = values @ self._weights(name, record).T
            if self._channel(name, record).ndim:
                varying[name] = along
            else:
                constant[name] = along[:, 0]
        return constant, varying, diverged

    def _channel(self, name: str, record: Record) -> FloatArray:
        return np.asarray(value_in(record.channels, self.depends[name][0], "the record"))

    def _weights(self, name: str, record: Record) -> FloatArray:
        """Weights of the places (n_samples, n_places), or (1, n_places) where the channel is constant."""
        return np.atleast_2d(weights(self.at[name], self._channel(name, record)))

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the law's state in the steady cycle of a record; ValueError if a channel varies."""
        constant, varying, _ = self._of_record(parameters, record)
        if varying:
            raise ValueError(f'{next(iter(varying))} varies along the record, which has no steady cycle: use "free"')
        state = self.law.steady(constant, record)
        return {**parameters, **{name: value for name, value in state.items() if name not in self.at}}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        polynomials, rest = [], dict(parameters)
        for name, (channel, _) in self.depends.items():
            at = self.at.get(name, places(*self.spans[name], 0))
            values = tuple(rest.pop(each) for each in names_of(name, channel, at))
            polynomials.append(
                ChannelPolynomial(parameter=name, channel=channel, at=at, values=values, span=self.spans[name])
            )
        middle = {each.parameter: float(each.value(np.mean(each.span))) for each in polynomials}
        return self.model(law=self.law.assemble({**rest, **middle}), polynomials=tuple(polynomials))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Remarks on the law in the middle of the channels' ranges."""
        return tuple(self.law.notes(record, model.law))

    # ------------------------------------------------------------------------------ what the law says of its search

    @property
    def scalars(self) -> Mapping[str, float]:
        return dict(self.law.scalars) if isinstance(self.law, Numbered) else {}

    def freed_in_turn(self) -> tuple[Stage, ...]:
        """The law's stages if nothing depends on a channel, else empty."""
        return () if self.at else tuple(self.law.freed_in_turn())

    def simpler(self) -> Simpler | None:
        return None if self.at else self.law.simpler()

    def known_to(self, tolerance: float) -> "DependentStructure":
        return self._with(self.law.known_to(tolerance))

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        return tuple(self.law.assumed_states(record))

    def variants(self) -> tuple[Variant, ...]:
        return tuple(each._replace(family=self._with(each.family)) for each in self.law.variants())

    def _with(self, law: Any) -> "DependentStructure":
        return self if law is self.law else replace(self, law=law)


def _comes_near_zero(at: tuple[float, ...], values: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether polynomials with `values` (n_sets, n_places) of one sign nearly reach zero between them, (n_sets,)."""
    if len(at) < 3:
        return np.zeros(len(values), dtype=bool)
    between = values @ weights(at, np.linspace(at[0], at[-1], _GRID)).T
    sign = np.sign(values[:, 0])
    one_sign = (values * sign[:, np.newaxis] > 0.0).all(axis=1)
    least = _NEAR_ZERO * np.abs(values).min(axis=1)
    return np.asarray(one_sign & ((between * sign[:, np.newaxis]).min(axis=1) < least))
