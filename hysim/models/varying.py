"""Parameters that are polynomials of a channel, and outputs of models whose parameters change along a record.

A polynomial is known by its values at some places of the channel:

    p(T) = sum_k p_k l_k(T),    l_k(T) = prod_(j != k) (T - T_j) / (T_k - T_j)

The values p_k are parameters of the same kind as p, in the same unit and the same box, and are well determined together
where coefficients of powers are not: those of 1 and T at 20 to 60 degC are correlated by 0.96. Of degree 1 the places
are the ends of the identified range; of higher degrees those of Chebyshev and Lobatto, against oscillation.

Along a record on which a channel varies, each branch between two samples has the parameters of the sample at its end,
and so has the output there; the memory is kept where they change. More samples of a channel that goes on steadily are
thus nearer to a continuous change, with an error of first order in its change between two samples.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.parallel import in_chunks
from hysim._columns.channels import label
from hysim.errors import SimulationError
from hysim.kernels import stepping
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.joint_space import columns_beside
from hysim.models.law import Law
from hysim.models.model import family
from hysim.models.parts import labelled, own, response_of
from hysim.models.protocols import Identifiable, Timed, needed_time
from hysim.models.search_space import Parameters
from hysim.models.sum import Sum, SumStructure
from hysim.models.tables import tables_of
from hysim.records import Record

_OUTSIDE = 1e-9  # of the identified range: rounding
_DISTURBED = 1e-12  # of the output: an affine parameter that moves the memory moves it by more


@family
class ChannelPolynomial:
    """A parameter that is a polynomial of a channel, by its values at places of the channel.

    Parameters
    ----------
    parameter : str
        Name of a number of the law, as in `Law.scalars`.
    channel : str
        Name of the channel.
    at : tuple of float
        Increasing places [unit of the channel]; one place for a parameter that is constant.
    values : tuple of float
        Values of the parameter there [unit of the parameter].
    span : tuple of (float, float), optional
        Range of the channel in which the polynomial is known; by default from the first place to the last one.

    Raises
    ------
    ValueError
        If the places do not increase, or there are not as many values.

    Examples
    --------
    >>> import hysim as hs
    >>> gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
    >>> float(gain.value(30.0)), gain.coefficients
    (1.75, (2.5, -0.025))
    """

    parameter: str
    channel: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    span: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.at or (np.diff(self.at) <= 0.0).any():
            raise ValueError(f"at must hold increasing places of {self.channel!r}, got {self.at}")
        if len(self.values) != len(self.at):
            raise ValueError(f"values must hold one number for each of the {len(self.at)} places, got {self.values}")
        span = self.span or (self.at[0], self.at[-1])
        if len(span) != 2 or not span[0] <= span[1]:
            raise ValueError(f"span must be the lowest and the highest {self.channel!r}, got {span}")
        object.__setattr__(self, "span", span)

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.at) - 1

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers 0, 1, ... of the channel."""
        rows = (self.values[k] * power_coefficients(self.at)[k] for k in range(len(self.at)))
        return tuple(np.sum(list(rows), axis=0).tolist())

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each value, such as ``"gain(T=20)"``; that of a constant is the parameter's own."""
        return names_of(self.parameter, self.channel, self.at)

    def value(self, channel: npt.ArrayLike) -> FloatArray:
        """Value of the parameter at values of the channel, of the same shape."""
        return np.asarray(weights(self.at, channel) @ np.array(self.values))

    def is_known_at(self, channel: npt.ArrayLike) -> bool:
        """Whether values of the channel lie in the identified range."""
        low, high = self.span
        slack = _OUTSIDE * (high - low)
        values = np.asarray(channel)
        return bool((values >= low - slack).all() and (values <= high + slack).all())


def names_of(parameter: str, channel: str, at: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{parameter}({channel}={label(place, at)})" for place in at) if len(at) > 1 else (parameter,)


def places(low: float, high: float, degree: int) -> tuple[float, ...]:
    """Places of Chebyshev and Lobatto for a polynomial of this degree, the middle for degree 0."""
    if degree == 0:
        return (0.5 * (low + high),)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inner = (middle - half * np.cos(np.pi * np.arange(1, degree) / degree)).tolist()
    return (low, *inner, high)


def weights(at: tuple[float, ...], channel: npt.ArrayLike) -> FloatArray:
    """Weights of the values at the places, shape (..., n_places): exactly 0 and 1 at a place."""
    x, nodes = np.asarray(channel, dtype=float)[..., np.newaxis], np.array(at)
    rest = [np.delete(nodes, k) for k in range(nodes.size)]
    return np.stack([np.prod((x - r) / (node - r), axis=-1) for node, r in zip(nodes, rest, strict=True)], axis=-1)


def power_coefficients(at: tuple[float, ...]) -> FloatArray:
    """Coefficients of the powers 0, 1, ... of each weight, shape (n_places, n_places)."""
    nodes, roots = np.array(at), np.polynomial.polynomial.polyfromroots
    rest = [np.delete(nodes, k) for k in range(nodes.size)]
    return np.array([roots(r) / np.prod(node - r) for node, r in zip(nodes, rest, strict=True)])


def columns_along(
    subject: Any, parameters: Parameters, varying: Mapping[str, FloatArray], record: Record
) -> FloatArray:
    """As `Identifiable.regressors`, with `varying` parameters (n_sets, n_samples); TypeError if one is affine."""
    if not varying:
        return np.asarray(subject.regressors(parameters, record))
    if isinstance(subject, Sum):
        return columns_along(subject.as_structure(), parameters, varying, record)
    if isinstance(subject, SumStructure):
        known = tuple(part for part in subject.parts if not isinstance(part, Identifiable))
        blocks = [
            columns_along(part, own(parameters, name), own(varying, name), record)
            for name, part in labelled(subject.parts).items()
            if isinstance(part, Identifiable)
        ]
        return columns_beside(blocks, replace(subject, parts=known).regressors({}, record) if known else 0.0)
    law = subject() if isinstance(subject, type) else subject
    law = law.at_sample_time(record.sample_time) if isinstance(law, Timed) else law
    if not isinstance(law, Law):
        raise _cannot_vary(varying, law)
    n_sets = len(next(iter(varying.values())))
    sets = {name: np.broadcast_to(np.asarray(value, dtype=float), (n_sets,)) for name, value in parameters.items()}
    return law.columns_by(lambda numbers, u: paths(law, {**numbers, **varying}, u), sets, record.u)


def response_along(
    model: Any, series: Mapping[str, FloatArray], u: FloatArray, sample_time: float | None = None
) -> FloatArray:
    """Output (n_samples,) of a model with a `series` of some numbers; TypeError if such a number cannot vary."""
    if not series:
        return response_of(model, u, sample_time)
    if isinstance(model, Sum):
        named = labelled(model.parts).items()
        parts = [response_along(part, own(series, name), u, sample_time) for name, part in named]
        return np.asarray(np.sum(parts, axis=0))
    law = model.at_sample_time(needed_time(model, sample_time)) if isinstance(model, Timed) else model
    if isinstance(law, Law):
        y = paths(law, {**law.scalars, **{name: each[np.newaxis] for name, each in series.items()}}, u)[0]
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


def paths(law: Law, parameters: Parameters, u: FloatArray) -> FloatArray:
    """Outputs (n_sets, n_samples) for numbers of this shape, (n_sets,) or (); inf for laws that diverge."""
    from hysim.kernels.varying import drive_varying  # compiled where it is needed

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
        for name, part in labelled(law.parts).items():
            check_memory_is_its_own(part, own(dict.fromkeys(names), name), record)
    elif isinstance(law, Law) and names and law.initial_names:
        changed = law.with_scalars({name: law.scalars[name] + k for k, name in enumerate(names, 1)})
        path_through = np.array([record.u[0], record.u.max(), record.u.min()])
        before, after = (each.remembered(path_through) for each in (law, changed))
        if not np.allclose(before, after, rtol=_DISTURBED, atol=0.0):
            raise ValueError(
                f"{' or '.join(names)} of a {type(law).__name__} moves its memory, and cannot vary along a record; "
                "split it where the channel is nearly constant"
            )
