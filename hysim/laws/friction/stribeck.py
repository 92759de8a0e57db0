"""Friction as a curve of the velocity."""

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels import stribeck as kernels
from hysim.laws.friction.rated_law import RatedLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine


@family
class StribeckFriction(RatedLaw):
    """Coulomb, Stribeck and viscous friction, a smooth curve of the velocity.

    ::

        F = offset + sqrt(2 e) (breakaway - coulomb) exp(-(v / v_s)^2) v / v_s + coulomb tanh(v / v_c) + viscous v
        v_s = sqrt(2) breakaway_velocity,    v_c = breakaway_velocity / 10

    v = u' is constant between samples; at a sample that of the stroke which ends there. Friction at rest is a slow
    creep: a force below the breakaway force moves a mass at a speed below the breakaway velocity. `hysim.LuGre` sticks.
    Formula and parameters are those of the block Translational Friction of Simscape, MathWorks.

    Parameters
    ----------
    coulomb : float
        Friction at high speed without the viscous part [unit of y].
    breakaway : float
        Peak of the friction, about at the breakaway velocity [unit of y].
    breakaway_velocity : float
        Positive [unit of u / s].
    viscous : float
        [unit of y s / unit of u]
    offset : float
        Output at rest [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, or the breakaway velocity is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> friction = hs.StribeckFriction(coulomb=20.0, breakaway=25.0, breakaway_velocity=0.1, viscous=100.0)
    >>> friction.steady_force([0.1, 1.0]).round(3).tolist()
    [35.0, 120.0]
    >>> friction.response([0.0, 0.1, 0.1], sample_time=1.0).round(3).tolist()
    [0.0, 35.0, 0.0]
    """

    coulomb: float = 1.0
    breakaway: float = 1.5
    breakaway_velocity: float = 0.001
    viscous: float = 0.0
    offset: float = 0.0

    positive = ("breakaway_velocity",)
    example = Example(
        {"coulomb": 1.0, "breakaway": 1.5, "breakaway_velocity": 1.0, "viscous": 0.05},
        title="Friction: Stribeck",
        units={"u": "mm", "y": "N"},
        kind="sine",
    )
    step = staticmethod(kernels.step)
    rated_step = staticmethod(kernels.rated_step)
    initial: ClassVar[tuple[str, ...]] = ()
    searched = (
        Parameter("breakaway_velocity", 1e-4, 1e1, unit="v", log=True),
        *affine("coulomb", "breakaway", "viscous", "offset"),
    )
    starts: ClassVar = tuple({"breakaway_velocity": velocity} for velocity in (0.001, 0.01, 0.1))
    memory = None  # type: ignore[assignment]  # it remembers nothing

    @property
    def viscosity(self) -> float:
        return self.viscous

    def steady_force(self, velocity: npt.ArrayLike) -> FloatArray:
        """Force at velocities, shape (n,) [unit of y]."""
        v = np.asarray(velocity, dtype=float)
        ratio = v / (math.sqrt(2.0) * self.breakaway_velocity)
        with np.errstate(under="ignore", over="ignore"):
            peak = math.sqrt(2.0 * math.e) * (self.breakaway - self.coulomb) * ratio * np.exp(-(ratio**2))
        dry = peak + self.coulomb * np.tanh(10.0 * v / self.breakaway_velocity)
        return np.asarray(self.offset + dry + self.viscous * v)
