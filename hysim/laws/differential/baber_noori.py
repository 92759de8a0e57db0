"""The Bouc-Wen law of Baber and Noori, which degrades with the energy that it has taken, and pinches.

The two materials of OpenSees that change with the energy count it as e' = (1 - alpha) ko u' z, ours is e' = u' z, so
that rates go over by the factor (1 - alpha) ko. Source: OpenSees command manual, uniaxialMaterial BoucWen and BWBN.

The box in which a law that wears off or pinches is searched, in its own scales.

The memory of such a law saturates at the yield memory z_u, often far below what the input's span would make of it, and
the energy that wears it grows by z_u for each unit of the input's path. With U the span of the input, P the length of
its path, k the knee and l the shape coefficients of `hysim.laws.differential._boucwen_search`, the coordinates are

    loading       c,  k = sinh(c):  z_u = |A| U / k for a memory that saturates, k from 1/3 to 500 drawn
    ratio         (beta - gamma) / |beta + gamma|, from -1 to 3 drawn
    n             log n
    delta_nu, delta_eta    asinh(delta z_u P), and delta_a likewise with delta_a z_u P / |A|
    p             log(p z_u P)
    psi           log(psi / z_u), and delta_psi as the rates with delta_psi P
    lambda_       log lambda_
    z0            z0 / z_u
    zeta_s, q     themselves

Rates are not negative: damage does not heal. A parameter that the user bounds is its own coordinate within its bounds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels.elementary import power
from hysim.kernels.stepping import inlined_kernel
from hysim.laws.differential import _boucwen_search
from hysim.laws.differential._boucwen_search import KNEE, ROWS
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen import bouc_wen_with
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.models.by_structure import Holding
from hysim.models.model import Example, family
from hysim.models.parameters import Coordinate, by_name
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Stage
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
    word="lambda_", names=("lambda_",), neutral={"lambda_": 0.5}, drawn=8, rounds=((8, 25),), idle={"zeta_s": 0.0}
)
_WEARING = ("delta_a", "delta_nu", "delta_eta", "zeta_s")
_LARGEST_EXPONENT = 700.0
_WIDTHS, _BESIDE = 0.7, 4.0  # of the bell: the most that a step goes within it, and where it begins
_LARGEST = 600.0  # knee of the loading branch; smaller yield memories are below what a record resolves
_SAME_SIGN = 0.02  # smallest knee of a law that pinches, whose loading coefficient is positive
_LOADING = Coordinate(
    "loading", -KNEE, float(np.arcsinh(_LARGEST)), drawn=(float(np.arcsinh(1.0 / 3.0)), float(np.arcsinh(500.0)))
)
_RATE = Coordinate("", 0.0, 4.0, physical=(True, False))  # damage does not heal
_ROWS = {name: ROWS[name] for name in ("A", "beta", "gamma", "n")} | by_name(
    _LOADING,
    Coordinate("ratio", -10.0, 10.0, drawn=(-1.0, 3.0)),
    *(_RATE._replace(name=name) for name in ("delta_a", "delta_nu", "delta_eta")),
    Coordinate("zeta_s", 0.0, 0.999, physical=(True, True)),  # a slope along a branch does not change its sign
    Coordinate("q", -1.0, 1.0),
    Coordinate("p", 0.05, 300.0, log=True),
    Coordinate("psi", 0.02, 5.0, log=True),
    _RATE._replace(name="delta_psi", drawn=(0.0, 2.0)),
    Coordinate("lambda_", 0.02, 10.0, log=True),
    Coordinate("z0", -3.0, 3.0, drawn=(-1.0, 1.0)),
)
_PINCHED = {**_ROWS, "loading": _LOADING._replace(lower=float(np.arcsinh(_SAME_SIGN)), physical=(True, False))}


@dataclass(frozen=True, kw_only=True)
class _Chart(_boucwen_search.Chart):
    def sizes(self, known: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        slope = _boucwen_search.steepness(known["A"])
        coefficient = (known["beta"] + known["gamma"]) / _boucwen_search.shape_unit(known["A"], known["n"], self.span)
        yielding = slope * self.span * np.maximum(coefficient, 1.0) ** (-1.0 / known["n"])
        worn, one = yielding * self.path, np.ones_like(slope)
        return {
            "delta_a": slope / worn,
            **dict.fromkeys(("delta_nu", "delta_eta", "p"), one / worn),
            "psi": yielding,
            "delta_psi": one / self.path,
            **dict.fromkeys(("lambda_", "zeta_s", "q"), one),
            "z0": yielding,
        }


@inlined_kernel
def bell(
    e: float, loading: float, n: float, zeta_s: float, q: float, p: float, psi: float, lambda_: float
) -> tuple[float, float, float]:
    """Depth, place and width of the pinching; `psi` is that at `e`."""
    where = 0.0
    if q != 0.0:
        where = q * loading ** (-1.0 / n) if loading > 0.0 else math.nan
    depth = -zeta_s * math.expm1(min(-p * e, _LARGEST_EXPONENT))
    return depth, where, psi * (lambda_ + depth)


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

    Integrated along monotone strokes to 1e-10 of the range (`hysim.kernels.branch`). A law that degrades is never in a
    steady cycle. `identify` searches the Bouc-Wen law, then the wear, then the pinching, then ``lambda_``, and keeps of
    them what lowers the BIC; a start that wears off or pinches, or ``free=`` or ``bounds=`` with one of its parameters,
    keeps it in any case. Pinching is searched beside wear only: each stage begins where the one before ended, and wear
    at a rate of zero costs no more than its two parameters in the BIC. For pinching alone, ``fixed={"delta_nu": 0.0,
    "delta_eta": 0.0}`` leaves the wear out. It holds delta_a and delta_psi, whose work the other rates and psi nearly
    do. Sources: T. T. Baber and Y. K. Wen, J. Eng. Mech. Div. 107 (1981); T. T. Baber and M. N. Noori, J. Eng. Mech.
    111 (1985); G. C. Foliente, J. Struct. Eng. 121 (1995), for the form of the pinching.

    Parameters
    ----------
    A, beta, gamma, n : float
        As in `BoucWen`, of the law as it is new.
    delta_a, delta_nu, delta_eta : float
        Rates of lost slope, strength and stiffness [1 / (unit of z unit of u); delta_a that times the unit of A].
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

    Examples
    --------
    >>> import hysim as hs
    >>> worn = hs.BoucWenBaberNoori(beta=0.5, gamma=0.5, delta_nu=0.2, delta_eta=0.1)
    >>> worn.response([0.0, 2.0, -2.0, 2.0]).round(6).tolist()
    [0.0, 0.780431, -0.69475, 0.588304]
    """

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
    contains = bouc_wen_with(*_WEARING)
    stages = (_WEAR, _PINCHING, _SPREAD)
    samples_a_thread = 2_000

    @staticmethod
    def slope(p: Any, z: float, e: float, u: float, s: float) -> tuple[float, float]:
        w, nu = z * s, 1.0 + p.delta_nu * e
        bend = nu * power(abs(z), p.n) * (p.gamma + math.copysign(1.0, w) * p.beta)
        eta = 1.0 + p.delta_eta * e
        slope = (p.A - p.delta_a * e - bend) / eta if eta > 0.0 else math.nan
        if p.zeta_s != 0.0:
            depth, where, width = bell(
                e, nu * (p.beta + p.gamma), p.n, p.zeta_s, p.q, p.p, p.psi + p.delta_psi * e, p.lambda_
            )
            slope *= 1.0 - depth * math.exp(-(((w - where) / width) ** 2))
        return slope, z

    @staticmethod
    def longest(p: Any, z: float, e: float, slope: float, s: float) -> float:
        if p.zeta_s == 0.0:
            return math.inf
        nu = 1.0 + p.delta_nu * e
        _, where, width = bell(e, nu * (p.beta + p.gamma), p.n, p.zeta_s, p.q, p.p, p.psi + p.delta_psi * e, p.lambda_)
        speed = abs(slope) + abs(where * p.delta_nu / (p.n * nu) * z)
        return float(max(_WIDTHS * abs(width), abs(z * s - where) - _BESIDE * abs(width)) / speed)

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        pinches = tables["zeta_s"] != 0.0
        sums = {"beta + gamma": tables["beta"] + tables["gamma"], "psi": tables["psi"], "lambda_": tables["lambda_"]}
        for name, value in sums.items():
            if (wrong := pinches & (value <= 0.0)).any():
                raise ValueError(f"{name} must be positive in a law that pinches, got {value[wrong][0]}")

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

        ValueError if the law pinches, has an offset, initial memory, more than one input coefficient, or no stiffness.
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

        ValueError if the law degrades, has an offset, initial memory, more than one input coefficient, or no stiffness.
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
    def known_slopes(self) -> tuple[float, float]:
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
        held = freedom.held(self.scalars, redundant=self.alike(record, freedom))
        if all(held.get(name, 1.0) == 0.0 for name in _WEARING):
            return super().search_space(record, freedom)
        rows = _ROWS if held.get("zeta_s", 1.0) == 0.0 else _PINCHED
        return _boucwen_search.search_space(self, record, freedom, _Chart, rows)

    def alike(self, record: Record, freedom: Freedom) -> tuple[tuple[str, ...], ...]:
        pinches = self.zeta_s != 0.0 or "zeta_s" in freedom.free
        pinching = () if pinches else (*_PINCHING.names, *_PINCHING.optional, *_SPREAD.names)
        return tuple((name,) for name in ("delta_a", *pinching))

    def steady(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Initial memory of a steady cycle; ValueError for a law that degrades or pinches: it has no steady cycle."""
        values = {**self.scalars, **parameters}
        if any(np.any(values[name]) for name in _WEARING):
            raise ValueError('a law that wears off has no steady cycle: use initial="free"')
        return super().steady(parameters, record)
