"""A text with one sample a line, as a table."""

import itertools
import json
import operator
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._cells import Signs, numbers, parse, plain_numbers
from hysim.files._layout import Layout, layout
from hysim.files._table import Column, Notes, channels_in, listed, nearest, number_of, positive
from hysim.files._text import COMMENTS, Lines, Text

T = TypeVar("T")

_NOTE = re.compile(r"[#%] *(name|resolution|units|channels) *:")


@dataclass(frozen=True)
class Delimited:
    """The columns of a text."""

    layout: Layout
    notes: Notes

    @property
    def labels(self) -> Sequence[str]:
        """Names of the columns."""
        return [column.label for column in self.layout.columns]

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        columns = self.layout.columns
        if isinstance(key, str):
            number = number_of(key, "columns", self.labels, [f"{column.label} [{column.unit}]" for column in columns])
            if number is None:
                raise ValueError(
                    f"no column {key!r}, the columns are: {listed(self.labels)}{nearest(key, self.labels)}"
                )
            return columns[number]
        if not 0 <= operator.index(key) < len(columns):
            raise ValueError(f"no column {key}, there are columns 0 to {len(columns) - 1}")
        return columns[key]

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        values, at = np.empty((len(columns), self.layout.n_samples)), 0
        for lines in self.layout.samples():
            values[:, at : at + len(lines.texts)] = self._values(lines, columns)
            at += len(lines.texts)
        return values

    def _values(self, lines: Lines, columns: list[Column]) -> FloatArray:
        delimiter, signs = self.layout.delimiter, self.layout.signs
        values = plain_numbers(lines.texts, [column.place for column in columns], delimiter, signs)
        if values is not None:
            return values
        rows = self.layout.rows(lines)
        return np.stack([numbers([row[c.place] for row in rows], lines.numbers, c.label, signs) for c in columns])

    def place(self, sample: int) -> str:
        """The sample's line."""
        numbers = itertools.chain.from_iterable(lines.numbers for lines in self.layout.samples())
        return f"line {next(itertools.islice(numbers, sample, None))}"


def delimited(text: Text, delimiter: str | None, decimal: str | None, thousands: str | None = None) -> Delimited:
    """The table that a text holds; ValueError with the number of the line if it holds none."""
    return Delimited(layout(text, delimiter, decimal, thousands), _notes(text))


def _notes(text: Text) -> Notes:
    """The name, resolution, units and channels in the comments above a text, as `hysim.save_record` writes them."""
    notes: dict[str, str] = {}
    for line in itertools.takewhile(lambda line: line.startswith(COMMENTS), text.top()):
        if note := _NOTE.match(line):
            notes[note[1]] = line[note.end() :].strip()
    units = _json(notes.get("units", ""), dict) or {}
    name = _json(notes.get("name", ""), str)
    return Notes(
        units={str(signal): str(unit) for signal, unit in units.items()},
        resolution=positive(parse(notes.get("resolution", ""), Signs("."))),
        name=notes.get("name") if name is None else name,
        channels=channels_in(notes.get("channels")),
    )


def _json(text: str, kind: type[T]) -> T | None:
    """The value that a text in JSON holds, None if it is of another kind."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, kind) else None
