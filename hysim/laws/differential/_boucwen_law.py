"""The laws whose memory is that of Bouc and Wen: facts, limit cycle and inverse.

    dz/du = A - |z|^n (gamma + beta sign(z du))
    y = offset + c1 u + c2 u^2 + ... + gain z

`A` and `gain` enter only as a product. With A > 0 and beta > 0 the loop of y runs clockwise for a positive gain (a
restoring force) and counterclockwise for a negative one (a piezoelectric displacement). Sources: R. Bouc 1967; Y. K.
Wen, J. Eng. Mech. Div. 102 (1976); the classes after Ikhouane and Rodellar 2007.

**Bounds** of the memory and of the slope, whatever the input. A branch on which w = |z| grows obeys w' = a - c w^n and
ends at w = (a/c)^(1/n): with A > 0 the loading branch, a = A and c = beta + gamma; with A < 0 the unloading one, a = -A
and c = beta - gamma. In the classes I to IV of Ikhouane and Rodellar (2007) this bounds the memory, or z0 does where it
is larger. With |z| <= B the slope lies between its values at z = 0, and at B on both branches:

    A,    A - (beta + gamma) B^n,    A + (beta - gamma) B^n
"""

import math
from typing import Any, ClassVar

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import boucwen as kernels
from hysim.kernels import stepping
from hysim.kernels.charts import N_WORK
from hysim.laws.differential import boucwen_inverse, limit_cycle
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen_inverse import BoucWenInverse, InverseState
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Law, State, Stepping
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import Tables
from hysim.records import Record


def saturation(A: float, beta: float, gamma: float, n: float) -> float:
    """``|z|`` at the end of a long stroke of the input; inf where it has no limit."""
    if A == 0.0:
        return 0.0 if beta + gamma > 0.0 and beta - gamma >= 0.0 else math.inf
    c = beta + math.copysign(1.0, A) * gamma
    return _power(abs(A) / c, 1.0 / n) if c > 0.0 else math.inf


def memory_slopes(A: float, beta: float, gamma: float, n: float, bound: float) -> tuple[float, float]:
    """Lowest and highest slope dz/du for |z| <= `bound`."""
    ends = [A, *(A - c * _power(bound, n) if c != 0.0 else A for c in (beta + gamma, gamma - beta))]
    return min(ends), max(ends)


def polynomial_range(coefficients: FloatArray, low: float, high: float) -> tuple[float, float]:
    """Lowest and highest value of a polynomial (ascending powers) on an interval that may be infinite."""
    trimmed = np.trim_zeros(coefficients, "b")
    if trimmed.size < 2:
        value = float(trimmed[0]) if trimmed.size else 0.0
        return value, value
    turns = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(trimmed))
    real = turns[np.abs(turns.imag) <= 1e-8 * np.abs(turns)].real
    inside = [turn for turn in real.tolist() if low < turn < high]
    finite = [point for point in (low, high, *inside) if math.isfinite(point)]
    values = np.polynomial.polynomial.polyval(finite, trimmed).tolist()
    values += [float(trimmed[-1]) * end ** (trimmed.size - 1) for end in (low, high) if math.isinf(end)]
    return min(values), max(values)


def _power(base: float, exponent: float) -> float:
    """base ** exponent for base >= 0, where Python raises an OverflowError for infinity."""
    with np.errstate(over="ignore"):
        return float(np.float64(base) ** exponent)


class BoucWenStep(Law):
    """A law that packs the parameters (A, beta, gamma, n, gain, offset, c1, c2, ...) and the memory (u, z)."""

    step = staticmethod(kernels.step)
    start = staticmethod(kernels.start)
    resume = staticmethod(kernels.resume)
    workspace: ClassVar[int] = N_WORK - 2

    @classmethod
    def path(cls, law: CompiledLaw, u: FloatArray, y: FloatArray) -> int:
        A, beta, gamma, n = map(float, law.parameters[:4])
        last_u, z = map(float, law.state[:2])
        if n == 1.0:
            lost = kernels.linear_path(A, beta, gamma, last_u, z, u, y)
        elif n == 2.0:
            lost = kernels.quadratic_path(A, beta, gamma, last_u, z, u, y)
        else:
            lost = kernels.power_path(law.parameters, last_u, z, u, law.state, y)
        if lost < 0:
            law.state[:2] = u[-1], y[-1]
            kernels.to_output(law.parameters, 4, u, y)
        return int(lost)

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        parameters, memory = cls.pack(tables)
        laws = read_only(np.concatenate([parameters[:, :4], memory[:, 1:]], axis=1), finite=False)
        with np.errstate(all="ignore"):  # a memory that diverges overflows, and uncompiled kernels would warn of it
            kernels.batch(laws, read_only(parameters[:, 4:], finite=False), u, y)


class BoucWenLaw(BoucWenStep, MemoryLaw):
    """A law with the memory of Bouc and Wen, exact at the samples of an input that is linear between them."""

    elementary = (1.0, 2.0)

    @property
    def stepping(self) -> Stepping:
        """The kernel for the exponent: a loop compiles no other, and n = 1 and 2 need no charts."""
        if self.n == 1.0:
            return Stepping(kernels.linear_step, stepping.start, 0)
        return Stepping(kernels.quadratic_step, stepping.start, 0) if self.n == 2.0 else super().stepping

    @property
    def admissible(self) -> bool:
        """Whether ``-beta <= gamma <= beta``: the law then creates no energy, whatever the input."""
        return -self.beta <= self.gamma <= self.beta

    @property
    def stability_class(self) -> str:
        """Class ``"I"`` to ``"V"`` in which the memory is bounded for every input, or ``"none"``.

        Classes II and IV are bounded only from a range of initial memories (Ikhouane and Rodellar 2007).
        """
        loading, unloading = self.beta + self.gamma, self.beta - self.gamma
        if self.A > 0.0 and loading > 0.0:
            return "I" if unloading >= 0.0 else "II" if self.beta >= 0.0 else "none"
        if self.A < 0.0 and unloading > 0.0:
            return "III" if loading >= 0.0 else "IV" if self.beta >= 0.0 else "none"
        return "V" if self.A == 0.0 and loading > 0.0 and unloading >= 0.0 else "none"

    @property
    def passive(self) -> bool:
        """Whether the memory is a passive map from the velocity u' to z that is bounded for every input.

        This is class I: A > 0, beta + gamma > 0 and beta >= gamma, that is, sigma >= 1/2 in normalised form.
        """
        return self.stability_class == "I"

    @property
    def saturation(self) -> float:
        """Limit of ``|z|`` on a long stroke of the input, (A / (beta + gamma))^(1/n) for A > 0; inf without a limit."""
        return saturation(self.A, self.beta, self.gamma, self.n)

    @property
    def memory_bound(self) -> float:
        """Bound of ``|z|`` for every input that begins with z0; inf if ``|z|`` is not bounded."""
        if self.stability_class == "none":
            return math.inf
        if self.stability_class in ("II", "IV"):
            unstable = abs(self.A) / (abs(self.gamma) - self.beta)
            if abs(self.z0) > _power(unstable, 1.0 / self.n):
                return math.inf
        return max(abs(self.z0), self.saturation)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude [unit of u].

        It has the peak, the coercive input, the width at u = 0 and the energy, to rounding; a law with beta > 0
        approaches it from every memory inside its bound. Raises ValueError if the amplitude is not positive or A = 0,
        and SimulationError if the memory diverges within one stroke.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.BoucWen(beta=0.5, gamma=0.5).limit_cycle(1.0)
        >>> round(loop.peak, 12), round(loop.coercive, 12), round(loop.energy, 12)
        (0.721535457239, 0.278464542761, 0.593244754991)
        """
        return limit_cycle.limit_cycle(self.A, self.beta, self.gamma, self.n, float(amplitude))

    @property
    def known_slopes(self) -> tuple[float, float]:
        return self.slope_bounds()

    def slope_bounds(self, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input between `low` and `high` [unit of u] that begins with z0.

        They are infinite where neither the memory nor the slope is bounded. Inputs that saturate the memory approach
        them, so that they are sharp for a law without polynomial; such a law's do not depend on the range of the input.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)  # Low and Guo's stack
        >>> [round(bound, 12) for bound in law.slope_bounds()]
        [0.44, 1.0]
        """
        if not low <= high:
            raise ValueError(f"low must not be above high, got {low} and {high}")
        memory = memory_slopes(self.A, self.beta, self.gamma, self.n, self.memory_bound)
        scaled = sorted(self.gain * slope if self.gain else 0.0 for slope in memory)
        static = polynomial_range(self.input_slope, low, high)
        with np.errstate(invalid="ignore"):
            total = np.add(static, scaled)
        lowest, highest = np.where(np.isnan(total), [-np.inf, np.inf], total).tolist()
        return lowest, highest

    def is_invertible(self, low: float = -np.inf, high: float = np.inf) -> bool:
        """Whether the slope keeps its sign for every input between `low` and `high`: its bounds have one sign.

        This is sufficient, not necessary: `inverse_response` looks at the given record. For a piezoelectric stack by
        Low and Guo it reads alpha max(1, 2 beta / (beta + gamma)) < 1. A bound of zero to rounding counts as zero.
        """
        bounds = self.slope_bounds(low, high)
        rounding = 1e-14 * (abs(self.gain * self.A) + float(np.abs(self.input_polynomial).max()))
        return bounds[0] > rounding or bounds[1] < -rounding

    def inverse(self) -> BoucWenInverse:
        """The inverse as an object for loops, in the direction of the output at u = z = 0, else ValueError."""
        return boucwen_inverse.inverse(self)

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | InverseState | None) -> CompiledLaw:
        rest = boucwen_inverse.at_rest(self, float(y[0])) if u0 is None and state is None else (u0, self.z0)
        begin: Any = rest if state is None else state
        return boucwen_inverse.inverse(self, float(begin[0])).begun(begin)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        return boucwen_inverse.unreached(sample, y, inverse)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        return boucwen_inverse.inverse(self, u0).compiled(u0=u0, limits=limits)

    def notes(self, record: Record, model: "BoucWenLaw") -> tuple[str, ...]:
        """Stability class and passivity of the identified law."""
        if model.admissible and model.stability_class == "I":
            return ("the law is of stability class I, and its memory is passive",)
        kind = model.stability_class
        bounded = f"of stability class {kind}" if kind != "none" else "of no stability class: it may diverge"
        return (f"the law is {bounded}" + ("" if model.admissible else ", and its memory may create energy"),)

    def divergence(self, sample: int, u: float, y: float) -> str:
        loading, unloading = self.beta + self.gamma, self.beta - self.gamma
        return (
            f"the memory diverges at sample {sample} (u = {u:g}): with beta + gamma = {loading:g} and beta - gamma = "
            f"{unloading:g} it is bounded for shorter inputs only: the law is unsafe, identify it with admissible=True"
        )

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *_: FloatArray) -> FloatArray:
        return np.asarray(self.A - np.abs(z) ** self.n * (self.gamma + self.beta * np.sign(z * direction)))
