"""Pictures of posteriors: corners, bands of what they predict, and evidences of models."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hysim._basics.frozen import FloatArray
from hysim._basics.prefixes import label
from hysim.plot._style import GUIDE, MEASURED, POINTS, AxesArray, AxesLike, line, one, scattered, several
from hysim.posterior import Evidence, Posterior, Prediction
from hysim.records import Record

_BINS = 30
_SHARES = (0.39, 0.86)  # of the draws: one and two standard deviations of a normal distribution of two numbers
_OUTLIERS = 0.002  # of the draws, on each side, that are not shown
_FAR = -30.0  # ln of an evidence so far below the best one that a linear axis would hide the others
_TICKS = (0.0, -1.0, -2.0, -3.0, -10.0, -30.0, -100.0, -300.0, -1e3, -1e4, -1e5)
_SHADES = ("#cfe2f0", "#6aa5cf")


def corner(posterior: Posterior, names: Sequence[str] | None = None, axes: AxesLike | None = None) -> AxesArray:
    """Draw the distribution of each parameter, and of each pair: the regions that hold 39 % and 86 % of the draws.

    `names` are those of the parameters, in this order; by default all. Dashed lines are the interval at 95 %. `axes`
    are n^2 for n parameters, row by row; those above the diagonal stay empty. The result has shape (n, n). A KeyError
    is raised if there is no parameter of a name.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> post = hs.sample_posterior(hs.identify(hs.Line, rec), rec, samples=50, walkers=8)
    >>> with hs.plot.house_style():
    ...     hs.plot.corner(post, axes=hs.plot.figure().subplots(3, 3)).shape
    (3, 3)
    """
    chosen = tuple(posterior.names if names is None else names)
    draws = [posterior.samples[name] for name in chosen]
    ends = posterior.interval()
    n = len(chosen)
    with several(axes, n * n, height=6.4 / n, columns=n, sharex=False) as panels:
        grid: AxesArray = panels.reshape(n, n)
        for i, j in np.ndindex(n, n):
            ax: Axes = panels[n * i + j]
            if j > i:
                ax.set_axis_off()
                continue
            if i == j:
                ax.hist(draws[i], bins=np.linspace(*_shown(draws[i]), _BINS + 1).tolist(), color=_SHADES[1])
                for end in ends[chosen[i]]:
                    ax.axvline(end, color=GUIDE, linewidth=0.8, linestyle="dashed")
            else:
                _draw_pair(ax, draws[j], draws[i])
                ax.set_ylim(*_shown(draws[i]))
            ax.set_xlim(*_shown(draws[j]))
            _label(ax, chosen[j] if i == n - 1 else "", chosen[i] if j == 0 and i else "")
    return grid


def prediction(
    prediction: Prediction, record: Record | None = None, ax: Axes | None = None, *, measured: bool = True
) -> Axes:
    """Draw the band of the output against the input, with the points of a `record` over it.

    The dark band is that of the model's output, the light one that of the next measurement, which `measured` = False
    leaves out; the line is the median.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> post = hs.sample_posterior(hs.identify(hs.Line, rec), rec, samples=50, walkers=8)
    >>> with hs.plot.house_style():
    ...     ax = hs.plot.prediction(post.predict(rec.u, n=50), rec, hs.plot.figure().add_subplot())
    >>> ax.get_xlabel()
    'Voltage [V]'
    """
    u = prediction.u
    with one(ax) as axes:
        share = f"{100.0 * prediction.level:g} %"
        bands = [(prediction.measured_band, _SHADES[0], f"next measurement, {share}")] if measured else []
        for (low, high), colour, words in (*bands, (prediction.band, _SHADES[1], f"output, {share}")):
            _fill(axes, u, low, high, colour, words)
        axes.plot(u, prediction.y, label="median", **{**line(0), "linewidth": 0.9})
        if record is not None:
            axes.plot(record.u, record.y, label="measured", color=MEASURED, **scattered(len(record)))
        units = {} if record is None else record.units
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        axes.legend(loc="best")
    return axes


def evidence(evidence: Evidence, ax: Axes | None = None) -> Axes:
    """Draw ln Z of each model below that of the best, with its boxes unchanged, halved and doubled.

    Bars are two standard errors to each side. The axis is logarithmic beyond -3 if a model is far behind. Left of the
    dotted line a model has odds of less than 1 : 3 against the best one.

    Examples
    --------
    >>> import hysim as hs
    >>> known = {"n_parameters": 2, "fit_percent": 90.0, "error": (0.1, 0.1, 0.1), "n_evaluations": 1000}
    >>> line = hs.EvidenceRow(name="line", log_evidence=(-90.0, -91.0, -92.0), **known)
    >>> play = hs.EvidenceRow(name="play", log_evidence=(-80.0, -81.0, -83.0), **known)
    >>> found = hs.Evidence(rows=(play, line), noise="gaussian", method="nested")
    >>> with hs.plot.house_style():
    ...     len(hs.plot.evidence(found, hs.plot.figure().add_subplot()).get_yticks())
    2
    """
    places = np.arange(len(evidence.rows), dtype=float)
    values = np.array([row.log_evidence for row in evidence.rows])
    errors = np.array([row.error for row in evidence.rows])
    with one(ax, height=1.3 + 0.34 * len(evidence.rows)) as axes:
        for k, factor in enumerate(evidence.factors):
            behind, reach = values[:, k] - values[:, k].max(), 2.0 * errors[:, k]
            points: dict[str, Any] = {"marker": "o^s"[k % 3], "markersize": 4.0, "color": line(k)["color"]}
            bars: dict[str, Any] = {"xerr": reach, "linestyle": "none", "linewidth": 1.0}
            axes.errorbar(behind, places + 0.22 * (k - 1), label=f"boxes x {factor:g}", **points, **bars)
        axes.axvline(-np.log(3.0), color=GUIDE, linewidth=0.8, linestyle="dotted")
        axes.set_yticks(places, evidence.names)
        axes.invert_yaxis()
        axes.set(xlabel="ln evidence, less that of the best model")
        if (least := float((values - values.max(axis=0)).min())) < _FAR:
            axes.set_xscale("symlog", linthresh=3.0, linscale=0.9)
            ticks = [tick for tick in _TICKS if tick > 1.5 * least]
            axes.set_xticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
            axes.set_xlim(1.6 * least, 0.5)
            axes.minorticks_off()
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return axes


def _draw_pair(ax: Axes, x: FloatArray, y: FloatArray) -> None:
    from scipy.ndimage import convolve1d

    smooth, across, up = np.histogram2d(x, y, bins=_BINS, range=[_shown(x), _shown(y)])
    for axis in (0, 1, 0, 1):  # means of neighbours, 1 : 2 : 1 along both axes, twice
        smooth = convolve1d(smooth, [0.25, 0.5, 0.25], axis, mode="nearest")
    ordered = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(held, share)]) for share in reversed(_SHARES)]
    if not 0.0 < levels[0] < levels[1] < smooth.max():
        ax.plot(x, y, ".", color=POINTS, markersize=1.0, rasterized=True)
        return
    middle = [0.5 * (each[1:] + each[:-1]) for each in (across, up)]
    ax.contourf(*middle, smooth.T, levels=[*levels, float(smooth.max())], colors=_SHADES)


def _shown(draws: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(draws, [_OUTLIERS, 1.0 - _OUTLIERS]).tolist()
    margin = 0.05 * (high - low) or 1e-12 + 1e-6 * abs(high)
    return low - margin, high + margin


def _label(ax: Axes, below: str, beside: str) -> None:
    ax.locator_params(nbins=3)
    ax.tick_params(labelsize=6, labelbottom=bool(below), labelleft=bool(beside), axis="both")
    ax.tick_params(axis="x", rotation=45)
    ax.set_xlabel(below, fontsize=8)
    ax.set_ylabel(beside, fontsize=8)


def _fill(ax: Axes, u: FloatArray, low: FloatArray, high: FloatArray, colour: str, words: str) -> None:
    """A band along a path of the input, which turns back: one quadrilateral for each step."""
    from matplotlib.collections import PolyCollection

    corners = [
        [(u[k], low[k]), (u[k + 1], low[k + 1]), (u[k + 1], high[k + 1]), (u[k], high[k])] for k in range(u.size - 1)
    ]
    ax.add_collection(PolyCollection(corners, facecolor=colour, edgecolor=colour, linewidth=0.3, label=words))
    ax.autoscale_view()
