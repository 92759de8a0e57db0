"""Cells of a text into numbers."""

import math
import re

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import shown

MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Cells that stand for a missing value, in upper or lower case."""

_HAS_COMMA = re.compile(r"[+-]?\d[\d.]*,\d+")


def parse(cell: str, decimal: str) -> float | None:
    """The number in a cell, or None if it holds none."""
    if decimal == ",":
        if "." in cell or cell.endswith(","):
            return None
        cell = cell.replace(",", ".")
    try:
        return None if "_" in cell else float(cell)  # Python would take 1_0 for 10
    except ValueError:
        return None


def plain_numbers(lines: list[str], places: list[int], delimiter: str, decimal: str) -> FloatArray | None:
    """Columns of lines, shape (n_columns, n_lines), None unless all are finite numbers; much faster than `numbers`."""
    if decimal == ",":
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


def numbers(cells: list[str], lines: list[int], label: str, decimal: str) -> FloatArray:
    """The numbers of a column, nan where one is missing; `lines` are the numbers of the cells' lines for messages."""
    return np.array([_number(cell, line, label, decimal) for cell, line in zip(cells, lines, strict=True)])


def _number(cell: str, line: int, label: str, decimal: str) -> float:
    value = parse(cell, decimal)
    if value is not None and not math.isinf(value):
        return value
    cell = cell.strip()
    if cell.lower() in MISSING:
        return math.nan
    advice = _advice(cell, decimal)
    raise ValueError(f"line {line}, column {shown(label)}: expected a finite number, got {shown(cell)}{advice}")


def _advice(cell: str, decimal: str) -> str:
    if decimal == "." and _HAS_COMMA.fullmatch(cell):
        return ' (pass decimal="," if the comma is the decimal sign)'
    if decimal == "," and "." in cell:
        return ' (pass decimal="." if the point is the decimal sign; remove points between thousands)'
    return ""
