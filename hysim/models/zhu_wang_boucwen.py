"""The asymmetric Bouc-Wen law of Zhu and Wang.

    dz/du = A - |z|^n (gamma + beta sgn(z du)) + delta u sgn(du)
    y = offset + c1 u + c2 u^2 + ... + gain z

The last term is the slope's own share of the input: where u > 0 it steepens the rising branch and flattens
the falling one for a positive delta, and the other way round where u < 0, so that the loop is not symmetric
about its centre. n = 1 is evaluated in closed form, other n by power series to 1e-12 of the range
(`hysim.kernels.zhu_wang`).

Source: W. Zhu and D.-H. Wang, Sensors and Actuators A 181 (2012). In the rates there the term is commonly
printed as ``delta u sgn(u')``, beside terms in u'. As a share of z' that has no factor ``|u'|``, and the
loop would depend on the rate of the input. The form here has the factor, ``delta u |u'|``: it does not depend
on the rate, and has the same loops as the printed one under a triangle of unit slope.
"""

from typing import ClassVar

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels import zhu_wang as kernels
from hysim.kernels.stepping import Step
from hysim.models import _boucwen_search
from hysim.models._asymmetric import SteppedLaw
from hysim.models.model import model
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.records import Record


@model
class ZhuWangBoucWen(SteppedLaw):
    """Bouc-Wen law with the term ``delta u sgn(du)``, after Zhu and Wang (2012).

    ``dz/du = A - |z|^n (gamma + beta sgn(z du)) + delta u sgn(du)``, ``y = offset + sum c_k u^k + gain z``

    Parameters
    ----------
    A, beta, gamma, n, gain, offset, z0 : float
        As in `BoucWen`.
    delta : float
        Asymmetry of the branches [unit of z / (unit of u)^2]; zero is the Bouc-Wen law. Its sign depends on where
        u = 0 lies: an offset of the input is not the same law.
    input_coefficients : sequence of float
        (c1, c2, ...) [unit of y / (unit of u)^k]; c1 is the feedthrough. Their number is the degree that
        `identify` fits.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, or there is no coefficient.

    Notes
    -----
    Exact for n = 1. For other n the power series are good to 1e-12 of the range, and not called exact. No
    class of stability is known: the forcing delta u grows with the input.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.ZhuWangBoucWen(beta=0.5, gamma=0.5, delta=0.3)
    >>> law.response([0.0, 1.0, 0.0, 1.0]).round(6).tolist()
    [0.0, 0.742485, -0.291879, 0.710331]
    """

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    delta: float = 0.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0,)

    memory_names: ClassVar[tuple[str, ...]] = ("A", "beta", "gamma", "n", "delta", "z0")
    state_size: ClassVar[int] = kernels.N_STATE

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._boucwen_search`."""
        return _boucwen_search.search_space(self.scalars, self.columns, record, freedom)

    @property
    def _step(self) -> Step:
        return kernels.step

    @staticmethod
    def _step_parameters(memory: FloatArray, output: FloatArray) -> FloatArray:
        return np.concatenate([memory[:, :-1], output], axis=1)

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray) -> FloatArray:
        bend = np.abs(z) ** self.n * (self.gamma + self.beta * np.sign(z * direction))
        return np.asarray(self.A - bend + self.delta * u * direction)
