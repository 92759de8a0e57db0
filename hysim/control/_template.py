"""The controllers that `tune` searches, as points: PIDs in their standard form, or the free gains of a template."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from hysim._frozen import FloatArray
from hysim.control._pid import PID
from hysim.control._tracking import TrackingController

Limits = tuple[float, ...] | None
Gains = tuple[float, float, float]
"""kp, ki and kd."""

Tuned = PID | TrackingController

_SHAPES = tuple(product((0.1, 1.0, 3.0, 10.0), (0.05, 0.3, 1.0)))  # Ti and Td in units of 1 / crossover
_ZEROS = (0.03, 0.3)  # damping ratio of zeros that a PID puts on a resonance
_SCALES = (1.0, 0.3, 0.1, 0.03)  # of a template's own gains
_FILTER = 0.1
_LARGEST_WEIGHT = 1.0
_LARGEST_LOG = 100.0
_STEP = 0.2  # of the first simplex along the logarithm of a gain


class StandardForm:
    """PIDs as points (log |Kp|, log Ti, log Td, setpoint weight); the gains have the sign of the plant's gain.

    The derivative's filter is a tenth of Td, and of sqrt(Ti Td), one over the frequency of its zeros, if shorter.
    """

    def __init__(self, sign: float) -> None:
        self.sign = sign

    def controller(self, x: FloatArray) -> PID:
        Kp, Ti, Td = _gains(x[:3])
        weight = float(np.clip(x[3], 0.0, _LARGEST_WEIGHT))
        shorter = _FILTER * min(Td, math.sqrt(Ti * Td))
        return PID.standard(math.copysign(Kp, self.sign), Ti, Td, derivative_filter=shorter, setpoint_weight=weight)

    def feedback(self, gains: Gains) -> PID:
        """Part of the controller that is proportional to the gains."""
        return self.controller(self.point(gains))

    def point(self, gains: Gains) -> FloatArray:
        kp, ki, kd = gains
        return np.append(np.log([kp, kp / ki, kd / kp]), 1.0)

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        """Gains up to a factor, for a crossover frequency and a plant with these resonances [rad/s]."""
        yield from _shapes(crossover, resonances)

    def own(self) -> list[FloatArray]:
        return []

    def simplex(self, x: FloatArray) -> FloatArray | None:
        """Corners from which a search around a point begins; None for the search's own."""
        return None


class FreeGains:
    """Controllers as points: logarithms of the gains of a template's feedback and damping loop that are not zero."""

    def __init__(self, template: Tuned, sign: float) -> None:
        self.template, self.sign = template, sign
        self.pid = template if isinstance(template, PID) else template.feedback or PID()
        self.damping = None if isinstance(template, PID) else template.damping
        damping_gain = 0.0 if self.damping is None else self.damping.gain
        self.gains = np.array([self.pid.kp, self.pid.ki, self.pid.kd, damping_gain])
        self.free = self.gains != 0.0
        if not self.free.any():
            raise ValueError("the controller has nothing to tune: the gains that are not zero are the free ones")

    def controller(self, x: FloatArray) -> Tuned:
        gains = np.zeros(4)
        gains[self.free] = self.sign * _gains(x)
        kp, ki, kd, damping = gains.tolist()
        pid = replace(self.pid, kp=kp, ki=ki, kd=kd)
        if isinstance(self.template, PID):
            return pid
        damped = self.damping if self.damping is None else replace(self.damping, gain=damping)
        return replace(self.template, feedback=self.template.feedback and pid, damping=damped)

    def feedback(self, gains: Gains) -> Tuned:
        controller = self.controller(self.point(gains))
        return controller if isinstance(controller, PID) else replace(controller, damping=None)

    def point(self, gains: Gains) -> FloatArray:
        return np.asarray(np.log(np.abs(np.array([*gains, self.gains[3]])[self.free])))

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        free = self.free[:3]
        shapes = _shapes(crossover, resonances) if free.any() else ()
        yield from dict.fromkeys(tuple(np.where(free, gains, 0.0).tolist()) for gains in shapes)

    def own(self) -> list[FloatArray]:
        own = np.log(np.abs(self.gains[self.free]))
        return [own + math.log(scale) for scale in _SCALES]

    def simplex(self, x: FloatArray) -> FloatArray | None:
        return np.vstack([x, x + _STEP * np.eye(x.size)])


def as_template(template: Tuned | None, sign: float) -> StandardForm | FreeGains:
    if template is None:
        return StandardForm(sign)
    if not isinstance(template, PID | TrackingController):
        raise TypeError(f"controller must be a PID or a TrackingController, got {type(template).__name__}")
    return FreeGains(template, sign)


def _gains(logarithms: FloatArray) -> FloatArray:
    return np.exp(np.clip(logarithms, -_LARGEST_LOG, _LARGEST_LOG))


def _shapes(crossover: float, resonances: FloatArray) -> Iterator[Gains]:
    """PIDs up to a factor: by their times, and with zeros on the resonances."""
    yield from ((1.0, crossover / Ti, Td / crossover) for Ti, Td in _SHAPES)
    yield from ((2.0 * ratio / w, 1.0, 1.0 / w**2) for w in resonances for ratio in _ZEROS)
