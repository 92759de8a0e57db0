"""The header of an AT2 file of PEER, whose last line states the number of values and the step.

Its spelling has changed over the years::

    NPTS=  4000, DT= .00500 SEC        PEER Strong Motion Database, and NGA-West2
    NPTS=4000,    DT=0.0050SEC         NGA
    4000    0.0050    NPTS, DT         NGA
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


class PeerHeader(NamedTuple):
    """The line of a PEER file that states the number of values and the step, and its number from 1."""

    line: int
    n_values: int
    step: float


def peer_header(lines: list[str]) -> PeerHeader | None:
    """The last of some lines that states NPTS and DT, because a corrected record may have its old header above."""
    for number in range(len(lines), 0, -1):
        line = lines[number - 1]
        if (n_values := _NPTS.search(line)) and (step := _DT.search(line)):
            return PeerHeader(number, int(n_values[1]), _real(step[1]))
        for form in _IN_ORDER:
            if both := form.search(line):
                return PeerHeader(number, int(both[1]), _real(both[2]))
    return None


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
