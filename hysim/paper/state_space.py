"""The paper's state-space forms and their controllability and observability.

    (7), (8)    x' = [[-1.1577, -2.6439], [1, 0]] x + [1; 0] u,   y = [0, 0.0579] x
    (13), (14)  x' = [[-0.1187, -2.430], [1, 0]] x + [1; 0] u,    y = [0, -0.0722] x
    (9), (11)   Gc = [B, A B],   Go = [C; C A]

These are companion forms: k / (s^2 + a_1 s + a_0) becomes A = [[-a_1, -a_0], [1, 0]], B = [1; 0], C = [0, k].
"""

from typing import Any

import numpy as np

from hysim._frozen import FloatArray, checked
from hysim.paper import printed
from hysim.paper.printed import Matrix, floats
from hysim.plants.transfer_function import TransferFunction

_ROUNDING = 1e-12  # leading coefficients of this size, relative to the largest, are what is left of zeros


@checked
class StateSpace:
    """x' = A x + B u, y = C x, time in the model's own unit.

    Parameters
    ----------
    A : array, shape (n, n)
    B : array, shape (n, 1)
    C : array, shape (1, n)
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray

    def to_ss(self) -> Any:
        """The python-control state-space system."""
        import control

        return control.ss(self.A, self.B, self.C, 0.0)

    @property
    def controllability(self) -> FloatArray:
        """[B, A B, ...], equation (9), by python-control."""
        import control

        return np.asarray(control.ctrb(self.A, self.B))

    @property
    def observability(self) -> FloatArray:
        """[C; C A; ...], equation (11), by python-control."""
        import control

        return np.asarray(control.obsv(self.A, self.C))

    @property
    def transfer_function(self) -> TransferFunction:
        """C (s I - A)^-1 B."""
        import control

        system = control.ss2tf(self.to_ss())
        num, den = system.num_array[0, 0], system.den_array[0, 0]
        num = np.where(np.abs(num) > _ROUNDING * np.abs(num).max(), num, 0.0)
        return TransferFunction(num=tuple(np.trim_zeros(num, "f")), den=tuple(den))


def companion(model: TransferFunction) -> StateSpace:
    """The companion form in which the paper writes (7), (8), (13), (14), of a strictly proper model.

    Raises
    ------
    ValueError
        If the numerator's degree is the denominator's.

    Examples
    --------
    >>> form = companion(TransferFunction(num=(3.0,), den=(1.0, 2.0, 5.0)))
    >>> form.A.tolist(), form.C.tolist()
    ([[-2.0, -5.0], [1.0, 0.0]], [[0.0, 3.0]])
    """
    if len(model.num) > model.order:
        raise ValueError("a companion form without feedthrough needs a strictly proper model")
    den = np.array(model.den) / model.den[0]
    A = np.vstack([-den[1:], np.eye(model.order - 1, model.order)])
    C = np.concatenate([np.zeros(model.order - len(model.num)), np.array(model.num) / model.den[0]])
    return StateSpace(A=A, B=np.eye(model.order, 1), C=C[np.newaxis])


def array(matrix: Matrix) -> FloatArray:
    """A printed matrix as numbers."""
    return np.array([floats(row) for row in matrix])


EQUATIONS_7_8 = StateSpace(A=array(printed.A_7), B=array(printed.B), C=array(printed.C_8))
EQUATIONS_13_14 = StateSpace(A=array(printed.A_13), B=array(printed.B), C=array(printed.C_14))
