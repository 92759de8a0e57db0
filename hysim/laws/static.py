"""Yardsticks without memory: a model that does not beat them has learnt nothing about hysteresis.

Cubic smoothing spline through an output that scatters, its strength chosen by the inputs that are left out.

The curve f minimises, over m groups of n_g samples with equal inputs x_g (scaled to 0 ... 1) and mean output y_g,

    sum_g n_g / N (y_g - f(x_g))^2 + strength * integral of f''^2 dx.

With f = B c in cubic B-splines on even knots this is (B^T W B + strength P) c = B^T W y, banded. The strength is the
one that predicts best what is left out: the groups between the first and the last, *in the order of their inputs*, are
cut into contiguous blocks, and each block is predicted from the others. Loading and unloading lie in the same block, so
that the spline averages them. Sources: P. J. Green and B. W. Silverman, Nonparametric Regression and Generalized Linear
Models (1994), ch. 2 for the spline, section 3.3.4 for its degrees of freedom, the trace of the matrix that takes y to
f; T. Hastie, J. R. Stat. Soc. B 58 (1996) 379 for fewer knots; for blocks D. Roberts et al., Ecography 40 (2017) 913.
"""

import math
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import inverses, stepping
from hysim.models.composable import Composable
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.protocols import UNLIMITED, CompiledLaw, DirectFit, Limits
from hysim.records import Record

_EQUAL = 1e-9  # of the span: inputs nearer than this are equal; a sine computed twice differs by 1e-15
_MOST_GROUPS = 1000  # beyond, inputs of a thousandth of the span make a group: 1e-3 of the span moves no smooth curve
_MOST_INTERVALS = 100  # between knots; the strength decides the shape long before
_MOST_BLOCKS = 20
_GROUPS_IN_BLOCK = 5  # at least, where there are as many: fewer would let a branch see its neighbour
_STRENGTHS = np.logspace(-9.0, 2.0, 23)  # from a hundred half waves over the span to a straight line
_ROUNDING = 1e-12  # of the mean squared output: errors below are equal


class Smooth(NamedTuple):
    """A smooth curve.

    Increasing inputs `u` (m,) and outputs `y` (m,) of the curve; its degrees of freedom; and at each sample the
    standard error of the curve for noise of standard deviation 1, `spread` (n,).
    """

    u: FloatArray
    y: FloatArray
    degrees_of_freedom: float
    spread: FloatArray


def smoothing_spline(u: FloatArray, y: FloatArray, weights: FloatArray) -> Smooth:
    """The smoothing spline of outputs `y` (n,) at inputs `u` (n,), which take at least two values; positive weights."""
    from scipy.linalg import solveh_banded

    place, scaled = _groups(u)
    counts, total = np.bincount(place, weights), float(weights.sum())
    x, means = np.bincount(place, weights * scaled) / counts, np.bincount(place, weights * y) / counts
    share = counts / total
    splines = _Splines.on(x.size)
    rows = splines.at(x)
    bands, moments = _normal_equations(rows, share, means, np.zeros(x.size, dtype=np.intp), 1, splines.size)
    penalised = bands[0] + _strength(splines, rows, share, means) * splines.penalty
    inverse = solveh_banded(penalised, np.eye(splines.size), lower=True)
    gram, reach = (rows.T @ rows.multiply(share[:, np.newaxis])).toarray(), rows @ inverse
    coefficients = inverse @ moments[0]
    low, high = float(u.min()), float(u.max())
    knots = np.concatenate([[0.0], x, [1.0]])
    # in u, where they round
    inputs, remaining = np.unique(np.clip(low + (high - low) * knots, low, high), return_index=True)
    return Smooth(
        u=inputs,
        y=splines.at(knots[remaining]) @ coefficients,
        degrees_of_freedom=float(np.sum(gram * inverse)),
        spread=np.sqrt(np.maximum(np.sum((reach @ gram) * reach, axis=1), 0.0) / total)[place],
    )


def equal_inputs(u: FloatArray) -> npt.NDArray[np.intp]:
    """Which group of equal inputs each sample is in, (n,); the groups are numbered by increasing input."""
    order = np.argsort(u, kind="stable")
    steps = np.diff(u[order]) > _EQUAL * float(np.ptp(u))
    place = np.empty(u.size, dtype=np.intp)
    place[order] = np.concatenate([[0], np.cumsum(steps)])
    return place


def _groups(u: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Which group each sample is in, and its scaled input, both (n,)."""
    scaled = (u - u.min()) / np.ptp(u)
    place = equal_inputs(scaled)
    if place.max() >= _MOST_GROUPS:
        cells = np.minimum(scaled * _MOST_GROUPS, _MOST_GROUPS - 1).astype(np.intp)
        place = np.unique(cells, return_inverse=True)[1]
    return place, scaled


class _Splines(NamedTuple):
    """Cubic B-splines on even knots over 0 ... 1.

    `penalty` holds the integrals of the products of their second derivatives, by diagonals, (4, size).
    """

    knots: FloatArray
    penalty: FloatArray

    @classmethod
    def on(cls, n_groups: int) -> "_Splines":
        """The splines for so many groups."""
        from scipy.interpolate import BSpline

        n = max(1, min(n_groups - 1, _MOST_INTERVALS))
        breaks = np.linspace(0.0, 1.0, n + 1)
        knots = np.concatenate([np.zeros(3), breaks, np.ones(3)])
        middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 / n
        points = (middle[:, np.newaxis] + half * np.array([-1.0, 1.0]) / np.sqrt(3.0)).ravel()
        bends = BSpline(knots, np.eye(n + 3), 3).derivative(2)(points)  # piecewise linear: two points are exact
        penalty = np.zeros((4, n + 3))
        for k in range(4):
            penalty[k, : n + 3 - k] = half * np.sum(bends[:, k:] * bends[:, : n + 3 - k], axis=0)
        return cls(knots, penalty)

    @property
    def size(self) -> int:
        """Number of splines."""
        return self.knots.size - 4

    def at(self, x: FloatArray) -> Any:
        """The splines at `x` (m,) as a sparse table (m, size), with four elements a row."""
        from scipy.interpolate import BSpline

        return BSpline.design_matrix(x, self.knots, 3)


def _strength(splines: _Splines, rows: Any, share: FloatArray, y: FloatArray) -> float:
    """The strength that predicts left-out blocks best; of equal ones the greatest."""
    block, n_blocks = _blocks(share.size)
    if not n_blocks:
        return float(_STRENGTHS[-1])
    bands, moments = _normal_equations(rows, share, y, block, n_blocks + 1, splines.size)
    remaining, goals = bands.sum(axis=0) - bands[:-1], moments.sum(axis=0) - moments[:-1]
    coefficients = _solved(remaining, goals, splines.penalty)
    inside = np.flatnonzero(block < n_blocks)
    places, values = (each.reshape(-1, 4)[inside] for each in (rows.indices, rows.data))
    predicted = np.einsum("ik,iks->is", values, coefficients[block[inside, np.newaxis], :, places])
    errors = share[inside] @ (y[inside, np.newaxis] - predicted) ** 2
    return float(_STRENGTHS[errors <= errors.min() * (1.0 + 1e-9) + _ROUNDING * (share @ y**2)].max())


def _blocks(n_groups: int) -> tuple[npt.NDArray[np.intp], int]:
    """The block that each group is in, contiguous, and their number; the first and the last group are in no block."""
    inner = n_groups - 2
    n_blocks = min(_MOST_BLOCKS, max(inner // _GROUPS_IN_BLOCK, min(inner, 2)))
    block = np.full(n_groups, n_blocks)
    block[1:-1] = np.arange(inner) * n_blocks // max(inner, 1)
    return block, n_blocks


def _normal_equations(
    rows: Any, share: FloatArray, y: FloatArray, block: npt.NDArray[np.intp], n_blocks: int, count: int
) -> tuple[FloatArray, FloatArray]:
    """B^T W B by diagonals, (n_blocks, 4, count), and B^T W y, (n_blocks, count), of each block's groups."""
    bands, moments = np.zeros((n_blocks, 4, count)), np.zeros((n_blocks, count))
    places, values = (each.reshape(-1, 4) for each in (rows.indices, rows.data))
    for a in range(4):
        weighted = share * values[:, a]
        place = block * count + places[:, a]
        moments += np.bincount(place, weighted * y, moments.size).reshape(moments.shape)
        for b in range(a, 4):
            products = weighted * values[:, b]
            bands[:, b - a] += np.bincount(place, products, moments.size).reshape(moments.shape)
    return bands, moments


def _solved(bands: FloatArray, goals: FloatArray, penalty: FloatArray) -> FloatArray:
    """Coefficients for each block left out and each strength, (n_blocks, n_strengths, count)."""
    from scipy.linalg import solveh_banded

    systems = bands[:, np.newaxis] + _STRENGTHS[:, np.newaxis, np.newaxis] * penalty
    right = np.broadcast_to(goals[:, np.newaxis], (len(goals), _STRENGTHS.size, goals.shape[1]))
    return np.asarray(
        solveh_banded(np.moveaxis(systems, 2, 0).reshape(4, -1), right.ravel(), lower=True).reshape(right.shape)
    )


@family
class Line(Law):
    """Straight line ``y = offset + slope u``.

    Parameters
    ----------
    offset, slope : float
        [unit of y], [unit of y / unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Line(offset=1.0, slope=2.0).response([0.0, 1.0]).tolist()
    [1.0, 3.0]
    """

    offset: float = 0.0
    slope: float = 0.0

    example = Example({"offset": 1.0, "slope": 2.0})
    step = staticmethod(stepping.line)
    initial: ClassVar[tuple[str, ...]] = ()
    searched = (Parameter("offset", unit="y", affine=True), Parameter("slope", unit="y/u", affine=True))
    memory = None  # type: ignore[assignment]  # a line remembers nothing

    @property
    def known_slopes(self) -> tuple[float, float]:
        return self.slope, self.slope

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        if not self.slope:
            raise ValueError("the law has no inverse: its slope is zero")
        parameters = read_only([*limits, self.offset, self.slope], finite=False)
        return CompiledLaw(inverses.line, parameters, np.array([u0, self.offset + self.slope * u0]))


@family
class SingleValued(Composable):
    """A function of the input alone, linear between knots and constant outside.

    `hysim.identify` fits a cubic smoothing spline to the mean outputs of equal inputs, and takes its values at the
    record's inputs as the knots (at most about a thousand). The spline's strength is the one that predicts best what
    is left out, in blocks of neighbouring inputs, so that it follows the mean of loading and unloading
    The number of parameters is that of its degrees of freedom, rounded.

    Parameters
    ----------
    u, y : array, shape (m,)
        Knots: increasing inputs, and the outputs there.

    Raises
    ------
    ValueError
        If the shapes differ or the inputs do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.SingleValued(u=[0.0, 1.0], y=[0.0, 2.0]).response([0.5, 3.0]).tolist()
    [1.0, 2.0]
    """

    u: FloatArray
    y: FloatArray

    example = Example({"u": (0.0, 1.0), "y": (0.0, 2.0)}, (-10.0, 10.0))

    def __post_init__(self) -> None:
        if self.u.ndim != 1 or self.u.shape != self.y.shape or not self.u.size:
            raise ValueError(f"u and y must be equally long vectors, got shapes {self.u.shape} and {self.y.shape}")
        if not (np.diff(self.u) > 0.0).all():
            raise ValueError("the knots' inputs u must increase")

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n,)."""
        return np.interp(read_only(u, "u", ndim=1), self.u, self.y)

    def advance(
        self, u: npt.ArrayLike, state: tuple[()] | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, tuple[()]]:
        """Output at the samples of `u`, and a state that holds nothing."""
        return self.response(u), ()

    @classmethod
    def fitted(cls, records: Sequence[Record], weights: FloatArray | None = None) -> DirectFit:
        """The smoothing spline of all records, with a weight for each of their samples (n,).

        Raises ValueError if the input is constant.
        """
        u, y = (np.concatenate([vars(record)[name] for record in records]) for name in "uy")
        shares = np.ones(u.size) if weights is None else weights
        kept = shares > 0.0
        if np.ptp(u[kept]) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        smooth = smoothing_spline(u[kept], y[kept], shares[kept])
        order = np.argsort(u[kept], kind="stable")
        spread = np.interp(u, u[kept][order], smooth.spread[order])
        return DirectFit((cls(u=smooth.u, y=smooth.y),) * len(records), smooth.degrees_of_freedom, spread)

    @classmethod
    def through_means(cls, record: Record) -> Self:
        """The curve through the mean output at each input of a record, equal to 1e-9 of their span.

        No function of the input fits the record better: its fit is the bound of all models without memory. It predicts
        nothing where inputs do not repeat, and is no model of the actuator; that is what `hysim.identify` fits.

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.datasets.table1()
        >>> curve = hs.SingleValued.through_means(rec)
        >>> curve.u.size, round(hs.metrics.fit_percent(rec.y, curve.response(rec.u)), 2)
        (26, 90.27)
        """
        place = equal_inputs(record.u)
        first = np.unique(place, return_index=True)[1]
        return cls(u=record.u[first], y=np.bincount(place, record.y) / np.bincount(place))
