"""Tellinen's law between two branches of tanh."""

import math
from typing import Self

import numpy as np

from hysim.kernels.magnetics import tellinen as kernels
from hysim.laws.magnetic._branches import VACUUM, BranchLaw
from hysim.models.law import Packed
from hysim.models.model import Example, family
from hysim.models.tables import Tables


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
        If a number is not finite, coercivity is not positive, squareness is not between 0 and 1, or z0 not between
        -1 and 1.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.Tellinen(saturation=1.8, coercivity=120.0, squareness=0.5)
    >>> core.response([0.0, 500.0, 0.0, -120.0]).round(4).tolist()
    [0.0, 1.7126, 0.8681, -0.0185]
    """

    saturation: float = 1.0
    coercivity: float = 1.0
    squareness: float = 0.5
    feedthrough: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    example = Example({"coercivity": 0.4, "squareness": 0.7}, (-2.0, 2.0), title="Magnetic core: Tellinen")
    step = staticmethod(kernels.step)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.magnetics.tellinen` has them, and the memory (u, z)."""
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

        Notes
        -----
        Two guards of that model against division by zero are left out here, where nothing is divided: branches Js /
        1000 further apart, and a share of the slope of at least 0.01.

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
