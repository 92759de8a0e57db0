"""The global search: many starts descend together, and the best are polished.

The best points of a scrambled Sobol sequence that lie apart from each other, and the family's own starts, descend by
projected Levenberg-Marquardt steps in one batch. The best distinct optima descend to the end.

Searches that are asked for several times within one call of `identify`, `compare` or `select` are done `once`. The best
law of the admissible region is compared with the optimum, and often returned in its place. A family that contains a
simpler one begins its search with the optima of that one (`Problem.simpler`), which several families may contain, and
which is often compared itself. The first that needs a search does it; the others wait for what it finds.
"""

import hashlib
import itertools
import math
import threading
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import awaited
from hysim._basics.printing import listed
from hysim._basics.progress import Progress
from hysim.identification._descent import Descent, Reached
from hysim.identification._noise import Gaussian
from hysim.identification._problem import Problem
from hysim.models.search_space import SearchSpace
from hysim.models.stages import Stage

# Where "by hand" stands beside a number, it was chosen by hand, and no other reason is known.
N_SCREENED = 4096  # by hand; a power of 2, for which a Sobol sequence is balanced
N_DESCENDING = 64  # by hand
N_DESCENDING_BESIDE = 32  # half, where the optima of a simpler family are starts and a record that is not short is dear
N_STEPS = 40  # by hand: of a descent that only ranks, and is then polished
N_POLISHED = 8  # by hand
N_POLISHING = 200  # by hand: most polishes rest long before
N_POLISHING_ALONE = 1000  # by hand: of the best optimum in a narrow bent valley, where it is not at rest
N_NESTED = 3  # by hand: optima of a simpler family that are starts
N_STAGED = 6  # points of a stage that are polished: 2 of 3 seeds then find the best law of a steel coupon, none with 3
N_POLISHED_WHOLE = 3  # by hand: optima of a thinned record that descend on all samples, of which each is dear
N_BRIEF_SCREENED = 512  # by hand: an eighth of a full search
N_BRIEF_DESCENDING = 12  # by hand: about a fifth of a full search
N_BRIEF_WHOLE = 4  # by hand: steps on all samples
_LONG = 512  # by hand: samples beyond which fewer points are tried; each costs more, and there are fewer optima
_SHORT = 250  # by hand: samples of a thinned record beside its reversals; less than half of `_LONG`, so that it pays
_DEAR = 5000  # by hand: samples beyond which each step costs much
_MIDDLE = 2000  # by hand: samples of such a record on which the BIC chooses among stages
_FIRST = 1000  # by hand: samples of the beginning of a record that turns at most of its samples
_APART = 0.05  # by hand: distance of two starts in units of the box, under which the better one stands for both
_SAME = 0.01  # by hand: likewise of two points after the descent, which are nearer to their optimum
_GAIN = 1e-5  # by hand: share of the sum of squares; a descent that gains less rests, and ranks are known
_TOLERANCE = 2e-8  # likewise of a polish: far less than a likelihood can tell on records of some 1e5 samples
_HOPELESS = 3.0  # by hand: times the least sum of squares on a thinned record, beyond which an optimum is no rival
_ALIKE = 1e-6  # relative difference of two sums of squares that are the same
_BESIDE = 0.01  # by hand: part of the way to a side of the box, where a flat tail is flat, too
_EFFECT = 1e-7  # of the outputs' range: smaller changes are none
_WIDENINGS = 4  # by hand: of a box, each by a quarter of its width, in all to 2.4 times it
_ROUGH = 0.1  # by hand: share of the cost by which the rough law's may differ; beyond, it does not say what stays
_FAR_FROM_CLOSE = 100.0  # by hand: times the accuracy of a close law; a residual of this size is fitted as well by it
PERFECT = 1e-14  # smallest sigma, in units of the output's size: about the rounding of a sum of some products


class Optimum(NamedTuple):
    """Local optimum: coordinates (n_x,), sum of squares, and whether the polish converged.

    One that `is_simpler` is the optimum of the simpler problem, where a stage seems to have no use.
    """

    x: FloatArray
    cost: float
    converged: bool
    is_simpler: bool = False


Known = Sequence[Optimum] | None


def chosen(
    problems: Sequence[Problem], *, seed: int, progress: Progress | None = None
) -> tuple[Problem, list[Optimum]]:
    """The problem of the lowest Bayesian information criterion among several, each larger than the one before it.

    Also its optima, as `optima` returns them. Problems with more parameters than samples take no part. Of several the
    criterion chooses on fewer samples of a long record, and only the chosen one is searched on all of them.
    """
    if len(problems) > 1 and problems[0].y.size > _DEAR:
        fewer = [problem.thinned(_MIDDLE) for problem in problems]
        if None not in fewer:
            short, likely = chosen([each for each in fewer if each is not None], seed=seed, progress=progress)
            problem = next(p for p, few in zip(problems, fewer, strict=True) if few is short)
            ends = np.array([each.x for each in likely[:N_POLISHED_WHOLE]])
            return problem, _distinct(polish(problem, ends)) if likely else []
    best: tuple[float, Problem, list[Optimum]] = (math.inf, problems[0], [])
    known: Known = None
    for problem in problems:
        n_samples, n_names = problem.n_samples, len(problem.space.names)
        if n_names > n_samples and problem is not problems[0]:
            break
        may_end = problem is not problems[0]
        known = optima(problem, seed=seed, progress=progress, known=known, may_end=may_end)
        if known:
            cost = max(known[0].cost, n_samples * (PERFECT * problem.scale) ** 2)
            best = min(best, (problem.criterion(cost), problem, known), key=lambda each: each[0])
    return best[1:]


def widened(problem: Problem, optima: Sequence[Optimum]) -> tuple[Problem, list[Optimum]]:
    """The problem in a box that holds the best optimum, and the optima there.

    Where it stands at a side that is neither physical nor the user's, the box is widened and the optimum polished in
    it, a few times: a parameter that runs away stays at the side.
    """
    best = _in_its_tail(problem, optima)
    for _ in range(_WIDENINGS if best else 0):
        low, high = problem.space.open_sides(best[0].x)
        if not (low | high).any():
            break
        wider = replace(problem, space=problem.space.widened(low, high), ends=None)
        reached = polish(wider, best[0].x[np.newaxis])
        if not reached or not reached[0].cost <= best[0].cost:
            break
        problem, best = wider, _in_its_tail(wider, _distinct([reached[0], *best[1:]]))
    return problem, best


def _in_its_tail(problem: Problem, optima: Sequence[Optimum]) -> list[Optimum]:
    """The optima, the best one at the search bound up to which its cost is the same, if there is one.

    In a flat tail a descent rests anywhere. A coordinate stays that has no effect, is redundant, or flat to both sides.
    """
    best, space = [*optima], problem.space
    alone = [name not in itertools.chain(*space.redundant) for name in space.coordinates]
    alike = (1.0 + _ALIKE) * optima[0].cost if best else np.inf
    for k in np.flatnonzero(alone if best else []).tolist():
        ends = np.tile(best[0].x, (2, 1))
        ends[:, k] = space.lower[k], space.upper[k]
        is_open = np.array([np.logical_or(*space.open_sides(end))[k] for end in ends])
        is_flat = is_open & (problem.costs(best[0].x + _BESIDE * (ends - best[0].x)) <= alike)
        if not is_flat.any():  # beside the optimum: at the ends of a wide box a simulation may take long
            continue
        costs = problem.costs(ends)
        kept = np.flatnonzero(costs <= alike)
        if kept.size != 1 or not is_flat[kept[0]]:
            continue
        here = problem.completed(best[0].x[np.newaxis])
        there = np.append(ends[kept], here[:, problem.n_x :], axis=1)
        if np.ptp(problem.model(there) - problem.model(here)) > _EFFECT * np.ptp(problem.y):
            best[0] = best[0]._replace(x=ends[kept[0]], cost=float(costs[kept[0]]))
    return best


def stages_in_words(problems: Sequence[Problem], last: Stage | None) -> str:
    """Which stages the criterion keeps, up to the `last` one, where it has the choice."""
    stages = [problem.stage.word for problem in problems if problem.stage is not None and problem.stage.word]
    if len(problems) < 2 or not stages:
        return ""
    after = next(k for k, problem in enumerate(problems) if problem.stage is last)
    n_kept = len(stages) - (len(problems) - 1 - after)
    kept, others = stages[:n_kept], stages[n_kept:]
    words = [f"keeps {listed(kept)}"] if kept else []
    words += [f"leaves out {listed(others)}"] if others else []
    return f"the BIC {' and '.join(words)}"


def optima(
    problem: Problem, *, seed: int, progress: Progress | None = None, known: Known = None, may_end: bool = False
) -> list[Optimum]:
    """Distinct local optima, best first; empty if every parameter set diverges.

    `known` are those of the simpler problem, which is searched without them. If it `may_end`, a stage that will not
    lower the Bayesian information criterion is not searched to its end.
    """

    def search() -> list[Optimum]:
        return _found(problem, seed, progress, known, may_end)

    is_whole = known is None and not may_end and problem.rough() is problem
    return once(problem, seed, search) if is_whole else search()


def _found(problem: Problem, seed: int, progress: Progress | None, known: Known, may_end: bool) -> list[Optimum]:
    space = problem.space
    if not space.coordinates:
        return polish(problem, np.empty((1, 0)))
    if problem.ends is not None:
        condensed = problem.condensed()
        ends = apart(space, problem.ends, condensed.costs(problem.ends), _SAME, N_POLISHED_WHOLE)
        return _distinct(polish(condensed, ends))
    if problem.y.size > _LONG and (short := problem.thinned(_SHORT) or problem.beginning(_FIRST)) is not None:
        likely = optima(short, seed=seed, progress=progress, known=known, may_end=may_end)[:N_POLISHED_WHOLE]
        if problem.stage is not None and problem.rough() is not problem:  # each costs much to polish
            likely = [each for each in likely if each.cost <= _HOPELESS * likely[0].cost]
        if likely and likely[0].is_simpler:
            return _as_they_are(problem, np.array([each.x for each in likely]))
        return _distinct(polish(problem, np.array([each.x for each in likely]))) if likely else []
    problem = problem.condensed()
    if known is None and problem.simpler is not None:
        known = optima(problem.simpler, seed=seed)
    begun = problem.begun(np.array([each.x for each in known[:N_NESTED]])) if known else np.empty((0, problem.n_x))
    if problem.stage is not None:
        points = _staged(problem, problem.stage, begun, seed)
        if may_end and len(begun) and not _may_stay(problem, begun, points):
            return _as_they_are(problem, begun)
        return _distinct(polish(problem, points))
    share = min(1.0, _LONG / problem.y.size)
    screened = max(256, round(N_SCREENED * share)) if space.screened is None else space.screened
    n_starts = max(16, round(N_DESCENDING * share))
    if begun.size and space.screened is not None and problem.y.size >= _SHORT:
        n_starts = N_DESCENDING_BESIDE
    starts = _starts(problem.rough(), screened, seed, n_starts, np.concatenate([space.starts, begun]))
    if not len(starts):
        return []
    reached = descended(problem.close(), starts, exact=False)
    best = apart(space, reached.theta[:, : problem.n_x], reached.loss, _SAME, N_POLISHED)
    report = progress or (lambda done, total: None)
    report(1, 2)
    polished = polish(problem, best) if len(best) else []
    report(2, 2)
    return _distinct(polished)


def brief_optimum(problem: Problem) -> tuple[FloatArray, float]:
    """Coordinates (n_x,) at which a short search ends, and the sum of squares there; inf if every set diverges."""
    ends, costs = brief_optima(problem)
    return ends[0], float(costs[0])


def brief_optima(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Distinct ends (n_sets, n_x) of a short search, at least one, and sums of squares (n_sets,), the best first.

    On a long record the sums of squares are estimates by fewer samples, unless few rows stand for all of them.
    """
    space, condensed = problem.space, problem.condensed()
    if problem.y.size > _LONG and (short := problem.thinned(_SHORT)) is not None:
        if condensed is problem:
            ends, costs = brief_optima(short)
            return ends, costs * problem.y.size / short.y.size
        ends = brief_optima(short)[0] if space.coordinates else np.empty((1, 0))
        reached = descended(condensed, ends[:1], exact=False, steps=N_BRIEF_WHOLE)
        ends[0] = reached.theta[0, : condensed.n_x]
        return ends, condensed.costs(ends)
    problem = condensed.close()
    if not space.coordinates:
        return np.empty((1, 0)), condensed.costs(np.empty((1, 0)))
    screened = N_BRIEF_SCREENED if space.screened is None else min(space.screened, N_BRIEF_SCREENED)
    best = _starts(condensed.rough(), screened, 0, N_BRIEF_DESCENDING, space.starts, are_kept=False)
    if not len(best):
        return 0.5 * (space.lower + space.upper)[np.newaxis], np.array([math.inf])
    reached = descended(problem, best, exact=False)
    ends = apart(space, reached.theta[:, : problem.n_x], reached.loss, _SAME, N_POLISHED_WHOLE)
    return (ends, problem.costs(ends)) if len(ends) else (best[:1], np.array([math.inf]))


def polish(problem: Problem, starts: FloatArray) -> list[Optimum]:
    """Ends of descents from `starts` (n_sets, n_x) on the close law, and on the law itself if it fits as closely."""
    problem = problem.condensed()
    close = problem.close()
    optima = _optima(problem, _polished(close, starts))
    least = min((each.cost for each in optima), default=math.inf)
    if close is problem or least > problem.y.size * (_FAR_FROM_CLOSE * close.accuracy * problem.scale) ** 2:
        return optima
    return _optima(problem, _polished(problem, np.array([each.x for each in optima])))


def _polished(problem: Problem, starts: FloatArray) -> Reached:
    share = 1.0 if problem.y.size <= _DEAR else _MIDDLE / problem.y.size
    reached = descended(problem, starts, exact=True, steps=max(N_STEPS, round(N_POLISHING * share)))
    if len(starts) and not reached.at_rest[best := int(reached.loss.argmin())]:
        steps = max(N_STEPS, round(N_POLISHING_ALONE * share**2))
        alone = descended(problem, reached.theta[[best], : problem.n_x], exact=True, steps=steps)
        for values, there in zip(reached, alone, strict=True):
            values[[best]] = there
    return reached


def _optima(problem: Problem, reached: Reached) -> list[Optimum]:
    x = reached.theta[:, : problem.n_x]
    costs = problem.costs(x)
    finite = np.flatnonzero(np.isfinite(costs)).tolist()
    return [Optimum(x[k], float(costs[k]), bool(reached.at_rest[k])) for k in finite]


def _staged(problem: Problem, stage: Stage, begun: FloatArray, seed: int) -> FloatArray:
    """Points (n_sets, n_x) to polish after the stage's rounds: the `begun`, and random ones in what the stage frees."""
    space, rough = problem.space, problem.rough()
    drawn = spread(space, stage.drawn, seed)
    around = begun if len(begun) else space.starts
    freed = np.array([name in stage.names for name in space.coordinates])
    beside = np.where(freed, drawn, around[np.arange(len(drawn)) % len(around)])
    points = np.concatenate([space.starts, begun, beside])
    cost = rough.costs(points)
    for n_best, steps in stage.rounds:
        points = apart(space, points, cost, _SAME, n_best)
        reached = descended(rough, points, exact=False, steps=steps)
        points, cost = reached.theta[:, : problem.n_x], reached.loss
    return apart(space, points, cost, _SAME, N_STAGED)


def _as_they_are(problem: Problem, x: FloatArray) -> list[Optimum]:
    return _distinct([Optimum(each, float(cost), True, True) for each, cost in zip(x, problem.costs(x), strict=True)])


def _may_stay(problem: Problem, begun: FloatArray, points: FloatArray) -> bool:
    """Whether the stage may lower the BIC, by rough costs at the `begun` points and after its rounds."""
    rough = problem.rough()
    before, after = (float(rough.costs(each).min()) for each in (begun, points))
    if not (0.0 < after < math.inf and 0.0 < before < math.inf):
        return True
    sizes = problem.costs(begun)
    n, freed = problem.n_samples, len(problem.space.names) - len(problem.simpler.space.names) if problem.simpler else 0
    is_rough = abs(before - sizes.min()) > _ROUGH * sizes.min()
    return is_rough or n * (math.log(before) - math.log(after)) > 0.5 * freed * math.log(n)


def descended(problem: Problem, starts: FloatArray, *, exact: bool, steps: int | None = None) -> Reached:
    noise, everything = Gaussian(floor=max(PERFECT, problem.accuracy) * problem.scale), np.ones((1, problem.y.size))
    descent = Descent(problem, noise, problem.y[np.newaxis], everything, not problem.space.bounds)
    least, most = (_TOLERANCE, N_POLISHING) if exact else (_GAIN, N_STEPS)
    return descent.run(problem.completed(starts), tolerance=0.5 * problem.y.size * least, steps=steps or most)


def _starts(
    problem: Problem, screened: int, seed: int, most: int, own_starts: FloatArray, *, are_kept: bool = True
) -> FloatArray:
    candidates = np.concatenate([own_starts, spread(problem.space, screened, seed)])
    n_own = len(own_starts) if are_kept else 0
    return apart(problem.space, candidates, problem.costs(candidates), _APART, most, n_own)


def spread(space: SearchSpace, n: int, seed: int) -> FloatArray:
    """Points (n, n_x) of a scrambled Sobol sequence in the part of the box that is searched."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(space.lower.size, rng=np.random.default_rng(seed))
    unit = sequence.random_base2(math.ceil(math.log2(max(n, 1))))[:n]
    lower, upper = space.drawn or (space.lower, space.upper)
    return np.asarray(np.clip(lower + unit * (upper - lower), space.lower, space.upper))


def apart(
    space: SearchSpace, points: FloatArray, cost: FloatArray, distance: float, most: int, n_given: int = 0
) -> FloatArray:
    """The first `n_given` points, and the best others that are apart from those already chosen."""
    unit = (points - space.lower) / (space.upper - space.lower)
    ranked = np.concatenate([np.arange(n_given), n_given + np.argsort(cost[n_given:], kind="stable")])
    chosen: list[int] = []
    for k in ranked[np.isfinite(cost[ranked])]:
        if len(chosen) == most:
            break
        if not chosen or np.abs(unit[chosen] - unit[k]).max(axis=1).min() > distance:
            chosen.append(int(k))
    return points[chosen]


def _distinct(optima: list[Optimum]) -> list[Optimum]:
    distinct: list[Optimum] = []
    for optimum in sorted(optima, key=lambda candidate: candidate.cost):
        if not distinct or optimum.cost > distinct[-1].cost * (1.0 + _ALIKE):
            distinct.append(optimum)
    return distinct


_known: ContextVar[dict[Hashable, Future[list[Optimum]]] | None] = ContextVar("searches that are known", default=None)
_lock = threading.Lock()


@contextmanager
def sharing() -> Iterator[None]:
    """Within the block `once` searches a problem once, in threads that `map_on_threads` begins there too."""
    token = _known.set({} if (known := _known.get()) is None else known)
    try:
        yield
    finally:
        _known.reset(token)


def once(problem: Problem, seed: int, search: Callable[[], list[Optimum]]) -> list[Optimum]:
    """The result of `search`, a function of the problem and the seed; one with a budget or a start is not shared."""
    known = _known.get()
    if known is None or problem.budget is not None or problem.ends is not None or problem.stage is not None:
        return search()
    key = (problem.family, _contents(problem), seed)
    try:
        hash(key)
    except TypeError:  # a family of the user's, with a list among its fields
        return search()
    with _lock:
        is_first = key not in known
        result: Future[list[Optimum]] = known.setdefault(key, Future())
    if is_first:
        try:
            result.set_result(search())
        except BaseException as error:
            result.set_exception(error)
            raise
    return awaited(result)


def _contents(problem: Problem) -> Hashable:
    """The freedom of a problem's family, and a digest of its records."""
    space, digest = problem.space, hashlib.blake2b()
    arrays: list[FloatArray | None] = [space.lower, space.upper, space.starts]
    for part in problem.parts:
        before = None if part.before is None else part.before.u
        arrays += [part.record.u, part.record.y, part.record.t, part.weights, before]
        arrays += [np.asarray(values) for _, values in sorted(part.record.channels.items())]
    for values in arrays:
        digest.update(b"none" if values is None else repr(values.shape).encode() + values.tobytes())
    freedom = (space.coordinates, space.names, space.linear, space.screened)
    return digest.digest(), freedom, tuple(sorted(space.held.items())), tuple(sorted(space.bounds.items()))
