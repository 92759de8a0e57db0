"""Backlash of an elastic shaft."""

from typing import ClassVar

from hysim.kernels import backlash as kernels
from hysim.laws.friction.rated_law import RatedLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.tables import Tables


@family
class ElasticBacklash(RatedLaw):
    """Backlash of a flexible shaft with damping, or a gap in series with a spring and a damper.

    ::

        T = offset + stiffness x + damping x'    in contact,    offset    in the gap
        x = u - center - b,    |b| <= half_gap

    u is the twist between the two sides, b the part of it that the gap takes, x the twist of the shaft. In the gap the
    shaft, without load, untwists as x' = -(stiffness / damping) x, so that contact ends before the shaft has no twist,
    and neither side ever pulls. Without damping it is a dead zone, which has no memory. The physical model of M.
    Nordin, J. Galic and P.-O. Gutman, New models for backlash and gear play, Int. J. Adaptive Control and Signal
    Processing 11 (1997) 49-63; reviewed by M. Nordin and P.-O. Gutman, Controlling mechanical systems with backlash,
    Automatica 38 (2002) 1633-1649. Before the first sample the shaft rests.

    Parameters
    ----------
    stiffness : float
        Positive [unit of y / unit of u].
    damping : float
        Not negative [unit of y s / unit of u].
    half_gap : float
        Half the width of the gap, not negative [unit of u].
    center : float
        Input in the middle of the gap [unit of u].
    offset : float
        Output in the gap [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, the stiffness is not positive, or damping or half gap are negative.

    Examples
    --------
    >>> import hysim as hs
    >>> shaft = hs.ElasticBacklash(stiffness=100.0, damping=1.0, half_gap=0.1)
    >>> shaft.response([0.0, 0.05, 0.2, 0.19, 0.1], sample_time=0.1).round(6).tolist()
    [0.0, 0.0, 11.5, 8.9, 0.0]
    """

    stiffness: float = 1.0
    damping: float = 0.0
    half_gap: float = 0.0
    center: float = 0.0
    offset: float = 0.0

    positive = ("stiffness",)
    not_negative = ("damping", "half_gap")
    example = Example(
        {"stiffness": 2.0, "damping": 0.05, "half_gap": 0.4},
        title="Backlash of an elastic shaft",
        units={"u": "rad", "y": "N m"},
        kind="sine",
    )
    step = staticmethod(kernels.step)
    rated_step = staticmethod(kernels.rated_step)
    initial: ClassVar[tuple[str, ...]] = ()
    searched = (
        Parameter("stiffness", 1e-2, 1e4, unit="y/u", log=True),
        Parameter("damping", 1e-6, 1e2, unit="y/v", log=True),
        Parameter("half_gap", 1e-4, 1.0, unit="h", log=True),
        Parameter("center", -1.5, 1.5, unit="u", from_first=True),
        Parameter("offset", affine=True),
    )
    starts: ClassVar = tuple(
        {"stiffness": 2.0, "damping": damping, "half_gap": gap, "center": center}
        for damping in (1e-3, 0.1)
        for gap in (0.1, 0.5)
        for center in (-0.5, 0.0, 0.5)
    )
    screened = 512

    @classmethod
    def further(cls, tables: Tables) -> int:
        """The part of the twist that the gap takes, and whether it has begun to."""
        return 2
