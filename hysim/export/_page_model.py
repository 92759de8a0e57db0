"""Models as pages compute them, laws by their modules, sums and cascades of them; and sliders for their numbers.

A slider covers the values that change the output by about its own span on the page's input, inside the search box of
the law and where the constructor takes them. A number of which only positive values are allowed has a logarithmic one.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from inspect import getdoc
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.export._c import plain
from hysim.export._compilers import Kernels, kernels_of, module_of
from hysim.export._packing import packing
from hysim.kernels import clamps, energy_plays, play_sums
from hysim.laws.dashpot import RatePart
from hysim.laws.friction.rated_law import RatedLaw
from hysim.laws.operators.rate_dependent_prandtl_ishlinskii import RateDependentPrandtlIshlinskii
from hysim.laws.static import SingleValued
from hysim.models.cascade import Cascade
from hysim.models.law import Law
from hysim.models.sum import Sum
from hysim.records import Record

_MOST = 3  # elements of a tuple that have a slider each; longer ones have one for all
_FIRST, _LAST = 1e-5, 1e3  # changes of a number that are tried, in sizes of itself
_TINY, _SMALL, _LARGE = 0.02, 0.25, 1.0  # changes of the output, in its spans
FEW = 100  # samples of the input on which changes are computed
_DECADE = 10.0
_FACTOR = 4.0  # of a slider that scales a tuple
_CLOCK = "sample_time"


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
        described = {"name": prefix + self.name, "value": self.value, "lower": self.lower, "upper": self.upper}
        flags = {name: True for name, is_on in (("log", self.log), ("scale", self.scale)) if is_on}
        return {**described, **flags, "places": [first + place for place in self.places]}


def controls_of(law: Law, free: tuple[str, ...], u: FloatArray, names: Sequence[str] | None = None) -> list[Control]:
    """A slider for each number in `free`: long tuples share one, initial tuples have none; `names` says the places."""
    names = list(law.scalars) if names is None else names
    groups: dict[str, list[str]] = {}
    for name in free:
        groups.setdefault(name.partition("[")[0], []).append(name)
    reach = _Reach(law, u)
    controls: list[Control] = []
    for base, members in groups.items():
        places = tuple(names.index(name) for name in members)
        is_tuple = "[" in members[0]
        if is_tuple and (base in law.initial or base in ("levels", "dead_zones")):
            continue
        if is_tuple and len(members) > _MOST and base not in ("left", "right"):
            if any(law.scalars[name] for name in members):
                controls.append(Control(f"{base} ×", 1.0, 1.0 / _FACTOR, _FACTOR, places, log=True, scale=True))
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


@dataclass
class Parts:
    """Modules, packing functions, numbers and sliders of a page's models; `sample_time` [s] is that of their input."""

    modules: dict[str, bytes] = field(default_factory=dict)
    packs: list[str] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    controls: list[dict[str, Any]] = field(default_factory=list)
    timed: bool = False
    sample_time: float = 1.0


def node_of(thing: Any, u: FloatArray, parts: Parts, prefix: str = "") -> dict[str, Any]:
    """A model as the page takes it, its contents put into `parts`; TypeError if it consists of other than laws."""
    if isinstance(thing, Sum):
        return {"sum": _members(thing.parts, u, parts, prefix)}
    if isinstance(thing, Cascade):
        return {"cascade": _members(thing.stages, u, parts, prefix)}
    first = len(parts.values)
    if isinstance(thing, SingleValued):
        return {"knots": [thing.u.tolist(), thing.y.tolist()], "name": "hs.SingleValued", "fields": []}
    if isinstance(thing, RatePart):
        return _of_rate(thing, parts, prefix)
    if isinstance(thing, RatedLaw):
        return _rated(thing, u, parts, prefix)
    if isinstance(thing, RateDependentPrandtlIshlinskii):
        return _at_sample_time(thing, u, parts, prefix)
    if not isinstance(thing, Law):
        raise TypeError(
            f"a page takes a law, or a sum or cascade of laws, got {type(thing).__name__}: plants and controllers "
            "are exported by hysim.to_c and hysim.to_fmu"
        )
    node = _law(thing, parts, first)
    names = list(thing.scalars)
    free = tuple(names[place] for place in node["free"])
    parts.controls += [control.to_json(first, prefix) for control in controls_of(thing, free, u)]
    return node


def _members(members: tuple[Any, ...], u: FloatArray, parts: Parts, prefix: str) -> list[dict[str, Any]]:
    """The parts of a sum or the stages of a cascade; their sliders are named by them."""
    names = [type(member).__name__ for member in members]
    return [
        node_of(member, u, parts, f"{prefix}{name}{f' {k + 1}' if names.count(name) > 1 else ''}: ")
        for k, (member, name) in enumerate(zip(members, names, strict=True))
    ]


def _law(law: Law, parts: Parts, first: int) -> dict[str, Any]:
    general = _general(law)
    packed = packing(general)
    kernels, state = kernels_of(general), general.startable().state
    if kernels.name not in parts.modules:
        parts.modules[kernels.name] = module_of(kernels)
    parts.packs.append(packed.to_js(f"pack{len(parts.packs)}"))
    names = list(law.scalars)
    parts.values += [float(value) for value in law.scalars.values()]
    return {
        "kind": type(law).__name__,
        "name": _name(type(law)),
        "module": kernels.name,
        "pack": len(parts.packs) - 1,
        "sizes": [len(packed.parameters), len(packed.memory)],
        "work": state.size - len(packed.memory),
        "first": first,
        "free": [names.index(name) for name in packed.fields],
        "output": output_of(type(law)),
        **({} if law.u0 is None else {"u0": law.u0}),
        **_plays(law, kernels.step),
        **_printed(law, first),
    }


def _plays(law: Law, step: Callable[..., float]) -> dict[str, Any]:
    """Place of the first threshold of plays, before their weights; `cone`: plays lie between u - r and u + r."""
    coefficients = int(law.packed[0][0]) if step is plain(clamps.bent_step) else 0
    first = {
        plain(clamps.step): clamps.N_OUTPUT,
        plain(clamps.bent_step): clamps.N_BENT + coefficients,
        plain(energy_plays.step): energy_plays.N_HEAD,
        plain(play_sums.step): play_sums.N_HEAD,
    }.get(step)
    return {} if first is None else {"plays": first, "cone": step is not plain(play_sums.step)}


def steps_of(thing: Any) -> list[Kernels]:
    if isinstance(thing, (Sum, Cascade)):
        members = thing.parts if isinstance(thing, Sum) else thing.stages
        return [kernels for member in members for kernels in steps_of(member)]
    if isinstance(thing, RateDependentPrandtlIshlinskii):
        thing = thing.at(1.0)
    law = thing.at_sample_time(1.0) if isinstance(thing, RatedLaw) else thing
    return [kernels_of(_general(law))] if isinstance(law, Law) else []


def _general(law: Law) -> Law:
    """The law with the step that takes every value of its numbers: one with another exponent than 1 and 2."""
    for name in law.structural:
        try:
            other = law.with_scalars({name: law.scalars[name] + 0.5})
        except ValueError:
            continue
        law = law if name in other.structural else other
    return law


def _printed(law: Law, first: int) -> dict[str, Any]:
    """Fields by the places of their numbers, and the values that need not be said; or the law to begin with."""
    names, defaults = list(law.scalars), law.defaults()
    if not by_fields(law):
        return {"fields": [], "base": _in_python(law), "named": [[name, first + k] for k, name in enumerate(names)]}
    fields: list[list[Any]] = []
    for name, value in law.arguments.items():
        places = [first + names.index(f"{name}[{k}]") for k in range(len(value))] if isinstance(value, tuple) else None
        fields.append([name, first + names.index(name) if places is None else places, defaults.get(name)])
    return {"fields": fields}


def _in_python(law: Law) -> str:
    plain = {name: np.asarray(value).tolist() for name, value in law.arguments.items()}
    return f"{_name(type(law))}({', '.join(f'{name}={value!r}' for name, value in plain.items())})"


def _at_sample_time(law: RateDependentPrandtlIshlinskii, u: FloatArray, parts: Parts, prefix: str) -> dict[str, Any]:
    """Plays whose widening is divided by the page's sample time."""
    first, parts.timed = len(parts.values), True
    node = _law(law.at(1.0), parts, first)
    names = list(law.at(1.0).scalars)
    place = names.index("width")
    others = tuple(name for name in names if name in law.plays.scalars)
    parts.controls += [control.to_json(first, prefix) for control in controls_of(law.plays, others, u, names)]
    size = 4.0 * law.beta or 0.1
    parts.controls.append(Control("beta", law.beta, 0.0, size, (place,)).to_json(first, prefix))
    fields = [["beta" if name == "width" else name, *rest] for name, *rest in node["fields"]]
    names_of = {"kind": type(law).__name__, "name": _name(type(law)), "output": output_of(type(law))}
    return {**node, **names_of, "fields": fields, "per_time": [place]}


def _of_rate(part: RatePart, parts: Parts, prefix: str) -> dict[str, Any]:
    """A part that is a power of the velocity of the input, times a coefficient."""
    first, parts.timed = len(parts.values), True
    parts.values.append(part.c)
    size = 2.0 * abs(part.c) or 1.0
    parts.controls.append(Control("c", part.c, -size, size, (0,)).to_json(first, prefix))
    words = {"name": _name(type(part)), "fields": [["c", first, 1.0]], "output": output_of(type(part))}
    return {"rate": first, "power": part.power, **words}


def _rated(law: RatedLaw, u: FloatArray, parts: Parts, prefix: str) -> dict[str, Any]:
    """A law that depends on the rate of its input, whose first number is the page's sample time."""
    first, parts.timed = len(parts.values), True
    coarse = u[:: max(1, len(u) // FEW)]
    timed = law.at_sample_time(parts.sample_time * (len(u) - 1) / (len(coarse) - 1))
    node = _law(timed, parts, first)
    names = list(timed.scalars)
    free = tuple(names[place] for place in node["free"] if names[place] != _CLOCK)
    parts.controls += [control.to_json(first, prefix) for control in controls_of(timed, free, coarse)]
    fields = [each for each in node["fields"] if each[0] != _CLOCK]
    words = {"kind": type(law).__name__, "name": _name(type(law)), "output": output_of(type(law))}
    return {**node, **words, "fields": fields, "clock": names.index(_CLOCK)}


def _name(family: type) -> str:
    return f"hs.{family.__name__}" if family.__module__.startswith("hysim.") else family.__name__


# ---------------------------------------------------------------------------------- words


def about(thing: Any) -> tuple[str, str]:
    if isinstance(thing, (Sum, Cascade)):
        members = thing.parts if isinstance(thing, Sum) else thing.stages
        word = "Sum" if isinstance(thing, Sum) else "Cascade"
        return f"{word} of {', '.join(escape(type(each).__name__) for each in members)}.", ""
    text = getdoc(type(thing)) or ""
    summary = escape(text.split("\n\n")[0].replace("\n", " "), quote=False)
    block = re.search(r"::\n\n((?:    .*\n|\n)+)", text.split("\nParameters\n")[0] + "\n")
    equation = "" if block is None else "\n".join(line[4:] for line in block.group(1).strip("\n").split("\n"))
    return re.sub(r"``?([^`]+)``?", r"<code>\1</code>", summary), equation


def output_of(family: type) -> str:
    """Right side of the equation of y in the docstring of a family; empty if it has none."""
    text = (getdoc(family) or "").split("\nParameters\n")[0]
    found = re.search(r"\b[yFT] *= ((?:offset|c (?:u'|sign)).*?)(?=``|,\s| {3}|\n|$)", text)
    return "" if found is None else found.group(1)


def heading(thing: Any) -> str:
    if isinstance(thing, (Sum, Cascade)):
        return about(thing)[0].rstrip(".")
    words = re.split(r"[,;:.`]", getdoc(type(thing)) or "")[0].strip()
    return words or type(thing).__name__


def plane_of(node: Mapping[str, Any]) -> dict[str, Any] | None:
    """Places of the levels of a law of relays, and of the weights of all pairs of intervals between them."""
    places = {name: place for name, place, *_ in node.get("fields", ()) if name in ("levels", "weights")}
    if not all(isinstance(place, list) for place in places.values()) or len(places) < 2:
        return None
    n_intervals = len(places["levels"]) - 1
    return places if len(places["weights"]) == n_intervals * (n_intervals + 1) // 2 else None
