"""Parts of a force that are a function of the velocity, times one coefficient: the viscous damper."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_not_negative, items, read_only
from hysim.kernels import stepping
from hysim.laws.static import linear_space
from hysim.models.batch import Batch, Reduction, Sets
from hysim.models.composable import Composable
from hysim.models.model import Example, family
from hysim.models.protocols import CompiledLaw, Startable, Subject, needed_time, positive_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import tables_of
from hysim.records import Record


class RatePart(Subject, Composable):
    """A part ``y = c f(u')``; a family has the field c, its step, f, and the power of the speed that f is."""

    dynamic: ClassVar[bool] = True
    power: ClassVar[float]
    step: ClassVar[Any]
    c: float

    @staticmethod
    @abstractmethod
    def of_velocity(velocity: FloatArray) -> FloatArray:
        """The function f of the velocity."""

    @property
    def scalars(self) -> dict[str, float]:
        """The coefficient by its name."""
        return {"c": self.c}

    def with_scalars(self, scalars: Mapping[str, float]) -> Self:
        """The part with another coefficient."""
        return type(self)(**{**items(self), **scalars})

    @classmethod
    def candidates(cls) -> dict[str, Any]:
        """None for `hysim.compare`: it is a part of sums."""
        return {}

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Output (n,) at the samples of `u` (n,), which rests before the first of them, every `sample_time` [s].

        Raises ValueError if `u` is not finite or has not one axis, or the sample time is not positive.
        """
        return self.advance(u, sample_time=sample_time)[0]

    def advance(
        self, u: npt.ArrayLike, state: float | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, float | None]:
        """Output continued from `state`, the last input, and the state after it; the same bits as uncut."""
        inputs = read_only(u, "u", ndim=1)
        time = positive_time(needed_time(self, sample_time))
        if not inputs.size:
            return inputs, state
        before = inputs[0] if state is None else state
        return self.c * self.of_velocity(np.diff(inputs, prepend=before) / time), float(inputs[-1])

    @classmethod
    def responses(
        cls,
        parameters: Parameters,
        u: npt.ArrayLike,
        sample_time: float,
        *,
        reduce: Reduction | None = None,
        target: npt.ArrayLike | None = None,
        workers: int | None = None,
    ) -> FloatArray:
        """Outputs of many parts at one sample time [s]; else as `hysim.Law.responses`."""
        time = positive_time(sample_time)
        tables, inputs = tables_of(cls.__name__, {"c": cls.c}, parameters, u)

        def compute(sets: Sets, u: FloatArray, y: FloatArray) -> None:
            y[:] = tables["c"][sets] * cls.of_velocity(np.diff(u, prepend=u[:, :1]) / time)

        return Batch(compute, len(tables["c"]), inputs).result(reduce, target, workers)

    def startable(self, sample_time: float | None = None) -> Startable:
        """The part at a sample time [s] as a step that runs from any first input, for exports."""
        parameters = read_only([self.c, positive_time(needed_time(self, sample_time))])
        return Startable(self.step, parameters, np.zeros(1), stepping.start)

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        """The part as compiled loops take it, at rest at the input `u0`; ValueError without a sample time [s]."""
        return self.startable(sample_time).started(u0)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Nothing to search: the output is linear in c."""
        if not record.sample_time or np.ptp(record.u) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        return linear_space({"c": self.c}, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns f(u'), 0, shape (1, n_samples, 2)."""
        of_one = self.with_scalars({"c": 1.0}).response(record.u, record.sample_time)
        return np.stack([of_one, np.zeros_like(of_one)], axis=-1)[np.newaxis]

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        return self.with_scalars(parameters)


@family
class Dashpot(RatePart):
    """Viscous damper, ``y = c u'``.

    Between the samples of an input that is linear there, u' is constant. At a sample the output is that of the stroke
    which ends there, the left limit: ``y_k = c (u_k - u_(k-1)) / h``.

    Parameters
    ----------
    c : float
        [unit of y s / unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Dashpot(c=2.0).response([0.0, 1.0, 1.0, 0.5], sample_time=0.5).tolist()
    [0.0, 4.0, 0.0, -2.0]
    """

    c: float = 1.0

    example = Example({"c": 2.0})
    power = 1.0
    step = staticmethod(stepping.dashpot)

    @staticmethod
    def of_velocity(velocity: FloatArray) -> FloatArray:
        return velocity

    @classmethod
    def eddy_currents(cls, *, conductivity: float, thickness: float) -> Self:
        """The field of classical eddy currents in a lamination by its flux density, ``H = sigma d^2 / 12 dB/dt``.

        It holds where the field in the lamination is even, that is where the skin depth is large beside d.

        Parameters
        ----------
        conductivity : float
            sigma, not negative [S/m].
        thickness : float
            d of the lamination, not negative [m].

        Returns
        -------
        Dashpot
            From the flux density [T] to the field [A/m].

        Raises
        ------
        ValueError
            If a number is negative.

        Examples
        --------
        >>> import hysim as hs
        >>> round(hs.Dashpot.eddy_currents(conductivity=2e6, thickness=0.3e-3).c, 6)
        0.015
        """
        check_not_negative(conductivity=conductivity, thickness=thickness)
        return cls(c=conductivity * thickness**2 / 12.0)
