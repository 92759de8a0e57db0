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
from dataclasses import dataclass

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.laws.differential import _boucwen_search as plain
from hysim.models.parameters import sides
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record

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
    chart = _Chart.of(defaults, held, bounds, record, float(np.abs(np.diff(record.u)).sum()))
    limits, pinches = chart.limits, held.get("zeta_s", 1.0) != 0.0
    box = {name: limits.get(name, _BOX[name]) for name in chart.coordinates}
    box |= {"n": (float(np.log(limits["n"][0])), float(np.log(limits["n"][1])))} if "n" in limits else {}
    box |= {"loading": (float(np.arcsinh(_SAME_SIGN)), _BOX["loading"][1])} if pinches and "loading" in box else {}
    drawn = sides({name: pair if name in limits else _DRAWN.get(name, pair) for name, pair in box.items()})
    physical = _PHYSICAL | ({"loading": (True, False)} if pinches else {})
    return plain.space_of_memory(chart, box, defaults, columns, held, bounds, freedom, physical=physical, drawn=drawn)


@dataclass(frozen=True)
class _Chart(plain.Chart):
    """Coordinates of the free parameters of the memory, with the length of the input's path as the reach."""

    memory = _MEMORY
    beside_loading = "ratio"

    def sizes(self, known: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        slope = plain.steepness(known["A"])
        coefficient = (known["beta"] + known["gamma"]) / plain.shape_unit(known["A"], known["n"], self.span)
        yielding = slope * self.span * np.maximum(coefficient, 1.0) ** (-1.0 / known["n"])
        worn, one = yielding * self.reach, np.ones_like(slope)
        return {
            "delta_a": slope / worn,
            **dict.fromkeys(("delta_nu", "delta_eta", "p"), one / worn),
            "psi": yielding,
            "delta_psi": one / self.reach,
            **dict.fromkeys(("lambda_", "zeta_s", "q"), one),
            "z0": yielding,
        }

    def sized(self, name: str, x: FloatArray) -> FloatArray:
        return np.asarray(np.sinh(x) if name in _RATES else np.exp(x) if name in _LOGS else x)

    def unsized(self, name: str, value: FloatArray) -> FloatArray:
        if name in _LOGS:
            return np.log(np.maximum(value, 1e-300))
        return np.asarray(np.arcsinh(value) if name in _RATES else value)
