"""Refinement by simulation error: the numbers of a structure whose free run is nearest to the records.

    minimise sum over the visible samples of (y_k - y(u; c, feedthrough, offset, y0)_k)^2

Every structure is judged by its free run alone. Records share all numbers but y0; a structure at rest has none.
Unknowns are measured in what they contribute, outputs in strokes. A free run beyond BOUND strokes has diverged.

    BIC = N ln(V + FLOOR^2) + d ln N,    V = mean squared residual in strokes,  d = n_parameters

**Structures** are laws before their numbers are known: terms of a library, or a Bouc-Wen law of any exponent. A
structure has `size` numbers, those of the memory first, then a feedthrough and an offset where it has them:

    y = offset + feedthrough u + z

Each record has its own initial memory, unless the structure is at `rest`: z is zero at the first sample, so that
y0 = offset + feedthrough u0 is no free number.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.identification.marquardt import Schedule, SumOfSquares, descend, differences
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.duhem_runs import free_runs
from hysim.laws.differential.terms import Term, coefficient_units
from hysim.metrics.criteria import information
from hysim.records import Record

Bounds = tuple[FloatArray, FloatArray]

EXPONENTS = (0.3, 10.0)  # lowest and highest n
_MOST_STEPS = 150  # by hand: between two samples; a law that needs more is stiff


Name = Term | str


class Structure(NamedTuple):
    """Terms, and the shifts; with `any_exponent` the terms are those of n = 1, and n comes after their numbers."""

    terms: tuple[Term, ...]
    feedthrough: bool = False
    offset: bool = False
    rest: bool = False
    any_exponent: bool = False

    @property
    def size(self) -> int:
        return len(self.terms) + self.any_exponent + self.feedthrough + self.offset

    @property
    def names(self) -> list[Name]:
        """The terms, then ``"feedthrough"`` and ``"offset"`` where it has them: one name for each number."""
        return [*self.terms, *["feedthrough"] * self.feedthrough, *["offset"] * self.offset]

    def of(self, names: Sequence[Name]) -> Self:
        """The structure of these of its names."""
        terms = tuple(name for name in names if isinstance(name, Term))
        return self._replace(terms=terms, feedthrough="feedthrough" in names, offset="offset" in names)

    def units(self, record: Record, stroke: float) -> FloatArray:
        """Changes of the numbers (size,) that move the output by about a stroke."""
        span = float(np.ptp(record.u))
        of_law = coefficient_units(record.u, record.y, self.terms)
        if self.any_exponent:
            of_law = np.array([stroke / span, 1.0 / span, 1.0 / span, 1.0])
        return np.array([*of_law, *[stroke / span] * self.feedthrough, *[stroke] * self.offset])

    def bounds(self, signs: Mapping[Term, int]) -> Bounds:
        wanted = np.zeros(self.size)
        wanted[: len(self.terms)] = [signs.get(term, 0) for term in self.terms]
        lower, upper = np.where(wanted > 0, 0.0, -np.inf), np.where(wanted < 0, 0.0, np.inf)
        if self.any_exponent:
            lower[len(self.terms)], upper[len(self.terms)] = EXPONENTS
        return lower, upper

    def run(self, u: FloatArray, numbers: FloatArray, y0: FloatArray, bound: float) -> tuple[FloatArray, int]:
        """Outputs (n_sets, n_samples) from y0 (n_sets,), inf where a law diverges, and the slopes taken."""
        feedthrough, offset = shifts(self, numbers)
        if self.any_exponent:
            A, dissipative, conservative, n = numbers[:, :4].T
            law = {"A": A, "beta": -dissipative, "gamma": -conservative, "n": n, "z0": y0 - offset - feedthrough * u[0]}
            y = BoucWen.responses({**law, "feedthrough": feedthrough, "offset": offset}, u)
            y[~(np.abs(y) <= bound).all(axis=1)] = np.inf
            return y, 0  # not counted: no law of this form takes long
        laws = self.terms, numbers[:, : len(self.terms)], feedthrough
        runs, work = free_runs(*laws, y0 - offset, u[np.newaxis], bound, most_steps=_MOST_STEPS)
        return runs + offset[:, np.newaxis], work


def shifts(structure: Structure, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    zero, first = np.zeros(len(numbers)), structure.size - structure.feedthrough - structure.offset
    feedthrough = numbers[:, first] if structure.feedthrough else zero
    return feedthrough, numbers[:, first + structure.feedthrough] if structure.offset else zero


BOUND = 30.0
FLOOR = 1e-4  # smaller residuals, in strokes, are no evidence for one law over another: no input is exactly known
DIVERGED = 1e3  # the residual, in strokes, of a free run that has
RANKING = 1e-5  # relative change of the cost at which a descent ends: far less than a difference of BIC that counts
POLISH = 1e-12
_STEPS_TO_RANK = 20  # a structure that is still on its way then is not taken for its last digits
_STEPS = 200
_FEWEST_STEPS = 2  # where the work is done
_SCHEDULE = Schedule(factors=(1e-3, 1e-1, 1.0, 10.0), success=1.0, failure=1e4, least=1e-12, most=1e8)
_SINGULAR = 1e-10
_STIFFEST = 200.0  # units that a number may reach: a memory that turns within 1/200 of the range of u is a step
_AMPLITUDES = (1.0, 0.5)  # of the steady loops, in ranges of the input
_CYCLES = 20
_STEADY = 1e-2  # strokes by which the last two may differ

Samples = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Candidate:
    """A refined structure.

    `unknowns` (size + n_records,) are its numbers and each record's y0, `residual` (n_samples,) is in strokes,
    `jacobian()` (n_samples, size + n_records) is its derivative. `settles()`: whether cycles end in a steady loop.
    """

    structure: Structure
    unknowns: FloatArray
    jacobian: Callable[[], FloatArray]  # it and the next are computed where they are asked for
    residual: FloatArray
    settles: Callable[[], bool]

    @cached_property
    def cost(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def n_parameters(self) -> int:
        """Numbers of the structure, and y0 of each record unless it is at rest."""
        return self.structure.size if self.structure.rest else len(self.unknowns)

    @cached_property
    def bic(self) -> float:
        n_samples = self.residual.size
        return information(self.cost / n_samples, n_samples, self.n_parameters, floor=FLOOR)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the unknowns, zero for y0 at rest; nan where the records do not determine all of them."""
        n, d, covariance = self.residual.size, self.n_parameters, np.zeros((self.unknowns.size,) * 2)
        jacobian, covariance[:d, :d] = self.jacobian()[:, :d], np.nan
        sizes = np.linalg.norm(jacobian, axis=0)
        if n > d and (sizes > 0.0).all():
            singular, right = np.linalg.svd(jacobian / sizes, full_matrices=False)[1:]
            if singular[-1] >= _SINGULAR * singular[0]:
                root = (right / singular[:, np.newaxis]).T / sizes[:, np.newaxis]
                covariance[:d, :d] = root @ root.T * (self.cost / (n - d))
        return covariance

    @property
    def significance(self) -> FloatArray:
        """Size of each number of the structure, (size,), in standard errors; inf where that is not known."""
        size = self.structure.size
        spread = np.sqrt(np.diag(self.covariance)[:size])
        return np.where(spread > 0.0, np.abs(self.unknowns[:size]) / np.where(spread > 0.0, spread, 1.0), np.inf)


@dataclass
class Work:
    """Slopes per sample that free runs have taken, and the `most` allowed; no clock is read."""

    most: float = math.inf
    done: float = 0.0

    @property
    def share(self) -> float:
        return self.done / self.most

    def steps(self, cost: float) -> float:
        return max(0.0, self.most - self.done) / cost if cost else math.inf


@dataclass(frozen=True)
class FreeRun:
    """Least squares over records; `signs` of coefficients, `masks` (n_samples,) of visible outputs, `work` done."""

    records: tuple[Record, ...]
    masks: tuple[Samples, ...] | None = None
    signs: Mapping[Term, int] = field(default_factory=dict)
    work: Work = field(default_factory=Work, compare=False)

    @cached_property
    def visible(self) -> tuple[Record, ...]:
        if self.masks is None:
            return self.records
        return tuple(Record(u=r.u[mask], y=r.y[mask]) for r, mask in zip(self.records, self.masks, strict=True))

    @cached_property
    def stroke(self) -> float:
        """Range of the visible outputs, the unit of outputs and residuals."""
        return float(max(record.y.max() for record in self.visible) - min(record.y.min() for record in self.visible))

    @cached_property
    def n_samples(self) -> int:
        return sum(map(len, self.visible))

    def bic_of(self, cost: float, n_parameters: int) -> float:
        return information(cost / self.n_samples, self.n_samples, n_parameters, floor=FLOOR)

    def cost_of(self, bic: float, n_parameters: int) -> float:
        """Sum of squared residuals, in squared strokes, with this BIC; negative if no sum has this BIC."""
        n = self.n_samples
        return n * (math.exp((bic - n_parameters * math.log(n)) / n) - FLOOR**2)

    @cached_property
    def largest(self) -> Record:
        return max(self.visible, key=lambda record: float(np.ptp(record.u)))

    @property
    def measured_starts(self) -> FloatArray:
        return np.array([record.y[0] for record in self.visible])

    @property
    def line(self) -> FloatArray:
        """Unknowns of y' = b u': the mean slope of the largest record, and the first outputs."""
        u, y = self.largest.u, self.largest.y
        return np.append(np.polyfit(u, y, 1)[0], self.measured_starts)

    def units(self, structure: Structure) -> FloatArray:
        """Units of the unknowns (size + n_records,): changes that move the output by about a stroke."""
        starts = np.full(len(self.records), self.stroke)
        return np.concatenate([structure.units(self.largest, self.stroke), starts])

    def residuals(self, structure: Structure, unknowns: FloatArray) -> FloatArray:
        """Residuals (n_sets, n_samples) in strokes at the visible samples."""
        return np.concatenate([self._residual(structure, unknowns, k) for k in range(len(self.records))], axis=1)

    def refine(
        self, structure: Structure, starts: FloatArray, *, tolerance: float = RANKING, hopeless: float = math.inf
    ) -> Candidate | None:
        """Optimum from the best of `starts` (n_starts, size + n_records); None if all diverge. See `descend`."""
        units, free = self.units(structure), np.full(len(self.records), np.inf)
        sides = zip(structure.bounds(self.signs), (-free, free), strict=True)
        lower, upper = (np.clip(np.concatenate(side), -_STIFFEST * units, _STIFFEST * units) for side in sides)
        starts, before = np.clip(starts, lower, upper), self.work.done
        costs = np.sum(self.residuals(structure, starts) ** 2, axis=1)
        if costs.min() >= DIVERGED**2:
            return None
        is_ranked = tolerance >= RANKING  # else polished
        residuals, n_runs = self._scaled(structure), len(_SCHEDULE.factors) + units.size * (1 if is_ranked else 2)
        affordable = self.work.steps((self.work.done - before) / len(starts) * n_runs)

        def slopes(x: FloatArray, residual: FloatArray) -> FloatArray:
            return differences(residuals, x, residual, central=not is_ranked)

        problem = SumOfSquares(residuals, slopes, lower / units, upper / units)
        begin = starts[[np.argmin(costs)]] / units
        steps = int(max(_FEWEST_STEPS, min(affordable, _STEPS_TO_RANK if is_ranked else _STEPS)))
        reached = descend(problem, begin, relative=tolerance, steps=steps, hopeless=hopeless, schedule=_SCHEDULE)
        x, residual = reached.x[0], reached.evaluated[0][0]
        unknowns = x * units
        first = [self._first(structure, unknowns[np.newaxis], k)[0] for k in range(len(self.records))]
        unknowns[structure.size :], jacobian = first, cache(lambda: slopes(x, residual) / units)
        return Candidate(structure, unknowns, jacobian, residual, cache(lambda: self._settles(structure, unknowns)))

    def _scaled(self, structure: Structure) -> Callable[[FloatArray], FloatArray]:
        units = self.units(structure)
        return lambda x: self.residuals(structure, x * units)

    def linearised(self, structure: Structure, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (n_samples,) at some unknowns (size + n_records,), and its Jacobian in their units."""
        residuals, x = self._scaled(structure), unknowns / self.units(structure)
        residual = residuals(x[np.newaxis])[0]
        return residual, differences(residuals, x, residual, central=True)

    def _first(self, structure: Structure, unknowns: FloatArray, k: int) -> FloatArray:
        """First output of a record, (n_sets,): y0, or that where the memory is zero."""
        if not structure.rest:
            return unknowns[:, structure.size + k]
        feedthrough, offset = shifts(structure, unknowns)
        return offset + feedthrough * float(self.records[k].u[0])

    def _settles(self, structure: Structure, unknowns: FloatArray) -> bool:
        k = max(range(len(self.records)), key=lambda k: float(np.ptp(self.records[k].u)))
        for share in _AMPLITUDES:
            u = self.records[k].u
            middle, reach = 0.5 * (u.max() + u.min()), 0.5 * share * float(np.ptp(u))
            path = np.concatenate([u, np.tile([middle - reach, middle + reach], _CYCLES)])
            path.setflags(write=False)
            numbers, y0 = np.split(unknowns[np.newaxis], [structure.size], axis=1)
            y = structure.run(path, numbers, y0[:, k], BOUND * self.stroke)[0][0]
            if not np.isfinite(y).all() or np.abs(y[-4:-2] - y[-2:]).max() > _STEADY * self.stroke:
                return False
        return True

    def _residual(self, structure: Structure, unknowns: FloatArray, k: int) -> FloatArray:
        record, visible = self.records[k], self.visible[k]
        bound = BOUND * self.stroke + float(np.abs(visible.y).max())
        y0 = self._first(structure, unknowns, k)
        y, terms = structure.run(record.u, unknowns[:, : structure.size], y0, bound)
        self.work.done += terms / self.n_samples
        if self.masks is not None:
            y = y[:, self.masks[k]]
        residual = (visible.y - y) / self.stroke
        residual[~np.isfinite(residual)] = DIVERGED
        return residual
