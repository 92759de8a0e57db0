"""The verb `identify`: declare, search, describe."""

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._frozen import FloatArray
from hysim._parallel import Progress
from hysim.identification._projection import Projection
from hysim.identification._result import Candidate, Identification
from hysim.identification._search import Optimum, descend, optima
from hysim.identification._uncertainty import covariance
from hysim.identification.folds import folds
from hysim.models.search_space import Freedom, Identifiable
from hysim.records import Record

_AT_FOLD = 4  # a fold of the cross-validation begins from this many of the best optima
_FOLD_TOLERANCE = 1e-7
_SAMPLES_AT_ONCE = 1_000_000  # of all folds that descend together, to bound the memory


def identify(
    model_or_class: Any,
    record: Record,
    *,
    fixed: Mapping[str, float] | None = None,
    free: tuple[str, ...] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    initial: str | None = None,
    cross_validate: str | int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Identification:
    """Identify a model's parameters on a record, by its error in free run.

    Parameters
    ----------
    model_or_class : model, model class or structure
        `hysim.BoucWen`, `hysim.TransferFunction.structure(poles=4, zeros=1)`, ... A class gives its
        defaults as one start of the search, an instance its values.
    record : Record
        Input and output, and for models with dynamics the time.
    fixed : mapping, optional
        Parameters that are not free, and their values.
    free : tuple of str, optional
        Names to take out of the set that is held by default. Of each redundant group one is held, for
        Bouc-Wen ``A = 1``, since only A times gain can be told.
    bounds : mapping, optional
        Name to (lower, upper), in place of the family's own box.
    initial : {"free", "rest"}, optional
        Whether the state at the first sample is identified, or rest; by default as the family has it (free
        for a memory, as the structure says for a transfer function).
    cross_validate : {None, "loo"} or int, optional
        ``"loo"`` leaves one output sample out at a time, an int that many blocks of samples; the input is
        kept. Fills `Identification.cv_rmse`.
    seed : int
        Of the starts of the search.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If a name is unknown, the record is too short for the parameters, or its input is constant.
    TypeError
        If the first argument is not something that can be identified.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> rec = hs.Record(u=u, y=hs.BoucWen(beta=0.7, gamma=0.3, gain=2.0).response(u))
    >>> fit = hs.identify(hs.BoucWen, rec, fixed={"n": 1.0, "feedthrough": 0.0})
    >>> round(fit.estimates["beta"], 6), round(fit.estimates["gain"], 6)
    (0.7, 2.0)
    """
    family = _family(model_or_class)
    if not isinstance(record, Record):
        raise TypeError(f"identify takes a Record, got {type(record).__name__}: hs.Record(u=u, y=y)")
    space = family.search_space(record, Freedom(fixed or {}, tuple(free), bounds or {}, initial))
    if len(record) < len(space.names):
        raise ValueError(f"{len(record)} samples cannot tell {len(space.names)} parameters: fix some of them")
    left_out = [] if cross_validate is None else folds(cross_validate, len(record), name="cross_validate")
    problem = Projection(family, space, record)
    found = optima(problem, seed=seed, progress=progress)
    if not found:
        raise ValueError("no law in the box stays finite on this record: check its units, or give bounds")
    result = _describe(problem, found)
    return replace(
        result, regions=_regions(problem, found[0], seed), cv_rmse=_cross_validated(problem, found, left_out)
    )


def _family(model_or_class: Any) -> Identifiable:
    """The object that declares the search: a class stands for the model with its defaults."""
    family: Any = model_or_class
    if not all(callable(getattr(family, name, None)) for name in ("search_space", "regressors", "assemble")):
        raise TypeError(f"identify takes a model, a model class or a structure, got {model_or_class!r}")
    belongs_to_the_class = inspect.ismethod(family.search_space)
    if isinstance(family, type) and not belongs_to_the_class:
        required = [f.name for f in fields(family) if f.default is MISSING and f.default_factory is MISSING]
        if required:
            raise TypeError(
                f"{family.__name__} has no defaults for {', '.join(required)}: pass an instance as the start, "
                "or use discover"
            )
        family = family()
    return family  # type: ignore[no-any-return]


def _regions(problem: Projection, best: Optimum, seed: int) -> dict[str, Candidate]:
    """The best candidate inside each named region that the optimum is not in."""
    space = problem.space
    candidates: dict[str, Candidate] = {}
    for name, (lower, upper) in space.regions.items():
        if np.all(best.x >= lower) and np.all(best.x <= upper):
            continue
        box = replace(space, lower=lower, upper=upper, starts=np.clip(space.starts, lower, upper), regions={})
        inside = replace(problem, space=box)
        if found := optima(inside, seed=seed):
            candidates[name] = _candidate(inside, found[0])
    return candidates


def _estimates(problem: Projection, x: FloatArray) -> dict[str, float]:
    space = problem.space
    linear = problem.solve(x[np.newaxis])[0][0]
    searched = {name: float(values[0]) for name, values in space.parameters(x[np.newaxis]).items()}
    return searched | dict(space.held) | dict(zip(space.linear, linear.tolist(), strict=True))


def _candidate(problem: Projection, optimum: Optimum) -> Candidate:
    estimates = _estimates(problem, optimum.x)
    y = problem.record.y
    return Candidate(
        model=problem.family.assemble(estimates),
        estimates=estimates,
        fit_percent=metrics.fit_percent(y, y - problem.residual(optimum.x)),
        rmse=float(np.sqrt(optimum.cost / y.size)),
    )


def _describe(problem: Projection, found: list[Optimum]) -> Identification:
    best = found[0]
    names, n = problem.space.names, len(problem.record)
    residual = problem.residual(best.x)
    spread, reasons = covariance(problem, best.x, residual)
    chosen = _candidate(problem, best)
    rivals = tuple(
        _candidate(problem, other) for other in found[1:] if _indistinct(other.cost, best.cost, n, len(names))
    )
    if rivals:
        reasons.append(
            f"{len(rivals)} other optimum within the noise"
            if len(rivals) == 1
            else f"{len(rivals)} other optima within the noise"
        )
    message = "converged" if best.converged else "the search did not converge"
    return Identification(
        model=chosen.model,
        estimates=chosen.estimates,
        stderr=dict(zip(names, np.sqrt(np.diag(spread)).tolist(), strict=True)),
        covariance=spread,
        free_names=names,
        n_parameters=len(names),
        fit_percent=chosen.fit_percent,
        rmse=chosen.rmse,
        fpe=metrics.fpe(residual, len(names)),
        aic=metrics.aic(residual, len(names)),
        bic=metrics.bic(residual, len(names)),
        residual=residual,
        success=best.converged,
        message="; ".join([message, *reasons]),
        rivals=rivals,
    )


def _indistinct(cost: float, best: float, n_samples: int, n_parameters: int) -> bool:
    """Whether the likelihood ratio N ln(V / V_best) is inside the 95 % region of the optimum."""
    from scipy.stats import chi2

    if best == 0.0:
        return cost == 0.0
    return bool(n_samples * np.log(cost / best) < chi2.ppf(0.95, n_parameters))


def _cross_validated(problem: Projection, found: list[Optimum], left_out: list[npt.NDArray[np.intp]]) -> float:
    """Rmse of the left-out samples: every fold descends from the best optima of the whole record."""
    if not left_out:
        return float("nan")
    at_once = max(1, _SAMPLES_AT_ONCE // (_AT_FOLD * len(problem.record)))
    groups = [left_out[k : k + at_once] for k in range(0, len(left_out), at_once)]
    return float(np.sqrt(np.mean(np.concatenate([_left_out_errors(problem, found, group) for group in groups]) ** 2)))


def _left_out_errors(problem: Projection, found: list[Optimum], left_out: list[npt.NDArray[np.intp]]) -> FloatArray:
    """Errors of the samples that each of some folds leaves out, one fold after the other."""
    starts = np.array([optimum.x for optimum in found[:_AT_FOLD]])
    weights = np.ones((len(left_out), len(problem.record)))
    for fold, samples in enumerate(left_out):
        weights[fold, samples] = 0.0
    each = np.repeat(weights, len(starts), axis=0)
    reached, costs = descend(problem, np.tile(starts, (len(left_out), 1)), each, tolerance=_FOLD_TOLERANCE)
    best = np.arange(len(left_out)) * len(starts) + costs.reshape(len(left_out), -1).argmin(axis=1)
    linear = problem.solve(reached[best], weights)[0]
    columns, fixed_part = problem.split(problem.space.parameters(reached[best]))
    errors = problem.record.y - fixed_part - (columns @ linear[..., np.newaxis])[..., 0]
    return np.asarray(errors[weights == 0.0])
