"""Units of variables: labels of quotients, and what a label is in base units of the SI."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from hysim._prefixes import prefixed

BASE_UNITS = ("kg", "m", "s", "A", "K", "rad")
_EXPONENTS = MappingProxyType(
    {
        "m": (0, 1), "g": (1,), "s": (0, 0, 1), "A": (0, 0, 0, 1), "K": (0, 0, 0, 0, 1), "rad": (0, 0, 0, 0, 0, 1),
        "N": (1, 1, -2), "Pa": (1, -1, -2), "Hz": (0, 0, -1), "W": (1, 2, -3), "J": (1, 2, -2), "L": (0, 3),
        "V": (1, 2, -3, -1), "C": (0, 0, 1, 1), "F": (-1, -2, 4, 2), "T": (1, 0, -2, -1), "H": (1, 2, -2, -2),
        "Wb": (1, 2, -2, -1), "ohm": (1, 2, -3, -2), "\u03a9": (1, 2, -3, -2),
    }
)  # fmt: skip
_POWERS = MappingProxyType({"g": -3, "L": -3})  # of ten, in base units
_SIGNALS = MappingProxyType({"reference": "y", "measurement": "y", "command": "u", "h": "u"})


class BaseUnit(NamedTuple):
    """Exponents of `BASE_UNITS`, and the power of ten with which a value becomes one in them."""

    exponents: tuple[int, ...]
    power: int


def label(unit: str, units: Mapping[str, str]) -> str:
    """The label of a unit such as ``"y/u"`` for the labels of u, y and t; empty where one of them is unknown.

    ``"1"`` and ``"s"`` stand for themselves, ``"h"`` for half the span of an input.

    >>> label("y/u", {"u": "V", "y": "um"}), label("y", {}), label("1/u", {"u": "m/s"})
    ('um/V', '', '1/(m/s)')
    """
    parts = unit.split("/")
    names = [part if part in ("1", "s") else units.get(_SIGNALS.get(part, part), "") for part in parts]
    if not all(names):
        return ""
    return "/".join([names[0], *(f"({name})" if "/" in name else name for name in names[1:])])


def base_unit(unit: str) -> BaseUnit | None:
    """A label such as ``um/V`` in base units, None where it is not understood.

    >>> base_unit("um/V")
    BaseUnit(exponents=(-1, -1, 3, 1, 0, 0), power=-6)
    >>> base_unit("px") is None
    True
    """
    exponents, power = [0] * len(BASE_UNITS), 0
    for k, part in enumerate(unit.split("/")):
        if part == "1":
            continue
        try:
            prefix, base = prefixed(part)
        except ValueError:
            return None
        sign = -1 if k else 1
        power += sign * (prefix + _POWERS.get(base, 0))
        for place, exponent in enumerate(_EXPONENTS[base]):
            exponents[place] += sign * exponent
    return BaseUnit(tuple(exponents), power)
