"""The verb `discover`: from records to a law with memory.

    z' = sum c_k phi_k(u', |u'|, u, z),    y = offset + feedthrough u + gain z

Regression of the slope along the loading length (`_derivatives`, `_library`, `_shifts`), PySINDy's optimizers from
dense to sparse (`_pysindy`), refinement by simulation error (`_refinement`), choice of one structure (`_selection`,
`_subsets`, `_search`, `_exponent`), the error of repeated searches (`_validation`), and the question whether it is
hysteresis at all (`_judgement`).
"""

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hysim import metrics
from hysim._blas import one_blas_thread
from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.discovery import _laws, _pysindy, arguments
from hysim.discovery._doubts import doubts
from hysim.discovery._exponent import or_any_exponent
from hysim.discovery._judgement import HYSTERESIS, NO_STRUCTURE, Competitors, Judgement, competitors, judge
from hysim.discovery._library import FORMS, duhem_terms, memory_terms, named_terms, signs_of, symmetric
from hysim.discovery._refinement import Candidate, FreeRun, Samples
from hysim.discovery._result import Discovery
from hysim.discovery._search import Library, Outcome, searched
from hysim.discovery._structures import AnyExponent
from hysim.discovery._validation import left_out_rmse
from hysim.identification.columns import swapped_columns
from hysim.identification.folds import folds
from hysim.records import Record

if TYPE_CHECKING:
    from hysim.models.oscillator_structure import OscillatorStructure

_POOR = 80.0  # fit of a law without dynamics [%] below which an oscillator is tried
_SHORT = (
    "only the optimizer's path was searched, since no law on it comes near the model without a law that explains the "
    "records best"
)
_STAGES = 3  # hidden memory, other libraries, judgement


@one_blas_thread()
def discover(
    record_or_records: Record | Sequence[Record],
    *,
    route: str = "auto",
    library: str | Sequence[str] | None = None,
    degree: int = 2,
    symmetry: str | None = None,
    signs: Mapping[str, int] | None = None,
    optimizer: str = "STLSQ",
    derivative: str = "auto",
    initial: str = "auto",
    structure: "OscillatorStructure | None" = None,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float | None = None,
    cross_validate: str | int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Discovery:
    """Discover the law of a memory in one or several records.

    The slope of the memory along the loading length, dL = ``|du|``, is regressed on a library of terms by PySINDy,
    from a dense law to a sparse one. Every structure on that path is refined by its error in free run, and the search
    goes on among all smaller structures of the library. Among structures that fit equally well, the one of fewest
    numbers is taken. Models without a law are fitted beside it, and all are judged on data they have not seen.

    Parameters
    ----------
    record_or_records : Record or sequence of Record
        Input and output. The input is taken as exact, and must reverse. Several records share the law; each begins
        at a memory of its own. A law with memory does not need the time; whether it is hysteresis cannot be told
        without. Records with gaps are given as several (``hs.load(..., on_missing="split")``).
    route : {"auto", "memory", "output", "oscillator"}
        What is measured: the memory itself, y = z; an output, y = offset + feedthrough u + gain z; or force u and
        displacement y of a mass on a hysteretic spring, m y'' + c y' + k y + z = u. By default the first two are
        tried, and a Duhem law, and the one of lowest BIC is taken; where all of these explain little, the third is
        tried too. Only routes that use all given arguments are tried: with `mass`, only the oscillator.
    library : {"bouc-wen", "duhem"} or sequence of str, optional
        ``"bouc-wen"``, for z: ``u'`` and ``|u'|`` times z^j, and times ``|z|`` z^(j-1), j up to `degree`.
        ``"duhem"``, for y: ``u'`` and ``|u'|`` times u^i y^j, i + j up to `degree`. Or the names of the terms:
        ``["u'", "|u'| z", "u' |z|"]``.
    degree : int
        Of the library's monomials; an oscillator's goes one higher, to 3 at most. Not with a library of names.
    symmetry : {None, "odd", "even"}
        Of the response: only terms that leave it so. Loops about the origin are odd, butterflies even. An oscillator's
        may be odd.
    signs : mapping, optional
        Term to 1 or -1, the sign that its coefficient must have. Not for an oscillator.
    optimizer : {"STLSQ", "SR3", "SSR", "FROLS"}
        PySINDy's optimizer that makes the path. Not for an oscillator.
    derivative : {"auto", "smoothed", "weak"}
        Slopes of smoothed branches, or the integral form, which needs none; by default the one whose regressions run
        nearest to samples that they have not seen. Not for an oscillator.
    initial : {"auto", "free", "rest"}
        Whether the memory at the first sample is a number of each record, or rest, which is zero and no number: z = 0,
        or y = 0 in a Duhem law. By default both are tried, and the lower BIC decides; a Duhem law begins at rest only
        in records that begin at u = 0. Not for an oscillator.
    structure : OscillatorStructure, optional
        How an oscillator's records were made, from ``BoucWenOscillator.structure(...)``; by default a record whose
        input repeats itself is taken as steady, any other as beginning at rest. Only for an oscillator.
    mass, damping, stiffness : float, optional
        Of the oscillator, where they are known [u per unit of y''; y'; y]. Only for an oscillator.
    cross_validate : {None, "loo"} or int, optional
        ``"loo"`` leaves one output sample out at a time, an int that many blocks of samples; the input is kept. The
        whole search is repeated without them, for the structure as for the numbers, so that it takes as many times as
        long as `discover` alone: minutes for ``"loo"`` on 50 samples. Fills `Discovery.cv_rmse`. Not for an
        oscillator, which is tried on blocks of the record in any case (`Judgement.held_out`).
    seed : int
        Of random restarts, and of the ensemble.
    progress : callable, optional
        Called as ``progress(done, total)``; each fold of the cross-validation is one step.

    Returns
    -------
    Discovery
        Its verdict is about the records. Beside the law it rests on models that need no library: a single-valued
        curve, a linear plant, linear creep, and a superposition of functions of plays, all judged on held-out samples.

        - ``"rate-independent hysteresis"``: under several rates the law or the plays predict what they have not seen
          better than all models that know time, and than the curve;
        - ``"linear lag"``: a linear dynamic model does;
        - ``"cannot be told from one rate"``: there is a loop, but the input passes each place at one rate only, or
          there is no time. Under a triangle at one rate the output of a linear lag is a function of u, y and the
          direction, so on that record the lag *is* a rate-independent law;
        - ``"no structure found"``: a single-valued curve does as well, since there is no loop or noise is wider; or
          no model explains the records; or the law diverges in free run, and the plays show no hysteresis.

        `Discovery.warnings` says which of these it is, that a linear model predicts better than the law, and that a
        law describes the hysteresis only in part.

    Raises
    ------
    ValueError
        If an option is unknown or not used by the route, an input or output is constant, the input never reverses, its
        branches are too short to have a slope, there are no more samples than terms, every law diverges, or an
        oscillator's record has no even time.
    TypeError
        If the first argument is not a record or a sequence of them, or `mass`, `damping` or `stiffness` is no number.
    ImportError
        If `optimizer` is one of PySINDy's that needs an extra.

    Notes
    -----
    Structures are compared by BIC = N ln V + d ln N with V the mean squared residual in free run plus 1e-8 squared
    strokes: smaller residuals are no evidence. d counts the numbers of the law, and y0 of each record where it is free
    (`Discovery.n_parameters`).

    Sources: S. L. Brunton, J. L. Proctor and J. N. Kutz, PNAS 113 (2016); PySINDy 2.1.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> u = np.concatenate([np.linspace(0, 2, 41), np.linspace(2, -1, 61)[1:], np.linspace(-1, 2, 61)[1:]])
    >>> rec = hs.Record(u=u, y=hs.BoucWen(A=1.0, beta=0.6, gamma=0.3).memory(u))
    >>> dis = hs.discover(rec, route="memory")
    >>> {term: round(value, 4) for term, value in dis.coefficients.items()}
    {"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}
    """
    records = _checked(record_or_records)
    _pysindy.check(optimizer)
    if cross_validate is not None:
        folds(cross_validate, sum(map(len, records)), name="cross_validate")
    if derivative not in ("auto", *FORMS):
        raise ValueError(f'derivative must be "auto", "smoothed" or "weak", got {derivative!r}')
    if symmetry not in (None, "odd", "even"):
        raise ValueError(f'symmetry must be None, "odd" or "even", got {symmetry!r}')
    plant: dict[str, Any] = {"structure": structure, "mass": mass, "damping": damping, "stiffness": stiffness}
    given = arguments.given(
        {
            "library": library,
            "degree": degree,
            "symmetry": symmetry,
            "signs": signs,
            "optimizer": optimizer,
            "derivative": derivative,
            "initial": initial,
            "cross_validate": cross_validate,
            **plant,
        }
    )
    routes = arguments.routes(route, given)
    vibrating = {"degree": _oscillators_degree(degree), "symmetry": symmetry or "none", "seed": seed, **plant}
    if routes == ("oscillator",):
        return _as_oscillator(records, progress=progress, **vibrating)
    if initial not in ("auto", "free", "rest"):
        raise ValueError(f'initial must be "auto", "free" or "rest", got {initial!r}')
    hidden, *shown = (
        replace(each, rests=_rests(initial, each, records)) for each in _libraries(route, library, degree, symmetry)
    )
    options: dict[str, Any] = {
        "signs": signs_of([term for each in (hidden, *shown) for term in each.terms], signs),
        "optimizer": optimizer,
        "derivative": derivative,
        "seed": seed,
    }
    n_folds = 0 if cross_validate is None else len(folds(cross_validate, sum(map(len, records))))
    total = _STAGES + n_folds
    report = progress or (lambda done, total: None)
    others = cache(lambda: competitors(records))
    if cross_validate is None:  # whose folds repeat the search without knowing what the competitors know
        options["enough"] = lambda: others().enough
    outcomes = _searched(records, (hidden,), options)
    report(1, total)
    doubt = swapped_columns(records)
    warnings = (doubt,) if doubt else ()
    if route == "auto" and _may_move(records, outcomes[0].candidate):
        if "oscillator" in routes:
            moving = _moving(records, outcomes[0].candidate, vibrating)
            if moving is not None:
                report(total, total)
                return replace(moving, warnings=(*moving.warnings, *warnings))
        else:
            warnings = (*warnings, arguments.not_tried("oscillator", given))
    any_exponent = library is None and symmetry is None and not signs

    def chosen(first: list[Outcome], seen: tuple[Samples, ...] | None) -> tuple[Outcome, Candidate[Any]]:
        more = _searched(records, shown, options, first[0].searched.bic, seen)
        outcome = min([*first, *more], key=lambda each: each.candidate.bic)
        if not any_exponent or outcome.is_short:
            return outcome, outcome.candidate
        return outcome, or_any_exponent(FreeRun(records, seen), first[0], outcome)

    def again(seen: tuple[Samples, ...]) -> Candidate[Any]:
        return chosen(_searched(records, (hidden,), options, seen=seen), seen)[1]

    outcome, candidate = chosen(outcomes, None)
    report(_STAGES - 1, total)
    found = _discovery(records, outcome, candidate, others(), seed)
    report(_STAGES, total)
    error = math.nan
    if cross_validate is not None:
        error = left_out_rmse(records, again, cross_validate, lambda done, n: report(_STAGES + done, total))
    return replace(found, warnings=(*found.warnings, *warnings), cv_rmse=error)


def _rests(initial: str, library: Library, records: Sequence[Record]) -> tuple[bool, ...]:
    """Whether the memory may begin at a value of its own, at zero, or at either."""
    if initial != "auto":
        return (initial == "rest",)
    return (False, True) if library.letter == "z" or all(record.u[0] == 0.0 for record in records) else (False,)


def _may_move(records: tuple[Record, ...], candidate: Candidate[Any]) -> bool:
    """Whether the records may be an oscillator's: their time is even, and a law without dynamics explains little."""
    return _scores(candidate, records)["fit_percent"] <= _POOR and all(_is_even(record) for record in records)


def _moving(records: tuple[Record, ...], candidate: Candidate[Any], options: Mapping[str, Any]) -> Discovery | None:
    """An oscillator's hysteresis, where the oscillator explains more than a law without dynamics."""
    with contextlib.suppress(ValueError):  # no mass on springs is near
        found = _as_oscillator(records, **options)
        if found.verdict == HYSTERESIS and found.scores["rmse"] < _scores(candidate, records)["rmse"]:
            return found
    return None


def _is_even(record: Record) -> bool:
    return record.t is not None and float(np.ptp(np.diff(record.t))) < 1e-6 * float(np.ptp(record.t))


def _oscillators_degree(degree: int) -> int:
    """The highest power of z in an oscillator's library."""
    if isinstance(degree, bool) or not isinstance(degree, int) or degree < 0:
        raise ValueError(f"degree must be a whole number from 0 up, got {degree!r}")
    return min(degree + 1, 3)


def _as_oscillator(records: tuple[Record, ...], **options: Any) -> Discovery:
    from hysim.discovery._oscillator import oscillator
    from hysim.discovery._oscillator_result import discovery

    return discovery(oscillator(records, **options), records)


def _checked(record_or_records: Record | Sequence[Record]) -> tuple[Record, ...]:
    records = (record_or_records,) if isinstance(record_or_records, Record) else record_or_records
    if not isinstance(records, (list, tuple)) or not records:
        raise TypeError(f"discover takes a Record or several, got {type(records).__name__}: hs.Record(u=u, y=y)")
    for record in records:
        if not isinstance(record, Record):
            raise TypeError(f"discover takes records, got {type(record).__name__}: hs.Record(u=u, y=y)")
        for name, values in (("input", record.u), ("output", record.y)):
            if np.ptp(values) == 0.0:
                raise ValueError(f"the {name} is constant: give a record on which it moves")
    return tuple(records)


def _libraries(
    route: str, library: str | Sequence[str] | None, degree: int, symmetry: str | None
) -> tuple[Library, ...]:
    """The libraries that a route looks into, the cheaper first."""
    feedthrough = {"auto": "may", "memory": "no", "output": "must"}[route]
    hidden = Library(symmetric(memory_terms(degree), symmetry), "z", feedthrough, offset=route != "memory")
    shown = Library(symmetric(duhem_terms(degree), symmetry), "y")
    if library is None:
        return (hidden, shown) if route == "auto" else (hidden,)
    if library == "bouc-wen":
        return (hidden,)
    if library == "duhem":
        chosen = shown
    elif isinstance(library, str):
        raise ValueError(f'library must be "bouc-wen", "duhem" or names of terms, got {library!r}')
    else:
        terms = symmetric(named_terms(library), symmetry)
        of_z = any("z" in name for name in library)
        chosen = replace(hidden, terms=terms) if of_z else Library(terms, "y")
    if chosen.letter == "y" and route == "output":
        raise ValueError("a library in u and y has its feedthrough in the terms: take the memory route for it")
    return (chosen,)


def _searched(
    records: tuple[Record, ...],
    libraries: Sequence[Library],
    options: Mapping[str, Any],
    best: float = math.inf,
    seen: Sequence[Samples] | None = None,
) -> list[Outcome]:
    """What each library has for the records; one that cannot come near the BIC `best` has nothing."""
    n = sum(map(len, records))
    outcomes: list[Outcome] = []
    for library in libraries:
        if n <= len(library.terms):
            raise ValueError(f"{n} samples cannot tell {len(library.terms)} terms and y0: lower the degree")
        found = searched(records, library, best=best, seen=seen, **options)
        outcomes += [] if found is None else [found]
    return outcomes


def _discovery(
    records: tuple[Record, ...],
    outcome: Outcome,
    candidate: Candidate[Any],
    others: Competitors,
    seed: int,
) -> Discovery:
    letter, structure = outcome.library.letter, candidate.structure
    found = _laws.found(candidate, records, "z" if isinstance(structure, AnyExponent) else letter)
    judgement = _judged(records, candidate, letter, found.models, others)
    path = [(threshold, outcome.search.refine(each)) for threshold, each in outcome.path]
    path_scores = [_scores(each, outcome.search.free_run.records) for _, each in path]
    return Discovery(
        model=found.models[0],
        models=found.models,
        coefficients=found.coefficients,
        stderr=found.stderr,
        equation=found.equation,
        verdict=NO_STRUCTURE if outcome.unstable and judgement.verdict != HYSTERESIS else judgement.verdict,
        route="output" if structure.feedthrough or structure.offset else "memory",
        scores={
            **_scores(candidate, records),
            "n_terms": len(found.coefficients),
            "threshold": outcome.threshold,
            "n_structures": len(outcome.search.tried),
            "condition": outcome.start.regression.condition,
        },
        n_parameters=candidate.n_parameters,
        parameters=found.parameters,
        initial="rest" if structure.rest else "free",
        initial_states=found.initial_states,
        judgement=judgement,
        cv_rmse=math.nan,
        left_out=tuple(term.named(letter) for term in outcome.start.regression.dependent),
        regressed=_regressed(outcome) if candidate is outcome.candidate else {},
        inclusion=outcome.inclusion(seed),
        thresholds=np.array([threshold for threshold, _ in path]),
        path_n_terms=np.array([len(structure.terms) for _, structure in outcome.path], dtype=float),
        path_fit_percent=np.array([scores["fit_percent"] for scores in path_scores]),
        path_bic=np.array([scores["bic"] for scores in path_scores]),
        message=_message(outcome, structure.rest),
        warnings=doubts(judgement),
    )


def _message(outcome: Outcome, rest: bool) -> str:
    parts = [f"{outcome.library.letter} at the first sample is held at zero, its rest"] * rest
    parts += [_SHORT] * outcome.is_short
    return "; ".join(parts)


def _regressed(outcome: Outcome) -> dict[str, float]:
    structure, start = outcome.candidate.structure, outcome.start
    if not set(structure.terms) <= set(start.regression.terms):
        return {}
    shift = [start.feedthrough] * structure.feedthrough + [start.offset] * structure.offset
    numbers = np.array([*start.regression.ridge(structure.terms, 0.0), *shift])
    return _laws.coefficients(structure, numbers, outcome.library.letter)


def _judged(
    records: tuple[Record, ...], candidate: Candidate[Any], letter: str, models: Sequence[Any], others: Competitors
) -> Judgement:
    structure = candidate.structure

    def refit(some: Sequence[Record], weights: Sequence[FloatArray]) -> Sequence[Any]:
        refined = FreeRun(tuple(some), tuple(each > 0.0 for each in weights)).refine(
            structure, candidate.unknowns[np.newaxis]
        )
        if refined is None:
            raise ValueError("the law diverges")
        return _laws.found(refined, some, letter).models

    return judge(records, models, refit, others)


def _scores(candidate: Candidate[Any] | None, records: Sequence[Record]) -> dict[str, float]:
    if candidate is None:
        return {"fit_percent": -math.inf, "rmse": math.inf, "bic": math.inf}
    y = np.concatenate([record.y for record in records])
    residual = candidate.residual * float(np.ptp(y))
    return {
        "fit_percent": metrics.fit_percent(y, y - residual),
        "rmse": metrics.rmse(y, y - residual),
        "bic": metrics.bic(residual, candidate.n_parameters),
    }
