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
from typing import NamedTuple, TypeVar

from hysim._printing import text_in_cell
from hysim.files._cells import MISSING, Signs, parse
from hysim.files._table import Column, require
from hysim.interop import heading

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}
DECIMALS = (".", ",")
COMMENTS = ("#", "%")

T = TypeVar("T")

_LOOKED_AT = 100  # lines, of which the first half is from the top and the others are spread over the file
_EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)  # a first line for Excel, which names the delimiter
_WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[\]()]*[\])])?|\S+")


class Layout(NamedTuple):
    """The columns of a file, its delimiter, the signs in its numbers, and the samples' lines with their numbers."""

    columns: list[Column]
    delimiter: str
    signs: Signs
    numbers: list[int]
    lines: list[str]

    def rows(self) -> list[list[str]]:
        """The cells of each sample."""
        return _rows(self.lines, self.numbers, self.delimiter)

    def widths(self) -> list[int]:
        """The number of cells of each sample."""
        if any('"' in line for line in self.lines):
            return [len(row) for row in self.rows()]
        if self.delimiter == " ":
            return [len(line.split()) for line in self.lines]
        return [line.count(self.delimiter) + 1 for line in self.lines]


def layout(text: str, delimiter: str | None, decimal: str | None, thousands: str | None = None) -> Layout:
    """Detect the layout of a text with one sample a line; ValueError if it has none."""
    every = text.split("\n")
    if (said := _EXCEL.fullmatch(every[0].strip())) is not None:
        every[0], delimiter = "", delimiter or said[1]
    numbers = [k for k, line in enumerate(every, start=1) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    require(numbers, "the file is empty, there is no header and no sample")
    lines = [every[k - 1] for k in numbers]
    delimiter, signs = _signs(lines, delimiter, decimal, thousands)
    top = _rows(lines[:2], numbers, delimiter)
    below = _rows(_spread(lines[1:]), _spread(numbers[1:]), delimiter)
    width = _most_common([len(row) for row in [top[0], *below]])
    has_header, has_units = _heads(top, [row for row in below if len(row) == width], numbers[0], width, signs)
    first = has_header + has_units
    require(first < len(lines), "there is a header, but no sample")
    if has_header:
        names = _names(lines[0], delimiter)
    else:
        names = _commented(every[: numbers[0] - 1], delimiter, width, signs) or [str(k) for k in range(width)]
    is_named = len(names) == width
    require(
        is_named,
        f"line {numbers[0]} names {len(names)} columns, most lines below have {width} cells; if it is part of a header "
        "above the names, pass its number of lines as skip=",
    )
    columns = [_column(place, label) for place, label in enumerate(names)]
    if has_units:
        columns = [c._replace(unit=c.unit or _unit(cell)) for c, cell in zip(columns, top[1], strict=True)]
    result = Layout(columns, delimiter, signs, numbers[first:], lines[first:])
    for number, cells in zip(result.numbers, result.widths(), strict=True):
        if cells != width:
            between = DELIMITERS.get(delimiter, repr(delimiter))
            raise ValueError(
                f"line {number}: expected {width} cells, got {cells} (separated by {between}); correct the line, begin "
                "it with # if it is no sample, pass the number of lines of a header above the columns as skip=, or the "
                "sign between the cells as delimiter="
            )
    return result


def _signs(lines: list[str], delimiter: str | None, decimal: str | None, thousands: str | None) -> tuple[str, Signs]:
    """The delimiter and the signs in numbers; delimiter and decimal sign are detected where they are None."""
    sample = _spread(lines)
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


def _rows(lines: list[str], numbers: list[int], delimiter: str) -> list[list[str]]:
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


def _commented(above: list[str], delimiter: str, width: int, signs: Signs) -> list[str] | None:
    """Names in the last comment above the samples, if they are as many as the columns."""
    comments = [line.strip() for line in above if line.strip()]
    if not comments:
        return None
    names = _names(comments[-1].lstrip("".join(COMMENTS)), delimiter)
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


def _spread(items: list[T]) -> list[T]:
    """Some of the items: those at the top, and as many spread over the rest."""
    head, rest = items[: _LOOKED_AT // 2], items[_LOOKED_AT // 2 :]
    return head + rest[:: max(1, len(rest) // (_LOOKED_AT // 2))]
