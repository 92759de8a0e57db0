"""The inverse of a law that is known by its step and its slope: Newton's method in a bracket, sample by sample.

From one sample of the output to the next the input moves monotonically. Its end is the zero of
y(u) - y_wanted, which is monotone where the slope keeps its sign. The slope is looked at where the stretch
begins, in both directions (or the output would not tell which way the input went), and along it. Where it has
turned, the search is repeated in front of the turn.

An output may be small beside the terms that it is the sum of. Many inputs then give it to rounding, and the first one
that is found is taken; the error that is left is no more than what the rounding of the terms comes to.
"""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hysim._frozen import FloatArray
from hysim.errors import SimulationError
from hysim.models.protocols import CompiledLaw

_POINTS = 16  # of a stretch at which its slope is looked at
_MAX_STEPS = 400
_MAX_TURNS = 64  # stretches that are tried, each shorter than the last, before the first turn is left at its place
_UNIT = 2.0**-52
_CLOSED = 16.0  # roundings of the terms of the output that a law's step may leave where the bracket has closed
_PROMISED = 1e-12  # of the memory's stroke: what a law that is stepped by a power series may be off by
_SMALLEST = 2.0**-1022  # below it numbers lose their bits: an output that near to another is no other


class SteppedLaw(Protocol):
    """What a law must have to be inverted."""

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The forward step."""
        ...

    @property
    def tangent(self) -> Callable[..., FloatArray]:
        """The slope dy/du, ``tangent(direction, z, u, ...)`` with the rest of the state."""
        ...


def inverse_response(
    law: SteppedLaw, y: FloatArray, start: tuple[float, ...], terms: Callable[[float, float], tuple[float, float]]
) -> FloatArray:
    """Inputs for the outputs `y`, from the state `start`; see `ZhuWangBoucWen.inverse_response`.

    `terms` are the parts of the output at the input u and the memory z, each as the sum of the sizes of its terms:
    what u contributes with the offset, and what z contributes. They tell how far an output is rounded.
    """
    forward = _Forward(law, start, terms)
    slope = forward.slope(start, 1.0)
    rising = math.copysign(1.0, slope)
    if slope == 0.0:
        raise ValueError(f"the law has no inverse: its slope is zero at u = {start[0]:g}")
    u = np.empty(y.size)
    with np.errstate(all="ignore"):  # a bracket may reach where the memory overflows
        for k, wanted in enumerate(y.tolist()):
            try:
                u[k] = forward.reach(wanted, rising)
            except ArithmeticError as reason:
                raise SimulationError(f"the law has no inverse at sample {k} (y = {wanted:g}): {reason}") from None
    return u


class _Forward:
    """The law at its last input, and what it does from there."""

    def __init__(
        self, law: SteppedLaw, start: tuple[float, ...], terms: Callable[[float, float], tuple[float, float]]
    ) -> None:
        self.law, self.compiled, self.terms = law, law.compiled(), terms
        self.here = start
        self.y = self.output(start[0])

    def output(self, u: float) -> float:
        """Output at the input `u`, reached from here."""
        self.compiled.state[: len(self.here)] = self.here
        return float(self.compiled.step(self.compiled.parameters, self.compiled.state, u))

    def state(self, u: float) -> tuple[float, ...]:
        """State at the input `u`, reached from here."""
        self.output(u)
        return tuple(self.compiled.state[: len(self.here)].tolist())

    def slope(self, state: tuple[float, ...], direction: float) -> float:
        """Slope of the output at a state for an input that moves in `direction`."""
        u, z, *others = state
        return float(self.law.tangent(direction, z, u, *others))

    def reach(self, wanted: float, rising: float) -> float:
        """Move to where the output is `wanted`, and return the input there; `rising` is the sign of the slope.

        The first place is meant: where the law has turned on the way, the search is repeated in front of the turn.

        Raises
        ------
        ArithmeticError
            If there is no such place, or the slope has not this sign on the way.
        """
        gap = wanted - self.y
        u = self.here[0]
        if abs(gap) < _SMALLEST:
            return u
        direction = math.copysign(1.0, gap) * rising
        if reason := self._turn([self.here, self.here], np.array([direction, -direction]), rising)[1]:
            raise ArithmeticError(reason)
        limit, reason = direction * math.inf, ""
        for _ in range(_MAX_TURNS):
            end, missed = self._zero(wanted, direction, rising, limit)
            way = [self.state(u + (end - u) * (k / _POINTS)) for k in range(_POINTS)]
            way.append(self.state(end))
            turn, reason_here = self._turn(way, np.full(len(way), direction), rising)
            reason = reason or reason_here or missed
            if not reason_here and not missed:
                self.here, self.y = way[-1], wanted
                return end
            if not reason_here or not direction * u < direction * turn < direction * end:
                break
            limit = turn
        raise ArithmeticError(reason)

    def _turn(self, states: list[tuple[float, ...]], direction: FloatArray, rising: float) -> tuple[float, str]:
        """The first of the inputs at which the slope has not the sign `rising`, and a reason; or an empty reason."""
        u, z, *others = np.array(states).T
        slopes = self.law.tangent(direction, z, u, *others)
        turned = ~(rising * slopes > 0.0)
        if not turned.any():
            return math.nan, ""
        k = int(np.argmax(turned))
        return float(u[k]), f"at u = {u[k]:g} its slope is {slopes[k]:g}"

    def _zero(self, wanted: float, direction: float, rising: float, limit: float) -> tuple[float, str]:
        """The input at which the output is `wanted`, sought in `direction` up to `limit`, and why there is none.

        Newton's method in a bracket, which is halved where Newton's steps do not shrink. What is not finite, or where
        the slope has turned, is beyond the input. The error that is left is no larger than what rounds the output: its
        terms, those of the input, and the promise of the step.
        """
        behind, beyond = self.here[0], limit
        target, error, slope = behind, self.y - wanted, self.slope(self.here, direction)
        (plain_here, memory_here), z_here = self.terms(*self.here[:2]), self.here[1]
        closest, nearest, allowed = behind, math.inf, 0.0
        before_last = last = math.inf
        for _ in range(_MAX_STEPS):
            move = -error / slope if rising * slope > 0.0 and math.isfinite(error) else math.nan
            trial = target + move
            if trial == target:
                return target, ""
            inside = direction * behind < direction * trial < direction * beyond
            if not inside or (not math.isinf(beyond) and abs(move) > 0.5 * before_last):
                if math.isinf(beyond):
                    break
                trial = 0.5 * (behind + beyond)
                move = abs(trial - target)
            if trial in (behind, beyond):
                break
            before_last, last, target = last, abs(move), trial
            error = self.output(target) - wanted
            state = tuple(self.compiled.state[: len(self.here)].tolist())
            slope = self.slope(state, direction)
            plain, memory = self.terms(*state[:2])
            memory = min(memory, abs(wanted) + plain)  # what it is where the output is reached; it may be infinite here
            rounding = _UNIT * (max(plain, plain_here) + max(memory, memory_here) + abs(wanted))
            if abs(error) < nearest:
                closest, nearest = target, abs(error)
                stroke = min(self.terms(0.0, state[1] - z_here)[1], memory + memory_here)
                allowed = _CLOSED * (rounding + _UNIT * abs(target * slope)) + _PROMISED * stroke
            if abs(error) <= rounding < math.inf and rising * slope > 0.0:
                return target, ""
            if direction * rising * error < 0.0 and rising * slope > 0.0 and math.isfinite(error):
                behind = target
            else:
                beyond = target
        if nearest <= allowed + _SMALLEST < math.inf:
            return closest, ""
        return behind, f"the output does not reach it; at u = {target:g} its slope is {slope:g}"
