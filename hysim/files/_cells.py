"""Cells into numbers."""

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
    try:
        return _floats([cell], decimal)[0]
    except ValueError:
        return None


def table(lines: list[str], places: list[int], delimiter: str, decimal: str) -> FloatArray | None:
    """Columns of lines that hold plain finite numbers there, shape (n_columns, n_lines); None if some do not."""
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
    """The numbers of a column, nan where one is missing.

    Raises
    ------
    ValueError
        If a cell is not a finite number; the message names its line.
    """
    try:
        values = np.array(_floats(cells, decimal))
    except ValueError:  # a value is missing, or is none
        values = np.array([_number(cell, line, label, decimal) for cell, line in zip(cells, lines, strict=True)])
    if np.isinf(values).any():
        k = int(np.argmax(np.isinf(values)))
        _number(cells[k], lines[k], label, decimal)
    return values


def _floats(cells: list[str], decimal: str) -> list[float]:
    joined = "\n".join(cells)
    if "_" in joined:
        raise ValueError("Python would take 1_0 for 10")
    if decimal == ",":
        if "." in joined or ",\n" in joined or joined.endswith(","):
            raise ValueError("a point, or a comma without decimals")
        cells = joined.replace(",", ".").split("\n")
    return list(map(float, cells))


def _number(cell: str, line: int, label: str, decimal: str) -> float:
    cell = cell.strip()
    if cell.lower() in MISSING:
        return math.nan
    value = parse(cell, decimal)
    if value is None or not math.isfinite(value):
        mend = _mend(cell, decimal)
        raise ValueError(f"line {line}, column {shown(label)}: expected a finite number, got {shown(cell)}{mend}")
    return value


def _mend(cell: str, decimal: str) -> str:
    if decimal == "." and _HAS_COMMA.fullmatch(cell):
        return ' (give decimal="," if the comma begins its decimals)'
    if decimal == "," and "." in cell:
        return ' (give decimal="." if the point begins its decimals; leave points between thousands out)'
    return ""
