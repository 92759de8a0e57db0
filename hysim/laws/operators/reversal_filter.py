"""A filter that ignores small reversals of a measured input.

    rising:   v = max(v, u), until v - u > threshold; then v = u, falling
    falling:  v = min(v, u), until u - v > threshold; then v = u, rising

The output v follows the input's running extreme and turns only once it has retreated by more than the threshold. Noise
below half the threshold makes no reversal. This is the causal turning-point (rainflow) filter of fatigue analysis.
"""

from typing import ClassVar

from hysim.kernels import clamps as kernels
from hysim.models.law import Law
from hysim.models.model import Example, family, not_offered


@family
class ReversalFilter(Law):
    """Filter of an input, whose output v follows the input's extremes and ignores reversals up to a threshold.

    It stands in front of a law, ``hs.ReversalFilter(threshold=0.1) >> law``, whose measured input has noise: without it
    each false reversal moves the memory. `hysim.identify` puts it there where the record needs it. A command has no
    such noise, so that the inverse of a cascade that begins with a filter is the inverse of what stands behind it.

    Parameters
    ----------
    threshold : float
        Largest reversal that is ignored, not negative [unit of u]. For white noise of standard deviation sigma
        `hysim.identify` takes 5 sqrt(2) sigma.

    Raises
    ------
    ValueError
        If the threshold is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.ReversalFilter(threshold=0.2).response([0.0, 1.0, 0.9, 1.1, 0.8, 0.9, 0.5]).tolist()
    [0.0, 1.0, 1.0, 1.1, 0.8, 0.8, 0.5]
    """

    threshold: float = 0.0

    units: ClassVar = {"threshold": "u"}
    not_negative = ("threshold",)
    example = Example({"threshold": 0.3}, title="Filter of small reversals")
    step = staticmethod(kernels.extreme)
    start = staticmethod(kernels.start_extreme)
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 2  # the extreme and the direction
    filters_input: ClassVar[bool] = True
    memory = inverse_response = None  # type: ignore[assignment]  # it says nothing that its output does not
    candidates = not_offered  # it is no model of a device by itself
