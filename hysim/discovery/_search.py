"""One library on some records: from slopes to refined structures.

**Shifts.** The slope of z = y - feedthrough u - offset is linear in the coefficients of its law, not in the two
shifts. These are scanned, and the coefficients solved for at each (variable projection). The left side loses what the
term u' gains by a feedthrough, so that misfits are comparable. The free runs begin at the best few places.

**Any exponent.** A Bouc-Wen law whose exponent is no whole number has terms that are in no finite library,

    z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n.

Its exponent is scanned; from the best regressions on the three terms the free run is refined, n with the other numbers.
The law is taken where its BIC is lower by more than INDISTINCT.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.discovery._judgement import about_trends, rms
from hysim.discovery._refinement import POLISH, AnyExponent, Candidate, FreeRun, Samples, Terms, Work, bic_of, shifts
from hysim.discovery._selection import (
    ALIKE,
    INDISTINCT,
    MOST_WORK,
    PATH_SHARE,
    Search,
    Start,
    gap,
    preferred,
    pruned,
    thinned,
    turning,
)
from hysim.discovery._slopes import FORMS, Feature, Slopes, inclusion, ridge, slopes, sparse_path
from hysim.laws.differential.terms import Term, symmetric
from hysim.records import Record

LINE = Terms((Term(False, 0, 0),))
_FINALISTS = 6
_RESTARTS = 4
_HOPELESS = 2.0  # times the rmse that is enough: the descent of a large law may end so far above its least rmse
_SAME = 1e-6  # relative difference of the cost within which two optima are the same
_SPREAD = 0.3  # of a random restart, in units of what each term contributes over the span of the input
_HELD_OUT = 3  # every third sample decides between the forms of the slope
_ENSEMBLE = 50
_ENSEMBLE_ROWS = 500
_FEEDTHROUGHS = np.linspace(-1.0, 2.0, 46)  # of the slope of the chord from end to end
_OFFSETS = np.linspace(0.05, 0.95, 10)  # of the range of z
_KEPT = 3
_EXPONENTS = np.geomspace(0.4, 6.0, 16)
_RIDGES = (1e-9, 1e-4, 1e-2)


@dataclass(frozen=True)
class Library:
    """Terms of laws; whether these have an offset, and a `feedthrough`: "no", "may" or "must".

    `letter` is "y" where the memory is the output, else "z"; `rests` are the values of `Terms.rest` to try.
    """

    terms: tuple[Term, ...]
    letter: str
    feedthrough: str = "no"
    offset: bool = False
    rests: tuple[bool, ...] = (False,)

    def structure(self, terms: Sequence[Term]) -> Terms:
        return Terms(tuple(terms), self.feedthrough != "no", self.offset, all(self.rests))


@dataclass(frozen=True)
class Options:
    """Signs of coefficients, arguments of `discover`, the rmse that is `enough`, and where to `report` progress."""

    signs: Mapping[Term, int] = field(default_factory=dict)
    optimizer: str = "STLSQ"
    derivative: str = "auto"
    seed: int = 0
    enough: Callable[[], float] | None = None
    report: Callable[[float], None] = lambda share: None


@dataclass(frozen=True)
class Outcome:
    """Law of one library and its search: `is_short` on the optimizer's path alone, `is_cut` at the limit of work."""

    library: Library
    candidate: Candidate[Terms]
    search: Search
    start: Start
    slopes: Slopes
    path: list[tuple[float, Terms]]
    is_short: bool = False
    is_cut: bool = False

    @property
    def searched(self) -> Candidate[Terms]:
        """The law as it is refined on the samples of the search, from its numbers on all samples."""
        free_run = self.search.free_run
        if free_run.n_samples == self.candidate.residual.size:
            return self.candidate
        return free_run.refine(self.candidate.structure, self.candidate.unknowns[np.newaxis]) or self.candidate

    @property
    def unstable(self) -> bool:
        lines = (LINE, LINE._replace(rest=True))
        return all(candidate is None for structure, candidate in self.search.tried.items() if structure not in lines)

    @property
    def threshold(self) -> float:
        """Largest threshold whose structure still has all terms of the law; nan if no structure has them."""
        terms = set(self.candidate.structure.terms)
        return max((t for t, structure in self.path if terms <= set(structure.terms)), default=math.nan)

    def inclusion(self, seed: int) -> dict[str, float]:
        """Share of an ensemble of sparse regressions that keeps each term, where the path is as sparse as the law."""
        regression = self.start.regression
        stride = max(1, -(-len(regression.slope) // _ENSEMBLE_ROWS))
        n_terms = len(self.candidate.structure.terms)
        threshold = max((t for t, structure in self.path if len(structure.terms) >= n_terms), default=0.0)
        shares = inclusion(
            regression.features[::stride], regression.slope[::stride], threshold, n_models=_ENSEMBLE, seed=seed
        )
        names = (term.named(self.library.letter) for term in regression.terms)
        return dict(zip(names, shares.tolist(), strict=True))


def searched(
    records: Sequence[Record],
    library: Library,
    options: Options,
    *,
    best: float = math.inf,
    masks: Sequence[Samples] | None = None,
) -> Outcome | None:
    """The best law of a library; None if no law can come near the BIC `best`.

    Only outputs in the `masks`, (n_samples,) for each record, are used. The search is short if no law on the
    optimizer's path, which has the largest ones, comes near an rmse that is enough.
    """
    if (n := sum(map(len, records))) <= len(library.terms):
        raise ValueError(f"{len(library.terms)} terms and y0 cannot be estimated from {n} samples: lower the degree")
    free_run = FreeRun(tuple(records), None if masks is None else tuple(masks), options.signs, Work(MOST_WORK))
    thin = thinned(free_run)
    optimizer, form = options.optimizer, options.derivative
    form = _better_form(thin.visible, library, optimizer) if form == "auto" else form
    rows = slopes(free_run.visible, form)
    starts = shifted(rows, library.terms, feedthrough=library.feedthrough != "no", offset=library.offset)
    required = frozenset({"feedthrough"} if library.feedthrough == "must" else ())
    search = Search(thin, starts, required, library.rests, report=options.report)
    for start in starts:
        search.refine(library.structure(start.regression.terms))
    if not search.could_win(1, best):
        return None
    search.refine(LINE._replace(rest=all(library.rests)), thin.line)
    for start in starts:
        for _, structure in _path(start, library, optimizer):
            if thin.work.share < PATH_SHARE or not search.candidates:
                search.refine(structure)
    if not search.candidates:
        raise ValueError(
            f"every law that was tried diverges on these records, whose output moves by {free_run.stroke:.3g} about "
            f"{float(records[0].y[0]):.3g}: check the units, or subtract the offset"
        )
    is_short = options.enough is not None and not _least_rmse(search) <= _HOPELESS * options.enough()
    is_cut = not is_short and not search.explore(library.structure(starts[0].regression.terms))
    chosen = _on_all_samples(free_run, search, library, options.seed, restarts=0 if is_short or is_cut else _RESTARTS)
    feedthrough, offset = shifts(chosen.structure, chosen.unknowns[np.newaxis])
    place = float(feedthrough[0]), float(offset[0])
    start = Start(rows.regression(library.terms, *place), *place)
    return Outcome(library, chosen, search, start, rows, _path(start, library, optimizer), is_short, is_cut)


def _least_rmse(search: Search) -> float:
    """Smallest rmse of the laws about a slow trend of each record [unit of y], as the judgement takes it."""
    free_run = search.free_run
    errors = (rms(about_trends(candidate.residual, free_run.visible)) for candidate in search.candidates)
    return min(errors, default=math.inf) * free_run.stroke


def _path(start: Start, library: Library, optimizer: str) -> list[tuple[float, Terms]]:
    regression = start.regression
    path = sparse_path(regression.features, regression.slope, optimizer)
    return [(threshold, library.structure(regression.included(coefficients))) for threshold, coefficients in path]


def _better_form(records: Sequence[Record], library: Library, optimizer: str) -> str:
    free_run, errors, training = FreeRun(tuple(records)), {}, []
    for record in records:
        included = (np.arange(len(record)) % _HELD_OUT != 1) | turning(record.u)
        training.append(Record(u=record.u[included], y=record.y[included]))
    held_out = np.concatenate([np.arange(len(record)) % _HELD_OUT == 1 for record in records])
    for form in FORMS:
        try:
            rows = slopes(training, form)
        except ValueError:
            continue
        starts = shifted(rows, library.terms, feedthrough=library.feedthrough != "no", offset=library.offset)
        runs = [
            free_run.residuals(structure, start.unknowns(structure, free_run))[:, held_out]
            for start in starts[:2]  # the output itself, and the best place of the scan
            for _, structure in _path(start, library, optimizer)
        ]
        errors[form] = min((float(np.mean(run**2, axis=1).min()) for run in runs), default=math.inf)
    return min(errors, key=lambda form: errors[form], default="smoothed")


def _on_all_samples(free_run: FreeRun, search: Search, library: Library, seed: int, restarts: int) -> Candidate[Terms]:
    """Steps 4 and 5 of the selection on all samples, and the best of descending again from random starts."""
    finalists = search.followed
    if free_run.n_samples > search.free_run.n_samples:
        shortest = preferred(finalists, library.letter)
        few = {c.structure: c.unknowns for c in (shortest, *finalists[:_FINALISTS])}
        refined = [free_run.refine(structure, unknowns[np.newaxis]) for structure, unknowns in few.items()]
        finalists = [c for c in refined if c is not None] or finalists
    chosen = preferred(finalists, library.letter)
    restarted = _restarted(search.free_run, search.tried[chosen.structure] or chosen, seed, restarts)
    starts = np.stack([chosen.unknowns, restarted.unknowns])
    polished = free_run.refine(chosen.structure, starts, tolerance=POLISH) or chosen
    return pruned(free_run, polished, search.required, POLISH)


def _restarted(free_run: FreeRun, chosen: Candidate[Terms], seed: int, restarts: int) -> Candidate[Terms]:
    random = np.random.default_rng(seed)
    spread = _SPREAD * free_run.units(chosen.structure)
    best = chosen
    for _ in range(restarts):
        start = chosen.unknowns + spread * random.standard_normal(len(spread))
        refined = free_run.refine(chosen.structure, start[np.newaxis], hopeless=best.cost)
        if refined is not None and refined.cost < best.cost * (1.0 - _SAME):
            best = refined
    return best


def shifted(slopes: Slopes, terms: tuple[Term, ...], *, feedthrough: bool, offset: bool) -> tuple[Start, ...]:
    """Regressions to begin at: that of the output itself, and those at the best places of the scan."""
    trial = symmetric(terms, "odd") or terms  # about the origin of z a law is odd, or nearly
    chord = max((np.copysign(np.ptp(r.y) / np.ptp(r.u), np.cov(r.u, r.y)[0, 1]) for r in slopes.rows), key=abs)
    places = []
    for slope in [0.0, *(chord * _FEEDTHROUGHS).tolist()] if feedthrough else [0.0]:
        memory = np.concatenate([rows.y - slope * rows.u for rows in slopes.rows])
        levels = (memory.min() + (memory.max() - memory.min()) * _OFFSETS).tolist() if offset else []
        places += [(slopes.misfit(trial, slope, level), slope, level) for level in (0.0, *levels)]
    chosen = [(0.0, 0.0)] if feedthrough or offset else []
    chosen += [(slope, level) for _, slope, level in sorted(places)[:_KEPT]]
    return tuple(Start(slopes.regression(terms, *place), *place) for place in dict.fromkeys(chosen))


def or_any_exponent(
    free_run: FreeRun, of_memory: Outcome, chosen: Outcome
) -> Candidate[Terms] | Candidate[AnyExponent]:
    """The chosen law, or the Bouc-Wen law of any exponent where its BIC is lower; `of_memory` is the outcome for z."""
    thin, best = of_memory.search.free_run, chosen.searched
    if chosen.candidate.cost < free_run.n_samples * ALIKE**2:
        return chosen.candidate
    library = of_memory.library
    feedthroughs = {"no": (False,), "may": (True, False), "must": (True,)}[library.feedthrough]
    offsets = (True, False) if library.offset else (False,)
    largest, *others = itertools.starmap(AnyExponent, itertools.product(feedthroughs, offsets, library.rests))
    candidates = [_refined(thin, of_memory, largest)]
    least = math.inf if candidates[0] is None else candidates[0].cost
    smallest = [largest, *others][-1]
    fewest = smallest.size + (0 if True in library.rests else len(thin.records))
    if not bic_of(least, thin.n_samples, fewest) < best.bic - INDISTINCT:
        return chosen.candidate
    candidates += [_refined(thin, of_memory, structure) for structure in others]
    sound = [candidate for candidate in candidates if candidate is not None and candidate.settles()]
    lowest = min(sound, key=lambda candidate: candidate.bic, default=None)
    if lowest is None or lowest.bic >= best.bic - INDISTINCT or gap(best, lowest) < ALIKE:
        return chosen.candidate
    return free_run.refine(lowest.structure, lowest.unknowns[np.newaxis], tolerance=POLISH) or chosen.candidate


def _refined(free_run: FreeRun, of_memory: Outcome, structure: AnyExponent) -> Candidate[AnyExponent] | None:
    starts = []
    for start in of_memory.search.starts:
        for n in _EXPONENTS.tolist():
            columns, target = of_memory.slopes.equations(_features(n), start.feedthrough, start.offset)
            ends = [n, *start.shift(structure), *free_run.measured_starts]
            starts += [[*_ridge(columns, target, weight), *ends] for weight in _RIDGES]
    return free_run.refine(structure, np.array(starts))


def _features(n: float) -> Feature:
    def features(u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
        power = np.abs(z) ** n
        return np.stack([direction, np.copysign(power, z), direction * power], axis=1)

    return features


def _ridge(columns: FloatArray, target: FloatArray, weight: float) -> list[float]:
    sizes = np.sqrt(np.mean(columns**2, axis=0))
    sizes[sizes == 0.0] = 1.0
    return [float(value) for value in ridge(columns / sizes, target, weight) / sizes]
