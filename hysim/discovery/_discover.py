"""The verb `discover`: from a record to a polynomial Duhem law.

    y' = u' p(u, y) + |u'| q(u, y)

Regression of the slope along the loading length (`_derivatives`, `_library`), PySINDy's optimizer from dense
to sparse (`_pysindy`), refinement by simulation error (`_refinement`), choice of one structure (`_selection`).
"""

import math
from collections.abc import Mapping

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray, frozen
from hysim._parallel import Progress
from hysim.discovery import _pysindy
from hysim.discovery._library import duhem_terms, regression
from hysim.discovery._refinement import POLISH, Candidate, FreeRun, law
from hysim.discovery._selection import SEARCHED, Search, preferred, thinned
from hysim.discovery._validation import cross_validated_rmse
from hysim.identification.folds import folds
from hysim.models.duhem import Duhem
from hysim.records import Record

ONE_RATE = "cannot be told from one rate"
NO_STRUCTURE = "no structure found"
UNSTABLE = "unstable"

_RESTARTS = 4
_SAME = 1e-6  # relative difference of the cost within which two optima are the same
_SPREAD = 0.3  # of a random restart, in units of what each term contributes over the span of the input


@frozen
class Discovery:
    """What `discover` found.

    Parameters
    ----------
    model : Duhem
        The law, refined by simulation error.
    coefficients : mapping
        Term to coefficient, for instance ``"|u'| y"``.
    equation : str
        The law as text.
    verdict : str
        ``"cannot be told from one rate"``, ``"no structure found"`` or ``"unstable"``; see `discover`.
    scores : mapping
        Of the law's free run, as in `hysim.metrics`: ``"fit_percent"`` [%], ``"rmse"`` [unit of y], ``"bic"``,
        and ``"n_terms"``; of the search: ``"threshold"``, the largest one whose structure still has all terms of
        the law, ``"n_structures"`` refined, ``"condition"`` of the regression.
    n_parameters : int
        What was fitted: the terms, and y0.
    cv_rmse : float
        Cross-validated rmse [unit of y]; nan if it was not asked for.
    left_out : tuple of str
        Terms of the library that this record cannot tell from those of lower degree.
    thresholds, path_n_terms, path_fit_percent, path_bic : array, shape (n_thresholds,)
        The optimizer's path from dense to sparse, each structure refined: for a Pareto figure. A structure
        whose free run diverges has a fit of -inf and a BIC of inf. Long records are thinned for the path.
    """

    model: Duhem
    coefficients: Mapping[str, float]
    equation: str
    verdict: str
    scores: Mapping[str, float]
    n_parameters: int
    cv_rmse: float
    left_out: tuple[str, ...]
    thresholds: FloatArray
    path_n_terms: FloatArray
    path_fit_percent: FloatArray
    path_bic: FloatArray


def discover(
    record: Record,
    *,
    degree: int = 2,
    cross_validate: str | int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Discovery:
    """Discover a law ``y' = u' p(u, y) + |u'| q(u, y)`` in a record.

    The slope dy/dL along the loading length, dL = \\|du\\|, is taken branch by branch and regressed on the terms
    by PySINDy's STLSQ, from a dense law to a sparse one. Every structure on that path is refined by its error
    in free run; the search goes on from there by taking terms away, and by trying every structure whose form
    does not depend on where u and y are zero. Of the structures whose BIC is within 2 of the lowest, which the
    record cannot tell apart, one of these is taken first, then the one of fewest terms.

    Parameters
    ----------
    record : Record
        Input and output; its time is not used. The input is taken as exact, and must reverse.
    degree : int
        Highest total degree of the monomials u^i y^j.
    cross_validate : {None, "loo"} or int, optional
        ``"loo"`` leaves one output sample out at a time, an int that many blocks of samples; the input and
        the structure are kept, the numbers fitted anew. Fills `Discovery.cv_rmse`.
    seed : int
        Of the random restarts of the last refinement.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    Discovery
        The verdict is "cannot be told from one rate" where a law with a term of \\|u'\\| runs best. That is as
        much as one record can say: under a triangle at one rate the output of a linear lag is a function of
        u, y and the direction too, so on that record the lag *is* a rate-independent law. It is
        "no structure found" where a single-valued law (no term of \\|u'\\|, such as a line) does as well, and
        "unstable" where no structure of the optimizer stays finite; the model is then the best line.

    Raises
    ------
    ValueError
        If the input or the output is constant, the input never reverses, its branches are too short to have
        a slope, or there are no more samples than terms.
    TypeError
        If the first argument is not a record.

    Notes
    -----
    Structures are compared by BIC = N ln V + d ln N with V the mean squared residual in free run plus 1e-12
    squared strokes: smaller residuals are no evidence. d counts the terms and y0.

    Sources: S. L. Brunton, J. L. Proctor and J. N. Kutz, PNAS 113 (2016); PySINDy 2.1.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> u = np.concatenate([np.linspace(0, 2, 41), np.linspace(2, -1, 61)[1:], np.linspace(-1, 2, 61)[1:]])
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    >>> hs.discover(hs.Record(u=u, y=law.response(u))).equation
    "y' = u' (1) + |u'| (-1 y)"
    """
    if not isinstance(record, Record):
        raise TypeError(f"discover takes a Record, got {type(record).__name__}: hs.Record(u=u, y=y)")
    if cross_validate is not None:
        folds(cross_validate, len(record), name="cross_validate")
    problem = regression(record, duhem_terms(degree))
    path = _pysindy.sparse_path(problem)
    structures = [problem.kept(coefficients) for _, coefficients in path]
    search = Search(FreeRun(thinned(record, SEARCHED)), problem)
    refined = [search.refine(structure) for structure in structures]
    search.eliminate()
    search.enumerate_complete(progress)
    chosen = _restarted(FreeRun(record), preferred(search.found), seed)
    model = law(chosen)
    path_scores = [_scores(candidate, search.free_run.record) for candidate in refined]
    return Discovery(
        model=model,
        coefficients=model.terms,
        equation=model.equation,
        verdict=_verdict(chosen, refined),
        scores={
            **_scores(chosen, record),
            "n_terms": len(chosen.terms),
            "threshold": max(t for (t, _), s in zip(path, structures, strict=True) if set(chosen.terms) <= set(s)),
            "n_structures": len(search.tried),
            "condition": problem.condition,
        },
        n_parameters=chosen.n_parameters,
        cv_rmse=math.nan if cross_validate is None else cross_validated_rmse(model, record, cross_validate),
        left_out=tuple(term.name for term in problem.dependent),
        thresholds=np.array([threshold for threshold, _ in path]),
        path_n_terms=np.array([len(structure) for structure in structures]),
        path_fit_percent=np.array([scores["fit_percent"] for scores in path_scores]),
        path_bic=np.array([scores["bic"] for scores in path_scores]),
    )


def _scores(candidate: Candidate | None, record: Record) -> dict[str, float]:
    if candidate is None:
        return {"fit_percent": -math.inf, "rmse": math.inf, "bic": math.inf}
    residual = candidate.residual * float(np.ptp(record.y))
    return {
        "fit_percent": metrics.fit_percent(record.y, record.y - residual),
        "rmse": metrics.rmse(record.y, record.y - residual),
        "bic": metrics.bic(residual, candidate.n_parameters),
    }


def _restarted(free_run: FreeRun, chosen: Candidate, seed: int) -> Candidate:
    """The best of polishing the chosen candidate and descending again from random starts around it."""
    random = np.random.default_rng(seed)
    spread = _SPREAD * free_run.units(chosen.terms)
    starts = [chosen.unknowns + spread * random.standard_normal(len(spread)) for _ in range(_RESTARTS)]
    best = chosen
    for k, start in enumerate((chosen.unknowns, *starts)):
        found = free_run.refine(chosen.terms, start[np.newaxis], tolerance=POLISH)
        if found is not None and (k == 0 or found.cost < best.cost * (1.0 - _SAME)):
            best = found
    return best


def _verdict(chosen: Candidate, path: list[Candidate | None]) -> str:
    if all(candidate is None for candidate in path):
        return UNSTABLE
    return ONE_RATE if any(term.rectified for term in chosen.terms) else NO_STRUCTURE
