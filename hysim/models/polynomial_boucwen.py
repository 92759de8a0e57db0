"""The Bouc-Wen law beside a polynomial of the input, for asymmetric loops.

    dz/du = A - |z|^n (gamma + beta sign(z du))
    y = offset + c1 u + c2 u^2 + ... + gain z

What follows from the equations is in `hysim.models._boucwen_law`.

Source: the polynomial input for asymmetric piezoelectric loops after Wang, Chen and Bai 2015.
"""

from collections.abc import Mapping
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim.models._boucwen_law import BoucWenLaw
from hysim.models.model import model
from hysim.models.search_space import Parameters


@model
class PolynomialBoucWen(BoucWenLaw):
    """Bouc-Wen law beside a polynomial of the input, ``y = offset + sum c_k u^k + gain z``.

    Parameters
    ----------
    A, beta, gamma, n, gain, offset, z0 : float
        As in `BoucWen`; z is driven by u itself.
    input_coefficients : sequence of float
        (c1, c2, ...) [unit of y / (unit of u)^k]; c1 is the feedthrough. Their number is the degree
        that `identify` fits.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, or there is no coefficient.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.PolynomialBoucWen(beta=0.5, gamma=0.5, gain=-1.0, input_coefficients=(2.0, 0.1))
    >>> law.response([0.0, 1.0, 0.0]).round(6).tolist()
    [0.0, 1.467879, 0.307799]
    """

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0, 0.0)

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """One name for each input coefficient."""
        return tuple(f"input_coefficients[{k}]" for k in range(len(self.input_coefficients)))

    @classmethod
    def _from_scalars(cls, scalars: Mapping[str, float]) -> Self:
        plain = {name: value for name, value in scalars.items() if not name.startswith("input_coefficients[")}
        degree = len(scalars) - len(plain)
        return cls(**plain, input_coefficients=tuple(scalars[f"input_coefficients[{k}]"] for k in range(degree)))

    @classmethod
    def _to_scalars(cls, parameters: Parameters) -> dict[str, npt.ArrayLike]:
        scalars = dict(parameters)
        coefficients = np.atleast_2d(np.asarray(scalars.pop("input_coefficients", cls.input_coefficients), float))
        return scalars | {f"input_coefficients[{k}]": column for k, column in enumerate(coefficients.T)}
