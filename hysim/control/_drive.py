"""The open loop that a closed one is judged against: the voltage reference / secant gain.

The secant gain of a steady cycle is its stroke over its voltage's span. It depends on the span itself, so
that it is found by iteration: the gain at which the cycle that it drives has this gain.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.actuator import Actuator
from hysim.models.static import Line

_ITERATIONS = 50


def secant_gain(actuator: Actuator, cycle: FloatArray, sample_time: float | None = None) -> float:
    """Stroke over span of the steady cycle that the voltage ``cycle / secant gain`` drives.

    `cycle` is one period of a reference that starts where it ends. Without a sample time the cycle is
    quasi-static: the law's, times the vibration's DC gain.

    Raises
    ------
    ValueError
        If the plant has no gain to divide by, or there is no such voltage.
    """
    span = float(np.ptp(cycle))
    if actuator.hysteresis is None and sample_time is None:
        return _usable(_dc_gain(actuator))
    gain = _usable(_dc_gain(actuator) * _slope(actuator, 1.0))
    for _ in range(_ITERATIONS):
        y = steady_cycle(actuator, cycle / gain, sample_time)
        following = _usable(math.copysign(float(np.ptp(y)), gain) / (span / abs(gain)))
        if abs(following - gain) <= 1e-12 * abs(gain):
            return following
        gain = following
    return gain


def steady_cycle(actuator: Actuator, u: FloatArray, sample_time: float | None) -> FloatArray:
    """The displacement over the last of three periods of the voltage `u`."""
    voltage = np.tile(u, 3)
    if sample_time is None:
        level = voltage if actuator.hysteresis is None else actuator.hysteresis.response(voltage)
        return np.asarray(_dc_gain(actuator) * level[-u.size :])
    return actuator.response(voltage, sample_time)[-u.size :]


def without_memory(actuator: Actuator, u: FloatArray) -> Actuator:
    """The actuator with its law replaced by a line of its secant gain over the steady cycle of `u`."""
    if actuator.hysteresis is None:
        return actuator
    level = Actuator(hysteresis=actuator.hysteresis).response(np.tile(u, 3))[-u.size :]
    slope = float(np.ptp(level)) / float(np.ptp(u))
    offset = 0.5 * float(level.max() + level.min()) - slope * 0.5 * float(u.max() + u.min())
    return Actuator(hysteresis=Line(offset=offset, slope=slope), vibration=actuator.vibration)


def slopes(actuator: Actuator, u: FloatArray) -> tuple[float, float]:
    """The least and the largest slope of the law along the steady cycle of `u`; one without a law."""
    if actuator.hysteresis is None:
        return 1.0, 1.0
    voltage = np.tile(u, 3)
    level = Actuator(hysteresis=actuator.hysteresis).response(voltage)
    moves = np.diff(voltage[-u.size - 1 :])
    local = np.diff(level[-u.size - 1 :])[moves != 0.0] / moves[moves != 0.0]
    return float(local.min()), float(local.max())


def _slope(actuator: Actuator, rise: float) -> float:
    if actuator.hysteresis is None:
        return 1.0
    low, high = actuator.hysteresis.response(np.array([0.0, rise]))
    return float(high - low) / rise


def _dc_gain(actuator: Actuator) -> float:
    return 1.0 if actuator.vibration is None else actuator.vibration.dc_gain


def _usable(gain: float) -> float:
    if not (math.isfinite(gain) and gain != 0.0):
        raise ValueError(f"the plant's gain is {gain}: there is no voltage that would drive it along the reference")
    return gain
