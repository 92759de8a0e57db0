"""Units of acceleration, as files of ground motions state them."""

import re

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import shown

STANDARD_GRAVITY = 9.80665
"""The g of files [m/s^2]."""

_SCALES = {
    "g": (STANDARD_GRAVITY, 1.0),
    "mg": (STANDARD_GRAVITY, 1000.0),
    "%g": (STANDARD_GRAVITY, 100.0),
    "m/s2": (1.0, 1.0),
    "cm/s2": (1.0, 100.0),
    "mm/s2": (1.0, 1000.0),
    "gal": (1.0, 100.0),
    "in/s2": (0.0254, 1.0),
    "ft/s2": (0.3048, 1.0),
}
"""Factor and divisor from each unit to m/s^2."""

_KNOWN = 'expected "m/s^2", "cm/s^2", "mm/s^2", "gal", "g", "mg", "in/s^2" or "ft/s^2"'
_PER_SECOND_SQUARED = re.compile(r"(/s/s|/\(?s2\)?|s-2|/\(?ss\)?)$")
_STATED = re.compile(r"\bunits?\b\s*(?:(?:of|are|is|in)\b|[=:])?\s*([^\s,;:=()]+)", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]")
_IN = re.compile(r"\bin\s+([^\s,;:()]+)", re.IGNORECASE)
_ENDS_IN_UNIT = re.compile(r"acc[a-z]*[_ ]+(?:in[_ ]+)?(\S+)", re.IGNORECASE)


def in_si(values: FloatArray, unit: str) -> FloatArray:
    """Accelerations in m/s^2, infinite where too large, from those in a unit; ValueError if it is unknown."""
    name = _name(unit)
    if name is None:
        raise ValueError(f"{shown(unit)} is no known unit of acceleration: {_KNOWN}; pass the file's unit as units=")
    factor, divisor = _SCALES[name]
    with np.errstate(over="ignore"):
        return np.asarray(values * factor / divisor)


def check_unit(unit: str | None) -> None:
    """Raise a ValueError if a unit is given that is none of acceleration."""
    if unit is not None and _name(unit) is None:
        raise ValueError(f"units must be a unit of acceleration: {_KNOWN}, got {unit!r}")


def stated_unit(header: str) -> str | None:
    """The unit that the text above some numbers states, None if it states none; ValueError if it is not understood.

    First the word behind "unit", then what is in brackets or behind "in", then words that can be nothing else, such as
    cm/sec2.
    """
    behind = [match.strip(".") for match in _STATED.findall(header)]
    words = [word.strip("().:") for word in re.split(r"[\s,;]+", header)]
    lone = [word for word in words if (name := _name(word)) and "/s2" in name]
    after_in = [word.strip(".") for word in _IN.findall(header)]
    for candidate in (*behind, *_BRACKETS.findall(header), *after_in, *lone):
        if _name(candidate):
            return str(candidate)
    if behind:
        raise ValueError(f"the header states the unit {shown(behind[0])}, which is unknown: pass units=, {_KNOWN}")
    return None


def unit_of_column(label: str, unit: str) -> str:
    """The unit of a column, m/s^2 if its header states none; ValueError if the name may end in a unit."""
    if unit:
        return unit
    end = _ENDS_IN_UNIT.fullmatch(label.strip())
    if end and (name := _name(end[1])) and name != "m/s2":
        raise ValueError(f'column {shown(label)} may be in {end[1]}: pass units="{end[1]}", or units="m/s^2"')
    return "m/s^2"


def _name(unit: str) -> str | None:
    """The key of a unit in the table of scales, whatever its spelling."""
    text = unit.strip().lower().replace("²", "2").replace("**", "").replace("^", "").replace("'", "")
    text = re.sub(r"sec(ond)?s?", "s", re.sub(r"[\s*·.]+", "", text))
    text = {"gs": "g", "gals": "gal"}.get(text, text)
    text = _PER_SECOND_SQUARED.sub("/s2", text)
    return text if text in _SCALES else None
