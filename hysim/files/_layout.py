"""The layout of a text file: its delimiter, its decimal sign, and the line where its samples begin.

Every pair of a delimiter and a decimal sign is tried on some lines spread over the file. Its score is the share
of the lines that have the most common number of cells, at least two, times the share of the cells that are
numbers or missing. The best score wins, of equal ones the first in the order tab, semicolon, comma, white space,
with a decimal point before a decimal comma.

A column holds numbers if at least half of its cells below the first line do. The first line is a header if it has
text in such columns and no number; a line of text in all of them right below the header holds the units.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from hysim._printing import text_in_cell
from hysim.files._cells import MISSING, Signs, parse
from hysim.files._table import Column, require
from hysim.files._text import COMMENTS, Lines, Text
from hysim.interop import heading

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}
DECIMALS = (".", ",")

_LOOKED_AT = 50  # lines from the top, and at most as many spread over the rest of the file
_EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)  # a first line for Excel, which names the delimiter
_WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[\]()]*[\])])?|\S+")


class Layout(NamedTuple):
    """The columns of a text, its delimiter, the signs in its numbers, and the place and number of its samples."""

    columns: list[Column]
    delimiter: str
    signs: Signs
    text: Text
    head: int
    n_samples: int

    def samples(self) -> Iterator[Lines]:
        """The lines of the samples, which are those below the header, some at a time."""
        head = self.head
        for lines in self.text.samples():
            if head < len(lines.texts):
                yield Lines(lines.numbers[head:], lines.texts[head:])
            head = max(0, head - len(lines.texts))

    def rows(self, lines: Lines) -> list[list[str]]:
        """The cells of some samples."""
        return _rows(lines.texts, lines.numbers, self.delimiter)

    def check_widths(self) -> None:
        """Raise a ValueError with the number of the first line that has another number of cells."""
        for lines in self.samples():
            widths, width = self._widths(lines), len(self.columns)
            if widths.count(width) < len(widths):
                k = next(k for k, cells in enumerate(widths) if cells != width)
                between = DELIMITERS.get(self.delimiter, repr(self.delimiter))
                raise ValueError(
                    f"line {lines.numbers[k]}: expected {width} cells, got {widths[k]} (separated by {between}); "
                    "correct the line, begin it with # if it is no sample, pass the number of lines of a header "
                    "above the columns as skip=, or the sign between the cells as delimiter="
                )

    def _widths(self, lines: Lines) -> list[int]:
        if any('"' in line for line in lines.texts):
            return [len(row) for row in self.rows(lines)]
        if self.delimiter == " ":
            return [len(line.split()) for line in lines.texts]
        return [line.count(self.delimiter) + 1 for line in lines.texts]


class _Survey(NamedTuple):
    """Some of the lines that are neither blank nor comments: all at the top, others spread over the rest."""

    top: Lines
    rest: Lines
    n_lines: int


def _survey(text: Text) -> _Survey:
    """The lines by which a layout is found, in one reading of a text."""
    top, rest, n, step = Lines([], []), Lines([], []), 0, 1
    for numbers, texts in text.samples():
        own = max(0, _LOOKED_AT - n)
        top = Lines([*top.numbers, *numbers[:own]], top.texts + texts[:own])
        begin = own + (_LOOKED_AT - n - own) % step  # every step-th line below the top
        rest = Lines([*rest.numbers, *numbers[begin::step]], rest.texts + texts[begin::step])
        while len(rest.texts) > _LOOKED_AT:
            rest, step = Lines(rest.numbers[::2], rest.texts[::2]), 2 * step
        n += len(texts)
    return _Survey(top, rest, n)


def layout(text: Text, delimiter: str | None, decimal: str | None, thousands: str | None = None) -> Layout:
    """Detect the layout of a text with one sample a line; ValueError if it has none."""
    (numbers, lines), (numbers_below, lines_below), n_lines = _survey(text)
    if lines and (said := _EXCEL.fullmatch(lines[0].strip())) is not None and numbers[0] == 1:
        return layout(text._replace(skip=1), delimiter or said[1], decimal, thousands)
    require(lines, "the file is empty, there is no header and no sample")
    delimiter, signs = _signs(lines + lines_below, delimiter, decimal, thousands)
    top = _rows(lines[:2], numbers, delimiter)
    below = _rows(lines[1:] + lines_below, [*numbers[1:], *numbers_below], delimiter)
    width = _most_common([len(row) for row in [top[0], *below]])
    has_header, has_units = _heads(top, [row for row in below if len(row) == width], numbers[0], width, signs)
    head = has_header + has_units
    require(head < n_lines, "there is a header, but no sample")
    if has_header:
        names = _names(lines[0], delimiter)
    else:
        names = _commented(text, numbers[0], delimiter, width, signs) or [str(k) for k in range(width)]
    is_named = len(names) == width
    require(
        is_named,
        f"line {numbers[0]} names {len(names)} columns, most lines below have {width} cells; if it is part of a header "
        "above the names, pass its number of lines as skip=",
    )
    columns = [_column(place, label) for place, label in enumerate(names)]
    if has_units:
        columns = [c._replace(unit=c.unit or _unit(cell)) for c, cell in zip(columns, top[1], strict=True)]
    result = Layout(columns, delimiter, signs, text, head, n_lines - head)
    result.check_widths()
    return result


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
    width = _most_common([len(row) for row in rows])
    if width < 2:
        return 0.0
    cells = [cell for row in rows for cell in row]
    plain = sum(_kind(cell, signs) != "text" for cell in cells)
    return sum(len(row) == width for row in rows) / len(rows) * plain / len(cells)


def _rows(lines: list[str], numbers: Sequence[int], delimiter: str) -> list[list[str]]:
    rows = []
    for line, number in zip(lines, numbers, strict=False):
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


def _commented(text: Text, line: int, delimiter: str, width: int, signs: Signs) -> list[str] | None:
    """Names in the last comment above the first sample, which is in this line, if they are as many as the columns."""
    comment = ""
    for each, _ in zip(text.top(), range(line - 1), strict=False):
        comment = each.strip() or comment
    names = _names(comment.lstrip("".join(COMMENTS)), delimiter)
    is_named = len(names) == width and all(_kind(name, signs) == "text" for name in names)
    return names if is_named else None


def _column(place: int, label: str) -> Column:
    return Column(place, *heading(label))


def _unit(cell: str) -> str:
    text = cell.strip()
    unit = text.removeprefix("[").removeprefix("(").removesuffix("]").removesuffix(")").strip()
    return "" if unit == "-" else unit


def _most_common(widths: list[int]) -> int:
    return Counter(widths).most_common(1)[0][0]
