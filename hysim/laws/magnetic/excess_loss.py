"""The field of excess loss, which a core needs in addition to hysteresis and classical eddy currents."""

import math
from typing import Self

from hysim._basics.frozen import check_not_negative
from hysim.kernels import core_losses as losses
from hysim.laws.dashpot import RatePart
from hysim.models.model import Example, family

_BERTOTTI = 0.1356
"""Bertotti's dimensionless coefficient of eddy current damping by one magnetic object, 4 / pi^3 sum 1 / (2 k + 1)^3."""


@family
class ExcessLoss(RatePart):
    """Field of excess loss by the flux density, ``y = c sign(u') sqrt(|u'|)``.

    u is the flux density B and y the field H. Beside a law with the input B and a `Dashpot` of classical eddy currents
    it gives the loss per cycle its three parts: constant, proportional to the frequency, and to its square root. The
    output is that of the stroke which ends at the sample. Source: G. Bertotti, IEEE Trans. Magn. 24 (1988) 621.

    Parameters
    ----------
    c : float
        [unit of y s^(1/2) / unit of u^(1/2)].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.ExcessLoss(c=2.0).response([0.0, 2.0, 2.0, 1.5], sample_time=0.5).tolist()
    [0.0, 4.0, 0.0, -2.0]
    """

    c: float = 1.0

    example = Example({"c": 2.0})
    step = staticmethod(losses.excess)

    @classmethod
    def from_bertotti(cls, *, conductivity: float, cross_section: float, V0: float) -> Self:
        """The law by Bertotti's numbers, ``c = sqrt(sigma G V0 S)`` with G = 0.1356.

        Parameters
        ----------
        conductivity : float
            sigma, not negative [S/m].
        cross_section : float
            S of the lamination, not negative [m^2].
        V0 : float
            Field that describes the local coercive fields, not negative [A/m].

        Returns
        -------
        ExcessLoss
            From the flux density [T] to the field [A/m].

        Raises
        ------
        ValueError
            If a number is negative.

        Examples
        --------
        >>> import hysim as hs
        >>> round(hs.ExcessLoss.from_bertotti(conductivity=2e6, cross_section=9e-6, V0=0.1).c, 4)
        0.494
        """
        check_not_negative(conductivity=conductivity, cross_section=cross_section, V0=V0)
        return cls(c=math.sqrt(conductivity * _BERTOTTI * V0 * cross_section))
