"""Units with SI prefixes: micrometres are 1e-6 metres; and the words that a unit stands for on an axis."""

import re
from collections.abc import Mapping

_POWERS = {
    "": 0, "y": -24, "z": -21, "a": -18, "f": -15, "p": -12, "n": -9, "u": -6, "\u00b5": -6, "\u03bc": -6, "m": -3,
    "c": -2, "d": -1, "da": 1, "h": 2, "k": 3, "M": 6, "G": 9, "T": 12, "P": 15, "E": 18, "Z": 21, "Y": 24,
}  # fmt: skip
_BASES = frozenset(
    {"m", "g", "s", "A", "K", "V", "N", "Pa", "Hz", "rad", "W", "J", "C", "F", "T", "H", "Wb", "ohm", "\u03a9", "L"}
)


def power_of_ten(old: str, new: str) -> int:
    """The power of ten that converts a value from the old unit to the new one; ValueError if only a prefix cannot."""
    if old == new:  # whatever it is
        return 0
    (before, base), (after, other) = prefixed(old), prefixed(new)
    if base != other:
        raise ValueError(f"{old!r} cannot become {new!r}: only the prefix of a unit can change")
    return before - after


def prefixed(unit: str) -> tuple[int, str]:
    """The power of a unit's prefix, and its base: m is a metre, mm a thousandth of it; ValueError if it is unknown.

    Of a quotient, such as mm/s^2, the prefix above counts.
    """
    if "/" in unit:
        above, slash, below = unit.partition("/")
        power, base = prefixed(above)
        return power, base + slash + below
    for prefix, power in _POWERS.items():
        if unit.startswith(prefix) and unit[len(prefix) :] in _BASES:
            return power, unit[len(prefix) :]
    raise ValueError(f"{unit!r} is not a known unit with an SI prefix: scale the values, or pass other units")


def is_known(unit: str) -> bool:
    """Whether `prefixed` knows the unit."""
    try:
        return bool(prefixed(unit))
    except ValueError:
        return False


# ---------------------------------------------------------------------------------- axes

_QUANTITIES = {
    **dict.fromkeys(("V", "mV", "kV"), "Voltage"),
    **dict.fromkeys(("nm", "um", "µm", "mm", "m"), "Displacement"),
    **dict.fromkeys(("mN", "N", "kN"), "Force"),
    **dict.fromkeys(("mm/s^2", "cm/s^2", "m/s^2"), "Acceleration"),
    **dict.fromkeys(("us", "µs", "ms", "s"), "Time"),
}
_NAMES = {"t": "Time", "u": "Input", "y": "Output", "z": "Memory z"}


def label(units: Mapping[str, str], signal: str) -> str:
    """`Voltage [V]` for ``{"u": "V"}`` and ``"u"``; `Input` if the unit is unknown."""
    if signal not in units:
        return _NAMES[signal]
    unit = units[signal]
    quantity = _NAMES[signal] if signal == "z" else _QUANTITIES.get(unit, _NAMES[signal])
    return f"{quantity} [{printed(unit)}]"


def in_unit(name: str, unit: str) -> str:
    """`Loop width [µm]` for a name and a unit; the name alone without a unit."""
    return f"{name} [{printed(unit)}]" if unit else name


def in_brackets(unit: str) -> str:
    """A unit as a part of another one: ``(mm/s)`` for ``mm/s``, which would be ambiguous after a stroke."""
    return f"({unit})" if re.search(r"[/ *·]", unit) and not unit.startswith("(") else unit


def printed(unit: str) -> str:
    """A unit with its micro sign and its square: `µm` for ``"um"``, `m/s²` for ``"m/s^2"``."""
    return re.sub(r"\bu(?=(m|s|V|A|N)\b)", "µ", unit.replace("\u03bc", "µ")).replace("^2", "²")
