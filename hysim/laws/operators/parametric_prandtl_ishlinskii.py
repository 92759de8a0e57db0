"""The sum of the Prandtl-Ishlinskii law of a density with two parameters and a polynomial of the input.

The plays stand on a fixed grid, finer towards zero, where the density may be singular: play k has the thresholds
between the edges e_(k-1) and e_k, their middle r_k, and their share m_k of the density,

    e_k = reach (k / plays)^2,    m_k = (integral of w from e_(k-1) to e_k) / (integral of w from 0 to reach)

The shares are quotients of incomplete gamma functions. The thresholds do not depend on what is searched, so that the
positions of the plays are the same for every density.
"""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels import clamps as kernels
from hysim.laws.operators._bank_search import conditioned, dominant_extremes, moved, named, table_of
from hysim.laws.operators._densities import gamma_plays
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine, declared_space, spans
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record, few_places

_DENSITIES = ((-0.5, 0.3), (0.0, 0.15), (1.0, 0.15), (0.0, 1.0))  # exponent, and decay in half spans of the input
_TURNS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # of a free memory, in half spans from the first input
_SMALLEST = 1e-280  # norm: nothing is divided by less
_SAMPLES = 250  # for the choice of the past
_STRONG = 10.0  # difference of two BIC that is very strong evidence


@family
class ParametricPrandtlIshlinskii(Law):
    """Plays of the density ``w(r) ~ r^exponent exp(-r / decay)``, plus a polynomial of the input.

    ::

        y    = offset + c_1 u + c_2 u^2 + c_3 u^3 + (weight + weight_slope u) sum_k m_k (z_k - u)
        z_k  = min(max(z_k, u - r_k), u + r_k),    m_k ~ the integral of w over the thresholds of play k,  sum m_k = 1

    Eight numbers describe loops of all sizes. The slope dy/du right after a reversal is that of the polynomial less
    weight + weight_slope u, and returns to it as the plays are pushed one after the other.

    As a start of `hysim.identify` the class leaves the reach to the record, the span of the input, and what was before
    it: the cycle between the lowest and the highest input, on the branch in whose direction the record moves first, or
    plays that all stand at zero or at the first input, where that fits clearly better (the BIC is lower by 10). With
    ``initial="rest"`` all plays stand at zero before the first sample, with ``"free"`` they have made one stroke from
    there, to ``z0[1]``. Sources: M. Al Janaideh, S. Rakheja and C.-Y. Su, IEEE/ASME Trans. Mechatronics 16 (2011), for
    a density; P. Krejci and K. Kuhnen, IEE Proc. Control Theory Appl. 148 (2001), for the law.

    Parameters
    ----------
    exponent : float
        Exponent of the density at small thresholds, above -1; negative for loops that are sharp at their reversals.
    decay : float
        Threshold over which the density falls by the factor e, positive [unit of u].
    weight, weight_slope : float
        Sum of the weights of the plays at u = 0, positive for a counterclockwise loop [unit of y / unit of u], and its
        change with the input [unit of y / unit of u^2].
    offset : float
        Output at u = 0 where all plays stand at zero [unit of y].
    input_coefficients : sequence of float
        (c_1, c_2, ...) [unit of y / (unit of u)^k]. Their number is the degree that `identify` fits.
    reach : float
        Largest threshold, positive where there is a weight [unit of u]. Loops widen with the amplitude up to `reach`.
    plays : float
        Their number, whole and positive.
    z0 : sequence of float
        Inputs before the first sample, the oldest first, at which all plays stand [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, the exponent is not above -1, the decay is not positive, the reach is negative or
        zero beside a weight, the number of plays is not whole and positive, or z0 is empty.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.ParametricPrandtlIshlinskii(exponent=-0.5, decay=0.3, weight=0.4, reach=2.0)
    >>> law.response([0.0, 1.0, 0.5, -1.0]).round(6).tolist()
    [0.0, 0.940997, 0.523183, -0.940997]
    """

    exponent: float = 0.0
    decay: float = 1.0
    weight: float = 0.0
    weight_slope: float = 0.0
    offset: float = 0.0
    input_coefficients: tuple[float, ...] = (1.0, 0.0, 0.0)
    reach: float = 0.0
    plays: float = 40.0
    z0: tuple[float, ...] = (0.0, 0.0)

    units: ClassVar = {"exponent": "1", "reach": "u", "plays": "1"}
    positive = ("decay",)
    example = Example(
        {"exponent": -0.3, "decay": 0.4, "weight": 0.5, "reach": 2.0, "plays": 20.0},
        title="Prandtl-Ishlinskii: density",
    )
    step = staticmethod(kernels.bent_step)
    searched = (
        Parameter("exponent", -0.95, 4.0, physical=(True, False)),
        Parameter("decay", 3e-3, 1e2, unit="h", log=True),
        Parameter("weight", unit="y/u", affine=True),
        Parameter("offset", unit="y", affine=True),
        *affine("weight_slope", "input_coefficients"),
        Parameter("z0", -2.0, 2.0, unit="h", from_first=True),
    )
    screened = 64
    structural = ("plays",)

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        exponent, reach, plays = (tables[name] for name in ("exponent", "reach", "plays"))
        idle = (tables["weight"] == 0.0) & (tables["weight_slope"] == 0.0)
        if not (exponent > -1.0).all():
            raise ValueError(f"exponent must be above -1, got {exponent.min()}")
        if not ((reach > 0.0) | (idle & (reach == 0.0))).all():
            raise ValueError(f"reach must be positive if a weight is not zero, got {reach.min()}")
        if not ((plays >= 1.0) & (plays == np.round(plays))).all():
            raise ValueError(f"plays must be whole and positive, got {plays.min()}")
        if not tables["z0"].shape[1]:
            raise ValueError("z0 must hold at least one input")

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.clamps.bent_step` takes them, and the positions after the inputs z0."""
        thresholds, shares = gamma_plays(tables)
        numbers = [tables[name] for name in ("offset", "weight", "weight_slope", "input_coefficients")]
        degree = np.full_like(tables["offset"], numbers[-1].shape[1])
        first, *past = tables["z0"].T[:, :, np.newaxis]
        z = first + np.zeros_like(thresholds)
        for u in past:
            z = moved(z, thresholds, u)
        parameters = np.concatenate([degree, *numbers, thresholds, shares], axis=1)
        return Packed(parameters, np.concatenate([np.zeros_like(degree), z], axis=1))

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Positions of the plays at the samples of `u`, shape (n_samples, n_plays); errors as of `response`."""
        return self.remembered(u)

    @property
    def thresholds(self) -> FloatArray:
        """Threshold r_k of each play, shape (n_plays,) [unit of u]."""
        return np.asarray(gamma_plays(self.tables)[0][0])

    @property
    def shares(self) -> FloatArray:
        """Share m_k of each play in the weight, shape (n_plays,); their sum is one."""
        return np.asarray(gamma_plays(self.tables)[1][0])

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Box of the two parameters of the density, and of the former turning point where the memory is free."""
        law = replace(self, reach=self.reach or spans(record)["u"], z0=self.z0 if any(self.z0) else (0.0, 0.0))
        names, known = law.initial_names, {}
        if freedom.initial is None:
            known = dict(zip(names, law.z0 if any(law.z0) else law._likely_past(record), strict=True))
        elif freedom.initial == "free":  # the last input before the first sample is
            known = dict(zip(names[:-1], law.z0, strict=False))
        held = {name: value for name, value in known.items() if name not in freedom.free} | {**freedom.fixed}
        turns = [{}] if names[-1] in held else [{names[-1]: turn} for turn in _TURNS]
        starts = [{"exponent": a, "decay": decay} | turn for a, decay in _DENSITIES for turn in turns]
        return declared_space(law, record, replace(freedom, fixed=held), starts=starts)

    def _likely_past(self, record: Record) -> tuple[float, float]:
        """Inputs before the first sample: those of the cycle, unless plays that stand still fit clearly better.

        What counts is the residual of the best of the densities from which a search begins.
        """
        places, first, (exponent, decay) = few_places(record, _SAMPLES), float(record.u[0]), np.array(_DENSITIES).T
        short = Record(u=record.u[places], y=record.y[places])
        density = {"exponent": exponent, "decay": spans(short)["h"] * decay}
        best, criterion = conditioned(record.u), np.inf
        for past in (best, (0.0, 0.0), (first, first)):
            law = replace(self, z0=past)
            columns = law.regressors({**law.scalars, **density}, short)[..., :-1]
            columns = columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), _SMALLEST)
            fits = (each @ np.linalg.lstsq(each, short.y, rcond=None)[0] for each in columns)
            error = min(float(np.linalg.norm(short.y - fit)) for fit in fits)
            own = 2.0 * len(short) * np.log(max(error, _SMALLEST))
            if own < criterion - _STRONG:
                best, criterion = past, own
        return best

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns of weight, weight_slope, 1, u, u^2, ... and 0, shape (n_sets, n_samples, n_columns + 1)."""
        law = replace(self, z0=(0.0,) * (table_of("z0", parameters).shape[1] or len(self.z0)))
        zero = {**parameters, **dict.fromkeys(law.columns, 0.0)}
        lag = law.outputs({**zero, "weight": 1.0}, record.u)
        powers = [np.broadcast_to(record.u**k, lag.shape) for k in range(len(self.input_coefficients) + 1)]
        return np.stack([lag, record.u * lag, *powers, np.zeros_like(lag)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The record's own dominant turning points as the inputs before it, (n_sets,) by name."""
        n_sets = max((np.size(value) for value in parameters.values()), default=1)
        inputs = dominant_extremes(np.append(record.u, record.u[0]))
        return {**parameters} | named("z0", (np.full(n_sets, u) for u in inputs))
