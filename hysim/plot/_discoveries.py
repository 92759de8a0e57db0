"""Picture of a discovery: what each number of terms buys."""

from collections.abc import Sequence

import numpy as np

from hysim.discovery import Discovery
from hysim.plot._style import MEASURED, Axes, AxesArray, line, several


def selection(discovery: Discovery, axes: Sequence[Axes] | AxesArray | None = None) -> AxesArray:
    """Draw the fit and the BIC of the free run against the number of terms, one over the other.

    The structures on the path of thresholds are points; the law that was chosen is a filled one. It need not
    be on the path, from which the search goes on by taking terms away. A structure whose free run diverges is
    a cross on the lower edge.

    Parameters
    ----------
    discovery : Discovery
        What `hysim.discover` found.
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
    n_terms, scores = discovery.path_n_terms, discovery.scores
    finite = np.isfinite(discovery.path_bic)
    with several(axes, 2, height=2.2) as panels:
        measures = (("Fit in free run [%]", discovery.path_fit_percent, "fit_percent"), ("BIC", discovery.path_bic, "bic"))
        for ax, (quantity, path, chosen) in zip(panels, measures, strict=True):
            ax.plot(n_terms[finite], path[finite], "o", color=MEASURED, markerfacecolor="white", label="path of thresholds")
            ax.plot(scores["n_terms"], scores[chosen], "D", color=line(3)["color"], markersize=8, label="chosen law")
            if not finite.all():
                edge = np.zeros(np.count_nonzero(~finite))
                ax.plot(n_terms[~finite], edge, "x", color=MEASURED, transform=ax.get_xaxis_transform(), clip_on=False, label="diverged")
            ax.set_ylabel(quantity)
        panels[-1].set_xlabel("Number of terms")
        panels[0].legend()
    return panels
