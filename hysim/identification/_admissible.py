"""Whether an identified law is safe on inputs that its record does not hold, and the choice of a safe one.

A law is tried inside the span of the record's input, after the record's own turning points: on the record's path at
smaller amplitudes, about its middle and shifted towards either end, on fading and growing stairs, and on minor loops
about three inputs on either branch, each repeated 50 times. A device stays inside the band of its outer loop, or little
beyond: what counts is how far the output beside the line that fits the record best leaves this band. A law is *safe* if
no trial leaves it by more than half of the output's range: the ratcheting of Bouc and Wen's law on thin loops, which is
in the equation, comes to 0.4 of it, and a memory that grows to much more.

*Admissible* laws are safe, and lie in the region that the family names so, if it names one: -beta <= gamma <= beta for
Bouc and Wen's, where the law creates no energy and the memory is bounded. The best law of all is taken where it is
safe. Otherwise the best admissible law is taken where it fits as well within noise and creep,

    N_eff ln(V_admissible / V_best) <= 10,        N_eff = N / (1 + 2 sum of rho_k),

and its rmse is at most a quarter above, since the residual of a wrong family is correlated, too. V is the mean squared
residual, not below that of the sensor's rounding, and rho_k the autocorrelation of the best law's residual up to the
first pair of lags whose sum is not positive (C. J. Geyer, Stat. Sci. 7, 1992): creep stays for many samples, and so
leaves few that are independent. 10 is the difference of two BIC that `_assumptions` calls clear.

Where the best law of the region is not safe, or the family names none, the best safe law is approached from a safe one:
the law descends in a box about its place, to which it moves where it is still safe there; else the box is halved.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.errors import SimulationError
from hysim.identification._result import Candidate
from hysim.identification._search import optima, polish, spread
from hysim.identification._searched import LocalOptimum, Search
from hysim.models.dependent import AlongRecord, on_record
from hysim.models.protocols import Responding, needs_time
from hysim.models.search_space import SearchSpace
from hysim.records import Record

_UNSAFE = 0.5  # of the output's range: see above
_RUNAWAY = 2.0  # likewise
_FARTHEST = 1.0  # of the record's range beside the line: a device leaves it by less
_TURN = 0.01  # of the span: smaller reversals are noise, or change little
_MOST_TURNS = 40  # of the record's path that is tried at other amplitudes
_POINTS = 4  # on each branch
_STAIRS = 20
_SCALES = ((0.5, 0.0), (0.5, -1.0), (0.5, 1.0), (0.9, 0.0), (0.9, -1.0), (0.9, 1.0))  # amplitude, and fixed end
_LOOPS = ((-0.5, 0.1), (-0.5, 0.4), (0.0, 0.1), (0.0, 0.4), (0.5, 0.1), (0.5, 0.4))  # centre and amplitude
_REPEATED = 50
_CLEAR = 10.0  # difference of two BIC: that of `_assumptions`
_MOST_LOSS = 1.25  # rmse over that of the best law
_N_SCREENED = 256
_N_TRIED = 64  # points that are tried for safety, the best first
_N_BEGUN = 4  # safe points from which the best safe law is approached
_LONG, _SHORT = 512, 250  # samples beyond which it is approached on so many first
_LARGEST_BOX, _SMALLEST_BOX = 0.25, 1.0 / 512.0  # half a side, of the whole box
_MOST_BOXES = 40
_GAIN = 1e-4  # share of the sum of squares: a box that gains less is the last


class Excursion(NamedTuple):
    """The largest distance from the band on all trials [unit of y], and the trial; inf where the model diverges."""

    beyond: float
    trial: str
    band: float  # width of the band [unit of y]
    span: float  # range of the output [unit of y]

    @property
    def is_safe(self) -> bool:
        return self.beyond <= _UNSAFE * self.span


Ends = tuple[Search, list[LocalOptimum]]
"""A search and its optima, best first."""


def excursion(models: Sequence[Any], records: Sequence[Record]) -> Excursion | None:
    """Largest excursion on the record of the widest input; None if time or a channel matters, or nothing turns."""
    k = max(range(len(records)), key=lambda k: float(np.ptp(records[k].u)))
    model, record = models[k], records[k]
    turning = record.reversals(tolerance=_TURN)
    if needs_time(model) or isinstance(model, AlongRecord) or not isinstance(model, Responding) or not turning.size:
        return None
    line, low, high = _band(records)
    if high == low:
        return None
    span = max(float(np.ptp(each.y)) for each in records)
    past = record.u[np.concatenate([[0], turning, [len(record) - 1]])]
    worst, where = 0.0, ""
    for name, path in _trials(past):
        try:
            beside = model.response(np.concatenate([past, path]))[past.size :] - np.polyval(line, path)
        except SimulationError:
            return Excursion(math.inf, name, high - low, span)
        beyond = max(float(beside.max()) - high, low - float(beside.min()))
        if beyond > worst:
            worst, where = beyond, name
    return Excursion(worst, where, high - low, span)


def danger(off: Excursion | None, records: Sequence[Record], alternative: Candidate | None) -> str:
    """A sentence where a law is not safe, with what to do; else the empty text."""
    if off is None or off.is_safe:
        return ""
    low, high = min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)
    unit = records[0].units.get("u", "")
    within = f"+-{high:.4g}" if math.isclose(-low, high, rel_tol=0.01) else f"{low:.4g} to {high:.4g}"
    what = f"leaves the measured range by {off.beyond / off.span:.0%} of it"
    if off.beyond > _RUNAWAY * off.span:
        what = "runs away"
    other = "" if alternative is None else f", or admissible=True (fit {alternative.fit_percent:.2f} %)"
    return (
        f"UNSAFE on smaller cycles: within {' '.join(filter(None, (within, unit)))} this law {what}. "
        f"Take hs.PrandtlIshlinskii{other}."
    )


def implausible(off: Excursion | None) -> str:
    """A sentence where a safe law leaves the band by more than its width; else the empty text."""
    if off is None or not off.is_safe or off.beyond <= _FARTHEST * off.band:
        return ""
    return (
        f"on {off.trial} inside the span of the input the model leaves the range of the output beside a line by "
        f"{off.beyond / off.band:.2g} times this range: check it on a record of smaller cycles before you use it off "
        "this one"
    )


def choose(
    search: Search, likely: list[LocalOptimum], admissible: bool | None
) -> tuple[Ends, Mapping[str, Candidate], str]:
    """The optimum, or the best admissible law in its place; `admissible` is that of `hysim.identify`.

    Also candidates that are named, and a remark.
    """
    best = likely[0]
    named = {name: each.candidate(inside[0].theta) for name, (each, inside) in _by_region(search, best).items()}
    is_safe = _is_safe(search, best.theta)
    if admissible is False or (is_safe and not (admissible and named)) or _is_cut(search):
        return (search, likely), named, ""
    other = _safest(search, likely)
    if other is None:
        return (search, likely), {name: each for name, each in named.items() if name != "admissible"}, ""
    safe, inside = other
    if admissible is None and not _is_as_good(search, best.theta, inside[0].theta):
        return (search, likely), {**named, "admissible": safe.candidate(inside[0].theta)}, ""
    unrestricted = search.candidate(best.theta)
    kind = "is not admissible" if is_safe else "is unsafe on smaller cycles"
    loss = "" if admissible else ", and fits no better within noise and creep"
    remark = (
        f"the best admissible law, in place of one of fit {unrestricted.fit_percent:.2f} % that {kind}{loss}: "
        "admissible=False returns that one"
    )
    return other, {"unrestricted": unrestricted}, remark


def _is_cut(search: Search) -> bool:
    return search.problem.budget is not None and search.problem.budget.cut


def _by_region(search: Search, best: LocalOptimum) -> dict[str, Ends]:
    """The optima inside each named region that the best one is not in."""
    known, x = {}, best.theta[: search.problem.n_x]
    for name, (lower, upper) in search.problem.space.regions.items():
        if not (np.all(x >= lower) and np.all(x <= upper)) and not _is_cut(search):
            inside = _inside(search, lower, upper)
            if reached := _reached(inside):
                known[name] = inside, reached
    return known


def _inside(search: Search, lower: FloatArray, upper: FloatArray) -> Search:
    return replace(search, problem=replace(search.problem, space=_part(search.problem.space, lower, upper), ends=None))


def _part(space: SearchSpace, lower: FloatArray, upper: FloatArray) -> SearchSpace:
    drawn = space.drawn and (np.clip(space.drawn[0], lower, upper), np.clip(space.drawn[1], lower, upper))
    starts, outer = np.clip(space.starts, lower, upper), space.outer or (space.lower, space.upper)
    return replace(space, lower=lower, upper=upper, starts=starts, drawn=drawn, regions={}, outer=outer)


def _reached(search: Search) -> list[LocalOptimum]:
    squares = optima(search.problem, seed=search.seed)
    return search.likely(squares) if squares else []


def _is_safe(search: Search, theta: FloatArray) -> bool:
    problem = search.problem
    records = [part.record for part in problem.parts]
    models = [problem.family.assemble(problem.estimates(theta, k)) for k in range(len(records))]
    off = excursion([on_record(*each) for each in zip(models, records, strict=True)], records)
    return off is None or off.is_safe


def _is_as_good(search: Search, best: FloatArray, other: FloatArray) -> bool:
    """Whether noise and creep allow the loss of fit, as the module says."""
    problem = search.problem
    share = np.sqrt(problem.weights)
    first, second = (share * search.residual(theta) for theta in (best, other))
    rounding = max(problem.rounding, (problem.parts[0].record.resolution or 0.0) / math.sqrt(12.0))
    least, more = (max(float(np.mean(each**2)), rounding**2) for each in (first, second))
    return more <= _MOST_LOSS**2 * least and effective_samples(first) * math.log(more / least) <= _CLEAR


def effective_samples(residual: FloatArray) -> float:
    """Number of independent samples of a residual (n,), at least 1."""
    centred, n = residual - residual.mean(), residual.size
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    covariance = np.fft.irfft(spectrum)[:n]
    if n < 4 or not covariance[0] > 0.0:
        return float(n)
    pairs = (covariance[1 : n - (n - 1) % 2] / covariance[0]).reshape(-1, 2).sum(axis=1)
    first = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else pairs.size
    return n / (1.0 + 2.0 * float(pairs[:first].sum()))


def _safest(search: Search, likely: list[LocalOptimum] | None) -> Ends | None:
    """The best admissible optimum that was met, in its own box, followed by others of this box."""
    regions = search.problem.space.regions
    if regions:
        lower, upper = np.max([low for low, _ in regions.values()], 0), np.min([up for _, up in regions.values()], 0)
        search, likely = _inside(search, lower, upper), None
    likely = _reached(search) if likely is None else likely
    if likely and _is_safe(search, likely[0].theta):
        return search, likely
    ends = [_approached(search, x) for x in _safe_points(search, likely)]
    return min((each for each in ends if each is not None), key=lambda each: each[1][0].loss, default=None)


def _safe_points(search: Search, likely: Sequence[LocalOptimum]) -> FloatArray:
    """Coordinates (n_sets, n_x) of safe laws: the best of other optima, the simpler family's, and random ones."""
    problem = search.problem
    points = [each.theta[np.newaxis, : problem.n_x] for each in likely[1:]]
    if problem.simpler is not None and problem.own.encoded is not None:
        simple = _safest(replace(search, problem=problem.simpler), None)
        if simple is not None:
            points.append(problem.begun(simple[1][0].theta[np.newaxis, : problem.simpler.n_x]))
    every = np.concatenate([*points, problem.space.starts, spread(problem.space, _N_SCREENED, search.seed)])
    costs = problem.costs(every)
    ranked = (k for k in np.argsort(costs, kind="stable")[:_N_TRIED] if np.isfinite(costs[k]))
    safe = (every[k] for k in ranked if _is_safe(search, problem.completed(every[[k]])[0]))
    points = [*itertools.islice(safe, _N_BEGUN)]
    return np.reshape(points, (len(points), problem.n_x))


def _approached(search: Search, x: FloatArray) -> Ends | None:
    """The safe optimum that is reached from safe coordinates (n_x,), box by box; on few samples first."""
    problem, half = search.problem, _LARGEST_BOX
    short = problem.thinned(_SHORT) if problem.y.size > _LONG else None
    size, box, reached = problem.space.upper - problem.space.lower, problem.space, None
    for part in filter(None, (short, problem)):
        cost, reached = math.inf, None
        for _ in range(_MOST_BOXES):
            sides = np.clip([x - half * size, x + half * size], problem.space.lower, problem.space.upper)
            inside = replace(part, space=_part(problem.space, *sides), ends=None, simpler=None)
            end = next(iter(polish(inside, x[np.newaxis])), None)
            if end is None or not _is_safe(search, problem.completed(end.x[np.newaxis])[0]):
                half *= 0.5
                if half < _SMALLEST_BOX:
                    break
                continue
            gain, x, cost = cost - end.cost, end.x, end.cost
            box, reached = inside.space, [end]
            if gain <= _GAIN * cost:
                break
        half = max(half, _SMALLEST_BOX)
    if reached is None:
        return None
    at_end = replace(search, problem=replace(problem, space=box, ends=None, simpler=None))
    return at_end, at_end.likely(reached)


def _band(records: Sequence[Record]) -> tuple[FloatArray, float, float]:
    """The line that fits all records best, and the lowest and highest output less this line."""
    u, y = np.concatenate([record.u for record in records]), np.concatenate([record.y for record in records])
    slope = float(np.dot(u - u.mean(), y - y.mean()) / np.dot(u - u.mean(), u - u.mean()))
    line = np.array([slope, y.mean() - slope * u.mean()])
    beside = y - np.polyval(line, u)
    return line, float(beside.min()), float(beside.max())


def _trials(past: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Names and inputs, between the lowest and the highest turning point of the past."""
    low, high = float(past.min()), float(past.max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    path = (past[-_MOST_TURNS:] - middle) / half
    scaled = [end + amplitude * (path - end) for amplitude, end in _SCALES]
    yield "the record's path at smaller amplitudes", middle + half * _sampled(np.concatenate(scaled))
    fading = (1.0 - np.arange(_STAIRS) / _STAIRS) * (-1.0) ** np.arange(_STAIRS)
    yield "fading and growing stairs", middle + half * _sampled(np.concatenate([fading, fading[::-1]]))
    loops: list[float] = []
    for centre, amplitude in _LOOPS:
        for outer in (1.0, -1.0):
            loops += [-outer, outer, *[centre - outer * amplitude, centre + outer * amplitude] * _REPEATED]
    yield "minor loops", middle + half * _sampled(np.array(loops))


def _sampled(corners: FloatArray) -> FloatArray:
    places = np.arange((corners.size - 1) * _POINTS + 1) / _POINTS
    return np.interp(places, np.arange(corners.size), corners)
