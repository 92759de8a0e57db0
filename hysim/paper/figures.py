"""The report's figures: the paper's, regenerated, and the models and loops in pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hysim import plot
from hysim._frozen import FloatArray
from hysim.comparison import Comparison
from hysim.datasets import PIXEL
from hysim.discovery import Discovery
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.paper.camera import CameraLoop
from hysim.paper.dwell import DwellWidth
from hysim.paper.loops import PERIOD, HysteresisCase, SquareCase, StepCase
from hysim.paper.periods import PERIODS, PeriodCurve
from hysim.posterior import Evidence
from hysim.records import Record

_MARK = "#B34700"
_POINTS = 900  # of a line, at most
_SAMPLES = {"t": "samples", "y": "um"}
_SECONDS = {"t": "s", "y": "um"}


@plot.house_style()
def input_and_output(record: Record) -> plot.Figure:
    """Displacement and voltage against time: the paper's Figures 3 and 9."""
    canvas = plot.figure(height=4.2)
    plot.history(record, plot.panels(canvas, 2))
    return canvas


@plot.house_style()
def figure4(record: Record) -> plot.Figure:
    """The hysteresis loop, its widest place marked."""
    canvas = plot.figure(height=4.4)
    ax = plot.loop(record, ax=canvas.add_subplot())
    measured = loop_metrics(record.u, record.y)
    _mark_widest(ax, measured)
    _name_branches(ax, measured)
    return canvas


@plot.house_style()
def opening(comparison: Comparison) -> plot.Figure:
    """Table 1 with the printed linear model and the asymmetric Bouc-Wen law."""
    canvas = plot.figure(height=3.6)
    chosen = replace(comparison, rows=tuple(comparison[name] for name in ("eq1-printed", "bouc-wen-asymmetric")))
    plot.loops(chosen, plot.panels(canvas, 2, columns=2, sharey=True))
    return canvas


@plot.house_style()
def step_responses(responses: Mapping[str, tuple[FloatArray, FloatArray]], time_unit: str) -> plot.Figure:
    """Responses to a step of one volt, as times and displacements [um] by name: the paper's Figures 5 and 10."""
    canvas = plot.figure(height=3.6)
    ax = plot.traces(responses, canvas.add_subplot(), units={"t": time_unit})
    ax.set_ylabel("Displacement per volt [µm/V]")
    return canvas


@plot.house_style()
def model_loops(comparison: Comparison) -> plot.Figure:
    """Each model's loop over the measured points."""
    canvas = plot.figure(height=9.0)
    plot.loops(comparison, plot.panels(canvas, len(comparison.rows), columns=2, sharey=True))
    return canvas


@plot.house_style()
def model_residuals(comparison: Comparison) -> plot.Figure:
    """Each model's residuals in pixels."""
    canvas = plot.figure(height=9.0)
    plot.residuals(comparison, plot.panels(canvas, len(comparison.rows), columns=2, sharey=True), quanta="pixels")
    return canvas


@plot.house_style()
def model_widths(comparison: Comparison) -> plot.Figure:
    """Loop width against voltage, measured and modelled."""
    canvas = plot.figure(height=4.8)
    plot.widths(comparison, canvas.add_subplot())
    return canvas


@plot.house_style()
def discovery_path(discovery: Discovery) -> plot.Figure:
    """The fit against the number of terms."""
    canvas = plot.figure(height=4.4)
    plot.selection(discovery, plot.panels(canvas, 2))
    return canvas


@plot.house_style()
def step_figure(case: StepCase, duration: float, *, seconds: bool) -> plot.Figure:
    """A step with and without control, and the voltage that it takes: the paper's Figures 12 and 14."""
    canvas = plot.figure(height=5.0)
    upper, lower = plot.panels(canvas, 2)
    closed, units = case.assessment.closed, _SECONDS if seconds else _SAMPLES
    shown = _thinned(closed.t <= duration)
    t = closed.t[shown]
    series = {
        "reference": closed.reference,
        "with PID": closed.y,
        "without": case.assessment.open_y,
    }
    plot.traces({name: (t, y[shown]) for name, y in series.items()}, upper, units=units)
    plot.traces({"voltage": (t, closed.u[shown])}, lower, units={**units, "y": "V"})
    return canvas


@plot.house_style()
def figure13(cases: Sequence[SquareCase]) -> plot.Figure:
    """The last two periods of the square waves, one over the other."""
    canvas = plot.figure(height=2.4 * len(cases))
    axes = [canvas.add_subplot(len(cases), 1, k + 1) for k in range(len(cases))]
    for ax, case in zip(axes, cases, strict=True):
        closed = case.assessment.closed
        begin = closed.t[-1] - 2.0 * (case.period or 0.0)
        shown = _thinned(closed.t >= begin)
        series = {"reference": closed.reference, "with PID": closed.y, "without": case.assessment.open_y}
        plot.traces({name: (closed.t[shown] - begin, y[shown]) for name, y in series.items()}, ax, units=_SAMPLES)
        ax.set_title(f"period {case.period:g} samples")
        ax.set_xlabel(ax.get_xlabel() if ax is axes[-1] else "")
        if ax is not axes[0] and (legend := ax.get_legend()):
            legend.remove()
    return canvas


@plot.house_style()
def hysteresis_figure(case: HysteresisCase) -> plot.Figure:
    """The triangle's last cycle: displacement, and its deviation, against the reference."""
    canvas = plot.figure(height=6.4)
    upper, lower = plot.panels(canvas, 2)
    closed = case.assessment.closed
    shown = _thinned(closed.t >= closed.t[-1] - PERIOD)
    reference = closed.reference[shown]
    outputs = {"with PID": closed.y[shown], "without": case.assessment.open_y[shown]}
    plot.traces({name: (reference, y) for name, y in outputs.items()}, upper)
    plot.traces({name: (reference, y - reference) for name, y in outputs.items()}, lower)
    upper.set(xlabel="", ylabel="Displacement [µm]")
    lower.set(xlabel="Reference [µm]", ylabel="Displacement less reference [µm]")
    lower.legend().remove()
    return canvas


@plot.house_style()
def dwell_figure(widths: Sequence[DwellWidth]) -> plot.Figure:
    """Largest loop width against dwell."""
    canvas = plot.figure(height=4.0)
    dwells = np.array([width.dwell for width in widths])
    series = {
        "(1)": [width.linear for width in widths],
        "(1), read at the start": [width.linear_at_start for width in widths],
        "Bouc-Wen": [width.law for width in widths],
        "Bouc-Wen and (7)": [width.law_and_dynamics for width in widths],
    }
    ax = plot.traces({name: (dwells, np.array(values)) for name, values in series.items()}, canvas.add_subplot())
    ax.set(xscale="log", xlabel="Dwell [s]", ylabel="Largest loop width [µm]", xticks=dwells)
    ax.set_xticks(dwells, [f"{dwell:g}" for dwell in dwells])
    ax.minorticks_off()
    return canvas


@plot.house_style()
def camera_figure(cameras: Sequence[CameraLoop]) -> plot.Figure:
    """True reduction against the frame rate, a curve for each sensor; the hysteresis above, the vibration below."""
    canvas = plot.figure(height=6.4)
    for ax, (plant, target, name) in zip(
        plot.panels(canvas, 2),
        (("bouc-wen+eq7", 90.0, "Hysteresis"), ("eq4", 97.0, "Vibration")),
        strict=True,
    ):
        series: dict[str, tuple[list[float], list[float]]] = {}
        for each in (each for each in cameras if each.plant == plant):
            rates, values = series.setdefault(f"{each.quantum / PIXEL:g} px, shake {each.shake:g}", ([], []))
            rates.append(each.frame_rate)
            values.append(float(np.nan_to_num(max(each.true_reduction_percent, 0.0))))
        plot.traces({key: (np.array(x), np.array(y)) for key, (x, y) in series.items()}, ax)
        ax.axhline(target, color=_MARK, linestyle="--", linewidth=1.0)
        rates = [each.frame_rate for each in cameras if each.plant == plant]
        ax.set(xscale="log", ylim=(0.0, 102.0), xlabel="Frames a second", ylabel=f"{name}: reduction [%]")
        ax.set_xticks(sorted(set(rates)), [f"{rate:g}" for rate in sorted(set(rates))])
        ax.minorticks_off()
        if plant == "eq4" and (legend := ax.get_legend()):
            legend.remove()
    return canvas


@plot.house_style()
def periods_figure(curves: Sequence[PeriodCurve]) -> plot.Figure:
    """Reduction against the period of the triangle, a curve for each controller."""
    canvas = plot.figure(height=3.8)
    ax = canvas.add_subplot()
    names = ["10 ms", *(f"camera of {1.0 / curve.sample_time:g} Hz" for curve in curves[1:])]
    series = {name: (np.array(PERIODS), np.array(curve.reductions)) for name, curve in zip(names, curves, strict=True)}
    plot.traces(series, ax)
    ax.axhline(90.0, color=_MARK, linestyle="--", linewidth=1.0)
    ax.set(xscale="log", xlabel="Period of the triangle [s]", ylabel="Reduction [%]")
    ax.set_xticks(PERIODS, [f"{period:g}" for period in PERIODS])
    ax.minorticks_off()
    return canvas


@plot.house_style()
def evidence_figure(found: Evidence) -> plot.Figure:
    """ln of the evidence of each model, for each size of the boxes."""
    canvas = plot.figure(height=1.3 + 0.34 * len(found.rows))
    plot.evidence(found, canvas.add_subplot())
    return canvas


def _thinned(shown: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Indices of some of the samples shown, the last one among them."""
    (indices,) = np.nonzero(shown)
    return indices[:: max(1, indices.size // _POINTS)]


def _mark_widest(ax: plot.Axes, loop: LoopMetrics) -> None:
    k = int(np.argmin(np.abs(loop.u - loop.max_width_at)))
    lower, upper = (loop.u[k], loop.loading[k]), (loop.u[k], loop.unloading[k])
    ax.annotate("", xy=lower, xytext=upper, arrowprops={"arrowstyle": "<->", "color": _MARK, "linewidth": 1.2})
    text = f"widest: {loop.max_width:.3f} µm at {loop.max_width_at:g} V"
    ax.annotate(text, xy=lower, xytext=(6, -20), textcoords="offset points", color=_MARK)


def _name_branches(ax: plot.Axes, loop: LoopMetrics) -> None:
    k = (2 * loop.u.size) // 3
    for name, branch, offset, side in (
        ("loading", loop.loading, (8, -14), "left"),
        ("unloading", loop.unloading, (-8, 8), "right"),
    ):
        ax.annotate(name, xy=(loop.u[k], branch[k]), xytext=offset, textcoords="offset points", ha=side)
