"""Measures and whiteness of a fit, errors of its numbers and of its loop's width, and cross-validation.

**Standard errors** are those of the linearised model; parameters that the data do not determine have none.

With J = dm/dtheta at the optimum, theta the coordinates and the linear parameters, W the curvature of the loss in the
model's output (1/sigma^2 for normal noise), and G = d(the user's parameters)/d(theta),

    cov = N / (N - d) G (J^T W J)^-1 G^T.

A coordinate at its search bound counts as known if it has an effect; it and a direction without effect have no
standard error. The condition number is that of W^(1/2) J with columns of length one.

J is computed by central differences over a millionth of the box. Where a part of that step gives another derivative,
the output bends within the step, as at a stiff optimum in a wide box: there the derivatives of a law are extrapolated
(`hysim.Law.response_jacobian`), and those of others, or of long records, differences over a shorter step.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._columns.turning import TOLERANCE
from hysim.errors import SimulationError
from hysim.identification._descent import Descent, named_slopes
from hysim.identification._noise import Gaussian, Noise
from hysim.identification._problem import Problem, samples_of_sensor
from hysim.identification.marquardt import pieces
from hysim.metrics.rows import LoopRows, max_widths
from hysim.models.law import Law
from hysim.models.search_space import Flags
from hysim.records import Record, SensorRecord, by_record

Samples = npt.NDArray[np.intp]
Folds = Sequence[Samples]

_MOST_LAGS = 20
_SINGULAR = 1e-7  # below this share of the largest, a direction of the scaled Jacobian is not identifiable
_MOST_NAMES = 4  # in a sentence
_SHARE = 0.125  # of the step, by which a derivative is computed again
_CLOSE = 1e-4  # difference of both, of the derivative, up to which the first one is taken
_MOST_SHARES = 4  # beyond which the rounding of the output is most of a difference
_FEW = 4_000  # samples times numbers up to which a law is run 15 times for each number
_EDGE = "this law is at the edge of the admissible ones"
_TAKES_PART = 0.05  # share of a parameter in a direction, of the largest share in it, to be named


@dataclass(frozen=True)
class Uncertainty:
    """Covariances and notes at an optimum."""

    covariance: FloatArray  # (n_names, n_names), nan where it is unknown
    of_theta: FloatArray  # (n_theta, n_theta), zero along what is not known
    with_names: FloatArray  # (n_theta, n_names), of theta with the parameters
    output: FloatArray  # (n_samples,), standard error of the model's output
    condition: float
    redundant: tuple[tuple[str, ...], ...]
    reasons: tuple[str, ...]
    stopped: tuple[str, ...] = ()  # by which sides of the box, in words
    slopes: FloatArray | None = None  # dm/dtheta (n_samples, n_theta), where it was computed

    def with_disturbances(self, disturbances: FloatArray, curvature: FloatArray) -> "Uncertainty":
        """The covariance with what disturbances of the output (n_draws, n_samples) add to the estimates.

        Each moves the optimum by (J^T W J)^-1 J^T W d to first order, `curvature` being W; their mean is a bias.
        """
        if self.slopes is None:
            return self
        changes = (disturbances * curvature) @ np.nan_to_num(self.slopes) @ self.with_names
        return replace(self, covariance=self.covariance + changes.T @ changes / len(disturbances))


def uncertainty(problem: Problem, theta: FloatArray, curvature: FloatArray) -> Uncertainty:
    """Covariance at `theta` (n_theta,) for the curvature of the loss (n_samples,)."""
    space, n_samples, curvature = problem.space, problem.n_samples, curvature * problem.weights
    n_names = len(space.names)
    if n_samples <= n_names:
        return _unknown(problem, theta, f"no standard errors: {n_samples} samples for {n_names} parameters")
    slopes, way_back = output_slopes(problem, theta), named_slopes(problem, theta[np.newaxis])[0]
    if not np.isfinite(slopes).all():
        return _unknown(problem, theta, "no standard errors: the output is not finite beside the optimum")
    x, linear = np.split(theta, [problem.n_x])
    width = space.upper - space.lower
    at_side, is_end = (np.logical_or(*sides) for sides in (space.at_sides(x), space.ends(x)))
    reach = np.linalg.norm(slopes[:, : x.size], axis=0) * width
    has_effect = reach > _SINGULAR * reach.max(initial=0.0)
    stopped, reasons = _bounds_in_words(problem, theta, way_back, is_end & has_effect)
    reasons += [_EDGE] if (at_side & ~is_end).any() else []
    known = np.concatenate([at_side & has_effect, np.zeros(linear.size, dtype=bool)])
    moves, way_back = np.concatenate([~at_side, np.ones(linear.size, dtype=bool)]), np.where(known, 0.0, way_back)
    root, every = np.sqrt(curvature)[:, np.newaxis], pieces(len(slopes))
    rows = np.concatenate([np.linalg.qr(np.where(moves, slopes[k], 0.0) * root[k], mode="r") for k in every])
    norms = np.linalg.norm(rows, axis=0)
    norms[norms == 0.0] = 1.0
    _, singular, right = np.linalg.svd(np.linalg.qr(rows / norms, mode="r"))
    is_determined = singular > _SINGULAR * singular[0]
    factor = np.sqrt(n_samples / (n_samples - n_names))
    spread = factor * (right[is_determined].T / singular[is_determined]) / norms[:, np.newaxis]
    directions = way_back / norms @ right.T
    covariance = (way_back @ spread) @ (way_back @ spread).T
    size = np.abs(directions).max(axis=1)
    is_searched = np.abs(right[:, ~known]).max(axis=1, initial=0.0) > 0.5 / np.sqrt(known.size)
    undetermined = np.flatnonzero(~is_determined & is_searched)
    redundant = tuple(_named(space.names, directions[:, k], size) for k in undetermined)
    redundant = tuple(dict.fromkeys(names for names in redundant if names))
    reasons += [_in_words(names, space.redundant) for names in redundant]
    unknown = (np.abs(directions[:, ~is_determined]).max(axis=1, initial=0.0) > 1e-3 * size) | (size == 0.0)
    covariance[unknown], covariance[:, unknown] = np.nan, np.nan
    free = singular[: np.count_nonzero(~known)]
    condition = float(free[0] / free[-1]) if free.size and free[-1] > 0.0 else np.inf
    visible = np.where(moves | known, 1.0, 0.0)[:, np.newaxis] * spread
    output = np.concatenate([np.linalg.norm(slopes[k] @ visible, axis=1) for k in every])
    together = spread @ (way_back @ spread).T
    notes = redundant, tuple(reasons), stopped
    return Uncertainty(covariance, spread @ spread.T, together, output, condition, *notes, slopes)


def by_energy(
    known: Uncertainty, problem: Problem, theta: FloatArray, sigma: float, disturbances: FloatArray
) -> Uncertainty:
    """The uncertainty at an optimum for the work T y: errors e of the output move it by ``(T J)^+ T e``.

    The errors are those of `sigma`, and `disturbances` (n_draws, n_samples).
    """
    if known.slopes is None:
        return known
    x, n_samples, n_names = theta[: problem.n_x], problem.n_samples, len(problem.space.names)
    moves = np.append(~np.logical_or(*problem.space.at_sides(x)), np.ones(theta.size - x.size, dtype=bool))
    slopes = np.where(moves, known.slopes, 0.0)
    norms = np.linalg.norm(slopes, axis=0)
    norms[norms == 0.0] = 1.0
    to_work = np.asarray(np.linalg.pinv(problem.work(slopes / norms), rcond=_SINGULAR).T, dtype=np.float64)
    shift = np.concatenate([_transposed(record.u, to_work[own]) for record, own in problem.pieces])
    change, size = shift.T / norms[:, np.newaxis], sigma * np.sqrt(n_samples / (n_samples - n_names))
    change_of_names, spread = named_slopes(problem, theta[np.newaxis])[0] @ change, size * change
    of_names, by_input = size * change_of_names, change_of_names @ disturbances.T
    covariance = of_names @ of_names.T + by_input @ by_input.T / len(disturbances)
    covariance[np.isnan(known.covariance)] = np.nan
    output = np.linalg.norm(slopes @ spread, axis=1)
    of_theta, with_names = spread @ spread.T, spread @ of_names.T
    return replace(known, covariance=covariance, of_theta=of_theta, with_names=with_names, output=output)


def _transposed(u: FloatArray, values: FloatArray) -> FloatArray:
    """The transpose of the integral by the trapezoidal rule, times values (n_samples, n)."""
    later = np.cumsum(values[::-1], axis=0)[::-1][1:]
    halves = 0.5 * np.diff(u)[:, np.newaxis] * later
    return np.pad(halves, ((0, 1), (0, 0))) + np.pad(halves, ((1, 0), (0, 0)))


def output_slopes(problem: Problem, theta: FloatArray, *, refined: bool = True) -> FloatArray:
    """dm/dtheta, (n_samples, n_theta), refined where the output bends within the step of a difference."""
    slopes, share = _differences(problem, theta, 1.0), _SHARE
    if not refined or not np.isfinite(slopes).all():
        return slopes
    for _ in range(_MOST_SHARES):
        if not any(_bends(slopes, problem, theta, share, some) for some in problem.chunks(problem.n_x)):
            return slopes
        own = _extrapolated(problem, theta)
        if own is not None:
            return own
        slopes, share = _differences(problem, theta, share), _SHARE * share
    return slopes


def _bends(slopes: FloatArray, problem: Problem, theta: FloatArray, share: float, some: slice) -> bool:
    """Whether the derivative by one of `some` coordinates is another one over a shorter step."""
    shorter = _rates(problem, theta, share, some)
    with np.errstate(invalid="ignore"):
        distance = np.linalg.norm(slopes.T[: problem.n_x][some] - shorter, axis=1)
        return bool((distance > _CLOSE * np.linalg.norm(shorter, axis=1)).any())


def _differences(problem: Problem, theta: FloatArray, share: float) -> FloatArray:
    slopes = np.empty((theta.size, problem.y.size))
    slopes[problem.n_x :] = problem.split(theta[np.newaxis, : problem.n_x])[0][0].T
    for some in problem.chunks(problem.n_x):
        slopes[: problem.n_x][some] = _rates(problem, theta, share, some)
    return slopes.T


def _rates(problem: Problem, theta: FloatArray, share: float, some: slice) -> FloatArray:
    """Central differences (n, n_samples) of the output by `some` coordinates."""
    x, linear = np.split(theta, [problem.n_x])
    *ends, steps = (values[0, some] for values in problem.neighbours(x[np.newaxis], share))
    above, below = (problem.model(np.column_stack([end, np.tile(linear, (len(end), 1))])) for end in ends)
    with np.errstate(invalid="ignore"):
        return np.asarray((above - below) / steps[:, np.newaxis])


def _extrapolated(problem: Problem, theta: FloatArray) -> FloatArray | None:
    """dm/dtheta of a law over steps that suit its numbers; None of other models, of long records and of cycles."""
    family, names = problem.family, problem.space.names
    is_short = problem.y.size * len(names) <= _FEW and problem.below is None
    is_alone = not any(part.before or part.record.channels for part in problem.parts)
    if not (isinstance(family, Law) and is_short and is_alone):
        return None
    by_names, rows = named_slopes(problem, theta[np.newaxis])[0], []
    for k, part in enumerate(problem.parts):
        try:
            law = family.assemble(problem.estimates(theta, k))
            own = [name for name in law.scalars if part.names.get(name, name) in names]
            jacobian = law.response_jacobian(part.record.u, own)
        except (ValueError, SimulationError):
            return None
        places = [names.index(part.names.get(name, name)) for name in own]
        if len(own) + sum(len(each.names) for each in problem.parts if each is not part) < len(names):
            return None
        rows.append(jacobian.matrix @ by_names[places])
    return np.concatenate(rows)


def _unknown(problem: Problem, theta: FloatArray, reason: str) -> Uncertainty:
    n_names, n_theta = len(problem.space.names), theta.size
    covariance, of_theta = np.full((n_names, n_names), np.nan), np.zeros((n_theta, n_theta))
    output = np.full(problem.y.size, np.nan)
    return Uncertainty(covariance, of_theta, np.zeros((n_theta, n_names)), output, np.nan, (), (reason,))


def _named(names: tuple[str, ...], direction: FloatArray, size: FloatArray) -> tuple[str, ...]:
    """Parameters that move along a direction, each measured by its largest move along any."""
    share = np.abs(direction) / np.where(size == 0.0, 1.0, size)
    return tuple(np.array(names)[share > _TAKES_PART * max(share.max(initial=0.0), 1e-12)].tolist())


def _in_words(names: tuple[str, ...], groups: tuple[tuple[str, ...], ...]) -> str:
    if len(names) == 1:
        return f"the data do not determine {names[0]}"
    for group in groups:
        if set(group) <= set(names):
            return f"the data determine only the product of {' and '.join(group)}: fix one of them"
    return f"the data do not determine {_shortened(names)} separately"


def _bounds_in_words(
    problem: Problem, theta: FloatArray, way_back: FloatArray, at_side: Flags
) -> tuple[tuple[str, ...], list[str]]:
    """Sides of the box where the search stopped, and other bounds, in terms of the user's parameters."""
    space, x = problem.space, theta[: problem.n_x]
    values = dict(zip(space.names, problem.named(theta[np.newaxis])[0].tolist(), strict=True))
    is_open = np.logical_or(*space.open_sides(x))
    search, physical, user = list[str](), list[str](), list[str]()
    for k in np.flatnonzero(at_side).tolist():
        name, is_upper = space.coordinates[k], bool(space.upper[k] - x[k] < x[k] - space.lower[k])
        affected = [each for each, slope in zip(space.names, way_back[:, k], strict=True) if slope]
        told = user if space.by_user.get(name, (False, False))[is_upper] else physical
        (search if is_open[k] else told).extend([name] if name in values else affected)
    for name, value, low, high in zip(space.linear, theta[problem.n_x :].tolist(), *problem.linear_box(), strict=True):
        if value in (low, high):
            (user if space.by_user.get(name, (False, False))[int(value == high)] else physical).append(name)
    stopped = [f"{_at(search, values, 'reached', 'search bound')}: widen it with bounds="] if search else []
    kinds = {"physical bound": physical, "given bound": user}
    others = [_at(names, values, "is at", kind) for kind, names in kinds.items() if names]
    return tuple(stopped), others


def _at(names: Sequence[str], values: Mapping[str, float], verb: str, bound: str) -> str:
    if len(names) > _MOST_NAMES:
        return f"{_shortened(names)} {verb.replace('is', 'are')} their {bound}s"
    return ", ".join(f"{name} {verb} its {bound} {values[name]:.4g}" for name in names)


def _shortened(names: Sequence[str]) -> str:
    if len(names) <= _MOST_NAMES:
        return ", ".join(names)
    return f"{', '.join(names[: _MOST_NAMES - 1])} and {len(names) - _MOST_NAMES + 1} others"


def fit_measures(y: FloatArray, residual: FloatArray, n_parameters: int) -> dict[str, Any]:
    """Measures of a fit of `n_parameters` to outputs `y` (n,) with this residual (n,)."""
    return {
        "fit_percent": metrics.fit_percent(y, y - residual),
        "rmse": metrics.rmse(residual, 0.0 * residual),
        "fpe": metrics.fpe(residual, n_parameters),
        "aic": metrics.aic(residual, n_parameters),
        "bic": metrics.bic(residual, n_parameters),
        "whiteness": whiteness(residual, n_parameters),
    }


def whiteness(residual: FloatArray, n_parameters: int) -> float:
    """Probability of residuals at least as correlated as these if they were white (Ljung and Box 1978).

    Q = N (N + 2) sum_k r_k^2 / (N - k) against chi^2, lags k to N / 5 or 20; nan if samples are too few or all equal.
    """
    from scipy.stats import chi2

    n = residual.size
    lags = min(_MOST_LAGS, n // 5)
    centred = residual - residual.mean()
    power = float(centred @ centred)
    if lags < 2 or power == 0.0 or n <= n_parameters:
        return float("nan")
    correlation = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / power
    statistic = n * (n + 2) * np.sum(correlation**2 / (n - np.arange(1, lags + 1)))
    return float(chi2.sf(statistic, lags))


def loop_widths(descent: Descent, theta: FloatArray) -> FloatArray:
    record = descent.problem.parts[0].record
    if isinstance(record, SensorRecord):  # of sensors, in units of their noise
        return np.empty(0)
    outputs = descent.problem.model(theta)[:, : len(record)]
    return max_widths(record.u, outputs[np.isfinite(outputs).all(axis=1)])


def width_stderr(problem: Problem, theta: FloatArray, of_theta: FloatArray, slopes: FloatArray | None = None) -> float:
    """Standard error of the largest width by the linearised model, nan without a loop; `slopes` are dy/dtheta."""
    record = problem.parts[0].record
    slopes = (output_slopes(problem, theta) if slopes is None else slopes)[: len(record)]
    output = problem.model(theta[np.newaxis])[0, : len(record)]
    if not (np.isfinite(slopes).all() and np.isfinite(output).all()):
        return float("nan")
    slope = LoopRows(record.u).max_width_slopes(output, slopes.T)
    return float(np.sqrt(np.maximum(slope @ of_theta @ slope, 0.0)))


_AT_FOLD = 4  # a fold of the cross-validation begins from this many of the best optima
_SAMPLES_AT_ONCE = 1_000_000  # of all sets that descend together, to bound the memory
_TOLERANCE = 1e-9


def folds(count: str | int, n: int, *, name: str = "folds") -> list[Samples]:
    """Samples of each fold of `n`: ``"loo"`` is one at a time, an int that many blocks; else a ValueError."""
    number = n if count == "loo" else count
    if not isinstance(number, int) or isinstance(number, bool) or not 2 <= number <= n:
        raise ValueError(f'{name} must be "loo" or a number of blocks from 2 to {n}, got {count!r}')
    return np.array_split(np.arange(n), number)


def left_out(cross_validate: str | int | None, records: Sequence[Record]) -> list[Samples]:
    """Samples of each fold of records that follow each other, by `cross_validate` of `identify`; else a ValueError."""
    if cross_validate is None:
        return []
    samples = by_record(np.arange(sum(map(len, records))), records)
    if cross_validate == "records":
        if len(records) < 2:
            raise ValueError('cross_validate="records" needs at least 2 records')
        return samples
    if cross_validate == "cycles":
        return _cycles(records, samples)
    parts = folds(cross_validate, sum(map(len, records)), name="cross_validate")
    if cross_validate == "loo":
        return parts
    # The beginning of a record says what the state was there: without it errors are those of a guess.
    kept: list[Samples] = []
    for record, own in zip(records, samples, strict=True):
        sensors = own.reshape(-1, samples_of_sensor(record))
        kept.append(sensors[:, : math.ceil(sensors.shape[1] / len(parts))].ravel())
    others = [np.setdiff1d(part, np.concatenate(kept)) for part in parts]
    return [part for part in others if part.size]


def _cycles(records: Sequence[Record], samples: Sequence[Samples]) -> list[Samples]:
    cycles = []
    for record, own in zip(records, samples, strict=True):
        cycles += np.split(own, record.reversals(TOLERANCE)[1::2])[1:]
    if not cycles:
        raise ValueError('cross_validate="cycles" needs at least 2 cycles of the input')
    return cycles


def errors_of_refits(residual: Callable[[FloatArray], FloatArray], n: int, every_fold: Folds) -> FloatArray:
    """Errors (n,) in the `residual(weights)` (n,) of fits without the samples of weight zero, nan of others."""
    errors = np.full(n, np.nan)
    for samples in every_fold:
        weights = np.ones(n)
        weights[samples] = 0.0
        errors[samples] = residual(weights)[samples]
    return errors


def left_out_errors(problem: Problem, noise: Noise, optima: FloatArray, every_fold: Folds) -> FloatArray:
    """Error of each sample, shape (n,), in the fit that leaves it out; inf if it diverged.

    It is nan without such a fit, and of samples that have no weight in any.
    """
    errors_of_all = np.full(problem.y.size, np.nan)
    if not every_fold:
        return errors_of_all
    starts = optima[:_AT_FOLD]
    at_once = max(1, _SAMPLES_AT_ONCE // (len(starts) * problem.y.size))
    groups = [every_fold[k : k + at_once] for k in range(0, len(every_fold), at_once)]
    errors = [_left_out_errors(problem, noise, starts, group) for group in groups]
    errors_of_all[np.concatenate(every_fold)] = np.concatenate(errors)
    errors_of_all[problem.weights == 0.0] = np.nan
    return errors_of_all


def _left_out_errors(problem: Problem, noise: Noise, starts: FloatArray, every_fold: Folds) -> FloatArray:
    weights = np.ones((len(every_fold), problem.y.size))
    for fold, samples in enumerate(every_fold):
        weights[fold, samples] = 0.0
    # Beyond the budget of the search, which may be spent: without a step the errors would be those of the fit.
    descent = Descent(problem.within(None), noise, problem.y[np.newaxis], np.repeat(weights, len(starts), axis=0))
    reached = descent.run(np.tile(starts, (len(every_fold), 1)), tolerance=_TOLERANCE)
    best = np.arange(len(every_fold)) * len(starts) + reached.loss.reshape(len(every_fold), -1).argmin(axis=1)
    errors = (problem.y - problem.model(reached.theta[best]))[weights == 0.0]
    return np.where(np.isfinite(errors), errors, np.inf)  # nan is for samples that no fold has


def bootstrap(
    problem: Problem, noise: Noise, theta: FloatArray, residual: FloatArray, sigma: float, *, draws: int, seed: int
) -> FloatArray:
    """Theta (draws, n_theta) of records drawn anew: residuals enlarged by sqrt(N / (N - d)), or other noise.

    Residuals are drawn in units of sigma / sqrt(weight), from the samples that are not left out.
    """
    if not draws:
        return np.empty((0, theta.size))
    rng = np.random.default_rng(seed)
    targets = np.tile(problem.y - residual, (draws, 1))
    enlarged = np.sqrt(problem.n_samples / (problem.n_samples - len(problem.space.names)))
    if isinstance(noise, Gaussian):
        kept = problem.weights > 0.0
        root = np.sqrt(problem.weights[kept])
        own = root * residual[kept]
        targets[:, kept] += rng.choice((own - own.mean()) * enlarged, (draws, own.size)) / root
    else:
        targets = noise.draw(targets, sigma * enlarged, rng)
    reached = Descent(problem, noise, targets, np.ones((1, residual.size))).run(np.tile(theta, (draws, 1)))
    return reached.theta[np.isfinite(reached.loss)]
