"""Pictures of parameters that drift along a record."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from hysim._prefixes import in_unit
from hysim.plot._style import line, one
from hysim.tracking import ParameterTrack


def track(
    result: ParameterTrack,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    t: Sequence[float] | npt.NDArray[Any] | None = None,
    truth: npt.ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """Draw the path of a number of a law with its band at 95 %.

    Parameters
    ----------
    result : ParameterTrack
        A result of `hysim.track_parameters`.
    name : str, optional
        The number; by default the first one that is free.
    ax : Axes, optional
        To draw on.
    t : array, shape (n_samples,), optional
        Times of the samples; by default their numbers [s].
    truth : array, shape (n_samples,), optional
        What is known of it otherwise.
    units : mapping, optional
        Label of the unit of the number, by its name.

    Returns
    -------
    Axes

    Raises
    ------
    KeyError
        If the number is not free.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(feedthrough=0.5)
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=20)
    >>> result = hs.track_parameters(law, hs.Record(u=u, y=law.response(u)), ["gain"], noise=0.01)
    >>> hs.plot.track(result, "gain").get_ylabel()
    'gain'
    """
    name = result.names[0] if name is None else name
    path, (lower, upper) = result[name], result.band(name)
    x = np.arange(path.size) if t is None else np.asarray(t)
    with one(ax, height=3.0) as axes:
        axes.fill_between(x, lower, upper, alpha=0.25, linewidth=0.0, label="95 %", color=line(0)["color"])
        axes.plot(x, path, label=f"by {result.method}s", **line(0))
        if truth is not None:
            axes.plot(x, np.asarray(truth), label="truth", **line(1))
        axes.set_xlabel("sample" if t is None else "t [s]")
        axes.set_ylabel(in_unit(name, (units or {}).get(name, "")))
        axes.legend()
    return axes
