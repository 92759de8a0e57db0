"""The modified Prandtl-Ishlinskii law: plays, and behind them dead zones, for loops that are not odd.

S is a broken line through zero, of the slope c_0 about zero and c_0 + c_1 + ... + c_j beyond the j-th threshold on
either side. Where these sums have one sign it has an inverse of its own kind, each side by the formulas of the plays,

    c'_0 = 1 / c_0,    c'_j = -c_j / (s_j s_(j-1)),    d'_j = sum_(i<=j) c_i (d_j - d_i)

The search for the parameters of the modified Prandtl-Ishlinskii law.

    y = offset + S(sum_i w_i z_i),    S(x) = x + sum_j c_j S_(d_j)(x)

With given weights of the plays the output is affine in those of the dead zones, which are solved for. The plays'
weights are searched; the search begins with the plain law's least squares, and with a law's own weights where there
is one. The thresholds of plays and dead zones are given,
by default evenly inside the range that the plain law's x has on the record. The weight of the dead zone zero is
one, because a factor on x could be taken for one on S. At the first sample the plays stand at zero, at the first input,
or where the cycle of the record leaves them; by default the record decides.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_whole, checked, read_only
from hysim.laws.operators._clamp_search import ClampStructure
from hysim.laws.operators._play_sums import ExtendedPlays, check_dead_zones, dead_zone, kernel_rows
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii, wrong_sum
from hysim.models.composable import Composable
from hysim.models.inverse_search import searched_inverse
from hysim.models.law import Packed, State
from hysim.models.model import Example, family
from hysim.models.parameters import Coordinate, space_of
from hysim.models.protocols import UNLIMITED, CompiledLaw, Identifiable, Limits, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

_LARGEST = 4.0  # of a weight, in slopes of the record, unless the plain law has a larger one


@checked
class DeadZoneStructure(Identifiable, Composable):
    """Plays and dead zones to be identified; see `ModifiedPrandtlIshlinskii.structure`."""

    law: type
    plays: ClampStructure
    dead_zones: tuple[float, ...] = ()
    count: int = 5
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_whole(self.count, "dead_zones", least=0)
        if self.dead_zones:
            check_dead_zones(*[np.atleast_2d(self.dead_zones)] * 2)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The plays' weights as coordinates; the dead zones' weights and the offset are linear."""
        if not freedom.starts_at_rest("rest"):
            raise ValueError('the memory of plays before dead zones is not searched: use initial="rest" or "periodic"')
        own = self.plays.search_space(record, Freedom(initial=freedom.initial))
        weights, (start, x) = own.columns[:-1], self._plain(own, record)
        zones = self._zones(x)
        columns = (*(f"dead_zone_weights[{j}]" for j in range(zones.size)), "offset")
        defaults = dict(zip(weights, start.tolist(), strict=True)) | dict.fromkeys(columns, 0.0)
        through = tuple(columns[j] for j in np.flatnonzero(zones == 0.0))
        held = freedom.held(defaults | dict.fromkeys(through, 1.0), redundant=tuple((name,) for name in through))
        limits = freedom.limits(defaults, held)
        starts = [defaults, *([dict(zip(weights, self.weights, strict=True))] if self.weights else [])]
        slope = float(np.ptp(record.y)) / float(np.ptp(record.u)) or 1.0
        largest = max(_LARGEST * abs(slope), 2.0 * float(np.abs(start).max()))  # a steep start is inside
        sides = {name: np.clip(own.bounds.get(name, (-np.inf, np.inf)), -largest, largest) for name in weights}
        box = [
            Coordinate(name, float(low), float(high), slope, physical=(low == 0.0, high == 0.0))
            for name, (low, high) in sides.items()
        ]
        held = dict(own.held) | {f"dead_zones[{j}]": d for j, d in enumerate(zones.tolist())} | held
        return space_of(box, columns, defaults, held, limits, starts, state=own.state, screened=0)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns S_0(x), S_1(x), ..., 1, 0 of the output, shape (n_sets, n_samples, n_zones + 2)."""
        z = self.plays.regressors(parameters, record)[..., :-2]
        weights = np.stack([np.ravel(parameters[f"weights[{i}]"]) for i in range(z.shape[2])], axis=-1)
        x = np.matmul(z, weights[..., np.newaxis])
        thresholds = np.stack([np.ravel(column) for column in _numbered("dead_zones", parameters)], axis=-1)
        ones = np.ones_like(x)
        return np.concatenate([dead_zone(x, thresholds[:, np.newaxis]), ones, np.zeros_like(ones)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the positions of the steady cycle of which `record` is one period or more."""
        return self.plays.steady(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The law with these parameters, one number for each name."""
        plain = self.plays.assemble(parameters)
        return self.law(
            thresholds=plain.thresholds,
            weights=plain.weights,
            dead_zones=_numbered("dead_zones", parameters),
            dead_zone_weights=_numbered("dead_zone_weights", parameters),
            offset=plain.offset,
            z0=plain.z0,
        )

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """At rest at zero or at the first input, or after the cycle."""
        return tuple(state for state in self.plays.assumed_states(record) if state != "free")

    def variants(self) -> tuple[Variant, ...]:
        """The choices of the plays."""
        return tuple(each._replace(family=replace(self, plays=each.family)) for each in self.plays.variants())

    def _plain(self, own: SearchSpace, record: Record) -> tuple[FloatArray, FloatArray]:
        """Weights of the plain law that fits best, and its output without the offset."""
        from scipy.optimize import lsq_linear

        columns = self.plays.regressors(own.parameters(np.empty((1, 0))), record)[0, :, :-1]
        limits = np.array([own.bounds.get(name, (-np.inf, np.inf)) for name in own.columns])
        size, unit = np.abs(columns).max(axis=0), float(np.abs(record.y).max()) or 1.0
        box = tuple(limits.T * size / unit)  # the tolerance of the solver is an absolute one
        weights = lsq_linear(columns / size, record.y / unit, bounds=box, method="bvls").x[:-1] * unit / size[:-1]
        return weights, columns[:, :-1] @ weights

    def _zones(self, x: FloatArray) -> FloatArray:
        """The structure's own, or zero and even steps inside the range of x."""
        if self.dead_zones:
            return np.array(self.dead_zones)
        inside = np.linspace(float(x.min()), float(x.max()), self.count + 2)[1:-1]
        return np.unique(np.append(inside, 0.0))


def _numbered(what: str, parameters: Mapping[str, Any]) -> list[Any]:
    """The values of ``what[0]``, ``what[1]``, ..."""
    count = sum(name.startswith(f"{what}[") for name in parameters)
    return [parameters[f"{what}[{j}]"] for j in range(count)]


@family
class ModifiedPrandtlIshlinskii(ExtendedPlays):
    """Modified Prandtl-Ishlinskii law: plays, and behind them dead zones, for loops that are not odd.

    ::

        x = sum_i w_i z_i,    z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)
        y = offset + S(x),    S(x) = sum_j c_j S_(d_j)(x)
        S_d(x) = max(x - d, 0) for d > 0,    min(x - d, 0) for d < 0,    x for d = 0

    Source: K. Kuhnen, European J. Control 9 (2003).

    Parameters
    ----------
    thresholds : sequence of float, length n_plays
        r_i, not negative and increasing [unit of u]. The play of threshold zero is the input itself.
    weights : sequence of float, length n_plays
        w_i, of any sign [unit of x / unit of u].
    dead_zones : sequence of float, length n_zones
        Thresholds d_j, increasing [unit of x]. That of threshold zero is x itself.
    dead_zone_weights : sequence of float, length n_zones
        c_j, of any sign [unit of y / unit of x].
    offset : float
        Output at rest at u = 0 [unit of y].
    z0 : float or sequence of float, length n_plays
        Positions before the first sample, which pushes them [unit of u].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, thresholds are negative, or either thresholds do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.ModifiedPrandtlIshlinskii(
    ...     thresholds=(0.0, 0.5), weights=(1.0, 2.0), dead_zones=(0.0, 1.0), dead_zone_weights=(1.0, 0.5)
    ... )
    >>> law.response([0.0, 1.0, 0.5, -1.0]).tolist()
    [0.0, 2.5, 1.75, -2.0]
    >>> law.inverse_response([0.0, 2.5, 1.75, -2.0]).tolist()
    [0.0, 1.0, 0.5, -1.0]
    """

    thresholds: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    dead_zones: tuple[float, ...] = (0.0,)
    dead_zone_weights: tuple[float, ...] = (1.0,)
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    units: ClassVar = {"thresholds": "u", "offset": "y", "z0": "u"}
    example = Example(
        {
            "thresholds": (0.0, 0.1, 0.2, 0.35, 0.5, 0.7), "weights": (0.4, 0.3, 0.2, 0.2, 0.1, 0.1),
            "dead_zones": (-0.4, 0.0, 0.4), "dead_zone_weights": (0.3, 1.0, -0.3),
        },
        title="Prandtl-Ishlinskii: dead zones",
    )  # fmt: skip

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse elements that are no plays or no dead zones."""
        super().check(tables)
        check_dead_zones(tables["dead_zones"], tables["dead_zone_weights"])

    @classmethod
    def structure(
        cls,
        *,
        plays: int = 10,
        thresholds: npt.ArrayLike = (),
        one_signed: bool | None = None,
        dead_zones: int | npt.ArrayLike = 5,
    ) -> DeadZoneStructure:
        """Plays and dead zones for `hysim.identify`; `plays`, `thresholds` and `one_signed` as of `PrandtlIshlinskii`.

        `dead_zones` is their number beside that of threshold zero, whose weight is held at one, with thresholds in even
        steps inside the range that the plays alone would give; or the thresholds themselves [unit of x]. Raises
        ValueError or TypeError as `PrandtlIshlinskii.structure`, or if dead zones do not increase.

        Examples
        --------
        >>> import hysim as hs
        >>> structure = hs.ModifiedPrandtlIshlinskii.structure(plays=4, dead_zones=2)
        >>> hs.identify(structure, hs.datasets.table1()).n_parameters
        7
        """
        counted = isinstance(dead_zones, int)
        return DeadZoneStructure(
            law=cls,
            plays=PrandtlIshlinskii.structure(plays=plays, thresholds=thresholds, one_signed=one_signed),
            count=dead_zones if isinstance(dead_zones, int) else 0,
            dead_zones=() if counted else tuple(read_only(dead_zones, "dead_zones", ndim=1).tolist()),
        )

    def inverted(self, y: FloatArray, u0: float | None, state: State | None) -> FloatArray:
        """The inverse of S, then that of the plays, exact to rounding.

        Raises ValueError also if z0 holds
        positions that no input leads to; one for a law that is not invertible names the weight.
        """
        if (refusal := self.refusal()) is not None:
            raise ValueError(refusal)
        wanted = y - self.offset
        slope = self.dead_zone_weights[self.dead_zones.index(0.0)]
        x = wanted / slope
        for side in (1.0, -1.0):
            inverse = self._side(side).inverse()
            for threshold, weight in zip(inverse.thresholds[1:], inverse.weights[1:], strict=True):
                x += weight * dead_zone(wanted, np.copysign(threshold, side * slope))
        return self.plays.inverted(x, u0, state)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Rows with dead zones; see `hysim.kernels.play_sums`."""
        behind = tables["dead_zones"], tables["dead_zone_weights"]
        return Packed(kernel_rows(tables, behind=behind), cls.initial_memory(tables))

    def as_structure(self) -> DeadZoneStructure:
        """The structure with the thresholds of this law, or with those by default where it has none."""
        one_signed = None if self.plays.is_one_signed() else False
        plays = replace(PrandtlIshlinskii.structure(thresholds=self.thresholds), one_signed=one_signed)
        own = self.dead_zones if self.thresholds else ()
        count = 0 if own else 5
        return DeadZoneStructure(law=type(self), plays=plays, dead_zones=own, count=count, weights=self.weights)

    def _side(self, side: float) -> PrandtlIshlinskii:
        """Plays whose initial curve is the sum of the dead zones from zero upwards, or (side = -1) downwards."""
        ranked = sorted(zip((side * d for d in self.dead_zones), self.dead_zone_weights, strict=True))
        thresholds, weights = zip(*((d, c) for d, c in ranked if d >= 0.0), strict=True)
        return PrandtlIshlinskii(thresholds=tuple(np.abs(thresholds).tolist()), weights=weights)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        return searched_inverse(self, self.compiled(u0), limits=limits)

    def refusal(self) -> str | None:
        """Why the law has no inverse: r_0 > 0, no dead zone of threshold zero, or weights whose sums change sign."""
        if 0.0 not in self.dead_zones:
            return "the law has no inverse: without a dead zone of threshold zero its output stands still about x = 0"
        for side in (1.0, -1.0):
            zones = self._side(side)
            if (wrong := wrong_sum(zones.weights)) is not None:
                return (
                    f"the law has no inverse: from the dead zone 0 outwards the sums of weights must have one sign, "
                    f"but with the weight {zones.weights[wrong]:g} of the dead zone "
                    f"{side * zones.thresholds[wrong]:g} they come to {sum(zones.weights[: wrong + 1]):g}"
                )
        return self.plays.refusal()
