"""Outputs of models whose parameters change along a record.

Each branch between two samples has the parameters of the sample at its end, and so has the output there; the memory is
kept where they change. More samples of a channel that goes on steadily are thus nearer to a continuous change, with an
error of first order in its change between two samples.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.errors import SimulationError
from hysim.kernels import stepping
from hysim.models._sum_search import SumStructure
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.law import Law
from hysim.models.parts import labels, own, response_of
from hysim.models.protocols import Identifiable, Sampled
from hysim.models.search_space import Parameters
from hysim.models.sum import Sum
from hysim.models.tables import tables_of
from hysim.records import Record

_DISTURBED = 1e-12  # of the output: an affine parameter that moves the memory moves it by more


def columns_along(
    subject: Any, parameters: Parameters, varying: Mapping[str, FloatArray], record: Record
) -> FloatArray:
    """As `Identifiable.regressors`, of parameters `varying` along the record, (n_sets, n_samples) each.

    Those in which the output is affine are not among them: their columns are multiplied by their values. Raises
    TypeError if a model has no parameters that could change from sample to sample.
    """
    if not varying:
        return np.asarray(subject.regressors(parameters, record))
    if isinstance(subject, Sum):
        return columns_along(subject.as_structure(), parameters, varying, record)
    if isinstance(subject, SumStructure):
        return _of_sum(subject, parameters, varying, record)
    law = subject() if isinstance(subject, type) else subject
    if not isinstance(law, Law) or isinstance(law, Sampled):
        raise _cannot_vary(varying, law)
    n_sets = len(next(iter(varying.values())))
    sets = {name: np.broadcast_to(np.asarray(value, dtype=float), (n_sets,)) for name, value in parameters.items()}
    return law.columns_by(lambda numbers, u: paths(law, {**numbers, **varying}, u), sets, record.u)


def response_along(
    model: Any, series: Mapping[str, FloatArray], u: FloatArray, sample_time: float | None = None
) -> FloatArray:
    """Output (n_samples,) of a model some of whose numbers, by name, are a `series` of one for each sample.

    Raises SimulationError if the output diverges, and TypeError if the model's numbers cannot change from sample to
    sample.
    """
    if not series:
        return response_of(model, u, sample_time)
    if isinstance(model, Sum):
        named = zip(labels(model.parts), model.parts, strict=True)
        parts = [response_along(part, own(series, label), u, sample_time) for label, part in named]
        return np.asarray(np.sum(parts, axis=0))
    if isinstance(model, Law) and not isinstance(model, Sampled):
        y = paths(model, {**model.scalars, **{name: each[np.newaxis] for name, each in series.items()}}, u)[0]
        if not np.isfinite(y).all():
            raise SimulationError("the output diverges where the parameters vary along the input")
        return np.asarray(y)
    time = None if sample_time is None else sample_time * np.arange(float(u.size))
    record = Record(u=u, y=u, t=time)
    names = model.search_space(record).columns if isinstance(model, Identifiable) else ()
    if not set(series) <= set(names):
        raise _cannot_vary(series, model)
    columns = np.asarray(model.regressors(model.scalars, record))[0]
    values = {**model.scalars, **series}
    return np.asarray(columns[:, -1] + sum(columns[:, k] * values[name] for k, name in enumerate(names)))


def _cannot_vary(names: Iterable[str], model: Any) -> TypeError:
    return TypeError(
        f"{', '.join(names)} of a {type(model).__name__} cannot vary along a record: only laws of a step, sums of "
        "them, and what the output is linear in can change from sample to sample; split the record where the channel "
        "is nearly constant"
    )


def _of_sum(
    structure: SumStructure, parameters: Parameters, varying: Mapping[str, FloatArray], record: Record
) -> FloatArray:
    """The parts' columns one after the other, and the sum of what is known."""
    outputs: list[FloatArray] = []
    known = [part for part in structure.parts if not isinstance(part, Identifiable)]
    rest = replace(structure, parts=tuple(known)).regressors({}, record)[..., -1] if known else 0.0
    for label, part in zip(labels(structure.parts), structure.parts, strict=True):
        if isinstance(part, Identifiable):
            columns = columns_along(part, own(parameters, label), own(varying, label), record)
            outputs.append(columns[..., :-1])
            rest = rest + columns[..., -1]
    n_sets = max(len(each) for each in outputs)
    joint = [np.broadcast_to(each, (n_sets, *each.shape[1:])) for each in outputs]
    last = np.broadcast_to(rest, (n_sets, len(record)))[..., np.newaxis]
    return np.concatenate([*joint, last], axis=-1)


def paths(law: Law, parameters: Parameters, u: FloatArray) -> FloatArray:
    """Outputs (n_sets, n_samples) of laws with these numbers by name; inf where one diverges.

    A number has the shape (n_sets, n_samples), (n_sets,) or (). Raises ValueError if the law's state holds what depends
    on a number that varies.
    """
    from hysim.kernels.channels.varying import drive_varying  # compiled where it is needed

    if law.u0 is not None:
        again = {k: np.insert(v, 0, v[:, 0], axis=1) if np.ndim(v) == 2 else v for k, v in parameters.items()}
        return paths(law.placed(None), again, np.append(law.u0, u))[:, 1:]
    inputs = read_only(u, "u", ndim=1)
    constants, memory, n_sets = _packed(law, parameters, inputs.size)
    y = np.empty((n_sets, inputs.size))
    step, start = compiled_step(law.step), compiled_start(law.start)
    resume = stepping.unchanged if law.resume is None else law.resume
    anew = law.resume is None and law.workspace > 0

    def work(first: int, stop: int) -> None:
        with np.errstate(all="ignore"):
            drive_varying(step, start, resume, anew, constants, memory, law.workspace, inputs, y, first, stop)

    in_chunks(work, n_sets, n_samples=inputs.size)
    return y


def _packed(law: Law, parameters: Parameters, n_samples: int) -> tuple[FloatArray, FloatArray, int]:
    """Constants of each sample (n_sets * n_samples, n_parameters), memory (n_sets, n_memory), and n_sets."""
    arrays = {name: np.asarray(value, dtype=float) for name, value in parameters.items()}
    n_sets = max([len(each) for each in arrays.values() if each.ndim], default=1)
    series = {
        name: np.broadcast_to(each if each.ndim == 2 else each.reshape(-1, 1), (n_sets, n_samples)).ravel()
        for name, each in arrays.items()
    }
    tables = law.completed(tables_of(type(law).__name__, law.arguments, series, np.zeros((1, 1)))[0])
    constants, memory = law.pack(tables)
    probe = law.pack({**tables, **{name: np.ones_like(tables[name]) for name in law.initial if name in tables}}).memory
    for each in (memory, probe):
        of_sets = each.reshape(n_sets, n_samples, -1)
        if (of_sets != of_sets[:, :1]).any():
            raise ValueError(
                f"the state of a {type(law).__name__} holds numbers that depend on its parameters: they cannot vary "
                "along a record; split it where the channel is nearly constant"
            )
    return read_only(constants, finite=False), read_only(memory[::n_samples], finite=False), n_sets


def check_memory_is_its_own(law: Any, names: Iterable[str], record: Record) -> None:
    """Raise a ValueError if an affine parameter among these moves the memory of a law, so that it cannot vary."""
    names = tuple(names)
    if isinstance(law, Sum | SumStructure):
        for label, part in zip(labels(law.parts), law.parts, strict=True):
            check_memory_is_its_own(part, own(dict.fromkeys(names), label), record)
    elif isinstance(law, Law) and names and law.initial_names:
        moved = law.with_scalars({name: law.scalars[name] + k for k, name in enumerate(names, 1)})
        path_through = np.array([record.u[0], record.u.max(), record.u.min()])
        before, after = (each.remembered(path_through) for each in (law, moved))
        if not np.allclose(before, after, rtol=_DISTURBED, atol=0.0):
            raise ValueError(
                f"{' or '.join(names)} of a {type(law).__name__} moves its memory, and cannot vary along a record; "
                "split it where the channel is nearly constant"
            )
