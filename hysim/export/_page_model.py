"""Models as pages compute them, laws by their modules, sums and cascades of them; and sliders for their numbers.

A slider covers the values that change the output by about its own span on the page's input, inside the search box of
the law and where the constructor takes them. A number of which only positive values are allowed has a logarithmic one.
"""

import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from inspect import getdoc
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.export._c import plain
from hysim.export._compilers import Kernels, kernels_of, module_of
from hysim.export._packing import packing
from hysim.kernels import clamps, energy_plays, play_sums
from hysim.laws.friction.rated_law import TimedLaw
from hysim.laws.static import SingleValued
from hysim.models.law import Law
from hysim.models.sum import Composite
from hysim.records import Record

_MOST = 3  # elements of a tuple that have a slider each; longer ones have one for all
_FIRST, _LAST = 1e-5, 1e3  # changes of a number that are tried, in sizes of itself
_TINY, _SMALL, _LARGE = 0.02, 0.25, 1.0  # changes of the output, in its spans
FEW = 100  # samples of the input on which changes are computed
_DECADE = 10.0
_FACTOR = 4.0  # of a slider that scales a tuple
_CUTS = 50  # of the way to an end that the constructor refuses, by a tenth each
_CLOCK = "sample_time"


def slider(name: str, value: float, lower: float, upper: float, **rest: Any) -> dict[str, Any]:
    """A slider as the page takes it, for the numbers at its `places`; one with `scale` multiplies them."""
    return {"name": name, "value": value, "lower": lower, "upper": upper, **rest}


def sliders_of(law: Law, free: Sequence[str], u: FloatArray, names: Sequence[str]) -> list[dict[str, Any]]:
    """A slider for each number in `free`, one for a long tuple, not for initial tuples; `names` says the places."""
    reach = _Reach(law, u)
    sliders: list[dict[str, Any]] = []
    for base, group in itertools.groupby(free, lambda name: name.partition("[")[0]):
        members = list(group)
        places = [names.index(name) for name in members]
        if "[" in members[0] and (base in law.initial or base in ("levels", "dead_zones")):
            continue
        if len(members) <= _MOST or base in ("left", "right"):
            sliders += [reach.slider_of(name, place) for name, place in zip(members, places, strict=True)]
        elif any(law.scalars[name] for name in members):
            sliders.append(slider(f"{base} ×", 1.0, 1.0 / _FACTOR, _FACTOR, log=True, scale=True, places=places))
    return sliders


class _Reach:
    """How far the numbers of a law can be moved on an input."""

    def __init__(self, law: Law, u: FloatArray) -> None:
        self.law, self.u, self.y = law, u, law.response(u)
        self.span = float(np.ptp(self.y)) or 1.0
        self.boxes = _boxes(law, Record(u=u, y=self.y))

    def slider_of(self, name: str, place: int) -> dict[str, Any]:
        value = self.law.scalars[name]
        low, high = self.boxes.get(name, (-math.inf, math.inf))
        kind = {"log": True} if value > 0.0 and self._with(name, 0.0) is None else {}
        if kind:
            lower, upper = max(value / _DECADE, min(low, value)), min(value * _DECADE, max(high, value))
            ends = _nice(lower, down=True), _nice(upper, down=False)
        else:
            below, above = (self._end(name, value, sign) for sign in (-1.0, 1.0))
            step = 10.0 ** math.floor(math.log10(0.5 * (above - below)))
            lower, upper = math.floor(below / step + 1e-9) * step, math.ceil(above / step - 1e-9) * step
            ends = max(lower, min(low, value)), min(upper, max(high, value))
        return slider(name, value, *(self._accepted(name, value, end) for end in ends), **kind, places=[place])

    def _accepted(self, name: str, value: float, end: float) -> float:
        """An end of a slider, closer to the value where the constructor refuses it."""
        ends = (rounded(value + (end - value) * 0.9**k) for k in range(_CUTS))
        return next((each for each in ends if self._with(name, each) is not None), value)

    def _with(self, name: str, value: float) -> Law | None:
        """The law with another value of a number, None where the constructor does not take it."""
        try:
            return self.law.with_scalars({name: value})
        except ValueError:
            return None

    def _end(self, name: str, value: float, sign: float) -> float:
        """The slider's end on one side: where the output has changed by about its span."""
        size, most, changes = abs(value) or 1.0, math.inf, [(0.0, 0.0)]
        step = _FIRST * size
        while step <= min(most, _LAST * size):
            change = self._change(name, value + sign * step)
            if change > _LARGE:
                break
            if change > _SMALL:
                most = min(most, 4.0 * step)
            changes.append((change, step))
            step *= 4.0 if change < _TINY else 2.0
        reached = changes[-1][1]
        if most == math.inf and step > _LAST * size:  # never much: half of what there is
            greatest = max(change for change, _ in changes)
            reached = next(step for change, step in changes if change >= 0.5 * greatest) or size
        if sign < 0.0 < value <= 2.0 * reached and self._with(name, -value) is None:
            return 0.0
        return value + sign * (reached or _FIRST * size)

    def _change(self, name: str, value: float) -> float:
        """Largest change of the output by another value of a number, in its spans; infinite if no output exists."""
        other = self._with(name, value)
        if other is None:
            return math.inf
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
    return rounded((math.floor(digits + 1e-9) if down else math.ceil(digits - 1e-9)) * power)


def rounded(value: float, digits: int = 6) -> float:
    return float(f"{value:.{digits}g}")


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
    if isinstance(thing, Composite):
        names = [type(member).__name__ for member in thing.members]
        named = [f"{name} {k}" if names.count(name) > 1 else name for k, name in enumerate(names, 1)]
        members = zip(thing.members, named, strict=True)
        return {type(thing).__name__.lower(): [node_of(each, u, parts, f"{prefix}{name}: ") for each, name in members]}
    if isinstance(thing, SingleValued):
        return {"knots": [thing.u.tolist(), thing.y.tolist()], "name": "hs.SingleValued", "fields": []}
    first = len(parts.values)
    node, sliders = _law(thing, u, parts)
    for each in sliders:
        places = [first + place for place in each["places"]]
        parts.controls.append({**each, "name": prefix + each["name"], "places": places})
    return node


def _law(thing: Any, u: FloatArray, parts: Parts) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """A law and its sliders; its step is for a sample time of the page where it depends on the rate of its input."""
    coarse = u[:: max(1, len(u) // FEW)]
    law = _at(thing, parts.sample_time * (len(u) - 1) / (len(coarse) - 1))
    if not isinstance(law, Law):
        others = "plants and controllers are exported by hysim.to_c and hysim.to_fmu"
        advice = f"{others}; a law with channels is shown as .at(T=...)"
        raise TypeError(f"a page takes a law, or a sum or cascade of laws, got {type(thing).__name__}: {advice}")
    node, names = _node(law, type(thing), parts), list(law.scalars)
    if isinstance(thing, TimedLaw):
        parts.timed = True
        node["fields"] = [each for each in node["fields"] if each[0] != _CLOCK]
        node["clock"] = names.index(_CLOCK)
    free = [names[place] for place in node["free"] if names[place] != _CLOCK]
    return node, sliders_of(law, free, coarse, names)


def _at(thing: Any, sample_time: float) -> Any:
    """A law that depends on the rate of its input, at a sample time; other laws unchanged."""
    return thing.at_sample_time(sample_time) if isinstance(thing, TimedLaw) else thing


def _node(law: Law, family: type, parts: Parts) -> dict[str, Any]:
    general, first = _general(law), len(parts.values)
    packed, kernels, names = packing(general), kernels_of(general), list(law.scalars)
    if kernels.name not in parts.modules:
        parts.modules[kernels.name] = module_of(kernels)
    parts.packs.append(packed.to_js(f"pack{len(parts.packs)}"))
    parts.values += [float(value) for value in law.scalars.values()]
    n_memory = len(packed.memory)
    names_of = {"kind": family.__name__, "name": _name(family), "module": kernels.name}
    node: dict[str, Any] = {**names_of, "pack": len(parts.packs) - 1, "sizes": [len(packed.parameters), n_memory]}
    node |= {"work": general.startable().state.size - n_memory, "first": first}
    node |= {"free": [names.index(name) for name in packed.fields], "output": output_of(family)}
    node |= {} if law.u0 is None else {"u0": law.u0}
    return node | _plays(law, kernels.step) | _printed(law, first)


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
    if isinstance(thing, Composite):
        return [kernels for member in thing.members for kernels in steps_of(member)]
    law = _at(thing, 1.0)
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
    if not {name.partition("[")[0] for name in names} <= set(law.arguments):
        plain = {name: np.asarray(value).tolist() for name, value in law.arguments.items()}
        base = f"{_name(type(law))}({', '.join(f'{name}={value!r}' for name, value in plain.items())})"
        return {"fields": [], "base": base, "named": [[name, first + k] for k, name in enumerate(names)]}
    fields = []
    for name, value in law.arguments.items():
        places = [first + k for k, each in enumerate(names) if each.partition("[")[0] == name]
        fields.append([name, places if isinstance(value, tuple) else places[0], defaults.get(name)])
    return {"fields": fields}


def _name(family: type) -> str:
    return f"hs.{family.__name__}" if family.__module__.startswith("hysim.") else family.__name__


# ---------------------------------------------------------------------------------- words


def about(thing: Any) -> tuple[str, str]:
    if isinstance(thing, Composite):
        return f"{type(thing).__name__} of {', '.join(escape(type(each).__name__) for each in thing.members)}.", ""
    text = getdoc(type(thing)) or ""
    summary = escape(text.split("\n\n")[0].replace("\n", " "), quote=False)
    block = re.search(r"::\n\n((?:    .*\n|\n)+)", text.split("\nParameters\n")[0] + "\n")
    equation = "" if block is None else "\n".join(line[4:] for line in block.group(1).strip("\n").split("\n"))
    return re.sub(r"``?([^`]+)``?", r"<code>\1</code>", summary), equation


def output_of(family: type) -> str:
    """Right side of the equation of y in the docstring of a family; empty without such an equation."""
    text = (getdoc(family) or "").split("\nParameters\n")[0]
    match = re.search(r"\b[yFT] *= ((?:offset|c (?:u'|sign)).*?)(?=``|,\s| {3}|\n|$)", text)
    return "" if match is None else match.group(1)


def heading(thing: Any) -> str:
    if isinstance(thing, Composite):
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
