"""Whether a loop is stable: by its poles, and by running it until it should be at rest.

In linear theory all poles of the sampled loop, with its delay, must lie inside the unit circle, the law replaced by
lines of its least and of its largest slope along the reference. A slope that is zero, or of the sign against that of
the whole cycle, closes no loop for a moment, and is left to the run.

Limits, quanta and memory are not in that theory. So the loop also follows the reference without noise, and the
reference then stays at its last value for `_REST` time constants of the slowest oscillation of the linear loop. A
stable loop comes to rest. One whose remaining oscillation, without its drift, is larger than

    1 % of the voltage that the reference asks for               where readings are continuous
    2 quanta of displacement, or nearly from limit to limit      where they are quantised

and decays at less than half the rate of the linear loop is in a limit cycle. A loop that still moves without
swinging is held longer.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.control._loop import RestingPlant
from hysim.control._margins import LinearLoop
from hysim.control._open_loop import slopes
from hysim.control._protocols import Controller, limits_of
from hysim.control._sampled import SampledController
from hysim.plants.actuator import Actuator
from hysim.plants.amplifier import Amplifier
from hysim.plants.sensor import Sensor

_REST = 6.0  # time constants: an oscillation is then 0.2 % of what it was
_SHORTEST, _LONGEST = 400, 10  # samples, and lengths of the reference, for which it is held
_FASTEST = 0.02  # decay per sample that is asked for at most: noise of rounding has none
_SMALL = 0.01  # part of the voltage's span
_QUANTA = 2.0
_FULL = 0.9  # part of the distance between the limits
_LARGE = 0.25  # part of the largest deviation that counts as a swing to a side
_SWINGS = 3  # changes of side; a curved drift has two
_CLOSES = 1e-6  # least slope of a law that closes a loop, in units of the cycle's


@frozen
class LinearFigures:
    """Figures of the linear loop, the worst over both slopes of the law.

    Parameters
    ----------
    is_stable : bool
    max_sensitivity, max_sensitivity_with_delay : float
        The largest ``|1 / (1 + L)|``, also with one sample more of delay; infinite if unstable, nan if unknown.
    decay : float
        Of the slowest oscillation, per sample.
    command_jump : float
        Jump of the command when the measurement moves by one; nan if unknown [unit of u / unit of y].
    """

    is_stable: bool
    max_sensitivity: float
    max_sensitivity_with_delay: float
    decay: float
    command_jump: float


def later(plant: Actuator, time: float) -> Actuator:
    """The plant, its displacement read later by a time [s]."""
    sensor = plant.sensor or Sensor()
    return replace(plant, sensor=replace(sensor, delay=sensor.delay + time))


def closing_slopes(plant: Actuator, cycle: FloatArray, gain: float) -> tuple[float, ...]:
    """Least and largest slope of the law along a cycle of the reference, of those that close a loop; 1 without a law.

    `gain` is the secant gain.
    """
    if plant.hysteresis is None:
        return (1.0,)
    secant = gain / plant.dc_gain
    each = sorted({slope for slope in slopes(plant, cycle / gain) if slope / secant > _CLOSES})
    return tuple(each) or (secant,)


def linear_figures(
    plant: Actuator, controller: Controller, sample_time: float, slopes: Sequence[float]
) -> LinearFigures:
    """Figures of the linear loop; of a controller that is not known to have a linear part they are unknown."""
    if not isinstance(controller, SampledController):
        return LinearFigures(
            is_stable=True,
            max_sensitivity=math.nan,
            max_sensitivity_with_delay=math.nan,
            decay=_FASTEST,
            command_jump=math.nan,
        )
    loops = [LinearLoop(each, sample_time) for each in (plant, later(plant, sample_time))]
    now, delayed = (max(loop.max_sensitivity(controller, slope) for slope in slopes) for loop in loops)
    return LinearFigures(
        is_stable=now < math.inf,
        max_sensitivity=now,
        max_sensitivity_with_delay=delayed,
        decay=slowest_decay(loops[0], controller, slopes) if now < math.inf else 0.0,
        command_jump=abs(controller.linear(sample_time).D),
    )


def slowest_decay(loop: LinearLoop, controller: SampledController, slopes: Sequence[float]) -> float:
    """Decay per sample of the slowest oscillation of a stable loop, at most `_FASTEST`."""
    poles = np.concatenate([loop.poles(controller, slope) for slope in slopes])
    oscillating = np.abs(poles[poles.imag > 0.0])
    slowest = float(oscillating.max()) if oscillating.size else 0.0
    return -math.log(max(slowest, math.exp(-_FASTEST)))


def limit_cycle(
    plant: Actuator,
    controller: Controller,
    reference: FloatArray,
    sample_time: float,
    u0: float | None = None,
    *,
    decay: float,
    asked: float,
) -> str:
    """In words, how the loop moves on where it should be at rest; empty if it comes to rest.

    `decay` is that of the slowest oscillation of the stable linear loop, per sample, and `asked` the range of the
    voltage that the reference asks for.
    """
    resting = RestingPlant(_without_noise(plant), sample_time, u0)
    n = reference.size
    longest = _LONGEST * max(n, _SHORTEST)
    held = min(max(math.ceil(_REST / decay), _SHORTEST, n // 4), longest)
    while True:
        signals = resting.attempt(controller, np.append(reference, np.full(held, reference[-1])))
        if signals.lost >= 0:
            return f"diverges at t = {signals.lost * sample_time:g}"
        tail, slower = held // 4, math.exp(-0.5 * decay * (held // 4))
        volts, far = _swing(signals.drive, tail, slower), _swing(signals.y, tail, slower)
        if _too_large(resting, controller, volts, far, asked):
            return f"is in a limit cycle of {volts:.3g} in the command and {far:.3g} in the displacement"
        volts, far = (float(np.ptp(signal[-2 * tail :])) for signal in (signals.drive, signals.y))
        if held == longest or not _too_large(resting, controller, volts, far, asked):
            return ""
        held = min(4 * held, longest)  # it drifts, or swings more slowly than that


def _without_noise(plant: Actuator) -> Actuator:
    return plant if plant.sensor is None else replace(plant, sensor=replace(plant.sensor, noise=0.0))


def _too_large(resting: RestingPlant, controller: Controller, volts: float, far: float, asked: float) -> bool:
    chain = resting.chain
    quantum = chain.sensor.quantum
    if not quantum:
        return volts > _SMALL * asked
    low, high = np.clip(limits_of(controller) or (-math.inf, math.inf), *_commands(chain.amplifier))
    return far > _QUANTA * quantum or _FULL * float(high - low) < volts


def _commands(amplifier: Amplifier) -> tuple[float, float]:
    """Commands at the limits of an amplifier."""
    if amplifier.limits is None:
        return -math.inf, math.inf
    first, second = ((limit - amplifier.offset) / amplifier.gain for limit in amplifier.limits)
    return min(first, second), max(first, second)


def _swing(signal: FloatArray, samples: int, slower: float) -> float:
    """Range of the last samples without their drift, if they swing and have not decayed from those before; else 0."""
    last, before = _without_drift(signal[-samples:]), _without_drift(signal[-2 * samples : -samples])
    size = float(np.ptp(last))
    sides = np.sign(last[np.abs(last) > _LARGE * np.abs(last).max()])
    swings = np.count_nonzero(np.diff(sides)) >= _SWINGS
    return size if swings and size >= slower * float(np.ptp(before)) else 0.0


def _without_drift(signal: FloatArray) -> FloatArray:
    places = np.linspace(-1.0, 1.0, signal.size)
    centred = signal - signal.mean()
    return np.asarray(centred - places * float(places @ centred) / float(places @ places))
