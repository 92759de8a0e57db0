"""The verb `identify`: choose what the record decides, search, describe.

A family that is fitted in one step (`hysim.models.protocols.Direct`) is not searched. Its number of parameters is its
degrees of freedom, rounded; it has none by name.

The model that is returned has the filter of its input, the start of its record, and its own residual.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._basics import results
from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import check_choice, check_count, read_only
from hysim._basics.parallel import at_most
from hysim._basics.progress import Progress, Reports, reports
from hysim.errors import SimulationError
from hysim.identification._admissible import choose, danger, excursion, implausible
from hysim.identification._assumptions import Treated, decided, in_units_of_noise, quiet_rmse, treated
from hysim.identification._choice import better, in_one_step, of_any_family, refuse
from hysim.identification._noise import Quantised, density
from hysim.identification._problem import Problem, Setting, Weights, samples_of_sensor
from hysim.identification._result import Candidate, Identification
from hysim.identification._search import PERFECT, chosen, sharing, stages_in_words, widened
from hysim.identification._searched import Search
from hysim.identification._starts import begun, begun_by_parts
from hysim.identification._uncertainty import Folds, left_out, left_out_errors
from hysim.identification.doubts import offset_for, rate_noise_warning, swapped_columns, swapped_for
from hysim.laws.operators.reversal_filter import ReversalFilter
from hysim.metrics.criteria import rms_of_known
from hysim.models import protocols as roles
from hysim.models.by_structure import searched
from hysim.models.cascade import Cascade
from hysim.models.dependent import Dependent, on_record
from hysim.models.dependent_structure import DependentStructure
from hysim.models.model import family_named, is_identifiable
from hysim.models.protocols import needs_time, placed, with_law
from hysim.models.search_space import Freedom
from hysim.records import Record, several
from hysim.simulation import residual_of

_APART = 0.01  # of the outputs' range, by which the returned model may differ from what was searched
_UNUSABLE = 2.0  # times the error along a quiet path: beyond, the noise of the input decides what the model does


@reports
def identify(
    model_or_class: Any,
    record_or_records: Record | Sequence[Record] | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    depends: Mapping[str, tuple[str, int]] | None = None,
    initial: str | Sequence[str] | None = None,
    input: str = "auto",
    noise: str | None = None,
    intervals: str = "linear",
    cross_validate: str | int | None = None,
    admissible: bool | None = None,
    weights: npt.ArrayLike | Sequence[npt.ArrayLike] | Literal["energy"] | None = None,
    max_evaluations: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Reports = None,
    seconds: float = 30.0,
) -> Identification:
    """Identify a model's parameters on one or several records, by its error in free run.

    ``identify(record)`` chooses the family, too, within so many `seconds`.

    Parameters
    ----------
    model_or_class : model, model class, structure, result of a fit, or str
        `hysim.BoucWen`, `hysim.TransferFunction.structure(poles=4, zeros=1)`, ..., or a family's name, as
        ``"bouc-wen"``. The search begins at a class's defaults, or an instance's values, such as a `hysim.Structure`.
    record_or_records : Record, table, or sequence of them
        Input and output, and for models with dynamics the time; of a `hysim.Structure` also `hysim.StructureRecord`. A
        table, such as a DataFrame, has columns u and y, and t or an index of times; see `hysim.load`. Several records
        share all parameters but the initial state: where free, each has its own, ``z0[0]``, ``z0[1]``, ...
    fixed : mapping, optional
        Parameters that are not free, and their values.
    free : sequence of str, optional
        Parameters to identify that are held by default. One of each redundant group is held, for Bouc-Wen ``A = 1``,
        since only the product of A and gain is determined. Of a `hysim.Structure` all parameters are held but these.
    bounds : mapping, optional
        Name to (lower, upper), in place of the family's own box. That box is widened where the optimum stands at a side
        of it that is no limit of physics; an optimum which still does is reported by `Identification.success`.
    depends : mapping, optional
        Name of a parameter to (channel, degree): it is a polynomial of this degree in a channel of the records,
        ``{"gain": ("T", 1)}``. It is identified by its values at degree + 1 places of the channel's range, such as
        ``gain(T=20)`` and ``gain(T=60)``, each in the parameter's own box. The name of a tuple stands for all its
        numbers. The model is then a `hysim.Dependent`. Where a channel varies along a record, each branch between two
        samples has the parameters of the sample at its end.
    initial : {"free", "rest", "still", "periodic"}, or one of them for each record, optional
        Whether the state at the first sample is identified, is rest at zero, is that of an input which stood still at
        its first value, or is what the cycle leaves behind with which the record begins. By default a single memory is
        free; for sums of plays, stops or relays and for transfer functions the BIC decides, and `message` says how.
    input : {"auto", "raw", "filtered"}
        Whether the model follows the measured input as it is, or behind a `hysim.ReversalFilter`, whose threshold is
        sized by the noise of the input. By default the filter is there where the input has noise and the law alone
        predicts parts that it was not fitted to worse. The filter is a part of the model.
    noise : {"gaussian", "quantised", "robust"}, optional
        Noise of the output: normal; normal before rounding to multiples of `Record.resolution`; or Student's t with 4
        degrees of freedom, for outliers. By default normal, or that of the sensor of a `hysim.Actuator.structure`.
    intervals : {"linear", "profile", "bootstrap"}
        Intervals at 95 %: from the standard errors, by the profile of the likelihood, or from 500 records drawn anew.
    cross_validate : {None, "loo", "cycles", "records"} or int, optional
        What is left out at a time: an output sample, a cycle of the input (not the first), a record, or one of that
        many blocks of samples (without the first share of each record); the input is kept. Fills
        `Identification.cv_rmse` and `Identification.cv_residual`.
    admissible : bool, optional
        Whether the law must be safe on smaller cycles: tried on minor loops, fading stairs and the record's path at
        smaller amplitudes, an admissible law leaves the band of the record by no more than half of the output's range,
        and lies in the region that its family names ``"admissible"``, if it names one. By default the best law is
        returned where it is safe; otherwise the best admissible one where noise and creep allow its loss of fit: where
        N_eff ln(V_admissible / V) <= 10, with V the mean squared residuals and N_eff the number of samples over the
        correlation time of the best law's residual, and the rmse rises by at most a quarter. Where they do not, the
        result is the best law, `success` is False, and the summary begins with ``UNSAFE``. True returns the best
        admissible law whatever its fit, False the best law of all. `Identification.regions` holds the law that was not
        returned: ``"unrestricted"``, or ``"admissible"``.
    weights : array, shape (n,), or one for each record, or "energy", optional
        Weight of each sample in the sum of squares, not negative; 0 leaves it out. Only ratios count; inputs are kept.
        Those of a `hysim.StructureRecord` are for each time, and count for all its sensors.
        ``"energy"`` takes the squared error of the work from the first sample, the integral of y du, in place of that
        of y. It is searched for from the optimum for y; the intervals are those for independent errors of y.
    max_evaluations : int, optional
        Number of parameter sets on the whole record that the search may simulate, about. A search that ends by it is
        partial: `success` is False, and `message` says so.
    seed : int
        Seed of the starts and of random draws. The optimum does not depend on it.
    workers : int, optional
        Number of threads, or without a model of processes; by default one for each core.
    progress : callable or False, optional
        Called as ``progress(done, total)``; see `hysim.simulate`.
    seconds : float, optional
        Without a model: time of the processor after which no further family is begun. The families of `hysim.compare`
        predict what is left out of fits and continue the record; the best one is searched completely, and where its
        law is unsafe the next ones that are not clearly worse. ``choice`` of the result has them all. Options that need
        a family are refused.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If a name or an option is unknown, nothing is free, the record is too short for the parameters, its input
        is constant, it has no resolution for quantised noise, weights are negative or of another length, or a record
        has not the channel that a parameter depends on, or the records too few different values of it.
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
    if record_or_records is None:
        for_one: dict[str, Any] = {"fixed": fixed, "free": free or None, "bounds": bounds, "depends": depends}
        for_one |= {"initial": initial, "noise": noise, "cross_validate": cross_validate, "weights": weights}
        for_one |= {"max_evaluations": max_evaluations}
        _refuse_for_any(model_or_class, for_one)
        ways: dict[str, Any] = {"input": input, "admissible": admissible, "intervals": intervals}
        ways |= {"seed": seed, "workers": workers}
        return of_any_family(identify, several(model_or_class, "identify"), ways, seconds, progress or None)
    if isinstance(model_or_class, str):
        model_or_class = family_named(model_or_class)
    model_or_class = results.model_or_class(model_or_class)
    subject = searched(model_or_class)
    records: Sequence[Record] = several(subject.as_records(record_or_records), "identify")
    options = _freedom(fixed or {}, free, bounds or {})
    check_choice("intervals", intervals, ("linear", "profile", "bootstrap"))
    check_choice("input", input, ("auto", "raw", "filtered"))
    if noise is not None:
        check_choice("noise", noise, ("gaussian", "quantised", "robust"))
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed must be an integer from 0 on, got {seed!r}")
    energy = isinstance(weights, str)
    if energy:
        check_choice("weights", weights, ("energy",))
        if noise not in (None, "gaussian") or intervals != "linear" or cross_validate is not None:
            raise ValueError('weights="energy" goes with normal noise, linear intervals and no cross_validate')
        if not (subject.may_depend or subject.is_parted):
            raise ValueError('weights="energy" is for models whose output times input is a work, not for a structure')
    shares = None if energy else _weights(weights, records)
    if max_evaluations is not None:
        check_count("max_evaluations", max_evaluations)
    folds = left_out(cross_validate, records)
    asked = _Asked(records, shares, folds, noise, intervals, admissible, progress or None, energy)
    with at_most(workers), one_blas_thread(), sharing():
        if isinstance(model_or_class, roles.Direct) and depends is None:
            fit = _without_search(model_or_class, options, asked, seed)
        else:
            family = searched(placed(_family(model_or_class, depends), None))
            setting = Setting(_without_left_out(records, shares), options, initial, shares, max_evaluations, seed)
            assumed = _assumed(family, setting, input, asked)
            fit = _described(_searched(assumed, asked), assumed, asked)
        every = np.empty(0) if shares is None else np.concatenate(shares)
        return replace(fit, weights=every, bounds=options.bounds)


@dataclass(frozen=True)
class _Asked:
    """The user's options for a fit, and the records as they were measured."""

    records: Sequence[Record]
    weights: Weights
    folds: Folds
    noise: str | None
    intervals: str
    admissible: bool | None
    progress: Progress | None
    energy: bool


class _Assumed(NamedTuple):
    """The family, its setting without samples of weight zero, and the problems to search, the simplest first."""

    family: Any
    setting: Setting
    treatment: Treated
    noise: str
    problems: Sequence[Problem]
    sentence: str
    is_cut: bool


def _without_search(family: roles.Direct, options: Freedom, asked: _Asked, seed: int) -> Identification:
    records = asked.records
    if asked.energy:
        raise ValueError('weights="energy" is for models that are searched for')
    refuse(family, options, asked.noise or "gaussian", asked.intervals)
    fit = in_one_step(family, records, asked.weights, asked.folds, seed, asked.admissible)
    doubts = [swapped_columns(records)]
    if isinstance(fit.model, roles.Placeable):
        fit = as_measured(fit, searched(family), records, asked.weights, Treated(records))
        off = excursion(fit.models, records)
        doubts.append(implausible(off))
        fit = _marked(fit, danger(off, records, None), asked.admissible)
    return replace(fit, warnings=(*fit.warnings, *filter(None, doubts)))


def _assumed(family: Any, setting: Setting, how: str, asked: _Asked) -> _Assumed:
    """Choose what a family leaves to the record: noise of the input, treated as `how` says, states and signs."""
    if isinstance(family, DependentStructure):
        family = begun(family.over(setting.records), setting)
    treatment = treated(family, setting, how)
    along, noise, ends, is_cut = replace(setting, records=treatment.records), asked.noise, None, False
    if family.is_parted:
        family, paths, ends, is_cut = begun_by_parts(family, along)
        along, noise = replace(along, records=paths), noise or family.noise
    problems, sentence = decided(family, along)
    if ends is not None:
        problems = [replace(each, ends=ends) for each in problems]
    searched = [in_units_of_noise(each, setting.seed) for each in problems]
    return _Assumed(family, setting, treatment, noise or "gaussian", searched, sentence, is_cut)


def _searched(assumed: _Assumed, asked: _Asked) -> Identification:
    """Search the problems, and describe the optimum on the records as they were searched."""
    problems, problem, seed = assumed.problems, assumed.problems[0], assumed.setting.seed
    n_samples, n_names = problem.n_samples, len(problem.space.names)
    if not n_names:
        if not assumed.setting.freedom.fixed:
            family = type(problem.family).__name__
            raise ValueError(
                f"{family} says in `searched` no parameter to search: declare it, or give free= and bounds="
            )
        raise ValueError("every parameter is fixed: leave at least one free")
    if n_samples < n_names:
        raise ValueError(f"{n_names} parameters cannot be estimated from {n_samples} samples; fix some of them")
    quanta = {part.record.resolution for part in problem.parts}
    floor = PERFECT * (float(np.abs(problem.y).max()) or 1.0)
    noise = density(assumed.noise, quanta.pop() if len(quanta) == 1 else None, floor)
    problem, squares = widened(*chosen(problems, seed=seed, progress=asked.progress))
    if not squares:
        raise ValueError("every parameter set tried diverged: check the units, or pass bounds=")
    if isinstance(noise, Quantised):
        noise = noise.at_least(squares[0].cost, n_samples - len(problem.space.names))
    best = Search(problem, noise, seed, assumed.treatment)
    (search, likely), named, remark = choose(best, best.likely(squares), asked.admissible)
    plain, said = squares[0].x if search is best else likely[0].theta[: problem.n_x], ""
    if asked.energy:
        search, likely = search.on_energy(likely[0])
    result, likely = search.described(likely, asked.intervals, plain)
    if asked.energy and result.least_squares is not None:
        possible = result.least_squares.fit_percent
        said = f"the work fits best: the fit of y is {result.fit_percent:.4g} % where {possible:.4g} % is possible"
    message = "; ".join(filter(None, (result.message, remark, said, stages_in_words(problems, problem.stage))))
    optima = np.array([optimum.theta for optimum in likely])
    errors = left_out_errors(search.problem, noise, optima, asked.folds)
    fit = replace(result, message=message, regions=named, cv_residual=errors, cv_rmse=rms_of_known(errors))
    is_plain = assumed.setting.freedom == _freedom({}, (), {}) and assumed.setting.initial is None and not asked.energy
    rival = assumed.family.in_one_step() if is_plain and assumed.noise == "gaussian" else None
    if rival is None or asked.intervals != "linear":
        return fit
    return better(fit, search, optima, rival, asked.folds, asked.admissible)


def _described(fit: Identification, assumed: _Assumed, asked: _Asked) -> Identification:
    """The result on the records as they were measured, with all that speaks against it."""
    records, setting, first = asked.records, assumed.setting, assumed.problems[0]
    is_partial = assumed.is_cut or (first.budget is not None and (first.budget.cut or not fit.success))
    fit = replace(fit, message="; ".join(filter(None, (fit.message, assumed.sentence))))
    if all(type(record) is Record for record in records):  # not in units of sensors, nor weighted by a verb
        fit = as_measured(fit, assumed.family, records, asked.weights, assumed.treatment)
        fit = said_of_noise(fit, records, assumed.treatment, quiet_rmse(assumed.family, setting, assumed.treatment))
    doubts = [swapped_columns(records)]
    if is_partial:
        stopped = f"partial: the search stopped at max_evaluations={setting.max_evaluations}"
        further = "cv_rmse is that of longer searches; " * bool(asked.folds)
        message = f"{stopped}, better parameters may exist; {further}{fit.message}"
        fit = replace(fit, success=False, message=message)
    elif not any(doubts) and not needs_time(fit.model):
        error = 1.0 - fit.fit_percent / 100.0
        names = fit.free_names
        doubts += [swapped_for(first.family, setting, error), offset_for(first.family, names, setting, error)]
    on_their_records = [on_record(each, record) for each, record in zip(fit.models, records, strict=True)]
    off = excursion(on_their_records, setting.records)
    worse = "the fit is negative: the mean of y predicts it better" if fit.fit_percent < 0.0 else ""
    doubts += [implausible(off), rate_noise_warning(on_their_records, records), worse]
    fit = _marked(fit, danger(off, setting.records, fit.regions.get("admissible")), asked.admissible)
    return replace(fit, warnings=(*fit.warnings, *filter(None, doubts)))


def _refuse_for_any(subject: Any, options: Mapping[str, Any]) -> None:
    """Refuse a model without a record, and options that need a family."""
    if isinstance(subject, (str, type)) or is_identifiable(subject):
        raise TypeError(f"identify takes a model and a record, or a record alone; got {_in_words(subject)} alone")
    if for_one := [f"{name}=" for name, value in options.items() if value is not None]:
        raise ValueError(f"{', '.join(for_one)} is for one family: give a model, too")


def _marked(fit: Identification, unsafe: str, admissible: bool | None) -> Identification:
    """The fit of a law that is not safe, said in its first line; no success unless this was asked for."""
    return replace(fit, unsafe=unsafe, success=fit.success and admissible is False) if unsafe else fit


def _weights(weights: Any, records: Sequence[Record]) -> Weights:
    if weights is None:
        return None
    single = len(records) == 1 and np.ndim(weights[0]) == 0
    shares = [read_only(each, "weights", ndim=1) for each in ([weights] if single else weights)]
    sizes = [samples_of_sensor(each) for each in records]
    if [each.size for each in shares] != sizes:
        raise ValueError(
            f"weights must hold one number for each sample, {', '.join(map(str, sizes))}; "
            f"got {', '.join(str(each.size) for each in shares)}"
        )
    shares = [np.tile(each, len(record) // each.size) for each, record in zip(shares, records, strict=True)]
    every = np.concatenate(shares)
    if (every < 0.0).any() or not every.any():
        raise ValueError(f"weights must not be negative, and not all zero, got {every.min():g}")
    return shares


def _without_left_out(records: Sequence[Record], shares: Weights) -> Sequence[Record]:
    """Records whose outputs of weight zero are on a line between their neighbours, so that they scale no search."""
    if shares is None or not all(type(record) is Record for record in records):
        return records
    filled = []
    for record, share in zip(records, shares, strict=True):
        kept = np.flatnonzero(share)
        y = record.y if kept.size in (0, share.size) else np.interp(np.arange(share.size), kept, record.y[kept])
        filled.append(replace(record, y=y))
    return filled


def _freedom(fixed: Mapping[str, float], free: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Freedom:
    for name, value in fixed.items():
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise ValueError(f"fixed must hold finite numbers, got {value!r} for {name!r}")
    for name, pair in bounds.items():
        if np.shape(pair) != (2,):
            raise ValueError(f"bounds of {name!r} must be (lower, upper), got {pair!r}")
    return Freedom(fixed, (free,) if isinstance(free, str) else tuple(free), bounds, starts_anew=True)


def _family(model_or_class: Any, depends: Mapping[str, tuple[str, int]] | None) -> roles.Identifiable:
    """The object that declares the search; a class stands for its defaults, or for the last that it offers."""
    family: Any = model_or_class
    if isinstance(family, roles.Direct) and depends is not None:
        raise TypeError(f"depends is for laws and sums of them, got {family!r}")
    if not isinstance(family, roles.Identifiable):
        raise TypeError(f"identify takes a model, a model class or a structure, got {_in_words(model_or_class)}")
    belongs_to_the_class = inspect.ismethod(family.search_space)
    if isinstance(model_or_class, type) and not belongs_to_the_class:
        required = [f.name for f in fields(model_or_class) if f.default is MISSING and f.default_factory is MISSING]
        offered = [*family.candidates().values()] if required and isinstance(family, roles.Offering) else []
        if offered:
            return _family(offered[-1], depends)
        if required:
            raise TypeError(
                f"{model_or_class.__name__} has no defaults for {', '.join(required)}: pass an instance as the start, "
                "or use discover"
            )
        family = model_or_class()
    return family if depends is None else Dependent.structure(searched(family), depends)


def _in_words(subject: Any) -> str:
    kind = subject if isinstance(subject, type) else type(subject)
    if isinstance(kind, roles.Structured):
        what = "the class" if kind is subject else "a finished"
        return f"{what} {kind.__name__}: pass its structure, hs.{kind.__name__}.structure(...)"
    return repr(subject)


def as_measured(
    fit: Identification, family: Any, records: Sequence[Record], weights: Weights, treatment: Treated
) -> Identification:
    """The result with models that begin where the records begin, and the residual of these models."""
    lowest, highest = min(float(each.u.min()) for each in records), max(float(each.u.max()) for each in records)

    def returned(model: Any, record: Record) -> Any:
        standing = family.standing(model, record)
        return placed(_behind(treatment.front, standing), float(record.u[0]), (lowest, highest))

    def candidate(each: Candidate) -> Candidate:
        return replace(each, model=returned(each.model, records[0]))

    models = tuple(returned(model, record) for model, record in zip(fit.models, records, strict=True))
    y = np.concatenate([record.y for record in records])
    residual = residual_of(models, records)
    kept = np.ones(y.size, dtype=bool) if weights is None else np.concatenate([*weights]) > 0.0
    if (off := metrics.rmse(fit.residual[kept], residual[kept])) > _APART * float(np.ptp(y)):
        said = f"the model's run is {off:.3g} rms off what was searched"
        if family.runs_as_searched:
            fit = replace(fit, success=False)
            said += ": is the output affine as `searched` says?"
        fit = replace(fit, warnings=(*fit.warnings, said))
    front = {} if treatment.front is None else {"reversal_filter.threshold": treatment.front.threshold}
    return replace(
        fit,
        model=models[0],
        models=models,
        estimates={**fit.estimates, **front},
        residual=residual,
        fit_percent=metrics.fit_percent(y[kept], (y - residual)[kept]),
        rmse=metrics.rmse(residual[kept], 0.0 * residual[kept]),
        rivals=tuple(candidate(each) for each in fit.rivals),
        regions={name: candidate(each) for name, each in fit.regions.items()},
        least_squares=None if fit.least_squares is None else candidate(fit.least_squares),
    )


def said_of_noise(
    fit: Identification, records: Sequence[Record], treatment: Treated, quiet_rmse: float
) -> Identification:
    """The result with what was done to a noisy input, and whether the model is of use on it."""
    if not treatment.noises:
        return fit
    size, span = max(treatment.noises), max(float(np.ptp(record.u)) for record in records)
    words = [f"input noise {size:.2g} rms ({100.0 * size / span:.2g} % of its span)"]
    if treatment.front is None:
        words.append("the law follows the input as measured, and predicts parts left out as well as behind a filter")
    else:
        pairs = zip(treatment.records, records, strict=True)
        turns = ", ".join(f"{each.reversals().size} of {raw.reversals().size}" for each, raw in pairs)
        words.append(f"fitted along {turns} reversals")
        words.append(f"the model includes a filter of reversals up to {treatment.front.threshold:.3g}")
        spread = float(np.ptp(np.concatenate([record.y for record in records])))
        alone = [placed(_alone(model), float(record.u[0])) for model, record in zip(fit.models, records, strict=True)]
        words.append(
            f"error on the record as measured {100.0 * fit.rmse / spread:.3g} % of its range, "
            f"{_alone_in_words(alone, records, spread)} without the filter"
        )
    message = f"{fit.message}; {', '.join(words)}"
    if fit.rmse <= _UNUSABLE * quiet_rmse:
        return replace(fit, message=message)
    unusable = (
        f"NOT USABLE on this input: its noise of {size:.2g} rms makes an error of {fit.rmse:.3g}, "
        f"{fit.rmse / quiet_rmse:.2g} times that along a path without noise"
    )
    return replace(fit, success=False, message=f"{unusable}; {message}")


def _alone_in_words(models: Sequence[Any], records: Sequence[Record], spread: float) -> str:
    try:
        residual = residual_of(models, records)
    except SimulationError:
        return "and it diverges"
    return f"{100.0 * rms_of_known(residual) / spread:.3g} %"


def _behind(front: ReversalFilter | None, model: Any) -> Any:
    """A model after a filter of its input; in an actuator the filter of the voltage stands in front of the law."""
    if front is None:
        return model
    if isinstance(model, roles.Containing):
        front = ReversalFilter(threshold=abs(model.input_gain) * front.threshold)
    return with_law(model, lambda law: front >> law)


def _alone(model: Any) -> Any:
    return with_law(model, lambda law: law.behind_filter)


def without_filter(model: Any, records: Sequence[Record]) -> tuple[Any, Sequence[Record]]:
    """A law without the filter of its input, from the first sample, and the records as the law sees them."""
    if not isinstance(model, Cascade) or model.behind_filter is model:
        return placed(model, None), records
    front = placed(model.stages[0], None)
    return placed(model.behind_filter, None), [replace(record, u=front.response(record.u)) for record in records]
