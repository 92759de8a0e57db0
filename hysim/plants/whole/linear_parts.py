"""The parts of an actuator beside its law: their coordinates, and the stages that values of these make.

The names of the parameters begin with those of the fields of `hysim.Actuator`:

    amplifier.time_constant                                                         [s]
    creep.percent, creep.slope, or creep.weights[k]                                 see `creep_bank`
    vibration.natural_frequencies[k], damping_ratios[k], gains[k]                   [rad/s], -, -
    vibration.delay                                                                 [s]

The modes stand side by side, and their gains come to one: that of the first mode is what remains. So the law carries
the gain of the whole. Of several inputs each excites the modes by gains of its own, ``vibration.gains[k].u2`` for the
input u2.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from hysim.models.parameters import Coordinate, space_of
from hysim.models.search_space import Freedom, Parameters, SearchSpace
from hysim.plants.amplifier import Amplifier
from hysim.plants.creep import Creep
from hysim.plants.modes import Modes
from hysim.plants.multi_input_actuator import MultiInputActuator
from hysim.plants.sampled import Vibration
from hysim.plants.transfer_function import TransferFunction
from hysim.plants.whole.creep_bank import CreepBank
from hysim.plants.whole.input_sum import MAIN
from hysim.plants.whole.survey import Survey

FREQUENCY, DAMPING, GAIN = "natural_frequencies", "damping_ratios", "gains"
BELOW_NYQUIST = 0.98
_PERIODS = 2.0  # of the slowest mode in the fastest record, at least
_DAMPING = (1e-4, 1.5)
_GAIN = (-0.95, 0.95)  # of a mode beside the first one
_GAIN_OF_INPUT = (-100.0, 100.0)  # likewise: one of several inputs may move the output at a resonance only
_LATEST = 50.0  # samples of the fastest record
_TIME_CONSTANT = (0.05, 0.1)  # of its sample time, and of its duration


class Stages(NamedTuple):
    """Linear parts of an actuator beside its law."""

    amplifier: Amplifier | None
    creep: Creep | None
    vibration: Vibration | None


@dataclass(frozen=True)
class LinearParts:
    """The parts that are searched, and those that are known."""

    amplifier: Any  # an Amplifier that is known, "first-order", or None
    creep: CreepBank | Creep | None
    modes: int
    delay: bool
    survey: Survey
    inputs: tuple[str, ...] = (MAIN,)
    gains: bool = True  # whether gains of modes are coordinates

    def spaces(self, freedom: Mapping[str, Freedom]) -> dict[str, SearchSpace]:
        """The search space of each part by its name."""
        return {
            name: _space(box, defaults, freedom.get(name, Freedom())) for name, (box, defaults) in self.boxes().items()
        }

    def boxes(self) -> dict[str, tuple[tuple[Coordinate, ...], dict[str, float]]]:
        """Coordinates and defaults of each part that has something to be searched."""
        survey = self.survey
        boxes: dict[str, tuple[tuple[Coordinate, ...], dict[str, float]]] = {}
        if self.amplifier == "first-order":
            low, high = _TIME_CONSTANT[0] * survey.shortest, _TIME_CONSTANT[1] * survey.duration
            box = Coordinate("time_constant", low, max(high, 2.0 * low), log=True)
            boxes["amplifier"] = (box,), {"time_constant": min(survey.shortest, box.upper)}
        if isinstance(self.creep, CreepBank):
            boxes["creep"] = self.creep.coordinates, self.creep.defaults
        if self.modes or self.delay:
            boxes["vibration"] = self._vibration()
        return boxes

    def stages(self, values: Mapping[str, float], late: float = 0.0, name: str = MAIN) -> Stages:
        """The stages behind the input of this name, at these values of all parameters, `late` by so much more [s]."""
        amplifier = self.amplifier
        if amplifier == "first-order":
            amplifier = Amplifier(time_constant=values["amplifier.time_constant"])
        creep = self.creep
        if isinstance(creep, CreepBank):
            creep = creep.made({name[6:]: value for name, value in values.items() if name.startswith("creep.")})
        delay = late + (values["vibration.delay"] if self.delay else 0.0)
        if not self.modes:
            through = TransferFunction(num=(1.0,), den=(1.0,), delay=delay) if self.delay or delay else None
            return Stages(amplifier, creep, through)
        others = [values[f"vibration.{self.gain_of(k, name)}"] for k in range(1, self.modes)]
        return Stages(amplifier, creep, self._modes(values, range(self.modes), (1.0 - sum(others), *others), delay))

    def one_mode(self, values: Mapping[str, float], k: int) -> Stages:
        """The stages with one of the modes, of the gain one."""
        vibration = self._modes(values, [k], (1.0,), values["vibration.delay"] if self.delay else 0.0)
        return replace(self, modes=0).stages(values)._replace(vibration=vibration)

    def of_input(self, values: Parameters, name: str) -> Parameters:
        """The parameters but the gains of the other inputs."""
        others = {self.gain_of(k, other) for k in range(self.modes) for other in self.inputs if other != name}
        return {each: value for each, value in values.items() if each.removeprefix("vibration.") not in others}

    def of_mode(self, values: Parameters, k: int) -> Parameters:
        """The parameters but those of the other modes."""
        others = {f"vibration.{each}[{j}]" for each in (FREQUENCY, DAMPING) for j in range(self.modes) if j != k}
        return {each: value for each, value in values.items() if each not in others}

    def gain_of(self, k: int, name: str) -> str:
        """Name of the gain of a mode for an input."""
        return f"{GAIN}[{k}]" if len(self.inputs) == 1 else f"{GAIN}[{k}].{name}"

    def coordinates_of(self, vibrations: Mapping[str, Any]) -> dict[str, float]:
        """Coordinates by name where the vibration behind each input is this one; those of other parts are left out."""
        first = vibrations[self.inputs[0]]
        values = {"delay": first.delay}
        for k in range(self.modes):
            values |= {f"{FREQUENCY}[{k}]": first.natural_frequencies[k], f"{DAMPING}[{k}]": first.damping_ratios[k]}
            values |= {self.gain_of(k, name): each.gains[k] / each.dc_gain for name, each in vibrations.items()}
        box, _ = self.boxes().get("vibration", ((), {}))
        return {f"vibration.{each.name}": float(each.encode(values[each.name])) for each in box}

    def _modes(self, values: Mapping[str, float], chosen: Sequence[int], gains: Sequence[float], delay: float) -> Modes:
        return Modes(
            natural_frequencies=tuple(values[f"vibration.{FREQUENCY}[{k}]"] for k in chosen),
            damping_ratios=tuple(values[f"vibration.{DAMPING}[{k}]"] for k in chosen),
            gains=tuple(gains),
            delay=delay,
        )

    def _vibration(self) -> tuple[tuple[Coordinate, ...], dict[str, float]]:
        survey, box = self.survey, []
        defaults: dict[str, float] = {}
        highest = BELOW_NYQUIST * survey.nyquist
        lowest = min(2.0 * math.pi * _PERIODS / survey.duration, 0.5 * highest)
        limits = _GAIN if len(self.inputs) == 1 else _GAIN_OF_INPUT
        for k in range(self.modes):
            frequency, damping = f"{FREQUENCY}[{k}]", f"{DAMPING}[{k}]"
            gains = [self.gain_of(k, name) for name in self.inputs] if k and self.gains else []
            box += [
                Coordinate(frequency, lowest, highest, log=True, physical=(True, True)),  # no more is in the record
                Coordinate(damping, *_DAMPING, log=True, physical=(True, False)),
                *(Coordinate(gain, *limits) for gain in gains),
            ]
            defaults |= {frequency: (lowest * highest) ** 0.5, damping: 0.02, **dict.fromkeys(gains, 0.0)}
        if self.delay:
            box.append(Coordinate("delay", 0.0, _LATEST * survey.shortest, survey.shortest, physical=(True, False)))
            defaults["delay"] = 0.0
        return tuple(box), defaults

    def check(self, freedom: Freedom) -> None:
        """Refuse a mode that the user has beyond half the sampling rate, and a delay below zero."""
        for k in range(self.modes):
            name = f"vibration.{FREQUENCY}[{k}]"
            wanted = [freedom.fixed[name]] if name in freedom.fixed else [*freedom.bounds.get(name, ())][1:]
            if wanted and wanted[0] > self.survey.nyquist:
                hertz = 2.0 * math.pi
                raise ValueError(
                    f"{name} = {wanted[0]:g} rad/s ({wanted[0] / hertz:.4g} Hz) is beyond half the highest sampling "
                    f"rate, {self.survey.nyquist / hertz:.4g} Hz: samples look the same as for a mode below it"
                )
        if min((freedom.fixed.get("vibration.delay", 0.0), *freedom.bounds.get("vibration.delay", (0.0,)))) < 0.0:
            raise ValueError("vibration.delay must not be negative")


def vibrations_of(start: Any, inputs: Sequence[str], modes: int) -> dict[str, Modes]:
    """The modes behind each input of an actuator; ValueError if it has other inputs, or not so many modes."""
    several = isinstance(start, MultiInputActuator)
    actuators = dict(zip(start.inputs, start.actuators, strict=True)) if several else {MAIN: start}
    if tuple(actuators) != tuple(inputs):
        raise ValueError(f"start has the inputs {', '.join(actuators)}; hysteresis those of {', '.join(inputs)}")
    found = {name: each.vibration for name, each in actuators.items()}
    for name, each in found.items():
        if not isinstance(each, Modes) or len(each.gains) != modes:
            n = len(each.gains) if isinstance(each, Modes) else 0
            raise ValueError(f"start has {n} modes behind {name}, and modes={modes}: the search grows none beside them")
    return found


def _space(box: tuple[Coordinate, ...], defaults: dict[str, float], freedom: Freedom) -> SearchSpace:
    held = freedom.held(defaults)
    return space_of(box, (), defaults, held, freedom.limits(defaults, held))
