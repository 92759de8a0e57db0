"""The asymmetric Bouc-Wen law of Zhu and Wang.

Source: W. Zhu and D.-H. Wang, Sensors and Actuators A 181 (2012), whose paper we know from others' accounts: these
write the rate z' with the term ``delta u sgn(u')``, which has no factor of the speed and so makes the loop depend on
it. The form here is the term of dz/du, that is, ``delta u |u'|`` in z'. With the factor ``|u'|`` the printed term would
be ``delta u u'``: the law for an input u + delta u^2 / (2 A) in the first term alone.
"""

import math
from typing import Any

from hysim.kernels.elementary import power
from hysim.kernels.zhu_wang import ramp
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.boucwen import bouc_wen_with
from hysim.models.model import Example, family


@family
class ZhuWangBoucWen(MemoryLaw):
    """Bouc-Wen law with the term ``delta u sgn(du)``, after Zhu and Wang (2012).

    ``dz/du = A - |z|^n (gamma + beta sgn(z du)) + delta u sgn(du)``, ``y = offset + sum c_k u^k + gain z``

    The last term steepens the rising branch and flattens the falling one where delta u > 0, and the other way round
    where delta u < 0. It is odd: a loop about u = 0 stays point symmetric, one on a piezo actuator's voltages does not.
    Exact for n = 1, and otherwise integrated to 1e-10 of the range (`hysim.kernels.branch`). No class of stability is
    known: the forcing delta u grows with the input.

    Parameters
    ----------
    A, beta, gamma, n : float
        As in `BoucWen`.
    delta : float
        What the slope of z gains where the input rises, and loses where it falls, for each unit of u
        [unit of z / (unit of u)^2]; zero is the Bouc-Wen law.
    gain, offset, z0, input_coefficients
        As in `PolynomialBoucWen`.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, or there is no coefficient.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.ZhuWangBoucWen(beta=0.5, gamma=0.5, delta=0.3)
    >>> law.response([0.0, 1.0, 0.0, 1.0]).round(6).tolist()
    [0.0, 0.742484, -0.101879, 0.70305]
    """

    delta: float = 0.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0,)

    short = "zhu-wang"
    example = Example({"beta": 0.5, "gamma": 0.2, "delta": 0.15}, (-2.0, 2.0), title="Zhu-Wang: asymmetric")
    samples_a_thread = 2_000
    elementary = (1.0,)
    screened = 1024  # a step costs twenty times that of the Bouc-Wen law
    contains = bouc_wen_with("delta")

    @staticmethod
    def slope(p: Any, z: float, u: float, s: float) -> float:
        return float(p.A - power(abs(z), p.n) * (p.gamma + math.copysign(1.0, z * s) * p.beta) + p.delta * u * s)

    @staticmethod
    def flows(p: Any) -> bool:
        return bool(p.n == 1.0)

    @staticmethod
    def flow(p: Any, z: float, last: float, u: float) -> float:
        return float(ramp(p.A, p.beta, p.gamma, p.delta, z, last, u - last))
