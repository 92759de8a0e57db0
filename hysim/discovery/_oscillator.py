"""The verb `discover_oscillator`: candidates for the law of the memory of an oscillator, and the choice of one.

1. A mass on a linear spring is refined by simulation error, as all laws are.
2. So are a linear relaxation and the Bouc-Wen law of the whole n nearest to what the measured motion shows
   (`hysim.plants.oscillator_structure`). Where neither has a lower BIC than the spring, there is no structure.
3. About the better one the output is linearised in all terms of the library: one structure by BIC among the best
   subsets, inclusion by bagging. If terms come in, the Bouc-Wen law is refined with n free and with n at the nearest
   whole number. Then the terms chosen about the best law are refined, until the choice stays the same.
4. Where the records may have another structure, and the best law has a lower BIC by it, step 3 is repeated there.
5. Of all refined laws that do not diverge, the linear spring among them, the one of the lowest BIC is taken; every
   number that has a standard error counts as a parameter.

hysim has models of these discovered oscillators:

    z' = A y' - beta |y'| |z|^(n-1) z - gamma y' |z|^n    BoucWenOscillator
    z' = A y' - r z                                       TransferFunction, since all of it is linear:

    Y / U = (s + r) / ((m s^2 + c s + k) (s + r) + A s)
"""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim import metrics, signals
from hysim._basics.frozen import FloatArray, Positive, checked, items
from hysim._basics.progress import Progress, Reports, reports
from hysim.discovery._hidden_memory import (
    EXPONENTS,
    PLANT,
    SPRING,
    Oscillator,
    Response,
    State,
    TermRegression,
    bouc_wen_numbers,
    is_polynomial,
    library,
    of_bouc_wen,
)
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE, signed_area
from hysim.discovery._result import OscillatorDiscovery
from hysim.discovery._search import INDISTINCT, WIDTH
from hysim.errors import SimulationError
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_exponent, law_text
from hysim.models.search_space import Freedom
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.oscillator_structure import Linear, OscillatorStructure, linear_plant
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record, several

N_DRAWS = 20

_SURE = 0.9  # inclusion below which a warning names a term of the law
_LARGEST_CONDITION = 1e4
_AT_BOUND = 1e-3  # relative distance from a bound below which a parameter is at it
_STEPS = 5
_ROUNDS = 5  # of choosing terms about a law of any terms
_NO_MODEL = (
    "There is no model of this law: the memory of an oscillator is simulated where it is a Bouc-Wen law or a linear "
    "relaxation."
)
_DIVERGES = "A law of lower BIC diverges on cycles over the measured range, and is left out."
_CYCLES, _SAMPLES = 10, 128  # of the path along which a memory shows its steady loop

RATE_DEPENDENT = "rate-dependent hysteresis"

Model = BoucWenOscillator | TransferFunction


def verdict(terms: Iterable[Term]) -> str:
    present = set(terms)
    if RELAXATION in present:
        return LAG if present <= {SPRING, RELAXATION} else RATE_DEPENDENT
    return HYSTERESIS if present - {SPRING} else NO_STRUCTURE


def model(oscillator: Oscillator, structure: OscillatorStructure, state: State) -> Model | None:
    """Model of an oscillator that begins in a state; None if hysim has no such model."""
    plant, law = oscillator
    kind, n = verdict(law), bouc_wen_exponent(law)
    if kind == LAG:
        return _lag(plant, law[RELAXATION], law.get(SPRING, 0.0), structure.hold, state)
    if n is None and kind != NO_STRUCTURE:
        return None
    at_rest: BoucWenOscillator = structure.assemble(bouc_wen_numbers(oscillator))
    if not any(state):
        return at_rest
    return replace(at_rest, initial_state=state[:2], law=replace(at_rest.law, z0=state.z))


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
    u = signals.triangle(float(y.min()), float(y.max()), cycles=_CYCLES, samples_per_cycle=_SAMPLES)
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


class _Fitted(NamedTuple):
    """An oscillator that a search refined, the standard errors by name, its residual (n_samples,), and warnings."""

    search: "Search"
    oscillator: Oscillator
    stderr: dict[str, float]
    residual: FloatArray
    warnings: tuple[str, ...] = ()
    regressed: Mapping[Term, float] = {}

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(self.oscillator.coefficients)

    @property
    def bic(self) -> float:
        return metrics.bic(self.residual, len(self.stderr), floor=self.search.response.floor)

    @property
    def diverges(self) -> bool:
        response = self.search.response
        return diverges(model(self.oscillator, response.structure, State(0.0, 0.0, 0.0)), response.widest.y)


class _Tried(NamedTuple):
    """The library tried about a refined oscillator: its structures from dense to sparse, and the one chosen."""

    fitted: _Fitted
    regression: TermRegression
    structures: list[tuple[Term, ...]]
    chosen: tuple[Term, ...]

    @property
    def beyond(self) -> set[Term]:
        return set(self.chosen) - set(self.fitted.terms)


def _bic(tried: _Tried) -> float:
    """BIC; that of a law without a model is lower only where it is so by more than INDISTINCT."""
    terms = tried.fitted.terms
    has_model = verdict(terms) in (LAG, NO_STRUCTURE) or bouc_wen_exponent(terms) is not None
    return tried.fitted.bic + (0.0 if has_model else INDISTINCT)


class Search(NamedTuple):
    """The response of oscillators on records of one structure, and the library of terms."""

    response: Response
    library: tuple[Term, ...]
    seed: int
    progress: Progress

    def result(self, others: Sequence[OscillatorStructure] = ()) -> OscillatorDiscovery:
        """Steps 1 to 5; `others` are other structures that the records may have."""
        motions = [self.response.structure.motion(record) for record in self.response.records]  # each is checked
        linear = linear_plant(motions[0])
        if linear is None:
            advice = "check the sign of u and y, and the time; or the motion is too far from that of a linear spring"
            raise ValueError(f"no plant with a positive mass is near: {advice}")
        elastic = self._without_memory(linear)
        self.progress(1, _STEPS)
        try:
            begun, failure = self._begun(elastic.oscillator), tuple[str, ...]()
        except ValueError as error:
            begun, failure = elastic, (f"A law with memory was tried and could not be refined: {error}.",)
        self.progress(2, _STEPS)
        if begun.bic >= elastic.bic:
            return self._described(self._about(elastic), elastic, {}, failure)
        candidates = self._candidates(self._about(begun))
        self.progress(3, _STEPS)
        best = min(candidates, key=_bic).fitted
        for structure in others:
            with contextlib.suppress(ValueError):  # the candidates by the other belief stay
                search = self._replace(response=replace(self.response, structure=structure))
                again = search._refined(best.oscillator, any_exponent="n" in best.stderr)
                if again.bic < best.bic:
                    candidates += search._candidates(search._about(again))
        self.progress(4, _STEPS)
        regressed = {} if RELAXATION in begun.terms else begun.regressed
        ranked = sorted(candidates, key=_bic)
        for rank, each in enumerate(ranked):
            if _bic(each) < elastic.bic and not each.fitted.diverges:
                return each.fitted.search._described(each, elastic, regressed, (_DIVERGES,) if rank else ())
        lost = (_DIVERGES,) if _bic(ranked[0]) < elastic.bic else ()
        return ranked[0].fitted.search._described(ranked[0]._replace(fitted=elastic), elastic, {}, lost)

    def _without_memory(self, linear: Linear) -> _Fitted:
        """The linear spring. Where the stiffness is known, z = A y is the rest of the spring."""
        plant: dict[str, float] = {**linear._asdict(), **self.response.known}
        springs = {SPRING: linear.stiffness - plant["stiffness"]} if "stiffness" in self.response.known else {}
        refined = self._refined(Oscillator(plant, springs))
        plant, law = refined.oscillator
        plant = plant | {"stiffness": plant["stiffness"] + law.get(SPRING, 0.0)}
        stderr = {"stiffness" if name == SPRING.name else name: value for name, value in refined.stderr.items()}
        return refined._replace(oscillator=Oscillator(plant, {}), stderr=stderr)

    def _begun(self, elastic: Oscillator) -> _Fitted:
        """Step 2: the better of a linear relaxation and the Bouc-Wen law whose whole n is nearest."""
        mass, _, total = (elastic.plant[name] for name in PLANT)
        stiffness = self.response.known.get("stiffness", 0.5 * total)
        relaxing = {SPRING: total - stiffness, RELAXATION: -float(np.sqrt(total / mass))}
        plant = elastic.plant | {"stiffness": stiffness}
        return self._refined(Oscillator(plant, relaxing), *self._starts(_whole(self._starts()[0])))

    def _candidates(self, first: _Tried) -> list[_Tried]:
        """Step 3: the law; where it lacks terms, also n free and at the nearest whole number; and what these lack."""
        candidates = [first]
        if first.beyond:
            with contextlib.suppress(ValueError):  # the first law stays
                candidates.append(self._about(self._refined(*self._starts(), any_exponent=True)))
                n = _whole(candidates[1].fitted.oscillator)
                if n != bouc_wen_exponent(first.fitted.terms):
                    candidates.append(self._about(self._refined(*self._starts(n))))
        with contextlib.suppress(ValueError):
            for _ in range(_ROUNDS):
                law = _asked_for(candidates)
                candidates.append(self._about(self._refined(law, any_exponent=not is_polynomial(law.coefficients))))
        return candidates

    def _starts(self, n: float | None = None) -> list[Oscillator]:
        """Bouc-Wen laws along the measured motion, the nearest one first; without `n` it is free."""
        fixed = dict(self.response.known) if n is None else {**self.response.known, "n": n}
        freedom = Freedom(fixed=fixed, bounds={"n": EXPONENTS} if n is None else {})
        space = self.response.structure.search_space(self.response.widest, freedom)
        each = [space.parameters(x[np.newaxis]) for x in space.starts]
        return [of_bouc_wen({name: float(value[0]) for name, value in values.items()}) for values in each]

    def _refined(self, *starts: Oscillator, any_exponent: bool = False) -> _Fitted:
        """The best law of those refined by simulation from some starts; a ValueError if all diverge."""
        refined = [end for start in starts if (end := self._ended(start, any_exponent)) is not None]
        if not refined:
            advice = "check the units, the time, and the sign of u and y"
            raise ValueError(f"the oscillator nearest to the records diverges, or does not become steady: {advice}")
        return min(refined, key=lambda each: each.bic)

    def _ended(self, start: Oscillator, any_exponent: bool) -> _Fitted | None:
        refined, at_rest = self.response.descended(start, any_exponent=any_exponent)
        terms = tuple(refined.coefficients)
        residual = self.response.measured - self.response.outputs([refined])[0]
        J = self.response.slopes(refined, terms, any_exponent=any_exponent)
        size = np.linalg.norm(J, axis=0)
        if not (np.isfinite(residual).all() and (size > 0.0).all()):
            return None
        variance = float(residual @ residual) / max(residual.size - size.size, 1)
        errors = np.sqrt(variance * np.diag(np.linalg.pinv((J / size).T @ (J / size)))) / size
        names = [*self.response.free, *(term.named("z") for term in terms), *["n"] * any_exponent]
        warnings = [] if at_rest else ["The refinement did not converge."]
        if any_exponent:
            n = bouc_wen_exponent(terms) or 1.0
            reached = [bound for bound in EXPONENTS if abs(n - bound) < _AT_BOUND * bound]
            warnings += [f"The exponent n reached its search bound {bound:g}." for bound in reached]
        stderr = dict(zip(names, errors.tolist(), strict=True))
        return _Fitted(self, refined, stderr, residual, tuple(warnings), start.coefficients)

    def _about(self, fitted: _Fitted) -> _Tried:
        """The library about a law; where n is free, without the terms that differ from the law's own by their power."""
        law = fitted.oscillator.coefficients
        same = {(t.rectified, t.is_even_in_memory) for t in law if not (t.is_polynomial or t.relaxing)}
        library = [t for t in self.library if not t.degree or (t.rectified, t.is_even_in_memory) not in same]
        return _tried(fitted, self.response.regression(fitted.oscillator, fitted.residual, library))

    def _described(
        self, tried: _Tried, elastic: _Fitted, regressed: Mapping[Term, float], warnings: tuple[str, ...] = ()
    ) -> OscillatorDiscovery:
        fitted, regression, structures = tried.fitted, tried.regression, tried.structures
        plant, law = fitted.oscillator
        measured, response = self.response.measured, self.response
        coefficients = _by_name(law)
        inclusion = _by_name(regression.inclusion(np.random.default_rng(self.seed), N_DRAWS))
        states = response.initial_states(fitted.oscillator)
        models = [model(fitted.oscillator, response.structure, state) for state in states]
        nothing = (_NO_MODEL,) if models[0] is None else ()
        warnings = (*nothing, *warnings, *fitted.warnings, *_warnings(tried, inclusion))
        free_exponent = {"n": bouc_wen_exponent(law) or np.nan} if "n" in fitted.stderr else {}
        held_out = np.array([regression.held_out_rmse(terms) for terms in structures])
        width, area = steady_loop(models[0] if law else None, response.widest.y)
        self.progress(_STEPS, _STEPS)
        return OscillatorDiscovery(
            model=models[0],
            models=tuple(each for each in models if each is not None),
            coefficients=coefficients,
            stderr=fitted.stderr,
            equation=f"{law_text(coefficients, 'z')}, {_motion(plant)}",
            verdict=verdict(fitted.terms),
            scores={
                "fit_percent": metrics.fit_percent(measured, measured - fitted.residual),
                "rmse": float(np.sqrt(np.mean(fitted.residual**2))),
                "bic": fitted.bic,
                "held_out_rmse": response.held_out_rmse(fitted.oscillator, fitted.residual),
                "linear_rmse": float(np.sqrt(np.mean(elastic.residual**2))),
                "linear_held_out_rmse": response.held_out_rmse(elastic.oscillator, elastic.residual),
                "linear_bic": elastic.bic,
                "n_terms": len(coefficients),
                "n_structures": len(structures),
                "condition": regression.condition,
            },
            n_parameters=len(fitted.stderr),
            parameters=plant | free_exponent,
            initial="rest" if response.structure.period is None else "periodic",
            initial_states=tuple(dict(zip(("y0", "y'0", "z0"), state, strict=True)) for state in states),
            rival=TransferFunction(num=(1.0,), den=tuple(elastic.oscillator.plant[name] for name in PLANT), hold="foh"),
            regressed=_by_name(regressed),
            inclusion=inclusion,
            left_out=tuple(term.named("z") for term in regression.dependent),
            path_n_terms=np.array([len(terms) for terms in structures], dtype=float),
            path_bic=np.array([regression.bic(terms) for terms in structures]),
            path_fit_percent=100.0 * (1.0 - held_out / float(np.std(measured))),
            path_terms=tuple(", ".join(term.named("z") for term in terms) for terms in structures),
            relative_width=width,
            dissipation=area,
            message=_message(verdict(fitted.terms), warnings),
            warnings=warnings,
        )


def _tried(fitted: _Fitted, regression: TermRegression) -> _Tried:
    law = tuple(term for term in regression.terms if term in fitted.terms)
    tried = {*regression.eliminated(WIDTH), law} - {()}
    structures = sorted(tried, key=lambda terms: (-len(terms), regression.bic(terms), terms))
    return _Tried(fitted, regression, structures, regression.best(structures))


def _whole(oscillator: Oscillator) -> float:
    """The whole exponent nearest to that of a Bouc-Wen law."""
    return float(max(round(bouc_wen_exponent(oscillator.coefficients) or 1.0), 1))


def _asked_for(candidates: Sequence[_Tried]) -> Oscillator:
    """Start of the law with the terms that the best candidate's regression chose; a ValueError if it was tried."""
    best = min(candidates, key=_bic)
    if best.beyond:  # terms beside those of a free n cannot be refined
        best = min((each for each in candidates if is_polynomial(each.fitted.terms)), key=_bic)
    plant, coefficients = best.fitted.oscillator
    if not best.chosen or set(best.chosen) in [set(each.fitted.terms) for each in candidates]:
        raise ValueError("nothing is lacking")
    return Oscillator(
        plant, {term: coefficients.get(term, 0.0) for term in best.regression.terms if term in best.chosen}
    )


def _by_name(values: Mapping[Term, float]) -> dict[str, float]:
    return {term.named("z"): value for term, value in values.items()}


def _motion(plant: Mapping[str, float]) -> str:
    text = f"{plant['mass']:.6g} y'' + {plant['damping']:.6g} y' + {plant['stiffness']:.6g} y + z = u"
    return text.replace("+ -", "- ")


def _message(kind: str, warnings: Sequence[str]) -> str:
    if kind == NO_STRUCTURE:
        return "no term of the library lowers the BIC of a linear spring"
    if kind == RATE_DEPENDENT:
        return "the memory depends on the rate"
    return "" if warnings else "every term is needed, and no other"


def _warnings(tried: _Tried, inclusion: Mapping[str, float]) -> tuple[str, ...]:
    parts = []
    if verdict(tried.fitted.terms) != NO_STRUCTURE and tried.beyond:
        parts.append(f"More terms would lower the BIC: {', '.join(term.named('z') for term in sorted(tried.beyond))}.")
    names = [term.named("z") for term in tried.fitted.terms]
    doubtful = [name for name in names if inclusion.get(name, 0.0) < _SURE]
    if doubtful:
        parts.append(f"Some terms are not in every fit to resampled data: {', '.join(doubtful)}.")
    if tried.fitted.terms and tried.regression.condition > _LARGEST_CONDITION:
        parts.append(f"The terms are nearly collinear on these records (condition {tried.regression.condition:.0e}).")
    return tuple(parts)


_REPEATS = 1e-3  # of the input's rms: largest difference of two periods that count as alike
_TRANSIENT = 1.5  # rms of what changes from period to period, early in the period over late


@reports
def discover_oscillator(
    record_or_records: Record | Sequence[Record],
    *,
    structure: OscillatorStructure | None = None,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float | None = None,
    degree: int = 3,
    symmetry: str | None = None,
    seed: int = 0,
    progress: Reports = None,
) -> OscillatorDiscovery:
    """Discover the law of the memory in a mass on a hysteretic spring, ``m y'' + c y' + k y + z = u``.

    Plant and law are found together, from force u and displacement y. Bouc-Wen laws, a linear relaxation and laws of
    other terms are refined by the error of the simulated oscillator; the one of lowest BIC is taken.

    Parameters
    ----------
    record_or_records : Record or sequence of Record
        Force, displacement and time, evenly spaced; all of one plant. They must hold several swings, large enough for
        the memory to be curved: only its curvature distinguishes A from k.
    structure : OscillatorStructure, optional
        How the records were made, from ``BoucWenOscillator.structure(...)``. By default a record is taken as steady if
        its input repeats itself and its periods are alike, otherwise as beginning at rest.
    mass, damping, stiffness : float, optional
        Known parts of the plant [u per unit of y''; y'; y].
    degree : {1, 2, 3}
        Highest power of z in the library of terms.
    symmetry : {None, "odd"}
        ``"odd"`` leaves out terms that do not change their sign with u and z.
    seed : int
        Seed of the resampling behind `OscillatorDiscovery.inclusion`.
    progress : callable or False, optional
        Called as ``progress(done, total)``; see `hysim.simulate`.

    Returns
    -------
    OscillatorDiscovery

    Raises
    ------
    ValueError
        If a record has no even time, is too short, constant or not that of a mass on springs, or an option is unknown.
    TypeError
        If the first argument is no record or sequence of them, `structure` is none, or a part of the plant no number.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
    >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    >>> t = np.arange(300) / 750
    >>> u = 60 * np.sin(2 * np.pi * (20 + 40 * t) * t)
    >>> dis = hs.discover_oscillator(hs.Record(u=u, y=hs.simulate(plant, t, u).y, t=t))
    >>> {term: round(value) for term, value in dis.coefficients.items()}
    {"u'": 50000, "|u'| z": -800, "u' |z|": 300}
    """
    records = several(record_or_records, "discover_oscillator")
    terms = library(degree, symmetry)
    parts = items(_KnownPlant(mass=mass, damping=damping, stiffness=stiffness))
    known = {name: value for name, value in parts.items() if value is not None}
    chosen = _structure(records, structure)
    others = () if structure is not None or chosen.period is None else (replace(chosen, hold="foh"),)
    search = Search(Response(chosen, records, known), terms, seed, progress or (lambda done, total: None))
    return search.result(others)


def recorded(record: Record) -> OscillatorStructure:
    """How a record with an even time was probably made; see `discover_oscillator`."""
    period = _period(record.u)
    if period is None or not _is_steady(record.y, period):
        return BoucWenOscillator.structure()
    return BoucWenOscillator.structure(initial="periodic", period=period, hold="band-limited")


def _structure(records: Sequence[Record], structure: OscillatorStructure | None) -> OscillatorStructure:
    if structure is None:
        made = {recorded(record) for record in records}
        if len(made) > 1:
            raise ValueError("the records were made in different ways: give structure=, or one record at a time")
        return made.pop()
    if not isinstance(structure, OscillatorStructure):
        raise TypeError(f"structure comes from BoucWenOscillator.structure(...), got {type(structure).__name__}")
    if structure.excitation != "force":
        raise ValueError('the input must be a force: structure(excitation="force")')
    return structure


@checked
class _KnownPlant:
    """Parts of the plant that the user knows."""

    mass: Positive | None
    damping: float | None
    stiffness: float | None


def _period(u: FloatArray) -> int | None:
    """Smallest shift, up to half of the record, by which an input repeats itself."""
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
    first_unlike = int(np.argmax(differences > 0.5 * (n - shifts) * squares[n] / n))
    repeats[:first_unlike] = False
    return int(shifts[np.argmax(repeats)]) if repeats.any() else None


def _is_steady(y: FloatArray, period: int) -> bool:
    first, last = y[:period], y[y.size // period * period - period : y.size // period * period]
    early, late = (float(np.std(part)) for part in np.array_split(first - last, 4)[::3])
    return early <= max(_TRANSIENT * late, 1e-6 * float(np.std(y)))
