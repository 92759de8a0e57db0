"""Control that learns from repetition: of trials from rest, or of a periodic reference.

A controller follows r + c. With the linear response T from c to the measurement a repetition leaves |q - l T| of the
error at each frequency (`hysim.kernels.learning`), with l = gain q / T of the model. Where this is below one for all T
the errors shrink: of plants whose natural frequencies and slopes are wrong by the `uncertainty`, and for the least and
the largest slope of the model's law against the controller's along the stroke, each frozen. q ends where it would not
learn: near a resonance that may lie 10 % off the error of the model is larger than the model. Sources: S. Arimoto et
al., J. Robotic Systems 1 (1984) 123; D. A. Bristow et al., IEEE Control Systems 26(3) (2006) 96; S. Hara et al., IEEE
Trans. Automatic Control 33 (1988) 659.
"""

import functools
import itertools
import math
import warnings
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, Interval, NotNegative, Positive, check_whole, checked, read_only, vectors
from hysim._basics.printing import frozen_result, quantity, summary_text
from hysim._basics.results import model_of
from hysim.control._controller import SteppedController, begun, compiled_of, limits_of, preview
from hysim.control._loop import RestingPlant, close_loop, known_ahead, sampled
from hysim.control._to_control import to_control
from hysim.control._tracking import InverseFeedforward, TrackingController, is_fed_back
from hysim.errors import HysimWarning
from hysim.kernels import controllers, learning
from hysim.laws.static import Line
from hysim.models.model import family
from hysim.models.protocols import CompiledController, law_at, positive_time
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.stages import Amplifier, Sensor
from hysim.plants.structures.structure import Structure
from hysim.plants.transfer_function import StateSpace
from hysim.signals import triangle

Spectrum = npt.NDArray[np.complex128]

_bound = functools.lru_cache(maxsize=64)(learning.learning)

_LENGTH = 2**15  # samples of an impulse response: 0.6 Hz between frequencies at 20 kHz
_CYCLE = 2000  # samples of the stroke along which slopes are taken
_STEADY = 3  # cycles, the last of which counts
_MOVES = 1e-6  # of the largest change of the inverse's output: smaller ones have no slope
_TRUSTED = 0.8  # rate of an ideal filter of gain one above which the automatic low pass stops
_LEARNS = 0.05  # of the gain: part of the error that the automatic low pass must take away
_HIGHEST = 0.5  # of pi / sample_time: highest automatic cutoff
_NARROWER, _TRIES = 0.85, 20
_RIPPLE = 60.0  # dB: an error of 0.1 % in the pass band is learned no further
_TRANSITION = 0.5  # of the cutoff
_DAMPED = 1e-2  # of the response at rest: smaller responses are not inverted


class LearningCondition(NamedTuple):
    """Part of the error that remains after a repetition, the largest over frequencies, slopes and uncertain plants.

    `rate` is that part, `frequency` its place, `cutoff` the corner of the low pass [rad/s]; `slopes` are the law's.
    """

    rate: float
    frequency: float
    cutoff: float
    slopes: tuple[float, float]

    @property
    def converges(self) -> bool:
        """Whether the errors shrink."""
        return self.rate < 1.0

    def __str__(self) -> str:
        hertz, corner = self.frequency / (2.0 * math.pi), self.cutoff / (2.0 * math.pi)
        shrinks = f"a repetition leaves at most {100.0 * self.rate:.3g} % of the error, at {hertz:.4g} Hz"
        condition = "converges" if self.converges else "MAY DIVERGE"
        return f"{condition}: with a line for the law, {shrinks}; learns up to {corner:.4g} Hz"


_Filters = tuple[FloatArray, LearningCondition]
"""Taps of q, l and -a (3, 2 m + 1) for the samples -m to m around one, and the condition that they meet."""


@checked
class _Learning(SteppedController):
    controller: Any
    model: Any
    stroke: Interval
    cutoff: Positive | None = None
    gain: Positive = 1.0
    uncertainty: NotNegative = 0.1

    def __post_init__(self) -> None:
        if not isinstance(self.controller, InverseFeedforward | TrackingController) or self.controller.plant is None:
            raise TypeError("controller must be an InverseFeedforward, or a TrackingController with one")
        if not self.uncertainty < 1.0:
            raise ValueError(f"uncertainty must be below 1, got {self.uncertainty:g}")
        actuator = as_actuator(self.model)
        if not math.isfinite(actuator.dc_gain):
            raise ValueError("the model integrates: close a loop around it, and learn the reference of that")
        bounds, inverted = actuator.amplifier and actuator.amplifier.limits, self.controller.plant.amplifier
        if bounds and not (self.limits or (inverted and inverted.limits)):
            raise ValueError("the model's amplifier has limits, which the controller must have too: give it limits=")

    @property
    def u0(self) -> float | None:
        """Command at which the memory of the controller's law holds; None for the first one."""
        u0: float | None = self.controller.u0
        return u0

    @property
    def limits(self) -> tuple[float, ...] | None:
        """Lowest and highest command of the controller [unit of u]."""
        return limits_of(self.controller)

    def ahead(self, sample_time: float) -> int:
        return preview(self.controller, sample_time)

    def condition(self, sample_time: float) -> LearningCondition:
        """Part of the error that remains after a repetition at worst, at a sample time [s]."""
        return _filters(self, positive_time(sample_time))[1]

    def _compiled(
        self, duration: float, is_trial: bool, sample_time: float, u0: float, y0: float
    ) -> CompiledController:
        inner = self.controller.compiled(sample_time, u0, y0)
        samples, ahead = round(duration / sample_time), preview(self.controller, sample_time)
        # corrections are those of references ahead of their time, and errors are of the present
        taps = np.pad(_filters(self, sample_time)[0], ((0, 0), (ahead, ahead)))
        taps[1], reach = np.roll(taps[1], ahead), taps.shape[1] // 2
        if abs(samples * sample_time - duration) > 1e-6 * duration:
            raise ValueError(f"a repetition of {duration:g} s is no whole number of samples of {sample_time:g} s")
        if is_trial and samples <= 3 * reach:
            raise ValueError(f"a trial needs more than {3 * reach} samples, most of them at rest, got {samples}")
        if not is_trial:
            samples *= reach // samples + 1
        late = ahead + _delay(self.model) / sample_time
        full = math.floor(late + 1e-9)
        room = 4 * samples if is_trial else 3 * (samples + reach + 1)
        head = [samples, reach, full, max(late - full, 0.0), float(is_trial), inner.state.size]
        parameters = [head, taps.ravel(), inner.state, inner.parameters]
        state = [[u0, 0.0], np.full(full + 2, y0), np.zeros(room), inner.state]
        return compiled_of(_bound(inner.step), parameters, state)


@family
class RepetitiveControl(_Learning):
    """Controller that learns a periodic reference: a model of the period corrects the reference of another controller.

    Parameters
    ----------
    controller : InverseFeedforward or TrackingController
        Follows the corrected reference.
    model : Actuator, law or fit
        What it drives, vibration and delay included; the law may be another one than the controller inverts.
    stroke : (float, float)
        Lowest and highest reference, along which slopes are taken [unit of y].
    cutoff : float, optional
        Corner of the low pass [rad/s]; by default the highest at which the errors shrink.
    gain, uncertainty : float
        Part of the error that is corrected at once, and relative error of natural frequencies and slopes for which
        errors must shrink.
    period : float
        Of the reference [s], whole samples. Where the low pass is longer than a period, it learns from several periods.

    Raises
    ------
    TypeError, ValueError
        If the controller is of another kind, or a number is outside its range.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
    >>> line = hs.InverseFeedforward(law=hs.Line(slope=0.025))
    >>> learner = hs.RepetitiveControl(controller=line, model=law, stroke=(0.0, 2.0), period=0.1)
    >>> learner.condition(1e-3).converges
    True
    >>> r = hs.signals.triangle(0.0, 2.0, cycles=10, samples_per_cycle=100)
    >>> error = r - hs.close_loop(law, learner, 1e-3 * np.arange(r.size), r).y
    >>> bool(np.std(error[-100:]) < 0.03 * np.std(error[:100]))
    True
    """

    period: Positive

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        return self._compiled(self.period, False, positive_time(sample_time), u0, y0)

    def margin(self, sample_time: float) -> float:
        """One minus the largest rate over slopes and uncertain plants; the loop is stable where it is positive."""
        return 1.0 - self.condition(sample_time).rate


@family
class IterativeLearning(_Learning):
    """Learning from trials: after each, the reference of a controller is corrected by the errors of the whole trial.

    `learn` runs the trials. With a `duration` it is a controller too, in loops and in C: after so many samples it
    updates the corrections, and begins again from rest.

    Parameters
    ----------
    controller, model, stroke, cutoff, gain, uncertainty
        As of `RepetitiveControl`.
    duration : float, optional
        Of a trial [s], where the device itself counts samples.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
    >>> line = hs.InverseFeedforward(law=hs.Line(slope=0.025))
    >>> learner = hs.IterativeLearning(controller=line, model=law, stroke=(0.0, 2.0))
    >>> r = hs.signals.triangle(0.0, 2.0, cycles=1, samples_per_cycle=100)
    >>> trials = learner.learn(law, 1e-3 * np.arange(r.size), r, trials=8)
    >>> bool(trials.rms[-1] < 0.02 * trials.rms[0])
    True
    """

    duration: Positive | None = None

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        if self.duration is None:
            raise ValueError("a controller that counts trials needs their duration=; learn() runs them without")
        return self._compiled(self.duration, True, positive_time(sample_time), u0, y0)

    def following(
        self, correction: npt.ArrayLike, error: npt.ArrayLike, sample_time: float, unreached: npt.ArrayLike = 0.0
    ) -> FloatArray:
        """Correction (n,) for the next trial from that of one and its error (n,) [unit of y].

        The error is the reference, as the sensor reads it, minus the measurement; where it is not finite it is zero.
        `unreached` (n,) is the part of the feed-forward's drive that its law cannot reach within the limits.
        """
        signals = np.stack(np.broadcast_arrays(correction, error, unreached)).astype(float)
        signals[1:][~np.isfinite(signals[1:])] = 0.0
        following = np.empty(signals.shape[1])
        learning.renew(_filters(self, positive_time(sample_time))[0].ravel(), signals.ravel(), following)
        return following

    def _commands(self, r: FloatArray, h: float, u0: float | None, measurement: FloatArray) -> tuple[FloatArray, ...]:
        """Commands for a reference, and what their law cannot reach, as of `following`."""
        ahead, places, u = known_ahead(self.controller, r, h), np.empty((2, r.size)), np.empty(r.size)
        step, parameters, state = begun(self.controller, h, self.u0 or 0.0 if u0 is None else u0, float(r[0]))
        controllers.replay(step, parameters, state, ahead, read_only(measurement, finite=False), places, u)
        return u, np.append(np.zeros(preview(self.controller, h)), places[1])[: r.size]

    def learn(
        self,
        trial: Any,
        t: npt.ArrayLike,
        reference: npt.ArrayLike,
        *,
        trials: int = 8,
        u0: float | None = None,
        correction: npt.ArrayLike | None = None,
    ) -> "LearnedTrials":
        """Run trials, and correct the reference after each.

        A trial has a lead before and after the reference: corrections begin before it, the last need later errors.

        Parameters
        ----------
        trial : plant as of `hysim.close_loop`, or callable
            A plant is at rest at `u0` before each trial, and the noise of its sensor differs between trials. A callable
            is ``trial(command) -> measurement`` with arrays of one shape, or ``trial(reference) -> measurement`` where
            the controller has feedback and runs on the stage. A sample of nan is missing.
        t, reference : array, shape (n,)
            Evenly spaced times [s] and the reference [unit of y].
        trials : int
            Number of trials, the first without learning.
        u0 : float, optional
            Command before each trial, as of `hysim.close_loop` [unit of u].
        correction : array, shape (n_samples,), optional
            Correction to continue from, of `LearnedTrials`.

        Returns
        -------
        LearnedTrials

        Raises
        ------
        ValueError
            If lengths differ, or times are uneven.
        """
        check_whole(trials, "trials")
        times, r, h = sampled(t, reference)
        lead = _filters(self, h)[0].shape[1] // 2
        rest = RestingPlant(as_actuator(self.model), h, self.u0 if u0 is None else u0).y0
        rising = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, lead))
        times = times[0] + h * np.arange(-lead, r.size + 2 * lead)
        r = np.concatenate([rest + rising * (r[0] - rest), r, np.full(2 * lead, r[-1])])
        c = np.zeros(r.size) if correction is None else vectors(correction=correction, t=times)[0]
        read = np.interp(times - _delay(self.model), times, r)
        corrections, measurements, commands = np.empty((3, trials, r.size))
        for k in range(trials):
            corrections[k] = c
            with warnings.catch_warnings():
                if k < trials - 1:
                    warnings.simplefilter("ignore", HysimWarning)
                measurements[k], commands[k], unreached = self._measured(trial, times, r + c, u0, k, k == trials - 1)
            c = self.following(c, read - measurements[k], h, unreached)
        return LearnedTrials(
            t=times,
            reference=r,
            corrections=corrections,
            measurements=measurements,
            commands=commands,
            rms=np.sqrt(np.nanmean((read - measurements)[:, lead : -2 * lead] ** 2, axis=1)),
            condition=self.condition(h),
        )

    def _measured(
        self, trial: Any, t: FloatArray, r: FloatArray, u0: float | None, number: int, is_last: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measurement of a trial, its commands, and what they do not reach; the last one warns as a loop does."""
        if callable(trial):
            u, unreached = (
                (r, 0.0 * r) if is_fed_back(self.controller) else self._commands(r, float(t[1] - t[0]), u0, r)
            )
            measurement = np.array(trial(u), dtype=float)
            if measurement.shape != r.shape:
                raise ValueError(f"trial must return a measurement of shape {r.shape}, got {measurement.shape}")
            if np.isnan(measurement).all():
                raise ValueError("trial must return a measurement that is not nan throughout")
            return measurement, u, unreached
        plant, (_, reference, h) = model_of(trial), sampled(t, r)
        if not isinstance(plant, Structure) and (sensor := as_actuator(plant).sensor) is not None:
            plant = replace(as_actuator(plant), sensor=replace(sensor, seed=sensor.seed + number))
        if is_last or isinstance(plant, Structure):
            run: Any = close_loop(plant, self.controller, t, r, u0=u0)
        else:
            run = RestingPlant(as_actuator(plant), h, u0).run(self.controller, reference)
        limited = (run.command != run.drive).any()
        unreached = self._commands(r, h, u0, run.measurement)[1] if limited else 0.0 * r
        return run.measurement, run.drive, unreached


@frozen_result
class LearnedTrials:
    """Trials of `IterativeLearning.learn`.

    Parameters
    ----------
    t, reference : array, shape (n_samples,)
        Times [s] and reference, with the rest before and after it [unit of y].
    corrections, measurements, commands : array, shape (n_trials, n_samples)
        Corrections of the reference, what the sensor read [unit of y], and commands within the limits [unit of u], or
        references where a controller with feedback runs on a stage of your own.
    rms : array, shape (n_trials,)
        Rms of the error of each trial, without the rest but with the sensor's noise in it [unit of y].
    condition : LearningCondition
        Part of the error that remains after a trial at worst.
    """

    t: FloatArray
    reference: FloatArray
    corrections: FloatArray
    measurements: FloatArray
    commands: FloatArray
    rms: FloatArray
    condition: LearningCondition

    @property
    def correction(self) -> FloatArray:
        """Correction (n_samples,) of the trial with the smallest error: the one to run, or to continue from."""
        return np.asarray(self.corrections[int(np.nanargmin(self.rms))])

    def __str__(self) -> str:
        first, last = quantity(self.rms[0]), quantity(self.rms[-1])
        lines = [f"LearnedTrials: {self.rms.size} trials, rms error {first} in the first and {last} in the last"]
        rows = {"each trial": ", ".join(f"{value:.3g}" for value in self.rms), "condition": str(self.condition)}
        return summary_text(lines, rows)


@functools.lru_cache(maxsize=32)
def _filters(learner: _Learning, sample_time: float) -> _Filters:
    """The filters of a learner with the cutoff asked for, or with the highest one at which errors shrink."""
    actuator = as_actuator(learner.model)
    slope, slopes = _slopes(learner.controller, actuator, learner.stroke)
    off = learner.uncertainty
    extremes = {slopes[0] * (1.0 - off), slopes[1] * (1.0 + off)}
    speeds = {1.0 - off, 1.0, 1.0 + off} if actuator.vibration is not None else {1.0}
    response = functools.partial(_response, learner.controller, actuator, slope, sample_time)
    nominal = response(0.5 * sum(slopes), 1.0)
    plants = np.stack([response(*each) for each in itertools.product(sorted(extremes), sorted(speeds))])
    taps = learner.controller.taps(sample_time)[0] if isinstance(learner.controller, TrackingController) else [1.0]
    drive = np.fft.rfft(taps, _LENGTH)
    ideal, from_drive = (np.conj(to) / (np.abs(to) ** 2 + (_DAMPED * abs(to[0])) ** 2) for to in (nominal, drive))
    inverses = np.stack([learner.gain * ideal, -from_drive])
    late = math.ceil(_delay(learner.model) / sample_time)
    doubtful = np.flatnonzero(np.abs(1.0 - ideal * plants).max(axis=0) > _TRUSTED)
    edge = doubtful[0] / nominal.size if doubtful.size else 1.0
    highest = min(edge / (1.0 + 0.5 * _TRANSITION), _HIGHEST) * math.pi / sample_time
    for cutoff in highest * _NARROWER ** np.arange(_TRIES) if learner.cutoff is None else [learner.cutoff]:
        filters = _with_cutoff(float(cutoff), inverses, plants, late, sample_time, slopes)
        if filters[1].rate < 1.0 - _LEARNS * learner.gain:
            break
    return filters


def _with_cutoff(
    cutoff: float, inverses: Spectrum, plants: Spectrum, late: int, sample_time: float, slopes: tuple[float, float]
) -> _Filters:
    """Taps of a low pass, and of it times the inverses, and what they leave of the error."""
    from scipy.signal import firwin, kaiser_beta, kaiserord

    corner = cutoff * sample_time / math.pi
    half = kaiserord(_RIPPLE, min(_TRANSITION * corner, 1.0 - corner))[0] // 2 if 0.0 < corner < 1.0 else _LENGTH
    reach = half + max(half // 2, 16) + late
    if 2 * reach >= _LENGTH:
        raise ValueError(
            f"no low pass of {_LENGTH} samples of {sample_time:g} s learns up to {cutoff:.4g} rad/s: give cutoff=, "
            "less uncertainty, a model whose sensor is not so late, or a controller that inverts the law"
        )
    taps = np.pad(firwin(2 * half + 1, corner, window=("kaiser", kaiser_beta(_RIPPLE))), reach - half)
    low_pass = _spectrum(taps)
    inverted = np.fft.irfft(low_pass * inverses, _LENGTH)[:, -np.arange(-reach, reach + 1)]
    rates = np.abs(low_pass - _spectrum(inverted[0]) * plants).max(axis=0)
    worst = int(np.argmax(rates))
    frequency = 2.0 * math.pi * worst / (_LENGTH * sample_time)
    condition = LearningCondition(float(rates[worst]), frequency, cutoff, slopes)
    return np.vstack([taps, inverted]), condition


def _spectrum(taps: FloatArray) -> Spectrum:
    """Response of taps for the samples -m ... m around a sample."""
    reach, around = taps.size // 2, np.zeros(_LENGTH)
    around[-np.arange(-reach, reach + 1)] = taps
    return np.fft.rfft(around)


def _delay(model: Any) -> float:
    sensor = as_actuator(model).sensor
    return 0.0 if sensor is None else float(sensor.delay)


def _slopes(controller: Any, actuator: Actuator, stroke: Interval) -> tuple[float, tuple[float, float]]:
    """Slope of the controller's law over the stroke, and the least and the largest of the model's against it."""
    cycle = np.tile(triangle(*stroke, cycles=1, samples_per_cycle=_CYCLE), _STEADY)
    cycle /= replace(actuator, amplifier=None).dc_gain
    law = Line(slope=1.0) if actuator.hysteresis is None else law_at(actuator.hysteresis, math.inf)
    inverse = controller if isinstance(controller, InverseFeedforward) else controller.feedforward
    inverted = Line(slope=1.0) if inverse.law is None else law_at(inverse.law, math.inf)
    u = inverted.inverse_response(cycle)
    own, other = inverse.amplifier or Amplifier(), replace(actuator.amplifier or Amplifier(), limits=None)
    level = np.diff(law.response(other.voltage((u - own.offset) / own.gain)))[-_CYCLE:]
    v = np.diff(inverted.response(u))[-_CYCLE:]
    moves = np.abs(v) > _MOVES * np.abs(v).max()
    ratios = level[moves] / v[moves] * (own.gain / other.gain)
    last = u[-_CYCLE:]
    slope = math.copysign(np.ptp(cycle) / np.ptp(last), float(np.diff(last) @ np.diff(cycle[-_CYCLE:])))
    return slope, (float(ratios.min()), float(ratios.max()))


def _response(
    controller: Any, actuator: Actuator, slope: float, sample_time: float, ratio: float, speed: float
) -> Spectrum:
    """Frequency response from a change of the reference to that of the measurement, with lines in place of laws.

    The plant's line has `ratio` times the controller's `slope`; its natural frequencies are `speed` times as high.
    """
    line, amplifier, inverted = Line(slope=slope), actuator.amplifier, controller.plant.amplifier
    inverted = inverted and Amplifier(gain=inverted.gain)
    plant = replace(
        actuator,
        amplifier=amplifier and replace(amplifier, offset=0.0, limits=None, slew_rate=None),
        hysteresis=Line(slope=slope * ratio),
        vibration=None if actuator.vibration is None else _faster(actuator.vibration, speed),
        sensor=Sensor(delay=_delay(actuator)),
    )
    if isinstance(controller, InverseFeedforward):
        linear: Any = replace(controller, law=line, amplifier=inverted)
    else:
        model = controller.model
        linear = replace(
            controller,
            feedforward=replace(controller.feedforward, law=line, amplifier=inverted),
            model=None if model is None else replace(model, hysteresis=line, amplifier=inverted),
            limits=None,
        )
    impulse = np.zeros(_LENGTH)
    at = preview(linear, sample_time)
    impulse[at] = 1.0
    measured = RestingPlant(plant, sample_time, 0.0).run(linear, impulse).measurement
    return np.fft.rfft(np.roll(measured, -at))


def _faster(vibration: Any, speed: float) -> Any:
    import control

    if speed == 1.0:
        return vibration
    system = control.ss(to_control(replace(vibration, delay=0.0) if vibration.delay else vibration))
    A, B, C, D = speed * system.A, speed * system.B[:, 0], system.C[0], float(system.D[0, 0])
    return StateSpace(A=A, B=B, C=C, D=D, delay=vibration.delay)
