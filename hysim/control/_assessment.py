"""What a loop achieves against the same plant in open loop: one code for every plant and controller.

The open loop drives the plant with reference / secant gain. Loops are measured against the reference, over
the last of several cycles; steps by the three figures of `hysim.metrics.vibration_reduction`, always
together; square waves over their last period.
"""

import math
from typing import Any

import numpy as np

from hysim import signals
from hysim._frozen import FloatArray, frozen
from hysim.control._drive import secant_gain, without_memory
from hysim.control._loop import ClosedLoop, Controller, RestingPlant, as_actuator, close_loop
from hysim.metrics import LoopMetrics, VibrationReduction, loop_metrics, reduction_percent, rmse, vibration_reduction
from hysim.models.actuator import Actuator

_FEWEST = 10  # samples of which a step is measured


@frozen
class HysteresisAssessment:
    """A triangle, followed in open and in closed loop.

    Parameters
    ----------
    hysteresis_reduction_percent : float
        100 (1 - W closed / W open), W the largest width over the stroke of the true displacement against the
        reference, in the last cycle [%]; nan for a plant without a law.
    lag_reduction_percent : float
        The same of a plant without a law, whose loop is lag; nan with one.
    open_width, closed_width : float
        Largest widths [unit of y].
    open_lag_width, lag_width : float
        Those of the same loops with the law replaced by a line of its secant gain [unit of y].
    tracking_rms : float
        Rms error of the closed loop over the last cycle [unit of y].
    closure_gap : float
        Displacement at the last cycle's end minus at its start [unit of y].
    secant_gain : float
        Of the open loop [unit of y / unit of u].
    open_u, open_y : array, shape (n,)
        The open loop.
    closed : ClosedLoop
        The closed one, with its conditions.
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


@frozen
class StepAssessment:
    """A step, in open and in closed loop.

    Parameters
    ----------
    reduction : VibrationReduction
        The three figures, and both responses' measures.
    open_y : array, shape (n,)
        The open loop, its voltage stepping to where the step ends.
    closed : ClosedLoop
        The closed one, with its conditions.
    """

    reduction: VibrationReduction
    open_y: FloatArray
    closed: ClosedLoop


@frozen
class SquareWaveAssessment:
    """A square wave in its periodic steady state, in open and in closed loop.

    Parameters
    ----------
    open_tracking_rms, tracking_rms : float
        Rms errors over the last period [unit of y].
    open_peak_excess_percent, peak_excess_percent : float
        How far the displacement leaves the reference's range, in the last period [% of the wave's height].
    reduction : VibrationReduction, or None
        The step's figures over the last half period, if this is at least the open loop's t98 and five of its
        periods long.
    open_y : array, shape (n,)
        The open loop.
    closed : ClosedLoop
        The closed one, with its conditions.
    """

    open_tracking_rms: float
    tracking_rms: float
    open_peak_excess_percent: float
    peak_excess_percent: float
    reduction: VibrationReduction | None
    open_y: FloatArray
    closed: ClosedLoop


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
    """Let a loop follow a triangle, and measure what is left of the hysteresis.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at no voltage before the first sample.
    controller : PID, or anything with its ``compiled``
        What closes the loop.
    low, high : float
        The triangle's extremes [unit of y]; reachable ones, if the figure shall say something.
    period, sample_time : float
        Of the triangle, an even number of samples, and of the controller [s].
    cycles : int
        Number of cycles, of which the last is measured.

    Returns
    -------
    HysteresisAssessment

    Raises
    ------
    SimulationError
        If a loop is lost.
    ValueError
        If the triangle is not one, or the plant has no gain.

    Examples
    --------
    >>> import hysim as hs
    >>> law, pid = hs.BoucWen(gain=0.5, feedthrough=1.0), hs.PID(ki=200.0)
    >>> found = hs.control.assess_hysteresis(law, pid, low=0.0, high=1.0, period=10.0, sample_time=0.001)
    >>> found.hysteresis_reduction_percent > 90.0, found.lag_width > 0.5 * found.closed_width
    (True, True)
    """
    actuator = as_actuator(plant)
    samples = _whole("a period", period, sample_time)
    reference = signals.triangle(low, high, cycles=cycles, samples_per_cycle=samples)
    last = slice(-samples - 1, None)
    cycle = reference[last]
    gain = secant_gain(actuator, cycle, sample_time, None if actuator.creep is None else cycles)
    line = without_memory(actuator, cycle / gain)
    t = sample_time * np.arange(reference.size)
    closed = close_loop(actuator, controller, t, reference)
    lag = close_loop(line, controller, t, reference)
    open_u = reference / gain
    open_y = _held(actuator, open_u, sample_time, 0.0)
    before, after = loop_metrics(cycle, open_y[last]), loop_metrics(cycle, closed.y[last])
    reduction = reduction_percent(before.relative_width, after.relative_width)
    has_law = actuator.hysteresis is not None
    return HysteresisAssessment(
        hysteresis_reduction_percent=reduction if has_law else math.nan,
        lag_reduction_percent=math.nan if has_law else reduction,
        open_width=before.max_width,
        closed_width=after.max_width,
        open_lag_width=_width(cycle, _held(line, open_u, sample_time, 0.0)[last]),
        lag_width=_width(cycle, lag.y[last]),
        tracking_rms=rmse(cycle, closed.y[last]),
        closure_gap=after.closure_gap,
        secant_gain=gain,
        open_u=open_u,
        open_y=open_y,
        closed=closed,
    )


def assess_step(
    plant: Any, controller: Controller, *, step: float, duration: float, sample_time: float, u0: float = 0.0
) -> StepAssessment:
    """Let a loop follow a step, and measure what is left of the vibration.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at `u0` before the first sample.
    controller : PID, or anything with its ``compiled``
        What closes the loop.
    step : float
        From the resting displacement [unit of y].
    duration, sample_time : float
        Of the record, long enough for the open loop to come to rest, and of the controller [s].
    u0 : float
        Voltage before the first sample.

    Returns
    -------
    StepAssessment

    Raises
    ------
    SimulationError
        If the loop is lost.
    ValueError
        If the plant has no gain.

    Examples
    --------
    >>> import hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0))
    >>> pid = hs.PID.standard(4.0, Ti=2.0, Td=1.0, derivative_filter=0.05, setpoint_weight=0.0)
    >>> found = hs.control.assess_step(mode, pid, step=1.0, duration=200.0, sample_time=0.01).reduction
    >>> round(found.overshoot_reduction_percent), round(found.settling_time_reduction_percent)
    (100, 84)
    """
    actuator = as_actuator(plant)
    t = sample_time * np.arange(round(duration / sample_time) + 1)
    rest = _resting_displacement(actuator, u0)
    closed = close_loop(actuator, controller, t, np.full(t.size, rest + step), u0=u0)
    gain = secant_gain(actuator, np.array([rest, rest + step]))
    open_y = _held(actuator, np.full(t.size, u0 + step / gain), sample_time, u0)
    return StepAssessment(
        reduction=vibration_reduction(t, open_y, closed.y, decay_rate=_decay_rate(actuator)),
        open_y=open_y,
        closed=closed,
    )


def assess_square_wave(
    plant: Any, controller: Controller, *, low: float, high: float, period: float, sample_time: float, periods: int
) -> SquareWaveAssessment:
    """Let a loop follow a square wave, and measure its last period.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at no voltage before the first sample.
    controller : PID, or anything with its ``compiled``
        What closes the loop.
    low, high : float
        The wave's levels, the first half of each period at the low one [unit of y].
    period, sample_time : float
        Of the wave, an even number of samples, and of the controller [s].
    periods : int
        Number of periods, enough for the open loop to become periodic.

    Returns
    -------
    SquareWaveAssessment

    Raises
    ------
    SimulationError
        If the loop is lost.
    ValueError
        If high is not above low, a half period is not a whole number of samples, or the plant has no gain.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> pid = hs.PID(kp=9.0, ki=9.0)
    >>> wave = dict(low=0.0, high=1.0, period=4.0, sample_time=0.01, periods=5)
    >>> found = hs.control.assess_square_wave(lag, pid, **wave)
    >>> found.tracking_rms < 0.5 * found.open_tracking_rms
    True
    """
    actuator = as_actuator(plant)
    if not high > low:
        raise ValueError(f"high must be above low, got low {low} and high {high}")
    half = _whole("a half period", 0.5 * period, sample_time)
    reference = np.tile(np.repeat([low, high], half), periods)
    t = sample_time * np.arange(reference.size)
    gain = secant_gain(actuator, np.array([low, high]))
    closed = close_loop(actuator, controller, t, reference)
    open_y = _held(actuator, reference / gain, sample_time, 0.0)
    last, last_half = slice(-2 * half, None), slice(-half, None)
    step = None
    if half >= _FEWEST:
        halves = t[last_half], open_y[last_half], closed.y[last_half]
        found = vibration_reduction(*halves, decay_rate=_decay_rate(actuator))
        if half * sample_time >= found.open.t98 + 5.0 * _vibration_period(actuator):
            step = found
    return SquareWaveAssessment(
        open_tracking_rms=rmse(reference[last], open_y[last]),
        tracking_rms=rmse(reference[last], closed.y[last]),
        open_peak_excess_percent=_peak_excess(open_y[last], low, high),
        peak_excess_percent=_peak_excess(closed.y[last], low, high),
        reduction=step,
        open_y=open_y,
        closed=closed,
    )


def _whole(what: str, duration: float, sample_time: float) -> int:
    """Number of samples in a duration."""
    samples = round(duration / sample_time)
    if samples < 1 or abs(samples - duration / sample_time) > 1e-6 * samples:
        raise ValueError(f"{what} must be a whole number of samples, got {duration / sample_time:g}")
    return samples


def _width(reference: FloatArray, y: FloatArray) -> float:
    loop: LoopMetrics = loop_metrics(reference, y)
    return loop.max_width


def _held(actuator: Actuator, u: FloatArray, sample_time: float, u0: float) -> FloatArray:
    """Displacements just before each voltage, as a loop measures them, from rest at `u0`."""
    return RestingPlant(actuator, sample_time, u0).driven(u)


def _resting_displacement(actuator: Actuator, u0: float) -> float:
    return RestingPlant(actuator, 1.0, u0).y0


def _decay_rate(actuator: Actuator) -> float:
    """Damping ratio times natural frequency of the least damped mode; nan without a vibration."""
    return -_least_damped(actuator).real


def _vibration_period(actuator: Actuator) -> float:
    return 2.0 * math.pi / _least_damped(actuator).imag


def _least_damped(actuator: Actuator) -> complex:
    """The pole of the least damped mode; nan, and an infinite frequency, without one."""
    poles = np.empty(0) if actuator.vibration is None else actuator.vibration.poles
    modes = poles[poles.imag > 0.0]
    return complex(modes[np.argmin(-modes.real / np.abs(modes))]) if modes.size else complex(math.nan, math.inf)


def _peak_excess(y: FloatArray, low: float, high: float) -> float:
    return 100.0 * max(0.0, float(y.max()) - high, low - float(y.min())) / (high - low)
