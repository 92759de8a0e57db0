"""Columns with names, whose numbers are read when they are chosen: common to all formats."""

import json
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._basics.names import meant
from hysim.interop import ForeignTable, heading

_LONGEST_REASON = 200  # letters

COMMENTS = ("#", "%")
"""Signs with which a comment begins in a text."""


class Column(NamedTuple):
    """A column's place in its file, its name, and its unit or an empty string."""

    place: Any
    label: str
    unit: str


@dataclass(frozen=True)
class Notes:
    """Units, resolution, name and channels of a record as a file states them; channels are columns or numbers."""

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
        """The column of this name or number; ValueError unless exactly one column matches."""

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""

    def place(self, sample: int) -> str:
        """Place of the sample in the file: "line 12"."""


@dataclass(frozen=True)
class Frame:
    """Columns of a DataFrame or the like."""

    table: ForeignTable

    @property
    def notes(self) -> Notes:
        return notes_in(self.table.notes, self.table.units)

    @property
    def labels(self) -> Sequence[str]:
        """Names of the columns; the last one is the index, where it holds times."""
        return self.table.labels

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        columns = [Column(k, label, self.table.units.get(label, "")) for k, label in enumerate(self.labels)]
        number, label, _ = column_of(key, columns)
        values, unit = self.table.read(number)
        return Column(values, label, unit)

    def values(self, columns: list[Column]) -> FloatArray:
        return np.stack([column.place for column in columns])

    def place(self, sample: int) -> str:
        """The sample's row, counted from 0 whatever the index holds."""
        return f"row {sample}"


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
        raise UnreadableError(f"the {form} file is damaged, or needs more memory than there is") from None
    except Exception as error:
        reason = f"{type(error).__name__} {error}"[:_LONGEST_REASON].strip()
        raise UnreadableError(f"the {form} file is damaged: {reason}; copy or save it again") from None


def check_complete(table: Table, columns: Sequence[Column], values: FloatArray, advice: str) -> None:
    """Refuse a missing value, by its place."""
    for sample, k in np.argwhere(np.isnan(values).T)[:1]:
        raise ValueError(f"{table.place(sample)}, column {shown(columns[k].label)}: the value is missing; {advice}")


def check_increasing(table: Table, times: FloatArray, samples: npt.NDArray[np.intp], advice: str) -> None:
    """Refuse times of some samples that do not increase, by the place of the first."""
    for k in np.flatnonzero(np.diff(times[samples]) <= 0.0)[:1]:
        before, after = samples[k : k + 2]
        order = f"time must increase, got {times[after]} after {times[before]}"
        raise ValueError(f"{table.place(after)}: {order}; {advice}")


def number_of(key: str, kind: str, *names: Sequence[str]) -> int | None:
    """Number of the one column of this name in the first of the lists that has it, or None; ValueError for several."""
    for labels in names:
        matches = [k for k, label in enumerate(labels) if label == key]
        if len(matches) > 1:
            numbers = listed([str(k) for k in matches])
            raise ValueError(f"{len(matches)} {kind} are called {key!r}: choose one of the numbers {numbers}")
        if matches:
            return matches[0]
    return None


def column_of(key: str | int, columns: Sequence[Column]) -> Column:
    """The column of this name, with or without its unit, or of this number from 0."""
    labels = [column.label for column in columns]
    if not isinstance(key, str):
        require(0 <= operator.index(key) < len(columns), f"no column {key}, there are columns 0 to {len(columns) - 1}")
        return columns[key]
    wanted = key if key in labels else "{} [{}]".format(*heading(key))
    number = number_of(wanted, "columns", labels, [f"{column.label} [{column.unit}]" for column in columns])
    if number is None:
        raise ValueError(f"no column {key!r}, the columns are: {listed(labels)}{meant(key, labels)}")
    return columns[number]


def shown(text: str, longest: int = 40) -> str:
    """A name or a cell from a file, in one line."""
    return repr(text if len(text) <= longest else text[: longest - 3] + "...")


def listed(names: Sequence[str], most: int = 20) -> str:
    plain = [name if name.isprintable() and len(name) <= 80 else shown(name, 80) for name in names[:most]]
    return ", ".join(plain) + (f" and {len(names) - most} more" if len(names) > most else "")


def notes_in(stated: Mapping[str, Any], units: Mapping[Any, Any]) -> Notes:
    """The notes about a record among the values that a file states; what is of another kind is left out."""
    name, resolution, channels = (stated.get(note) for note in ("name", "resolution", "channels"))
    if isinstance(channels, str):
        channels = json_value(channels)
    if not isinstance(channels, Mapping) or not all(isinstance(each, (str, int, float)) for each in channels.values()):
        channels = {}
    return Notes(
        units={str(label): unit for label, unit in units.items() if isinstance(unit, str)},
        resolution=resolution if isinstance(resolution, float) and 0.0 < resolution < math.inf else None,
        name=name if isinstance(name, str) else None,
        channels={str(label): each if isinstance(each, str) else float(each) for label, each in channels.items()},
    )


def json_value(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
