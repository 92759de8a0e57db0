"""The symmetric Bouc-Wen law, and the parameters that other authors and codes give it.

Laws that are Bouc-Wen laws with n = 1 and gamma = 0 under other names: everything is evaluated as such a law.
"""

import math
from abc import abstractmethod
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.kernels import boucwen as kernels
from hysim.kernels import stepping
from hysim.laws.differential import _boucwen_conversions as conversions
from hysim.laws.differential._boucwen_law import BoucWenLaw, BoucWenStep
from hysim.laws.differential.boucwen_inverse import BoucWenInverse, InverseState
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Packed, State
from hysim.models.model import Example, family
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import Tables


@family
class BoucWen(BoucWenLaw):
    """Symmetric Bouc-Wen law, ``dz/du = A - |z|^n (gamma + beta sign(z du))``, ``y = offset + feedthrough u + gain z``.

    Parameters
    ----------
    A : float
        Slope dz/du at z = 0 [unit of z / unit of u].
    beta, gamma : float
        Shape of the branches: ``beta + gamma`` bends the loading ones (z du > 0), ``beta - gamma`` the
        unloading ones. Any sign [unit of z^(1-n) / unit of u].
    n : float
        Sharpness of the knee, positive. Also called eta or nu.
    feedthrough : float
        Gain of the input past the memory [unit of y / unit of u].
    gain : float
        Gain of the memory [unit of y / unit of z].
    offset : float
        Output at u = 0, z = 0 [unit of y].
    z0 : float
        Memory at the first sample [unit of z].

    Raises
    ------
    ValueError
        If a parameter is not finite, or n is not positive.

    Notes
    -----
    beta + gamma < 0 is legal (the field's benchmark has it): z then has no bound that is independent
    of the input, and for n > 1 a long enough stretch of the input takes it to infinity.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.BoucWen(beta=0.5, gamma=0.5)
    >>> law.response([0.0, 1.0, -1.0, 1.0]).round(6).tolist()
    [0.0, 0.632121, -0.745354, 0.714823]
    """

    units: ClassVar = {"n": "1", "feedthrough": "y/u", "offset": "y"}
    example = Example({"beta": 0.6, "gamma": 0.2, "feedthrough": 0.1}, (-2.0, 2.0), title="Bouc-Wen")
    polynomial: ClassVar[str] = "feedthrough"

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    feedthrough: float = 0.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    @classmethod
    def from_low_guo(cls, *, alpha: float, beta: float, gamma: float, d: float = 1.0, h0: float = 0.0) -> Self:
        """The law of a piezoelectric stack by Low and Guo (1995), ``x = d u - h``.

        ``h' = alpha d u' - beta |u'| h - gamma u' |h|``: alpha has no unit, beta and gamma have [1 / unit of u], d is
        the displacement per input without hysteresis [unit of x / unit of u], h0 the initial h [unit of x]. The memory
        of the law is h: A = alpha d, feedthrough = d, gain = -1, n = 1.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen.from_low_guo(alpha=0.35, beta=0.02, gamma=0.005)
        >>> round(law.limit_cycle(30.0).peak, 12)
        8.702046583872
        """
        return cls(**conversions.from_low_guo(alpha, beta, gamma, d, h0))

    def to_low_guo(self) -> dict[str, float]:
        """The arguments of `from_low_guo`; there is one set only.

        Raises ValueError if n is not 1, there is an offset, or feedthrough or gain is zero.
        """
        return conversions.to_low_guo(self)

    @classmethod
    def from_wen(
        cls,
        *,
        alpha: float,
        k: float,
        A: float = 1.0,
        beta: float,
        gamma: float,
        n: float,
        D: float = 1.0,
        z0: float = 0.0,
    ) -> Self:
        """The restoring force by Wen (1976), ``F = alpha k u + (1 - alpha) k D z``.

        ``D z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n``: alpha is the ratio of the stiffness after yielding to
        the one before it for A = 1, k the stiffness [unit of F / unit of u], D the yield displacement [unit of u] with
        a z that has no unit, and 1 where z is a displacement; not zero, else ValueError.

        Examples
        --------
        >>> import hysim as hs
        >>> force = hs.BoucWen.from_wen(alpha=0.1, k=20.0, beta=0.6, gamma=0.4, n=1.5, D=0.5)
        >>> force.response([0.0, 10.0]).round(6).tolist()
        [0.0, 29.0]
        """
        return cls(**conversions.from_wen(alpha, k, A, beta, gamma, n, D, z0))

    def to_wen(self) -> dict[str, float]:
        """The arguments of `from_wen`, of all sets with this response the one with A = D = 1.

        Raises ValueError if there is an offset, A = 0, or no stiffness at z = 0.
        """
        return conversions.to_wen(self)

    @classmethod
    def from_normalized(cls, *, k_x: float, k_w: float, rho: float, sigma: float, n: float, w0: float = 0.0) -> Self:
        """The normalised law of Ikhouane and Rodellar (2007), ``F = k_x u + k_w w``.

        ``w' = rho (u' - sigma |u'| |w|^(n-1) w + (sigma - 1) u' |w|^n)``: w, which begins at w0, saturates at 1. The
        memory of the law is w: A = rho, beta = rho sigma, gamma = rho (1 - sigma).
        """
        return cls(**conversions.from_normalized(k_x, k_w, rho, sigma, n, w0))

    def to_normalized(self) -> dict[str, float]:
        """The arguments of `from_normalized`; there is one set only.

        Raises ValueError if beta + gamma <= 0 or A <= 0, for which nothing saturates at 1, or there is an offset.
        """
        return conversions.to_normalized(self)

    @classmethod
    def from_noel_schoukens(
        cls, *, alpha: float, beta: float, gamma: float, delta: float, nu: float, z0: float = 0.0
    ) -> Self:
        """The force of the system-identification benchmark of Noel and Schoukens (2016), ``y = z``.

        ``z' = alpha u' - beta (gamma |u'| |z|^(nu-1) z + delta u' |z|^nu)``: alpha is the stiffness of the memory
        [unit of z / unit of u]. Our beta is their beta gamma, our gamma their beta delta. Mass, damping and stiffness
        belong to the oscillator.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen.from_noel_schoukens(alpha=5e4, beta=1e3, gamma=0.8, delta=-1.1, nu=1.0)
        >>> law.stability_class, round(law.limit_cycle(1e-3).peak, 9)
        ('none', 77.756980989)
        """
        return cls(**conversions.from_noel_schoukens(alpha, beta, gamma, delta, nu, z0))

    def to_noel_schoukens(self) -> dict[str, float]:
        """The arguments of `from_noel_schoukens`, of all sets with this response the one with beta = 1.

        Raises ValueError if there is a feedthrough or an offset, or the gain is zero.
        """
        return conversions.to_noel_schoukens(self)

    @classmethod
    def from_opensees(
        cls,
        *,
        alpha: float,
        ko: float,
        n: float,
        gamma: float,
        beta: float,
        Ao: float = 1.0,
        deltaA: float = 0.0,
        deltaNu: float = 0.0,
        deltaEta: float = 0.0,
    ) -> Self:
        """The material ``uniaxialMaterial BoucWen`` of OpenSees, ``alpha ko u + (1 - alpha) ko z``.

        ``z' = u' (Ao - |z|^n (gamma + beta sign(u' z)))``: alpha is the ratio of the stiffness after yielding to the
        one before it, ko. The rates of degradation deltaA, deltaNu and deltaEta must be zero, else ValueError.
        """
        degradation = {"deltaA": deltaA, "deltaNu": deltaNu, "deltaEta": deltaEta}
        return cls(**conversions.from_opensees(alpha, ko, n, gamma, beta, Ao, degradation))

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`, of all sets with this response the one with Ao = 1.

        Raises ValueError if there is an offset or an initial memory, A = 0, or no stiffness at z = 0.
        """
        return conversions.to_opensees(self)

    @classmethod
    def from_opensees_original(
        cls,
        *,
        E: float,
        fy: float,
        alphaL: float,
        alphaNL: float = 0.0,
        eta: float = 1.0,
        beta: float = 0.5,
        gamma: float = 0.5,
    ) -> Self:
        """The material ``uniaxialMaterial BoucWenOriginal`` of OpenSees, ``alphaL E u + (1 - alphaL) fy z``.

        ``z' = u' (1 - |z|^eta (gamma + beta sign(z u'))) E / fy``: E is the stiffness before yielding and fy the yield
        force, both positive, alphaL the ratio of the stiffness of the linear spring to E. alphaNL, that of the spring
        with the power mu, must be zero. Other values raise ValueError.

        Examples
        --------
        >>> import hysim as hs
        >>> bearing = hs.BoucWen.from_opensees_original(E=200.0, fy=4.0, alphaL=0.1)
        >>> bearing.response([0.0, 10.0]).round(6).tolist()
        [0.0, 203.6]
        """
        return cls(**conversions.from_opensees_original(E, fy, alphaL, alphaNL, eta, beta, gamma))

    def to_opensees_original(self) -> dict[str, float]:
        """The arguments of `from_opensees_original`, of all sets with this response the one with beta + gamma = 1.

        Raises ValueError if there is an offset or an initial memory, A = 0, no stiffness at z = 0, or nothing yields.
        """
        return conversions.to_opensees_original(self)

    @classmethod
    def from_suanpan(
        cls, *, elastic_modulus: float, yield_stress: float, hardening: float, beta: float, n: float
    ) -> Self:
        """The material ``BoucWen`` of suanPan, whose gamma is 1 - beta.

        ``z' = u' (1 - |z|^n (1 - beta + beta sign(z u'))) elastic_modulus / yield_stress``: both are positive, else
        ValueError; hardening is the ratio of the stiffness after yielding to the one before it.
        """
        shape = {"eta": n, "beta": beta, "gamma": 1.0 - beta}
        return cls(**conversions.from_opensees_original(elastic_modulus, yield_stress, hardening, 0.0, **shape))

    def to_suanpan(self) -> dict[str, float]:
        """The arguments of `from_suanpan`; there is one set only. Raises ValueError as `to_opensees_original`."""
        return conversions.to_suanpan(self)


class EquivalentBoucWen(BoucWenStep):
    """A law that says which Bouc-Wen law it is."""

    step = staticmethod(kernels.linear_step)
    start = staticmethod(stepping.start)
    workspace: ClassVar[int] = 0

    @classmethod
    @abstractmethod
    def equivalent(cls, tables: Tables) -> dict[str, FloatArray]:
        """Parameters of the Bouc-Wen law over sets, those that differ from its defaults."""

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """The constants and the memory of the Bouc-Wen law."""
        parameters = cls.equivalent(tables)
        plain = {name: np.full_like(parameters["A"], value) for name, value in BoucWen.defaults().items()}
        return BoucWen.pack({**plain, **parameters})

    @property
    def bouc_wen(self) -> BoucWen:
        """The `BoucWen` law with the same output."""
        numbers = {name: float(table[0, 0]) for name, table in self.equivalent(self.tables).items()}
        return BoucWen(**numbers, u0=self.u0, u_range=self.u_range)

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Those of the Bouc-Wen law."""
        return self.bouc_wen.known_slopes

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike) -> FloatArray:
        """Slope dy/du at the memory `z` in a `direction` that is not zero; see `hysim.BoucWen.tangent`."""
        return self.bouc_wen.tangent(direction, z)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude; see `hysim.BoucWen.limit_cycle`."""
        return self.bouc_wen.limit_cycle(amplitude)

    def inverse(self) -> BoucWenInverse:
        """The law's inverse as an object, where its slope keeps its sign; see `hysim.BoucWen.inverse`."""
        return self.bouc_wen.inverse()

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | InverseState | None) -> CompiledLaw:
        """The inverse of the Bouc-Wen law."""
        return self.bouc_wen.inverse_begun(y, u0, state)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        """Message with the input and the slope there."""
        return self.bouc_wen.unreached(sample, y, inverse)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The closed form of the inverse, stepped; see `hysim.models.inverse_steps`."""
        return self.bouc_wen.compiled_inverse(u0, limits)
