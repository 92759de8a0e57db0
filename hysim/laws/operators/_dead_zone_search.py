"""The search for the parameters of the modified Prandtl-Ishlinskii law.

    y = offset + S(sum_i w_i z_i),    S(x) = x + sum_j c_j S_(d_j)(x)

With given weights of the plays the output is affine in those of the dead zones, which are solved for. The plays'
weights are searched; the search begins with the plain law's least squares, and with a law's own weights where there
is one. The thresholds of plays and dead zones are given,
by default evenly inside the range that the plain law's x has on the record. The weight of the dead zone zero is
one, because a factor on x could be taken for one on S. At the first sample the plays stand at zero, at the first input,
or where the cycle of the record leaves them; by default the record decides.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, check_whole, checked
from hysim.laws.operators._clamp_search import ClampStructure
from hysim.laws.operators._play_sums import check_dead_zones, dead_zone
from hysim.models.composable import Composable
from hysim.models.parameters import Coordinate, space_of
from hysim.models.protocols import Identifiable, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
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
