"""Texts of ground motions: what their headers state, and numbers in reading order below them.

The line of a header that states the number of values and the step has changed its spelling in the AT2 files of PEER
over the years, and COSMOS has one above each block of numbers::

    NPTS=  4000, DT= .00500 SEC        PEER Strong Motion Database, and NGA-West2
    NPTS=4000,    DT=0.0050SEC         NGA
    4000    0.0050    NPTS, DT         NGA
    4000 points of accel data equally spaced at  .005 sec, in cm/sec2. (8f10.6)

Numbers stand as many to a line as the format has, with blanks, commas or nothing between them, as programs in Fortran
write them: ``-.1234567E-02-.2345678E-02``. An exponent may be written with E, with D, or with three digits and its sign
alone. Only the last line may be shorter than the others.
"""

import math
import re
from contextlib import suppress
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.files._table import COMMENTS, require, shown

TOP = 60
"""Lines from the top of a file in which NPTS and DT are looked for."""

_REAL = r"((?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?)"
_NPTS = re.compile(r"\bNPTS?\s*[=:]?\s*(\d+)", re.IGNORECASE)
_DT = re.compile(rf"\bDT\s*[=:]?\s*{_REAL}", re.IGNORECASE)
_IN_ORDER = re.compile(
    rf"^\s*(\d+)[\s,]+{_REAL}[\s,]*NPTS\W+DT\b|\bNPTS\s*,?\s*DT\s*[=:]?\s*(\d+)[\s,]+{_REAL}", re.IGNORECASE
)
_BLOCK = re.compile(
    rf"[ \t]*(\d+)\s+points\s+of\s+acc\w*\s+data\s+equally\s+spaced\s+at\s+{_REAL}\s*sec", re.IGNORECASE
)
_NUMBERS_ONLY = re.compile(r"[\d\s.,;+\-eEdD]*")

_EXPONENT = r"[EeDd][+-]?(?:\d{1,3}(?![\d.])|\d{2}(?=[\d.]))"  # two digits where the next number follows at once
_NUMBER = re.compile(
    rf"(?P<mantissa>[+-]?(?:\d+\.\d*|\.\d+))(?:(?P<exponent>{_EXPONENT})|(?P<bare>[+-]\d{{3}})(?![\d.]))?"
    rf"|(?P<whole>[+-]?\d+(?:{_EXPONENT})?)"
)
_BETWEEN = re.compile(r"\s*[,;]\s*|\s+")
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?")
_BEGIN = "+-.0123456789"  # of a number
_LOOKED_AT = 1000  # lines for the decimal sign
_LONGEST = 60  # letters of a line in a message


class StatedValues(NamedTuple):
    """A line that states the number of values and the step, by its number from 1."""

    line: int
    n_values: int
    step: float


def peer_header(lines: list[str]) -> StatedValues | None:
    """The last of some lines that states NPTS and DT, because a corrected record may have its old header above."""
    for number in range(len(lines), 0, -1):
        line = lines[number - 1]
        if (n_values := _NPTS.search(line)) and (step := _DT.search(line)):
            return StatedValues(number, int(n_values[1]), _real(step[1]))
        if both := _IN_ORDER.search(line):
            return StatedValues(number, int(both[1] or both[3]), _real(both[2] or both[4]))
    return None


def cosmos_blocks(lines: list[str], skip: int) -> list[StatedValues]:
    """Every line below the first `skip` ones above a block of accelerations, as files of COSMOS have it."""
    numbered = [(number, _BLOCK.match(line)) for number, line in enumerate(lines, 1) if number > skip]
    return [StatedValues(number, int(block[1]), _real(block[2])) for number, block in numbered if block]


def block_below(lines: list[str], line: int) -> list[str]:
    return lines[:line] + list(takewhile(_NUMBERS_ONLY.fullmatch, lines[line:]))


def check_quantity(header: str) -> None:
    words = {word.upper() for word in re.findall(r"[A-Za-z]+", header)}
    other = next((word for word in ("VELOCITY", "DISPLACEMENT") if word in words), None)
    require(
        other is None or any(word.startswith("ACC") for word in words),
        f"the header says {other}: load the file of the acceleration, which PEER calls .AT2",
    )


class NumberList(NamedTuple):
    """The numbers, the text above them, and how many stand in which lines."""

    values: FloatArray
    header: str
    widths: list[int]
    lines: list[int]

    def check_widths(self) -> None:
        """Raise a ValueError unless every line but the last has as many numbers as the first."""
        first = self.widths[0]
        for width, line in zip(self.widths, self.lines, strict=True):
            require(
                width == first or (width < first and line == self.lines[-1]),
                f"line {line}: expected {first} numbers as in line {self.lines[0]}, got {width}; if the lines "
                f"above belong to the header, pass skip={line - 1}",
            )


def number_list(lines: list[str], decimal: str | None, skip: int = 0) -> NumberList:
    """All numbers of a text after `skip` lines, or from the first line of numbers on; ValueError for anything else."""
    if (decimal or _decimal_sign(lines[skip:])) == ",":
        lines = [line.replace(",", ".") for line in lines]
    samples = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    places = [k for k in samples if k >= skip] if skip else _from_numbers_on(lines, samples)
    require(places, "there are no numbers" + (f" below line {skip}" if skip else ""))
    rows = [_numbers(lines[k], k + 1) for k in places]
    values = np.array([value for row in rows for value in row])
    return NumberList(values, "\n".join(lines[: places[0]]), [*map(len, rows)], [k + 1 for k in places])


def _from_numbers_on(lines: list[str], samples: list[int]) -> list[int]:
    """The samples from the first line of numbers on; a line above that looks like one with a fault in it is refused."""
    above = ""
    for at, place in enumerate(samples):
        try:
            width = len(_numbers(lines[place], place + 1))
        except ValueError:
            above = lines[place].strip()
            continue
        cells = [cell for cell in _BETWEEN.split(above) if cell]
        n_plain = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
        require(
            width == 1 or len(cells) != width or 2 * n_plain <= width,
            f"line {place}: expected {width} numbers or a header, got {shown(above, _LONGEST)}; correct the number, "
            "or begin the line with #",
        )
        return samples[at:]
    return []


def _decimal_sign(lines: list[str]) -> str:
    """The comma where blanks or semicolons divide numbers with one comma each and no point."""
    rows = [re.split(r"[\s;]+", line.strip()) for line in lines[:_LOOKED_AT] if line.strip()]
    rows = [row for row in rows if all(re.fullmatch(r"[\d+\-.,EeDd]+", cell) for cell in row)]
    cells = [cell for row in rows for cell in row if "," in cell]
    if not cells or any("." in cell for row in rows for cell in row) or not all(map(_WITH_COMMA.fullmatch, cells)):
        return "."
    is_clear = max(map(len, rows)) > 1
    advice = 'pass decimal="," for one number, decimal="." for two'
    require(is_clear, f"{shown(cells[0])} may be one number or two: {advice}")
    return ","


def _numbers(line: str, number: int) -> list[float]:
    """The numbers of a line; a ValueError if it holds something else."""
    text, values, place = line.strip(), list[float](), 0
    with suppress(ValueError):  # numbers that blanks divide, which are most
        values = [float(cell) for cell in text.split()]
        if "_" not in text and all(map(math.isfinite, values)):
            return values
        values = []
    while place < len(text):
        match = _NUMBER.match(text, place)
        values.append(math.nan if match is None else _value(match))
        if match is None or not math.isfinite(values[-1]):
            raise ValueError(
                f"line {number}: expected finite numbers, got {shown(text, _LONGEST)}; correct the line, or if it "
                f"belongs to the header, pass skip={number}"
            )
        between = _BETWEEN.match(text, match.end())
        place = between.end() if between else match.end()
        is_joined = between is None and text[place : place + 1] in (*_BEGIN,)
        is_clear = not match["whole"] and (match["exponent"] or match["bare"] or text[place : place + 1] in ("+", "-"))
        require(
            is_clear or not is_joined,
            f"line {number}: it is not clear where the numbers end in {shown(text, _LONGEST)}: put blanks between them",
        )
    return values


def _value(match: re.Match[str]) -> float:
    return float(f"{match['mantissa']}E{match['bare']}") if match["bare"] else _real(match[0])


def _real(text: str) -> float:
    return float(text.upper().replace("D", "E"))
