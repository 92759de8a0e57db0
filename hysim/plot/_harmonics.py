"""Picture of describing functions: gain and phase of the first harmonic against the amplitude."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from hysim.metrics import describing_function as computed
from hysim.plot._style import AxesArray, in_unit, line, several


def describing_function(
    law: Any,
    amplitudes: npt.ArrayLike,
    axes: Sequence[Axes] | AxesArray | None = None,
    *,
    mean: float = 0.0,
    units: Mapping[str, str] | None = None,
) -> AxesArray:
    """Draw gain and phase of a law's first harmonic against the amplitude of a sine, one over the other.

    A phase is left out where the gain is zero.

    Parameters
    ----------
    law : model or mapping
        A rate-independent law, or name to law for several.
    amplitudes : array, shape (n,)
        Of the input, increasing [unit of u].
    axes : two Axes, optional
        For the gain and for the phase.
    mean : float
        Input in the middle of the cycle [unit of u].
    units : mapping, optional
        Labels of the units of ``"u"`` and ``"y"``.

    Returns
    -------
    array of Axes, shape (2,)

    Raises
    ------
    TypeError, ValueError, SimulationError
        As `hysim.metrics.describing_function`, or a ValueError if there are fewer than two Axes.

    Examples
    --------
    >>> import hysim as hs
    >>> laws = {"play": hs.Play(threshold=1.0), "stop": hs.Stop(threshold=1.0)}
    >>> gain, phase = hs.plot.describing_function(laws, [1.5, 2.0, 4.0], hs.plot.figure().subplots(2))
    >>> gain.get_ylabel(), phase.get_ylabel()
    ('Gain', 'Phase [degrees]')
    """
    known = units or {}
    laws = law if isinstance(law, Mapping) else {type(law).__name__: law}
    with several(axes, 2, height=2.4) as (upper, lower):
        for k, (name, each) in enumerate(laws.items()):
            found = computed(each, amplitudes, mean=mean)
            upper.plot(amplitudes, np.abs(found), label=name, **line(k))
            phase = np.where(found == 0.0, np.nan, np.degrees(np.angle(found)))
            lower.plot(amplitudes, phase, label=name, **line(k))
        upper.set_ylabel(in_unit("Gain", f"{known['y']}/{known['u']}" if {"u", "y"} <= known.keys() else ""))
        lower.set(xlabel=in_unit("Amplitude", known.get("u", "")), ylabel="Phase [degrees]")
        if len(laws) > 1:
            upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)
    return np.array([upper, lower])
