"""Dahl's friction law, which is the Bouc-Wen law with n = 1 and gamma = 0, under the names of its field.

    F' = sigma (u' - |u'| F / F_c),    y = offset + F

u is the displacement, F the friction force, sigma the stiffness at F = 0, F_c the Coulomb force to which F
tends. (Dahl's exponent is 1.) Everything is evaluated by the exact Bouc-Wen kernels with A = sigma and
beta = sigma / F_c.

Source: P. R. Dahl, A solid friction model, Aerospace Corporation 1968.
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

_NAMES = ("stiffness", "coulomb", "offset", "z0")
_LENGTHS = (1e-3, 1e2)  # of F_c / sigma, in spans of the input
_FORCES = (1e-2, 1e2)  # of F_c, in strokes
_STARTS = ((0.03, 0.5), (0.1, 0.5), (0.3, 0.7), (1.0, 1.5))


@model
class Dahl(AsBoucWen):
    """Dahl friction, ``F' = stiffness (u' - |u'| F / coulomb)`` and ``y = offset + F``.

    Parameters
    ----------
    stiffness : float
        Slope dF/du at F = 0, positive [unit of y / unit of u].
    coulomb : float
        Force to which ``|F|`` tends, positive [unit of y].
    offset : float
        Output at F = 0 [unit of y].
    z0 : float
        Force F at the first sample [unit of y].

    Raises
    ------
    ValueError
        If a number is not finite, or stiffness or coulomb is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> friction = hs.Dahl(stiffness=2.0, coulomb=0.5)
    >>> friction.response([0.0, 1.0, 0.9]).round(6).tolist()
    [0.0, 0.490842, 0.164181]
    """

    stiffness: float = 1.0
    coulomb: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "coulomb"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def bouc_wen(self) -> BoucWen:
        """The same law as Bouc-Wen's."""
        beta = self.stiffness / self.coulomb
        return BoucWen(A=self.stiffness, beta=beta, gamma=0.0, n=1.0, offset=self.offset, z0=self.z0)

    @property
    def saturation(self) -> float:
        """What ``|F|`` tends to, the Coulomb force."""
        return self.coulomb

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
            If stiffness or coulomb is not positive, or as there.
        """
        if unknown := set(parameters) - set(_NAMES):
            raise TypeError(f"unknown parameter {sorted(unknown)[0]!r}: Dahl has {', '.join(_NAMES)}")
        for name in ("stiffness", "coulomb"):
            if not (np.asarray(parameters.get(name, 1.0)) > 0.0).all():
                raise ValueError(f"{name} must be positive, got {np.min(parameters[name])}")
        stiffness, coulomb = (np.asarray(parameters.get(name, 1.0), dtype=float) for name in ("stiffness", "coulomb"))
        others = {name: parameters[name] for name in ("offset", "z0") if name in parameters}
        sets = {"A": stiffness, "beta": stiffness / coulomb, "gamma": 0.0, **others}
        return BoucWen.responses(sets, u, reduce=reduce, target=target, workers=workers)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Stiffness and Coulomb force on log scales; the output is affine in offset and z0.

        The length coulomb / stiffness is searched from a thousandth to a hundred spans of the input, the
        Coulomb force from a hundredth to a hundred strokes. A parameter that the user bounds has these
        bounds.

        Raises
        ------
        ValueError
            If the input is constant, `initial` is unknown, or a name or a bound does not fit.
        """
        span, stroke = float(np.ptp(record.u)), float(np.ptp(record.y)) or 1.0
        if span == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        defaults = {name: float(getattr(self, name)) for name in _NAMES}
        held = freedom.held(defaults, at_rest=("z0",) if freedom.starts_at_rest() else ())
        limits = freedom.limits(defaults, held)
        box = {
            "stiffness": (_FORCES[0] / _LENGTHS[1] * stroke / span, _FORCES[1] / _LENGTHS[0] * stroke / span),
            "coulomb": (_FORCES[0] * stroke, _FORCES[1] * stroke),
        } | {name: pair for name, pair in limits.items() if name in ("stiffness", "coulomb")}
        if wrong := [name for name, pair in box.items() if not 0.0 < pair[0] < pair[1] < np.inf]:
            raise ValueError(f"bounds of {wrong[0]!r} must be positive and finite, got {box[wrong[0]]}")
        free = [name for name in box if name not in held]
        columns = ("offset", "z0")
        constants = {name: value for name, value in held.items() if name not in columns}
        starts = [{"stiffness": force / length * stroke / span, "coulomb": force * stroke} for length, force in _STARTS]
        points = np.array([[point[name] for name in free] for point in [defaults, *starts]])
        lower, upper = (np.log([box[name][side] for name in free]) for side in (0, 1))

        def parameters(x: FloatArray) -> dict[str, FloatArray]:
            sets = np.exp(np.atleast_2d(x))
            fixed = {name: np.full(len(sets), value) for name, value in constants.items()}
            return fixed | dict(zip(free, sets.T, strict=True))

        return SearchSpace(
            coordinates=tuple(free),
            lower=lower,
            upper=upper,
            starts=np.clip(np.log(points), lower, upper),
            names=tuple(name for name in defaults if name not in held),
            columns=columns,
            linear=tuple(name for name in columns if name not in held),
            held=held,
            parameters=parameters,
            bounds={name: pair for name, pair in limits.items() if name in columns},
            state=("z0",),
            screened=512,
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns 1, what is left of a force of one, and F from zero, shape (n_sets, n_samples, 3)."""
        left, force = self._left_and_driven(parameters, record.u)
        return np.stack([np.ones_like(left), left, force], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, npt.ArrayLike]:
        """The parameters with the force of the steady cycle of which `record` is one period or more.

        It adds F_1 to what is left of the force, F_0 -> F_1 + left F_0, which comes to rest at
        F_1 / (1 - left).
        """
        left, force = self._left_and_driven(parameters, np.append(record.u, record.u[0]))
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        return {**parameters, "z0": (force[:, -1] / (1.0 - left[:, -1])).reshape(shape)[()]}

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters."""
        return type(self)(**{**{name: getattr(self, name) for name in _NAMES}, **parameters})

    def _left_and_driven(self, parameters: Parameters, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What is left of a force of one, and F from zero, shape (n_sets, n_samples) each."""
        stiffness, coulomb = np.broadcast_arrays(
            *(np.ravel(parameters.get(name, getattr(self, name))) for name in ("stiffness", "coulomb"))
        )
        return left_and_driven(stiffness, stiffness / coulomb, u)
