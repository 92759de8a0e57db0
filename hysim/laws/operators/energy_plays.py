"""Energy-based plays: cells of dry friction, each followed by an anhysteretic curve."""

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import energy_plays as kernels
from hysim.laws.operators._bank import Plays
from hysim.laws.operators._bank_search import Axis, BankStructure
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.search_space import Parameters
from hysim.records import Record

_SPACING = 2.0  # of the thresholds: finer towards zero


@family
class EnergyPlays(Plays, Law):
    """Energy-based plays, ``y = offset + feedthrough u + sum_i w_i L(z_i / field)`` over plays of the thresholds r_i.

    ``z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)`` is the reversible field of cell i, what a pinning force r_i
    leaves of the input, and ``L(x) = coth x - 1 / x`` the anhysteretic curve of all cells. u is the field H and y the
    flux density B. A cell dissipates r_i per unit of its magnetisation, whatever the path: with weights that are not
    negative no cycle yields energy, see `dissipated`. Inner loops are closed and wiped out, as those of plays. A law
    without cells, the default, is a line; as a start of `hysim.identify` it leaves the cells to the record, as
    ``EnergyPlays.structure()`` does. Sources: A. Bergqvist, Physica B 233 (1997) 342; F. Henrotte, A. Nicolet and K.
    Hameyer, COMPEL 25 (2006) 71.

    Parameters
    ----------
    thresholds : sequence of float, length n_plays
        Pinning force r_i of each cell, not negative and increasing [unit of u].
    weights : sequence of float, length n_plays
        Saturation w_i of each cell [unit of y].
    field : float
        Scale of the anhysteretic curve, positive [unit of u].
    feedthrough : float
        Slope dy/du at saturation [unit of y / unit of u]: the magnetic constant where y is a flux density.
    offset : float
        Output at rest at u = 0 [unit of y].
    z0 : float or sequence of float, length n_plays
        Reversible fields before the first sample, which pushes them [unit of u].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, the field not positive, or thresholds negative or not increasing.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.EnergyPlays(thresholds=(0.0, 20.0, 60.0), weights=(0.2, 0.7, 0.6), field=15.0)
    >>> core.response([0.0, 200.0, 0.0, -200.0]).round(4).tolist()
    [0.0, 1.3624, 0.7299, -1.3624]
    """

    units: ClassVar = {"thresholds": "u", "weights": "y", "field": "u", "feedthrough": "y/u", "offset": "y", "z0": "u"}
    positive = ("field",)
    is_curved = True
    axes = (Axis(Parameter("field", 3e-3, 3.0, unit="h", physical=(True, False)), (0.1, 0.03, 0.01, 0.3, 1.0)),)
    example = Example(
        {"thresholds": (0.0, 0.2, 0.5), "weights": (0.2, 0.6, 0.4), "field": 0.15},
        (-2.0, 2.0),
        title="Magnetic core: energy-based plays",
        group="Magnetic cores",
    )

    field: float = 1.0
    feedthrough: float = 0.0
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    step = staticmethod(kernels.step)
    step_fields = ("offset", "feedthrough", "field", "thresholds", "weights")

    @classmethod
    def structure(  # type: ignore[override]  # its weights have one sign
        cls, *, plays: int = 20, thresholds: npt.ArrayLike = ()
    ) -> BankStructure:
        """Cells for `hysim.identify`, whose weights and feedthrough have one sign: how many, or where.

        Parameters
        ----------
        plays : int
            Number of cells, with thresholds at the squares of even steps from zero up to half the span of the input.
        thresholds : sequence of float, optional
            The thresholds themselves [unit of u].

        Returns
        -------
        BankStructure
            The field is searched; weights, feedthrough and offset are solved for.

        Raises
        ------
        ValueError, TypeError
            If the number is not a positive int, or a threshold is not a finite number.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-100.0, 100.0, cycles=2, samples_per_cycle=60)
        >>> core = hs.EnergyPlays(thresholds=(0.0, 25.0), weights=(0.2, 1.0), field=15.0)
        >>> fit = hs.identify(hs.EnergyPlays.structure(plays=4), hs.Record(u=u, y=core.response(u)))
        >>> round(fit.estimates["field"], 3)
        15.0
        """
        plain = super().structure(plays=plays, thresholds=thresholds, one_signed=True)
        return replace(plain, spacing=_SPACING)

    def as_structure(self) -> BankStructure:
        """The structure with the thresholds of this law, its field first, or the default structure."""
        own = {"field": self.field} if self.thresholds else {}
        return replace(self.structure(), thresholds=self.thresholds, own=own)

    @classmethod
    def outputs_of_one(cls, z: FloatArray, parameters: Parameters, record: Record) -> FloatArray:
        """The curve at the positions (n_sets, n_samples, n_plays)."""
        return _langevin(z / np.reshape(parameters["field"], (-1, 1, 1)))

    @property
    def saturation(self) -> float:
        """Sum of the weights [unit of y]."""
        return sum(self.weights)

    @property
    def known_slopes(self) -> tuple[float, float]:
        """From all cells of negative weight at their steepest to all those of positive weight."""
        steepest = [weight / (3.0 * self.field) for weight in self.weights]
        low, high = (sum(side(slope, 0.0) for slope in steepest) for side in (min, max))
        return self.feedthrough + low, self.feedthrough + high

    @property
    def output_bounds(self) -> tuple[float, float]:
        """The weights on both sides of the offset; no limit with a feedthrough."""
        size = sum(map(abs, self.weights)) if self.feedthrough == 0.0 else math.inf
        return self.offset - size, self.offset + size

    def dissipated(self, u: npt.ArrayLike) -> FloatArray:
        """Energy that the cells have turned into heat since the first sample, ``sum_i r_i w_i |dL_i|``.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input [unit of u], monotone between the samples.

        Returns
        -------
        array, shape (n_samples,)
            [unit of u times unit of y]; a steady cycle adds its area. Never falls where no weight is negative.

        Raises
        ------
        ValueError
            If u is not finite or has not one axis.

        Examples
        --------
        >>> import hysim as hs
        >>> core = hs.EnergyPlays(thresholds=(20.0,), weights=(1.0,), field=15.0)
        >>> core.dissipated([0.0, 100.0, -100.0]).round(3).tolist()
        [0.0, 16.251, 48.753]
        """
        curves = _langevin(self.remembered(u) / self.field)
        displacement = np.abs(np.diff(curves, axis=0, prepend=curves[:1]))
        return np.asarray(np.cumsum(displacement, axis=0) @ (np.array(self.thresholds) * self.weights))


def _langevin(x: FloatArray) -> FloatArray:
    flat = read_only(x).ravel()
    values = np.empty_like(flat)
    kernels.anhysteretic(flat, values)
    return values.reshape(x.shape)
