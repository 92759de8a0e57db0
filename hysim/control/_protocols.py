"""Abilities of controllers; all but `compiled` are optional."""

from typing import Protocol, runtime_checkable

import numpy as np

from hysim._frozen import FloatArray
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


@runtime_checkable
class Substituting(Protocol):
    """A controller with a number of its own in place of a missing measurement; nan says that it goes without."""

    @property
    def substitute(self) -> float: ...


def begun(controller: Controller, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
    """A controller at rest, whose state has room for what `hysim.kernels.controllers.guarded` holds."""
    compiled = CompiledController(*controller.compiled(sample_time, u0, y0))
    substitute = controller.substitute if isinstance(controller, Substituting) else y0
    return compiled._replace(state=with_room(compiled.state, u0, y0, substitute))


def with_room(state: FloatArray, u: float, reference: float, measurement: float) -> FloatArray:
    """State of a controller, and what is held before the first valid sample."""
    return np.concatenate([state, [reference, measurement, u, 0.0]])


def held_samples(state: CompiledController) -> int:
    """Number of samples at which a controller has held its last valid inputs, or its last command.

    Parameters
    ----------
    state : CompiledController
        From a controller's ``step``, or ``initial``.

    Returns
    -------
    int

    Examples
    --------
    >>> import math, hysim as hs
    >>> pid = hs.PID(kp=1.0, ki=0.5)
    >>> u, state = pid.step(pid.initial(sample_time=1.0), reference=1.0, measurement=0.5)
    >>> again, state = pid.step(state, reference=1.0, measurement=math.nan)  # as if 0.5 were measured again
    >>> u, again, hs.control.held_samples(state)
    (0.5, 0.75, 1)
    """
    return int(state.state[-1])


def limits_of(controller: object) -> tuple[float, ...] | None:
    """Lowest and highest command of a controller; None for no limits."""
    return controller.limits if isinstance(controller, Limited) else None


def preview(controller: object, sample_time: float) -> int:
    """Number of samples by which a controller gets the reference ahead of its time."""
    return controller.ahead(sample_time) if isinstance(controller, Previewing) else 0
