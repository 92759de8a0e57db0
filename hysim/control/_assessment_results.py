"""Results of the assessments: what was measured, and the signals it was measured on."""

from hysim._frozen import FloatArray, frozen
from hysim._printing import extent, printed, summary_text
from hysim.control._loop import ClosedLoop
from hysim.control._loop_assessment import LoopAssessment
from hysim.control._tracking import is_fed_back
from hysim.metrics import LoopMetrics, VibrationReduction, loop_metrics, reduction_percent


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
        reference. The first is nan for a plant without a law, whose loop is lag; the second is nan with one. Both are
        nan if the loop is not stable.
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
    loop : LoopAssessment
        Stability, robustness, and share of limited samples.
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
    loop: LoopAssessment

    @property
    def is_lag(self) -> bool:
        """Whether the plant has no law, so that its loop is lag."""
        return self.closed.conditions["plant"].hysteresis is None

    def __str__(self) -> str:
        what = "lag" if self.is_lag else "hysteresis"
        reduction = self.lag_reduction_percent if self.is_lag else self.hysteresis_reduction_percent
        return summary_text(
            [f"HysteresisAssessment: {what} reduction {reduction:.2f} %, tracking rms {self.tracking_rms:.4g}"],
            {
                "not stable": self.loop.message,
                "open width": f"{self.open_width:.4g}, without the memory {self.open_lag_width:.4g}",
                f"{driven_by(self.closed)} width": f"{self.closed_width:.4g}, without the memory {self.lag_width:.4g}",
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
        The three figures, nan if the loop is not stable, and the measures of both responses.
    open_y, closed
        Displacement in open loop, shape (n,), where the voltage steps to its final value; and the closed loop.
    loop : LoopAssessment
        Stability, robustness, and share of limited samples.
    """

    reduction: VibrationReduction
    open_y: FloatArray
    closed: ClosedLoop
    loop: LoopAssessment

    def __str__(self) -> str:
        ends = f"from {self.closed.y[0]:.4g} to {self.closed.reference[-1]:.4g}"
        lines = [f"StepAssessment {ends}, voltage {extent(self.closed.u)}", f"  {self.reduction}"]
        return summary_text(lines, {"not stable": self.loop.message})


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
        The step's figures over the last half period, if it lasts the open loop's t98 and five of its periods, and the
        loop is stable.
    open_y, closed
        Displacement in open loop, shape (n,), and the closed loop.
    loop : LoopAssessment
        Stability, robustness, and share of limited samples.
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
        return summary_text(
            [
                f"SquareWaveAssessment: tracking rms {self.tracking_rms:.4g}, open loop {self.open_tracking_rms:.4g}",
                f"  peak excess {self.peak_excess_percent:.2f} %, open loop {self.open_peak_excess_percent:.2f} %",
                "" if self.reduction is None else f"  {self.reduction}",
            ],
            {"not stable": self.loop.message},
        )


def driven_by(run: ClosedLoop) -> str:
    """The drive of the plant in a word: "closed" for a loop with feedback, "inverse" for a controller without it."""
    return "closed" if is_fed_back(run.conditions["controller"]) else "inverse"
