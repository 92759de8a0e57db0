"""The verb `identify`: declare, search, describe."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._blas import one_blas_thread
from hysim._parallel import Progress, at_most
from hysim.identification import _direct as direct
from hysim.identification._extrapolation import implausible
from hysim.identification._noise import Gaussian, Noise, Quantised, Robust
from hysim.identification._problem import Problem, problem
from hysim.identification._resampling import left_out_errors, rms_of_known
from hysim.identification._result import Identification
from hysim.identification._search import PERFECT, optima
from hysim.identification._searched import Search
from hysim.identification.folds import left_out
from hysim.identification.swapped import swapped_columns, swapped_for
from hysim.models.protocols import Direct, Identifiable, needs_time
from hysim.models.search_space import Freedom
from hysim.records import Record, several


def identify(
    model_or_class: Any,
    record_or_records: Record | Sequence[Record],
    *,
    fixed: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    initial: str | Sequence[str] | None = None,
    noise: str = "gaussian",
    intervals: str = "linear",
    cross_validate: str | int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify a model's parameters on one or several records, by its error in free run.

    Parameters
    ----------
    model_or_class : model, model class or structure
        `hysim.BoucWen`, `hysim.TransferFunction.structure(poles=4, zeros=1)`, ... The search begins at the defaults of
        a class, or at the values of an instance.
    record_or_records : Record or sequence of Record
        Input and output, and for models with dynamics the time. Several records share all parameters but the state at
        the first sample: where it is free, each has its own, ``z0[0]``, ``z0[1]``, ...
    fixed : mapping, optional
        Parameters that are not free, and their values.
    free : sequence of str, optional
        Parameters to identify that are held by default. One of each redundant group is held, for Bouc-Wen ``A = 1``,
        since only the product of A and gain is determined.
    bounds : mapping, optional
        Name to (lower, upper), in place of the family's own box.
    initial : {"free", "rest", "periodic"}, or one of them for each record, optional
        Whether the state at the first sample is identified, is rest, or is that of a steady cycle; by default free for
        a memory, and as the structure says for a transfer function.
    noise : {"gaussian", "quantised", "robust"}
        Normal noise; normal noise before a sensor that rounds to multiples of `Record.resolution`; or Student's t with
        4 degrees of freedom, for records with outliers.
    intervals : {"linear", "profile", "bootstrap"}
        Intervals at 95 %: from the standard errors, by the profile of the likelihood, or from 500 records drawn anew.
    cross_validate : {None, "loo", "cycles", "records"} or int, optional
        What is left out at a time: an output sample, a cycle of the input (not the first), a record, or one of that
        many blocks of samples; the input is kept. Fills `Identification.cv_rmse` and `Identification.cv_residual`.
    seed : int
        Seed of the starts and of random draws. The optimum does not depend on it.
    workers : int, optional
        Number of threads; by default one for each core.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If a name or an option is unknown, nothing is free, the record is too short for the parameters, its input
        is constant, or it has no resolution for quantised noise.
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
    records, options = several(record_or_records, "identify"), _freedom(fixed or {}, free, bounds or {})
    if intervals not in ("linear", "profile", "bootstrap"):
        raise ValueError(f'intervals must be "linear", "profile" or "bootstrap", got {intervals!r}')
    if noise not in ("gaussian", "quantised", "robust"):
        raise ValueError(f'noise must be "gaussian", "quantised" or "robust", got {noise!r}')
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed must be an integer from 0 on, got {seed!r}")
    with at_most(workers), one_blas_thread():
        if isinstance(model_or_class, Direct):
            direct.refuse(model_or_class, options, noise, intervals)
            fit = direct.identified(model_or_class, records, left_out(cross_validate, records), seed)
            doubts = [swapped_columns(records)]
        else:
            family = _family(model_or_class)
            least_squares = problem(family, records, options, initial)
            fit = _searched(least_squares, noise, intervals, left_out(cross_validate, records), seed, progress)
            doubts = [swapped_columns(records)]
            if not any(doubts) and not needs_time(fit.model):
                doubts = [swapped_for(family, records, options, initial, 1.0 - fit.fit_percent / 100.0)]
            doubts.append(implausible(fit.models, records))
        warnings = (*fit.warnings, *filter(None, doubts))
        return replace(fit, warnings=warnings) if any(doubts) else fit


def _searched(
    problem: Problem,
    noise: str,
    intervals: str,
    folds: Sequence[npt.NDArray[np.intp]],
    seed: int,
    progress: Progress | None,
) -> Identification:
    n_samples, n_names = problem.y.size, len(problem.space.names)
    if not n_names:
        raise ValueError("every parameter is fixed: leave at least one free")
    if n_samples < n_names:
        raise ValueError(f"{n_names} parameters cannot be estimated from {n_samples} samples; fix some of them")
    density = _density(noise, problem)
    squares = optima(problem, seed=seed, progress=progress)
    if not squares:
        raise ValueError("every parameter set tried diverged: check the units, or pass bounds=")
    if isinstance(density, Quantised):
        density = density.at_least(squares[0].cost, n_samples - n_names)
    search = Search(problem, density, seed)
    result, likely = search.described(search.likely(squares), intervals, squares[0].x)
    errors = left_out_errors(problem, density, np.array([optimum.theta for optimum in likely]), folds)
    return replace(result, regions=search.regions(likely[0]), cv_residual=errors, cv_rmse=rms_of_known(errors))


def _freedom(fixed: Mapping[str, float], free: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Freedom:
    for name, value in fixed.items():
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise ValueError(f"fixed must hold finite numbers, got {value!r} for {name!r}")
    for name, pair in bounds.items():
        if np.shape(pair) != (2,):
            raise ValueError(f"bounds of {name!r} must be (lower, upper), got {pair!r}")
    return Freedom(fixed, (free,) if isinstance(free, str) else tuple(free), bounds)


def _family(model_or_class: Any) -> Identifiable:
    """The object that declares the search; a class stands for the model with its defaults."""
    family: Any = model_or_class
    if not isinstance(family, Identifiable):
        raise TypeError(f"identify takes a model, a model class or a structure, got {model_or_class!r}")
    belongs_to_the_class = inspect.ismethod(family.search_space)
    if isinstance(model_or_class, type) and not belongs_to_the_class:
        required = [f.name for f in fields(model_or_class) if f.default is MISSING and f.default_factory is MISSING]
        if required:
            raise TypeError(
                f"{model_or_class.__name__} has no defaults for {', '.join(required)}: pass an instance as the start, "
                "or use discover"
            )
        family = model_or_class()
    return family  # type: ignore[no-any-return]


def _density(noise: str, problem: Problem) -> Noise:
    floor = PERFECT * (float(np.abs(problem.y).max()) or 1.0)
    if noise == "gaussian":
        return Gaussian(floor)
    if noise == "robust":
        return Robust(floor)
    quanta = {part.record.resolution for part in problem.parts}
    if len(quanta) != 1 or None in quanta:
        raise ValueError("quantised noise needs the sensor's quantum, the same for all records: Record(resolution=...)")
    return Quantised(float(quanta.pop() or 0.0))
