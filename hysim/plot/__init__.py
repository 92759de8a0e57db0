"""Pictures of results: functions of a result and, optionally, of the Axes to draw on.

All functions take `ax`, or `axes` for several: the Axes to draw on, which keep their look. Without them a picture is a
new pyplot figure in the house style; too few Axes are a ValueError. They return the Axes, or an array of them;
`animate` returns the animation. Nothing is shown, and matplotlib's settings outside the calls are not changed.
"""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hysim.plot._comparisons import comparison, core_error, identification, loops, loss_map, residuals, widths
from hysim.plot._loops import animate, cycles, minor_loops, width
from hysim.plot._outcomes import describing_function, displacement, fragility, parameter, selection, track, trade_off
from hysim.plot._posterior import corner, evidence, prediction
from hysim.plot._records import element_loops, history, loop, response, signals, spectrum, traces
from hysim.plot._style import DIVERGING, FORMATS, SEQUENTIAL, figure, house_style, panels, save_svg, to_bytes, to_svg
from hysim.plot._sweeps import forc, heat_map, ida, parallel_coordinates, quantile_bands, residual_map, sensitivities

__all__ = [
    "DIVERGING", "FORMATS", "SEQUENTIAL", "Axes", "Figure", "animate", "comparison", "core_error", "corner",
    "cycles", "describing_function", "displacement", "element_loops", "evidence", "figure", "forc", "fragility",
    "heat_map", "history", "house_style", "ida", "identification", "loop", "loops", "loss_map", "minor_loops",
    "panels", "parallel_coordinates", "parameter", "prediction", "quantile_bands", "residual_map", "residuals",
    "response", "save_svg", "selection", "sensitivities", "signals", "spectrum", "to_bytes", "to_svg", "traces",
    "track", "trade_off", "width", "widths",
]  # fmt: skip
