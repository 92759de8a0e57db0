"""Parts of a force that are a function of the velocity, times one coefficient: the viscous damper."""

from typing import ClassVar, Self

from hysim._basics.frozen import check_not_negative
from hysim.kernels import stepping
from hysim.laws.friction.rated_law import TimedLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter


class RatePart(TimedLaw):
    """A part ``y = c f(u')`` of a sum; a family has the field c and its step."""

    initial: ClassVar[tuple[str, ...]] = ()
    searched = (Parameter("c", affine=True),)
    memory = None  # type: ignore[assignment]  # a damper remembers nothing


@family
class Dashpot(RatePart):
    """Viscous damper, ``y = c u'``.

    Between the samples of an input that is linear there, u' is constant. At a sample the output is that of the stroke
    which ends there, the left limit: ``y_k = c (u_k - u_(k-1)) / h``.

    Parameters
    ----------
    c : float
        [unit of y s / unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Dashpot(c=2.0).response([0.0, 1.0, 1.0, 0.5], sample_time=0.5).tolist()
    [0.0, 4.0, 0.0, -2.0]
    """

    c: float = 1.0

    example = Example({"c": 2.0})
    step = staticmethod(stepping.dashpot)

    @classmethod
    def eddy_currents(cls, *, conductivity: float, thickness: float) -> Self:
        """The field of classical eddy currents in a lamination by its flux density, ``H = sigma d^2 / 12 dB/dt``.

        It holds where the field in the lamination is even, that is where the skin depth is large beside d.

        Parameters
        ----------
        conductivity : float
            sigma, not negative [S/m].
        thickness : float
            d of the lamination, not negative [m].

        Returns
        -------
        Dashpot
            From the flux density [T] to the field [A/m].

        Raises
        ------
        ValueError
            If a number is negative.

        Examples
        --------
        >>> import hysim as hs
        >>> round(hs.Dashpot.eddy_currents(conductivity=2e6, thickness=0.3e-3).c, 6)
        0.015
        """
        check_not_negative(conductivity=conductivity, thickness=thickness)
        return cls(c=conductivity * thickness**2 / 12.0)
