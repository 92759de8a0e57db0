"""Pictures of parameters that depend on a channel."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hysim._channels import steady
from hysim._prefixes import in_unit
from hysim.identification import Identification, ParameterCurve, parameter_curve
from hysim.plot._style import MEASURED, line, one
from hysim.records import Record

_POINTS = 101  # of a curve
_BESIDE = 0.05  # of the range, shown on either side


def parameter(
    fit: Identification | ParameterCurve,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    one_by_one: Sequence[Identification] = (),
    records: Sequence[Record] = (),
    unit: str = "",
) -> Axes:
    """Draw a parameter against its channel, with its band at 95 %.

    Parameters
    ----------
    fit : Identification or ParameterCurve
        A result of `hysim.identify` with `depends`, or of `hysim.parameter_curve`.
    name : str, optional
        The parameter of the fit; not for a curve.
    ax : Axes, optional
        To draw on.
    one_by_one : sequence of Identification, optional
        Fits of the law without a dependence to records of one value of the channel each, drawn with their intervals.
    records : sequence of Record, optional
        The records of these fits, one for each.
    unit : str
        Unit of the parameter on the axis; that of the channel is the first record's.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the parameter depends on no channel, the fits are not as many as the records, or a channel varies along one.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> recs = [hs.Record(u=u, y=T * hs.Play(threshold=0.2).response(u), channels={"T": T}) for T in (1.0, 2.0)]
    >>> fit = hs.identify(hs.Play, recs, depends={"gain": ("T", 1)})
    >>> hs.plot.parameter(fit, "gain", ax=hs.plot.figure().add_subplot()).get_xlabel()
    'T'
    """
    curve = fit if isinstance(fit, ParameterCurve) else parameter_curve(fit, name or "")
    if len(one_by_one) != len(records):
        raise ValueError(f"give one record for each fit, got {len(one_by_one)} fits and {len(records)} records")
    known = curve.polynomial
    low, high = known.span
    margin = _BESIDE * (high - low)
    channel = np.linspace(low - margin, high + margin, _POINTS)
    units = records[0].units if records else {}
    style: dict[str, Any] = line(0)
    with one(ax, height=3.0) as axes:
        axes.fill_between(channel, *curve.band(channel), color=style["color"], alpha=0.25, linewidth=0.0)
        axes.plot(channel, curve.value(channel), label="jointly", **style)
        for k, (each, record) in enumerate(zip(one_by_one, records, strict=True)):
            _draw_alone(axes, each, known.parameter, steady(record.channel(known.channel)), k == 0)
        axes.set(xlabel=in_unit(known.channel, units.get(known.channel, "")), ylabel=in_unit(known.parameter, unit))
        if one_by_one:
            axes.legend()
    return axes


def _draw_alone(ax: Axes, fit: Identification, parameter: str, place: Any, is_first: bool) -> None:
    """One fit at one value of the channel, with its interval."""
    if np.ndim(place):
        raise ValueError("a channel varies along a record of these fits: a fit stands at one value of it")
    value, (low, high) = fit.estimates[parameter], fit.intervals.get(parameter, (np.nan, np.nan))
    label = "one by one" if is_first else None
    reach = [[value - low], [high - value]]
    ax.errorbar([place], [value], yerr=reach, color=MEASURED, fmt="o", markersize=4, capsize=2, label=label)
