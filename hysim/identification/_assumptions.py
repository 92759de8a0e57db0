"""Choices that a family leaves to the record: the state at the first sample, and others such as signs of weights.

Each combination is searched briefly, and has the criterion

    BIC = N ln(V) + d ln(N),        V = mean squared residual,

with d the free parameters that are not at a bound. First the state is chosen with the widest of the other choices,
which contains them all; then these. A choice replaces a simpler one if its BIC is lower by more than 10, "very strong"
evidence (R. E. Kass and A. E. Raftery, J. Am. Stat. Assoc. 90, 1995): residuals of a model that is not exact are
correlated, so that smaller differences are met by chance. A choice that contains another begins, beside its own starts,
where the search of the other ended, so that it never fits worse.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.input_noise import input_noise, quiet_path, reach, repeated_cycle
from hysim.errors import SimulationError
from hysim.identification._problem import Initial, Problem, Setting, problem
from hysim.identification._search import brief_optima, brief_optimum, optima
from hysim.laws.operators.reversal_filter import ReversalFilter
from hysim.metrics.criteria import information
from hysim.models.by_structure import searched
from hysim.models.dependent_structure import DependentStructure
from hysim.models.protocols import Variant
from hysim.models.search_space import SearchSpace
from hysim.records import Record, SensorRecord
from hysim.simulation import residual_of

# Difference of two BIC: "very strong" evidence. Discovery takes 2 to find the simplest of nearly equal laws; here a
# choice adds numbers to a model that is not exact, whose correlated residuals make smaller differences by chance.
_STRONG = 10.0
_IN_VAIN = 2  # longer pasts in a row that are no better: one number more may be of use only with another one
_WEIGHINGS = 4
_EVEN = 1.25  # largest noise of a sensor over the smallest, in the units of a search: weights cost < 3 % of precision
_AS_GOOD = 1.05  # times the error of the filtered law: differences below are met by chance on ten simulated records
_TURN = 0.1  # of the span: a half record without such a reversal shows no loop
_AT_BOUND = 1e-9  # of the largest linear parameter with a bound

_STATES = {
    "rest": "rest at zero before the first sample",
    "still": "an input that stood still at its first value before the record",
    "free": "a state at the first sample that is identified",
    "periodic": "a cycle of {} samples, which the input repeats, before the first sample",
}


class Decision(NamedTuple):
    """The problems to be searched, the simplest first if there are stages, and a sentence on the choice."""

    problems: Sequence[Problem]
    sentence: str = ""


class _State(NamedTuple):
    """A value of `initial`, and how many times the past of the family is made longer."""

    initial: Initial
    longer: int = 0


class _Trial(NamedTuple):
    problem: Problem
    state: _State
    variant: Variant
    ends: FloatArray  # (n_sets, n_x), the best first
    bic: float

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.space.coordinates


class Treated(NamedTuple):
    """Records as a search takes them, and what stands in front of the model for the noise of their inputs.

    `noises` are the standard deviations of the noise [unit of u], and `quiet` the records with inputs that are monotone
    between the reversals above it; both are empty where no noise was found, or is treated.
    """

    records: Sequence[Record]
    front: ReversalFilter | None = None
    noises: tuple[float, ...] = ()
    quiet: Sequence[Record] = ()


def treated(family: Any, setting: Setting, how: str) -> Treated:
    """How a search takes measured inputs: `how` is "raw", "filtered" or, where the record decides, "auto".

    A law is fitted behind a filter of reversals, and alone, on the first halves of the records. The bare law is taken
    where it predicts the second halves as well, both along the input as measured and along its quiet path: on the
    first alone a law whose parameters make up for false reversals may be as good.
    """
    records = setting.records
    is_plain = all(type(record) is Record for record in records)  # not of several sensors, nor weighted
    if how == "raw" or not is_plain or isinstance(family, DependentStructure):  # which no stage can stand in front of
        return Treated(records)
    # creep is read from what a law does not explain, to which few false reversals are much
    many = {"many": 1.0} if family.is_parted else {}
    noises = tuple(input_noise(record.u, **many) for record in records)
    if not any(noises):
        if how == "filtered":
            raise ValueError("no noise was found in the input, so that there is nothing to filter: leave out input=")
        return Treated(records)
    front = ReversalFilter(threshold=reach(max(noises)))
    filtered = [replace(record, u=front.response(record.u)) for record in records]
    pairs = zip(records, noises, strict=True)
    quiet = [replace(record, u=quiet_path(record.u, noise)) if noise else record for record, noise in pairs]
    behind = Treated(filtered, front, noises, quiet)
    if how == "filtered" or family.is_parted:
        return behind
    alone, in_front = (_left_out(family, setting, each, quiet) for each in (records, filtered))
    if alone <= _AS_GOOD**2 * in_front:
        return Treated(records, None, noises, quiet)
    return behind


def _left_out(family: Any, setting: Setting, paths: Sequence[Record], quiet: Sequence[Record]) -> float:
    """Sum of squares on the second halves of these paths and the quiet ones, by a fit to the first halves."""
    halves = [record[: len(record) // 2] for record in paths]
    if not all(half.reversals(_TURN).size for half in halves):
        halves = [*paths]
    total = 0.0
    try:
        attempt = problem(family, halves, setting.freedom, setting.initial)
        theta = attempt.completed(brief_optimum(attempt)[0][np.newaxis])[0]
        for k, half in enumerate(halves):
            model = attempt.family.assemble(attempt.estimates(theta, k))
            for record in (paths[k], quiet[k]):
                rest = residual_of([model], [record])[len(half) % len(record) :]
                total += float(rest @ rest)
    except (ValueError, ArithmeticError, SimulationError):
        return math.inf
    return total


def quiet_rmse(family: Any, setting: Setting, treatment: Treated) -> float:
    """Error of a short fit along the quiet paths, with what noise adds through the record's slope; else infinite."""
    if not treatment.noises or family.is_parted:
        return math.inf
    try:
        attempt = problem(family, treatment.quiet, setting.freedom, setting.initial)
        cost = brief_optimum(attempt)[1]
    except (ValueError, ArithmeticError, SimulationError):
        return math.inf
    slope = max(float(np.ptp(record.y)) / float(np.ptp(record.u)) for record in treatment.records)
    return math.hypot(math.sqrt(cost / attempt.n_samples), slope * max(treatment.noises))


def in_units_of_noise(problem: Problem, seed: int) -> Problem:
    """The problem with the outputs of several sensors in units of their noise, the residual of a search; else itself.

    Sensors are weighed anew until a search was made with weights that were nearly right; the search of the problem that
    is returned only polishes what this one has found.
    """
    measured = [part.record for part in problem.parts if isinstance(part.record, SensorRecord)]
    if not measured:
        return problem
    for _ in range(_WEIGHINGS):
        if not (reached := optima(problem, seed=seed)):
            break
        ends = np.array([each.x for each in reached])
        residual = problem.y - problem.model(problem.completed(ends[:1]))[0]
        own = list(zip(measured, np.split(residual, problem.cuts[1:-1]), strict=True))
        noise = np.concatenate([record.noise(rest) for record, rest in own])
        measured = [record.rescaled(rest) for record, rest in own]
        parts = (replace(part, record=record) for part, record in zip(problem.parts, measured, strict=True))
        problem = replace(problem, parts=tuple(parts), ends=ends)
        if noise.max() <= _EVEN * noise.min():
            break
    return problem


def decided(family: Any, setting: Setting) -> Decision:
    """The problems of a family in this setting; `initial` and `freedom` are the user's, and are kept."""
    choice = _decided(family, setting)
    budget = setting.allowing(setting.max_evaluations).budget
    return choice._replace(problems=[each.within(budget) for each in choice.problems])


def _decided(family: Any, setting: Setting) -> Decision:
    family = searched(family)
    if not decides(family, setting.records):
        return Decision(setting.problems(family))
    variants = family.variants() or (Variant(family, ""),)
    records, freedom, initial = setting.records, setting.freedom, setting.initial
    states, is_told = [_State(initial)], False
    if initial in (None, "free"):
        plain = problem(family, records, freedom, initial)
        is_told = bool({*freedom.fixed, *freedom.free, *freedom.bounds} & set(plain.own.state))
    if initial is None and not is_told:
        states = [_State(each) for each in _possible(family, records)] or states
    may_be_longer = _State("free") in states and len(records) == 1 and not is_told
    longest = _longer_pasts(variants[-1].family) if may_be_longer else 0
    if len(states) == len(variants) == 1 and not longest:
        return Decision(replace(setting, initial=states[0].initial).problems(variants[0].family))
    trials: dict[tuple[int, int], _Trial] = {}
    n_trials, brief = len(states) + longest + len(variants), None
    if setting.max_evaluations is not None:
        brief = setting.max_evaluations / (2 * n_trials)

    def trial(state: int, variant: int) -> _Trial:
        if (state, variant) not in trials:
            choice = _longer(variants[variant], states[state].longer)
            own = replace(setting, initial=states[state].initial).allowing(brief)
            attempt = own.problem(choice.family)
            trials[state, variant] = _tried(attempt, states[state], choice, [*trials.values()])
        return trials[state, variant]

    widest = len(variants) - 1
    for k in range(len(states)):
        trial(k, widest)
    free = [states.index(_State("free"))] if longest else []
    while 0 < len(free) <= longest:
        states.append(_State("free", len(free)))
        free.append(len(states) - 1)
        bics = [trial(k, widest).bic for k in free]
        if len(bics) > _IN_VAIN and min(bics[-_IN_VAIN:]) >= min(bics[:-_IN_VAIN]) - _STRONG:
            break
    state = _best(range(len(states)), lambda k: trial(k, widest).bic)
    for k in range(len(variants)):
        trial(state, k)
    chosen = _best([k for k, each in enumerate(variants) if each.offered], lambda k: trial(state, k).bic)
    if state in free and chosen != widest:  # fewer free weights may show what was not clear with all of them
        likely = [k for k in free if k > state and trial(k, widest).bic < trial(state, widest).bic]
        state = _best([state, *likely], lambda k: trial(k, chosen).bic)
    best = trial(state, chosen)
    others = [each for key, each in trials.items() if key != (state, chosen) and each.variant.offered]
    return Decision([_with_starts(best, trials.values())], _sentence(best, others, records))


def _longer_pasts(family: Any) -> int:
    """Number of times that the past of a family can be made longer."""
    longer = family.longer_past()
    return 0 if longer is None else 1 + _longer_pasts(longer)


def _longer(variant: Variant, times: int) -> Variant:
    for _ in range(times):
        variant = variant._replace(family=variant.family.longer_past())
    return variant


def decides(family: Any, records: Sequence[Record]) -> bool:
    """Whether a family leaves something to these records."""
    family = searched(family)
    return bool(family.variants() or family.longer_past() or any(family.assumed_states(each) for each in records))


def _possible(family: Any, records: Sequence[Record]) -> list[str]:
    named = [family.assumed_states(record) for record in records]
    return [
        state
        for state in dict.fromkeys(itertools.chain(*named))
        if not (state == "periodic" and any(repeated_cycle(record.u) is None for record in records))
        and not (state == "still" and all(record.u[0] == 0.0 for record in records))
    ]


def _tried(attempt: Problem, state: _State, variant: Variant, before: Sequence[_Trial]) -> _Trial:
    """A short search that begins at its own starts, and at the ends of the trials `before` that it contains."""
    known = next((each.problem.settled for each in before if each.problem.settled is not None), None)
    attempt = attempt.with_settled(known)
    space = attempt.space
    attempt = replace(attempt, space=replace(space, starts=_starts_beside(space, before)))
    try:
        ends, costs = brief_optima(attempt)
        bic = _bic(attempt, ends[0], float(costs[0]))
    except (ArithmeticError, SimulationError):
        ends, bic = np.empty((0, attempt.n_x)), math.inf
    return _Trial(attempt, state, variant, ends, bic)


def _starts_beside(space: SearchSpace, before: Sequence[_Trial]) -> FloatArray:
    """The starts of a space, and the end of a search with coordinates of the state alone, in their order."""
    starts, coordinates = [space.starts], space.coordinates
    for each in before:
        if each.names and {*each.names, *coordinates} <= {*space.state}:
            for places in itertools.combinations(range(len(coordinates)), len(each.names)):
                own = space.starts if len(places) < len(coordinates) else space.starts[:1]
                beside = np.repeat(own, len(each.ends), axis=0)
                beside[:, places] = np.tile(each.ends, (len(beside) // len(each.ends), 1))
                starts.append(beside)
    every = np.concatenate(starts)
    return every[np.sort(np.unique(every, axis=0, return_index=True)[1])]


def _bic(attempt: Problem, x: FloatArray, cost: float) -> float:
    n, d = attempt.n_samples, len(attempt.space.names)
    if not math.isfinite(cost) or n <= d:
        return math.inf
    if attempt.space.bounds:
        linear = attempt.condensed().completed(x[np.newaxis])[0, attempt.n_x :]
        near = np.min(np.abs(linear - attempt.linear_box()), axis=0)
        bounded = np.isfinite(near)
        d -= int(np.sum(near[bounded] <= _AT_BOUND * np.abs(linear[bounded]).max(initial=0.0)))
    return information(max(cost / n, attempt.rounding**2), n, d)


def _best(choices: Sequence[int], bic: Callable[[int], float]) -> int:
    best = choices[0]
    for k in choices[1:]:
        if bic(k) < bic(best) - _STRONG:
            best = k
    return best


def _with_starts(best: _Trial, trials: Iterable[_Trial]) -> Problem:
    """The problem of the best trial, whose search begins where the trials of the same coordinates ended."""
    space = best.problem.space
    ends = [best.ends, *(each.ends[:1] for each in trials if each is not best and each.names == best.names)]
    known = np.clip(np.concatenate(ends), space.lower, space.upper)
    if not known.size:
        return best.problem
    if set(best.names) <= set(space.state):  # for so few coordinates a short search is a whole one
        return replace(best.problem, ends=known)
    return replace(best.problem, space=replace(space, starts=np.concatenate([space.starts, known])))


def _sentence(best: _Trial, others: Sequence[_Trial], records: Sequence[Record]) -> str:
    """The assumptions in words, and by how much the next best other state and the next best other choice are worse."""
    states = [each.bic for each in others if each.state != best.state and each.state.longer <= best.state.longer]
    choices = [each.bic for each in others if each.state == best.state and each.variant.words != best.variant.words]
    words = []
    if states and isinstance(best.state.initial, str):
        cycles = ", ".join(f"{repeated_cycle(record.u)}" for record in records)
        numbers = f", by {len(best.problem.own.state)} numbers" if best.state.longer else ""
        words.append(_STATES[best.state.initial].format(cycles) + numbers + _by(min(states) - best.bic))
    if choices:
        words.append(best.variant.words + _by(min(choices) - best.bic))
    return f"assumed {' and '.join(words)}" if words else ""


def _by(gain: float) -> str:
    if math.isnan(gain):
        return ""
    if gain > _STRONG:
        return f" (else the BIC is {gain:.0f} higher)"
    return " (no other assumption has a clearly lower BIC)"
