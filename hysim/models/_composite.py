"""What sums and cascades of models share."""

from abc import abstractmethod
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.models import _parts
from hysim.models.by_structure import ByStructure
from hysim.models.composable import Composable
from hysim.models.inverse_search import inverse_response_of
from hysim.models.protocols import CompiledLaw, Continuable, needs_time

State = tuple[Any, ...]
"""The state of each member."""


class Composite(ByStructure, Composable):
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
        return inverse_response_of(self, outputs, u0)


def continued(part: Any, u: FloatArray, sample_time: float | None, state: Any) -> tuple[FloatArray, Any]:
    """Output of a part from `state` on, None for its first sample, and the state after it."""
    if not isinstance(part, Continuable):
        raise TypeError(f"a {type(part).__name__} cannot be continued")
    if isinstance(part, Composite):
        return part.advance(u, state, sample_time=sample_time)
    plant: Any = part
    y, end = plant.advance(u, _parts.given(part, sample_time), state) if needs_time(part) else part.advance(u, state)
    return np.asarray(y["y"] if isinstance(y, dict) else y), end
