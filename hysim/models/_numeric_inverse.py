"""The inverse of a law that is known by its step and its slope: Newton's method in a bracket, sample by sample.

From one sample of the output to the next the input moves monotonically. Its end is the zero of
y(u) - y_wanted, which is monotone where the slope keeps its sign. The slope is looked at where the stretch
begins, in both directions (or the output would not tell which way the input went), and along it.
"""

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.errors import SimulationError
from hysim.models.model import CompiledLaw

_POINTS = 16  # of a stretch at which its slope is looked at
_MAX_STEPS = 200
_ROUNDINGS = 8.0 * 2.0**-52


class SteppedLaw(Protocol):
    """What a law must have to be inverted."""

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The forward step."""
        ...

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike = 0.0) -> FloatArray:
        """The slope dy/du."""
        ...


def inverse_response(law: SteppedLaw, y: FloatArray, start: tuple[float, float]) -> FloatArray:
    """Inputs for the outputs `y`, from the input and memory `start`; see `ZhuWangBoucWen.inverse_response`."""
    forward = _Forward(law, start)
    rising = math.copysign(1.0, forward.slope(*start, 1.0))
    if forward.slope(*start, 1.0) == 0.0:
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

    def __init__(self, law: SteppedLaw, start: tuple[float, float]) -> None:
        self.law, self.compiled = law, law.compiled()
        self.here = start
        self.y = self.output(start[0])

    def output(self, u: float) -> float:
        """Output at the input `u`, reached from here."""
        self.compiled.state[:2] = self.here
        return float(self.compiled.step(self.compiled.parameters, self.compiled.state, u))

    def memory(self, u: float) -> float:
        """Memory at the input `u`, reached from here."""
        self.output(u)
        return float(self.compiled.state[1])

    def slope(self, u: float, z: float, direction: float) -> float:
        """Slope of the output at (u, z) for an input that moves in `direction`."""
        return float(self.law.tangent(direction, z, u))

    def reach(self, wanted: float, rising: float) -> float:
        """Move to where the output is `wanted`, and return the input there; `rising` is the sign of the slope.

        Raises
        ------
        ArithmeticError
            If there is no such place, or the slope has not this sign on the way.
        """
        gap = wanted - self.y
        u, z = self.here
        if gap == 0.0:
            return u
        direction = math.copysign(1.0, gap) * rising
        self._check(np.array([u, u]), np.array([z, z]), np.array([direction, -direction]), rising)
        end = self._zero(wanted, direction, rising)
        way = u + (end - u) * np.linspace(0.0, 1.0, _POINTS + 1)
        self._check(way, np.array([self.memory(point) for point in way]), np.full(way.size, direction), rising)
        self.here = end, self.memory(end)
        self.y = wanted
        return end

    def _check(self, u: FloatArray, z: FloatArray, direction: FloatArray, rising: float) -> None:
        slopes = self.law.tangent(direction, z, u)
        if not (rising * slopes > 0.0).all():
            k = int(np.argmin(rising * slopes))
            raise ArithmeticError(f"at u = {u[k]:g} its slope is {slopes[k]:g}")

    def _zero(self, wanted: float, direction: float, rising: float) -> float:
        behind, beyond = self.here[0], direction * math.inf
        target, z, error = behind, self.here[1], self.y - wanted
        for _ in range(_MAX_STEPS):
            slope = self.slope(target, z, direction)
            trial = target - error / slope if rising * slope > 0.0 else math.nan
            if not direction * behind < direction * trial < direction * beyond:
                if math.isinf(beyond):
                    break
                trial = 0.5 * (behind + beyond)
            if trial in (behind, beyond):
                return target
            target = trial
            error = self.output(target) - wanted
            z = float(self.compiled.state[1])
            if abs(error) <= _ROUNDINGS * (abs(wanted) + abs(self.y)):
                return target
            if direction * rising * error < 0.0:
                behind = target
            else:
                beyond = target
        raise ArithmeticError(f"the output does not reach it; at u = {target:g} its slope is {slope:g}")
