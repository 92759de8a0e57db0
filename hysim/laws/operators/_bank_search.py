"""The search for the parameters of a bank of plays, stops or relays.

The output is affine in weights, feedthrough and offset. Thresholds are given, by default evenly over half the input's
span. One that the user frees is searched between the middles of the gaps to its neighbours: their order stays.

One-signed weights are those of the classical operator, of one density: all elements past the threshold zero turn the
loop in one sense. Without it least squares fit noise by weights of alternating sign, and such a law may have no
inverse; a loop that crosses itself or bends the other way needs both signs. By default the record decides. Where each
element is a curve, that of threshold zero and the feedthrough have this sign, too, and the feedthrough has a least
size: without one the law would stand still after a reversal, and would have no inverse.

The memory of many plays is as many unknowns, which no record determines. With ``initial="rest"`` the plays stand at
zero before the first sample, with ``"still"`` at the first input. With ``"free"`` the memory is that of former turning
points: the stroke from rest at zero to the oldest, `turn_2` or further back, and so on to the last one, `turn`. For one

    z_i = sign(turn) max(|turn| - r_i, 0)

One holds for every record that begins at rest or at a turning point of its cycle, or in a cycle about zero; cycles that
faded or grew before the record need more. Any other steady cycle is ``"periodic"``: the positions that the cycle leaves
behind. By default the record decides, also how many former turning points there are.

Once the input has moved by twice the largest threshold all of this is forgotten, for weights of any sign.

Behind dead zones the output is affine in their weights for given weights of the plays,

    y = offset + S(sum_i w_i z_i),    S(x) = x + sum_j c_j S_(d_j)(x)

The plays' weights are searched; the search begins with the plain law's least squares, and with a law's own weights
where there is one. The thresholds of the dead zones are given, by default evenly inside the range that the plain law's
x has on the record. The weight of the dead zone zero is one, because a factor on x could be taken for one on S.
"""

import itertools
from abc import abstractmethod
from collections import ChainMap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, check_lengths, check_not_negative, check_whole, checked, read_only
from hysim.kernels import play_sums as kernels
from hysim.models.compiled_step import pointer
from hysim.models.composable import Composable
from hysim.models.parameters import Coordinate, Parameter, rate_spans, space_of, spans, unit_of
from hysim.models.protocols import Subject, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables, check_increasing
from hysim.records import Record

IDENTITY = (0.0, 0.0, 0.0, 0.0, 1.0)
"""The envelope gamma(u) = u."""
TURN = "turn"
_LEVELS = 33, 9  # of a single former turning point, and of one beside others, from which the search begins
_SIZES = (0.2, 0.4, 0.6, 0.8, 1.0, 1.3)  # of several about the middle of the input, in half spans, likewise
_LEAST_SLOPE = 1e-4  # of the feedthrough beside curves, in spans of the output over that of the input
_MOST_TURNS = 4  # more are seldom determined
_ROUNDING = 1e-9  # of a threshold
_LARGEST = 4.0  # of a weight before dead zones, in slopes of the record, unless the plain law has a larger one


class Axis(NamedTuple):
    """A coordinate other than thresholds and turning points, and where its search begins, in its unit."""

    parameter: Parameter
    starts: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class SignedStructure(Subject, Composable):
    """A bank whose weights may have one sign: that of the record's loop, or the other one."""

    law: Any
    one_signed: bool | None = None
    against: bool = False  # whether weights of one sign turn against the loop of the record

    def variants(self) -> tuple[Variant, ...]:
        """Weights of one sign, of that of the record's loop or the other, or of both."""
        if self.one_signed:
            return ()
        along = Variant(replace(self, one_signed=True), "weights of one sign", self.one_signed is None)
        against = Variant(replace(self, one_signed=True, against=True), along.words, along.offered)
        return along, against, Variant(replace(self, one_signed=False), "weights of both signs")

    def side(self, record: Record, *, clockwise: bool = False) -> tuple[float, float] | None:
        """Bounds of the weights that turn the loop, where they have one sign; `clockwise` if positive ones do so.

        A loop runs clockwise where the path of the record, closed by its chord, encloses more area clockwise.
        """
        if self.one_signed is False:
            return None
        area = np.dot(record.u, np.roll(record.y, -1)), np.dot(np.roll(record.u, -1), record.y)
        positive = (clockwise == bool(area[0] < area[1])) != self.against
        return (0.0, np.inf) if positive else (-np.inf, 0.0)

    @abstractmethod
    def initial(self, parameters: Parameters) -> FloatArray:
        """The initial memory of the laws, (n_sets, n_memory)."""

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        tuples = {name.partition("[")[0] for name in parameters if "[" in name}
        values = {**parameters, **{name: table_of(name, parameters)[0] for name in tuples}}
        values["z0"] = self.initial(parameters)[0]
        return self.law(**{each.name: values[each.name] for each in fields(self.law) if each.name in values})


@checked
class BankStructure(SignedStructure):
    """A bank of plays or stops to be identified; see `PrandtlIshlinskii.structure`.

    Its law is a `hysim.laws.operators._bank.Bank`. The `axes` are searched beside the thresholds; a search begins at
    `own` values, by name, where there are some. `known` are numbers that are not searched.
    """

    thresholds: tuple[float, ...] = ()
    plays: int = 10
    turns: int = 1  # former turning points that describe a free memory
    spacing: float = 1.0  # power of the even steps at which free thresholds lie
    axes: tuple[Axis, ...] = ()
    own: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, float] = field(default_factory=dict)
    zones: int | None = None  # number of dead zones behind plays, beside that of zero
    dead_zones: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_whole(self.plays, "plays")
        check_whole(self.zones or 0, "dead_zones", least=0)
        if self.dead_zones:
            check_dead_zones(*[np.atleast_2d(self.dead_zones)] * 2)
        check_elements(self.law, *[np.atleast_2d(self.thresholds)] * 3)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Thresholds and memory as coordinates where they are free, weights before dead zones; the rest is linear."""
        if self.zones is None:
            return self._space_without_dead_zones(record, freedom)
        if not freedom.starts_at_rest("rest"):
            raise ValueError('the memory of plays before dead zones is not searched: use initial="rest" or "periodic"')
        own = self._space_without_dead_zones(record, Freedom(initial=freedom.initial))
        weights, (start, x) = own.columns[:-1], self._plain(own, record)
        zones = np.array(self.dead_zones)
        if not zones.size:  # zero and even steps inside the range of x
            zones = np.unique(np.append(np.linspace(float(x.min()), float(x.max()), self.zones + 2)[1:-1], 0.0))
        columns = (*named("dead_zone_weights", zones), "offset")
        defaults = dict(zip(weights, start.tolist(), strict=True)) | dict.fromkeys(columns, 0.0)
        through = tuple(columns[j] for j in np.flatnonzero(zones == 0.0))
        held = freedom.held(defaults | dict.fromkeys(through, 1.0), redundant=tuple((name,) for name in through))
        limits = freedom.limits(defaults, held)
        starts = [defaults, *([self.own] if self.own else [])]
        slope = float(np.ptp(record.y)) / float(np.ptp(record.u)) or 1.0
        largest = max(_LARGEST * abs(slope), 2.0 * float(np.abs(start).max()))  # a steep start is inside
        box = []
        for name in weights:
            low, high = np.clip(own.bounds.get(name, (-np.inf, np.inf)), -largest, largest).tolist()
            box.append(Coordinate(name, low, high, slope, physical=(low == 0.0, high == 0.0)))
        held = {**own.held, **named("dead_zones", zones.tolist()), **held}
        return space_of(box, columns, defaults, held, limits, starts, state=own.state, screened=0)

    def _space_without_dead_zones(self, record: Record, freedom: Freedom) -> SearchSpace:
        half, first, turns = spans(record)["h"], float(record.u[0]), self._turns
        places = self._thresholds(half)
        thresholds, axes = named(self.law.thresholds_name, places.tolist()), self._axes(record)
        weights = dict(zip(named(self.law.weights_name, places), places.tolist(), strict=True))
        columns = (*weights, *(("feedthrough",) if self._has_feedthrough else ()), "offset")
        starts = {each.name: begins for each, begins in axes}
        rest = dict.fromkeys(columns, 0.0) | dict.fromkeys(turns, first)
        defaults = {**thresholds, **{name: begins[0] for name, begins in starts.items()}, **rest}
        chosen = freedom.held(defaults, at_rest=turns if freedom.starts_at_rest("rest") else ())
        held = {name: value for name, value in thresholds.items() if name not in freedom.free} | chosen
        constants = {**held, **self.known}
        limits = freedom.limits(defaults, held)
        box = [
            *(Coordinate(*each, half, physical=(True, True)) for each in _gaps(thresholds)),
            *(Coordinate(turn, first - 2.0 * half, first + 2.0 * half, half) for turn in turns),
            *(each for each, _ in axes),
        ]
        pasts = [past for past in _pasts(turns, record) if not set(turns) & set(held)] or [{}]
        free = [[{name: value} for value in begins] for name, begins in starts.items() if name not in held]
        points = [dict(ChainMap(*each)) for each in itertools.product(pasts, *free)]
        side = self.side(record, clockwise=self.law.stops)
        bounds = {
            name: side
            for name, r in weights.items()
            if side is not None and (r > 0.0 or self.law.is_curved) and name not in held
        }
        if side is not None and self.law.is_curved and "feedthrough" not in held:
            least = _LEAST_SLOPE * float(np.ptp(record.y)) / (2.0 * half or 1.0)
            bounds["feedthrough"] = (least, np.inf) if side[0] == 0.0 else (-np.inf, -least)
        bounds |= {name: pair for name, pair in limits.items() if name in columns}
        searched = {each.name for each in box} - set(held)
        few = 0 if searched <= {*turns} else 64 if searched <= {*turns, *starts} else 256
        space = space_of(box, columns, defaults, constants, limits, points, bounds=bounds, state=turns, screened=few)

        def parameters(x: FloatArray) -> dict[str, FloatArray]:
            numbers = space.parameters(x)
            return {**numbers, **self.law.derived(numbers, record)}

        return replace(space, parameters=parameters)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """One column for each element or dead zone, the input where there is a feedthrough, 1 and 0."""
        columns = self._columns(parameters, record)
        if self.zones is None:
            return columns
        x = np.matmul(columns[..., :-2], table_of("weights", parameters)[..., np.newaxis])
        return with_offset(dead_zone(x, table_of("dead_zones", parameters)[:, np.newaxis]))

    def _columns(self, parameters: Parameters, record: Record) -> FloatArray:
        z = self._positions(parameters, record)
        static = [np.broadcast_to(record.u[:, np.newaxis], (*z.shape[:2], 1))] if self._has_feedthrough else []
        return with_offset(self.law.outputs_of_one(z, parameters, record), *static)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the positions after one run through the record, which erases what was before it.

        Where the input stands still the plays stand at it: all within their thresholds, in the middle.
        """
        z = self._positions(parameters, record)[:, -1]
        if np.ptp(record.u) == 0.0:
            z = np.full_like(z, record.u[0])
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        return {**parameters} | named("z0", (column.reshape(shape)[()] for column in z.T))

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """At rest at zero or at the first input, after the cycle, or after one former turning point."""
        return "rest", "still", "periodic", *(("free",) if self.zones is None else ())

    def longer_past(self) -> "BankStructure | None":
        may_be_longer = self.turns < _MOST_TURNS and self.law.by_input
        return replace(self, turns=self.turns + 1) if may_be_longer else None

    def forgotten(self, record: Record, space: SearchSpace) -> int:
        """The first sample at which the input has pushed every play from both sides."""
        if not self.law.by_input or not set(space.coordinates) <= {*space.state}:
            return len(record)
        widest = 2.0 * table_of(self.law.thresholds_name, space.held).max(initial=0.0)
        span = np.maximum.accumulate(record.u) - np.minimum.accumulate(record.u)
        return int(np.count_nonzero(span <= widest * (1.0 + _ROUNDING)))

    def _thresholds(self, half: float) -> FloatArray:
        """The structure's own, or powers of even steps: from zero for plays, up to the end for stops."""
        if self.thresholds:
            return np.array(self.thresholds)
        steps = np.arange(self.plays) + float(self.law.stops)
        return np.asarray(half * (steps / (self.plays + float(self.law.stops))) ** self.spacing)

    def _axes(self, record: Record) -> list[tuple[Coordinate, tuple[float, ...]]]:
        """The coordinates other than thresholds and turning points, and where their search begins."""
        rated = any("v" in each.parameter.unit for each in self.axes)
        units, axes = rate_spans(record) if rated else spans(record), []
        for each, starts in self.axes:
            unit, own = unit_of(each.unit, units), [self.own[each.name]] if each.name in self.own else []
            coordinate = Coordinate(each.name, each.lower * unit, each.upper * unit, unit, physical=each.physical)
            axes.append((coordinate, (*own, *(unit * start for start in starts))))
        return axes

    @property
    def _turns(self) -> tuple[str, ...]:
        """Names of the former turning points, the last one first."""
        return (TURN, *(f"{TURN}_{k}" for k in range(2, self.turns + 1)))

    @property
    def _has_feedthrough(self) -> bool:
        return any(each.name == "feedthrough" for each in fields(self.law))

    def _plain(self, own: SearchSpace, record: Record) -> tuple[FloatArray, FloatArray]:
        """Weights of the plain law that fits best, and its output without the offset."""
        from scipy.optimize import lsq_linear

        columns = self._columns(own.parameters(np.empty((1, 0))), record)[0, :, :-1]
        limits = np.array([own.bounds.get(name, (-np.inf, np.inf)) for name in own.columns])
        size, unit = np.abs(columns).max(axis=0), float(np.abs(record.y).max()) or 1.0
        box = tuple(limits.T * size / unit)  # the tolerance of the solver is an absolute one
        weights = lsq_linear(columns / size, record.y / unit, bounds=box, method="bvls").x[:-1] * unit / size[:-1]
        return weights, columns[:, :-1] @ weights

    def initial(self, parameters: Parameters) -> FloatArray:
        """The positions of the plays: given ones, or those after the stroke from rest at zero by the turning points."""
        if "z0[0]" in parameters:
            return table_of("z0", parameters)
        thresholds = table_of(self.law.thresholds_name, parameters)
        z = np.zeros_like(thresholds)
        for turn in reversed([parameters[turn] for turn in self._turns if turn in parameters]):
            z = moved(z, thresholds, np.ravel(turn)[:, np.newaxis])
        return z

    def _positions(self, parameters: Parameters, record: Record) -> FloatArray:
        """Positions (n_sets, n_samples, n_plays) along a record, which do not depend on the weights."""
        from hysim.kernels.batches import drive_memory  # compiled where it is needed

        thresholds, z0 = table_of(self.law.thresholds_name, parameters), self.initial(parameters)
        tables = {"offset": np.zeros((len(z0), 1)), "thresholds": thresholds, "weights": np.zeros_like(z0)}
        tables |= {name: table_of(name, parameters) for name in ("left", "right") if f"{name}[0]" in parameters}
        if "beta" in parameters:
            tables |= {"beta": np.reshape(parameters["beta"], (-1, 1)), "sample_time": np.array([[record.sample_time]])}
        z, states = np.empty((len(z0), len(record), z0.shape[1])), np.insert(z0, 0, record.u[0], axis=1)
        for row, state, positions in zip(read_only(rows_of(tables)), states, z, strict=True):
            drive_memory(pointer(kernels.step), row, state, record.u, positions)
        return z


def table_of(what: str, parameters: Parameters) -> FloatArray:
    """The numbers of a tuple over the sets, ``what[0]``, ``what[1]`` ..., shape (n_sets, length)."""
    count = sum(name.startswith(f"{what}[") for name in parameters)
    n_sets = max((np.size(value) for value in parameters.values()), default=1)
    table = np.empty((n_sets, count))
    for k in range(count):
        table[:, k] = parameters[f"{what}[{k}]"]
    return table


def named(what: str, values: Iterable[Any]) -> dict[str, Any]:
    """The numbers of a tuple by their names, ``what[0]``, ``what[1]`` ..."""
    return {f"{what}[{k}]": value for k, value in enumerate(values)}


def with_offset(*columns: FloatArray) -> FloatArray:
    """Columns (n_sets, n_samples, n) of what the output is affine in, with 1 for the offset and 0 for the rest."""
    ones = np.ones((*columns[0].shape[:2], 1))
    return np.concatenate([*columns, ones, np.zeros_like(ones)], axis=-1)


def rows_of(tables: Tables) -> FloatArray:
    """Rows as the kernels take them: offset, width, envelopes, thresholds, weights, and then the dead zones.

    Growth `beta` at a sample time, envelopes `left` and `right`, and dead zones may be absent; `right` without
    coefficients is the left one.
    """
    offset = tables["offset"]
    width = tables["beta"] / tables["sample_time"] if "beta" in tables else 0.0
    left = tables.get("left", np.tile(IDENTITY, (len(offset), 1)))
    right = tables.get("right", left)
    head = [offset, width + np.zeros_like(offset), left, right if right.shape[1] else left]
    behind = [tables[name] for name in ("dead_zones", "dead_zone_weights") if name in tables]
    return np.concatenate([*head, tables["thresholds"], tables["weights"], *behind], axis=1)


def moved(z: FloatArray, thresholds: FloatArray, u: FloatArray) -> FloatArray:
    """Positions of plays that stood at `z`, once the input is `u`."""
    return np.minimum(np.maximum(z, u - thresholds), u + thresholds)


def dead_zone(x: FloatArray, d: float | FloatArray) -> FloatArray:
    """One-sided dead zone of the threshold `d`; the input itself where that is zero."""
    return np.where(np.equal(d, 0.0), x, np.where(np.greater(d, 0.0), np.maximum(x - d, 0.0), np.minimum(x - d, 0.0)))


def check_elements(law: Any, thresholds: FloatArray, weights: FloatArray, z0: FloatArray) -> None:
    """Refuse tables (n_sets, n_plays) that are no elements of a law."""
    name = law.thresholds_name
    check_lengths(empty=True, **{name: thresholds.T, law.weights_name: weights.T, "z0": z0.T})
    check_not_negative(**{name: thresholds.min(initial=0.0)})
    if law.ordered:
        check_increasing(name, thresholds)


def check_dead_zones(thresholds: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_zones) that are no dead zones."""
    check_lengths(empty=False, dead_zones=thresholds.T, dead_zone_weights=weights.T)
    check_increasing("dead_zones", thresholds)


def conditioned(u: FloatArray) -> tuple[float, float]:
    """Extremes of the cycle between the lowest and the highest input, that of the branch at the first sample last."""
    moves = np.diff(u)
    rises = bool(moves[np.flatnonzero(moves)[:1]].sum() > 0.0)
    low, high = float(u.min()), float(u.max())
    return (high, low) if rises else (low, high)


def dominant_extremes(u: FloatArray) -> list[float]:
    """The turning points that no later one has wiped out, the oldest first, then the last input; at least two.

    Seen from the end, they are where the input is higher or lower than ever: of highs in a row the highest, and so on.
    """
    back = u[::-1]
    sides = np.diff(np.maximum.accumulate(back)) + np.diff(np.minimum.accumulate(back))  # of one sign: never both
    places = np.flatnonzero(sides)
    last_of_a_row = np.sign(sides[places[1:]]) != np.sign(sides[places[:-1]])
    extremes = back[1 + places[np.append(last_of_a_row, True)[: places.size]]][::-1].tolist()
    return [*extremes, float(u[-1])] if extremes else [float(u[-1])] * 2


def _pasts(turns: Sequence[str], record: Record) -> list[dict[str, float]]:
    """Former turning points from which a search begins: single ones, or cycles that faded towards the first sample."""
    half, first = spans(record)["h"], float(record.u[0])
    levels = first + half * np.linspace(-2.0, 2.0, _LEVELS[len(turns) > 1])
    middle = 0.5 * float(record.u.min() + record.u.max())
    sides = middle + half * (-1.0) ** np.arange(len(turns)) * np.array([[-1.0], [1.0]])
    fading = [middle + np.array(sizes) * (sides - middle) for sizes in itertools.combinations(_SIZES, len(turns))]
    every = np.concatenate([np.tile(levels[:, np.newaxis], len(turns)), *(fading if len(turns) > 1 else [])])
    return [dict(zip(turns, past, strict=True)) for past in every.tolist()]


def _gaps(thresholds: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Each threshold with the middles of the gaps to its neighbours; zero below the first."""
    ranked = sorted(thresholds, key=lambda name: thresholds[name])
    values = np.array([thresholds[name] for name in ranked])
    middles = 0.5 * (values[1:] + values[:-1])
    edges = [0.0, *middles.tolist(), 1.5 * float(values.max(initial=0.0)) or 1.0]
    gaps = dict(zip(ranked, itertools.pairwise(edges), strict=True))
    return [(name, *gaps[name]) for name in thresholds]
