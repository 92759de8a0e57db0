"""Figures of a closed loop, compared with the same plant in open loop, driven with reference / secant gain.

Hysteresis loops and square waves are measured over their last cycle, steps by `hysim.metrics.vibration_reduction`.
The reductions of a loop that is not stable are nan: a limit cycle along the reference may be narrower than any loop.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import signals
from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.printing import extent, frozen_result, quantity, summary_text
from hysim.control._controller import Controller, preview
from hysim.control._loop import ClosedLoop, RestingPlant, around, inverted, sampled, secant_gain, without_memory
from hysim.control._stability import judge
from hysim.control._tracking import is_fed_back
from hysim.metrics import LoopMetrics, VibrationReduction, loop_metrics, reduction_percent, rmse, vibration_reduction
from hysim.plants.actuator import Actuator, as_actuator


@frozen_result
class LoopAssessment:
    """Stability, robustness and error of a closed loop.

    Parameters
    ----------
    stable : bool
        Whether the linear loop is stable at the law's extreme slopes, and the loop rests once the reference does.
    message : str
        Why it is not stable; empty if it is.
    period : float
        Period of the reference [s]; nan if it has none.
    tracking_rms : float
        Rms of reference minus true displacement, over the last period if there is one [unit of y].
    limited_percent : float
        Share of the samples at a limit of controller or amplifier [%].
    max_sensitivity, max_sensitivity_with_delay : float
        Largest ``|1 / (1 + L)|`` at either slope, and with one more sample of delay; inf if unstable, nan if unknown.
    command_jump : float
        Jump of the command when the measurement moves by one; nan if unknown [unit of u / unit of y].
    closed
        The closed loop.
    """

    stable: bool
    message: str
    period: float
    tracking_rms: float
    limited_percent: float
    max_sensitivity: float
    max_sensitivity_with_delay: float
    command_jump: float
    closed: ClosedLoop

    def __str__(self) -> str:
        lines = [f"LoopAssessment: {'stable' if self.stable else self.message}, tracking rms {self.tracking_rms:.4g}"]
        rows = {
            "maximum sensitivity": f"{self.max_sensitivity:.4g}, with one sample more of delay "
            f"{self.max_sensitivity_with_delay:.4g}",
            "at a limit": f"{self.limited_percent:.3g} % of the samples",
            "command": f"moves by {self.command_jump:.4g} when the measurement moves by one",
            "period": "" if math.isnan(self.period) else quantity(self.period, "s"),
        }
        return summary_text(lines, rows)

    def row(self, quantum: float | None = None) -> dict[str, float | bool | None]:
        """The columns that a table should give with every reduction: numbers, None where one is infinite or unknown.

        ``"stable"``, ``"period"``, ``"tracking_rms"``, ``"limited_percent"``, ``"max_sensitivity"``,
        ``"max_sensitivity_with_delay"``, ``"volts_per_quantum"``, for steps `quantum` [unit of y], else the sensor's.
        """
        step = self.closed.conditions["sensor_quantum"] if quantum is None else quantum
        numbers = {name: vars(self)[name] for name in _IN_A_ROW} | {"volts_per_quantum": self.command_jump * step}
        return {"stable": self.stable} | {key: each if math.isfinite(each) else None for key, each in numbers.items()}


def assess_loop(
    plant: Any,
    controller: Controller,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    u0: float | None = None,
    period: float = math.nan,
) -> LoopAssessment:
    """Close a loop, and judge its stability, robustness and error.

    A loop that is unstable in linear theory may still run along between the limits of its voltage, and a stable one may
    swing there, or on the steps of its sensor. Both count as not stable: their errors say nothing of the controller.

    Parameters
    ----------
    plant, controller, t, reference, u0
        As in `hysim.close_loop`.
    period : float
        Period of the reference, of which the last one is measured [s]; nan for a reference that has none.

    Returns
    -------
    LoopAssessment

    Raises
    ------
    SimulationError, ValueError
        If the loop diverges; if the plant has no gain, or the period is longer than the reference.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag, t = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), 0.1 * np.arange(200)
    >>> found = [hs.control.assess_loop(lag, hs.PID(kp=kp, limits=(0.0, 2.0)), t, np.ones(200)) for kp in (5.0, 50.0)]
    >>> [each.stable for each in found], found[1].message
    ([True, False], 'the loop is unstable: a pole of the linear loop lies outside the unit circle')
    """
    times, r, h = sampled(t, reference)
    resting = RestingPlant(as_actuator(plant), h, u0)
    samples = r.size if math.isnan(period) else round(period / h)
    if not 0 < samples <= r.size:
        raise ValueError(f"period must be at least a sample and no longer than the reference, got {period} s")
    cycle = r[-samples:]
    cycle = np.append(resting.y0, cycle) if np.ptp(cycle) == 0.0 else cycle
    gain = secant_gain(resting.plant, cycle)
    return _judged(resting, controller, times, r, cycle, gain, slice(-samples, None), period)


def _judged(
    resting: RestingPlant,
    controller: Controller,
    times: FloatArray,
    reference: FloatArray,
    cycle: FloatArray,
    gain: float,
    counted: slice,
    period: float = math.nan,
) -> LoopAssessment:
    """Judgement of a loop; `gain` is the secant gain along `cycle`, and `counted` are the samples of the error."""
    closed = around(resting, controller, times, reference)
    linear, moves = judge(resting, controller, closed.reference, cycle, gain)
    unstable = linear.max_sensitivity == math.inf
    why = ": a pole of the linear loop lies outside the unit circle" if unstable else " where the reference stops"
    return LoopAssessment(
        stable=not moves,
        message=moves and f"the loop {moves}{why}",
        period=period,
        tracking_rms=rmse(closed.reference[counted], closed.y[counted]),
        limited_percent=100.0 * float(closed.conditions["limited_samples"]) / float(closed.t.size),
        max_sensitivity=linear.max_sensitivity,
        max_sensitivity_with_delay=linear.max_sensitivity_with_delay,
        command_jump=linear.command_jump,
        closed=closed,
    )


@frozen_result
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
        """Last cycle of a signal, both ends included."""
        return signal[-self.samples_per_cycle - 1 :]

    def loop_of(self, y: FloatArray) -> LoopMetrics:
        """Measures of the last cycle of `y` over the reference."""
        return loop_metrics(self.cycle, self.last(y))

    def reduction_percent(self, y: FloatArray) -> float:
        """100 (1 - W closed / W open) [%], W the largest width over the stroke."""
        return reduction_percent(self.loop.relative_width, self.loop_of(y).relative_width)


@frozen_result
class HysteresisAssessment:
    """Figures of a triangle in open and in closed loop, over the last cycle.

    Parameters
    ----------
    hysteresis_reduction_percent, lag_reduction_percent : float
        100 (1 - W closed / W open) [%], W the largest width over the stroke of the true displacement against the
        reference. The first is nan without a law (the loop is lag), the second with one, both if it is not stable.
    open_width, closed_width, open_lag_width, lag_width : float
        Largest widths, and the same with the law replaced by a line of its secant gain [unit of y].
    open_tracking_rms, tracking_rms, closure_gap : float
        Rms errors, and displacement at the end minus at the start [unit of y].
    secant_gain : float
        Secant gain of the open loop [unit of y / unit of u].
    open_u, open_y, closed, loop
        Signals of the open loop, shape (n,); the closed loop; and its judgement.
    """

    hysteresis_reduction_percent: float
    lag_reduction_percent: float
    open_width: float
    closed_width: float
    open_lag_width: float
    lag_width: float
    open_tracking_rms: float
    tracking_rms: float
    closure_gap: float
    secant_gain: float
    open_u: FloatArray
    open_y: FloatArray
    closed: ClosedLoop
    loop: LoopAssessment

    @property
    def is_lag(self) -> bool:
        """Whether the plant has no law, so that its loop is lag."""
        return self.closed.conditions["plant"].hysteresis is None

    def __str__(self) -> str:
        what = "lag" if self.is_lag else "hysteresis"
        reduction = self.lag_reduction_percent if self.is_lag else self.hysteresis_reduction_percent
        drive, y = driven_by(self.closed), self.closed.units.get("y", "")
        lines = [f"HysteresisAssessment: {what} reduction {reduction:.2f} %, tracking rms {self.tracking_rms:.4g}"]
        rows = {
            "not stable": self.loop.message,
            "width": f"open {self.open_width:.4g}, {drive} {quantity(self.closed_width, y)}",
            "width without the memory": ""
            if self.is_lag
            else f"open {self.open_lag_width:.4g}, {drive} {quantity(self.lag_width, y)}",
            "tracking rms": f"open {self.open_tracking_rms:.4g}, {drive} {quantity(self.tracking_rms, y)}",
            "closure gap": quantity(self.closure_gap, y),
            "secant gain": f"{self.secant_gain:.4g}",
            "input": extent(self.closed.u, self.closed.units.get("u", "")),
        }
        return summary_text(lines, rows)


@frozen_result
class StepAssessment:
    """Figures of a step in open and in closed loop.

    Parameters
    ----------
    reduction : VibrationReduction
        The three figures, nan if the loop is not stable, and the measures of both responses.
    open_y, closed, loop
        Displacement in open loop, shape (n,), where the voltage steps to its final value; closed loop; its judgement.
    """

    reduction: VibrationReduction
    open_y: FloatArray
    closed: ClosedLoop
    loop: LoopAssessment

    def __str__(self) -> str:
        u, y = (self.closed.units.get(signal, "") for signal in "uy")
        ends = f"from {self.closed.y[0]:.4g} to {quantity(self.closed.reference[-1], y)}"
        rows = {"at a limit": f"{self.loop.limited_percent:.3g} % of the samples", "not stable": self.loop.message}
        return summary_text([f"StepAssessment {ends}, input {extent(self.closed.u, u)}", f"  {self.reduction}"], rows)


@frozen_result
class SquareWaveAssessment:
    """Figures of a square wave in its periodic steady state, in open and in closed loop.

    Parameters
    ----------
    open_tracking_rms, tracking_rms : float
        Rms errors over the last period [unit of y].
    open_peak_excess_percent, peak_excess_percent : float
        Largest displacement beyond the reference's range in the last period [% of the wave's height].
    reduction : VibrationReduction, or None
        Step figures over the last half period, if it lasts the open loop's t98 and 5 of its periods in a stable loop.
    open_y, closed, loop
        Displacement in open loop, shape (n,); the closed loop; and its judgement.
    """

    open_tracking_rms: float
    tracking_rms: float
    open_peak_excess_percent: float
    peak_excess_percent: float
    reduction: VibrationReduction | None
    open_y: FloatArray
    closed: ClosedLoop
    loop: LoopAssessment

    def __str__(self) -> str:
        lines = [
            f"SquareWaveAssessment: tracking rms {self.tracking_rms:.4g}, open loop {self.open_tracking_rms:.4g}",
            f"  peak excess {self.peak_excess_percent:.2f} %, open loop {self.open_peak_excess_percent:.2f} %",
            "" if self.reduction is None else f"  {self.reduction}",
        ]
        return summary_text(lines, {"not stable": self.loop.message})


def driven_by(run: ClosedLoop) -> str:
    """The drive of the plant in a word: "closed" for a loop with feedback, "inverse" for a controller without it."""
    return "closed" if is_fed_back(run.conditions["controller"]) else "inverse"


_FEWEST = 10  # samples of which a step is measured
_IN_A_ROW = ("period", "tracking_rms", "limited_percent", "max_sensitivity", "max_sensitivity_with_delay")
_UNKNOWN: dict[str, Any] = dict.fromkeys(
    ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent"), math.nan
)


def assess_hysteresis(
    plant: Any, controller: Controller, *, low: float, high: float, period: float, sample_time: float, cycles: int = 10
) -> HysteresisAssessment:
    """Let a loop follow a triangle, and measure the hysteresis that remains.

    Parameters
    ----------
    plant, controller
        As in `hysim.close_loop`; the plant is at rest at no voltage before the first sample.
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
    line = RestingPlant(without_memory(actuator, inverted(actuator, opened.cycle, opened.secant_gain)), sample_time)
    resting = RestingPlant(actuator, sample_time)
    counted = slice(-samples - 1, None)
    loop = _judged(resting, controller, opened.t, reference, opened.cycle, opened.secant_gain, counted, period)
    reduction = opened.reduction_percent(loop.closed.y) if loop.stable else math.nan
    after, has_law = opened.loop_of(loop.closed.y), actuator.hysteresis is not None
    return HysteresisAssessment(
        hysteresis_reduction_percent=reduction if has_law else math.nan,
        lag_reduction_percent=math.nan if has_law else reduction,
        open_width=opened.loop.max_width,
        closed_width=after.max_width,
        open_lag_width=opened.loop_of(line.driven(opened.u)).max_width,
        lag_width=opened.loop_of(line.run(controller, reference).y).max_width,
        open_tracking_rms=rmse(opened.cycle, opened.last(opened.y)),
        tracking_rms=loop.tracking_rms,
        closure_gap=after.closure_gap,
        secant_gain=opened.secant_gain,
        open_u=opened.u,
        open_y=opened.y,
        closed=loop.closed,
        loop=loop,
    )


def open_loop(plant: Any, reference: npt.ArrayLike, sample_time: float, samples_per_cycle: int) -> OpenLoop:
    """Drive a plant along a periodic reference by the voltage reference / secant gain.

    `plant` is an Actuator, a law or a linear plant, at rest at no voltage before the first sample. `reference` (n,)
    [unit of y] holds whole cycles of `samples_per_cycle`, and the sample at which the last one ends, each `sample_time`
    apart [s]. Raises SimulationError if the plant diverges; ValueError if it has no gain or the cycles are not whole.

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
    u = inverted(actuator, r, gain)
    return OpenLoop(
        t=read_only(sample_time * np.arange(r.size)),
        reference=r,
        u=u,
        y=RestingPlant(actuator, sample_time).driven(u),
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
    u0: float | None = None,
    hold: float = 0.0,
    known_ahead: bool = False,
) -> StepAssessment:
    """Let a loop follow a step, and measure the vibration that remains.

    Parameters
    ----------
    plant, controller
        As in `hysim.close_loop`.
    step : float
        Height from the resting displacement [unit of y].
    duration, sample_time : float
        Duration, long enough for the open loop to come to rest, and sample time of the controller [s].
    u0 : float, optional
        Voltage before the first sample.
    hold : float
        Time before the step, for a controller with a wrong model to come to rest [s].
    known_ahead : bool
        Whether a controller with preview moves before the step; by default it learns of it when the open loop steps.

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
    cycle = np.array([resting.y0, resting.y0 + step])
    gain = secant_gain(actuator, cycle)
    loop = _judged(resting, controller, read_only(t), reference, cycle, gain, slice(None))
    waits = np.arange(after) < (ahead if known_ahead else 0)
    open_y = resting.driven(resting.u0 + np.where(waits, 0.0, step / gain))
    reduction = vibration_reduction(t[:after], open_y, loop.closed.y[before:], decay_rate=-_least_damped(actuator).real)
    if not loop.stable:
        reduction = replace(reduction, **_UNKNOWN)
    return StepAssessment(reduction=reduction, open_y=open_y, closed=loop.closed, loop=loop)


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
    levels = np.array([low, high])
    gain = secant_gain(actuator, levels)
    resting = RestingPlant(actuator, sample_time)
    open_y = resting.driven(inverted(actuator, reference, gain))
    last, last_half = slice(-2 * half, None), slice(-half, None)
    loop = _judged(resting, controller, read_only(t), reference, levels, gain, last, period)
    mode, step = _least_damped(actuator), None
    if half >= _FEWEST and loop.stable:
        halves = t[last_half], open_y[last_half], loop.closed.y[last_half]
        reduction = vibration_reduction(*halves, decay_rate=-mode.real)
        if half * sample_time >= reduction.open.t98 + 5.0 * 2.0 * math.pi / mode.imag:
            step = reduction
    return SquareWaveAssessment(
        open_tracking_rms=rmse(reference[last], open_y[last]),
        tracking_rms=loop.tracking_rms,
        open_peak_excess_percent=_peak_excess(open_y[last], low, high),
        peak_excess_percent=_peak_excess(loop.closed.y[last], low, high),
        reduction=step,
        open_y=open_y,
        closed=loop.closed,
        loop=loop,
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
