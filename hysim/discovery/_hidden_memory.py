"""A memory that is not measured, from the equation of motion along a measured displacement.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

For given coefficients z follows from y by integration, so that no noise is differentiated. Both sides of the equation
of motion are filtered alike (`hysim.plants.oscillator_structure`); m, c and k are projected out, and a Gauss-Newton
step is a regression on the slopes of z. Only the curvature of the memory distinguishes A from k: the descent begins
from several shares of the stiffness. Noise lengthens the path of y, a bias of about a percent; a simulation refines it.

**The regression** is that of an oscillator's output on the terms of its memory, the plant projected out. Columns are
scaled so that the coefficients of all terms together have standard errors of one: a threshold is then a number of
standard errors. Where terms are nearly collinear a small coefficient is no sign of a small loss, so that STLSQ's
thresholds are accompanied by plain elimination.

**The oscillator's output** as its terms make it: simulation, its slopes, and the regression on them.

    y = y0 + sum of (coefficient - its value) times dy/d(coefficient) + the same for m, c and k

About a law that simulates the record well the residual is white and the slopes are free of noise. Unlike one of z' on
noisy signals, this regression has no bias, and its standard errors and BIC are right.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import in_chunks
from hysim.discovery._search import best_subsets
from hysim.discovery._slopes import Regression, independent
from hysim.errors import SimulationError
from hysim.identification import errors_of_refits, folds
from hysim.identification.marquardt import Schedule, SumOfSquares, descend
from hysim.kernels import memory_terms as kernels
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_terms, memory_terms, symmetric
from hysim.metrics.criteria import information, rms_of_known
from hysim.plants.oscillator import ATTEMPTS, attracting_state
from hysim.plants.oscillator_structure import Filter, Linear, Motion, OscillatorStructure, filtering, interpolated
from hysim.records import Record, by_record

FLOOR = 1e-5  # of the rms output: smaller residuals are no evidence of a term
BLOCKS = 4  # that are held out in turn, where there are no periods
DEPENDENT = 1e-5  # share of a slope that those before it do not explain, below which it is left out


@dataclass(frozen=True)
class TermRegression(Regression):
    """A regression with noise of one, of `size` [unit of y], about an oscillator whose plant is projected out.

    `blocks` are the samples held out in turn; `n_others` counts other fitted numbers than those of plant and terms.
    """

    floor: float
    n_plant: int
    blocks: Sequence[npt.NDArray[np.intp]]
    n_others: int = 0

    def structures(self) -> set[tuple[Term, ...]]:
        """Structures of STLSQ's thresholds, and of plain elimination."""
        return {*(terms for _, terms in self.path()), *self.eliminated()}

    def eliminated(self) -> list[tuple[Term, ...]]:
        """Structures from dense to sparse, each without the term whose removal costs least."""
        if not self.terms:
            return []
        (R, goal), every = self.triangle, np.ones(len(self.terms), dtype=bool)
        levels = best_subsets(R, -goal, np.zeros(every.size), every, width=1)
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
        n_parameters = self.n_plant + self.n_others + len(terms)
        return information(float(rest @ rest) / n * self.size**2, n, n_parameters, floor=self.floor)

    def held_out_rmse(self, terms: Sequence[Term]) -> float:
        """Rmse on each block of a structure that the other blocks have fitted [unit of y]."""
        return self.size * held_out_rmse(self.features[:, self.places(terms)], self.target, self.blocks)


def held_out_rmse(columns: FloatArray, target: FloatArray, blocks: Sequence[npt.NDArray[np.intp]]) -> float:
    """Rmse on each block of a regression on the other blocks."""

    def residual(weights: FloatArray) -> FloatArray:
        rows = columns * weights[:, np.newaxis]
        return np.asarray(target - columns @ np.linalg.lstsq(rows, target * weights, rcond=None)[0])

    return rms_of_known(errors_of_refits(residual, target.size, blocks))


def term_regression(
    terms: tuple[Term, ...],
    plant: FloatArray,
    slopes: FloatArray,
    target: FloatArray,
    floor: float,
    blocks: Sequence[npt.NDArray[np.intp]],
) -> TermRegression:
    """Regression of `target` (n_samples,) on slopes (n_samples, n_terms), the plant's (n_samples, n) projected out."""
    sizes = np.linalg.norm(plant, axis=0)
    plant, sizes = plant[:, sizes > 0.0], sizes[sizes > 0.0]  # where the motion diverges a slope is unknown, and zero
    basis = np.linalg.qr(plant / sizes)[0]
    n_plant, included = basis.shape[1], independent(slopes, basis, range(len(terms)), DEPENDENT)
    features = slopes[:, included] - basis @ (basis.T @ slopes[:, included])
    goal = target - basis @ (basis.T @ target)
    size = np.linalg.norm(features, axis=0)
    scaled = features / size
    residual = goal - scaled @ np.linalg.lstsq(scaled, goal, rcond=None)[0]
    freedom = max(goal.size - n_plant - len(included), 1)
    sigma = max(float(np.sqrt(residual @ residual / freedom)), floor)
    units = sigma * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))) / size
    return TermRegression(
        terms=tuple(terms[k] for k in included),
        dependent=tuple(term for k, term in enumerate(terms) if k not in included),
        features=features * units / sigma,
        target=goal / sigma,
        sizes=sigma / units,
        size=sigma,
        floor=floor,
        n_plant=n_plant,
        blocks=blocks,
    )


POWERS = (1.0, 2.0, 3.0)
SHARES = (0.2, 0.5, 0.8)  # of the stiffness of small motions, in A
PLANT = ("mass", "damping", "stiffness")
SPRING = bouc_wen_terms(1.0)[0]

OSCILLATOR_SCHEDULE = Schedule(failure=5.0, least=1e-12)

_FINER = 4  # increments of y for each sample
_DEGREE = 3


class State(NamedTuple):
    y: float
    velocity: float
    z: float


class Oscillator(NamedTuple):
    plant: dict[str, float]
    coefficients: dict[Term, float]


Regressed = tuple[float, Oscillator]
"""The unexplained share of the filtered force, and the oscillator that leaves it."""


class _Along(NamedTuple):
    """One motion: its filter, its increments, their time, and the samples of the memory along them."""

    filtered: Filter
    steps: FloatArray
    h: float
    samples: slice


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
    direction = np.array([1.0, 1.0] if term.rectified else [-1.0, 1.0])
    side = np.array([1.0, 1.0] if term.is_even_in_memory else [-1.0, 1.0])
    return np.asarray(direction[:, np.newaxis] * side)


class HiddenMemory:
    """Regressions of the memory along one or several motions of one plant; parts of the plant may be `known`."""

    def __init__(self, motions: Sequence[Motion], linear: Linear, known: Mapping[str, float]) -> None:
        self.linear, self.known = linear, dict(known)
        self._along = [_along(motion, linear) for motion in motions]
        force, y = self._stacked([motion.force for motion in motions], 0), [motion.y for motion in motions]
        sides = {name: self._stacked(y, power) for name, power in zip(PLANT, (2, 1, 0), strict=True)}
        self._target = force - sum((value * sides[name] for name, value in known.items()), np.zeros_like(force))
        self._free = [name for name in PLANT if name not in known]
        self._columns = np.array([sides[name] for name in self._free]).reshape(-1, force.size).T
        self._basis = np.linalg.qr(self._columns / np.linalg.norm(self._columns, axis=0))[0]
        self._size = float(np.linalg.norm(force))

    @staticmethod
    def library(degree: int, symmetry: str | None) -> tuple[Term, ...]:
        """The terms by their power of z, without combinations of earlier ones."""
        if degree not in (1, 2, 3):
            raise ValueError(f"degree must be 1, 2 or 3, got {degree!r}")
        if symmetry not in (None, "odd"):
            raise ValueError(f'symmetry must be None or "odd", got {symmetry!r}')
        ordered = sorted(memory_terms(degree), key=lambda term: (term.degree, term.is_even_in_memory, term.rectified))
        return symmetric((*ordered, RELAXATION), symmetry)

    def fit(self, terms: Sequence[Term]) -> Regressed | None:
        """Law of these terms, u' first, from the best of several starts; None if all diverge."""
        spring = self.linear.stiffness
        shares = [1.0 - self.known["stiffness"] / spring] if "stiffness" in self.known else SHARES
        starts = [np.array([max(share, 0.01) * spring, *np.zeros(len(terms) - 1)]) for share in shares]
        return _best(self._descended(terms, start) for start in starts)

    def nearest(self) -> Regressed | None:
        """Bouc-Wen law with a whole n, or linear relaxation, of the smallest error; None if all diverge."""
        laws = [bouc_wen_terms(n) for n in POWERS] + [(SPRING, RELAXATION)]
        return _best(map(self.fit, laws))

    def regression(self, library: Sequence[Term]) -> TermRegression:
        """Regression on all terms, about z = A y, of the force that a linear spring does not explain."""
        terms = (SPRING, *(term for term in library if term != SPRING))
        share = 1.0 - self.known.get("stiffness", 0.5 * self.linear.stiffness) / self.linear.stiffness
        x = np.array([share * self.linear.stiffness, *np.zeros(len(terms) - 1)])
        rows = self._memory(terms, x)
        if rows is None:
            raise ValueError("the displacement is not finite or too large")
        target = self._target - rows[0] + rows[1] * x[0]
        floor = FLOOR * self._size / float(np.sqrt(target.size))
        return term_regression(terms, self._columns, rows[1:].T, target, floor, folds(BLOCKS, target.size))

    def _descended(self, terms: Sequence[Term], start: FloatArray) -> Regressed | None:
        def residuals(points: FloatArray) -> FloatArray:
            values = np.full((len(points), self._target.size), np.inf)
            for k, x in enumerate(points):
                rows = self._memory(terms, x)
                if rows is not None:
                    values[k] = self._projected(self._target - rows[0])
            return values

        def columns(x: FloatArray) -> FloatArray:
            rows = self._memory(terms, x)
            return np.zeros((self._target.size, x.size)) if rows is None else rows[1:].T

        problem = SumOfSquares(
            residuals,
            lambda x, residual: -self._projected(columns(x)),
            sizes=lambda x: np.linalg.norm(columns(x), axis=0),  # those of slopes that the plant explains are tiny
        )
        x = descend(problem, start[np.newaxis], relative=1e-7, steps=100, schedule=OSCILLATOR_SCHEDULE).x[0]
        rows = self._memory(terms, x)
        if rows is None:
            return None
        goal = self._target - rows[0]
        plant = dict(zip(self._free, np.linalg.lstsq(self._columns, goal, rcond=None)[0].tolist(), strict=True))
        error = float(np.linalg.norm(self._projected(goal))) / self._size
        return error, Oscillator(self.known | plant, dict(zip(terms, x.tolist(), strict=True)))

    def _memory(self, terms: Sequence[Term], x: FloatArray) -> FloatArray | None:
        """Filtered memory and its slopes along the coefficients, (1 + n_terms, n_rows); None if it diverges."""
        polynomial, _, _, relaxation = memory_arrays(dict(zip(terms, x.tolist(), strict=True)), _DEGREE)
        polynomials = [term for term in terms if not term.relaxing]
        units = np.array([cases(term, _DEGREE) for term in polynomials])
        place = [1 + (len(polynomials) if term.relaxing else polynomials.index(term)) for term in terms]
        signals = []
        for each in self._along:
            memory = np.zeros((2 + len(polynomials), each.steps.size + 1))
            if not kernels.along(each.steps, each.h, polynomial, relaxation, units, memory[0], memory[1:]):
                return None
            signals.append(memory[[0, *place]][:, each.samples])
        rows = self._stacked(signals, 0)
        return rows if np.isfinite(rows).all() else None

    def _projected(self, rows: FloatArray) -> FloatArray:
        return np.asarray(rows - self._basis @ (self._basis.T @ rows))

    def _stacked(self, signals: Sequence[FloatArray], power: int) -> FloatArray:
        filtered = [each.filtered(signal, power) for each, signal in zip(self._along, signals, strict=True)]
        return np.concatenate(filtered, axis=-1)


def _best(laws: Iterable[Regressed | None]) -> Regressed | None:
    return min((each for each in laws if each is not None), key=lambda each: each[0], default=None)


def _along(motion: Motion, linear: Linear) -> _Along:
    h = motion.sample_time / _FINER
    if motion.periodic:
        fine = interpolated(motion.y, _FINER)
        steps = np.diff(np.tile(fine, 2), append=fine[0])
        return _Along(filtering(motion, linear), steps, h, slice(fine.size, -1, _FINER))
    places = np.arange((motion.y.size - 1) * _FINER + 1) / _FINER
    fine = scipy.interpolate.CubicSpline(np.arange(motion.y.size), motion.y)(places)
    return _Along(filtering(motion, linear), np.diff(fine), h, slice(None, None, _FINER))


_DIFFERENCES = (3e-4, 3e-5, 3e-6)  # of a parameter, for its slope: the first with which nothing diverges
_STEADY = 1e-9  # relative change of the state from period to period


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
    def widest(self) -> FloatArray:
        return max((record.y for record in self.records), key=lambda y: float(np.ptp(y)))

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

    def slopes(self, oscillator: Oscillator, terms: Sequence[Term]) -> FloatArray:
        """Derivatives of the output by free parameters and coefficients of `terms`, (n_samples, n); zero if unknown."""
        slopes = np.zeros((self.measured.size, len(self.free) + len(terms)))
        missing = np.arange(slopes.shape[1])
        for difference in _DIFFERENCES:
            if missing.size:
                columns = self._differences(oscillator, terms, missing, difference)
                is_finite = np.isfinite(columns).all(axis=0)
                slopes[:, missing[is_finite]] = columns[:, is_finite]
                missing = missing[~is_finite]
        return slopes

    def _differences(
        self, oscillator: Oscillator, terms: Sequence[Term], places: npt.NDArray[np.intp], difference: float
    ) -> FloatArray:
        """Central differences by the parameters at some places; not finite where one diverges."""
        plant, coefficients = oscillator
        spring = plant["stiffness"] + next(iter(coefficients.values()), 0.0)
        size = spring * float(np.sqrt(np.mean(self.measured**2)))
        frequency = np.sqrt(abs(spring) / plant["mass"])
        units = {"mass": plant["mass"], "damping": plant["mass"] * frequency, "stiffness": spring}
        steps = [units[name] for name in self.free]
        steps += [frequency if term.relaxing else spring / size**term.degree for term in terms]

        def displaced(k: int, by: float) -> Oscillator:
            if k < len(self.free):
                return Oscillator(plant | {self.free[k]: plant[self.free[k]] + by}, coefficients)
            term = terms[k - len(self.free)]
            return Oscillator(plant, coefficients | {term: coefficients.get(term, 0.0) + by})

        by = difference * np.array(steps)[places]
        both = [displaced(int(k), sign * step) for sign in (1.0, -1.0) for k, step in zip(places, by, strict=True)]
        with np.errstate(invalid="ignore"):
            ahead, behind = np.split(self.outputs(both), 2)
            return np.asarray((ahead - behind).T / (2.0 * by))

    def descended(self, oscillator: Oscillator) -> Oscillator:
        terms = tuple(oscillator.coefficients)

        def at(x: FloatArray) -> Oscillator:
            plant = oscillator.plant | dict(zip(self.free, x.tolist(), strict=False))
            return Oscillator(plant, dict(zip(terms, x[len(self.free) :].tolist(), strict=True)))

        def residuals(points: FloatArray) -> FloatArray:
            oscillators = [at(x) for x in points]
            possible = [k for k, each in enumerate(oscillators) if each.plant["mass"] > 0.0]
            residuals = np.full((len(points), self.measured.size), np.inf)
            residuals[possible] = self.measured - self.outputs([oscillators[k] for k in possible])
            return residuals

        def slopes(x: FloatArray, residual: FloatArray) -> FloatArray:
            return -self.slopes(at(x), terms)

        start = [oscillator.plant[name] for name in self.free] + list(oscillator.coefficients.values())
        problem = SumOfSquares(residuals, slopes)
        return at(descend(problem, np.array([start]), relative=1e-7, steps=100, schedule=OSCILLATOR_SCHEDULE).x[0])

    def regression(self, oscillator: Oscillator, residual: FloatArray, library: Sequence[Term]) -> TermRegression:
        """Regression about an oscillator with this residual on all terms of the library and its own."""
        terms = (*library, *(term for term in oscillator.coefficients if term not in library))
        slopes = self.slopes(oscillator, terms)
        n_plant = len(self.free)
        values = np.array([oscillator.coefficients.get(term, 0.0) for term in terms])
        target = residual + slopes[:, n_plant:] @ values
        return term_regression(terms, slopes[:, :n_plant], slopes[:, n_plant:], target, self.floor, self._blocks)

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
