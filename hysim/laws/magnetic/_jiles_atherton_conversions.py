"""Constants of the Jiles-Atherton law in other people's spellings, to ours and back.

Ours is  He = H + alpha M,  M = c M_an(He) + (1 - c) M_irr,  dM_irr/dHe = (M_an - M_irr)+ / (delta k). The same law is

    bulk            dM/dHe = c M_an' + (M_an - M)+ / (delta k), with the whole magnetisation: since
                    M_an - M = (1 - c) (M_an - M_irr), the constants are the same
    Bergqvist       dM_irr/dHe = (M_an - M)+ / (delta k (1 - c)): the same constants
    of M            dM_irr/dHe = (M_an - M)+ / (delta k'), which is k = k' / (1 - c)
    circuits        dM/dH = (M_an - M)+ / ((1 + C) delta K) + C / (1 + C) dM_an/dH without alpha: k = (1 + C) K,
                    c = C / (1 + C)
    JAmodel         the bulk form with (a, k, c, Ms, alpha, Kan, psi): anisotropy = Kan cos(2 psi) / (mu0 Ms a)
    pinning in J    k / mu0 in the papers that measure k in joule per ampere and square metre, that is, in tesla

Sources: D. C. Jiles and D. L. Atherton, J. Magn. Magn. Mater. 61 (1986); D. C. Jiles, J. B. Thoelke and M. K. Devine,
IEEE Trans. Magn. 28 (1992); A. J. Bergqvist, IEEE Trans. Magn. 32 (1996); R. Venkataraman and P. S. Krishnaprasad, IEEE
Conf. Decision and Control 2000, for the bulk form; R. Szewczyk, JAmodel (github.com/romanszewczyk/JAmodel), ModelType
2. The form of the circuit simulators is the one that is quoted for PSpice (core, level 2) and Micro-Cap; we have not
seen their manuals.
"""

import math
from typing import Any

MU0 = 4e-7 * math.pi
"""Magnetic constant [T m / A], to its nine digits."""

Scalars = dict[str, float]


def from_total(Ms: float, a: float, alpha: float, k: float, c: float) -> Scalars:
    """Numbers from those of a law whose irreversible rate is (M_an - M) / k."""
    if not c < 1.0:
        raise ValueError(f"c must be below 1, got {c:g}")
    return {"Ms": Ms, "a": a, "alpha": alpha, "k": k / (1.0 - c), "c": c}


def to_total(law: Any) -> Scalars:
    """The way back."""
    _isotropic(law, "this spelling")
    return {"Ms": law.Ms, "a": law.a, "alpha": law.alpha, "k": law.k * (1.0 - law.c), "c": law.c}


def from_circuit(MS: float, A: float, K: float, C: float) -> Scalars:
    """Numbers from those of the circuit simulators' law without alpha."""
    if not C >= 0.0:
        raise ValueError(f"C must not be negative, got {C:g}")
    return {"Ms": MS, "a": A, "alpha": 0.0, "k": (1.0 + C) * K, "c": C / (1.0 + C)}


def to_circuit(law: Any) -> Scalars:
    """The way back."""
    _isotropic(law, "the circuit simulators' law")
    if law.alpha != 0.0:
        raise ValueError(f"the circuit simulators' law has no coupling, got alpha = {law.alpha:g}")
    if law.c == 1.0:
        raise ValueError("the circuit simulators' law needs c below 1")
    return {"MS": law.Ms, "A": law.a, "K": law.k * (1.0 - law.c), "C": law.c / (1.0 - law.c)}


def from_jamodel(a: float, k: float, c: float, Ms: float, alpha: float, Kan: float, psi: float) -> Scalars:
    """Numbers from those of JAmodel's bulk model (ModelType 2)."""
    if not Ms * a > 0.0:
        raise ValueError(f"Ms and a must be positive, got {Ms:g} and {a:g}")
    anisotropy = Kan * math.cos(2.0 * psi) / (MU0 * Ms * a)
    return {"Ms": Ms, "a": a, "alpha": alpha, "k": k, "c": c, "anisotropy": anisotropy}


def to_jamodel(law: Any) -> Scalars:
    """The member with the easy axis along the field, or across it."""
    _whole_feedback(law, "JAmodel")
    Kan = law.anisotropy * MU0 * law.Ms * law.a
    axis = {"Kan": abs(Kan), "psi": 0.0 if Kan >= 0.0 else 0.5 * math.pi}
    return {"a": law.a, "k": law.k, "c": law.c, "Ms": law.Ms, "alpha": law.alpha, **axis}


def _isotropic(law: Any, whose: str) -> None:
    _whole_feedback(law, whose)
    if law.anisotropy != 0.0:
        raise ValueError(f"{whose} is isotropic, got anisotropy = {law.anisotropy:g}")


def _whole_feedback(law: Any, whose: str) -> None:
    if law.reversible_feedback != 1.0:
        raise ValueError(f"{whose} has He = H + alpha M, got reversible_feedback = {law.reversible_feedback:g}")
    if law.z0 != 0.0:
        raise ValueError(f"{whose} begins demagnetised, got z0 = {law.z0:g}")
