"""Which structure: from the optimizer's path to one law.

Sparse regression of slopes orders the terms, but on short or quantised records features such as u^2, u y
and y^2 are nearly one, and the order is rough. So the path is where the search begins:

1. Every structure on the threshold path is refined by simulation error.
2. From the densest to the sparsest, the best WIDTH structures of each size lose one term at a time. A
   linearised free run predicts each loss; the TRIED least costly ones are refined.
3. All complete structures are refined, from the smallest up, at most MOST_COMPLETE, until the penalty of
   their size alone rules them out.
4. Structures within INDISTINCT of the lowest BIC cannot be told apart by the record ("not worth more than a
   bare mention", Kass and Raftery 1995). Among them a complete one is preferred, then the one of fewest
   terms, then the lowest BIC.

A structure is *complete* if with each monomial it has all that divide it. The form of such a law does
not depend on where the zeros of u and y are, which are conventions of the instrument; any other is a
statement about these zeros that needs evidence.

Long records are searched on about SEARCHED of their samples, the reversals among them: the output of a
rate-independent law at a sample does not depend on the samples between it and the last reversal.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.discovery._library import Regression
from hysim.discovery._refinement import Candidate, FreeRun, information, without
from hysim.models.duhem_terms import Term
from hysim.records import Record

WIDTH = 2
TRIED = 2
MOST_COMPLETE = 118  # at degree 2 all of up to 7 terms
SEARCHED = 2000
INDISTINCT = 2.0
HOPELESS = 20.0  # BIC above the best, beyond which a structure is not followed further

Structure = tuple[Term, ...]


def thinned(record: Record, most: int) -> Record:
    """Every m-th sample of a record, its last one and its reversals, about `most` together."""
    stride = -(-len(record) // most)
    direction = np.sign(np.diff(record.u))
    kept = np.arange(len(record)) % stride == 0
    kept[1:-1] |= direction[1:] != direction[:-1]
    kept[-1] = True
    return Record(u=record.u[kept], y=record.y[kept])


def is_complete(terms: Iterable[Term]) -> bool:
    """Whether all divisors of each term are there, so that the law's form is that at any origin of u and y."""
    present = set(terms)
    return all(term.divisors() <= present for term in present)


@dataclass(frozen=True)
class Search:
    """The structures tried on one record, with their refinements: None where every free run diverged."""

    free_run: FreeRun
    regression: Regression
    tried: dict[Structure, Candidate | None] = field(default_factory=dict)

    def refine(self, terms: Structure, *starts: FloatArray) -> Candidate | None:
        """Refine a structure, unless that has been done, from its regressions and the given starts."""
        if terms not in self.tried:
            regressed = self.free_run.regressed(self.regression, terms)
            self.tried[terms] = self.free_run.refine(terms, np.array([*starts, *regressed]))
        return self.tried[terms]

    @property
    def found(self) -> list[Candidate]:
        """The refined structures, lowest BIC first."""
        return sorted((c for c in self.tried.values() if c is not None), key=lambda c: (c.bic, c.terms))

    def eliminate(self) -> None:
        """Step 2: from the densest structure down, the best of each size lose one term at a time."""
        for size in range(len(self.regression.terms), 1, -1):
            for parent in self._best(size):
                losses = sorted((without(parent, k) for k in range(size)), key=lambda loss: loss.cost)
                for loss in losses[:TRIED]:
                    self.refine(loss.terms, loss.unknowns)

    def enumerate_complete(self, progress: Progress | None = None) -> None:
        """Step 3: the complete structures, from the smallest up."""
        structures = complete_structures(self.regression.terms, MOST_COMPLETE)
        for done, terms in enumerate(structures):
            if self._could_win(len(terms)):
                self.refine(terms)
            if progress is not None:
                progress(done + 1, len(structures))

    def _could_win(self, size: int) -> bool:
        """Whether a structure of `size` terms would be preferred if it ran as well as the best of any size."""
        found = self.found
        least = min((candidate.cost for candidate in found), default=0.0)
        bound = information(least, len(self.free_run.record), size + 1)
        return not found or bound <= found[0].bic + INDISTINCT

    def _best(self, size: int) -> list[Candidate]:
        found = self.found
        return [c for c in found if len(c.terms) == size and c.bic < found[0].bic + HOPELESS][:WIDTH]


def complete_structures(terms: Sequence[Term], most: int) -> list[Structure]:
    """Complete structures of `terms`, all of one size before any of the next, `most` of them."""
    level: set[frozenset[Term]] = {frozenset()}
    found: list[Structure] = []
    while level and len(found) < most:
        level = {
            structure | {term}
            for structure in level
            for term in terms
            if term not in structure and term.divisors() <= structure
        }
        found += sorted(tuple(sorted(structure)) for structure in level)
    return found[:most]


def preferred(found: list[Candidate]) -> Candidate:
    """Step 4, of candidates sorted by BIC."""
    rivals = [candidate for candidate in found if candidate.bic <= found[0].bic + INDISTINCT]
    return min(rivals, key=lambda c: (not is_complete(c.terms), len(c.terms), c.bic))
