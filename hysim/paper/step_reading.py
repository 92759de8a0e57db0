"""Rise time, overshoot, peak and settling time of a stable linear system, read off its exact step response.

    x' = A x + B,  x(0) = 0:    y'(t) = C e^(A t) B,    y(t) = y(oo) + C A^-1 e^(A t) B

The response is evaluated at samples close enough to part its extremes, the extremes are found as the zeros of y', and
between two neighbours of samples and extremes, where y is monotone, each crossing of a level is found as a root. The
samples serve as brackets only: a finer grid changes no reading by more than the roots' tolerance, 1e-12 of the time
over which the response is evaluated. With eta = y / y(oo):

    rise time       from the first eta = 10 % to the first eta = 90 %
    settling time   after which |eta - 1| stays within 2 %
    overshoot       100 (max eta - 1) %, at least 0
    peak time       when eta is largest

`control.step_info` reads the same off samples that it chooses coarsely, without interpolation: 0.862 for the rise time
0.916 of equation (1).
"""

import math
from itertools import accumulate
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from hysim._basics.frozen import FloatArray, frozen

_SETTLED = 0.02
_PER_TIME_CONSTANT = 5
"""Samples in the time constant of the fastest mode, so that two extremes do not lie between two samples."""
_FADED = 1e-6
"""Share of the slowest mode that remains where the evaluation ends."""
_ROOT = 1e-12
"""Precision of the time of an extreme or a crossing, as a fraction of the time over which the response is evaluated."""


@frozen
class StepReading:
    """The readings of a step response.

    Parameters
    ----------
    final : float
        Final value [unit of y].
    rise_time : float
        From 10 to 90 % of it [unit of time].
    overshoot_percent : float
        Largest excess over it [%]; 0 where there is none.
    peak_time : float
        When the response is largest [unit of time]; the last time evaluated where it only creeps up.
    settling_time : float
        After which the response stays within 2 % of the final value [unit of time].
    """

    final: float
    rise_time: float
    overshoot_percent: float
    peak_time: float
    settling_time: float


def step_reading(system: Any, *, per_time_constant: int = _PER_TIME_CONSTANT) -> StepReading:
    """Read off the response of a stable system to a unit step.

    Parameters
    ----------
    system : python-control system
        Continuous, with one input and one output, a gain at zero frequency and no delay.
    per_time_constant : int
        Samples in the time constant of the fastest mode, which bracket extremes and crossings.

    Returns
    -------
    StepReading

    Raises
    ------
    ValueError
        If the system is not stable, or has no gain at zero frequency.

    Examples
    --------
    >>> import control
    >>> lag = step_reading(control.tf([2.0], [1.0, 1.0]))
    >>> round(lag.rise_time, 9), round(lag.settling_time, 9)  # ln 9 and ln 50
    (2.197224577, 3.912023005)
    """
    response = _Response(system)
    time, eta = response.knots(per_time_constant)

    def crossing(after: int, level: float) -> float:
        """When eta passes the level between the knot before `after` and it."""
        if after == 0:
            return 0.0
        begin, end = float(time[after - 1]), float(time[after])
        return _root(lambda t: response.at(t)[0] - level, begin, end, float(time[-1]))

    outside = int(np.flatnonzero(np.abs(eta - 1.0) > _SETTLED)[-1])
    rise_begins, rise_ends = (crossing(int(np.argmax(eta >= level)), level) for level in (0.1, 0.9))
    largest = int(np.argmax(eta))
    return StepReading(
        final=response.final,
        rise_time=rise_ends - rise_begins,
        overshoot_percent=max(100.0 * (float(eta[largest]) - 1.0), 0.0),
        peak_time=float(time[largest]),
        settling_time=crossing(outside + 1, 1.0 + math.copysign(_SETTLED, eta[outside] - 1.0)),
    )


class _Response:
    """The exact step response of a system, over its final value, and its slope."""

    def __init__(self, system: Any) -> None:
        import control

        states = control.ss(system)
        self.A, self.B = np.asarray(states.A), np.asarray(states.B)[:, 0]
        poles = np.linalg.eigvals(self.A)
        self.slowest, self.fastest = float(np.min(-poles.real)), float(np.max(np.abs(poles)))
        C, D = np.asarray(states.C)[0], float(np.asarray(states.D)[0, 0])
        if not self.slowest > 0.0:
            raise ValueError(f"the step response needs a stable system, got poles {poles}")
        to_final = np.linalg.solve(self.A.T, C)
        self.final = D - float(to_final @ self.B)
        if self.final == 0.0:
            raise ValueError("the step response needs a system with a gain at zero frequency, got 0")
        self.rows = np.array([to_final, C]) / self.final

    def at(self, t: float) -> tuple[float, float]:
        """The response over its final value, and its derivative."""
        rest, slope = self.rows @ expm(self.A * t) @ self.B
        return 1.0 + float(rest), float(slope)

    def knots(self, per_time_constant: int) -> tuple[FloatArray, FloatArray]:
        """Times and values of the samples and of every extreme between them, until the slowest mode has faded."""
        duration = math.log(1.0 / _FADED) / self.slowest
        time = np.linspace(0.0, duration, math.ceil(duration * self.fastest * per_time_constant) + 2)
        step = expm(self.A * time[1])
        modes = np.array(list(accumulate(time[1:], lambda mode, _: step @ mode, initial=self.B)))
        eta, slope = self.rows @ modes.T
        turning = np.flatnonzero(slope[1:-1] * slope[2:] < 0.0) + 1
        extremes = [_root(lambda t: self.at(t)[1], time[k], time[k + 1], duration) for k in turning]
        values = np.concatenate([1.0 + eta, [self.at(t)[0] for t in extremes]])
        times = np.concatenate([time, extremes])
        order = np.argsort(times, kind="stable")
        return times[order], values[order]


def _root(function: Any, begin: float, end: float, duration: float) -> float:
    """A root in a bracket; an end where rounding has taken the change of sign away."""
    at_begin, at_end = function(begin), function(end)
    if at_begin * at_end >= 0.0:
        return begin if abs(at_begin) < abs(at_end) else end
    return float(brentq(function, begin, end, xtol=_ROOT * duration, rtol=8.9e-16))
