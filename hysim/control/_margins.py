"""How far a sampled linear loop is from instability.

L is the loop's frequency response: the plant behind the hold, times the PID. Its distance from -1 is one over
the maximum sensitivity max |1 / (1 + L)|. That says nothing about a loop that is unstable already: the poles
of

    x' = A x + B v,    v = -(kp + r) y + I + a D + r y_before,    y = C x
    I' = I - ki h y,   D' = -r y + a D + r y_before,              r = kd / (T_f + h),  a = T_f / (T_f + h)

have to lie inside the unit circle (x' the state one sample later).
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim.control._loop import as_actuator
from hysim.control._pid import PID
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

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> loop = hs.control.LinearLoop(lag, sample_time=0.1)
    >>> round(loop.max_sensitivity(hs.PID(kp=5.0)), 2), loop.max_sensitivity(hs.PID(kp=50.0))
    (1.33, inf)
    """

    def __init__(self, plant: Any, sample_time: float) -> None:
        self.sample_time = sample_time
        self.system = to_control(replace(as_actuator(plant), hysteresis=None), sample_time)
        highest = math.pi / sample_time
        self.frequencies = np.geomspace(_SLOWEST * highest, highest, _FREQUENCIES)
        self.plant = np.asarray(self.system(np.exp(1j * self.frequencies * sample_time)))

    def response(self, pid: PID) -> npt.NDArray[np.complex128]:
        """L at `frequencies`."""
        return self.plant * pid.frequency_response(self.frequencies, self.sample_time)

    def max_sensitivity(self, pid: PID, slope: float = 1.0) -> float:
        """Largest ``|1 / (1 + L)|`` with a law of this slope; infinite if the loop is unstable."""
        if not self.is_stable(pid, slope):
            return math.inf
        return float(np.max(1.0 / np.abs(1.0 + slope * self.response(pid))))

    def is_stable(self, pid: PID, slope: float = 1.0) -> bool:
        """Whether all poles of the loop with a law of this slope lie inside the unit circle."""
        lag, n = pid.derivative_filter + self.sample_time, len(self.system.A)
        rate, kept, output = pid.kd / lag, pid.derivative_filter / lag, self.system.C[0]
        integrates = 1 if pid.ki else 0
        matrix = np.zeros((n + 3, n + 3))
        matrix[:n] = slope * self.system.B * np.concatenate([-(pid.kp + rate) * output, [integrates, kept, rate]])
        matrix[:n, :n] += self.system.A
        matrix[n, :n], matrix[n, n] = -pid.ki * self.sample_time * output, integrates
        matrix[n + 1, :n], matrix[n + 1, n + 1 :] = -rate * output, (kept, rate)
        matrix[n + 2, :n] = output
        return bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
