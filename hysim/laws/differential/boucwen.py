"""The symmetric Bouc-Wen law, and the parameters that other authors and codes give it.

Ours is  y = offset + feedthrough u + gain z,  z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n,  and

    Low, Guo 1995        x = d u - h,  h' = alpha d u' - beta |u'| h - gamma u' |h|
    Wen 1976             F = alpha k u + (1 - alpha) k D z,
                         D z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n
    normalised           F = k_x u + k_w w,  w' = rho (u' - sigma |u'| |w|^(n-1) w + (sigma - 1) u' |w|^n)
    Noel, Schoukens 2016 z' = alpha u' - beta (gamma |u'| |z|^(nu-1) z + delta u' |z|^nu)
    OpenSees BoucWen     sigma = alpha ko u + (1 - alpha) ko z,
                         z' = u' (Ao - |z|^n (gamma + beta sign(u' z))) without degradation
    BoucWenOriginal      sigma = q_d z + k2 u + k3 sign(u) |u|^mu,
                         z' = u' (1 - |z|^eta (gamma + beta sign(z u'))) / u_y,
                         k2 = alphaL E, k3 = alphaNL E, u_y = fy / E, q_d = fy - k2 u_y - k3 u_y^mu
    suanPan BoucWen      sigma = a E u + (1 - a) fy z,  z' as BoucWenOriginal with gamma = 1 - beta

Measuring the memory in another unit, z = unit w, leaves the output as it is; a negative unit turns A and gamma round:

    A -> A / unit    beta -> beta |unit|^(n-1)    gamma -> sign(unit) gamma |unit|^(n-1)    gain -> unit gain

The way out chooses the unit, and with it one member of all the parameter sets with the same response. Sources: Y. K.
Wen, J. Eng. Mech. Div. 102 (1976); T. S. Low and W. Guo, J. Microelectromech. Syst. 4 (1995); F. Ikhouane and J.
Rodellar, Systems with Hysteresis (2007), for the normalised form; J. P. Noel and M. Schoukens, Hysteretic benchmark
with a dynamic nonlinearity (2016); the OpenSees command manual, uniaxialMaterial BoucWen (Haukaas and Der Kiureghian
2003) and BoucWenOriginal; suanPan, material BoucWen.

Laws that are Bouc-Wen laws with n = 1 and gamma = 0 under other names: everything is evaluated as such a law.
"""

import math
from abc import abstractmethod
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive
from hysim.kernels import boucwen as kernels
from hysim.kernels import stepping
from hysim.laws.differential._boucwen_law import BoucWenLaw, BoucWenStep
from hysim.laws.differential.boucwen_inverse import BoucWenInverse
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Packed, State
from hysim.models.model import Example, family
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.stages import Subset
from hysim.models.tables import Tables


@family
class BoucWen(BoucWenLaw):
    """Symmetric Bouc-Wen law, ``dz/du = A - |z|^n (gamma + beta sign(z du))``, ``y = offset + feedthrough u + gain z``.

    beta + gamma < 0 is legal (the field's benchmark has it): z then has no bound that is independent of the input, and
    for n > 1 a long enough stretch of the input takes it to infinity.

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
    step_fields = ("A", "beta", "gamma", "n", "gain", "offset", "feedthrough")

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
        return cls(A=alpha * d, beta=beta, gamma=gamma, n=1.0, feedthrough=d, gain=-1.0, z0=h0)

    def to_low_guo(self) -> dict[str, float]:
        """The arguments of `from_low_guo`; there is one set only.

        Raises ValueError if n is not 1, there is an offset, or feedthrough or gain is zero.
        """
        _check_no_offset(self, "Low and Guo's law")
        if self.n != 1.0:
            raise ValueError(f"Low and Guo's law has n = 1, got n = {self.n:g}")
        if self.feedthrough == 0.0 or self.gain == 0.0:
            raise ValueError(
                f"Low and Guo's law needs a feedthrough and a gain, got feedthrough = {self.feedthrough:g}, "
                f"gain = {self.gain:g}"
            )
        unit = _in_unit(self, -1.0 / self.gain)
        d = self.feedthrough
        return {"alpha": unit["A"] / d, "beta": unit["beta"], "gamma": unit["gamma"], "d": d, "h0": unit["z0"]}

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
        if D == 0.0:
            raise ValueError("D must not be zero")
        memory = {"A": A / D, "beta": beta / D, "gamma": gamma / D, "n": n, "z0": z0}
        return cls(**memory, feedthrough=alpha * k, gain=(1.0 - alpha) * k * D)

    def to_wen(self) -> dict[str, float]:
        """The arguments of `from_wen`, of all sets with this response the one with A = D = 1.

        Raises ValueError if there is an offset, A = 0, or no stiffness at z = 0.
        """
        return {**_with_unit_slope(self, "Wen's law"), "A": 1.0, "D": 1.0}

    @classmethod
    def from_normalized(cls, *, k_x: float, k_w: float, rho: float, sigma: float, n: float, w0: float = 0.0) -> Self:
        """The normalised law of Ikhouane and Rodellar (2007), ``F = k_x u + k_w w``.

        ``w' = rho (u' - sigma |u'| |w|^(n-1) w + (sigma - 1) u' |w|^n)``: w, which begins at w0, saturates at 1. The
        memory of the law is w: A = rho, beta = rho sigma, gamma = rho (1 - sigma).
        """
        memory = {"A": rho, "beta": rho * sigma, "gamma": rho * (1.0 - sigma), "n": n, "z0": w0}
        return cls(**memory, feedthrough=k_x, gain=k_w)

    def to_normalized(self) -> dict[str, float]:
        """The arguments of `from_normalized`; there is one set only.

        Raises ValueError if beta + gamma <= 0 or A <= 0, for which nothing saturates at 1, or there is an offset.
        """
        _check_no_offset(self, "the normalised law")
        loading = self.beta + self.gamma
        if loading <= 0.0 or self.A <= 0.0:
            raise ValueError(
                f"the normalised law needs beta + gamma > 0 and A > 0, got beta + gamma = {loading:g}, A = {self.A:g}"
            )
        unit = (self.A / loading) ** (1.0 / self.n)
        memory = {"rho": self.A / unit, "sigma": self.beta / loading, "n": self.n, "w0": self.z0 / unit}
        return {"k_x": self.feedthrough, "k_w": self.gain * unit, **memory}

    @classmethod
    def from_noel_schoukens(
        cls, *, alpha: float, beta: float, gamma: float, delta: float, nu: float, z0: float = 0.0
    ) -> Self:
        """The force of the system-identification benchmark of Noel and Schoukens (2016), ``y = z``.

        ``z' = alpha u' - beta (gamma |u'| |z|^(nu-1) z + delta u' |z|^nu)``: alpha is the memory's stiffness [unit of z
        / unit of u]. Our beta is beta gamma, our gamma beta delta. Mass, damping and stiffness are the oscillator's.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen.from_noel_schoukens(alpha=5e4, beta=1e3, gamma=0.8, delta=-1.1, nu=1.0)
        >>> law.stability_class, round(law.limit_cycle(1e-3).peak, 9)
        ('none', 77.756980989)
        """
        return cls(A=alpha, beta=beta * gamma, gamma=beta * delta, n=nu, z0=z0)

    def to_noel_schoukens(self) -> dict[str, float]:
        """The arguments of `from_noel_schoukens`, of all sets with this response the one with beta = 1.

        Raises ValueError if there is a feedthrough or an offset, or the gain is zero.
        """
        _check_no_offset(self, "the benchmark's law")
        if self.feedthrough != 0.0:
            raise ValueError(
                f"the benchmark's law has no feedthrough, got {self.feedthrough:g}: it belongs to the oscillator's "
                "stiffness"
            )
        if self.gain == 0.0:
            raise ValueError("the benchmark's output is the memory itself: it needs a gain that is not zero")
        unit = _in_unit(self, 1.0 / self.gain)
        shape = {"beta": 1.0, "gamma": unit["beta"], "delta": unit["gamma"], "nu": self.n}
        return {"alpha": unit["A"], **shape, "z0": unit["z0"]}

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
        for name, rate in {"deltaA": deltaA, "deltaNu": deltaNu, "deltaEta": deltaEta}.items():
            if rate != 0.0:
                raise ValueError(f"{name} must be zero, got {rate:g}: the law does not degrade")
        return cls.from_wen(alpha=alpha, k=ko, A=Ao, beta=beta, gamma=gamma, n=n)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`, of all sets with this response the one with Ao = 1.

        Raises ValueError if there is an offset or an initial memory, A = 0, or no stiffness at z = 0.
        """
        same = _of_material(self)
        return {name: same[name] for name in ("alpha", "n", "gamma", "beta")} | {"ko": same["k"], "Ao": 1.0}

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
        if alphaNL != 0.0:
            raise ValueError(f"alphaNL must be zero, got {alphaNL:g}: the law has a linear spring only")
        check_positive(E=E, fy=fy)
        memory = {"A": E / fy, "beta": beta * (E / fy), "gamma": gamma * (E / fy), "n": eta}
        return cls(**memory, feedthrough=alphaL * E, gain=(1.0 - alphaL) * fy)

    def to_opensees_original(self) -> dict[str, float]:
        """The arguments of `from_opensees_original`, of all sets with this response the one with beta + gamma = 1.

        Raises ValueError if there is an offset or an initial memory, A = 0, no stiffness at z = 0, or nothing yields.
        """
        same = _of_material(self)
        loading = same["beta"] + same["gamma"]
        if loading <= 0.0:
            raise ValueError(f"the material yields: it needs beta + gamma > 0 where A = 1, got {loading:g}")
        shape = {"beta": same["beta"] / loading, "gamma": same["gamma"] / loading, "eta": same["n"]}
        return {"E": same["k"], "fy": same["k"] * loading ** (-1.0 / same["n"]), "alphaL": same["alpha"], **shape}

    @classmethod
    def from_suanpan(
        cls, *, elastic_modulus: float, yield_stress: float, hardening: float, beta: float, n: float
    ) -> Self:
        """The material ``BoucWen`` of suanPan, whose gamma is 1 - beta.

        ``z' = u' (1 - |z|^n (1 - beta + beta sign(z u'))) elastic_modulus / yield_stress``: both are positive, else
        ValueError; hardening is the ratio of the stiffness after yielding to the one before it.
        """
        stiffness = {"E": elastic_modulus, "fy": yield_stress, "alphaL": hardening}
        return cls.from_opensees_original(**stiffness, eta=n, beta=beta, gamma=1.0 - beta)

    def to_suanpan(self) -> dict[str, float]:
        """The arguments of `from_suanpan`; there is one set only. Raises ValueError as `to_opensees_original`."""
        same = self.to_opensees_original()
        names = {"elastic_modulus": "E", "yield_stress": "fy", "hardening": "alphaL", "beta": "beta", "n": "eta"}
        return {name: same[theirs] for name, theirs in names.items()}


def bouc_wen_with(*terms: str) -> Subset:
    """The Bouc-Wen law in a law with further terms, which vanish for zeros, and a polynomial of the input."""
    neutral = dict.fromkeys((*terms, "input_coefficients"), 0.0)
    return Subset(BoucWen, neutral=neutral, names={"feedthrough": "input_coefficients[0]"})


def _of_material(law: BoucWen) -> dict[str, float]:
    """The form that the materials of OpenSees share, with A = 1."""
    if law.z0 != 0.0:
        raise ValueError(f"the material begins with z = 0, got z0 = {law.z0:g}")
    return _with_unit_slope(law, "the material")


def _with_unit_slope(law: BoucWen, whose: str) -> dict[str, float]:
    """The form that Wen and OpenSees share, with A = 1."""
    _check_no_offset(law, whose)
    if law.A == 0.0:
        raise ValueError(f"{whose} needs a slope at z = 0 to measure the stiffness by, got A = 0")
    unit = _in_unit(law, law.A)
    k = law.feedthrough + unit["gain"]
    if k == 0.0:
        raise ValueError(
            f"{whose} needs a stiffness at z = 0, but feedthrough + gain A = 0 (feedthrough = {law.feedthrough:g})"
        )
    return {"alpha": law.feedthrough / k, "k": k} | {name: unit[name] for name in ("beta", "gamma", "n", "z0")}


def _in_unit(law: BoucWen, unit: float) -> dict[str, float]:
    """The law with its memory measured in `unit`."""
    scale = abs(unit) ** (law.n - 1.0)
    return {
        "A": law.A / unit,
        "beta": law.beta * scale,
        "gamma": math.copysign(1.0, unit) * law.gamma * scale,
        "n": law.n,
        "gain": law.gain * unit,
        "z0": law.z0 / unit,
    }


def _check_no_offset(law: BoucWen, whose: str) -> None:
    if law.offset != 0.0:
        raise ValueError(f"{whose} has no offset, got {law.offset:g}: take it off the output")


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

    def inverted(self, y: FloatArray, u0: float | None, state: State | None) -> FloatArray:
        return self.bouc_wen.inverted(y, u0, state)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        return self.bouc_wen.compiled_inverse(u0, limits)
