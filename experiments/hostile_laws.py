"""Random laws of every family, with states and strides on which a step may go wrong, from a NumPy generator.

A law is drawn in a scale of its own: S is the memory at which it balances (the threshold of a play), L the input on
which it gets there. Exponents go from 0.3 to 12, states from nothing to far beyond S, strides from 1e-12 L to 100 L,
coefficients have both signs, vanish, or differ by six orders of magnitude.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import hysim as hs

Rng = np.random.Generator
TINY = (0.0, 1e-300, 1e-12, 1e-6)
NEAR = (1e-15, 1e-9, 1e-3)
RATES = ("delta_nu", "delta_eta")


class Drawn(NamedTuple):
    """A law, and the input on which its memory moves by its own scale."""

    law: Any
    length: float


def decades(rng: Rng, low: float, high: float) -> float:
    """A number between 10^low and 10^high, even on a logarithmic scale."""
    return float(10.0 ** rng.uniform(low, high))


def signed(rng: Rng, size: float) -> float:
    """`size` with either sign."""
    return size if rng.random() < 0.5 else -size


def exponent(rng: Rng) -> float:
    """n from 0.3 to 12, often 1 or 2, now and then close to them."""
    kind = rng.random()
    if kind < 0.3:
        return 1.0 if kind < 0.18 else 2.0
    if kind < 0.4:
        return float(rng.choice([1.0, 2.0]) + signed(rng, rng.choice(NEAR)))
    return decades(rng, np.log10(0.3), np.log10(12.0))


def memory(rng: Rng, balance: float) -> float:
    """A state from nothing to a hundred times the balance."""
    kind = rng.integers(6)
    if kind == 0:
        size = float(rng.choice(TINY))
    elif kind == 1:
        size = 1.0 + signed(rng, rng.choice(NEAR))
    elif kind == 2:
        size = decades(rng, 0.0, 2.0)
    elif kind == 3:
        size = 1.0
    else:
        size = float(rng.random())
    return signed(rng, size * balance)


def shape(rng: Rng) -> tuple[dict[str, float], float, float]:
    """A, beta, gamma, n and z0 of a Bouc-Wen law, its balance S, and its length L."""
    n, balance, length = exponent(rng), decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
    slope = balance / length
    own = slope * balance**-n
    loading = own * float(rng.choice([1.0, 1.0, 1.0, -1.0, 0.0], p=[0.25, 0.25, 0.2, 0.25, 0.05]))
    ratio = float(rng.choice([0.0, rng.uniform(-1.0, 1.0), signed(rng, decades(rng, -6.0, 6.0))], p=[0.1, 0.6, 0.3]))
    unloading = own * ratio
    A = 0.0 if rng.random() < 0.05 else signed(rng, slope) if rng.random() < 0.3 else slope
    parameters = {"A": A, "beta": 0.5 * (loading + unloading), "gamma": 0.5 * (loading - unloading), "n": n}
    return {**parameters, "z0": memory(rng, balance)}, balance, length


def output(rng: Rng, balance: float, length: float, degree: int) -> dict[str, Any]:
    """Gain, offset, and the coefficients of the input, none of them in half of all laws."""
    gain = signed(rng, decades(rng, -2.0, 2.0))
    if rng.random() < 0.5:
        return {"gain": gain, "offset": 0.0, "input_coefficients": (0.0,) * degree}
    size = abs(gain) * balance
    powers = tuple(size * float(rng.normal()) / length**k for k in range(1, degree + 1))
    return {"gain": gain, "offset": size * float(rng.normal()), "input_coefficients": powers}


def bouc_wen(rng: Rng) -> Drawn:
    """The symmetric law."""
    parameters, balance, length = shape(rng)
    rest = output(rng, balance, length, 1)
    (feedthrough,) = rest.pop("input_coefficients")
    return Drawn(hs.BoucWen(**parameters, **rest, feedthrough=feedthrough), length)


def polynomial(rng: Rng) -> Drawn:
    """The law with a polynomial of the input."""
    parameters, balance, length = shape(rng)
    return Drawn(hs.PolynomialBoucWen(**parameters, **output(rng, balance, length, 3)), length)


def generalized(rng: Rng) -> Drawn:
    """The law with a shape for each sector."""
    parameters, balance, length = shape(rng)
    size = abs(parameters["beta"]) + abs(parameters["gamma"])
    shapes = {f"b{k}": size * float(rng.choice([0.0, rng.normal(), 0.1 * rng.normal()])) for k in range(2, 7)}
    return Drawn(hs.GeneralizedBoucWen(**parameters, **shapes, **output(rng, balance, length, 1)), length)


def zhu_wang(rng: Rng) -> Drawn:
    """The law whose forcing moves with the input."""
    parameters, balance, length = shape(rng)
    delta = signed(rng, balance / length**2 * decades(rng, -6.0, 2.0)) if rng.random() < 0.9 else 0.0
    return Drawn(hs.ZhuWangBoucWen(**parameters, **output(rng, balance, length, 1), delta=delta), length)


def baber_noori(rng: Rng) -> Drawn:
    """The law that wears off, and pinches in half of all laws that may."""
    parameters, balance, length = shape(rng)
    energy = balance * length
    signs = rng.choice([1.0, 1.0, 1.0, 0.0, -0.1], 2)
    rates = {name: decades(rng, -6.0, 0.5) / energy * sign for name, sign in zip(RATES, signs, strict=True)}
    rates["delta_a"] = float(rng.choice([0.0, parameters["A"] * decades(rng, -6.0, 0.0) / energy]))
    pinching: dict[str, float] = {}
    if parameters["beta"] + parameters["gamma"] > 0.0 and rng.random() < 0.5:
        pinching = {
            "zeta_s": float(rng.uniform(0.0, 0.98)), "q": float(rng.choice([0.0, rng.uniform(-0.5, 1.0)])),
            "p": decades(rng, -3.0, 1.0) / energy, "psi": balance * decades(rng, -1.5, 1.0),
            "lambda_": decades(rng, -1.0, 0.5), "delta_psi": float(rng.choice([0.0, decades(rng, -4.0, 0.0) / length])),
        }  # fmt: skip
    law = hs.BoucWenBaberNoori(**parameters, **rates, **pinching, **output(rng, balance, length, 1))
    return Drawn(law, length)


def duhem(rng: Rng) -> Drawn:
    """Bouc-Wen's laws of n = 1, 2, 3 as polynomials, and polynomials of the first and the second degree."""
    balance, length = decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
    slope = balance / length
    plain = signed(rng, decades(rng, 0.0, 2.0)) * slope if rng.random() < 0.5 else 0.0
    others = {"feedthrough": plain, "offset": float(rng.choice([0.0, rng.normal() * balance]))}
    if rng.random() < 0.4:
        n = int(rng.integers(1, 4))
        rectified, bent = {1: ("|u'| z", "u' |z|"), 2: ("|u'| |z| z", "u' z^2"), 3: ("|u'| z^3", "u' |z| z^2")}[n]
        sizes = -slope * balance**-n * rng.normal(size=2) * (1.0 if rng.random() < 0.8 else decades(rng, -3.0, 3.0))
        law = hs.Duhem.from_terms({"u'": slope, rectified: sizes[0], bent: sizes[1]}, **others)
    else:
        arrays = {}
        for name in ("p", "q", "p_abs", "q_abs")[: 2 if rng.random() < 0.5 else 4]:
            rows, columns = rng.integers(1, 4, 2)
            i, j = np.ogrid[:rows, :columns]
            scale = slope * length**-i * balance ** (-j - name.endswith("abs"))
            arrays[name] = scale * rng.normal(size=(rows, columns)) * (rng.random((rows, columns)) < 0.6)
        if rng.random() < 0.7:
            arrays["q"] = np.array([[0.0, -abs(rng.normal()) / length]])
        law = hs.Duhem(**arrays, **others)
    return Drawn(replace(law, y0=law.offset + memory(rng, balance) * float(rng.choice([1.0, 0.01]))), length)


def dahl(rng: Rng) -> Drawn:
    """Dahl's friction."""
    coulomb, length = decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
    offset = float(rng.choice([0.0, rng.normal() * coulomb]))
    return Drawn(hs.Dahl(stiffness=coulomb / length, coulomb=coulomb, offset=offset, z0=memory(rng, coulomb)), length)


def coleman_hodgdon(rng: Rng) -> Drawn:
    """The backlash-like law."""
    balance, length = decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
    c, above = signed(rng, decades(rng, -2.0, 4.0)) * balance / length, signed(rng, balance / length)
    offset = float(rng.choice([0.0, rng.normal() * balance]))
    law = hs.ColemanHodgdon(alpha=1.0 / length, c=c, B=c + above, offset=offset, z0=memory(rng, balance))
    return Drawn(law, length)


# ---------------------------------------------------------------------------------- plays and relays


def thresholds(rng: Rng, zero: bool = False) -> tuple[tuple[float, ...], float]:
    """Four thresholds that increase, with or without zero in front, and the length L."""
    length = decades(rng, -3.0, 3.0)
    r = np.sort(rng.uniform(0.0, length, 4)) + length * np.array([1.0, 2.0, 3.0, 4.0]) * 1e-9
    if zero or rng.random() < 0.5:
        r[0] = 0.0
    return tuple(r.tolist()), length


def positions(rng: Rng, length: float, count: int) -> tuple[float, ...]:
    """Positions anywhere, or all at zero."""
    return tuple((length * rng.normal(size=count) * (rng.random() < 0.7)).tolist())


def element(kind: type) -> Callable[[Rng], Drawn]:
    """A play or a stop."""

    def draw(rng: Rng) -> Drawn:
        length = decades(rng, -3.0, 3.0)
        threshold = length * float(rng.choice([0.0, 1e-12, 1.0]))
        (z0,) = positions(rng, length, 1)
        law = kind(threshold=threshold, gain=float(rng.normal()), offset=float(rng.normal()), z0=z0)
        return Drawn(law, length)

    return draw


def weights(rng: Rng, one_signed: bool) -> tuple[float, ...]:
    """Four weights."""
    w = rng.normal(size=4) * 10.0 ** rng.uniform(-3.0, 3.0)
    return tuple((np.abs(w) if one_signed else w).tolist())


def plays(rng: Rng, invertible: bool = False) -> Drawn:
    """A sum of plays; with `invertible`, of weights of one sign from the threshold zero on."""
    r, length = thresholds(rng, zero=invertible)
    z0 = (0.0,) * 4 if invertible else positions(rng, length, 4)
    w = weights(rng, invertible)
    return Drawn(hs.PrandtlIshlinskii(thresholds=r, weights=w, offset=float(rng.normal()), z0=z0), length)


def modified(rng: Rng, invertible: bool = False) -> Drawn:
    """Plays, and dead zones behind them."""
    law, length = plays(rng, invertible)
    reach = length * float(np.abs(law.weights).sum())
    zones = (-reach * rng.random(), 0.0, reach * rng.random())
    c = np.abs(rng.normal(size=3)) + 1e-3 if invertible else rng.normal(size=3)
    behind = {"dead_zones": zones, "dead_zone_weights": tuple(c.tolist())}
    plain = {name: getattr(law, name) for name in ("thresholds", "weights", "offset", "z0")}
    return Drawn(hs.ModifiedPrandtlIshlinskii(**plain, **behind), length)


def enveloped(rng: Rng, invertible: bool = False) -> Drawn:
    """Plays behind envelopes; with `invertible`, envelopes that do not end."""
    law, length = plays(rng, invertible)
    line = 0.1 + rng.random() if invertible else float(rng.choice([0.0, rng.random()]))
    tanh = length * rng.uniform(0.3, 3.0), rng.uniform(0.1, 3.0) / length, rng.normal(), length * rng.normal(), line
    left = tuple(float(value) for value in tanh)
    right = () if rng.random() < 0.5 else (*left[:3], left[3] - length * rng.random() * 1e-3, left[4])
    plain = {name: getattr(law, name) for name in ("thresholds", "weights", "offset", "z0")}
    return Drawn(hs.GeneralizedPrandtlIshlinskii(**plain, left=left, right=right), length)


def rate_dependent(rng: Rng, invertible: bool = False) -> Drawn:
    """Plays whose thresholds grow with the speed; its unit of time is the stride."""
    law, length = plays(rng, invertible)
    plain = {name: getattr(law, name) for name in ("thresholds", "weights", "offset", "z0")}
    return Drawn(hs.RateDependentPrandtlIshlinskii(**plain, beta=decades(rng, -6.0, -1.0)), length)


def parametric_plays(rng: Rng) -> Drawn:
    """Plays of a density with two parameters."""
    length = decades(rng, -3.0, 3.0)
    density = {"exponent": rng.uniform(-0.99, 4.0), "decay": length * decades(rng, -3.0, 3.0), "reach": length}
    sizes = {"weight": rng.normal(), "weight_slope": rng.normal() / length, "offset": rng.normal()}
    coefficients = rng.normal(size=int(rng.integers(0, 5))) * 10.0 ** rng.uniform(-2.0, 2.0)
    z0 = positions(rng, length, int(rng.integers(1, 4)))
    law = hs.ParametricPrandtlIshlinskii(
        **density, **sizes, input_coefficients=coefficients, plays=float(rng.integers(1, 60)), z0=z0
    )
    return Drawn(law, length)


def maxwell_slip(rng: Rng) -> Drawn:
    """Springs that slip."""
    slips, length = thresholds(rng)
    k = weights(rng, one_signed=False)
    z0 = positions(rng, length, 4)
    others = {"feedthrough": float(rng.normal()), "offset": float(rng.normal()), "z0": z0}
    return Drawn(hs.MaxwellSlip(slips=tuple(rng.permutation(slips)), stiffness=k, **others), length)


def relays(kind: type) -> Callable[[Rng], Drawn]:
    """Relays, single or spread, after some inputs in and beyond their levels."""

    def draw(rng: Rng, invertible: bool = False) -> Drawn:
        length = decades(rng, -3.0, 3.0)
        levels = length * (np.sort(rng.uniform(-1.0, 1.0, 5)) + 1e-6 * np.arange(5.0))
        w = np.abs(rng.normal(size=10)) + 1e-3 if invertible else rng.normal(size=10)
        past = rng.choice([*levels, *(length * rng.uniform(-1.2, 1.2, 4))], rng.integers(0, 5))
        law = kind(levels=tuple(levels), weights=tuple(w), offset=float(rng.normal()), z0=tuple(past))
        return Drawn(law, length)

    return draw


# ---------------------------------------------------------------------------------- cores


def core(kind: type) -> Callable[[Rng], Drawn]:
    """A law between two branches, from nearly straight to nearly a relay."""

    def draw(rng: Rng) -> Drawn:
        length, saturation = decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
        squareness = float(
            rng.choice([rng.uniform(0.05, 0.95), decades(rng, -6.0, -1.0), 1.0 - decades(rng, -6.0, -1.0)])
        )
        others = {"feedthrough": float(rng.choice([0.0, rng.random()])) * saturation / length}
        if kind is hs.Chan:
            others["gap"] = float(rng.choice([0.0, decades(rng, -3.0, 3.0)])) * length / saturation
        else:
            saturation = signed(rng, saturation)
        z0 = float(rng.choice([-1.0, 0.0, 1.0, rng.uniform(-1.0, 1.0)]))
        offset = float(rng.choice([0.0, rng.normal()])) * saturation
        law = kind(saturation=saturation, coercivity=length, squareness=squareness, offset=offset, z0=z0, **others)
        return Drawn(law, length)

    return draw


def tellinen_table(rng: Rng) -> Drawn:
    """Branches that are level, steep, far apart or closed, of six points."""
    length, saturation = decades(rng, -3.0, 3.0), decades(rng, -3.0, 3.0)
    inputs = length * (np.sort(rng.uniform(-1.0, 1.0, 6)) + 1e-6 * np.arange(6.0))
    lower = saturation * np.cumsum(rng.random(6) * (rng.random(6) < 0.7))
    upper = np.maximum.accumulate(lower + saturation * rng.random(6) * (rng.random(6) < 0.8))
    z0 = float(rng.choice([-1.0, 0.0, 1.0, rng.uniform(-1.0, 1.0)]))
    table = {"inputs": tuple(inputs), "lower": tuple(lower), "upper": tuple(upper)}
    line = {"feedthrough": rng.random() * saturation / length, "offset": rng.normal() * saturation, "z0": z0}
    return Drawn(hs.TellinenTable(**table, **line), length)


def energy_plays(rng: Rng) -> Drawn:
    """Plays behind an anhysteretic curve, from nearly straight to nearly a sign."""
    r, length = thresholds(rng)
    field = length * decades(rng, -4.0, 4.0)
    line = {"feedthrough": float(rng.normal()), "offset": float(rng.normal()), "z0": positions(rng, length, 4)}
    return Drawn(hs.EnergyPlays(thresholds=r, weights=weights(rng, one_signed=False), field=field, **line), length)


# ---------------------------------------------------------------------------------- others


def own_play(parameters: Any, state: Any, u: float) -> float:
    """A play as a user writes it."""
    state[1] = max(u - parameters[1], min(u + parameters[1], state[1]))
    state[0] = u
    return float(parameters[0] * state[1])


def custom(rng: Rng) -> Drawn:
    """A play as a law of one's own."""
    length = decades(rng, -3.0, 3.0)
    (z0,) = positions(rng, length, 1)
    parameters = {"gain": float(rng.normal()), "r": length * float(rng.random())}
    return Drawn(hs.CustomLaw(step=own_play, parameters=parameters, state={"z0": z0}), length)


def line(rng: Rng) -> Drawn:
    """A straight line."""
    length = decades(rng, -3.0, 3.0)
    return Drawn(hs.Line(offset=float(rng.normal()), slope=float(rng.normal()) / length), length)


def reversal_filter(rng: Rng) -> Drawn:
    """A filter of small reversals."""
    length = decades(rng, -3.0, 3.0)
    return Drawn(hs.ReversalFilter(threshold=length * float(rng.uniform(0.0, 1.0))), length)


def single_valued(rng: Rng) -> Drawn:
    """A broken line."""
    length = decades(rng, -3.0, 3.0)
    knots = length * (np.sort(rng.uniform(-1.0, 1.0, 6)) + 1e-9 * np.arange(6.0))
    return Drawn(hs.SingleValued(u=knots, y=rng.normal(size=6)), length)


def summed(rng: Rng) -> Drawn:
    """A Bouc-Wen law beside plays or relays."""
    first, other = bouc_wen(rng), (plays if rng.random() < 0.5 else relays(hs.Preisach))(rng)
    return Drawn(hs.Sum(parts=(first.law, other.law)), first.length if rng.random() < 0.5 else other.length)


def cascaded(rng: Rng) -> Drawn:
    """A law whose output moves one way on each stride, and a law behind it, of the first law's stroke.

    A sample of the first law is all that the second sees: where the first turned between two samples, more samples
    would show the second what it has missed. A Bouc-Wen memory never turns on a stride.
    """
    kind = rng.integers(3)
    behind = (bouc_wen, plays, relays(hs.Preisach))[kind](rng)
    if kind > 0:
        law, length = bouc_wen(rng)
        steepest = abs(law.A) * length or 1.0
        first = replace(law, feedthrough=0.0, offset=0.0, gain=signed(rng, behind.length / steepest))
    else:
        law, length = plays(rng, invertible=True)
        scale = behind.length / (length * sum(law.weights))
        first = replace(law, offset=0.0, weights=tuple(scale * w for w in law.weights))
    return Drawn(hs.Cascade(stages=(first, behind.law)), length)


def jiles_atherton(rng: Rng) -> Drawn:
    """A magnetic core, now and then with a coupling that is strong enough for a jump."""
    field, size = decades(rng, -3.0, 3.0), decades(rng, -3.0, 6.0)
    p = float(rng.choice([0.0, signed(rng, decades(rng, -3.0, 1.5))], p=[0.6, 0.4]))
    cosines, shares = np.polynomial.legendre.leggauss(100)
    shares = shares * np.exp(p * cosines**2)
    slope = float(shares @ cosines**2 / shares.sum())
    strength = (0.0, rng.random(), 1.0 - decades(rng, -3.0, 0.0), -decades(rng, -3.0, 1.0), decades(rng, 0.0, 1.0))
    coupling = float(rng.choice(strength, p=[0.1, 0.4, 0.2, 0.2, 0.1])) / slope
    c = float(rng.choice([0.0, rng.random(), decades(rng, -6.0, 0.0)]))
    w = float(rng.choice([1.0, 1.0, 0.0, rng.random()]))
    c = min(c, 0.9 / (coupling * slope)) if coupling > 0.0 else c
    pinning = field * decades(rng, -3.0, 2.0)
    signs = signed(rng, 1.0)
    constants = {"Ms": size, "a": field, "alpha": coupling * field / size, "k": pinning, "c": c}
    constants |= {"anisotropy": p, "reversible_feedback": w, "offset": float(rng.choice([0.0, size * rng.normal()]))}
    output = {"gain": signs * decades(rng, -2.0, 2.0), "feedthrough": signs * size / field * decades(rng, -6.0, 1.0)}
    return Drawn(hs.JilesAtherton(**constants, **output, z0=min(1.0, rng.random()) * memory(rng, size)), field)


DRAWS: dict[str, Callable[..., Drawn]] = {
    "BoucWen": bouc_wen,
    "PolynomialBoucWen": polynomial,
    "ZhuWangBoucWen": zhu_wang,
    "GeneralizedBoucWen": generalized,
    "BoucWenBaberNoori": baber_noori,
    "Duhem": duhem,
    "ColemanHodgdon": coleman_hodgdon,
    "Dahl": dahl,
    "JilesAtherton": jiles_atherton,
    "Play": element(hs.Play),
    "Stop": element(hs.Stop),
    "PrandtlIshlinskii": plays,
    "ModifiedPrandtlIshlinskii": modified,
    "GeneralizedPrandtlIshlinskii": enveloped,
    "RateDependentPrandtlIshlinskii": rate_dependent,
    "ParametricPrandtlIshlinskii": parametric_plays,
    "MaxwellSlip": maxwell_slip,
    "Preisach": relays(hs.Preisach),
    "PreisachRelays": relays(hs.PreisachRelays),
    "Tellinen": core(hs.Tellinen),
    "TellinenTable": tellinen_table,
    "Chan": core(hs.Chan),
    "EnergyPlays": energy_plays,
    "Sum": summed,
    "Cascade": cascaded,
    "CustomLaw": custom,
    "Line": line,
    "ReversalFilter": reversal_filter,
    "SingleValued": single_valued,
}
"""What draws a law of each family."""
