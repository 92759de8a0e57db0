"""The search for the strokes that are worth most."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.design._candidates import through, with_another_segment
from hysim.design._criteria import Criterion, merit, spreads
from hysim.design._limits import InputLimits
from hysim.design._subjects import Subject, sizes_of

_BEST = 4  # candidates that are improved
_MOVE = 0.3  # of the amplitude: the first moves of a turning point; the last ones are a tenth of it
_PAUSES, _PAUSE = 0.3, 0.1  # share of the moves that change a pause, and their size beside _MOVE in parts of the record

Move = Callable[[FloatArray, InputLimits, np.random.Generator, float], FloatArray]


class Found(NamedTuple):
    """Strokes (n, 3) and what their input is worth."""

    strokes: FloatArray
    worth: float


def determined(subject: Subject, inputs: Sequence[FloatArray]) -> tuple[Subject, tuple[str, ...]]:
    """The subject without the numbers that none of these inputs determines, and a remark on each."""
    if not subject.tolerances:
        return subject, ()
    names, sizes = subject.names, sizes_of(subject.values)
    remarks: list[str] = []
    known = [subject.information(u) for u in inputs]
    allowed = np.array([subject.tolerances.get(name, np.inf) for name in names])
    kept = np.arange(len(names))
    while kept.size:
        errors = sizes[kept] * np.min([spreads(each[np.ix_(kept, kept)]) for each in known], axis=0)
        excess = np.where(np.isinf(allowed[kept]), 0.0, errors / allowed[kept])
        worst = int(np.argmax(excess))
        if not excess[worst] > 1.0:
            break
        place = kept[worst]
        enough = f" well enough: {errors[worst]:.3g} at best, and {allowed[place]:.3g} is needed"
        remarks.append(
            f"no input within the limits determines {names[place]}{enough * bool(np.isfinite(errors[worst]))}; "
            f"it is taken as known, {subject.values[place]:.4g}"
        )
        kept = np.delete(kept, worst)
    for name in names:
        if name not in np.array(names)[kept]:
            subject = subject.without(name)
    return subject, tuple(remarks)


def searched(
    drawn: Sequence[FloatArray],
    worth: Callable[[FloatArray], float],
    limits: InputLimits,
    move: Move,
    moves: int,
    rng: np.random.Generator,
) -> Found:
    """The best strokes after moves of the best that were drawn."""

    def tried(strokes: FloatArray) -> float:
        return worth(through(strokes, limits))

    ranked = sorted((Found(strokes, tried(strokes)) for strokes in drawn), key=lambda each: -each.worth)
    improved = [_improved(each, limits, tried, move, moves, rng) for each in ranked[:_BEST]]
    return max(improved, key=lambda each: each.worth, default=Found(np.empty((0, 3)), 0.0))


def _improved(
    best: Found,
    limits: InputLimits,
    tried: Callable[[FloatArray], float],
    move: Move,
    moves: int,
    rng: np.random.Generator,
) -> Found:
    """The strokes after random moves, those that are worth more being kept."""
    for k in range(moves):
        strokes = move(best.strokes, limits, rng, k / moves)
        trial = Found(strokes, tried(strokes))
        best = trial if trial.worth > best.worth else best
    return best


def one_moved(strokes: FloatArray, limits: InputLimits, rng: np.random.Generator, progress: float) -> FloatArray:
    """The strokes with one turning point, or its pause, moved; less and less as the search goes on."""
    trial, share = strokes.copy(), _MOVE * 0.1**progress * rng.standard_normal()
    place = rng.integers(len(trial))
    if rng.random() < _PAUSES:
        trial[place, 1] = max(0.0, trial[place, 1] + _PAUSE * share * limits.duration)
    else:
        moved = trial[place, 0] + share * limits.amplitude
        trial[place, 0] = min(max(moved, -limits.amplitude), limits.amplitude)
    return trial


def one_redrawn(strokes: FloatArray, limits: InputLimits, rng: np.random.Generator, progress: float) -> FloatArray:
    """The strokes with a stretch of them drawn anew."""
    return with_another_segment(strokes, limits, rng)


def value_of(subject: Subject, criterion: Criterion) -> Callable[[FloatArray], float]:
    """The worth of an input."""
    return lambda u: merit(subject.information(u), criterion)
