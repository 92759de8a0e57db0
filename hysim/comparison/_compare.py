"""The verb `compare`: models side by side on one record, all by the same protocol.

Every model is identified on the same samples, cross-validated by the same splits and judged on the same test. It is
simulated in free run and judged by the measures of `hysim.metrics`: the fit of its output, and the width of its loop.
On several records a subject is one model for all of them, or one for each.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import map_on_threads
from hysim._basics.progress import Reports, announced_by, reports
from hysim._basics.results import Result, model_of, model_or_class
from hysim._columns.excursions import measured_cycles
from hysim._columns.turning import TOLERANCE
from hysim.comparison._result import Comparison, ComparisonRow
from hysim.errors import Interrupted, SimulationError
from hysim.identification import Identification, identify, sharing
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.models.dependent import on_record
from hysim.models.model import candidates, candidates_named, is_identifiable, is_searched
from hysim.models.parts import response_of
from hysim.models.protocols import Direct, Responding, needs_time
from hysim.records import Record, as_record, several
from hysim.simulation import free_run, models_on, simulate

_SHORT = 200  # samples; leaving one out at a time costs as many fits as there are samples
_BLOCKS = 10
_SAME = 1e-6  # of the output's range: largest effect of a change of rate on a rate-independent model
_CRITERIA = {"fpe": metrics.fpe, "aic": metrics.aic, "bic": metrics.bic}
_FAILURES = (ValueError, TypeError, ArithmeticError, SimulationError)


@reports
def compare(
    models: Mapping[str, Any] | Sequence[Any] | str | None,
    record_or_records: Record | Sequence[Record],
    *,
    cross_validate: str | int | None = "auto",
    test: Record | int | None = None,
    max_evaluations: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Reports = None,
    announce: Callable[[str], None] | None = None,
) -> Comparison:
    """Compare models on a record, or on several.

    Parameters
    ----------
    models : mapping, list, "all" or None
        Name to a model; to a result of `identify` or `discover`; to a class or structure, which is identified on the
        record; or, with several records, to a list of models or results, one for each of them. A name of a family, such
        as ``"bouc-wen"``, stands for it, and a list of names or classes for a mapping. ``"all"``, or None, is every
        family that needs no further arguments; those that this record cannot determine are listed with the reason.
    record_or_records : Record or sequence of Record
        With at least one complete cycle of the input. Of several, which may differ in channels, fit, rmse and criteria
        are those of all; loops are compared on the last one, the `Comparison.record`. A record given twice counts once.
    cross_validate : {"auto", "loo", "cycles", None} or int
        Cross-validation of the classes and structures; see `identify`. ``"auto"`` leaves out one sample at a time on
        records of up to 200 samples, and one of 10 blocks on longer ones.
    test : Record or int, optional
        Data for no fit: another record, on which models that were identified here get a new initial state; or a number
        of last complete cycles of this one, on which the free run continues.
    max_evaluations : int, optional
        Most parameter sets that the search of each model simulates; see `identify`. `ComparisonRow.success` is False
        for a model whose search ended by it, and `ComparisonRow.message` says so.
    seed : int
        Seed of the random starts of the searches.
    workers : int, optional
        Number of threads; by default one for each core. The result does not depend on it.
    progress : callable or False, optional
        Called as ``progress(done, total)`` after each model; see `hysim.simulate`.
    announce : callable, optional
        Called as ``announce(name)`` when a model's turn begins, on the thread that works on it.

    Returns
    -------
    Comparison

    Raises
    ------
    ValueError
        If there is nothing to compare, or the record has no complete cycle, or fewer than the test needs.
    TypeError
        If `record` is no Record, or a subject cannot be compared.
    Interrupted
        A `KeyboardInterrupt`, after Ctrl-C, if some models were compared: its `finished` is their `Comparison`.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=40)
    >>> rec = hs.Record(u=u, y=hs.BoucWen(beta=2.0, gamma=0.5).response(u))
    >>> tab = hs.compare({"line": hs.Line, "truth": hs.BoucWen(beta=2.0, gamma=0.5)}, rec)
    >>> [row.name for row in tab.rows], round(tab["truth"].fit_percent, 3)
    (['line', 'truth'], 100.0)
    """
    records = several(record_or_records, "compare")
    records, subjects = _distinct(records, _subjects(models, len(records)))
    trial = _trial(records, test)
    records = (*records[:-1], trial.training) if trial else records
    training = records[-1]
    if cross_validate == "auto":
        cross_validate = "loo" if sum(map(len, records)) <= _SHORT else _BLOCKS
    options: dict[str, Any] = {"cross_validate": cross_validate, "max_evaluations": max_evaluations, "seed": seed}
    protocol = _Protocol(records, _last_loop(training), trial, options, announce or announced_by(progress))
    names = list(subjects)
    done: dict[str, ComparisonRow | str] = {}

    def compared(k: int) -> None:
        done[names[k]] = protocol.row(names[k], subjects[names[k]])

    def of_those_done() -> Comparison:
        by_name = {name: done[name] for name in names if name in done}
        return Comparison(
            record=training,
            loop=protocol.measured,
            rows=tuple(row for row in by_name.values() if isinstance(row, ComparisonRow)),
            failed={name: reason for name, reason in by_name.items() if isinstance(reason, str)},
            test=trial.record if trial else None,
            earlier=records[:-1],
        )

    try:
        with sharing():
            map_on_threads(compared, len(names), workers=workers, progress=progress or None)
    except KeyboardInterrupt:
        if not done:
            raise
        raise Interrupted(f"{len(done)} of {len(names)} models were compared", of_those_done()) from None
    return of_those_done()


def _last_loop(record: Record) -> LoopMetrics:
    try:
        return loop_metrics(record.u, record.y)
    except ValueError as error:
        raise ValueError(f"compare judges models by the loop of the record, and it has no loop: {error}") from None


@dataclass(frozen=True)
class _Trial:
    """A test: the record for the fits, the record that drives the models, and the first sample that is judged."""

    training: Record
    drive: Record
    begin: int
    own_state: bool

    @property
    def record(self) -> Record:
        return self.drive[self.begin :]


@dataclass(frozen=True)
class _Protocol:
    records: tuple[Record, ...]
    measured: LoopMetrics
    trial: _Trial | None
    options: Mapping[str, Any]
    announce: Callable[[str], None] | None

    def row(self, name: str, subject: Any) -> ComparisonRow | str:
        identified_here = _is_family(subject)
        if self.announce is not None:
            self.announce(name)
        try:
            if identified_here:
                subject = identify(subject, self.records, **self.options)
            return self._measured_row(name, subject, identified_here)
        except _FAILURES as error:
            return " ".join(str(error).split())

    def _measured_row(self, name: str, subject: Any, identified_here: bool) -> ComparisonRow:
        record, measured = self.records[-1], self.measured
        if isinstance(subject, list | tuple):
            own = [models_on(each, [rec])[0] for each, rec in zip(subject, self.records, strict=True)]
            subject = together(subject)
        else:
            own = models_on(subject, self.records)
        outputs = [free_run(each, rec).y for each, rec in zip(own, self.records, strict=True)]
        model, y, every = own[-1], outputs[-1], np.concatenate([each.y for each in self.records])
        simulated = np.concatenate(outputs)
        loop, residual, rmse = _loop(model, record, y), every - simulated, metrics.rmse(every, simulated)
        fitted: dict[str, Any] = {"n_parameters": 0, "cv_rmse": rmse, "cv_residual": residual}
        fitted |= dict.fromkeys(_CRITERIA, math.nan)
        if isinstance(subject, Result):
            d = int(subject.n_parameters)
            cv_rmse = float(subject.cv_rmse) if isinstance(subject, CrossValidated) else math.nan
            fitted = {"n_parameters": d, "cv_rmse": cv_rmse, "cv_residual": np.empty(0)}
            fitted |= {name: criterion(residual, d) for name, criterion in _CRITERIA.items()}
        if isinstance(subject, Identification):
            fitted |= {"cv_residual": subject.cv_residual, "warnings": tuple(subject.warnings)}
            fitted |= {"unsafe": subject.unsafe, "success": subject.success}
            fitted |= {"message": subject.message if identified_here else ""}
        sense = -1.0 if {loop.orientation, measured.orientation} == {"clockwise", "counterclockwise"} else 1.0
        deviation = _rate_deviation(model, record, y)
        test_fit, test_rmse = self._test_errors(subject, model, identified_here)
        return ComparisonRow(
            name=name,
            model=model_of(subject),
            fit_percent=metrics.fit_percent(every, simulated),
            rmse=rmse,
            max_residual=float(np.abs(residual).max()),
            max_width=loop.max_width,
            max_width_at=loop.max_width_at,
            area=loop.area,
            width_rmse=metrics.width_rmse(measured, loop),
            width_error_percent=_excess_percent(sense * loop.max_width, measured.max_width),
            area_error_percent=_excess_percent(sense * loop.area, measured.area),
            is_rate_independent=deviation <= _SAME,
            rate_deviation=deviation,
            y=y,
            loop=loop,
            test_fit_percent=test_fit,
            test_rmse=test_rmse,
            **fitted,
        )

    def _test_errors(self, subject: Any, model: Any, identified_here: bool) -> tuple[float, float]:
        if self.trial is None or isinstance(subject, OneByOne):
            return math.nan, math.nan
        drive, test = self.trial.drive, self.trial.record
        if self.trial.own_state and identified_here:
            model = _with_initial_state(drive, subject, self.options["seed"])
        y = free_run(model, drive).y[self.trial.begin :]
        return metrics.fit_percent(test.y, y), metrics.rmse(test.y, y)


def _subjects(models: Mapping[str, Any] | Sequence[Any] | str | None, n_records: int) -> dict[str, Any]:
    if models is None or (isinstance(models, str) and models == "all"):
        return candidates()
    if isinstance(models, str) or not isinstance(models, Mapping):
        models = _named([models] if isinstance(models, str) else models)
    models = {name: _meant(each) for name, each in models.items()}
    if not models:
        raise ValueError("there is nothing to compare: give at least one model by name")
    for name, subject in models.items():
        if isinstance(subject, list | tuple) and len(subject) != n_records:
            raise ValueError(
                f"{name}: give one model or result for each of the {n_records} records, got {len(subject)}"
            )
        members = subject if isinstance(subject, list | tuple) else [subject]
        if not all(is_identifiable(each) or isinstance(model_or_class(each), Responding) for each in members):
            raise TypeError(f"compare takes a model, a result, a model class or a structure, got {subject!r} as {name}")
    return models


def _distinct(records: tuple[Record, ...], subjects: dict[str, Any]) -> tuple[tuple[Record, ...], dict[str, Any]]:
    """The records without copies of earlier ones, which are no evidence, and the subjects on them."""
    samples = [(each.u.tobytes(), each.y.tobytes()) for each in records]
    places = [k for k, own in enumerate(samples) if own not in samples[:k]]
    if len(places) == len(records):
        return records, subjects
    for name, subject in subjects.items():
        if isinstance(subject, Identification) and len(subject.models) == len(records):
            raise ValueError(f"{name} was identified on records that are not all different: give each record once")
        if isinstance(subject, list | tuple):
            subjects = {**subjects, name: [subject[k] for k in places]}
    return tuple(records[k] for k in places), subjects


def _named(models: Any) -> dict[str, Any]:
    if not isinstance(models, Sequence) or not all(isinstance(each, str | type) for each in models):
        raise TypeError(
            f'compare takes a mapping of names to models, a list of families or their names, or "all", got {models!r}'
        )
    named = [candidates_named(each) if isinstance(each, str) else {each.__name__: each} for each in models]
    return {name: subject for subjects in named for name, subject in subjects.items()}


def _meant(subject: Any) -> Any:
    """A subject, or the one candidate of the family that it names."""
    if not isinstance(subject, str):
        return subject
    subjects = candidates_named(subject)
    if len(subjects) > 1:
        raise ValueError(
            f"{subject!r} stands for several models, {', '.join(subjects)}: give [{subject!r}], or one of them"
        )
    return next(iter(subjects.values()))


def _trial(records: Sequence[Record], test: Record | int | None) -> _Trial | None:
    if test is None:
        return None
    record = records[-1]
    if (drive := as_record(test, "compare")) is not None:
        several([*records, drive], "compare")  # which raises where units differ
        return _Trial(record, drive, begin=0, own_state=True)
    if not isinstance(test, int) or isinstance(test, bool):
        raise TypeError(f"test takes a Record or a number of last cycles, got {test!r}")
    loops = measured_cycles(record.u, test, TOLERANCE)
    begin = loops.first_sample(loops.cycles[-1]) + 1
    if begin < 3:
        raise ValueError(f"a test on {test} of the record's cycles leaves no samples to identify from")
    return _Trial(record[:begin], record, begin, own_state=False)


def _is_family(subject: Any) -> bool:
    return isinstance(subject, type) or not isinstance(subject, Responding | Result | list | tuple)


def _with_initial_state(record: Record, fitted: Identification, seed: int) -> Any:
    model = on_record(fitted.model, record)
    if not is_searched(model):
        return model
    space = model.search_space(record)
    state = set(space.state) & set(space.names)
    if not state:
        return model
    is_alone = len(fitted.models) == 1 and model is fitted.model
    known = fitted.estimates if is_alone else model.scalars
    shared = {name: value for name, value in known.items() if name not in state}
    return identify(model, record, fixed=shared, admissible=False, seed=seed).model


def _loop(model: Any, record: Record, y: FloatArray) -> LoopMetrics:
    """The model's loop; a curve without memory has width 0, at whatever inputs its branches were sampled."""
    loop = loop_metrics(record.u, y)
    if not isinstance(model, Direct) or needs_time(model):
        return loop
    curve, zeros = response_of(model, loop.u, None), np.zeros(loop.u.size)
    names = ("max_width", "mean_width", "mid_width", "area", "relative_width", "energy")
    changes: dict[str, Any] = dict.fromkeys(names, 0.0) | {"loading": curve, "unloading": curve, "width": zeros}
    damping = 0.0 if loop.secant_stiffness > 0.0 else math.nan
    return replace(loop, **changes, max_width_at=float(loop.u[0]), orientation="none", equivalent_damping=damping)


def _rate_deviation(model: Any, record: Record, y: FloatArray) -> float:
    """Largest change of the output, over its range, if the input takes twice as long on the same path."""
    n = len(record)
    slow = np.arange(2 * n - 1) / 2.0
    t = record.sample_time * np.arange(2 * n - 1) if needs_time(model) else None
    changed = simulate(model, t, np.interp(slow, np.arange(n), record.u)).y[::2]
    span = float(np.ptp(y))
    return float(np.abs(changed - y).max()) / span if span > 0.0 else 0.0


def _excess_percent(value: float, measured: float) -> float:
    return 100.0 * (value / measured - 1.0) if measured > 0.0 else math.nan


@runtime_checkable
class CrossValidated(Protocol):
    """A result with an error of prediction."""

    cv_rmse: float


class OneByOne(NamedTuple):
    """Results on records one by one, as one result."""

    models: tuple[Any, ...]
    n_parameters: int
    cv_rmse: float

    @property
    def model(self) -> Any:
        return self.models[-1]


def together(subjects: Sequence[Any]) -> Any:
    """Results one by one as one result with the parameters of all; the last model if no model was fitted."""
    models = tuple(map(model_of, subjects))
    fits = [each for each in subjects if isinstance(each, Identification)]
    if not fits:
        return models[-1]
    sizes, errors = [each.residual.size for each in fits], [each.cv_rmse for each in fits]
    squares = sum(n * error**2 for n, error in zip(sizes, errors, strict=True))
    return OneByOne(models, sum(each.n_parameters for each in fits), math.sqrt(squares / float(np.sum(sizes))))
