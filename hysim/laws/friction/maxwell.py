"""The generalized Maxwell-slip model of friction."""

from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_lengths, check_one_each
from hysim.kernels import maxwell as kernels
from hysim.laws.friction.rated_law import RatedLaw, curve
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine
from hysim.models.tables import Tables


@family
class GeneralizedMaxwellSlip(RatedLaw):
    """Generalized Maxwell-slip friction: elements side by side that stick, and slip with a lag.

    ::

        sticking    F_i' = stiffness_i v                                        until |F_i| = weight_i g(v)
        slipping    F_i' = sign(v) attraction (weight_i - |F_i| / g(v))         until v stops or turns
        F = offset + sum_i F_i + viscous v
        g(v) = coulomb + (breakaway - coulomb) exp(-|v / stribeck_velocity|^stribeck_exponent)

    u is the displacement, v its velocity. It has the hysteresis with nonlocal memory of sticking contacts, which LuGre
    has not, and the frictional lag of slipping ones. Between samples the displacement is linear, and the force exact.
    Source: F. Al-Bender, V. Lampaert and J. Swevers, The generalized Maxwell-slip model: a novel model for friction
    simulation and compensation, IEEE Trans. Automatic Control 50 (2005) 1883-1887. Their weights are alpha_i, their
    attraction is C. Where g does not depend on the speed it is `hysim.MaxwellSlip`, as it is without a lag (a very
    large attraction) for forces that follow g(v). `hysim.identify` takes the number of elements and their weights from
    the law that it starts with.

    Parameters
    ----------
    stiffness : sequence of float, length n_elements
        Positive [unit of y / unit of u].
    weights : sequence of float, length n_elements
        Shares of the friction, positive; the friction g is that of all elements where their sum is 1.
    coulomb : float
        Friction at high speed without the viscous part, positive [unit of y].
    breakaway : float
        Friction at the speed zero, positive [unit of y].
    stribeck_velocity : float
        Positive [unit of u / s].
    stribeck_exponent : float
        Positive.
    attraction : float
        Rate at which a slipping force follows the friction, positive [unit of y / s].
    viscous : float
        [unit of y s / unit of u]
    offset : float
        Output at rest without forces of the elements [unit of y].
    z0 : float or sequence of float, length n_elements
        Forces F_i at the first sample, of elements that stick [unit of y].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, or one that must be positive is not.

    Examples
    --------
    >>> import hysim as hs
    >>> friction = hs.GeneralizedMaxwellSlip(stiffness=(4.0, 1.0), weights=(0.5, 0.5), breakaway=1.0)
    >>> friction.response([0.0, 0.1, 1.0, 0.9], sample_time=1.0).round(3).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """

    stiffness: tuple[float, ...] = (1.0,)
    weights: tuple[float, ...] = (1.0,)
    coulomb: float = 1.0
    breakaway: float = 1.5
    stribeck_velocity: float = 0.001
    stribeck_exponent: float = 2.0
    attraction: float = 10.0
    viscous: float = 0.0
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    positive = (
        "stiffness", "weights", "coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "attraction",
    )  # fmt: skip
    example = Example(
        {
            "stiffness": (20.0, 10.0, 5.0), "weights": (0.4, 0.3, 0.3), "stribeck_velocity": 2.0, "attraction": 50.0,
            "viscous": 0.02,
        },
        title="Friction: Maxwell slip with a lag",
        units={"u": "mm", "y": "N"},
        kind="sine",
    )  # fmt: skip
    step = staticmethod(kernels.step)
    rated_step = staticmethod(kernels.rated_step)
    searched = (
        Parameter("stiffness", 1e-2, 1e6, unit="y/u", log=True),
        *(Parameter(name, 1e-3, 1e1, unit="y", log=True) for name in ("coulomb", "breakaway")),
        Parameter("stribeck_velocity", 1e-4, 1e1, unit="v", log=True),
        Parameter("attraction", 1e-2, 1e6, unit="r", log=True),
        *affine("viscous", "offset"),
    )
    starts: ClassVar = tuple(
        {"coulomb": 0.4, "breakaway": level, "stribeck_velocity": velocity, "attraction": 100.0}
        for level in (0.4, 0.6)
        for velocity in (0.01, 0.1)
    )
    screened = 512

    def __post_init__(self) -> None:
        n = len(self.stiffness)
        check_lengths(empty=False, stiffness=self.stiffness, weights=self.weights)
        if len(self.z0) == 1:
            object.__setattr__(self, "z0", self.z0 * n)
        check_one_each("z0", self.z0, n, "elements")
        super().__post_init__()

    @classmethod
    def further(cls, tables: Tables) -> int:
        """The direction in which each element slips, zero where it sticks."""
        return int(tables["stiffness"].shape[1])

    @property
    def viscosity(self) -> float:
        return self.viscous

    def friction(self, velocity: npt.ArrayLike) -> FloatArray:
        """Stribeck's curve g at velocities of any shape, without sign and viscous friction [unit of y]."""
        return curve(velocity, self.coulomb, self.breakaway, self.stribeck_velocity, self.stribeck_exponent)

    def steady_force(self, velocity: npt.ArrayLike) -> FloatArray:
        """Force after a long motion at constant velocities of any shape [unit of y]."""
        v = np.asarray(velocity, dtype=float)
        return np.asarray(self.offset + sum(self.weights) * np.sign(v) * self.friction(v) + self.viscous * v)
