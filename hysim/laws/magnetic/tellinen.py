"""Tellinen's law between two branches of tanh.

Base of the laws between two branches of one curve, a coercivity to either side of the middle.

Both branches go from -saturation to saturation; the upper one has the remanence at zero input and crosses zero at
-coercivity. The place z is -1 on the lower and 1 on the upper one; at z = 0 and zero input the law is demagnetised.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from hysim.kernels import tellinen as kernels
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine
from hysim.models.tables import Tables
from hysim.records import Record

VACUUM = 1.25663706212e-6
"""Magnetic constant of 2018 [T m / A]."""

_SHAPES = ((0.03, 0.1), (0.1, 0.5), (0.3, 0.5), (0.3, 0.9))  # coercivity in half spans of the input, squareness


@dataclass(frozen=True, kw_only=True, eq=False)
class Branches(Law):
    """A law with the parameters of two branches in front of those of its family."""

    saturation: float = 1.0
    coercivity: float = 1.0
    squareness: float = 0.5
    feedthrough: float = 0.0


class BranchLaw(Branches):
    """A law with the fields offset and z0 after those of its branches."""

    offset: float
    z0: float

    positive = ("coercivity", "squareness")
    within: ClassVar = {"squareness": ("below", 1.0), "z0": ("of a size of at most", 1.0)}
    units: ClassVar[Mapping[str, str]] = {"squareness": "1", "z0": "1"}
    states: ClassVar[tuple[str, ...]] = ("rest", "periodic", "free")
    powers: ClassVar = {"saturation": None, "feedthrough": 1, "offset": 0}
    searched: ClassVar[tuple[Parameter, ...]] = (
        *affine("saturation", "offset", unit="y"),
        Parameter("coercivity", 1e-3, 3.0, unit="h", log=True),
        Parameter("squareness", 1e-3, 0.999, physical=(True, True)),
        Parameter("feedthrough", 0.0, unit="y/u", affine=True, physical=(True, False)),  # no core falls at saturation
        Parameter("z0", -1.0, 1.0, physical=(True, True)),
    )
    starts = tuple(
        {"coercivity": coercivity, "squareness": squareness, "z0": z0}
        for coercivity, squareness in _SHAPES
        for z0 in (-1.0, 0.0, 1.0)
    )
    screened = 64

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

    @property
    def output_bounds(self) -> tuple[float, float]:
        """The saturation on both sides of the offset; no limit with a feedthrough."""
        size = abs(self.saturation) if self.feedthrough == 0.0 else math.inf
        return self.offset - size, self.offset + size

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """Demagnetised, in the steady cycle, or anywhere between the branches: the record decides."""
        return self.states


@family
class Tellinen(BranchLaw):
    """Tellinen's law of magnetic cores: the slope of a branch of the limiting loop, by the distance left to the other.

    ::

        y        = offset + feedthrough u + saturation m
        rising   m' = (upper - m) / (upper - lower) lower',    falling  m' = (m - lower) / (upper - lower) upper'
        upper    = tanh((u + coercivity) / scale),    lower = tanh((u - coercivity) / scale)

    with ``scale = coercivity / artanh(squareness)``, so that the limiting loop passes through ``squareness
    saturation`` at u = 0. u is the field H and y the flux density B. Every stroke is a sum of two decays of the
    distance to a branch, evaluated exactly. The law knows the last input and one number more: a small loop does not
    close at once, and inner loops are not wiped out. Sources: J. Tellinen, IEEE Trans. Magn. 34 (1998) 2200; the
    branches of tanh are those of the Modelica Standard Library, ``GenericHystTellinenSoft``.

    Parameters
    ----------
    saturation : float
        Magnetisation to which both branches tend [unit of y].
    coercivity : float
        Half the width of the limiting loop at m = 0, positive [unit of u].
    squareness : float
        Remanence over saturation of the limiting loop, between 0 and 1.
    feedthrough : float
        Slope dy/du at saturation [unit of y / unit of u]: the magnetic constant where y is a flux density.
    offset : float
        Output of the demagnetised law at u = 0 [unit of y].
    z0 : float
        Place between the branches at the first sample, from -1 (lower) to 1 (upper); 0 is demagnetised at u = 0.

    Raises
    ------
    ValueError
        If a number is not finite, coercivity not positive, squareness not between 0 and 1, or z0 not between -1 and 1.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.Tellinen(saturation=1.8, coercivity=120.0, squareness=0.5)
    >>> core.response([0.0, 500.0, 0.0, -120.0]).round(4).tolist()
    [0.0, 1.7126, 0.8681, -0.0185]
    """

    offset: float = 0.0
    z0: float = 0.0

    example = Example({"coercivity": 0.4, "squareness": 0.7}, (-2.0, 2.0), title="Magnetic core: Tellinen")
    step = staticmethod(kernels.step)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.tellinen` has them, and the memory (u, z)."""
        s, coercivity = tables["squareness"], tables["coercivity"]
        scale = coercivity / (0.5 * (np.log1p(s) - np.log1p(-s)))
        rates = [(1.0 - s) * (1.0 - s) / (2.0 * s), (1.0 + s) * (1.0 + s) / (2.0 * s)]
        head = [tables[name] for name in ("offset", "saturation", "feedthrough", "coercivity")]
        return Packed(np.concatenate([*head, scale, *rates], axis=1), cls.initial_memory(tables))

    @property
    def bend(self) -> float:
        """Scale of the branches, ``coercivity / artanh(squareness)`` [unit of u]."""
        return self.coercivity / math.atanh(self.squareness)

    @classmethod
    def from_modelica(cls, *, Js: float, Br: float, Hc: float, K: float = 1.0) -> Self:
        """The law of a ``GenericHystTellinenSoft`` of the Modelica Standard Library, demagnetised.

        Two guards of that model against division by zero are left out here, where nothing is divided: branches Js /
        1000 further apart, and a share of the slope of at least 0.01.

        Parameters
        ----------
        Js, Br : float
            Saturation polarisation and remanence, 0 < Br < Js [T].
        Hc : float
            Coercivity [A/m].
        K : float
            Slope at saturation over the magnetic constant.

        Returns
        -------
        Tellinen
            From H [A/m] to B [T].

        Raises
        ------
        ValueError
            If the numbers are no pair of branches.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.Tellinen.from_modelica(Js=1.8, Br=0.9, Hc=120.0).to_modelica()["Br"]
        0.9
        """
        return cls(saturation=Js, coercivity=Hc, squareness=Br / Js, feedthrough=K * VACUUM)

    def to_modelica(self) -> dict[str, float]:
        """The parameters of a ``GenericHystTellinenSoft`` by name; ValueError if the law has an offset."""
        if self.offset != 0.0:
            raise ValueError(f"GenericHystTellinenSoft has no offset, got {self.offset:g}")
        return {"Js": self.saturation, "Br": self.remanence, "Hc": self.coercivity, "K": self.feedthrough / VACUUM}
