"""Starting points of searches that are too wide for one pass: plants of several parts, parameters of a channel.

**A plant of several parts** is searched part by part, and where that ends all parts are searched at once.

1. The law alone, on the record of the slowest input: a global search.
2. On the fastest record, behind that law but for its gain and offset, one mode after the other: the best of many
   points descend. A mode is kept if it lowers the BIC by more than 10.
3. On all records the parts descend beside the law's shape.
4. All at once. What the records do not determine there, by the Fisher information, is held in a new search.

Where the law alone leaves more than a hundredth of the span, its record is not slow, and the law may be wrong. The
search then begins a second time with the modes, behind the input itself, beside which many laws are tried. From
each end it goes on beyond whole samples of delay, and the end of the lower BIC stands.

Of several inputs no record shows a law alone: modes are searched behind the inputs themselves, with gains that are
solved for, and then all at once. Where the user knows an actuator like it, the search begins with its modes.

**Parameters that depend on channels** begin where short searches of the law itself end. The law without a dependence,
on all records, and the law on the records of each value of the channels, one after the other; polynomials of least
squares through the parameters that these have are the second start.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.channels import steady
from hysim.errors import SimulationError
from hysim.identification._assumptions import decided, decides
from hysim.identification._problem import Numbers, Problem, Setting
from hysim.identification._search import apart, brief_optimum, chosen, descended, spread
from hysim.identification._uncertainty import uncertainty
from hysim.models.dependent_structure import DependentStructure
from hysim.models.parts import share_of
from hysim.models.protocols import Identifiable
from hysim.models.search_space import Freedom
from hysim.models.varying import weights
from hysim.records import Record

_THINNED = 500  # samples of the slow record, beside its reversals
_SAME = 0.01  # distance of two points in units of the box, under which the better one stands for both
_APART = 0.03  # likewise of the first points on the fastest record
_BEST, _KEPT = 8, 2  # points that descend on the fastest record, and on all
_STRONG = 10.0  # difference of two BIC: that of `_assumptions`
_ENOUGH = 0.01  # error of the law alone beside the resolution, in spans of the output: with a larger one it moves
_SPREAD_LAWS = 1024  # laws beside parts that were searched without one
_APART_LAWS = 0.05  # likewise
_BEST_OF_ALL = 4  # points that descend where the law is searched too
_MOST_ROUNDS = 8  # of what is held
_IN_VAIN = 2  # trials in a row that are no better
_SHARE = 0.5  # of the evaluations that the user allows


class _End(NamedTuple):
    """A plant, its problem on all records, and the best coordinates (1, n_x) of one search."""

    plant: Any
    problem: Problem
    ends: FloatArray


def begun_by_parts(structure: Any, setting: Setting) -> tuple[Any, Sequence[Record], FloatArray, bool]:
    """The structure where the search part by part ends, with what it holds; ValueError as of `identify`.

    Also the records as its search takes them, coordinates (n_sets, n_x) where it begins, and whether the user's number
    of evaluations has ended a part of the search.
    """
    plant, records = structure.over(setting.records, setting.freedom)
    most = setting.max_evaluations
    setting = replace(setting, records=records).allowing(None if most is None else _SHARE * most)
    trial = setting.problem(plant)  # refuses what does not fit before anything is searched
    trial.split(0.5 * (trial.space.lower + trial.space.upper)[np.newaxis])
    if (begins := plant.begins()) is not None:
        end = _all_at_once(plant, [begins], setting)
    elif len(plant.inputs) > 1:
        end = _all_at_once(*_behind_inputs(plant, None, setting), setting)
    else:
        end = _searched(plant, setting)
    plant, ends = end.plant, end.ends
    if end.problem.n_x:
        plant, ends = _told_apart(plant, setting, end.problem, _descended(end.problem, ends, exact=True))
    return plant, records, ends, setting.budget is not None and setting.budget.cut


def _searched(plant: Any, setting: Setting) -> _End:
    """The best end of a search from the law on, and where its record moves, of one from the modes on."""
    plant, law, shape, is_enough = _with_law(plant, setting)
    grown, known = _behind_inputs(plant, law, setting)
    first = _all_at_once(grown, _on_all(grown, setting, shape, known), setting)
    if is_enough:
        return first
    grown, known = _behind_inputs(plant, None, setting)
    second = _all_at_once(grown, known, setting, spread_laws=True)
    return min(map(_gone_on, (first, second)), key=lambda end: _criterion(end.problem, end.ends))


def _gone_on(end: _End) -> _End:
    points = end.plant.beyond(end.problem.space, end.ends)
    return end._replace(ends=_descended(end.problem, points, exact=False)[:1]) if len(points) > 1 else end


def _with_law(plant: Any, setting: Setting) -> tuple[Any, Any, Numbers, bool]:
    """The plant whose law begins where the law alone is best, that law, its shape, and whether it is enough."""
    k, law, freedom = plant.survey.law, plant.law, setting.freedom
    record = plant.static(setting.records[k])
    share = replace(share_of(freedom, "hysteresis"), starts_anew=False)
    alone = replace(setting.only([k]), records=[record], freedom=share, max_evaluations=None)
    is_open = decides(law, [record])
    if alone.initial is None and is_open:
        alone = replace(alone, initial="rest")
    every = decided(law, alone).problems
    best, optima = chosen([each.thinned(_THINNED) or each for each in every], seed=setting.seed)
    if not optima:
        raise ValueError("every set of parameters of the law diverged on the slowest record: pass bounds=")
    estimates = best.estimates(best.completed(optima[0].x[np.newaxis])[0])
    model = best.family.assemble(estimates)
    start = model if isinstance(model, Identifiable) and not is_open else best.family
    space = best.own
    searched = [name for name in space.names if name not in (*space.linear, *space.state)]
    shape = {f"hysteresis.{name}": estimates[name] for name in searched}
    error = math.sqrt(optima[0].cost / best.n_samples)
    is_enough = error <= _ENOUGH * float(np.ptp(record.y)) + (record.resolution or 0.0)
    return replace(plant, law=start), model, shape, is_enough


def _behind_inputs(plant: Any, law: Any, setting: Setting) -> tuple[Any, list[Numbers]]:
    """The plant and coordinates of its parts, after a known law, or directly after several inputs."""
    plant, known = _grown(plant, law, setting)
    return _tried(plant, setting), known


def _all_at_once(plant: Any, known: Sequence[Numbers], setting: Setting, spread_laws: bool = False) -> _End:
    """End of a search for all parts from these coordinates, and if asked from laws all over their box."""
    problem = setting.problem(plant.begun(known))
    if not problem.n_x:
        return _End(plant, problem, np.empty((1, 0)))
    starts = _best_starts(problem)
    if spread_laws:
        starts = np.concatenate([starts, _beside_laws(problem, starts[:1], setting.seed)])
    return _End(plant, problem, _descended(problem, starts, exact=False)[:1])


def _beside_laws(problem: Problem, begun: FloatArray, seed: int) -> FloatArray:
    """The best points of many laws, with the other coordinates of one point."""
    space = problem.space
    of_law = [k for k, name in enumerate(space.coordinates) if name.startswith("hysteresis.")]
    points = np.repeat(begun, _SPREAD_LAWS, axis=0)
    points[:, of_law] = spread(space, _SPREAD_LAWS, seed)[:, of_law]
    return apart(space, points, problem.costs(points), _APART_LAWS, _BEST)


def _grown(plant: Any, law: Any, setting: Setting) -> tuple[Any, list[Numbers]]:
    """The plant with the modes that the fastest record shows, and the best coordinates of its parts there."""
    known: list[Numbers] = []
    before = math.inf
    for each in plant.growing():
        known_law = each.behind(law)
        attempt = setting.only([plant.survey.fastest]).about(known_law.names).problem(known_law)
        ends = _found(attempt, each, known) if attempt.n_x else np.empty((1, 0))
        criterion = _criterion(attempt, ends)
        if not criterion < before - _STRONG and (smaller := _left_out(plant, each, setting.freedom)) is not None:
            return smaller, known
        known, before = _parts_only(attempt, ends), criterion
    return plant, known


def _criterion(attempt: Problem, ends: FloatArray) -> float:
    return attempt.criterion(max(float(attempt.costs(ends[:1])[0]), 1e-300))


def _found(attempt: Problem, plant: Any, known: Sequence[Numbers]) -> FloatArray:
    space = attempt.space
    points = plant.points(space, known)
    best = apart(space, points, attempt.costs(points), _APART, _BEST)
    points = plant.finer(space, best if len(best) else space.starts[:1])
    best = apart(space, points, attempt.costs(points), _SAME, _BEST)
    if not len(best):
        return space.starts[:1]
    ends = _descended(attempt, best, exact=False)
    return apart(space, ends, attempt.costs(ends), _SAME, _BEST_OF_ALL)


def _left_out(plant: Any, each: Any, freedom: Freedom) -> Any:
    """The plant without the modes that `each` has first; None where the user insists on one."""
    smaller = plant
    for _ in range(1 + plant.modes - each.modes):
        less = smaller.smaller(freedom)
        if less is None:
            return None
        smaller = less[0]
    return smaller


def _tried(plant: Any, setting: Setting) -> Any:
    """The best of the plant's trials, in whose order the sum of squares has one minimum."""
    best, least, worse = plant, math.inf, 0
    for trial in plant.trials():
        if len(plant.trials()) == 1 or worse == _IN_VAIN:
            break
        attempt = setting.problem(trial)
        ends = _descended(attempt, _best_starts(attempt)[:1], exact=False) if attempt.n_x else np.empty((1, 0))
        cost = float(attempt.costs(ends)[0])
        best, least, worse = (trial, cost, 0) if cost < least else (best, least, worse + 1)
    return best


def _on_all(plant: Any, setting: Setting, shape: Numbers, known: Sequence[Numbers]) -> list[Numbers]:
    """The best coordinates of the parts on all records, with the law's shape."""
    attempt = setting.beside(shape).problem(plant.begun(known))
    if not attempt.n_x:
        return []
    return _parts_only(attempt, _descended(attempt, _best_starts(attempt), exact=False)[:_KEPT])


def _told_apart(plant: Any, setting: Setting, problem: Problem, ends: FloatArray) -> tuple[Any, FloatArray]:
    """The plant without what the records do not determine, and where its search ends."""
    for _ in range(_MOST_ROUNDS):
        theta = problem.completed(ends[:1])[0]
        spread = _stderr(problem, theta)
        doubts = plant.doubts(problem.estimates(theta), setting.freedom)
        sizes = [np.nan_to_num(spread[each.name] / each.largest, nan=np.inf) for each in doubts if each.name in spread]
        if not sizes or max(sizes) <= 1.0:
            break
        known = _parts_only(problem, ends[:1])
        plant = _tried([doubt for doubt in doubts if doubt.name in spread][int(np.argmax(sizes))].without, setting)
        problem = setting.problem(plant.begun(known))
        if not problem.n_x:
            return plant, np.empty((1, 0))
        ends = _descended(problem, _best_starts(problem)[:1], exact=True)
    return plant, ends


def _stderr(problem: Problem, theta: FloatArray) -> dict[str, float]:
    residual = problem.y - problem.model(theta[np.newaxis])[0]
    variance = float(np.average(residual**2, weights=problem.weights)) or 1e-300
    covariance = uncertainty(problem, theta, np.full(residual.size, 1.0 / variance)).covariance
    return dict(zip(problem.space.names, np.sqrt(np.diag(covariance)).tolist(), strict=True))


def _best_starts(attempt: Problem) -> FloatArray:
    """The best of the starts of a problem, of few all in their order."""
    starts = attempt.space.starts
    return starts if len(starts) <= 1 else apart(attempt.space, starts, attempt.costs(starts), _SAME, _BEST_OF_ALL)


def _descended(attempt: Problem, points: FloatArray, *, exact: bool) -> FloatArray:
    """Ends (n_sets, n_x) of descents, the best first."""
    reached = descended(attempt, points, exact=exact)
    order = np.argsort(reached.loss, kind="stable")
    return np.asarray(reached.theta[order, : attempt.n_x])


def _parts_only(attempt: Problem, ends: FloatArray) -> list[Numbers]:
    names, plant = attempt.space.coordinates, attempt.family
    own = [(k, name) for k, name in enumerate(names) if not name.startswith("hysteresis.")]
    known: list[Numbers] = [{name: row[k] for k, name in own} for row in ends.tolist()]
    if len(plant.inputs) == 1:
        return known
    solved = [plant.solved(attempt.estimates(theta)) for theta in attempt.completed(ends)]
    return [{**each, **gains} for each, gains in zip(known, solved, strict=True)]


_MOST_GROUPS = 12


def begun(structure: DependentStructure, setting: Setting) -> DependentStructure:
    """The structure with starts where short searches of its law end; they take half of `max_evaluations` at most."""
    if all(name in structure.columns for name in structure.at):
        return structure
    records, most = setting.records, setting.max_evaluations
    groups = _groups(structure, records)
    share = None if most is None else most / (2.0 * (1 + len(groups)))

    def found(chosen: Sequence[int]) -> dict[str, float] | None:
        return _short_search(structure.law, replace(setting.only(chosen), weights=None).allowing(share))

    alike = found(range(len(records)))
    starts = [] if alike is None else [_alike(structure, alike)]
    if 1 < len(groups) <= _MOST_GROUPS:
        known = [each for numbers in groups.values() if (each := found(numbers)) is not None]
        first = [records[numbers[0]] for numbers in groups.values()]
        starts[:0] = [_through(structure, first, known)] if len(known) == len(groups) else []
    return replace(structure, starts=tuple(starts))


def _short_search(law: Any, setting: Setting) -> dict[str, float] | None:
    try:
        attempt = setting.problem(law)
        x, cost = brief_optimum(attempt)
    except (ValueError, ArithmeticError, SimulationError):  # such as too few samples for the law alone
        return None
    return attempt.estimates(attempt.completed(x[np.newaxis])[0]) if np.isfinite(cost) else None


def _groups(structure: DependentStructure, records: Sequence[Record]) -> dict[tuple[float, ...], list[int]]:
    """Numbers of the records by the values of their channels; empty if a channel varies along a record."""
    channels = sorted({channel for channel, _ in structure.depends.values()})
    groups: dict[tuple[float, ...], list[int]] = {}
    for k, record in enumerate(records):
        values = [steady(record.channels[channel]) for channel in channels]
        if any(np.ndim(value) for value in values):
            return {}
        groups.setdefault(tuple(values), []).append(k)
    return groups


def _through(structure: DependentStructure, records: Sequence[Record], known: Sequence[Numbers]) -> dict[str, float]:
    """Values of polynomials through the `known` parameters of the law on some records, and medians of the others."""
    start = {name: float(np.median([each[name] for each in known])) for name in known[0]}
    for name, at in structure.at.items():
        if name in start:
            channel = structure.depends[name][0]
            rows = weights(at, [steady(record.channels[channel]) for record in records])
            values = np.linalg.lstsq(rows, np.array([each[name] for each in known]), rcond=None)[0]
            start |= dict(zip(structure.names[name], values.tolist(), strict=True))
            del start[name]
    return start


def _alike(structure: DependentStructure, known: Mapping[str, float]) -> dict[str, float]:
    """The parameters of the law as a start at which nothing depends on a channel."""
    start = dict(known)
    for name, names in structure.names.items():
        if name in start:
            start |= dict.fromkeys(names, start.pop(name))
    return start
