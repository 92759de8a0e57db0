"""The verb `discover`: from records to a law with memory.

    z' = sum c_k phi_k(u', |u'|, u, z),    y = offset + feedthrough u + gain z

Regression of the slope along the loading length, and PySINDy's optimizers from dense to sparse (`_slopes`), refinement
by simulation error (`_refinement`), choice of one structure (`_search`), and the verdict (`_judgement`).
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.progress import Progress, Reports, reports
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE, Trial, competitors, doubts, judge
from hysim.discovery._refinement import DIVERGED, Candidate, FreeRun, Samples, Work
from hysim.discovery._result import Discovery, coefficients, law_from
from hysim.discovery._search import MOST_WORK, Library, Options, Outcome, or_any_exponent, searched
from hysim.discovery._slopes import FORMS, check, signs_of
from hysim.identification import errors_of_refits, folds
from hysim.identification.doubts import swapped_columns
from hysim.laws.differential.terms import duhem_terms, memory_terms, named_terms, symmetric
from hysim.metrics.criteria import rms_of_known
from hysim.records import Record, by_record, several

_POOR = 80.0  # fit of a law without dynamics [%] below which the records may be an oscillator's
_SHORT = "only the optimizer's path was searched, since no law on it is nearly as good as the best model without a law"
_OSCILLATOR = (
    "The laws that were tried explain little of these records. If u is the force on a mass with a hysteretic spring "
    "and y its displacement, use hs.discover_oscillator."
)
_CUT = (
    "the search stopped at its limit of work, since many of the laws that it tried are stiff on these records: other "
    "structures may fit better. A library of fewer terms lets it try all of them"
)
_REPORTS = 20  # calls of the progress for the search, and for each fold
_SEARCHES = 0.9  # share of the searches; the rest is the judgement
_OF_REFIT = MOST_WORK / 20.0


@reports
@one_blas_thread()
def discover(
    record_or_records: Record | Sequence[Record],
    *,
    route: str = "auto",
    library: str | Sequence[str] | None = None,
    degree: int | None = None,
    symmetry: str | None = None,
    signs: Mapping[str, int] | None = None,
    optimizer: str = "STLSQ",
    derivative: str = "auto",
    initial: str = "auto",
    cross_validate: str | int | None = None,
    seed: int = 0,
    progress: Reports = None,
) -> Discovery:
    """Discover the law of a memory in one or several records.

    The slope of the memory along the loading length, dL = ``|du|``, is regressed on a library of terms by PySINDy.
    Structures are refined by their error in free run; of those that fit equally well the one of fewest parameters is
    taken. Models without a law are fitted beside it, and all are judged on held-out samples. Structures are compared by
    the BIC of their free runs; residuals below 1e-4 strokes are no evidence. A warning says where the records may be
    those of an oscillator, for which `discover_oscillator` is. Sources: S. L. Brunton, J. L. Proctor and J. N. Kutz,
    PNAS 113 (2016); PySINDy 2.1.

    Parameters
    ----------
    record_or_records : Record or sequence of Record
        Input, which is taken as exact and must reverse, and output. Several records share the law; each has its own
        initial state. Without time hysteresis and lag cannot be distinguished.
    route : {"auto", "memory", "output"}
        What is measured: the memory itself, y = z; or an output, y = offset + feedthrough u + gain z. By default both
        and a Duhem law are tried, and the one of lowest BIC is taken.
    library : {"bouc-wen", "duhem"} or sequence of str, optional
        ``"bouc-wen"``, for z: ``u'`` and ``|u'|`` times z^j, and times ``|z|`` z^(j-1), j up to `degree`. ``"duhem"``,
        for y: ``u'`` and ``|u'|`` times u^i y^j, i + j up to `degree`. Or the terms: ``["u'", "|u'| z", "u' |z|"]``.
    degree : int, optional
        Highest degree of the library's monomials, by default 2. Not with a library of names.
    symmetry : {None, "odd", "even"}
        Of the response: only terms that leave it so. Loops about the origin are odd, butterflies even.
    signs : mapping, optional
        Term to 1 or -1, the sign that its coefficient must have.
    optimizer : {"STLSQ", "SR3", "SSR", "FROLS"}
        PySINDy's optimizer that makes the path.
    derivative : {"auto", "smoothed", "weak"}
        Slopes of smoothed branches, or the integral form, without slopes; by default the better on held-out samples.
    initial : {"auto", "free", "rest"}
        Whether the memory at the first sample is fitted for each record, or zero. By default the lower BIC decides; a
        Duhem law begins at rest only in records that begin at u = 0.
    cross_validate : {None, "loo"} or int, optional
        ``"loo"`` leaves one output sample out at a time, an int that many blocks of samples; the input is kept. The
        whole search is repeated for each fold: minutes for ``"loo"`` on 50 samples. Fills `Discovery.cv_rmse`.
    seed : int
        Seed of random restarts, and of the ensemble.
    progress : callable or False, optional
        Called as ``progress(done, total)`` about every twentieth of the search, and after each fold of the
        cross-validation, which counts like a search; see `hysim.simulate`.

    Returns
    -------
    Discovery
        Its verdict rests on the law and on models that need no library: a single-valued curve, a linear plant, linear
        creep, and a superposition of functions of plays.

        - ``"rate-independent hysteresis"``: at several rates the law or the plays predict held-out samples better
          than all models that depend on time, and than the curve;
        - ``"linear lag"``: a linear dynamic model predicts them better;
        - ``"cannot be told from one rate"``: the records show a loop, but have one rate only, or no time;
        - ``"no structure found"``: a single-valued curve predicts as well; or no model explains the records; or the
          law diverges in free run, and the plays show no hysteresis.

    Raises
    ------
    ValueError
        If an option is unknown, an input or output is constant, the input never reverses, its branches are too short
        to have a slope, there are no more samples than terms, or every law diverges.
    TypeError, ImportError
        If the first argument is not a record or a sequence of them; if `optimizer` needs one of PySINDy's extras.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> u = np.concatenate([np.linspace(0, 2, 41), np.linspace(2, -1, 61)[1:], np.linspace(-1, 2, 61)[1:]])
    >>> rec = hs.Record(u=u, y=hs.BoucWen(A=1.0, beta=0.6, gamma=0.3).memory(u))
    >>> dis = hs.discover(rec, route="memory")
    >>> {term: round(value, 4) for term, value in dis.coefficients.items()}
    {"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}
    """
    records = _checked(record_or_records)
    n_samples = sum(map(len, records))
    left_out = [] if cross_validate is None else folds(cross_validate, n_samples, name="cross_validate")
    check(optimizer)
    if route == "oscillator":
        raise ValueError("an oscillator has its own verb: hs.discover_oscillator(record)")
    check_choice("route", route, ("auto", "memory", "output"))
    check_choice("derivative", derivative, ("auto", *FORMS))
    check_choice("initial", initial, ("auto", "free", "rest"))
    libraries = _libraries(route, library, degree, symmetry)
    of_memory, *of_output = (replace(each, rests=_rests(initial, each, records)) for each in libraries)
    others = cache(lambda: competitors(records))
    options = Options(
        signs=signs_of([term for each in (of_memory, *of_output) for term in each.terms], signs),
        optimizer=optimizer,
        derivative=derivative,
        seed=seed,
        # the folds of a cross-validation repeat the search without knowing what the competitors know
        enough=None if left_out else lambda: others().enough,
    )
    report = _in_steps(progress or (lambda done, total: None), _REPORTS, 1 + len(left_out))
    share = _SEARCHES / (1 + len(of_output))
    any_exponent = library is None and symmetry is None and not signs

    def report_search(k: int, done: float) -> None:
        report(share * (k + done))

    def search(masks: tuple[Samples, ...] | None = None) -> tuple[Outcome, Outcome, Candidate]:
        """The outcome of the first library, the best outcome, and the law that is taken."""
        outcomes = list[Outcome]()
        for k, each in enumerate((of_memory, *of_output)):
            how = options if masks else replace(options, report=partial(report_search, k))
            best = outcomes[0].searched.bic if outcomes else math.inf
            outcome = searched(records, each, how, best=best, masks=masks)
            outcomes += [] if outcome is None else [outcome]
            how.report(1.0)
        first, chosen = outcomes[0], min(outcomes, key=lambda each: each.candidate.bic)
        chosen = replace(chosen, is_cut=any(each.is_cut for each in outcomes))
        if not any_exponent or chosen.is_short:
            return first, chosen, chosen.candidate
        return first, chosen, or_any_exponent(FreeRun(records, masks), first, chosen)

    first, outcome, candidate = search()
    result = _discovery(records, outcome, candidate, others(), seed)
    report(1.0)
    error = left_out_rmse(records, lambda masks: search(masks)[2], left_out, lambda k, _: report(1.0 + k))
    warnings = [*result.warnings, swapped_columns(records)]
    is_even = all(r.t is not None and np.ptp(np.diff(r.t)) < 1e-6 * np.ptp(r.t) for r in records)
    is_poor = _scores(first.candidate, records)["fit_percent"] <= _POOR
    if route == "auto" and result.verdict != LAG and is_even and is_poor:
        warnings.append(_OSCILLATOR)
    return replace(result, warnings=tuple(filter(None, warnings)), cv_rmse=error)


def _in_steps(progress: Progress, each: int, searches: int) -> Callable[[float], None]:
    """A function of the searches that are done which calls `progress`, `each` times for one search at most."""
    last = 0

    def report(done: float) -> None:
        nonlocal last
        if (steps := math.floor(each * done + 1e-9)) > last:
            last = steps
            progress(steps, each * searches)

    return report


def _rests(initial: str, library: Library, records: Sequence[Record]) -> tuple[bool, ...]:
    if initial != "auto":
        return (initial == "rest",)
    return (False, True) if library.letter == "z" or all(record.u[0] == 0.0 for record in records) else (False,)


def _checked(record_or_records: Record | Sequence[Record]) -> tuple[Record, ...]:
    records = several(record_or_records, "discover")
    for record in records:
        for name, values in (("input", record.u), ("output", record.y)):
            if np.ptp(values) == 0.0:
                raise ValueError(f"the {name} is constant: give a record on which it moves")
    return records


def _libraries(
    route: str, library: str | Sequence[str] | None, degree: int | None, symmetry: str | None
) -> tuple[Library, ...]:
    if degree is not None and not isinstance(library, str | None):
        raise ValueError("degree is not used with a library of names: leave it out")
    degree = 2 if degree is None else degree
    feedthrough = {"auto": "may", "memory": "no", "output": "must"}[route]
    of_memory = Library(symmetric(memory_terms(degree), symmetry), "z", feedthrough, offset=route != "memory")
    of_output = Library(symmetric(duhem_terms(degree), symmetry), "y")
    if library is None:
        return (of_memory, of_output) if route == "auto" else (of_memory,)
    if library == "bouc-wen":
        return (of_memory,)
    if library == "duhem":
        chosen = of_output
    elif isinstance(library, str):
        raise ValueError(f'library must be "bouc-wen", "duhem" or names of terms, got {library!r}')
    else:
        terms = symmetric(named_terms(library), symmetry)
        of_z = any("z" in name for name in library)
        chosen = replace(of_memory, terms=terms) if of_z else Library(terms, "y")
    if chosen.letter == "y" and route == "output":
        raise ValueError("a library in u and y has its feedthrough in the terms: take the memory route for it")
    return (chosen,)


def _discovery(
    records: tuple[Record, ...], outcome: Outcome, candidate: Candidate, others: Trial, seed: int
) -> Discovery:
    letter, structure = outcome.library.letter, candidate.structure
    law = law_from(candidate, records, "z" if structure.any_exponent else letter)

    def refit(some: Sequence[Record], weights: Sequence[FloatArray]) -> Sequence[Any]:
        masks = tuple(each > 0.0 for each in weights)
        refined = FreeRun(tuple(some), masks, work=Work(_OF_REFIT)).refine(structure, candidate.unknowns[np.newaxis])
        if refined is None:
            raise ValueError("the law diverges")
        return law_from(refined, some, letter).models

    judgement = judge(others, law.models, refit)
    message = [f"{letter} is held at zero at the first sample"] * structure.rest
    message += [_SHORT] * outcome.is_short + [_CUT] * outcome.is_cut
    path = [(threshold, outcome.search.refine(each)) for threshold, each in outcome.path]
    path_scores = [_scores(each, outcome.search.free_run.records) for _, each in path]
    return Discovery(
        **law._asdict(),
        model=law.models[0],
        verdict=NO_STRUCTURE if outcome.unstable and judgement.verdict != HYSTERESIS else judgement.verdict,
        route="output" if structure.feedthrough or structure.offset else "memory",
        scores={
            **_scores(candidate, records),
            "n_terms": len(law.coefficients),
            "threshold": outcome.threshold,
            "n_structures": len(outcome.search.tried),
            "condition": outcome.start.regression.condition,
        },
        n_parameters=candidate.n_parameters,
        initial="rest" if structure.rest else "free",
        judgement=judgement,
        cv_rmse=math.nan,
        left_out=tuple(term.named(letter) for term in outcome.start.regression.dependent),
        regressed=_regressed(outcome) if candidate is outcome.candidate else {},
        inclusion=outcome.inclusion(seed),
        thresholds=np.array([threshold for threshold, _ in path]),
        path_n_terms=np.array([len(structure.terms) for _, structure in outcome.path], dtype=float),
        path_fit_percent=np.array([scores["fit_percent"] for scores in path_scores]),
        path_bic=np.array([scores["bic"] for scores in path_scores]),
        message="; ".join(message),
        warnings=doubts(judgement),
    )


def _regressed(outcome: Outcome) -> dict[str, float]:
    structure, start = outcome.candidate.structure, outcome.start
    if not set(structure.terms) <= set(start.regression.terms):
        return {}
    numbers = np.array([*start.regression.ridge(structure.terms, 0.0), *start.shift(structure)])
    return coefficients(structure, numbers, outcome.library.letter)


def _scores(candidate: Candidate | None, records: Sequence[Record]) -> dict[str, float]:
    if candidate is None:
        return {"fit_percent": -math.inf, "rmse": math.inf, "bic": math.inf}
    y = np.concatenate([record.y for record in records])
    residual = candidate.residual * float(np.ptp(y))
    return {
        "fit_percent": metrics.fit_percent(y, y - residual),
        "rmse": metrics.rmse(y, y - residual),
        "bic": metrics.bic(residual, candidate.n_parameters),
    }


def left_out_rmse(
    records: Sequence[Record],
    search: Callable[[tuple[Samples, ...]], Candidate],
    left_out: Sequence[npt.NDArray[np.intp]],
    progress: Progress,
) -> float:
    """Rmse on samples left out of the search, repeated for each fold [unit of y]; inf where a law diverges."""
    free_run, done = FreeRun(tuple(records)), itertools.count(1)

    def residual(weights: FloatArray) -> FloatArray:
        law = search(tuple(by_record(weights > 0.0, records)))
        progress(next(done), len(left_out))
        return np.asarray(free_run.residuals(law.structure, law.unknowns[np.newaxis])[0])

    errors = errors_of_refits(residual, free_run.n_samples, left_out)
    return math.inf if np.abs(errors).max() >= DIVERGED else rms_of_known(errors) * free_run.stroke
