"""The Duhem law of Coleman and Hodgdon in its backlash-like form."""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.laws.differential.boucwen import EquivalentBoucWen
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine
from hysim.models.tables import Tables


@family
class ColemanHodgdon(EquivalentBoucWen):
    """Backlash-like Duhem law, ``y' = alpha |u'| (c u + offset - y) + B u'``.

    Whatever the direction, y is drawn to the line offset + c u, and ends up at the distance ``|B - c| / alpha``. Above
    that line the law is Dahl's, ``y = offset + c u + z`` with ``z' = (B - c) u' - alpha |u'| z``, and is evaluated
    exactly as the Bouc-Wen law with n = 1, A = B - c, beta = alpha and gamma = 0. The loop runs counterclockwise where
    B < c, as a piezoelectric displacement does. Sources: B. D. Coleman and M. L. Hodgdon, Int. J. Eng. Sci. 24 (1986);
    C.-Y. Su et al., IEEE Trans. Autom. Control 45 (2000), for the backlash-like form.

    Parameters
    ----------
    alpha : float
        Rate at which the output is drawn to the line, positive [1 / unit of u].
    c : float
        Slope of the line [unit of y / unit of u].
    B : float
        Slope dy/du on the line [unit of y / unit of u]; right after a reversal it is less, or more.
    offset : float
        Height of the line at u = 0 [unit of y].
    z0 : float
        Output above the line at the first sample [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, or alpha is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.ColemanHodgdon(alpha=1.0, c=3.1635, B=0.345)
    >>> law.response([0.0, 6.5, -6.5]).round(6).tolist()
    [0.0, 17.748487, -17.744263]
    """

    alpha: float = 1.0
    c: float = 1.0
    B: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    positive = ("alpha",)
    example = Example({}, (-2.0, 2.0), title="Coleman-Hodgdon: magnet")
    searched = (
        Parameter("alpha", 1e-2, 1e3, unit="1/u", log=True),
        *affine("c", "B", unit="y/u"),
        *affine("offset", "z0", unit="y"),
    )
    starts = tuple({"alpha": 1.0 / length} for length in (0.03, 0.1, 0.3, 1.0))
    screened = 64

    @classmethod
    def equivalent(cls, tables: Tables) -> dict[str, FloatArray]:
        """The law with A = B - c and beta = alpha, whose memory is the output above the line."""
        memory = {"A": tables["B"] - tables["c"], "beta": tables["alpha"], "gamma": np.zeros_like(tables["alpha"])}
        return {**memory, "feedthrough": tables["c"], "offset": tables["offset"], "z0": tables["z0"]}

    @property
    def saturation(self) -> float:
        """Limit of the distance from the line on a long stroke, ``|B - c| / alpha``."""
        return abs(self.B - self.c) / self.alpha
