"""The modified Prandtl-Ishlinskii law: plays, followed by dead zones, for loops that are not odd.

S is a broken line through zero, of the slope c_0 about zero and c_0 + c_1 + ... + c_j beyond the j-th threshold on
either side. Where these sums have one sign it has an inverse of its own kind, each side by the formulas of the plays,

    c'_0 = 1 / c_0,    c'_j = -c_j / (s_j s_(j-1)),    d'_j = sum_(i<=j) c_i (d_j - d_i)
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim.laws.operators._bank import Plays
from hysim.laws.operators._bank_search import BankStructure, check_dead_zones, dead_zone, named
from hysim.laws.operators._play_sums import EXAMPLE, PlaySum
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii, wrong_sum
from hysim.models.law import Law, State
from hysim.models.model import Example, family
from hysim.models.tables import Tables


@family
class ModifiedPrandtlIshlinskii(Plays, PlaySum):
    """Modified Prandtl-Ishlinskii law: plays, followed by dead zones, for loops that are not odd.

    ::

        x = sum_i w_i z_i,    z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)
        y = offset + S(x),    S(x) = sum_j c_j S_(d_j)(x)
        S_d(x) = max(x - d, 0) for d > 0,    min(x - d, 0) for d < 0,    x for d = 0

    Source: K. Kuhnen, European J. Control 9 (2003).

    Parameters
    ----------
    thresholds, weights
        As in `PrandtlIshlinskii` [unit of u, unit of x / unit of u].
    dead_zones, dead_zone_weights : sequence of float, length n_zones
        Thresholds d_j, increasing [unit of x], and c_j, of any sign [unit of y / unit of x]. S of threshold zero is x.
    offset, z0
        As in `PrandtlIshlinskii` [unit of y, unit of u].

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
    >>> law.response([0.0, 1.0, 0.5, -1.0]).tolist(), law.inverse_response([0.0, 2.5, 1.75, -2.0]).tolist()
    ([0.0, 2.5, 1.75, -2.0], [0.0, 1.0, 0.5, -1.0])
    """

    dead_zones: tuple[float, ...] = (0.0,)
    dead_zone_weights: tuple[float, ...] = (1.0,)
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    units: ClassVar = {"thresholds": "u", "offset": "y", "z0": "u"}
    by_input: ClassVar[bool] = False
    example = Example(
        {**EXAMPLE, "dead_zones": (-0.4, 0.0, 0.4), "dead_zone_weights": (0.3, 1.0, -0.3)},
        title="Prandtl-Ishlinskii: dead zones",
    )

    @classmethod
    def check(cls, tables: Tables) -> None:
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
    ) -> BankStructure:
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
        plain = super().structure(plays=plays, thresholds=thresholds, one_signed=one_signed)
        if isinstance(dead_zones, int):
            return replace(plain, zones=dead_zones)
        return replace(plain, zones=0, dead_zones=tuple(read_only(dead_zones, "dead_zones", ndim=1).tolist()))

    def inverted(self, y: FloatArray, u0: float | None, state: State | None) -> FloatArray:
        """The inverse of S, then that of the plays, exact to rounding.

        ValueError also if no input leads to the positions z0; one for a law that is not invertible names the weight.
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

    def as_structure(self) -> BankStructure:
        own, known = named("weights", self.weights), self.dead_zones if self.thresholds else ()
        return replace(super().as_structure(), own=own, dead_zones=known)

    def _side(self, side: float) -> PrandtlIshlinskii:
        """Plays whose initial curve is the sum of the dead zones from zero upwards, or (side = -1) downwards."""
        ranked = sorted(zip((side * d for d in self.dead_zones), self.dead_zone_weights, strict=True))
        thresholds, weights = zip(*((d, c) for d, c in ranked if d >= 0.0), strict=True)
        return PrandtlIshlinskii(thresholds=tuple(np.abs(thresholds).tolist()), weights=weights)

    compiled_inverse = Law.compiled_inverse

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
