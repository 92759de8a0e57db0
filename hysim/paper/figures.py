"""The report's figures: the paper's Figures 3, 4 and 5 regenerated, and the models of Table 1 in pictures."""

from collections.abc import Mapping

import numpy as np

from hysim import plot
from hysim._frozen import FloatArray
from hysim.comparison import Comparison
from hysim.discovery import Discovery
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.records import Record

_MARK = "#B34700"


@plot.house_style()
def figure3(record: Record) -> plot.Figure:
    """Displacement and voltage against time."""
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
def figure5(responses: Mapping[str, tuple[FloatArray, FloatArray]]) -> plot.Figure:
    """Responses to a step of one volt, as times [s] and displacements [um] by name."""
    canvas = plot.figure(height=3.6)
    ax = plot.traces(responses, canvas.add_subplot(), units={"t": "s"})
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
    """What each number of terms buys."""
    canvas = plot.figure(height=4.4)
    plot.selection(discovery, plot.panels(canvas, 2))
    return canvas


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
