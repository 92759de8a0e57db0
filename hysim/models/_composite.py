"""What sums and cascades of models share."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.models import _inverse_search, _parts
from hysim.models.composable import Composable
from hysim.models.model import CompiledLaw, needs_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[Any, ...]
"""The state of each member."""


class Composite(Composable, ABC):
    """Models that make one model. It is a law, rate-independent, unless one of them moves in time."""

    @property
    @abstractmethod
    def members(self) -> tuple[Any, ...]:
        """The models."""

    @abstractmethod
    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        """Output at the samples of `u`; only what moves in time needs the sample time [s]."""

    @abstractmethod
    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        """Output continued from `state`, and the state after the last sample."""

    @abstractmethod
    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it."""

    @abstractmethod
    def _structure(self) -> Any:
        """What is identified, from this as the start."""

    @property
    def dynamic(self) -> bool:
        """Whether a member moves in time."""
        return any(needs_time(member) for member in self.members)

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None) -> FloatArray:
        """Input that gives the output `y`, monotone between the samples.

        Parameters
        ----------
        y : array, shape (n,)
            Wanted output.
        u0 : float, optional
            Input at which the law rests before it moves to the first sample. By default the first sample finds it
            at its begin: the input is the one with the first output, found from u = 0.

        Returns
        -------
        array, shape (n,)
            Its `response` is y to the rounding of u, found by a bracket in compiled code.

        Raises
        ------
        SimulationError
            If the output does not reach a sample, or does not rise (or fall) all the way there; it names the sample.
        TypeError
            If a member is not a law that can be stepped.
        ValueError
            If y is not finite or has not one axis, a member moves in time, or the output does not tell where the
            input begins.
        """
        outputs = read_only(y, "y", ndim=1)
        if self.dynamic:
            raise ValueError("what moves in time has no inverse that depends on the output alone")
        if not outputs.size:
            return outputs
        here = _inverse_search.first_input(self, float(outputs[0])) if u0 is None else float(u0)
        reached = float(outputs[0]) if u0 is None else None
        inverse = _inverse_search.inverse_step(self.compiled(here), here, reached)
        return _inverse_search.inverse_response(inverse, outputs)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The members' spaces beside each other, as the `structure` has them."""
        space: SearchSpace = self._structure().search_space(record, freedom)
        return space

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns in which the output is affine, and what is known of it."""
        return np.asarray(self._structure().regressors(parameters, record))

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The model with these parameters."""
        found: Self = self._structure().assemble(parameters)
        return found

    def notes(self, record: Record, model: Self) -> tuple[str, ...]:
        """What the laws among the members say of themselves."""
        found: tuple[str, ...] = self._structure().notes(record, model)
        return found


def continued(part: Any, u: FloatArray, sample_time: float | None, state: Any) -> tuple[FloatArray, Any]:
    """Output of a part from `state` on, None for its first sample, and the state after it."""
    if not callable(getattr(part, "advance", None)):
        raise TypeError(f"a {type(part).__name__} cannot be continued")
    if isinstance(part, Composite):
        return part.advance(u, state, sample_time=sample_time)
    plant: Any = part
    y, end = plant.advance(u, _parts.given(part, sample_time), state) if needs_time(part) else part.advance(u, state)
    return np.asarray(y["y"] if isinstance(y, dict) else y), end
