"""Cells of a text into numbers.

Signs between thousands are an apostrophe or a space, and the point or comma that is not the decimal sign where a cell
can mean nothing else: ``1.000,5`` and ``1.000.000``, but not ``1.000``, unless that sign is given.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import shown

MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Cells that stand for a missing value, in upper or lower case."""

THOUSANDS = ".,'\u2019 \u00a0\u2009\u202f"
"""Signs that may stand between thousands: a point, a comma, apostrophes and spaces of some widths."""

_GROUPED = re.compile(
    rf"(?P<sign>[+-]?)(?P<whole>\d{{1,3}}(?P<mark>[{THOUSANDS}])\d{{3}}(?:(?P=mark)\d{{3}})*)(?P<rest>(?P<point>[.,])?\d*)"
)


_CLOCK = re.compile(r"(\S+[ T])?\d{1,2}:\d\d(:\d\d([.,]\d*)?)?")


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
