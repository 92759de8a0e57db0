"""One family on one or several records: an output that is affine in some parameters, and the regression on them.

The family's coordinates x are searched in a box. The output is affine in the linear parameters b,

    y(x, b) = C(x) b + e(x),        b(x) = C(x)^+ (y - e(x)),

so that the norm of r(x) = y - e(x) - C(x) b(x) is minimised over x alone (Golub and Pereyra 1973). Records share all
parameters but the state at the first sample, which each has as ``z0[0]``, ``z0[1]``, ... Everything is evaluated for
many x at once. A `Budget` limits the number of parameter sets that a search may simulate.
"""

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._basics.names import meant
from hysim._columns.channels import taken
from hysim._columns.input_noise import repeated_cycle
from hysim.identification.marquardt import Settled, least_squares, triangle
from hysim.metrics.criteria import information
from hysim.models.by_structure import searched
from hysim.models.protocols import Identifiable, placed
from hysim.models.search_space import STATES, STATES_IN_WORDS, Freedom, SearchSpace
from hysim.models.stages import BASE, Stage
from hysim.records import Record, SensorRecord, few_places

_LEAST = 64  # sets that are always compared
_SHARE = 0.5  # of what remains, for one stage of the search


@dataclass
class Budget:
    """So many samples may be simulated; `spent` of them have been, and `cut` says whether a stage was shortened."""

    samples: float
    spent: float = 0.0
    cut: bool = False

    def sets(self, wanted: int, n_samples: int) -> int:
        """As many of the `wanted` sets as a stage may simulate."""
        allowed = max(_LEAST, int(_SHARE * (self.samples - self.spent) / n_samples))
        self.cut = self.cut or allowed < wanted
        return min(wanted, allowed)

    def steps(self, wanted: int, sets_a_step: int, n_samples: int) -> int:
        """As many of the `wanted` steps of a descent as a stage may take."""
        return min(wanted, max(0, int(_SHARE * (self.samples - self.spent) / (sets_a_step * n_samples))))


# Samples that are evaluated at once: some megabytes of arrays. Of many more, a C library may return the memory to the
# system after each evaluation, and a new page costs as much as the work in it.
_CHUNK = 50_000
_LARGEST = 1e150  # beyond it squares overflow: such a set counts as one that has diverged
_FEWEST = 2  # samples of a record
_MOST_OF_SPAN = 0.8
_ROUGH, _CLOSE = 1e-4, 1e-8  # of the range: of differences over 1e-6 of the box only the second leaves slopes
_PERFECT = 1e-10  # of half the range: smaller residuals are those of a perfect fit
_EPSILONS = 16.0  # of the largest output: a sum of some products is rounded by less
_DIFFERENCE = 1e-6  # step of a central difference in units of the box: truncation and rounding both ~1e-10


Initial = str | Sequence[str] | None
Weights = Sequence[FloatArray] | None
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Part:
    """One record, and where the family's own coordinates and linear parameters stand among those of all records."""

    record: Record
    coordinates: npt.NDArray[np.intp]  # -1 for a coordinate of the state that this record does not have
    linear: npt.NDArray[np.intp]
    before: Record | None  # what ran ahead of the first sample, where the state is what it leaves behind
    names: Mapping[str, str]  # the family's names of the state to those of the problem
    weights: FloatArray | None = None  # (n_samples,), those of all records with a mean of one; None for equal ones


@dataclass(frozen=True)
class Problem:
    """Least-squares problem of one family; `space` is that of all records, `own` the family's for one."""

    family: Any
    space: SearchSpace
    own: SearchSpace
    parts: tuple[Part, ...]
    budget: Budget | None = None
    simpler: "Problem | None" = None  # whose optimum starts the search
    enlarged: Callable[[Mapping[str, float]], dict[str, float]] = dict  # its parameters to those of this family
    stage: Stage | None = None  # what this problem frees, and the simpler one does not
    ends: FloatArray | None = None  # (n_sets, n_x), where searches have ended: they are only polished
    settled: Settled | None = None  # rows that may stand for samples, if they are known
    below: Settled | None = None  # rows that do stand for samples, which the parts do not have any more
    accuracy: float = 0.0  # of the outputs, in units of their size, where the law stands for another

    @property
    def n_x(self) -> int:
        """Number of coordinates; theta (n_theta,) is the coordinates x, then the linear parameters b."""
        return len(self.space.coordinates)

    @cached_property
    def y(self) -> FloatArray:
        below = [] if self.below is None else [self.below.target]
        return np.concatenate([*(part.record.y for part in self.parts), *below])

    @cached_property
    def weights(self) -> FloatArray:
        """Weight of each sample in the sum of squares (n_samples,), zero for one that is left out."""
        below = [] if self.below is None else [np.ones(self.below.target.size)]
        own = [np.ones(len(part.record)) if part.weights is None else part.weights for part in self.parts]
        return np.concatenate([*own, *below])

    @property
    def n_samples(self) -> int:
        """Number of samples that are not left out."""
        return int(np.count_nonzero(self.weights))

    @cached_property
    def scale(self) -> float:
        """Size of the outputs [unit of y]."""
        if self.below is not None:
            return self.below.scale
        return float(np.abs(self.y).max()) or 1.0

    @property
    def rounding(self) -> float:
        """Size of residuals that are those of a perfect fit [unit of y], whatever the offset of the outputs."""
        return max(_PERFECT * 0.5 * float(np.ptp(self.y)), _EPSILONS * np.finfo(float).eps * self.scale)

    @cached_property
    def cuts(self) -> list[int]:
        """First sample of each record, and the number of samples."""
        return [0, *np.cumsum([len(part.record) for part in self.parts]).tolist()]

    @property
    def pieces(self) -> list[tuple[Record, slice]]:
        """Each record, and its samples among those of all."""
        return [(part.record, slice(a, b)) for part, a, b in zip(self.parts, self.cuts, self.cuts[1:], strict=False)]

    def criterion(self, cost: float) -> float:
        """Bayesian information criterion of a sum of squares."""
        return information(cost / self.n_samples, self.n_samples, len(self.space.names))

    def work(self, values: FloatArray) -> FloatArray:
        """Integral over the input from the first sample of each record, of values (n_samples, n) in its output."""
        from scipy.integrate import cumulative_trapezoid

        works = [cumulative_trapezoid(values[own], record.u, axis=0, initial=0.0) for record, own in self.pieces]
        return np.concatenate(works)

    def thinned(self, samples: int) -> "Problem | None":
        """This problem on about so many samples of each record: all reversals, and others evenly between them.

        It is None where that saves less than half, or where the family depends on time. A rate-independent law passes
        through the same memories at the samples that remain, except for reversals of less than 1 % of the span.
        """
        return self._shortened(lambda part: _at(part, few_places(part.record, samples)))

    def beginning(self, samples: int) -> "Problem | None":
        """This problem on so many first samples of each record, or up to where the input has had most of its span.

        It is None as of `thinned`, which saves nothing where a record turns at most of its samples.
        """
        return self._shortened(lambda part: _beginning(part, samples))

    def at(self, samples: npt.NDArray[np.intp]) -> "Problem":
        """This problem on some samples, by their places in all records."""
        cuts = zip(self.cuts, self.cuts[1:], strict=False)
        chosen = [samples[(samples >= first) & (samples < end)] - first for first, end in cuts]
        parts = tuple(_at(part, own) for part, own in zip(self.parts, chosen, strict=True))
        return replace(self, parts=parts, simpler=None, settled=None)

    def _shortened(self, shortened: Callable[[Part], Part]) -> "Problem | None":
        parts = tuple(shortened(part) for part in self.parts)
        short = replace(self, parts=parts, simpler=self.simpler and self.simpler._shortened(shortened), settled=None)
        if 2 * sum(len(part.record) for part in parts) > self.y.size:
            return None
        try:
            short.split(0.5 * (self.space.lower + self.space.upper)[np.newaxis])
        except ValueError:  # the records have no time any more
            return None
        return short

    def with_settled(self, known: Settled | None = None) -> "Problem":
        """This problem with the rows that may stand for samples: the `known` ones of a problem of the same columns."""
        if known is not None and known.names == self.space.linear:
            return replace(self, settled=known)
        records = [part.record for part in self.parts]
        first = tuple(max(_FEWEST, self.family.forgotten(record, self.own)) for record in records)
        if sum(len(record) - k for record, k in zip(records, first, strict=True)) < 2 * (len(self.space.linear) + 1):
            return self
        columns, fixed_part = self.split(0.5 * (self.space.lower + self.space.upper)[np.newaxis])
        is_later = np.concatenate([np.arange(len(record)) >= k for record, k in zip(records, first, strict=True)])
        root = np.sqrt(self.weights[is_later])
        target = root * (self.y - fixed_part)[:, is_later]
        rows, short = triangle(root[:, np.newaxis] * columns[:, is_later], target)
        return replace(self, settled=Settled(first, self.space.linear, rows[0], short[0], self.scale))

    def condensed(self) -> "Problem":
        """This problem with the same sums of squares on fewer rows, where no coordinate has an effect on many samples.

        It has no record to look at any more: it is for searches alone.
        """
        settled = self.with_settled().settled if self.settled is None and self.below is None else self.settled
        if settled is None:
            return self
        parts = (
            replace(part, record=part.record[:k], weights=None if part.weights is None else part.weights[:k])
            for part, k in zip(self.parts, settled.first, strict=True)
        )
        return replace(self, parts=tuple(parts), settled=None, below=settled)

    def within(self, budget: Budget | None) -> "Problem":
        """This problem with a budget, which it shares with the simpler one."""
        return replace(self, budget=budget, simpler=self.simpler and self.simpler.within(budget))

    def weighted(self, weights: Weights) -> "Problem":
        """This problem with a weight for each sample of each record."""
        if weights is None:
            return self
        every = np.concatenate(weights)
        scale = np.count_nonzero(every) / float(every.sum())
        parts = (replace(part, weights=scale * own) for part, own in zip(self.parts, weights, strict=True))
        return replace(self, parts=tuple(parts), simpler=self.simpler and self.simpler.weighted(weights))

    def begun(self, x: FloatArray) -> FloatArray:
        """Coordinates (n_sets, n_x) of models with the outputs of the `simpler` problem's at its `x`; may be empty.

        Those outside the box are brought to its side.
        """
        encoded = self.own.encoded
        if self.simpler is None or encoded is None:
            return np.empty((0, self.n_x))
        begun = np.clip(np.zeros((len(x), self.n_x)), self.space.lower, self.space.upper)
        for start, theta in zip(begun, self.simpler.completed(x), strict=True):
            for k, part in enumerate(self.parts):
                present = part.coordinates >= 0
                values = encoded(self.enlarged(self.simpler.estimates(theta, k)))
                start[part.coordinates[present]] = values[present]
        return np.asarray(np.clip(begun, self.space.lower, self.space.upper))

    def rough(self) -> "Problem":
        """This problem with nearly the same outputs, cheaper to compute, which rank points."""
        family = self.family.known_to(_ROUGH)
        return self if family is self.family else replace(self, family=family)

    def close(self) -> "Problem":
        """This problem with the same outputs to what a search can tell, cheaper to compute."""
        family = self.family.known_to(_CLOSE)
        return self if family is self.family else replace(self, family=family, accuracy=_CLOSE)

    def completed(self, x: FloatArray) -> FloatArray:
        """Theta (n_sets, n_theta): the coordinates `x` and the best linear parameters."""
        linear = [self._solve(x[part])[0] for part in self.chunks(len(x))]
        return np.concatenate([x, np.concatenate(linear)], axis=1)

    def costs(self, x: FloatArray) -> FloatArray:
        """Sums of squares (n_sets,); those beyond the budget are infinite."""
        n_sets = len(x) if self.budget is None else self.budget.sets(len(x), self.y.size)
        known = [np.sum(self._solve(x[:n_sets][part])[1] ** 2, axis=1) for part in self.chunks(n_sets)]
        return np.concatenate([*known, np.full(len(x) - n_sets, np.inf)])

    def chunks(self, n_sets: int) -> list[slice]:
        """Sets that are evaluated at once."""
        size = max(1, _CHUNK * len(self.parts) // self.y.size)  # many sets are the same for a record
        return [slice(k, k + size) for k in range(0, n_sets, size)]

    def _solve(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns, fixed_part = self.split(x)
        return self.regression(columns, self.y - fixed_part)

    def regression(self, columns: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Linear parameters (n_sets, n_linear) and residuals (n_sets, n_samples), inf for a set that diverges.

        Residuals are multiplied by the roots of the weights.
        """
        broken = ~((np.abs(columns) < _LARGEST).all(axis=(1, 2)) & (np.abs(target) < _LARGEST).all(axis=1))
        columns[broken], target[broken] = 0.0, 0.0
        if any(part.weights is not None for part in self.parts):
            root = np.sqrt(self.weights)
            columns, target = columns * root[:, np.newaxis], target * root
        linear = self._regress(columns, target)
        residual = target - (columns @ linear[..., np.newaxis])[..., 0]
        residual[broken] = np.inf
        return linear, residual

    def model(self, theta: FloatArray) -> FloatArray:
        outputs = np.empty((len(theta), self.y.size))
        for sets in self.chunks(len(theta)):
            columns, fixed_part = self.split(theta[sets, : self.n_x])
            with np.errstate(over="ignore", invalid="ignore"):
                outputs[sets] = fixed_part + (columns @ theta[sets, self.n_x :, np.newaxis])[..., 0]
        return outputs

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns (n_sets, n_samples, n_linear) of the free linear parameters, and the output without them."""
        if self.budget is not None:
            self.budget.spent += float(len(x)) * self.y.size
        n_linear = len(self.space.linear)
        columns = np.zeros((len(x), self.y.size, n_linear))
        fixed_part = np.zeros((len(x), self.y.size))
        if self.below is not None:
            columns[:, self.cuts[-1] :] = self.below.columns
        for k, part in enumerate(self.parts):
            samples = slice(self.cuts[k], self.cuts[k + 1])
            different, places_of = self._different(x, part)
            parameters = self.parameters(x[different], k)
            missing = [~np.isfinite(parameters[name]) for name in self.own.state if part.before]
            parameters |= {name: np.nan_to_num(parameters[name]) for name in self.own.state if part.before}
            with np.errstate(over="ignore", invalid="ignore"):
                regressors = self.family.regressors(parameters, part.record)
                if regressors.shape[-1] != len(self.own.columns) + 1:
                    raise ValueError("this model has other parameters for each record: identify it on one at a time")
                rest = regressors[..., -1]
                for place, name in enumerate(self.own.columns):
                    if name in self.own.held:
                        steady = part.before is not None and name in self.own.state
                        value = parameters[name][:, np.newaxis] if steady else self.own.held[name]
                        rest = rest + value * regressors[..., place]
            for diverged in missing:  # there is no steady cycle
                rest[diverged] = np.inf
            fixed_part[:, samples] = rest[places_of]
            places = [place for place, name in enumerate(self.own.columns) if name in self.own.linear]
            for place, column in zip(places, part.linear.tolist(), strict=True):
                if column >= 0:
                    columns[:, samples, column] = regressors[..., place][places_of]
        return columns, fixed_part

    def _different(self, x: FloatArray, part: Part) -> tuple[Any, Any]:
        """Sets that differ for a record, and the place of each set among them."""
        own = part.coordinates[part.coordinates >= 0]
        if own.size == self.n_x:
            return slice(None), slice(None)
        _, first, places = np.unique(x[:, own], axis=0, return_index=True, return_inverse=True)
        return first, places.ravel()

    def parameters(self, x: FloatArray, k: int = 0) -> dict[str, FloatArray]:
        """The family's parameters, (n_sets,) each, for the record `k`; those that are linear are left out."""
        part = self.parts[k]
        parameters = self._decoded(x, part)
        steady = self.family.steady(parameters, part.before) if part.before and self.own.state else {}
        return {**parameters, **steady}

    def _decoded(self, x: FloatArray, part: Part) -> dict[str, FloatArray]:
        present = part.coordinates >= 0
        if present.all():
            return self.own.parameters(x[:, part.coordinates])
        own = np.where(present, x[:, part.coordinates], self.own.lower)
        resting = {self.own.coordinates[place]: np.zeros(len(x)) for place in np.flatnonzero(~present)}
        return self.own.parameters(own) | resting

    def named(self, theta: FloatArray) -> FloatArray:
        """The user's free parameters, (n_sets, n_names), in the order of `space.names`."""
        x = theta[:, : self.n_x]
        known = dict(zip(self.space.linear, theta[:, self.n_x :].T, strict=True))
        for part in self.parts:
            known |= {part.names.get(name, name): values for name, values in self._decoded(x, part).items()}
        return np.stack([np.broadcast_to(known[name], len(x)) for name in self.space.names], axis=1)

    def estimates(self, theta: FloatArray, k: int = 0) -> dict[str, float]:
        """Every parameter of the family by name at one point, as the record `k` has it."""
        x, linear = np.split(theta, [self.n_x])
        searched = {name: float(np.ravel(values)[0]) for name, values in self.parameters(x[np.newaxis], k).items()}
        columns = self.parts[k].linear.tolist()
        regressed = [float(linear[column]) if column >= 0 else 0.0 for column in columns]
        state = {name: searched[name] for name in self.own.state if name in searched}
        return searched | dict(self.own.held) | dict(zip(self.own.linear, regressed, strict=True)) | state

    def beside(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (n_sets, n_x, n_x) a small step from each `x` along each coordinate, inside the box, and the steps."""
        ahead, behind, _ = self.neighbours(x)
        ends = np.where((x == self.space.upper)[..., np.newaxis], behind, ahead)
        return ends, np.einsum("sii->si", ends - x[:, np.newaxis])

    def neighbours(self, x: FloatArray, share: float = 1.0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points a small step above and below each `x` (n_sets, n_x) along each coordinate, and their distance.

        `share` is the part of the step by which a difference is usually taken.
        """
        step = np.diag(share * _DIFFERENCE * (self.space.upper - self.space.lower))
        ahead = np.minimum(x[:, np.newaxis] + step, self.space.upper)
        behind = np.maximum(x[:, np.newaxis] - step, self.space.lower)
        return ahead, behind, np.einsum("sii->si", ahead - behind)

    def _regress(self, columns: FloatArray, target: FloatArray) -> FloatArray:
        norms = np.linalg.norm(columns, axis=1)
        norms[norms == 0.0] = 1.0
        normalised = columns / norms[:, np.newaxis, :]
        if self.space.bounds:
            return self._bounded(normalised, target, norms)
        return np.asarray(least_squares(normalised, target) / norms)

    def _bounded(self, columns: FloatArray, target: FloatArray, norms: FloatArray) -> FloatArray:
        """Solutions within the bounds: the free ones where they are, for they are best; else by active bounds."""
        from scipy.optimize import lsq_linear

        lower, upper = self.linear_box()
        rows, goals = triangle(columns, target)
        solutions = np.asarray(least_squares(rows, goals) / norms)
        outside = np.flatnonzero(((solutions < lower) | (solutions > upper)).any(axis=1))
        for k in outside:
            size = float(np.linalg.norm(goals[k])) or 1.0  # the tolerance of the solver is an absolute one
            unit = norms[k] / size
            box = lower * unit, upper * unit
            solutions[k] = lsq_linear(rows[k], goals[k] / size, bounds=box, method="bvls").x / unit
        return solutions

    def linear_box(self) -> tuple[FloatArray, FloatArray]:
        limits = [self.space.bounds.get(name, (-np.inf, np.inf)) for name in self.space.linear]
        lower, upper = np.array(limits).reshape(-1, 2).T
        return lower, upper


def samples_of_sensor(record: Any) -> int:
    """Samples of each sensor of a record, which follow those of the one before."""
    return record.input.size if isinstance(record, SensorRecord) else len(record)


def _beginning(part: Part, samples: int) -> Part:
    u = part.record.u
    spans = np.maximum.accumulate(u) - np.minimum.accumulate(u)
    enough = 1 + int(np.argmax(spans >= _MOST_OF_SPAN * spans[-1]))
    return _at(part, np.arange(min(u.size, max(samples, enough))))


def _at(part: Part, chosen: npt.NDArray[np.intp]) -> Part:
    """The chosen samples, without the times."""
    record = part.record
    shared: dict[str, Any] = {"units": record.units, "resolution": record.resolution}
    short = Record(u=record.u[chosen], y=record.y[chosen], channels=taken(record.channels, chosen), **shared)
    return replace(part, record=short, weights=None if part.weights is None else part.weights[chosen])


def problem(family: Any, records: Sequence[Record], freedom: Freedom, initial: Initial) -> Problem:
    """Put the records of one family together; a ValueError says why `initial` or `freedom` does not fit.

    The memory of a law that stands somewhere is that at the first sample of each record.
    """
    family = searched(placed(family, None))
    alone = _alone(family, records, freedom, initial)
    simple = family.simpler()
    if simple is None or alone.own.encoded is None:
        return alone
    simpler = problem(simple.family, records, simple.reduced(freedom), initial)
    return replace(alone, simpler=simpler, enlarged=simple.enlarged)


def problems(family: Any, records: Sequence[Record], freedom: Freedom, initial: Initial) -> list[Problem]:
    """The problems of a search in stages, the simplest first, among which a criterion may choose; else one problem."""
    family = searched(family)
    stages = [each for each in family.freed_in_turn() if each.is_open(freedom)]
    if not stages:
        return [problem(family, records, freedom, initial)]
    simplest = problem(family, records, _at_stage(stages, 0, freedom, family.scalars), initial)
    chain, first = [replace(simplest, stage=None if simplest.simpler is None else BASE)], 0
    for k, stage in enumerate(stages, 1):
        larger = _alone(family, records, _at_stage(stages, k, freedom, family.scalars), initial)
        chain.append(replace(larger, simpler=chain[-1], stage=stage))
        first = k if stage.is_asked_for(freedom, family.scalars) else first
    return chain[first:]


@dataclass(frozen=True)
class Setting:
    """Records, and the choices of the user for a search on them; `budget` is that of the problems made here."""

    records: Sequence[Record]
    freedom: Freedom
    initial: Initial = None
    weights: Weights = None
    max_evaluations: float | None = None
    seed: int = 0
    budget: Budget | None = None

    def problem(self, family: Any) -> Problem:
        attempt = problem(family, self.records, self.freedom, self.initial)
        return attempt.weighted(self.weights).within(self.budget)

    def problems(self, family: Any) -> list[Problem]:
        every = problems(family, self.records, self.freedom, self.initial)
        return [each.weighted(self.weights) for each in every]

    def allowing(self, evaluations: float | None) -> "Setting":
        """With a budget of so many parameter sets on the whole records."""
        budget = None if evaluations is None else Budget(evaluations * sum(map(len, self.records)))
        return replace(self, budget=budget)

    def only(self, places: Sequence[int]) -> "Setting":
        """On some of the records; weights that leave all samples of these out are dropped."""
        initial, weights = self.initial, self.weights and [self.weights[k] for k in places]
        if initial is not None and not isinstance(initial, str):
            initial = [initial[k] for k in places] if len(places) > 1 else initial[places[0]]
        if weights is not None and not any(each.any() for each in weights):
            weights = None
        return replace(self, records=[self.records[k] for k in places], initial=initial, weights=weights)

    def about(self, names: Container[str]) -> "Setting":
        """With the part of the user's freedom that is about these parameters."""
        fixed = {name: value for name, value in self.freedom.fixed.items() if name in names}
        free = tuple(name for name in self.freedom.free if name in names)
        bounds = {name: pair for name, pair in self.freedom.bounds.items() if name in names}
        return replace(self, freedom=replace(self.freedom, fixed=fixed, free=free, bounds=bounds))

    def beside(self, values: Mapping[str, float]) -> "Setting":
        """With further parameters that are fixed, unless the user has fixed them."""
        known = {name: value for name, value in values.items() if name not in self.freedom.fixed}
        others = self.about({*self.freedom.free, *self.freedom.bounds} - known.keys()).freedom
        return replace(self, freedom=replace(others, fixed={**self.freedom.fixed, **known}))


def _at_stage(stages: Sequence[Stage], k: int, freedom: Freedom, values: Mapping[str, float]) -> Freedom:
    for stage in stages[:k]:
        freedom = stage.opened(freedom, values)
    for stage in stages[k:]:
        freedom = stage.closed(freedom, values)
    return freedom


def _alone(family: Identifiable, records: Sequence[Record], freedom: Freedom, initial: Initial) -> Problem:
    kinds = _kinds(initial, len(records))
    shared = None if kinds[0] is None else "free" if "free" in kinds else "rest"
    widest = max(records, key=lambda record: (float(np.ptp(record.u)), len(record)))  # it scales the box
    own = family.search_space(widest, replace(freedom, initial=shared))
    told = {name: freedom.bounds.get(name, freedom.bounds.get(name.partition("(")[0])) for name in own.names}
    user_sides = {name: (bool(np.isfinite(pair[0])), bool(np.isfinite(pair[1]))) for name, pair in told.items() if pair}
    own = replace(own, by_user=user_sides)
    if len(records) == 1:
        every = np.arange(len(own.coordinates)), np.arange(len(own.linear))
        return Problem(family, own, own, (Part(records[0], *every, _before(records[0], kinds[0]), {}),))
    return _together(family, own, records, kinds)


def _before(record: Record, kind: str | None) -> Record | None:
    """The record before the first sample: the cycle that the record repeats, by default all of it, or no motion."""
    if kind == "still":
        return replace(record[:2], u=np.repeat(record.u[:1], 2))
    return record[: repeated_cycle(record.u)] if kind == "periodic" else None


def _kinds(initial: Initial, n: int) -> list[str | None]:
    kinds: list[Any] = list(initial) if isinstance(initial, (list, tuple)) else [initial] * n
    if len(kinds) != n:
        raise ValueError(f"initial must be one word, or one for each of the {n} records, got {initial!r}")
    for kind in kinds:
        if kind not in (STATES if initial is not None else (None,)):
            raise ValueError(f"initial must be {STATES_IN_WORDS}, got {kind!r}{meant(kind, STATES)}")
    return kinds


def _together(
    family: Identifiable, own: SearchSpace, records: Sequence[Record], kinds: Sequence[str | None]
) -> Problem:
    states = [name for name in own.state if name not in own.held]
    if foreign := [name for name in states if name not in (*own.coordinates, *own.linear)]:
        raise ValueError(f'{foreign[0]} is not free record by record: use initial="rest" or "periodic"')
    with_own = [k for k, kind in enumerate(kinds) if kind in (None, "free")] if states else []
    places = [[k for k, name in enumerate(own.coordinates) if (name in states) is state] for state in (False, True)]
    order = [(place, None) for place in places[0]] + [(place, k) for k in with_own for place in places[1]]
    linear: list[tuple[str, int | None]] = [(name, None) for name in own.linear if name not in states]
    linear += [(name, k) for k in with_own for name in own.linear if name in states]

    searched = [(own.coordinates[place], k) for place, k in order]
    parts = tuple(
        Part(
            record=record,
            coordinates=np.array([_place(order, k, place) for place in range(len(own.coordinates))], dtype=np.intp),
            linear=np.array([_place(linear, k, name) for name in own.linear], dtype=np.intp),
            before=_before(record, kinds[k]),
            names={name: f"{name}[{k}]" for name in states} if k in with_own else {},
        )
        for k, record in enumerate(records)
    )
    free_states = tuple(f"{name}[{k}]" for k in with_own for name in states)
    space = own.at(
        [place for place, _ in order],
        coordinates=tuple(_called(name, k) for name, k in searched),
        names=(*(name for name in own.names if name not in states), *free_states),
        linear=tuple(_called(name, k) for name, k in linear),
        bounds={_called(name, k): own.bounds[name] for name, k in linear if name in own.bounds},
        physical={_called(name, k): own.physical[name] for name, k in searched if name in own.physical},
        by_user={_called(name, k): own.by_user[name] for name, k in (*searched, *linear) if name in own.by_user},
        state=free_states,
    )
    return Problem(family, space, own, parts)


def _called(name: str, k: int | None) -> str:
    return name if k is None else f"{name}[{k}]"


def _place(order: Sequence[tuple[Any, int | None]], k: int, key: Any) -> int:
    return next((place for place, (other, owner) in enumerate(order) if other == key and owner in (None, k)), -1)
