"""The box in which a Bouc-Wen law that wears off or pinches is searched, in the law's own scales.

The memory of such a law saturates at the yield memory z_u, often far below what the input's span would make of it, and
the energy that wears it grows by z_u for each unit of the input's path. With U the span of the input, P the length of
its path, k the knee and l the shape coefficients of `hysim.laws.differential._boucwen_search`, the coordinates are

    loading       c,  k = sinh(c):  z_u = |A| U / k for a memory that saturates, k from 1/3 to 500 drawn
    ratio         (beta - gamma) / |beta + gamma|, from -1 to 3 drawn
    n             log n
    delta_nu, delta_eta    asinh(delta z_u P), and delta_a likewise with delta_a z_u P / |A|
    p             log(p z_u P)
    psi           log(psi / z_u), and delta_psi as the rates with delta_psi P
    lambda_       log lambda_
    z0            z0 / z_u
    zeta_s, q     themselves

Rates are not negative: damage does not heal. A parameter that the user bounds is its own coordinate within its bounds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.laws.differential import _boucwen_search as plain
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record, span_of

_LARGEST = 600.0  # knee of the loading branch; smaller yield memories are below what a record resolves
_SAME_SIGN = 0.02  # smallest knee of a law that pinches, whose loading coefficient is positive
_BOX = {
    "A": (-10.0, 10.0),
    "loading": (-plain.KNEE, float(np.arcsinh(_LARGEST))),
    "ratio": (-10.0, 10.0),
    "beta": (-plain.KNEE, plain.KNEE),
    "gamma": (-plain.KNEE, plain.KNEE),
    "n": (float(np.log(0.5)), float(np.log(10.0))),
    "delta_a": (0.0, 4.0),
    "delta_nu": (0.0, 4.0),
    "delta_eta": (0.0, 4.0),
    "zeta_s": (0.0, 0.999),
    "q": (-1.0, 1.0),
    "p": (float(np.log(0.05)), float(np.log(300.0))),
    "psi": (float(np.log(0.02)), float(np.log(5.0))),
    "delta_psi": (0.0, 4.0),
    "lambda_": (float(np.log(0.02)), float(np.log(10.0))),
    "z0": (-3.0, 3.0),
}
_DRAWN = {
    "loading": (float(np.arcsinh(1.0 / 3.0)), float(np.arcsinh(500.0))),
    "ratio": (-1.0, 3.0),
    "delta_psi": (0.0, 2.0),
    "z0": (-1.0, 1.0),
}
_RATES = ("delta_a", "delta_nu", "delta_eta", "delta_psi")
_PHYSICAL = {  # damage does not heal, and a slope along a branch does not change its sign
    **plain.PHYSICAL,
    **dict.fromkeys(_RATES, (True, False)),
    "zeta_s": (True, True),
}
_LOGS = ("p", "psi", "lambda_")
_MEMORY = (
    *("A", "beta", "gamma", "n", "delta_a", "delta_nu", "delta_eta"),
    *("zeta_s", "q", "p", "psi", "delta_psi", "lambda_", "z0"),
)


def search_space(
    defaults: Mapping[str, float],
    columns: tuple[str, ...],
    record: Record,
    freedom: Freedom,
    held: Mapping[str, float],
) -> SearchSpace:
    """Declare the coordinates, their box and the way back to the user's parameters for one record.

    `held` are the parameters that are not free.
    """
    bounds = freedom.limits(defaults, held)
    for name, pair in bounds.items():
        if name in _MEMORY and not np.isfinite(pair).all():
            raise ValueError(f"bounds of {name!r} must be finite, got {pair}")
        if name in ("n", *_LOGS) and pair[0] <= 0.0:
            raise ValueError(f"bounds of {name!r} must be positive, got {pair}")
    limits = {name: pair for name, pair in bounds.items() if name in _MEMORY}
    free = [name for name in _MEMORY if name in defaults and name not in held]
    pinches = held.get("zeta_s", 1.0) != 0.0
    paired = {"beta", "gamma"} <= {*free} and not {"beta", "gamma"} & limits.keys()
    other = {"beta": "loading", "gamma": "ratio"} if paired else {}
    chart = _Chart(
        coordinates=tuple(other.get(name, name) for name in free),
        values={**defaults, **held},
        limits=limits,
        span=span_of(record),
        path=float(np.abs(np.diff(record.u)).sum()),
        slope=plain.slope_of(record, {**defaults, **held}),
    )
    box = [chart.side(name, limits.get(name)) for name in chart.coordinates]
    if pinches and "loading" in chart.coordinates:
        box[chart.coordinates.index("loading")] = (float(np.arcsinh(_SAME_SIGN)), _BOX["loading"][1])
    lower, upper = (np.array([pair[side] for pair in box]) for side in (0, 1))
    drawn = [
        pair if name in limits else _DRAWN.get(name, pair) for name, pair in zip(chart.coordinates, box, strict=True)
    ]
    physical = _PHYSICAL | ({"loading": (True, False)} if pinches else {})
    sides = np.array([low for low, _ in drawn]), np.array([high for _, high in drawn])
    return plain.space_of_memory(
        chart, (lower, upper), defaults, columns, held, bounds, freedom, physical=physical, drawn=sides
    )


@dataclass(frozen=True)
class _Chart:
    """Coordinates of the free parameters of the memory, and the way there and back."""

    coordinates: tuple[str, ...]
    values: Mapping[str, float]  # every parameter, where it is not free
    limits: Mapping[str, tuple[float, float]]  # parameters that are their own coordinates
    span: float
    path: float
    slope: float  # what A is measured in

    def side(self, name: str, limits: tuple[float, float] | None) -> tuple[float, float]:
        """The box of a coordinate."""
        if limits is None:
            return _BOX[name]
        return (float(np.log(limits[0])), float(np.log(limits[1]))) if name == "n" else limits

    def in_own_units(self) -> "_Chart":
        return replace(self, span=1.0, path=self.path / self.span, slope=1.0)

    def decode(self, x: FloatArray) -> dict[str, FloatArray]:
        sets = np.atleast_2d(x)
        raw = dict(zip(self.coordinates, sets.T, strict=True))
        known = {name: np.full(len(sets), self.values[name]) for name in _MEMORY}
        known |= {name: raw[name] for name in self.limits}
        if "A" in raw and "A" not in self.limits:
            known["A"] = raw["A"] * self.slope
        if "n" in raw:
            known["n"] = np.exp(raw["n"])
        unit = plain.shape_unit(known["A"], known["n"], self.span)
        if "loading" in raw:
            loading = plain.shape(raw["loading"], known["n"]) * unit
            unloading = raw["ratio"] * np.abs(loading)
            known |= {"beta": 0.5 * (loading + unloading), "gamma": 0.5 * (loading - unloading)}
        for name in ("beta", "gamma"):
            if name in raw and name not in self.limits:
                known[name] = plain.shape(raw[name], known["n"]) * unit
        sizes = self._sizes(known)
        for name in self.coordinates:
            if name in sizes and name not in self.limits:
                known[name] = _value(name, raw[name]) * sizes[name]
        return known

    def encode(self, parameters: Mapping[str, float]) -> FloatArray:
        known = {name: np.array(parameters[name]) for name in _MEMORY}
        unit = plain.shape_unit(known["A"], known["n"], self.span)
        loading, unloading = known["beta"] + known["gamma"], known["beta"] - known["gamma"]
        raw = {
            "A": known["A"] / self.slope,
            "n": np.log(known["n"]),
            "loading": plain.knee(loading / unit, known["n"]),
            "ratio": unloading / np.abs(loading) if loading != 0.0 else np.zeros(()),
            **{name: plain.knee(known[name] / unit, known["n"]) for name in ("beta", "gamma")},
        }
        raw |= {name: _coordinate(name, known[name] / size) for name, size in self._sizes(known).items()}
        raw |= {name: known[name] for name in self.limits if name != "n"}
        return np.array([float(raw[name]) for name in self.coordinates])

    def _sizes(self, known: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Units of the parameters that have one, from A, beta, gamma and n."""
        slope = np.where(known["A"] == 0.0, 1.0, np.abs(known["A"]))
        coefficient = (known["beta"] + known["gamma"]) / plain.shape_unit(known["A"], known["n"], self.span)
        yielding = slope * self.span * np.maximum(coefficient, 1.0) ** (-1.0 / known["n"])
        worn, one = yielding * self.path, np.ones_like(slope)
        return {
            "delta_a": slope / worn,
            **dict.fromkeys(("delta_nu", "delta_eta", "p"), one / worn),
            "psi": yielding,
            "delta_psi": one / self.path,
            **dict.fromkeys(("lambda_", "zeta_s", "q"), one),
            "z0": yielding,
        }


def _value(name: str, x: FloatArray) -> FloatArray:
    return np.asarray(np.sinh(x) if name in _RATES else np.exp(x) if name in _LOGS else x)


def _coordinate(name: str, value: FloatArray) -> FloatArray:
    if name in _LOGS:
        return np.log(np.maximum(value, 1e-300))
    return np.asarray(np.arcsinh(value) if name in _RATES else value)
