"""Dahl's friction law."""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.laws.differential.boucwen import EquivalentBoucWen
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.tables import Tables

_STARTS = ((0.03, 0.5), (0.1, 0.5), (0.3, 0.7), (1.0, 1.5))  # coulomb / stiffness in spans of u, coulomb in spans of y


@family
class Dahl(EquivalentBoucWen):
    """Dahl friction, ``F' = stiffness (u' - |u'| F / coulomb)`` and ``y = offset + F``.

    u is the displacement, F the force; Dahl's exponent is 1. It is the Bouc-Wen law with A = stiffness, beta =
    stiffness / coulomb, n = 1 and gamma = 0. Source: P. R. Dahl, A solid friction model, Aerospace Corporation 1968.

    Parameters
    ----------
    stiffness : float
        Slope dF/du at F = 0, positive [unit of y / unit of u].
    coulomb : float
        Force to which ``|F|`` tends, positive [unit of y].
    offset : float
        Output at F = 0 [unit of y].
    z0 : float
        Force F at the first sample [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, or stiffness or coulomb is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> friction = hs.Dahl(stiffness=2.0, coulomb=0.5)
    >>> friction.response([0.0, 1.0, 0.9]).round(6).tolist()
    [0.0, 0.490842, 0.164181]
    """

    stiffness: float = 1.0
    coulomb: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    positive = ("stiffness", "coulomb")
    example = Example({"stiffness": 1.0, "coulomb": 0.8}, (-2.0, 2.0), title="Dahl")
    searched = (
        Parameter("stiffness", 1e-4, 1e5, unit="y/u", log=True),
        Parameter("coulomb", 1e-2, 1e2, unit="y", log=True),
        Parameter("offset", unit="y", affine=True),
        Parameter("z0", unit="y", affine=True),
    )
    starts = tuple({"stiffness": force / length, "coulomb": force} for length, force in _STARTS)
    screened = 512

    @classmethod
    def equivalent(cls, tables: Tables) -> dict[str, FloatArray]:
        """The law with A = stiffness and beta = stiffness / coulomb."""
        A, gamma = tables["stiffness"], np.zeros_like(tables["stiffness"])
        beta = tables["stiffness"] / tables["coulomb"]
        return {"A": A, "beta": beta, "gamma": gamma, "offset": tables["offset"], "z0": tables["z0"]}

    @property
    def saturation(self) -> float:
        """Limit of ``|F|`` on a long stroke, the Coulomb force."""
        return self.coulomb
