"""Pictures of comparisons, identifications and core losses: loops, residuals, widths, profiles, and errors."""

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike, NDArray

from hysim import metrics
from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.prefixes import in_unit, label, printed
from hysim.comparison import Comparison, ComparisonRow
from hysim.identification import Identification
from hysim.plot import _style as house
from hysim.plot._style import GUIDE, MANY, MEASURED, POINTS, AxesArray, AxesLike, line, one, scattered, several
from hysim.records import Record, by_record
from hysim.simulation import free_run, models_on
from hysim.sweeps import LossMap

_FILLED: dict[str, Any] = {"markeredgewidth": 0.8}
_OPEN = _FILLED | {"markerfacecolor": "white"}
_UNLOADING = "#56B4E9"  # of many samples, which have no open markers
_TIGHT: dict[str, Any] = {"borderaxespad": 0.1, "columnspacing": 1.0, "handlelength": 1.2, "handletextpad": 0.3}
_SAME = 1e-6  # of the output's range: largest difference of two runs of one model
_SHOWN = 4  # models in a figure, unless names are chosen
_BINS, _BARS = 40, 0.68  # of a histogram, and the part of its height below the legend


def loops(comparison: Comparison, axes: AxesLike | None = None) -> AxesArray:
    """Draw each model's loop over the measured points, one panel per model, with its fit and its largest width.

    The result has one Axes for each row of `comparison`.

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


def residuals(comparison: Comparison, axes: AxesLike | None = None, *, quanta: str = "quanta") -> AxesArray:
    """Draw measured minus model against the input, one panel per model: loading filled, unloading open.

    Residuals are counted in quanta of the sensor, with lines at half a quantum (rounding) and at one; `quanta` is their
    name, such as ``"pixels"``. Without a resolution they have the unit of y. The result has one Axes for each row.
    """
    quantum, unit = _quantum(comparison.record, quanta)
    with _panels(axes, comparison) as panels:
        for ax, row in zip(panels, comparison.rows, strict=True):
            _draw_residual(ax, comparison, row, quanta)
            _entitle(ax, row, f"largest {row.max_residual / quantum:.2f} {unit}")
        panels[0].legend(loc="lower center", ncols=2, borderaxespad=0.0, columnspacing=1.0, handletextpad=0.2)
    return panels


def widths(comparison: Comparison, ax: Axes | None = None) -> Axes:
    """Draw the loop widths of a comparison, unloading minus loading, against the input: measured and of models."""
    with one(ax, height=4.8) as axes:
        _draw_width(axes, comparison)
        for k, row in enumerate(comparison.rows):
            axes.plot(row.loop.u, row.loop.width, label=row.name, **line(k))
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return axes


def comparison(
    comparison: Comparison, names: Sequence[str] | None = None, axes: AxesLike | None = None, *, quanta: str = "quanta"
) -> AxesArray:
    """Draw the best models side by side: one row per model, with its loop, its residuals and its loop width.

    `names` are those of the models, in this order (KeyError); by default the four with the smallest cross-validated
    rmse, or the first four. `axes` are three for each model, row by row, and `quanta` is the name of the sensor's
    quanta, as in `residuals`. The result has shape (n_models, 3). A ValueError is raised if there is nothing to draw.

    Examples
    --------
    >>> import hysim as hs
    >>> tab = hs.compare({"curve": hs.SingleValued, "line": hs.Line}, hs.datasets.table1())
    >>> with hs.plot.house_style():
    ...     hs.plot.comparison(tab, axes=hs.plot.figure().subplots(2, 3)).shape
    (2, 3)
    """
    best = (comparison.ranked() or comparison.rows)[:_SHOWN]
    rows = best if names is None else [comparison[name] for name in names]
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
            ends = np.array([ax.get_ylim() for ax in column])  # one range for all, so that heights compare
            for ax in column:
                ax.set_ylim(ends[:, 0].min(), ends[:, 1].max())
            column[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small", **_TIGHT)
    return grid


def loss_map(result: LossMap, ax: Axes | None = None, *, plane: int = 0) -> Axes:
    """Draw the loss density of a `hysim.loss_map` over the amplitude, a line for each frequency, on logarithmic axes.

    `plane` is the number of a bias, and of the channels' values, in the order of ``result.energy``.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.MaxwellSlip(stiffness=(40.0, 20.0), slips=(0.1, 0.3)) + hs.Dashpot(c=0.02)
    >>> result = hs.loss_map(core, [0.2, 0.4, 0.8], [50.0, 400.0])
    >>> hs.plot.loss_map(result, ax=hs.plot.figure().add_subplot()).get_xlabel()
    'Amplitude [T]'
    """
    losses = result.loss.reshape(*result.loss.shape[:2], -1)[:, :, plane]
    with one(ax) as axes:
        for k, (frequency, loss) in enumerate(zip(result.frequencies, losses.T, strict=True)):
            axes.loglog(result.amplitudes, loss, label=f"{frequency:.4g} Hz", **line(k))
        axes.set(xlabel="Amplitude [T]", ylabel="Loss density [W/m³]")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, **_TIGHT)
    return axes


def core_error(errors: Mapping[str, ArrayLike] | ArrayLike, axes: AxesLike | None = None) -> AxesArray:
    """Draw the distribution of relative errors over sequences, with its mean, 95th percentile and maximum.

    `errors`, shape (n_sequences,), are fractions, such as those of `hysim.metrics.sequence_relative_error`, or a
    mapping from names of models to them; the models stand side by side. Magnitudes are drawn. The percentile is that of
    the MagNet Challenges: of n errors, the k-th smallest is at (k - 1/2) / n. The result has shape (n_models,). A
    ValueError is raised if a model has no errors, or one is not finite.

    Examples
    --------
    >>> import hysim as hs
    >>> errors = {"static": [0.2, 0.3, 0.4], "with eddy currents": [0.05, 0.1, 0.12]}
    >>> [ax.get_title() for ax in hs.plot.core_error(errors, hs.plot.figure().subplots(1, 2))]
    ['static', 'with eddy currents']
    """
    named = errors if isinstance(errors, Mapping) else {"": errors}
    percent = {name: 100.0 * np.abs(read_only(each, "errors", ndim=1)) for name, each in named.items()}
    if not percent or not all(each.size for each in percent.values()):
        raise ValueError("core_error needs at least one error of each model")
    bins = np.linspace(0.0, max(float(each.max()) for each in percent.values()) or 1.0, _BINS + 1)
    with several(axes, len(percent), height=3.0, columns=len(percent), sharey=True) as drawn:
        for ax, (name, each) in zip(drawn, percent.items(), strict=True):
            ax.hist(each, bins, weights=np.full(each.size, 100.0 / each.size), color=POINTS)
            places = each.mean(), np.percentile(each, 95.0, method="hazen"), each.max()
            for k, (word, place) in enumerate(zip(("mean", "95th percentile", "maximum"), places, strict=True)):
                ax.axvline(place, 0.0, _BARS, label=f"{word} {place:.3g} %", **line(k))
            ax.set(title=name, xlabel="Relative error [%]", ymargin=1.0 / _BARS - 1.0)
            ax.legend(loc="upper left", **_TIGHT)
        drawn[0].set_ylabel("Share of the sequences [%]")
    return drawn


def identification(fit: Identification, record: Record | Sequence[Record], axes: AxesLike | None = None) -> AxesArray:
    """Draw the model over the measured loop, the residuals, and the profiles of the likelihood if there are any.

    `record` is the Record, or the sequence of them, from which `fit` was identified, else a ValueError. The band is two
    standard errors of the model's output to each side, the model's line its free run on the measured input. Residuals
    are in quanta of the sensor if its resolution is known, with lines at one. A profile is the signed root of the
    deviance over the distance from the estimate in standard errors, on the diagonal for a normal distribution; the
    interval at 95 % lies between the horizontal lines. The result has shape (2,), or (3,) with profiles.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> len(hs.plot.identification(hs.identify(hs.Line, rec), rec, hs.plot.figure().subplots(1, 2)))
    2
    """
    records = (record,) if isinstance(record, Record) else tuple(record)
    u, y = np.concatenate([each.u for each in records]), np.concatenate([each.y for each in records])
    if u.size != fit.residual.size:
        raise ValueError(f"the result is of {fit.residual.size} samples, the record has {u.size}")
    model = np.concatenate([free_run(own, each).y for own, each in zip(models_on(fit, records), records, strict=True)])
    percent = metrics.fit_percent(y, y - fit.residual)  # that of all samples: a fit may have left some out
    if not (
        np.isclose(percent, fit.fit_percent, rtol=1e-6, equal_nan=True)
        or np.allclose(y - model, fit.residual, rtol=0.0, atol=_SAME * float(np.ptp(y)))
    ):
        raise ValueError(f"the result is of another record: its fit is {fit.fit_percent:g} %, not {percent:g} %")
    residual = (y - model) / (fit.resolution or 1.0)
    parts = by_record(np.arange(u.size), records)
    with several(axes, 3 if fit.profiles else 2, height=3.0, sharex=False) as panels:
        _draw_fit(panels[0], u, y, model, fit.response_stderr, parts)
        panels[0].set(xlabel=label(records[0].units, "u"), ylabel=label(records[0].units, "y"))
        _draw_guides(panels[1], {1.0: "dashed"} if fit.resolution else {})
        panels[1].plot(u, residual, color=MEASURED, **scattered(u.size))
        unit = "quanta" if fit.resolution else records[0].units.get("y", "")
        panels[1].set(xlabel=label(records[0].units, "u"), ylabel=in_unit("Residual", unit))
        panels[1].margins(y=0.15)
        if fit.profiles:
            _draw_profiles(panels[2], fit)
    return panels


def _draw_fit(
    ax: Axes, u: FloatArray, y: FloatArray, model: FloatArray, stderr: FloatArray, parts: list[NDArray[np.intp]]
) -> None:
    _draw_measured(ax, u, y, parts)
    name = f"model, fit {metrics.fit_percent(y, model):.2f} %"
    for k, part in enumerate(parts):
        ax.plot(u[part], model[part], label=None if k else name, **line(0))
        if np.isfinite(stderr[part]).all():
            reach = 2.0 * stderr[part]
            corners = np.concatenate([model[part] + reach, (model[part] - reach)[::-1]])
            style = {"color": line(0)["color"], "alpha": 0.25, "linewidth": 0, **house.grid_of(part.size)}
            band = Polygon(np.column_stack([np.concatenate([u[part], u[part][::-1]]), corners]), **style)
            ax.add_artist(band)  # a patch would be searched for extremes side by side, which takes seconds
            ax.update_datalim(band.get_xy())
    ax.legend(loc="best")


def _draw_measured(ax: Axes, u: FloatArray, y: FloatArray, parts: list[NDArray[np.intp]]) -> None:
    if u.size <= MANY:
        ax.plot(u, y, label="measured", color=POINTS, **scattered(u.size, **_FILLED))
        return
    for k, part in enumerate(parts):
        ax.plot(u[part], y[part], label=None if k else "measured", **house.joined(u.size))


def _draw_profiles(ax: Axes, fit: Identification) -> None:
    reach = 1.0
    for k, (name, curve) in enumerate(fit.profiles.items()):
        distance = (curve.values - fit.estimates[name]) / fit.stderr[name]
        root = np.sign(distance) * np.sqrt(np.maximum(curve.deviance, 0.0))
        shown = np.abs(root) <= 1.3 * np.sqrt(curve.limit)
        ax.plot(distance[shown], root[shown], label=name, **line(k))
        reach = max(reach, 1.1 * float(np.sqrt(curve.limit)))
    ax.axline((0.0, 0.0), slope=1.0, color=GUIDE, linewidth=0.8)
    for side in (-1.0, 1.0):
        ax.axhline(side * reach / 1.1, color=GUIDE, linewidth=0.8, linestyle="dashed")
    ax.set(xlabel="Distance from the estimate [standard errors]", ylabel="Signed root of the deviance")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, 1.0), fontsize="small")


def _draw_guides(ax: Axes, sizes: dict[float, str]) -> None:
    ax.axhline(0.0, color=GUIDE, linewidth=0.8)
    for size, dashes in sizes.items():
        for height in (size, -size):
            ax.axhline(height, color=GUIDE, linewidth=0.8, linestyle=dashes)


def _draw_loop(ax: Axes, comparison: Comparison, row: ComparisonRow) -> None:
    record = comparison.record
    _draw_measured(ax, record.u, record.y, [np.arange(len(record))])
    ax.plot(record.u, row.y, label="model", **line(0))
    ax.set(xlabel=label(record.units, "u"), ylabel=label(record.units, "y"))


def _draw_residual(ax: Axes, comparison: Comparison, row: ComparisonRow, quanta: str) -> None:
    record = comparison.record
    quantum, unit = _quantum(record, quanta)
    rising, residual = _rising(record.u), (record.y - row.y) / quantum
    _draw_guides(ax, {0.5: "dotted", 1.0: "dashed"} if record.resolution else {})
    for name, at, style, colour in (
        ("loading", rising, _FILLED, MEASURED),
        ("unloading", ~rising, _OPEN, MEASURED if len(record) <= MANY else _UNLOADING),
    ):
        (points,) = ax.plot(record.u[at], residual[at], color=colour, label=name, **scattered(len(record), **style))
        if len(record) > MANY:  # dots too small for a legend
            points.set_label("_")
            ax.plot([], [], color=colour, label=name, **scattered(0, **_FILLED))
    ax.set(xlabel=label(record.units, "u"), ylabel=in_unit("Residual", unit))
    ax.margins(y=0.2)


def _draw_width(ax: Axes, comparison: Comparison) -> None:
    units, loop = comparison.record.units, comparison.loop
    style = scattered(loop.u.size, **_FILLED) if loop.u.size <= MANY else {"linewidth": 1.8}
    ax.plot(loop.u, loop.width, color=MEASURED, label="measured", zorder=3 if loop.u.size <= MANY else 1, **style)
    ax.set(xlabel=label(units, "u"), ylabel=in_unit("Loop width", units.get("y", "")))


def _quantum(record: Record, quanta: str) -> tuple[float, str]:
    return (record.resolution, quanta) if record.resolution else (1.0, printed(record.units.get("y", "")))


def _panels(axes: AxesLike | None, comparison: Comparison) -> AbstractContextManager[AxesArray]:
    n = len(comparison.rows)
    return several(axes, n, height=2.15, columns=min(n, 2), sharey=True)


def _entitle(ax: Axes, row: ComparisonRow, measure: str) -> None:
    ax.set_title(f"{row.name}\nfit {row.fit_percent:.1f} %, {measure}", loc="left", fontsize="medium")


def _in_unit(length: float, comparison: Comparison) -> str:
    """A length along the output with its unit, to about a thousandth of the stroke."""
    decimals = max(0, 3 - math.floor(math.log10(comparison.loop.stroke)))
    return f"{length:.{decimals}f} {printed(comparison.record.units.get('y', ''))}".rstrip()


def _rising(u: FloatArray) -> NDArray[np.bool_]:
    """Whether each sample is on a loading branch; while the input rests, as before."""
    slope = np.gradient(u)
    latest_motion = np.maximum.accumulate(np.where(slope != 0.0, np.arange(u.size), 0))
    return np.asarray(slope[latest_motion] >= 0.0)
