"""Distance of a sampled linear loop from instability, and voltage noise that its sensor causes.

L is the loop's frequency response, the plant behind the hold times the controller. Its distance from -1 is one over
the maximum sensitivity max |1 / (1 + L)|, for stable loops only: the poles of

    x' = A x + B v,        v = C_c q + D_c (y + noise),    y = C x
    q' = A_c q + B_c (y + noise)

must lie inside the unit circle (x' and q' the states one sample later). Near a lightly damped pole exp(-d + i a) L
changes over its half width d, so that both are evaluated around the angles a in units of d, and the largest peaks once
more between the neighbours. White noise of unit rms gives the command the variance

    D_c^2 + K X K^T,       X = G G^T + M G G^T M^T + M^2 G G^T M^2^T + ...

summed by doubling, with M, G and K the loop's matrices from the noise to the states and from the states to the command.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.control._loop import as_actuator
from hysim.control._sampled import Feedback, SampledController
from hysim.control._to_control import to_control

_FREQUENCIES = 300
_SLOWEST = 1e-4
"""Lowest frequency, in units of the highest, pi / sample time."""

_PLANTS_POLES = np.sinh(np.linspace(-8.0, 8.0, 80))
_LOOPS_POLES = np.sinh(np.linspace(-2.0, 2.0, 9))
"""Places around a resonance, in units of its half width."""

_LIGHT = 0.5
"""Half width over angle of a pole below which 300 frequencies do not resolve it."""

_HIGH = 0.9
"""Part of the largest value below which peaks are not refined."""

_ROUNDS = 2
_BETWEEN = 9

_FORGOTTEN = 1e-9
"""Size of a power of M from which on older noise has no part in X."""


class _Loop(NamedTuple):
    """States one sample later, and command: M x + G noise, K x + through noise."""

    M: FloatArray
    G: FloatArray
    K: FloatArray
    through: float


class LinearLoop:
    """A plant behind a sampled controller's hold, its law replaced by a line of slope one.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        Its linear part counts.
    sample_time : float
        Sample time of the controller [s].
    frequencies : array, optional
        Where L is evaluated, increasing [rad/s]; by default 300, log-spaced up to pi / sample time, and more around
        each resonance of the plant.

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
        self.resonances = _light(np.linalg.eigvals(self.system.A))
        self.frequencies = self._default() if frequencies is None else np.array(frequencies, dtype=float)
        self.plant = self.plant_at(self.frequencies)

    def response(self, controller: SampledController) -> npt.NDArray[np.complex128]:
        """L at `frequencies`."""
        return self.plant * controller.frequency_response(self.frequencies, self.sample_time)

    def max_sensitivity(self, controller: SampledController, slope: float = 1.0) -> float:
        """Largest ``|1 / (1 + L)|`` with a law of this slope, within 0.1 %; infinite if the loop is unstable."""
        poles = self.poles(controller, slope)
        if not np.abs(poles).max() < 1.0:
            return math.inf
        own = _around(_light(poles), _LOOPS_POLES) / self.sample_time
        frequencies = np.concatenate([self.frequencies, own])
        values = np.concatenate([_sensitivity(slope * self.response(controller)), self._at(own, controller, slope)])
        order = np.argsort(frequencies, kind="stable")
        return self._highest(frequencies[order], values[order], controller, slope)

    def is_stable(self, controller: SampledController, slope: float = 1.0) -> bool:
        """Whether all poles of the loop with a law of this slope lie inside the unit circle."""
        return bool(np.abs(self.poles(controller, slope)).max() < 1.0)

    def are_stable(self, feedbacks: Sequence[Feedback], slope: float = 1.0) -> npt.NDArray[np.bool_]:
        """Whether the loop of each of several controllers of one class is stable, as `is_stable` says."""
        matrices = np.stack([self._closed(feedback, slope).M for feedback in feedbacks])
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1) < 1.0)

    def margins(self, controller: SampledController, slope: float = 1.0) -> tuple[float, float]:
        """Gain and phase margin [degrees] at a slope, by python-control, and at z = -1; nan if the loop is unstable."""
        import control

        if not self.is_stable(controller, slope):
            return math.nan, math.nan
        loop = slope * self.response(controller)
        gain, phase = control.margin(control.frd(loop, self.frequencies))[:2]
        at_nyquist = -1.0 / loop[-1].real if loop[-1].real < 0.0 else math.inf
        return min(float(gain), at_nyquist), float(phase)

    def noise_gain(self, controller: SampledController, slope: float = 1.0) -> float:
        """Rms of the command for white noise of rms one in the measurement; infinite if the loop is unstable."""
        if not self.is_stable(controller, slope):
            return math.inf
        loop = self._loop(controller, slope)
        power, states = loop.M, np.outer(loop.G, loop.G)
        while np.abs(power).max() > _FORGOTTEN:
            states, power = states + power @ states @ power.T, power @ power
        return math.sqrt(loop.through**2 + max(0.0, float(loop.K @ states @ loop.K)))

    def poles(self, controller: SampledController, slope: float = 1.0) -> npt.NDArray[np.complex128]:
        """Poles of the loop in z with a law of this slope."""
        return np.asarray(np.linalg.eigvals(self._loop(controller, slope).M))

    def _default(self) -> FloatArray:
        highest = math.pi / self.sample_time
        apart = np.geomspace(_SLOWEST * highest, highest, _FREQUENCIES)
        return np.union1d(apart, _around(self.resonances, _PLANTS_POLES) / self.sample_time)

    def plant_at(self, frequencies: FloatArray) -> npt.NDArray[np.complex128]:
        """Response of the sampled plant at frequencies [rad/s], C (z - A)^-1 B; it has no D."""
        A, B, C = self.system.A, self.system.B, self.system.C
        z = np.exp(1j * frequencies * self.sample_time)[:, np.newaxis, np.newaxis]
        states = np.linalg.solve(z * np.eye(len(A)) - A, np.broadcast_to(B, (z.size, *B.shape)))
        return np.asarray((C @ states)[:, 0, 0])

    def _at(self, frequencies: FloatArray, controller: SampledController, slope: float) -> FloatArray:
        feedback = controller.frequency_response(frequencies, self.sample_time)
        return _sensitivity(slope * self.plant_at(frequencies) * feedback)

    def _highest(
        self, frequencies: FloatArray, values: FloatArray, controller: SampledController, slope: float
    ) -> float:
        """Largest value, refined between the neighbours of all peaks that are nearly as high."""
        before, after = np.append(0.0, values[:-1]), np.append(values[1:], 0.0)
        highest = float(values.max())
        peaks = np.flatnonzero((values > before) & (values >= after) & (values >= _HIGH * highest))
        low, high = frequencies[np.maximum(peaks - 1, 0)], frequencies[np.minimum(peaks + 1, values.size - 1)]
        for _ in range(_ROUNDS):
            between = np.linspace(low, high, _BETWEEN)
            finer = self._at(between.ravel(), controller, slope).reshape(between.shape)
            highest = max(highest, float(finer.max()))
            best, each = finer.argmax(axis=0), np.arange(low.size)
            low, high = between[np.maximum(best - 1, 0), each], between[np.minimum(best + 1, _BETWEEN - 1), each]
        return highest

    def _loop(self, controller: SampledController, slope: float) -> _Loop:
        return self._closed(controller.linear(self.sample_time), slope)

    def _closed(self, feedback: Feedback, slope: float) -> _Loop:
        n = len(self.system.A)
        output, drive = self.system.C[0], slope * self.system.B[:, 0]
        K = np.concatenate([feedback.D * output, feedback.C])
        M = np.zeros((K.size, K.size))
        M[:n] = np.outer(drive, K)
        M[:n, :n] += self.system.A
        M[n:, :n], M[n:, n:] = np.outer(feedback.B, output), feedback.A
        return _Loop(M, np.concatenate([feedback.D * drive, feedback.B]), K, feedback.D)


def _sensitivity(loop: npt.NDArray[np.complex128]) -> FloatArray:
    return np.asarray(1.0 / np.abs(1.0 + loop))


def _light(poles: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
    """Lightly damped poles of the upper half plane as half width + i angle."""
    logs = np.log(poles[poles.imag > 0.0].astype(complex))
    places = np.abs(logs.real) + 1j * logs.imag
    return np.asarray(places[places.real < _LIGHT * places.imag])


def _around(resonances: npt.NDArray[np.complex128], places: FloatArray) -> FloatArray:
    angles = (resonances.imag[:, np.newaxis] + resonances.real[:, np.newaxis] * places).ravel()
    return np.asarray(angles[(angles > 0.0) & (angles <= math.pi)])
