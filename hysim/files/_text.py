"""The lines of a text file, and its cells as numbers.

Signs between thousands are an apostrophe or a space, and the point or comma that is not the decimal sign where a cell
can mean nothing else: ``1.000,5`` and ``1.000.000``, but not ``1.000``, unless that sign is given.
"""

import codecs
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import BinaryIO, NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import COMMENTS, shown

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
        """The lines that are neither blank nor comments."""
        for numbers, texts in self.lines():
            begins = {line[:1] for line in texts}
            if not any(sign in ("", *COMMENTS) or sign.isspace() for sign in begins):
                yield Lines(numbers, texts)
                continue
            kept = [k for k, line in enumerate(texts) if line.strip() and not line.lstrip().startswith(COMMENTS)]
            yield Lines([numbers[k] for k in kept], [texts[k] for k in kept])

    def whole(self) -> str:
        """All of the text."""
        return "\n".join(line for lines in self.lines() for line in lines.texts)

    def _no_text(self, encoding: str, reason: str) -> str:
        return (
            f"{self.name} is not a {encoding}text file: {reason}; and it does not begin as NPZ, NPY, MAT (-v7, -v7.3) "
            'or HDF5 files do; if it is text, pass its encoding, for instance encoding="latin-1"'
        )


class Signs(NamedTuple):
    """The decimal sign of a text, and the sign between its thousands if it is given."""

    decimal: str
    thousands: str | None = None


def parse(cell: str, signs: Signs) -> float | None:
    """The number in a cell, or None if it holds none."""
    cell = _without_thousands(cell.strip().replace("\u2212", "-"), signs)  # the minus sign of typesetters
    if signs.decimal == ",":
        if "." in cell or cell.endswith(","):
            return None
        cell = cell.replace(",", ".")
    try:
        return None if "_" in cell else float(cell)  # Python would take 1_0 for 10
    except ValueError:
        return None


def _without_thousands(cell: str, signs: Signs) -> str:
    """The cell without the signs between its thousands, if it has any."""
    number = _GROUPED.fullmatch(cell)
    if number is None or number["mark"] == signs.decimal or number["point"] not in (None, signs.decimal):
        return cell
    mark, whole = number["mark"], number["whole"]
    is_clear = mark not in ".," or number["point"] or whole.count(mark) > 1 or mark == signs.thousands
    return number["sign"] + whole.replace(mark, "") + number["rest"] if is_clear else cell


def plain_numbers(lines: list[str], places: list[int], delimiter: str, signs: Signs) -> FloatArray | None:
    """Columns of lines, shape (n_columns, n_lines), None unless all are finite numbers; much faster than `numbers`."""
    if signs.thousands is not None:
        return None
    if signs.decimal == ",":
        if delimiter == "," or any("." in line for line in lines):
            return None
        lines = [line.replace(",", ".") for line in lines]
    if any("_" in line or '"' in line for line in lines):
        return None
    try:
        values = np.loadtxt(
            lines, delimiter=None if delimiter == " " else delimiter, usecols=places, comments=None, ndmin=2
        )
    except ValueError:
        return None
    return np.ascontiguousarray(values.T) if np.isfinite(values).all() else None


def numbers(cells: list[str], lines: Sequence[int], label: str, signs: Signs) -> FloatArray:
    """The numbers of a column, nan where one is missing; `lines` are the numbers of the cells' lines for messages."""
    return np.array([_number(cell, line, label, signs) for cell, line in zip(cells, lines, strict=True)])


def _number(cell: str, line: int, label: str, signs: Signs) -> float:
    value = parse(cell, signs)
    if value is not None and not math.isinf(value):
        return value
    cell = cell.strip()
    if cell.lower() in MISSING:
        return math.nan
    advice = _advice(cell, signs)
    raise ValueError(f"line {line}, column {shown(label)}: expected a finite number, got {shown(cell)}{advice}")


def _advice(cell: str, signs: Signs) -> str:
    """Advice on a cell that is a time of day, or whose point or comma has the other meaning."""
    if _CLOCK.fullmatch(cell):
        return " (a time of day: write it in seconds, or load without time: t=False)"
    other = {".": ",", ",": "."}[signs.decimal]
    name = {".": "point", ",": "comma"}[other]
    number = _GROUPED.fullmatch(cell)
    thousands = (
        f'thousands="{other}" if the {name} stands between thousands' if number and number["mark"] == other else ""
    )
    decimal = (
        f'decimal="{other}" if the {name} is the decimal sign'
        if cell.count(other) == 1 and signs.decimal not in cell
        else ""
    )
    advice = ", ".join(filter(None, (decimal, thousands)))
    return f" (pass {advice})" if advice and parse(cell.replace(other, ""), signs) is not None else ""
