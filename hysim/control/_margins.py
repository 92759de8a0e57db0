"""How far a sampled linear loop is from instability.

L is the loop's frequency response: the plant behind the hold, times the controller. Its distance from -1 is one over
the maximum sensitivity max |1 / (1 + L)|. That says nothing about a loop that is unstable already: the poles
of

    x' = A x + B v,        v = C_c q + D_c y,    y = C x
    q' = A_c q + B_c y

have to lie inside the unit circle (x' and q' the states of plant and controller one sample later).
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim.control._loop import as_actuator
from hysim.control._sampled import SampledController
from hysim.control._to_control import to_control

_FREQUENCIES = 300
_SLOWEST = 1e-4
"""Lowest frequency looked at, in units of the highest, pi / sample time."""


class LinearLoop:
    """A plant behind a sampled controller's hold, its law replaced by a line of slope one.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        Of which the linear part is taken.
    sample_time : float
        Of the controller [s].
    frequencies : array, optional
        At which L is looked at, increasing [rad/s]; by default 300, log-spaced up to pi / sample time. A sharp
        resonance lies between two of those: give the frequencies around it.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> loop = hs.control.LinearLoop(lag, sample_time=0.1)
    >>> round(loop.max_sensitivity(hs.PID(kp=5.0)), 2), loop.max_sensitivity(hs.PID(kp=50.0))
    (1.33, inf)
    """

    def __init__(self, plant: Any, sample_time: float, frequencies: npt.ArrayLike | None = None) -> None:
        self.sample_time = sample_time
        self.system = to_control(replace(as_actuator(plant), hysteresis=None), sample_time)
        highest = math.pi / sample_time
        default = np.geomspace(_SLOWEST * highest, highest, _FREQUENCIES)
        self.frequencies = default if frequencies is None else np.array(frequencies, dtype=float)
        self.plant = np.asarray(self.system(np.exp(1j * self.frequencies * sample_time)))

    def response(self, controller: SampledController) -> npt.NDArray[np.complex128]:
        """L at `frequencies`."""
        return self.plant * controller.frequency_response(self.frequencies, self.sample_time)

    def max_sensitivity(self, controller: SampledController, slope: float = 1.0) -> float:
        """Largest ``|1 / (1 + L)|`` with a law of this slope; infinite if the loop is unstable."""
        if not self.is_stable(controller, slope):
            return math.inf
        return float(np.max(1.0 / np.abs(1.0 + slope * self.response(controller))))

    def is_stable(self, controller: SampledController, slope: float = 1.0) -> bool:
        """Whether all poles of the loop with a law of this slope lie inside the unit circle."""
        feedback, n = controller.linear(self.sample_time), len(self.system.A)
        output = self.system.C[0]
        matrix = np.zeros((n + feedback.B.size, n + feedback.B.size))
        matrix[:n] = slope * self.system.B * np.concatenate([feedback.D * output, feedback.C])
        matrix[:n, :n] += self.system.A
        matrix[n:, :n], matrix[n:, n:] = np.outer(feedback.B, output), feedback.A
        return bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
