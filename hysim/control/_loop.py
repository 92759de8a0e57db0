"""The verb `close_loop`: a sampled controller around a continuous actuator."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._parallel import Progress
from hysim.control._pid import CompiledController
from hysim.errors import SimulationError
from hysim.kernels import loop as kernels
from hysim.models.actuator import Actuator, is_law
from hysim.models.transfer_function import TransferFunction
from hysim.records import Record

_CHUNK = 1_000_000


class Controller(Protocol):
    """What closes a loop: frozen settings that give a compiled step with its state."""

    def compiled(self, sample_time: float, u0: float, y0: float) -> CompiledController:
        """The controller at rest at the voltage `u0` and the displacement `y0`."""
        ...


@frozen
class ClosedLoop:
    """A loop that was closed; every signal has shape (n,).

    Parameters
    ----------
    t : array
        Times of the samples [s].
    reference, error : array
        Reference, and reference minus measurement [unit of y].
    command, u : array
        What the controller asks for, and the voltage within its limits; held from each sample on [unit of u].
    z : array, or None
        Memory of the law at each sample, before the new voltage; None for a law without one.
    y, measurement : array
        True displacement at each sample, before the new voltage, and what the sensor gives [unit of y].
    conditions : mapping
        Under which the loop ran: plant, controller, sample_time [s], delay [s], limits, sensor_quantum, noise
        (rms), seed, u0, and the extremes of the voltage.
    units : mapping
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``.
    """

    t: FloatArray
    reference: FloatArray
    error: FloatArray
    command: FloatArray
    u: FloatArray
    z: FloatArray | None
    y: FloatArray
    measurement: FloatArray
    conditions: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)


def close_loop(
    plant: Any,
    controller: Controller,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    u0: float = 0.0,
    units: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> ClosedLoop:
    """Run a sampled controller around an actuator.

    At every sample the controller reads the displacement and gives a voltage, which is held until the next.
    The plant between the samples is exact.

    Parameters
    ----------
    plant : Actuator, law or TransferFunction
        At rest at `u0` before the first sample.
    controller : PID, or anything with its ``compiled``
        At rest too, without a bump.
    t : array, shape (n,)
        Evenly spaced times [s]; their spacing is the controller's sample time.
    reference : array, shape (n,)
        [unit of y]
    u0 : float
        Voltage before the first sample [unit of u].
    units : mapping, optional
        Labels to carry along.
    progress : callable, optional
        Called as ``progress(done, total)`` with numbers of samples, in long runs.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    SimulationError
        If a signal leaves the finite numbers, as in an unstable loop; it names the time.
    TypeError, ValueError
        If the plant is not one, times are uneven, lengths differ, or the plant cannot rest at `u0`.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> run = hs.close_loop(lag, hs.PID(kp=4.0, ki=4.0), np.arange(0.0, 5.0, 0.01), np.ones(500))
    >>> round(float(run.y[-1]), 3), run.conditions["sample_time"]
    (1.0, 0.01)
    """
    actuator = as_actuator(plant)
    if not callable(getattr(controller, "compiled", None)) or callable(getattr(controller, "response", None)):
        raise TypeError(f"controller must be a PID or the like, got {type(controller).__name__}")
    r, times = read_only(reference, "reference", ndim=1), read_only(t, "t", ndim=1)
    sample_time = Record(u=r, y=r, t=times).sample_time
    signals = RestingPlant(actuator, sample_time, u0).run(controller, r, progress)
    if signals.lost >= 0:
        raise SimulationError(f"the loop leaves the finite numbers at t = {times[signals.lost]:g}: it is unstable")
    memory = actuator.memory(np.append(u0, signals.u))
    return ClosedLoop(
        t=times,
        reference=r,
        error=r - signals.y,
        command=signals.command,
        u=signals.u,
        z=None if memory is None else memory[:-1],
        y=signals.y,
        measurement=signals.y,
        conditions=_conditions(actuator, controller, sample_time, u0, signals.u),
        units=units or {},
    )


class Signals(NamedTuple):
    """What a loop gives at every sample; `lost` is the first one that is not finite, or -1."""

    command: FloatArray
    u: FloatArray
    y: FloatArray
    lost: int


class RestingPlant:
    """An actuator at rest at the voltage `u0`, sampled: every loop that is run starts from here."""

    def __init__(self, actuator: Actuator, sample_time: float, u0: float) -> None:
        if not math.isfinite(u0):
            raise ValueError(f"u0 must be finite, got {u0}")
        self.sample_time, self.u0 = sample_time, u0
        self._law = actuator.compiled(u0)
        self._stage = actuator.sampled(sample_time)
        self._level = u0 if actuator.hysteresis is None else float(actuator.hysteresis.response([u0])[0])
        self._x = np.zeros(2 * self._stage.C.size)
        if self._level != 0.0:
            self._x[: self._stage.C.size] = self._stage.rest * self._level
        if not np.isfinite(self._x).all():
            raise ValueError(f"the vibration integrates: it cannot rest at the law's output {self._level:g}")
        self.y0 = float(self._stage.C @ self._x[: self._stage.C.size] + self._stage.D * self._level)

    def run(self, controller: Controller, reference: FloatArray, progress: Progress | None = None) -> Signals:
        """Close the loop around it."""
        step, parameters, state = controller.compiled(self.sample_time, self.u0, self.y0)
        law, law_parameters, law_state = self._law
        law_state, x, past = law_state.copy(), self._x.copy(), np.full(self._stage.lag + 2, self._level)
        A, B_old, B_new, C, D, _, _ = self._stage
        command, u, w, y = np.empty((4, reference.size))
        for start in range(0, reference.size, _CHUNK):
            stop = min(start + _CHUNK, reference.size)
            lost = kernels.close(
                step, parameters, state, law, law_parameters, law_state, A, B_old, B_new, C, D, x, past,
                reference, start, stop, command, u, w, y,
            )  # fmt: skip
            if lost >= 0:
                return Signals(command, u, y, lost)
            if progress is not None:
                progress(stop, reference.size)
        return Signals(command, u, y, -1)


def as_actuator(plant: Any) -> Actuator:
    """Any plant as the chain that loops run."""
    if isinstance(plant, Actuator):
        return plant
    if isinstance(plant, TransferFunction):
        return Actuator(vibration=plant)
    if is_law(plant):
        return Actuator(hysteresis=plant)
    raise TypeError(f"plant must be an Actuator, a law or a TransferFunction, got {type(plant).__name__}")


def _conditions(
    actuator: Actuator, controller: Controller, sample_time: float, u0: float, u: FloatArray
) -> dict[str, Any]:
    return {
        "plant": actuator,
        "controller": controller,
        "sample_time": sample_time,
        "delay": 0.0 if actuator.vibration is None else actuator.vibration.delay,
        "limits": getattr(controller, "limits", None),
        "sensor_quantum": 0.0,
        "noise": 0.0,
        "seed": None,
        "u0": u0,
        "lowest_u": float(u.min()),
        "highest_u": float(u.max()),
    }
