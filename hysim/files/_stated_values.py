"""Lines of a header that state the number of values below them and the step.

That of the AT2 files of PEER has changed its spelling over the years, and COSMOS has one above each block of numbers::

    NPTS=  4000, DT= .00500 SEC        PEER Strong Motion Database, and NGA-West2
    NPTS=4000,    DT=0.0050SEC         NGA
    4000    0.0050    NPTS, DT         NGA
    4000 points of accel data equally spaced at  .005 sec, in cm/sec2. (8f10.6)
"""

import re
from typing import NamedTuple

from hysim.files._table import require

TOP = 60
"""Lines from the top of a file in which NPTS and DT are looked for."""

_REAL = r"((?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?)"
_NPTS = re.compile(r"\bNPTS?\s*[=:]?\s*(\d+)", re.IGNORECASE)
_DT = re.compile(rf"\bDT\s*[=:]?\s*{_REAL}", re.IGNORECASE)
_IN_ORDER = (
    re.compile(rf"^\s*(\d+)[\s,]+{_REAL}[\s,]*NPTS\W+DT\b", re.IGNORECASE),
    re.compile(rf"\bNPTS\s*,?\s*DT\s*[=:]?\s*(\d+)[\s,]+{_REAL}", re.IGNORECASE),
)
_BLOCK = re.compile(
    rf"^[ \t]*(\d+)\s+points\s+of\s+acc\w*\s+data\s+equally\s+spaced\s+at\s+{_REAL}\s*sec.*$",
    re.IGNORECASE | re.MULTILINE,
)
_NUMBERS_ONLY = re.compile(r"[\d\s.,;+\-eEdD]*")


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
        for form in _IN_ORDER:
            if both := form.search(line):
                return StatedValues(number, int(both[1]), _real(both[2]))
    return None


def cosmos_blocks(text: str, skip: int) -> list[StatedValues]:
    """Every line below the first `skip` ones above a block of accelerations, as files of COSMOS have it."""
    blocks = [
        StatedValues(text.count("\n", 0, found.start()) + 1, int(found[1]), _real(found[2]))
        for found in _BLOCK.finditer(text)
    ]
    return [block for block in blocks if block.line > skip]


def block_below(text: str, line: int) -> str:
    """A text as far as the numbers below a line go."""
    lines = text.split("\n")
    end = next((k for k in range(line, len(lines)) if not _NUMBERS_ONLY.fullmatch(lines[k])), len(lines))
    return "\n".join(lines[:end])


def _real(text: str) -> float:
    return float(text.upper().replace("D", "E"))


def check_quantity(header: str) -> None:
    """Refuse the velocities and displacements that are published beside accelerations."""
    words = {word.upper() for word in re.findall(r"[A-Za-z]+", header)}
    other = next((word for word in ("VELOCITY", "DISPLACEMENT") if word in words), None)
    require(
        other is None or any(word.startswith("ACC") for word in words),
        f"the header says {other}: load the file of the acceleration, which PEER calls .AT2",
    )
