"""Laws before their numbers are known: terms of a library, or a Bouc-Wen law of any exponent.

A structure has `size` numbers, those of the memory first, then a feedthrough and an offset where it has them:

    y = offset + feedthrough u + z

Each record has its own initial memory, unless the structure is at `rest`: z is zero at the first sample, so that
y0 = offset + feedthrough u0 is no free number.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from hysim._frozen import FloatArray
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.duhem_runs import free_runs
from hysim.laws.differential.terms import Term, coefficient_units
from hysim.records import Record

Bounds = tuple[FloatArray, FloatArray]

_MOST_STEPS = 500  # of the series from one sample to the next: laws that need more are steps, and take most of the time


class Terms(NamedTuple):
    """The law of some terms of a library."""

    terms: tuple[Term, ...]
    feedthrough: bool = False
    offset: bool = False
    rest: bool = False

    @property
    def size(self) -> int:
        return len(self.terms) + self.feedthrough + self.offset

    def without(self, k: int) -> Self:
        if k < len(self.terms):
            return self._replace(terms=self.terms[:k] + self.terms[k + 1 :])
        if self.feedthrough and k == len(self.terms):
            return self._replace(feedthrough=False)
        return self._replace(offset=False)

    def units(self, record: Record, stroke: float) -> FloatArray:
        """Changes of the numbers (size,) that move the output by about a stroke."""
        of_terms = coefficient_units(record.u, record.y, self.terms)
        return np.concatenate([of_terms, _shift_units(self, record, stroke)])

    def bounds(self, signs: Mapping[Term, int]) -> Bounds:
        wanted = np.array([signs.get(term, 0) for term in self.terms] + [0] * (self.feedthrough + self.offset))
        return np.where(wanted > 0, 0.0, -np.inf), np.where(wanted < 0, 0.0, np.inf)

    def run(self, u: FloatArray, numbers: FloatArray, y0: FloatArray, bound: float) -> tuple[FloatArray, int]:
        """Outputs (n_sets, n_samples) of numbers (n_sets, size) from y0 (n_sets,), and the terms of series they take.

        A law that diverges is a row of inf.
        """
        feedthrough, offset = shifts(self, numbers)
        coefficients = numbers[:, : len(self.terms)]
        memory = y0 - offset
        runs, work = free_runs(
            self.terms, coefficients, feedthrough, memory, u[np.newaxis], bound, most_steps=_MOST_STEPS
        )
        return runs + offset[:, np.newaxis], work


@dataclass(frozen=True)
class AnyExponent:
    """z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n; its numbers are A, -beta, -gamma and n, then the shifts."""

    feedthrough: bool = False
    offset: bool = False
    rest: bool = False

    LOWEST, HIGHEST = 0.3, 10.0

    @property
    def size(self) -> int:
        return 4 + self.feedthrough + self.offset

    def units(self, record: Record, stroke: float) -> FloatArray:
        span = float(np.ptp(record.u))
        return np.concatenate([[stroke / span, 1.0 / span, 1.0 / span, 1.0], _shift_units(self, record, stroke)])

    def bounds(self, signs: Mapping[Term, int]) -> Bounds:
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        lower[3], upper[3] = self.LOWEST, self.HIGHEST
        return lower, upper

    def run(self, u: FloatArray, numbers: FloatArray, y0: FloatArray, bound: float) -> tuple[FloatArray, int]:
        """As of `Terms`, whose work is not counted: no law of this form takes long."""
        feedthrough, offset = shifts(self, numbers)
        A, dissipative, conservative, n = numbers[:, :4].T
        laws = {"A": A, "beta": -dissipative, "gamma": -conservative, "n": n}
        shift = {"feedthrough": feedthrough, "offset": offset, "z0": y0 - offset - feedthrough * u[0]}
        y = BoucWen.responses({**laws, **shift}, u)
        y[~(np.abs(y) <= bound).all(axis=1)] = np.inf
        return y, 0


Structure = Terms | AnyExponent


def output_at_rest(structure: Structure, numbers: FloatArray, u0: float) -> FloatArray:
    """Outputs (n_sets,) at the input `u0` where the memory is zero, of numbers (n_sets, size)."""
    feedthrough, offset = shifts(structure, numbers)
    return offset + feedthrough * u0


def shifts(structure: Structure, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    zero, first = np.zeros(len(numbers)), structure.size - structure.feedthrough - structure.offset
    feedthrough = numbers[:, first] if structure.feedthrough else zero
    return feedthrough, numbers[:, first + structure.feedthrough] if structure.offset else zero


def _shift_units(structure: Structure, record: Record, stroke: float) -> FloatArray:
    return np.array([stroke / float(np.ptp(record.u))] * structure.feedthrough + [stroke] * structure.offset)
