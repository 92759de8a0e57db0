"""The controllers that `tune` searches, as points: PIDs in their standard form, or the free gains of a template."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.control._pid import PID
from hysim.control._sampled import SampledController
from hysim.control._tracking import TrackingController

Limits = tuple[float, float] | None
Gains = tuple[float, float, float]
"""kp, ki and kd."""

_SHAPES = tuple(product((0.1, 1.0, 3.0, 10.0), (0.05, 0.3, 1.0)))  # Ti and Td in units of 1 / crossover
_ZEROS = (0.03, 0.3)  # damping ratio of zeros that a PID puts on a resonance
_SCALES = (1.0, 0.3, 0.1, 0.03)  # of a template's own gains
_FILTER = 0.1
_LARGEST_WEIGHT = 1.0
_LARGEST_LOG = 100.0
_STEP = 0.2  # of the first simplex along the logarithm of a gain


class Template(Protocol):
    """Controllers as points of a space of logarithms."""

    def controller(self, x: FloatArray) -> Any:
        """The controller at a point."""
        ...

    def feedback(self, gains: Gains) -> SampledController:
        """What the linear rule scales: the part of a controller that is proportional to these gains."""
        ...

    def point(self, gains: Gains) -> FloatArray:
        """Where the controller with these gains is."""
        ...

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        """Gains up to a factor, for a crossover frequency and a plant with these resonances [rad/s]."""
        ...

    def own(self) -> list[FloatArray]:
        """Points that need no rule."""
        ...

    def simplex(self, x: FloatArray) -> FloatArray | None:
        """The corners from which a search around a point begins; None for the search's own."""
        ...


def as_template(template: Any, sign: float) -> Template:
    """Of no controller, of a PID, or of a controller of parts; the gains get the sign of the plant's gain."""
    if template is None:
        return StandardForm(sign)
    if not isinstance(template, PID | TrackingController):
        raise TypeError(f"controller must be a PID or a TrackingController, got {type(template).__name__}")
    return FreeGains(template, sign)


def within(controller: Any, limits: Limits) -> Any:
    """The controller with other limits."""
    return replace(controller, limits=limits)


class StandardForm:
    """log |Kp|, log Ti, log Td and the setpoint weight.

    The derivative's filter is a tenth of Td, and of sqrt(Ti Td), one over the frequency of its zeros, where that is
    shorter.
    """

    def __init__(self, sign: float) -> None:
        self.sign = sign

    def controller(self, x: FloatArray) -> PID:
        Kp, Ti, Td = _gains(x[:3])
        weight = float(np.clip(x[3], 0.0, _LARGEST_WEIGHT))
        shorter = _FILTER * min(Td, math.sqrt(Ti * Td))
        return PID.standard(math.copysign(Kp, self.sign), Ti, Td, derivative_filter=shorter, setpoint_weight=weight)

    def feedback(self, gains: Gains) -> PID:
        return self.controller(self.point(gains))

    def point(self, gains: Gains) -> FloatArray:
        kp, ki, kd = gains
        return np.append(np.log([kp, kp / ki, kd / kp]), 1.0)

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        yield from _shapes(crossover)
        yield from _on(resonances)

    def own(self) -> list[FloatArray]:
        return []

    def simplex(self, x: FloatArray) -> FloatArray | None:
        return None


class FreeGains:
    """Logarithms of the gains of a template's feedback, and of its damping loop, that are not zero."""

    def __init__(self, template: PID | TrackingController, sign: float) -> None:
        self.template, self.sign = template, sign
        pid = template if isinstance(template, PID) else template.feedback or PID()
        damping = None if isinstance(template, PID) else template.damping
        self.pid, self.damping = pid, damping
        self.given = np.array([pid.kp, pid.ki, pid.kd, 0.0 if damping is None else damping.gain])
        self.free = self.given != 0.0
        if not self.free.any():
            raise ValueError("the controller has nothing to tune: the gains that are not zero are the free ones")

    def controller(self, x: FloatArray) -> Any:
        gains = np.zeros(4)
        gains[self.free] = self.sign * _gains(x)
        kp, ki, kd, damping = gains.tolist()
        pid = replace(self.pid, kp=kp, ki=ki, kd=kd)
        if isinstance(self.template, PID):
            return pid
        damped = self.damping if self.damping is None else replace(self.damping, gain=damping)
        return replace(self.template, feedback=self.template.feedback and pid, damping=damped)

    def feedback(self, gains: Gains) -> SampledController:
        found = self.controller(self.point(gains))
        return found if isinstance(found, PID) else replace(found, damping=None)

    def point(self, gains: Gains) -> FloatArray:
        return np.asarray(np.log(np.abs(np.array([*gains, self.given[3]])[self.free])))

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        if not self.free[:3].any():
            return
        tried = [*_shapes(crossover), *_on(resonances)]
        yield from dict.fromkeys(tuple(np.where(self.free[:3], gains, 0.0).tolist()) for gains in tried)

    def own(self) -> list[FloatArray]:
        given = np.log(np.abs(self.given[self.free]))
        return [given + math.log(scale) for scale in _SCALES]

    def simplex(self, x: FloatArray) -> FloatArray:
        return np.vstack([x, x + _STEP * np.eye(x.size)])


def _gains(logarithms: FloatArray) -> FloatArray:
    return np.exp(np.clip(logarithms, -_LARGEST_LOG, _LARGEST_LOG))


def _shapes(crossover: float) -> Iterator[Gains]:
    return ((1.0, crossover / Ti, Td / crossover) for Ti, Td in _SHAPES)


def _on(resonances: Sequence[float] | npt.NDArray[np.float64]) -> Iterator[Gains]:
    """PIDs whose zeros lie at a resonance."""
    return ((2.0 * ratio / w, 1.0, 1.0 / w**2) for w in resonances for ratio in _ZEROS)
