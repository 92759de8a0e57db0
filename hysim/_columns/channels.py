"""Channels of a record, such as a temperature or a supply: one number for the record, or one for each sample."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only

Channels = Mapping[str, Any]
"""Names to a number, or to an array of shape (n,)."""

_SIGNALS = ("t", "u", "y")


def checked_channels(channels: Channels, n: int) -> dict[str, Any]:
    """Channels of a record of `n` samples as floats and read-only arrays (n,); ValueError or TypeError for others."""
    return {name: _values(name, values, n) for name, values in channels.items() if _checked_name(name)}


def _checked_name(name: Any) -> bool:
    if not isinstance(name, str) or not name.strip() or name in _SIGNALS:
        raise ValueError(f'a channel needs a name other than "t", "u" and "y", got {name!r}')
    return True


def _values(name: str, values: Any, n: int) -> Any:
    array = read_only(values, f"channel {name!r}", finite=np.ndim(values) > 0)
    if not np.isfinite(array).all():
        raise ValueError(f"channel {name!r} must be finite, got {float(array)}")
    if array.ndim > 1 or (array.ndim == 1 and array.size != n):
        raise ValueError(f"channel {name!r} must be one number, or {n} as u has, got shape {array.shape}")
    return array if array.ndim else float(array)


def along(channels: Channels) -> dict[str, FloatArray]:
    return {name: values for name, values in channels.items() if isinstance(values, np.ndarray)}


def taken(channels: Channels, samples: slice | npt.NDArray[np.intp]) -> dict[str, Any]:
    return {**channels, **{name: values[samples] for name, values in along(channels).items()}}


def steady(values: Any) -> Any:
    """The number of a channel whose values are all the same; else the array."""
    if isinstance(values, np.ndarray) and values.size and (values == values[0]).all():
        return float(values[0])
    return values


def value_in(channels: Channels, name: str, owner: str) -> Any:
    """A channel's number, or its array where it varies; ValueError naming the `owner` if it is not there."""
    if name not in channels:
        known = ", ".join(map(repr, channels)) or "none"
        raise ValueError(f"{owner} has no channel {name!r}; it has {known}: give channels={{{name!r}: ...}}")
    return steady(channels[name])


def label(value: float, others: Iterable[float]) -> str:
    """A number in the fewest digits, at least four, that tell it from the others."""
    different = [each for each in others if each != value]
    digits = 4
    while digits < 17 and any(f"{each:.{digits}g}" == f"{value:.{digits}g}" for each in different):
        digits += 1
    return f"{value + 0.0:.{digits}g}"
