"""What every model shares: the `model` decorator, the registry of families, and the protocols.

A model is a specification. It is frozen and keyword-only, its numbers are finite floats, and it is
compared by value. Evolving state is separate: it is passed in and handed back.
"""

import importlib
import pkgutil
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol, TypeGuard, TypeVar, dataclass_transform

from hysim._frozen import FloatArray, checked

T = TypeVar("T")

FAMILIES: dict[str, type] = {}


@dataclass_transform(kw_only_default=True, frozen_default=True)
def model(cls: type[T]) -> type[T]:
    """Make `cls` a frozen model, and enter it into the registry of families under its name."""
    specification = checked(cls)
    FAMILIES[cls.__name__] = specification
    return specification


def every_family() -> dict[str, type]:
    """The registry after every public module of models has entered its families."""
    from hysim import models

    for module in pkgutil.iter_modules(models.__path__):
        if not module.name.startswith("_"):
            importlib.import_module(f"{models.__name__}.{module.name}")
    return FAMILIES


class CompiledLaw(NamedTuple):
    """A law as loops take it: `y = step(parameters, state, u)`, where the state moves along in place."""

    step: Callable[[FloatArray, FloatArray, float], float]
    parameters: FloatArray
    state: FloatArray


class CompiledController(NamedTuple):
    """A controller as loops take it: `u = step(parameters, state, reference, measurement)`.

    The state begins with the last command, before the controller's limits.
    """

    step: Callable[[FloatArray, FloatArray, float, float], float]
    parameters: FloatArray
    state: FloatArray


class Dynamic(Protocol):
    """A plant whose output depends on time; it says so by `dynamic = True`."""

    dynamic: ClassVar[bool] = True

    def response(self, u: FloatArray, sample_time: float) -> FloatArray:
        """Output at the samples of `u`, shape (n,), taken every `sample_time`."""
        ...


def needs_time(plant: Any) -> TypeGuard[Dynamic]:
    """Whether a plant is `Dynamic`."""
    return bool(getattr(plant, "dynamic", False))


def law_at(law: Any, sample_time: float) -> Any:
    """A law as it is stepped at a sample time [s]: itself, or where it depends on time what its ``at`` gives."""
    at = getattr(law, "at", None)
    return law if at is None else at(sample_time)
