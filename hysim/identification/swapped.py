"""Whether the input and the output of a record were swapped.

**By the columns.** The output is a generator's waveform, a triangle of equal steps or one sine, and the input is none.

**By a family.** An actuator's loop runs counterclockwise, and clockwise where the columns were swapped; but so does a
force that follows from a displacement. A clockwise record is doubted only where the same family fits well from y to u
and clearly better than from u to y, in a short fit on at most 500 samples whose error is an upper bound.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.identification._problem import Setting, problems
from hysim.identification._search import brief_cost
from hysim.identification.forms import SWAPPED
from hysim.models.protocols import Identifiable
from hysim.records import Record

_FEWEST = 20  # samples in which a waveform can be recognised
_SAME = 1e-6  # of a step: steps of a generator are equal but for rounding
_MOSTLY = 0.9  # of the steps are equal in a triangle; its turns may be samples of their own
_SMOOTH = 1e-3  # of the second differences: a sine's follow from its samples, noise adds to them
_MOST_SAMPLES = 500
_BETTER = 0.8  # of the forward error: a reverse fit that is better by chance, or by a parameter, is not
_GOOD = 0.1  # of the standard deviation: a reverse model that is worse describes nothing
_PERFECT = 1e-3  # forward errors below this leave nothing to suspect


def swapped_columns(records: Sequence[Record]) -> str:
    """A sentence if each record's output is a generator's waveform and its input is not; else the empty text."""
    if not all(_is_generated(record.y) and _moves(record.u) and not _is_generated(record.u) for record in records):
        return ""
    return (
        f"{SWAPPED}: y is a regular waveform, as a generator makes it, and u is not; check the columns, unless u was "
        "computed so that y is regular"
    )


def _moves(signal: FloatArray) -> bool:
    return bool(np.mean(np.diff(signal) != 0.0) >= _MOSTLY)


def _is_generated(signal: FloatArray) -> bool:
    steps = np.diff(signal)
    if signal.size < _FEWEST or not np.any(steps):
        return False
    length = float(np.median(np.abs(steps)))
    if np.mean(np.abs(np.abs(steps) - length) <= _SAME * length) >= _MOSTLY and length > 0.0:
        return True
    bends = np.diff(steps)  # of a sine: an affine function of the sample in the middle
    middle = np.stack([signal[1:-1], np.ones(bends.size)], axis=1)
    rest = bends - middle @ np.linalg.lstsq(middle, bends, rcond=None)[0]
    return bool(np.std(rest) <= _SMOOTH * np.std(bends) > 0.0)


def swapped_for(family: Identifiable, setting: Setting, error: float) -> str:
    """A sentence if the family fits the first record better from y to u; `error` is relative to the spread of y."""
    record = setting.records[0]
    if len(setting.records) > 1 or not error > _PERFECT or not _is_clockwise(record):
        return ""
    reverse = replace(record, u=record.y, y=record.u, resolution=None, units={})[:: -(-len(record) // _MOST_SAMPLES)]
    try:
        reversed_problem = problems(family, [reverse], setting.freedom, setting.initial)[0]
        if len(reversed_problem.space.names) >= len(reverse):
            return ""
        cost = brief_cost(reversed_problem)
    except (ValueError, TypeError, ArithmeticError, SimulationError):
        return ""  # what cannot be fitted in reverse was not swapped
    other = float(np.sqrt(cost / len(reverse)) / np.std(reverse.y))
    if not other < min(_BETTER * error, _GOOD):
        return ""
    return (
        f"{SWAPPED}: from y to u the same family leaves an error of {100.0 * other:.2g} % instead of "
        f"{100.0 * error:.2g} %, and the loop runs counterclockwise as an actuator's does; check the columns"
    )


def _is_clockwise(record: Record) -> bool:
    try:
        return metrics.loop_metrics(record.u, record.y).orientation == "clockwise"
    except ValueError:  # there is no complete cycle
        return False
