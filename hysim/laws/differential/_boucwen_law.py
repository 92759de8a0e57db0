"""What all Bouc-Wen laws share: the memory and what follows from it.

    dz/du = A - |z|^n (gamma + beta sign(z du))
    y = offset + c1 u + c2 u^2 + ... + gain z

u is the input, z the memory, y the output. The memory is evaluated exactly at the samples of an input
that is linear between them (`hysim.kernels.boucwen`); it does not depend on time. `A` and `gain` enter
only as a product. With A > 0 and beta > 0 the loop of y runs clockwise for a positive gain (a restoring
force) and counterclockwise for a negative one (a piezoelectric displacement).

Sources: R. Bouc 1967; Y. K. Wen, J. Eng. Mech. Div. 102 (1976); the classes after Ikhouane and Rodellar 2007.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.laws.differential import _boucwen_facts, boucwen_inverse, limit_cycle
from hysim.laws.differential._boucwen_step import BoucWenStep
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen_inverse import BoucWenInverse, InverseState
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Packed, State, Tables
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.records import Record


class BoucWenLaw(BoucWenStep, MemoryLaw):
    """The memory of Bouc and Wen; what it shares with other laws is in `hysim.laws.differential._memory_law`."""

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
        """What ``|z|`` tends to on a long way of the input, (A / (beta + gamma))^(1/n) for A > 0; inf if nothing."""
        return _boucwen_facts.saturation(self.A, self.beta, self.gamma, self.n)

    @property
    def memory_bound(self) -> float:
        """Bound of ``|z|`` for every input that begins with z0; inf if there is none."""
        return _boucwen_facts.memory_bound(self.A, self.beta, self.gamma, self.n, self.z0, self.stability_class)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude.

        Parameters
        ----------
        amplitude : float
            [unit of u].

        Returns
        -------
        LimitCycle
            Peak, coercive input, width at u = 0 and energy, to rounding; a law with beta > 0 approaches it
            from every memory inside its bound.

        Raises
        ------
        ValueError
            If the amplitude is not positive, or A = 0.
        SimulationError
            If the memory diverges within one stroke.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.BoucWen(beta=0.5, gamma=0.5).limit_cycle(1.0)
        >>> round(loop.peak, 12), round(loop.coercive, 12), round(loop.energy, 12)
        (0.721535457239, 0.278464542761, 0.593244754991)
        """
        return limit_cycle.limit_cycle(self.A, self.beta, self.gamma, self.n, float(amplitude))

    def slope_bounds(self, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
        """Bounds of the slope dy/du over every input between `low` and `high` that begins with z0.

        Parameters
        ----------
        low, high : float
            Range of the input [unit of u]; a law without polynomial does not depend on it.

        Returns
        -------
        (float, float)
            Infinite where the memory is not bounded and the slope neither. They are approached by inputs
            that saturate the memory, so that they are sharp for a law without polynomial.

        Examples
        --------
        A piezoelectric stack by Low and Guo: 1 - 0.56 is left of the slope just after a reversal.

        >>> import hysim as hs
        >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
        >>> [round(bound, 12) for bound in law.slope_bounds()]
        [0.44, 1.0]
        """
        if not low <= high:
            raise ValueError(f"low must not be above high, got {low} and {high}")
        memory = _boucwen_facts.memory_slopes(self.A, self.beta, self.gamma, self.n, self.memory_bound)
        scaled = sorted(self.gain * slope if self.gain else 0.0 for slope in memory)
        static = _boucwen_facts.polynomial_range(boucwen_inverse.derivative(self), low, high)
        with np.errstate(invalid="ignore"):
            total = np.add(static, scaled)
        lowest, highest = np.where(np.isnan(total), [-np.inf, np.inf], total).tolist()
        return lowest, highest

    def is_invertible(self, low: float = -np.inf, high: float = np.inf) -> bool:
        """Whether the slope keeps its sign for every input between `low` and `high`: its bounds have one sign.

        This is sufficient for an inverse, not necessary: on one record a law may do without, and
        `inverse_response` looks at the record. For a piezoelectric stack by Low and Guo it reads
        alpha max(1, 2 beta / (beta + gamma)) < 1. A bound of zero to rounding counts as zero.
        """
        bounds = self.slope_bounds(low, high)
        rounding = 1e-14 * (abs(self.gain * self.A) + float(np.abs(boucwen_inverse.coefficients(self)).max()))
        return bounds[0] > rounding or bounds[1] < -rounding

    def inverse(self) -> BoucWenInverse:
        """The law's inverse as an object, for loops that run sample by sample.

        Returns
        -------
        BoucWenInverse
            In the direction that the output has at u = 0, z = 0.

        Raises
        ------
        ValueError
            If the slope is zero there.
        """
        return boucwen_inverse.inverse(self)

    def inverse_response(
        self, y: npt.ArrayLike, u0: float | None = None, state: State | InverseState | None = None
    ) -> FloatArray:
        """Input that gives the output `y`, linear between the samples.

        Parameters
        ----------
        y : array, shape (n_samples,)
            Wanted output.
        u0 : float, optional
            Input at which the law rests, its memory at z0, before it moves to the first sample. By default
            it rests at the first sample: the input that gives y[0] with the memory at z0, found from u = 0.
        state : tuple of float, optional
            Input and memory (and output) to continue from, in place of u0 and z0.

        Returns
        -------
        array, shape (n_samples,)
            Its `response` is y to rounding.

        Raises
        ------
        SimulationError
            If the slope dy/du does not keep its sign on the way, or the output does not reach a sample; the
            message names the sample, the input and the slope there.
        ValueError
            If y is not finite or has not one axis, its first sample does not tell the first input (give u0),
            or the slope is zero where the record begins.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
        >>> law.inverse_response(law.response([0.0, 30.0, 10.0])).round(9).tolist()
        [0.0, 30.0, 10.0]
        """
        return boucwen_inverse.inverse_response(self, y, u0, state)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The closed form of the inverse, stepped; see `hysim.models.inverse_steps`."""
        return boucwen_inverse.inverse(self, u0).compiled(u0=u0, limits=limits)

    def notes(self, record: Record, model: "BoucWenLaw") -> tuple[str, ...]:
        """What the identified law promises for other inputs."""
        if model.admissible and model.stability_class == "I":
            return ("the law is of stability class I and passive",)
        kind = model.stability_class
        bounded = f"of stability class {kind}" if kind != "none" else "of no stability class: other inputs may escape"
        return (f"the law is {bounded}" + ("" if model.admissible else ", and may create energy"),)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters (A, beta, gamma, n, gain, offset, c1, c2, ...) and memory (u, z)."""
        return Packed(cls.joined(tables, "A", "beta", "gamma", "n"), cls.initial_memory(tables))

    def divergence(self, sample: int, u: float, y: float) -> str:
        """The sums of parameters that let the memory diverge."""
        loading, unloading = self.beta + self.gamma, self.beta - self.gamma
        return (
            f"the memory diverges at sample {sample} (u = {u:g}): with beta + gamma = {loading:g} and beta - gamma = "
            f"{unloading:g} it is bounded for shorter inputs only"
        )

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *_: FloatArray) -> FloatArray:
        return np.asarray(self.A - np.abs(z) ** self.n * (self.gamma + self.beta * np.sign(z * direction)))
