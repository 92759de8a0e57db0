"""Yardsticks without memory: a model that does not beat them has learnt nothing about hysteresis."""

import math
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels import inverses, stepping
from hysim.laws._smoothing import equal_inputs, smoothing_spline
from hysim.models.composable import Composable
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, space_of
from hysim.models.protocols import UNLIMITED, CompiledLaw, DirectFit, Limits
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record


@family
class Line(Law):
    """Straight line ``y = offset + slope u``.

    Parameters
    ----------
    offset, slope : float
        [unit of y], [unit of y / unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Line(offset=1.0, slope=2.0).response([0.0, 1.0]).tolist()
    [1.0, 3.0]
    """

    offset: float = 0.0
    slope: float = 0.0

    example = Example({"offset": 1.0, "slope": 2.0})
    step = staticmethod(stepping.line)
    initial: ClassVar[tuple[str, ...]] = ()
    searched = (Parameter("offset", unit="y", affine=True), Parameter("slope", unit="y/u", affine=True))
    memory = None  # type: ignore[assignment]  # a line remembers nothing

    @property
    def known_slopes(self) -> tuple[float, float]:
        """The slope."""
        return self.slope, self.slope

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        if not self.slope:
            raise ValueError("the law has no inverse: its slope is zero")
        parameters = read_only([*limits, self.offset, self.slope], finite=False)
        return CompiledLaw(inverses.line, parameters, np.array([u0, self.offset + self.slope * u0]))


@family
class SingleValued(Composable):
    """A function of the input alone, linear between knots and constant outside.

    `hysim.identify` fits a cubic smoothing spline to the mean outputs of equal inputs, and takes its values at the
    record's inputs as the knots (at most about a thousand). The spline's strength is the one that predicts best what
    is left out, in blocks of neighbouring inputs, so that it follows the mean of loading and unloading
    (`hysim.laws._smoothing`). The number of parameters is that of its degrees of freedom, rounded.

    Parameters
    ----------
    u, y : array, shape (m,)
        Knots: increasing inputs, and the outputs there.

    Raises
    ------
    ValueError
        If the shapes differ or the inputs do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.SingleValued(u=[0.0, 1.0], y=[0.0, 2.0]).response([0.5, 3.0]).tolist()
    [1.0, 2.0]
    """

    u: FloatArray
    y: FloatArray

    example = Example({"u": (0.0, 1.0), "y": (0.0, 2.0)}, (-10.0, 10.0))

    def __post_init__(self) -> None:
        if self.u.ndim != 1 or self.u.shape != self.y.shape or not self.u.size:
            raise ValueError(f"u and y must be equally long vectors, got shapes {self.u.shape} and {self.y.shape}")
        if not (np.diff(self.u) > 0.0).all():
            raise ValueError("the knots' inputs u must increase")

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n,)."""
        return np.interp(read_only(u, "u", ndim=1), self.u, self.y)

    def advance(
        self, u: npt.ArrayLike, state: tuple[()] | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, tuple[()]]:
        """Output at the samples of `u`, and a state that holds nothing."""
        return self.response(u), ()

    @classmethod
    def fitted(cls, u: FloatArray, y: FloatArray) -> DirectFit:
        """The smoothing spline of outputs `y` at inputs `u`, both of shape (n,).

        Raises ValueError if the input is constant.
        """
        if np.ptp(u) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        smooth = smoothing_spline(u, y)
        return DirectFit(cls(u=smooth.u, y=smooth.y), smooth.degrees_of_freedom, smooth.spread)

    @classmethod
    def through_means(cls, record: Record) -> Self:
        """The curve through the mean output at each input of a record, equal to 1e-9 of their span.

        No function of the input fits the record better: its fit is the bound of all models without memory. It predicts
        nothing where inputs do not repeat, and is no model of the actuator; that is what `hysim.identify` fits.

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.datasets.table1()
        >>> curve = hs.SingleValued.through_means(rec)
        >>> curve.u.size, round(hs.metrics.fit_percent(rec.y, curve.response(rec.u)), 2)
        (26, 90.27)
        """
        place = equal_inputs(record.u)
        first = np.unique(place, return_index=True)[1]
        return cls(u=record.u[first], y=np.bincount(place, record.y) / np.bincount(place))


def linear_space(defaults: Mapping[str, float], freedom: Freedom) -> SearchSpace:
    """The space of a family whose parameters are all linear, by their defaults."""
    held = freedom.held(defaults)
    return space_of((), tuple(defaults), defaults, held, freedom.limits(defaults, held))
