"""Picture of a displacement that was measured from camera frames."""

import numpy as np
from matplotlib.axes import Axes

from hysim.plot._style import MEASURED, label, line, one
from hysim.vision import Displacement

_BAND = 2.0  # standard errors


def displacement(result: Displacement, ax: Axes | None = None) -> Axes:
    """Draw the displacement of each frame with a band of two standard errors; lost frames are marked below.

    Parameters
    ----------
    result : Displacement
        What `hysim.vision.displacement` measured.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import hysim as hs
    >>> moved = hs.vision.Displacement(
    ...     y=[0.0, 0.1, 0.3], uncertainty=[0.0, 0.01, 0.01], shift=[[0, 0], [1, 0], [3, 0]], across=[0, 0, 0],
    ...     quality=[1, 0.99, 0.99], status=("ok", "ok", "ok"), scale=0.1, direction=0.0,
    ... )
    >>> hs.plot.displacement(moved, hs.plot.figure().add_subplot()).get_ylabel()
    'Displacement [µm]'
    """
    frames = np.arange(len(result))
    half = _BAND * result.uncertainty
    is_blurred, is_lost = (np.array([status == word for status in result.status]) for word in ("blurred", "lost"))
    with one(ax) as axes:
        shade = {"color": line(0)["color"], "alpha": 0.25, "linewidth": 0.0}
        axes.fill_between(frames, result.y - half, result.y + half, label="± 2 standard errors", **shade)
        axes.plot(frames, result.y, marker=".", markersize=4.0, linewidth=0.8, color=line(0)["color"])
        if is_blurred.any():
            axes.plot(
                frames[is_blurred], result.y[is_blurred], "o", mfc="none", color=line(1)["color"], label="blurred"
            )
        if is_lost.any():
            at = np.full(is_lost.sum(), 0.03)
            axes.plot(frames[is_lost], at, "x", color=MEASURED, transform=axes.get_xaxis_transform(), label="lost")
        axes.set(xlabel="Frame", ylabel=label(result.units, "y"))
        axes.legend()
    return axes
