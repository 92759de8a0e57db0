"""One integrator for every law that is given by its slope: along a monotone stroke of the input, to 1e-10 of the range.

    dx/du = f(p, x, u, s),    s = sign(du),    x the hidden states of the law

The embedded Runge-Kutta pairs of Dormand and Prince, of order 5(4) for a stroke that one step takes and of order
8(5, 3) for the others; the coefficients are those of SciPy. Each step leaves out no more than a tolerance of what a
state comes to: the largest of its values, and of what the rest of the stroke would add at the present slope. A law may
have a corner where its first state is zero, as `|z|^n` has, so a step that changes the sign of z is repeated until it
ends at z = 0. What is not smooth elsewhere makes the steps short, as a power of z does near zero.

A law that diverges is `inf`: its steps become a rounding of the way while z grows. A stiff or undefined one is `nan`.
A search asks for a coarse tolerance and tries many stiff laws: all steps of such a run together are limited, too.
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from scipy.integrate import DOP853, RK45

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels._compile import inlined, uncounted, unstored

F = TypeVar("F", bound=Callable[..., Any])
Rates = Callable[[FloatArray, FloatArray, float, float, float, FloatArray], None]
"""``rates(parameters, x, u, s, side, out)``: the slopes of the states `x` into `out`.

A law with a corner at x[0] = 0 may give those of the `side` from which a step crosses it, if their formula goes on
beyond: such a step is then as long as any other, and the zero in it is found by Newton's rule.
"""

Longest = Callable[[FloatArray, FloatArray, float, float], float]
"""``longest(parameters, x, slope, s)``: the longest step from `x`, for what is narrow and could be missed."""

TOLERANCE = 1e-12
MAX_STEPS = 20_000
LARGEST, TINY = 1.7976931348623157e308, 2.2250738585072014e-308
_ROOM = 16  # places for each state: thirteen stages, and three rows of work

_FEW, _MANY = 6, 12  # stages before the slope at the end
_A5 = read_only(np.pad(RK45.A, ((0, 0), (0, 1))).ravel())
_B5, _C5, _E5 = read_only(RK45.B), read_only(RK45.C), read_only(RK45.E)
_A8 = read_only(DOP853.A[:_MANY, :_MANY].ravel())
_B8, _C8 = read_only(DOP853.B), read_only(DOP853.C[:_MANY])
_E8, _E8_LOW = read_only(DOP853.E5), read_only(DOP853.E3)

_ROUNDING = 1e-15  # of the way: a memory that grows by steps of it diverges, and a zero is not looked for nearer
_HOPELESS = 1e6  # error of order 5, times what is allowed, up to which order 8 is tried over the same length
_SAFETY, _LEAST, _MOST = 0.9, 0.1, 5.0  # of the next length: those of SciPy, but for a growth by half as much
# Estimates change their sign, and are small there by chance: an error counts as no less than this part of the one
# before, and of the square of the error of order 3.
_OF_LAST, _OF_SQUARE = 0.1, 0.01
_NEWTON = 8  # tries to end at zero by Newton's rule; then by the rule of false position
_AT_ZERO = 0.01  # of the tolerance
# A tolerance above _COARSE is that of a search, whose run may take _ALWAYS steps and _EACH more for each sample. A
# memory that bends within 1/100 of the way between two samples needs 20 to the next one, and no sample shows its bend.
_COARSE, _ALWAYS, _EACH = 1e-9, 2000.0, 20.0
_MOST_AHEAD = 1e6  # times what a further state is: no error that is allowed for what is ahead steps over a pole


def workspace(n: int) -> int:
    """Number of working places after `n` states."""
    return _ROOM * n + 3  # and input where the last stroke ended, steps, less those allowed, and its direction


@uncounted
def missed(k: FloatArray, i: int, n: int, is_high: bool, h: float, size: float) -> float:
    """What a step of length `h` leaves out of the state `i`, which comes to `size`."""
    if not is_high:
        total = 0.0
        for m in range(_FEW + 1):
            total += _E5[m] * k[m * n + i]
        return abs(h * total)
    high, low = 0.0, 0.0
    for m in range(_MANY + 1):
        high += _E8[m] * k[m * n + i]
        low += _E8_LOW[m] * k[m * n + i]
    ratio = low / high if high != 0.0 else 0.0
    high, low = abs(h * high), abs(h * low)
    return max(high / math.sqrt(1.0 + 0.01 * ratio * ratio), _OF_SQUARE * low * min(low / size, 1.0))


@inlined
def retreat(error: float, is_high: bool) -> float:
    """Part of a length to try after an `error`, in units of what is allowed; order 8 may serve all of it."""
    if is_high:
        return max(_LEAST, _SAFETY * error**-0.125) if error < math.inf else _LEAST
    return 1.0 if error < _HOPELESS else max(_LEAST, (_HOPELESS / error) ** 0.2) if error < math.inf else _LEAST


def follower(
    rates: Rates, longest: Longest
) -> Callable[[int, FloatArray, FloatArray, float, float, bool, float, int], int]:
    """The kernel ``follow(n, parameters, state, u, tolerance, corner, bound, most)`` of a law.

    It is compiled with the slopes inside, since numba keeps no code that takes functions.
    """

    def own(function: F) -> F:
        """Compile a function under a name of its own: numba links functions of one name, from whatever file."""
        function.__qualname__ = f"{rates.__module__}.{rates.__qualname__}.{function.__name__}"
        return unstored(function)

    @own
    def combine(
        n: int,
        parameters: FloatArray,
        x: FloatArray,
        u: float,
        end: float,
        h: float,
        s: float,
        k: FloatArray,
        y: FloatArray,
        after: FloatArray,
        a: FloatArray,
        b: FloatArray,
        c: FloatArray,
        side: float,
    ) -> bool:
        """One step of length `h` to `end` from `x`, whose slopes lead `k`; returns whether x[0] leaves its `side`."""
        stages, crosses = c.size, False
        for j in range(1, stages):
            for i in range(n):
                total = 0.0
                for m in range(j):
                    total += a[j * stages + m] * k[m * n + i]
                y[i] = x[i] + h * total
            crosses = crosses or y[0] * side < 0.0
            rates(parameters, y, u + c[j] * h, s, side, k[j * n : (j + 1) * n])
        for i in range(n):
            total = 0.0
            for m in range(stages):
                total += b[m] * k[m * n + i]
            after[i] = x[i] + h * total
        rates(parameters, after, end, s, side, k[stages * n : (stages + 1) * n])
        return crosses

    @own
    def follow(
        n: int,
        parameters: FloatArray,
        state: FloatArray,
        u: float,
        tolerance: float,
        corner: bool,
        bound: float,
        most: int,
    ) -> int:
        """Move `state`, (last u, the `n` states, work), to the input `u`, and return how many slopes this takes.

        A step leaves out no more than the `tolerance`. The law may have a `corner` where its first state is zero. This
        state is inf beyond `bound`, and nan where `most` steps, or those left to a search, do not reach the end.
        """
        last = state[0]
        state[0] = u
        if u == last or not math.isfinite(state[1]):  # a memory that has diverged remains so
            return 0
        x, work = state[1 : 1 + n], state[1 + n :]
        k, y, after, largest = work[: 13 * n], work[13 * n : 14 * n], work[14 * n : 15 * n], work[15 * n : 16 * n]
        ended = work[_ROOM * n :]
        s = 1.0 if u > last else -1.0
        if ended[2] == 0.0:  # no stroke of this law yet
            ended[1] = 0.0
        is_known = ended[0] == last and ended[2] == s  # the slope at the end of the last stroke is that here
        for i in range(n):
            is_known = is_known and x[i] == after[i]
        if not is_known:
            rates(parameters, x, last, s, x[0], k[:n])
            if corner and x[0] == 0.0 and k[0] != 0.0:  # the slope on the side to which it leads
                rates(parameters, x, last, s, k[0] * s, k[:n])
        ended[0], ended[2] = u, s
        if tolerance > _COARSE:
            ended[1] -= _EACH
            most = min(most, int(_ALWAYS - ended[1]))
        # The slope of a memory that grows without end is no measure of what the stroke adds, and a memory that decays
        # from far away goes no further than one that begins at zero.
        steepest = abs(k[0])
        if steepest == 0.0 or steepest * abs(u - last) > abs(x[0]):
            for i in range(n):
                y[i] = x[i]
            y[0] = 0.0
            rates(parameters, y, last if steepest > 0.0 else u, s, 0.0, after)
            steepest = min(steepest, abs(after[0])) if steepest > 0.0 else abs(after[0])
        for i in range(n):
            largest[i] = abs(x[i])
        left = h = u - last
        aims, is_high, evaluated, done, before, across = 0, False, 1, 0.0, 0.0, 0.0
        for step in range(most):
            h = math.copysign(min(abs(h), longest(parameters, x, k[0], s)), s)
            if abs(h) >= abs(left):
                h = left
            if h == 0.0 or (abs(h) <= _ROUNDING * done and k[0] * s * x[0] > 0.0):
                x[0] = math.copysign(math.inf, x[0]) if k[0] * s * x[0] > 0.0 else math.nan
                return evaluated
            at = u - left
            there = u if h == left else at + h
            stages = _MANY if is_high else _FEW
            side = x[0] if x[0] != 0.0 else k[0] * s
            if is_high:
                crosses = combine(n, parameters, x, at, there, h, s, k, y, after, _A8, _B8, _C8, side)
            else:
                crosses = combine(n, parameters, x, at, there, h, s, k, y, after, _A5, _B5, _C5, side)
            evaluated += stages
            end = stages * n
            error = 0.0
            for i in range(n):
                slope = min(abs(k[0]), steepest) if i == 0 else max(abs(k[i]), abs(k[end + i]))
                size = max(largest[i], slope * abs(left))
                if i > 0:
                    size = min(size, _MOST_AHEAD * max(largest[i], abs(after[i])))
                room = tolerance * (size if size > 0.0 else abs(after[i]))
                if room != 0.0:
                    error += missed(k, i, n, is_high, h, room / tolerance) / room
            if not error <= 1.0:
                h *= retreat(error, is_high)
                is_high = True
                continue
            taken, rounding = h, _AT_ZERO * tolerance * max(largest[0], min(abs(k[0]), steepest) * abs(left))
            comes_back = (crosses or side * after[0] < 0.0) and (x[0] == 0.0 or side * after[0] > 0.0)
            if corner and comes_back and abs(h) > _ROUNDING * abs(u - last):  # to a zero inside the step
                h *= 0.5
                continue
            if corner and x[0] * after[0] < 0.0 and abs(after[0]) > rounding:
                across = h if abs(h) > abs(across) else across
                aims += 1
                aimed, secant = h - after[0] / k[end], h * (abs(x[0]) / (abs(x[0]) + abs(after[0])))
                if aims > _NEWTON or not 0.1 * abs(secant) < s * aimed < abs(h):
                    aimed = secant
                if abs(aimed) > _ROUNDING * abs(u - last):
                    h = aimed
                    continue
                taken = after[0] = 0.0
                for i in range(1, n):
                    after[i] = x[i]
            if corner and ((x[0] != 0.0 and abs(after[0]) <= rounding) or side * after[0] < 0.0):
                after[0] = 0.0 if abs(after[0]) <= rounding else after[0]
                rates(parameters, after, at + taken, s, after[0], k[end : end + n])
                if after[0] == 0.0 and k[end] != 0.0:
                    rates(parameters, after, at + taken, s, -side, k[end : end + n])
            aims = 0
            for i in range(n):
                x[i], k[i] = after[i], k[end + i]
                largest[i] = max(largest[i], abs(x[i]))
            if not abs(x[0]) <= bound:
                x[0] = math.copysign(math.inf, x[0])
                return evaluated
            if taken == left:
                ended[1] += step
                return evaluated
            left -= taken
            done += abs(taken)
            h *= min(_MOST, _SAFETY * max(error, _OF_LAST * before, 1e-10) ** (-0.125 if is_high else -0.2))
            if x[0] == 0.0 and 0.0 < abs(across) < math.inf:  # once: the steps to a zero are short because of it alone
                h, across = across, math.inf
            before = error
        x[0] = math.nan
        return evaluated

    return follow
