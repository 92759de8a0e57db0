"""Models on several records: one for all of them, or one for each."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hysim.identification import Identification
from hysim.models.channels.dependent import on_record
from hysim.records import Record


@runtime_checkable
class Result(Protocol):
    """A result of `identify` or `discover`."""

    model: Any
    n_parameters: int
    cv_rmse: float


class OneByOne(NamedTuple):
    """Results on records one by one, as one result."""

    model: Any
    n_parameters: int
    cv_rmse: float


def model_of(subject: Any) -> Any:
    """The model of a result, or of results one by one the last; another subject itself."""
    if isinstance(subject, list | tuple) and not isinstance(subject, OneByOne):
        return model_of(subject[-1])
    return subject.model if isinstance(subject, Result) else subject


def models_on(subject: Any, records: Sequence[Record]) -> list[Any]:
    """The model of a subject on each record, with the channels that this has."""
    if isinstance(subject, list | tuple):
        own = [model_of(each) for each in subject]
    elif isinstance(subject, Identification) and len(subject.models) == len(records):
        own = list(subject.models)
    else:
        own = [model_of(subject)] * len(records)
    return [on_record(model, record) for model, record in zip(own, records, strict=True)]


def together(subjects: Sequence[Any]) -> Any:
    """Results one by one as one result with the parameters of all; the last model if none was fitted."""
    fits = [each for each in subjects if isinstance(each, Identification)]
    if not fits:
        return subjects[-1]
    sizes, errors = [each.residual.size for each in fits], [each.cv_rmse for each in fits]
    squares = sum(n * error**2 for n, error in zip(sizes, errors, strict=True))
    return OneByOne(
        model_of(fits[-1]), sum(each.n_parameters for each in fits), math.sqrt(squares / float(np.sum(sizes)))
    )
