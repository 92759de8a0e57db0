"""Base class of the sampled controllers, and their linear part."""

import functools
import math
from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.kernels.tracking import bound
from hysim.models.model import CompiledController

with_inverse = functools.lru_cache(maxsize=256)(bound)
"""The controller of a kernel of `hysim.kernels.tracking` and the inverse of a law."""


class Feedback(NamedTuple):
    """What a controller makes of the measurement, limits apart: x' = A x + B m, command = C x + D m."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    def then(self, other: "Feedback") -> "Feedback":
        """This one, and another behind it."""
        return Feedback(
            np.block([[self.A, np.zeros((self.B.size, other.B.size))], [np.outer(other.B, self.C), other.A]]),
            np.concatenate([self.B, other.B * self.D]),
            np.concatenate([other.D * self.C, other.C]),
            other.D * self.D,
        )

    def beside(self, other: "Feedback") -> "Feedback":
        """The sum of both."""
        n, m = self.B.size, other.B.size
        return Feedback(
            np.block([[self.A, np.zeros((n, m))], [np.zeros((m, n)), other.A]]),
            np.concatenate([self.B, other.B]),
            np.concatenate([self.C, other.C]),
            self.D + other.D,
        )


class SampledController(ABC):
    """Frozen settings that give a compiled step with its state."""

    @abstractmethod
    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        """The controller as compiled loops take it, at rest at the command `u0` and the displacement `y0`."""

    @abstractmethod
    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """From the negative measurement to the command, limits apart, at frequencies [rad/s] in their shape."""

    @abstractmethod
    def linear(self, sample_time: float) -> Feedback:
        """From the measurement to the command, limits apart."""

    def ahead(self, sample_time: float) -> int:
        """By how many samples the reference must be known ahead of its time; 0 for a controller without preview."""
        return 0

    def initial(self, sample_time: float, u: float = 0.0, y: float = 0.0) -> CompiledController:
        """The state at rest, to `step` from.

        Parameters
        ----------
        sample_time : float
            [s]
        u, y : float
            Command and displacement that have been held for ever [unit of u], [unit of y].

        Returns
        -------
        CompiledController
            The compiled step, its parameters and its state.

        Raises
        ------
        ValueError
            If the sample time is not positive and finite.
        """
        return self.compiled(sample_time, u, y)

    def step(self, state: CompiledController, reference: float, measurement: float) -> tuple[float, CompiledController]:
        """The command for one sample, and the state after it; `state` itself stays as it is.

        Parameters
        ----------
        state : CompiledController
            From `initial`, or from the step before.
        reference, measurement : float
            The reference `ahead` of its time, and the measurement now [unit of y].

        Returns
        -------
        u : float
            Within the limits, the same bits as in a loop.
        state : CompiledController
            To continue from.

        Examples
        --------
        >>> import hysim as hs
        >>> pid = hs.PID(kp=1.0, ki=0.5)
        >>> state = pid.initial(sample_time=1.0)
        >>> u, state = pid.step(state, reference=1.0, measurement=0.0)
        >>> u, pid.step(state, 1.0, 0.0)[0]
        (1.0, 1.5)
        """
        moved = state._replace(state=np.array(state.state))
        return moved.step(moved.parameters, moved.state, reference, measurement), moved


def check_kind(name: str, part: Any, kind: type) -> None:
    """Raise a TypeError if a part is there and not of its kind."""
    if part is not None and not isinstance(part, kind):
        raise TypeError(f"{name} must be of {kind.__name__}, got {type(part).__name__}")


def check_limits(limits: tuple[float, ...] | None) -> None:
    """Raise a ValueError if limits are given and are no interval."""
    if limits is not None and not (len(limits) == 2 and limits[0] <= limits[1]):
        raise ValueError(f"limits must be (lowest, highest), got {limits}")


def check_sample_time(sample_time: float) -> None:
    """Raise a ValueError if a sample time is not positive and finite."""
    if not 0.0 < sample_time < math.inf:
        raise ValueError(f"sample_time must be positive and finite, got {sample_time}")
