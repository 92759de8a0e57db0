"""The open loop that a closed one is compared with: the voltage reference / secant gain.

The secant gain of a steady cycle is its stroke over its voltage's span, which depends on the span: the gain g at which
the cycle driven by ``cycle / g`` has the gain f(g) = g. It is found by the secant rule in the logarithms, and by
g <- f where f is no contraction.
"""

import math
from dataclasses import replace

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.laws.static import Line
from hysim.plants.actuator import Actuator

_ITERATIONS = 60
_CONVERGED = 1e-12  # of the gain
_ACCEPTED = 1e-9  # where rounding keeps it from that
_CONTRACTION = 0.5  # largest slope of the map at which the secant rule is trusted
_PERIODS = 96  # at most, until a driven cycle is steady
_STEADY = 1e-12  # of the stroke


def secant_gain(
    actuator: Actuator, cycle: FloatArray, sample_time: float | None = None, periods: int | None = None
) -> float:
    """Stroke over span of the steady cycle that the voltage ``cycle / secant gain`` drives.

    `cycle` is one period of a reference. Without a sample time it is quasi-static: the law's, times the vibration's DC
    gain. With a number of periods the last of them stands for the steady cycle, which creep approaches slowly. A
    ValueError if the plant has no gain, or there is no such voltage.
    """
    span = float(np.ptp(cycle))
    if actuator.hysteresis is None and sample_time is None:
        return _usable(actuator.dc_gain)
    gain = _usable(actuator.dc_gain * _first_slope(actuator))
    before: tuple[float, float] | None = None
    for _ in range(_ITERATIONS):
        y = steady_cycle(actuator, cycle / gain, sample_time, periods)
        next_gain = _usable(float(np.ptp(y)) / span * gain)
        change = abs(next_gain / gain - 1.0)
        if change <= _CONVERGED:
            return next_gain
        now = gain, next_gain
        gain, before = next_gain if before is None else _secant(before, now), now
    if change > _ACCEPTED:
        raise ValueError(
            f"no voltage drives the plant along the reference: its secant gain does not converge at {gain:g}"
        )
    return next_gain


def steady_cycle(
    actuator: Actuator, u: FloatArray, sample_time: float | None, periods: int | None = None
) -> FloatArray:
    """Displacement over a period of the voltage `u` once it repeats, or over the last of some periods."""
    if periods is not None:
        return _driven(actuator, np.tile(u, periods), sample_time)[-u.size :]
    periods = 3
    while True:
        y = _driven(actuator, np.tile(u, periods), sample_time)
        last, before = y[-u.size :], y[-2 * u.size : -u.size]
        if periods >= _PERIODS or np.abs(last - before).max() <= _STEADY * max(float(np.ptp(last)), 1e-300):
            return last
        periods *= 2


def without_memory(actuator: Actuator, u: FloatArray) -> Actuator:
    """Actuator with its law replaced by a line of its secant gain over the steady cycle of `u`."""
    if actuator.hysteresis is None:
        return actuator
    voltage, level = actuator.voltage(u), _steady_level(actuator, u)
    rises = float(np.diff(level) @ np.diff(voltage))
    slope = math.copysign(float(np.ptp(level)) / float(np.ptp(voltage)), rises)
    offset = 0.5 * float(level.max() + level.min()) - slope * 0.5 * float(voltage.max() + voltage.min())
    return replace(actuator, hysteresis=Line(offset=offset, slope=slope))


def slopes(actuator: Actuator, u: FloatArray) -> tuple[float, float]:
    """Least and largest slope of the law along the steady cycle of `u`; one without a law."""
    if actuator.hysteresis is None:
        return 1.0, 1.0
    voltage, level = actuator.voltage(u), _steady_level(actuator, u)
    steps = np.diff(voltage, append=voltage[0])
    local = np.diff(level, append=level[0])[steps != 0.0] / steps[steps != 0.0]
    return float(local.min()), float(local.max())


def _driven(actuator: Actuator, u: FloatArray, sample_time: float | None) -> FloatArray:
    if sample_time is not None:
        return actuator.response(u, sample_time)
    return np.asarray(replace(actuator, amplifier=None).dc_gain * actuator.level(u))


def _steady_level(actuator: Actuator, u: FloatArray) -> FloatArray:
    return steady_cycle(Actuator(hysteresis=actuator.hysteresis), actuator.voltage(u), None)


def _first_slope(actuator: Actuator) -> float:
    low, high = replace(actuator, amplifier=None).level(np.array([0.0, 1.0]))
    return float(high - low)


def _secant(before: tuple[float, float], now: tuple[float, float]) -> float:
    """Gain at which, in log g and log f, the line through two points meets f = g; f if the map is no contraction."""
    gain, value = now
    step = math.log(gain / before[0])
    slope = math.log(value / before[1]) / step if step else math.inf
    return gain * (value / gain) ** (1.0 / (1.0 - slope)) if abs(slope) < _CONTRACTION else value


def _usable(gain: float) -> float:
    if not (math.isfinite(gain) and gain != 0.0):
        raise ValueError(
            f"the plant's gain is {gain}: no voltage drives it along the reference; if its law is unsafe on smaller "
            "cycles, identify it with admissible=True, or take a sum of plays"
        )
    return gain
