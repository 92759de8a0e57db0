"""The verb `close_loop`: a sampled controller around a continuous actuator."""

import math
from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._parallel import Progress
from hysim._words import extent, printed, quantity, words
from hysim.errors import SimulationError
from hysim.models.actuator import Actuator, is_law
from hysim.models.chain import Signals
from hysim.models.model import in_brief
from hysim.models.protocols import CompiledController
from hysim.models.sampled import Vibration
from hysim.models.state_space import linear_plant
from hysim.records import Record


class Controller(Protocol):
    """What closes a loop: frozen settings that give a compiled step with its state."""

    def compiled(self, sample_time: float, u0: float, y0: float) -> CompiledController:
        """The controller at rest at the voltage `u0` and the displacement `y0`."""
        ...


@printed
@frozen
class ClosedLoop:
    """A loop that was closed; every signal has shape (n,).

    Parameters
    ----------
    t : array
        Times of the samples [s].
    reference, error : array
        Reference, and reference minus measurement [unit of y].
    command, drive : array
        What the controller asks for, and what it gives within its limits; held from each sample on [unit of u].
    u : array
        Voltage at the law just after each new command, within the amplifier's limits [unit of u]. It is held, unless
        the amplifier takes time.
    z : array, or None
        Memory of the law at each sample, before the new command; None for a law without one.
    y, measurement : array
        True displacement at each sample, before the new command, and what the sensor gives [unit of y].
    conditions : mapping
        Under which the loop ran: plant, controller, sample_time [s], substeps, delay (of the vibration and the
        sensor together) [s], preview (by how much the controller knows the reference ahead) [s], limits (the
        controller's), amplifier_limits, sensor_quantum, noise (rms), seed, u0, the extremes lowest_u and highest_u
        of the voltage, limited_samples (at which the controller or the amplifier gave less than was asked for),
        and voltage_noise_rms and voltage_noise_peak: of the voltage less that of the same loop without noise.
    units : mapping
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``.
    """

    t: FloatArray
    reference: FloatArray
    error: FloatArray
    command: FloatArray
    drive: FloatArray
    u: FloatArray
    z: FloatArray | None
    y: FloatArray
    measurement: FloatArray
    conditions: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        t, u, y = (self.units.get(signal, unit) for signal, unit in (("t", "s"), ("u", ""), ("y", "")))
        rms = float(np.sqrt(np.mean((self.reference - self.y) ** 2)))
        known = self.conditions
        return words(
            [f"ClosedLoop: {self.t.size} samples to {quantity(self.t[-1], t)}, tracking rms {quantity(rms, y)}"],
            {
                "reference": extent(self.reference, y),
                "displacement": extent(self.y, y),
                "voltage": f"{extent(self.u, u)}, limited at {known.get('limited_samples', 'unknown')} samples",
                "plant": in_brief(known["plant"]) if "plant" in known else "",
                "controller": in_brief(known["controller"]) if "controller" in known else "",
                "conditions": ", ".join(
                    f"{name.replace('_', ' ')} {known[name]:.4g}"
                    for name in ("sample_time", "delay", "preview", "noise", "sensor_quantum", "voltage_noise_rms")
                    if known.get(name)
                ),
            },
        )


def close_loop(
    plant: Any,
    controller: Controller,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    u0: float = 0.0,
    substeps: int | None = None,
    units: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> ClosedLoop:
    """Run a sampled controller around an actuator.

    At every sample the controller reads the sensor and gives a command, which is held until the next. The plant
    between the samples is exact, unless its amplifier takes time: then it is second order in the sub-step. The
    delay of the sensor is that of the loop: one sample of it, ``hs.Sensor(delay=sample_time)``, is a controller
    that needs a sample to compute.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at `u0` before the first sample, creep included.
    controller : PID, TrackingController, or anything with its ``compiled``
        At rest too, without a bump. A controller with a method ``ahead`` is given the reference so many samples
        ahead of its time, and after the end of the record its last value.
    t : array, shape (n,)
        Evenly spaced times [s]; their spacing is the controller's sample time.
    reference : array, shape (n,)
        [unit of y]
    u0 : float
        Command before the first sample [unit of u].
    substeps : int, optional
        Of a sample, behind an amplifier that takes time; by default as in `Actuator.response`.
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
    if not is_controller(controller):
        raise TypeError(f"controller must be a PID or the like, got {type(controller).__name__}")
    r, times = read_only(reference, "reference", ndim=1), read_only(t, "t", ndim=1)
    sample_time = Record(u=r, y=r, t=times).sample_time
    plant_at_rest = RestingPlant(actuator, sample_time, u0, substeps)
    signals = plant_at_rest.run(controller, r, progress)
    if signals.lost >= 0:
        raise SimulationError(f"the loop leaves the finite numbers at t = {times[signals.lost]:g}: it is unstable")
    u = plant_at_rest.voltages(signals)
    return ClosedLoop(
        t=times,
        reference=r,
        error=r - signals.measurement,
        command=signals.command,
        drive=signals.drive,
        u=u,
        z=plant_at_rest.memory(signals),
        y=signals.y,
        measurement=signals.measurement,
        conditions={
            **_conditions(actuator, controller, plant_at_rest, signals, u),
            **_voltage_noise(actuator, controller, plant_at_rest, r, u),
        },
        units=units or {},
    )


class RestingPlant:
    """An actuator at rest at the command `u0`, sampled: every loop that is run starts from here."""

    def __init__(self, actuator: Actuator, sample_time: float, u0: float = 0.0, substeps: int | None = None) -> None:
        self.sample_time, self.u0 = sample_time, u0
        self.chain = actuator.chain(sample_time, substeps)
        self.state = self.chain.rest(u0)
        self.y0 = self.chain.displacement(self.state)

    def run(self, controller: Controller, reference: FloatArray, progress: Progress | None = None) -> Signals:
        """Close the loop around it."""
        compiled = CompiledController(*controller.compiled(self.sample_time, self.u0, self.y0))
        given = _known_ahead(reference, preview(controller, self.sample_time))
        return self.chain.run(compiled, self.state, given, progress)[0]

    def voltages(self, signals: Signals) -> FloatArray:
        """Voltage at the law just after each new command."""
        return self.chain.just_after(float(self.state.voltages[1]), signals.v)

    def memory(self, signals: Signals) -> FloatArray | None:
        """Memory of the law just before each new command; None for a law without one."""
        memory = getattr(self.chain.hysteresis, "memory", None)
        if not callable(memory):
            return None
        path = np.append(self.state.voltages[1], signals.v)
        return np.asarray(memory(path)[: -1 : self.chain.substeps])

    def driven(self, u: FloatArray) -> FloatArray:
        """Displacements just before each of the commands `u`, as a loop would measure them."""
        return self.chain.driven(u, self.state)[0].y


def is_controller(value: Any) -> bool:
    """Whether a value gives a compiled step from reference and measurement to a command."""
    return callable(getattr(value, "compiled", None)) and not callable(getattr(value, "response", None))


def as_actuator(plant: Any) -> Actuator:
    """Any plant as the chain that loops run.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        A law becomes an actuator's hysteresis, a linear plant its vibration.

    Returns
    -------
    Actuator

    Raises
    ------
    TypeError
        If it is none of these.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.control.as_actuator(hs.Line(slope=2.0)) == hs.Actuator(hysteresis=hs.Line(slope=2.0))
    True
    """
    if isinstance(plant, Actuator):
        return plant
    if is_law(plant):
        return Actuator(hysteresis=plant)
    vibration = linear_plant(plant)
    if isinstance(vibration, Vibration):
        return Actuator(vibration=vibration)
    raise TypeError(f"plant must be an Actuator, a law or a linear plant, got {type(plant).__name__}")


def preview(controller: Controller, sample_time: float) -> int:
    """By how many samples a controller gets the reference ahead of its time."""
    ahead = getattr(controller, "ahead", None)
    return int(ahead(sample_time)) if callable(ahead) else 0


def _known_ahead(reference: FloatArray, samples: int) -> FloatArray:
    """The reference of some samples later; after its end the last value."""
    if not samples:
        return reference
    return read_only(np.append(reference[samples:], np.full(min(samples, reference.size), reference[-1])))


def _conditions(
    actuator: Actuator, controller: Controller, plant: RestingPlant, signals: Signals, u: FloatArray
) -> dict[str, Any]:
    sensor, amplifier = plant.chain.sensor, plant.chain.amplifier
    within = amplifier.voltage(signals.command) == amplifier.gain * signals.command + amplifier.offset
    return {
        "plant": actuator,
        "controller": controller,
        "sample_time": plant.sample_time,
        "substeps": plant.chain.substeps,
        "delay": plant.chain.delay + sensor.delay,
        "preview": preview(controller, plant.sample_time) * plant.sample_time,
        "limits": getattr(controller, "limits", None),
        "amplifier_limits": amplifier.limits,
        "sensor_quantum": sensor.quantum,
        "noise": sensor.noise,
        "seed": sensor.seed if sensor.noise else None,
        "u0": plant.u0,
        "lowest_u": float(u.min()),
        "highest_u": float(u.max()),
        "limited_samples": int(np.count_nonzero((signals.drive != signals.command) | ~within)),
    }


def _voltage_noise(
    actuator: Actuator, controller: Controller, plant: RestingPlant, reference: FloatArray, u: FloatArray
) -> dict[str, float]:
    """What the sensor's noise adds to the voltage: against the same loop without it; nan where that one is lost."""
    if actuator.sensor is None or not actuator.sensor.noise:
        return {"voltage_noise_rms": 0.0, "voltage_noise_peak": 0.0}
    quiet = replace(actuator, sensor=replace(actuator.sensor, noise=0.0))
    at_rest = RestingPlant(quiet, plant.sample_time, plant.u0, plant.chain.substeps)
    signals = at_rest.run(controller, reference)
    if signals.lost >= 0:
        return {"voltage_noise_rms": math.nan, "voltage_noise_peak": math.nan}
    noise = u - at_rest.voltages(signals)
    return {"voltage_noise_rms": float(np.sqrt(np.mean(noise**2))), "voltage_noise_peak": float(np.abs(noise).max())}
