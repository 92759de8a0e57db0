"""Abilities of controllers; all but `compiled` are optional."""

from typing import Protocol, runtime_checkable

from hysim.models.protocols import CompiledController


@runtime_checkable
class Controller(Protocol):
    """Settings of a sampled controller."""

    def compiled(self, sample_time: float, u0: float, y0: float) -> CompiledController:
        """Step, parameters, and state at rest at the command `u0` and the displacement `y0`."""
        ...


@runtime_checkable
class Previewing(Protocol):
    """A controller that gets the reference ahead of its time."""

    def ahead(self, sample_time: float) -> int: ...


@runtime_checkable
class Limited(Protocol):
    @property
    def limits(self) -> tuple[float, ...] | None: ...


def limits_of(controller: object) -> tuple[float, ...] | None:
    """Lowest and highest command of a controller; None for no limits."""
    return controller.limits if isinstance(controller, Limited) else None


def preview(controller: object, sample_time: float) -> int:
    """Number of samples by which a controller gets the reference ahead of its time."""
    return controller.ahead(sample_time) if isinstance(controller, Previewing) else 0
