"""Measures of a response to a step and to a sine.

**Step.** The response, and the vibration that a loop removes:

    eta(t) = (y - y0) / (yf - y0),    y0 the first sample, yf the mean of the last tenth of the samples

so that negative gains and creep need no special case. Of a plant in open and in closed loop:

    overshoot      100 (max eta - 1) %, at least 0
    settling time  after which |eta - 1| stays within 2 %
    t98            when eta first reaches 98 %
    residual       rms of eta - 1 from the open loop's t98, for 2 ln(50) / decay rate of its slowest vibration

and each reduction is 100 (1 - closed / open) %. Crossings are interpolated. A measure that does not exist is nan.

**Sine.** The describing function of a law is the first harmonic of its steady cycle under a sine:

    u = mean + a sin(phi)
    y = y_0 + a (Re N sin(phi) + Im N cos(phi)) + harmonics
    N(a) = 1 / (pi a) times the integral of y (sin(phi) + i cos(phi)) d phi over a cycle
    Im N = -(signed area) / (pi a^2),    negative for a counterclockwise loop

A rate-independent law needs only the extremes of the input, two samples a cycle, to come to its steady cycle. The
integral is a mean over n samples: its error is of the order 1 / n where the loop jumps between two of them, 1 / n^2
where it has a kink, and smaller where it is smooth. The area is that of the polygon through the samples, which
`loop_metrics` measures, times (2 pi / n) / sin(2 pi / n). Source: A. Gelb and W. E. Vander Velde, Multiple-Input
Describing Functions and Nonlinear System Design, 1968.
"""

import math
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, frozen, read_only, vectors
from hysim._basics.printing import frozen_result, summary_text
from hysim._basics.results import model_of
from hysim._columns.turning import ROUNDING
from hysim.errors import SimulationError

_BATCHES = tuple(2**k for k in range(4, 18))  # cycles of each of the successive runs
_SLOW = 1e-6  # of the output's span: largest change during half of the last run


@runtime_checkable
class _Stepped(Protocol):
    """A law that can be cut and continued."""

    def advance(self, u: Any, state: Any = None) -> Any: ...


@runtime_checkable
class _Dynamic(Protocol):
    dynamic: bool


def describing_function(
    law: Any, amplitudes: npt.ArrayLike, *, mean: float = 0.0, samples_per_cycle: int = 2000
) -> npt.NDArray[np.complex128]:
    """First harmonic of a law's steady cycle under ``u = mean + a sin(phi)``, over the sine.

    The gain is ``abs(N)``, the phase ``np.angle(N)`` [rad], negative where the output lags. The law begins with its
    memory at `mean`, and cycles until its output repeats, to 1e-12 of its span or, after 262 128 cycles, 1e-6.

    Parameters
    ----------
    law : model or result of a fit
        A rate-independent law, such as `hysim.BoucWen`.
    amplitudes : array, shape (n,)
        Positive amplitudes a of the input [unit of u].
    mean : float
        Input in the middle of the cycle [unit of u].
    samples_per_cycle : int
        Even number of samples of the cycle.

    Returns
    -------
    array of complex, shape (n,) [unit of y / unit of u]

    Raises
    ------
    TypeError, ValueError, SimulationError
        If the law has no `advance` or depends on time; if an amplitude is not positive, a number is not finite, or
        `samples_per_cycle` is odd or below 4; if the output does not repeat, or diverges.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.metrics.describing_function(hs.Play(threshold=1.0), [1.0, 2.0, 1e3]).round(3).tolist()
    [0j, (0.5-0.318j), (1-0.001j)]
    """
    law = model_of(law)
    if not isinstance(law, _Stepped) or (isinstance(law, _Dynamic) and law.dynamic):
        needed = f"a describing function of the amplitude alone needs a law without time, got {type(law).__name__}"
        raise TypeError(f"{needed}; for a transfer function see hysim.to_control")
    swings = read_only(amplitudes, "amplitudes", ndim=1)
    if not (swings > 0.0).all() or not math.isfinite(mean):
        raise ValueError(f"amplitudes must be positive, and the mean finite, got {swings.tolist()} and {mean}")
    if samples_per_cycle < 4 or samples_per_cycle % 2:
        raise ValueError(f"samples_per_cycle must be even, and at least 4, got {samples_per_cycle}")
    turn = np.exp(1j * np.pi * np.arange(samples_per_cycle // 2 + 1) / (samples_per_cycle // 2))
    turn = np.append(turn, turn[-2:0:-1].conj())  # from the lowest input, phi = -pi / 2, up and back
    rise = -turn.real
    harmonic = rise + 1j * turn.imag
    values = [2.0 * np.mean(_steady_cycle(law, mean + a * rise, float(a), mean) * harmonic) / a for a in swings]
    return np.array(values, dtype=complex)


def _steady_cycle(law: Any, u: FloatArray, amplitude: float, mean: float) -> FloatArray:
    """The law's output at the inputs of a cycle from the lowest one on, once it repeats."""
    extremes = [mean + amplitude, mean - amplitude]
    _, state = law.advance([mean])
    for cycles in _BATCHES:
        y, state = law.advance(extremes * cycles, state)
        ends = np.reshape(y, (cycles, 2))
        change, span = np.abs(ends[-1] - ends[cycles // 2]).max(), abs(ends[-1, 0] - ends[-1, 1])
        if change <= ROUNDING * span + 4.0 * np.spacing(np.abs(ends[-1]).max()):
            break
    else:
        if change > _SLOW * span:
            raise SimulationError(f"the output does not repeat after {sum(_BATCHES)} cycles of amplitude {amplitude:g}")
    return np.asarray(law.advance(u, state)[0])


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
        Largest excess over the final value [% of the step], at least 0; 0 for a response that still rises at its end.
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


_REDUCED = ("overshoot", "residual_rms", "settling_time")


@frozen_result
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
        figures = {name.replace("_", " "): vars(self)[f"{name}_reduction_percent"] for name in _REDUCED}
        words = (f"{name} {'undefined' if math.isnan(each) else f'{each:.2f} %'}" for name, each in figures.items())
        rows = {"open loop": _in_words(self.open), "closed loop": _in_words(self.closed)}
        return summary_text([f"VibrationReduction: {', '.join(words)}"], rows)


def _in_words(response: StepMetrics) -> str:
    times = f"settled after {response.settling_time:.4g}, 98 % after {response.t98:.4g}"
    return f"overshoot {response.overshoot:.2f} %, {times}"


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
    is_rising = bool(eta.argmax() == eta.size - 1)  # to the end: above the mean of the last tenth, and of no return
    return StepMetrics(
        initial=initial,
        final=final,
        rise_time=_first_crossing(times, eta, 0.9) - _first_crossing(times, eta, 0.1),
        overshoot=0.0 if excess <= ROUNDING or is_rising else 100.0 * excess,
        settling_time=_settling_time(times, eta),
        t98=_first_crossing(times, eta, 1.0 - SETTLED),
    )


def vibration_reduction(
    t: npt.ArrayLike, y_open: npt.ArrayLike, y_closed: npt.ArrayLike, *, decay_rate: float
) -> VibrationReduction:
    """Compare the responses of a plant in open and in closed loop to a step at the first sample.

    `t` (n,) are evenly spaced times [s], `y_open` and `y_closed` (n,) the displacements, and `decay_rate` is the
    damping ratio times the natural frequency of the open loop's least damped mode [1/s]. The residual's figure is nan
    if the record ends before its window does. Errors are those of `step_metrics`.

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
    times = opened.settling_time, closed.settling_time
    pairs = (opened.overshoot, closed.overshoot), (residual_open, residual_closed), times
    reductions = zip(_REDUCED, (reduction_percent(*pair) for pair in pairs), strict=True)
    figures = {f"{name}_reduction_percent": percent for name, percent in reductions}
    return VibrationReduction(**figures, open=opened, closed=closed)


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
    if not (np.diff(times) > 0.0).all():
        k = int(np.argmax(np.diff(times) <= 0.0))
        raise ValueError(f"t must increase from sample to sample, got {times[k + 1]:g} after {times[k]:g}")
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
