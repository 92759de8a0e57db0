"""Parameters as data: where a family's parameters are searched, and one machine that makes the search box of it.

A parameter is searched in units of the record's spans, so that one box fits a record in any units; or the output is
affine in it, and it is solved for; or it is neither, and held.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.names import meant
from hysim.models.search_space import Freedom, SearchSpace
from hysim.models.tables import scalars_of
from hysim.records import Record, span_of

Numbers = Mapping[str, float]
Box = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Parameter:
    """The treatment of a field of a family by `hysim.identify`.

    `lower` and `upper` are the box in units of `unit`: a quotient of the spans of input and output such as ``"y/u"``;
    ``"h"`` is half the span of the input. A quotient of two other parameters stands for their values in the law: the
    box of ``"breakaway/sigma0"`` moves with both. The box of a parameter with `from_first` stands about the first
    input, and one with `log` is searched on a log scale. The output is affine in an `affine` parameter, which needs no
    box. `physical` says whether the lower and the upper side of the box is a limit of physics or of the law: the search
    is not stopped there, as it is at other sides. Of an affine parameter only such a side counts.
    """

    name: str
    lower: float = -np.inf
    upper: float = np.inf
    unit: str = "1"
    log: bool = False
    from_first: bool = False
    affine: bool = False
    physical: tuple[bool, bool] = (False, False)

    def physical_sides(self, units: Mapping[str, float]) -> tuple[float, float]:
        """Lower and upper side in these units, infinite where it is no limit of physics."""
        (lower, upper), unit = self.physical, unit_of(self.unit, units)
        return self.lower * unit if lower else -np.inf, self.upper * unit if upper else np.inf


def affine(*names: str, unit: str = "1") -> tuple[Parameter, ...]:
    """Fields of one unit in which the output is affine."""
    return tuple(Parameter(name, unit=unit, affine=True) for name in names)


_ROUNDING = 1e-14  # of a number by way of its logarithm


class Coordinate(NamedTuple):
    """A number in its box: searched as a multiple of `scale`, or as the logarithm of one.

    `physical` is that of a `Parameter`, and `drawn` the part of the box from which random points are drawn.
    """

    name: str
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0
    log: bool = False
    physical: tuple[bool, bool] = (False, False)
    drawn: tuple[float, float] | None = None

    def encode(self, values: Any) -> Any:
        """Coordinates of values, those outside the box at its side."""
        inside = np.clip(values, self.lower, self.upper) / self.scale
        return np.log(inside) if self.log else inside

    def decode(self, x: FloatArray) -> FloatArray:
        """Values of coordinates; a value at a bound is exactly the bound, without the rounding of its logarithm."""
        if not self.log:
            return x * self.scale
        values = np.exp(x) * self.scale
        for side in (self.lower, self.upper):
            values = np.where(np.abs(values - side) <= _ROUNDING * side, side, values)
        return np.asarray(values)

    def holding(self, value: float) -> "Coordinate":
        """The coordinate in a box that holds a value, where that is one of a law."""
        if self.log and not value > 0.0:
            return self
        return self._replace(lower=min(self.lower, value), upper=max(self.upper, value))

    def within(self, lower: float, upper: float) -> "Coordinate":
        """The coordinate of a chart in the user's bounds; between finite ones it measures the parameter itself."""
        if np.isfinite([lower, upper]).all():
            return self._replace(lower=lower, upper=upper, physical=(False, False), drawn=None)
        low, high = max(self.lower, lower), min(self.upper, upper)
        if not low < high:
            raise ValueError(f"bounds of {self.name!r} leave nothing to search, got {(lower, upper)}")
        return self._replace(lower=low, upper=high, physical=(False, False))

    def limited(self, limits: Mapping[str, tuple[float, float]]) -> "Coordinate":
        """The coordinate in the user's bounds; ValueError if one is not finite, or not positive on a log scale."""
        lower, upper = limits.get(self.name, (self.lower, self.upper))
        positive = " positive and" if self.log else ""
        if not (lower < upper and np.isfinite([lower, upper]).all()) or (self.log and not lower > 0.0):
            raise ValueError(
                f"bounds of {self.name!r} must be{positive} finite and lower < upper, got {(lower, upper)}"
            )
        return self._replace(lower=lower, upper=upper)


def by_name(*coordinates: Coordinate) -> dict[str, Coordinate]:
    return {each.name: each for each in coordinates}


def declared_space(
    law: Any,
    record: Record,
    freedom: Freedom,
    *,
    searched: Sequence[Parameter] | None = None,
    starts: Sequence[Mapping[str, float]] | None = None,
    units: Mapping[str, float] | None = None,
) -> SearchSpace:
    """The search box of a law on one record, by its `searched` parameters and `starts` unless others are given.

    Starts are points in the units of the parameters, from which the search begins beside the law's own `scalars`; its
    `initial` memory is held at zero where the record begins at rest. A parameter that is not declared is held, unless
    it is free and bounded. `units` are the record's, by default its `spans`. A number that is the family's by default
    is one in these units: the search does not depend on the record's scale.

    Raises ValueError if the input is constant, `freedom.initial` is unknown, or a name or a bound does not fit.
    """
    scalars, parameters = law.scalars, law.searched if searched is None else searched
    starts = law.starts if starts is None else starts
    units, first = units or spans(record), float(record.u[0])
    declared = {parameter.name: parameter for parameter in parameters}
    if unknown := declared.keys() - law.arguments.keys():
        first_one = sorted(unknown)[0]
        raise TypeError(
            f"`searched` of {type(law).__name__} has {first_one!r}, which is no field{meant(first_one, scalars)}"
        )
    of = {name: declared.get(name.partition("[")[0]) for name in scalars}
    resting = tuple(name for name in scalars if name.partition("[")[0] in law.initial)
    bounded = {name for name, each in of.items() if each is None and name in {*freedom.free, *freedom.bounds}}
    if unbounded := [name for name in scalars if name in bounded and name not in freedom.bounds]:
        raise ValueError(
            f"{unbounded[0]!r} is free, but has no bounds: give bounds={{{unbounded[0]!r}: (lower, upper)}}"
        )
    chosen = freedom.held(scalars, at_rest=resting if freedom.starts_at_rest() else ())
    held = {name: scalars[name] for name, each in of.items() if each is None and name not in bounded} | chosen
    coordinates, values, shares = [], {}, {}
    for name, each in of.items():
        if each is None:
            coordinates += [free_coordinate(name, *freedom.bounds[name])] if name in bounded else []
        elif not each.affine:
            is_share = scalars.keys() >= {*each.unit.split("/")}
            if is_share and name not in {*held, *freedom.bounds}:
                shares[name] = each.unit.split("/")
            unit, origin = 1.0 if is_share else unit_of(each.unit, units), first if each.from_first else 0.0
            box = origin + each.lower * unit, origin + each.upper * unit
            coordinates.append(Coordinate(name, *box, unit, each.log, each.physical))
            values[name] = origin, unit
    usual = scalars_of(law.defaults()).items() if freedom.starts_anew else ()
    own = {name: value for name, value in usual if name in values and scalars[name] == value}
    points = [{name: values[name][0] + start[name] * values[name][1] for name in start} for start in (own, *starts)]
    columns = tuple(name for name, each in of.items() if each is not None and each.affine)
    sides = {name: each.physical_sides(units) for name, each in of.items() if each and each.affine and name not in held}
    limits = {name: pair for name, pair in sides.items() if np.isfinite(pair).any()} | freedom.limits(scalars, held)
    shown = scalars | _as_shares(scalars, shares)
    if not freedom.starts_anew:
        coordinates = [each.holding(shown[each.name]) for each in coordinates]
    space = space_of(coordinates, columns, shown, held, limits, points, state=resting, screened=law.screened)
    return _with_shares(space, scalars, shares) if shares else space


def _as_shares(parameters: Mapping[str, float], shares: Mapping[str, Sequence[str]]) -> dict[str, float]:
    return {name: parameters[name] * parameters[below] / parameters[above] for name, (above, below) in shares.items()}


def _with_shares(space: SearchSpace, scalars: Mapping[str, float], shares: Mapping[str, Sequence[str]]) -> SearchSpace:
    """The space in which the coordinates of these parameters are shares of a quotient of two others."""

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        known = space.parameters(x)
        return known | {name: known[name] * known[above] / known[below] for name, (above, below) in shares.items()}

    def encoded(parameters: Mapping[str, float]) -> FloatArray:
        assert space.encoded is not None
        return space.encoded({**parameters, **_as_shares({**scalars, **parameters}, shares)})

    return replace(space, parameters=parameters, encoded=encoded)


def free_coordinate(name: str, lower: float, upper: float) -> Coordinate:
    """A parameter with nothing known but its bounds: on a log scale if they are positive."""
    return Coordinate(name, lower, upper, max(abs(lower), abs(upper)), log=lower > 0.0)


def space_of(
    coordinates: Iterable[Coordinate],
    columns: tuple[str, ...],
    defaults: Mapping[str, float],
    held: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    points: Sequence[Mapping[str, float]] = ({},),
    **others: Any,
) -> SearchSpace:
    """The space of the coordinates that are not held, with starts at `points` and the user's `limits`."""
    searched = [each.limited(limits) for each in coordinates if each.name not in held]
    names = tuple(each.name for each in searched)
    lower = np.array([each.encode(each.lower) for each in searched])
    upper = np.array([each.encode(each.upper) for each in searched])
    starts = [[each.encode({**defaults, **point}[each.name]) for each in searched] for point in points]
    constants = {name: value for name, value in held.items() if name not in columns}

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        sets = np.atleast_2d(x)
        fixed = {name: np.full(len(sets), value) for name, value in constants.items()}
        return fixed | {each.name: each.decode(column) for each, column in zip(searched, sets.T, strict=True)}

    def encoded(parameters: Mapping[str, float]) -> FloatArray:
        values = [parameters.get(each.name, defaults[each.name]) for each in searched]
        same = [value == defaults[each.name] for each, value in zip(searched, values, strict=True)]
        there = [each.encode(value) for each, value in zip(searched, values, strict=True)]
        return np.where(same, starts[0], there)

    return SearchSpace.of(
        defaults,
        columns,
        held,
        coordinates=names,
        lower=lower,
        upper=upper,
        starts=np.reshape(starts, (len(points), len(names)))[: None if names else 1],
        parameters=parameters,
        physical={each.name: each.physical for each in searched if each.name not in limits},
        **{
            "bounds": {name: pair for name, pair in limits.items() if name in columns},
            "encoded": encoded,
            **others,
        },
    )


@dataclass(frozen=True, kw_only=True)
class Chart(ABC):
    """Coordinates of the free parameters of a law in scales of its own, and the ways there and back.

    Its `rows` are the coordinates in their order, by the names of parameters and of what stands in their place; a
    parameter that the user bounds by finite numbers is its own coordinate.
    """

    rows: Mapping[str, Coordinate]
    defaults: Numbers
    held: Numbers
    bounds: Box  # of the user

    @property
    @abstractmethod
    def called(self) -> Mapping[str, str]:
        """Names of coordinates by those of the parameters in whose places they stand."""

    @abstractmethod
    def measured(self, known: dict[str, FloatArray], raw: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """All parameters: those `known`, and the others by the numbers `raw` of their coordinates, (n_sets,) each."""

    @abstractmethod
    def located(self, known: dict[str, FloatArray]) -> dict[str, Any]:
        """Numbers of the coordinates that differ from their parameters, by all parameters."""

    @cached_property
    def values(self) -> Numbers:
        return {**self.defaults, **self.held}

    @cached_property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in self.rows if name in self.values and name not in self.held)

    @cached_property
    def limits(self) -> Box:
        """Bounds of the parameters that are their own coordinates."""
        return {name: pair for name, pair in self.bounds.items() if name in self.free and np.isfinite(pair).all()}

    @cached_property
    def axes(self) -> Mapping[str, Coordinate]:
        """The coordinates in the user's bounds."""
        axes = {name: self.rows[name] for name in (self.called.get(name, name) for name in self.free)}
        return axes | {name: axes[name].within(*self.bounds[name]) for name in axes if name in self.bounds}

    def numbers(self, parameters: Numbers) -> dict[str, Any]:
        """Numbers of the coordinates by all parameters."""
        known = {name: np.array(float(parameters[name])) for name in self.rows if name in parameters}
        return known | self.located(known) | {name: known[name] for name in self.limits}


def space_of_chart(
    chart: Chart, columns: tuple[str, ...], freedom: Freedom, start: Numbers | None = None, **others: Any
) -> SearchSpace:
    """The search in the box of a chart from the numbers `start` of its coordinates, by default those of the law.

    A search that begins at a law of the user's has a box that holds it, but for the user's `bounds`.
    """
    own, axes = chart.numbers(chart.values), [*chart.axes.values()]
    drawn = np.array([each.encode(each.drawn or (each.lower, each.upper)) for each in axes]).reshape(-1, 2).T
    if not freedom.starts_anew:
        axes = [each if each.name in chart.bounds else each.holding(own[each.name]) for each in axes]

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        known = space.parameters(x)
        raw = {name: known.pop(name) for name in chart.axes if name not in chart.limits}
        values = chart.measured(known, raw)
        return {name: values[name] for name in chart.values if name in values}

    def encoded(parameters: Numbers) -> FloatArray:
        numbers = chart.numbers({**chart.values, **parameters})
        return np.array([each.encode(numbers[each.name]) for each in axes])

    space = space_of(
        axes,
        columns,
        chart.values,
        chart.held,
        {name: pair for name, pair in chart.bounds.items() if name in (*chart.limits, *columns)},
        [own if start is None else start],
        encoded=encoded,
        state=("z0",),
        drawn=(drawn[0], drawn[1]) if any(each.drawn for each in chart.rows.values()) else None,
        **others,
    )
    return replace(space, parameters=parameters)


def spans(record: Record) -> dict[str, float]:
    """Spans of input and output, the latter 1 where it is constant. Raises ValueError if the input is constant."""
    span = span_of(record)
    return {"u": span, "h": 0.5 * span, "y": float(np.ptp(record.y)) or 1.0, "1": 1.0}


def rate_spans(record: Record) -> dict[str, float]:
    """`spans`, with the highest speeds ``"v"`` of the input and ``"r"`` of the output; ValueError without time."""
    units, time = spans(record), record.sample_time
    speed = float(np.abs(np.diff(record.u)).max()) / time
    return {**units, "v": speed, "r": units["y"] / units["u"] * speed}


def unit_of(unit: str, units: Mapping[str, float]) -> float:
    numerator, _, denominator = unit.partition("/")
    return units[numerator] / units[denominator or "1"]
