"""A text with one sample a line, as a table.

Its layout is found from lines spread over the file: every pair of a delimiter and a decimal sign is tried on them. Its
score is the share of the lines that have the most common number of cells, at least two, times the share of the cells
that are numbers or missing. The best score wins, of equal ones the first in the order tab, semicolon, comma, white
space, with a decimal point before a decimal comma.

Signs between thousands are an apostrophe or a space, and the point or comma that is not the decimal sign where a cell
can mean nothing else: ``1.000,5`` and ``1.000.000``, but not ``1.000``, unless that sign is given.

A column holds numbers if at least half of its cells below the first line do. The first line is a header if it has
text in such columns and no number; a line of text in all of them right below the header holds the units.
"""

import codecs
import csv
import io
import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.printing import text_in_cell
from hysim.files._table import COMMENTS, Column, Notes, column_of, json_value, notes_in, require, shown
from hysim.interop import heading

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}

_LOOKED_AT = 50  # lines from the top, and about as many spread over the rest of the file
_EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)  # a first line for Excel, which names the delimiter
_WORD = re.compile(r"[^\s\[(]+(?:\s+/\s+[^\s\[(]+|(?:\s+/)?\s*[\[(][^\[\]()]*[\])])?|\S+")
_NOTE = re.compile(r"[#%] *(name|resolution|units|channels) *:")

DECIMALS = (".", ",")

MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Cells that stand for a missing value, in upper or lower case."""

THOUSANDS = ".,'\u2019 \u00a0\u2009\u202f"
"""Signs that may stand between thousands: a point, a comma, apostrophes and spaces of some widths."""

_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16, so it is looked for first
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_AT_ONCE = 1 << 18  # letters: their lines take some megabytes
_GROUPED = re.compile(
    rf"(?P<sign>[+-]?)(?P<whole>\d{{1,3}}(?P<mark>[{THOUSANDS}])\d{{3}}(?:(?P=mark)\d{{3}})*)(?P<rest>(?P<point>[.,])?\d*)"
)
_CLOCK = re.compile(r"(\S+[ T])?\d{1,2}:\d\d(:\d\d([.,]\d*)?)?")


class Lines(NamedTuple):
    """Some lines of a text, with their numbers from 1."""

    numbers: Sequence[int]
    texts: list[str]


class Text(NamedTuple):
    """The text in a file of this name, which is read anew, some lines at a time, whenever it is asked for.

    A ValueError is raised where it is read if it is not text in its encoding. The first `skip` lines are empty.
    `reading(n_bytes)` is called after each piece.
    """

    content: BinaryIO
    name: str = ""
    encoding: str | None = None
    skip: int = 0
    reading: Callable[[int], None] = lambda n_bytes: None

    def lines(self) -> Iterator[Lines]:
        """All lines, without the signs at their ends."""
        self.content.seek(0)
        head = self.content.read(4)
        marked = next((known for mark, known in _MARKS.items() if head.startswith(mark)), "utf-8")
        self.content.seek(0)
        number, at = 1, 0
        try:
            stream = io.TextIOWrapper(self.content, self.encoding or marked)
        except LookupError:
            raise ValueError(f"{self.name}: encoding must be one that Python knows, got {self.encoding!r}") from None
        try:
            while piece := stream.read(_AT_ONCE) + stream.readline():
                if "\0" in piece:
                    raise ValueError(self._no_text("", "it holds zero bytes"))
                texts = (piece.removeprefix("\ufeff") if number == 1 else piece).removesuffix("\n").split("\n")
                hidden = max(0, self.skip + 1 - number)
                yield Lines(range(number, number + len(texts)), [""] * len(texts[:hidden]) + texts[hidden:])
                number, before, at = number + len(texts), at, self.content.tell()
                self.reading(at - before)
        except UnicodeError as error:
            reason = error.reason if isinstance(error, UnicodeDecodeError) else str(error)
            raise ValueError(self._no_text(f"{(self.encoding or marked).upper()} ", reason)) from None
        finally:
            with suppress(ValueError):  # of a file that was closed before an unfinished reading of it
                stream.detach()

    def samples(self) -> Iterator[Lines]:
        for numbers, texts in self.lines():
            begins = {line[:1] for line in texts}
            if not any(sign in ("", *COMMENTS) or sign.isspace() for sign in begins):
                yield Lines(numbers, texts)
                continue
            kept = [k for k, line in enumerate(texts) if line.strip() and not line.lstrip().startswith(COMMENTS)]
            yield Lines([numbers[k] for k in kept], [texts[k] for k in kept])

    def whole(self) -> list[str]:
        return [line for lines in self.lines() for line in lines.texts]

    def _no_text(self, encoding: str, reason: str) -> str:
        return (
            f"{self.name} is not a {encoding}text file: {reason}; and it does not begin as NPZ, NPY, MAT (-v7, -v7.3) "
            'or HDF5 files do; if it is text, pass its encoding, for instance encoding="latin-1"'
        )


class Signs(NamedTuple):
    """The delimiter of a text, its decimal sign, and the sign between its thousands if it is given."""

    delimiter: str
    decimal: str
    thousands: str | None = None

    def number(self, cell: str) -> float | None:
        cell = cell.strip().replace("\u2212", "-")  # the minus sign of typesetters
        grouped = _GROUPED.fullmatch(cell)
        if grouped and grouped["mark"] != self.decimal and grouped["point"] in (None, self.decimal):
            mark, digits = grouped["mark"], grouped["whole"]
            if mark not in ".," or grouped["point"] or digits.count(mark) > 1 or mark == self.thousands:
                cell = grouped["sign"] + digits.replace(mark, "") + grouped["rest"]
        if self.decimal == ",":
            cell = "" if "." in cell or cell.endswith(",") else cell.replace(",", ".")
        try:
            return None if "_" in cell else float(cell)  # Python would take 1_0 for 10
        except ValueError:
            return None

    def kind(self, cell: str) -> str:
        return "missing" if cell.strip().lower() in MISSING else "text" if self.number(cell) is None else "number"

    def cells(self, line: str, *, strict: bool = False) -> list[str]:
        """The cells of a line; one that cannot be split is a csv.Error if `strict`, or else a single cell."""
        if '"' not in line:
            cells = line.split() if self.delimiter == " " else line.strip(" ").split(self.delimiter)
        else:
            try:
                cells = next(csv.reader([line.strip()], delimiter=self.delimiter, skipinitialspace=True, strict=strict))
            except csv.Error:
                if strict:
                    raise
                cells = [line]
        return [text_in_cell(cell.strip()) for cell in cells]

    def rows(self, lines: Lines) -> list[list[str]]:
        """The cells of some lines; ValueError with the number of one that cannot be split."""
        rows = []
        for number, line in zip(*lines, strict=True):
            try:
                rows.append(self.cells(line, strict=True))
            except csv.Error as error:
                raise ValueError(f"line {number}: a quoted cell is not closed or too long ({error})") from None
        return rows

    def names(self, line: str) -> list[str]:
        """Names of columns; between blanks a unit in brackets belongs to the name before it."""
        return _WORD.findall(line) if self.delimiter == " " and '"' not in line else self.cells(line)

    def score(self, lines: list[str]) -> float:
        """How well these signs fit some lines, from 0 to 1."""
        rows = [self.cells(line) for line in lines]
        width, cells = _most_common(rows), [cell for row in rows for cell in row]
        plain = sum(self.kind(cell) != "text" for cell in cells)
        return (width > 1) * sum(len(row) == width for row in rows) / len(rows) * plain / len(cells)

    def numbers(self, cells: list[str], lines: Sequence[int], label: str) -> FloatArray:
        """The numbers of a column, nan where one is missing; `lines` are the numbers of the cells' lines."""
        values = [self.number(cell) for cell in cells]
        for cell, value, line in zip(cells, values, lines, strict=True):
            is_known = cell.lower() in MISSING if value is None else not math.isinf(value)
            if not is_known:
                place, advice = f"line {line}, column {shown(label)}", self.advice(cell)
                raise ValueError(f"{place}: expected a finite number, got {shown(cell)}{advice}")
        return np.array(values, dtype=np.float64)  # None is nan

    def advice(self, cell: str) -> str:
        """Advice on a cell that is a time of day, or whose point or comma has the other meaning."""
        if _CLOCK.fullmatch(cell):
            return " (a time of day: write it in seconds, or load without time: t=False)"
        other, name = {".": (",", "comma"), ",": (".", "point")}[self.decimal]
        grouped, advice = _GROUPED.fullmatch(cell), list[str]()
        if cell.count(other) == 1 and self.decimal not in cell:
            advice.append(f'decimal="{other}" if the {name} is the decimal sign')
        if grouped and grouped["mark"] == other:
            advice.append(f'thousands="{other}" if the {name} stands between thousands')
        is_number = self.number(cell.replace(other, "")) is not None
        return f" (pass {', '.join(advice)})" if advice and is_number else ""


def plain_numbers(lines: list[str], places: list[int], signs: Signs) -> FloatArray | None:
    """Columns of lines, shape (n_columns, n_lines), None unless all are finite numbers; faster than `Signs.numbers`."""
    text, swapped = "".join(lines), signs.decimal == ","
    if signs.thousands or "_" in text or '"' in text or (swapped and (signs.delimiter == "," or "." in text)):
        return None
    lines = [line.replace(",", ".") for line in lines] if swapped else lines
    delimiter = None if signs.delimiter == " " else signs.delimiter
    with suppress(ValueError):
        values = np.loadtxt(lines, delimiter=delimiter, usecols=places, comments=None, ndmin=2)
        return np.ascontiguousarray(values.T) if np.isfinite(values).all() else None
    return None


@dataclass(frozen=True)
class Delimited:
    """The columns of a text, its signs, and the numbers of the lines of its header and of its samples."""

    text: Text
    notes: Notes
    columns: list[Column]
    signs: Signs
    head: int
    n_samples: int

    @property
    def labels(self) -> Sequence[str]:
        return [column.label for column in self.columns]

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        return column_of(key, self.columns)

    def values(self, columns: list[Column]) -> FloatArray:
        result, at = np.empty((len(columns), self.n_samples)), 0
        for lines in self._samples():
            values = plain_numbers(lines.texts, [column.place for column in columns], self.signs)
            if values is None:
                rows = self.signs.rows(lines)
                cells = [[row[column.place] for row in rows] for column in columns]
                named = zip(cells, columns, strict=True)
                values = np.stack([self.signs.numbers(each, lines.numbers, column.label) for each, column in named])
            result[:, at : at + len(lines.texts)] = values
            at += len(lines.texts)
        return result

    def place(self, sample: int) -> str:
        numbers = itertools.chain.from_iterable(lines.numbers for lines in self._samples())
        return f"line {next(itertools.islice(numbers, sample, None))}"

    def _samples(self) -> Iterator[Lines]:
        head = self.head
        for lines in self.text.samples():
            if head < len(lines.texts):
                yield Lines(lines.numbers[head:], lines.texts[head:])
            head = max(0, head - len(lines.texts))

    def check_widths(self) -> None:
        """Raise a ValueError with the number of the first line that has another number of cells."""
        delimiter, width = self.signs.delimiter, len(self.columns)
        for lines in self._samples():
            if any('"' in line for line in lines.texts):
                widths = [len(row) for row in self.signs.rows(lines)]
            elif delimiter == " ":
                widths = [len(line.split()) for line in lines.texts]
            else:
                widths = [line.count(delimiter) + 1 for line in lines.texts]
            if widths.count(width) < len(widths):
                k = next(k for k, cells in enumerate(widths) if cells != width)
                between = DELIMITERS.get(delimiter, repr(delimiter))
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
    """The table that a text holds; ValueError with the number of the line if it is not a table."""
    top, rest, n_lines = _survey(text)
    lines, first = top.texts, next(iter(top.numbers), 0)
    if lines and (said := _EXCEL.fullmatch(lines[0].strip())) is not None and first == 1:
        return delimited(text._replace(skip=1), delimiter or said[1], decimal, thousands)
    require(lines, "the file is empty, there is no header and no sample")
    signs = _signs(lines + rest.texts, delimiter, decimal, thousands)
    rows = signs.rows(Lines([*top.numbers, *rest.numbers], lines + rest.texts))
    width = _most_common(rows)
    has_header, has_units = _heads(rows[:2], [row for row in rows[1:] if len(row) == width], first, signs)
    head = has_header + has_units
    require(head < n_lines, "there is a header, but no sample")
    above = list(itertools.islice(itertools.chain.from_iterable(each.texts for each in text.lines()), first - 1))
    names = signs.names(lines[0]) if has_header else _commented(above, width, signs)
    advice = "if it is part of a header above the names, pass its number of lines as skip="
    sizes = f"names {len(names)} columns, most lines below have {width} cells"
    require(len(names) == width, f"line {first} {sizes}; {advice}")
    columns = [Column(place, *heading(label)) for place, label in enumerate(names)]
    if has_units:
        columns = [c._replace(unit=c.unit or _unit(cell)) for c, cell in zip(columns, rows[1], strict=True)]
    table = Delimited(text, _notes(above), columns, signs, head, n_lines - head)
    table.check_widths()
    return table


def _notes(above: list[str]) -> Notes:
    """The name, resolution, units and channels in the comments above a text, as `hysim.save_record` writes them."""
    texts: dict[str, str] = {}
    for line in itertools.takewhile(lambda line: line.startswith(COMMENTS), above):
        if note := _NOTE.match(line):
            texts[note[1]] = line[note.end() :].strip()
    name, units, channels = (json_value(texts.get(each, "")) for each in ("name", "units", "channels"))
    name = name if isinstance(name, str) else texts.get("name")
    resolution = Signs(",", ".").number(texts.get("resolution", ""))
    notes = {"name": name, "resolution": resolution, "channels": channels}
    return notes_in(notes, units if isinstance(units, dict) else {})


def _signs(lines: list[str], delimiter: str | None, decimal: str | None, thousands: str | None) -> Signs:
    """The signs of some lines; delimiter and decimal sign are detected where they are None."""
    quoted = any('"' in line for line in lines)
    candidates = [
        Signs(between, point, thousands)
        for between in ([delimiter] if delimiter else DELIMITERS)
        for point in ([decimal] if decimal else DECIMALS)
        if (between != point or quoted) and point != thousands
    ]
    require(candidates, f"delimiter and decimal sign must differ, both are {delimiter!r}")
    best = max(candidates, key=lambda signs: signs.score(lines))
    if best.score(lines) == 0.0 and delimiter is None:
        present = (between for between in DELIMITERS if any(between in line.strip() for line in lines))
        return candidates[0]._replace(delimiter=next(present, " "))
    return best


def _heads(rows: list[list[str]], below: list[list[str]], line: int, signs: Signs) -> tuple[bool, bool]:
    width = len(below[0]) if below else len(rows[0])
    columns = [[signs.kind(row[place]) for row in below] for place in range(width)]
    numeric = {place for place, kinds in enumerate(columns) if kinds.count("number") >= max(1, kinds.count("text"))}
    if not numeric:  # nothing below to compare with
        kinds_above = [signs.kind(cell) for cell in rows[0]]
        return "text" in kinds_above or "number" not in kinds_above, False
    looked_at = [{*range(len(row))} if len(row) != width else numeric for row in rows]
    kinds_of = [{k: signs.kind(row[k]) for k in sorted(places)} for row, places in zip(rows, looked_at, strict=True)]
    texts, counts = ([place for place, kind in kinds_of[0].items() if kind == one] for one in ("text", "number"))
    if texts and counts:
        number, text = (f"{rows[0][place]!r}" for place in (counts[0], texts[0]))
        cells = f"column {counts[0]} holds the number {number}, column {texts[0]} the text {text}"
        raise ValueError(f"line {line} is half a header: {cells}; name every column, or begin the line with #")
    has_units = bool(texts) and len(rows[1]) == width and set(kinds_of[1].values()) == {"text"}
    return bool(texts), has_units


def _commented(above: list[str], width: int, signs: Signs) -> list[str]:
    """Names in the last comment above the first sample, if they are as many as the columns; else their numbers."""
    comment = next((line for line in reversed(above) if line.strip()), "")
    names = signs.names(comment.strip().lstrip("".join(COMMENTS)))
    is_named = len(names) == width and all(signs.kind(name) == "text" for name in names)
    return names if is_named else [str(k) for k in range(width)]


def _unit(cell: str) -> str:
    unit = re.sub(r"^[\[(]|[\])]$", "", cell.strip()).strip()
    return "" if unit == "-" else unit


def _most_common(rows: list[list[str]]) -> int:
    return Counter(map(len, rows)).most_common(1)[0][0]
