"""Abilities of controllers, all but `compiled` optional; base class of the sampled ones, and their linear part."""

from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from hysim._frozen import FloatArray
from hysim.kernels.controllers import guarded
from hysim.models.protocols import CompiledController


@runtime_checkable
class Controller(Protocol):
    """Settings of a sampled controller."""

    def compiled(self, sample_time: float, u0: float, y0: float) -> CompiledController:
        """Step, parameters, and state at rest at the command `u0` and the displacement `y0`."""
        ...


@runtime_checkable
class Previewing(Protocol):
    """A controller that gets the reference ahead of its time."""

    def ahead(self, sample_time: float) -> int: ...


@runtime_checkable
class Limited(Protocol):
    @property
    def limits(self) -> tuple[float, ...] | None: ...


@runtime_checkable
class Substituting(Protocol):
    """A controller with a number of its own in place of a missing measurement; nan says that it goes without."""

    @property
    def substitute(self) -> float: ...


def begun(controller: Controller, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
    """A controller at rest, whose state has room for what `hysim.kernels.controllers.guarded` holds."""
    compiled = CompiledController(*controller.compiled(sample_time, u0, y0))
    substitute = controller.substitute if isinstance(controller, Substituting) else y0
    return compiled._replace(state=with_room(compiled.state, u0, y0, substitute))


def with_room(state: FloatArray, u: float, reference: float, measurement: float) -> FloatArray:
    """State of a controller, and what is held before the first valid sample."""
    return np.concatenate([state, [reference, measurement, u, 0.0]])


def held_samples(state: CompiledController) -> int:
    """Number of samples at which a controller has held its last valid inputs, or its last command.

    Parameters
    ----------
    state : CompiledController
        From a controller's ``step``, or ``initial``.

    Returns
    -------
    int

    Examples
    --------
    >>> import math, hysim as hs
    >>> pid = hs.PID(kp=1.0, ki=0.5)
    >>> u, state = pid.step(pid.initial(sample_time=1.0), reference=1.0, measurement=0.5)
    >>> again, state = pid.step(state, reference=1.0, measurement=math.nan)  # as if 0.5 were measured again
    >>> u, again, hs.control.held_samples(state)
    (0.5, 0.75, 1)
    """
    return int(state.state[-1])


def limits_of(controller: object) -> tuple[float, ...] | None:
    """Lowest and highest command of a controller; None for no limits."""
    return controller.limits if isinstance(controller, Limited) else None


def preview(controller: object, sample_time: float) -> int:
    """Number of samples by which a controller gets the reference ahead of its time."""
    return controller.ahead(sample_time) if isinstance(controller, Previewing) else 0


class Feedback(NamedTuple):
    """Linear system from the measurement m to the command, limits apart: x' = A x + B m, command = C x + D m."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    def then(self, other: "Feedback") -> "Feedback":
        return Feedback(
            np.block([[self.A, np.zeros((self.B.size, other.B.size))], [np.outer(other.B, self.C), other.A]]),
            np.concatenate([self.B, other.B * self.D]),
            np.concatenate([other.D * self.C, other.C]),
            other.D * self.D,
        )

    def beside(self, other: "Feedback") -> "Feedback":
        B, C = np.concatenate([self.B, other.B]), np.concatenate([self.C, other.C])
        return Feedback(block_diag(self.A, other.A), B, C, self.D + other.D)


class SampledController(ABC):
    """Frozen settings of a controller that is stepped from sample to sample."""

    @abstractmethod
    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        """Compiled step, parameters and state at rest at the command `u0` and the displacement `y0`."""

    @abstractmethod
    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Response from the negative measurement to the command at frequencies [rad/s], in their shape, limits apart.

        The frequencies must not be zero where there is an integral.
        """

    @abstractmethod
    def linear(self, sample_time: float) -> Feedback:
        """Linear system from the measurement to the command, limits apart."""

    def ahead(self, sample_time: float) -> int:
        """Samples by which the reference must be known ahead of its time."""
        return 0

    def initial(self, sample_time: float, u: float = 0.0, y: float = 0.0) -> CompiledController:
        """State to `step` from, at rest at a command [unit of u] and a displacement [unit of y].

        Raises
        ------
        ValueError
            If the sample time [s] is not positive and finite.
        """
        return begun(self, sample_time, u, y)

    def step(self, state: CompiledController, reference: float, measurement: float) -> tuple[float, CompiledController]:
        """Command for one sample, and the state after it; `state` itself does not change.

        A reference or measurement that is not finite, or beyond 1e100, is replaced by the last valid one;
        `hysim.control.held_samples` counts them.

        Parameters
        ----------
        state : CompiledController
            From `initial`, or from the step before.
        reference, measurement : float
            Reference, `ahead` of its time where the controller has preview, and measurement [unit of y].

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
        >>> u, state = pid.step(pid.initial(sample_time=1.0), reference=1.0, measurement=0.0)
        >>> u, pid.step(state, 1.0, 0.0)[0]
        (1.0, 1.5)
        """
        after = state._replace(state=np.array(state.state))
        return guarded(after.step, after.parameters, after.state, reference, measurement), after


class WithoutFeedback(SampledController):
    """Controllers of which the measurement does not move the command itself."""

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Zeros: there is no feedback."""
        return np.zeros(np.shape(frequency), dtype=complex)

    def linear(self, sample_time: float) -> Feedback:
        """No feedback, a system without states."""
        return Feedback(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)


def check_limits(limits: tuple[float, ...] | None) -> None:
    if limits is not None and not (len(limits) == 2 and limits[0] <= limits[1]):
        raise ValueError(f"limits must be (lowest, highest), got {limits}")
