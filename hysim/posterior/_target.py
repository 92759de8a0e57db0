"""The posterior density of all parameters, for many sets at once.

A point is q = (x', e, s'): the coordinates of the search x and ln sigma, each as the standard normal quantile of its
place in the box, x = lower + (upper - lower) Phi(x'), so that a flat prior becomes a normal one and a box has no sides;
and one number for each linear parameter. The output y(x, b) = C(x) b + e0(x) is linear in b. With the units of the
prior (see below), its centre c and standard deviations d, and s the spread of the noise, the regression

    [C / s; 1 / d] w = [(y - e0) / s; c / d],    [C / s; 1 / d] = Q R,    w_0 = R^-1 (Q^T rhs)

has the best linear parameters w_0 at this x, and R (w - w_0) is about standard normal between the ends of the priors.
From the last row of R up, each of its numbers is the quantile of the normal distribution that these ends cut off,

    x_k = Phi^-1(Phi(a_k) + Phi(e_k) (Phi(b_k) - Phi(a_k))),    a_k <= x_k <= b_k given the rows below.

This is a change of coordinates whose volume is known, and no approximation: for normal
noise e is about standard normal whatever x is, so that chains need not follow the narrow ridges between linear and
other parameters, nor the sides of their boxes. All parameters are sampled; none is integrated out.

**Normal numbers between ends** are functions of normal numbers that have none. With Phi the distribution of the
standard normal one, x = Phi^-1(Phi(low) + Phi(e) (Phi(high) - Phi(low))) is normal between its ends where e is standard
normal. All is computed by logarithms, so that ends may lie far out on one side.

**The priors** are flat in the box of the search, or given. A searched parameter has a flat prior in its coordinate,
between the sides of the search box; (low, high) are other sides, a distribution is of the parameter itself. A linear
parameter b of the column C(x) has one of what it adds,

    w = b s(x) / Y,    -reach <= w <= reach,    s(x) the span of C(x) over the samples, Y that of the measured output,

which fits any units and any size of the memory; a column without a span, such as that of an offset, has s = max |C| and
its centre at the mean of the output. ln sigma is flat.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp

from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.identification.likelihood import Noise, Problem

REACH = 3.0
"""Largest w of a linear parameter without a given prior: three spans of the measured output."""

SIGMA = "sigma"

_LEAST = float(np.finfo(float).tiny)
_TAIL = 1e-10  # probability beyond each side of the box of a distribution
_QUARTILES = 1.349  # standard deviations between those of a normal distribution
_LEVEL = 1e-9  # of the size of a column: a smaller span is none
_FINEST = 0.1  # quanta: smallest sigma of rounded data, as in `identify`
_SMALLEST = 1e-6  # of the output's span: smallest sigma otherwise
_POINTS = np.linspace(0.1, 0.9, 5)  # of the box, where the scale of a coordinate is looked at


@dataclass(frozen=True)
class Given:
    """A prior that the user gives: a flat one from `low` to `high`, or a distribution of scipy.stats."""

    low: float
    high: float
    distribution: Any = None

    @property
    def centre(self) -> float:
        """Mean of the prior; its median where it has no mean."""
        if self.distribution is None:
            return 0.5 * (self.low + self.high)
        mean = float(self.distribution.mean())
        return mean if math.isfinite(mean) else float(self.distribution.ppf(0.5))

    @property
    def spread(self) -> float:
        """Standard deviation of the prior; from its quartiles if it is not defined."""
        if self.distribution is None:
            return (self.high - self.low) / math.sqrt(12.0)
        spread = float(self.distribution.std())
        return spread if math.isfinite(spread) else float(np.diff(self.distribution.ppf([0.25, 0.75]))[0]) / _QUARTILES

    def log_density(self, values: FloatArray) -> FloatArray:
        """Logarithm of the density of the parameter's `values`; minus infinity outside."""
        inside = (values >= self.low) & (values <= self.high)
        if self.distribution is None:
            return np.where(inside, -math.log(self.high - self.low), -np.inf)
        return np.asarray(np.where(inside, self.distribution.logpdf(values), -np.inf))

    def quantile(self, share: FloatArray) -> FloatArray:
        if self.distribution is None:
            return self.low + share * (self.high - self.low)
        return np.asarray(np.clip(self.distribution.ppf(share), self.low, self.high))

    def scaled(self, factor: float) -> "Given":
        """A flat prior with its box this much larger about its centre; a distribution is what it was."""
        if self.distribution is not None:
            return self
        low, high = scaled_box(np.array([self.low]), np.array([self.high]), factor)
        return Given(float(low[0]), float(high[0]))

    def __str__(self) -> str:
        if self.distribution is None:
            return f"flat from {self.low:.4g} to {self.high:.4g}"
        return f"{_called(self.distribution)}, mean {self.centre:.4g}, standard deviation {self.spread:.4g}"


def _called(distribution: Any) -> str:
    """Name of a distribution; a frozen one of scipy.stats knows its own."""
    known = vars(distribution)
    return str(known["dist"].name) if "dist" in known else type(distribution).__name__


def given(priors: Mapping[str, Any]) -> dict[str, Given]:
    """The priors by name; a ValueError or TypeError says which one is neither limits nor a distribution."""
    return {name: _given(name, value) for name, value in priors.items()}


def _given(name: str, value: Any) -> Given:
    if isinstance(value, Given):
        return value
    if isinstance(value, (tuple, list, np.ndarray)):
        if np.shape(value) != (2,) or not np.isfinite(np.asarray(value, dtype=float)).all() or not value[0] < value[1]:
            raise ValueError(f"the prior of {name!r} must be (low, high), both finite and low < high, got {value!r}")
        return Given(float(value[0]), float(value[1]))
    try:
        low, high = float(value.ppf(_TAIL)), float(value.ppf(1.0 - _TAIL))
        value.logpdf(low)
    except (AttributeError, TypeError):
        kinds = "(low, high) or a frozen distribution of scipy.stats"
        raise TypeError(f"the prior of {name!r} must be {kinds}, got {value!r}") from None
    return Given(low, high, value)


def scaled_box(lower: FloatArray, upper: FloatArray, factor: float) -> tuple[FloatArray, FloatArray]:
    """A box this much larger about its centre; a side that would change its sign stays where it was."""
    centre, half = 0.5 * (lower + upper), 0.5 * factor * (upper - lower)
    low, high = centre - half, centre + half
    low = np.where((lower >= 0.0) & (low < 0.0), lower, low)
    return low, np.where((upper <= 0.0) & (high > 0.0), upper, high)


@dataclass(frozen=True)
class Searched:
    """Prior of the coordinates x and ln sigma, (n_sets, n_x + 1), in a box; `own` are the given ones, by place."""

    lower: FloatArray
    upper: FloatArray
    own: Mapping[int, tuple[Given, "Scale"]]

    def log_density(self, x: FloatArray) -> FloatArray:
        """Logarithm of the density of the coordinates (n_sets,)."""
        inside = ((x >= self.lower) & (x <= self.upper)).all(axis=1)
        total = np.where(inside, 0.0, -np.inf)
        for k in range(x.shape[1]):
            if k in self.own:
                prior, scale = self.own[k]
                with np.errstate(all="ignore"):
                    total = total + prior.log_density(scale.value(x[:, k])) + scale.log_slope(x[:, k])
            else:
                total = total - math.log(self.upper[k] - self.lower[k])
        return np.where(inside, total, -np.inf)

    def quantile(self, share: FloatArray) -> FloatArray:
        """Coordinates (n_sets, n_x + 1) from numbers that are uniform between 0 and 1."""
        x = self.lower + share * (self.upper - self.lower)
        for k, (prior, scale) in self.own.items():
            x[:, k] = np.clip(scale.coordinate(prior.quantile(share[:, k])), self.lower[k], self.upper[k])
        return np.asarray(x)


@dataclass(frozen=True)
class Scale:
    """A parameter as a function of its coordinate: unit x + origin, or unit exp(x)."""

    unit: float
    origin: float
    is_log: bool

    def value(self, x: FloatArray) -> FloatArray:
        return self.unit * np.exp(x) if self.is_log else self.origin + self.unit * x

    def coordinate(self, value: FloatArray) -> FloatArray:
        return np.log(np.maximum(value / self.unit, _LEAST)) if self.is_log else (value - self.origin) / self.unit

    def log_slope(self, x: FloatArray) -> FloatArray | float:
        return math.log(abs(self.unit)) + (x if self.is_log else 0.0)


def searched(problem: Problem, priors: Mapping[str, Given], quantum: float | None, factor: float = 1.0) -> Searched:
    """Prior of the coordinates of a problem and of ln sigma; the box of the former is enlarged by `factor`.

    The box has the ends of the given `priors`; `quantum` is that of rounded data.
    """
    space = problem.space
    named = {name: priors[key] for name in space.coordinates if (key := _key(name, priors)) is not None}
    fixed = np.array([name in named and named[name].distribution is not None for name in space.coordinates], dtype=bool)
    lower, upper = scaled_box(space.lower, space.upper, factor)
    lower, upper = np.where(fixed, space.lower, lower), np.where(fixed, space.upper, upper)
    if not np.isfinite([lower, upper]).all():
        name = space.coordinates[int(np.argmax(~np.isfinite(lower) | ~np.isfinite(upper)))]
        raise ValueError(f"{name!r} has no finite search box: pass priors={{{name!r}: (low, high)}}")
    own = {k: (named[space.coordinates[k]], _scale(problem, k)) for k in np.flatnonzero(fixed).tolist()}
    low, high = _ends_of_sigma(problem, priors.get(SIGMA), quantum)
    if SIGMA in priors and priors[SIGMA].distribution is not None:
        own[lower.size] = priors[SIGMA], Scale(1.0, 0.0, is_log=True)
    return Searched(np.append(lower, low), np.append(upper, high), own)


def _key(name: str, priors: Mapping[str, Given]) -> str | None:
    """The name under which a prior is given: of a state of one record also without the record's number."""
    return next((each for each in (name, name.rpartition("[")[0]) if each in priors), None)


def _scale(problem: Problem, k: int) -> Scale:
    """How the parameter depends on its own coordinate; a ValueError where that is neither linear nor a logarithm."""
    space = problem.space
    x = np.tile(0.5 * (space.lower + space.upper), (_POINTS.size, 1))
    x[:, k] = space.lower[k] + _POINTS * (space.upper[k] - space.lower[k])
    theta = np.concatenate([x, np.zeros((len(x), len(space.linear)))], axis=1)
    values = problem.named(theta)[:, space.names.index(space.coordinates[k])]
    for is_log in (False, True):
        points = np.log(np.abs(values)) if is_log else values
        slope = float((points[-1] - points[0]) / (x[-1, k] - x[0, k]))
        origin = float(points[0] - slope * x[0, k])
        apart = np.abs(points - (origin + slope * x[:, k])).max()
        if apart <= 1e-9 * np.abs(points).max() and (not is_log or abs(slope - 1.0) < 1e-9):
            size = math.copysign(math.exp(min(origin, 700.0)), values[0])
            return Scale(size, 0.0, True) if is_log else Scale(slope, origin, False)
    raise ValueError(f"a distribution of {space.coordinates[k]!r} is not possible: pass (low, high)")


@dataclass(frozen=True)
class Linear:
    """Prior of the linear parameters b, in units (n_sets, n_linear) in which it has about the width one.

    With `priors` by place, the others are flat in w from `centre` - `reach` to `centre` + `reach`, as far as that is
    within the `box` of their least and largest values (2, n_linear), such as bounds of physics.
    """

    priors: Mapping[int, Given]
    box: FloatArray
    reach: float
    span: float  # of the measured output
    mean: float

    def units(self, columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Unit of each parameter, and centre and standard deviation of its prior in units, (n_sets, n_linear)."""
        along = np.ascontiguousarray(np.swapaxes(columns, 1, 2))  # extremes across the memory are slow
        low, high = along.min(axis=2), along.max(axis=2)
        size = np.maximum(np.abs(low), np.abs(high))
        is_level = high - low <= _LEVEL * size
        scale = np.where(is_level, size, high - low)
        unit = self.span / np.where(scale > 0.0, scale, 1.0)
        centre = np.where(is_level, self.mean / self.span * np.sign(low), 0.0)
        spread = np.full(unit.shape, self.reach / math.sqrt(3.0))
        for k, prior in self.priors.items():
            unit[:, k], centre[:, k], spread[:, k] = prior.spread, prior.centre / prior.spread, 1.0
        return unit, centre, spread

    def log_density(self, w: FloatArray, units: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """Logarithm of the density of the parameters in their units (n_sets,)."""
        unit, (low, high) = units[0], self.ends(units)
        total = np.zeros(len(w))
        for k in range(w.shape[1]):
            if k in self.priors:
                total = total + self.priors[k].log_density(unit[:, k] * w[:, k]) + np.log(unit[:, k])
            else:
                inside = (low[:, k] <= w[:, k]) & (w[:, k] <= high[:, k])
                width = np.maximum(high[:, k] - low[:, k], _LEAST_WIDTH)  # a huge bound loses its width to rounding
                total = total + np.where(inside, -np.log(width), -np.inf)
        return total

    def quantile(self, share: FloatArray, units: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """Parameters in their units from numbers that are uniform between 0 and 1."""
        unit, centre, _ = units
        (low, high), is_free = self.ends(units), np.isinf(self.box).all(axis=0)
        w = np.where(is_free, centre + self.reach * (2.0 * share - 1.0), low + (high - low) * share)
        for k, prior in self.priors.items():
            w[:, k] = prior.quantile(share[:, k]) / unit[:, k]
        return w

    def ends(self, units: tuple[FloatArray, FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """The least and the largest values that the prior allows, in units, (n_sets, n_linear)."""
        unit, centre, _ = units
        least, most = self.box[0] / unit, self.box[1] / unit  # beyond the reach it begins there
        low = np.maximum(np.minimum(centre - self.reach, most - self.reach), least)
        high = np.minimum(np.maximum(centre + self.reach, least + self.reach), most)
        for k, prior in self.priors.items():
            low[:, k], high[:, k] = prior.low / unit[:, k], prior.high / unit[:, k]
        return low, high


def linear(problem: Problem, priors: Mapping[str, Given], factor: float = 1.0) -> Linear:
    names = problem.space.linear
    own = {k: priors[key].scaled(factor) for k, name in enumerate(names) if (key := _key(name, priors)) is not None}
    span = float(np.ptp(problem.y)) or problem.scale
    return Linear(own, np.array(problem.linear_box()), factor * REACH, span, float(problem.y.mean()))


def _ends_of_sigma(problem: Problem, own: Given | None, quantum: float | None) -> tuple[float, float]:
    """Ends of ln sigma, those of its `own` prior if there is one."""
    if own is not None:
        if not own.high > 0.0 or (own.distribution is None and not own.low > 0.0):
            raise ValueError(f"the prior of 'sigma' must be positive, got {own}")
        return math.log(max(own.low, 1e-12 * own.high)), math.log(own.high)
    span = float(np.ptp(problem.y)) or problem.scale
    low = _SMALLEST * span if quantum is None else _FINEST * quantum
    return math.log(low), math.log(max(span, 10.0 * low))


def check_names(problem: Problem, free: Sequence[str], priors: Mapping[str, Given]) -> None:
    """A ValueError for a prior of a parameter that is not one of the `free` ones, or not sampled by itself."""
    sampled = {*problem.space.coordinates, *problem.space.linear, SIGMA}
    sampled |= {name.rpartition("[")[0] for name in problem.space.state}
    for name in priors:
        if name not in {*free, *(each.rpartition("[")[0] for each in free), SIGMA}:
            raise ValueError(f"priors name {name!r}, which is not free; the parameters are {', '.join(free)}")
        if name not in sampled:
            raise ValueError(f"{name!r} is not sampled by itself, and can have no prior of its own")


_FAR = 9.0  # from which on an end cuts off nothing that is seen in 64 bits


def solved_within(
    triangle: FloatArray, best: FloatArray, e: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The w with R w - best normal between low and high, and ln |dw/de|; no diagonal of R (n_sets, n, n) is zero."""
    w, log_volume = np.empty_like(e), np.zeros(len(e))
    for k in reversed(range(e.shape[1])):
        scale = triangle[:, k, k]
        mean = best[:, k] - np.einsum("sj,sj->s", triangle[:, k, k + 1 :], w[:, k + 1 :])
        ends = np.sort([scale * low[:, k] - mean, scale * high[:, k] - mean], axis=0)
        x, log_slope = between(e[:, k], *ends)
        w[:, k] = np.clip((mean + x) / scale, low[:, k], high[:, k])
        log_volume += log_slope - np.log(np.abs(scale))
    return w, log_volume


def between(e: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The x between low < high whose quantile there is that of e, and ln dx/de, (n_sets,)."""
    if (low < -_FAR).all() and (high > _FAR).all():
        return e, np.zeros(len(e))
    is_above = low + high > 0.0  # the tail on the other side keeps the digits
    least, most = np.where(is_above, -high, low), np.where(is_above, -low, high)
    below, above = log_ndtr(least), log_ndtr(most)
    with np.errstate(divide="ignore"):  # there is nothing between equal ends
        mass = above + np.log1p(-np.exp(np.minimum(below - above, -1e-300)))
    x = np.clip(ndtri_exp(np.logaddexp(below, log_ndtr(np.where(is_above, -e, e)) + mass)), least, most)
    return np.where(is_above, -x, x), mass + 0.5 * (x**2 - e**2)


_LEAST_WIDTH = 1e-300
_SAMPLES_AT_ONCE = 50_000
_LOG_2PI = float(np.log(2.0 * np.pi))
_EDGE = 1e-12  # share of a box next to its sides
_LOWEST = -1e300
_LARGEST = 1e100  # beyond it squares of squares overflow: such a set has diverged


class Columns(NamedTuple):
    """Regression: columns, the target without them, the units of the prior, and which diverged."""

    columns: FloatArray  # (n_sets, n_samples, n_linear)
    target: FloatArray  # (n_sets, n_samples)
    units: tuple[FloatArray, FloatArray, FloatArray]
    is_lost: np.ndarray[Any, np.dtype[np.bool_]]


@dataclass
class Target:
    """Posterior of a problem with noise and priors; `evaluations` counts sets, `optima` are v (n_optima, n_x + 1)."""

    problem: Problem
    noise: Noise
    v_prior: Searched  # of the coordinates of the search and ln sigma
    b_prior: Linear
    evaluations: int = field(default=0)
    optima: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @cached_property
    def _counted(self) -> tuple[npt.NDArray[np.intp], FloatArray] | None:
        """Samples that have a weight, and its root relative to their mean; None if all have the same."""
        weights = self.problem.weights
        kept = np.flatnonzero(weights)
        root = np.sqrt(weights[kept] / weights[kept].mean())
        return None if kept.size == weights.size and np.ptp(root) == 0.0 else (kept, root)

    @property
    def n_x(self) -> int:
        return self.problem.n_x

    @property
    def n_linear(self) -> int:
        return len(self.problem.space.linear)

    @property
    def n_dim(self) -> int:
        return self.n_x + self.n_linear + 1

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.problem.space.names, SIGMA)

    def priors_in_words(self) -> dict[str, str]:
        space, (*ends, of_sigma) = self.problem.space, np.column_stack([self.v_prior.lower, self.v_prior.upper])
        words = {name: self._flat_in_words(k, name, *ends[k]) for k, name in enumerate(space.coordinates)}
        flat = f"flat, within {self.b_prior.reach:g} spans of the output of what it adds to it"
        box = self.b_prior.box.T
        within = [f", from {low:.4g} to {high:.4g}" if np.isfinite([low, high]).any() else "" for low, high in box]
        words |= {name: str(self.b_prior.priors.get(k, flat + within[k])) for k, name in enumerate(space.linear)}
        low, high = np.exp(of_sigma).tolist()
        words |= {SIGMA: f"flat in its logarithm from {low:.3g} to {high:.3g}"}
        return words | {(*space.coordinates, SIGMA)[k]: str(own) for k, (own, _) in self.v_prior.own.items()}

    def _flat_in_words(self, k: int, name: str, low: float, high: float) -> str:
        """A flat prior of a coordinate in terms of its parameter, where that is the coordinate or its exponential.

        It is so in the middle of the box of the others and half way to its corners.
        """
        names, shares = self.problem.space.names, np.linspace(0.0, 1.0, 9)
        sides = self.v_prior.lower[: self.n_x], self.v_prior.upper[: self.n_x]
        for_others = [np.tile(sides[0] + share * (sides[1] - sides[0]), (9, 1)) for share in (0.25, 0.5, 0.75)]
        theta = np.concatenate([np.concatenate(for_others), np.zeros((27, self.n_linear))], axis=1)
        theta[:, k] = np.tile(low + shares * (high - low), 3)
        if name in names:
            values = self.problem.named(theta)[:, names.index(name)].reshape(3, 9)
            first, last = values[0, 0], values[0, -1]
            if np.allclose(values, first + shares * (last - first), rtol=1e-6, atol=1e-9 * abs(last - first)):
                return f"flat from {first:.4g} to {last:.4g}"
            if first * last > 0.0 and np.allclose(values / first, (last / first) ** shares, rtol=1e-6):
                return f"flat in its logarithm from {first:.4g} to {last:.4g}"
        return f"flat from {low:.4g} to {high:.4g} in the coordinate of the search"

    def log_posterior(self, q: FloatArray) -> FloatArray:
        """Logarithm of likelihood times prior in the coordinates q (n_sets, n_dim), -inf outside of the priors."""
        values, (v, e) = np.full(len(q), -np.inf), self._parted(q)
        prior = self._log_prior(self.without_linear(q), v)
        for places in self._chunks(np.flatnonzero(np.isfinite(prior))):
            parts, sigma = self._columns(v[places, :-1]), np.exp(v[places, -1])
            w, log_volume = self._from_normal(parts, e[places], sigma)
            density = self._log_likelihood(parts, w, sigma) + self.b_prior.log_density(w, parts.units) + log_volume
            values[places] = prior[places] + density
        return values

    def parameters(self, q: FloatArray) -> FloatArray:
        """The user's parameters and sigma at points, (n_sets, n_names + 1)."""
        v, e = self._parted(q)
        b = np.empty_like(e)
        for places in self._chunks(np.arange(len(q))):
            parts = self._columns(v[places, :-1])
            w, _ = self._from_normal(parts, e[places], np.exp(v[places, -1]))
            b[places] = w * parts.units[0]
        theta = np.concatenate([v[:, :-1], b], axis=1)
        return np.column_stack([self.problem.named(theta), np.exp(v[:, -1])])

    def without_linear(self, q: FloatArray) -> FloatArray:
        """v = (x', s') of points, (n_sets, n_x + 1)."""
        return np.concatenate([q[:, : self.n_x], q[:, -1:]], axis=1)

    def prior_draws(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draws of v = (x', s') from the prior, (n, n_x + 1)."""
        return self._normal(self.v_prior.quantile(rng.random((n, self.n_x + 1))))

    def begin_at(self, x: FloatArray, sigma: float) -> None:
        """Take coordinates of optima (n_optima, n_x), and the sigma that they have."""
        self.optima = self._normal(np.column_stack([x, np.full(len(x), np.log(sigma))]))

    def marginal(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """About ln of the likelihood with the linear parameters integrated out, and ln of the prior of v, (n_sets,)."""
        own = self._values(v)
        prior = self._log_prior(v, own)
        values = np.full(len(v), _LOWEST)
        for places in self._chunks(np.flatnonzero(np.isfinite(prior))):
            parts, sigma = self._columns(own[places, :-1]), np.exp(own[places, -1])
            w, log_volume = self._from_normal(parts, np.zeros((len(places), self.n_linear)), sigma)
            density = self.b_prior.log_density(w, parts.units) + log_volume + 0.5 * self.n_linear * _LOG_2PI
            values[places] = np.maximum(self._log_likelihood(parts, w, sigma) + density, _LOWEST)
        return values, prior

    def log_likelihood_in_cube(self, cube: FloatArray) -> FloatArray:
        """Logarithm of the likelihood at points of the unit cube (n_sets, n_dim), on which the prior is uniform."""
        values = np.empty(len(cube))
        for places in self._chunks(np.arange(len(cube))):
            share = cube[places]
            v = self.v_prior.quantile(self.without_linear(share))
            parts = self._columns(v[:, :-1])
            w = self.b_prior.quantile(share[:, self.n_x : -1], parts.units)
            values[places] = self._log_likelihood(parts, w, np.exp(v[:, -1]))
        return values

    def _parted(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates of the search and ln sigma (n_sets, n_x + 1), and e (n_sets, n_linear)."""
        return self._values(self.without_linear(q)), q[:, self.n_x : -1]

    def _values(self, normal: FloatArray) -> FloatArray:
        """Coordinates of the search and ln sigma, by normal numbers (n_sets, n_x + 1)."""
        lower, upper = self.v_prior.lower, self.v_prior.upper
        return np.asarray(np.clip(lower + (upper - lower) * ndtr(normal), lower, upper))

    def _normal(self, values: FloatArray) -> FloatArray:
        share = (values - self.v_prior.lower) / (self.v_prior.upper - self.v_prior.lower)
        return np.asarray(ndtri(np.clip(share, _EDGE, 1.0 - _EDGE)))

    def _log_prior(self, normal: FloatArray, values: FloatArray) -> FloatArray:
        slopes = -0.5 * normal**2 - 0.5 * _LOG_2PI  # of Phi
        widths = np.log(self.v_prior.upper - self.v_prior.lower).sum()
        density = self.v_prior.log_density(values)
        return np.where(np.isfinite(normal).all(axis=1), density + slopes.sum(axis=1) + widths, -np.inf)

    def _chunks(self, places: Any) -> list[Any]:
        size = max(1, _SAMPLES_AT_ONCE // self.problem.y.size)
        return [places[k : k + size] for k in range(0, len(places), size)]

    def _log_likelihood(self, parts: Columns, w: FloatArray, sigma: FloatArray) -> FloatArray:
        residual = parts.target - (parts.columns @ (w * parts.units[0])[..., np.newaxis])[..., 0]
        return np.where(parts.is_lost, -np.inf, self.noise.log_likelihood(residual, sigma))

    def _columns(self, x: FloatArray) -> Columns:
        self.evaluations += len(x)
        columns, fixed = self._split(x)
        target = self.problem.y - fixed
        if self._counted is not None:
            kept, root = self._counted
            columns, target = columns[:, kept] * root[:, np.newaxis], target[:, kept] * root
        with np.errstate(invalid="ignore"):
            is_lost = ~((np.abs(columns) < _LARGEST).all(axis=(1, 2)) & (np.abs(target) < _LARGEST).all(axis=1))
        columns[is_lost], target[is_lost] = 0.0, 0.0
        return Columns(columns, target, self.b_prior.units(columns), np.asarray(is_lost))

    def _split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns and fixed part; sets that the family refuses are not finite."""
        try:
            return self.problem.split(x)
        except (ValueError, ArithmeticError, SimulationError):
            n = len(x)
            if n == 1:
                samples = self.problem.y.size
                return np.full((1, samples, self.n_linear), np.inf), np.full((1, samples), np.inf)
            halves = [self._split(x[: n // 2]), self._split(x[n // 2 :])]
            return np.concatenate([a for a, _ in halves]), np.concatenate([b for _, b in halves])

    def _regression(self, parts: Columns, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The triangle R (n_sets, n_linear, n_linear) and Q^T times the right side (n_sets, n_linear)."""
        unit, centre, spread = parts.units
        n_sets, n = unit.shape
        scale = np.column_stack([unit, np.ones(n_sets)]) / self.noise.spread(sigma)[:, np.newaxis]
        every = np.concatenate([parts.columns, parts.target[..., np.newaxis]], axis=2)
        likely = np.asarray(np.linalg.qr(every, mode="r"))
        both = np.zeros((n_sets, likely.shape[1] + n, n + 1))
        both[:, :-n] = likely * scale[:, np.newaxis]
        both[:, -n + np.arange(n), np.arange(n)] = 1.0 / spread
        both[:, -n:, n] = centre / spread
        rows = np.asarray(np.linalg.qr(both, mode="r"))
        return rows[:, :n, :n], rows[:, :n, n]

    def _from_normal(self, parts: Columns, e: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Linear parameters w in units of the prior, and ln |dw/de|."""
        if not self.n_linear:
            return e, np.zeros(len(e))
        triangle, best = self._regression(parts, sigma)
        return solved_within(triangle, best, e, *self.b_prior.ends(parts.units))
