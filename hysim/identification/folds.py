"""Samples that are left out together in a cross-validation."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._cycles import TOLERANCE
from hysim.records import Record


def folds(count: str | int, n: int, *, name: str = "folds") -> list[npt.NDArray[np.intp]]:
    """Samples of each fold of `n`: ``"loo"`` is one at a time, an int that many blocks; else a ValueError."""
    number = n if count == "loo" else count
    if not isinstance(number, int) or isinstance(number, bool) or not 2 <= number <= n:
        raise ValueError(f'{name} must be "loo" or a number of blocks from 2 to {n}, got {count!r}')
    return np.array_split(np.arange(n), number)


def left_out(cross_validate: str | int | None, records: Sequence[Record]) -> list[npt.NDArray[np.intp]]:
    """Samples of each fold of records that follow each other, by `cross_validate` of `identify`; else a ValueError."""
    if cross_validate is None:
        return []
    cuts = [0, *np.cumsum([len(record) for record in records]).tolist()]
    if cross_validate == "records":
        if len(records) < 2:
            raise ValueError('cross_validate="records" needs at least 2 records')
        return np.split(np.arange(cuts[-1]), cuts[1:-1])
    if cross_validate == "cycles":
        return _cycles(records, cuts)
    return folds(cross_validate, cuts[-1], name="cross_validate")


def _cycles(records: Sequence[Record], cuts: Sequence[int]) -> list[npt.NDArray[np.intp]]:
    cycles = []
    for record, begin in zip(records, cuts, strict=False):
        turns = record.reversals(TOLERANCE)[1::2]
        cycles += [begin + samples for samples in np.split(np.arange(len(record)), turns)[1:]]
    if not cycles:
        raise ValueError('cross_validate="cycles" needs at least 2 cycles of the input')
    return cycles
