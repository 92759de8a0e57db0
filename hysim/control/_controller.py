"""Abilities of controllers, all but `compiled` optional; base class of the sampled ones, and the PID.

A PID with two degrees of freedom; in continuous time, with the error e = r - y,

    u = kp (b r - y) + ki integral e dt + kd d/dt (c r - y) / (1 + T_f s),    within the limits

The paper's standard form (17), u = Kp (e + 1/Ti integral e dt + Td de/dt), is kp = Kp, ki = Kp / Ti,
kd = Kp Td, with b = c = 1 and T_f = 0. `hysim.kernels.controllers` has the sampled form.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from hysim._basics.frozen import FloatArray, Interval, NotNegative, read_only, vectors
from hysim.kernels import controllers as kernels
from hysim.models.model import family
from hysim.models.protocols import CompiledController, positive_time, standing


@runtime_checkable
class Controller(Protocol):
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


def compiled_of(step: Any, parameters: Sequence[Any], state: Sequence[Any]) -> CompiledController:
    """A compiled controller whose parameters and state are these parts, one after the other."""
    return CompiledController(step, read_only(np.concatenate(parameters), finite=False), np.concatenate(state))


def held_samples(state: CompiledController) -> int:
    """Number of samples at which a controller has held its last valid inputs, or its last command.

    `state` is what a controller's ``step`` or ``initial`` returned.

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


class SteppedController(ABC):
    """Frozen settings of a controller that is stepped from sample to sample."""

    keeps_limits: ClassVar[bool] = False  # in what it computes, so that a loop cannot see that they hold it

    @abstractmethod
    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        """Compiled step, parameters and state at rest at the command `u0` and the displacement `y0`."""

    def ahead(self, sample_time: float) -> int:
        """Samples by which the reference must be known ahead of its time."""
        return 0

    def scratch(self, sample_time: float) -> int:
        """Elements at the end of the state that a step writes before it reads them."""
        return 0

    def initial(self, sample_time: float, u: float | None = None, y: float = 0.0) -> CompiledController:
        """State to `step` from, at rest at a command and a displacement; ValueError for a bad sample time [s].

        By default the command is that at which the law of the controller stands, or zero.
        """
        return begun(self, sample_time, standing(self, u), y)

    def step(self, state: CompiledController, reference: float, measurement: float) -> tuple[float, CompiledController]:
        """Command for one sample, the same bits as in a loop, and the state after it; `state` does not change.

        `state` is from `initial` or the step before; the reference, `ahead` of its time where the controller has
        preview, and the measurement are in [unit of y]. One that is not finite, or beyond 1e100, is replaced by the
        last valid one; `hysim.control.held_samples` counts them.

        Examples
        --------
        >>> import hysim as hs
        >>> pid = hs.PID(kp=1.0, ki=0.5)
        >>> u, state = pid.step(pid.initial(sample_time=1.0), reference=1.0, measurement=0.0)
        >>> u, pid.step(state, 1.0, 0.0)[0]
        (1.0, 1.5)
        """
        after = state._replace(state=np.array(state.state))
        return kernels.guarded(after.step, after.parameters, after.state, reference, measurement), after


class SampledController(SteppedController):
    """A controller with a linear part, limits apart."""

    @abstractmethod
    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Response from the negative measurement to the command at frequencies [rad/s], in their shape, limits apart.

        The frequencies must not be zero where there is an integral.
        """

    @abstractmethod
    def linear(self, sample_time: float) -> Feedback:
        """Linear system from the measurement to the command, limits apart."""


class WithoutFeedback(SampledController):
    """Controllers whose command does not depend on the measurement."""

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        return np.zeros(np.shape(frequency), dtype=complex)

    def linear(self, sample_time: float) -> Feedback:
        return Feedback(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)


State = tuple[float, float, float, float]
"""Last command before the limits, integral part, derivative part, and last c r - y."""


@family
class PID(SampledController):
    """Sampled PID controller with limits, anti-windup and a filtered derivative.

    Parameters
    ----------
    kp, ki, kd : float
        Gains: proportional [unit of u / unit of y], integral [unit of u / (unit of y s)] and derivative
        [unit of u s / unit of y], of the sign of the plant's gain.
    derivative_filter : float
        Time constant T_f of the derivative's first-order filter [s]; 0 for none.
    limits : (float, float), optional
        Lowest and highest voltage; None for none [unit of u].
    tracking_time : float, optional
        Time constant with which the integral unwinds while the voltage is limited [s], at least a sample time; by
        default sqrt(Ti Td), and Ti without a derivative.
    setpoint_weight, derivative_weight : float
        b and c, the weights of the reference in the proportional action and in the derivative; c = 0 avoids a kick at a
        step of the reference, 1 takes the error.

    Raises
    ------
    ValueError
        If a number is not finite, a time is negative, or the limits are not an interval.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.PID.standard(2.0, Ti=4.0, Td=0.5) == hs.PID(kp=2.0, ki=0.5, kd=1.0)
    True
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    derivative_filter: NotNegative = 0.0
    limits: Interval | None = None
    tracking_time: NotNegative | None = None
    setpoint_weight: float = 1.0
    derivative_weight: float = 0.0

    @classmethod
    def standard(
        cls,
        Kp: float,
        Ti: float = math.inf,
        Td: float = 0.0,
        *,
        derivative_filter: float = 0.0,
        limits: tuple[float, float] | None = None,
        tracking_time: float | None = None,
        setpoint_weight: float = 1.0,
        derivative_weight: float = 0.0,
    ) -> Self:
        """PID in its standard form, u = Kp (e + 1/Ti integral e dt + Td de/dt); other arguments as of the constructor.

        `Kp` is the gain [unit of u / unit of y], `Ti` the integral time, infinite for none, and `Td` the derivative
        time [s]. Raises ValueError if `Ti` is not positive, or as the constructor.
        """
        if not Ti > 0.0:
            raise ValueError(f"Ti must be positive, got {Ti}: an infinite one leaves the integral out")
        return cls(
            kp=Kp,
            ki=Kp / Ti,
            kd=Kp * Td,
            derivative_filter=derivative_filter,
            limits=limits,
            tracking_time=tracking_time,
            setpoint_weight=setpoint_weight,
            derivative_weight=derivative_weight,
        )

    def start(self, u: float = 0.0, y: float = 0.0) -> State:
        """State at rest at the voltage `u` and the displacement `y`."""
        return u, u - self.kp * (self.setpoint_weight - 1.0) * y, 0.0, (self.derivative_weight - 1.0) * y

    def advance(
        self, reference: npt.ArrayLike, measurement: npt.ArrayLike, sample_time: float, state: State | None = None
    ) -> tuple[FloatArray, State]:
        """Voltages (n,) [unit of u] within the limits, the same bits as in a loop, and the state after the last sample.

        `reference` and `measurement` are (n,) [unit of y], `sample_time` is in [s], and `state` is one to continue
        from, by default `start` at no voltage and at the first measurement. A ValueError is raised if lengths differ, a
        value is not finite, the sample time is not positive, or the state has not 4 numbers.

        Examples
        --------
        >>> import hysim as hs
        >>> u, state = hs.PID(kp=1.0, ki=0.5).advance([1.0, 1.0], [0.0, 0.0], sample_time=1.0)
        >>> u.tolist(), state[1]
        ([1.0, 1.5], 1.0)
        """
        r, y = vectors(reference=reference, measurement=measurement)
        rest = float(y[0]) if y.size else 0.0
        numbers = read_only(self.start(y=rest) if state is None else state, "state", ndim=1)
        if numbers.size != 4:
            raise ValueError(f"state must hold 4 numbers, as `start` gives them, got {numbers.size}")
        state_after = with_room(numbers, float(numbers[0]), rest, rest)
        command, u = np.empty((1, r.size)), np.empty(r.size)
        step, parameters, _ = self.compiled(sample_time)
        kernels.replay(step, parameters, state_after, r, y, command, u)
        last, integral, derivative, weighted = state_after[:4].tolist()
        return u, (last, integral, derivative, weighted)

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        z = np.exp(1j * np.asarray(frequency, dtype=float) * sample_time)
        lag = self.derivative_filter + sample_time
        derivative = self.kd / lag * (z - 1.0) / (z - self.derivative_filter / lag)
        integral = self.ki * sample_time / (z - 1.0) if self.ki else 0.0
        return np.asarray(self.kp + integral + derivative)

    def linear(self, sample_time: float) -> Feedback:
        """Linear system from the measurement to the command; the states are I, D and the last measurement."""
        lag, integrates = self.derivative_filter + sample_time, 1.0 if self.ki else 0.0
        rate, decay = self.kd / lag, self.derivative_filter / lag
        return Feedback(
            np.array([[integrates, 0.0, 0.0], [0.0, decay, rate], [0.0, 0.0, 0.0]]),
            np.array([-self.ki * sample_time, -rate, 1.0]),
            np.array([integrates, decay, rate]),
            -(self.kp + rate),
        )

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        positive_time(sample_time)
        lowest, highest = self.limits or (-math.inf, math.inf)
        lag = self.derivative_filter + sample_time
        parameters = [
            self.kp, self.ki * sample_time, self.kd / lag, self.derivative_filter / lag, self.setpoint_weight,
            self.derivative_weight, lowest, highest, self._tracking(sample_time),
        ]  # fmt: skip
        return CompiledController(kernels.pid, read_only(parameters, finite=False), np.array(self.start(u0, y0)))

    def _tracking(self, sample_time: float) -> float:
        if self.ki == 0.0:
            return 0.0
        usual = math.sqrt(abs(self.kd / self.ki)) if self.kd else abs(self.kp / self.ki)
        return sample_time / max(sample_time, usual if self.tracking_time is None else self.tracking_time)
