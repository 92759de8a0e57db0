"""A law and its linear rival on samples that they have not seen.

What is left out at a time is a record, if there are several; of one record a rate, if its cycles have several; else a
cycle, if there are three; else a few blocks. The start of each record is always seen, since it tells the memory, or
the state, at the first sample.

An error on these samples is small enough if it is not above FACTOR times the error of the law on what it has seen,
where records or rates are left out, or else times the noise. It is so too if it is not above UNEXPLAINED times what a
curve without memory, a cubic of the input, leaves. Neither is asked where samples go beyond the range of those seen.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
import numpy.typing as npt

from hysim._cycles import TOLERANCE, complete_cycles
from hysim._frozen import FloatArray
from hysim.discovery._rates import Samples, at_one_rate
from hysim.discovery._rival import FLOOR, Rival
from hysim.errors import SimulationError
from hysim.identification.folds import folds as blocks
from hysim.records import Record

FACTOR = 2.0
UNEXPLAINED = 0.2

_FOLDS = 5
_START = 0.1  # of each record is always seen
_INSIDE = 0.05  # spans of the input by which left-out samples may reach beyond the others
_CURVE = 3


class Law(Protocol):
    """What is judged: an output at the samples of an input, without time."""

    def response(self, u: npt.ArrayLike, /) -> FloatArray:
        """Output at the samples of `u`."""
        ...


Refit = Callable[[Sequence[Record], Sequence[FloatArray]], Sequence[Law]]
"""Laws, one for each record, fitted again where the weights (n_samples,) are not zero."""


@dataclass(frozen=True)
class Trial:
    """Rmse of law and rival on held-out samples, and what was left out at a time.

    `enough` is the rmse that explains the samples, `floor` one below which nothing counts.
    """

    law: float
    rival: float
    by: str
    enough: float
    floor: float


def held_out(records: Sequence[Record], refit: Refit, linear: Rival | None) -> Trial:
    """Fit law and rival again without some of the samples, and see what they say of these; nan for no rival."""
    u, y = (np.concatenate([getattr(record, name) for record in records]) for name in ("u", "y"))
    cuts = np.cumsum([len(record) for record in records])[:-1]
    by, left_out = _folds(records)
    law, other, fitted, covered = [], [], [], True
    for samples in left_out:
        seen = np.ones(y.size)
        seen[samples] = 0.0
        weights = np.split(seen, cuts)
        residual = y - _outputs(records, partial(refit, records, weights))
        law.append(residual[samples])
        fitted.append(residual[seen > 0.0])
        if linear is not None:
            other.append((y - np.concatenate(linear.refitted(records, weights).outputs(records)))[samples])
        covered &= _covers(u[seen > 0.0], u[samples])
    floor = FLOOR * float(np.ptp(y))
    noise = _rms(fitted) if by in ("record", "rate") else _noise(records)
    memory = float(np.std(y - np.polynomial.Polynomial.fit(u, y, _CURVE)(u)))
    enough = max(FACTOR * noise, UNEXPLAINED * memory) + floor if covered else math.inf
    return Trial(_rms(law), _rms(other), by, enough, floor)


def _covers(seen: FloatArray, other: FloatArray) -> bool:
    """Whether the inputs seen have about the range of the others: no law is judged by what it says beyond it."""
    beyond = _INSIDE * float(np.ptp(np.append(seen, other)))
    return bool(other.min() >= seen.min() - beyond and other.max() <= seen.max() + beyond)


def _folds(records: Sequence[Record]) -> tuple[str, list[Samples]]:
    """What is left out at a time, and its samples among those of all records; the start of a record never is."""
    lengths = [len(record) for record in records]
    begins = np.cumsum([0, *lengths])[:-1]
    kept = np.ones(sum(lengths), dtype=bool)
    for begin, length in zip(begins, lengths, strict=True):
        kept[begin : begin + math.ceil(_START * length)] = False
    by, parts = "record", [begin + np.arange(length) for begin, length in zip(begins, lengths, strict=True)]
    if len(records) == 1:
        by, parts = "rate", at_one_rate(records[0])
        if len(parts) == 1:
            cycles = complete_cycles(records[0].u, TOLERANCE)[::-1]
            by, parts = "cycle", [np.arange(*cycle.path.indices(lengths[0])) for cycle in cycles]
            if len(parts) < 3:
                by, parts = "block", blocks(min(2 * _FOLDS, lengths[0]), lengths[0])
    groups = [np.unique(np.concatenate(parts[k::_FOLDS])) for k in range(min(_FOLDS, len(parts)))]
    return by, [group[kept[group]] for group in groups if kept[group].any()]


def _outputs(records: Sequence[Record], laws: Callable[[], Sequence[Law]]) -> FloatArray:
    """Free runs of the laws one after the other; inf where they cannot be fitted or diverge."""
    try:
        return np.concatenate([law.response(record.u) for law, record in zip(laws(), records, strict=True)])
    except (SimulationError, ValueError):
        return np.full(sum(len(record) for record in records), math.inf)


def _noise(records: Sequence[Record]) -> float:
    """Rms of white noise as the third differences of the outputs show it, those of smooth outputs being small."""
    return _rms([np.diff(record.y, 3) for record in records]) / math.sqrt(20.0)


def _rms(parts: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else math.nan
