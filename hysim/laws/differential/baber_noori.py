"""The Bouc-Wen law of Baber and Noori, which degrades with the energy that it has taken, and pinches.

The two materials of OpenSees that change with the energy count it as e' = (1 - alpha) ko u' z, ours is e' = u' z, so
that rates go over by the factor (1 - alpha) ko. Source: OpenSees command manual, uniaxialMaterial BoucWen and BWBN.
"""

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels import baber_noori as kernels
from hysim.kernels.baber_noori_search import close_step
from hysim.kernels.remainder import ROUNDING
from hysim.laws.differential import _boucwen_search, _power_units, _wear_search
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.models.by_structure import Holding
from hysim.models.law import Packed, Stepping
from hysim.models.model import Example, family
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Stage, Subset
from hysim.models.tables import Tables
from hysim.records import Record

_WEAR = Stage(
    word="wear",
    names=("delta_nu", "delta_eta"),
    neutral={"delta_nu": 0.0, "delta_eta": 0.0},
    optional=("delta_a",),
    drawn=16,
    rounds=((16, 25),),
)
_PINCHING = Stage(
    word="pinching",
    names=("zeta_s", "q", "p", "psi"),
    neutral={"zeta_s": 0.0},
    optional=("delta_psi",),
    drawn=512,
    rounds=((32, 8), (8, 25)),
)
_SPREAD = Stage(
    word="lambda_",
    names=("lambda_",),
    neutral={"lambda_": 0.5},
    drawn=8,
    rounds=((8, 25),),
    idle={"zeta_s": 0.0},
)
_WEARING = ("delta_a", "delta_nu", "delta_eta", "zeta_s")
_OWN = ("delta_a", "delta_nu", "delta_eta", "zeta_s", "q", "p", "psi", "delta_psi", "lambda_")


@family
class BoucWenBaberNoori(MemoryLaw):
    """Bouc-Wen law with degradation and pinching, after Baber and Noori (1985) and Foliente (1995).

    ::

        dz/du = h (A - delta_a e - (1 + delta_nu e) |z|^n (gamma + beta sgn(z u'))) / (1 + delta_eta e),    de/du = z
        h     = 1 - zeta1 exp(-(z sgn(u') - q z_u)^2 / zeta2^2),    z_u = (1 / ((1 + delta_nu e) (beta + gamma)))^(1/n)
        zeta1 = zeta_s (1 - exp(-p e)),    zeta2 = (psi + delta_psi e) (lambda_ + zeta1)
        y     = offset + c1 u + c2 u^2 + ... + gain z

    u is the displacement, y the force, z the memory, and gain e the energy that the hysteretic spring has taken. The
    rates are those per unit of e, not per gain e as in some codes, so that the output stays affine in gain.

    Parameters
    ----------
    A, beta, gamma, n : float
        As in `BoucWen`, of the law as it is new.
    delta_a, delta_nu, delta_eta : float
        Rates at which slope, strength and stiffness are lost [1 / (unit of z unit of u); delta_a that times the unit
        of A].
    zeta_s : float
        Largest depth of the pinching, below 1 for a slope that stays positive; 0 for none.
    q : float
        Where a branch is flattest, in units of z_u.
    p : float
        Rate at which the pinching deepens with e [1 / (unit of z unit of u)].
    psi, delta_psi : float
        Width of the pinching, and its growth with e [unit of z, and 1 / unit of u].
    lambda_ : float
        Part of the width that does not depend on the depth.
    gain, offset, z0, input_coefficients
        As in `PolynomialBoucWen`.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, there is no coefficient, or a law that pinches has
        beta + gamma or a width that is not positive.

    Notes
    -----
    Solved by power series along monotone strokes, good to 1e-12 of the range; a law that neither degrades nor pinches
    is the Bouc-Wen law to the bit. A law that degrades is never in a steady cycle. `identify` searches the Bouc-Wen
    law, then the wear, then the pinching, then ``lambda_``, and keeps of them what lowers the BIC; a start that wears
    off or pinches, or ``free=`` or ``bounds=`` with one of its parameters, keeps it in any case. Pinching is searched
    beside wear only: each stage begins where the one before ended, and wear at a rate of zero costs no more than its
    two parameters in the BIC. For pinching alone, ``fixed={"delta_nu": 0.0, "delta_eta": 0.0}`` leaves the wear out. It
    holds delta_a and delta_psi, whose work the other rates and psi nearly do. Sources: T. T. Baber and Y. K. Wen, J.
    Eng. Mech. Div. 107 (1981); T. T. Baber and M. N. Noori, J. Eng. Mech. 111 (1985); G. C. Foliente, J. Struct. Eng.
    121 (1995), for the form of the pinching.

    Examples
    --------
    >>> import hysim as hs
    >>> worn = hs.BoucWenBaberNoori(beta=0.5, gamma=0.5, delta_nu=0.2, delta_eta=0.1)
    >>> worn.response([0.0, 2.0, -2.0, 2.0]).round(6).tolist()
    [0.0, 0.780431, -0.69475, 0.588304]
    """

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    delta_a: float = 0.0
    delta_nu: float = 0.0
    delta_eta: float = 0.0
    zeta_s: float = 0.0
    q: float = 0.0
    p: float = 1.0
    psi: float = 0.2
    delta_psi: float = 0.0
    lambda_: float = 0.5
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0,)

    short = "baber-noori"
    example = Example(
        {
            "beta": 0.5, "gamma": 0.3, "delta_nu": 0.03, "delta_eta": 0.03, "zeta_s": 0.8, "q": 0.1, "p": 1.0,
            "psi": 0.3, "lambda_": 0.3,
        },
        (-4.0, 4.0),
        title="Baber-Noori: wear and pinching",
        group="Devices",
        units={"u": "mm", "y": "kN"},
    )  # fmt: skip
    contains = Subset(
        BoucWen,
        neutral={"delta_a": 0.0, "delta_nu": 0.0, "delta_eta": 0.0, "zeta_s": 0.0, "input_coefficients": 0.0},
        names={"feedthrough": "input_coefficients[0]"},
    )
    stages = (_WEAR, _PINCHING, _SPREAD)
    step = staticmethod(kernels.step)
    workspace: ClassVar[int] = kernels.N_STATE - 3
    samples_a_thread = 2_000
    tolerance: ClassVar[float] = ROUNDING  # of what the series leave out, beside the memory

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse also a law that pinches in which a width or the yield memory is not positive."""
        super().check(tables)
        pinches = tables["zeta_s"] != 0.0
        sums = {"beta + gamma": tables["beta"] + tables["gamma"], "psi": tables["psi"], "lambda_": tables["lambda_"]}
        for name, value in sums.items():
            if (wrong := pinches & (value <= 0.0)).any():
                raise ValueError(f"{name} must be positive in a law that pinches, got {value[wrong][0]}")

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.baber_noori.step` takes them, and memory (u, z, e)."""
        units = _power_units.units_with_wear(tables)
        energy = units.memory + units.input
        exponents = {
            **{"delta_a": 2.0 * units.input, "delta_nu": energy, "delta_eta": energy, "p": energy},
            **{"q": (units.input - units.memory) / units.n, "psi": -units.memory, "delta_psi": units.input},
        }
        own = [units.times(tables[name], exponents.get(name, np.zeros(()))) for name in _OWN]
        plain = cls.joined(tables, "A", "beta", "gamma", "n")
        tolerance = np.full((len(plain), 1), cls.tolerance)
        parameters = np.concatenate([*own, units.shape(tables), units.scales, tolerance, plain], axis=1)
        return Packed(parameters, cls.initial_memory(tables, further=1))

    @classmethod
    def candidates(cls) -> dict[str, Holding]:
        """Only the law with n = 1 is tried by `hysim.compare`: few records tell it from another n."""
        return {f"{cls.__name__} with n = 1": Holding(cls(), {"n": 1.0})}

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
        """The material ``uniaxialMaterial BoucWen`` of OpenSees, which degrades.

        alpha is the ratio of the stiffness after yielding to the one before it, ko; n, gamma, beta and Ao are those of
        ``z' = u' (Ao - deltaA e - nu |z|^n (gamma + beta sign(u' z))) / eta``; deltaA, deltaNu and deltaEta are rates
        per unit of their energy, ``e' = (1 - alpha) ko u' z``.

        Examples
        --------
        >>> import hysim as hs
        >>> material = {"alpha": 0.1, "ko": 20.0, "n": 1.0, "gamma": 0.5, "beta": 0.5}
        >>> law = hs.BoucWenBaberNoori.from_opensees(**material, deltaNu=0.01, deltaEta=0.02)
        >>> law.gain, round(law.delta_nu, 12), round(law.delta_eta, 12)
        (18.0, 0.18, 0.36)
        """
        stiffness = (1.0 - alpha) * ko
        rates = {"delta_a": deltaA * stiffness, "delta_nu": deltaNu * stiffness, "delta_eta": deltaEta * stiffness}
        memory = {"A": Ao, "beta": beta, "gamma": gamma, "n": n}
        return cls(**memory, **rates, gain=stiffness, input_coefficients=(alpha * ko,))

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`, with Ao = A.

        Raises ValueError if the law pinches, has an offset, an initial memory, more than one input coefficient, or no
        stiffness.
        """
        if self.zeta_s != 0.0:
            raise ValueError(f"the material does not pinch, got zeta_s = {self.zeta_s:g}: see to_opensees_bwbn")
        rates = {"deltaA": self.delta_a, "deltaNu": self.delta_nu, "deltaEta": self.delta_eta}
        return {**self._of_material(), **{name: rate / self.gain for name, rate in rates.items()}}

    @classmethod
    def from_opensees_bwbn(
        cls,
        *,
        alpha: float,
        ko: float,
        n: float,
        gamma: float,
        beta: float,
        Ao: float,
        q: float,
        zetas: float,
        p: float,
        Shi: float,
        deltaShi: float,
        lamda: float,
    ) -> Self:
        """The material ``uniaxialMaterial BWBN`` of OpenSees, which pinches and does not degrade.

        The first six parameters are those of `from_opensees`, the others the pinching in the order of the command, with
        ``lambda`` for lamda; p and deltaShi are per unit of their energy.
        """
        stiffness = (1.0 - alpha) * ko
        memory = {"A": Ao, "beta": beta, "gamma": gamma, "n": n}
        pinching = {"q": q, "zeta_s": zetas, "p": p * stiffness, "psi": Shi, "delta_psi": deltaShi * stiffness}
        return cls(**memory, **pinching, lambda_=lamda, gain=stiffness, input_coefficients=(alpha * ko,))

    def to_opensees_bwbn(self) -> dict[str, float]:
        """The arguments of `from_opensees_bwbn`, with Ao = A.

        Raises ValueError if the law degrades, has an offset, an initial memory, more than one input coefficient, or no
        stiffness.
        """
        for name in ("delta_a", "delta_nu", "delta_eta"):
            if (rate := self.scalars[name]) != 0.0:
                raise ValueError(f"the material does not degrade, got {name} = {rate:g}: see to_opensees")
        own = {"q": self.q, "zetas": self.zeta_s, "p": self.p / self.gain, "Shi": self.psi, "lamda": self.lambda_}
        return {**self._of_material(), **own, "deltaShi": self.delta_psi / self.gain}

    def _of_material(self) -> dict[str, float]:
        """Parameters that both materials of OpenSees have."""
        if self.offset != 0.0:
            raise ValueError(f"the material has no offset, got {self.offset:g}: take it off the output")
        if self.z0 != 0.0:
            raise ValueError(f"the material begins with z = 0, got z0 = {self.z0:g}")
        first, *others = self.input_coefficients
        if any(others):
            raise ValueError(
                f"the material has a linear spring only, got input_coefficients = {self.input_coefficients}"
            )
        ko = first + self.gain
        if ko == 0.0 or self.gain == 0.0:
            raise ValueError(f"the material needs a stiffness and a gain, got {ko:g} and {self.gain:g}")
        return {"alpha": first / ko, "ko": ko, "n": self.n, "gamma": self.gamma, "beta": self.beta, "Ao": self.A}

    @property
    def stepping(self) -> Stepping:
        """Without the charts that only a law of a general exponent needs that neither degrades nor pinches."""
        if self.n not in (1.0, 2.0) and not any(self.scalars[name] for name in _WEARING):
            return super().stepping
        return super().stepping._replace(workspace=min(self.workspace, kernels.N_LEAN - 3))

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Those of the Bouc-Wen law, where it neither degrades nor pinches."""
        if any(self.scalars[name] for name in _WEARING):
            return super().known_slopes
        return PolynomialBoucWen(**{name: self.arguments[name] for name in PolynomialBoucWen.defaults()}).known_slopes

    def energy(self, u: npt.ArrayLike) -> FloatArray:
        """Work e done on the memory at the samples of `u`, shape (n_samples,) [unit of z unit of u]; see `response`."""
        return self.remembered(u)[:, 1]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box in the scales of wear and pinching, and that of the Bouc-Wen law where both are held at zero.

        Held by default are the wear of A, and the pinching in a law that does not pinch.
        """
        pinches = self.zeta_s != 0.0 or "zeta_s" in freedom.free
        alone = ("delta_a", *(() if pinches else (*_PINCHING.names, *_PINCHING.optional, *_SPREAD.names)))
        at_rest = ("z0",) if freedom.starts_at_rest() else ()
        groups = (*_boucwen_search.REDUNDANT, *((name,) for name in alone))
        held = freedom.held(self.scalars, redundant=groups, at_rest=at_rest)
        if all(held.get(name, 1.0) == 0.0 for name in _WEARING):
            every = replace(freedom, fixed={**held, **freedom.fixed})
            return _boucwen_search.search_space(self.scalars, self.columns, record, every)
        return _wear_search.search_space(self.scalars, self.columns, record, freedom, held)

    def rough(self) -> MemoryLaw:
        """The law by Rosenbrock steps, good to a few parts in a thousand."""
        return _RoughBaberNoori(**self.arguments)

    def close(self) -> MemoryLaw:
        """The law with shorter series, and few evaluations near a memory of zero, good to 1e-8 of the range."""
        return _CloseBaberNoori(**self.arguments)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Initial memory of a steady cycle; ValueError for a law that degrades or pinches, which has none."""
        values = {**self.scalars, **parameters}
        if any(np.any(values[name]) for name in _WEARING):
            raise ValueError('a law that wears off has no steady cycle: use initial="free"')
        return super().steady(parameters, record)

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *others: FloatArray) -> FloatArray:
        e = others[0] if others else np.zeros(())
        nu, eta = 1.0 + self.delta_nu * e, 1.0 + self.delta_eta * e
        bend = nu * np.abs(z) ** self.n * (self.gamma + self.beta * np.sign(z * direction))
        return np.asarray(self._pinching(direction * z, e, nu) * (self.A - self.delta_a * e - bend) / eta)

    def _pinching(self, w: FloatArray, e: FloatArray, nu: FloatArray) -> FloatArray | float:
        """h at w = z sgn(u')."""
        if self.zeta_s == 0.0:
            return 1.0
        where = self.q * (nu * (self.beta + self.gamma)) ** (-1.0 / self.n)
        depth = -self.zeta_s * np.expm1(-self.p * e)
        width = (self.psi + self.delta_psi * e) * (self.lambda_ + depth)
        return np.asarray(1.0 - depth * np.exp(-(((w - where) / width) ** 2)))


class _RoughBaberNoori(BoucWenBaberNoori):
    """The law as the first steps of a search take it."""

    step = staticmethod(kernels.rough_step)
    workspace: ClassVar[int] = 0


class _CloseBaberNoori(BoucWenBaberNoori):
    """The law as the later steps of a search take it: its differences over 1e-6 of the box are still good slopes."""

    step = staticmethod(close_step)
    tolerance: ClassVar[float] = 2.0**-30
