"""Whether an identified model stays plausible on inputs that its record does not hold.

It is tried inside the span of the record's input, after the record's own turning points: on the record's path at
smaller amplitudes, about its middle and shifted towards either end, on fading and growing stairs, and on minor loops
about three inputs on either branch. What counts is the output beside the line that fits the record best: its range on
the trials is compared with that on the record. A device stays inside the band of its outer loop or little beyond. A law
whose memory grows, or drifts from one minor loop to the next, leaves it by far: Bouc and Wen's does both outside its
admissible parameters, and drifts inside them where the hysteresis is weak.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.errors import SimulationError
from hysim.models.channels.dependent import AlongRecord
from hysim.models.protocols import Responding, needs_time
from hysim.records import Record

_FARTHEST = 1.0  # of the record's range beside the line: a device leaves it by less
_TURN = 0.01  # of the span: smaller reversals are noise, or change little
_MOST_TURNS = 40  # of the record's path that is tried at other amplitudes
_POINTS = 4  # on each branch
_STAIRS = 20
_SCALES = ((0.5, 0.0), (0.5, -1.0), (0.5, 1.0), (0.9, 0.0), (0.9, -1.0), (0.9, 1.0))  # amplitude, and fixed end
_LOOPS = ((-0.5, 0.1), (-0.5, 0.4), (0.0, 0.1), (0.0, 0.4), (0.5, 0.1), (0.5, 0.4))  # centre and amplitude
_REPEATED = 5


def implausible(models: Sequence[Any], records: Sequence[Record]) -> str:
    """A sentence where a trial of the models, one for each record, leaves the record's range; else the empty text.

    It is empty too where a model depends on time or on a channel that varies, or no input turns back.
    """
    k = max(range(len(records)), key=lambda k: float(np.ptp(records[k].u)))
    model, record = models[k], records[k]
    turning = record.reversals(tolerance=_TURN)
    if needs_time(model) or isinstance(model, AlongRecord) or not isinstance(model, Responding) or not turning.size:
        return ""
    line, low, high = _band(records)
    if high == low:
        return ""
    past = record.u[np.concatenate([[0], turning, [len(record) - 1]])]
    worst, where = 0.0, ""
    for name, path in _trials(past):
        try:
            beside = model.response(np.concatenate([past, path]))[past.size :] - np.polyval(line, path)
        except SimulationError:
            return f"the model diverges on {name} inside the span of the input: {_REMEDY}"
        beyond = max(float(beside.max()) - high, low - float(beside.min())) / (high - low)
        if beyond > worst:
            worst, where = beyond, name
    if worst <= _FARTHEST:
        return ""
    return (
        f"on {where} inside the span of the input the model leaves the range of the output beside a line by "
        f"{worst:.2g} times this range: {_REMEDY}"
    )


_REMEDY = "check it on a record of smaller cycles before you use it off this one"


def _band(records: Sequence[Record]) -> tuple[FloatArray, float, float]:
    """The line that fits all records best, and the lowest and highest output beside it."""
    u, y = np.concatenate([record.u for record in records]), np.concatenate([record.y for record in records])
    slope = float(np.dot(u - u.mean(), y - y.mean()) / np.dot(u - u.mean(), u - u.mean()))
    line = np.array([slope, y.mean() - slope * u.mean()])
    beside = y - np.polyval(line, u)
    return line, float(beside.min()), float(beside.max())


def _trials(past: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Names and inputs, between the lowest and the highest turning point of the past."""
    low, high = float(past.min()), float(past.max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    path = (past[-_MOST_TURNS:] - middle) / half
    scaled = [end + amplitude * (path - end) for amplitude, end in _SCALES]
    yield "the record's path at smaller amplitudes", middle + half * _sampled(np.concatenate(scaled))
    fading = (1.0 - np.arange(_STAIRS) / _STAIRS) * (-1.0) ** np.arange(_STAIRS)
    yield "fading and growing stairs", middle + half * _sampled(np.concatenate([fading, fading[::-1]]))
    loops: list[float] = []
    for centre, amplitude in _LOOPS:
        for outer in (1.0, -1.0):
            loops += [-outer, outer, *[centre - outer * amplitude, centre + outer * amplitude] * _REPEATED]
    yield "minor loops", middle + half * _sampled(np.array(loops))


def _sampled(corners: FloatArray) -> FloatArray:
    """A path through these corners with some samples on each branch."""
    places = np.arange((corners.size - 1) * _POINTS + 1) / _POINTS
    return np.interp(places, np.arange(corners.size), corners)
