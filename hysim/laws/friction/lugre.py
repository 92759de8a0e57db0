"""The LuGre model of friction."""

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels import lugre as kernels
from hysim.laws.friction.rated_law import RatedLaw, curve
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine


@family
class LuGre(RatedLaw):
    """LuGre friction: bristles that bend and slip, whose friction falls with the speed.

    ::

        z' = v - sigma0 |v| z / g(v),    F = offset + sigma0 z + sigma1 z' + sigma2 v
        g(v) = coulomb + (breakaway - coulomb) exp(-|v / stribeck_velocity|^stribeck_exponent)

    u is the displacement, v its velocity, F the friction force. Between samples u is linear and z exact, however stiff
    the bristles. With sigma1 = sigma2 = 0 and breakaway = coulomb it is `hysim.Dahl`, and does not depend on the rate.
    Sources: C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky, A new model for control of systems with
    friction, IEEE Trans. Automatic Control 40 (1995) 419-425; for the damping that falls with the speed H. Olsson,
    Control systems with friction, Lund Institute of Technology (1996).

    Parameters
    ----------
    sigma0 : float
        Stiffness of the bristles, positive [unit of y / unit of u].
    sigma1 : float
        Their damping [unit of y s / unit of u].
    sigma2 : float
        Viscous friction [unit of y s / unit of u].
    coulomb : float
        Friction at high speed without the viscous part, positive [unit of y].
    breakaway : float
        Friction at the speed zero, the static friction, positive [unit of y].
    stribeck_velocity : float
        Speed over which the friction falls from breakaway to coulomb, positive [unit of u / s].
    stribeck_exponent : float
        Positive; 2 in the source, 1 is Tustin's.
    damping_velocity : float
        Speed v_d over which the bristles' damping falls, sigma1 exp(-(v / v_d)^2) [unit of u / s]; 0: it does not.
    offset : float
        Output at rest without bent bristles [unit of y].
    z0 : float
        Deflection of the bristles at the first sample [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, one of sigma0, coulomb, breakaway, stribeck_velocity and stribeck_exponent is not
        positive, or damping_velocity is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> friction = hs.LuGre(sigma0=1e5, sigma1=300.0, sigma2=0.4, coulomb=1.0, breakaway=1.5, stribeck_velocity=0.001)
    >>> friction.response([0.0, 5e-6, 1e-4, 2e-4], sample_time=0.01).round(4).tolist()
    [0.0, 0.5248, 1.0039, 1.004]
    >>> friction.steady_force([0.0, 0.001, 0.1]).round(4).tolist()
    [0.0, 1.1843, 1.04]
    """

    sigma0: float = 1e5
    sigma1: float = 0.0
    sigma2: float = 0.0
    coulomb: float = 1.0
    breakaway: float = 1.5
    stribeck_velocity: float = 0.001
    stribeck_exponent: float = 2.0
    damping_velocity: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    short = "lugre"
    positive = ("sigma0", "coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent")
    not_negative = ("damping_velocity",)
    example = Example(
        {
            "sigma0": 20.0, "sigma1": 0.1, "sigma2": 0.02, "coulomb": 1.0, "breakaway": 1.5, "stribeck_velocity": 2.0,
        },
        title="Friction: LuGre",
        units={"u": "mm", "y": "N"},
        kind="sine",
    )  # fmt: skip
    step = staticmethod(kernels.step)
    rated_step = staticmethod(kernels.rated_step)
    searched = (
        Parameter("sigma0", 1e-2, 1e6, unit="y/u", log=True),
        *(Parameter(name, 1e-3, 1e1, unit="y", log=True) for name in ("coulomb", "breakaway")),
        Parameter("stribeck_velocity", 1e-4, 1e1, unit="v", log=True),
        Parameter("z0", -1.0, 1.0, unit="breakaway/sigma0", physical=(True, True)),
        *affine("sigma1", "sigma2", "offset"),
    )
    starts: ClassVar = tuple(
        {"sigma0": 0.4 / length, "coulomb": 0.4, "breakaway": level, "stribeck_velocity": velocity}
        for length in (1e-4, 1e-2)
        for level in (0.4, 0.6)
        for velocity in (0.01, 0.1)
    )
    screened = 512

    @property
    def viscosity(self) -> float:
        """Damping of bristles that stick, and the viscous friction, sigma1 + sigma2."""
        return self.sigma1 + self.sigma2

    def friction(self, velocity: npt.ArrayLike) -> FloatArray:
        """Stribeck's curve g at velocities of any shape, without sign and viscous friction [unit of y]."""
        return curve(velocity, self.coulomb, self.breakaway, self.stribeck_velocity, self.stribeck_exponent)

    def steady_force(self, velocity: npt.ArrayLike) -> FloatArray:
        """Force after a long motion at constant velocities of any shape [unit of y]."""
        v = np.asarray(velocity, dtype=float)
        return np.asarray(self.offset + np.sign(v) * self.friction(v) + self.sigma2 * v)

    def is_passive(self) -> bool:
        """Whether friction is known to take no more energy out than the bristles hold, at any motion.

        For a constant sigma1 the condition sigma2 >= sigma1 (breakaway / coulomb - 1) is necessary and sufficient (N.
        Barabanov and R. Ortega, IEEE Trans. Automatic Control 45, 2000, 2028-2032). With a damping_velocity it is
        sufficient that ``sigma1(v) |v| <= 4 coulomb`` at every speed, which False does not deny.

        Examples
        --------
        >>> import hysim as hs
        >>> [hs.LuGre(sigma1=300.0, sigma2=0.4, damping_velocity=v).is_passive() for v in (0.0, 0.01)]
        [False, True]
        """
        if self.sigma1 < 0.0 or self.sigma2 < 0.0:
            return False
        highest = max(self.breakaway, self.coulomb)
        lowest = min(self.breakaway, self.coulomb)
        always = self.sigma2 >= self.sigma1 * (highest / lowest - 1.0)
        if self.damping_velocity == 0.0:
            return always
        return always or self.sigma1 * self.damping_velocity / math.sqrt(2.0 * math.e) <= 4.0 * lowest
