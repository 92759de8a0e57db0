"""Linear plants by their matrices; those of other packages by A, B, C and D, or num and den."""

import math
from collections.abc import Sized
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
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
    D : float
        What passes through [unit of y / unit of u].
    delay : float
        Dead time [s], not negative.

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
    delay: float = 0.0

    def __post_init__(self) -> None:
        n = self.B.size
        if self.A.shape != (n, n) or self.B.shape != (n,) or self.C.shape != (n,):
            raise ValueError(
                f"A, B and C must have the shapes (n, n), (n,) and (n,), got {self.A.shape}, {self.B.shape} and "
                f"{self.C.shape}"
            )
        if self.delay < 0.0:
            raise ValueError(f"delay must not be negative, got {self.delay}")

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
