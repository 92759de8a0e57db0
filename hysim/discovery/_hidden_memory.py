"""The output of an oscillator as the terms of its memory make it: simulation, its slopes, and the regression on them.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

    y = y0 + sum of (coefficient - its value) times dy/d(coefficient) + the same for m, c and k

The plant is projected out. About a law that simulates the record well the residual is white and the slopes are free of
noise. Unlike one of z' on noisy signals, this regression has no bias, and its standard errors and BIC are right. Terms
may be nearly collinear, so that a small coefficient is no sign of a small loss: structures are the best subsets.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.parallel import in_chunks
from hysim.discovery._search import best_subsets
from hysim.discovery._slopes import Regression, independent
from hysim.errors import SimulationError
from hysim.identification import errors_of_refits, folds
from hysim.identification.marquardt import Schedule, SumOfSquares, descend
from hysim.kernels import memory_terms as kernels
from hysim.laws.differential.terms import (
    RELAXATION,
    Term,
    bouc_wen_exponent,
    bouc_wen_terms,
    memory_terms,
    symmetric,
)
from hysim.metrics.criteria import information, rms_of_known
from hysim.plants.oscillator import ATTEMPTS, attracting_state
from hysim.plants.oscillator_structure import OscillatorStructure
from hysim.records import Record, by_record

FLOOR = 1e-5  # of the rms output: smaller residuals are no evidence of a term
BLOCKS = 4  # that are held out in turn, where there are no periods
DEPENDENT = 1e-5  # share of a slope that those before it do not explain, below which it is left out


@dataclass(frozen=True)
class TermRegression(Regression):
    """A regression about an oscillator whose plant is projected out.

    `blocks` are the samples held out in turn; `n_others` counts the fitted numbers that are no coefficients.
    """

    floor: float
    n_others: int
    blocks: Sequence[npt.NDArray[np.intp]]

    def eliminated(self, width: int = 1) -> list[tuple[Term, ...]]:
        """The best structure of each size among the `width` followed, from dense to sparse."""
        if not self.terms:
            return []
        (R, goal), every = self.triangle, np.ones(len(self.terms), dtype=bool)
        levels = best_subsets(R, -goal, np.zeros(every.size), every, width=width)
        return [tuple(itertools.compress(self.terms, level.included[0])) for level in levels][:-1]

    def best(self, structures: Sequence[tuple[Term, ...]]) -> tuple[Term, ...]:
        return min([*structures, ()], key=self.bic)

    def inclusion(self, rng: np.random.Generator, n_draws: int) -> dict[Term, float]:
        """Share of regressions on samples drawn with replacement whose best structure has each term."""
        counts = dict.fromkeys(self.terms, 0)
        for _ in range(n_draws):
            rows = rng.integers(self.target.size, size=self.target.size)
            drawn = replace(self, features=self.features[rows], target=self.target[rows])
            for term in drawn.best(drawn.eliminated()):
                counts[term] += 1
        return {term: count / n_draws for term, count in counts.items()}

    def bic(self, terms: Sequence[Term]) -> float:
        (R, goal), n = self.triangle, self.target.size
        included = R[:, self.places(terms)]
        rest = goal - included @ np.linalg.lstsq(included, goal, rcond=None)[0]
        return information(float(rest @ rest) / n, n, self.n_others + len(terms), floor=self.floor)

    def held_out_rmse(self, terms: Sequence[Term]) -> float:
        """Rmse on each block of a structure that the other blocks have fitted [unit of y]."""
        return held_out_rmse(self.features[:, self.places(terms)], self.target, self.blocks)


def held_out_rmse(columns: FloatArray, target: FloatArray, blocks: Sequence[npt.NDArray[np.intp]]) -> float:
    """Rmse on each block of a regression on the other blocks."""

    def residual(weights: FloatArray) -> FloatArray:
        rows = columns * weights[:, np.newaxis]
        return np.asarray(target - columns @ np.linalg.lstsq(rows, target * weights, rcond=None)[0])

    return rms_of_known(errors_of_refits(residual, target.size, blocks))


PLANT = ("mass", "damping", "stiffness")
SPRING = bouc_wen_terms(1.0)[0]

OSCILLATOR_SCHEDULE = Schedule(failure=5.0, least=1e-12)
EXPONENTS = (0.5, 10.0)  # the published bounds of n


class State(NamedTuple):
    y: float
    velocity: float
    z: float


class Oscillator(NamedTuple):
    plant: dict[str, float]
    coefficients: dict[Term, float]


def library(degree: int, symmetry: str | None) -> tuple[Term, ...]:
    """The terms by their power of z, without combinations of earlier ones."""
    check_choice("degree", degree, (1, 2, 3))
    if symmetry not in (None, "odd"):
        raise ValueError(f'symmetry must be None or "odd", got {symmetry!r}')
    ordered = sorted(memory_terms(degree), key=lambda term: (term.degree, term.is_even_in_memory, term.rectified))
    return symmetric((*ordered, RELAXATION), symmetry)


def memory_arrays(coefficients: Mapping[Term, float], degree: int) -> tuple[FloatArray, FloatArray, float, float]:
    """A law as `hysim.kernels.memory_terms` takes it: polynomials in z, one more term and its power, the relaxation.

    The first two are by direction and side. Terms whose powers are not whole must share one power.
    """
    polynomial, extra, power = np.zeros((2, 2, degree + 1)), np.zeros((2, 2)), 1.0
    for term, value in coefficients.items():
        if term.is_polynomial:
            polynomial += value * cases(term, degree)
        elif not term.relaxing:
            extra, power = extra + value * _signs(term), term.degree
    return polynomial, extra, power, coefficients.get(RELAXATION, 0.0)


def cases(term: Term, degree: int) -> FloatArray:
    """Polynomials in z of a term, shape (2, 2, degree + 1), by direction and side of z = 0."""
    polynomials = np.zeros((2, 2, degree + 1))
    polynomials[..., int(term.degree)] = _signs(term)
    if term.degree % 2:
        polynomials[:, 0] *= -1.0  # z^power = -|z|^power there
    return polynomials


def _signs(term: Term) -> FloatArray:
    direction, side = ([1.0 if is_even else -1.0, 1.0] for is_even in (term.rectified, term.is_even_in_memory))
    return np.outer(direction, side)


_DIFFERENCE = 3e-5  # of a parameter, for its slope
_LIGHTEST = 1e-3  # share of the mass where a descent begins
_STEADY = 1e-9  # relative change of the state from period to period


def bouc_wen_numbers(oscillator: Oscillator) -> dict[str, float]:
    """Parameters of a `BoucWenOscillator` whose memory has a Bouc-Wen law; without a memory A is zero."""
    plant, law = oscillator
    n = bouc_wen_exponent(law) or 1.0
    A, dissipative, conservative = (law.get(term, 0.0) for term in bouc_wen_terms(n))
    return {**plant, "A": A, "beta": -dissipative, "gamma": -conservative, "n": n}


def is_polynomial(terms: Iterable[Term]) -> bool:
    return all(term.is_polynomial or term.relaxing for term in terms)


def with_exponent(terms: Sequence[Term], n: float) -> tuple[Term, ...]:
    """These terms of a Bouc-Wen law, for another exponent."""
    both = zip(bouc_wen_terms(bouc_wen_exponent(terms) or 1.0), bouc_wen_terms(n), strict=True)
    return tuple(new for old, new in both if old in terms)


def of_bouc_wen(numbers: Mapping[str, float]) -> Oscillator:
    coefficients = (numbers["A"], -numbers["beta"], -numbers["gamma"])
    law = dict(zip(bouc_wen_terms(numbers["n"]), coefficients, strict=True))
    return Oscillator({name: numbers[name] for name in PLANT}, law)


def _spring(oscillator: Oscillator) -> float:
    return oscillator.plant["stiffness"] + oscillator.coefficients.get(SPRING, 0.0)


@dataclass(frozen=True)
class Response:
    """Outputs of oscillators on records that were made as `structure` says; names in `known` are not free."""

    structure: OscillatorStructure
    records: Sequence[Record]
    known: Mapping[str, float]

    @cached_property
    def measured(self) -> FloatArray:
        return np.concatenate([record.y for record in self.records])

    @cached_property
    def widest(self) -> Record:
        return max(self.records, key=lambda record: float(np.ptp(record.y)))

    @cached_property
    def floor(self) -> float:
        """Residual below which nothing counts as evidence [unit of y]."""
        return FLOOR * float(np.sqrt(np.mean(self.measured**2)))

    @cached_property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in PLANT if name not in self.known)

    @cached_property
    def _inputs(self) -> list[tuple[FloatArray, float]]:
        return [(self.structure.fine_input(r.u), r.sample_time / self.structure.oversampling) for r in self.records]

    def outputs(self, oscillators: Sequence[Oscillator]) -> FloatArray:
        """Outputs (n_oscillators, n_samples), inf where one diverges; Bouc-Wen laws alone by their model's method."""
        if oscillators and all(bouc_wen_exponent(each.coefficients) for each in oscillators):
            numbers = [bouc_wen_numbers(each) for each in oscillators]
            sets = {name: np.array([each[name] for each in numbers]) for name in numbers[0]}
            return np.concatenate([self.structure.regressors(sets, r)[..., 0] for r in self.records], axis=1)
        outputs = np.full((len(oscillators), self.measured.size), np.inf)

        def work(start: int, stop: int) -> None:
            for row, oscillator in zip(outputs[start:stop], oscillators[start:stop], strict=True):
                for y, force_and_step in zip(by_record(row, self.records), self._inputs, strict=True):
                    run = self._run(oscillator, *force_and_step)
                    if run is not None:
                        y[:] = np.resize(self.structure.sampled(run[0]), y.size)

        in_chunks(work, len(oscillators), minimum=1)
        return outputs

    def initial_states(self, oscillator: Oscillator) -> tuple[State, ...]:
        """State at the first sample of each record: rest, or that of the steady motion under a periodic input."""
        runs = [self._run(oscillator, *drive) if self.structure.period else None for drive in self._inputs]
        missing = np.nan if self.structure.period else 0.0
        return tuple(State(*([missing] * 3 if run is None else run[1].tolist())) for run in runs)

    def _run(self, oscillator: Oscillator, force: FloatArray, h: float) -> tuple[FloatArray, FloatArray] | None:
        degree = max((int(term.degree) for term in oscillator.coefficients if term.is_polynomial), default=0)
        polynomial, extra, power, relaxation = memory_arrays(oscillator.coefficients, degree)
        plant = np.array([*(oscillator.plant[name] for name in PLANT), relaxation, power])
        state = np.zeros(3)
        if self.structure.period is None:
            y = np.zeros(force.size)
            return (y, state) if kernels.motion(plant, polynomial, extra, force, h, state, y[1:]) else None
        y, force, largest = np.empty(force.size), np.append(force, force[0]), np.zeros(3)

        def after(x: FloatArray) -> FloatArray:
            end = x.copy()
            if not kernels.motion(plant, polynomial, extra, force, h, end, y):
                raise SimulationError("the motion diverges")
            return end

        try:
            for n_periods in range(ATTEMPTS[-1] + 2):
                if n_periods in ATTEMPTS:
                    steady = attracting_state(after, state, largest, _STEADY)
                    state = state if steady is None else steady
                before, state = state, after(state)
                largest = np.maximum(largest, np.abs(state))
                if np.all(np.abs(state - before) <= _STEADY * np.maximum(np.abs(state), np.abs(before))):
                    return np.roll(y, 1), state
        except SimulationError:
            return None
        return None

    def slopes(self, oscillator: Oscillator, terms: Sequence[Term], *, any_exponent: bool = False) -> FloatArray:
        """Central differences of the output by free parameters, coefficients of `terms` and n, (n_samples, n_numbers).

        They are zero where they are unknown, since one of two laws diverges.
        """
        plant, coefficients = oscillator
        spring, size = _spring(oscillator), self._force(oscillator)
        frequency = np.sqrt(abs(spring) / plant["mass"])
        units = {"mass": plant["mass"], "damping": plant["mass"] * frequency, "stiffness": spring}
        steps = [units[name] for name in self.free]
        steps += [frequency if term.relaxing else spring / size**term.degree for term in terms] + [1.0] * any_exponent

        def displaced(k: int, by: float) -> Oscillator:
            if k < len(self.free):
                return Oscillator(plant | {self.free[k]: plant[self.free[k]] + by}, coefficients)
            if k == len(self.free) + len(terms):
                others = with_exponent(terms, (bouc_wen_exponent(terms) or 1.0) + by)
                return Oscillator(plant, dict(zip(others, coefficients.values(), strict=True)))
            term = terms[k - len(self.free)]
            return Oscillator(plant, coefficients | {term: coefficients.get(term, 0.0) + by})

        by = _DIFFERENCE * np.array(steps)
        both = [displaced(k, sign * step) for sign in (1.0, -1.0) for k, step in enumerate(by.tolist())]
        with np.errstate(invalid="ignore"):
            ahead, behind = np.split(self.outputs(both), 2)
            slopes = np.asarray((ahead - behind).T / (2.0 * by))
        return np.where(np.isfinite(slopes).all(axis=0), slopes, 0.0)

    def _force(self, oscillator: Oscillator) -> float:
        return _spring(oscillator) * float(np.sqrt(np.mean(self.measured**2)))

    def descended(self, oscillator: Oscillator, *, any_exponent: bool = False) -> tuple[Oscillator, bool]:
        """The oscillator of least squares near this one, of a Bouc-Wen law n too; and whether the descent ended."""
        n_plant, size = len(self.free), self._force(oscillator)
        terms, last = tuple(oscillator.coefficients), -1 if any_exponent else None

        def at(x: FloatArray) -> Oscillator:
            own = with_exponent(terms, float(x[-1])) if any_exponent else terms
            plant = oscillator.plant | dict(zip(self.free, x.tolist(), strict=False))
            values = x[n_plant:last] / powers(own)
            return Oscillator(plant, dict(zip(own, values.tolist(), strict=True)))

        def powers(terms: Sequence[Term]) -> FloatArray:
            """Factors of the coefficients with which a change of n leaves their effect about as it was."""
            return np.array([size**term.degree for term in terms])

        def residuals(points: FloatArray) -> FloatArray:
            return self.measured - self.outputs([at(x) for x in points])

        def slopes(x: FloatArray, residual: FloatArray) -> FloatArray:
            here = at(x)
            own = tuple(here.coefficients)
            columns = -self.slopes(here, own, any_exponent=any_exponent)
            if any_exponent:
                numbers = [value * term.degree / x[-1] for term, value in here.coefficients.items()]
                columns[:, -1] -= columns[:, n_plant:-1] @ np.array(numbers) * np.log(size)
            columns[:, n_plant:last] /= powers(own)
            return columns

        start = np.array([oscillator.plant[name] for name in self.free] + [*oscillator.coefficients.values()])
        start[n_plant:] *= powers(terms)
        bounds = np.full((2, start.size + any_exponent), [[-np.inf], [np.inf]])
        lowest = {"mass": _LIGHTEST * oscillator.plant["mass"], "damping": 0.0}
        bounds[0, :n_plant] = [lowest.get(name, -np.inf) for name in self.free]
        if any_exponent:
            start, bounds[:, -1] = np.append(start, bouc_wen_exponent(terms) or 1.0), EXPONENTS
        problem = SumOfSquares(residuals, slopes, *bounds)
        reached = descend(problem, start[np.newaxis], relative=1e-10, steps=100, schedule=OSCILLATOR_SCHEDULE)
        return at(reached.x[0]), bool(reached.at_rest[0])

    def regression(self, oscillator: Oscillator, residual: FloatArray, library: Sequence[Term]) -> TermRegression:
        """Regression about an oscillator with this residual on all terms of the library and its own."""
        law = oscillator.coefficients
        terms = (*library, *(term for term in law if term not in library))
        plant, slopes = np.split(self.slopes(oscillator, terms), [len(self.free)], axis=1)
        target = residual + slopes @ np.array([law.get(term, 0.0) for term in terms])
        sizes = np.linalg.norm(plant, axis=0)
        plant, sizes = plant[:, sizes > 0.0], sizes[sizes > 0.0]  # where the motion diverges a slope is zero: unknown
        basis = np.linalg.qr(plant / sizes)[0]
        included = independent(slopes, basis, range(len(terms)), DEPENDENT)
        features = slopes[:, included] - basis @ (basis.T @ slopes[:, included])
        sizes = np.linalg.norm(features, axis=0)
        return TermRegression(
            terms=tuple(terms[k] for k in included),
            dependent=tuple(term for k, term in enumerate(terms) if k not in included),
            features=features / sizes,
            target=target - basis @ (basis.T @ target),
            sizes=sizes,
            size=1.0,
            floor=self.floor,
            n_others=basis.shape[1] + (not is_polynomial(law)),
            blocks=self._blocks,
        )

    def held_out_rmse(self, oscillator: Oscillator, residual: FloatArray) -> float:
        """Rmse on each block, predicted by a linear fit about the oscillator to the other blocks [unit of y]."""
        slopes = self.slopes(oscillator, tuple(oscillator.coefficients))
        sizes = np.linalg.norm(slopes, axis=0)
        return held_out_rmse(slopes / np.where(sizes > 0.0, sizes, 1.0), residual, self._blocks)

    @cached_property
    def _blocks(self) -> list[npt.NDArray[np.intp]]:
        blocks, period = [], self.structure.period
        for samples in by_record(np.arange(self.measured.size), self.records):
            n = samples.size // period if period is not None and samples.size >= 2 * period else BLOCKS
            blocks += [samples[block] for block in folds(n, samples.size)]
        return blocks
