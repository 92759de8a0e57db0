"""Abilities of controllers and laws that `close_loop` uses; all but `compiled` are optional."""

from typing import Protocol, runtime_checkable

import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.models.protocols import CompiledController


@runtime_checkable
class Controller(Protocol):
    """Frozen settings of a sampled controller."""

    def compiled(self, sample_time: float, u0: float, y0: float) -> CompiledController:
        """The compiled step, its parameters and its state at rest at the command `u0` and the displacement `y0`."""
        ...


@runtime_checkable
class Previewing(Protocol):
    """A controller that gets the reference ahead of its time."""

    def ahead(self, sample_time: float) -> int:
        """By how many samples; 0 for none."""
        ...


@runtime_checkable
class Limited(Protocol):
    """A controller whose commands are limited."""

    @property
    def limits(self) -> tuple[float, ...] | None:
        """Lowest and highest command; None for no limits."""
        ...


@runtime_checkable
class Responding(Protocol):
    """A law or a plant."""

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`."""
        ...


@runtime_checkable
class Remembering(Protocol):
    """A law with a memory."""

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Memory at the samples of `u`."""
        ...

    def advance(self, u: npt.ArrayLike) -> tuple[FloatArray, tuple[float, ...]]:
        """Output at the samples of `u`, and the state after them."""
        ...


def limits_of(controller: object) -> tuple[float, ...] | None:
    """Lowest and highest command of a controller; None for no limits."""
    return controller.limits if isinstance(controller, Limited) else None


def preview(controller: object, sample_time: float) -> int:
    """By how many samples a controller gets the reference ahead of its time."""
    return controller.ahead(sample_time) if isinstance(controller, Previewing) else 0
