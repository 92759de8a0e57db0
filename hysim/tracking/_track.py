"""The verb `track_parameters`.

A drift's size is the one that makes the errors of one-sample predictions most likely. Too large a walk follows the
noise, too small a one comes late: both make these errors larger or smaller than the filter expects. Their
log-likelihood (the prediction-error decomposition; A. C. Harvey, Forecasting, Structural Time Series Models and the
Kalman Filter, 1989, section 3.4) is maximised over the logarithms of the sizes, one at a time.

    theta_k = theta_(k-1) + w_k,    (z_k, y_k) = step(theta_k, z_(k-1), u_k),    measured_k = y_k + noise

The numbers theta walk at random; the memory follows from them by the exact step.

Sigma points: mean and covariance of (theta, z) are carried by 2 n points at +- sqrt(n) standard deviations, each moved
by the step (the cubature rule; I. Arasaratnam and S. Haykin, IEEE Trans. Autom. Control 54 (2009) 1254). Where the
errors of the last samples are too large for the noise, a number has jumped: the filter goes back to the first of them,
raises the variances there, and comes again.

Particles: many copies, weighted by how well they predict, and drawn anew by weight; a few of them jump at each sample.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, as_mapping, check_choice, check_count, read_only
from hysim._basics.printing import frozen_result, summary_text
from hysim._basics.progress import Reports, reports
from hysim._basics.results import model_of
from hysim.kernels.copies import step_each
from hysim.kernels.stepping import START, STEP, by_address
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.jacobian import checked_names, sizes_along
from hysim.models.law import Law
from hysim.records import Record


class Coordinates(NamedTuple):
    """Free numbers of a law, and which of them are tracked by their logarithms."""

    names: tuple[str, ...]
    values: FloatArray
    log: npt.NDArray[np.bool_]

    def encode(self, values: FloatArray) -> FloatArray:
        """Coordinates (..., n_names) of values."""
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)

    def decode(self, x: FloatArray) -> FloatArray:
        """Values (..., n_names) of coordinates."""
        return np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)

    def spread(self, changes: FloatArray) -> FloatArray:
        return np.where(self.log, changes / np.where(self.log, self.values, 1.0), changes)


def coordinates_of(law: Law, free: Sequence[str]) -> Coordinates:
    """The coordinates of some numbers; ValueError if a name is unknown or decides which step the law has."""
    names = checked_names(law, free)
    if initial := [name for name in names if name in law.initial_names]:
        raise ValueError(f"{initial[0]} is the memory at the first sample, which does not drift: leave it out of free")
    if not names:
        raise ValueError("free must name at least one number that drifts")
    values = np.array([law.scalars[name] for name in names])
    return Coordinates(names, values, np.array([_must_be_positive(law, name) for name in names]))


def _must_be_positive(law: Law, name: str) -> bool:
    value = law.scalars[name]
    try:
        law.with_scalars({name: -abs(value) or -math.ulp(0.0)})
    except ValueError:
        if value == 0.0:
            raise ValueError(f"{name} is 0 and cannot be negative: leave it out of free, or make it positive") from None
        return value > 0.0
    return False


class Copies:
    """Copies of a law, moved sample by sample, that differ in the numbers of their `coordinates`."""

    def __init__(self, law: Law, coordinates: Coordinates) -> None:
        self._law, self._coordinates = law, coordinates
        self._step = by_address(compiled_step(law.step), STEP.signature)
        self._start = by_address(compiled_start(law.start), START.signature)
        self.memory = law.packed[1].copy()
        self._state = np.zeros(self.memory.size + law.workspace)

    def begun(self, u0: float) -> FloatArray:
        return np.array(self._law.state_at(u0))

    def moved(self, x: FloatArray, memory: FloatArray, before: float, u: float) -> FloatArray:
        """Outputs (n,) at the input `u` of copies with coordinates `x` (n, n_names); `memory` (n, n_memory) moves."""
        y = np.empty(len(x))
        with np.errstate(all="ignore"):
            step_each(self._step, self._start, self._packed(x), memory, self._state, before, u, y)
        return y

    def _packed(self, x: FloatArray) -> FloatArray:
        law, columns = self._law, self._coordinates.decode(x).T[:, :, np.newaxis]
        changed = law.exchanged(dict(zip(self._coordinates.names, columns, strict=True)))
        tables = {name: np.broadcast_to(table, (len(x), *table.shape[1:])) for name, table in changed.items()}
        with np.errstate(all="ignore"):
            return read_only(law.pack(law.completed(tables)).parameters, finite=False)


_SURPRISE = 3.0  # mean square of the last normalised errors, from which on a number has jumped
_RECENT = 12  # errors that are looked at; after a jump as many pass before the next look
_LEAST = 1e-13  # of the variances: keeps a covariance positive
_JUMPING = 0.01  # share of the particles that jump at a sample
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)
_FEWEST = 0.5  # share of effective particles below which they are drawn anew


class Walk(NamedTuple):
    """Standard deviations of the coordinates: at the first sample, of the walk in one sample, and of a jump."""

    first: FloatArray
    step: FloatArray
    jump: FloatArray


class Filtered(NamedTuple):
    """Means and standard deviations of the coordinates (n_samples, n_names), and predictions with their deviations.

    The logarithm of the likelihood is that of the errors of predictions one sample ahead. After a jump the samples that
    came again count with their second predictions, and the place of the jump with one over the number of samples.
    """

    mean: FloatArray
    deviation: FloatArray
    predicted: FloatArray
    expected_error: FloatArray
    jumps: tuple[int, ...]
    log_likelihood: float


class Belief(NamedTuple):
    """Mean (n,) and covariance (n, n) of the coordinates and the memory, and the last input."""

    mean: FloatArray
    covariance: FloatArray
    before: float


def sigma_points(copies: Copies, x: FloatArray, walk: Walk, noise: float, u: FloatArray, y: FloatArray) -> Filtered:
    """The filter by sigma points from the coordinates `x` (n_names,)."""
    begun, count = copies.begun(float(u[0])), x.size
    covariance = np.zeros((x.size + begun.size - 1,) * 2)
    covariance[range(count), range(count)] = walk.first**2
    belief = Belief(np.concatenate([x, begun[1:]]), covariance, float(u[0]))
    means, deviations = np.empty((u.size, count)), np.empty((u.size, count))
    predicted, expected, log_density = np.empty(u.size), np.empty(u.size), np.empty(u.size)
    recent: list[tuple[Belief, float]] = []
    jumps: list[int] = []
    for k in range(u.size):
        last = belief
        belief, predicted[k], expected[k] = _filtered(copies, last, walk.step, noise, float(u[k]), float(y[k]), k)
        log_density[k] = _log_normal(float(y[k]) - predicted[k], expected[k])
        recent = [*recent[-_RECENT + 1 :], (last, ((y[k] - predicted[k]) / expected[k]) ** 2)]
        if len(recent) == _RECENT and np.mean([square for _, square in recent]) > _SURPRISE and walk.jump.any():
            begin = recent[0][0]
            begin.covariance[range(count), range(count)] += walk.jump**2
            belief, jumps, recent = begin, [*jumps, k], []
            for j in range(k - _RECENT + 1, k + 1):
                belief, again, spread = _filtered(copies, belief, walk.step, noise, float(u[j]), float(y[j]), j)
                log_density[j] = _log_normal(float(y[j]) - again, spread)
        means[k] = belief.mean[:count]
        deviations[k] = np.sqrt(np.maximum(belief.covariance.diagonal()[:count], 0.0))
    log_likelihood = float(log_density.sum()) - len(jumps) * math.log(u.size)
    return Filtered(means, deviations, predicted, expected, tuple(jumps), log_likelihood)


def _log_normal(error: float, deviation: float) -> float:
    return -0.5 * (error / deviation) ** 2 - math.log(deviation) - _LOG_ROOT_2PI


def _filtered(
    copies: Copies, last: Belief, step: FloatArray, noise: float, u: float, y: float, k: int
) -> tuple[Belief, float, float]:
    """The belief after the sample `k`, the output that was predicted, and the standard deviation expected of it."""
    count, covariance = step.size, last.covariance.copy()
    covariance[range(count), range(count)] += step**2
    points = last.mean + _sigma_points(covariance)
    memory = np.ascontiguousarray(np.column_stack([np.full(len(points), last.before), points[:, count:]]))
    outputs = copies.moved(points[:, :count], memory, last.before, u)
    points[:, count:] = memory[:, 1:]
    usable = np.isfinite(outputs) & np.isfinite(points).all(axis=1)
    points, outputs = points[usable], outputs[usable]
    if not outputs.size:
        raise ValueError(f"every copy of the law diverges at sample {k}: give a smaller drift")
    mean, predicted = points.mean(axis=0), float(outputs.mean())
    apart, errors = points - mean, outputs - predicted
    variance = float(errors @ errors) / len(points) + noise**2
    gain = apart.T @ errors / len(points) / variance
    after = apart.T @ apart / len(points) - variance * np.outer(gain, gain)
    return Belief(mean + gain * (y - predicted), after, u), predicted, float(np.sqrt(variance))


def _sigma_points(covariance: FloatArray) -> FloatArray:
    size = np.maximum(covariance.diagonal(), 0.0)
    scale = np.sqrt(np.where(size > 0.0, size, 1.0))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    spread = scale[:, np.newaxis] * vectors * np.sqrt(np.maximum(values, _LEAST) * len(scale))
    spread[size <= 0.0] = 0.0
    return np.asarray(np.concatenate([spread.T, -spread.T]))


def particles(
    copies: Copies, x: FloatArray, walk: Walk, noise: float, u: FloatArray, y: FloatArray, count: int, seed: int
) -> Filtered:
    """The filter by particles from the coordinates `x` (n_names,)."""
    rng = np.random.default_rng(seed)
    points = x + walk.first * rng.standard_normal((count, x.size))
    memory = np.tile(copies.begun(float(u[0])), (count, 1))
    weights = np.full(count, 1.0 / count)
    means, deviations = np.empty((u.size, x.size)), np.empty((u.size, x.size))
    predicted, expected = np.empty(u.size), np.empty(u.size)
    log_likelihood = 0.0
    for k in range(u.size):
        points = points + walk.step * rng.standard_normal(points.shape)
        jumping = rng.random(count) < _JUMPING
        points[jumping] += walk.jump * rng.standard_normal((int(jumping.sum()), x.size))
        outputs = copies.moved(points, memory, float(u[max(k - 1, 0)]), float(u[k]))
        usable = np.isfinite(outputs)
        if not usable.any():
            raise ValueError(f"every copy of the law diverges at sample {k}: give a smaller drift")
        known, weights = np.where(usable, outputs, 0.0), usable * weights / (usable @ weights)
        predicted[k] = weights @ known
        expected[k] = np.sqrt(weights @ (known - predicted[k]) ** 2 + noise**2)
        log = -0.5 * ((float(y[k]) - known) / noise) ** 2
        most = log[usable].max()
        weights = weights * np.exp(log - most)
        log_likelihood += most + math.log(weights.sum()) - math.log(noise) - _LOG_ROOT_2PI
        weights = weights / weights.sum()
        means[k] = weights @ points
        deviations[k] = np.sqrt(weights @ (points - means[k]) ** 2)
        if 1.0 / float(weights @ weights) < _FEWEST * count:
            chosen = np.searchsorted(np.cumsum(weights), (np.arange(count) + rng.random()) / count).clip(max=count - 1)
            points, memory, weights = points[chosen], memory[chosen], np.full(count, 1.0 / count)
    return Filtered(means, deviations, predicted, expected, (), float(log_likelihood))


_BAND = 1.959963984540054  # standard deviations of a band at 95 %


@frozen_result
class ParameterTrack:
    """Numbers of a law along a record, as far as the samples up to each one tell them.

    Attributes
    ----------
    names : tuple of str
        The numbers that are free to drift.
    values, lower, upper : array, shape (n_samples, n_names)
        Estimates and their bands at 95 % [unit of each number].
    predicted, residual, expected_error : array, shape (n_samples,)
        Output predicted one sample ahead, measured minus predicted, and its expected standard deviation [unit of y].
    jumps : tuple of int
        Samples at which the errors had become too large for a drift; none for particles, of which some always jump.
    method : str
        ``"sigma-point"`` or ``"particle"``.
    noise : float
        Standard deviation of the measurement [unit of y].
    drift : mapping
        Names to the standard deviation of the walk over the whole record [unit of each].
    searched : tuple of str
        Names whose drift was not given: it is the most likely one.
    log_likelihood : float
        Logarithm of the likelihood of the errors.
    model : law
        The law with the last estimates.
    """

    names: tuple[str, ...]
    values: FloatArray
    lower: FloatArray
    upper: FloatArray
    predicted: FloatArray
    residual: FloatArray
    expected_error: FloatArray
    jumps: tuple[int, ...]
    method: str
    noise: float
    drift: Mapping[str, float]
    searched: tuple[str, ...]
    log_likelihood: float
    model: Any

    def __getitem__(self, name: str) -> FloatArray:
        """The path of one number, shape (n_samples,); KeyError if it is not free."""
        return self.values[:, self._place(name)]

    def band(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of the band of a number, (n_samples,) each; KeyError if it is not free."""
        return self.lower[:, self._place(name)], self.upper[:, self._place(name)]

    @property
    def consistency(self) -> float:
        """Mean square of the errors over the expected ones: near one if noise and drift are what was said."""
        return float(np.mean((self.residual / self.expected_error) ** 2))

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(f"{name!r} is not tracked: {', '.join(self.names)}")
        return self.names.index(name)

    def summary(self) -> str:
        """The printed result as a text."""
        return str(self)

    def __str__(self) -> str:
        rms = float(np.sqrt(np.mean(self.residual**2)))
        head = f"ParameterTrack by {self.method}s: {len(self.values)} samples, one-step error rms {rms:.4g}"
        rows = {
            name: f"{self.values[0, k]:.4g} to {self.values[-1, k]:.4g}, at the end within "
            f"[{self.lower[-1, k]:.4g}, {self.upper[-1, k]:.4g}] at 95 %"
            for k, name in enumerate(self.names[:6])
        }
        sizes = ", ".join(
            f"{name} {size:.3g}{' (most likely)' if name in self.searched else ''}"
            for name, size in list(self.drift.items())[:6]
        )
        notes = {
            "drift over the record": sizes,
            "consistency": f"{self.consistency:.3g} (near 1 if noise and drift are what was said)",
            "jumps": f"at samples {', '.join(map(str, self.jumps[:8]))}" if self.jumps else "",
        }
        return summary_text([head], rows | notes)


_STEPS = (1.0, 0.5, 0.25)  # decades
_SMALLEST, _LARGEST = -4.0, 1.0  # decades beside the first sizes


def most_likely(
    log_likelihood: Callable[[FloatArray], float], sizes: FloatArray, searched: npt.NDArray[np.bool_]
) -> FloatArray:
    """The most likely sizes (n_names,); only some are searched."""
    if not searched.any():
        return sizes
    exponents, best = np.zeros(sizes.size), log_likelihood(sizes)
    for step in _STEPS:
        improved = True
        while improved:
            improved = False
            for k in np.flatnonzero(searched):
                for direction in (-step, step):
                    trial = exponents.copy()
                    trial[k] = min(max(trial[k] + direction, _SMALLEST), _LARGEST)
                    value = best if trial[k] == exponents[k] else log_likelihood(sizes * 10.0**trial)
                    if value > best:
                        exponents, best, improved = trial, value, True
    return np.asarray(sizes * 10.0**exponents)


_DRIFT, _JUMP = 0.1, 0.2  # of the size
_MOST_MEMORIES = 40  # of a filter by sigma points
_NORMAL = 1.4826  # standard deviations of the median of the sizes


@reports
def track_parameters(
    law: Any,
    record: Record,
    free: Sequence[str],
    *,
    drift: Mapping[str, float] | None = None,
    jump: Mapping[str, float] | None = None,
    noise: float | None = None,
    method: Literal["sigma-point", "particle"] = "sigma-point",
    particles_count: int = 500,
    seed: int = 0,
    progress: Reports = None,
) -> ParameterTrack:
    """Follow numbers of a law that drift along a record.

    The numbers walk at random, and the law's memory follows from them by its exact step. A number that the law refuses
    where it is negative is tracked by its logarithm.

    Parameters
    ----------
    law : Law or result of a fit
        A law with the numbers and the memory at the first sample; of a fit to data that `record` continues,
        ``fit.model.after(earlier.u)``.
    record : Record
        Input and measured output.
    free : sequence of str
        Names of the numbers that drift, as in ``law.scalars``.
    drift : mapping, optional
        Names to the change that is expected over the whole record, as the standard deviation of a random walk [unit of
        each]. By default the size for which the errors of predictions one sample ahead are most likely, which takes
        some twenty passes of the filter for each name; the number at the first sample is then known to a tenth.
    jump : mapping, optional
        Names to the size of a sudden change, zero for none; by default a fifth of the value.
    noise : float, optional
        Standard deviation of the measurement; by default from the third differences of the output [unit of y].
    method : {"sigma-point", "particle"}
        Sigma points are quick, and made for a memory of a few numbers that change evenly. Particles take any law.
    particles_count, seed : int
        Number of the particles, and of their draws.
    progress : callable or False, optional
        Called as ``progress(passes, 0)`` for each pass of the filter; see `hysim.simulate`.

    Returns
    -------
    ParameterTrack

    Raises
    ------
    TypeError, ValueError
        If the law is none, or depends on the rate of its input; if a name or the method is unknown, the noise is not
        positive, or every copy of the law diverges.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=10, samples_per_cycle=40)
    >>> law = hs.BoucWen(n=1.0, feedthrough=0.5)
    >>> fades = np.linspace(1.0, 0.8, u.size)
    >>> y = 0.5 * u + fades * law.memory(u) + 0.005 * np.random.default_rng(0).standard_normal(u.size)
    >>> track = hs.track_parameters(law, hs.Record(u=u, y=y), ["gain"], drift={"gain": 0.2}, noise=0.005)
    >>> bool(abs(track["gain"][-1] - 0.8) < 0.02)
    True
    """
    law = model_of(law)
    if not isinstance(law, Law):
        raise TypeError(f"law must be a law that a step describes, such as BoucWen, got {type(law).__name__}")
    if not isinstance(record, Record):
        raise TypeError(f"track_parameters takes one Record, got {type(record).__name__}")
    coordinates, spread = coordinates_of(law, free), _noise_of(record) if noise is None else float(noise)
    if not 0.0 < spread < math.inf:
        raise ValueError("noise must be positive: give the standard deviation of the measurement")
    check_choice("method", method, ("sigma-point", "particle"))
    check_count("particles_count", particles_count)
    copies, x = Copies(law, coordinates), coordinates.encode(coordinates.values)
    if method == "sigma-point" and copies.memory.size > _MOST_MEMORIES:
        raise ValueError(f'this law remembers {copies.memory.size} numbers: use method="particle"')
    usual = sizes_along(law, coordinates.names, record.u)
    drifts = _sizes(coordinates, drift or {}, _DRIFT * usual, "drift")
    jumps = _sizes(coordinates, jump or {}, _JUMP * usual, "jump")
    first = coordinates.spread(drifts)

    passes = itertools.count(1)

    def filtered(sizes: FloatArray, by: str) -> Filtered:
        if progress:
            progress(next(passes), 0)
        walk = Walk(first, coordinates.spread(sizes) / np.sqrt(len(record)), coordinates.spread(jumps))
        if by == "particle":
            return particles(copies, x, walk, spread, record.u, record.y, particles_count, seed)
        return sigma_points(copies, x, walk, spread, record.u, record.y)

    searched = np.array([name not in (drift or {}) for name in coordinates.names])
    by = "particle" if copies.memory.size > _MOST_MEMORIES else "sigma-point"
    drifts = most_likely(lambda sizes: filtered(sizes, by).log_likelihood, drifts, searched)
    estimates = filtered(drifts, method)
    values = coordinates.decode(estimates.mean)
    last: dict[str, float] = dict(zip(coordinates.names, values[-1].tolist(), strict=True))
    return ParameterTrack(
        names=coordinates.names,
        values=values,
        lower=coordinates.decode(estimates.mean - _BAND * estimates.deviation),
        upper=coordinates.decode(estimates.mean + _BAND * estimates.deviation),
        predicted=estimates.predicted,
        residual=record.y - estimates.predicted,
        expected_error=estimates.expected_error,
        jumps=estimates.jumps,
        method=method,
        noise=spread,
        drift=dict(zip(coordinates.names, drifts.tolist(), strict=True)),
        searched=tuple(np.array(coordinates.names)[searched].tolist()),
        log_likelihood=estimates.log_likelihood,
        model=law.with_scalars(last),
    )


def _sizes(coordinates: Coordinates, user: Mapping[str, Any], usual: FloatArray, what: str) -> FloatArray:
    """Sizes of changes (n_names,), those that are not given as usual."""
    if unknown := [name for name in as_mapping(user, what) if name not in coordinates.names]:
        raise ValueError(f"{what} has {unknown[0]!r}, which is not free")
    sizes = np.array([float(user.get(name, own)) for name, own in zip(coordinates.names, usual, strict=True)])
    if not ((sizes >= 0.0) & (sizes < np.inf)).all():
        raise ValueError(f"{what} must be finite and not negative, got {dict(user)}")
    return sizes


def _noise_of(record: Record) -> float:
    """Standard deviation of white noise by the third differences of the output, which a smooth output does not have."""
    third = np.diff(record.y, 3)
    return float(_NORMAL * np.median(np.abs(third)) / np.sqrt(20.0)) if third.size else 0.0
