"""The inverse of a law that is known by its step and its slope: Newton's method in a bracket, sample by sample.

From one sample of the output to the next the input moves monotonically. Its end is the zero of
y(u) - y_wanted, which is monotone where the slope keeps its sign. The slope is looked at where the stretch
begins, in both directions (or the output would not tell which way the input went), and along it.
"""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hysim._frozen import FloatArray
from hysim.errors import SimulationError
from hysim.models.model import CompiledLaw

_POINTS = 16  # of a stretch at which its slope is looked at
_MAX_STEPS = 200
_ROUNDINGS = 8.0 * 2.0**-52
_CLOSED = 64.0 * 2.0**-52  # of the outputs and of u dy/du: what rounding may leave where the bracket has closed
_SMALLEST = 2.0**-1022


class SteppedLaw(Protocol):
    """What a law must have to be inverted."""

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The forward step."""
        ...

    @property
    def tangent(self) -> Callable[..., FloatArray]:
        """The slope dy/du, ``tangent(direction, z, u, ...)`` with the rest of the state."""
        ...


def inverse_response(law: SteppedLaw, y: FloatArray, start: tuple[float, ...]) -> FloatArray:
    """Inputs for the outputs `y`, from the state `start`; see `ZhuWangBoucWen.inverse_response`."""
    forward = _Forward(law, start)
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

    def __init__(self, law: SteppedLaw, start: tuple[float, ...]) -> None:
        self.law, self.compiled = law, law.compiled()
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

        Raises
        ------
        ArithmeticError
            If there is no such place, or the slope has not this sign on the way.
        """
        gap = wanted - self.y
        u = self.here[0]
        if gap == 0.0:
            return u
        direction = math.copysign(1.0, gap) * rising
        self._check(np.array([self.here, self.here]), np.array([direction, -direction]), rising)
        end = self._zero(wanted, direction, rising)
        way = u + (end - u) * np.linspace(0.0, 1.0, _POINTS + 1)
        self._check(np.array([self.state(point) for point in way]), np.full(way.size, direction), rising)
        self.here = self.state(end)
        self.y = wanted
        return end

    def _check(self, states: FloatArray, direction: FloatArray, rising: float) -> None:
        u, z, *others = states.T
        slopes = self.law.tangent(direction, z, u, *others)
        if not (rising * slopes > 0.0).all():
            k = int(np.argmin(rising * slopes))
            raise ArithmeticError(f"at u = {u[k]:g} its slope is {slopes[k]:g}")

    def _zero(self, wanted: float, direction: float, rising: float) -> float:
        """The input at which the output is `wanted`, sought in `direction`.

        What is not finite, or where the slope has turned, is beyond it. An output that is nearer than the next input
        takes the input that is there.
        """
        behind, beyond = self.here[0], direction * math.inf
        target, error, slope = behind, self.y - wanted, self.slope(self.here, direction)
        for _ in range(_MAX_STEPS):
            trial = target - error / slope if rising * slope > 0.0 and math.isfinite(error) else math.nan
            if trial == target and rising * slope > 0.0:
                return target
            if not direction * behind < direction * trial < direction * beyond:
                if math.isinf(beyond):
                    break
                trial = 0.5 * (behind + beyond)
            if trial in (behind, beyond):
                left = abs(error) - _CLOSED * (abs(wanted) + abs(self.y) + abs(target * slope)) - _SMALLEST
                if left <= 0.0:
                    return target
                break
            target = trial
            error = self.output(target) - wanted
            slope = self.slope(tuple(self.compiled.state[: len(self.here)].tolist()), direction)
            if abs(error) <= _ROUNDINGS * (abs(wanted) + abs(self.y)):
                return target
            if direction * rising * error < 0.0 and rising * slope > 0.0 and math.isfinite(error):
                behind = target
            else:
                beyond = target
        raise ArithmeticError(f"the output does not reach it; at u = {target:g} its slope is {slope:g}")
