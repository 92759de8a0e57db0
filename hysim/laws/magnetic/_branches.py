"""Base of the laws between two branches of one curve, a coercivity to either side of the middle.

Both branches go from -saturation to saturation; the upper one is at the remanence where the input is zero, and crosses
zero at -coercivity. The place z between the branches is -1 on the lower one and 1 on the upper one; at z = 0 the law
is demagnetised where the input is zero.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from hysim.models.law import Law
from hysim.models.parameters import Parameter
from hysim.models.protocols import Variant
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

VACUUM = 1.25663706212e-6
"""Magnetic constant of 2018 [T m / A]."""

_SHAPES = ((0.03, 0.1), (0.1, 0.5), (0.3, 0.5), (0.3, 0.9))  # coercivity in half spans of the input, squareness
_SIDES = {"feedthrough": (0.0, np.inf)}  # of affine parameters: no core falls at saturation


class BranchLaw(Law):
    """A law with the fields saturation, coercivity, squareness, feedthrough, offset and z0."""

    saturation: float
    coercivity: float
    squareness: float
    feedthrough: float
    offset: float
    z0: float

    units: ClassVar[Mapping[str, str]] = {"squareness": "1", "z0": "1"}
    states: ClassVar[tuple[str, ...]] = ("rest", "periodic", "free")
    searched: ClassVar[tuple[Parameter, ...]] = (
        Parameter("saturation", unit="y", affine=True),
        Parameter("coercivity", 1e-3, 3.0, unit="h", log=True),
        Parameter("squareness", 1e-3, 0.999, physical=(True, True)),
        Parameter("feedthrough", unit="y/u", affine=True),
        Parameter("offset", unit="y", affine=True),
        Parameter("z0", -1.0, 1.0, physical=(True, True)),
    )
    starts = tuple(
        {"coercivity": coercivity, "squareness": squareness, "z0": z0}
        for coercivity, squareness in _SHAPES
        for z0 in (-1.0, 0.0, 1.0)
    )
    screened = 64

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse a coercivity that is not positive, a squareness that is none, and a place beyond a branch."""
        if not (tables["coercivity"] > 0.0).all():
            raise ValueError(f"coercivity must be positive, got {tables['coercivity'].min()}")
        squareness = tables["squareness"].ravel()
        wrong = squareness[~((squareness > 0.0) & (squareness < 1.0))]
        if wrong.size:
            raise ValueError(f"squareness, remanence over saturation, must be between 0 and 1, got {wrong[0]}")
        if not (abs(tables["z0"]) <= 1.0).all():
            raise ValueError(f"z0 must be from -1 (lower branch) to 1 (upper branch), got {tables['z0'].ravel()}")

    @property
    @abstractmethod
    def bend(self) -> float:
        """Saturation over the slope of a branch where it is steepest [unit of u]."""

    @property
    def remanence(self) -> float:
        """Magnetisation of the limiting loop at zero field [unit of y]."""
        return self.saturation * self.squareness

    @property
    def known_slopes(self) -> tuple[float, float]:
        """From that of the feedthrough alone to that of a branch where it is steepest."""
        ends = self.feedthrough, self.feedthrough + self.saturation / self.bend
        return min(ends), max(ends)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The declared box, with a feedthrough that is not negative unless the user's bounds say so."""
        space = super().search_space(record, freedom)
        sides = {name: side for name, side in _SIDES.items() if name in space.linear}
        return replace(space, bounds={**sides, **space.bounds})

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """Demagnetised, in the steady cycle, or anywhere between the branches: the record decides."""
        return self.states

    def variants(self) -> tuple[Variant, ...]:
        """None: nothing else is left open."""
        return ()
