"""Search boxes, as families declare them for `identify`, which knows no family.

Identification searches a box of *coordinates* that the family chooses: scaled, free of redundancy,
of order one. The family turns coordinates into the user's parameters. Parameters in which the output is
affine are not searched: for given others, the best ones are the solution of a linear regression.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, frozen
from hysim._basics.names import among, check_parameters, meant

Parameters = Mapping[str, Any]
"""User's names to floats or to arrays of shape (n_sets,)."""

Flags = npt.NDArray[np.bool_]

_AT_SIDE = 1e-6  # in units of the box

STATES = ("free", "rest", "still", "periodic")
"""Values of `initial` of `hysim.identify`."""

STATES_IN_WORDS = '"free", "rest", "still" or "periodic"'


@frozen
class SearchSpace:
    """The box in which a family's parameters are searched on one record.

    Parameters
    ----------
    coordinates : tuple of str, length n_x
        Names of the internal coordinates.
    lower, upper : array, shape (n_x,)
        The box. An unbounded side is infinite.
    starts : array, shape (n_starts, n_x)
        Points from which a search should begin beside the random ones.
    names : tuple of str
        The user's free parameters in the order in which they are reported, the linear ones among them.
    columns : tuple of str
        All parameters in which the output is affine, free or held, in the order of the regressors.
    linear : tuple of str
        Those of them that are free.
    held : mapping
        The user's parameters that are not free, and their values.
    parameters : callable
        Coordinates, shape (n_sets, n_x), to the free parameters that are not linear, each (n_sets,).
    redundant : tuple of tuples of str
        Groups of parameters of which the data can tell only the product.
    regions : mapping
        Name to the box (lower, upper) of a part of the space that has a meaning of its own.
    bounds : mapping
        The user's bounds on linear parameters, name to (lower, upper).
    state : tuple of str
        Parameters, searched or linear, of the state at the first sample; of several records each has its own.
    screened : int, optional
        Random points that a search should try beside the starts, where one evaluation is dear; 0 for none.
    drawn : tuple of two arrays, shape (n_x,) each, optional
        Lower and upper side of the part of the box from which these points are drawn; by default all of it.
    outer : tuple of two arrays, shape (n_x,) each, optional
        The box of which this one is the part with the admissible laws: only its sides are search bounds.
    physical : mapping
        Coordinate to whether its lower and its upper side is a limit of physics or of the law itself: an optimum there
        is one. At other sides that the user has not given the search has stopped, and the box is widened.
    by_user : mapping
        Searched or linear parameter to whether its lower and its upper bound is the user's.
    encoded : callable, optional
        The user's parameters by name, as far as they differ from the start, to coordinates, shape (n_x,).
    """

    coordinates: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    starts: FloatArray
    names: tuple[str, ...]
    columns: tuple[str, ...]
    linear: tuple[str, ...]
    held: Mapping[str, float]
    parameters: Callable[[FloatArray], dict[str, FloatArray]]
    redundant: tuple[tuple[str, ...], ...] = ()
    regions: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    state: tuple[str, ...] = ()
    screened: int | None = None
    drawn: tuple[FloatArray, FloatArray] | None = None
    outer: tuple[FloatArray, FloatArray] | None = None
    physical: Mapping[str, tuple[bool, bool]] = field(default_factory=dict)
    by_user: Mapping[str, tuple[bool, bool]] = field(default_factory=dict)
    encoded: Callable[[Mapping[str, float]], FloatArray] | None = None

    def sides(self, kind: Mapping[str, tuple[bool, bool]]) -> tuple[Flags, Flags]:
        """Which lower and upper sides of the box (n_x,) are of a kind, such as `physical` or `by_user`."""
        lower, upper = np.array([kind.get(name, (False, False)) for name in self.coordinates]).reshape(-1, 2).T
        return lower.astype(bool), upper.astype(bool)

    def open_sides(self, x: FloatArray) -> tuple[Flags, Flags]:
        """The lower and the upper sides at which `x` (n_x,) stands, and which are neither physical nor the user's."""
        closed = zip(self.ends(x), self.sides(self.physical), self.sides(self.by_user), strict=True)
        low, high = (at & ~physical & ~user for at, physical, user in closed)
        return low, high

    def at_sides(self, x: FloatArray) -> tuple[Flags, Flags]:
        """The lower and the upper sides at which `x` (n_x,) stands."""
        width = self.upper - self.lower
        return x - self.lower < _AT_SIDE * width, self.upper - x < _AT_SIDE * width

    def ends(self, x: FloatArray) -> tuple[Flags, Flags]:
        """As `at_sides`, without the sides that part the admissible laws from the others."""
        low, high = self.at_sides(x)
        if self.outer is None:
            return low, high
        return low & (self.lower <= self.outer[0]), high & (self.upper >= self.outer[1])

    def widened(self, low: Flags, high: Flags) -> "SearchSpace":
        """The space whose box reaches a quarter of its width beyond these sides."""
        width = self.upper - self.lower
        lower, upper = self.lower - 0.25 * width * low, self.upper + 0.25 * width * high
        regions = {
            name: (np.where(below == self.lower, lower, below), np.where(above == self.upper, upper, above))
            for name, (below, above) in self.regions.items()
        }
        outer = None if self.outer is None else (np.minimum(self.outer[0], lower), np.maximum(self.outer[1], upper))
        return replace(self, lower=lower, upper=upper, regions=regions, outer=outer)

    def at(self, places: Sequence[int], **others: Any) -> "SearchSpace":
        """The space with coordinates at some places of its own, maybe several at one; `others` are its further fields.

        ``coordinates``, with the new names, are among them.
        """

        def laid(side: FloatArray) -> FloatArray:
            return side[..., [*places]] if places else np.empty((*side.shape[:-1], 0))

        drawn = self.drawn and (laid(self.drawn[0]), laid(self.drawn[1]))
        regions = {name: (laid(low), laid(high)) for name, (low, high) in self.regions.items()}
        box: dict[str, Any] = {name: laid(vars(self)[name]) for name in ("lower", "upper", "starts")}
        return replace(self, **box, drawn=drawn, regions=regions, **others)

    @classmethod
    def of(cls, every: Iterable[str], columns: tuple[str, ...], held: Mapping[str, float], **others: Any) -> Self:
        """The space of all parameters that are not `held`; `others` are those of the constructor."""
        names, linear = (tuple(name for name in each if name not in held) for each in (every, columns))
        return cls(names=names, columns=columns, linear=linear, held=held, **others)


@dataclass(frozen=True)
class Freedom:
    """The user's wishes about the parameters; see `hysim.identify` for the meaning.

    A search that `starts_anew` takes default numbers in units of the record; else it begins at the law itself.
    """

    fixed: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    initial: str | None = None
    starts_anew: bool = False

    def starts_at_rest(self, default: str = "free") -> bool:
        """Whether the initial state is not free, where the user says nothing by the family's default."""
        if self.initial not in (None, *STATES):
            raise ValueError(f"initial must be {STATES_IN_WORDS}, got {self.initial!r}{meant(self.initial, STATES)}")
        return (self.initial or default) != "free"

    def held(
        self, defaults: Mapping[str, float], *, redundant: tuple[tuple[str, ...], ...] = (), at_rest: Iterable[str] = ()
    ) -> dict[str, float]:
        """The parameters that are not free, and their values: fixed ones, zeros `at_rest`, one of each redundant group.

        A name in `free` is not among the last two kinds. ValueError if a name is unknown, or both fixed and free.
        """
        check_parameters(defaults, fixed=self.fixed, free=self.free)
        if both := set(self.fixed) & set(self.free):
            raise ValueError(f"{sorted(both)[0]!r} is both fixed and free")
        held = {name: 0.0 for name in at_rest if name not in self.free}
        held |= {name: float(value) for name, value in self.fixed.items()}
        for group in redundant:
            candidates = [name for name in group if name not in self.free]
            if candidates and not held.keys() & set(group):
                held[candidates[0]] = defaults[candidates[0]]
        return held

    def limits(self, defaults: Mapping[str, float], held: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """The bounds as floats; ValueError if a name is unknown or held, or a lower bound is not below the upper."""
        for name, pair in self.bounds.items():
            if name in self.fixed:
                raise ValueError(f"{name!r} is fixed, and has bounds: give one of both")
            if name not in defaults or name in held:
                raise ValueError(f"bounds name {name!r}, which is not free; the parameters are {among(name, defaults)}")
            if len(pair) != 2 or not pair[0] < pair[1]:
                raise ValueError(f"bounds of {name!r} must be (lower, upper) with lower < upper, got {pair}")
        return {name: (float(lower), float(upper)) for name, (lower, upper) in self.bounds.items()}


ALL_FREE = Freedom()
