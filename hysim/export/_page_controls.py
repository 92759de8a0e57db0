"""Sliders for the numbers of a law.

A slider covers the values that change the output by about its own span on the page's input, inside the search box of
the law and where the constructor takes them. A number of which only positive values are allowed has a logarithmic one.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.errors import SimulationError
from hysim.models.law import Law
from hysim.records import Record

_MOST = 3  # elements of a tuple that have a slider each; longer ones have one for all
_FIRST, _LAST = 1e-5, 1e3  # changes of a number that are tried, in sizes of itself
_TINY, _SMALL, _LARGE = 0.02, 0.25, 1.0  # changes of the output, in its spans
FEW = 100  # samples of the input on which changes are computed
_DECADE = 10.0
_FACTOR = 4.0  # of a slider that scales a tuple


class Control(NamedTuple):
    """A slider for the numbers at some places among a law's; one with `scale` multiplies them."""

    name: str
    value: float
    lower: float
    upper: float
    places: tuple[int, ...]
    log: bool = False
    scale: bool = False

    def to_json(self, first: int, prefix: str = "") -> dict[str, Any]:
        """As the page takes it, for a law whose numbers begin at the place `first`."""
        described = {"name": prefix + self.name, "value": self.value, "lower": self.lower, "upper": self.upper}
        flags = {name: True for name, is_on in (("log", self.log), ("scale", self.scale)) if is_on}
        return {**described, **flags, "places": [first + place for place in self.places]}


def controls_of(law: Law, free: tuple[str, ...], u: FloatArray, names: Sequence[str] | None = None) -> list[Control]:
    """A slider for each number in `free`, names as in `law.scalars`; long tuples share one, initial tuples have none.

    Places are those among `names`, by default all numbers of the law.
    """
    names = list(law.scalars) if names is None else names
    groups: dict[str, list[str]] = {}
    for name in free:
        groups.setdefault(name.partition("[")[0], []).append(name)
    reach = _Reach(law, u)
    controls: list[Control] = []
    for field, members in groups.items():
        places = tuple(names.index(name) for name in members)
        is_tuple = "[" in members[0]
        if is_tuple and (field in law.initial or field in ("levels", "dead_zones")):
            continue
        if is_tuple and len(members) > _MOST and field not in ("left", "right"):
            if any(law.scalars[name] for name in members):
                controls.append(Control(f"{field} ×", 1.0, 1.0 / _FACTOR, _FACTOR, places, log=True, scale=True))
        else:
            controls += [reach.control(name, place) for name, place in zip(members, places, strict=True)]
    return controls


def by_fields(law: Law) -> bool:
    """Whether the numbers of a law are named by its fields, so that the constructor takes them."""
    return {name.partition("[")[0] for name in law.scalars} <= set(law.arguments)


class _Reach:
    """How far the numbers of a law can be moved on an input."""

    def __init__(self, law: Law, u: FloatArray) -> None:
        self.law, self.u = law, u[:: max(1, len(u) // FEW)]
        self.y = law.response(self.u)
        self.span = float(np.ptp(self.y)) or 1.0
        self.boxes = _boxes(law, Record(u=self.u, y=self.y))

    def control(self, name: str, place: int) -> Control:
        """The slider of a number."""
        value = self.law.scalars[name]
        low, high = self.boxes.get(name, (-math.inf, math.inf))
        if value > 0.0 and self._with(name, 0.0) is None:
            lower, upper = max(value / _DECADE, min(low, value)), min(value * _DECADE, max(high, value))
            return Control(name, value, _nice(lower, down=True), _nice(upper, down=False), (place,), log=True)
        below, above = (self._end(name, value, sign) for sign in (-1.0, 1.0))
        step = 10.0 ** math.floor(math.log10(0.5 * (above - below)))
        lower, upper = math.floor(below / step + 1e-9) * step, math.ceil(above / step - 1e-9) * step
        lower = lower if self._with(name, lower) is not None else below
        upper = upper if self._with(name, upper) is not None else above
        return Control(
            name, value, _rounded(max(lower, min(low, value))), _rounded(min(upper, max(high, value))), (place,)
        )

    def _with(self, name: str, value: float) -> Law | None:
        """The law with another value of a number, None where the constructor does not take it."""
        try:
            return self.law.with_scalars({name: value})
        except ValueError:
            return None

    def _end(self, name: str, value: float, sign: float) -> float:
        """The slider's end on one side: where the output has changed by about its span."""
        size, reached = abs(value) or 1.0, 0.0
        most, changes = math.inf, [(0.0, 0.0)]
        step = _FIRST * size
        while step <= min(most, _LAST * size):
            other = self._with(name, value + sign * step)
            change = math.inf if other is None else self._change(other)
            if change > _LARGE:
                break
            if change > _SMALL:
                most = min(most, 4.0 * step)
            changes.append((change, step))
            reached, step = step, (4.0 if change < _TINY else 2.0) * step
        if most == math.inf and step > _LAST * size:  # never much: half of what there is
            greatest = max(change for change, _ in changes)
            reached = next(step for change, step in changes if change >= 0.5 * greatest) or size
        if sign < 0.0 < value <= 2.0 * reached and self._with(name, -value) is None:
            return 0.0
        return value + sign * (reached or _FIRST * size)

    def _change(self, other: Law) -> float:
        """Largest change of the output, in its spans."""
        try:
            return float(np.abs(other.response(self.u) - self.y).max()) / self.span
        except SimulationError:
            return math.inf


def _boxes(law: Law, record: Record) -> dict[str, tuple[float, float]]:
    """Sides of the search box for the numbers that are searched as they are."""
    try:
        space = law.search_space(record)
    except ValueError:
        return {}
    own = [name for name in space.coordinates if name in law.scalars]
    with np.errstate(all="ignore"):
        corners = space.parameters(np.stack([space.lower, space.upper]))
    ends = {name: (float(np.min(corners[name])), float(np.max(corners[name]))) for name in own}
    return {name: pair for name, pair in ends.items() if np.isfinite(pair).all()}


def _nice(value: float, *, down: bool) -> float:
    """The next value of one digit."""
    power = 10.0 ** math.floor(math.log10(value))
    digits = value / power
    return _rounded((math.floor(digits + 1e-9) if down else math.ceil(digits - 1e-9)) * power)


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
