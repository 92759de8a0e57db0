"""Inverses of laws as steps: `u = step(parameters, state, y)` returns the input at which the output is `y`.

Every inverse moves a copy of its law to the input within limits, and so continues rightly where the input was limited:

    parameters    lowest and highest input, then what the inverse and the law need
    state         input at which the copy stands, output there, then what the inverse and the law remember

The input that is returned is not limited. Where no input has the output it is nan; the copy then moves to the limit
ahead, or stays where it is if there is no limit. `hysim.kernels.boucwen_inverse`, `play_sums` and `preisach` have
closed forms of their own; `searched` makes the inverse of any law from its step.

    searched:    u with y(u) = y, where y rises (or falls) along the whole branch from the input before
"""

import math
from collections.abc import Callable

from numba import float64, types

from hysim._basics.frozen import FloatArray
from hysim.kernels import clamps
from hysim.kernels._compile import borrowed, by_address, inlined, inner, kernel, signed_closure
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step

N_LIMITS = 2  # parameters before those of the inverse itself
N_PLACE = 2  # places of the state before those of the inverse itself
N_SEARCH = 4  # places of the state of `searched` before the law's: input, output, slope, largest output so far
# parameters before the places of the memory: limits, certain, numbers of stretches and places
N_SEARCHED = N_LIMITS + 3

_POINTS = 16  # of a branch at which the output is evaluated
_DOUBLINGS = 1100  # more than there are between the smallest number and the largest
_HALVINGS = 200
_ATTEMPTS = 64  # branches that are tried, each ended where the output has turned on the last
_RESOLVED = 1e-13
"""Part of the largest output so far: shorter branches rise in steps of rounding, and are not searched for a turn."""
_NEAR, _NEARER, _NEAREST = 1e-10, 0.125, 1e-13
"""Parts of the largest output so far: distances behind a branch at which it is evaluated, the farthest first."""
_ROUNDINGS = 64.0 * 2.0**-53
_CLEAR = 256.0  # roundings by which an output has to rise to show it
_BELOW = 16.0  # part of the rounding by which what is taken for saturated is below the last output
_AHEAD = 2.0**-26
"""Part of a branch: distance beyond its end at which the output is evaluated; a turn is missed by its square."""
_SMALLEST = 2.0**-1022
_SEARCH = float64(STEP, CONSTANTS, VECTOR, float64)
SEARCH = types.FunctionType(_SEARCH)
Branch = tuple[float, float, float, float]
"""Input where a branch begins, direction of the input, side from which outputs are counted, and their level."""
Ends = tuple[float, float, float, float]
"""Two lengths on a branch, each with its error."""
Search = Callable[[Step, FloatArray, FloatArray, float], float]


# ---------------------------------------------------------------------------------- limits


@inlined
def within_limits(parameters: FloatArray, u: float, direction: float) -> float:
    """Input to which the copy of the law moves for the wanted input `u`; nan if it stays.

    `direction` is that in which an input was sought, for the case that there is none.
    """
    if not math.isnan(u):
        return float(min(max(u, parameters[0]), parameters[1]))
    limit = parameters[1] if direction > 0.0 else parameters[0]
    return float(limit) if abs(limit) < math.inf else math.nan


# ---------------------------------------------------------------------------------- closed forms


@kernel
def line(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Inverse of `hysim.kernels.stepping.line`; `parameters` are (limits, offset, slope), `state` is (u, y)."""
    offset, slope = parameters[N_LIMITS], parameters[N_LIMITS + 1]
    u = (y - offset) / slope
    state[0] = within_limits(parameters, u, 0.0)
    state[1] = y if state[0] == u else offset + slope * state[0]
    return float(u)


@kernel
def plays(parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Inverse of a sum of plays by another one.

    `parameters` are limits and those of `clamps.step` of inverse and law; `state` is (u, y, both states, room for one).
    """
    parameters, state = borrowed(parameters), borrowed(state)
    n, m = (parameters.size - N_LIMITS) // 2, (state.size - N_PLACE) // 3
    own, forward = parameters[N_LIMITS : N_LIMITS + n], parameters[N_LIMITS + n :]
    inverse, law, before = state[N_PLACE : N_PLACE + m], state[N_PLACE + m : N_PLACE + 2 * m], state[N_PLACE + 2 * m :]
    for i in range(m):
        before[i] = inverse[i]
    u = clamps.step(own, inverse, y)
    state[0] = within_limits(parameters, u, 0.0)
    state[1] = clamps.step(forward, law, state[0])
    if state[0] != u:
        for i in range(m):
            inverse[i] = before[i]
        clamps.step(own, inverse, state[1])
    return float(u)


# ---------------------------------------------------------------------------------- search on a law's step


@inlined
def keep(law: FloatArray, before: FloatArray, places: FloatArray) -> None:
    """Copy the memory of a law into `before`; see `put_back`."""
    i = 0
    for k in range(places.size // 2):
        first = int(places[2 * k])
        for j in range(int(places[2 * k + 1])):
            before[i + j] = law[first + j]
        i += int(places[2 * k + 1])


@inlined
def put_back(law: FloatArray, before: FloatArray, places: FloatArray) -> None:
    """Put the memory `before` into the state of a law; `places` are first place and length of its stretches.

    The workspace of the law stays: it holds nothing that the memory does not determine.
    """
    i = 0
    for k in range(places.size // 2):
        first = int(places[2 * k])
        for j in range(int(places[2 * k + 1])):
            law[first + j] = before[i + j]
        i += int(places[2 * k + 1])


@inner
def _rise(
    step: Step, own: FloatArray, law: FloatArray, before: FloatArray, places: FloatArray, branch: Branch, length: float
) -> float:
    """Output after `length` on a branch less its level, counted positive on its side, from the memory `before`."""
    here, direction, side, level = branch
    put_back(law, before, places)
    return side * (step(own, law, here + direction * length) - level)


@inlined
def _apart(branch: Branch, low: float, length: float, high: float) -> bool:
    """Whether the input after `length` is a number between those after `low` and `high`."""
    here, direction, _, _ = branch
    end = direction * (here + direction * length)
    return direction * (here + direction * low) < end < direction * (here + direction * high)


@inlined
def _bracket(
    step: Step,
    own: FloatArray,
    law: FloatArray,
    before: FloatArray,
    places: FloatArray,
    branch: Branch,
    gap: float,
    guess: float,
    limit: float,
    ahead: float,
    noise: float,
) -> Ends:
    """Two lengths with their errors. The second reaches the output; if no length does, its error is negative.

    The output turns before `limit`. Unless `ahead` is zero, it is evaluated this part of a length beyond each end:
    where it falls there, the end is behind the turn. An infinite `noise` is an output that rises in steps of rounding.
    """
    here, direction, side, wanted = branch
    low, low_error = 0.0, -gap
    high, too_far = min(guess, 0.5 * limit), limit
    high_error = math.nan
    for _ in range(_DOUBLINGS):
        high_error = _rise(step, own, law, before, places, branch, high)
        if 0.0 <= high_error < math.inf:
            return low, low_error, high, high_error
        rises = -math.inf < high_error < 0.0 and high_error >= low_error - noise
        if rises and ahead > 0.0:
            next_error = side * (step(own, law, here + direction * (high + ahead * high)) - wanted)
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
    step: Step, own: FloatArray, law: FloatArray, before: FloatArray, places: FloatArray, branch: Branch, ends: Ends
) -> float:
    """The shortest length that reaches the output, by regula falsi (Illinois) where that is faster than halving.

    Where the output stands still, saturated, the length is halved while it keeps the output.
    """
    low, low_error, high, high_error = ends
    last_side = 0
    while high_error == 0.0:
        length = 0.5 * (low + high)
        if not _apart(branch, low, length, high) or _rise(step, own, law, before, places, branch, length) != 0.0:
            return high
        high = length
    for i in range(_HALVINGS):
        length = high - (high - low) * (high_error / (high_error - low_error))
        if i % 3 == 2 or not _apart(branch, low, length, high):
            length = 0.5 * (low + high)
        if high_error == 0.0 or not _apart(branch, low, length, high):
            break
        error = _rise(step, own, law, before, places, branch, length)
        if error < 0.0:
            low, low_error = length, error
            high_error *= 0.5 if last_side < 0 else 1.0
            last_side = -1
        else:
            high, high_error = length, error
            low_error *= 0.5 if last_side > 0 else 1.0
            last_side = 1
    return high


@inlined
def _turn(
    step: Step,
    own: FloatArray,
    law: FloatArray,
    before: FloatArray,
    places: FloatArray,
    branch: Branch,
    length: float,
    noise: float,
) -> float:
    """Length at which the output has fallen; zero if it rises all along."""
    last = 0.0
    for i in range(1, _POINTS + 1):
        part = length * i / _POINTS
        rise = _rise(step, own, law, before, places, branch, part)
        if not rise > last - noise:
            return part
        last = rise
    return 0.0


@inlined
def _falls_back(
    step: Step,
    own: FloatArray,
    law: FloatArray,
    before: FloatArray,
    places: FloatArray,
    branch: Branch,
    steepness: float,
    largest: float,
) -> bool:
    """Whether the output falls or stands still where the input turns back; `steepness` is the slope ahead.

    It is evaluated as near as rounding allows, and counts as falling where it is infinite even there. It stands still
    behind the place where a law has saturated.
    """
    near, noise, known = _NEAR, 0.0, False
    put_back(law, before, places)
    here, direction, side, _ = branch
    reached = step(own, law, here)  # which differs from what was wanted by the rounding of the input
    back_from = here, direction, side, reached
    while near > _NEAREST:
        back = _rise(step, own, law, before, places, back_from, -(near * largest / steepness))
        if math.isfinite(back) and (back < -noise or (noise == 0.0 and back <= _ROUNDINGS * largest)):
            return True
        known = known or math.isfinite(back)
        near, noise = near * _NEARER, _ROUNDINGS * largest
    return not known


@kernel
def search(step: Step, parameters: FloatArray, state: FloatArray, y: float) -> float:
    """Input at which a law has the output `y`; the step of `searched`.

    A length is doubled until its end is beyond, or halved while its end is so far that the output has turned or is not
    finite, and then closed in on. Where this fails, or the output has turned before, it is sought again: with a look
    ahead, which tells an end before the turn from one behind it, and before the turn.
    """
    parameters, state = borrowed(parameters), borrowed(state)
    certain, n_stretches, m = parameters[2] != 0.0, int(parameters[3]), state.size - int(parameters[4])
    own, places = parameters[N_SEARCHED + 2 * n_stretches :], parameters[N_SEARCHED : N_SEARCHED + 2 * n_stretches]
    law, before = state[N_SEARCH:m], state[m:]
    keep(law, before, places)
    here, reached, slope = state[0], state[1], state[2]
    rising, side, gap = math.copysign(1.0, slope), math.copysign(1.0, y - reached), abs(y - reached)
    direction, length = side * rising, math.nan
    if gap < _SMALLEST:
        length = 0.0
    else:
        state[3] = max(state[3], abs(y), abs(reached), abs(slope * here))
        largest, resolved = state[3], gap > _RESOLVED * state[3]
        noise, guess = _ROUNDINGS * largest, gap / abs(slope)
        limit, ahead, from_here = math.inf, 0.0, (here, direction, side, reached)
        for _ in range(_ATTEMPTS):
            allowed = noise if resolved else math.inf
            branch = here, direction, side, y
            ends = _bracket(step, own, law, before, places, branch, gap, guess, limit, ahead, allowed)
            low, low_error, high, high_error = ends
            reaches = 0.0 <= high_error < math.inf
            if not reaches and -noise <= low_error < 0.0:  # saturated but for rounding: what is reached is wanted
                y += side * (low_error - noise / _BELOW)
                gap = side * (y - reached)
                if low == 0.0 or gap < _SMALLEST:
                    length = 0.0
                    break
                continue
            if reaches:
                high = _closed_in(step, own, law, before, places, branch, ends)
            if reaches or ahead > 0.0:
                end = high if reaches else low
                turn = 0.0 if certain else _turn(step, own, law, before, places, from_here, end, noise)
                if turn == 0.0 or not resolved:
                    length = high if reaches else math.nan
                    break
                limit = turn
            ahead = max(_AHEAD, _CLEAR * noise / gap)
        if resolved and length > 0.0:
            steepness = gap / length
            if certain or _falls_back(step, own, law, before, places, from_here, steepness, largest):
                state[2] = rising * steepness
            else:
                length = math.nan
    u = here + direction * length
    end = within_limits(parameters, u, direction)
    put_back(law, before, places)
    if not math.isnan(end) and (length != 0.0 or end != here):
        output = step(own, law, end)
        state[0], state[1] = end, y if end == u else output
    return float(u)


def searched(step: Step) -> Step:
    """The inverse of the law with this step.

    Its parameters are the limits, one for a law that is known to rise or fall along every branch, else zero, the
    numbers of stretches and of places of the law's memory, first place and length of each stretch in the law's state,
    and the law's own. Its state is (u, y, slope dy/du of the right sign, 0), the law's state, and room for its memory.
    """
    search_by = by_address(search, _SEARCH)
    step_by = by_address(step, STEP.signature)

    @signed_closure(STEP.signature)
    def inverse(parameters: FloatArray, state: FloatArray, y: float) -> float:
        return search_by(step_by, parameters, state, y)

    return inverse
