"""Which structure: from the optimizer's path to one law.

Sparse regression of slopes orders the terms, but on short, noisy or quantised records features such as u^2, u y and
y^2 are nearly one, and the order is rough. So the path is where the search begins:

1. Every structure on the threshold path is refined by simulation error.
2. From the densest to the sparsest, the best WIDTH structures of each size lose one number at a time. A linearised
   free run predicts each loss; the TRIED least costly ones are refined.
3. Of a Duhem library all complete structures are refined, from the smallest up, at most MOST_COMPLETE, until the
   penalty of their size alone rules them out.
4. Laws that come to no steady loop when the input goes on to and fro are out. Structures within INDISTINCT of the
   lowest BIC cannot be told apart by the records ("not worth more than a bare mention", Kass and Raftery 1995), nor
   can smaller ones whose free runs differ by less than ALIKE strokes in rms. Among them a complete one is preferred,
   then the one of fewest numbers, then the lowest BIC.

A structure is *complete* if with each monomial it has all that divide it. The form of such a law does not depend on
where the zeros of u and y are, which are conventions of the instrument; any other is a statement about these zeros
that needs evidence. A law in z = y - feedthrough u - offset makes that statement by its offset.

Long records are searched on about SEARCHED of their samples, the reversals among them: the output of a
rate-independent law at a sample does not depend on the samples between it and the last reversal. The best structures
are then refined on all samples, where step 4 is taken again.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.discovery._library import Regression
from hysim.discovery._refinement import Candidate, FreeRun, information, losses
from hysim.discovery._structures import Terms
from hysim.models.duhem_terms import Term
from hysim.records import Record

WIDTH = 2
TRIED = 2
MOST_COMPLETE = 118  # at degree 2 all of up to 7 terms
SEARCHED = 2000
INDISTINCT = 2.0
ALIKE = 1e-4
HOPELESS = 20.0  # BIC above the best, beyond which a structure is not followed further


class Start(NamedTuple):
    """A regression of z = y - feedthrough u - offset."""

    regression: Regression
    feedthrough: float = 0.0
    offset: float = 0.0


def thinned(record: Record, most: int) -> Record:
    """Every m-th sample of a record, its last one and its reversals, about `most` together.

    A record that has more reversals than that is cut short.
    """
    stride = -(-len(record) // most)
    kept = np.arange(len(record)) % stride == 0
    kept[-1] = True
    samples = np.flatnonzero(kept | turning(record.u))[: 2 * most]
    return Record(u=record.u[samples], y=record.y[samples])


def turning(u: FloatArray) -> npt.NDArray[np.bool_]:
    """Where an input turns, rests or leaves a rest, (n,): a path through these samples keeps its extremes."""
    direction = np.sign(np.diff(u))
    return np.concatenate([[False], direction[1:] != direction[:-1], [False]])


def is_complete(terms: Iterable[Term]) -> bool:
    """Whether all divisors of each term are there, so that the law's form is that at any origin of u and y."""
    present = set(terms)
    return all(term.divisors() <= present for term in present)


@dataclass(frozen=True)
class Search:
    """The structures tried on some records, with their refinements: None where every free run diverged.

    `held` are numbers that no structure may lose: "feedthrough", if the route says that there is one.
    """

    free_run: FreeRun
    starts: tuple[Start, ...]
    held: frozenset[str] = frozenset()
    tried: dict[Terms, Candidate[Terms] | None] = field(default_factory=dict)

    def refine(self, structure: Terms, *unknowns: FloatArray) -> Candidate[Terms] | None:
        """Refine a structure, unless that has been done, from its regressions and the given starts."""
        if structure not in self.tried:
            regressed = [
                self.free_run.regressed(start.regression, structure, start.feedthrough, start.offset)
                for start in self.starts
                if set(structure.terms) <= set(start.regression.terms)
            ]
            given = np.array(unknowns).reshape(-1, structure.size + len(self.free_run.records))
            self.tried[structure] = self.free_run.refine(structure, np.concatenate([given, *regressed]))
        return self.tried[structure]

    @property
    def found(self) -> list[Candidate[Terms]]:
        """The refined structures, lowest BIC first."""
        return sorted((c for c in self.tried.values() if c is not None), key=lambda c: (c.bic, c.structure))

    @property
    def sound(self) -> list[Candidate[Terms]]:
        """Those that come to a steady loop; all, if none does."""
        found = self.found
        return [candidate for candidate in found if candidate.settles] or found

    def followed(self, candidates: Sequence[Candidate[Terms]]) -> list[Candidate[Terms]]:
        """Those of some candidates that are near the best one."""
        best = self.sound[0]
        return [c for c in candidates if c.bic < best.bic + HOPELESS or gap(c, best) < ALIKE]

    def eliminate(self) -> None:
        """Step 2: from the densest structure down, the best of each size lose one number at a time."""
        largest = max((structure.size for structure in self.tried), default=0)
        for size in range(largest, 1, -1):
            for parent in self._best(size):
                ranked = sorted(losses(parent), key=lambda loss: loss.cost)
                for loss in [loss for loss in ranked if self._may_be(loss.structure)][:TRIED]:
                    self.refine(loss.structure, loss.unknowns)

    def enumerate_complete(self, terms: Sequence[Term]) -> None:
        """Step 3: the complete structures, from the smallest up."""
        for each in complete_structures(terms, MOST_COMPLETE):
            if self.could_win(len(each)):
                self.refine(Terms(each))

    def could_win(self, size: int, best: float = math.inf) -> bool:
        """Whether a structure of `size` numbers would be preferred if it ran as well as the best of any size.

        To be preferred its BIC must come near the lowest found, and `best`.
        """
        sound = self.sound
        least = min((candidate.cost for candidate in self.found), default=0.0)
        bound = information(least, self.free_run.n_samples, size + len(self.free_run.records))
        return not sound or bound <= min(sound[0].bic, best) + INDISTINCT

    def _best(self, size: int) -> list[Candidate[Terms]]:
        return [c for c in self.followed(self.found) if c.structure.size == size][:WIDTH]

    def _may_be(self, structure: Terms) -> bool:
        return bool(structure.terms) and (structure.feedthrough or "feedthrough" not in self.held)


def complete_structures(terms: Sequence[Term], most: int) -> list[tuple[Term, ...]]:
    """Complete structures of `terms`, all of one size before any of the next, `most` of them."""
    level: set[frozenset[Term]] = {frozenset()}
    found: list[tuple[Term, ...]] = []
    while level and len(found) < most:
        level = {
            structure | {term}
            for structure in level
            for term in terms
            if term not in structure and term.divisors() <= structure
        }
        found += sorted(tuple(sorted(structure)) for structure in level)
    return found[:most]


def preferred(found: Sequence[Candidate[Terms]], *, complete: bool) -> Candidate[Terms]:
    """Step 4; only of a Duhem library is a complete structure preferred."""
    lowest = min(candidate.bic for candidate in found)
    best = min(found, key=lambda candidate: candidate.bic)
    rivals = [c for c in found if c.bic <= lowest + INDISTINCT or _is_as_good(c, best)]
    return min(rivals, key=lambda c: (complete and not is_complete(c.structure.terms), c.structure.size, c.bic))


def _is_as_good(candidate: Candidate[Terms], best: Candidate[Terms]) -> bool:
    return candidate.structure.size < best.structure.size and gap(candidate, best) < ALIKE


def gap(candidate: Candidate[Any], best: Candidate[Any]) -> float:
    """Rms difference in strokes that the better of two free runs makes up for."""
    return math.sqrt(max(candidate.cost - best.cost, 0.0) / best.residual.size)
