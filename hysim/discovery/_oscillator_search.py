"""The search behind `hysim.discovery._oscillator`: candidates for the law of the memory, and the choice of one."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.discovery._hidden_memory import PLANT, HiddenMemory, Regressed
from hysim.discovery._judgement import HYSTERESIS, NO_STRUCTURE
from hysim.discovery._memory_terms import RELAXATION, MemoryTerm, bouc_wen_terms, equation
from hysim.discovery._oscillator_models import (
    RATE_DEPENDENT,
    SPRING,
    State,
    diverges,
    exponent,
    model,
    verdict,
)
from hysim.discovery._oscillator_response import Oscillator, Response
from hysim.discovery._oscillator_result import FoundOscillator
from hysim.discovery._term_regression import TermRegression
from hysim.identification import identify
from hysim.models.equation_of_motion import Linear, linear_plant
from hysim.models.oscillator_structure import OscillatorStructure
from hysim.models.transfer_function import TransferFunction
from hysim.records import Record

N_DRAWS = 20

_SURE = 0.9  # inclusion below which a warning names a term of the law
_LARGEST_CONDITION = 1e4
_EXPONENTS = (0.5, 10.0)  # the published bounds of n
_AT_BOUND = 1e-3  # relative distance from a bound below which a parameter is at it
_STEPS = 5
_ROUNDS = 5  # of choosing terms about a law of any terms
_LAW = ("A", "beta", "gamma")
_NO_MODEL = (
    "There is no model of this law: the memory of an oscillator is simulated where it is a Bouc-Wen law or a linear "
    "relaxation."
)
_DIVERGES = "A law of lower BIC diverges on cycles over the measured range, and is left out."


class _Fitted(NamedTuple):
    """A refined oscillator, the standard errors by name, its residual (n_samples,), and what went wrong."""

    oscillator: Oscillator
    stderr: dict[str, float]
    residual: FloatArray
    warnings: tuple[str, ...] = ()

    @property
    def terms(self) -> tuple[MemoryTerm, ...]:
        """The terms of the law."""
        return tuple(self.oscillator.coefficients)

    @property
    def verdict(self) -> str:
        """The kind of law."""
        return verdict(self.terms)

    def bic(self, floor: float) -> float:
        """Bayesian information criterion; each number that has a standard error counts as a parameter."""
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
        """Terms that are chosen and not in the law."""
        return set(self.chosen) - set(self.fitted.terms)


class Search(NamedTuple):
    """Records, how they were made, and the library; `others` are other beliefs about how they were made."""

    structure: OscillatorStructure
    others: tuple[OscillatorStructure, ...]
    records: tuple[Record, ...]
    response: Response
    library: tuple[MemoryTerm, ...]
    seed: int
    progress: Progress

    def found(self) -> FoundOscillator:
        """Steps 1 to 5."""
        memory = self._along()
        elastic = self._without_memory(memory.linear)
        self.progress(1, _STEPS)
        first = _tried(elastic, memory.regression(self.library))
        self.progress(2, _STEPS)
        if not first.chosen:
            return self._described(first, elastic, {})
        nearest = memory.nearest()
        self.progress(3, _STEPS)
        if nearest is None:
            return self._described(first, elastic, {}, ("Every law tried diverges along the measured displacement.",))
        refined, failures = [], []
        for search in (self, *map(self._made, self.others)):
            try:
                refined.append((search, search._refined(nearest)))
            except ValueError as error:
                failures.append(f"A law with memory was tried and could not be refined: {error}.")
        self.progress(4, _STEPS)
        if not refined:
            return self._described(first, elastic, {}, tuple(failures[:1]))
        best, fitted = min(refined, key=lambda each: float(each[1].residual @ each[1].residual))
        first = best._tried(fitted)
        candidates = [(best, each) for each in best._candidates(first)]
        if first.beyond:  # a law that is not the one decided how the records were made
            candidates += [pair for search, _ in refined if search is not best for pair in search._again(candidates)]
        return _chosen(candidates, elastic, nearest)

    def _made(self, structure: OscillatorStructure) -> "Search":
        """The same search under another assumption of how the records were made."""
        return self._replace(structure=structure, response=replace(self.response, structure=structure))

    def _again(self, candidates: "Sequence[tuple[Search, _Tried]]") -> "list[tuple[Search, _Tried]]":
        """Candidates by this belief about how the records were made; none if it suits the best Bouc-Wen law less."""
        laws = [each for _, each in candidates if each.fitted.verdict == HYSTERESIS]
        if not laws:
            return []
        law = min(laws, key=self._bic).fitted
        with contextlib.suppress(ValueError):  # the candidates by the other belief stay
            begun = self._bouc_wen(law.terms if _is_whole(law.terms) else ())
            if begun.bic(self._floor) < law.bic(self._floor):
                return [(self, each) for each in self._candidates(self._tried(begun))]
        return []

    @property
    def _floor(self) -> float:
        return self.response.floor

    def _bic(self, tried: _Tried) -> float:
        return tried.fitted.bic(self._floor)

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
        """The rival without a memory. Where the stiffness is given, z = A y is the rest of the spring."""
        plant: dict[str, float] = {**linear._asdict(), **self.response.known}
        springs = {SPRING: linear.stiffness - plant["stiffness"]} if "stiffness" in self.response.known else {}
        found = self._simulated(Oscillator(plant, springs))
        plant, law = found.oscillator
        plant = plant | {"stiffness": plant["stiffness"] + law.get(SPRING, 0.0)}
        stderr = {"stiffness" if name == SPRING.name else name: value for name, value in found.stderr.items()}
        return found._replace(oscillator=Oscillator(plant, {}), stderr=stderr)

    def _refined(self, nearest: Regressed) -> _Fitted:
        """Step 3."""
        if RELAXATION in nearest.coefficients:
            return self._simulated(Oscillator(nearest.plant, nearest.coefficients))
        return self._bouc_wen(tuple(nearest.coefficients))

    def _candidates(self, first: _Tried) -> list[_Tried]:
        """Step 4: the first law; where it lacks terms, also n free, n at the nearest whole number, and these terms."""
        found, is_free = self._pruned(first), not _is_whole(first.fitted.terms)
        if not found[-1].beyond and not is_free:
            return found
        with contextlib.suppress(ValueError):  # the first law stays
            free = first if is_free else self._tried(self._bouc_wen(()))
            found += [] if is_free else [free]
            n = float(max(round(exponent(free.fitted.terms) or 1.0), 1))
            if n != exponent(first.fitted.terms):
                found += self._pruned(self._tried(self._bouc_wen(bouc_wen_terms(n))))
        if not min(found, key=self._bic).beyond:
            return found
        lacking = [each for each in found if each.beyond and _is_whole(each.chosen)]
        more = self._extended(min(lacking, key=self._bic)) if lacking else None
        return found if more is None else [*found, more]

    def _pruned(self, tried: _Tried) -> list[_Tried]:
        """A Bouc-Wen law, and the same without those of its terms that are not chosen."""
        law = tried.fitted.terms
        kept = tuple(term for term in law if term == SPRING or term in tried.chosen)
        n = exponent(kept)
        if tried.fitted.verdict != HYSTERESIS or len(kept) == len(law) or n is None or not _is_whole(kept):
            return [tried]
        with contextlib.suppress(ValueError):  # the law with all terms stays
            return [tried, self._tried(self._bouc_wen(kept))]
        return [tried]

    def _extended(self, tried: _Tried) -> _Tried | None:
        """The law of the terms that are chosen, which are chosen again until they stay the same."""
        for _ in range(_ROUNDS):
            plant, coefficients = tried.fitted.oscillator
            law = {term: coefficients.get(term, 0.0) for term in tried.regression.terms if term in tried.chosen}
            try:
                again = self._tried(self._simulated(Oscillator(plant, law)))
            except ValueError:
                return None
            if set(again.chosen) == set(law) or not again.chosen:
                return again
            tried = again
        return tried

    def _bouc_wen(self, terms: Sequence[MemoryTerm]) -> _Fitted:
        """Identified with these terms of a Bouc-Wen law; without any, with all of them and n free."""
        fixed: dict[str, float] = {} if not terms else {"n": exponent(terms) or 1.0}
        for rectified, name in ((True, "beta"), (False, "gamma")):
            if terms and all(term.rectified != rectified for term in terms if term != SPRING):
                fixed[name] = 0.0
        fit = identify(
            self.structure,
            self.records,
            fixed={**fixed, **self.response.known},
            bounds={} if terms else {"n": _EXPONENTS},
        )
        numbers = fit.estimates
        law = {
            term: (sign * numbers[name], name)
            for term, name, sign in zip(bouc_wen_terms(numbers["n"]), _LAW, (1.0, -1.0, -1.0), strict=True)
            if name not in fixed
        }
        stderr = {name: value for name, value in fit.stderr.items() if name not in _LAW}
        stderr |= {term.name: fit.stderr[name] for term, (_, name) in law.items()}
        plant = {name: numbers[name] for name in PLANT}
        warnings: list[str] = [] if fit.success else [f"The refinement did not converge: {fit.message}."]
        if not terms:
            reached = [bound for bound in _EXPONENTS if abs(numbers["n"] - bound) < _AT_BOUND * bound]
            warnings += [f"The exponent n reached its search bound {bound:g}." for bound in reached]
        coefficients = {term: value for term, (value, _) in law.items()}
        return _Fitted(Oscillator(plant, coefficients), stderr, fit.residual, tuple(warnings))

    def _simulated(self, oscillator: Oscillator) -> _Fitted:
        """A law of any terms, refined by the simulation behind the regression.

        Raises
        ------
        ValueError
            If it diverges.
        """
        found = self.response.descended(oscillator)
        terms = tuple(found.coefficients)
        residual = self.response.measured - self.response.outputs([found])[0]
        J = self.response.slopes(found, terms)
        size = np.linalg.norm(J, axis=0)
        if not (np.isfinite(residual).all() and (size > 0.0).all()):
            raise ValueError(
                "the oscillator nearest to the records diverges, or does not become steady: check the units, the time, "
                "and the sign of u and y"
            )
        variance = float(residual @ residual) / max(residual.size - size.size, 1)
        errors = np.sqrt(variance * np.diag(np.linalg.pinv((J / size).T @ (J / size)))) / size
        names = (*self.response.free, *(term.name for term in terms))
        return _Fitted(found, dict(zip(names, errors.tolist(), strict=True)), residual)

    def _tried(self, fitted: _Fitted) -> _Tried:
        """The library about a law; where n is free, the terms that differ from the law's own by their power are none.

        The law itself is among the structures: a path of elimination need not meet it.
        """
        law = fitted.oscillator.coefficients
        same = {(term.rectified, term.even) for term in law if not (term.whole or term.relaxing)}
        library = [term for term in self.library if not term.power or (term.rectified, term.even) not in same]
        regression = self.response.regression(fitted.oscillator, fitted.residual, library)
        return _tried(fitted, regression if _is_whole(fitted.terms) else replace(regression, n_others=1))

    def _diverges(self, fitted: _Fitted) -> bool:
        plant, law = fitted.oscillator
        largest = max((record.y for record in self.records), key=lambda y: float(np.ptp(y)))
        return diverges(model(plant, law, self.structure, State(0.0, 0.0, 0.0)), largest)

    def _described(
        self,
        tried: _Tried,
        elastic: _Fitted,
        regressed: Mapping[MemoryTerm, float],
        warnings: tuple[str, ...] = (),
    ) -> FoundOscillator:
        fitted, regression = tried.fitted, tried.regression
        measured = self.response.measured
        plant, law = fitted.oscillator
        coefficients = {term.name: value for term, value in law.items()}
        shares = regression.inclusion(np.random.default_rng(self.seed), N_DRAWS)
        inclusion = {term.name: share for term, share in shares.items()}
        states = self.response.initial_states(fitted.oscillator)
        models = [model(plant, law, self.structure, state) for state in states]
        structures = tried.structures
        nothing = (_NO_MODEL,) if models[0] is None else ()
        warnings = (*nothing, *warnings, *fitted.warnings, *_warnings(tried, inclusion))
        self.progress(_STEPS, _STEPS)
        return FoundOscillator(
            model=models[0],
            models=tuple(each for each in models if each is not None),
            coefficients=coefficients,
            stderr=fitted.stderr,
            equation=equation(coefficients),
            verdict=fitted.verdict,
            **plant,
            initial="rest" if self.structure.period is None else "periodic",
            initial_states=states,
            rival=_transfer_function(elastic),
            regressed={term.name: value for term, value in regressed.items()},
            inclusion=inclusion,
            left_out=tuple(term.name for term in regression.dependent),
            scores={
                "fit_percent": metrics.fit_percent(measured, measured - fitted.residual),
                "rmse": float(np.sqrt(np.mean(fitted.residual**2))),
                "bic": fitted.bic(self._floor),
                "held_out_rmse": self.response.held_out_rmse(fitted.oscillator, fitted.residual),
                "linear_rmse": float(np.sqrt(np.mean(elastic.residual**2))),
                "linear_held_out_rmse": self.response.held_out_rmse(elastic.oscillator, elastic.residual),
                "linear_bic": elastic.bic(self._floor),
                "condition": regression.condition,
            },
            path_n_terms=np.array([len(terms) for terms in structures], dtype=float),
            path_bic=np.array([regression.bic(terms) for terms in structures]),
            path_held_out_rmse=np.array([regression.held_out_rmse(terms) for terms in structures]),
            path_terms=tuple(", ".join(term.name for term in terms) for terms in structures),
            message=_message(fitted, warnings),
            warnings=warnings,
        )


def _chosen(candidates: Sequence[tuple[Search, _Tried]], elastic: _Fitted, nearest: Regressed) -> FoundOscillator:
    """Step 5: the law of the lowest BIC of those that do not diverge, or none."""
    ranked = sorted(candidates, key=lambda each: each[0]._bic(each[1]))
    search, lowest = ranked[0]
    linear = elastic.bic(search._floor)
    for rank, (believed, each) in enumerate(ranked):
        if believed._bic(each) < linear and not believed._diverges(each.fitted):
            return believed._described(each, elastic, nearest.coefficients, (_DIVERGES,) if rank else ())
    lost = (_DIVERGES,) if search._bic(lowest) < linear else ()
    return search._described(lowest._replace(fitted=elastic), elastic, nearest.coefficients, lost)


def _tried(fitted: _Fitted, regression: TermRegression) -> _Tried:
    law = tuple(term for term in regression.terms if term in fitted.terms)
    paths = {*regression.thresholded(), *regression.eliminated(), *([law] if law else [])}
    structures = sorted(paths, key=lambda terms: (-len(terms), regression.bic(terms), terms))
    return _Tried(fitted, regression, structures, regression.best(structures))


def _transfer_function(elastic: _Fitted) -> TransferFunction:
    plant = elastic.oscillator.plant
    return TransferFunction(num=(1.0,), den=tuple(plant[name] for name in PLANT), hold="foh")


def _is_whole(terms: Sequence[MemoryTerm]) -> bool:
    return all(term.whole or term.relaxing for term in terms)


def _message(fitted: _Fitted, warnings: Sequence[str]) -> str:
    """How the search ended."""
    if fitted.verdict == NO_STRUCTURE:
        return "no term of the library is worth its parameter beside a linear spring"
    if fitted.verdict == RATE_DEPENDENT:
        return "the memory depends on the rate"
    return "" if warnings else "every term is needed, and no other"


def _warnings(tried: _Tried, inclusion: Mapping[str, float]) -> tuple[str, ...]:
    """Reasons to doubt the law, the gravest first."""
    parts = []
    if tried.fitted.verdict != NO_STRUCTURE and tried.beyond:
        parts.append(f"The records ask for more terms: {', '.join(term.name for term in sorted(tried.beyond))}.")
    doubtful = [term.name for term in tried.fitted.terms if inclusion.get(term.name, 0.0) < _SURE]
    if doubtful:
        parts.append(f"Some terms are not in every fit to resampled data: {', '.join(doubtful)}.")
    if tried.fitted.terms and tried.regression.condition > _LARGEST_CONDITION:
        parts.append(f"The terms are hard to tell apart on these records (condition {tried.regression.condition:.0e}).")
    return tuple(parts)
