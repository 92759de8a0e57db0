"""What the formats have in common: named columns, read when they are chosen, and what makes a record of them."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray

_LONGEST_REASON = 200  # letters


class Column(NamedTuple):
    """A column's place in its file, its name, and its unit or an empty string."""

    place: Any
    label: str
    unit: str


@dataclass(frozen=True)
class Notes:
    """What a file says about its record, beside the columns."""

    units: Mapping[str, str] = field(default_factory=dict)
    resolution: float | None = None
    name: str | None = None


class Table(Protocol):
    """Columns of a file."""

    @property
    def notes(self) -> Notes:
        """What the file says beside its columns."""

    def column(self, key: str | int) -> Column:
        """The column of this name or number; ValueError if there is none, or more than one."""

    def has(self, label: str) -> bool:
        """Whether a column is called so."""

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""

    def place(self, sample: int) -> str:
        """Where the sample is in the file: "line 12"."""


class UnreadableError(ValueError):
    """What a reader says of a file itself."""


def require(condition: object, message: str) -> None:
    """Refuse a file that does not meet a condition.

    Raises
    ------
    UnreadableError
        With this message, if the condition is false.
    """
    if not condition:
        raise UnreadableError(message)


@contextmanager
def damaged(form: str) -> Iterator[None]:
    """Whatever else goes wrong where a file is read: damaged files raise all kinds of errors."""
    try:
        yield
    except UnreadableError:
        raise
    except MemoryError:
        raise UnreadableError(f"the {form} file asks for more memory than there is") from None
    except Exception as error:
        reason = f"{type(error).__name__} {error}"[:_LONGEST_REASON].strip()
        raise UnreadableError(f"the {form} file is damaged: {reason}") from None


def shown(text: str, longest: int = 40) -> str:
    """A name or a cell from a file, in one line."""
    return repr(text if len(text) <= longest else text[: longest - 3] + "...")


def listed(names: list[str], most: int = 20) -> str:
    """Names from a file, in one line."""
    plain = [name if name.isprintable() and len(name) <= 80 else shown(name, 80) for name in names[:most]]
    return ", ".join(plain) + (f" and {len(names) - most} more" if len(names) > most else "")


def quantum(value: float | None) -> float | None:
    """A resolution that a file says, None if that is none."""
    return value if value is not None and 0.0 < value < math.inf else None


def check_gaps(table: Table, columns: list[Column], values: FloatArray) -> None:
    """Refuse values that are missing."""
    if np.isnan(values).any():
        k, j = np.argwhere(np.isnan(values.T))[0]
        raise ValueError(
            f"{table.place(k)}, column {shown(columns[j].label)}: the value is missing; "
            'on_missing="drop" leaves such samples out, on_missing="split" cuts the record there'
        )


def pieces(is_gap: npt.NDArray[np.bool_], *, cut: bool) -> list[npt.NDArray[np.intp]]:
    """Places of the samples of each record."""
    kept = np.flatnonzero(~is_gap)
    cuts = np.flatnonzero(np.diff(kept) > 1) + 1 if cut else kept[:0]
    parts = np.split(kept, cuts)
    long_enough = [part for part in parts if part.size >= 2]
    if not long_enough:
        longest = max(part.size for part in parts)
        raise ValueError(f"a record needs at least 2 samples, there are {longest}{' in a row' if cut else ''}")
    return long_enough


def check_time(table: Table, times: FloatArray, parts: list[npt.NDArray[np.intp]]) -> None:
    """Refuse times that do not increase."""
    for part in parts:
        back = np.flatnonzero(np.diff(times[part]) <= 0)
        if back.size:
            before, k = part[back[0]], part[back[0] + 1]
            raise ValueError(
                f"{table.place(k)}: time must increase, got {times[k]} after {times[before]}; sort the samples, leave "
                "repeated ones out, or load without time: t=False"
            )
