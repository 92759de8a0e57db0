"""The report's figures: the paper's, regenerated, and the models and loops in pictures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import plot
from hysim._basics.frozen import FloatArray
from hysim.comparison import Comparison
from hysim.datasets import PIXEL
from hysim.discovery import Discovery
from hysim.metrics import loop_metrics
from hysim.paper.camera import FRAME_RATES, PERIODS, CameraLoop
from hysim.paper.loops import PERIOD, Case, HysteresisCase, SquareCase, StepCase
from hysim.posterior import Evidence
from hysim.records import Record

_MARK = "#B34700"
_POINTS = 900  # of a line, at most
_SAMPLES = {"t": "samples", "y": "um"}
_SECONDS = {"t": "s", "y": "um"}


def input_and_output(record: Record) -> plot.Figure:
    """Displacement and voltage against time: the paper's Figures 3 and 9."""
    return _drawn(4.2, lambda canvas: plot.history(record, plot.panels(canvas, 2)))


@plot.house_style()
def figure4(record: Record) -> plot.Figure:
    """The hysteresis loop, its widest place marked."""
    canvas = plot.figure(height=4.4)
    ax = plot.loop(record, ax=canvas.add_subplot())
    loop = loop_metrics(record.u, record.y)
    k = int(np.argmin(np.abs(loop.u - loop.max_width_at)))
    lower, upper = (loop.u[k], loop.loading[k]), (loop.u[k], loop.unloading[k])
    ax.annotate("", xy=lower, xytext=upper, arrowprops={"arrowstyle": "<->", "color": _MARK, "linewidth": 1.2})
    text = f"widest: {loop.max_width:.3f} µm at {loop.max_width_at:g} V"
    ax.annotate(text, xy=lower, xytext=(6, -20), textcoords="offset points", color=_MARK)
    k = (2 * loop.u.size) // 3
    for name, branch, offset, side in (
        ("loading", loop.loading, (8, -14), "left"),
        ("unloading", loop.unloading, (-8, 8), "right"),
    ):
        ax.annotate(name, xy=(loop.u[k], branch[k]), xytext=offset, textcoords="offset points", ha=side)
    return canvas


def opening(comparison: Comparison) -> plot.Figure:
    """Table 1 with the printed linear model and the asymmetric Bouc-Wen law."""
    titles = {"eq1-printed": "equation (1), as printed", "bouc-wen-asymmetric": "Bouc-Wen, 7 parameters"}
    chosen = replace(comparison, rows=tuple(replace(comparison[key], name=title) for key, title in titles.items()))
    return _drawn(3.0, lambda canvas: plot.loops(chosen, plot.panels(canvas, 2, columns=2, sharey=True)), width=5.0)


@plot.house_style()
def step_responses(responses: Mapping[str, tuple[FloatArray, FloatArray]], time_unit: str) -> plot.Figure:
    """Responses to a step of one volt, as times and displacements [um] by name: the paper's Figures 5 and 10."""
    canvas = plot.figure(height=3.6)
    ax = plot.traces(responses, canvas.add_subplot(), units={"t": time_unit})
    ax.set_ylabel("Displacement per volt [µm/V]")
    return canvas


def model_loops(comparison: Comparison) -> plot.Figure:
    """Each model's loop over the measured points."""
    return _drawn(9.0, lambda canvas: plot.loops(comparison, _by_model(canvas, comparison)))


def model_residuals(comparison: Comparison) -> plot.Figure:
    """Each model's residuals in pixels."""
    return _drawn(9.0, lambda canvas: plot.residuals(comparison, _by_model(canvas, comparison), quanta="pixels"))


def model_widths(comparison: Comparison) -> plot.Figure:
    """Loop width against voltage, measured and modelled."""
    return _drawn(4.8, lambda canvas: plot.widths(comparison, canvas.add_subplot()))


def discovery_path(discovery: Discovery) -> plot.Figure:
    """The fit against the number of terms."""
    return _drawn(4.4, lambda canvas: plot.selection(discovery, plot.panels(canvas, 2)))


@plot.house_style()
def step_figure(case: StepCase, duration: float, *, seconds: bool) -> plot.Figure:
    """A step with and without control, and the voltage that it takes: the paper's Figures 12 and 14."""
    canvas = plot.figure(height=5.0)
    upper, lower = plot.panels(canvas, 2)
    closed, units = case.assessment.closed, _SECONDS if seconds else _SAMPLES
    shown = _thinned(closed.t <= duration)
    t = closed.t[shown]
    plot.traces({name: (t, y[shown]) for name, y in _outputs(case).items()}, upper, units=units)
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
        t = closed.t[shown] - begin
        plot.traces({name: (t, y[shown]) for name, y in _outputs(case).items()}, ax, units=_SAMPLES)
        ax.set_title(f"period {case.period:g} samples")
        ax.set_xlabel(ax.get_xlabel() if ax is axes[-1] else "")
    for ax in axes[1:]:
        _without_legend(ax)
    return canvas


@plot.house_style()
def hysteresis_figure(case: HysteresisCase) -> plot.Figure:
    """The triangle's last cycle: displacement, and its deviation, against the reference."""
    canvas = plot.figure(height=6.4)
    upper, lower = plot.panels(canvas, 2)
    closed = case.assessment.closed
    shown = _thinned(closed.t >= closed.t[-1] - PERIOD)
    reference, *outputs = (y[shown] for y in _outputs(case).values())
    for ax, origin in ((upper, 0.0), (lower, reference)):
        series = dict(zip(("with PID", "without"), ((reference, y - origin) for y in outputs), strict=True))
        plot.traces(series, ax)
    upper.set(xlabel="", ylabel="Displacement [µm]")
    lower.set(xlabel="Reference [µm]", ylabel="Displacement less reference [µm]")
    _without_legend(lower)
    return canvas


@plot.house_style()
def dwell_figure(rows: Sequence[Mapping[str, float]]) -> plot.Figure:
    """Largest loop width against dwell."""
    canvas = plot.figure(height=4.0)
    names = ("(1)", "(1), read at the start", "Bouc-Wen", "Bouc-Wen and (7)")
    dwells, *widths = np.array([list(row.values()) for row in rows]).T
    ax = plot.traces(dict(zip(names, ((dwells, each) for each in widths), strict=True)), canvas.add_subplot())
    _log_axis(ax, dwells)
    ax.set(xlabel="Dwell [s]", ylabel="Largest loop width [µm]")
    return canvas


@plot.house_style()
def camera_figure(cameras: Sequence[CameraLoop]) -> plot.Figure:
    """True reduction against the frame rate, a curve for each sensor; the hysteresis above, the vibration below."""
    canvas = plot.figure(height=6.4)
    panels = plot.panels(canvas, 2)
    for ax, (plant, target, name) in zip(
        panels, (("bouc-wen+eq7", 90.0, "Hysteresis"), ("eq4", 97.0, "Vibration")), strict=True
    ):
        series: dict[str, list[float]] = {}
        for each in (each for each in cameras if each.plant == plant):
            reduction = float(np.nan_to_num(max(each.true_reduction_percent, 0.0)))
            series.setdefault(f"{each.quantum / PIXEL:g} px, shake {each.shake:g}", []).append(reduction)
        plot.traces({key: (np.array(FRAME_RATES), np.array(values)) for key, values in series.items()}, ax)
        ax.axhline(target, color=_MARK, linestyle="--", linewidth=1.0)
        _log_axis(ax, FRAME_RATES)
        ax.set(ylim=(0.0, 102.0), xlabel="Frames a second", ylabel=f"{name}: reduction [%]")
    _without_legend(panels[1])
    return canvas


@plot.house_style()
def periods_figure(rows: Sequence[Mapping[str, float]]) -> plot.Figure:
    """Reduction against the period of the triangle, a curve for each controller; the first one is that of 10 ms."""
    canvas = plot.figure(height=3.8)
    ax = canvas.add_subplot()
    curves = np.reshape([row["reduction_percent"] for row in rows], (-1, len(PERIODS)))
    names = [f"camera of {1.0 / row['sample_time_s']:g} Hz" for row in rows[:: len(PERIODS)]]
    plot.traces(dict(zip(["10 ms", *names[1:]], ((np.array(PERIODS), each) for each in curves), strict=True)), ax)
    ax.axhline(90.0, color=_MARK, linestyle="--", linewidth=1.0)
    _log_axis(ax, PERIODS)
    ax.set(xlabel="Period of the triangle [s]", ylabel="Reduction [%]")
    return canvas


def evidence_figure(evidence: Evidence) -> plot.Figure:
    """ln of the evidence of each model, for each size of the boxes."""
    return _drawn(1.3 + 0.34 * len(evidence.rows), lambda canvas: plot.evidence(evidence, canvas.add_subplot()))


@plot.house_style()
def _drawn(height: float, draw: Callable[[plot.Figure], Any], *, width: float = 6.0) -> plot.Figure:
    canvas = plot.figure(width, height)
    draw(canvas)
    return canvas


def _by_model(canvas: plot.Figure, comparison: Comparison) -> npt.NDArray[np.object_]:
    return plot.panels(canvas, len(comparison.rows), columns=2, sharey=True)


def _outputs(case: Case[Any]) -> dict[str, FloatArray]:
    closed = case.assessment.closed
    return {"reference": closed.reference, "with PID": closed.y, "without": case.assessment.open_y}


def _log_axis(ax: plot.Axes, ticks: Sequence[float] | FloatArray) -> None:
    ax.set_xscale("log")
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()


def _without_legend(ax: plot.Axes) -> None:
    if legend := ax.get_legend():
        legend.remove()


def _thinned(shown: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Indices of some of the samples shown, the last one among them."""
    (indices,) = np.nonzero(shown)
    return indices[:: max(1, indices.size // _POINTS)]
