"""The report's figures: the paper's Figures 3, 4 and 5 regenerated, and the models of Table 1 in pictures."""

from collections.abc import Mapping

from hysim import plot
from hysim._frozen import FloatArray
from hysim.comparison import Comparison
from hysim.discovery import Discovery
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.records import Record


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
    _mark_widest(ax, loop_metrics(record.u, record.y))
    return canvas


@plot.house_style()
def figure5(responses: Mapping[str, tuple[FloatArray, FloatArray]]) -> plot.Figure:
    """Responses to a step of one volt, as times [s] and displacements [um] by name."""
    canvas = plot.figure(height=3.6)
    plot.traces(responses, canvas.add_subplot(), units={"t": "s", "y": "um"})
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
    plot.residuals(comparison, plot.panels(canvas, len(comparison.rows), columns=2, sharey=True))
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
    u = loop.max_width_at
    k = int(abs(loop.u - u).argmin())
    ends = (loop.loading[k], loop.unloading[k])
    ax.annotate("", xy=(u, ends[0]), xytext=(u, ends[1]), arrowprops={"arrowstyle": "<->", "color": "#D55E00"})
    ax.annotate(f"widest: {loop.max_width:.3f} µm at {u:g} V", xy=(u, ends[1]), xytext=(-8, 14), textcoords="offset points", ha="right", color="#D55E00")
