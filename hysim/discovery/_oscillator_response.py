"""The oscillator's output as its terms make it: simulation, its slopes, and the regression on them.

    y = y0 + sum of (coefficient - its value) times dy/d(coefficient) + the same for m, c and k

About a law that simulates the record well the residual is white and the slopes are free of noise. Unlike one of z' on
noisy signals, this regression has no bias, and its standard errors and BIC are right (`_hidden_memory`).

hysim has models of these discovered oscillators:

    z' = A y' - beta |y'| |z|^(n-1) z - gamma y' |z|^n    BoucWenOscillator
    z' = A y' - r z                                       TransferFunction, since all of it is linear:

    Y / U = (s + r) / ((m s^2 + c s + k) (s + r) + A s)
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import in_chunks
from hysim.discovery._hidden_memory import (
    BLOCKS,
    FLOOR,
    OSCILLATOR_SCHEDULE,
    PLANT,
    TermRegression,
    memory_arrays,
    term_regression,
)
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE, signed_area
from hysim.errors import SimulationError
from hysim.identification.marquardt import SumOfSquares, descend
from hysim.kernels import memory_terms as kernels
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_exponent, bouc_wen_terms
from hysim.plants.oscillator import ATTEMPTS, BoucWenOscillator, attracting_state
from hysim.plants.oscillator_structure import OscillatorStructure
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

RATE_DEPENDENT = "rate-dependent hysteresis"

Model = BoucWenOscillator | TransferFunction

SPRING = bouc_wen_terms(1.0)[0]
_CYCLES = 10
_SAMPLES = 65  # of a branch


class State(NamedTuple):
    y: float
    velocity: float
    z: float


def verdict(terms: Iterable[Term]) -> str:
    present = set(terms)
    if RELAXATION in present:
        return LAG if present <= {SPRING, RELAXATION} else RATE_DEPENDENT
    return HYSTERESIS if present - {SPRING} else NO_STRUCTURE


def model(
    plant: Mapping[str, float], law: Mapping[Term, float], structure: OscillatorStructure, state: State
) -> Model | None:
    """Model of an oscillator that begins in a state; None where hysim has none."""
    kind, n = verdict(law), bouc_wen_exponent(law)
    if kind == LAG:
        return _lag(plant, law[RELAXATION], law.get(SPRING, 0.0), structure.hold, state)
    if n is None and kind != NO_STRUCTURE:
        return None
    A, dissipative, conservative = (law.get(term, 0.0) for term in bouc_wen_terms(n or 1.0))
    shape = {"A": A, "beta": -dissipative, "gamma": -conservative, "n": n or 1.0}
    oscillator: BoucWenOscillator = structure.assemble({**plant, **shape})
    if not any(state):
        return oscillator
    return replace(oscillator, initial_state=state[:2], law=replace(oscillator.law, z0=state.z))


def diverges(oscillator: Model | None, y: FloatArray) -> bool:
    """Whether a model's memory diverges on cycles over the range of the displacements `y`, or a lag is unstable."""
    if isinstance(oscillator, TransferFunction):
        return bool((oscillator.poles.real > 0.0).any())
    try:
        steady_loop(oscillator, y)
    except SimulationError:
        return True
    return False


def steady_loop(oscillator: Model | None, y: FloatArray) -> tuple[float, float]:
    """Relative width and signed area of the memory's loop over the range of `y`; nan if it is no Bouc-Wen law."""
    law = oscillator.law if isinstance(oscillator, BoucWenOscillator) else None
    if not isinstance(law, BoucWen):
        return np.nan, np.nan
    path = np.linspace(0.0, 1.0, _SAMPLES)
    one = np.concatenate([path, path[-2::-1]])
    u = y.min() + np.ptp(y) * np.concatenate([one, *[one[1:]] * (_CYCLES - 1)])
    loop = metrics.loop_metrics(u, law.gain * law.memory(u))
    return loop.relative_width, signed_area(loop)


def _lag(plant: Mapping[str, float], relaxation: float, A: float, hold: str, state: State) -> TransferFunction:
    m, c, k = plant["mass"], plant["damping"], plant["stiffness"]
    without_memory = np.polymul([m, c, k], [1.0, -relaxation])
    force = -c * state.velocity - k * state.y - state.z  # of the free response, which no input pushes
    return TransferFunction(
        num=(1.0, -relaxation),
        den=tuple(np.polyadd(without_memory, [A, 0.0]).tolist()),
        hold="zoh" if hold == "zoh" else "foh",
        initial_state=(state.y, state.velocity, force / m) if any(state) else (),
    )


_DIFFERENCES = (3e-4, 3e-5, 3e-6)  # of a parameter, for its slope: the first with which nothing diverges
_STEADY = 1e-9  # relative change of the state from period to period


class Oscillator(NamedTuple):
    plant: dict[str, float]
    coefficients: dict[Term, float]


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
        begins = np.cumsum([0, *map(len, self.records)])

        def work(start: int, stop: int) -> None:
            for k in range(start, stop):
                for record, begin, force_and_step in zip(self.records, begins, self._inputs, strict=False):
                    run = self._run(oscillators[k], *force_and_step)
                    if run is not None:
                        y = np.resize(self.structure.sampled(run[0]), len(record))
                        outputs[k, begin : begin + len(record)] = y

        in_chunks(work, len(oscillators), minimum=1)
        return outputs

    def initial_states(self, oscillator: Oscillator) -> tuple[State, ...]:
        """State at the first sample of each record: rest, or that of the steady motion under a periodic input."""
        runs = [
            self._run(oscillator, *force_and_step) if self.structure.period else None for force_and_step in self._inputs
        ]
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
        slopes, total = self.slopes(oscillator, tuple(oscillator.coefficients)), 0.0
        sizes = np.linalg.norm(slopes, axis=0)
        slopes = slopes / np.where(sizes > 0.0, sizes, 1.0)
        for block in self._blocks:
            fitted = np.ones(residual.size, dtype=bool)
            fitted[block] = False
            change = np.linalg.lstsq(slopes[fitted], residual[fitted], rcond=None)[0]
            total += float(np.sum((residual[block] - slopes[block] @ change) ** 2))
        return float(np.sqrt(total / residual.size))

    @cached_property
    def _blocks(self) -> list[slice]:
        edges = [0]
        for record in self.records:
            period = self.structure.period
            n = len(record) // period if period is not None and len(record) >= 2 * period else BLOCKS
            edges += [edges[-1] + len(record) * (k + 1) // n for k in range(n - 1)] + [edges[-1] + len(record)]
        return [slice(*pair) for pair in itertools.pairwise(edges)]
