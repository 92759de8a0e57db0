"""One library on some records: from slopes to refined structures, and from the optimizer's path to one law.

**Shifts.** The slope of z = y - feedthrough u - offset is linear in the coefficients of its law, not in the two
shifts. These are scanned, and the coefficients solved for at each (variable projection). The left side loses what the
term u' gains by a feedthrough, so that misfits are comparable. The free runs begin at the best few places.

**Any exponent.** A Bouc-Wen law whose exponent is no whole number has terms that are in no finite library,

    z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n.

Its exponent is scanned; from the best regressions on the three terms the free run is refined, n with the other numbers.
The law is taken where its BIC is lower by more than INDISTINCT.

**Which structure.** Sparse regression of slopes orders the terms, but on short, noisy or quantised records features
such as u^2, u y and y^2 are nearly the same. So the path is where the search begins:

1. The law of all terms and every structure on the threshold path are refined by simulation error.
2. About the best of these the free run is linearised in all numbers of the library, and all smaller structures of that
   linear problem are solved, with free memory and at rest. The MET ones of lowest BIC are refined. This is
   repeated about the new best ones, at most ROUNDS times.
3. The best structures are refined both with their memory at zero at the first sample and with a free one.
4. Laws without a steady loop under a cyclic input are out. Structures within INDISTINCT of the lowest BIC are equally
   good (Kass and Raftery 1995), and so are smaller ones whose free runs differ by less than ALIKE strokes in rms. Among
   them the one of fewest numbers is taken, then a plain one, then the lowest BIC.
5. Numbers within SIGNIFICANT standard errors of zero are taken out, the least certain first, as long as BIC does not
   rise by more than INDISTINCT.

A structure in u and y is *plain* if it has, with each monomial, all that divide it: its form does not depend on the
zeros of u and y. A structure in z is plain if it is a Bouc-Wen law. Long records are searched on about SEARCHED of
their samples, the reversals among them; the best structures are then refined on all samples, and step 4 taken again.

**The best subsets** of the columns of a linear least-squares problem are found by sweeping columns out:

    minimise ||r + J (x' - x)||^2 over x' that are zero where a column is left out

With C = (J^T J)^-1 and the optimum of all columns, leaving out column j costs x_j^2 / C_jj, moves the others by -C_j
x_j / C_jj, and turns C into C - C_j C_j^T / C_jj. The subsets of each size follow from those of one more column; of
each size the `width` cheapest are followed, which with WIDTH are all up to 12 columns. A chain of sweeps adds small
positive costs, so that nothing cancels where the residual is rounding. Source: G. M. Furnival and R. W. Wilson,
Regressions by leaps and bounds, Technometrics 16 (1974) 499.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.discovery._judgement import about_trends
from hysim.discovery._refinement import POLISH, Candidate, FreeRun, Samples, Structure, Work, shifts
from hysim.discovery._slopes import FORMS, Regression, Slopes, inclusion, ridge, slopes, turning
from hysim.laws.differential.terms import Term, bouc_wen_exponent, bouc_wen_terms, symmetric
from hysim.metrics.criteria import rms_of_known
from hysim.records import Record

WIDTH = 924  # the subsets of 6 of 12 columns
_RIDGE = 1e-12  # on steps of columns of unit size: sweeps stay exact to 1e-4 where columns depend on each other

_LEAST = 0.5  # C of columns of unit size has diagonals of 1 and more, but for rounding


class Subsets(NamedTuple):
    """Subsets of one size: columns included (n_subsets, n), optima (n_subsets, n), zero elsewhere, and costs."""

    included: npt.NDArray[np.bool_]
    x: FloatArray
    cost: FloatArray


def best_subsets(
    jacobian: FloatArray, residual: FloatArray, x: FloatArray, removable: npt.NDArray[np.bool_], *, width: int = WIDTH
) -> Iterator[Subsets]:
    """The `width` best subsets of each size, from all columns down to those that are not `removable` (n,).

    `jacobian` (n_samples, n) and `residual` (n_samples,) are those at `x` (n,).
    """
    sizes = np.linalg.norm(jacobian, axis=0)
    sizes[sizes == 0.0] = 1.0
    ridge = np.sqrt(_RIDGE) * np.eye(x.size)
    basis, triangle = np.linalg.qr(np.vstack([jacobian / sizes, ridge]))
    root = np.linalg.solve(triangle, np.eye(x.size))
    C = root @ root.T
    step = -root @ (basis[: residual.size].T @ residual)
    rest = residual + jacobian @ (step / sizes)
    included, best = np.ones((1, x.size), dtype=bool), (x * sizes + step)[np.newaxis]
    cost, C = np.array([float(rest @ rest)]), C[np.newaxis]
    while True:
        yield Subsets(included, best / sizes, cost)
        diagonal = np.maximum(np.diagonal(C, axis1=1, axis2=2), _LEAST)
        losses = np.where(included & removable, best**2 / diagonal, np.inf)
        parents, columns = _cheapest(included, cost[:, np.newaxis] + losses, width)
        if not parents.size:
            return
        here, rows = np.arange(parents.size), C[parents, columns]
        pivot = diagonal[parents, columns][:, np.newaxis]
        cost = cost[parents] + losses[parents, columns]
        best = best[parents] - rows * (best[parents, columns][:, np.newaxis] / pivot)
        C = C[parents] - rows[:, :, np.newaxis] * (rows / pivot)[:, np.newaxis, :]
        included = included[parents]
        included[here, columns] = False
        best[~included] = 0.0
        C[here, columns], C[here, :, columns] = 0.0, 0.0


def _cheapest(
    included: npt.NDArray[np.bool_], costs: FloatArray, width: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Parents and columns whose removal leaves the `width` cheapest different subsets, cheapest first."""
    parents, columns = np.nonzero(np.isfinite(costs))
    codes = (1 << np.arange(included.shape[1]))[::-1]
    subsets = included[parents] @ codes - codes[columns]
    order = np.lexsort((subsets, costs[parents, columns]))
    first = np.sort(np.unique(subsets[order], return_index=True)[1])[:width]
    return parents[order][first], columns[order][first]


MET = 24  # this one and those below without a reason are chosen by hand
ROUNDS = 6
SEARCHED = 2000
# "Not worth more than a bare mention" by Kass and Raftery. It is smaller than the 10 of `hysim.identification`, since
# here the difference only decides which of several nearly equal laws is the simplest.
INDISTINCT = 2.0
ALIKE = 1e-4
SIGNIFICANT = 2.0
HOPELESS = 20.0  # BIC above the best, beyond which a structure is not followed further
_POINTS = 2  # candidates about which one round linearises
_LIKELY = 8.0  # predicted BIC above the lowest one, beyond which a structure is not refined
_TWINS = 6
MOST_WORK = 2.5e5  # slopes for each sample, of one library: smooth laws take a tenth to a half of it
PATH_SHARE, SEARCH_SHARE = 0.45, 0.7  # of that, after which no further structure is tried; the rest is for last digits
_RIDGES = tuple(10.0**power for power in range(-9, 1))
_EXPECTED = 40.0  # structures of one search, of which there are 30 to 100


class Start(NamedTuple):
    """A regression of z = y - feedthrough u - offset, where laws begin."""

    regression: Regression
    feedthrough: float = 0.0
    offset: float = 0.0

    def shift(self, structure: Structure) -> list[float]:
        return [self.feedthrough] * structure.feedthrough + [self.offset] * structure.offset

    def unknowns(self, structure: Structure, free_run: FreeRun) -> FloatArray:
        """Starts (n_ridges, size + n_records) from ridge regressions of increasing weight."""
        ends = [*self.shift(structure), *free_run.measured_starts]
        return np.array([[*self.regression.ridge(structure.terms, weight), *ends] for weight in _RIDGES])


class Prediction(NamedTuple):
    """A structure, its BIC and its unknowns as a linearised free run predicts them."""

    bic: float
    structure: Structure
    unknowns: FloatArray


def thinning(record: Record, most: int) -> npt.NDArray[np.intp]:
    """Every m-th sample of a record, its last one and its reversals, about `most` together, and 2 `most` at most."""
    stride = -(-len(record) // most)
    included = np.arange(len(record)) % stride == 0
    included[-1] = True
    return np.flatnonzero(included | turning(record.u))[: 2 * most]


def thinned(free_run: FreeRun) -> FreeRun:
    samples = [thinning(record, SEARCHED // len(free_run.records)) for record in free_run.records]
    records = tuple(Record(u=r.u[k], y=r.y[k]) for r, k in zip(free_run.records, samples, strict=True))
    masks = free_run.masks and tuple(mask[included] for mask, included in zip(free_run.masks, samples, strict=True))
    return FreeRun(records, masks, free_run.signs, free_run.work)


def is_complete(terms: Iterable[Term]) -> bool:
    present = set(terms)
    return all(term.divisors() <= present for term in present)


def is_plain(structure: Structure, letter: str) -> bool:
    """Whether a structure in u and y is complete, or one in z a Bouc-Wen law."""
    return is_complete(structure.terms) if letter == "y" else bouc_wen_exponent(structure.terms) is not None


@dataclass(frozen=True)
class Search:
    """Structures tried on some records, with their refinements: None where every free run diverged.

    `required` are numbers that no structure may lose; `rests` the values of `Structure.rest` to try.
    `report` is called with the share that is done, about, after each structure.
    """

    free_run: FreeRun
    starts: tuple[Start, ...]
    required: frozenset[str] = frozenset()
    rests: tuple[bool, ...] = (False,)
    tried: dict[Structure, Candidate | None] = field(default_factory=dict)
    report: Callable[[float], None] = lambda share: None

    def refine(self, structure: Structure, *unknowns: FloatArray, race: bool = False) -> Candidate | None:
        """Refine a structure once, from its regressions and these starts; in a `race` it may be given up."""
        if structure not in self.tried:
            known = [start for start in self.starts if set(structure.terms) <= set(start.regression.terms)]
            regressed = [start.unknowns(structure, self.free_run) for start in known]
            own = np.array(unknowns).reshape(-1, structure.size + len(self.free_run.records))
            starts, hopeless = np.concatenate([own, *regressed]), self._hopeless(structure) if race else math.inf
            self.tried[structure] = self.free_run.refine(structure, starts, hopeless=hopeless)
            self.report(max(1.0 - math.exp(-len(self.tried) / _EXPECTED), min(1.0, self.free_run.work.share)))
        return self.tried[structure]

    @property
    def candidates(self) -> list[Candidate]:
        return sorted((c for c in self.tried.values() if c is not None), key=lambda c: (c.bic, c.structure))

    def sound(self, most: int = 1) -> list[Candidate]:
        """The best candidates that come to a steady loop; the best of all if no candidate does."""
        refined = self.candidates
        return list(itertools.islice((each for each in refined if each.settles()), most)) or refined[:most]

    @property
    def followed(self) -> list[Candidate]:
        best = self.sound()[0]
        near = [c for c in self.candidates if c.bic < best.bic + HOPELESS or gap(c, best) < ALIKE]
        return [candidate for candidate in near if candidate.settles()] or near

    def _hopeless(self, structure: Structure) -> float:
        sound, n = self.sound(), self.free_run.n_samples
        if not sound:
            return math.inf
        best, d = sound[0], structure.size + (0 if structure.rest else len(self.free_run.records))
        return max(self.free_run.cost_of(best.bic + HOPELESS, d), best.cost + n * ALIKE**2)

    def explore(self, largest: Structure) -> bool:
        """Steps 2 and 3 about structures inside `largest`; whether all of them were tried before the work was done."""
        done: set[Structure] = set()
        for _ in range(ROUNDS):
            points = [c for c in self.sound(_POINTS) if c.structure not in done]
            points += [c for c in [self.tried.get(largest)] if c is not None and not done]
            if not points:
                break
            done |= {candidate.structure for candidate in points}
            for each in [each for candidate in points for each in self.predicted(candidate, largest)]:
                if self.free_run.work.share >= SEARCH_SHARE:
                    return False
                self.refine(each.structure, each.unknowns, race=True)
        for candidate in self.sound(_TWINS):
            for rest in self.rests:
                self.refine(candidate.structure._replace(rest=rest), candidate.unknowns)
        return True

    def predicted(self, candidate: Candidate, largest: Structure) -> list[Prediction]:
        """The MET structures inside `largest` of lowest BIC, in the free run linearised about a candidate."""
        likely = [each for rest in self.rests for each in self._linearly(candidate, largest, rest)]
        lowest = min((each.bic for each in likely), default=0.0)
        return sorted((e for e in likely if e.bic < lowest + _LIKELY), key=lambda e: (e.bic, e.structure))[:MET]

    def could_win(self, size: int, best: float = math.inf) -> bool:
        """Whether a structure of `size` numbers would be preferred if it ran as well as the best of any size."""
        sound = self.sound()
        least = min((candidate.cost for candidate in self.candidates), default=0.0)
        starts = 0 if True in self.rests else len(self.free_run.records)
        bound = self.free_run.bic_of(least, size + starts)
        return not sound or bound <= min(sound[0].bic, best) + INDISTINCT

    def _linearly(self, candidate: Candidate, largest: Structure, rest: bool) -> Iterator[Prediction]:
        """Predictions with or without rest; the unknowns are the numbers of `largest` and each record's first z."""
        free_run, size = self.free_run, largest.size
        u0 = np.array([record.u[0] for record in free_run.records])
        values = dict(zip(candidate.structure.names, candidate.unknowns.tolist(), strict=False))
        starts = candidate.unknowns[candidate.structure.size :]
        x = np.concatenate([[values.get(name, 0.0) for name in largest.names], starts])
        residual, jacobian = free_run.linearised(largest._replace(rest=False), x)
        jacobian /= free_run.units(largest)
        columns = {"feedthrough": u0, "offset": np.ones(u0.size)}  # change of the first outputs while the memory stays
        shift = np.stack([columns.get(str(name), np.zeros(u0.size)) for name in largest.names], axis=1)
        jacobian[:, :size] += jacobian[:, size:] @ shift
        x[size:] -= shift @ x[:size]
        if rest:
            residual = residual - jacobian[:, size:] @ x[size:]
            jacobian, x = jacobian[:, :size], x[:size]
        removable = np.arange(x.size) < size
        if "feedthrough" in self.required:
            removable[len(largest.terms)] = False
        for subsets in best_subsets(jacobian, residual, x, removable):
            for k in self._worth_refining(subsets, largest):
                included, unknowns = subsets.included[k], subsets.x[k]
                bic = free_run.bic_of(float(subsets.cost[k]), int(included.sum()))
                starts = (np.zeros(u0.size) if rest else unknowns[size:]) + shift @ unknowns[:size]
                numbers = unknowns[:size][included[:size]]
                structure = largest.of(list(itertools.compress(largest.names, included)))._replace(rest=rest)
                yield Prediction(bic, structure, np.concatenate([numbers, starts]))

    def _worth_refining(self, subsets: Subsets, largest: Structure) -> list[int]:
        n_terms = len(largest.terms)
        wanted = np.array([self.free_run.signs.get(term, 0) for term in largest.terms])
        allowed = (subsets.x[:, :n_terms] * wanted >= 0.0).all(axis=1) & subsets.included[:, :n_terms].any(axis=1)
        return [int(k) for k in np.flatnonzero(allowed)[:MET]]


def preferred(candidates: Sequence[Candidate], letter: str) -> Candidate:
    best = min(candidates, key=lambda candidate: candidate.bic)
    smaller = [c for c in candidates if c.n_parameters < best.n_parameters and gap(c, best) < ALIKE]
    rivals = [*(c for c in candidates if c.bic <= best.bic + INDISTINCT), *smaller]
    return min(rivals, key=lambda c: (c.n_parameters, not is_plain(c.structure, letter), c.bic))


def pruned(free_run: FreeRun, candidate: Candidate, required: frozenset[str]) -> Candidate:
    structure = candidate.structure
    for k in np.argsort(candidate.significance).tolist():
        if candidate.significance[k] >= SIGNIFICANT:
            break
        smaller = structure.of(structure.names[:k] + structure.names[k + 1 :])
        if not smaller.terms or ("feedthrough" in required and not smaller.feedthrough):
            continue
        start = np.delete(candidate.unknowns, k)
        worst = free_run.cost_of(candidate.bic + INDISTINCT, candidate.n_parameters - 1)
        refined = free_run.refine(smaller, start[np.newaxis], tolerance=POLISH, hopeless=worst)
        if refined and refined.bic <= candidate.bic + INDISTINCT and refined.settles() >= candidate.settles():
            return pruned(free_run, refined, required)
    return candidate


def gap(candidate: Candidate, best: Candidate) -> float:
    """Rms difference in strokes between two free runs."""
    return math.sqrt(max(candidate.cost - best.cost, 0.0) / best.residual.size)


LINE = Structure((Term(False, 0, 0),))
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
_WEIGHTS = (1e-9, 1e-4, 1e-2)


@dataclass(frozen=True)
class Library:
    """Terms of laws; whether these have an offset, and a `feedthrough`: "no", "may" or "must".

    `letter` is "y" where the memory is the output, else "z"; `rests` are the values of `Structure.rest` to try.
    """

    terms: tuple[Term, ...]
    letter: str
    feedthrough: str = "no"
    offset: bool = False
    rests: tuple[bool, ...] = (False,)

    def structure(self, terms: Sequence[Term]) -> Structure:
        return Structure(tuple(terms), self.feedthrough != "no", self.offset, all(self.rests))


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
    candidate: Candidate
    search: Search
    start: Start
    slopes: Slopes
    path: list[tuple[float, Structure]]
    is_short: bool = False
    is_cut: bool = False

    @property
    def searched(self) -> Candidate:
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
        stride = max(1, -(-len(regression.target) // _ENSEMBLE_ROWS))
        n_terms = len(self.candidate.structure.terms)
        threshold = max((t for t, structure in self.path if len(structure.terms) >= n_terms), default=0.0)
        features, slope = regression.features[::stride], regression.target[::stride]
        shares = inclusion(features, slope, threshold, n_models=_ENSEMBLE, seed=seed)
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
        output = f"whose output moves by {free_run.stroke:.3g} about {float(records[0].y[0]):.3g}"
        advice = "check the units, or subtract the offset"
        raise ValueError(f"every law that was tried diverges on these records, {output}: {advice}")
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
    errors = (rms_of_known(*about_trends(candidate.residual, free_run.visible)) for candidate in search.candidates)
    return min(errors, default=math.inf) * free_run.stroke


def _path(start: Start, library: Library, optimizer: str) -> list[tuple[float, Structure]]:
    return [(threshold, library.structure(terms)) for threshold, terms in start.regression.path(optimizer)]


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


def _on_all_samples(free_run: FreeRun, search: Search, library: Library, seed: int, restarts: int) -> Candidate:
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
    return pruned(free_run, polished, search.required)


def _restarted(free_run: FreeRun, chosen: Candidate, seed: int, restarts: int) -> Candidate:
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
    """Regressions to begin at: that of the output itself, from a level in its range, and the best ones of the scan."""
    trial = symmetric(terms, "odd") or terms  # about the origin of z a law is odd, or nearly
    chord = max((np.copysign(np.ptp(r.y) / np.ptp(r.u), np.cov(r.u, r.y)[0, 1]) for r in slopes.rows), key=abs)
    outputs = np.concatenate([rows.y for rows in slopes.rows])
    origin = float(np.clip(0.0, outputs.min(), outputs.max())) if offset else 0.0  # far outside, all z have one sign
    places = []
    for slope in [0.0, *(chord * _FEEDTHROUGHS).tolist()] if feedthrough else [0.0]:
        memory = np.concatenate([rows.y - slope * rows.u for rows in slopes.rows])
        levels = (memory.min() + (memory.max() - memory.min()) * _OFFSETS).tolist() if offset else []
        places += [(slopes.misfit(trial, slope, level), slope, level) for level in (origin, *levels)]
    chosen = [(0.0, origin)] if feedthrough or offset else []
    chosen += [(slope, level) for _, slope, level in sorted(places)[:_KEPT]]
    return tuple(Start(slopes.regression(terms, *place), *place) for place in dict.fromkeys(chosen))


def or_any_exponent(free_run: FreeRun, of_memory: Outcome, chosen: Outcome) -> Candidate:
    """The chosen law, or the Bouc-Wen law of any exponent where its BIC is lower; `of_memory` is the outcome for z."""
    thin, best = of_memory.search.free_run, chosen.searched
    if chosen.candidate.cost < free_run.n_samples * ALIKE**2:
        return chosen.candidate
    library = of_memory.library
    feedthroughs = {"no": (False,), "may": (True, False), "must": (True,)}[library.feedthrough]
    offsets = (True, False) if library.offset else (False,)
    any_power = partial(Structure, bouc_wen_terms(1.0), any_exponent=True)
    largest, *others = itertools.starmap(any_power, itertools.product(feedthroughs, offsets, library.rests))
    candidates = [_refined(thin, of_memory, largest)]
    least = math.inf if candidates[0] is None else candidates[0].cost
    smallest = [largest, *others][-1]
    fewest = smallest.size + (0 if True in library.rests else len(thin.records))
    if not thin.bic_of(least, fewest) < best.bic - INDISTINCT:
        return chosen.candidate
    candidates += [_refined(thin, of_memory, structure) for structure in others]
    sound = [candidate for candidate in candidates if candidate is not None and candidate.settles()]
    lowest = min(sound, key=lambda candidate: candidate.bic, default=None)
    if lowest is None or lowest.bic >= best.bic - INDISTINCT or gap(best, lowest) < ALIKE:
        return chosen.candidate
    return free_run.refine(lowest.structure, lowest.unknowns[np.newaxis], tolerance=POLISH) or chosen.candidate


def _refined(free_run: FreeRun, of_memory: Outcome, structure: Structure) -> Candidate | None:
    starts = []
    for start in of_memory.search.starts:
        for n in _EXPONENTS.tolist():
            columns, target = of_memory.slopes.equations(partial(_features, n), start.feedthrough, start.offset)
            ends = [n, *start.shift(structure), *free_run.measured_starts]
            starts += [[*_ridge(columns, target, weight), *ends] for weight in _WEIGHTS]
    return free_run.refine(structure, np.array(starts))


def _features(n: float, u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
    power = np.abs(z) ** n
    return np.stack([direction, np.copysign(power, z), direction * power], axis=1)


def _ridge(columns: FloatArray, target: FloatArray, weight: float) -> list[float]:
    sizes = np.sqrt(np.mean(columns**2, axis=0))
    sizes[sizes == 0.0] = 1.0
    return [float(value) for value in ridge(columns / sizes, target, weight) / sizes]
