"""The verb `design_input`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._results import model_of
from hysim.design import _search as search
from hysim.design._candidates import random_segments, random_strokes, through, triangles, usual, usual_of_many_speeds
from hysim.design._criteria import Criterion, spreads
from hysim.design._limits import InputLimits
from hysim.design._result import InputDesign
from hysim.design._subjects import LawAlone, Subject, sizes_of
from hysim.design._whole import whole_actuator
from hysim.models.law import Law
from hysim.plants.actuator_structure import ActuatorStructure
from hysim.plants.linear_parts import FREQUENCY

_FASTER = 2.0  # times the frequency of the fastest mode: a multisine that is not told how far to go
_BELOW_NYQUIST = 0.8  # at most, of half the sampling rate


def design_input(
    plant: Any,
    *,
    limits: InputLimits | Mapping[str, float],
    free: Sequence[str] | None = None,
    values: Mapping[str, float] | None = None,
    noise: float | None = None,
    criterion: Criterion = "D",
    highest_frequency: float | None = None,
    beside: Mapping[str, npt.ArrayLike] | None = None,
    candidates: int = 100,
    moves: int = 300,
    seed: int = 0,
) -> InputDesign:
    """Propose an input within limits that tells most of the numbers of a law, or of a whole actuator.

    The input is a row of strokes between turning points, at some of which it is held: at the full slew for a law, and
    at many speeds for an actuator. They are drawn at random, and those of the best candidates are changed as long as
    the Fisher information on the numbers grows: a search, which is not sure to find the best input. Noise is taken as
    white, so that a pause is as good as any sample. The information depends on the numbers; begin with what is known of
    them, and repeat.

    Parameters
    ----------
    plant : Law, result of a fit, or structure of an Actuator
        A law as far as it is known, or `hysim.Actuator.structure` with such a law; at rest before the first sample.
    limits : InputLimits or mapping
        amplitude, slew, duration, sample_time, and optionally centre.
    free : sequence of str, optional
        Numbers to be identified, as in ``law.scalars``. Of an actuator as in `hysim.identify`, by default those that it
        frees.
    values : mapping, optional
        Names of an actuator's parameters to their values, such as the estimates of a first fit. What is not named has
        the number of the structure's law, or the start of its search; the frequencies of the modes must be named.
    noise : float, optional
        Standard deviation of the output; by default that of the structure's sensor with its rounding, or one
        [unit of y].
    criterion : {"D", "A", "E"}
        The determinant of the information, the mean variance, or the largest one; A and E judge numbers in parts of
        their sizes.
    highest_frequency : float, optional
        Of the random-phase multisine that stands beside a design for an actuator; by default twice that of the fastest
        mode [Hz].
    beside : mapping, optional
        Names to inputs of your own, (n_samples,) each, that are judged beside the usual ones.
    candidates, moves : int
        Random inputs, and changes of each of the best ones.
    seed : int
        Of the draws.

    Returns
    -------
    InputDesign

    Raises
    ------
    TypeError
        If the plant is none of these, or `free` is a single string.
    ValueError
        If a name, a limit or the criterion is unknown, a value is missing, or no input within the limits tells all
        numbers apart.

    Examples
    --------
    >>> import hysim as hs
    >>> limits = hs.InputLimits(amplitude=2.0, slew=4.0, duration=8.0, sample_time=0.05)
    >>> design = hs.design_input(hs.Dahl(stiffness=3.0, coulomb=0.5), limits=limits, free=("stiffness", "coulomb"))
    >>> bool(max(design.efficiency.values()) <= 1.0), bool(abs(design.u).max() <= 2.0)
    (True, True)
    """
    plant = model_of(plant)
    bounds = limits if isinstance(limits, InputLimits) else InputLimits(**limits)
    subject = _subject(plant, bounds, free, values, noise, criterion)
    rng, in_time = np.random.default_rng(seed), isinstance(plant, ActuatorStructure)
    if in_time:
        inputs = usual_of_many_speeds(bounds, _highest(highest_frequency, values or {}, bounds), rng)
    else:
        inputs = usual(bounds)
    drawn = [*triangles(bounds), *triangles(bounds, fading=True)] if in_time else []
    drawn += [(random_segments if in_time else random_strokes)(bounds, rng) for _ in range(candidates)]
    inputs |= _own(beside or {}, bounds)
    every = [u for variants in inputs.values() for u in variants]
    subject, unseen = search.determined(subject, [*every, *(through(strokes, bounds) for strokes in drawn)])
    worth = search.value_of(subject, criterion)
    judged = {
        name: max(((worth(u), u) for u in variants), key=lambda each: each[0]) for name, variants in inputs.items()
    }
    move = search.one_redrawn if in_time else search.one_moved
    strokes, best = search.searched(drawn, worth, bounds, move, moves, rng)
    u, first = through(strokes, bounds), max(judged.values(), key=lambda each: each[0])
    if first[0] > best:
        (best, u), strokes = first, np.empty((0, 3))
    if not best > 0.0:
        raise ValueError(f"no input within the limits tells {', '.join(subject.names)} apart: free fewer of them")
    covariance = subject.covariance(u)
    return InputDesign(
        t=bounds.t,
        u=u,
        levels=bounds.centre + strokes[:, 0],
        holds=strokes[:, 1],
        expected_stderr=dict(zip(subject.names, np.sqrt(covariance.diagonal()).tolist(), strict=True)),
        covariance=covariance,
        efficiency={name: value / best for name, (value, _) in judged.items()},
        beside={name: each for name, (_, each) in judged.items()},
        beside_stderr={name: _stderr(subject, each) for name, (_, each) in judged.items()},
        criterion=criterion,
        noise=subject.noise,
        limits=bounds,
        remarks=(*subject.remarks, *unseen, *_weak(subject, covariance)),
    )


def _own(beside: Mapping[str, npt.ArrayLike], limits: InputLimits) -> dict[str, list[FloatArray]]:
    inputs = {name: read_only(u, f"beside[{name!r}]", ndim=1) for name, u in beside.items()}
    for name, u in inputs.items():
        if u.size != limits.samples:
            raise ValueError(f"beside[{name!r}] must hold {limits.samples} samples, got {u.size}")
    return {name: [u] for name, u in inputs.items()}


def _stderr(subject: Subject, u: FloatArray) -> dict[str, float]:
    """Expected standard errors by name; infinite for numbers that an input does not determine."""
    errors = sizes_of(subject.values) * spreads(subject.information(u))
    return dict(zip(subject.names, errors.tolist(), strict=True))


def _weak(subject: Subject, covariance: FloatArray) -> list[str]:
    """Remarks on numbers that the design determines to no more than their size."""
    errors = np.sqrt(covariance.diagonal())
    return [
        f"the standard error of {name} is expected to be {error:.3g}, more than its size"
        for name, value, error in zip(subject.names, subject.values.tolist(), errors.tolist(), strict=True)
        if value != 0.0 and error > abs(value)
    ]


def _highest(given: float | None, values: Mapping[str, float], limits: InputLimits) -> float:
    """Highest frequency of a multisine [Hz]."""
    nyquist = 0.5 / limits.sample_time
    if given is not None:
        if not 0.0 < given <= nyquist:
            raise ValueError(f"highest_frequency must be positive and at most {nyquist:g} Hz, got {given}")
        return given
    modes = [value for name, value in values.items() if FREQUENCY in name]
    return min(_FASTER * max(modes, default=np.inf) / (2.0 * np.pi), _BELOW_NYQUIST * nyquist)


def _subject(
    plant: Any,
    limits: InputLimits,
    free: Sequence[str] | None,
    values: Mapping[str, float] | None,
    noise: float | None,
    criterion: str,
) -> Subject:
    if not isinstance(plant, Law | ActuatorStructure):
        raise TypeError(
            f"design_input takes a law that a step describes, such as BoucWen, or an Actuator.structure, "
            f"got {type(plant).__name__}"
        )
    if isinstance(free, str):
        raise TypeError(f"free must be a sequence of names, got the string {free!r}")
    if criterion not in ("D", "A", "E"):
        raise ValueError(f'criterion must be "D", "A" or "E", got {criterion!r}')
    if noise is not None and not noise > 0.0:
        raise ValueError(f"noise must be positive, got {noise}")
    if isinstance(plant, ActuatorStructure):
        return whole_actuator(plant, limits, values or {}, free, noise)
    if values:
        raise ValueError("values are for the structure of an actuator: a law has its numbers")
    if not free:
        raise ValueError("free must name at least one number")
    if unknown := [name for name in free if name not in plant.scalars]:
        raise ValueError(f"free has {unknown[0]!r}: a {type(plant).__name__} has {', '.join(plant.scalars)}")
    return LawAlone(plant, tuple(free), 1.0 if noise is None else noise, {})
