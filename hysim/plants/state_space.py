"""Linear plants by their matrices, those of other packages by A, B, C and D, or num and den, and resonances."""

import math
from collections.abc import Sized
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, NotNegative, check_not_negative, check_positive
from hysim.models.model import family
from hysim.plants.transfer_function import TransferFunction


@family
class StateSpace:
    """A linear stage with one input and one output.

    ``x' = A x + B u(t - delay)`` and ``y = C x + D u(t - delay)``

    Parameters
    ----------
    A : array, shape (n, n)
        [1/s]
    B, C : array, shape (n,)
        Input and output.
    D, delay : float
        What passes through [unit of y / unit of u], and dead time [s], not negative.

    Raises
    ------
    ValueError
        If shapes do not fit, or the delay is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.StateSpace(A=[[-2.0]], B=[1.0], C=[3.0])
    >>> lag.dc_gain, lag.poles.real.tolist()
    (1.5, [-2.0])
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float = 0.0
    delay: NotNegative = 0.0

    def __post_init__(self) -> None:
        n = self.B.size
        if self.A.shape != (n, n) or self.B.shape != (n,) or self.C.shape != (n,):
            raise ValueError(
                f"A, B and C must have the shapes (n, n), (n,) and (n,), got {self.A.shape}, {self.B.shape} and "
                f"{self.C.shape}"
            )

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of A [rad/s]."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @property
    def dc_gain(self) -> float:
        """Output under a constant input of one, at rest; infinite with a pole at zero."""
        rest = resting_states(self.A, self.B)
        return self.D + float(self.C @ rest) if np.isfinite(rest).all() else math.inf


def resting_states(A: FloatArray, B: FloatArray) -> FloatArray:
    """The x with A x + B = 0; infinite where A is singular."""
    try:
        return np.asarray(np.linalg.solve(A, -B))
    except np.linalg.LinAlgError:
        return np.full(B.size, math.inf)


def linear_plant(system: Any) -> Any:
    """A system of another package as a plant of hysim; ValueError if it is discrete or has several signals."""
    by_matrices = all(hasattr(system, name) for name in "ABCD")  # systems of SciPy and python-control share no class
    own = isinstance(system, StateSpace | TransferFunction)
    if own or not (by_matrices or all(hasattr(system, name) for name in ("num", "den"))):
        return system
    if getattr(system, "dt", None):
        raise ValueError(f"vibration must be a system in continuous time, got one with dt = {system.dt}")
    if by_matrices:
        A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
        if D.size != 1:
            raise ValueError(f"vibration must have one input and one output, got D of the shape {D.shape}")
        return StateSpace(A=A, B=B.ravel(), C=C.ravel(), D=float(D.item()))
    return TransferFunction(num=_polynomial(system.num), den=_polynomial(system.den))


def _polynomial(coefficients: Any) -> tuple[float, ...]:
    """Coefficients as such, or as the one entry of a matrix of them."""
    while len(coefficients) == 1 and isinstance(coefficients[0], Sized):
        coefficients = coefficients[0]
    if isinstance(coefficients[0], Sized):
        raise ValueError("vibration must have one input and one output, got a matrix of transfer functions")
    return tuple(float(value) for value in np.trim_zeros(np.asarray(coefficients), "f")) or (0.0,)


def mode(natural_frequency: float, damping_ratio: float, gain: float = 1.0, *, delay: float = 0.0) -> TransferFunction:
    """One resonance as a transfer function, ``exp(-delay s) gain w^2 / (s^2 + 2 zeta w s + w^2)``.

    The natural frequency w is positive [rad/s], the damping ratio zeta and the delay [s] are not negative, else
    ValueError; the gain is that at rest [unit of y / unit of its input].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.mode(2.0, 0.1).den
    (1.0, 0.4, 4.0)
    """
    check_positive(natural_frequency=natural_frequency)
    check_not_negative(damping_ratio=damping_ratio)
    damping, stiffness = 2.0 * damping_ratio * natural_frequency, natural_frequency**2
    return TransferFunction(num=(gain * stiffness,), den=(1.0, damping, stiffness), delay=delay)


@family
class Modes:
    """Several resonances side by side.

    ::

        G(s) = exp(-delay s) sum_i  g_i w_i^2 / (s^2 + 2 zeta_i w_i s + w_i^2)
        d/dt (q_i, q_i' / w_i) = w_i [[0, 1], [-1, -2 zeta_i]] (q_i, q_i' / w_i) + (0, w_i v),    y = sum g_i q_i

    Parameters
    ----------
    natural_frequencies, damping_ratios : sequence of float
        Positive [rad/s], and not negative.
    gains : sequence of float
        Static gains; their sum is the gain at rest [unit of y / unit of the input].
    delay : float
        Dead time [s], not negative.

    Raises
    ------
    ValueError
        If lengths differ or a number is outside its range.

    Examples
    --------
    >>> import hysim as hs
    >>> pair = hs.Modes(natural_frequencies=(3.0, 20.0), damping_ratios=(0.01, 0.02), gains=(0.9, 0.1))
    >>> pair.dc_gain, pair.poles.size
    (1.0, 4)
    """

    natural_frequencies: tuple[float, ...]
    damping_ratios: tuple[float, ...]
    gains: tuple[float, ...]
    delay: NotNegative = 0.0

    def __post_init__(self) -> None:
        lengths = len(self.natural_frequencies), len(self.damping_ratios), len(self.gains)
        if len(set(lengths)) > 1 or not lengths[0]:
            raise ValueError(
                "natural_frequencies, damping_ratios and gains must be equally long, and hold a mode, got lengths "
                f"{lengths[0]}, {lengths[1]} and {lengths[2]}"
            )
        check_positive(natural_frequencies=min(self.natural_frequencies))
        check_not_negative(damping_ratios=min(self.damping_ratios))

    @property
    def dc_gain(self) -> float:
        """Sum of the static gains."""
        return float(sum(self.gains))

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Two of each mode [rad/s]."""
        w, zeta = np.array(self.natural_frequencies), np.array(self.damping_ratios)
        apart = np.sqrt(zeta.astype(complex) ** 2 - 1.0)
        return np.concatenate([w * (-zeta + apart), w * (-zeta - apart)])

    @property
    def state_space(self) -> StateSpace:
        """The states (q_i, q_i' / w_i) of each mode."""
        n = len(self.gains)
        A, B, C = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.zeros(2 * n)
        for i, (w, zeta) in enumerate(zip(self.natural_frequencies, self.damping_ratios, strict=True)):
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, w], [-w, -2.0 * zeta * w]]
        B[1::2], C[::2] = self.natural_frequencies, self.gains
        return StateSpace(A=A, B=B, C=C, delay=self.delay)
