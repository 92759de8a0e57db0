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
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # of a way on which the output turns: where its largest value is sought
_RESOLVED = 1e-13
"""Of the largest output so far: shorter ways rise in steps of rounding, and are not looked at for a turn."""
_NEAR = 1e-10  # of the largest output so far: how far back from its beginning a way is looked at
_ROUNDINGS = 64.0 * 2.0**-53
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
    resolved: bool,
) -> tuple[float, float, float, float]:
    """Two ways with their errors, of which the second reaches the output; where none does, its error is negative."""
    behind = low = 0.0
    behind_error = low_error = -gap
    high, too_far = guess, math.inf
    high_error = math.nan
    for _ in range(_DOUBLINGS):
        high_error = side * (_tried(step, parameters, state, trial, here + direction * high) - wanted)
        if 0.0 <= high_error < math.inf:
            return low, low_error, high, high_error
        if low_error < high_error < 0.0 or (not resolved and -math.inf < high_error < 0.0):
            behind, behind_error, low, low_error = low, low_error, high, high_error
        else:
            too_far = high
        high = 2.0 * low if too_far == math.inf else 0.5 * (low + too_far)
        if not low < high < too_far:
            break
    start, end = behind, too_far  # the output turns between them, and `low` may be behind the turn
    for _ in range(_HALVINGS if too_far < math.inf else 0):
        first, second = end - _GOLDEN * (end - start), start + _GOLDEN * (end - start)
        first_error = side * (_tried(step, parameters, state, trial, here + direction * first) - wanted)
        if 0.0 <= first_error < math.inf:
            return behind, behind_error, first, first_error
        second_error = side * (_tried(step, parameters, state, trial, here + direction * second) - wanted)
        if 0.0 <= second_error < math.inf:
            return behind, behind_error, second, second_error
        start, end = (first, end) if first_error < second_error else (start, second)
    return low, low_error, high, high_error


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
    output has turned or is not finite, and then closed in on, by regula falsi (Illinois) where that is faster.
    """
    rising, largest = math.copysign(1.0, slope), 0.0
    for k in range(y.size):
        wanted = y[k]
        if wanted == reached:
            u[k] = here
            continue
        largest = max(largest, abs(wanted), abs(reached), abs(slope * here))
        resolved = abs(wanted - reached) > _RESOLVED * largest
        side = math.copysign(1.0, wanted - reached)
        direction = side * rising
        gap, guess = abs(wanted - reached), abs((wanted - reached) / slope)
        if gap < _SMALLEST:
            u[k] = here
            continue
        low, low_error, high, high_error = _bracket(
            step, parameters, state, trial, here, direction, side, wanted, gap, guess, resolved
        )
        if not 0.0 <= high_error < math.inf:
            return k
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
        if resolved:
            before = -gap
            for i in range(1, _POINTS + 1):
                error = side * (_tried(step, parameters, state, trial, here + direction * high * i / _POINTS) - wanted)
                if not error > before - _ROUNDINGS * largest:
                    return k
                before = error
            back = _tried(step, parameters, state, trial, here - direction * high * (_NEAR * largest / gap))
            if not side * (back - reached) < 0.0:
                return k
            slope = rising * (gap / high)
        here += direction * high
        step(parameters, state, here)
        reached = wanted
        u[k] = here
    return -1
