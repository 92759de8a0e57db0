"""The verb `design_input`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.design._candidates import most_levels, random_levels, through, usual
from hysim.design._criteria import Criterion, information, merit
from hysim.design._limits import InputLimits
from hysim.design._result import InputDesign
from hysim.models.law import Law

_BEST = 4  # candidates that are improved
_MOVE = 0.3  # of the amplitude: the first moves of a turning point; the last ones are a tenth of it


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

    The input is a row of strokes at the full slew between turning points. They are drawn at random, and those of the
    best candidates are moved as long as the Fisher information on the numbers grows: a search, which is not sure to
    find the best input. The information depends on the law; begin with what is known of it, and repeat.

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
    drawn = [random_levels(int(rng.integers(4, most_levels(bounds) + 1)), bounds, rng) for _ in range(candidates)]
    order = sorted(drawn, key=lambda levels: -worth(through(levels, bounds)))[:_BEST]
    improved = [_improved(levels, bounds, worth, moves, rng) for levels in order]
    levels = max(improved, key=lambda each: worth(through(each, bounds)), default=np.empty(0))
    u, best = through(levels, bounds), worth(through(levels, bounds))
    first = max(known, key=lambda name: known[name])
    if known[first] > best:
        u, best, levels = inputs[first], known[first], np.empty(0)
    if not best > 0.0:
        raise ValueError(f"no input within the limits tells {', '.join(names)} apart: free fewer of them")
    covariance = np.linalg.inv(law.response_jacobian(u, names).information(noise))
    used = np.cumsum(np.abs(np.diff(levels, prepend=0.0))) / bounds.slew < bounds.duration
    return InputDesign(
        t=bounds.t,
        u=u,
        levels=levels[used] if levels.size else levels,
        expected_stderr=dict(zip(names, np.sqrt(covariance.diagonal()).tolist(), strict=True)),
        efficiency={name: value / best for name, value in known.items()},
        criterion=criterion,
        noise=noise,
        limits=bounds,
    )


def _improved(levels: FloatArray, limits: InputLimits, worth: Any, moves: int, rng: np.random.Generator) -> FloatArray:
    """The turning points after random moves of one at a time, those that are worth more being kept."""
    best = worth(through(levels, limits))
    for k in range(moves):
        trial = levels.copy()
        size = _MOVE * limits.amplitude * 0.1 ** (k / moves)
        place = rng.integers(trial.size)
        trial[place] = np.clip(trial[place] + size * rng.standard_normal(), -limits.amplitude, limits.amplitude)
        value = worth(through(trial, limits))
        if value > best:
            levels, best = trial, value
    return levels


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
