"""Models on several records: one for all of them, or one for each."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hysim._results import model_of
from hysim.identification import Identification


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
        """The model on the last record."""
        return self.models[-1]


def together(subjects: Sequence[Any]) -> Any:
    """Results one by one as one result with the parameters of all; the last model if none was fitted."""
    models = tuple(map(model_of, subjects))
    fits = [each for each in subjects if isinstance(each, Identification)]
    if not fits:
        return models[-1]
    sizes, errors = [each.residual.size for each in fits], [each.cv_rmse for each in fits]
    squares = sum(n * error**2 for n, error in zip(sizes, errors, strict=True))
    return OneByOne(models, sum(each.n_parameters for each in fits), math.sqrt(squares / float(np.sum(sizes))))
