"""The parts of an actuator beside its law: their coordinates, and the stages that values of these make.

The names of the parameters begin with those of the fields of `hysim.Actuator`:

    amplifier.time_constant                                                         [s]
    creep.percent, creep.slope, or creep.weights[k]                                 see `creep_bank`
    vibration.natural_frequencies[k], damping_ratios[k], gains[k]                   [rad/s], -, -
    vibration.delay                                                                 [s]

The modes stand side by side, and their gains come to one: that of the first mode is what remains. So the law carries
the gain of the whole.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from hysim.models.parameters import Coordinate, space_of
from hysim.models.search_space import Freedom, SearchSpace
from hysim.plants.amplifier import Amplifier
from hysim.plants.creep import Creep
from hysim.plants.modes import Modes
from hysim.plants.sampled import Vibration
from hysim.plants.transfer_function import TransferFunction
from hysim.plants.whole.creep_bank import CreepBank
from hysim.plants.whole.survey import Survey

FREQUENCY, DAMPING, GAIN = "natural_frequencies", "damping_ratios", "gains"
BELOW_NYQUIST = 0.98
_PERIODS = 2.0  # of the slowest mode in the fastest record, at least
_DAMPING = (1e-4, 1.5)
_GAIN = (-0.95, 0.95)  # of a mode beside the first one
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

    def stages(self, values: Mapping[str, float], late: float = 0.0) -> Stages:
        """The stages at these values of all parameters, the vibration `late` by so much more [s]."""
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
        others = [values[f"vibration.{GAIN}[{k}]"] for k in range(1, self.modes)]
        vibration = Modes(
            natural_frequencies=tuple(values[f"vibration.{FREQUENCY}[{k}]"] for k in range(self.modes)),
            damping_ratios=tuple(values[f"vibration.{DAMPING}[{k}]"] for k in range(self.modes)),
            gains=(1.0 - sum(others), *others),
            delay=delay,
        )
        return Stages(amplifier, creep, vibration)

    def _vibration(self) -> tuple[tuple[Coordinate, ...], dict[str, float]]:
        survey, box = self.survey, []
        defaults: dict[str, float] = {}
        highest = BELOW_NYQUIST * survey.nyquist
        lowest = min(2.0 * math.pi * _PERIODS / survey.duration, 0.5 * highest)
        for k in range(self.modes):
            names = [f"{name}[{k}]" for name in (FREQUENCY, DAMPING, GAIN)]
            box += [
                Coordinate(names[0], lowest, highest, log=True),
                Coordinate(names[1], *_DAMPING, log=True),
                *([Coordinate(names[2], *_GAIN)] if k else []),
            ]
            defaults |= {names[0]: (lowest * highest) ** 0.5, names[1]: 0.02, **({names[2]: 0.0} if k else {})}
        if self.delay:
            box.append(Coordinate("delay", 0.0, _LATEST * survey.shortest, survey.shortest))
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


def _space(box: tuple[Coordinate, ...], defaults: dict[str, float], freedom: Freedom) -> SearchSpace:
    held = freedom.held(defaults)
    return space_of(box, (), defaults, held, freedom.limits(defaults, held))
