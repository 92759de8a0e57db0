"""The search for the parameters of a law of plays or stops.

The output is affine in the weights, the feedthrough and the offset. A bank has its thresholds given, by default evenly
over half the span of the input. A threshold that the user frees is searched between the middles of the gaps to its
neighbours, so that their order stays.

One-signed weights are those of the classical operator, of one density: all elements past the threshold zero turn the
loop in one sense. Without it least squares fit noise by weights of alternating sign, and such a law may have no
inverse; a loop that crosses itself or bends the other way needs both signs. By default the record decides.

The memory of many plays is as many unknowns, which no record determines. With ``initial="rest"`` the plays stand at
zero before the first sample, with ``"still"`` at the first input. With ``"free"`` the memory is that of former turning
points: the stroke from rest at zero to the oldest, `turn_2` or further back, and so on to the last one, `turn`. For one

    z_i = sign(turn) max(|turn| - r_i, 0)

One holds for every record that begins at rest or at a turning point of its cycle, or in a cycle about zero; cycles that
faded or grew before the record need more. Any other steady cycle is ``"periodic"``: the positions that the cycle leaves
behind. By default the record decides, also how many former turning points there are.

Once the input has moved by twice the largest threshold all of this is forgotten: what follows is the same for every
past, and for weights of any sign.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, check_whole, checked
from hysim.laws.operators._clamps import check_elements, positions
from hysim.models.composable import Composable
from hysim.models.parameters import Coordinate, space_of, spans
from hysim.models.protocols import Identifiable, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

TURN = "turn"
BANK_STATES = ("rest", "still", "periodic", "free")
_LEVELS = 33, 9  # of a single former turning point, and of one beside others, from which the search begins
_SIZES = (0.2, 0.4, 0.6, 0.8, 1.0, 1.3)  # of several about the middle of the input, in half spans, likewise
_MOST_TURNS = 4  # more are seldom determined
_ROUNDING = 1e-9  # of a threshold


class Axis(NamedTuple):
    """A coordinate beside thresholds and turning point: its box and starts, and the scale by which it is divided.

    `physical` is that of `hysim.models.parameters.Parameter`.
    """

    lower: float
    upper: float
    starts: tuple[float, ...]
    scale: float
    physical: tuple[bool, bool] = (False, False)


@checked
class Pushing:
    """The search for the way in which the input pushes plays; here it pushes them itself."""

    by_input: ClassVar[bool] = True  # whether the input itself pushes

    def axes(self, record: Record) -> dict[str, Axis]:
        """Coordinates beside thresholds and turning point, by name."""
        return {}

    def derived(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Parameters of the law in place of the coordinates, by name, (n_sets,) each."""
        return {}

    def positions(self, parameters: Parameters, thresholds: FloatArray, z0: FloatArray, record: Record) -> FloatArray:
        """Positions (n_sets, n_samples, n_plays) for thresholds and initial positions (n_sets, n_plays)."""
        return positions(thresholds, z0, record.u)

    def outputs(self, z: FloatArray, parameters: Parameters) -> FloatArray:
        """Outputs of plays of the weight one at the positions `z`, (n_sets, n_samples, n_plays)."""
        return z

    def arguments(self, parameters: Mapping[str, float]) -> dict[str, Any]:
        """The constructor's arguments beside those of every bank."""
        return {}


@checked
class ClampStructure(Identifiable, Composable):
    """A bank of plays or stops to be identified; see `PrandtlIshlinskii.structure`."""

    law: Any
    thresholds: tuple[float, ...] = ()
    plays: int = 10
    one_signed: bool | None = None
    against: bool = False  # whether weights of one sign turn against the loop of the record
    turns: int = 1  # former turning points that describe a free memory
    spacing: float = 1.0  # power of the even steps at which free thresholds lie
    pushing: Pushing = Pushing()

    def __post_init__(self) -> None:
        check_whole(self.plays, "plays")
        check_elements(self.law, *[np.atleast_2d(self.thresholds)] * 3)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Thresholds and memory as coordinates where they are free; the rest is linear."""
        half = spans(record)["h"]
        thresholds = self._thresholds(half)
        names, columns = self._names("thresholds", thresholds.size), self._columns(thresholds.size)
        first, axes, turns = float(record.u[0]), self.pushing.axes(record), _turns(self.turns)
        defaults = {
            **dict(zip(names, thresholds.tolist(), strict=True)),
            **{name: axis.starts[0] for name, axis in axes.items()},
            **dict.fromkeys(columns, 0.0),
            **dict.fromkeys(turns, first),
        }
        chosen = freedom.held(defaults, at_rest=turns if freedom.starts_at_rest("rest") else ())
        held = {name: defaults[name] for name in names if name not in freedom.free} | chosen
        limits = freedom.limits(defaults, held)
        gaps = zip(names, _gaps(thresholds), strict=True)
        box = [
            *(Coordinate(name, *gap, half, physical=(True, True)) for name, gap in gaps),
            *(Coordinate(turn, first - 2.0 * half, first + 2.0 * half, half) for turn in turns),
        ]
        box += [
            Coordinate(name, axis.lower, axis.upper, axis.scale, physical=axis.physical) for name, axis in axes.items()
        ]
        pasts = [point for point in _pasts(turns, record) if not set(turns) & set(held)] or [{}]
        starts = {name: axis.starts for name, axis in axes.items() if name not in held}
        points = [
            past | dict(zip(starts, values, strict=True))
            for past in pasts
            for values in itertools.product(*starts.values())
        ]
        signs = self._signs(record, dict(zip(self._names("weights", thresholds.size), thresholds, strict=True)))
        bounds = {name: pair for name, pair in signs.items() if name in columns and name not in held}
        space = space_of(
            box,
            columns,
            defaults,
            held,
            limits,
            points,
            bounds=bounds | {name: pair for name, pair in limits.items() if name in columns},
            state=turns,
            screened=_screened({each.name for each in box} - set(held), turns, axes),
        )
        return replace(space, parameters=lambda x: self._with_derived(space.parameters(x), record))

    def _with_derived(self, searched: dict[str, FloatArray], record: Record) -> dict[str, FloatArray]:
        return searched | self.pushing.derived(searched, record)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """One column for each element, the input where there is a feedthrough, 1 and 0."""
        thresholds, z0 = self._elements(parameters)
        z = self.pushing.positions(parameters, thresholds, z0, record)
        outputs = self.pushing.outputs(z, parameters)
        elements: FloatArray = record.u[:, np.newaxis] - z if self.law.stops else outputs
        ones = np.ones((*z.shape[:2], 1))
        static = [record.u[:, np.newaxis] * ones] if _has_feedthrough(self.law) else []
        return np.concatenate([elements, *static, ones, np.zeros_like(ones)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the positions after one run through the record, which erases what was before it.

        Where the input stands still the plays stand at it.
        """
        thresholds, z0 = self._elements(parameters)
        if np.ptp(record.u) == 0.0:  # all within their thresholds: in the middle
            z = np.full_like(thresholds, record.u[0])
        else:
            z = self.pushing.positions(parameters, thresholds, z0, record)[:, -1]
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        columns = (column.reshape(shape)[()] for column in z.T)
        return {**parameters} | dict(zip(self._names("z0", z.shape[1]), columns, strict=True))

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The law with these parameters, one number for each name."""
        thresholds, z0 = self._elements(parameters)
        law: Any = self.law
        weights = [parameters[name] for name in self._names("weights", thresholds.shape[1])]
        others = {name: parameters[name] for name in ("feedthrough", "offset") if name in parameters}
        tuples = {law.thresholds_name: thresholds[0], law.weights_name: weights, "z0": z0[0]}
        return law(**tuples, **others, **self.pushing.arguments(parameters))

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """At rest at zero or at the first input, after the cycle, or after one former turning point."""
        return BANK_STATES

    def variants(self) -> tuple[Variant, ...]:
        """Weights of one sign, of that of the record's loop or the other, or of both."""
        return variants_of_sign(self, self.one_signed)

    def longer_past(self) -> "ClampStructure | None":
        """With one former turning point more."""
        may_be_longer = self.turns < _MOST_TURNS and self.pushing.by_input
        return replace(self, turns=self.turns + 1) if may_be_longer else None

    def forgotten(self, record: Record, space: SearchSpace) -> int:
        """The first sample at which the input has pushed every play from both sides."""
        if not self.pushing.by_input or not set(space.coordinates) <= {*space.state}:
            return len(record)
        widest = 2.0 * max((value for name, value in space.held.items() if name.startswith(self._prefix)), default=0.0)
        moved = np.maximum.accumulate(record.u) - np.minimum.accumulate(record.u)
        return int(np.count_nonzero(moved <= widest * (1.0 + _ROUNDING)))

    def _thresholds(self, half: float) -> FloatArray:
        """The structure's own, or powers of even steps: from zero for plays, up to the end for stops."""
        if self.thresholds:
            return np.array(self.thresholds)
        steps = np.arange(self.plays) + float(self.law.stops)
        return np.asarray(half * (steps / (self.plays + float(self.law.stops))) ** self.spacing)

    def _names(self, what: str, count: int) -> tuple[str, ...]:
        own = {"thresholds": self.law.thresholds_name, "weights": self.law.weights_name}
        return tuple(f"{own.get(what, what)}[{k}]" for k in range(count))

    @property
    def _prefix(self) -> str:
        return f"{self.law.thresholds_name}["

    def _columns(self, count: int) -> tuple[str, ...]:
        static = ("feedthrough",) if _has_feedthrough(self.law) else ()
        return (*self._names("weights", count), *static, "offset")

    def _elements(self, parameters: Parameters) -> tuple[FloatArray, FloatArray]:
        """Thresholds and initial positions, shape (n_sets, n_plays) each."""
        count = sum(name.startswith(self._prefix) for name in parameters)
        n_sets = max((np.size(value) for value in parameters.values()), default=1)

        def table(what: str) -> FloatArray:
            values = np.empty((n_sets, count))
            for column, name in zip(values.T, self._names(what, count), strict=True):
                column[:] = parameters[name]
            return values

        thresholds = table("thresholds")
        if "z0[0]" in parameters:
            return thresholds, table("z0")
        return thresholds, _after([parameters[turn] for turn in _turns(self.turns) if turn in parameters], thresholds)

    def _signs(self, record: Record, thresholds: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Bounds at zero of the weights that turn the loop."""
        if self.one_signed is False:
            return {}
        positive = (self.law.stops == runs_clockwise(record)) != self.against
        side = (0.0, np.inf) if positive else (-np.inf, 0.0)
        return {name: side for name, threshold in thresholds.items() if threshold > 0.0}


def _screened(searched: set[str], turns: Sequence[str], axes: Iterable[str]) -> int:
    """Random points beside the starts; none where these lie close."""
    if searched <= {*turns}:
        return 0
    return 64 if searched <= {*turns, *axes} else 256


def _turns(count: int) -> tuple[str, ...]:
    """Names of the former turning points, the last one first."""
    return (TURN, *(f"{TURN}_{k}" for k in range(2, count + 1)))


def _pasts(turns: Sequence[str], record: Record) -> list[dict[str, float]]:
    """Former turning points from which a search begins: single ones, or cycles that faded towards the first sample."""
    half, first = spans(record)["h"], float(record.u[0])
    levels = first + half * np.linspace(-2.0, 2.0, _LEVELS[len(turns) > 1])
    middle = 0.5 * float(record.u.min() + record.u.max())
    sides = middle + half * (-1.0) ** np.arange(len(turns)) * np.array([[-1.0], [1.0]])
    fading = [middle + np.array(sizes) * (sides - middle) for sizes in itertools.combinations(_SIZES, len(turns))]
    every = np.concatenate([np.tile(levels[:, np.newaxis], len(turns)), *(fading if len(turns) > 1 else [])])
    return [dict(zip(turns, past, strict=True)) for past in every.tolist()]


def _after(turns: Sequence[Any], thresholds: FloatArray) -> FloatArray:
    """Positions (n_sets, n_plays) after the way from rest at zero through `turns`, (n_sets,) each, the last first."""
    z = np.zeros_like(thresholds)
    for turn in reversed(turns):
        level = np.ravel(turn)[:, np.newaxis]
        z = np.minimum(np.maximum(z, level - thresholds), level + thresholds)
    return z


def _gaps(thresholds: FloatArray) -> list[tuple[float, float]]:
    """For each threshold the middles of the gaps to its neighbours; zero below the first."""
    order = np.argsort(thresholds, kind="stable")
    middles = 0.5 * (thresholds[order][1:] + thresholds[order][:-1])
    last = 1.5 * float(thresholds.max(initial=0.0)) or 1.0
    edges = np.concatenate([[0.0], middles, [last]])
    gaps = np.empty((thresholds.size, 2))
    gaps[order] = np.stack([edges[:-1], edges[1:]], axis=1)
    return [(lower, upper) for lower, upper in gaps.tolist()]


def variants_of_sign(structure: Any, one_signed: bool | None) -> tuple[Variant, ...]:
    """The choices of sign for a structure with the fields `one_signed` and `against`, where it leaves them open."""
    if one_signed:
        return ()
    along = Variant(replace(structure, one_signed=True), "weights of one sign", one_signed is None)
    against = Variant(replace(structure, one_signed=True, against=True), along.words, along.offered)
    return along, against, Variant(replace(structure, one_signed=False), "weights of both signs")


def runs_clockwise(record: Record) -> bool:
    """Whether the path of the record, closed by its chord, encloses more area clockwise."""
    return bool(np.dot(record.u, np.roll(record.y, -1)) < np.dot(np.roll(record.u, -1), record.y))


def _has_feedthrough(law: type) -> bool:
    return any(field.name == "feedthrough" for field in fields(law))
