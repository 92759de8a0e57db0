"""Other people's Bouc-Wen parameters, to ours and back.

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

Measuring the memory in another unit, z = unit w, leaves the output as it is; a negative unit turns A and
gamma round:

    A -> A / unit    beta -> beta |unit|^(n-1)    gamma -> sign(unit) gamma |unit|^(n-1)    gain -> unit gain

The way out chooses the unit, and with it one member of all the parameter sets with the same response.

Sources: Y. K. Wen, J. Eng. Mech. Div. 102 (1976); T. S. Low and W. Guo, J. Microelectromech. Syst. 4 (1995);
F. Ikhouane and J. Rodellar, Systems with Hysteresis (2007), for the normalised form; J. P. Noel and
M. Schoukens, Hysteretic benchmark with a dynamic nonlinearity (2016); the OpenSees command manual,
uniaxialMaterial BoucWen (Haukaas and Der Kiureghian 2003); OpenSees, uniaxialMaterial BoucWenOriginal and BWBN;
suanPan, material BoucWen.

The two materials of OpenSees that change with the energy count it as e' = (1 - alpha) ko u' z, ours is e' = u' z, so
that rates go over by the factor (1 - alpha) ko.
"""

import math
from typing import Any

Scalars = dict[str, float]


def from_low_guo(alpha: float, beta: float, gamma: float, d: float, h0: float) -> Scalars:
    """Numbers of a `BoucWen` from those of Low and Guo."""
    return {"A": alpha * d, "beta": beta, "gamma": gamma, "n": 1.0, "feedthrough": d, "gain": -1.0, "z0": h0}


def to_low_guo(law: Any) -> Scalars:
    """The only member: h is the memory in the unit of the output."""
    _no_offset(law, "Low and Guo's law")
    if law.n != 1.0:
        raise ValueError(f"Low and Guo's law has n = 1, got n = {law.n:g}")
    if law.feedthrough == 0.0 or law.gain == 0.0:
        raise ValueError(
            f"Low and Guo's law needs a feedthrough and a gain, got feedthrough = {law.feedthrough:g}, "
            f"gain = {law.gain:g}"
        )
    unit = _in_unit(law, -1.0 / law.gain)
    d = law.feedthrough
    return {"alpha": unit["A"] / d, "beta": unit["beta"], "gamma": unit["gamma"], "d": d, "h0": unit["z0"]}


def from_wen(alpha: float, k: float, A: float, beta: float, gamma: float, n: float, D: float, z0: float) -> Scalars:
    """Numbers of a `BoucWen` from those of Wen."""
    if D == 0.0:
        raise ValueError("D must not be zero")
    shape = {"A": A / D, "beta": beta / D, "gamma": gamma / D, "n": n}
    return {**shape, "feedthrough": alpha * k, "gain": (1.0 - alpha) * k * D, "z0": z0}


def to_wen(law: Any) -> Scalars:
    """The member with A = D = 1, for which k is the stiffness at z = 0."""
    return {**_with_unit_slope(law, "Wen's law"), "A": 1.0, "D": 1.0}


def from_normalized(k_x: float, k_w: float, rho: float, sigma: float, n: float, w0: float) -> Scalars:
    """Numbers of a `BoucWen` from the normalised ones."""
    shape = {"A": rho, "beta": rho * sigma, "gamma": rho * (1.0 - sigma), "n": n}
    return {**shape, "feedthrough": k_x, "gain": k_w, "z0": w0}


def to_normalized(law: Any) -> Scalars:
    """The only member: w is the memory in units of its saturation."""
    _no_offset(law, "the normalised law")
    loading = law.beta + law.gamma
    if loading <= 0.0 or law.A <= 0.0:
        raise ValueError(
            f"the normalised law needs beta + gamma > 0 and A > 0, got beta + gamma = {loading:g}, A = {law.A:g}"
        )
    unit = (law.A / loading) ** (1.0 / law.n)
    return {
        "k_x": law.feedthrough,
        "k_w": law.gain * unit,
        "rho": law.A / unit,
        "sigma": law.beta / loading,
        "n": law.n,
        "w0": law.z0 / unit,
    }


def from_noel_schoukens(alpha: float, beta: float, gamma: float, delta: float, nu: float, z0: float) -> Scalars:
    """Numbers of a `BoucWen` from those of the benchmark."""
    return {"A": alpha, "beta": beta * gamma, "gamma": beta * delta, "n": nu, "z0": z0}


def to_noel_schoukens(law: Any) -> Scalars:
    """The member with beta = 1."""
    _no_offset(law, "the benchmark's law")
    if law.feedthrough != 0.0:
        raise ValueError(
            f"the benchmark's law has no feedthrough, got {law.feedthrough:g}: it belongs to the oscillator's stiffness"
        )
    if law.gain == 0.0:
        raise ValueError("the benchmark's output is the memory itself: it needs a gain that is not zero")
    unit = _in_unit(law, 1.0 / law.gain)
    return {
        "alpha": unit["A"],
        "beta": 1.0,
        "gamma": unit["beta"],
        "delta": unit["gamma"],
        "nu": law.n,
        "z0": unit["z0"],
    }


def from_opensees(
    alpha: float, ko: float, n: float, gamma: float, beta: float, Ao: float, degradation: Scalars
) -> Scalars:
    """Numbers of a `BoucWen` from those of the material without degradation."""
    for name, rate in degradation.items():
        if rate != 0.0:
            raise ValueError(f"{name} must be zero, got {rate:g}: the law does not degrade")
    return from_wen(alpha, ko, Ao, beta, gamma, n, 1.0, 0.0)


def to_opensees(law: Any) -> Scalars:
    """The member with Ao = 1, for which ko is the stiffness at z = 0."""
    if law.z0 != 0.0:
        raise ValueError(f"the material begins with z = 0, got z0 = {law.z0:g}")
    same = _with_unit_slope(law, "the material")
    return {name: same[name] for name in ("alpha", "n", "gamma", "beta")} | {"ko": same["k"], "Ao": 1.0}


def from_opensees_original(
    E: float, fy: float, alphaL: float, alphaNL: float, eta: float, beta: float, gamma: float
) -> Scalars:
    """Numbers of a `BoucWen` from those of the material with a linear spring."""
    if alphaNL != 0.0:
        raise ValueError(f"alphaNL must be zero, got {alphaNL:g}: the law has a linear spring only")
    if E <= 0.0 or fy <= 0.0:
        raise ValueError(f"E and fy must be positive, got {E:g} and {fy:g}")
    shape = {"A": E / fy, "beta": beta * (E / fy), "gamma": gamma * (E / fy), "n": eta}
    return {**shape, "feedthrough": alphaL * E, "gain": (1.0 - alphaL) * fy}


def to_opensees_original(law: Any) -> Scalars:
    """The member with beta + gamma = 1, for which fy is where the material yields."""
    if law.z0 != 0.0:
        raise ValueError(f"the material begins with z = 0, got z0 = {law.z0:g}")
    same = _with_unit_slope(law, "the material")
    loading = same["beta"] + same["gamma"]
    if loading <= 0.0:
        raise ValueError(f"the material yields: it needs beta + gamma > 0 where A = 1, got {loading:g}")
    shape = {"beta": same["beta"] / loading, "gamma": same["gamma"] / loading, "eta": same["n"]}
    return {"E": same["k"], "fy": same["k"] * loading ** (-1.0 / same["n"]), "alphaL": same["alpha"], **shape}


def to_suanpan(law: Any) -> Scalars:
    """Conversion of the member of this name, whose gamma is not written."""
    same = to_opensees_original(law)
    names = {"elastic_modulus": "E", "yield_stress": "fy", "hardening": "alphaL", "beta": "beta", "n": "eta"}
    return {name: same[theirs] for name, theirs in names.items()}


def from_opensees_energy(
    alpha: float, ko: float, n: float, gamma: float, beta: float, Ao: float, rates: Scalars
) -> dict[str, Any]:
    """Numbers of a `BoucWenBaberNoori` from those that the materials with an energy share; `rates` are per energy."""
    stiffness = (1.0 - alpha) * ko
    worn = {name: rate * stiffness for name, rate in rates.items()}
    shape = {"A": Ao, "beta": beta, "gamma": gamma, "n": n}
    return {**shape, **worn, "gain": stiffness, "input_coefficients": (alpha * ko,)}


def to_opensees_degrading(law: Any) -> Scalars:
    """The member with Ao = A."""
    if law.zeta_s != 0.0:
        raise ValueError(f"the material does not pinch, got zeta_s = {law.zeta_s:g}: see to_opensees_bwbn")
    return {
        **_of_opensees_energy(law),
        "deltaA": law.delta_a / law.gain,
        "deltaNu": law.delta_nu / law.gain,
        "deltaEta": law.delta_eta / law.gain,
    }


def to_opensees_pinching(law: Any) -> Scalars:
    """The member with Ao = A."""
    for name, rate in {"delta_a": law.delta_a, "delta_nu": law.delta_nu, "delta_eta": law.delta_eta}.items():
        if rate != 0.0:
            raise ValueError(f"the material does not degrade, got {name} = {rate:g}: see to_opensees")
    return {
        **_of_opensees_energy(law),
        "q": law.q,
        "zetas": law.zeta_s,
        "p": law.p / law.gain,
        "Shi": law.psi,
        "deltaShi": law.delta_psi / law.gain,
        "lamda": law.lambda_,
    }


def _of_opensees_energy(law: Any) -> Scalars:
    """Parameters that both materials with an energy have."""
    _no_offset(law, "the material")
    if law.z0 != 0.0:
        raise ValueError(f"the material begins with z = 0, got z0 = {law.z0:g}")
    if any(law.input_coefficients[1:]):
        raise ValueError(f"the material has a linear spring only, got input_coefficients = {law.input_coefficients}")
    ko = law.input_coefficients[0] + law.gain
    if ko == 0.0 or law.gain == 0.0:
        raise ValueError(f"the material needs a stiffness and a gain, got {ko:g} and {law.gain:g}")
    shape = {"n": law.n, "gamma": law.gamma, "beta": law.beta, "Ao": law.A}
    return {"alpha": law.input_coefficients[0] / ko, "ko": ko, **shape}


def _with_unit_slope(law: Any, whose: str) -> Scalars:
    """The form that Wen and OpenSees share, with A = 1."""
    _no_offset(law, whose)
    if law.A == 0.0:
        raise ValueError(f"{whose} needs a slope at z = 0 to measure the stiffness by, got A = 0")
    unit = _in_unit(law, law.A)
    k = law.feedthrough + unit["gain"]
    if k == 0.0:
        raise ValueError(
            f"{whose} needs a stiffness at z = 0, but feedthrough + gain A = 0 (feedthrough = {law.feedthrough:g})"
        )
    return {"alpha": law.feedthrough / k, "k": k} | {name: unit[name] for name in ("beta", "gamma", "n", "z0")}


def _in_unit(law: Any, unit: float) -> Scalars:
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


def _no_offset(law: Any, whose: str) -> None:
    if law.offset != 0.0:
        raise ValueError(f"{whose} has no offset, got {law.offset:g}: take it off the output")
