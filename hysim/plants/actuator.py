"""The actuator as a chain of stages:  u -> amplifier -> hysteresis -> creep -> vibration -> y -> sensor."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, items, read_only
from hysim._basics.results import model_of
from hysim.errors import SimulationError, warn_unsafe
from hysim.models import protocols as roles
from hysim.models.cascade import Cascade
from hysim.models.model import family
from hysim.models.protocols import CompiledLaw, Startable, law_at, needs_time, placed
from hysim.plants.actuator_structure import ActuatorStructure
from hysim.plants.chain import Chain, ChainState, Stages, linear_chain
from hysim.plants.stages import Amplifier, Creep, Sensor, Stage, Vibration
from hysim.plants.transfer_function import TransferFunction, linear_plant
from hysim.records import Record


def is_law(value: Any) -> bool:
    """Whether a value has a response and can be stepped in a loop, at a sample time if it needs one."""
    steps = isinstance(value, roles.Responding) and isinstance(value, roles.Steppable)
    return steps and (not needs_time(value) or isinstance(value, roles.Sampled))


@runtime_checkable
class _Resolved(Protocol):
    """A fit that knows the quantum of its record's sensor."""

    resolution: float | None


@family
class Actuator:
    """A hysteretic actuator as a chain of stages: amplifier, hysteresis, creep, vibration, sensor.

    What is behind the law is linear. A voltage that is held between samples moves the law at once to a level that is
    held too, and the chain is exact. Behind an amplifier that slews or charges a capacitance the voltage is exact at
    the ends of sub-steps, between which the law's output is taken as linear: second order in the sub-step.

    Parameters
    ----------
    amplifier : Amplifier, optional
        From the command to the voltage.
    hysteresis : law, optional
        Law from voltage to displacement, such as `BoucWen`. One that depends on the voltage's speed, such as
        `RateDependentPrandtlIshlinskii`, takes each step as a stroke of the whole sample before it.
    creep : Creep, optional
        Slow growth of the displacement.
    vibration : TransferFunction, StateSpace or Modes, optional
        Linear dynamics behind it; also a system of python-control, which is converted. With ``hold="zoh"`` and no
        initial state. Where a response is taken, ``sample``, is the actuator's; without one it is the start.
    sensor : Sensor, optional
        From the true displacement to the measured one.

    Raises
    ------
    TypeError, ValueError
        If a stage is not of its kind, or the vibration holds an initial state, is not held, has several inputs or
        outputs, or is discrete.

    Examples
    --------
    >>> import hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0), sample="end")
    >>> actuator = hs.Actuator(hysteresis=hs.BoucWen(), vibration=mode)
    >>> actuator.response([0.0, 1.0, 1.0], sample_time=1.0).round(6).tolist()
    [0.0, 0.272462, 0.795252]
    """

    amplifier: Amplifier | None = None
    hysteresis: Any = None
    creep: Creep | None = None
    vibration: Vibration | None = None
    sensor: Sensor | None = None

    def _prepare(self) -> None:
        object.__setattr__(self, "vibration", linear_plant(self.vibration))

    def __post_init__(self) -> None:
        if self.hysteresis is not None and not is_law(model_of(self.hysteresis)):
            raise TypeError(
                f"hysteresis must be a law that a loop can step, such as BoucWen, got {type(self.hysteresis).__name__}"
            )
        if isinstance(self.vibration, TransferFunction) and self.vibration.hold != "zoh":
            raise ValueError('the vibration\'s input is held: its hold must be "zoh"')
        if isinstance(self.vibration, TransferFunction) and self.vibration.initial_state:
            raise ValueError("an actuator begins at rest: its vibration must not hold an initial state")

    @property
    def u0(self) -> float | None:
        """Command at which the memory of the law holds; None for the first one."""
        u0 = roles.first_input(self.hysteresis)
        return u0 if u0 is None or self.amplifier is None else self.amplifier.command(u0)

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest voltage of the record that the law was identified on; None if unknown."""
        return roles.input_range(self.hysteresis)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Actuator":
        """The actuator with the memory of its law at the command `u0`, and its range from one of commands."""
        if self.amplifier is not None:
            u0 = None if u0 is None else float(self.amplifier.voltage(u0))
            u_range = None if u_range is None else tuple(sorted(self.amplifier.voltage(u_range).tolist()))
        return self.with_law(lambda law: placed(law, u0, u_range))

    @property
    def input_gain(self) -> float:
        """Gain of the amplifier, from the command to the voltage of the law."""
        return 1.0 if self.amplifier is None else self.amplifier.gain

    def with_law(self, changed: Callable[[Any], Any]) -> "Actuator":
        """The actuator with its law changed by a function."""
        return replace(self, hysteresis=changed(self.hysteresis))

    @classmethod
    def of(cls, fit: Any, record: Record | None = None) -> "Actuator":
        """The actuator of a fit, a law or a plant (see `hysim.close_loop`), kept within the inputs of its record.

        Its amplifier stops at the lowest and the highest voltage of the `record`, and its sensor reads in steps of the
        record's resolution, unless the model's own amplifier and sensor have limits and a quantum. By default these are
        the ``u_range`` that the model was identified on (ValueError if unknown) and the fit's resolution.

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.datasets.table1()
        >>> stack = hs.Actuator.of(hs.identify(hs.Line, rec), rec)
        >>> stack.amplifier.limits, stack.sensor.quantum
        ((0.0, 125.0), 0.0763)
        """
        actuator, resolution = as_actuator(fit), fit.resolution if isinstance(fit, _Resolved) else None
        limits = actuator.u_range
        if record is not None:
            extremes, resolution = (float(record.u.min()), float(record.u.max())), record.resolution
            limits = tuple(sorted(actuator.voltage(extremes).tolist()))
            actuator = actuator.placed(float(record.u[0]) if actuator.u0 is None else actuator.u0, extremes)
        if limits is None:
            raise ValueError("the inputs of the model's record are not known: give Actuator.of(fit, record)")
        amplifier, sensor = actuator.amplifier or Amplifier(), actuator.sensor or Sensor()
        return replace(
            actuator,
            amplifier=replace(amplifier, limits=limits) if amplifier.limits is None else amplifier,
            sensor=replace(sensor, quantum=resolution) if resolution and not sensor.quantum else actuator.sensor,
        )

    @classmethod
    def structure(
        cls,
        hysteresis: Any,
        *,
        creep: bool | int | npt.ArrayLike | Creep = True,
        modes: int = 1,
        amplifier: str | Amplifier | None = None,
        delay: bool = True,
        sensor: Sensor | None = None,
        offsets: Literal["shared", "own"] = "shared",
        start: Any = None,
    ) -> ActuatorStructure:
        """An actuator for `hysim.identify`, on one or several records with time: law, creep, modes and delay at once.

        Records of different rates tell the parts apart: a slow one shows law and creep, a fast one with corners or
        steps the modes and the delay. What they do not determine is held, and the result's message says so. A record
        begins at rest, creep included; its input is held between samples. A law with a single memory has its own at the
        first sample of each record (``hysteresis.z0``); plays begin at rest at zero unless ``initial=`` says otherwise.

        Parameters
        ----------
        hysteresis : law, its class or its structure, or mapping of them
            Its parameters are ``hysteresis.beta``, ... A mapping has a law for each of several inputs: of the record's
            input by the name ``"u"``, of its channels by their names. Their outputs are added, the parameters are
            ``hysteresis.u2.beta``, ..., and the model is a `MultiInputActuator`.
        creep : bool, int, sequence of float or Creep
            True for the bank of `Creep.per_decade`, whose growth is ``creep.percent``; a number of log-spaced elements
            between the shortest sample time and the duration of the longest record, with ``creep.percent`` and a
            ``creep.slope`` (their growth changes by the factor 10^slope from a decade to the next); time constants [s]
            with free weights ``creep.weights[k]``, relative to the instant response; or a creep that is known.
        modes : int
            Resonances, from 0 to 3: ``vibration.natural_frequencies[k]`` [rad/s], ``vibration.damping_ratios[k]``, and
            of several ``vibration.gains[k]`` for k > 0. They are searched up to half the highest sampling rate. Of
            several inputs up to 20, each with its own gains ``vibration.gains[k].u2``, relative to its output at rest.
        amplifier : {"first-order"} or Amplifier, optional
            A time constant ``amplifier.time_constant`` [s] to be identified, or an amplifier that is known.
        delay : bool
            Whether there is a dead time ``vibration.delay`` [s]. It need not be a whole number of samples, but without
            a mode or a slow amplifier the records show it to a sample only.
        sensor : Sensor, optional
            What the records were read by: its delay is taken into account, and its quantum makes the noise of
            `hysim.identify` ``"quantised"`` where no other is asked for.
        offsets : {"shared", "own"}
            Whether all records have one offset of the law, or each its own.
        start : Actuator or MultiInputActuator, optional
            Of the same inputs and as many modes: the search begins with its modes and its delay beside the starts of
            the laws, no part is searched alone, and no mode is left out.

        Returns
        -------
        ActuatorStructure
            For `hysim.identify`, `hysim.select` and `hysim.compare`. The model is an `Actuator` (of several inputs a
            `MultiInputActuator`) whose `response` to each record's input is the fit (as a delayed sensor reads it).

        Raises
        ------
        ValueError, TypeError
            If an argument is none of these; later of `hysim.identify`, if a record has not the channel of an input.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> stage = hs.Actuator(hysteresis=hs.Play(threshold=0.2), vibration=hs.mode(300.0, 0.05, delay=0.4e-3))
        >>> slow, fast = np.sin(np.linspace(0.0, 9.0, 90)), np.repeat([0.0, 1.0, -0.5, 0.5], 20)
        >>> runs = ((slow, 0.1), (fast, 1e-3))
        >>> recs = [hs.Record(u=u, y=stage.response(u, h), t=h * np.arange(u.size)) for u, h in runs]
        >>> fit = hs.identify(hs.Actuator.structure(hs.Play, creep=False), recs)
        >>> round(fit.estimates["vibration.natural_frequencies[0]"], 3), round(fit.estimates["vibration.delay"], 6)
        (300.0, 0.0004)
        """
        return ActuatorStructure(
            family=cls,
            law=hysteresis,
            creep=creep,
            modes=modes,
            amplifier=amplifier,
            delay=delay,
            sensor=sensor,
            offsets=offsets,
            start=start,
        )

    @property
    def dynamic(self) -> bool:
        """Whether the displacement or its measurement depends on time."""
        return self._moves or (self.sensor is not None and self.sensor.delay > 0.0)

    @property
    def dc_gain(self) -> float:
        """Displacement at rest per unit of the command, with a law of the slope one."""
        amplifier = 1.0 if self.amplifier is None else self.amplifier.gain
        creep = 1.0 if self.creep is None else self.creep.dc_gain
        return amplifier * creep * (1.0 if self.vibration is None else self.vibration.dc_gain)

    def voltage(self, u: npt.ArrayLike) -> FloatArray:
        """Voltage at the law after a command has been held, in the shape of `u`."""
        return np.array(u, dtype=float) if self.amplifier is None else self.amplifier.voltage(u)

    def level(self, u: npt.ArrayLike) -> FloatArray:
        """Output of the law for commands, each held until the amplifier has settled, shape (n,)."""
        voltage = self.voltage(read_only(u, "u", ndim=1))
        return voltage if self.hysteresis is None else np.array(law_at(self.hysteresis, math.inf).response(voltage))

    def response(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> FloatArray:
        """True displacement (n,) at the samples of a command `u` (n,) that is held between them.

        At the first sample the law has its initial memory and everything is at rest, creep included. Only a `dynamic`
        actuator needs the `sample_time` [s]. `substeps` are those of a sample behind an amplifier that takes time, by
        default 4 to 64 of a quarter of its time constant. Raises SimulationError if a stage diverges; ValueError if `u`
        is not finite or has not one axis, a needed time is missing, or the vibration integrates and cannot rest.
        """
        inputs = read_only(u, "u", ndim=1)
        if not self._moves or not inputs.size:
            return self.level(inputs)
        return self.advance(inputs, sample_time=sample_time, substeps=substeps)[0]

    def advance(
        self,
        u: npt.ArrayLike,
        state: ChainState | None = None,
        *,
        sample_time: float | None = None,
        substeps: int | None = None,
    ) -> tuple[FloatArray, ChainState]:
        """As `response`, continued from `state` (by default rest) with the same bits, and the state at the end."""
        inputs = read_only(u, "u", ndim=1)
        chain = self.chain(self._any_time(sample_time), substeps)
        if state is None and not inputs.size:
            raise ValueError("u must hold a sample to begin at rest with")
        begin = chain.rest(float(inputs[0])) if state is None else state
        signals, end = chain.driven(inputs, begin)
        if signals.lost >= 0:
            raise SimulationError(f"the actuator leaves the finite numbers at sample {signals.lost}")
        if isinstance(self.vibration, TransferFunction) and self.vibration.sample == "end":
            return np.append(signals.y, chain.displacement(end))[1:], end
        return chain.after_the_command(signals, begin), end

    @property
    def as_read(self) -> "Actuator":
        """The actuator whose displacement is what the sensor of this one reads, without noise and steps."""
        if self.sensor is None or not self.sensor.delay:
            return self
        vibration = self.vibration or TransferFunction(num=(1.0,), den=(1.0,))
        return replace(self, vibration=replace(vibration, delay=vibration.delay + self.sensor.delay))

    def measured(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> FloatArray:
        """Readings (n,) of the sensor for `response`: late, noisy, in steps; arguments and errors as there."""
        if self.sensor is None:
            return self.response(u, sample_time, substeps=substeps)
        return self.sensor.measure(self.as_read.response(u, sample_time, substeps=substeps))

    def startable(self, sample_time: float | None = None, *, substeps: int | None = None) -> Startable:
        """A step from the command to what `measured` reads without noise; ValueError without a needed time [s]."""
        actuator = self.as_read
        at_end = isinstance(actuator.vibration, TransferFunction) and actuator.vibration.sample == "end"
        return actuator.chain(self._any_time(sample_time), substeps).startable(at_end=at_end)

    def compiled(
        self, u0: float = 0.0, *, sample_time: float | None = None, substeps: int | None = None
    ) -> CompiledLaw:
        """The actuator as a step for loops, at rest at `u0`; arguments and errors as of `startable`."""
        self.chain(self._any_time(sample_time), substeps).rest(u0)
        return self.startable(sample_time, substeps=substeps).started(u0)

    def signals(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> dict[str, FloatArray]:
        """Output of each stage at the samples of `u`, by name; arguments and errors as of `response`.

        There are ``"y"``, and for the stages that the actuator has ``"amplifier"`` (voltage), ``"hysteresis"``,
        ``"creep"`` and ``"measurement"``; ``"z"`` for a law with a memory. A stage's signal is the response up to it.
        """
        parts = {"y": self}
        if self.creep is not None:
            parts["creep"] = replace(self, vibration=None)
        if self.hysteresis is not None:
            parts["hysteresis"] = replace(self, creep=None, vibration=None)
        if self.amplifier is not None:
            parts["amplifier"] = replace(self, hysteresis=None, creep=None, vibration=None)
        signals = {name: part.response(u, sample_time, substeps=substeps) for name, part in parts.items()}
        if self.sensor is not None:
            signals["measurement"] = self.measured(u, sample_time, substeps=substeps)
        memory = self.memory(u, sample_time, substeps=substeps)
        return signals if memory is None else signals | {"z": memory}

    def memory(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> FloatArray | None:
        """Memory of the law at the samples of `u`, None without one; arguments and errors as of `response`."""
        if not isinstance(self.hysteresis, roles.Remembering):
            return None
        inputs = read_only(u, "u", ndim=1)
        if not self._drive_takes_time and not needs_time(self.hysteresis):
            return np.asarray(self.hysteresis.memory(self.voltage(inputs)))
        chain = self.chain(sample_time, substeps)
        memory = law_at(self.hysteresis, chain.step).memory
        if not self._drive_takes_time or not inputs.size:
            return np.asarray(memory(self.voltage(inputs)))
        begin = chain.rest(float(inputs[0]))
        signals, _ = chain.driven(inputs, begin)
        return np.asarray(memory(np.append(begin.voltages[1], signals.v))[: -1 : chain.substeps])

    def chain(self, sample_time: float | None, substeps: int | None = None) -> Chain:
        """The actuator as it is stepped at a sample time [s]."""
        if sample_time is None:
            raise ValueError("an actuator that moves in time needs sample_time")
        return Chain(Stages(**items(self)), sample_time, substeps)

    def linear(self, sample_time: float) -> tuple[Stage, float]:
        """From command to measurement with a law of the slope one, without limits; and its dead time [s]."""
        delays = [stage.delay for stage in (self.vibration, self.sensor) if stage is not None]
        return linear_chain(self.amplifier, self.creep, self.vibration, sample_time), sum(delays)

    def _any_time(self, sample_time: float | None) -> float | None:
        """The sample time; where it has no effect any will do."""
        return sample_time if self.dynamic or sample_time is not None else 1.0

    @property
    def _moves(self) -> bool:
        slow = self._drive_takes_time or needs_time(self.hysteresis)
        return slow or self.creep is not None or self.vibration is not None

    @property
    def _drive_takes_time(self) -> bool:
        return self.amplifier is not None and self.amplifier.dynamic


def as_actuator(plant: Any) -> Actuator:
    """Any plant as an actuator: a law becomes its hysteresis, a linear plant its vibration; others are a TypeError.

    Of a cascade of laws that ends with a transfer function the laws become the hysteresis, and the transfer function
    the vibration, which begins at rest. A creep, an amplifier and the result of a fit are taken, too.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.control.as_actuator(hs.Line(slope=2.0)) == hs.Actuator(hysteresis=hs.Line(slope=2.0))
    True
    """
    warn_unsafe(plant)
    plant = model_of(plant)
    if isinstance(plant, Actuator):
        return plant
    if is_law(plant):
        return Actuator(hysteresis=plant)
    if isinstance(plant, Creep):
        return Actuator(creep=plant)
    if isinstance(plant, Amplifier):
        return Actuator(amplifier=plant)
    if isinstance(plant, Cascade) and isinstance(plant.stages[-1], TransferFunction):
        laws = plant.stages[:-1]
        hysteresis = Cascade(stages=laws) if len(laws) > 1 else laws[0] if laws else None
        return Actuator(hysteresis=hysteresis, vibration=plant.stages[-1])
    if isinstance(vibration := linear_plant(plant), Vibration):
        return Actuator(vibration=vibration)
    moves = ", which moves in time: a loop cannot step such a law" if roles.needs_time(plant) else ""
    raise TypeError(f"plant must be an Actuator, a law or a linear plant, got {type(plant).__name__}{moves}")


def as_stepwise(plant: Any) -> roles.Stepwise:
    """A model as one that runs sample by sample: itself where it does, else as an actuator; TypeError if neither."""
    return plant if isinstance(plant, roles.Stepwise) else as_actuator(plant)
