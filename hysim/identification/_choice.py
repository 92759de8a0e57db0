"""Choices by what is predicted: between a search and a fit in one step, and among families.

**A fit in one step**, of families that are not searched for, has many numbers without names and standard errors. It is
returned in place of a search of few where its rms error in parts that are left out is lower by a clear part. It is made
smoother until it is safe on cycles that the record does not have.

**Without a family** every one that needs no further arguments is tried, those with fewer numbers first, in two ways:

    left out     cycles beyond the first of each record, in three folds; each is predicted by a fit to the others.
                 Without cycles to leave out, every fourth sample.
    continued    of one record, the rest by fits to its first half and to its first three quarters, where these
                 have a complete cycle, until the input leaves the range of the beginning: left-out cycles alone are
                 too kind where a material fades.
    beyond       likewise, from there on. This counts half, for a law warns beyond the inputs of its record; where the
                 amplitudes grow throughout, there is no other continuation, and it stands for that, too.

The errors are those of free runs on the inputs as measured. Each kind is taken over the least error of any family, and
the score of a family is the geometric mean over the kinds. Among those within a twentieth of the best, where the noise
of the outputs hides what is wrong with a family, the BIC decides. In a first round each family has one fold of each
kind, and those that are clearly worse than the best have no second one (as in successive halving: K. Jamieson,
A. Talwalkar, AISTATS 2016).

The fits of this comparison are short searches. Complete ones go down the ranking until one succeeds, through three
families at most; where all three are unsafe, through up to eight that are not clearly worse than the best.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial
from itertools import takewhile
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray, check_count
from hysim._basics.parallel import awaited, cores, forked
from hysim._basics.progress import Progress
from hysim._columns.turning import TOLERANCE
from hysim.errors import SimulationError
from hysim.identification._admissible import excursion
from hysim.identification._problem import Weights
from hysim.identification._result import Choice, Identification, Width
from hysim.identification._searched import Search
from hysim.identification._uncertainty import Folds, Samples, errors_of_refits, fit_measures, left_out, left_out_errors
from hysim.identification.doubts import CONSTANT
from hysim.metrics.criteria import rms_of_known
from hysim.metrics.rows import LoopRows
from hysim.models.by_structure import searched
from hysim.models.model import candidates
from hysim.models.protocols import Direct, DirectFit, placed
from hysim.models.search_space import Freedom
from hysim.records import Record, by_record, few_places
from hysim.simulation import free_run, residual_of

_CLEARLY = 0.9  # of the left-out error of the search: a law without names and standard errors must gain more than that
_NORMAL = 1.959964  # standard errors on either side of an interval at 95 %
_FOLDS = 3  # of cycles
_EVERY = 4  # samples, of which one is left out where there are no cycles
_CUTS = (0.5, 0.75)  # of a record, from where it is continued
_CYCLE = 2  # reversals at least before a cut
_EVALUATIONS = 3000  # of a short search: within some per cent of the complete one's error in a tenth of its time
_SAMPLES = 3000  # of all records that a short search has, beside their reversals
_WORSE = 2.0  # times the best of the first round: a family has no second one
_MOST_PROCESSES = 8  # beyond, the few families of many numbers take as long
_COMPLETE, _MOST_COMPLETE = 3, 8  # complete searches, until one succeeds; and where none of the former is safe
_EQUAL = 1.05  # times the best score: noise of the outputs may hide the difference
_MOST_TIED = 6
_LAST = 1000
_WEIGHTS = np.array([1.0, 1.0, 0.5])  # of parts left out, continued and beyond
_ALL_BEYOND = np.array([1.0, 0.0, 1.5])
_BEYOND = 0.02  # of the range of a beginning: inputs that leave it by more are beyond
_ROUNDING = 1e-9  # of the outputs' range

Identify = Callable[..., Identification]


def refuse(family: Direct, freedom: Freedom, noise: str, intervals: str) -> None:
    """Refuse options that such a fit does not have."""
    name = family.__name__ if isinstance(family, type) else type(family).__name__
    if freedom.fixed or freedom.free or freedom.bounds:
        raise ValueError(f"{name} has no parameters by name: leave out fixed=, free= and bounds=")
    if noise != "gaussian":
        raise ValueError(f'{name} is fitted by least squares: noise must be "gaussian", got {noise!r}')
    if intervals != "linear":
        raise ValueError(f'{name} has no parameters by name: intervals must be "linear", got {intervals!r}')


def in_one_step(
    family: Direct, records: Sequence[Record], weights: Weights, folds: Folds, seed: int, admissible: bool | None
) -> Identification:
    """The fit, and its errors at samples that are left out."""
    return _described(family, _fitted(family, records, weights, admissible), records, weights, folds, seed)


def better(
    fit: Identification, search: Search, optima: FloatArray, rival: Any, folds: Folds, admissible: bool | None
) -> Identification:
    """The `fit` of a search from its `optima`, or that of the `rival` where it predicts left-out parts better."""
    parts = search.problem.parts
    records, weights = [part.record for part in parts], [part.weights for part in parts]
    shares = [each for each in weights if each is not None] or None
    smooth = _fitted(rival, records, shares, admissible)
    if (smoother := smooth.smoother) is None:
        raise TypeError(f"{rival!r} does not say how its fit depends on the outputs")
    samples, residual = smoother.samples, residual_of(smooth.models, records)
    short = search.problem.at(samples)
    kinds = rival.parts([part.record for part in short.parts])
    own = np.concatenate([left_out_errors(short, search.noise, optima, kind) for kind in kinds])
    others = np.concatenate([smoother.left_out(residual, [samples[each] for each in kind]) for kind in kinds])
    of_search, of_rival = rms_of_known(own), rms_of_known(others)
    told = f"{of_rival:.3g} against {of_search:.3g}"
    if not of_rival < _CLEARLY * of_search:
        message = f"{fit.message}; a smooth density predicts parts left out not clearly better, {told}"
        return replace(fit, message=message)
    result = _described(rival, smooth, records, shares, folds, fit.seed)
    return replace(result, message=f"{result.message}; it predicts parts left out better than a grid, {told}")


def _fitted(family: Direct, records: Sequence[Record], weights: Weights, admissible: bool | None) -> DirectFit:
    """The fit, the next smoother one as long as it is not safe on smaller cycles."""
    shares = None if weights is None else np.concatenate(weights)
    fit = family.fitted(records, shares)
    while admissible is not False and fit.smoother_family is not None:
        off = excursion(fit.models, records)
        if off is None or off.is_safe:
            break
        fit = fit.smoother_family.fitted(records, shares)
    return fit


def _described(
    family: Direct, fit: DirectFit, records: Sequence[Record], weights: Weights, folds: Folds, seed: int
) -> Identification:
    y, residual = np.concatenate([record.y for record in records]), residual_of(fit.models, records)
    shares = np.ones(y.size) if weights is None else np.concatenate(weights)
    kept = shares > 0.0

    def refitted(others: FloatArray) -> FloatArray:
        return residual_of(family.fitted(records, others * shares).models, records)

    n_parameters = max(1, round(fit.degrees_of_freedom))
    freedom = np.count_nonzero(kept) - fit.degrees_of_freedom
    sigma = float(np.sqrt(np.sum(residual[kept] ** 2) / freedom)) if freedom > 0.5 else float("nan")
    smoother = fit.smoother
    errors = errors_of_refits(refitted, y.size, folds) if smoother is None else smoother.left_out(residual, folds)
    errors = np.where(kept, errors, np.nan)
    measures = fit_measures(y[kept], residual[kept], n_parameters)
    return Identification(
        model=fit.models[0],
        models=fit.models,
        n_parameters=n_parameters,
        **measures,
        sigma=measures["rmse"],
        log_likelihood=-0.5 * metrics.aic(residual[kept], 0) - 0.5 * np.count_nonzero(kept),
        residual=residual,
        resolution=records[0].resolution,
        response_stderr=sigma * fit.spread,
        loop_width=_width(fit, records[0], sigma),
        success=True,
        message="; ".join(filter(None, ("fitted in one step", fit.words))),
        cv_residual=errors,
        cv_rmse=rms_of_known(errors),
        seed=seed,
        warnings=() if np.ptp(y) else (CONSTANT,),
    )


def _width(fit: DirectFit, record: Record, sigma: float) -> Width | None:
    """The largest width of the loop, between bounds that are nan where they are not known; None without a loop."""
    rows, output = LoopRows(record.u), free_run(fit.models[0], record).y
    try:
        value = float(rows.max_width(output[np.newaxis])[0])
    except ValueError:  # there is no complete cycle
        return None
    if fit.smoother is None:
        bound = 0.0 if value == 0.0 else float("nan")
        return Width(value=value, lower=bound, upper=bound)
    own = fit.smoother.samples < len(record)
    places, every = fit.smoother.samples[own], np.arange(len(record))
    by_outputs = np.array([np.interp(every, places, each) for each in fit.smoother.rows[own].T])
    slope = rows.max_width_slopes(output, by_outputs)
    reach = _NORMAL * sigma * float(np.sqrt(np.maximum(slope @ fit.smoother.gram @ slope, 0.0)))
    return Width(value=value, lower=value - reach, upper=value + reach)


def of_any_family(
    identify: Identify, records: Sequence[Record], options: Mapping[str, Any], seconds: float, progress: Progress | None
) -> Identification:
    """The complete search of the family with the best score, with its `choice`."""
    trials, subjects = _Trials(identify, records, options), candidates()
    size = max(float(np.ptp(record.y)) for record in records) or 1.0
    names = sorted(subjects, key=trials.unknowns)
    if options["workers"] is not None:
        check_count("workers", options["workers"])
    number, spent = min(options["workers"] or cores(), _MOST_PROCESSES), 0.0
    _at_hand[id(trials)] = trials  # which forked processes find without pickling

    def results(of: Callable[[Any, str], Any], every: Sequence[str], seconds: float, done: int) -> dict[str, Any]:
        """Results of families by name. None is begun after so many seconds of the processor."""
        nonlocal spent
        known: dict[str, Any] = {}
        rest, waiting = deque(every), deque[tuple[str, Future[tuple[Any, float]]]]()
        while waiting or (rest and (spent < seconds or not known)):
            is_full = len(waiting) == 2 * number - 1 or bool(waiting and waiting[0][1].done())
            if rest and not is_full and (spent < seconds or not (known or waiting)):
                waiting.append((rest[0], pool.submit(_timed, id(trials), of, rest.popleft())))
            else:
                name, future = waiting.popleft()
                known[name], cpu = _result(future, [name, *(each for each, _ in waiting)])
                spent += cpu
                if progress:
                    progress(done + len(known), 2 * len(names))
        return known

    with forked(number if number > 1 else 0) as pool:
        first = results(partial(_Trials.of, which=slice(0, 1)), names, seconds, 0)
        second, score = dict[str, FloatArray](), _scores(first, size)
        # the best of one fold may predict others badly: then families that were worse on that fold are tried again
        while close := _close(score, second):
            more = results(partial(_Trials.of, which=slice(None)), close, seconds, len(names) + len(second))
            if len(more) < len(close):  # the time is over
                break
            second |= more
            score = _scores(first | second, size)
        errors, compared = first | second, first if close else second
        ranked = sorted(score, key=lambda name: (name not in compared, score[name]))
        tied = [name for name in ranked if name in compared and score[name] <= _EQUAL * score[ranked[0]]][:_MOST_TIED]
        bic = results(_Trials.bic, tied, math.inf, 2 * len(names) - len(tied)) if len(tied) > 1 else {}
    ranked = [*sorted(bic, key=lambda name: bic[name]), *(name for name in ranked if name not in bic)]
    fits: dict[str, Identification] = {}
    for name in ranked[:_MOST_COMPLETE]:
        is_close = score[name] <= _WORSE * min(score.values())
        if len(fits) >= _COMPLETE and not (is_close and all(fit.unsafe for fit in fits.values())):
            break
        begin = time.process_time()
        fits[name] = identify(subjects[name], records, **options)
        spent += time.process_time() - begin
        if fits[name].success:
            break
    name = min(fits, key=lambda name: (not fits[name].success, bool(fits[name].unsafe)))
    reasons = {each: "no fit succeeded" for each in ranked if score[each] == math.inf} | trials.refused
    reasons |= {each: fits[each].unsafe or fits[each].message for each in takewhile(lambda each: each != name, fits)}
    choice = Choice(
        family=name,
        left_out={each: float(errors[each][0]) for each in ranked},
        continued={each: float(errors[each][1]) for each in ranked},
        beyond={each: float(errors[each][2]) for each in ranked},
        score={each: score[each] for each in ranked},
        bic=bic,
        untried=tuple(each for each in names if each not in errors and each not in trials.refused),
        passed_over={each: why.partition(":")[0].partition(";")[0] for each, why in reasons.items()},
        amplitude=trials.amplitude,
        span=(min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)),
        seconds=spent,
    )
    return replace(fits[name], choice=choice)


_at_hand = WeakValueDictionary[int, "_Trials"]()


def _timed(trials: int, of: Callable[[Any, str], Any], name: str) -> tuple[Any, float]:
    """A result of the trials at hand, and its seconds of the processor."""
    begin = time.process_time()
    return of(_at_hand[trials], name), time.process_time() - begin


def _result(future: Future[tuple[Any, float]], searched_now: Sequence[str]) -> tuple[Any, float]:
    try:
        return awaited(future)
    except BrokenProcessPool:
        why = "maybe for its memory; one worker takes no process"
        raise RuntimeError(f"a process was ended that searched one of {', '.join(searched_now)}, {why}") from None


class _Trials:
    """Short searches on parts of records, and the errors of what they predict."""

    def __init__(self, identify: Identify, records: Sequence[Record], options: Mapping[str, Any]) -> None:
        self.identify, self.options, (first, *others) = identify, options, records
        self.refused: dict[str, str] = {}
        every = [np.arange(len(record)) for record in records]
        kept = [few_places(record, _SAMPLES // len(records)) for record in records]
        self.whole = _Sampled(records, every)
        self.short = _Sampled([_at(*each) for each in zip(records, kept, strict=True)], kept)
        cuts = [] if others else [round(share * len(first)) for share in _CUTS]
        self.cuts = [cut for cut in cuts if first[:cut].reversals(TOLERANCE).size >= _CYCLE]
        self.amplitude = max((float(np.ptp(first.u) / np.ptp(first.u[:cut])) for cut in self.cuts), default=math.nan)

    def unknowns(self, name: str) -> int:
        """How many numbers a search moves; families that cannot be searched here come last."""
        subject: Any = candidates()[name]
        if isinstance(subject, Direct):
            return 0
        try:
            start = subject() if isinstance(subject, type) else subject
            return len(searched(start).search_space(self.whole.records[0]).coordinates)
        except (TypeError, ValueError) as error:
            self.refused[name] = str(error)
            return _LAST

    def of(self, name: str, which: slice) -> FloatArray:
        """Errors of parts left out, of continuations and beyond; inf where a fit fails, nan without such parts."""
        subject = candidates()[name]
        for sampled in (self.short, self.whole):  # a family that depends on time needs all samples
            try:
                return np.array([self._left_out(subject, sampled, which), *self._continued(subject, sampled, which)])
            except (TypeError, ValueError, SimulationError):
                pass
        return np.full(3, np.inf)

    def bic(self, name: str) -> float:
        """The BIC of a fit to all samples."""
        subject = candidates()[name]
        try:
            return float(self._fit(subject, self.short.records, None).bic)
        except (TypeError, ValueError, SimulationError):
            return float(self._fit(subject, self.whole.records, None).bic)

    def _left_out(self, subject: Any, sampled: "_Sampled", which: slice) -> float:
        records = sampled.records

        def residual(weights: FloatArray) -> FloatArray:
            return self._fit(subject, records, by_record(weights, records)).residual

        return rms_of_known(errors_of_refits(residual, sum(map(len, records)), _folds(records)[which]))

    def _continued(self, subject: Any, sampled: "_Sampled", which: slice) -> tuple[float, float]:
        record, kept = sampled.records[0], sampled.kept[0]
        within, beyond = list[FloatArray](), list[FloatArray]()
        for cut in np.searchsorted(kept, self.cuts[which]).tolist():
            model = placed(self._fit(subject, [record[:cut]], None).model, float(record.u[0]))
            rest, u, begin = residual_of([model], [record])[cut:], record.u[cut:], record.u[:cut]
            slack = _BEYOND * float(np.ptp(begin))
            leaves = np.flatnonzero((u < begin.min() - slack) | (u > begin.max() + slack))
            end = leaves[0] if leaves.size else u.size
            within, beyond = [*within, rest[:end]], [*beyond, rest[end:]]
        return rms_of_known(*within), rms_of_known(*beyond)

    def _fit(self, subject: Any, records: Sequence[Record], weights: Any) -> Identification:
        return self.identify(subject, records, weights=weights, max_evaluations=_EVALUATIONS, **self.options)


class _Sampled(NamedTuple):
    """Records, and the places of their samples in the whole ones."""

    records: Sequence[Record]
    kept: Sequence[Samples]


def _at(record: Record, kept: Samples) -> Record:
    if kept.size == len(record):
        return record
    return Record(u=record.u[kept], y=record.y[kept], resolution=record.resolution)


def _folds(records: Sequence[Record]) -> list[Samples]:
    """Every third cycle but the first of each record, which shows where a memory begins; else every fourth sample."""
    try:
        cycles = left_out("cycles", records)
    except ValueError:
        samples = np.arange(sum(map(len, records)))
        return [samples[k::_EVERY] for k in range(_EVERY)]
    return [np.concatenate(cycles[k::_FOLDS]) for k in range(min(_FOLDS, len(cycles)))]


def _close(score: Mapping[str, float], second: Mapping[str, FloatArray]) -> list[str]:
    """Families without a second round that are not clearly worse than the best of those with one, or of all."""
    worst = _WORSE * min(score[name] for name in second or score)
    return [name for name in sorted(score, key=lambda each: score[each]) if name not in second and score[name] <= worst]


def _scores(errors: Mapping[str, FloatArray], size: float) -> dict[str, float]:
    """The geometric mean, over the kinds of parts that there are, of the errors over the least of each."""
    table = np.array([*errors.values()]) + _ROUNDING * size  # errors below rounding are equal
    is_kind = np.any(np.isfinite(table), axis=0, keepdims=True)[0]
    if not is_kind.any():  # no fit succeeded: that of the first family says why
        return dict.fromkeys(errors, math.inf)
    known = np.where(np.isnan(table), np.inf, table)[:, is_kind]
    weights = _WEIGHTS if is_kind[1] else _ALL_BEYOND
    with np.errstate(over="ignore"):
        means = np.exp(np.average(np.log(known / known.min(axis=0)), axis=1, weights=weights[is_kind]))
    return dict(zip(errors, means.tolist(), strict=True))
