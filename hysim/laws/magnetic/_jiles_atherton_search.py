"""The box in which the Jiles-Atherton law is searched.

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
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray
from hysim.laws.magnetic._jiles_atherton_conversions import MU0
from hysim.models.parameters import spans
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record

_BOX = {
    "Ms": (np.log(0.9), np.log(30.0)),
    "a": (np.log(1e-4), np.log(30.0)),
    "alpha": (-6.0, 13.0),
    "k": (np.log(1e-3), np.log(30.0)),
    "c": (0.0, 0.99),
    "anisotropy": (-30.0, 30.0),
    "reversible_feedback": (0.0, 1.0),
    "z0": (-1.0, 1.0),
}
_DRAWN = {
    "Ms": (np.log(1.0), np.log(4.0)),
    "a": (np.log(0.01), np.log(3.0)),
    "alpha": (0.0, 4.0),
    "k": (np.log(0.01), np.log(3.0)),
    "c": (0.0, 0.8),
    "anisotropy": (-10.0, 10.0),
}
_PHYSICAL = {
    "Ms": (True, False),
    **dict.fromkeys(("c", "reversible_feedback", "z0"), (True, True)),
}
_LOGS = ("Ms", "a", "k")
_CALLED = {"a": "width", "alpha": "stability"}
_HELD = ("anisotropy", "reversible_feedback")
_COLUMNS = ("gain", "feedthrough")
_SI = ("A/m", "T")
_LEAST = 1e-12  # of 1 - alpha Ms m0 / a
_TURN = 12.0  # twice the stability at which alpha Ms s / a is 1
_SMALLEST = 1e-3  # of the width: a for a coupling that is given, and nearly as large
_SCREENED = 1024


def search_space(
    scalars: Mapping[str, float],
    columns: tuple[str, ...],
    record: Record,
    freedom: Freedom,
    *,
    is_by_default: bool,
) -> SearchSpace:
    """The coordinates, their box and the way back to the user's parameters for one record.

    A search of the law by default begins in the middle of the box.

    Held by default are gain and feedthrough, of which the first could not be told from Ms, and what makes the law
    another one: an anisotropy that is zero at the start, and reversible_feedback. The feedthrough of a law by default,
    mu0, is that of a record in A/m and T; it is free in a record whose units are others or not known.
    """
    is_of_vacuum = scalars["feedthrough"] == scalars["gain"] == MU0
    has_other_units = is_of_vacuum and (record.units.get("u"), record.units.get("y")) != _SI
    further = [name for name in _HELD if name not in freedom.bounds and not (name == "anisotropy" and scalars[name])]
    known = _COLUMNS[:1] if has_other_units else _COLUMNS
    alone = tuple((name,) for name in (*known, *further) if name not in freedom.bounds)
    at_rest = ("z0",) if freedom.starts_at_rest() else ()
    held = freedom.held(scalars, redundant=alone, at_rest=at_rest)
    bounds = freedom.limits(scalars, held)
    limits = {name: pair for name, pair in bounds.items() if name in _BOX}
    for name, pair in limits.items():
        if not np.isfinite(pair).all() or (name in _LOGS and pair[0] <= 0.0):
            raise ValueError(f"bounds of {name!r} must be {'positive and ' * (name in _LOGS)}finite, got {pair}")
    values = {**scalars, **held}
    unit = spans(record)
    chart = _Chart(
        names=tuple(name for name in _BOX if name not in held),
        values=values,
        limits=limits,
        field=unit["h"],
        magnetisation=0.5 * unit["y"] / (abs(values["gain"]) or 1.0),
    )
    lower, upper = np.array([chart.side(name) for name in chart.names]).reshape(-1, 2).T
    begins_anew = freedom.starts_anew and is_by_default
    if not freedom.starts_anew:
        own = chart.encode(values)
        free = np.array([name not in limits for name in chart.names], dtype=bool)
        lower, upper = np.where(free, np.minimum(lower, own), lower), np.where(free, np.maximum(upper, own), upper)
    drawn = np.array([chart.side(name) if name in limits else _DRAWN.get(name, _BOX[name]) for name in chart.names])
    low, high = np.clip(drawn.reshape(-1, 2).T, lower, upper)

    def encoded(parameters: Mapping[str, float]) -> FloatArray:
        return np.asarray(np.clip(chart.encode({**values, **parameters}), lower, upper))

    return SearchSpace(
        coordinates=tuple(name if name in limits else _CALLED.get(name, name) for name in chart.names),
        lower=lower,
        upper=upper,
        starts=(0.5 * (low + high) if begins_anew else encoded({}))[np.newaxis],
        names=tuple(name for name in scalars if name not in held),
        columns=columns,
        linear=tuple(name for name in columns if name not in held),
        held=held,
        parameters=chart.decode,
        bounds={name: pair for name, pair in bounds.items() if name in columns},
        state=("z0",),
        physical={name: _PHYSICAL[name] for name in chart.names if name in _PHYSICAL and name not in limits},
        screened=_SCREENED,
        drawn=(low, high),
        encoded=encoded,
    )


@dataclass(frozen=True)
class _Chart:
    """Coordinates of the free parameters, and the way there and back."""

    names: tuple[str, ...]
    values: Mapping[str, float]  # every parameter, where it is not free
    limits: Mapping[str, tuple[float, float]]  # parameters that are their own coordinates
    field: float
    magnetisation: float

    def side(self, name: str) -> tuple[float, float]:
        """The box of a coordinate."""
        if name not in self.limits:
            return _BOX[name]
        low, high = self.limits[name]
        return (float(np.log(low)), float(np.log(high))) if name in _LOGS else (low, high)

    def has_stability(self) -> bool:
        """Whether the coupling is searched by its stability."""
        return "alpha" in self.names and "alpha" not in self.limits

    def decode(self, x: FloatArray) -> dict[str, FloatArray]:
        """Parameters that are not linear, each (n_sets,), from coordinates (n_sets, n_x)."""
        sets = np.atleast_2d(x)
        raw = dict(zip(self.names, sets.T, strict=True))
        known = {name: np.full(len(sets), self.values[name]) for name in _BOX} | raw
        known |= {name: np.exp(raw[name]) for name in _LOGS if name in raw}
        for name, unit in (("Ms", self.magnetisation), ("k", self.field)):
            if name in raw and name not in self.limits:
                known[name] = known[name] * unit
        stable = raw["alpha"] if self.has_stability() else None
        share = initial_slope(known["anisotropy"]) * known["Ms"]
        apart = 1.0
        if stable is not None:
            below, above = np.exp(-stable), np.exp(stable - _TURN)
            apart = below + above
        if "a" in raw and "a" not in self.limits:
            width = known["a"] * self.field
            coupled = width + known["alpha"] * share if stable is None else width / apart
            known["a"] = np.maximum(coupled, _SMALLEST * width)
        if stable is not None:
            known["alpha"] = (1.0 - below + above) * known["a"] / (known["Ms"] * steepest(known))
        if "z0" in raw and "z0" not in self.limits:
            known["z0"] = raw["z0"] * known["Ms"]
        return known

    def encode(self, parameters: Mapping[str, float]) -> FloatArray:
        """Coordinates (n_x,) of one set of parameters."""
        raw = {name: float(parameters[name]) for name in _BOX}
        one = {name: np.array([value]) for name, value in raw.items()}
        if self.has_stability():
            beyond = raw["alpha"] * raw["Ms"] * float(steepest(one)[0]) / raw["a"] - 1.0
            apart = float(np.hypot(beyond, 2.0 * np.exp(-0.5 * _TURN)))
            stable = -np.log(0.5 * (apart - beyond))
        else:
            share = float(initial_slope(one["anisotropy"])[0]) * raw["Ms"]
            apart, stable = max(1.0 - raw["alpha"] * share / raw["a"], _LEAST), 0.0
        own = {
            "Ms": raw["Ms"] / self.magnetisation,
            "a": raw["a"] * apart / self.field,
            "alpha": stable,
            "k": raw["k"] / self.field,
            "z0": raw["z0"] / raw["Ms"],
        }
        raw |= {name: value for name, value in own.items() if name not in self.limits}
        return np.array([np.log(raw[name]) if name in _LOGS else raw[name] for name in self.names])


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
_PLACES, _SHARES = np.polynomial.legendre.leggauss(64)
_PLACES = 0.5 * (1.0 + _PLACES)
