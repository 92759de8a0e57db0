"""The box in which the Bouc-Wen laws are searched.

With U the span of the input and Z = |A| U, the law in z/Z and u/U has the shape coefficients

    loading   = (beta + gamma) Z^n / |A|      unloading = (beta - gamma) Z^n / |A|

which act on different stretches of the path, and hold the thermodynamically admissible laws (-beta <= gamma <= beta)
where both are >= 0. A positive loading coefficient l bends the branch over at z = Z / k with k = l^(1/n): the
coordinate c measures this knee, is smooth and signed, and is of order one for every n,

    l = k (1 + |k|)^(n - 1),    k = sinh(c)

The box is |k| <= 40 for both, n in [0.5, 10] on a log scale, z0/Z in [-1, 1], and open for the parameters in which the
output is affine; the upper side of n is a limit, beyond the others `hysim.identify` searches where an optimum stands at
them. The further shape coefficients b2 to b6 of the generalised law have the coordinates of beta; the forcing delta of
Zhu and Wang is measured by what it adds to |A| where |u| is largest, in [-5, 5]. A parameter that the user bounds is
its own coordinate, between these bounds; bounds from or to zero and infinity cut the box at zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.models.parameters import space_of_chart
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record, span_of

REDUNDANT = (("A", "gain"),)
_FURTHER = ("b2", "b3", "b4", "b5", "b6")
_SCALED = {  # parameters with a unit of their own, and their box in it
    "delta": (-5.0, 5.0),
    "z0": (-1.0, 1.0),
}
_MEMORY = ("A", "beta", "gamma", "n", *_FURTHER, *_SCALED)
_PAIR = ("loading", "unloading")
_LEAST_UNIT, _LARGEST_UNIT = 1e-290, 1e290  # times 1e17, the largest coefficient, still a number
_BY_DEFAULT = {"A": 1.0, "beta": 0.5, "gamma": 0.5, "n": 1.0, "z0": 0.0}
KNEE = float(np.arcsinh(40.0))
PHYSICAL = {"n": (False, True)}  # a larger exponent is a corner as sharp as that of two straight lines
_BOX = {
    "A": (-10.0, 10.0),
    "loading": (-KNEE, KNEE),
    "unloading": (-KNEE, KNEE),
    "beta": (-KNEE, KNEE),
    "gamma": (-KNEE, KNEE),
    "n": (0.5, 10.0),
    **dict.fromkeys(_FURTHER, (-KNEE, KNEE)),
    **_SCALED,
}


def search_space(
    defaults: Mapping[str, float],
    columns: tuple[str, ...],
    record: Record,
    freedom: Freedom,
    *,
    alike: tuple[tuple[str, ...], ...] = (),
    screened: int | None = None,
) -> SearchSpace:
    """Declare the coordinates, their box and the way back to the user's parameters for one record."""
    at_rest = ("z0",) if freedom.starts_at_rest() else ()
    held = freedom.held(defaults, redundant=(*REDUNDANT, *alike), at_rest=at_rest)
    bounds = freedom.limits(defaults, held)
    if held.get("n", 1.0) <= 0.0:
        raise ValueError(f"n must be positive, got {held['n']}")
    if "n" in bounds and not (bounds["n"][0] >= 0.0 and (bounds["n"][0] > 0.0 or np.isinf(bounds["n"][1]))):
        raise ValueError(f"bounds of 'n' must be positive, got {bounds['n']}")
    signs = {name: pair for name, pair in bounds.items() if name in _MEMORY and np.isinf(pair).any()}
    limits = {name: pair for name, pair in bounds.items() if name in _MEMORY and name not in signs}
    chart = _chart({**defaults, **held}, frozenset(defaults) - frozenset(held), limits, frozenset(signs), record)
    box = {name: limits.get(name, _cut(name, signs.get(name))) for name in chart.coordinates}
    box |= {"n": (float(np.log(box["n"][0])), float(np.log(box["n"][1])))} if "n" in box else {}
    lower, upper = (np.array([pair[side] for pair in box.values()]) for side in (0, 1))
    known = {*columns, *("A", "beta", "gamma", "n", "z0")}
    extended = not known.issuperset(defaults)  # what is admissible for such a law is not known

    quadrant = np.array([max(low, 0.0) if name in _PAIR else low for name, (low, _) in box.items()])
    return space_of_memory(
        chart,
        (lower, upper),
        defaults,
        columns,
        held,
        bounds,
        freedom,
        regions={"admissible": (quadrant, upper)} if set(_PAIR) <= set(box) and not extended else {},
        screened=screened,
    )


def space_of_memory(
    chart: Any,
    box: tuple[FloatArray, FloatArray],
    defaults: Mapping[str, float],
    columns: tuple[str, ...],
    held: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    freedom: Freedom,
    **others: Any,
) -> SearchSpace:
    """The search of a memory in the coordinates of a chart, which begins in the units of the record by default."""
    is_default = freedom.starts_anew and _BY_DEFAULT.items() <= defaults.items()
    start = (chart.in_own_units() if is_default else chart).encode(chart.values)
    others = {"redundant": REDUNDANT, "physical": PHYSICAL, **others}
    return space_of_chart(chart, box, start, defaults, columns, held, bounds, freedom, state=("z0",), **others)


def _cut(name: str, sign: tuple[float, float] | None) -> tuple[float, float]:
    """The default box, cut at zero where the user asks for a sign."""
    lower, upper = _BOX[name]
    if sign is None:
        return lower, upper
    if 0.0 not in sign and sign != (-np.inf, np.inf):
        raise ValueError(f"bounds of {name!r} must be finite, or reach from zero to infinity, got {sign}")
    return max(lower, sign[0]), min(upper, sign[1])


@dataclass(frozen=True)
class _Chart:
    """Coordinates of the memory's free parameters, and the way there and back."""

    coordinates: tuple[str, ...]
    values: Mapping[str, float]  # every parameter, where it is not free
    limits: Mapping[str, tuple[float, float]]  # parameters that are their own coordinates
    span: float
    reach: float  # of |u|
    slope: float  # what A is measured in

    def in_own_units(self) -> "_Chart":
        return replace(self, span=1.0, reach=self.reach / self.span, slope=1.0)

    def decode(self, x: FloatArray) -> dict[str, FloatArray]:
        """Parameters of the memory, each (n_sets,), from coordinates (n_sets, n_x)."""
        raw = dict(zip(self.coordinates, np.atleast_2d(x).T, strict=True))
        held = {name: np.full(np.atleast_2d(x).shape[0], self.values[name]) for name in _MEMORY if name in self.values}
        A = raw["A"] * (1.0 if "A" in self.limits else self.slope) if "A" in raw else held["A"]
        n = np.exp(raw["n"]) if "n" in raw else held["n"]
        unit = self._unit(A, n)
        parameters = held | {"A": A, "n": n}
        shapes = (*_PAIR, "beta", "gamma", *_FURTHER)
        scaled = {name: shape(raw[name], n) * unit for name in shapes if name in raw}
        if "loading" in scaled:
            parameters["beta"] = 0.5 * (scaled["loading"] + scaled["unloading"])
            parameters["gamma"] = 0.5 * (scaled["loading"] - scaled["unloading"])
        scaled |= {name: raw[name] * size for name, size in self._sizes(A).items() if name in raw}
        parameters |= {name: values for name, values in scaled.items() if name not in _PAIR}
        return parameters | {name: raw[name] for name in self.limits if name not in ("A", "n")}

    def encode(self, parameters: Mapping[str, float]) -> FloatArray:
        """Coordinates (n_x,) of one set of parameters."""
        A, n = np.array(parameters["A"]), np.array(parameters["n"])
        beta, gamma, unit = parameters["beta"], parameters["gamma"], self._unit(A, n)
        scaled: dict[str, FloatArray | float] = {
            "A": A / self.slope,
            "loading": knee((beta + gamma) / unit, n),
            "unloading": knee((beta - gamma) / unit, n),
            "beta": knee(beta / unit, n),
            "gamma": knee(gamma / unit, n),
            **{name: knee(parameters[name] / unit, n) for name in _FURTHER if name in parameters},
            **{name: parameters[name] / size for name, size in self._sizes(A).items() if name in parameters},
        }
        scaled |= {name: parameters[name] for name in self.limits if name in scaled}
        scaled["n"] = np.log(n)
        return np.array([float(scaled[name]) for name in self.coordinates])

    def _sizes(self, A: FloatArray) -> dict[str, FloatArray]:
        """Units of the scaled parameters."""
        slope = _steepness(A)
        return {"delta": slope / self.reach, "z0": slope * self.span}

    def _unit(self, A: FloatArray, n: FloatArray) -> FloatArray:
        return shape_unit(A, n, self.span)


def shape_unit(A: FloatArray, n: FloatArray, span: float) -> FloatArray:
    """The unit of beta and gamma, |A| / Z^n, where that is a number which the coefficients can be measured in."""
    slope = _steepness(A)
    with np.errstate(over="ignore", under="ignore", divide="ignore"):
        unit = slope / (slope * span) ** n
    return np.clip(unit, _LEAST_UNIT, _LARGEST_UNIT)


def _steepness(A: FloatArray) -> FloatArray:
    return np.where(A == 0.0, 1.0, np.abs(A))


def shape(c: FloatArray, n: FloatArray) -> FloatArray:
    """Shape coefficient l from its coordinate."""
    k = np.sinh(c)
    return np.asarray(k * (1.0 + np.abs(k)) ** (n - 1.0))


def knee(coefficient: FloatArray, n: FloatArray) -> float:
    """Coordinate of a shape coefficient l, the inverse of `shape`, by bisection."""
    low, high = 0.0, 2.0
    while shape(np.array(high), n) < abs(coefficient) and high < 300.0:
        high *= 2.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shape(np.array(middle), n) < abs(coefficient) else (low, middle)
    return float(np.copysign(high, coefficient)) if coefficient else 0.0


def _chart(
    values: Mapping[str, float],
    free: frozenset[str],
    limits: Mapping[str, tuple[float, float]],
    signed: frozenset[str],
    record: Record,
) -> _Chart:
    paired = {"beta", "gamma"} <= free and not {"beta", "gamma"} & (limits.keys() | signed)
    shapes = _PAIR if paired else ("beta", "gamma")
    order = ("A", *shapes, "n", *_FURTHER, *_SCALED)
    coordinates = [name for name in order if name in free or (paired and name in _PAIR)]
    return _Chart(
        coordinates=tuple(coordinates),
        values=values,
        limits=limits,
        span=span_of(record),
        reach=float(np.abs(record.u).max()),
        slope=slope_of(record, values),
    )


def slope_of(record: Record, values: Mapping[str, float]) -> float:
    """The unit of A: the output's span over the gain and the input's."""
    return float(np.ptp(record.y)) / (abs(values["gain"]) or 1.0) / span_of(record) or 1.0
