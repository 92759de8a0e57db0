"""Parts of an actuator that records may not determine, and what is assumed then.

A parameter counts as not determined if its standard error is larger than its use: 1 % a decade of creep (or half of
it), a quarter of a frequency, two samples of a delay (or all of it). It is held where its part has no effect; a mode
is left out.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hysim.models.protocols import Doubt
from hysim.models.search_space import Freedom
from hysim.plants.whole.linear_parts import DAMPING, FREQUENCY, GAIN

_PERCENT, _WEIGHT, _SLOPE = 1.0, 0.05, 0.7
_SHARE_OF_FREQUENCY = 0.25
_GAIN = 0.5
_USUAL_DAMPING = 0.02
_SAMPLES = 2.0  # of delay
_NEAR = 1e-6  # relative distance of a bound


def doubts(structure: Any, estimates: Mapping[str, float], freedom: Freedom) -> list[Doubt]:
    """The parameters of the parts beside the law that the user does not name; at a bound only some of them."""
    named = {*freedom.fixed, *freedom.free, *freedom.bounds, *structure.known}
    ends = {
        f"{part}.{each.name}": (each.lower, each.upper)
        for part, (box, _) in structure.parts([]).boxes().items()
        for each in box
    }
    found = []
    for name, (low, high) in ends.items():
        value = estimates[name]
        doubt = None if name in named else _doubt(structure, name, value, freedom)
        at_end = value <= low * (1.0 + _NEAR) or value >= high * (1.0 - _NEAR)
        if doubt is not None and (not at_end or FREQUENCY in name or value == 0.0):
            found.append(doubt)
    return found


def without_last_mode(structure: Any, freedom: Freedom) -> tuple[Any, str] | None:
    """The structure with one mode less, and a remark; None where the user names its parameters, or the modes."""
    k = structure.modes - 1
    gains = [structure.parts([]).gain_of(k, name) for name in structure.inputs]
    own = {f"vibration.{name}" for name in (f"{FREQUENCY}[{k}]", f"{DAMPING}[{k}]", *gains)}
    if k < 0 or structure.start is not None or own & {*freedom.fixed, *freedom.free, *freedom.bounds}:
        return None
    box = {each.name: each for each in structure.parts([]).boxes()["vibration"][0]}[f"{FREQUENCY}[{k}]"]
    low, high = box.lower / (2.0 * math.pi), box.upper / (2.0 * math.pi)
    which = "mode" if not k else "further mode"
    remark = f"the records show no {which} between {low:.3g} and {high:.3g} Hz: it is left out"
    known = {name: value for name, value in structure.known.items() if name not in own}
    return replace(structure, modes=k, known=known, remarks=(*structure.remarks, remark)), remark


def _doubt(structure: Any, name: str, value: float, freedom: Freedom) -> Doubt | None:
    """A reason to doubt one parameter, and the structure without it."""

    def held(at: float, why: str, unit: str = "") -> Any:
        remark = f"the records do not tell {why}: {name} is held at {at:g}{unit}"
        return replace(structure, known={**structure.known, name: at}, remarks=(*structure.remarks, remark))

    if name == "creep.percent":
        return Doubt(name, max(_PERCENT, 0.5 * abs(value)), held(0.0, "creep from the law"))
    if name == "creep.slope":
        return Doubt(name, _SLOPE, held(0.0, "how the creep changes from decade to decade"))
    if name.startswith("creep.weights"):
        return Doubt(name, max(_WEIGHT, abs(value)), held(0.0, "this element from the others and the law"))
    if name == "vibration.delay":
        largest = max(_SAMPLES * structure.survey.shortest, value)
        return Doubt(name, largest, held(0.0, "a delay from a mode", " s"))
    if name == "amplifier.time_constant":
        remark = "the records do not show the time constant of the amplifier: it is left out"
        smaller = replace(structure, amplifier=None, remarks=(*structure.remarks, remark))
        return Doubt(name, value, smaller)
    if DAMPING in name:
        return Doubt(name, value + _USUAL_DAMPING, held(_USUAL_DAMPING, "the damping of a mode"))
    if GAIN in name and len(structure.inputs) > 1:  # an input may well leave a mode at rest
        return None
    less = without_last_mode(structure, freedom)
    largest = _SHARE_OF_FREQUENCY * value if FREQUENCY in name else _GAIN
    return None if less is None else Doubt(name, largest, less[0])
