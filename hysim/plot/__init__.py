"""Pictures of results: functions of a result and, if wanted, of the Axes to draw on.

Each returns the Axes it drew on, or an array of them, and shows nothing; `animate` returns the animation. On given
Axes a picture takes their look and pyplot is not imported; without them it is a new pyplot figure in the house style.
Nothing here changes matplotlib's settings outside its own calls.
"""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hysim.plot._comparisons import comparison, loops, residuals, widths
from hysim.plot._discoveries import selection
from hysim.plot._frames import displacement
from hysim.plot._harmonics import describing_function
from hysim.plot._identifications import identification
from hysim.plot._loops import animate, minor_loops, width
from hysim.plot._maps import forc, residual_map
from hysim.plot._pictures import FORMATS, to_bytes
from hysim.plot._records import history, loop, response, traces
from hysim.plot._style import DIVERGING, SEQUENTIAL, figure, house_style, panels
from hysim.plot._svg import save_svg, to_svg
from hysim.plot._sweeps import heat_map, parallel_coordinates, quantile_bands, sensitivities
from hysim.plot._tunings import trade_off

__all__ = [
    "DIVERGING",
    "FORMATS",
    "SEQUENTIAL",
    "Axes",
    "Figure",
    "animate",
    "comparison",
    "describing_function",
    "displacement",
    "figure",
    "forc",
    "heat_map",
    "history",
    "house_style",
    "identification",
    "loop",
    "loops",
    "minor_loops",
    "panels",
    "parallel_coordinates",
    "quantile_bands",
    "residual_map",
    "residuals",
    "response",
    "save_svg",
    "selection",
    "sensitivities",
    "to_bytes",
    "to_svg",
    "traces",
    "trade_off",
    "width",
    "widths",
]
