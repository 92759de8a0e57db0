"""Picture of a tuning: what robustness costs."""

import numpy as np
from matplotlib.axes import Axes

from hysim._frozen import FloatArray
from hysim.control import Trial, Tuning
from hysim.plot._style import MEASURED, POINTS, line, one

_SCALE = 30.0  # times the chosen one's objective: what is worse would hide the differences that matter


def trade_off(tuning: Tuning, ax: Axes | None = None) -> Axes:
    """Draw the objective against the maximum sensitivity: every trial, the front of the best, and the chosen one.

    Trials that are 30 times worse than the chosen one, or twice as sensitive, are left out.

    Parameters
    ----------
    tuning : Tuning
        What `hysim.tune` found.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> found = hs.tune(lag, 0.1 * np.arange(100), np.ones(100))
    >>> hs.plot.trade_off(found, ax=hs.plot.figure().add_subplot()).get_xlabel()
    'Maximum sensitivity'
    """
    tried, best = (_points(tuning, trials) for trials in (tuning.trials, tuning.trade_off))
    with one(ax) as axes:
        axes.plot(*tried, "o", color=POINTS, markersize=3.0, label="simulated")
        axes.plot(*best, marker="o", markersize=4.0, drawstyle="steps-post", label="best so robust", **line(0))
        chosen = tuning.max_sensitivity, tuning.objective
        axes.plot(*chosen, "D", color=MEASURED, markersize=7, label="chosen")
        axes.set(xlabel="Maximum sensitivity", ylabel="Objective [of the reference's span]", yscale="log")
        axes.legend()
    return axes


def _points(tuning: Tuning, trials: tuple[Trial, ...]) -> FloatArray:
    found = np.array([(trial.max_sensitivity, trial.objective) for trial in trials])
    shown = (found[:, 0] <= 2.0 * tuning.max_sensitivity) & (found[:, 1] <= _SCALE * tuning.objective)
    return np.asarray(found[shown].T)
