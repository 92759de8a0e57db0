"""Priors of the parameters: flat in the box of the search, or given.

A searched parameter has a flat prior in its coordinate, between the sides of the search box; (low, high) are other
sides, a distribution is of the parameter itself. A linear parameter b of the column C(x) has one of what it adds,

    w = b s(x) / Y,    -reach <= w <= reach,    s(x) the span of C(x) over the samples, Y that of the measured output,

which fits any units and any size of the memory; a column without a span, such as that of an offset, has s = max |C| and
its centre at the mean of the output. ln sigma is flat.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.identification.likelihood import Problem

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
        raise TypeError(
            f"the prior of {name!r} must be (low, high) or a frozen distribution of scipy.stats, got {value!r}"
        ) from None
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
    own = {
        k: (named[name], _scale(problem, k))
        for k, name in enumerate(space.coordinates)
        if name in named and named[name].distribution is not None
    }
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

    With `priors` by place, the others are flat in w from `centre` - `reach` to `centre` + `reach`.
    """

    priors: Mapping[int, Given]
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
        unit, centre, _ = units
        total = np.zeros(len(w))
        for k in range(w.shape[1]):
            if k in self.priors:
                total = total + self.priors[k].log_density(unit[:, k] * w[:, k]) + np.log(unit[:, k])
            else:
                inside = np.abs(w[:, k] - centre[:, k]) <= self.reach
                total = total + np.where(inside, -math.log(2.0 * self.reach), -np.inf)
        return total

    def quantile(self, share: FloatArray, units: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """Parameters in their units from numbers that are uniform between 0 and 1."""
        unit, centre, _ = units
        w = centre + self.reach * (2.0 * share - 1.0)
        for k, prior in self.priors.items():
            w[:, k] = prior.quantile(share[:, k]) / unit[:, k]
        return w

    def ends(self, units: tuple[FloatArray, FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """The least and the largest values that the prior allows, in units, (n_sets, n_linear)."""
        unit, centre, _ = units
        low, high = centre - self.reach, centre + self.reach
        for k, prior in self.priors.items():
            low[:, k], high[:, k] = prior.low / unit[:, k], prior.high / unit[:, k]
        return low, high


def linear(problem: Problem, priors: Mapping[str, Given], factor: float = 1.0) -> Linear:
    names = problem.space.linear
    own = {k: priors[key].scaled(factor) for k, name in enumerate(names) if (key := _key(name, priors)) is not None}
    span = float(np.ptp(problem.y)) or problem.scale
    return Linear(own, factor * REACH, span, float(problem.y.mean()))


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
