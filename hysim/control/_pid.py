"""PID with two degrees of freedom; in continuous time, with the error e = r - y,

    u = kp (b r - y) + ki integral e dt + kd d/dt (c r - y) / (1 + T_f s),    within the limits

The paper's standard form (17), u = Kp (e + 1/Ti integral e dt + Td de/dt), is kp = Kp, ki = Kp / Ti,
kd = Kp Td, with b = c = 1 and T_f = 0. `hysim.kernels.controllers` has the sampled form.
"""

import math
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_not_negative, read_only, vectors
from hysim.control._controller import Feedback, SampledController, check_limits, with_room
from hysim.kernels import controllers as kernels
from hysim.models.model import family
from hysim.models.protocols import CompiledController, positive_time

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
    setpoint_weight : float
        b, the weight of the reference in the proportional action.
    derivative_weight : float
        c, the weight of the reference in the derivative: 0 avoids a kick at a step of the reference, 1 differentiates
        the error.

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
    derivative_filter: float = 0.0
    limits: tuple[float, ...] | None = None
    tracking_time: float | None = None
    setpoint_weight: float = 1.0
    derivative_weight: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative(derivative_filter=self.derivative_filter, tracking_time=self.tracking_time)
        check_limits(self.limits)

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
        """PID in its standard form, u = Kp (e + 1/Ti integral e dt + Td de/dt).

        Parameters
        ----------
        Kp : float
            Gain [unit of u / unit of y].
        Ti, Td : float
            Integral time, positive and infinite for none, and derivative time [s].
        derivative_filter, limits, tracking_time, setpoint_weight, derivative_weight
            As in the constructor.

        Returns
        -------
        PID

        Raises
        ------
        ValueError
            If Ti is not positive, or as the constructor.
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
        """Voltages within the limits, the same bits as in a loop, and the state after the last sample.

        Parameters
        ----------
        reference, measurement : array, shape (n,)
            [unit of y]
        sample_time : float
            [s]
        state : State, optional
            To continue from; by default `start` at no voltage and at the first measurement.

        Returns
        -------
        u : array, shape (n,)
            Commands within the limits [unit of u].
        state : tuple
            To continue from.

        Raises
        ------
        ValueError
            If lengths differ, a value is not finite, the sample time is not positive, or the state has not 4 numbers.

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
        command, u = np.empty((2, r.size))
        step, parameters, _ = self.compiled(sample_time)
        kernels.replay(step, parameters, state_after, r, y, command, u)
        last, integral, derivative, weighted = state_after[:4].tolist()
        return u, (last, integral, derivative, weighted)

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Response from the negative measurement to the command at frequencies [rad/s], not zero with an integral."""
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
