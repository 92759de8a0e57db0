"""Pictures of a comparison: each model's loop, its residuals and its loop width, on one record."""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hysim._frozen import FloatArray
from hysim.comparison import Comparison, ComparisonRow
from hysim.plot._style import GUIDE, MEASURED, POINTS, AxesArray, in_unit, label, line, one, printed, several

_FILLED: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.8, "markeredgewidth": 0.8}
_TIGHT: dict[str, Any] = {"borderaxespad": 0.1, "columnspacing": 1.0, "handlelength": 1.2, "handletextpad": 0.3}
_SHOWN = 4  # models in a figure, where none are named
_OPEN = _FILLED | {"markerfacecolor": "white"}


def loops(comparison: Comparison, axes: Sequence[Axes] | AxesArray | None = None) -> AxesArray:
    """Draw each model's loop over the measured points, a panel a model, with its fit and its largest width.

    Parameters
    ----------
    comparison : Comparison
        The models on one record.
    axes : Axes, one for each model, optional
        Where to draw.

    Returns
    -------
    array of Axes, shape (n_models,)

    Raises
    ------
    ValueError
        If there are fewer Axes than models.

    Examples
    --------
    >>> import hysim as hs
    >>> tab = hs.compare({"law": hs.BoucWen(gain=0.02)}, hs.datasets.table1())
    >>> [ax.get_title(loc="left").split("\\n")[0] for ax in hs.plot.loops(tab, [hs.plot.figure().add_subplot()])]
    ['law']
    """
    with _panels(axes, comparison) as panels:
        for ax, row in zip(panels, comparison.rows, strict=True):
            _draw_loop(ax, comparison, row)
            _entitle(ax, row, f"width {_in_unit(row.max_width, comparison)}")
        panels[0].legend(loc="lower right")
    return panels


def residuals(
    comparison: Comparison, axes: Sequence[Axes] | AxesArray | None = None, *, quanta: str = "quanta"
) -> AxesArray:
    """Draw measured minus model against the input, a panel a model: loading filled, unloading open.

    Residuals are counted in quanta of the sensor, with lines at half a quantum (what rounding alone leaves)
    and at one; where the record has no resolution, they are in the unit of y and the lines are left out.

    Parameters
    ----------
    comparison : Comparison
        The models on one record.
    axes : Axes, one for each model, optional
        Where to draw.
    quanta : str
        What the sensor's quanta are called, for instance ``"pixels"``.

    Returns
    -------
    array of Axes, shape (n_models,)

    Raises
    ------
    ValueError
        If there are fewer Axes than models.
    """
    quantum, unit = _quantum(comparison, quanta)
    with _panels(axes, comparison) as panels:
        for ax, row in zip(panels, comparison.rows, strict=True):
            _draw_residual(ax, comparison, row, quanta)
            _entitle(ax, row, f"largest {row.max_residual / quantum:.2f} {unit}")
        panels[0].legend(loc="lower center", ncols=2, borderaxespad=0.0, columnspacing=1.0, handletextpad=0.2)
    return panels


def widths(comparison: Comparison, ax: Axes | None = None) -> Axes:
    """Draw the signed loop width, unloading minus loading, against the input: measured as points, models as lines.

    Parameters
    ----------
    comparison : Comparison
        The models on one record.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    with one(ax, height=4.8) as axes:
        _draw_width(axes, comparison)
        for k, row in enumerate(comparison.rows):
            axes.plot(row.loop.u, row.loop.width, label=row.name, **line(k))
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return axes


def comparison(
    comparison: Comparison,
    names: Sequence[str] | None = None,
    axes: Sequence[Axes] | AxesArray | None = None,
    *,
    quanta: str = "quanta",
) -> AxesArray:
    """Draw the best models side by side: a row a model, with its loop, its residuals and its loop width.

    Measured points are grey or dark and the model is a line, loading residuals are filled and unloading ones open, so
    that nothing rests on colour alone.

    Parameters
    ----------
    comparison : Comparison
        The models on one record.
    names : sequence of str, optional
        Which models, in this order; by default the four with the least cross-validated rmse, or the first four.
    axes : Axes, three for each model, optional
        Where to draw, row by row.
    quanta : str
        What the sensor's quanta are called, for instance ``"pixels"``.

    Returns
    -------
    array of Axes, shape (n_models, 3)

    Raises
    ------
    ValueError
        If there is nothing to draw, or too few Axes.
    KeyError
        If there is no model of a name.

    Examples
    --------
    >>> import hysim as hs
    >>> tab = hs.compare({"curve": hs.SingleValued, "line": hs.Line}, hs.datasets.table1())
    >>> with hs.plot.house_style():
    ...     hs.plot.comparison(tab, axes=hs.plot.figure().subplots(2, 3)).shape
    (2, 3)
    """
    rows = [comparison[name] for name in names] if names is not None else _best(comparison)
    if not rows:
        raise ValueError("there is no model to draw")
    with several(axes, 3 * len(rows), height=1.9, columns=3) as panels:
        grid: AxesArray = panels.reshape(len(rows), 3)
        for row, (loop, residual, width) in zip(rows, grid, strict=True):
            _draw_loop(loop, comparison, row)
            _draw_residual(residual, comparison, row, quanta)
            _draw_width(width, comparison)
            width.plot(row.loop.u, row.loop.width, label="model", **line(0))
            loop.set_title(f"{row.name}: fit {row.fit_percent:.1f} %", loc="left", fontsize="medium")
        for column in grid.T[1:]:
            _same_height(column)
            column[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small", **_TIGHT)
    return grid


def _best(comparison: Comparison) -> Sequence[ComparisonRow]:
    return (comparison.ranked() or comparison.rows)[:_SHOWN]


def _same_height(column: AxesArray) -> None:
    """Give Axes one range, so that their heights compare."""
    ends = [ax.get_ylim() for ax in column]
    for ax in column:
        ax.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))


def _draw_loop(ax: Axes, comparison: Comparison, row: ComparisonRow) -> None:
    record = comparison.record
    ax.plot(record.u, record.y, color=POINTS, label="measured", **_FILLED)
    ax.plot(record.u, row.y, label="model", **line(0))
    ax.set(xlabel=label(record.units, "u"), ylabel=label(record.units, "y"))


def _draw_residual(ax: Axes, comparison: Comparison, row: ComparisonRow, quanta: str) -> None:
    record = comparison.record
    quantum, unit = _quantum(comparison, quanta)
    rising = _rising(record.u)
    residual = (record.y - row.y) / quantum
    ax.axhline(0.0, color=GUIDE, linewidth=0.8)
    if record.resolution:
        for size, dashes in ((0.5, "dotted"), (1.0, "dashed")):
            ax.axhline(size, color=GUIDE, linewidth=0.8, linestyle=dashes)
            ax.axhline(-size, color=GUIDE, linewidth=0.8, linestyle=dashes)
    ax.plot(record.u[rising], residual[rising], color=MEASURED, label="loading", **_FILLED)
    ax.plot(record.u[~rising], residual[~rising], color=MEASURED, label="unloading", **_OPEN)
    ax.set(xlabel=label(record.units, "u"), ylabel=in_unit("Residual", unit))
    ax.margins(y=0.2)


def _draw_width(ax: Axes, comparison: Comparison) -> None:
    """The measured width, under the lines of the models."""
    units, loop = comparison.record.units, comparison.loop
    ax.plot(loop.u, loop.width, color=MEASURED, label="measured", zorder=3, **_FILLED)
    ax.set(xlabel=label(units, "u"), ylabel=in_unit("Loop width", units.get("y", "")))


def _quantum(comparison: Comparison, quanta: str) -> tuple[float, str]:
    """What residuals are divided by, and the unit that leaves."""
    record = comparison.record
    return (record.resolution, quanta) if record.resolution else (1.0, printed(record.units.get("y", "")))


def _panels(axes: Sequence[Axes] | AxesArray | None, comparison: Comparison) -> AbstractContextManager[AxesArray]:
    n = len(comparison.rows)
    return several(axes, n, height=2.15, columns=min(n, 2), sharey=True)


def _entitle(ax: Axes, row: ComparisonRow, measure: str) -> None:
    ax.set_title(f"{row.name}\nfit {row.fit_percent:.1f} %, {measure}", loc="left", fontsize="medium")


def _in_unit(length: float, comparison: Comparison) -> str:
    """A length along the output with its unit, to about a thousandth of the stroke."""
    decimals = max(0, 3 - math.floor(math.log10(comparison.loop.stroke)))
    return f"{length:.{decimals}f} {printed(comparison.record.units.get('y', ''))}".rstrip()


def _rising(u: FloatArray) -> NDArray[np.bool_]:
    """Whether each sample is on a loading branch; where the input rests, as before."""
    slope = np.gradient(u)
    moved = np.maximum.accumulate(np.where(slope != 0.0, np.arange(u.size), 0))
    return np.asarray(slope[moved] >= 0.0)
