"""The sum of the Bouc-Wen law and a polynomial of the input, for asymmetric loops."""

from hysim.laws.differential._boucwen_law import BoucWenLaw
from hysim.laws.differential.boucwen import bouc_wen_with
from hysim.models.model import Example, family


@family
class PolynomialBoucWen(BoucWenLaw):
    """Bouc-Wen law plus a polynomial of the input, ``y = offset + sum c_k u^k + gain z``.

    The memory is that of `BoucWen`. Source: Wang, Chen and Bai 2015, for asymmetric piezoelectric loops.

    Parameters
    ----------
    A, beta, gamma, n, gain, offset, z0 : float
        As in `BoucWen`; z is driven by u itself.
    input_coefficients : sequence of float
        (c1, c2, ...) [unit of y / (unit of u)^k]; c1 is the feedthrough, their number the degree that `identify` fits.

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

    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0, 0.0)

    example = Example(
        {"A": 1.0, "beta": 0.05, "gamma": -0.03, "gain": -0.012, "input_coefficients": (0.03, 4e-5)},
        (0.0, 100.0),
        title="Piezo actuator",
        group="Devices",
        units={"u": "V", "y": "um"},
    )
    contains = bouc_wen_with()
