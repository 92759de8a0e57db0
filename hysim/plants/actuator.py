"""The actuator as a chain of stages:  u -> amplifier -> hysteresis -> creep -> vibration -> y -> sensor."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, items, read_only
from hysim.errors import SimulationError
from hysim.models.cascade import Cascade
from hysim.models.model import family
from hysim.models.protocols import (
    CompiledLaw,
    Remembering,
    Responding,
    Sampled,
    Startable,
    Steppable,
    Stepwise,
    law_at,
    needs_time,
)
from hysim.plants.amplifier import Amplifier
from hysim.plants.chain import Chain, ChainState, linear_chain
from hysim.plants.creep import Creep
from hysim.plants.sampled import Stage, Vibration
from hysim.plants.sensor import Sensor
from hysim.plants.state_space import linear_plant
from hysim.plants.transfer_function import TransferFunction


def is_law(value: Any) -> bool:
    """Whether a value has a response and can be stepped in a loop, at a sample time if it needs one."""
    steps = isinstance(value, Responding) and isinstance(value, Steppable)
    return steps and (not needs_time(value) or isinstance(value, Sampled))


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
    TypeError
        If a stage is not of its kind.
    ValueError
        If the vibration holds an initial state or is not held, has several inputs or outputs, or is discrete.

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

    def __post_init__(self) -> None:
        for name, kind in (("amplifier", Amplifier), ("creep", Creep), ("sensor", Sensor)):
            if not isinstance(part := items(self)[name], kind | None):
                raise TypeError(f"{name} must be of {kind.__name__}, got {type(part).__name__}")
        if self.hysteresis is not None and not is_law(self.hysteresis):
            raise TypeError(
                f"hysteresis must be a law that a loop can step, such as BoucWen, got {type(self.hysteresis).__name__}"
            )
        object.__setattr__(self, "vibration", as_vibration(self.vibration))

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
        """True displacement at the samples of a command that is held between them.

        Parameters
        ----------
        u : array, shape (n,)
            Command. At its first sample the law has its initial memory and everything is at rest, creep included.
        sample_time : float, optional
            Time between two samples [s]; an actuator that is not `dynamic` needs none.
        substeps : int, optional
            Sub-steps of a sample behind an amplifier that takes time, by default 4 to 64 of a quarter of its time
            constant.

        Returns
        -------
        array, shape (n,)

        Raises
        ------
        SimulationError
            If a stage diverges.
        ValueError
            If `u` is not finite or has not one axis, no time is given where one is needed, or the vibration cannot
            rest at the first sample because it integrates.
        """
        inputs = read_only(u, "u", ndim=1)
        if not self._moves or not inputs.size:
            return self.level(inputs)
        return self.advance(inputs, sample_time, substeps=substeps)[0]

    def advance(
        self,
        u: npt.ArrayLike,
        sample_time: float | None,
        state: ChainState | None = None,
        *,
        substeps: int | None = None,
    ) -> tuple[FloatArray, ChainState]:
        """As `response`, continued from `state` (by default rest), and the state after the last sample.

        The bits are those of one uncut command. Raises ValueError also if there is neither a state nor a sample.
        """
        inputs = read_only(u, "u", ndim=1)
        chain = self.chain(sample_time, substeps)
        if state is None and not inputs.size:
            raise ValueError("u must hold a sample to begin at rest with")
        begin = chain.rest(float(inputs[0])) if state is None else state
        signals, end = chain.driven(inputs, begin)
        if signals.lost >= 0:
            raise SimulationError(f"the actuator leaves the finite numbers at sample {signals.lost}")
        if isinstance(self.vibration, TransferFunction) and self.vibration.sample == "end":
            return np.append(signals.y, chain.displacement(end))[1:], end
        return chain.after_the_command(signals, begin), end

    def measured(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> FloatArray:
        """Readings (n,) of the sensor for `response`: late, noisy, in steps; arguments and errors as there."""
        if self.sensor is None:
            return self.response(u, sample_time, substeps=substeps)
        return self.sensor.measure(self._late(self.sensor.delay).response(u, sample_time, substeps=substeps))

    def startable(self, sample_time: float | None = None, *, substeps: int | None = None) -> Startable:
        """The actuator as a step from the command to what `measured` reads without noise, for exports.

        An actuator that is not `dynamic` needs no `sample_time` [s]. Raises ValueError if one is needed, and TypeError
        if the law has no start.
        """
        whole = self if self.sensor is None else self._late(self.sensor.delay)
        at_end = isinstance(whole.vibration, TransferFunction) and whole.vibration.sample == "end"
        return whole.chain(self._any_time(sample_time), substeps).startable(at_end=at_end)

    def compiled(
        self, u0: float = 0.0, *, sample_time: float | None = None, substeps: int | None = None
    ) -> CompiledLaw:
        """The step of `startable` at rest at the command `u0`; ValueError also if the actuator cannot rest there."""
        self.chain(self._any_time(sample_time), substeps).rest(u0)
        return self.startable(sample_time, substeps=substeps).started(u0)

    def signals(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, substeps: int | None = None
    ) -> dict[str, FloatArray]:
        """Output of each stage at the samples of `u`, by name; arguments and errors as of `response`.

        There are ``"y"``, and for the stages that the actuator has ``"amplifier"`` (voltage), ``"hysteresis"``,
        ``"creep"`` and ``"measurement"``; ``"z"`` for a law with a memory. A stage's signal is the response of a chain
        that ends with it.
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
        """Memory of the law at the samples of `u`, shape (n,); None for a law without one. See `response`."""
        if not isinstance(self.hysteresis, Remembering):
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
        return Chain(
            amplifier=self.amplifier,
            hysteresis=self.hysteresis,
            creep=self.creep,
            vibration=self.vibration,
            sensor=self.sensor,
            sample_time=sample_time,
            substeps=substeps,
        )

    def linear(self, sample_time: float) -> tuple[Stage, float]:
        """From command to measurement with a law of the slope one, without limits; and its dead time [s]."""
        delays = [stage.delay for stage in (self.vibration, self.sensor) if stage is not None]
        return linear_chain(self.amplifier, self.creep, self.vibration, sample_time), sum(delays)

    def _any_time(self, sample_time: float | None) -> float | None:
        """The sample time; where it has no effect any will do."""
        return sample_time if self.dynamic or sample_time is not None else 1.0

    @property
    def _moves(self) -> bool:
        """Whether the true displacement depends on time."""
        slow = self._drive_takes_time or needs_time(self.hysteresis)
        return slow or self.creep is not None or self.vibration is not None

    @property
    def _drive_takes_time(self) -> bool:
        return self.amplifier is not None and self.amplifier.dynamic

    def _late(self, delay: float) -> "Actuator":
        """The actuator whose true displacement is this one's of some time ago."""
        if not delay:
            return self
        vibration = self.vibration or TransferFunction(num=(1.0,), den=(1.0,))
        return replace(self, vibration=replace(vibration, delay=vibration.delay + delay))


def as_vibration(value: Any) -> Vibration | None:
    """A linear stage, one of another package converted."""
    plant = linear_plant(value)
    if plant is not None and not isinstance(plant, Vibration):
        raise TypeError(f"vibration must be a TransferFunction, a StateSpace or Modes, got {type(value).__name__}")
    if isinstance(plant, TransferFunction) and plant.hold != "zoh":
        raise ValueError('the vibration\'s input is held: its hold must be "zoh"')
    if isinstance(plant, TransferFunction) and plant.initial_state:
        raise ValueError("an actuator begins at rest: its vibration must not hold an initial state")
    return plant


def as_actuator(plant: Any) -> Actuator:
    """Any plant as an actuator: a law becomes its hysteresis, a linear plant its vibration; others are a TypeError.

    Of a cascade of laws that ends with a transfer function the laws become the hysteresis, and the transfer function
    the vibration, which begins at rest as every actuator does. A creep and an amplifier are taken, too.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.control.as_actuator(hs.Line(slope=2.0)) == hs.Actuator(hysteresis=hs.Line(slope=2.0))
    True
    >>> mode = hs.mode(2.0, 0.1)
    >>> hs.control.as_actuator(hs.Line(slope=2.0) >> mode) == hs.Actuator(hysteresis=hs.Line(slope=2.0), vibration=mode)
    True
    """
    if isinstance(plant, Actuator):
        return plant
    if is_law(plant):
        return Actuator(hysteresis=plant)
    if isinstance(plant, Creep):
        return Actuator(creep=plant)
    if isinstance(plant, Amplifier):
        return Actuator(amplifier=plant)
    if isinstance(plant, Cascade) and isinstance(plant.stages[-1], TransferFunction):
        return _hammerstein(plant.stages)
    vibration = linear_plant(plant)
    if isinstance(vibration, Vibration):
        return Actuator(vibration=vibration)
    raise TypeError(f"plant must be an Actuator, a law or a linear plant, got {type(plant).__name__}")


def _hammerstein(stages: tuple[Any, ...]) -> Actuator:
    """Laws in front of a transfer function; TypeError if one of them is no law that a loop can step."""
    if len(stages) < 3:
        return Actuator(hysteresis=stages[0] if len(stages) > 1 else None, vibration=stages[-1])
    return Actuator(hysteresis=Cascade(stages=stages[:-1]), vibration=stages[-1])


def as_stepwise(plant: Any) -> Stepwise:
    """A model as one that runs sample by sample: itself where it does, else as an actuator; TypeError if neither.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.plants.actuator import as_stepwise
    >>> creep = hs.Creep(time_constants=(1.0,), weights=(0.1,))
    >>> step, parameters, state = as_stepwise(creep).startable(0.5).started(0.0)
    >>> [round(step(parameters, state, u), 6) for u in (0.0, 1.0, 1.0)]
    [0.0, 1.0, 1.039347]
    """
    return plant if isinstance(plant, Stepwise) else as_actuator(plant)
