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
from hysim.plot._style import GUIDE, MEASURED, POINTS, AxesArray, label, line, one, printed, several

_FILLED: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.8, "markeredgewidth": 0.8}
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
    record = comparison.record
    with _panels(axes, comparison) as panels:
        for ax, row in zip(panels, comparison.rows, strict=True):
            ax.plot(record.u, record.y, color=POINTS, label="measured", **_FILLED)
            ax.plot(record.u, row.y, label="model", **line(0))
            _entitle(ax, row, f"width {_in_unit(row.max_width, comparison)}")
            ax.set(xlabel=label(record.units, "u"), ylabel=label(record.units, "y"))
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
    record = comparison.record
    quantum = record.resolution or 1.0
    unit = quanta if record.resolution else printed(record.units.get("y", ""))
    rising = _rising(record.u)
    with _panels(axes, comparison) as panels:
        for ax, row in zip(panels, comparison.rows, strict=True):
            residual = (record.y - row.y) / quantum
            ax.axhline(0.0, color=GUIDE, linewidth=0.8)
            if record.resolution:
                for size, dashes in ((0.5, "dotted"), (1.0, "dashed")):
                    ax.axhline(size, color=GUIDE, linewidth=0.8, linestyle=dashes)
                    ax.axhline(-size, color=GUIDE, linewidth=0.8, linestyle=dashes)
            ax.plot(record.u[rising], residual[rising], color=MEASURED, label="loading", **_FILLED)
            ax.plot(record.u[~rising], residual[~rising], color=MEASURED, label="unloading", **_OPEN)
            _entitle(ax, row, f"largest {np.abs(residual).max():.2f} {unit}")
            ax.set(xlabel=label(record.units, "u"), ylabel=f"Residual [{unit}]" if unit else "Residual")
            ax.margins(y=0.2)
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
    units = comparison.record.units
    with one(ax, height=4.8) as axes:
        axes.plot(comparison.loop.u, comparison.loop.width, color=MEASURED, label="measured", zorder=3, **_FILLED)
        for k, row in enumerate(comparison.rows):
            axes.plot(row.loop.u, row.loop.width, label=row.name, **line(k))
        unit = f" [{printed(units['y'])}]" if "y" in units else ""
        axes.set(xlabel=label(units, "u"), ylabel=f"Loop width{unit}")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return axes


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
