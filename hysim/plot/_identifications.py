"""Picture of an identification: the loop with its band, the residuals, and how far the likelihood is from linear."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.identification import Identification
from hysim.plot._style import GUIDE, MEASURED, POINTS, AxesArray, in_unit, label, line, several
from hysim.records import Record

_MEASURED: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.8, "color": POINTS}


def identification(
    fit: Identification, record: Record | Sequence[Record], axes: Sequence[Axes] | AxesArray | None = None
) -> AxesArray:
    """Draw the model over the measured loop, the residuals, and the profiles of the likelihood if there are any.

    The band is two standard errors of the model's output wide to each side. Residuals are counted in quanta of the
    sensor where its resolution is known, with lines at one quantum. A profile is drawn as the signed root of the
    deviance over the distance from the estimate in standard errors: it is the diagonal where the standard error
    tells the whole truth. The interval at 95 % lies between the horizontal lines.

    Parameters
    ----------
    fit : Identification
        What `hysim.identify` found.
    record : Record or sequence of Record
        What it was found from.
    axes : two Axes, or three with profiles, optional
        For the loop, the residuals, and the profiles.

    Returns
    -------
    array of Axes, shape (2,) or (3,)

    Raises
    ------
    ValueError
        If the record is not the one that the result is of, or there are fewer Axes than needed.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> fit = hs.identify(hs.Line, rec)
    >>> len(hs.plot.identification(fit, rec, hs.plot.figure().subplots(1, 2)))
    2
    """
    records = (record,) if isinstance(record, Record) else tuple(record)
    u, y = (np.concatenate([getattr(each, name) for each in records]) for name in ("u", "y"))
    if u.size != fit.residual.size:
        raise ValueError(f"the result is of {fit.residual.size} samples, the record has {u.size}")
    percent = metrics.fit_percent(y, y - fit.residual)
    if not np.isclose(percent, fit.fit_percent, rtol=1e-6, equal_nan=True):
        raise ValueError(f"the result is of another record: its fit is {fit.fit_percent:g} %, not {percent:g} %")
    cuts = np.cumsum([len(each) for each in records])[:-1]
    with several(axes, 3 if fit.profiles else 2, height=3.0, sharex=False) as panels:
        _loop(panels[0], u, y, fit, cuts.tolist(), records[0])
        _residuals(panels[1], u, fit, records[0])
        if fit.profiles:
            _profiles(panels[2], fit)
    return panels


def _loop(ax: Axes, u: FloatArray, y: FloatArray, fit: Identification, cuts: list[int], record: Record) -> None:
    model = y - fit.residual
    ax.plot(u, y, label="measured", **_MEASURED)
    for k, part in enumerate(np.split(np.arange(u.size), cuts)):
        ax.plot(u[part], model[part], label=None if k else f"model, fit {fit.fit_percent:.2f} %", **line(0))
        if np.isfinite(fit.response_stderr[part]).all():
            reach = 2.0 * fit.response_stderr[part]
            corners = np.concatenate([model[part] + reach, (model[part] - reach)[::-1]])
            ax.fill(np.concatenate([u[part], u[part][::-1]]), corners, color=line(0)["color"], alpha=0.25, linewidth=0)
    ax.set(xlabel=label(record.units, "u"), ylabel=label(record.units, "y"))
    ax.legend(loc="best")


def _residuals(ax: Axes, u: FloatArray, fit: Identification, record: Record) -> None:
    quanta = fit.residual_quanta
    unit = record.units.get("y", "") if quanta is None else "quanta"
    ax.axhline(0.0, color=GUIDE, linewidth=0.8)
    if quanta is not None:
        for size in (-1.0, 1.0):
            ax.axhline(size, color=GUIDE, linewidth=0.8, linestyle="dashed")
    ax.plot(u, fit.residual if quanta is None else quanta, **{**_MEASURED, "color": MEASURED})
    ax.set(xlabel=label(record.units, "u"), ylabel=in_unit("Residual", unit))
    ax.margins(y=0.15)


def _profiles(ax: Axes, fit: Identification) -> None:
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
