"""Figures of a closed loop beside those of the same plant in open loop, driven with reference / secant gain.

Hysteresis loops and square waves are measured over their last cycle, steps by `hysim.metrics.vibration_reduction`.
The reductions of a loop that is not stable are nan: a limit cycle along the reference may be narrower than any loop.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import signals
from hysim._frozen import FloatArray, read_only
from hysim.control._assessment_results import HysteresisAssessment, OpenLoop, SquareWaveAssessment, StepAssessment
from hysim.control._loop import RestingPlant, around_actuator, as_actuator
from hysim.control._loop_assessment import judged
from hysim.control._open_loop import secant_gain, without_memory
from hysim.control._protocols import Controller, preview
from hysim.metrics import VibrationReduction, rmse, vibration_reduction
from hysim.plants.actuator import Actuator

_FEWEST = 10  # samples of which a step is measured


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
    closed = around_actuator(actuator, controller, opened.t, reference)
    counted = slice(-samples - 1, None)
    loop = judged(actuator, controller, closed, opened.cycle, opened.secant_gain, counted, period)
    reduction = opened.reduction_percent(closed.y) if loop.stable else math.nan
    after, has_law = opened.loop_of(closed.y), actuator.hysteresis is not None
    return HysteresisAssessment(
        hysteresis_reduction_percent=reduction if has_law else math.nan,
        lag_reduction_percent=math.nan if has_law else reduction,
        open_width=opened.loop.max_width,
        closed_width=after.max_width,
        open_lag_width=opened.loop_of(line.driven(opened.u)).max_width,
        lag_width=opened.loop_of(line.run(controller, reference).y).max_width,
        tracking_rms=loop.tracking_rms,
        closure_gap=after.closure_gap,
        secant_gain=opened.secant_gain,
        open_u=opened.u,
        open_y=opened.y,
        closed=closed,
        loop=loop,
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
    u0: float | None = None,
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
    u0 : float, optional
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
    closed = around_actuator(actuator, controller, read_only(t), reference, u0)
    cycle = np.array([resting.y0, resting.y0 + step])
    gain = secant_gain(actuator, cycle)
    loop = judged(actuator, controller, closed, cycle, gain, slice(None))
    waits = np.arange(after) < (ahead if known_ahead else 0)
    open_y = resting.driven(resting.u0 + np.where(waits, 0.0, step / gain))
    decay_rate = -_least_damped(actuator).real
    reduction = vibration_reduction(t[:after], open_y, closed.y[before:], decay_rate=decay_rate)
    return StepAssessment(
        reduction=reduction if loop.stable else _unknown(reduction),
        open_y=open_y,
        closed=closed,
        loop=loop,
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
    levels = np.array([low, high])
    gain = secant_gain(actuator, levels)
    closed = around_actuator(actuator, controller, read_only(t), reference)
    open_y = RestingPlant(actuator, sample_time).driven(reference / gain)
    last, last_half = slice(-2 * half, None), slice(-half, None)
    loop = judged(actuator, controller, closed, levels, gain, last, period)
    mode, step = _least_damped(actuator), None
    if half >= _FEWEST and loop.stable:
        halves = t[last_half], open_y[last_half], closed.y[last_half]
        reduction = vibration_reduction(*halves, decay_rate=-mode.real)
        if half * sample_time >= reduction.open.t98 + 5.0 * 2.0 * math.pi / mode.imag:
            step = reduction
    return SquareWaveAssessment(
        open_tracking_rms=rmse(reference[last], open_y[last]),
        tracking_rms=loop.tracking_rms,
        open_peak_excess_percent=_peak_excess(open_y[last], low, high),
        peak_excess_percent=_peak_excess(closed.y[last], low, high),
        reduction=step,
        open_y=open_y,
        closed=closed,
        loop=loop,
    )


def _unknown(reduction: VibrationReduction) -> VibrationReduction:
    """The measures of both responses, without the reductions."""
    return replace(
        reduction,
        overshoot_reduction_percent=math.nan,
        residual_rms_reduction_percent=math.nan,
        settling_time_reduction_percent=math.nan,
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
