"""Linear predictive control around the inverse of a law; `hysim.kernels.predictive` has its equations."""

import functools
import itertools
import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are, toeplitz

from hysim._basics.frozen import Count, FloatArray, Interval, NotNegative, Positive
from hysim.control._controller import SteppedController, compiled_of
from hysim.control._to_control import to_control
from hysim.kernels import predictive as kernels
from hysim.kernels.tracking import bound
from hysim.laws.static import Line
from hysim.models.inverse_search import inverse_step
from hysim.models.model import family
from hysim.models.protocols import CompiledController, law_at, positive_time
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.stages import Amplifier, Sensor
from hysim.signals import triangle

_with_inverse = functools.lru_cache(maxsize=64)(bound)

_LONGEST = 200  # samples of a horizon: K^-1 then has 40 000 numbers
_STEP = 0.1  # rho, of the geometric mean of these: 30 iterations then miss the optimum by 1e-5 of a step's error
_REGULAR = 1e-6  # sigma, of the largest eigenvalue of P
_CYCLE = 400  # samples of a cycle between the limits, along which slopes are taken
_FLAT = 0.3  # of the mean slope: a law that is flatter at its reversals would hold the command for long
_FORGETTING = 1e-12  # noise of each state, of that of the law's output: else a stage at rest, a delay, has no filter


@family
class PredictiveControl(SteppedController):
    """Controller that minimises the predicted error over a horizon, within limits of the command and of its rate.

    The limits hold exactly, but the rate comes first where the command begins outside its limits.

    Parameters
    ----------
    model : Actuator, law or fit
        What it drives; an amplifier must act at once.
    horizon, effort : float
        Time over which it predicts [s], at most 200 samples, and weight of the law output's changes against errors.
    limits : (float, float), optional
        Lowest and highest command [unit of u].
    rate : float, optional
        Largest rate of the command [unit of u / s].
    output_limits, softness : (float, float), optional, and float
        Lowest and highest displacement, which are exceeded where nothing else is possible [unit of y], and weight of
        what is beyond them against errors.
    model_error, drift : float
        What is expected of the law's output and of the disturbance: error, and change, in a sample, in units of the
        sensor's noise. Small numbers trust the model, and damp less of what it does not know.
    preview : bool
        Whether the reference is known a horizon ahead.
    iterations : int
        Of the solver at each sample, from the solution before.

    Raises
    ------
    ValueError
        If a number is outside its range, the amplifier takes time, or the law has no inverse.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
    >>> stage = hs.Actuator(hysteresis=law, vibration=hs.mode(natural_frequency=500.0, damping_ratio=0.02))
    >>> mpc = hs.PredictiveControl(model=stage, horizon=0.02, limits=(0.0, 60.0), rate=1e5)
    >>> run = hs.close_loop(stage, mpc, 5e-4 * np.arange(200), np.where(np.arange(200) < 60, 0.0, 1.0))
    >>> bool(run.y.max() < 1.04 and abs(run.y[-1] - 1.0) < 1e-3)
    True
    """

    keeps_limits: ClassVar[bool] = True

    model: Any
    horizon: Positive
    effort: NotNegative = 1e-2
    limits: Interval | None = None
    rate: Positive | None = None
    output_limits: Interval | None = None
    softness: Positive = 100.0
    model_error: Positive = 10.0
    drift: Positive = 0.1
    preview: bool = True
    iterations: Count = 30

    def __post_init__(self) -> None:
        amplifier = as_actuator(self.model).amplifier
        if amplifier is not None and (amplifier.dynamic or not amplifier.gain):
            raise ValueError("the amplifier must act at once and have a gain")

    @property
    def u0(self) -> float | None:
        """Command at which the memory of the model's law holds; None for the first one."""
        return as_actuator(self.model).u0

    def ahead(self, sample_time: float) -> int:
        return self._samples(sample_time) if self.preview else 0

    def _samples(self, sample_time: float) -> int:
        samples = max(1, round(self.horizon / sample_time))
        if samples > _LONGEST:
            raise ValueError(
                f"horizon must have at most {_LONGEST} samples, got {samples}: the loop is too fast for it"
            )
        return samples

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        p, plant = self._samples(positive_time(sample_time)), as_actuator(self.model)
        law = Line(slope=1.0) if plant.hysteresis is None else plant.hysteresis
        amplifier = plant.amplifier or Amplifier()
        low, high = sorted(amplifier.voltage(self.limits or (-math.inf, math.inf)).tolist())
        inverse = inverse_step(law, float(amplifier.voltage(u0)), (low, high), sample_time)
        A, B, C, M = _linear(plant, sample_time)
        level = inverse.state[1]
        if not np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1.0:
            raise ValueError("the vibration must come to rest: it integrates, or is unstable")
        rest = np.linalg.solve(np.eye(B.size) - A, B)
        size = abs(float(C @ rest)) or 1.0
        C, M = C / size, M / size
        powers = list(itertools.accumulate(range(p), lambda row, _: row @ A, initial=C))
        free, pulse = np.stack(powers[1:]), np.stack(powers[:-1]) @ B
        if not pulse.any():
            raise ValueError(f"horizon must be longer than the plant's dead time, got {self.horizon:g} s")
        K, rho, sigma = self._problem(pulse)
        gains = _observer(A, B, M, self.model_error, self.drift)
        change = math.inf if self.rate is None else abs(amplifier.gain) * self.rate * sample_time
        head: list[Any] = [
            B.size, p, self.iterations, float(self.preview), gains[-1], low, high, change, _flattest(law, low, high),
            self.effort, float(self.output_limits is not None), *np.array(self.output_limits or (0.0, 0.0)) / size,
            2.0 * self.softness / (2.0 * self.softness + rho), rho, sigma, amplifier.gain, amplifier.offset, size,
        ]  # fmt: skip
        parameters: list[Any] = [head, A.ravel(), B, M, gains[:-1], free.ravel(), pulse, K.ravel(), inverse.parameters]
        state: list[Any] = [
            [u0, y0 / size - level * M @ rest], level * rest, np.zeros(B.size), np.full(p, y0 / size),
            np.full(p, level), np.zeros(p), np.full(p, level), level * np.eye(1, p)[0], level * np.cumsum(pulse),
            np.zeros(4 * p), inverse.parameters, inverse.state,
        ]  # fmt: skip
        return compiled_of(_with_inverse(kernels.predict, inverse.step), parameters, state)

    def _problem(self, pulse: FloatArray) -> tuple[FloatArray, float, float]:
        """K^-1, rho and sigma, for a linear stage with this response."""
        n = pulse.size
        respond, differ = np.tril(toeplitz(pulse)), np.eye(n) - np.eye(n, k=-1)
        P = 2.0 * (respond.T @ respond + self.effort * differ.T @ differ)
        least, largest = np.linalg.eigvalsh(P)[[0, -1]]
        sigma = _REGULAR * largest
        rho = _STEP * math.sqrt(max(least, sigma) * largest)
        limited = respond if self.output_limits is not None else np.zeros((n, n))
        bounds = np.eye(n) + differ.T @ differ + limited.T @ limited
        return np.linalg.inv(P + sigma * np.eye(n) + rho * bounds), rho, sigma


def _linear(plant: Actuator, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A, B, and the rows of the displacement and of the measurement, from the output of the law held over a sample."""
    delay = 0.0 if plant.sensor is None else plant.sensor.delay
    stages = Actuator(creep=plant.creep, vibration=plant.vibration)
    true, read = (to_control(replace(stages, sensor=sensor), sample_time) for sensor in (None, Sensor(delay=delay)))
    displacement, measurement = block_diag(true.C, read.C)
    return block_diag(true.A, read.A), np.append(true.B, read.B), displacement, measurement


def _observer(A: FloatArray, B: FloatArray, M: FloatArray, model_error: float, drift: float) -> FloatArray:
    """Gains of the stationary Kalman filter for the states, and for the disturbance of the measurement."""
    measured = np.append(M, 1.0)
    noise = block_diag(model_error**2 * (np.outer(B, B) + _FORGETTING * (B @ B) * np.eye(B.size)), drift**2)
    P = solve_discrete_are(block_diag(A, 1.0).T, measured[:, np.newaxis], noise, np.eye(1))
    return np.asarray(P @ measured / (measured @ P @ measured + 1.0))


def _flattest(law: Any, low: float, high: float) -> float:
    """Least slope of a law along a cycle between two inputs, but for what is flatter than a part of its mean slope."""
    ends = np.array([low, high] if math.isfinite(high - low) else [-1.0, 1.0])
    cycle = np.tile(triangle(*ends.tolist(), cycles=1, samples_per_cycle=_CYCLE)[:-1], 2)
    level = np.asarray(law_at(law, math.inf).response(cycle))
    mean = float((level[_CYCLE // 2] - level[0]) / np.ptp(ends))
    steps = np.diff(level)[-_CYCLE + 1 :] / np.diff(cycle)[-_CYCLE + 1 :]
    return math.copysign(max(_FLAT * abs(mean), float(np.abs(steps).min())), mean)
