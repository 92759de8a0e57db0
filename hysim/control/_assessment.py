"""Figures of a closed loop beside those of the same plant in open loop, driven with reference / secant gain.

Hysteresis loops and square waves are measured over their last cycle, steps by `hysim.metrics.vibration_reduction`.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import signals
from hysim._frozen import FloatArray, frozen, read_only
from hysim._printing import extent, printed, summary_text
from hysim.control._loop import ClosedLoop, RestingPlant, as_actuator, close_loop
from hysim.control._open_loop import secant_gain, without_memory
from hysim.control._protocols import Controller, preview
from hysim.metrics import LoopMetrics, VibrationReduction, loop_metrics, reduction_percent, rmse, vibration_reduction
from hysim.plants.actuator import Actuator

_FEWEST = 10  # samples of which a step is measured


@printed
@frozen
class OpenLoop:
    """Response to a periodic reference without a controller; every signal has shape (n,).

    Parameters
    ----------
    t, reference : array
        Times [s] and reference [unit of y].
    u, y : array
        Voltage reference / secant gain [unit of u], and true displacement just before it [unit of y].
    secant_gain, samples_per_cycle
        Stroke over span of the last cycle [unit of y / unit of u], and length of a cycle.
    """

    t: FloatArray
    reference: FloatArray
    u: FloatArray
    y: FloatArray
    secant_gain: float
    samples_per_cycle: int

    def __str__(self) -> str:
        return summary_text([f"OpenLoop: {self.t.size} samples, secant gain {self.secant_gain:.4g}", str(self.loop)])

    @property
    def cycle(self) -> FloatArray:
        """Last cycle of the reference, both ends included."""
        return self.last(self.reference)

    @property
    def loop(self) -> LoopMetrics:
        return self.loop_of(self.y)

    def last(self, signal: FloatArray) -> FloatArray:
        return signal[-self.samples_per_cycle - 1 :]

    def loop_of(self, y: FloatArray) -> LoopMetrics:
        """Measures of a displacement against the reference in the last cycle."""
        return loop_metrics(self.cycle, self.last(y))

    def reduction_percent(self, y: FloatArray) -> float:
        """100 (1 - W closed / W open) [%], W the largest width over the stroke."""
        return reduction_percent(self.loop.relative_width, self.loop_of(y).relative_width)


@printed
@frozen
class HysteresisAssessment:
    """Figures of a triangle in open and in closed loop, over the last cycle.

    Parameters
    ----------
    hysteresis_reduction_percent, lag_reduction_percent : float
        100 (1 - W closed / W open) [%], W the largest width over the stroke of the true displacement against the
        reference. The first is nan for a plant without a law, whose loop is lag; the second is nan with one.
    open_width, closed_width : float
        Largest widths [unit of y].
    open_lag_width, lag_width : float
        The same with the law replaced by a line of its secant gain [unit of y].
    tracking_rms, closure_gap : float
        Rms error, and displacement at the end minus at the start [unit of y].
    secant_gain : float
        Secant gain of the open loop [unit of y / unit of u].
    open_u, open_y, closed
        Signals of the open loop, shape (n,), and the closed loop.
    """

    hysteresis_reduction_percent: float
    lag_reduction_percent: float
    open_width: float
    closed_width: float
    open_lag_width: float
    lag_width: float
    tracking_rms: float
    closure_gap: float
    secant_gain: float
    open_u: FloatArray
    open_y: FloatArray
    closed: ClosedLoop

    def __str__(self) -> str:
        is_lag = math.isnan(self.hysteresis_reduction_percent)
        what = "lag" if is_lag else "hysteresis"
        reduction = self.lag_reduction_percent if is_lag else self.hysteresis_reduction_percent
        return summary_text(
            [f"HysteresisAssessment: {what} reduction {reduction:.2f} %, tracking rms {self.tracking_rms:.4g}"],
            {
                "open width": f"{self.open_width:.4g}, without the memory {self.open_lag_width:.4g}",
                "closed width": f"{self.closed_width:.4g}, without the memory {self.lag_width:.4g}",
                "closure gap": f"{self.closure_gap:.4g}",
                "secant gain": f"{self.secant_gain:.4g}",
                "voltage": extent(self.closed.u),
            },
        )


@printed
@frozen
class StepAssessment:
    """Figures of a step in open and in closed loop.

    Parameters
    ----------
    reduction : VibrationReduction
        The three figures, and the measures of both responses.
    open_y, closed
        Displacement in open loop, shape (n,), where the voltage steps to its final value; and the closed loop.
    """

    reduction: VibrationReduction
    open_y: FloatArray
    closed: ClosedLoop

    def __str__(self) -> str:
        ends = f"from {self.closed.y[0]:.4g} to {self.closed.reference[-1]:.4g}"
        return summary_text([f"StepAssessment {ends}, voltage {extent(self.closed.u)}", f"  {self.reduction}"])


@printed
@frozen
class SquareWaveAssessment:
    """Figures of a square wave in its periodic steady state, in open and in closed loop.

    Parameters
    ----------
    open_tracking_rms, tracking_rms : float
        Rms errors over the last period [unit of y].
    open_peak_excess_percent, peak_excess_percent : float
        Largest displacement beyond the reference's range in the last period [% of the wave's height].
    reduction : VibrationReduction, or None
        The step's figures over the last half period, if it lasts the open loop's t98 and five of its periods.
    open_y, closed
        Displacement in open loop, shape (n,), and the closed loop.
    """

    open_tracking_rms: float
    tracking_rms: float
    open_peak_excess_percent: float
    peak_excess_percent: float
    reduction: VibrationReduction | None
    open_y: FloatArray
    closed: ClosedLoop

    def __str__(self) -> str:
        return summary_text(
            [
                f"SquareWaveAssessment: tracking rms {self.tracking_rms:.4g}, open loop {self.open_tracking_rms:.4g}",
                f"  peak excess {self.peak_excess_percent:.2f} %, open loop {self.open_peak_excess_percent:.2f} %",
                "" if self.reduction is None else f"  {self.reduction}",
            ],
        )


def assess_hysteresis(
    plant: Any,
    controller: Controller,
    *,
    low: float,
    high: float,
    period: float,
    sample_time: float,
    cycles: int = 10,
) -> HysteresisAssessment:
    """Let a loop follow a triangle, and measure the hysteresis that remains.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at no voltage before the first sample.
    controller : PID, or anything with its ``compiled``
        Closes the loop.
    low, high : float
        Extremes of the triangle, which the plant must be able to reach [unit of y].
    period, sample_time : float
        Period of the triangle, an even number of samples, and sample time of the controller [s].
    cycles : int
        Number of cycles; the last one is measured.

    Returns
    -------
    HysteresisAssessment

    Raises
    ------
    SimulationError, ValueError
        If a loop diverges; if a period is not a whole number of samples, or the plant has no gain.

    Examples
    --------
    >>> import hysim as hs
    >>> law, pid = hs.BoucWen(gain=0.5, feedthrough=1.0), hs.PID(ki=200.0)
    >>> result = hs.control.assess_hysteresis(law, pid, low=0.0, high=1.0, period=10.0, sample_time=0.001)
    >>> result.hysteresis_reduction_percent > 90.0, result.lag_width > 0.5 * result.closed_width
    (True, True)
    """
    actuator = as_actuator(plant)
    samples = _samples_in("a period", period, sample_time)
    reference = signals.triangle(low, high, cycles=cycles, samples_per_cycle=samples)
    opened = open_loop(actuator, reference, sample_time, samples)
    line = RestingPlant(without_memory(actuator, opened.cycle / opened.secant_gain), sample_time)
    closed = close_loop(actuator, controller, opened.t, reference)
    reduction, after = opened.reduction_percent(closed.y), opened.loop_of(closed.y)
    has_law = actuator.hysteresis is not None
    return HysteresisAssessment(
        hysteresis_reduction_percent=reduction if has_law else math.nan,
        lag_reduction_percent=math.nan if has_law else reduction,
        open_width=opened.loop.max_width,
        closed_width=after.max_width,
        open_lag_width=opened.loop_of(line.driven(opened.u)).max_width,
        lag_width=opened.loop_of(line.run(controller, reference).y).max_width,
        tracking_rms=rmse(opened.cycle, opened.last(closed.y)),
        closure_gap=after.closure_gap,
        secant_gain=opened.secant_gain,
        open_u=opened.u,
        open_y=opened.y,
        closed=closed,
    )


def open_loop(plant: Any, reference: npt.ArrayLike, sample_time: float, samples_per_cycle: int) -> OpenLoop:
    """Drive a plant along a periodic reference by the voltage reference / secant gain.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at no voltage before the first sample.
    reference : array, shape (n,)
        Whole cycles, and the sample at which the last one ends [unit of y].
    sample_time, samples_per_cycle
        Sample time [s] and length of a cycle.

    Returns
    -------
    OpenLoop

    Raises
    ------
    SimulationError, ValueError
        If the plant diverges or has no gain, or the reference does not hold whole cycles.

    Examples
    --------
    >>> import hysim as hs
    >>> triangle = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=100)
    >>> opened = hs.control.open_loop(hs.Line(slope=2.0), triangle, 0.1, 100)
    >>> opened.secant_gain, round(opened.loop.max_width, 6)  # two samples' rise: read just before the next voltage
    (2.0, 0.04)
    """
    actuator, r = as_actuator(plant), read_only(reference, "reference", ndim=1)
    cycles, rest = divmod(r.size - 1, samples_per_cycle)
    if rest or not cycles:
        raise ValueError(
            f"reference must hold whole cycles of {samples_per_cycle} samples and a last one, got {r.size} samples"
        )
    creeping = None if actuator.creep is None else cycles
    gain = secant_gain(actuator, r[-samples_per_cycle - 1 :], sample_time, creeping)
    return OpenLoop(
        t=read_only(sample_time * np.arange(r.size)),
        reference=r,
        u=r / gain,
        y=RestingPlant(actuator, sample_time).driven(r / gain),
        secant_gain=gain,
        samples_per_cycle=samples_per_cycle,
    )


def assess_step(
    plant: Any,
    controller: Controller,
    *,
    step: float,
    duration: float,
    sample_time: float,
    u0: float = 0.0,
    hold: float = 0.0,
    known_ahead: bool = False,
) -> StepAssessment:
    """Let a loop follow a step, and measure the vibration that remains.

    Parameters
    ----------
    plant, controller
        As in `assess_hysteresis`; the plant rests at `u0`.
    step : float
        Height from the resting displacement [unit of y].
    duration, sample_time : float
        Duration, long enough for the open loop to come to rest, and sample time of the controller [s].
    u0 : float
        Voltage before the first sample.
    hold : float
        Time before the step, for a controller with a wrong model to come to rest [s].
    known_ahead : bool
        Whether the reference is known ahead, so that a controller with preview moves before the step. By default the
        controller learns of the step when the open loop steps.

    Returns
    -------
    StepAssessment

    Raises
    ------
    SimulationError, ValueError
        As `assess_hysteresis`.

    Examples
    --------
    >>> import hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0))
    >>> pid = hs.PID.standard(4.0, Ti=2.0, Td=1.0, derivative_filter=0.05, setpoint_weight=0.0)
    >>> result = hs.control.assess_step(mode, pid, step=1.0, duration=200.0, sample_time=0.01).reduction
    >>> round(result.overshoot_reduction_percent), round(result.settling_time_reduction_percent)
    (100, 84)
    """
    actuator = as_actuator(plant)
    before, after = round(hold / sample_time), round(duration / sample_time) + 1
    ahead = preview(controller, sample_time)
    t = sample_time * np.arange(before + after)
    resting = RestingPlant(actuator, sample_time, u0)
    reference = resting.y0 + np.where(np.arange(t.size) < before + ahead, 0.0, step)
    closed = close_loop(actuator, controller, t, reference, u0=u0)
    gain = secant_gain(actuator, np.array([resting.y0, resting.y0 + step]))
    waits = np.arange(after) < (ahead if known_ahead else 0)
    open_y = resting.driven(u0 + np.where(waits, 0.0, step / gain))
    decay_rate = -_least_damped(actuator).real
    return StepAssessment(
        reduction=vibration_reduction(t[:after], open_y, closed.y[before:], decay_rate=decay_rate),
        open_y=open_y,
        closed=closed,
    )


def assess_square_wave(
    plant: Any, controller: Controller, *, low: float, high: float, period: float, sample_time: float, periods: int
) -> SquareWaveAssessment:
    """Let a loop follow a square wave, and measure its last period.

    Parameters
    ----------
    plant, controller
        As in `assess_hysteresis`.
    low, high : float
        Levels of the wave; each period begins at the low one [unit of y].
    period, sample_time : float
        Period of the wave, an even number of samples, and sample time of the controller [s].
    periods : int
        Number of periods, enough for the open loop to become periodic.

    Returns
    -------
    SquareWaveAssessment

    Raises
    ------
    SimulationError, ValueError
        As `assess_hysteresis`, or if high is not above low.

    Examples
    --------
    >>> import hysim as hs
    >>> lag, pid = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), hs.PID(kp=9.0, ki=9.0)
    >>> wave = dict(low=0.0, high=1.0, period=4.0, sample_time=0.01, periods=5)
    >>> result = hs.control.assess_square_wave(lag, pid, **wave)
    >>> result.tracking_rms < 0.5 * result.open_tracking_rms
    True
    """
    actuator = as_actuator(plant)
    if not high > low:
        raise ValueError(f"high must be above low, got low {low} and high {high}")
    half = _samples_in("a half period", 0.5 * period, sample_time)
    reference = np.tile(np.repeat([low, high], half), periods)
    t = sample_time * np.arange(reference.size)
    gain = secant_gain(actuator, np.array([low, high]))
    closed = close_loop(actuator, controller, t, reference)
    open_y = RestingPlant(actuator, sample_time).driven(reference / gain)
    last, last_half = slice(-2 * half, None), slice(-half, None)
    mode, step = _least_damped(actuator), None
    if half >= _FEWEST:
        halves = t[last_half], open_y[last_half], closed.y[last_half]
        reduction = vibration_reduction(*halves, decay_rate=-mode.real)
        if half * sample_time >= reduction.open.t98 + 5.0 * 2.0 * math.pi / mode.imag:
            step = reduction
    return SquareWaveAssessment(
        open_tracking_rms=rmse(reference[last], open_y[last]),
        tracking_rms=rmse(reference[last], closed.y[last]),
        open_peak_excess_percent=_peak_excess(open_y[last], low, high),
        peak_excess_percent=_peak_excess(closed.y[last], low, high),
        reduction=step,
        open_y=open_y,
        closed=closed,
    )


def _samples_in(what: str, duration: float, sample_time: float) -> int:
    samples = round(duration / sample_time)
    if samples < 1 or abs(samples - duration / sample_time) > 1e-6 * samples:
        raise ValueError(f"{what} must be a whole number of samples, got {duration / sample_time:g}")
    return samples


def _least_damped(actuator: Actuator) -> complex:
    poles = np.empty(0) if actuator.vibration is None else actuator.vibration.poles
    modes = poles[poles.imag > 0.0]
    return complex(modes[np.argmin(-modes.real / np.abs(modes))]) if modes.size else complex(math.nan, math.inf)


def _peak_excess(y: FloatArray, low: float, high: float) -> float:
    return 100.0 * max(0.0, float(y.max()) - high, low - float(y.min())) / (high - low)
