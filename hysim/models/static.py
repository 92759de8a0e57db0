"""Yardsticks without memory: what a model must beat to have learnt anything about hysteresis.

Line           y = offset + slope u
SingleValued   y = f(u), linear between knots; fitted, the mean output at each input of the record,
               which no function of the input alone can beat
"""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels import stepping
from hysim.models.composable import Composable
from hysim.models.model import CompiledLaw, model
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


@model
class Line(Composable):
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

    columns: ClassVar[tuple[str, ...]] = ("offset", "slope")

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n,)."""
        return self.offset + self.slope * read_only(u, "u", ndim=1)

    def advance(self, u: npt.ArrayLike, state: tuple[()] | None = None) -> tuple[FloatArray, tuple[()]]:
        """Output at the samples of `u`, and a state that holds nothing."""
        return self.response(u), ()

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The line as compiled loops take it; it has no state, whatever the input `u0` before."""
        return CompiledLaw(stepping.line, read_only([self.offset, self.slope]), np.empty(0))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Nothing to search: both parameters are linear."""
        if np.ptp(record.u) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        return linear_space(dict.fromkeys(self.columns, 0.0), freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns 1, u, 0, shape (1, n_samples, 3)."""
        return np.stack([np.ones(len(record)), record.u, np.zeros(len(record))], axis=-1)[np.newaxis]

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The line with these parameters."""
        return type(self)(**parameters)


@model
class SingleValued(Composable):
    """A function of the input alone, linear between knots and constant outside.

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

    def __post_init__(self) -> None:
        if self.u.ndim != 1 or self.u.shape != self.y.shape or not self.u.size:
            raise ValueError(f"u and y must be equally long vectors, got shapes {self.u.shape} and {self.y.shape}")
        if not (np.diff(self.u) > 0.0).all():
            raise ValueError("the knots' inputs u must increase")

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n,)."""
        return np.interp(read_only(u, "u", ndim=1), self.u, self.y)

    def advance(self, u: npt.ArrayLike, state: tuple[()] | None = None) -> tuple[FloatArray, tuple[()]]:
        """Output at the samples of `u`, and a state that holds nothing."""
        return self.response(u), ()

    @classmethod
    def search_space(cls, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """One linear parameter for each different input of the record, ``"y(0)"``, ``"y(2.5)"``, ..."""
        return linear_space({_name(level): 0.0 for level in np.unique(record.u).tolist()}, freedom)

    @classmethod
    def regressors(cls, parameters: Parameters, record: Record) -> FloatArray:
        """Columns that tell which input a sample has, and zero, shape (1, n_samples, n_levels + 1)."""
        levels = np.append(np.unique(record.u), np.nan)
        return np.asarray(record.u[np.newaxis, :, np.newaxis] == levels, dtype=float)

    @classmethod
    def assemble(cls, parameters: Mapping[str, float]) -> Self:
        """The function through these points."""
        knots = sorted((float(name[2:-1]), value) for name, value in parameters.items())
        return cls(u=np.array([u for u, _ in knots]), y=np.array([y for _, y in knots]))


def _name(level: float) -> str:
    return f"y({repr(level + 0.0).removesuffix('.0')})"  # adding zero takes the sign off -0.0


def linear_space(defaults: Mapping[str, float], freedom: Freedom) -> SearchSpace:
    """The space of a family whose parameters are all linear, by their defaults."""
    held = freedom.held(defaults)
    names = tuple(name for name in defaults if name not in held)
    return SearchSpace(
        coordinates=(),
        lower=np.empty(0),
        upper=np.empty(0),
        starts=np.empty((0, 0)),
        names=names,
        columns=tuple(defaults),
        linear=names,
        held=held,
        parameters=lambda x: {},
        bounds=freedom.limits(defaults, held),
    )
