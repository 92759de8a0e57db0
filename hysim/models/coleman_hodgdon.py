"""The Duhem law of Coleman and Hodgdon in its backlash-like form.

    y' = alpha |u'| (c u + offset - y) + B u'

u is the input, y the output. Whatever the direction, y is drawn to the line offset + c u, and runs beside it at the
distance |B - c| / alpha in the end. Measured from that line the law is Dahl's,

    y = offset + c u + z,    z' = (B - c) u' - alpha |u'| z

so that along a monotone stretch of the input, with L its length and s its direction, it has the closed form

    z = z_0 exp(-alpha L) + s (B - c) (1 - exp(-alpha L)) / alpha

Everything is evaluated by the exact Bouc-Wen kernels with n = 1, A = B - c, beta = alpha and gamma = 0. The loop runs
counterclockwise where B < c, as a piezoelectric displacement does.

Sources: B. D. Coleman and M. L. Hodgdon, Int. J. Eng. Sci. 24 (1986); C.-Y. Su, Y. Stepanenko, J. Svoboda and
T. P. Leung, IEEE Trans. Autom. Control 45 (2000), for the backlash-like form.
"""

from collections.abc import Mapping
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.models._as_bouc_wen import AsBoucWen, left_and_driven
from hysim.models._batch import Reduction
from hysim.models.boucwen import BoucWen
from hysim.models.model import model
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

_NAMES = ("alpha", "c", "B", "offset", "z0")
_COLUMNS = ("c", "B", "offset", "z0")
_LENGTHS = (1e-3, 1e2)  # of 1 / alpha, in spans of the input
_STARTS = (0.03, 0.1, 0.3, 1.0)
_SCREENED = 64


@model
class ColemanHodgdon(AsBoucWen):
    """Backlash-like Duhem law, ``y' = alpha |u'| (c u + offset - y) + B u'``.

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
        What the output is above the line at the first sample [unit of y].

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

    def __post_init__(self) -> None:
        if self.alpha <= 0.0:
            raise ValueError(f"alpha must be positive, got {self.alpha}")

    @property
    def bouc_wen(self) -> BoucWen:
        """The same law as Bouc-Wen's, whose memory is what the output is above the line."""
        memory = {"A": self.B - self.c, "beta": self.alpha, "gamma": 0.0, "n": 1.0, "z0": self.z0}
        return BoucWen(**memory, feedthrough=self.c, offset=self.offset)

    @property
    def saturation(self) -> float:
        """What the distance from the line tends to, ``|B - c| / alpha``."""
        return abs(self.B - self.c) / self.alpha

    @classmethod
    def responses(
        cls,
        parameters: Parameters,
        u: npt.ArrayLike,
        *,
        reduce: Reduction | None = None,
        target: npt.ArrayLike | None = None,
        workers: int | None = None,
    ) -> FloatArray:
        """Outputs of many laws at once, on all cores, or one number of each; see `hysim.BoucWen.responses`.

        Raises
        ------
        TypeError
            If a name is not one of the constructor's.
        ValueError
            If alpha is not positive, or as there.
        """
        if unknown := set(parameters) - set(_NAMES):
            raise TypeError(f"unknown parameter {sorted(unknown)[0]!r}: ColemanHodgdon has {', '.join(_NAMES)}")
        alpha, c, B = (np.asarray(parameters.get(name, getattr(cls, name)), dtype=float) for name in _NAMES[:3])
        if not (alpha > 0.0).all():
            raise ValueError(f"alpha must be positive, got {np.min(alpha)}")
        others = {name: parameters[name] for name in ("offset", "z0") if name in parameters}
        sets = {"A": B - c, "beta": alpha, "gamma": 0.0, "feedthrough": c, **others}
        return BoucWen.responses(sets, u, reduce=reduce, target=target, workers=workers)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The rate alpha on a log scale; the output is affine in all others.

        The length 1 / alpha is searched from a thousandth to a hundred spans of the input, unless the user bounds
        alpha.

        Raises
        ------
        ValueError
            If the input is constant, `initial` is unknown, or a name or a bound does not fit.
        """
        span = float(np.ptp(record.u))
        if span == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        defaults = {name: float(getattr(self, name)) for name in _NAMES}
        held = freedom.held(defaults, at_rest=("z0",) if freedom.starts_at_rest() else ())
        limits = freedom.limits(defaults, held)
        low, high = limits.get("alpha", (1.0 / (_LENGTHS[1] * span), 1.0 / (_LENGTHS[0] * span)))
        if not 0.0 < low < high < np.inf:
            raise ValueError(f"bounds of 'alpha' must be positive and finite, got {(low, high)}")
        free = ("alpha",) if "alpha" not in held else ()
        rates = np.clip([self.alpha, *(1.0 / (length * span) for length in _STARTS)], low, high)

        def parameters(x: FloatArray) -> dict[str, FloatArray]:
            sets = np.atleast_2d(x)
            return {"alpha": np.exp(sets[:, 0]) if free else np.full(len(sets), held["alpha"])}

        return SearchSpace(
            coordinates=free,
            lower=np.log([low])[: len(free)],
            upper=np.log([high])[: len(free)],
            starts=np.log(rates)[:, np.newaxis][:, : len(free)],
            names=tuple(name for name in defaults if name not in held),
            columns=_COLUMNS,
            linear=tuple(name for name in _COLUMNS if name not in held),
            held=held,
            parameters=parameters,
            bounds={name: pair for name, pair in limits.items() if name in _COLUMNS},
            state=("z0",),
            screened=_SCREENED,
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns of c, B, offset, z0, and 0, shape (n_sets, n_samples, 5).

        With v the memory for B - c = 1 from zero they are u - v, v, 1 and what is left of a memory of one.
        """
        rate = np.ravel(parameters.get("alpha", self.alpha))
        left, driven = left_and_driven(np.ones_like(rate), rate, record.u)
        return np.stack([record.u - driven, driven, np.ones_like(left), left, np.zeros_like(left)], axis=-1)

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters."""
        return type(self)(**{**{name: getattr(self, name) for name in _NAMES}, **parameters})
