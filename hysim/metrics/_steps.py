"""The measures of a response to a step, and of the vibration that a loop removes.

    eta(t) = (y - y0) / (yf - y0),    y0 the first sample, yf the mean of the last tenth of the samples

so that negative gains and creep need no special case. Of a plant in open and in closed loop:

    overshoot      100 (max eta - 1) %, at least 0
    settling time  after which |eta - 1| stays within 2 %
    t98            when eta first reaches 98 %
    residual       rms of eta - 1 from the open loop's t98, for 2 ln(50) / decay rate of its slowest vibration

and each reduction is 100 (1 - closed / open) %. Crossings are interpolated. A measure that does not exist is nan.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._cycles import ROUNDING
from hysim._frozen import FloatArray, frozen, vectors
from hysim._printing import printed, summary_text

SETTLED = 0.02
"""Distance from the final value within which a response has settled, as a fraction of the step."""


@frozen
class StepMetrics:
    """The measures of one response to a step; times count from the first sample.

    Parameters
    ----------
    initial, final : float
        First value, and mean of the last tenth [unit of y].
    rise_time : float
        Time from 10 to 90 % [unit of t].
    overshoot : float
        Largest excess over the final value [% of the step], at least 0.
    settling_time : float
        Time after which the response stays within 2 %; nan if it does not before the last tenth [unit of t].
    t98 : float
        Time at which 98 % is first reached [unit of t].
    """

    initial: float
    final: float
    rise_time: float
    overshoot: float
    settling_time: float
    t98: float


@printed
@frozen
class VibrationReduction:
    """The reduction of the vibration after a step by a loop, always three figures together.

    Parameters
    ----------
    overshoot_reduction_percent, residual_rms_reduction_percent, settling_time_reduction_percent : float
        100 (1 - closed / open) of each [%]; nan where the open loop has none.
    open, closed : StepMetrics
        The two responses.
    """

    overshoot_reduction_percent: float
    residual_rms_reduction_percent: float
    settling_time_reduction_percent: float
    open: StepMetrics
    closed: StepMetrics

    def __str__(self) -> str:
        return summary_text(
            [
                f"VibrationReduction: overshoot {self.overshoot_reduction_percent:.2f} %, residual rms "
                f"{self.residual_rms_reduction_percent:.2f} %, settling time "
                f"{self.settling_time_reduction_percent:.2f} %"
            ],
            {"open loop": _in_words(self.open), "closed loop": _in_words(self.closed)},
        )


def _in_words(response: StepMetrics) -> str:
    return (
        f"overshoot {response.overshoot:.2f} %, settled after {response.settling_time:.4g}, 98 % after "
        f"{response.t98:.4g}"
    )


def step_metrics(t: npt.ArrayLike, y: npt.ArrayLike) -> StepMetrics:
    """Measure a response to a step at the first sample.

    `t` and `y` are increasing times and outputs, shape (n,), long enough for the output to come to rest. All measures
    but the two levels are nan if the output ends where it began. A ValueError is raised if lengths differ, a value is
    not finite, or there are fewer than 10 samples.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> t = np.linspace(0.0, 20.0, 2001)
    >>> step = hs.metrics.step_metrics(t, 1.0 - np.exp(-t))
    >>> round(step.rise_time, 3), round(step.overshoot, 3), round(step.settling_time, 2)
    (2.197, 0.0, 3.91)
    """
    times, eta, initial, final = _normalised(t, y)
    excess = float(eta.max()) - 1.0 if np.isfinite(eta).all() else math.nan
    return StepMetrics(
        initial=initial,
        final=final,
        rise_time=_first_crossing(times, eta, 0.9) - _first_crossing(times, eta, 0.1),
        overshoot=0.0 if excess <= ROUNDING else 100.0 * excess,
        settling_time=_settling_time(times, eta),
        t98=_first_crossing(times, eta, 1.0 - SETTLED),
    )


def vibration_reduction(
    t: npt.ArrayLike, y_open: npt.ArrayLike, y_closed: npt.ArrayLike, *, decay_rate: float
) -> VibrationReduction:
    """Compare the responses of a plant in open and in closed loop to a step at the first sample.

    Parameters
    ----------
    t : array, shape (n,)
        Evenly spaced times [s].
    y_open, y_closed : array, shape (n,)
        Displacements.
    decay_rate : float
        Damping ratio times natural frequency of the open loop's least damped mode [1/s].

    Returns
    -------
    VibrationReduction
        The residual's figure is nan if the record ends before its window does.

    Raises
    ------
    ValueError
        As `step_metrics`.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> t = np.linspace(0.0, 40.0, 4001)
    >>> vibrating, calm = 1.0 - np.exp(-0.5 * t) * np.cos(5.0 * t), 1.0 - np.exp(-5.0 * t)
    >>> less = hs.metrics.vibration_reduction(t, vibrating, calm, decay_rate=0.5)
    >>> round(less.overshoot_reduction_percent), round(less.settling_time_reduction_percent)
    (100, 90)
    """
    opened, closed = step_metrics(t, y_open), step_metrics(t, y_closed)
    duration = 2.0 * math.log(1.0 / SETTLED) / decay_rate if decay_rate > 0.0 else math.nan
    residual_open, residual_closed = (_residual(t, y, opened.t98, duration) for y in (y_open, y_closed))
    return VibrationReduction(
        overshoot_reduction_percent=reduction_percent(opened.overshoot, closed.overshoot),
        residual_rms_reduction_percent=reduction_percent(residual_open, residual_closed),
        settling_time_reduction_percent=reduction_percent(opened.settling_time, closed.settling_time),
        open=opened,
        closed=closed,
    )


def reduction_percent(before: float, after: float) -> float:
    """100 (1 - after / before) %, of a measure in open and in closed loop; nan if `before` is not positive.

    Examples
    --------
    >>> reduction_percent(4.0, 1.0)
    75.0
    """
    return 100.0 * (1.0 - after / before) if before > 0.0 else math.nan


def _normalised(t: npt.ArrayLike, y: npt.ArrayLike) -> tuple[FloatArray, FloatArray, float, float]:
    times, outputs = vectors(t=t, y=y)
    if times.size < 10:
        raise ValueError(f"the response to a step needs at least 10 samples, got {times.size}")
    initial, final = float(outputs[0]), float(outputs[-(outputs.size // 10) :].mean())
    scale = final - initial
    eta = (outputs - initial) / scale if abs(scale) > ROUNDING * float(np.ptp(outputs)) else np.full(times.size, np.nan)
    return times - times[0], eta, initial, final


def _first_crossing(t: FloatArray, eta: FloatArray, level: float) -> float:
    above = eta >= level
    return _crossing(t, eta, int(np.argmax(above)), level) if above.any() else math.nan


def _settling_time(t: FloatArray, eta: FloatArray) -> float:
    last = int(np.flatnonzero(~(np.abs(eta - 1.0) <= SETTLED))[-1])  # the first sample at the latest, where eta is 0
    if last + 1 >= t.size - t.size // 10:
        return math.nan
    return _crossing(t, eta, last + 1, 1.0 + math.copysign(SETTLED, eta[last] - 1.0))


def _crossing(t: FloatArray, eta: FloatArray, k: int, level: float) -> float:
    """Time at which the line from sample k - 1 to sample k passes the level."""
    if k == 0:
        return float(t[0])
    return float(t[k - 1] + (t[k] - t[k - 1]) * (level - eta[k - 1]) / (eta[k] - eta[k - 1]))


def _residual(t: npt.ArrayLike, y: npt.ArrayLike, begin: float, duration: float) -> float:
    times, eta, _, _ = _normalised(t, y)
    if not begin + duration <= times[-1]:
        return math.nan
    window = (times >= begin) & (times <= begin + duration)
    return float(np.sqrt(np.mean((eta[window] - 1.0) ** 2)))
