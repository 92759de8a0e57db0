"""The generalised Bouc-Wen law of Song and Der Kiureghian."""

from typing import ClassVar

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels import generalized as kernels
from hysim.laws.differential import _boucwen_law as facts
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen import bouc_wen_with
from hysim.models.law import Packed, Stepping
from hysim.models.model import Example, family
from hysim.models.search_space import Freedom
from hysim.models.tables import Tables
from hysim.records import Record

_SECTORS = ("b2", "b3", "b4", "b5", "b6")
_ONE_SIDED = (("b6", "gamma"), ("b3", "b5"), ("b2", "b4"))
"""Pairs of terms that are the same to a sign as long as u keeps its sign."""


@family
class GeneralizedBoucWen(MemoryLaw):
    """Bouc-Wen law with a shape for each sector of the loop, after Song and Der Kiureghian (2006).

    A loop in the (u, z) plane has six sectors by the signs of u', z and u; psi is one number in each.

    ``dz/du = A - |z|^n psi`` with ``psi = gamma + beta sgn(u' z) + b2 sgn(u' u) + b3 sgn(z u) + b4 sgn(u') +
    b5 sgn(z) + b6 sgn(u)``, and ``y = offset + sum c_k u^k + gain z``. Exact for every n. On an input of one sign only
    the sums gamma + b6, b3 + b5 and b2 + b4 can be told (differences for a negative one): `identify` then holds b6, b3
    and b2. No class of stability is known for the general case. Source: J. Song and A. Der Kiureghian, J. Eng. Mech.
    132 (2006).

    Parameters
    ----------
    A, beta, gamma, n : float
        As in `BoucWen`; beta is their beta_1, and theirs has no gamma.
    b2, b3, b4, b5, b6 : float
        Their beta_2 to beta_6 [unit of z^(1-n) / unit of u]. The loop is point symmetric if b4, b5 and b6 are zero.
    gain, offset, z0, input_coefficients
        As in `PolynomialBoucWen`.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, or there is no coefficient.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.GeneralizedBoucWen(beta=0.5, gamma=0.3, b4=0.1, b5=-0.2)
    >>> law.response([0.0, 1.0, 0.0, 1.0]).round(6).tolist()
    [0.0, 0.719164, -0.325835, 0.534028]
    """

    b2: float = 0.0
    b3: float = 0.0
    b4: float = 0.0
    b5: float = 0.0
    b6: float = 0.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0,)

    example = Example({"beta": 0.5, "gamma": 0.2, "b2": 0.1, "b4": 0.1}, (-2.0, 2.0), title="Generalised Bouc-Wen")
    contains = bouc_wen_with(*_SECTORS)
    elementary = (1.0, 2.0)
    step = staticmethod(kernels.step)
    workspace: ClassVar[int] = kernels.N_STATE - 2

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters of four Bouc-Wen laws, for a falling and a rising u, each below and above zero; memory (u, z)."""
        A, beta, gamma, n, b2, b3, b4, b5, b6 = (tables[name] for name in ("A", "beta", "gamma", "n", *_SECTORS))
        output, laws = [tables[name] for name in ("gain", "offset", "input_coefficients")], []
        for direction in (-1.0, 1.0):
            for side in (-1.0, 1.0):
                both = direction * side
                bend = gamma + both * b2 + direction * b4 + side * b6
                laws += [A, beta + both * b3 + direction * b5, bend, n, *output]
        return Packed(np.concatenate(laws, axis=1), cls.initial_memory(tables))

    @property
    def stepping(self) -> Stepping:
        """The kernel for the exponent: n = 1 and 2 need no charts."""
        return Stepping(kernels.elementary_step, self.start, 0) if self.n in self.elementary else super().stepping

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Bounds for a law whose four parts all limit the memory to their saturation."""
        laws = self.packed[0].reshape(4, -1)[:, :4].tolist()
        loading, unloading = ([gamma + side * beta for _, beta, gamma, _ in laws] for side in (1.0, -1.0))
        if not (self.A > 0.0 and min(loading) > 0.0):
            return super().known_slopes
        bound = max(abs(self.z0), facts.saturation(self.A, 0.0, min(loading), self.n))
        lows, highs = zip(*(facts.memory_slopes(A, b, g, n, bound) for A, b, g, n in laws), strict=True)
        if self.A - max(unloading) * bound**self.n < 0.0:  # the memory may grow where the input turns back
            return super().known_slopes
        memory = sorted((self.gain * min(lows), self.gain * max(highs)))
        static = facts.polynomial_range(self.input_slope, -np.inf, np.inf)
        return static[0] + memory[0], static[1] + memory[1]

    def alike(self, record: Record, freedom: Freedom) -> tuple[tuple[str, ...], ...]:
        """The pairs of parameters; if the input keeps its sign, one of each pair is held."""
        return _ONE_SIDED if (record.u >= 0.0).all() or (record.u <= 0.0).all() else ()

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *_: FloatArray) -> FloatArray:
        s, e, side = direction, np.sign(z), np.sign(u)
        symmetric = self.gamma + self.beta * s * e + self.b2 * s * side + self.b3 * e * side
        return np.asarray(self.A - np.abs(z) ** self.n * (symmetric + self.b4 * s + self.b5 * e + self.b6 * side))
