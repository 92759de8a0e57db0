"""A text with one sample a line, as a table.

Its layout is found from lines spread over the file: every pair of a delimiter and a decimal sign is tried on them. Its
score is the share of the lines that have the most common number of cells, at least two, times the share of the cells
that are numbers or missing. The best score wins, of equal ones the first in the order tab, semicolon, comma, white
space, with a decimal point before a decimal comma.

A column holds numbers if at least half of its cells below the first line do. The first line is a header if it has
text in such columns and no number; a line of text in all of them right below the header holds the units.
"""

import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim._printing import text_in_cell
from hysim.files._table import COMMENTS, Column, Notes, column_of, json_value, notes_in, require
from hysim.files._text import DECIMALS, MISSING, Lines, Signs, Text, numbers, parse, plain_numbers
from hysim.interop import heading

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}

_LOOKED_AT = 50  # lines from the top, and about as many spread over the rest of the file
_EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)  # a first line for Excel, which names the delimiter
_WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[\]()]*[\])])?|\S+")
_NOTE = re.compile(r"[#%] *(name|resolution|units|channels) *:")


@dataclass(frozen=True)
class Delimited:
    """The columns of a text, its delimiter, the signs in its numbers, the lines of its header, and its samples."""

    text: Text
    notes: Notes
    columns: list[Column]
    delimiter: str
    signs: Signs
    head: int
    n_samples: int

    @property
    def labels(self) -> Sequence[str]:
        """Names of the columns."""
        return [column.label for column in self.columns]

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        return column_of(key, self.columns)

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        values, at = np.empty((len(columns), self.n_samples)), 0
        for lines in self._samples():
            values[:, at : at + len(lines.texts)] = self._values(lines, columns)
            at += len(lines.texts)
        return values

    def _values(self, lines: Lines, columns: list[Column]) -> FloatArray:
        values = plain_numbers(lines.texts, [column.place for column in columns], self.delimiter, self.signs)
        if values is not None:
            return values
        rows = _rows(lines, self.delimiter)
        return np.stack([numbers([row[c.place] for row in rows], lines.numbers, c.label, self.signs) for c in columns])

    def place(self, sample: int) -> str:
        """The sample's line."""
        numbers = itertools.chain.from_iterable(lines.numbers for lines in self._samples())
        return f"line {next(itertools.islice(numbers, sample, None))}"

    def _samples(self) -> Iterator[Lines]:
        """The lines of the samples, which are those below the header, some at a time."""
        head = self.head
        for lines in self.text.samples():
            if head < len(lines.texts):
                yield Lines(lines.numbers[head:], lines.texts[head:])
            head = max(0, head - len(lines.texts))

    def check_widths(self) -> None:
        """Raise a ValueError with the number of the first line that has another number of cells."""
        for lines in self._samples():
            if any('"' in line for line in lines.texts):
                widths = [len(row) for row in _rows(lines, self.delimiter)]
            elif self.delimiter == " ":
                widths = [len(line.split()) for line in lines.texts]
            else:
                widths = [line.count(self.delimiter) + 1 for line in lines.texts]
            width = len(self.columns)
            if widths.count(width) < len(widths):
                k = next(k for k, cells in enumerate(widths) if cells != width)
                between = DELIMITERS.get(self.delimiter, repr(self.delimiter))
                raise ValueError(
                    f"line {lines.numbers[k]}: expected {width} cells, got {widths[k]} (separated by {between}); "
                    "correct the line, begin it with # if it is no sample, pass the number of lines of a header "
                    "above the columns as skip=, or the sign between the cells as delimiter="
                )


def _survey(text: Text) -> tuple[Lines, Lines, int]:
    """The samples at the top, others spread over the rest, and the number of all, in one reading of a text."""
    top, rest, n = Lines([], []), list[tuple[int, str]](), 0
    for lines in text.samples():
        own = max(0, _LOOKED_AT - n)
        top = Lines([*top.numbers, *lines.numbers[:own]], top.texts + lines.texts[:own])
        step = 1 + len(lines.texts) // _LOOKED_AT
        rest += zip(lines.numbers[own::step], lines.texts[own::step], strict=True)
        n += len(lines.texts)
    rest = rest[:: 1 + len(rest) // _LOOKED_AT]
    return top, Lines([number for number, _ in rest], [line for _, line in rest]), n


def delimited(text: Text, delimiter: str | None, decimal: str | None, thousands: str | None = None) -> Delimited:
    """The table that a text holds; ValueError with the number of the line if it holds none."""
    top, rest, n_lines = _survey(text)
    lines, first = top.texts, next(iter(top.numbers), 0)
    if lines and (said := _EXCEL.fullmatch(lines[0].strip())) is not None and first == 1:
        return delimited(text._replace(skip=1), delimiter or said[1], decimal, thousands)
    require(lines, "the file is empty, there is no header and no sample")
    delimiter, signs = _signs(lines + rest.texts, delimiter, decimal, thousands)
    rows = _rows(Lines([*top.numbers, *rest.numbers], lines + rest.texts), delimiter)
    width = _most_common(rows)
    below = [row for row in rows[1:] if len(row) == width]
    has_header, has_units = _heads(rows[:2], below, first, width, signs)
    head = has_header + has_units
    require(head < n_lines, "there is a header, but no sample")
    above = list(itertools.islice(itertools.chain.from_iterable(each.texts for each in text.lines()), first - 1))
    names = _names(lines[0], delimiter) if has_header else _commented(above, delimiter, width, signs)
    is_named = len(names) == width
    require(
        is_named,
        f"line {first} names {len(names)} columns, most lines below have {width} cells; if it is part of a header "
        "above the names, pass its number of lines as skip=",
    )
    columns = [Column(place, *heading(label)) for place, label in enumerate(names)]
    if has_units:
        columns = [c._replace(unit=c.unit or _unit(cell)) for c, cell in zip(columns, rows[1], strict=True)]
    table = Delimited(text, _notes(above), columns, delimiter, signs, head, n_lines - head)
    table.check_widths()
    return table


def _notes(above: list[str]) -> Notes:
    """The name, resolution, units and channels in the comments above a text, as `hysim.save_record` writes them."""
    notes: dict[str, Any] = {}
    for line in itertools.takewhile(lambda line: line.startswith(COMMENTS), above):
        if note := _NOTE.match(line):
            notes[note[1]] = line[note.end() :].strip()
    name, units = (json_value(notes.get(each, "")) for each in ("name", "units"))
    notes["resolution"] = parse(notes.get("resolution", ""), Signs("."))
    notes["name"] = name if isinstance(name, str) else notes.get("name")
    return notes_in(notes, units if isinstance(units, dict) else {})


def _signs(sample: list[str], delimiter: str | None, decimal: str | None, thousands: str | None) -> tuple[str, Signs]:
    """The delimiter and the signs in numbers; delimiter and decimal sign are detected where they are None."""
    quoted = any('"' in line for line in sample)
    candidates = [
        (between, Signs(point, thousands))
        for between in ([delimiter] if delimiter else DELIMITERS)
        for point in ([decimal] if decimal else DECIMALS)
        if (between != point or quoted) and point != thousands
    ]
    require(candidates, f"delimiter and decimal sign must differ, both are {delimiter!r}")
    best = max(candidates, key=lambda signs: _score(sample, *signs))
    if _score(sample, *best) == 0.0 and delimiter is None:
        present = (between for between in DELIMITERS if any(between in line.strip() for line in sample))
        return next(present, " "), candidates[0][1]
    return best


def _score(lines: list[str], delimiter: str, signs: Signs) -> float:
    rows = [_cells(line, delimiter, strict=False) for line in lines]
    width = _most_common(rows)
    if width < 2:
        return 0.0
    cells = [cell for row in rows for cell in row]
    plain = sum(_kind(cell, signs) != "text" for cell in cells)
    return sum(len(row) == width for row in rows) / len(rows) * plain / len(cells)


def _rows(lines: Lines, delimiter: str) -> list[list[str]]:
    rows = []
    for number, line in zip(*lines, strict=True):
        try:
            rows.append(_cells(line, delimiter))
        except csv.Error as error:
            raise ValueError(f"line {number}: a quoted cell is not closed or too long ({error})") from None
    return rows


def _cells(line: str, delimiter: str, *, strict: bool = True) -> list[str]:
    """The cells of a line; one that cannot be split is a csv.Error, or unless `strict` a single cell."""
    if '"' not in line:
        cells = line.split() if delimiter == " " else line.strip(" ").split(delimiter)
        return [text_in_cell(cell.strip()) for cell in cells]
    try:
        cells = next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True, strict=strict))
    except csv.Error:
        if strict:
            raise
        cells = [line]
    return [text_in_cell(cell.strip()) for cell in cells]


def _names(line: str, delimiter: str) -> list[str]:
    """Names of columns; between blanks a unit in brackets belongs to the name before it."""
    return _WORD.findall(line) if delimiter == " " and '"' not in line else _cells(line, delimiter, strict=False)


def _heads(rows: list[list[str]], below: list[list[str]], line: int, width: int, signs: Signs) -> tuple[bool, bool]:
    """Whether the first line is a header, and whether the second one holds units."""
    columns = [[_kind(row[place], signs) for row in below] for place in range(width)]
    numeric = {place for place, kinds in enumerate(columns) if kinds.count("number") >= max(1, kinds.count("text"))}
    if not numeric:  # nothing below to compare with
        kinds_above = [_kind(cell, signs) for cell in rows[0]]
        return "text" in kinds_above or "number" not in kinds_above, False
    kinds_of = [
        {place: _kind(cell, signs) for place, cell in enumerate(row) if len(row) != width or place in numeric}
        for row in rows
    ]
    texts, counts = ([place for place, kind in kinds_of[0].items() if kind == one] for one in ("text", "number"))
    if texts and counts:
        raise ValueError(
            f"line {line} is half a header: column {counts[0]} holds the number {rows[0][counts[0]]!r}, column "
            f"{texts[0]} the text {rows[0][texts[0]]!r}; name every column, or begin the line with #"
        )
    has_units = bool(texts) and len(rows[1]) == width and set(kinds_of[1].values()) == {"text"}
    return bool(texts), has_units


def _kind(cell: str, signs: Signs) -> str:
    return "missing" if cell.strip().lower() in MISSING else "text" if parse(cell, signs) is None else "number"


def _commented(above: list[str], delimiter: str, width: int, signs: Signs) -> list[str]:
    """Names in the last comment above the first sample, if they are as many as the columns; else their numbers."""
    comment = next((line for line in reversed(above) if line.strip()), "")
    names = _names(comment.strip().lstrip("".join(COMMENTS)), delimiter)
    is_named = len(names) == width and all(_kind(name, signs) == "text" for name in names)
    return names if is_named else [str(k) for k in range(width)]


def _unit(cell: str) -> str:
    unit = re.sub(r"^[\[(]|[\])]$", "", cell.strip()).strip()
    return "" if unit == "-" else unit


def _most_common(rows: list[list[str]]) -> int:
    return Counter(map(len, rows)).most_common(1)[0][0]
