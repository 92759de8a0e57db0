"""The law of Jiles and Atherton for magnetic cores.

    He = H + alpha M,    M = c M_an(He) + (1 - c) M_irr,    B = mu0 (H + M)
    dM_irr/dHe = (M_an(He) - M_irr) / (delta k),    zero where (M_an - M_irr) delta < 0,    delta = sgn(dH)

u is the field H, y the flux density B, and the memory z is M_irr, the irreversible magnetisation.
"""

import math
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels.magnetics import jiles_atherton as kernels
from hysim.kernels.magnetics import jiles_atherton_inverse as inverse
from hysim.laws.magnetic import _jiles_atherton_conversions as conversions
from hysim.laws.magnetic import _jiles_atherton_search as search
from hysim.laws.magnetic._jiles_atherton_conversions import MU0
from hysim.models.inverse_search import first_input
from hysim.models.law import Law, Packed, State
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

_POSITIVE = ("Ms", "a", "k")


@family
class JilesAtherton(Law):
    """Jiles-Atherton law of a magnetic core, from the field H to the flux density B.

    ::

        y    = offset + feedthrough H + gain M,    M = c M_an(He) + (1 - c) M_irr,    He = H + alpha M
        M_an = Ms L(He / a),    L(x) = coth x - 1/x
        dM_irr/dHe = (M_an - M_irr) / (delta k),    zero where (M_an - M_irr) delta < 0,    delta = sgn(dH)

    By default ``feedthrough = gain = mu0``, and y is B in tesla; with ``feedthrough=0, gain=1`` it is M. Where the rate
    would be negative it is zero, as in all present uses. Sources: D. C. Jiles and D. L. Atherton, J. Magn. Magn. Mater.
    61 (1986); J. H. B. Deane, IEEE Trans. Magn. 30 (1994), for the clip; A. Ramesh, D. C. Jiles and J. M. Roderick,
    IEEE Trans. Magn. 32 (1996), for the anisotropy.

    Parameters
    ----------
    Ms : float
        Saturation magnetisation, positive [A/m].
    a : float
        Field that scales the anhysteretic curve, positive [A/m].
    alpha : float
        Coupling of the magnetisation to the effective field; negative for a core with a gap, alpha - N for a
        demagnetising factor N and the outer field.
    k : float
        Pinning, near the coercive field of a soft material, positive [A/m]. It is mu0 k in papers that give it in
        tesla.
    c : float
        Reversible part of the magnetisation, from 0 to 1.
    anisotropy : float
        Energy of a uniaxial anisotropy in units of the thermal one, ``K cos(2 psi) / (mu0 Ms a)`` for an easy axis at
        the angle psi: positive for an easy axis along the field, negative for one across it, 0 for Langevin's curve.
    reversible_feedback : float
        Part w of the reversible magnetisation in ``He = H + alpha (M_irr + w c (M_an - M_irr))``, from 0 to 1: 1 is
        ``H + alpha M``, 0 is ``H + alpha M_irr``, the two readings of the paper of 1986.
    gain : float
        Output for each unit of M [unit of y / (A/m)].
    feedthrough : float
        Output for each unit of H [unit of y / (A/m)].
    offset : float
        Output at H = M = 0 [unit of y].
    z0 : float
        M_irr at the first sample [A/m].

    Raises
    ------
    ValueError
        If a number is not finite; Ms, a or k is not positive; c or reversible_feedback is not between 0 and 1; or
        ``reversible_feedback alpha c dM_an/dHe`` comes to 1 at He = 0: the reversible magnetisation would not be
        unique.

    Notes
    -----
    Between two samples H moves monotonically. The law is evaluated in He, in which it is linear, by quadratures whose
    remainder is bounded by a rounding: good to 1e-13 of the range, whatever the samples. The bulk form
    ``dM/dHe = c M_an' + (M_an - M) / (delta k)`` is the same law; see `from_jamodel`, `from_total` and `from_circuit`
    for others. Where alpha is so large that H would fall while He rises, the magnetisation jumps: `response` raises
    SimulationError there. A law with ``alpha Ms < 3 a`` (and no anisotropy) does not jump from a state that an input
    has led to. `identify` holds the feedthrough mu0 in records whose units are A/m and T, and frees it in others.

    Examples
    --------
    >>> import hysim as hs
    >>> iron = hs.JilesAtherton(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=400.0, c=0.2)
    >>> iron.response([0.0, 5000.0, 0.0, -5000.0]).round(6).tolist()
    [0.0, 1.691671, 0.623882, -1.691671]
    """

    Ms: float = 1.6e6
    a: float = 1100.0
    alpha: float = 1.6e-3
    k: float = 400.0
    c: float = 0.2
    anisotropy: float = 0.0
    reversible_feedback: float = 1.0
    gain: float = MU0
    feedthrough: float = MU0
    offset: float = 0.0
    z0: float = 0.0

    units: ClassVar = {
        **dict.fromkeys(("Ms", "a", "k", "z0"), "u"),
        **dict.fromkeys(("alpha", "c", "anisotropy", "reversible_feedback"), "1"),
    }
    example = Example(
        {"Ms": 1.0, "a": 0.3, "alpha": 0.1, "k": 0.4, "gain": 1.0, "feedthrough": 0.0},
        (-2.0, 2.0),
        title="Magnetic core: Jiles-Atherton",
    )
    searched = (
        Parameter("gain", unit="y/u", affine=True),
        Parameter("feedthrough", unit="y/u", affine=True),
        Parameter("offset", unit="y", affine=True),
    )
    step = staticmethod(kernels.step)
    resume = staticmethod(kernels.resume)
    exact_strokes: ClassVar[bool] = True

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse constants of no material, and a reversible magnetisation that is not unique."""
        for name in _POSITIVE:
            if not (tables[name] > 0.0).all():
                raise ValueError(f"{name} must be positive, got {tables[name].min()}")
        for name in ("c", "reversible_feedback"):
            if not ((tables[name] >= 0.0) & (tables[name] <= 1.0)).all():
                raise ValueError(f"{name} must be between 0 and 1, got {tables[name].ravel().tolist()[0]}")
        coupling = tables["alpha"] * tables["Ms"] / tables["a"]
        feedback = tables["reversible_feedback"] * tables["c"] * coupling * search.initial_slope(tables["anisotropy"])
        if not (feedback < 1.0).all():
            raise ValueError(
                "the reversible magnetisation is not unique: reversible_feedback alpha c dM_an/dHe must be below 1 at "
                f"He = 0, got {feedback.max():g}; take a smaller alpha or c, or a larger a"
            )

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.magnetics.jiles_atherton.step` takes them; memory (u, M_irr, He / a, rest)."""
        a, Ms = tables["a"], tables["Ms"]
        scaled = [a, Ms, tables["alpha"] * Ms / a, tables["k"] / a]
        others = ("c", "reversible_feedback", "anisotropy", "gain", "feedthrough", "offset")
        parameters = np.concatenate([*scaled, *(tables[name] for name in others)], axis=1)
        return Packed(parameters, cls.initial_memory(tables, further=2))

    @classmethod
    def from_total(cls, *, Ms: float, a: float, alpha: float, k: float, c: float) -> Self:
        """The spelling ``dM_irr/dHe = (M_an - M) / (delta k)``, with the whole M in place of M_irr.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.JilesAtherton.from_total(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=320.0, c=0.2).k
        400.0
        """
        numbers: Any = conversions.from_total(Ms, a, alpha, k, c)
        return cls(**numbers)

    def to_total(self) -> dict[str, float]:
        """The arguments of `from_total`; ValueError if the law is anisotropic, has another He, or begins magnetised."""
        return conversions.to_total(self)

    @classmethod
    def from_circuit(cls, *, MS: float, A: float, K: float, C: float) -> Self:
        """The spelling of circuit simulators, ``dM/dH = (M_an - M) / ((1 + C) delta K) + C / (1 + C) dM_an/dH``.

        It has no coupling alpha. Where the simulator's anhysteretic curve is ``MS H / (|H| + A)`` (PSpice, level 2),
        the law here differs in this curve. ngspice (version 39) has no Jiles-Atherton law.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.JilesAtherton.from_circuit(MS=4e5, A=25.0, K=20.0, C=0.25)
        >>> law.k, law.c
        (25.0, 0.2)
        """
        numbers: Any = conversions.from_circuit(MS, A, K, C)
        return cls(**numbers)

    def to_circuit(self) -> dict[str, float]:
        """The arguments of `from_circuit`; ValueError also if the law has a coupling, or c = 1."""
        return conversions.to_circuit(self)

    @classmethod
    def from_jamodel(
        cls, *, a: float, k: float, c: float, Ms: float, alpha: float, Kan: float = 0.0, psi: float = 0.0
    ) -> Self:
        """The constants of Szewczyk's JAmodel for Octave, bulk model (``ModelType = 2``), psi in radian.

        Examples
        --------
        >>> import hysim as hs
        >>> round(hs.JilesAtherton.from_jamodel(a=50.0, k=20.0, c=0.2, Ms=1e6, alpha=1e-5, Kan=100.0).anisotropy, 6)
        1.591549
        """
        numbers: Any = conversions.from_jamodel(a, k, c, Ms, alpha, Kan, psi)
        return cls(**numbers)

    def to_jamodel(self) -> dict[str, float]:
        """The arguments of `from_jamodel`, with psi = 0 or pi / 2."""
        return conversions.to_jamodel(self)

    def magnetisation(self, u: npt.ArrayLike) -> FloatArray:
        """Magnetisation M at the samples of the field `u`, shape (n_samples,) [A/m]; errors as of `response`."""
        return self.with_scalars({"gain": 1.0, "feedthrough": 0.0, "offset": 0.0}).response(u)

    def divergence(self, sample: int, u: float, y: float) -> str:
        """Message with the coupling."""
        return (
            f"the magnetisation jumps at sample {sample} (on the way to u = {u:g}): the effective field H + alpha M "
            f"rises while H falls there; alpha Ms / a = {self.alpha * self.Ms / self.a:g} is too large for this input"
        )

    def is_invertible(self) -> bool:
        """Whether gain and feedthrough have one sign, and are not both zero: y rises, or falls, along every branch."""
        return self.gain * self.feedthrough >= 0.0 and self.gain + self.feedthrough != 0.0

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """By the search for the effective field, from the input that gives the first output with M_irr at z0."""
        if not self.is_invertible():
            return super().inverse_begun(y, u0, state)
        if state is not None:
            return self._inverse_from(self._begun(state[0], state)[0], UNLIMITED)
        return self.compiled_inverse(first_input(self, float(y[0])) if u0 is None else float(u0))

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        if not self.is_invertible():
            return super().compiled_inverse(u0, limits, sample_time)
        return self._inverse_from(self.compiled(u0), limits)

    def _inverse_from(self, law: CompiledLaw, limits: Limits) -> CompiledLaw:
        reached = law.step(law.parameters, law.state, law.state[0])
        parameters = np.concatenate([limits, law.parameters])
        return CompiledLaw(
            inverse.step, read_only(parameters, finite=False), np.concatenate([[law.state[0], reached], law.state])
        )

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box in the scales of the record's field and magnetisation."""
        is_by_default = self.arguments == self.defaults()
        return search.search_space(self.scalars, self.columns, record, freedom, is_by_default=is_by_default)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns M, H, 1 and 0, shape (n_sets, n_samples, 4)."""
        magnetisation = self.outputs({**parameters, "gain": 1.0, "feedthrough": 0.0, "offset": 0.0}, record.u)
        field = np.broadcast_to(record.u, magnetisation.shape)
        return np.stack([magnetisation, field, np.ones_like(field), np.zeros_like(field)], axis=-1)

    def _check_memory_is_its_own(self, parameters: Parameters, u: FloatArray) -> None:
        """It is: gain, feedthrough and offset stand behind it."""
