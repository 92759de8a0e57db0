"""The inverse of any law that is known by its step, found by a search on this step (`hysim.kernels.inverses`)."""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels import inverses as kernels
from hysim.kernels.stepping import drive
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits, StepwiseInvertible, Stretched

_REACH, _WIDER = 1e-6, 16.0  # how far at most the output is looked at to either side of the first input; the ratio
_SHORTEST = 2.0**-46  # of the first input, or this number
_NEXT_TO_NOTHING = 1e-150
_HALVINGS = 10_000  # at most, of a bracket down to 1e-300: about a thousand where rounding hides the slope at zero
_HIDDEN, _FARTHEST = 2.0**-44, 1e150  # part of the output by which rounding may hide a rise: it is then sought further
_FLAT = 1e-6  # of the highest slope: one that is flatter somewhere is looked at, as one that turns
_ROUNDING = 1e-12  # of the largest output: what the sum that an output is may miss of the saturation
_LINEAR = 0.1  # part by which rises over once, twice and four times a length are no multiples of each other

Unreached = Callable[[int, float, CompiledLaw], str]
"""Message for the number of a sample, an output that has no input, and the inverse there."""

_searched = functools.lru_cache(maxsize=256)(kernels.searched)


def searched_inverse(
    law: Any, forward: CompiledLaw, y: float | None = None, limits: Limits = UNLIMITED, terms: float = 0.0
) -> CompiledLaw:
    """The inverse of a law in the state of `forward`, as `hysim.kernels.inverses` has it.

    `y` is the output there, by default that of the step; `terms` is the size of the terms that it is the sum of, where
    they are larger: their rounding is the output's. Of a `law` that says where its memory is, the search copies no
    more than that; of one that knows its slopes, it looks for no turn where these have one sign.

    Raises ValueError if the output does not rise or fall through `u`.
    """
    u, trial = float(forward.state[0]), np.empty_like(forward.state)

    def output(u: float) -> float:
        trial[:] = forward.state
        return float(forward.step(forward.parameters, trial, u))

    with np.errstate(all="ignore"):
        reached, slope = output(u), _slope(output, u)
    if slope == 0.0 and isinstance(law, Stretched):
        slope = _steepest(law)
    if slope == 0.0:
        raise ValueError(f"the law has no inverse: its output does not rise or fall through u = {u:g}")
    places = law.memory_places if isinstance(law, Stretched) else ((0, forward.state.size),)
    certain = isinstance(law, Stretched) and one_signed(law.known_slopes)
    n_memory = sum(count for _, count in places)
    head = [*limits, certain, len(places), n_memory, *(number for stretch in places for number in stretch)]
    return CompiledLaw(
        _searched(forward.step),
        read_only(np.concatenate([head, forward.parameters]), finite=False),
        np.concatenate([[u, reached if y is None else y, slope, terms], forward.state, np.zeros(n_memory)]),
    )


def one_signed(slopes: tuple[float, float]) -> bool:
    """Whether slopes between these two are clearly above zero, or below."""
    least, most = sorted(map(abs, slopes))
    return slopes[0] * slopes[1] > 0.0 and _FLAT * most < least and most < np.inf


def _steepest(law: Stretched) -> float:
    """Steepest slope of a law that saturates and so stands still somewhere, zero if it may rise and fall."""
    low, high = law.known_slopes
    return max(low, high, key=abs) if low * high >= 0.0 and max(map(abs, law.output_bounds)) < math.inf else 0.0


def inverse_response(inverse: CompiledLaw, y: FloatArray, unreached: Unreached | None = None) -> FloatArray:
    """Inputs for the outputs `y`, by steps of the inverse; SimulationError if no input gives an output."""
    u = np.empty(y.size)
    with np.errstate(all="ignore"):  # a bracket may reach where a memory overflows
        lost = in_pieces(lambda k: drive(inverse.step, inverse.parameters, inverse.state, y[k], u[k]), y.size)
    if lost >= 0:
        raise SimulationError((unreached or not_reached)(lost, float(y[lost]), inverse))
    return u


def check_reached(y: FloatArray, bounds: tuple[float, float]) -> None:
    """Raise a SimulationError for the first of the outputs `y` that a law does not reach at any input."""
    low, high = bounds
    room = _ROUNDING * max(map(abs, bounds))
    beyond = np.flatnonzero((y < low - room) | (y > high + room))
    if beyond.size:
        raise SimulationError(
            f"the law has no inverse at sample {beyond[0]} (y = {y[beyond[0]]:g}): its outputs lie between {low:g} and "
            f"{high:g}, and {beyond.size} of {y.size} samples lie beyond; limit y to 99 % of this range by numpy.clip, "
            "or take a law with a feedthrough, a slope at saturation"
        )


def not_reached(sample: int, y: float, inverse: CompiledLaw) -> str:
    return (
        f"the law has no inverse at sample {sample} (y = {y:g}): from u = {inverse.state[0]:g} on the output "
        "does not reach it, or turns on the way"
    )


def inverse_at_rest(law: Any, y: float, u0: float | None) -> CompiledLaw:
    """The inverse of a law that rests at `u0`; by default at the first input with the first output `y`."""
    here, reached = (first_input(law, y), y) if u0 is None else (float(u0), None)
    return searched_inverse(law, law.compiled(here), reached)


def first_input(law: Any, y: float) -> float:
    from scipy.optimize import brentq

    def error(u: float) -> float:
        return float(law.response([u])[0]) - y

    if (here := error(0.0)) == 0.0:
        return 0.0
    for reach in np.ldexp(1e-6, range(519)).tolist():  # up to 1e150
        for end in (reach, -reach):
            if np.sign(error(end)) * np.sign(here) <= 0.0:  # their product may be too small for a number
                return float(brentq(error, 0.0, end, xtol=1e-300, rtol=4.0 * np.finfo(float).eps, maxiter=_HALVINGS))
    raise ValueError("the first input cannot be computed from the first output: give u0")


def _slope(output: Callable[[float], float], here: float) -> float:
    """Slope of the output at the input `here`, zero where it does not rise or fall through it."""
    reached, fallback, highest = output(here), 0.0, 0.0
    reach = max(_SHORTEST * abs(here), _NEXT_TO_NOTHING)
    while reach < _REACH * (1.0 + abs(here)) or (highest < _HIDDEN * abs(reached) and reach < _FARTHEST):
        lengths = reach * np.array([1.0, 2.0, 4.0])
        ends = here + np.array([lengths, -lengths])
        rises = np.array([[output(u) for u in side] for side in ends.tolist()]) - reached
        slopes = rises / (ends - here)
        if 0.0 < slopes[0, 0] * slopes[1, 0] < np.inf:
            fallback = slopes[0, 0]
            if (np.abs(slopes / slopes[:, :1] - 1.0) < _LINEAR).all():
                return float(slopes[0, 0])
        elif fallback == 0.0 and np.isfinite(slopes[:, 0]).sum() == 1:  # the memory diverges at once on the other side
            fallback = float(slopes[np.isfinite(slopes[:, 0]), 0][0])
        elif fallback == 0.0 and reach < _REACH * (1.0 + abs(here)):  # saturated: the output stands still on one side
            moves = int(np.abs(rises[1]).max() > np.abs(rises[0]).max())
            still = float(np.abs(rises[1 - moves]).max())
            even = (np.abs(slopes[moves] / slopes[moves, 0] - 1.0) < _LINEAR).all()
            if even and still <= _HIDDEN * abs(reached) < _FLAT * abs(rises[moves, 0]):
                fallback = float(slopes[moves, 0])
        highest = float(np.abs(rises).max())
        reach *= _WIDER
    return float(fallback)


def inverse_step(law: Any, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    """The inverse of a law at rest at `u0`, as a step; TypeError or ValueError if it has no inverse."""
    if isinstance(law, StepwiseInvertible):
        return law.compiled_inverse(u0, limits, sample_time)
    return searched_inverse(law, CompiledLaw(*law.compiled(u0)), limits=limits)
