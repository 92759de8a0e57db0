"""Laws side by side and behind each other, and the inverse of any law that is known by its step.

Two steps make one of the same type. Its parameters are the numbers of the first law's parameters and states, and
then both laws' own; its state is that of the first law, and then that of the second. More than two are pairs of pairs.

    inverse:    the u_k for which y(u_k) = y_k, where y rises (or falls) on the whole way from u_(k-1)
"""

import math

from numba import float64, int64

from hysim._frozen import FloatArray
from hysim.kernels._compile import inlined, signed_closure, signed_kernel
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step

_SIGNATURE = float64(CONSTANTS, VECTOR, float64)
_POINTS = 16  # of a way at which the output is looked at
_DOUBLINGS = 1100  # more than there are between the smallest number and the largest
_HALVINGS = 200
_ATTEMPTS = 64  # ways that are tried, each ended where the output has turned on the last
_RESOLVED = 1e-13
"""Of the largest output so far: shorter ways rise in steps of rounding, and are not looked at for a turn."""
_NEAR, _NEARER, _NEAREST = 1e-10, 0.125, 1e-13
"""Of the largest output so far: how far back from its beginning a way is looked at, and then nearer."""
_ROUNDINGS = 64.0 * 2.0**-53
_CLEAR = 256.0  # roundings by which an output is to rise, so that it is seen
_AHEAD = 2.0**-26
"""Of a way: how far beyond its end the output is looked at; a turn is missed by the square of it, which is rounding."""
_SMALLEST = 2.0**-1022


def side_by_side(first: Step, second: Step) -> Step:
    """The step of the sum of both outputs."""

    @signed_closure(_SIGNATURE)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        n, m = 2 + int(parameters[0]), int(parameters[1])
        return first(parameters[2:n], state[:m], u) + second(parameters[n:], state[m:], u)

    return step


def one_behind_the_other(first: Step, second: Step) -> Step:
    """The step of the second law for the output of the first."""

    @signed_closure(_SIGNATURE)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        n, m = 2 + int(parameters[0]), int(parameters[1])
        between = first(parameters[2:n], state[:m], u)
        return second(parameters[n:], state[m:], between) if math.isfinite(between) else between

    return step


@inlined
def _tried(step: Step, parameters: FloatArray, state: FloatArray, trial: FloatArray, u: float) -> float:
    """Output at `u`, the state left as it is."""
    trial[:] = state
    return step(parameters, trial, u)


@inlined
def _apart(here: float, direction: float, low: float, way: float, high: float) -> bool:
    """Whether the end of `way` is an input between those of `low` and `high`."""
    end = direction * (here + direction * way)
    return direction * (here + direction * low) < end < direction * (here + direction * high)


@inlined
def _bracket(
    step: Step,
    parameters: FloatArray,
    state: FloatArray,
    trial: FloatArray,
    here: float,
    direction: float,
    side: float,
    wanted: float,
    gap: float,
    guess: float,
    limit: float,
    ahead: float,
    noise: float,
) -> tuple[float, float, float, float]:
    """Two ways with their errors, of which the second reaches the output; where none does, its error is negative.

    The output turns before `limit`. Where `ahead` is not zero, it is looked at by this part of a way beyond each end:
    where it falls there, the end is behind the turn. A `noise` of infinity stands for an output that rises in steps of
    rounding.
    """
    low, low_error = 0.0, -gap
    high, too_far = min(guess, 0.5 * limit), limit
    high_error = math.nan
    for _ in range(_DOUBLINGS):
        high_error = side * (_tried(step, parameters, state, trial, here + direction * high) - wanted)
        if 0.0 <= high_error < math.inf:
            return low, low_error, high, high_error
        rises = -math.inf < high_error < 0.0 and high_error >= low_error - noise
        if rises and ahead > 0.0:
            next_error = side * (step(parameters, trial, here + direction * (high + ahead * high)) - wanted)
            rises = next_error >= high_error - noise
        if rises:
            low, low_error = high, high_error
        else:
            too_far = high
        high = 2.0 * low if too_far == math.inf else 0.5 * (low + too_far)
        if not low < high < too_far:
            break
    return low, low_error, high, high_error


@inlined
def _closed_in(
    step: Step,
    parameters: FloatArray,
    state: FloatArray,
    trial: FloatArray,
    here: float,
    direction: float,
    side: float,
    wanted: float,
    low: float,
    low_error: float,
    high: float,
    high_error: float,
) -> float:
    """The shortest way that reaches the output, by regula falsi (Illinois) where that is faster than halving."""
    last_side = 0
    for i in range(_HALVINGS):
        way = high - (high - low) * (high_error / (high_error - low_error))
        if i % 3 == 2 or not _apart(here, direction, low, way, high):
            way = 0.5 * (low + high)
        if high_error == 0.0 or not _apart(here, direction, low, way, high):
            break
        error = side * (_tried(step, parameters, state, trial, here + direction * way) - wanted)
        if error < 0.0:
            low, low_error = way, error
            high_error *= 0.5 if last_side < 0 else 1.0
            last_side = -1
        else:
            high, high_error = way, error
            low_error *= 0.5 if last_side > 0 else 1.0
            last_side = 1
    return high


@inlined
def _turn(
    step: Step,
    parameters: FloatArray,
    state: FloatArray,
    trial: FloatArray,
    here: float,
    direction: float,
    side: float,
    reached: float,
    way: float,
    noise: float,
) -> float:
    """Length at which the output has fallen on a way, or zero."""
    before = 0.0
    for i in range(1, _POINTS + 1):
        part = way * i / _POINTS
        rise = side * (_tried(step, parameters, state, trial, here + direction * part) - reached)
        if not rise > before - noise:
            return part
        before = rise
    return 0.0


@inlined
def _falls_back(
    step: Step,
    parameters: FloatArray,
    state: FloatArray,
    trial: FloatArray,
    here: float,
    direction: float,
    side: float,
    reached: float,
    steepness: float,
    largest: float,
) -> bool:
    """Whether the output falls on the way back, as near as it can be told; `steepness` is that of the way ahead.

    Where it is infinite as near as that, nothing is told, and it counts as falling.
    """
    near, noise, told = _NEAR, 0.0, False
    while near > _NEAREST:
        back = side * (
            _tried(step, parameters, state, trial, here - direction * (near * largest / steepness)) - reached
        )
        if back < -noise and math.isfinite(back):
            return True
        told = told or math.isfinite(back)
        near, noise = near * _NEARER, _ROUNDINGS * largest
    return not told


@signed_kernel(int64(STEP, CONSTANTS, VECTOR, VECTOR, float64, float64, float64, CONSTANTS, VECTOR))
def inverse(
    step: Step,
    parameters: FloatArray,
    state: FloatArray,
    trial: FloatArray,
    here: float,
    reached: float,
    slope: float,
    y: FloatArray,
    u: FloatArray,
) -> int:
    """Inputs for the outputs `y` into `u`: the first sample that has none, or -1.

    The law is at the input `here`, where its output is `reached`; `slope` is a guess of dy/du with the right sign.
    `trial` is as long as `state`. A way is doubled until its end is beyond, or halved while its end is so far that the
    output has turned or is not finite, and then closed in on. Where this fails, or the output has turned on the way,
    it is sought again: with a look ahead, which tells an end before the turn from one behind it, and before the turn.
    """
    rising, largest = math.copysign(1.0, slope), 0.0
    for k in range(y.size):
        wanted = y[k]
        side, gap = math.copysign(1.0, wanted - reached), abs(wanted - reached)
        if gap < _SMALLEST:
            u[k] = here
            continue
        largest = max(largest, abs(wanted), abs(reached), abs(slope * here))
        resolved = gap > _RESOLVED * largest
        noise = _ROUNDINGS * largest
        direction, guess = side * rising, gap / abs(slope)
        limit, ahead, way = math.inf, 0.0, math.nan
        for _ in range(_ATTEMPTS):
            allowed = noise if resolved else math.inf
            low, low_error, high, high_error = _bracket(
                step, parameters, state, trial, here, direction, side, wanted, gap, guess, limit, ahead, allowed
            )
            reaches = 0.0 <= high_error < math.inf
            if reaches:
                high = _closed_in(
                    step, parameters, state, trial, here, direction, side, wanted, low, low_error, high, high_error
                )
            if reaches or ahead > 0.0:
                end = high if reaches else low
                turn = _turn(step, parameters, state, trial, here, direction, side, reached, end, noise)
                if turn == 0.0 or not resolved:
                    way = high if reaches else math.nan
                    break
                limit = turn
            ahead = max(_AHEAD, _CLEAR * noise / gap)
        if math.isnan(way):
            return k
        if resolved:
            steepness = gap / way
            if not _falls_back(step, parameters, state, trial, here, direction, side, reached, steepness, largest):
                return k
            slope = rising * steepness
        here += direction * way
        step(parameters, state, here)
        reached = wanted
        u[k] = here
    return -1
