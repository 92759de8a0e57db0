"""Columns with names, whose numbers are read when they are chosen: common to all formats."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from hysim._frozen import FloatArray
from hysim._names import nearest as nearest_of

_LONGEST_REASON = 200  # letters


class Column(NamedTuple):
    """A column's place in its file, its name, and its unit or an empty string."""

    place: Any
    label: str
    unit: str


@dataclass(frozen=True)
class Notes:
    """Units, resolution, name and channels of a record, as a file states them.

    `channels` are names to columns, or to the numbers of those that are constant.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    resolution: float | None = None
    name: str | None = None
    channels: Mapping[str, str | float] = field(default_factory=dict)


class Table(Protocol):
    """Columns of a file."""

    @property
    def notes(self) -> Notes:
        """Units, resolution and name that the file states."""

    @property
    def labels(self) -> Sequence[str]:
        """Names of the columns."""

    def column(self, key: str | int) -> Column:
        """The column of this name or number; ValueError if there is none, or more than one."""

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""

    def place(self, sample: int) -> str:
        """Place of the sample in the file: "line 12"."""


class UnreadableError(ValueError):
    """A file that cannot be read, with a message that needs no further explanation."""


def require(condition: object, message: str) -> None:
    """Raise an `UnreadableError` with this message if the condition is false."""
    if not condition:
        raise UnreadableError(message)


@contextmanager
def damaged(form: str) -> Iterator[None]:
    """Turn every error into an `UnreadableError`: readers of damaged files raise errors of all kinds."""
    try:
        yield
    except UnreadableError:
        raise
    except MemoryError:
        raise UnreadableError(f"the {form} file needs more memory than there is") from None
    except Exception as error:
        reason = f"{type(error).__name__} {error}"[:_LONGEST_REASON].strip()
        raise UnreadableError(f"the {form} file is damaged: {reason}") from None


def number_of(key: str, kind: str, *names: Sequence[str]) -> int | None:
    """Number of the one column with this name, from the first list of names that has it; None if there is none.

    If there are several in a list, a ValueError calls them by the plural `kind`.
    """
    for labels in names:
        matches = [k for k, label in enumerate(labels) if label == key]
        if len(matches) > 1:
            numbers = listed([str(k) for k in matches])
            raise ValueError(f"{len(matches)} {kind} are called {key!r}: choose one of the numbers {numbers}")
        if matches:
            return matches[0]
    return None


def shown(text: str, longest: int = 40) -> str:
    """A name or a cell from a file, in one line."""
    return repr(text if len(text) <= longest else text[: longest - 3] + "...")


def listed(names: Sequence[str], most: int = 20) -> str:
    """Names from a file, in one line."""
    plain = [name if name.isprintable() and len(name) <= 80 else shown(name, 80) for name in names[:most]]
    return ", ".join(plain) + (f" and {len(names) - most} more" if len(names) > most else "")


def nearest(key: str, names: Sequence[str]) -> str:
    """The name that may be meant by a key, as the end of a message; an empty text if none is near."""
    near = nearest_of(key, names)
    return "" if near is None else f"; did you mean {shown(near)}?"


def channels_in(text: Any) -> dict[str, str | float]:
    """The channels that a text in JSON names; none if it does not."""
    try:
        channels = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return {}
    known = isinstance(channels, dict) and all(type(each) in (str, int, float) for each in channels.values())
    return {name: each if isinstance(each, str) else float(each) for name, each in channels.items()} if known else {}


def positive(value: float | None) -> float | None:
    """A resolution that a file states, None if it is not positive and finite."""
    return value if value is not None and 0.0 < value < math.inf else None
