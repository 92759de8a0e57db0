"""The play and the stop, of which the other rate-independent operators are built.

    z_k = min(max(z_(k-1), u_k - r), u_k + r)
    y   = offset + gain z             Play: backlash of half width r; its loop runs counterclockwise
    y   = offset + gain (u - z)       Stop: a spring that slips at the elongation r; clockwise

u is the input, z the position that it pushes, r the threshold. Both are exact at the samples of an input that
is monotone between them, and do not depend on time. The stop is an elastic-perfectly plastic element; z is
then the place to which its spring is fixed.

Sources: M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np

from hysim._frozen import FloatArray
from hysim.models import _clamp_search
from hysim.models._clamps import ClampLaw, end_positions, positions
from hysim.models.model import model
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


class _Element(ClampLaw):
    """One play or stop."""

    thresholds_name: ClassVar[str] = "threshold"
    weights_name: ClassVar[str] = "gain"
    bank: ClassVar[bool] = False
    threshold: float
    gain: float

    @property
    def scalars(self) -> dict[str, float]:
        """Parameters by name, in the order of the constructor."""
        return {"threshold": self.threshold, "gain": self.gain, "offset": self.offset, "z0": self.z0}

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._clamp_search`."""
        return _clamp_search.single_space(self.scalars, record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns z (or u - z), 1 and 0 of the output, shape (n_sets, n_samples, 3)."""
        z = positions(*self._memory_of(parameters), record.u)
        element = record.u[:, np.newaxis] - z if self.stops else z
        return np.concatenate([element, np.ones_like(z), np.zeros_like(z)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the position of the steady cycle of which `record` is one period or more."""
        z = end_positions(*self._memory_of(parameters), record.u)
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        return {**parameters, "z0": z.reshape(shape)[()]}

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters."""
        return type(self)(**{**self.scalars, **parameters})

    def _memory_of(self, parameters: Parameters) -> tuple[FloatArray, FloatArray]:
        """Threshold and z0 over the sets, shape (n_sets, 1) each."""
        values = (np.ravel(parameters.get(name, getattr(self, name))) for name in ("threshold", "z0"))
        threshold, z0 = np.broadcast_arrays(*values)
        return threshold[:, np.newaxis], z0[:, np.newaxis]


@model
class Play(_Element):
    """Play (backlash) of half width r, ``y = offset + gain z``.

    Parameters
    ----------
    threshold : float
        Half width r, not negative [unit of u].
    gain : float
        [unit of y / unit of u].
    offset : float
        Output at z = 0 [unit of y].
    z0 : float
        Position before the first sample, which pushes it [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, or the threshold is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Play(threshold=0.25, gain=2.0).response([0.0, 1.0, 0.75, 0.0]).tolist()
    [0.0, 1.5, 1.5, 0.5]
    """

    stops: ClassVar[bool] = False
    threshold: float = 1.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0


@model
class Stop(_Element):
    """Stop (elastic-perfectly plastic element), ``y = offset + gain (u - z)``.

    Parameters
    ----------
    threshold : float
        Elongation r at which it slips, not negative [unit of u].
    gain : float
        Stiffness [unit of y / unit of u].
    offset : float
        Output of the relaxed element [unit of y].
    z0 : float
        Where it is fixed before the first sample, which may pull it along [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, or the threshold is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Stop(threshold=0.25, gain=2.0).response([0.0, 1.0, 0.75, 0.0]).tolist()
    [0.0, 0.5, 0.0, -0.5]
    """

    stops: ClassVar[bool] = True
    threshold: float = 1.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    @property
    def saturation(self) -> float:
        """What y - offset tends to on a long way upwards: gain r; its negative on the way down."""
        return self.gain * self.threshold
