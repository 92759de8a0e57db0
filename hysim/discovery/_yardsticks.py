"""Models that need no law, beside which a law is judged: a curve, relaxations, and plays.

    curve         y = f(u) + trend
    relaxations   y = c_0 u + sum_i g(log tau_i) x_i + trend,       tau_i x_i' + x_i = u
    plays         y = f(u) + sum_i (c_i p_i + d_i p_i^2 + e_i p_i^3) + trend,   p_i the play of the threshold r_i

Relaxations are linear creep over all times of a record. Every Preisach operator is a sum of functions of plays
(M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, 1996, section 2.4). The trend is a polynomial of time in
each record, f is a cubic spline and g is linear between three places. The numbers come from a ridge regression whose
weight minimises the generalised cross-validation

    GCV = (residual sum of squares / n) / (1 - degrees of freedom / n)^2.

The state of a play before a record is unknown within its threshold of the first input: the difference between both
ends is a column for that record alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre
from scipy.interpolate import BSpline
from scipy.linalg import block_diag

from hysim._cycles import TOLERANCE
from hysim._frozen import FloatArray
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.laws.static import SingleValued
from hysim.plants.transfer_function import TransferFunction
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

    Each has a ridge of its own, `ridges` (n_columns,) in squared sizes. A smoothing spline of `u`, if any, is fitted
    first.
    """

    columns: FloatArray
    ridges: FloatArray
    u: FloatArray | None = None

    def outputs(self, y: FloatArray, weights: FloatArray) -> FloatArray:
        """Outputs at all samples, the numbers fitted to `y` where the weights are not zero."""
        fitted = weights > 0.0
        if self.u is not None:
            first: FloatArray = SingleValued.fitted(self.u[fitted], y[fitted]).model.response(self.u)
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
    return _yardstick([_spline(records)], _trends(records), u=_inputs(records))


def relaxations(records: Sequence[Record]) -> Yardstick:
    """Linear creep; the records have even times."""
    shortest = min(record.sample_time for record in records)
    longest = max(record.sample_time * (len(record) - 1) for record in records)
    n = max(2, int(np.ceil(_PER_DECADE * np.log10(longest / shortest))) + 1)
    times = np.geomspace(shortest, longest, n)
    hats = np.array([np.interp(np.linspace(0.0, 1.0, n), _PLACES, row) for row in np.eye(_PLACES.size)])
    parts = [np.stack([_relaxed(record, float(tau)) for tau in times], axis=1) @ hats.T for record in records]
    return _yardstick([_inputs(records)[:, np.newaxis], np.concatenate(parts)], _trends(records))


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
    return _yardstick([_spline(records), *powers], _trends(records), block_diag(*before), u)


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
    degree = min(_BENDS, len(record.branches(TOLERANCE)) // _BRANCHES)
    return np.asarray(legendre.legvander(np.linspace(-1.0, 1.0, len(record)), degree))


def _yardstick(
    parts: Sequence[FloatArray],
    trends: FloatArray,
    before: FloatArray | None = None,
    u: FloatArray | None = None,
) -> Yardstick:
    groups = [(np.concatenate(parts, axis=1), 0.0), (trends, _SLOW)]
    groups += [] if before is None else [(before, _BEFORE)]
    columns = np.concatenate([each for each, _ in groups], axis=1)
    return Yardstick(columns, np.concatenate([np.full(each.shape[1], ridges) for each, ridges in groups]), u)


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
    return np.asarray(BSpline.design_matrix(u, knots, _CUBIC).toarray())


def _steps(u: FloatArray) -> npt.NDArray[np.bool_]:
    return np.asarray(np.diff(np.sort(u)) > _EQUAL * float(np.ptp(u)))


def _positions(u: FloatArray, side: float) -> FloatArray:
    thresholds = np.arange(1.0, _PLAYS + 1.0) / (_PLAYS + 1.0)
    starts = tuple((u[0] + side * thresholds).tolist())
    return PrandtlIshlinskii(thresholds=tuple(thresholds.tolist()), weights=starts, z0=starts).memory(u)


def _relaxed(record: Record, tau: float) -> FloatArray:
    lag = TransferFunction(num=(1.0,), den=(tau, 1.0), hold="foh")
    return lag.response(record.u - record.u[0], record.sample_time)


def _inputs(records: Sequence[Record]) -> FloatArray:
    return np.concatenate([record.u for record in records])


def _trends(records: Sequence[Record]) -> FloatArray:
    return np.asarray(block_diag(*(trend(record) for record in records)))
