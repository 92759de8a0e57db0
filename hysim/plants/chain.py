"""An actuator at one sample time, as `hysim.kernels.loop` steps it; every loop and every response goes through here."""

import functools
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_count, check_finite, read_only
from hysim._basics.parallel import in_pieces
from hysim.kernels import controllers
from hysim.kernels import loop as kernels
from hysim.laws.static import Line
from hysim.models import protocols as roles
from hysim.models.compiled_step import startable
from hysim.models.protocols import check_continued, law_at, needs_time, positive_time
from hysim.plants import stages as linear
from hysim.plants.stages import Amplifier, Creep, Sensor, Stage, Vibration

_chain_step = functools.lru_cache(maxsize=256)(kernels.chain_step)
_chain_start = functools.lru_cache(maxsize=256)(kernels.chain_start)

_NO_AMPLIFIER, _NO_LAW, _NO_SENSOR = Amplifier(), Line(slope=1.0), Sensor()
_PER_TIME_CONSTANT = 4  # sub-steps
_FEWEST, _MOST = 4, 64  # sub-steps of a sample


class Stages(NamedTuple):
    """The stages of an `Actuator`, in their order."""

    amplifier: Amplifier | None = None
    hysteresis: Any = None
    creep: Creep | None = None
    vibration: Vibration | None = None
    sensor: Sensor | None = None


class ChainState(NamedTuple):
    """Samples so far, and the states of the stages.

    `past` holds the law's last outputs, the latest at its end, and `readings` the displacements that the sensor has
    still to give, the oldest first, and at its end the one within the last sample. `step` is that of the chain [s].
    """

    samples: int
    voltages: FloatArray
    law: roles.CompiledLaw
    x: FloatArray
    past: FloatArray
    readings: FloatArray
    step: float


class Signals(NamedTuple):
    """Signals at samples, `v` and `w` of the law at sub-steps, first `lost` sample or -1, number of `held` ones."""

    command: FloatArray
    drive: FloatArray
    u: FloatArray  # voltage at the law just after each new command
    v: FloatArray
    w: FloatArray
    y: FloatArray
    measurement: FloatArray
    lost: int
    held: int = 0
    others: Mapping[str, FloatArray] = MappingProxyType({})  # of a structure, by name


class Chain:
    """The stages of an `Actuator` at the sample time [s] of a controller or of a held voltage."""

    def __init__(self, stages: Stages, sample_time: float, substeps: int | None = None) -> None:
        amplifier, hysteresis, creep, vibration, sensor = stages
        positive_time(sample_time)
        self.amplifier, self.sensor = amplifier or _NO_AMPLIFIER, sensor or _NO_SENSOR
        self.substeps = _substeps(self.amplifier, sample_time, substeps)
        self.step = sample_time / self.substeps
        self.hysteresis = _NO_LAW if hysteresis is None else law_at(hysteresis, self.step)
        self.delay = 0.0 if vibration is None else vibration.delay
        self.linear = linear_stage(creep, vibration, self.step)
        between = {"linear": self.amplifier.dynamic}
        creeping = 0 if creep is None else len(creep.weights)
        self.stage = linear.sampled(self.linear, self.step, self.delay, creeping=creeping, **between)
        self.samples_late, part = linear.whole_and_part(self.sensor.delay / sample_time)
        self.seen_in, reading = -1, self.stage.output
        if part:
            self.seen_in, at = linear.whole_and_part((1.0 - part) * self.substeps)
            reading = linear.seen_within(self.linear, self.step, self.delay, at, **between)
        self.outputs = read_only([self.stage.output, reading])
        is_scaled, delays = self.linear.rate != 1.0, self.delay or self.sensor.delay
        self.is_of_its_step = is_scaled or delays > 0.0 or needs_time(hysteresis)

    @property
    def linear_block(self) -> FloatArray:
        stage = self.stage
        return np.concatenate([np.ravel(part) for part in (stage.decline, stage.A, stage.B, self.outputs)])

    def rest(self, u0: float) -> ChainState:
        """At rest at the command `u0`; ValueError if it is not finite, or a plant that integrates cannot rest there."""
        check_finite(u0=u0)
        voltages = self.amplifier.compiled(self.step, u0).state
        level = float(np.asarray(self.hysteresis.response(voltages[1:]))[0])
        x = np.zeros(2 * self.stage.rest.size)
        if level != 0.0:
            with np.errstate(invalid="ignore"):
                x[: self.stage.rest.size] = self.stage.rest * level
        if not np.isfinite(x).all():
            raise ValueError(f"the vibration integrates: it cannot rest at the law's output {level:g}")
        law = roles.CompiledLaw(*self.hysteresis.compiled(float(voltages[1])))
        past, readings = np.full(self.stage.lag + 3, level), np.empty(self.samples_late + 2)
        state = ChainState(0, voltages, law, x, past, readings, self.step)
        state.readings[:] = self.displacement(state)
        return state

    def displacement(self, state: ChainState) -> float:
        """The true displacement just before the next command."""
        row, n = self.stage.output, self.stage.rest.size
        return float(row[3:] @ state.x[:n] + row[1] * state.past[2] + row[2] * state.past[1])

    def seen(self, state: ChainState) -> float:
        """The displacement that the sensor gives just before the next command, without its noise and its quantum."""
        if self.samples_late:
            return float(state.readings[1])
        return self.displacement(state) if self.seen_in < 0 else float(state.readings[-1])

    def after_the_command(self, signals: Signals, state: ChainState) -> FloatArray:
        """The displacement just after each new command; `state` is the one before the run."""
        if not self._jumps:
            return signals.y
        w = np.concatenate([state.past[1:], signals.w])
        return signals.y + self.linear.D * np.diff(w)[1 : 1 + signals.y.size]

    def run(
        self, controller: roles.CompiledController, state: ChainState, reference: FloatArray
    ) -> tuple[Signals, ChainState]:
        """Run a controller, whose state moves along, from a state of the chain; the state at the end with it."""
        n = reference.size
        if self.is_of_its_step:
            check_continued(self.step, state.step)
        law = state.law._replace(state=state.law.state.copy())
        parts = (state.voltages, state.x, state.past, state.readings)
        plant_state, inputs = np.concatenate(parts), self._inputs(state, reference)
        samples, path = np.empty((4, n)), np.empty((2, n * self.substeps))

        def piece(k: slice) -> int:
            with np.errstate(all="ignore"):  # an unstable loop may overflow before it is lost
                lost = kernels.close(
                    *controller, *law, self._parameters, plant_state, inputs, k.start, k.stop, samples, path
                )
            return lost - k.start if lost >= 0 else -1

        lost = in_pieces(piece, n)
        voltages, x, past, readings = np.split(plant_state, np.cumsum([part.size for part in parts])[:-1])
        remaining = np.append(np.roll(readings[:-1], -n), readings[-1])
        end = ChainState(state.samples + n, voltages, law, x, np.roll(past, -n * self.substeps), remaining, self.step)
        (command, drive, y, measurement), (v, w) = samples, path
        u = np.append(state.voltages[1], v)[: -1 : self.substeps] if self.amplifier.dynamic else v
        return Signals(command, drive, u, v, w, y, measurement, lost), end

    def run_each(
        self, controllers: Sequence[roles.CompiledController], state: ChainState, reference: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Displacements (m, n) of controllers of one kind from `state`, and the first sample that diverges, or -1."""
        n, m = reference.size, len(controllers)
        parameters = np.stack([each.parameters for each in controllers])
        states = np.stack([each.state for each in controllers])
        plant = np.concatenate([state.voltages, state.x, state.past, state.readings])
        y, lost = np.empty((m, n)), np.empty(m, dtype=np.int64)
        kernels.close_each(
            controllers[0].step, parameters, states, state.law.step, state.law.parameters, state.law.state,
            self._parameters, plant, self._inputs(state, reference), y, lost,
        )  # fmt: skip
        return y, lost

    def _inputs(self, state: ChainState, reference: FloatArray) -> FloatArray:
        noise = self.sensor.noise_samples(state.samples + reference.size)[state.samples :]
        return read_only(np.stack([reference, noise]), finite=False)

    def driven(self, u: FloatArray, state: ChainState) -> tuple[Signals, ChainState]:
        return self.run(roles.CompiledController(controllers.through, read_only([]), np.zeros(1)), state, u)

    def startable(self, *, at_end: bool = False) -> roles.Startable:
        """A step from the command to the reading after it, or before the next, without noise and the sensor's delay."""
        law, stage = startable(self.hysteresis), self.stage
        row = stage.output if at_end else self.output_row
        order = stage.rest.size
        parts: list[Any] = [
            [law.state.size, at_end, self.sensor.quantum], self.amplifier.compiled(self.step).parameters,
            [stage.decline.size, order, stage.lag, self.substeps],
            row, stage.decline, stage.A.ravel(), stage.B.ravel(), stage.rest, law.parameters,
        ]  # fmt: skip
        state = [np.zeros(kernels.N_PLACE + 2), law.state, np.zeros(2 * order + stage.lag + 3)]
        step, start = _chain_step(law.step), _chain_start(law.step, law.start)
        return roles.Startable(step, read_only(np.concatenate(parts), finite=False), np.concatenate(state), start)

    @property
    def output_row(self) -> FloatArray:
        """Weights of the displacement just after each new command, as `SampledStage.output` has those just before."""
        return read_only([self.linear.D, 0.0, 0.0, *self.linear.C]) if self._jumps else self.stage.output

    @property
    def _jumps(self) -> bool:
        takes_time = self.amplifier.dynamic or linear.whole_and_part(self.delay / self.step)[1]
        return bool(not takes_time and self.linear.D)

    @functools.cached_property
    def _parameters(self) -> FloatArray:
        stage = self.stage
        head = [
            stage.decline.size, stage.rest.size, stage.lag, self.samples_late,
            self.substeps, self.seen_in, self.sensor.quantum,
        ]  # fmt: skip
        driver = self.amplifier.compiled(self.step).parameters
        return read_only(np.concatenate([driver, head, self.linear_block]), finite=False)


def linear_stage(creep: Creep | None, vibration: Vibration | None, step: float) -> Stage:
    first = linear.gain(1.0) if creep is None else linear.creep_stage(creep)
    return first if vibration is None else first.then(linear.vibration_stage(vibration, step))


def linear_chain(amplifier: Amplifier | None, creep: Creep | None, vibration: Vibration | None, step: float) -> Stage:
    """The whole chain with a law of the slope one, without limits and slewing."""
    driver = linear.gain(1.0 if amplifier is None else amplifier.gain)
    if amplifier is not None and amplifier.time_constant:
        driver = driver.then(linear.low_pass(amplifier.time_constant))
    return driver.then(linear_stage(creep, vibration, step))


def _substeps(amplifier: Amplifier, sample_time: float, substeps: int | None) -> int:
    if substeps is not None:
        check_count("substeps", substeps)
        return substeps if amplifier.dynamic else 1
    if not amplifier.dynamic:
        return 1
    wanted = _PER_TIME_CONSTANT * sample_time / amplifier.time_constant if amplifier.time_constant else 0.0
    return min(max(_FEWEST, math.ceil(min(wanted, _MOST))), _MOST)
