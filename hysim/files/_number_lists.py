"""Numbers in reading order below a text header, as programs in Fortran write them.

Numbers stand as many to a line as the format has, with blanks, commas or nothing between them:
``-.1234567E-02-.2345678E-02``. An exponent may be written with E, with D, or with three digits and its sign alone. Only
the last line may be shorter than the others.
"""

import math
import re
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import COMMENTS, require, shown

_EXPONENT = r"[EeDd][+-]?(?:\d{1,3}(?![\d.])|\d{2}(?=[\d.]))"  # two digits where the next number follows at once
_NUMBER = re.compile(
    rf"(?P<mantissa>[+-]?(?:\d+\.\d*|\.\d+))(?P<exponent>{_EXPONENT}|[+-]\d{{3}}(?![\d.]))?"
    rf"|(?P<whole>[+-]?\d+(?:{_EXPONENT})?)"
)
_BETWEEN = re.compile(r"\s*[,;]\s*|\s+")
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?")
_BEGIN = "+-.0123456789"  # of a number
_LOOKED_AT = 1000  # lines for the decimal sign
_LONGEST = 60  # letters of a line in a message


class NumberList(NamedTuple):
    """The numbers, the text above them, and how many stand in which lines."""

    values: FloatArray
    header: str
    widths: list[int]
    lines: list[int]

    def check_widths(self) -> None:
        """Raise a ValueError unless every line but the last has as many numbers as the first."""
        first, *others = self.widths
        for width, line in zip(others, self.lines[1:], strict=True):
            if width > first or (width < first and line != self.lines[-1]):
                raise ValueError(
                    f"line {line}: expected {first} numbers as in line {self.lines[0]}, got {width}; if the lines "
                    f"above belong to the header, pass skip={line - 1}"
                )


def number_list(text: str, decimal: str | None, skip: int = 0) -> NumberList:
    """All numbers of a text from the line after `skip`, or from the first line of numbers on.

    A ValueError names the first line below that holds something else.
    """
    lines = text.split("\n")
    sign = decimal or _decimal_sign(lines[skip:])
    begin = skip if skip else _first_numbers(lines, sign)
    places = [k for k in range(begin, len(lines)) if lines[k].strip() and not lines[k].lstrip().startswith(COMMENTS)]
    require(places, "there are no numbers" + (f" below line {skip}" if skip else ""))
    numbers = [k + 1 for k in places]
    body = [lines[k].replace(",", ".") if sign == "," else lines[k] for k in places]
    values, widths = _plain(body) or _row_by_row(body, numbers)
    return NumberList(values, "\n".join(lines[: places[0]]), widths, numbers)


def _first_numbers(lines: list[str], decimal: str) -> int:
    """Place of the first line that holds nothing but numbers; the number of lines if there is none."""
    above = ""
    for place, line in enumerate(lines):
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        try:
            width = len(_numbers(line.replace(",", ".") if decimal == "," else line, place + 1))
        except ValueError:
            above = line
            continue
        _check_header(above, width, place)
        return place
    return len(lines)


def _check_header(line: str, width: int, place: int) -> None:
    """Refuse a line above the numbers that is rather a line of numbers with a fault in it."""
    cells = [cell for cell in _BETWEEN.split(line.strip()) if cell]
    plain = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
    if width > 1 and len(cells) == width and 2 * plain > width:
        raise ValueError(
            f"line {place}: expected {width} numbers or a header, got {shown(line.strip(), _LONGEST)}; correct the "
            "number, or begin the line with #"
        )


def _decimal_sign(lines: list[str]) -> str:
    """The comma where blanks or semicolons divide numbers with one comma each and no point."""
    rows = [re.split(r"[\s;]+", line.strip()) for line in lines[:_LOOKED_AT] if line.strip()]
    rows = [row for row in rows if all(re.fullmatch(r"[\d+\-.,EeDd]+", cell) for cell in row)]
    cells = [cell for row in rows for cell in row if "," in cell]
    if not cells or any("." in cell for row in rows for cell in row) or not all(map(_WITH_COMMA.fullmatch, cells)):
        return "."
    if max(map(len, rows)) == 1:
        raise ValueError(
            f'{shown(cells[0])} may be one number or two: pass decimal="," for one number, decimal="." for two'
        )
    return ","


def _plain(lines: list[str]) -> tuple[FloatArray, list[int]] | None:
    """Numbers that blanks divide, None if there are others; much faster than line by line."""
    rows = [line.split() for line in lines]
    if any("_" in line for line in lines):
        return None
    try:
        values = np.array([float(cell) for row in rows for cell in row])
    except ValueError:
        return None
    return (values, [len(row) for row in rows]) if np.isfinite(values).all() else None


def _row_by_row(lines: list[str], numbers: list[int]) -> tuple[FloatArray, list[int]]:
    rows = [_numbers(line, number) for line, number in zip(lines, numbers, strict=True)]
    return np.array([value for row in rows for value in row]), [len(row) for row in rows]


def _numbers(line: str, number: int) -> list[float]:
    """The numbers of a line; a ValueError if it holds something else."""
    text, values, place = line.strip(), [], 0
    while place < len(text):
        match = _NUMBER.match(text, place)
        value = math.nan if match is None else _value(match)
        if match is None or not math.isfinite(value):
            raise ValueError(
                f"line {number}: expected finite numbers, got {shown(text, _LONGEST)}; correct the line, or if it "
                f"belongs to the header, pass skip={number}"
            )
        values.append(value)
        between = _BETWEEN.match(text, match.end())
        place = between.end() if between else match.end()
        joined = between is None and place < len(text) and text[place] in _BEGIN
        if joined and (match["whole"] or not (match["exponent"] or text[place] in "+-")):
            raise ValueError(
                f"line {number}: it is not clear where the numbers end in {shown(text, _LONGEST)}: put blanks between "
                "them"
            )
    return values


def _value(match: re.Match[str]) -> float:
    if match["whole"]:
        return float(match["whole"].upper().replace("D", "E"))
    exponent = (match["exponent"] or "E0").upper().replace("D", "E")
    return float(match["mantissa"] + (exponent if exponent.startswith("E") else f"E{exponent}"))
