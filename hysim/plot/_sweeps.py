"""Pictures of studies: sensitivities, maps over a grid, bands of quantiles, and one line for each task."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from hysim._frozen import FloatArray
from hysim.plot._style import MEASURED, POINTS, line, one
from hysim.sweeps import SobolIndices, Sweep

_BANDS = ((0.05, 0.95), (0.25, 0.75))
_COLOURS = "viridis"


def sensitivities(indices: SobolIndices, output: str, ax: Axes | None = None) -> Axes:
    """Draw the Sobol indices of an output, first order beside total, with their intervals.

    `indices` is a result of `hysim.sobol_indices`, and `output` the name of one of its outputs.

    Examples
    --------
    >>> import hysim as hs
    >>> sample = hs.Sample(distributions={"a": (0.0, 1.0), "b": (0.0, 1.0)}, n=64, method="saltelli")
    >>> indices = hs.sobol_indices(hs.sweep(lambda a, b: {"y": a + 2.0 * b}, sample))
    >>> hs.plot.sensitivities(indices, "y", ax=hs.plot.figure().add_subplot()).get_ylabel()
    'Share of the variance of y'
    """
    kinds = {
        "first order": (indices.first_order, indices.first_order_interval, POINTS),
        "total": (indices.total_order, indices.total_order_interval, MEASURED),
    }
    with one(ax) as axes:
        for k, (label, (values, intervals, colour)) in enumerate(kinds.items()):
            places = np.arange(len(indices.parameters)) + 0.3 * (k - 0.5)
            spread = np.abs(np.asarray(intervals[output]) - values[output])
            axes.errorbar(places, values[output], yerr=spread, fmt="o", color=colour, capsize=3.0, label=label)
        axes.set_xticks(range(len(indices.parameters)), indices.parameters)
        axes.set(ylabel=f"Share of the variance of {output}")
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        axes.legend()
    return axes


def heat_map(result: Sweep, x: str, y: str, output: str, ax: Axes | None = None) -> Axes:
    """Draw an output of a study over two parameters of its grid, as the median over all others.

    `x`, `y` and `output` are the names of the parameters and of the output. A ValueError is raised if the study
    `result` is not of a grid with these parameters.

    Examples
    --------
    >>> import hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a * b}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    >>> hs.plot.heat_map(result, "a", "b", "y", ax=hs.plot.figure().add_subplot()).get_xlabel()
    'a'
    """
    if result.axes is None or not {x, y} <= result.axes.keys() or x == y:
        raise ValueError(f"a heat map needs a grid with the parameters {x} and {y}")
    columns, rows = result.axes[x], result.axes[y]
    medians = [_median(result[output][(result[x] == across) & (result[y] == up)]) for up in rows for across in columns]
    table = np.reshape(medians, (len(rows), len(columns)))
    with one(ax) as axes:
        picture = axes.pcolormesh(range(table.shape[1]), range(table.shape[0]), table, cmap=_COLOURS, shading="nearest")
        for axis, name in ((axes.xaxis, x), (axes.yaxis, y)):
            values = result.axes[name]
            shown = range(0, len(values), max(1, len(values) // 6))
            axis.set_ticks(list(shown), [_short(values[k]) for k in shown])
        axes.set(xlabel=x, ylabel=y)
        axes.figure.colorbar(picture, ax=axes, label=output)
    return axes


def quantile_bands(result: Sweep, parameter: str, output: str, ax: Axes | None = None, *, slices: int = 20) -> Axes:
    """Draw the median of an output against a parameter, and the bands that hold half and nine tenths of the tasks.

    `parameter` and `output` are names in the study `result`. If the parameter has more values than `slices`, it is cut
    into as many slices with equally many tasks.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a + b}, {"a": np.linspace(0.0, 1.0, 9), "b": np.linspace(0.0, 0.1, 20)})
    >>> hs.plot.quantile_bands(result, "a", "y", ax=hs.plot.figure().add_subplot()).get_ylabel()
    'y'
    """
    finite = np.isfinite(result[output])
    x, y = np.asarray(result[parameter], dtype=float)[finite], result[output][finite]
    order = np.argsort(x, kind="stable")
    distinct = np.unique(x)
    if distinct.size <= slices:
        parts = [np.flatnonzero(x == value) for value in distinct]
    else:
        parts = np.array_split(order, slices)
    middles = [float(np.median(x[part])) for part in parts]
    with one(ax) as axes:
        for low, high in _BANDS:
            limits = [np.quantile(y[part], [low, high]) for part in parts]
            axes.fill_between(middles, *np.transpose(limits), alpha=0.25, linewidth=0.0, color=line(0)["color"])
        axes.plot(middles, [np.median(y[part]) for part in parts], label="median", **line(0))
        axes.set(xlabel=parameter, ylabel=output)
    return axes


def parallel_coordinates(result: Sweep, output: str, ax: Axes | None = None) -> Axes:
    """Draw one line for each task of a study across its parameters, scaled to their ranges, coloured by an output.

    `result` is a study, and `output` the name of one of its outputs.

    Examples
    --------
    >>> import hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a * b}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    >>> len(hs.plot.parallel_coordinates(result, "y", ax=hs.plot.figure().add_subplot()).lines)
    6
    """
    finite = np.flatnonzero(np.isfinite(result[output]))
    order = finite[np.argsort(result[output][finite], kind="stable")]
    names = [*result.parameters]
    heights = np.transpose([_scaled(result[name]) for name in names])
    colours = colormaps[_COLOURS](_scaled(result[output][order]))
    with one(ax) as axes:
        for task, colour in zip(order, colours, strict=True):
            axes.plot(range(len(names)), heights[task], color=colour, linewidth=0.6)
        axes.set_xticks(range(len(names)), names)
        axes.set(ylabel="Fraction of the range", title=f"from dark to light: {output}")
    return axes


def _median(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def _scaled(values: FloatArray) -> FloatArray:
    """Fractions of the range of numbers, or of the order of strings."""
    numbers = np.unique(values, return_inverse=True)[1] if values.dtype.kind == "U" else np.asarray(values, dtype=float)
    return np.asarray((numbers - numbers.min()) / (np.ptp(numbers) or 1.0))


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
