"""Bandwidth of a loop, found by running it: law, limits and sampling included.

After its transient the response to a sine r = y0 + a sin(w t) is fitted by least squares as

    y = c + a Re(G) sin(w t) + a Im(G) cos(w t)

G is the loop's describing function. The bandwidth is the lowest frequency at which |G| leaves 1 / sqrt(2) to sqrt(2)
(3 dB): frequencies are tried upwards, then bisected.
"""

import math
from typing import Any

import numpy as np

from hysim._frozen import check_positive
from hysim.control._controller import Controller
from hysim.control._loop import RestingPlant, as_actuator
from hysim.control._open_loop import secant_gain
from hysim.control._stability import judge
from hysim.errors import SimulationError

_PER_DECADE = 24  # frequencies tried
_BISECTIONS = 10
_PERIODS = 4  # of which G is fitted, at least
_FEWEST = 64  # samples of which G is fitted, at least
_SHORTEST = 2.5  # samples of a period


def bandwidth(
    plant: Any,
    controller: Controller,
    *,
    sample_time: float,
    amplitude: float,
    lowest: float,
    transient: float,
    u0: float | None = None,
) -> float:
    """Frequency up to which the true displacement follows a small sine within 3 dB.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at `u0` before the first sample; the noise of its sensor is left out.
    controller : PID, TrackingController, or anything with their ``compiled``
        Closes the loop.
    sample_time : float
        Sample time of the controller [s].
    amplitude : float
        Amplitude of the sine about the resting displacement [unit of y].
    lowest : float
        First frequency tried [rad/s].
    transient : float
        Time after which the response is periodic [s].
    u0 : float, optional
        Voltage before the first sample.

    Returns
    -------
    float
        [rad/s]; zero if the loop does not follow at the lowest frequency, infinite if it follows up to 2.5 samples a
        period.

    Raises
    ------
    SimulationError, ValueError
        If the loop diverges, or is not stable as `hysim.control.assess_loop` has it; if the amplitude or the lowest
        frequency is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> sine = dict(sample_time=1e-3, amplitude=1.0, lowest=0.1, transient=5.0)
    >>> round(hs.control.bandwidth(lag, hs.PID(kp=9.0, ki=9.0), **sine), 1)  # 9 / s in open loop
    9.0
    """
    check_positive(amplitude=amplitude, lowest=lowest)
    resting = RestingPlant(as_actuator(plant), sample_time, u0).quiet()
    cycle = resting.y0 + amplitude * np.sin(np.linspace(0.0, 2.0 * math.pi, _FEWEST))
    if moves := judge(resting, controller, cycle, cycle, secant_gain(resting.actuator, cycle))[1]:
        raise SimulationError(f"the loop {moves}: it has no bandwidth")

    def follows(frequency: float) -> bool:
        gain = abs(_describing(resting, controller, frequency, amplitude, transient))
        return 1.0 <= math.sqrt(2.0) * gain <= 2.0

    highest = 2.0 * math.pi / (_SHORTEST * sample_time)
    tried = np.geomspace(lowest, highest, 1 + math.ceil(_PER_DECADE * math.log10(highest / lowest))).tolist()
    first_failure = next((k for k, frequency in enumerate(tried) if not follows(frequency)), None)
    if first_failure is None:
        return math.inf
    if not first_failure:
        return 0.0
    within, beyond = tried[first_failure - 1], tried[first_failure]
    for _ in range(_BISECTIONS):
        middle = math.sqrt(within * beyond)
        within, beyond = (middle, beyond) if follows(middle) else (within, middle)
    return math.sqrt(within * beyond)


def _describing(
    resting: RestingPlant, controller: Controller, frequency: float, amplitude: float, transient: float
) -> complex:
    h = resting.sample_time
    before = math.ceil(transient / h)
    fitted = max(_FEWEST, math.ceil(2.0 * math.pi * _PERIODS / (frequency * h)))
    t = h * np.arange(before + fitted)
    sine = np.sin(frequency * t)
    y = resting.run(controller, resting.y0 + amplitude * sine).y
    columns = np.stack([sine, np.cos(frequency * t), np.ones_like(t)], axis=1)[before:]
    real, imaginary, _ = np.linalg.lstsq(columns, y[before:])[0] / amplitude
    return complex(real, imaginary)
