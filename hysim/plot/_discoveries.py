"""Picture of a discovery: what each number of terms buys."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hysim.discovery import Discovery, OscillatorDiscovery
from hysim.plot._style import MEASURED, AxesArray, line, several

_OPEN: dict[str, Any] = {"color": MEASURED, "markerfacecolor": "white"}
_SCALE = 5.0  # of the fit below the best one [%]: what is worse would hide the differences that matter


def selection(discovery: Discovery | OscillatorDiscovery, axes: Sequence[Axes] | AxesArray | None = None) -> AxesArray:
    """Draw the fit and the BIC of the free run against the number of terms, one over the other.

    The structures on the path of thresholds are circles, the chosen law is a diamond. It need not be on the
    path, from which the search goes on by taking terms away. A structure that fits 5 % worse than the best, or
    whose free run diverges, is a cross on the edge.

    Parameters
    ----------
    discovery : Discovery or OscillatorDiscovery
        The result of `hysim.discover` or `hysim.discover_oscillator`.
    axes : two Axes, optional
        For the fit and for the BIC.

    Returns
    -------
    array of Axes, shape (2,)

    Raises
    ------
    ValueError
        If fewer than two Axes are given.
    """
    n_terms, fits, scores = discovery.path_n_terms, discovery.path_fit_percent, discovery.scores
    shown = fits >= fits.max(initial=scores["fit_percent"]) - _SCALE
    with several(axes, 2, height=2.2) as (upper, lower):
        for ax, path, measure, edge in ((upper, fits, "fit_percent", 0.0), (lower, discovery.path_bic, "bic", 1.0)):
            ax.plot(n_terms[shown], path[shown], "o", label="path of thresholds", **_OPEN)
            ax.plot(scores["n_terms"], scores[measure], "D", color=line(0)["color"], markersize=7, label="chosen law")
            if not shown.all():
                edges = np.full(np.count_nonzero(~shown), edge)
                on_edge = {"transform": ax.get_xaxis_transform(), "clip_on": False, "label": "off the scale"}
                ax.plot(n_terms[~shown], edges, "x", color=MEASURED, **on_edge)
            ax.margins(y=0.15)
        upper.set_ylabel("Fit in free run [%]")
        lower.set(xlabel="Number of terms", ylabel="BIC")
        lower.xaxis.get_major_locator().set_params(integer=True)
        upper.legend()
    return np.array([upper, lower])
