"""The verb `design_input`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.design._candidates import random_strokes, through, usual
from hysim.design._criteria import Criterion, information, merit
from hysim.design._limits import InputLimits
from hysim.design._result import InputDesign
from hysim.models.law import Law

_BEST = 4  # candidates that are improved
_MOVE = 0.3  # of the amplitude: the first moves of a turning point; the last ones are a tenth of it
_PAUSES, _PAUSE = 0.3, 0.1  # share of the moves that change a pause, and their size beside _MOVE in parts of the record


def design_input(
    law: Law,
    *,
    limits: InputLimits | Mapping[str, float],
    free: Sequence[str],
    noise: float = 1.0,
    criterion: Criterion = "D",
    candidates: int = 100,
    moves: int = 300,
    seed: int = 0,
) -> InputDesign:
    """Propose an input within limits that tells most of a law's numbers.

    The input is a row of strokes at the full slew between turning points, at some of which it is held. They are drawn
    at random, and those of the best candidates are moved as long as the Fisher information on the numbers grows: a
    search, which is not sure to find the best input. Noise is taken as white, so that a pause is as good as any sample.
    The information depends on the law; begin with what is known of it, and repeat.

    Parameters
    ----------
    law : Law
        The law as far as it is known, at rest before the first sample.
    limits : InputLimits or mapping
        amplitude, slew, duration and sample_time.
    free : sequence of str
        Numbers to be identified, as in ``law.scalars``.
    noise : float
        Standard deviation of the output [unit of y].
    criterion : {"D", "A", "E"}
        The determinant of the information, the mean variance, or the largest one; A and E judge numbers in parts of
        their sizes.
    candidates, moves : int
        Random inputs, and moves of turning points of each of the best ones.
    seed : int
        Of the draws.

    Returns
    -------
    InputDesign

    Raises
    ------
    TypeError
        If the law is none that a step describes, or `free` is a single string.
    ValueError
        If a name, a limit or the criterion is unknown, or no input within the limits tells all numbers apart.

    Examples
    --------
    >>> import hysim as hs
    >>> limits = hs.InputLimits(amplitude=2.0, slew=4.0, duration=8.0, sample_time=0.05)
    >>> design = hs.design_input(hs.Dahl(stiffness=3.0, coulomb=0.5), limits=limits, free=("stiffness", "coulomb"))
    >>> bool(max(design.efficiency.values()) <= 1.0), bool(abs(design.u).max() <= 2.0)
    (True, True)
    """
    names, bounds = _checked(law, free, limits, criterion, noise)
    rng = np.random.default_rng(seed)

    def worth(u: FloatArray) -> float:
        return merit(information(law, names, u, noise), criterion)

    inputs = usual(bounds)
    known = {name: worth(each) for name, each in inputs.items()}

    def tried(strokes: FloatArray) -> float:
        return worth(through(strokes[:, 0], bounds, strokes[:, 1]))

    drawn = [random_strokes(bounds, rng) for _ in range(candidates)]
    order = sorted(drawn, key=lambda strokes: -tried(strokes))[:_BEST]
    improved = [_improved(strokes, bounds, tried, moves, rng) for strokes in order]
    strokes = max(improved, key=tried, default=np.empty((0, 2)))
    u, best = through(strokes[:, 0], bounds, strokes[:, 1]), tried(strokes)
    first = max(known, key=lambda name: known[name])
    if known[first] > best:
        u, best, strokes = inputs[first], known[first], np.empty((0, 2))
    if not best > 0.0:
        raise ValueError(f"no input within the limits tells {', '.join(names)} apart: free fewer of them")
    covariance = np.linalg.inv(law.response_jacobian(u, names).information(noise))
    return InputDesign(
        t=bounds.t,
        u=u,
        levels=strokes[:, 0],
        holds=strokes[:, 1],
        expected_stderr=dict(zip(names, np.sqrt(covariance.diagonal()).tolist(), strict=True)),
        efficiency={name: value / best for name, value in known.items()},
        criterion=criterion,
        noise=noise,
        limits=bounds,
    )


def _improved(strokes: FloatArray, limits: InputLimits, tried: Any, moves: int, rng: np.random.Generator) -> FloatArray:
    """The strokes after random moves of one turning point or pause at a time, those that are worth more being kept."""
    best = tried(strokes)
    for k in range(moves):
        trial, share = strokes.copy(), _MOVE * 0.1 ** (k / moves) * rng.standard_normal()
        place = rng.integers(len(trial))
        if rng.random() < _PAUSES:
            trial[place, 1] = max(0.0, trial[place, 1] + _PAUSE * share * limits.duration)
        else:
            moved = trial[place, 0] + share * limits.amplitude
            trial[place, 0] = min(max(moved, -limits.amplitude), limits.amplitude)
        value = tried(trial)
        if value > best:
            strokes, best = trial, value
    return strokes


def _checked(
    law: Any, free: Sequence[str], limits: InputLimits | Mapping[str, float], criterion: str, noise: float
) -> tuple[tuple[str, ...], InputLimits]:
    if not isinstance(law, Law):
        raise TypeError(f"law must be a law that a step describes, such as BoucWen, got {type(law).__name__}")
    if isinstance(free, str):
        raise TypeError(f"free must be a sequence of names, got the string {free!r}")
    if not free:
        raise ValueError("free must name at least one number")
    if unknown := [name for name in free if name not in law.scalars]:
        raise ValueError(f"free has {unknown[0]!r}: a {type(law).__name__} has {', '.join(law.scalars)}")
    if criterion not in ("D", "A", "E"):
        raise ValueError(f'criterion must be "D", "A" or "E", got {criterion!r}')
    if not noise > 0.0:
        raise ValueError(f"noise must be positive, got {noise}")
    return tuple(free), limits if isinstance(limits, InputLimits) else InputLimits(**limits)
