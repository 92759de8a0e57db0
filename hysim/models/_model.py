"""What every model shares: the `model` decorator, the registry of families, and the protocols.

A model is a specification. It is frozen and keyword-only, its numbers are finite floats, and it is
compared by value. Evolving state is separate: it is passed in and handed back.
"""

from typing import Any, Protocol, TypeVar, dataclass_transform, runtime_checkable

from hysim._frozen import FloatArray, checked

T = TypeVar("T")

FAMILIES: dict[str, type] = {}


@dataclass_transform(kw_only_default=True, frozen_default=True)
def model(cls: type[T]) -> type[T]:
    """Make `cls` a frozen model, and enter it into the registry of families under its name."""
    specification = checked(cls)
    FAMILIES[cls.__name__] = specification
    return specification


@runtime_checkable
class Law(Protocol):
    """A rate-independent hysteresis law: its output depends on the path of the input, not on time."""

    def response(self, u: FloatArray) -> FloatArray:
        """Output at the samples of the piecewise-linear input `u`, shape (n,)."""
        ...

    def advance(self, u: FloatArray, state: Any) -> tuple[FloatArray, Any]:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample."""
        ...


@runtime_checkable
class Dynamic(Protocol):
    """A plant whose output depends on time."""

    def response(self, u: FloatArray, sample_time: float) -> FloatArray:
        """Output at the samples of `u`, shape (n,), taken every `sample_time`."""
        ...
