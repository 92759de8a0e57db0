"""Models that need no law, with which a law is compared: a curve, relaxations, plays, and a linear plant.

    curve         y = f(u) + trend
    relaxations   y = c_0 u + sum_i g(log tau_i) x_i + trend,       tau_i x_i' + x_i = u
    plays         y = f(u) + sum_i (c_i p_i + d_i p_i^2 + e_i p_i^3) + trend,   p_i the play of the threshold r_i

Relaxations are linear creep over all times of a record. Every Preisach operator is a sum of functions of plays
(M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, 1996, section 2.4). The trend is a polynomial of time in
each record, f is a cubic spline and g is linear between three places. The numbers come from a ridge regression whose
weight minimises the generalised cross-validation

    GCV = (residual sum of squares / n) / (1 - degrees of freedom / n)^2.

A play's initial state is unknown within its threshold of the first input: the ends' difference is a column per record.

**The linear rival** of a law is a plant without hysteresis, but with dynamics, fitted to the same records:

    y = offset + G(s) u + free response,    G of the orders in ORDERS, or a line

The input is linear between its samples. Each record has its own initial state, all share G and the offset.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from numpy.polynomial import legendre
from scipy.linalg import block_diag

from hysim import metrics
from hysim._basics.frozen import FloatArray, checked
from hysim._columns.turning import TOLERANCE, turns
from hysim.errors import SimulationError
from hysim.identification import identify
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.laws.static import SingleValued
from hysim.models.protocols import Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants.transfer_function import FREQUENCY, TransferFunction, TransferFunctionStructure
from hysim.records import Record

_SPLINES = 24  # or half as many as there are different inputs
_CUBIC = 3
_IN_MEAN = 6  # samples
_EQUAL = 1e-9  # of the span: a sine computed twice differs by 1e-15
_PLAYS = 10
_POWERS = (1, 2, 3)
_PER_DECADE = 2  # relaxations
_PLACES = np.linspace(0.0, 1.0, 3)  # of g, in shares of the range of log tau
_BENDS = 4  # highest degree of a trend
_BRANCHES = 3  # of a record for each degree of its trend: a trend of fewer cannot be distinguished from the loop
_RIDGES = 10.0 ** np.arange(-12.0, 1.1, 0.5)  # in the largest squared singular value
_MOST = 0.8  # degrees of freedom in samples
_BEFORE = 0.1  # ridge of the state before a record
_SLOW = 1e-3  # ridge of trends: the first samples of a left-out record cannot determine them


@dataclass(frozen=True)
class Yardstick:
    """A model that is linear in its numbers, which multiply `columns` (n_samples, n_columns), and a constant.

    Each has a ridge of its own, `ridges` (n_columns,) in squared sizes. A smoothing spline of `u`, if any, comes first.
    """

    columns: FloatArray
    ridges: FloatArray
    u: FloatArray | None = None

    def outputs(self, y: FloatArray, weights: FloatArray) -> FloatArray:
        """Outputs at all samples, the numbers fitted to `y` where the weights are not zero."""
        fitted = weights > 0.0
        if self.u is not None:
            first: FloatArray = SingleValued.fitted([Record(u=self.u[fitted], y=y[fitted])]).models[0].response(self.u)
            return np.asarray(first + replace(self, u=None).outputs(y - first, weights))
        means = self.columns[fitted].mean(axis=0)
        sizes = np.linalg.norm(self.columns - self.columns.mean(axis=0), axis=0)
        sizes[sizes == 0.0] = 1.0
        columns, level = (self.columns - means) / sizes, float(y[fitted].mean())
        prior = np.diag(np.sqrt(self.ridges))[self.ridges > 0.0]
        design = np.concatenate([columns[fitted], prior])
        target = np.concatenate([y[fitted] - level, np.zeros(len(prior))])
        return np.asarray(level + columns @ _ridge(design, target, int(fitted.sum())))


def curve(records: Sequence[Record]) -> Yardstick:
    return _yardstick(records, [_spline(records)], u=_inputs(records))


def relaxations(records: Sequence[Record]) -> Yardstick:
    """Linear creep; the records have even times."""
    shortest = min(record.sample_time for record in records)
    longest = max(record.sample_time * (len(record) - 1) for record in records)
    n = max(2, int(np.ceil(_PER_DECADE * np.log10(longest / shortest))) + 1)
    times = np.geomspace(shortest, longest, n)
    hats = np.array([np.interp(np.linspace(0.0, 1.0, n), _PLACES, row) for row in np.eye(_PLACES.size)])
    lags = [TransferFunction(num=(1.0,), den=(tau, 1.0), hold="foh") for tau in times.tolist()]
    lagging = ([lag.response(r.u - r.u[0], r.sample_time) for lag in lags] for r in records)
    parts = [np.stack(each, axis=1) @ hats.T for each in lagging]
    return _yardstick(records, [_inputs(records)[:, np.newaxis], np.concatenate(parts)])


def plays(records: Sequence[Record]) -> Yardstick:
    u = _inputs(records)
    middle, reach = 0.5 * (u.max() + u.min()), 0.5 * float(np.ptp(u))
    positions, before = [], []
    for record in records:
        inside = (record.u - middle) / reach
        high, low = _positions(inside, 1.0), _positions(inside, -1.0)
        positions.append(0.5 * (high + low))
        before.append(high - low)
    powers = [np.concatenate(positions) ** power for power in _POWERS]
    return _yardstick(records, [_spline(records), *powers], block_diag(*before), u)


def means(u: FloatArray, y: FloatArray, weights: FloatArray) -> FloatArray:
    """Straight lines through mean outputs of neighbouring inputs that have a weight, at all inputs.

    Where inputs repeat themselves, this curve has steps and kinks that no smooth one has. Single samples would know the
    path of an input that another record repeats: a mean is that of several.
    """
    fitted = weights > 0.0
    order = np.argsort(u[fitted], kind="stable")
    new = np.append(True, _steps(u[fitted]))
    begins = [0]
    for k in range(1, order.size):
        if new[k] and k - begins[-1] >= _IN_MEAN:
            begins.append(k)
    counts = np.diff([*begins, order.size])
    at, levels = (np.add.reduceat(values[fitted][order], begins) / counts for values in (u, y))
    return np.asarray(np.interp(u, at, levels))


def trend(record: Record) -> FloatArray:
    """Columns (n_samples, 1 + degree) of a slow drift of the record: the polynomials of time up to a degree."""
    degree = min(_BENDS, len(turns(record.u, TOLERANCE).branches) // _BRANCHES)
    return np.asarray(legendre.legvander(np.linspace(-1.0, 1.0, len(record)), degree))


def _yardstick(
    records: Sequence[Record],
    parts: Sequence[FloatArray],
    before: FloatArray | None = None,
    u: FloatArray | None = None,
) -> Yardstick:
    own, trends = np.concatenate(parts, axis=1), block_diag(*(trend(record) for record in records))
    before = np.empty((len(own), 0)) if before is None else before
    ridges = np.repeat([0.0, _SLOW, _BEFORE], [own.shape[1], trends.shape[1], before.shape[1]])
    return Yardstick(np.concatenate([own, trends, before], axis=1), ridges, u)


def _ridge(design: FloatArray, target: FloatArray, n: int) -> FloatArray:
    """Least squares with the ridge of least GCV, one number of the n samples being their mean."""
    basis, singular, right = np.linalg.svd(design, full_matrices=False)
    along = basis.T @ target
    beyond = max(float(target @ target - along @ along), 0.0)
    best, chosen = np.inf, np.zeros(singular.size)
    for ridge in _RIDGES * singular[0] ** 2:
        filters = singular**2 / (singular**2 + ridge)
        freedom = 1.0 + float(filters.sum())
        cost = (beyond + float(np.sum(((1.0 - filters) * along) ** 2))) / (1.0 - freedom / n) ** 2
        if freedom < _MOST * n and cost < best:
            best, chosen = cost, singular / (singular**2 + ridge) * along
    return np.asarray(right.T @ chosen)


def _spline(records: Sequence[Record]) -> FloatArray:
    u = _inputs(records)
    n = min(_SPLINES, max(int(np.count_nonzero(_steps(u))) // 2, _CUBIC + 1))
    inner = np.linspace(u.min(), u.max(), n - _CUBIC + 1)
    knots = np.concatenate([np.full(_CUBIC, inner[0]), inner, np.full(_CUBIC, inner[-1])])
    return np.asarray(scipy.interpolate.BSpline.design_matrix(u, knots, _CUBIC).toarray())


def _steps(u: FloatArray) -> npt.NDArray[np.bool_]:
    return np.asarray(np.diff(np.sort(u)) > _EQUAL * float(np.ptp(u)))


def _positions(u: FloatArray, side: float) -> FloatArray:
    thresholds = np.arange(1.0, _PLAYS + 1.0) / (_PLAYS + 1.0)
    starts = tuple((u[0] + side * thresholds).tolist())
    return PrandtlIshlinskii(thresholds=tuple(thresholds.tolist()), weights=starts, z0=starts).memory(u)


def _inputs(records: Sequence[Record]) -> FloatArray:
    return np.concatenate([record.u for record in records])


ORDERS = ((1, 0), (1, 1), (2, 0), (2, 1))  # poles, zeros
FLOOR = 1e-6  # strokes: smaller residuals are no evidence
_FREQUENCIES, _DAMPINGS = 16, (0.03, 0.3, 1.0, 3.0)  # of the points that are tried
_DESCENDING = 3  # of them, the best
_PER_PARAMETER = 3  # samples


@checked
class WeightedRecord(Record):
    """A record whose samples are left out by `shares` (n,) of 0, which multiply its output and its regressors."""

    shares: FloatArray


@dataclass(frozen=True)
class Rival:
    """A linear plant with an offset, fitted to records; `plants` differ in the initial state alone."""

    plants: tuple[TransferFunction, ...]
    offset: float
    bic: float

    @property
    def is_line(self) -> bool:
        return self.plants[0].order == 0

    def outputs(self, records: Sequence[Record]) -> list[FloatArray]:
        pairs = zip(self.plants, records, strict=True)
        return [self.offset + plant.response(record.u, record.sample_time) for plant, record in pairs]

    def refitted(self, records: Sequence[Record], weights: Sequence[FloatArray]) -> "Rival":
        """Fit of the same orders to the samples whose weights are not zero, which begins here."""
        plant = self.plants[0]
        if self.is_line:
            return _line(records, weights)
        return _identified(records, weights, plant.order, len(plant.num) - 1, plant)


def rival(records: Sequence[Record]) -> Rival:
    everything = [np.ones(len(record)) for record in records]
    most = sum(len(record) for record in records) // _PER_PARAMETER
    orders = [(poles, zeros) for poles, zeros in ORDERS if poles * (1 + len(records)) + zeros + 2 <= most]
    plants = [_identified(records, everything, poles, zeros) for poles, zeros in orders]
    return min([_line(records, everything), *plants], key=lambda plant: plant.bic)


def steady_width(plant: TransferFunction, cycle: Record, rate: float) -> float:
    """Relative width of the plant's steady loop with the cycle at `rate` times its rate; nan without a steady loop.

    The coefficients of prod (x - exp(p T)), p the poles, take the free response out of as many periods and one more.
    """
    step, u = cycle.sample_time / rate, cycle.u[:-1]
    taken = np.atleast_1d(np.poly(np.exp(plant.poles * step * u.size))).real[::-1]
    try:
        periods = plant.response(np.tile(u - u.mean(), plant.order + 1), step).reshape(-1, u.size)
    except SimulationError:
        return float("nan")
    y = taken @ periods / taken.sum()
    return metrics.loop_metrics(np.append(u, u[0]), np.append(y, y[0])).relative_width


@dataclass(frozen=True)
class _Affine(Subject):
    """A transfer function with an offset, as `identify` takes it; the search begins at `start`, if given."""

    structure: TransferFunctionStructure
    records: Sequence[Record]
    start: TransferFunction | None = None

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        finest = min(self.records, key=lambda each: each.sample_time)
        longest = max(len(each) * each.sample_time for each in self.records)
        own = self.structure.search_space(finest, freedom)
        slowest = np.log(FREQUENCY[0] * finest.sample_time / longest)
        lower = np.where([name.startswith("log damping") for name in own.coordinates], own.lower, slowest)
        own = replace(own, lower=lower)
        starts = self._scanned(own) if self.start is None else _coordinates(self.start, finest.sample_time)
        extended: dict[str, Any] = {name: (*vars(own)[name], "offset") for name in ("names", "columns", "linear")}
        return replace(own, starts=np.clip(starts, lower, own.upper), screened=0, **extended)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        columns = np.insert(self.structure.regressors(parameters, record), -1, 1.0, axis=-1)
        return columns * record.shares[:, np.newaxis] if isinstance(record, WeightedRecord) else columns

    def assemble(self, parameters: Mapping[str, float]) -> TransferFunction:
        return self.structure.assemble(parameters)

    def _scanned(self, own: SearchSpace) -> FloatArray:
        """The best points (n, n_x) of a grid over the box, each record with a numerator and an offset of its own."""
        axes = [np.linspace(own.lower[0], own.upper[0], _FREQUENCIES), np.log(_DAMPINGS)][: own.lower.size]
        points = np.stack([axis.ravel() for axis in np.meshgrid(*axes)], axis=1)
        costs = np.zeros(len(points))
        for record in self.records:
            basis = np.linalg.qr(self.regressors(own.parameters(points), record)[..., :-1])[0]
            costs += np.sum((record.y - (basis @ (record.y @ basis)[..., np.newaxis])[..., 0]) ** 2, axis=1)
        return points[np.argsort(costs, kind="stable")[:_DESCENDING]]


def _coordinates(plant: TransferFunction, sample_time: float) -> FloatArray:
    sizes = np.array(plant.den[1:]) * sample_time ** np.arange(1, len(plant.den))
    frequency = np.sqrt(sizes[-1])
    place = sizes if sizes.size == 1 else [frequency, sizes[0] / (2.0 * frequency)]
    return np.asarray(np.log(place))[np.newaxis]


def _identified(
    records: Sequence[Record],
    weights: Sequence[FloatArray],
    poles: int,
    zeros: int,
    start: TransferFunction | None = None,
) -> Rival:
    structure = TransferFunction.structure(poles=poles, zeros=zeros, hold="foh", initial="free")
    weighted = [
        WeightedRecord(u=record.u, y=record.y * shares, t=record.t, shares=shares)
        for record, shares in zip(records, weights, strict=True)
    ]
    fit = identify(_Affine(structure, records, start), weighted)
    return Rival(fit.models, fit.estimates["offset"], _information(records, fit.residual, fit.n_parameters))


def _line(records: Sequence[Record], weights: Sequence[FloatArray]) -> Rival:
    u, y, shares = _inputs(records), np.concatenate([record.y for record in records]), np.concatenate(weights)
    mean = float(shares @ u / shares.sum())  # so that the columns are orthogonal
    columns = np.stack([u - mean, np.ones(u.size)], axis=1)
    slope, level = np.linalg.lstsq(columns * shares[:, np.newaxis], y * shares)[0].tolist()
    plants = (TransferFunction(num=(slope,), den=(1.0,), hold="foh"),) * len(records)
    return Rival(plants, level - slope * mean, _information(records, y - columns @ [slope, level], 2))


def _information(records: Sequence[Record], residual: FloatArray, n_parameters: int) -> float:
    stroke = max(float(np.ptp(record.y)) for record in records)
    return metrics.bic(residual, n_parameters, floor=FLOOR * stroke)
