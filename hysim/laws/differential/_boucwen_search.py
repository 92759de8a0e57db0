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
from typing import Any, Self

import numpy as np

from hysim._basics.frozen import FloatArray, check_positive
from hysim.models import parameters
from hysim.models.parameters import Coordinate, Numbers, by_name, space_of_chart
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record, span_of

REDUNDANT = (("A", "gain"),)
_FURTHER = ("b2", "b3", "b4", "b5", "b6")
_PAIR = ("loading", "unloading")
_SHAPES = (*_PAIR, "beta", "gamma", *_FURTHER)
_RATES = ("delta_a", "delta_nu", "delta_eta", "delta_psi")
_LEAST_UNIT, _LARGEST_UNIT = 1e-290, 1e290  # times 1e17, the largest coefficient, still a number
_BY_DEFAULT = {"A": 1.0, "beta": 0.5, "gamma": 0.5, "n": 1.0, "z0": 0.0}
KNEE = float(np.arcsinh(40.0))
ROWS = by_name(
    Coordinate("A", -10.0, 10.0),
    *(Coordinate(name, -KNEE, KNEE) for name in (*_PAIR, "beta", "gamma")),
    # a larger exponent is a corner as sharp as that of two straight lines
    Coordinate("n", 0.5, 10.0, log=True, physical=(False, True)),
    *(Coordinate(name, -KNEE, KNEE) for name in _FURTHER),
    Coordinate("delta", -5.0, 5.0),
    Coordinate("z0", -1.0, 1.0),
)


@dataclass(frozen=True, kw_only=True)
class Chart(parameters.Chart):
    """Coordinates in the scales of a record; A is measured in the output's span over the gain and the input's."""

    span: float
    reach: float  # of |u|
    path: float  # length of that of the input
    slope: float  # what A is measured in

    @property
    def called(self) -> Mapping[str, str]:
        paired = {"beta", "gamma"} <= {*self.free} - {*self.bounds}
        return {"beta": "loading", "gamma": "ratio" if "ratio" in self.rows else "unloading"} if paired else {}

    def in_own_units(self) -> Self:
        return replace(self, span=1.0, reach=self.reach / self.span, path=self.path / self.span, slope=1.0)

    def measured(self, known: dict[str, FloatArray], raw: dict[str, FloatArray]) -> dict[str, FloatArray]:
        known |= {name: raw[name] * size for name, size in {"A": self.slope, "n": 1.0}.items() if name in raw}
        unit = shape_unit(known["A"], known["n"], self.span)
        shapes = {name: shape(raw[name], known["n"]) * unit for name in _SHAPES if name in raw}
        if "loading" in shapes:
            loading = shapes.pop("loading")
            unloading = shapes.pop("unloading") if "unloading" in shapes else raw["ratio"] * np.abs(loading)
            known |= {"beta": 0.5 * (loading + unloading), "gamma": 0.5 * (loading - unloading)}
        known |= shapes
        raw |= {name: np.sinh(raw[name]) for name in _RATES if name in raw}
        return known | {name: raw[name] * size for name, size in self.sizes(known).items() if name in raw}

    def located(self, known: dict[str, FloatArray]) -> dict[str, Any]:
        unit = shape_unit(known["A"], known["n"], self.span)
        loading, unloading = known["beta"] + known["gamma"], known["beta"] - known["gamma"]
        shapes = {**known, "loading": loading, "unloading": unloading}
        raw = {name: knee(shapes[name] / unit, known["n"]) for name in _SHAPES if name in self.axes}
        ratio = unloading / np.abs(loading) if loading != 0.0 else 0.0
        sized = {name: known[name] / size for name, size in self.sizes(known).items() if name in known}
        sized |= {name: np.arcsinh(sized[name]) for name in _RATES if name in sized}
        return {**raw, "A": known["A"] / self.slope, "ratio": ratio, **sized}

    def sizes(self, known: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Units of the parameters that have one, by A, beta, gamma and n."""
        slope = steepness(known["A"])
        return {"delta": slope / self.reach, "z0": slope * self.span}


def search_space(
    law: Any, record: Record, freedom: Freedom, kind: type[Chart] = Chart, rows: Mapping[str, Coordinate] = ROWS
) -> SearchSpace:
    """The search of a memory in the coordinates of a chart, which begins in the units of the record by default."""
    defaults: Numbers = law.scalars
    at_rest = ("z0",) if freedom.starts_at_rest() else ()
    held = freedom.held(defaults, redundant=(*REDUNDANT, *law.alike(record, freedom)), at_rest=at_rest)
    bounds = freedom.limits(defaults, held)
    check_positive(n=held.get("n"))
    if "n" in bounds and not (bounds["n"][0] >= 0.0 and (bounds["n"][0] > 0.0 or np.isinf(bounds["n"][1]))):
        raise ValueError(f"bounds of 'n' must be positive, got {bounds['n']}")
    for name, pair in bounds.items():
        if name in rows and not np.isfinite(pair).all() and 0.0 not in pair and pair != (-np.inf, np.inf):
            raise ValueError(f"bounds of {name!r} must be finite, or reach from zero to infinity, got {pair}")
    span, gain = span_of(record), abs({**defaults, **held}["gain"]) or 1.0
    chart = kind(
        rows=rows,
        defaults=defaults,
        held=held,
        bounds=bounds,
        span=span,
        reach=float(np.abs(record.u).max()),
        path=float(np.abs(np.diff(record.u)).sum()),
        slope=float(np.ptp(record.y)) / gain / span or 1.0,
    )
    is_default = freedom.starts_anew and _BY_DEFAULT.items() <= defaults.items()
    start = chart.in_own_units().numbers(chart.values) if is_default else None
    space = space_of_chart(chart, law.columns, freedom, start, redundant=REDUNDANT, screened=law.screened)
    known = {*law.columns, *("A", "beta", "gamma", "n", "z0")}
    extended = not known.issuperset(defaults)  # what is admissible for such a law is not known
    if extended or not {*_PAIR} <= {*space.coordinates}:
        return space
    quadrant = np.where(np.isin(space.coordinates, _PAIR), np.maximum(space.lower, 0.0), space.lower)
    return replace(space, regions={"admissible": (quadrant, space.upper)})


def shape_unit(A: FloatArray, n: FloatArray, span: float) -> FloatArray:
    """The unit of beta and gamma, |A| / Z^n, where that is a number which the coefficients can be measured in."""
    slope = steepness(A)
    with np.errstate(over="ignore", under="ignore", divide="ignore"):
        unit = slope / (slope * span) ** n
    return np.clip(unit, _LEAST_UNIT, _LARGEST_UNIT)


def steepness(A: FloatArray) -> FloatArray:
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
