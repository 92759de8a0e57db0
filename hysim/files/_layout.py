"""How a text file is laid out: what parts its cells, how it writes decimals, and where its samples begin.

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

from hysim.files._cells import MISSING, parse
from hysim.files._table import Column

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}
DECIMALS = (".", ",")
COMMENTS = ("#", "%")

T = TypeVar("T")

_LOOKED_AT = 100  # lines, of which the first half is from the top and the others are spread over the file
_HEADING = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
_WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[\]()]*[\])])?|\S+")


class Layout(NamedTuple):
    """The columns of a file, how its cells are parted and its numbers written, and the samples' lines."""

    columns: list[Column]
    delimiter: str
    decimal: str
    numbers: list[int]
    lines: list[str]

    def rows(self) -> list[list[str]]:
        """The cells of each sample."""
        return _split_all(self.lines, self.numbers, self.delimiter)


def layout(text: str, delimiter: str | None, decimal: str | None) -> Layout:
    """Find the layout of a text with one sample a line.

    Raises
    ------
    ValueError
        If there is no sample, a row is too long or short, or the first line is half a header.
    """
    every = text.split("\n")
    numbers = [k for k, line in enumerate(every, start=1) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    if not numbers:
        raise ValueError("the file is empty, there is no header and no sample")
    lines = [every[k - 1] for k in numbers]
    delimiter, decimal = _signs(lines, delimiter, decimal)
    top = _split_all(lines[:2], numbers, delimiter)
    below = _split_all(_spread(lines[1:]), _spread(numbers[1:]), delimiter)
    width = _most_common([len(row) for row in [top[0], *below]])
    header, units = _heads(top, [row for row in below if len(row) == width], numbers[0], width, decimal)
    first = header + units
    if first == len(lines):
        raise ValueError("there is a header, but no sample")
    if header:
        names = _words(lines[0]) if delimiter == " " else top[0]
    else:
        names = _commented(every[: numbers[0] - 1], delimiter, width, decimal) or [str(k) for k in range(width)]
    if len(names) != width:
        raise ValueError(f"line {numbers[0]} names {len(names)} columns, most lines below have {width} cells")
    columns = [_column(place, label) for place, label in enumerate(names)]
    if units:
        columns = [c._replace(unit=c.unit or _unit(cell)) for c, cell in zip(columns, top[1], strict=True)]
    found = Layout(columns, delimiter, decimal, numbers[first:], lines[first:])
    widths = _widths(found)
    if set(widths) != {width}:
        k = next(k for k, cells in enumerate(widths) if cells != width)
        raise ValueError(_uneven(found.numbers[k], width, widths[k], delimiter))
    return found


def _widths(found: Layout) -> list[int]:
    """The number of cells of each sample."""
    if any('"' in line for line in found.lines):
        return [len(row) for row in found.rows()]
    if found.delimiter == " ":
        return [len(line.split()) for line in found.lines]
    return [line.count(found.delimiter) + 1 for line in found.lines]


def _signs(lines: list[str], delimiter: str | None, decimal: str | None) -> tuple[str, str]:
    """The delimiter and the decimal sign, as far as they are not given."""
    looked_at = _spread(lines)
    quoted = any('"' in line for line in looked_at)
    candidates = [
        (between, point)
        for between in ([delimiter] if delimiter else DELIMITERS)
        for point in ([decimal] if decimal else DECIMALS)
        if between != point or quoted
    ]
    if not candidates:
        raise ValueError(f"the cells and the decimals are both parted by {delimiter!r}: one of them must be another")
    best = max(candidates, key=lambda signs: _score(looked_at, *signs))
    if _score(looked_at, *best) == 0.0 and delimiter is None:
        present = (between for between in DELIMITERS if any(between in line.strip() for line in looked_at))
        return next(present, " "), decimal or "."
    return best


def _score(lines: list[str], delimiter: str, decimal: str) -> float:
    rows = [_split(line, delimiter) for line in lines]
    width = _most_common([len(row) for row in rows])
    if width < 2:
        return 0.0
    cells = [cell for row in rows for cell in row]
    plain = sum(cell.lower() in MISSING or parse(cell, decimal) is not None for cell in cells)
    return sum(len(row) == width for row in rows) / len(rows) * plain / len(cells)


def _split_all(lines: list[str], numbers: list[int], delimiter: str) -> list[list[str]]:
    if any('"' in line for line in lines):
        rows = []
        for line, number in zip(lines, numbers, strict=False):
            try:
                rows.append(_split(line, delimiter, strict=True))
            except csv.Error as error:
                raise ValueError(f"line {number}: a quoted cell is not closed or too long ({error})") from None
        return rows
    if delimiter == " ":
        return [line.split() for line in lines]
    return [line.strip(" ").split(delimiter) for line in lines]


def _split(line: str, delimiter: str, *, strict: bool = False) -> list[str]:
    if '"' in line:
        try:
            cells = next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True, strict=strict))
        except csv.Error:
            if strict:
                raise
            cells = [line]
    elif delimiter == " ":
        return line.split()
    else:
        cells = line.strip(" ").split(delimiter)
    return [cell.strip() for cell in cells]


def _words(line: str) -> list[str]:
    """Names parted by white space; a unit in brackets belongs to the name before it."""
    return (
        next(csv.reader([line.strip()], delimiter=" ", skipinitialspace=True)) if '"' in line else _WORD.findall(line)
    )


def _heads(rows: list[list[str]], below: list[list[str]], line: int, width: int, decimal: str) -> tuple[bool, bool]:
    """Whether the first line is a header, and whether the second one holds units."""
    kinds = [[_kind(row[place], decimal) for row in below] for place in range(width)]
    numeric = {place for place, found in enumerate(kinds) if found.count("number") >= max(1, found.count("text"))}
    if not numeric:  # nothing below to compare with
        kinds_above = [_kind(cell, decimal) for cell in rows[0]]
        return "text" in kinds_above or "number" not in kinds_above, False
    found = [
        {place: _kind(cell, decimal) for place, cell in enumerate(row) if len(row) != width or place in numeric}
        for row in rows
    ]
    header = "text" in found[0].values()
    if header and "number" in found[0].values():
        texts = [place for place, kind in found[0].items() if kind == "text"]
        counts = [place for place, kind in found[0].items() if kind == "number"]
        raise ValueError(
            f"line {line} is half a header: column {counts[0]} holds the number {rows[0][counts[0]]!r}, column "
            f"{texts[0]} the text {rows[0][texts[0]]!r}; name every column, or begin the line with #"
        )
    return header, header and len(rows[1]) == width and set(found[1].values()) == {"text"}


def _kind(cell: str, decimal: str) -> str:
    cell = cell.strip()
    return "missing" if cell.lower() in MISSING else "text" if parse(cell, decimal) is None else "number"


def _commented(above: list[str], delimiter: str, width: int, decimal: str) -> list[str] | None:
    """Names in the last comment above the samples, if they are as many as the columns."""
    comments = [line.strip() for line in above if line.strip()]
    if not comments:
        return None
    line = comments[-1].lstrip("".join(COMMENTS))
    names = _words(line) if delimiter == " " else _split(line, delimiter)
    is_named = len(names) == width and all(_kind(name, decimal) == "text" for name in names)
    return names if is_named else None


def _column(place: int, label: str) -> Column:
    parts = _HEADING.fullmatch(label.strip())
    return Column(place, parts["name"], parts["unit"].strip()) if parts else Column(place, label.strip(), "")


def _unit(cell: str) -> str:
    text = cell.strip()
    unit = text.removeprefix("[").removeprefix("(").removesuffix("]").removesuffix(")").strip()
    return "" if unit == "-" else unit


def _uneven(line: int, expected: int, got: int, delimiter: str) -> str:
    between = DELIMITERS.get(delimiter, repr(delimiter))
    return (
        f"line {line}: expected {expected} cells, got {got} (parted by {between}); mend the line, begin it with # if "
        "it is no sample, or say what parts the cells by delimiter="
    )


def _most_common(widths: list[int]) -> int:
    return Counter(widths).most_common(1)[0][0]


def _spread(items: list[T]) -> list[T]:
    """Some of the items: those at the top, and as many spread over the rest."""
    head, rest = items[: _LOOKED_AT // 2], items[_LOOKED_AT // 2 :]
    return head + rest[:: max(1, len(rest) // (_LOOKED_AT // 2))]
