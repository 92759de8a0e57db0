"""A text with one sample a line, as a table."""

import json
import operator
import re
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._cells import numbers, parse, table
from hysim.files._layout import COMMENTS, Layout, layout
from hysim.files._table import Column, Notes, listed, quantum

T = TypeVar("T")

_NOTE = re.compile(r"[#%] *(name|resolution|units) *:")


@dataclass(frozen=True)
class Delimited:
    """The columns of a text."""

    layout: Layout
    notes: Notes

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        columns = self.layout.columns
        if not isinstance(key, str):
            place = operator.index(key)
            if not 0 <= place < len(columns):
                raise ValueError(f"no column {place}, there are columns 0 to {len(columns) - 1}")
            return columns[place]
        found = [column for column in columns if key in (column.label, f"{column.label} [{column.unit}]")]
        if len(found) > 1:
            places = listed([str(column.place) for column in found])
            raise ValueError(f"{len(found)} columns are called {key!r}: choose one of the numbers {places}")
        if not found:
            there = listed([column.label for column in columns])
            raise ValueError(f"no column {key!r}, the columns are: {there}")
        return found[0]

    def has(self, label: str) -> bool:
        """Whether a column is called so."""
        return any(column.label == label for column in self.layout.columns)

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        found = self.layout
        quick = table(found.lines, [column.place for column in columns], found.delimiter, found.decimal)
        if quick is not None:
            return quick
        rows = found.rows()
        return np.stack(
            [numbers([row[c.place] for row in rows], found.numbers, c.label, found.decimal) for c in columns]
        )

    def place(self, sample: int) -> str:
        """The sample's line."""
        return f"line {self.layout.numbers[sample]}"


def delimited(text: str, delimiter: str | None, decimal: str | None) -> Delimited:
    """The table that a text holds.

    Raises
    ------
    ValueError
        If it is none; the message names the line.
    """
    return Delimited(layout(text, delimiter, decimal), _notes(text))


def _notes(text: str) -> Notes:
    """The name, resolution and units in the comments that a text begins with, as `hysim.save_record` writes them."""
    said: dict[str, str] = {}
    start = 0
    while text.startswith(COMMENTS, start):
        end = text.find("\n", start) % (len(text) + 1)
        if note := _NOTE.match(text, start, end):
            said[note[1]] = text[note.end() : end].strip()
        start = end + 1
    units = _json(said.get("units", ""), dict)
    return Notes(
        units={str(signal): str(unit) for signal, unit in (units or {}).items()},
        resolution=quantum(parse(said.get("resolution", ""), ".")),
        name=_json(said.get("name", ""), str) or said.get("name"),
    )


def _json(text: str, kind: type[T]) -> T | None:
    """What a text in JSON holds, None if that is of another kind."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, kind) else None
