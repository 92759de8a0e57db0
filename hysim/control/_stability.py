"""Whether a loop is stable, by its poles and by running it; its margins, noise and bandwidth.

In linear theory all poles of the sampled loop, with its delay, must lie inside the unit circle, the law replaced by
lines of its least and of its largest slope along the reference. A slope that is zero, or of the sign against that of
the whole cycle, closes no loop for a moment, and is left to the run.

Limits, quanta and memory are not in that theory. So the loop also follows the reference without noise, and the
reference then stays at its last value for `_REST` time constants of the slowest oscillation of the linear loop. A
stable loop comes to rest. One whose remaining oscillation, without its drift, is larger than

    1 % of the voltage that the reference asks for               where readings are continuous
    2 quanta of displacement, or nearly from limit to limit      where they are quantised

and decays at less than half the linear rate is in a limit cycle. One that moves without swinging is held longer.

L is the loop's frequency response, the plant behind the hold times the controller. Its distance from -1 is one over
the maximum sensitivity max |1 / (1 + L)|, for stable loops only: the poles of

    x' = A x + B v,        v = C_c q + D_c (y + noise),    y = C x
    q' = A_c q + B_c (y + noise)

must lie inside the unit circle (x' and q' the states one sample later). Near a lightly damped pole exp(-d + i a) L
changes over its half width d, so that both are evaluated around the angles a in units of d, and the largest peaks once
more between the neighbours. White noise of unit rms gives the command the variance

    D_c^2 + K X K^T,       X = G G^T + M G G^T M^T + M^2 G G^T M^2^T + ...

summed by doubling, with M, G and K the loop's matrices from the noise to the states and from the states to the command.

The bandwidth is found by running the loop, law, limits and sampling included. After its transient the response to a
sine r = y0 + a sin(w t) is fitted by least squares as

    y = c + a Re(G) sin(w t) + a Im(G) cos(w t)

G is the loop's describing function. The bandwidth is the lowest frequency at which |G| leaves 1 / sqrt(2) to sqrt(2)
(3 dB): frequencies are tried upwards, then bisected.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive
from hysim.control._controller import Controller, Feedback, SampledController, limits_of
from hysim.control._loop import RestingPlant, inverted, secant_gain, slopes
from hysim.control._to_control import to_control
from hysim.errors import SimulationError
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.stages import Sensor

_FREQUENCIES = 300
_SLOWEST = 1e-4
_SLOWER = 1e-6
"""Lowest frequencies, in units of the highest, pi / sample time, and of the lowest for a slow integral."""

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
    """A plant after the hold of a sampled controller, its law replaced by a line of slope one.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        Its linear part counts.
    sample_time : float
        Sample time of the controller [s].
    frequencies : array, optional
        Where L is evaluated, increasing [rad/s]; by default 300, log-spaced to pi / sample time, more at resonances.

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
        loop = np.concatenate([slope * self.response(controller), self._at(own, controller, slope)])
        order = np.argsort(frequencies, kind="stable")
        frequencies, values = frequencies[order], _sensitivity(loop[order])
        before, after = np.append(0.0, values[:-1]), np.append(values[1:], 0.0)
        highest = float(values.max())
        peaks = np.flatnonzero((values > before) & (values >= after) & (values >= _HIGH * highest))
        low, high = frequencies[np.maximum(peaks - 1, 0)], frequencies[np.minimum(peaks + 1, values.size - 1)]
        for _ in range(_ROUNDS):
            between = np.linspace(low, high, _BETWEEN)
            finer = _sensitivity(self._at(between.ravel(), controller, slope)).reshape(between.shape)
            highest = max(highest, float(finer.max()))
            best, each = finer.argmax(axis=0), np.arange(low.size)
            low, high = between[np.maximum(best - 1, 0), each], between[np.minimum(best + 1, _BETWEEN - 1), each]
        return highest

    def is_stable(self, controller: SampledController, slope: float = 1.0) -> bool:
        """Whether all poles of the loop with a law of this slope lie inside the unit circle."""
        return bool(np.abs(self.poles(controller, slope)).max() < 1.0)

    def are_stable(self, feedbacks: Sequence[Feedback], slope: float = 1.0) -> npt.NDArray[np.bool_]:
        """Whether the loop of each of several controllers of one class is stable, as `is_stable` says."""
        matrices = np.stack([self._closed(feedback, slope).M for feedback in feedbacks])
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1) < 1.0)

    def margins(self, controller: SampledController, slope: float = 1.0) -> tuple[float, float]:
        """Gain and phase margin [degrees] at a slope, by python-control, and at z = -1; nan if the loop is unstable.

        A negative phase margin is the lead that makes it unstable, where that is less than the lag.
        """
        import control

        if not self.is_stable(controller, slope):
            return math.nan, math.nan
        loop, highest = slope * self.response(controller), np.array([math.pi / self.sample_time])
        gain, phase = control.margin(control.frd(loop, self.frequencies))[:2]
        last = float(self._at(highest, controller, slope)[0].real)
        if abs(loop[0]) < 1.0:  # a slow integral has its crossover below
            slower = self.frequencies[0] * np.geomspace(_SLOWER, 1.0, _FREQUENCIES)
            phase = min(phase, control.margin(control.frd(self._at(slower, controller, slope), slower))[1], key=abs)
        return nearest_to_one([gain, -1.0 / last if last < 0.0 else math.inf]), float(phase)

    def noise_gain(self, controller: SampledController, slope: float = 1.0) -> float:
        """Rms of the command for white noise of rms one in the measurement; infinite if the loop is unstable."""
        if not self.is_stable(controller, slope):
            return math.inf
        loop = self._closed(controller.linear(self.sample_time), slope)
        power, states = loop.M, np.outer(loop.G, loop.G)
        while np.abs(power).max() > _FORGOTTEN:
            states, power = states + power @ states @ power.T, power @ power
        return math.sqrt(loop.through**2 + max(0.0, float(loop.K @ states @ loop.K)))

    def poles(self, controller: SampledController, slope: float = 1.0) -> npt.NDArray[np.complex128]:
        """Poles of the closed loop in z at a slope of the law."""
        return np.asarray(np.linalg.eigvals(self._closed(controller.linear(self.sample_time), slope).M))

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

    def _at(self, frequencies: FloatArray, controller: SampledController, slope: float) -> npt.NDArray[np.complex128]:
        feedback = controller.frequency_response(frequencies, self.sample_time)
        return np.asarray(slope * self.plant_at(frequencies) * feedback)

    def _closed(self, feedback: Feedback, slope: float) -> _Loop:
        n = len(self.system.A)
        output, drive = self.system.C[0], slope * self.system.B[:, 0]
        K = np.concatenate([feedback.D * output, feedback.C])
        M = np.zeros((K.size, K.size))
        M[:n] = np.outer(drive, K)
        M[:n, :n] += self.system.A
        M[n:, :n], M[n:, n:] = np.outer(feedback.B, output), feedback.A
        return _Loop(M, np.concatenate([feedback.D * drive, feedback.B]), K, feedback.D)


def nearest_to_one(gain_margins: npt.ArrayLike) -> float:
    """The factor that a loop reaches first; those below one are of loops that a smaller gain makes unstable."""
    gains = np.asarray(gain_margins, dtype=float)
    return float(gains[np.argmin(np.abs(np.log(gains)))])


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


_REST = 6.0  # time constants: an oscillation is then 0.2 % of what it was
_SHORTEST, _LONGEST = 400, 10  # samples, and lengths of the reference, for which it is held
_FASTEST = 0.02  # decay per sample that is asked for at most: noise of rounding has none
_SMALL = 0.01  # part of the voltage's span
_QUANTA = 2.0
_FULL = 0.9  # part of the distance between the limits
_LARGE = 0.25  # part of the largest deviation that counts as a swing to a side
_SWINGS = 3  # changes of side; a curved drift has two
_CLOSES = 1e-6  # least slope of a law that closes a loop, in units of the cycle's


class LinearFigures(NamedTuple):
    """Figures of the linear loop, the worst over both slopes of the law; nan for a controller without a linear part.

    The sensitivities are the largest ``|1 / (1 + L)|``, also with one sample more of delay, infinite if the loop is
    unstable; `decay` is that of the slowest oscillation per sample; for `command_jump` see `LoopAssessment`.
    """

    max_sensitivity: float
    max_sensitivity_with_delay: float
    decay: float
    command_jump: float


def later(plant: Actuator, time: float) -> Actuator:
    """The plant, its displacement read later by a time [s]."""
    sensor = plant.sensor or Sensor()
    return replace(plant, sensor=replace(sensor, delay=sensor.delay + time))


def judge(
    resting: RestingPlant, controller: Controller, reference: FloatArray, cycle: FloatArray, gain: float
) -> tuple[LinearFigures, str]:
    """Figures of the linear loop along a `cycle` with this secant gain, and why the loop does not rest, or ""."""
    plant, h = resting.plant, resting.sample_time
    linear = LinearFigures(math.nan, math.nan, _FASTEST, math.nan)
    if isinstance(controller, SampledController):
        loops = [LinearLoop(each, h) for each in (plant, later(plant, h))]
        along = closing_slopes(plant, cycle, gain)
        now, delayed = (max(loop.max_sensitivity(controller, slope) for slope in along) for loop in loops)
        decay = slowest_decay(loops[0], controller, along) if now < math.inf else 0.0
        linear = LinearFigures(now, delayed, decay, abs(controller.linear(h).D))
    if linear.max_sensitivity == math.inf:
        return linear, "is unstable"
    asked = float(np.ptp(cycle)) / abs(gain)
    return linear, limit_cycle(resting, controller, reference, linear.decay, asked)


def closing_slopes(plant: Actuator, cycle: FloatArray, gain: float) -> list[float]:
    """Least and largest slope of the law along a cycle of the reference that close a loop; 1 without a law."""
    if plant.hysteresis is None:
        return [1.0]
    secant = gain / plant.dc_gain
    along = slopes(plant, inverted(plant, cycle, gain))
    return sorted({slope for slope in along if slope / secant > _CLOSES}) or [secant]


def slowest_decay(loop: LinearLoop, controller: SampledController, slopes: Sequence[float]) -> float:
    """Decay per sample of the slowest oscillation of a stable loop, at most `_FASTEST`."""
    poles = np.concatenate([loop.poles(controller, slope) for slope in slopes])
    oscillating = np.abs(poles[poles.imag > 0.0])
    slowest = float(oscillating.max()) if oscillating.size else 0.0
    return -math.log(max(slowest, math.exp(-_FASTEST)))


def limit_cycle(
    resting: RestingPlant, controller: Controller, reference: FloatArray, decay: float, asked: float
) -> str:
    """In words, how the loop moves on where it should be at rest; empty if it comes to rest.

    `decay` is per sample, of the stable linear loop's slowest oscillation; `asked` is the reference's voltage range.
    """
    resting = resting.quiet()
    n = reference.size
    longest = _LONGEST * max(n, _SHORTEST)
    held = min(max(math.ceil(_REST / decay), _SHORTEST, n // 4), longest)
    while True:
        signals = resting.attempt(controller, np.append(reference, np.full(held, reference[-1])))
        if signals.lost >= 0:
            return f"diverges at t = {signals.lost * resting.sample_time:g}"
        tail, slower = held // 4, math.exp(-0.5 * decay * (held // 4))
        volts, far = _swing(signals.drive, tail, slower), _swing(signals.y, tail, slower)
        if _too_large(resting, controller, volts, far, asked):
            return f"is in a limit cycle of {volts:.3g} in the command and {far:.3g} in the output"
        volts, far = (float(np.ptp(signal[-2 * tail :])) for signal in (signals.drive, signals.y))
        if held == longest or not _too_large(resting, controller, volts, far, asked):
            return ""
        held = min(4 * held, longest)  # it drifts, or swings more slowly than that


def _too_large(resting: RestingPlant, controller: Controller, volts: float, far: float, asked: float) -> bool:
    chain = resting.chain
    quantum = chain.sensor.quantum
    if not quantum:
        return volts > _SMALL * asked
    low, high = limits_of(controller) or (-math.inf, math.inf)
    if chain.amplifier.limits is not None:
        least, most = sorted(map(chain.amplifier.command, chain.amplifier.limits))
        low, high = min(max(low, least), most), min(max(high, least), most)
    return far > _QUANTA * quantum or _FULL * (high - low) < volts


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


_PER_DECADE = 24  # frequencies tried
_BISECTIONS = 10
_PERIODS = 4  # of which G is fitted, at least
_FEWEST = 64  # samples of which G is fitted, at least
_FEWEST_PER_PERIOD = 2.5  # samples of a period


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
    plant, controller
        As in `hysim.close_loop`; the noise of the sensor is left out.
    sample_time, amplitude, lowest, transient : float
        Sample time of the controller [s], amplitude of the sine about the resting displacement [unit of y], first
        frequency that is tried [rad/s], and time after which the response is periodic [s].
    u0 : float, optional
        Voltage before the first sample.

    Returns
    -------
    float
        [rad/s]; zero if the loop does not follow at the lowest frequency, infinite if up to 2.5 samples a period.

    Raises
    ------
    SimulationError, ValueError
        If the loop diverges or is unstable (`hysim.control.assess_loop`), or amplitude or lowest frequency is not > 0.

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
    if moves := judge(resting, controller, cycle, cycle, secant_gain(resting.plant, cycle))[1]:
        raise SimulationError(f"the loop {moves}: it has no bandwidth")

    def follows(frequency: float) -> bool:
        gain = abs(_describing(resting, controller, frequency, amplitude, transient))
        return 1.0 <= math.sqrt(2.0) * gain <= 2.0

    highest = 2.0 * math.pi / (_FEWEST_PER_PERIOD * sample_time)
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
