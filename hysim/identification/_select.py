"""Choices among families: the verb `select` by a criterion of fits, and that of `identify` without a family.

**Without a family** every one that can be compared without further arguments is tried, those with fewer numbers to
search for first, in two ways:

    left out     cycles beyond the first of each record, in three folds; each is predicted by a fit to the others.
                 Without cycles to leave out, every fourth sample.
    continued    of one record, the rest by fits to its first half and to its first three quarters, where these
                 have a complete cycle, until the input leaves the range of the beginning: left-out cycles alone are
                 too kind where a material fades.
    beyond       likewise, from there on. This counts half, for a law warns beyond the inputs of its record.

The errors are those of free runs on the inputs as measured. Each kind is taken over the least error of any family, and
the score of a family is the geometric mean over the kinds. Among those within a tenth of the best, where the noise of
the outputs hides what is wrong with a family, the BIC decides. The fits of this comparison are short searches; the
search of the best one is complete. In a first round each family has one fold of each kind, and those that are clearly
worse than the best have no second one (as in successive halving: K. Jamieson, A. Talwalkar, AISTATS 2016).
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, frozen
from hysim._basics.printing import aligned, printed, summary_text
from hysim._basics.progress import Progress, Reports, announced_by, reports
from hysim.errors import SimulationError
from hysim.identification._diagnostics import left_out
from hysim.identification._identify import identify
from hysim.identification._result import Choice, Identification
from hysim.identification.sharing import sharing
from hysim.interop import frame
from hysim.models.by_structure import searched
from hysim.models.model import candidates
from hysim.models.protocols import Direct, placed
from hysim.records import Record
from hysim.simulation import free_run

_FOLDS = 3  # of cycles
_EVERY = 4  # samples, of which one is left out where there are no cycles
_CUTS = (0.5, 0.75)  # of a record, from where it is continued
_CYCLE = 2  # reversals at least before a cut
_TURN = 0.01  # of the span: smaller reversals do not count
_EVALUATIONS = 3000  # of a short search: within some per cent of the complete one's error in a tenth of its time
_SAMPLES = 3000  # of all records that a short search has, beside their reversals
_WORSE = 2.0  # times the best of the first round: a family has no second one
_COMPLETE = 3  # complete searches at most, until one succeeds
_EQUAL = 1.1  # times the best score: noise of the outputs may hide the difference
_MOST_TIED = 6
_LAST = 1000
_WEIGHTS = np.array([1.0, 1.0, 0.5])  # of parts left out, continued and beyond
_BEYOND = 0.02  # of the range of a beginning: inputs that leave it by more are beyond
_ROUNDING = 1e-9  # of the outputs' range

Samples = npt.NDArray[np.intp]
CRITERIA = ("bic", "aic", "fpe", "cv_rmse")


@printed
@frozen
class Selection:
    """Candidates identified on the same records, ranked by a criterion.

    Parameters
    ----------
    criterion : {"bic", "aic", "fpe", "cv_rmse"}
    name : str
        Name of the best candidate.
    fits : mapping
        Name to `Identification`, the best first.
    """

    criterion: str
    name: str
    fits: Mapping[str, Identification]

    @property
    def best(self) -> Identification:
        """Fit of the best candidate."""
        return self.fits[self.name]

    def __str__(self) -> str:
        return summary_text(
            [f"Selection: {self.name} is the best of {len(self.fits)} by {self.criterion}", self.to_text()]
        )

    def to_text(self) -> str:
        """The table for a terminal, the best first."""
        rows = [
            [
                name if fit.success else f"{name} ({'UNSAFE' if fit.unsafe else 'partial'})",
                str(fit.n_parameters),
                "-" if math.isnan(fit.fit_percent) else f"{fit.fit_percent:.2f}",
                f"{fit.rmse:.4g}",
                f"{vars(fit)[self.criterion]:.6g}",
            ]
            for name, fit in self.fits.items()
        ]
        header, *lines = aligned([["candidate", "parameters", "fit [%]", "rmse", self.criterion], *rows])
        return "\n".join([header, "-" * len(header), *lines])

    def to_frame(self) -> Any:
        """The candidates as a `pandas.DataFrame`, one row each, the best first; ImportError without pandas."""
        names = ("n_parameters", "fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic", "success", "message")
        return frame(
            {name: [vars(fit)[name] for fit in self.fits.values()] for name in names},
            index=("candidate", [*self.fits]),
            notes={"criterion": self.criterion},
        )


@reports
def select(
    candidates: Mapping[str, Any] | Sequence[Any],
    record_or_records: Record | Sequence[Record],
    *,
    criterion: str = "bic",
    initial: str | Sequence[str] | None = None,
    noise: str = "gaussian",
    cross_validate: str | int | None = None,
    max_evaluations: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Reports = None,
    announce: Callable[[str], None] | None = None,
) -> Selection:
    """Identify several candidates, and rank them.

    Parameters
    ----------
    candidates : mapping or sequence
        Name to what `identify` takes: a class, a model as the start, or a structure. In a sequence a class is named by
        its name, anything else by its text.
    record_or_records : Record or sequence of Record
        As in `identify`, the same for all.
    criterion : {"bic", "aic", "fpe", "cv_rmse"}
        Criterion of the ranking; the last needs `cross_validate`. Without noise the residual is rounding, and the
        others mean nothing.
    initial, noise, cross_validate, max_evaluations, seed, workers
        As in `identify`, the same for all. A fit that ends by `max_evaluations` is marked as partial.
    progress : callable or False, optional
        Called as ``progress(done, total)`` after each candidate; see `hysim.simulate`.
    announce : callable, optional
        Called as ``announce(name)`` before each candidate.

    Returns
    -------
    Selection

    Raises
    ------
    ValueError
        If there is no candidate, two have one name, the criterion is unknown or not computed, or as `identify`.
    TypeError
        If a candidate is not something that can be identified.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1(dwell=1.0)
    >>> hs.select([hs.Line, hs.SingleValued], rec).name
    'SingleValued'
    """
    check_choice("criterion", criterion, CRITERIA)
    if criterion == "cv_rmse" and cross_validate is None:
        raise ValueError('criterion="cv_rmse" needs a cross-validation: cross_validate="loo", or a number of blocks')
    named, report = _named(candidates), progress or (lambda done, total: None)
    fits: dict[str, Identification] = {}
    announce = announce or announced_by(progress)
    with sharing():
        for name, candidate in named.items():
            if announce is not None:
                announce(name)
            fits[name] = identify(
                candidate,
                record_or_records,
                initial=initial,
                noise=noise,
                cross_validate=cross_validate,
                max_evaluations=max_evaluations,
                seed=seed,
                workers=workers,
            )
            report(len(fits), len(named))

    def score(name: str) -> float:
        value = float(vars(fits[name])[criterion])
        return math.inf if math.isnan(value) else value

    ranked = sorted(fits, key=score)
    return Selection(criterion=criterion, name=ranked[0], fits={name: fits[name] for name in ranked})


def _named(candidates: Mapping[str, Any] | Sequence[Any]) -> dict[str, Any]:
    if not isinstance(candidates, (Mapping, Sequence)):
        raise TypeError(f"select takes several candidates, got {type(candidates).__name__}: use identify for one")
    if isinstance(candidates, Mapping):
        named = dict(candidates)
    else:
        named = {each.__name__ if isinstance(each, type) else str(each): each for each in candidates}
    if len(named) < len(candidates):
        raise ValueError("two candidates have one name: give a mapping, name to candidate")
    if not named:
        raise ValueError("there is nothing to select from: give at least one candidate")
    return named


def of_any_family(
    records: Sequence[Record], options: Mapping[str, Any], seconds: float, progress: Progress | None
) -> Identification:
    """The complete search of the family with the best score, with its `choice`."""
    begin, trials, subjects = time.process_time(), _Trials(records, options), candidates()
    size = max(float(np.ptp(record.y)) for record in records)
    names = sorted(subjects, key=lambda name: trials.unknowns(subjects[name]))

    def errors_of(every: Sequence[str], which: slice, done: int) -> dict[str, FloatArray]:
        errors: dict[str, FloatArray] = {}
        for name in every:
            if errors and time.process_time() - begin > seconds:
                break
            errors[name] = trials.of(subjects[name], which)
            if progress:
                progress(done + len(errors), 2 * len(names))
        return errors

    first = errors_of(names, slice(0, 1), 0)
    rounds = _scores(first, size)
    close = [
        name for name in sorted(rounds, key=lambda name: rounds[name]) if rounds[name] <= _WORSE * min(rounds.values())
    ]
    second = errors_of(close, slice(None), len(names))
    if len(second) < len(close):  # not all have had all parts: the errors of the first round are of the same ones
        errors, compared = first, [*first]
    else:
        errors, compared = first | second, close
    score = _scores(errors, size)
    ranked = sorted(score, key=lambda name: (name not in compared, score[name]))
    tied = [name for name in ranked if name in compared and score[name] <= _EQUAL * score[ranked[0]]][:_MOST_TIED]
    bic = {name: trials.bic(subjects[name]) for name in tied} if len(tied) > 1 else {}
    ranked = [*sorted(bic, key=lambda name: bic[name]), *(name for name in ranked if name not in bic)]
    fits = {}
    for name in ranked[:_COMPLETE]:
        fits[name] = identify(subjects[name], records, **options)
        if fits[name].success:
            break
    name = next((name for name, fit in fits.items() if fit.success), ranked[0])
    choice = Choice(
        family=name,
        left_out={each: float(errors[each][0]) for each in ranked},
        continued={each: float(errors[each][1]) for each in ranked},
        beyond={each: float(errors[each][2]) for each in ranked},
        score={each: score[each] for each in ranked},
        bic=bic,
        untried=tuple(each for each in names if each not in errors),
        amplitude=trials.amplitude,
        span=(min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)),
        seconds=time.process_time() - begin,
    )
    return replace(fits[name], choice=choice)


class _Trials:
    """Short searches on parts of records, and the errors of what they predict."""

    def __init__(self, records: Sequence[Record], options: Mapping[str, Any]) -> None:
        self.options, (first, *others) = options, records
        every = [np.arange(len(record)) for record in records]
        kept = [_kept(record, _SAMPLES // len(records)) for record in records]
        self.whole = _Sampled(records, every)
        self.short = _Sampled([_at(*each) for each in zip(records, kept, strict=True)], kept)
        self.cuts = [] if others else [cut for cut in (round(x * len(first)) for x in _CUTS) if _is_cycle(first[:cut])]
        self.amplitude = max((float(np.ptp(first.u) / np.ptp(first.u[:cut])) for cut in self.cuts), default=math.nan)

    def unknowns(self, subject: Any) -> int:
        """How many numbers a search moves; families that cannot be searched here come last."""
        if isinstance(subject, Direct):
            return 0
        try:
            start = subject() if isinstance(subject, type) else subject
            return len(searched(start).search_space(self.whole.records[0]).coordinates)
        except (TypeError, ValueError):
            return _LAST

    def of(self, subject: Any, which: slice) -> FloatArray:
        """Errors of parts left out, of continuations and beyond; inf where a fit fails, nan without such parts."""
        for sampled in (self.short, self.whole):  # a family that depends on time needs all samples
            try:
                return np.array([self._left_out(subject, sampled, which), *self._continued(subject, sampled, which)])
            except (TypeError, ValueError, SimulationError):
                pass
        return np.full(3, np.inf)

    def bic(self, subject: Any) -> float:
        """The BIC of a fit to all samples."""
        try:
            return float(self._fit(subject, self.short.records, None).bic)
        except (TypeError, ValueError, SimulationError):
            return float(self._fit(subject, self.whole.records, None).bic)

    def _left_out(self, subject: Any, sampled: "_Sampled", which: slice) -> float:
        begins = np.cumsum([0, *(len(record) for record in sampled.records)])
        errors = []
        for fold in _folds(sampled.records)[which]:
            weights = np.ones(begins[-1])
            weights[fold] = 0.0
            errors.append(self._fit(subject, sampled.records, np.split(weights, begins[1:-1])).residual[fold])
        return _rms(errors)

    def _continued(self, subject: Any, sampled: "_Sampled", which: slice) -> tuple[float, float]:
        record, kept = sampled.records[0], sampled.kept[0]
        within, beyond = [np.empty(0)], [np.empty(0)]
        for cut in np.searchsorted(kept, self.cuts[which]).tolist():
            model = placed(self._fit(subject, [record[:cut]], None).model, float(record.u[0]))
            rest, u, begin = (record.y - free_run(model, record).y)[cut:], record.u[cut:], record.u[:cut]
            slack = _BEYOND * float(np.ptp(begin))
            leaves = np.flatnonzero((u < begin.min() - slack) | (u > begin.max() + slack))
            end = leaves[0] if leaves.size else u.size
            within, beyond = [*within, rest[:end]], [*beyond, rest[end:]]
        return _rms(within), _rms(beyond)

    def _fit(self, subject: Any, records: Sequence[Record], weights: Any) -> Identification:
        return identify(subject, records, weights=weights, max_evaluations=_EVALUATIONS, **self.options)


class _Sampled(NamedTuple):
    """Records, and the places of their samples in the whole ones."""

    records: Sequence[Record]
    kept: Sequence[Samples]


def _kept(record: Record, most: int) -> Samples:
    if len(record) <= most:
        return np.arange(len(record))
    evenly = np.linspace(0, len(record) - 1, most).round().astype(np.intp)
    return np.union1d(evenly, record.reversals(_TURN))


def _at(record: Record, kept: Samples) -> Record:
    return (
        record if kept.size == len(record) else Record(u=record.u[kept], y=record.y[kept], resolution=record.resolution)
    )


def _is_cycle(record: Record) -> bool:
    return record.reversals(_TURN).size >= _CYCLE


def _folds(records: Sequence[Record]) -> list[Samples]:
    """Every third cycle but the first of each record, which shows where a memory begins; else every fourth sample."""
    try:
        cycles = left_out("cycles", records)
    except ValueError:
        samples = np.arange(sum(map(len, records)))
        return [samples[k::_EVERY] for k in range(_EVERY)]
    return [np.concatenate(cycles[k::_FOLDS]) for k in range(min(_FOLDS, len(cycles)))]


def _rms(errors: Sequence[FloatArray]) -> float:
    every = np.concatenate(errors)
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(every**2))) if every.size else math.nan


def _scores(errors: Mapping[str, FloatArray], size: float) -> dict[str, float]:
    """The geometric mean, over the kinds of parts that there are, of the errors over the least of each."""
    table = np.array([*errors.values()]) + _ROUNDING * size  # errors below rounding are equal
    is_kind = np.isfinite(table).any(axis=0)
    known = np.where(np.isnan(table), np.inf, table)[:, is_kind]
    with np.errstate(over="ignore"):
        means = np.exp(np.average(np.log(known / known.min(axis=0)), axis=1, weights=_WEIGHTS[is_kind]))
    return dict(zip(errors, means.tolist(), strict=True))
