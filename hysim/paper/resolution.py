"""The step in which printed displacements were read: one pixel of the camera."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import read_only


def quantum(values: npt.ArrayLike, tolerance: float) -> float:
    """The largest step of which every value is a whole multiple, to `tolerance` [unit of the values].

    Each number of steps in the largest value is tried in turn, with the step that suits all values best.

    Parameters
    ----------
    values : array, shape (n,)
        At least one not zero.
    tolerance : float
        Largest distance from a whole multiple: half a unit of the last digit, if the values were rounded once.

    Raises
    ------
    ValueError
        If all values are zero, or the tolerance is not positive.

    Examples
    --------
    >>> round(quantum([0.33, 0.67, 1.33], tolerance=0.01), 3)
    0.333
    """
    sizes = np.abs(read_only(values, "values", ndim=1))
    largest = float(sizes.max())
    if not (largest > 0.0 and tolerance > 0.0):
        raise ValueError("a quantum needs a value that is not zero, and a positive tolerance")
    for steps in range(1, int(largest / tolerance) + 1):
        counts = np.round(sizes * (steps / largest))
        step = float(counts @ sizes / (counts @ counts))
        if np.abs(sizes - step * counts).max() <= tolerance:
            return step
    return tolerance
