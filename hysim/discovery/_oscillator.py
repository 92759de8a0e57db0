"""The oscillator route: a memory found from an oscillator's input and output alone.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

1. A rival without memory, a mass on a linear spring, is identified. About it all terms of the library are tried: if
   none is worth its parameter (BIC), there is no structure.
2. Along the measured motion, with z from the equation of motion and m, c and k projected out, the laws of Bouc and Wen
   with n = 1, 2 and 3 and a linear relaxation are regressed (`_hidden_memory`): the nearest one begins.
3. It is refined by simulation error (`hysim.identify`).
4. About the refined law the whole library is regressed, the law's own terms like all others: PySINDy's STLSQ and plain
   elimination from dense to sparse, one structure by BIC, inclusion by bagging (`_oscillator_response`). Terms that are
   not chosen leave the law, which is refined again. If terms come in, n is no whole number, or the law is none of Bouc
   and Wen's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray, frozen
from hysim._parallel import Progress
from hysim.discovery._hidden_memory import PLANT, HiddenMemory, Regressed
from hysim.discovery._memory_terms import (
    RELAXATION,
    SYMMETRIES,
    MemoryTerm,
    bouc_wen_terms,
    equation,
    memory_terms,
)
from hysim.discovery._oscillator_response import Oscillator, Response
from hysim.discovery._term_regression import TermRegression
from hysim.identification import Identification, identify
from hysim.models.equation_of_motion import Linear, linear_plant
from hysim.models.oscillator import BoucWenOscillator
from hysim.models.oscillator_structure import OscillatorStructure
from hysim.records import Record

HYSTERESIS = "rate-independent hysteresis"
LAG = "linear lag"
NO_STRUCTURE = "no structure found"
RATE_DEPENDENT = "rate-dependent hysteresis"
OTHER = "rate-independent hysteresis, not of Bouc and Wen"

N_DRAWS = 20

_SURE = 0.9  # inclusion below which the message names a term of the law
_LARGEST_CONDITION = 1e4
_REPEATS = 1e-3  # of the input's rms: how nearly a period must repeat itself to be seen
_TRANSIENT = 1.5  # rms of what changes from period to period, early in the period over late
_STEPS = 5


@frozen
class FoundOscillator:
    """An oscillator and the law of its memory, found from input and output.

    Parameters
    ----------
    model : BoucWenOscillator
        Refined by simulation error. Without structure, or with a lag, a linear oscillator whose law has A = 0;
        where the law is none of Bouc and Wen's, the nearest that is.
    coefficients, stderr : mapping
        Term to coefficient and to its standard error; `stderr` also has those of the plant that were not given.
        Of a law that `model` has, A is that of ``"u'"``, -beta of ``"|u'| z"`` and -gamma of ``"u' |z|"``.
    equation : str
        The law as text.
    verdict : str
        ``"rate-independent hysteresis"``, the same with ``", not of Bouc and Wen"``, ``"linear lag"`` or
        ``"no structure found"``.
    mass, damping, stiffness : float
        Of the plant; without structure the stiffness is that of all springs.
    regressed : mapping
        Coefficients before the refinement, from the regression along the measured motion.
    inclusion : mapping
        Term to the share of fits to resampled data that keep it, for every term of the library that can be told.
    left_out : tuple of str
        Terms whose effects these records cannot tell from the plant's or from those of terms of lower degree.
    scores : mapping
        ``"fit_percent"`` [%], ``"rmse"`` [unit of y], ``"bic"`` of the free run; ``"held_out_rmse"`` [unit of y], on
        each period (or quarter) with the coefficients of the others; ``"linear_rmse"`` and ``"linear_bic"`` of the
        rival without memory; ``"condition"`` of the regression on all terms.
    path_terms : tuple of str
        The structures that were compared, from dense to sparse, each as its terms joined by commas.
    path_n_terms, path_bic, path_held_out_rmse : array, shape (n_structures,)
        Their sizes, BIC, and rmse on what is held out [unit of y]: for a Pareto figure.
    message : str
        What to know about all this.
    """

    model: BoucWenOscillator
    coefficients: Mapping[str, float]
    stderr: Mapping[str, float]
    equation: str
    verdict: str
    mass: float
    damping: float
    stiffness: float
    regressed: Mapping[str, float]
    inclusion: Mapping[str, float]
    left_out: tuple[str, ...]
    scores: Mapping[str, float]
    path_n_terms: FloatArray
    path_bic: FloatArray
    path_held_out_rmse: FloatArray
    path_terms: tuple[str, ...]
    message: str


def oscillator(
    records: Sequence[Record],
    *,
    structure: OscillatorStructure | None = None,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float | None = None,
    degree: int = 3,
    symmetry: str = "none",
    seed: int = 0,
    progress: Progress | None = None,
) -> FoundOscillator:
    """Find the hidden memory of ``m y'' + c y' + k y + z = u`` from u and y.

    Parameters
    ----------
    records : sequence of Record
        Force, displacement and time, evenly spaced; all of one plant. They must be long enough to hold several
        swings, and large enough for the memory to be curved: only that tells A from k.
    structure : OscillatorStructure, optional
        How the records were made, from ``BoucWenOscillator.structure(...)``. By default a record whose input
        repeats itself and whose periods are alike is taken as steady, its input as band-limited or as linear between
        samples, whichever fits better; any other record as beginning at rest, its input as linear between samples.
    mass, damping, stiffness : float, optional
        Known parts of the plant.
    degree : {1, 2, 3}
        Highest power of z in the library.
    symmetry : {"none", "odd"}
        Whether terms are left out that do not change their sign with u and z.
    seed : int
        Of the resampling behind `FoundOscillator.inclusion`.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    FoundOscillator

    Raises
    ------
    ValueError
        If a record has no even time, is too short, has a constant signal or is not that of a mass on springs, or an
        option is unknown.
    TypeError
        If an argument is not a record, or `structure` is not one.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> from hysim.discovery._oscillator import oscillator
    >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
    >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    >>> t = np.arange(300) / 750
    >>> u = 60 * np.sin(2 * np.pi * (20 + 40 * t) * t)
    >>> found = oscillator([hs.Record(u=u, y=hs.simulate(plant, t, u).y, t=t)])
    >>> found.equation
    "z' = 50000 u' - 800 |u'| z + 300 u' |z|"
    """
    known = _known({"mass": mass, "damping": damping, "stiffness": stiffness})
    chosen, given = _checked(records, structure, degree, symmetry), tuple(records)
    response = Response(chosen, given, known)
    library = memory_terms(degree, symmetry)
    others = () if structure is not None or chosen.period is None else (replace(chosen, hold="foh"),)
    return _Search(chosen, others, given, response, library, seed, progress or (lambda done, total: None)).found()


def recorded(record: Record) -> OscillatorStructure:
    """How a record seems to have been made; see `oscillator`.

    Parameters
    ----------
    record : Record
        With an even time.

    Returns
    -------
    OscillatorStructure
    """
    period = _period(record.u)
    if period is None or not _is_steady(record.y, period):
        return BoucWenOscillator.structure()
    return BoucWenOscillator.structure(initial="periodic", period=period, hold="band-limited")


class _Fitted(NamedTuple):
    """A refined oscillator, the standard errors by name, what it leaves (n_samples,), and its or the nearest model."""

    oscillator: Oscillator
    stderr: dict[str, float]
    residual: FloatArray
    model: BoucWenOscillator
    verdict: str

    def bic(self, floor: float) -> float:
        """Bayesian information criterion, all that has a standard error counted."""
        n = self.residual.size
        return float(n * np.log(np.mean(self.residual**2) + floor**2) + len(self.stderr) * np.log(n))


class _Tried(NamedTuple):
    """The library tried about a refined oscillator: its structures from dense to sparse, and the one chosen."""

    fitted: _Fitted
    regression: TermRegression
    structures: list[tuple[MemoryTerm, ...]]
    chosen: tuple[MemoryTerm, ...]

    @property
    def beyond(self) -> set[MemoryTerm]:
        """What is chosen and not in the law."""
        return set(self.chosen) - set(self.fitted.oscillator.coefficients)


class _Search(NamedTuple):
    structure: OscillatorStructure
    others: tuple[OscillatorStructure, ...]
    records: tuple[Record, ...]
    response: Response
    library: tuple[MemoryTerm, ...]
    seed: int
    progress: Progress

    def found(self) -> FoundOscillator:
        """Steps 1 to 4."""
        memory = self._along()
        elastic = self._without_memory(memory.linear)
        self.progress(1, _STEPS)
        first = _tried(elastic, memory.regression(self.library))
        self.progress(2, _STEPS)
        if not first.chosen:
            return self._described(first, elastic, {})
        nearest = memory.nearest()
        self.progress(3, _STEPS)
        searches = [self, *(self._made(structure) for structure in self.others)]
        refined = [(search, search._refined(nearest, elastic)) for search in searches]
        best, fitted = min(refined, key=lambda each: float(each[1].residual @ each[1].residual))
        self.progress(4, _STEPS)
        return best._judged(fitted, elastic, nearest)

    def _made(self, structure: OscillatorStructure) -> "_Search":
        """The same search with another belief about how the records were made."""
        return self._replace(structure=structure, response=replace(self.response, structure=structure))

    def _judged(self, fitted: _Fitted, elastic: _Fitted, nearest: Regressed) -> FoundOscillator:
        found = self._tried(fitted)
        law = found.fitted.oscillator.coefficients
        if found.fitted.verdict == HYSTERESIS and set(found.chosen) < set(law):
            found = self._tried(self._bouc_wen([term for k, term in enumerate(law) if not k or term in found.chosen]))
        if found.beyond:
            found = self._widened(found)
        if found.fitted.bic(found.regression.floor) >= elastic.bic(found.regression.floor):
            found = found._replace(fitted=elastic)
        return self._described(found, elastic, nearest.coefficients)

    def _along(self) -> HiddenMemory:
        motions = [self.structure.motion(record) for record in self.records]
        linear = linear_plant(motions[0])
        if linear is None:
            raise ValueError(
                "no plant with a positive mass is near: check the sign of u and y, and the time; or the motion is too "
                "far from that of a linear spring"
            )
        return HiddenMemory(motions, linear, self.response.known)

    def _without_memory(self, linear: Linear) -> _Fitted:
        """The rival: without a memory, or with z = A y where the linear spring is known."""
        plant: dict[str, float] = {**linear._asdict(), **self.response.known}
        springs = {bouc_wen_terms(1.0)[0]: linear.stiffness - plant["stiffness"]}
        found = Oscillator(plant, springs if "stiffness" in self.response.known else {})
        return self._simulated(found, None)

    def _refined(self, nearest: Regressed, elastic: _Fitted) -> _Fitted:
        """Step 3."""
        if RELAXATION in nearest.coefficients:
            return self._simulated(Oscillator(nearest.plant, nearest.coefficients), elastic.model)
        return self._bouc_wen(list(nearest.coefficients))

    def _bouc_wen(self, terms: Sequence[MemoryTerm]) -> _Fitted:
        """Identified with these terms of Bouc and Wen's law, u' first; without any, with all of them and n free."""
        fixed = {"n": terms[1].power} if terms else {}
        for rectified, name in ((True, "beta"), (False, "gamma")):
            if terms and all(term.rectified != rectified for term in terms[1:]):
                fixed[name] = 0.0
        fit = self._identified(fixed)
        numbers = fit.estimates
        names = {"A": 1.0, "beta": -1.0, "gamma": -1.0}
        law = {
            term: (sign * numbers[name], name)
            for term, (name, sign) in zip(bouc_wen_terms(numbers["n"]), names.items(), strict=True)
            if name not in fixed
        }
        stderr = {name: value for name, value in fit.stderr.items() if name not in names}
        stderr |= {term.name: fit.stderr[name] for term, (_, name) in law.items()}
        oscillator = Oscillator(
            {name: numbers[name] for name in PLANT}, {term: value for term, (value, _) in law.items()}
        )
        return _Fitted(oscillator, stderr, fit.residual, fit.model, HYSTERESIS)

    def _simulated(self, oscillator: Oscillator, model: BoucWenOscillator | None) -> _Fitted:
        """A law that is none of Bouc and Wen's, refined by the simulation behind the regression.

        Without a model it is linear, and that of a linear spring.
        """
        found = self.response.descended(oscillator)
        terms = tuple(found.coefficients)
        residual = self.response.measured - self.response.outputs([found])[0]
        J = self.response.slopes(found, terms)
        size = np.linalg.norm(J, axis=0)
        variance = float(residual @ residual) / max(residual.size - size.size, 1)
        errors = np.sqrt(variance * np.diag(np.linalg.pinv((J / size).T @ (J / size)))) / size
        names = (*self.response.free, *(term.name for term in terms))
        linear = all(term.relaxing or term == bouc_wen_terms(1.0)[0] for term in terms)
        verdict = LAG if linear else RATE_DEPENDENT if RELAXATION in terms else OTHER
        if model is None:
            verdict = NO_STRUCTURE
            springs = found.plant["stiffness"] + sum(found.coefficients.values())
            numbers = {"A": 0.0, "beta": 0.0, "gamma": 0.0, "n": 1.0, **found.plant, "stiffness": springs}
            model = self.structure.assemble(numbers)
        return _Fitted(found, dict(zip(names, errors.tolist(), strict=True)), residual, model, verdict)

    def _widened(self, found: _Tried) -> _Tried:
        """With n free where that is worth more than the terms that come in, else with these terms."""
        free = self._tried(self._bouc_wen(()))
        if not free.beyond and free.fitted.bic(free.regression.floor) < found.regression.bic(found.chosen):
            return free
        regression, coefficients = found.regression, dict(found.fitted.oscillator.coefficients)
        law = {term: coefficients.get(term, 0.0) for term in regression.terms if term in found.chosen}
        return self._tried(self._simulated(Oscillator(found.fitted.oscillator.plant, law), free.fitted.model))

    def _tried(self, fitted: _Fitted) -> _Tried:
        """Step 4; where n is free, the terms that differ from the law's own by their power are no others."""
        law = fitted.oscillator.coefficients
        same = {(term.rectified, term.even) for term in law if not (term.whole or term.relaxing)}
        library = [term for term in self.library if not term.power or (term.rectified, term.even) not in same]
        return _tried(fitted, self.response.regression(fitted.oscillator, fitted.residual, library))

    def _identified(self, fixed: Mapping[str, float]) -> Identification:
        return identify(self.structure, self.records, fixed={**fixed, **self.response.known})

    def _described(self, found: _Tried, elastic: _Fitted, regressed: Mapping[MemoryTerm, float]) -> FoundOscillator:
        fitted, regression = found.fitted, found.regression
        measured = self.response.measured
        law = {} if fitted.verdict == NO_STRUCTURE else fitted.oscillator.coefficients
        coefficients = {term.name: value for term, value in law.items()}
        shares = regression.inclusion(np.random.default_rng(self.seed), N_DRAWS)
        inclusion = {term.name: share for term, share in shares.items()}
        plant = fitted.oscillator.plant
        if fitted.verdict == NO_STRUCTURE:
            plant = plant | {"stiffness": fitted.model.stiffness}
        structures = found.structures
        self.progress(_STEPS, _STEPS)
        return FoundOscillator(
            model=fitted.model,
            coefficients=coefficients,
            stderr=fitted.stderr,
            equation=equation(coefficients),
            verdict=fitted.verdict,
            **plant,
            regressed={term.name: value for term, value in regressed.items()},
            inclusion=inclusion,
            left_out=tuple(term.name for term in regression.dependent),
            scores={
                "fit_percent": metrics.fit_percent(measured, measured - fitted.residual),
                "rmse": float(np.sqrt(np.mean(fitted.residual**2))),
                "bic": fitted.bic(regression.floor),
                "held_out_rmse": regression.held_out_rmse([term for term in regression.terms if term in law]),
                "linear_rmse": float(np.sqrt(np.mean(elastic.residual**2))),
                "linear_bic": elastic.bic(regression.floor),
                "condition": regression.condition,
            },
            path_n_terms=np.array([len(terms) for terms in structures], dtype=float),
            path_bic=np.array([regression.bic(terms) for terms in structures]),
            path_held_out_rmse=np.array([regression.held_out_rmse(terms) for terms in structures]),
            path_terms=tuple(", ".join(term.name for term in terms) for terms in structures),
            message=_message(found, coefficients, inclusion),
        )


def _tried(fitted: _Fitted, regression: TermRegression) -> _Tried:
    paths = {*regression.thresholded(), *regression.eliminated()}
    structures = sorted(paths, key=lambda terms: (-len(terms), regression.bic(terms)))
    return _Tried(fitted, regression, structures, regression.best(structures))


def _message(found: _Tried, law: Mapping[str, float], inclusion: Mapping[str, float]) -> str:
    """What to know, in the order of weight."""
    regression, parts = found.regression, []
    if found.fitted.verdict == NO_STRUCTURE:
        parts.append("no term of the library is worth its parameter beside a linear spring")
    elif found.beyond:
        parts.append(f"the records ask for more terms: {', '.join(term.name for term in sorted(found.beyond))}")
    if found.fitted.verdict in (OTHER, RATE_DEPENDENT, LAG):
        parts.append("the model is the nearest oscillator of Bouc and Wen's or a linear one, not this law")
    doubtful = [name for name in law if inclusion.get(name, 0.0) < _SURE]
    if doubtful:
        parts.append(f"not in every resampled fit: {', '.join(doubtful)}")
    if regression.condition > _LARGEST_CONDITION:
        parts.append(f"terms are hard to tell apart here (condition {regression.condition:.0e})")
    return "; ".join(parts) or "every term is needed, and no other"


def _checked(
    records: Sequence[Record],
    structure: OscillatorStructure | None,
    degree: int,
    symmetry: str,
) -> OscillatorStructure:
    if not isinstance(records, Sequence) or not all(isinstance(record, Record) for record in records) or not records:
        raise TypeError(f"oscillator takes a sequence of records, got {type(records).__name__}")
    if degree not in (1, 2, 3):
        raise ValueError(f"degree must be 1, 2 or 3, got {degree!r}")
    if symmetry not in SYMMETRIES:
        raise ValueError(f"symmetry must be one of {', '.join(SYMMETRIES)}, got {symmetry!r}")
    if structure is None:
        made = {recorded(record) for record in records}
        if len(made) > 1:
            raise ValueError("the records were not all made alike: say how by structure=, or find on each of them")
        return made.pop()
    if not isinstance(structure, OscillatorStructure):
        raise TypeError(f"structure comes from BoucWenOscillator.structure(...), got {type(structure).__name__}")
    if structure.excitation != "force":
        raise ValueError('the input must be a force: structure(excitation="force")')
    return structure


def _known(given: Mapping[str, float | None]) -> dict[str, float]:
    known = {name: float(value) for name, value in given.items() if value is not None}
    for name, value in known.items():
        if not np.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
    if known.get("mass", 1.0) <= 0.0:
        raise ValueError(f"mass must be positive, got {known['mass']}")
    return known


def _period(u: FloatArray) -> int | None:
    """The smallest shift, up to half of the record, by which an input repeats itself."""
    n = u.size
    if np.ptp(u) == 0.0:
        return None
    centred = u - u.mean()
    squares = np.concatenate([[0.0], np.cumsum(centred**2)])
    shifts = np.arange(1, n // 2 + 1)
    spectrum = np.fft.rfft(centred, 2 * n)
    products = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n)[shifts]
    differences = squares[n - shifts] + squares[n] - squares[shifts] - 2.0 * products
    repeats = differences <= _REPEATS**2 * (n - shifts) * squares[n] / n
    left = int(np.argmax(differences > 0.5 * (n - shifts) * squares[n] / n))  # where the input has left its beginning
    repeats[:left] = False
    return int(shifts[np.argmax(repeats)]) if repeats.any() else None


def _is_steady(y: FloatArray, period: int) -> bool:
    """Whether what changes between the first and the last period is no transient, which would be larger at first."""
    first, last = y[:period], y[y.size // period * period - period : y.size // period * period]
    early, late = (float(np.std(part)) for part in np.array_split(first - last, 4)[::3])
    return early <= max(_TRANSIENT * late, 1e-6 * float(np.std(y)))
