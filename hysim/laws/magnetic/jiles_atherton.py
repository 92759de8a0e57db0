"""The law of Jiles and Atherton for magnetic cores.

    He = H + alpha M,    M = c M_an(He) + (1 - c) M_irr,    B = mu0 (H + M)
    dM_irr/dHe = (M_an(He) - M_irr) / (delta k),    zero where (M_an - M_irr) delta < 0,    delta = sgn(dH)

u is the field H, y the flux density B, and the memory z is M_irr, the irreversible magnetisation.

The box in which the Jiles-Atherton law is searched.

With h half the span of the field, m half the span of the magnetisation (that of the output over the gain), and m0 the
slope of M_an / Ms at He = 0 in units of 1 / a (1/3 without anisotropy), the coordinates are

    Ms         log(Ms / m), from the amplitude to 30 times it
    stability  t,  alpha Ms s / a = 1 - exp(-t) + exp(t - 12): 0 for no coupling, 1 for t = 6
    width      log(a (exp(-t) + exp(t - 12)) / h): below t = 6 nearly the width of a loop's steep part
    k          log(k / h)
    c, anisotropy, reversible_feedback    themselves
    z0         z0 / Ms

where s is nearly the steepest slope of M / Ms over He / a that a loop may have (`steepest`), so that an upright loop is
an upright loop whatever the coupling. Without pinning s is m0. Pinning makes s smaller: a core with alpha Ms m0 > a,
whose anhysteretic curve has several branches, need not jump, and on small loops even one with alpha Ms s > a does not.
For a coupling that the user holds or bounds, width is log((a - alpha Ms m0) / h). A parameter that the user bounds is
its own coordinate, between these bounds.

Constants of the Jiles-Atherton law in other people's spellings, to ours and back.

Ours is  He = H + alpha M,  M = c M_an(He) + (1 - c) M_irr,  dM_irr/dHe = (M_an - M_irr)+ / (delta k). The same law is

    bulk            dM/dHe = c M_an' + (M_an - M)+ / (delta k), with the whole magnetisation: since
                    M_an - M = (1 - c) (M_an - M_irr), the constants are the same
    Bergqvist       dM_irr/dHe = (M_an - M)+ / (delta k (1 - c)): the same constants
    of M            dM_irr/dHe = (M_an - M)+ / (delta k'), which is k = k' / (1 - c)
    circuits        dM/dH = (M_an - M)+ / ((1 + C) delta K) + C / (1 + C) dM_an/dH without alpha: k = (1 + C) K,
                    c = C / (1 + C)
    JAmodel         the bulk form with (a, k, c, Ms, alpha, Kan, psi): anisotropy = Kan cos(2 psi) / (mu0 Ms a)
    pinning in J    k / mu0 in the papers that measure k in joule per ampere and square metre, that is, in tesla

Sources: D. C. Jiles and D. L. Atherton, J. Magn. Magn. Mater. 61 (1986); D. C. Jiles and others, IEEE Trans. Magn. 28
(1992); A. J. Bergqvist, IEEE Trans. Magn. 32 (1996); R. Venkataraman and P. S. Krishnaprasad, IEEE Conf. Decision and
Control 2000, for the bulk form; R. Szewczyk, JAmodel (github.com/romanszewczyk/JAmodel), ModelType 2. The form of the
circuit simulators is quoted for PSpice (core, level 2) and Micro-Cap; we have not seen their manuals.
"""

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_not_negative, check_positive, read_only
from hysim.errors import HysimWarning
from hysim.kernels import jiles_atherton as kernels
from hysim.kernels import jiles_atherton_inverse as inverse
from hysim.models.inverse_search import first_input
from hysim.models.law import Law, Packed, State
from hysim.models.model import Example, family
from hysim.models.parameters import Chart, Coordinate, affine, by_name, space_of_chart, spans
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

MU0 = 4e-7 * math.pi
"""Magnetic constant [T m / A], to its nine digits."""

_ROWS = by_name(
    Coordinate("Ms", 0.9, 30.0, log=True, drawn=(1.0, 4.0), physical=(True, False)),
    Coordinate("a", log=True),
    Coordinate("width", 1e-4, 30.0, log=True, drawn=(0.01, 3.0)),
    Coordinate("alpha"),
    Coordinate("stability", -6.0, 13.0, drawn=(0.0, 4.0)),
    Coordinate("k", 1e-3, 30.0, log=True, drawn=(0.01, 3.0)),
    Coordinate("c", 0.0, 0.99, drawn=(0.0, 0.8), physical=(True, True)),
    Coordinate("anisotropy", -30.0, 30.0, drawn=(-10.0, 10.0)),
    Coordinate("reversible_feedback", 0.0, 1.0, physical=(True, True)),
    Coordinate("z0", -1.0, 1.0, physical=(True, True)),
)
_HELD = ("anisotropy", "reversible_feedback")
_COLUMNS = ("gain", "feedthrough")
_SI = ("A/m", "T")
_LEAST = 1e-12  # of 1 - alpha Ms m0 / a
_TURN = 12.0  # twice the stability at which alpha Ms s / a is 1
_SMALLEST = 1e-3  # of the width: a for a coupling that is given, and nearly as large
_SCREENED = 1024
_COUPLING, _JUMPS = 2.0, 3.0  # alpha Ms / a by default, 2.2 and 2.3 in papers, and where a law without pinning jumps
_DATASHEET_BOX = np.array([[0.0, -5.0, -5.0, 0.0], [4.0, 7.0, 7.0, 0.99]])  # logarithms of Ms, a and k; c
_DATASHEET_STARTS = ((0.05, 0.0, 0.2, 0.2), (0.05, -1.2, 0.2, 0.7), (0.05, 1.1, 0.2, 0.7), (0.05, 2.3, 1.0, 0.2))
_MET, _MISSED, _NOTHING = 1e-4, 0.02, 1e-9  # relative errors of its numbers: no further start, a warning, the least
_MOST = 5.0  # of a magnetisation [T]: iron with cobalt has 2.5
_TOGETHER = "no Jiles-Atherton law with these numbers was found; check their units, A/m and T"
_STROKES = np.append(0.0, np.tile([1.0, -1.0], 20)[:-1])  # after them a loop is steady


def _check_isotropic(law: "JilesAtherton", whose: str) -> None:
    _check_feedback(law, whose)
    if law.anisotropy != 0.0:
        raise ValueError(f"{whose} is isotropic, got anisotropy = {law.anisotropy:g}")


def _check_feedback(law: "JilesAtherton", whose: str) -> None:
    if law.reversible_feedback != 1.0:
        raise ValueError(f"{whose} has He = H + alpha M, got reversible_feedback = {law.reversible_feedback:g}")
    if law.z0 != 0.0:
        raise ValueError(f"{whose} begins demagnetised, got z0 = {law.z0:g}")


@dataclass(frozen=True, kw_only=True)
class _Chart(Chart):
    field: float
    magnetisation: float

    @property
    def called(self) -> Mapping[str, str]:
        return {name: called for name, called in (("a", "width"), ("alpha", "stability")) if name not in self.limits}

    @property
    def units(self) -> Mapping[str, float]:
        own = dict.fromkeys(("c", "anisotropy", "reversible_feedback"), 1.0)
        return {"Ms": self.magnetisation, "k": self.field, **own}

    def measured(self, known: dict[str, FloatArray], raw: dict[str, FloatArray]) -> dict[str, FloatArray]:
        known |= {name: raw[name] * unit for name, unit in self.units.items() if name in raw}
        below, above = (
            (np.exp(-raw["stability"]), np.exp(raw["stability"] - _TURN)) if "stability" in raw else (1.0, 0.0)
        )
        if "width" in raw:
            width = raw["width"] * self.field
            share = initial_slope(known["anisotropy"]) * known["Ms"]
            coupled = width / (below + above) if "stability" in raw else width + known["alpha"] * share
            known["a"] = np.maximum(coupled, _SMALLEST * width)
        if "stability" in raw:
            known["alpha"] = (1.0 - below + above) * known["a"] / (known["Ms"] * steepest(known))
        if "z0" in raw:
            known["z0"] = raw["z0"] * known["Ms"]
        return known

    def located(self, known: dict[str, FloatArray]) -> dict[str, Any]:
        own = {name: known[name] / unit for name, unit in self.units.items()}
        coupling = known["alpha"] * known["Ms"]
        if "stability" in self.axes:
            beyond = coupling * steepest(known) / known["a"] - 1.0
            apart = np.hypot(beyond, 2.0 * np.exp(-0.5 * _TURN))
            own["stability"] = -np.log(0.5 * (apart - beyond))
        else:
            apart = max(1.0 - coupling * initial_slope(known["anisotropy"]) / known["a"], _LEAST)
        return {**own, "width": known["a"] * apart / self.field, "z0": known["z0"] / known["Ms"]}


def initial_slope(anisotropy: FloatArray) -> FloatArray:
    """Slope of the anhysteretic curve at x = 0, the mean square of a moment's cosine."""
    p = np.asarray(anisotropy)[..., np.newaxis]
    reach = np.where(p >= 0.0, _DEPTH / np.maximum(p, _DEPTH), np.sqrt(_DEPTH / np.maximum(-p, _DEPTH)))
    squares = np.where(p >= 0.0, 1.0 - reach * _PLACES, reach * _PLACES) ** 2
    weights = _SHARES * np.exp(p * (squares - (p >= 0.0)))
    return np.asarray((weights * squares).sum(axis=-1) / weights.sum(axis=-1))


def steepest(parameters: Mapping[str, FloatArray]) -> FloatArray:
    """Slope of M / Ms over x = He / a that no large loop exceeds, low by up to 6 % without anisotropy.

    M is c w m + (1 - c w) z, where m has its steepest slope m0 at 0. z is m averaged with the weight exp(-s / kappa)
    over the x before, and its steepest slope about m0 / sqrt(1 + q^2 b(q)) with q = 3 m0 kappa.
    """
    initial, kappa = initial_slope(parameters["anisotropy"]), parameters["k"] / parameters["a"]
    q = 3.0 * initial * kappa
    averaged = initial / np.sqrt(1.0 + q * q * (_FAR + (_NEAR - _FAR) / (1.0 + _BETWEEN * q)))
    share = parameters["c"] * parameters["reversible_feedback"]
    return np.asarray(share * initial + (1.0 - share) * averaged)


_NEAR, _FAR, _BETWEEN = 0.4, 0.034, 0.55  # b(q), fitted to Langevin's curve
_DEPTH = 40.0  # of the exponent: beyond, nothing is left
_NODES, _SHARES = np.polynomial.legendre.leggauss(64)
_PLACES = 0.5 * (1.0 + _NODES)


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
    IEEE Trans. Magn. 32 (1996), for the anisotropy. Between two samples H moves monotonically. The law is evaluated in
    He, in which it is linear, by quadratures whose remainder is bounded by a rounding: good to 1e-13 of the range,
    whatever the samples. The bulk form ``dM/dHe = c M_an' + (M_an - M) / (delta k)`` is the same law; see
    `from_jamodel`, `from_total` and `from_circuit` for others. Where alpha is so large that H would fall while He
    rises, the magnetisation jumps: `response` raises SimulationError there. A law with ``alpha Ms < 3 a`` (and no
    anisotropy) does not jump from a state that an input has led to. `identify` holds the feedthrough mu0 in records
    whose units are A/m and T, and frees it in others.

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
        Pinning, near the coercive field of a soft material, positive [A/m]; mu0 k in papers that give it in tesla.
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
        ``reversible_feedback alpha c dM_an/dHe`` is 1 at He = 0: the reversible magnetisation is not unique.

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
    positive = ("Ms", "a", "k")
    not_negative = ("c", "reversible_feedback")
    within: ClassVar = dict.fromkeys(not_negative, ("at most", 1.0))
    example = Example(
        {"Ms": 1.0, "a": 0.3, "alpha": 0.1, "k": 0.4, "gain": 1.0, "feedthrough": 0.0},
        (-2.0, 2.0),
        title="Magnetic core: Jiles-Atherton",
    )
    searched = (*affine("gain", "feedthrough", unit="y/u"), *affine("offset", unit="y"))
    powers: ClassVar = {"gain": None, "feedthrough": 1, "offset": 0}
    step = staticmethod(kernels.step)
    resume = staticmethod(kernels.resume)
    exact_strokes: ClassVar[bool] = True

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse constants of no material, and a reversible magnetisation that is not unique."""
        super().check(tables)
        coupling = tables["alpha"] * tables["Ms"] / tables["a"]
        feedback = tables["reversible_feedback"] * tables["c"] * coupling * initial_slope(tables["anisotropy"])
        if not (feedback < 1.0).all():
            raise ValueError(
                "the reversible magnetisation is not unique: reversible_feedback alpha c dM_an/dHe must be below 1 at "
                f"He = 0, got {feedback.max():g}; take a smaller alpha or c, or a larger a"
            )

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.jiles_atherton.step` takes them; memory (u, M_irr, He / a, rest)."""
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
        if not c < 1.0:
            raise ValueError(f"c must be below 1, got {c:g}")
        return cls(Ms=Ms, a=a, alpha=alpha, k=k / (1.0 - c), c=c)

    def to_total(self) -> dict[str, float]:
        """The arguments of `from_total`; ValueError if the law is anisotropic, has another He, or begins magnetised."""
        _check_isotropic(self, "this spelling")
        return {"Ms": self.Ms, "a": self.a, "alpha": self.alpha, "k": self.k * (1.0 - self.c), "c": self.c}

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
        check_not_negative(C=C)
        return cls(Ms=MS, a=A, alpha=0.0, k=(1.0 + C) * K, c=C / (1.0 + C))

    def to_circuit(self) -> dict[str, float]:
        """The arguments of `from_circuit`; ValueError also if the law has a coupling, or c = 1."""
        _check_isotropic(self, "the circuit simulators' law")
        if self.alpha != 0.0:
            raise ValueError(f"the circuit simulators' law has no coupling, got alpha = {self.alpha:g}")
        if self.c == 1.0:
            raise ValueError("the circuit simulators' law needs c below 1")
        return {"MS": self.Ms, "A": self.a, "K": self.k * (1.0 - self.c), "C": self.c / (1.0 - self.c)}

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
        if not Ms * a > 0.0:
            raise ValueError(f"Ms and a must be positive, got {Ms:g} and {a:g}")
        anisotropy = Kan * math.cos(2.0 * psi) / (MU0 * Ms * a)
        return cls(Ms=Ms, a=a, alpha=alpha, k=k, c=c, anisotropy=anisotropy)

    def to_jamodel(self) -> dict[str, float]:
        """The arguments of `from_jamodel`, with psi = 0 or pi / 2."""
        _check_feedback(self, "JAmodel")
        Kan = self.anisotropy * MU0 * self.Ms * self.a
        axis = {"Kan": abs(Kan), "psi": 0.0 if Kan >= 0.0 else 0.5 * math.pi}
        return {"a": self.a, "k": self.k, "c": self.c, "Ms": self.Ms, "alpha": self.alpha, **axis}

    @classmethod
    def from_datasheet(
        cls, *, Hc: float, Br: float, Bs: float, Hs: float, mu_i: float, coupling: float = _COUPLING
    ) -> Self:
        """The law whose steady loop has the numbers of a data sheet, by least squares from several starts.

        Four numbers leave one of the five constants open, for which `coupling` stands. One loop says little of smaller
        ones; see `hysim.identify`.

        Parameters
        ----------
        Hc, Br : float
            Coercive field [A/m] and remanence [T] of the loop between -Hs and Hs.
        Bs, Hs : float
            Flux density [T] at the tip of this loop, where the field is Hs [A/m].
        mu_i : float
            Initial permeability of the demagnetised core, over mu0.
        coupling : float
            ``alpha Ms / a``, below 3: 2.3 for the steel of 1986, negative for a core with a gap.

        Returns
        -------
        JilesAtherton
            A `hysim.HysimWarning` names the numbers that it has in their place, if one is missed by more than 2 %.

        Raises
        ------
        ValueError, TypeError
            If they are not finite numbers with Hc below Hs, Br below Bs - mu0 Hs, which no core has above 5 T, mu_i
            above 1 and the coupling below 3.

        Examples
        --------
        >>> import hysim as hs
        >>> core = hs.JilesAtherton.from_datasheet(Hc=15.0, Br=0.17, Bs=0.47, Hs=1200.0, mu_i=2300.0)
        >>> {name: round(value, 3) for name, value in core.to_datasheet(Hs=1200.0).items()}
        {'Hc': 15.0, 'Br': 0.17, 'Bs': 0.47, 'Hs': 1200.0, 'mu_i': 2300.0, 'coupling': 2.0}
        """
        from scipy.optimize import least_squares

        asked = {"Hc": Hc, "Br": Br, "Bs": Bs, "Hs": Hs, "mu_i": mu_i, "coupling": coupling}
        numbers = read_only([*asked.values()], ", ".join(asked), ndim=1)
        Hc, Br, Bs, Hs, mu_i, coupling = numbers.tolist()
        if not (0.0 < Hc < Hs and 0.0 < Br < Bs - MU0 * Hs < _MOST and mu_i > 1.0 and coupling < _JUMPS):
            raise ValueError(
                f"a core has 0 < Hc < Hs [A/m], 0 < Br < Bs - mu0 Hs < {_MOST:g} [T], mu_i > 1 and coupling < "
                f"{_JUMPS:g}, got {', '.join(f'{name} = {value}' for name, value in asked.items())}"
            )

        def constants(x: FloatArray) -> dict[str, float]:
            Ms, a, k = (np.exp(x[:3]) * [Bs / MU0 - Hs, Hc, Hc]).tolist()
            return {"Ms": Ms, "a": a, "alpha": coupling * a / Ms, "k": k, "c": float(x[3])}

        def missed(x: FloatArray) -> FloatArray:
            own = [*cls(**constants(x)).to_datasheet(Hs=Hs).values()]
            return np.log(np.maximum(np.array(own[:-1]) / numbers[:-1], _NOTHING))

        fits = (least_squares(missed, start, bounds=_DATASHEET_BOX, max_nfev=100) for start in _DATASHEET_STARTS)
        best = next(fits)
        while np.abs(best.fun).max() > _MET and (other := next(fits, None)) is not None:
            best = min(best, other, key=lambda fit: float(fit.cost))
        core = cls(**constants(best.x))
        if np.abs(best.fun).max() > _MISSED:
            own = core.to_datasheet(Hs=Hs)
            errors = ", ".join(
                f"{name} is {own[name]:.4g}, not {asked[name]:.4g}" for name in ("Hc", "Br", "Bs", "mu_i")
            )
            warnings.warn(f"{errors}: {_TOGETHER}", HysimWarning, stacklevel=2)
        return core

    def to_datasheet(self, *, Hs: float) -> dict[str, float]:
        """The arguments of `from_datasheet`: numbers of the steady loop between -Hs and Hs [A/m], in A/m and T.

        Gain, feedthrough, offset and z0 of the law do not count. ValueError if Hs is not positive and finite.
        """
        check_positive(Hs=float(read_only(Hs, "Hs", ndim=0)))
        core = self.placed(None).with_scalars({"gain": MU0, "feedthrough": MU0, "offset": 0.0, "z0": 0.0})
        B, tip = core.advance(Hs * _STROKES)
        chi = self.c * self.Ms / self.a * float(initial_slope(np.array(self.anisotropy)))
        return {
            "Hc": -float(core.inverse_response([0.0], state=tip)[0]),
            "Br": float(core.advance([0.0], tip)[0][0]),
            "Bs": float(B[-1]),
            "Hs": float(Hs),
            "mu_i": 1.0 + chi / (1.0 - self.reversible_feedback * self.alpha * chi),
            "coupling": self.alpha * self.Ms / self.a,
        }

    def magnetisation(self, u: npt.ArrayLike) -> FloatArray:
        """Magnetisation M at the samples of the field `u`, shape (n_samples,) [A/m]; errors as of `response`."""
        return self.with_scalars(self.memory_only).response(u)

    def divergence(self, sample: int, u: float, y: float) -> str:
        """Message with the coupling."""
        return (
            f"the magnetisation jumps at sample {sample} (on the way to u = {u:g}): the effective field H + alpha M "
            f"rises while H falls there; alpha Ms / a = {self.alpha * self.Ms / self.a:g} is too large for this input"
        )

    def is_invertible(self) -> bool:
        """Whether gain and feedthrough have one sign, and are not both zero: y rises, or falls, along every branch."""
        return self.gain * self.feedthrough >= 0.0 and self.gain + self.feedthrough != 0.0

    @property
    def output_bounds(self) -> tuple[float, float]:
        """The saturation on both sides of the offset; no limit with a feedthrough."""
        size = abs(self.gain) * self.Ms if self.feedthrough == 0.0 else math.inf
        return self.offset - size, self.offset + size

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
        """The box in the scales of the record's field and magnetisation, in whose middle the law by default begins.

        Held by default are gain and feedthrough, of which the first could not be told from Ms, and what makes the law
        another one: an anisotropy that is zero at the start, and reversible_feedback. The feedthrough of a law by
        default, mu0, is that of a record in A/m and T; it is free in a record whose units are others or not known.
        """
        scalars, unit = self.scalars, spans(record)
        has_other_units = (record.units.get("u"), record.units.get("y")) != _SI
        known = _COLUMNS[:1] if self.feedthrough == self.gain == MU0 and has_other_units else _COLUMNS
        further = [name for name in _HELD if not (name == "anisotropy" and self.anisotropy)]
        alone = tuple((name,) for name in (*known, *further) if name not in freedom.bounds)
        at_rest = ("z0",) if freedom.starts_at_rest() else ()
        held = freedom.held(scalars, redundant=alone, at_rest=at_rest)
        bounds = freedom.limits(scalars, held)
        if "feedthrough" not in held and "gain" in held and held["gain"] > 0.0:  # no core falls at saturation
            bounds = {"feedthrough": (0.0, np.inf), **bounds}
        size = 0.5 * unit["y"] / (abs(held.get("gain", self.gain)) or 1.0)
        rows = _ROWS
        if "feedthrough" not in held:  # which may be most of the output
            rows = rows | {"Ms": rows["Ms"]._replace(physical=(False, False))}
        chart = _Chart(rows=rows, defaults=scalars, held=held, bounds=bounds, field=unit["h"], magnetisation=size)
        for name in bounds.keys() & rows.keys():
            rows[name].limited(bounds)  # which raises
        space = space_of_chart(chart, self.columns, freedom, screened=_SCREENED)
        if space.drawn is None or not freedom.starts_anew or self.arguments != self.defaults():
            return space
        return replace(space, starts=0.5 * np.sum(space.drawn, axis=0, keepdims=True))
