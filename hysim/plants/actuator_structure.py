"""An actuator to be identified: amplifier, law, creep, modes and delay at once.

    u -> amplifier -> law -> creep -> modes, delay -> y

Of several inputs each has a law, and the outputs of all are added: creep, frequencies, dampings and delay are common,
and each input excites the modes by gains of its own (`hysim.plants.multi_input_actuator`).

What is behind the law is linear: the output is affine in what the law is affine in, and only the law's other parameters
and those of the parts are searched. The search begins part by part (`hysim.identification._starts`): the law where
the input is slow, the modes and the delay on the fastest record, beside a creep of 1 % a decade, and then all at once.

A parameter is undetermined if its standard error is above its use: 1 % a decade of creep (or half of it), a quarter of
a frequency, two samples of a delay (or all of it). It is held where its part has no effect; a mode is left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, checked
from hysim.models.joint_space import columns_beside, declared, together
from hysim.models.parts import own
from hysim.models.protocols import Doubt, Identifiable, Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants import linear_parts
from hysim.plants import multi_input_actuator as several
from hysim.plants.actuator_search import MOST_LATE, as_points, between_samples, columns_through, finer, points
from hysim.plants.chain import Stages
from hysim.plants.linear_parts import DAMPING, FREQUENCY, GAIN, CreepBank, LinearParts, Survey
from hysim.plants.multi_input_actuator import MAIN, InputSum, ModalGains, MultiInputActuator, seen_by
from hysim.plants.stages import Amplifier, Creep, Sensor
from hysim.records import Record

MOST_MODES = 3
MOST_MODES_OF_SEVERAL = 20  # inputs: their gains are solved for, one mode after the other
_LAW, _OFFSET = "hysteresis", "hysteresis.offset"
_PERCENT, _WEIGHT, _SLOPE = 1.0, 0.05, 0.7
_SHARE_OF_FREQUENCY = 0.25
_GAIN = 0.5
_USUAL_DAMPING = 0.02
_SAMPLES = 2.0  # of delay
_NEAR = 1e-6  # relative distance of a bound


@checked
class ActuatorStructure(Subject):
    """An actuator to be identified; see `hysim.Actuator.structure`, whose class is `family`."""

    family: type
    law: Any
    creep: Any
    modes: int
    amplifier: Any
    delay: bool
    sensor: Any
    offsets: str
    survey: Any = None
    scaled_on: Any = None  # the record that scales the law's box
    known: Mapping[str, float] = field(default_factory=dict)  # parameters that are held beside those of the user
    remarks: tuple[str, ...] = ()
    starting: Any = ()  # coordinates by name
    start: Any = None  # an actuator from whose vibration the search begins
    inputs: tuple[str, ...] = (MAIN,)

    def __post_init__(self) -> None:
        if self.law is None:
            raise ValueError("hysteresis is needed: a law, its class or structure, such as hs.BoucWen or hs.Line")
        law = self.law() if isinstance(self.law, type) else self.law
        if isinstance(law, Mapping):
            law = several.checked_laws(law)
            object.__setattr__(self, "inputs", tuple(law.laws))
        if not isinstance(law, Identifiable):
            raise TypeError(f"hysteresis must be a law that can be identified, got {type(law).__name__}")
        object.__setattr__(self, "law", law)
        object.__setattr__(self, "creep", linear_parts.checked_creep(self.creep))
        most = MOST_MODES if len(self.inputs) == 1 else MOST_MODES_OF_SEVERAL
        if isinstance(self.modes, bool) or self.modes not in range(most + 1):
            raise ValueError(f"modes must be a number from 0 to {most}, got {self.modes!r}")
        if not isinstance(self.amplifier, Amplifier | None) and self.amplifier != "first-order":
            raise ValueError(f'amplifier must be None, "first-order" or an Amplifier, got {self.amplifier!r}')
        if not isinstance(self.delay, bool):
            raise TypeError(f"delay must be True or False, got {self.delay!r}: fix it by fixed= of identify")
        if not isinstance(self.sensor, Sensor | None):
            raise TypeError(f"sensor must be a Sensor, got {type(self.sensor).__name__}")
        if len(self.inputs) > 1 and self.sensor is not None and self.sensor.delay:
            raise ValueError("a sensor with a delay is for one input: of several inputs it is a part of the delay")
        branches = self.start.actuators if isinstance(self.start, MultiInputActuator) else (self.start,)
        if self.start is not None and not all(isinstance(each, self.family) for each in branches):
            raise TypeError(f"start must be an Actuator, or a MultiInputActuator of them, got {self.start!r}")
        if self.offsets not in ("shared", "own"):
            raise ValueError(f'offsets must be "shared" or "own", got {self.offsets!r}')

    def __str__(self) -> str:
        each = self.law.laws.values() if isinstance(self.law, InputSum) else [self.law]
        law = " + ".join(type(law).__name__.removesuffix("Structure") for law in each)
        parts = [
            f"{self.modes} mode{'s' * (self.modes > 1)}" * bool(self.modes),
            "creep" * (self.creep not in (None, False)),
            "delay" * self.delay,
            "amplifier" * (self.amplifier is not None),
        ]
        return f"Actuator of {', '.join([law, *filter(None, parts)])}"

    # ------------------------------------------------------------------------------ as `identify` sees it

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        if self.offsets == "own" and freedom.initial not in (None, "free"):
            raise ValueError('offsets="own" needs initial="free"; fix the memory by fixed={"hysteresis.z0": 0}')
        parts = self.parts([record])
        parts.check(freedom)
        known = {name: value for name, value in self.known.items() if name not in freedom.free}
        wished = replace(freedom, fixed={**known, **freedom.fixed})
        scaling = self.static(record) if self.scaled_on is None else self.scaled_on
        own_spaces = {name: lambda free, name=name: parts.spaces({name: free})[name] for name in parts.boxes()}
        spaces = declared({_LAW: lambda free: self.law.search_space(scaling, free), **own_spaces}, wished)
        space = together(spaces)
        state = (*space.state, *self._offsets(space.linear)) if self.offsets == "own" else space.state
        points = np.clip(as_points(space, self.starting), space.lower, space.upper)
        return replace(space, starts=points, screened=0, regions={}, state=state)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        late = 0.0 if self.sensor is None else self.sensor.delay
        parts = self.parts([record])
        others = {name: value for name, value in parameters.items() if not name.startswith(f"{_LAW}.")}
        if isinstance(self.law, ModalGains):
            return self._by_mode(self.law, parts, others, record)
        blocks = [
            columns_through(
                law, shape, parts.of_input(others, name), partial(parts.stages, late=late, name=name), reading
            )
            for name, law, shape, reading in self._laws(own(parameters, _LAW), record)
        ]
        return columns_beside(blocks)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The law's memory after an input that stood still; ValueError for one that moved."""
        if np.ptp(record.u) > 0.0:
            raise ValueError('an actuator begins at rest, not in a cycle: initial="periodic" is not for it')
        states = self.law.steady(own(parameters, _LAW), self.static(record))
        return {f"{_LAW}.{name}": value for name, value in states.items()}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        parts, law = self.parts([]), self.law.assemble(own(parameters, _LAW))
        if not isinstance(law, InputSum):
            stages = parts.stages(parameters)._replace(hysteresis=law, sensor=self.sensor)
            return self.family(**stages._asdict())
        each = [parts.stages(parameters, name=name)._replace(hysteresis=part) for name, part in law.laws.items()]
        return MultiInputActuator(inputs=self.inputs, actuators=tuple(self.family(**one._asdict()) for one in each))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Parameters that the records do not determine, and the values at which they are held."""
        return self.remarks

    # ------------------------------------------------------------------------------ as its search begins

    def over(self, records: Sequence[Record], freedom: Freedom) -> tuple["ActuatorStructure", Sequence[Record]]:
        """The structure for these records; records without a resolution get that of the sensor."""
        survey = Survey.of(records)
        quantum = 0.0 if self.sensor is None else self.sensor.quantum
        if quantum:
            records = [
                replace(record, resolution=quantum) if record.resolution is None else record for record in records
            ]
        bank = linear_parts.creep_bank(self.creep, survey.shortest, survey.longest)
        idle = {f"creep.weights[{k}]": 0.0 for k in bank.idle} if isinstance(bank, CreepBank) else {}
        idle = {name: value for name, value in idle.items() if name not in {*freedom.free, *freedom.bounds}}
        remarks = (bank.remark,) if isinstance(bank, CreepBank) and idle else ()
        scaled_on = self.static(records[survey.law])
        structure = replace(self, survey=survey, scaled_on=scaled_on, known=idle, remarks=remarks)
        structure.parts([]).check(freedom)
        return structure, records

    @property
    def noise(self) -> str:
        """The noise that its sensor makes, as `identify` names it."""
        return "quantised" if self.sensor is not None and self.sensor.quantum else "gaussian"

    @property
    def slowest(self) -> int:
        """The record of the slowest input among those with a wide one."""
        return 0 if self.survey is None else int(self.survey.law)

    @property
    def fastest(self) -> int:
        """The record on which the parts that grow are searched."""
        return 0 if self.survey is None else int(self.survey.fastest)

    def static(self, record: Record) -> Record:
        """The record with the voltages that a known amplifier makes of its commands."""
        if not isinstance(self.amplifier, Amplifier):
            return record
        others = {name: self.amplifier.voltage(seen_by(record, name).u) for name in self.inputs if name != MAIN}
        return replace(record, u=self.amplifier.voltage(record.u), channels={**record.channels, **others})

    def with_law(self, law: Any) -> "ActuatorStructure":
        """The structure with another law, or another start of it."""
        return replace(self, law=law)

    def behind(self, law: Any) -> "ActuatorStructure":
        """The structure after a law that is known except for its gain, or directly after several inputs."""
        return replace(self, law=several.Scaled(law) if len(self.inputs) == 1 else ModalGains(self.inputs, self.modes))

    def solved(self, estimates: Mapping[str, float]) -> dict[str, float]:
        """Coordinates by name that are solved for after a known law, and are searched with another law."""
        if not isinstance(self.law, ModalGains):
            return {}
        return {f"vibration.{name}": value for name, value in self.law.shares(own(estimates, _LAW)).items()}

    def begins(self) -> Mapping[str, float] | None:
        """Coordinates of the vibration at which the user lets the search begin."""
        if self.start is None:
            return None
        return self.parts([]).coordinates_of(linear_parts.vibrations_of(self.start, self.inputs, self.modes))

    @property
    def names(self) -> frozenset[str]:
        """Names of the parameters of the parts other than the law."""
        boxes = {} if self.survey is None else self.parts([]).boxes()
        return frozenset(f"{part}.{each.name}" for part, (box, _) in boxes.items() for each in box)

    def growing(self) -> Sequence["ActuatorStructure"]:
        """The structure without modes, with the first one, and so on; a creep that is searched is left out."""
        creep = self.creep if isinstance(self.creep, Creep) else False
        known = {name: value for name, value in self.known.items() if not name.startswith("creep.")}
        return [replace(self, modes=k, creep=creep, known=known) for k in range(self.modes + 1)]

    def points(self, space: SearchSpace, known: Sequence[Mapping[str, float]]) -> FloatArray:
        """Points of a space of this plant, spread over its last part, with coordinates `known` of a smaller one."""
        return points(space, self.modes, known)

    def finer(self, space: SearchSpace, best: FloatArray) -> FloatArray:
        """Points about the best of `points`, and these."""
        return finer(space, self.modes, best)

    def beyond(self, space: SearchSpace, end: FloatArray) -> FloatArray:
        """The end (1, n_x) of a descent that may rest too early, and points (n, n_x) from which others may go on."""
        return between_samples(space, end)

    def trials(self) -> Sequence["ActuatorStructure"]:
        """The structure with each delay that samples tell apart, where the output jumps with the command."""
        if not self.delay or self.modes or self.amplifier == "first-order" or "vibration.delay" in self.known:
            return [self]
        if isinstance(self.amplifier, Amplifier) and self.amplifier.dynamic:
            return [self]
        return [self._delayed(k, self.survey.shortest) for k in range(MOST_LATE)]

    def begun(self, starting: Sequence[Mapping[str, float]]) -> "ActuatorStructure":
        """The structure with a search that begins at these coordinates by name."""
        return replace(self, starting=tuple(dict(each) for each in starting))

    def smaller(self, freedom: Freedom) -> tuple["ActuatorStructure", str] | None:
        """The structure without its last mode; None if it has no mode, or the user names one of its parameters."""
        k = self.modes - 1
        gains = [self.parts([]).gain_of(k, name) for name in self.inputs]
        mine = {f"vibration.{name}" for name in (f"{FREQUENCY}[{k}]", f"{DAMPING}[{k}]", *gains)}
        if k < 0 or self.start is not None or mine & {*freedom.fixed, *freedom.free, *freedom.bounds}:
            return None
        box = {each.name: each for each in self.parts([]).boxes()["vibration"][0]}[f"{FREQUENCY}[{k}]"]
        low, high = box.lower / (2.0 * math.pi), box.upper / (2.0 * math.pi)
        which = "mode" if not k else "further mode"
        remark = f"the records show no {which} between {low:.3g} and {high:.3g} Hz: it is left out"
        known = {name: value for name, value in self.known.items() if name not in mine}
        return self._remarked(remark, modes=k, known=known), remark

    def doubts(self, estimates: Mapping[str, float], freedom: Freedom) -> Sequence[Doubt]:
        """The parameters of the other parts than the law that the user does not name; at a bound only some of them."""
        named = {*freedom.fixed, *freedom.free, *freedom.bounds, *self.known}
        doubts = []
        for part, (box, _) in self.parts([]).boxes().items():
            for each in box:
                name = f"{part}.{each.name}"
                value = estimates[name]
                at_end = value <= each.lower * (1.0 + _NEAR) or value >= each.upper * (1.0 - _NEAR)
                if name not in named and (not at_end or FREQUENCY in name or value == 0.0):
                    doubts.append(self._doubt(name, value, freedom))
        return [doubt for doubt in doubts if doubt is not None]

    def _doubt(self, name: str, value: float, freedom: Freedom) -> Doubt | None:
        """A reason to doubt one parameter, and the structure without it."""
        if name == "creep.percent":
            return Doubt(name, max(_PERCENT, 0.5 * abs(value)), self._held(name, 0.0, "creep from the law"))
        if name == "creep.slope":
            return Doubt(name, _SLOPE, self._held(name, 0.0, "how the creep changes from decade to decade"))
        if name.startswith("creep.weights"):
            without = self._held(name, 0.0, "this element from the others and the law")
            return Doubt(name, max(_WEIGHT, abs(value)), without)
        if name == "vibration.delay":
            largest = max(_SAMPLES * self.survey.shortest, value)
            return Doubt(name, largest, self._held(name, 0.0, "a delay from a mode", " s"))
        if name == "amplifier.time_constant":
            remark = "the records do not show the time constant of the amplifier: it is left out"
            return Doubt(name, value, self._remarked(remark, amplifier=None))
        if DAMPING in name:
            without = self._held(name, _USUAL_DAMPING, "the damping of a mode")
            return Doubt(name, value + _USUAL_DAMPING, without)
        if GAIN in name and len(self.inputs) > 1:  # an input may well leave a mode at rest
            return None
        less = self.smaller(freedom)
        largest = _SHARE_OF_FREQUENCY * value if FREQUENCY in name else _GAIN
        return None if less is None else Doubt(name, largest, less[0])

    def _held(self, name: str, at: float, why: str, unit: str = "") -> "ActuatorStructure":
        remark = f"the records do not tell {why}: {name} is held at {at:g}{unit}"
        return self._remarked(remark, known={**self.known, name: at})

    def _remarked(self, remark: str, **changes: Any) -> "ActuatorStructure":
        return replace(self, remarks=(*self.remarks, remark), **changes)

    def parts(self, records: Sequence[Record]) -> LinearParts:
        survey = self.survey if self.survey is not None or not records else Survey.of(records)
        bank: Any = self.creep
        if survey is not None:
            bank = linear_parts.creep_bank(bank, survey.shortest, survey.longest)
        gains = not isinstance(self.law, ModalGains)
        return LinearParts(self.amplifier, bank, self.modes, self.delay, survey, self.inputs, gains)

    def _laws(self, parameters: Parameters, record: Record) -> list[tuple[str, Any, Parameters, Record]]:
        if not isinstance(self.law, InputSum):
            return [(MAIN, self.law, parameters, record)]
        return [(name, law, own(parameters, name), seen_by(record, name)) for name, law in self.law.laws.items()]

    def _by_mode(self, law: ModalGains, parts: LinearParts, others: Parameters, record: Record) -> FloatArray:
        """Columns (n_sets, n_samples, n_columns + 1) of the inputs through each mode, one, and zero."""
        law_records = [seen_by(record, name) for name in self.inputs]
        behind: list[tuple[Parameters, partial[Stages]]] = [(others, partial(parts.stages))]
        if self.modes:
            behind = [(parts.of_mode(others, k), partial(parts.one_mode, k=k)) for k in range(self.modes)]
        blocks = [columns_through(law, {}, mine, stages, one) for mine, stages in behind for one in law_records]
        n_sets = max(len(block) for block in blocks)
        blocks = [np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks]
        return np.concatenate([*(block[..., :1] for block in blocks), blocks[0][..., 1:]], axis=-1)

    def _offsets(self, linear: Sequence[str]) -> list[str]:
        names = [_OFFSET] if len(self.inputs) == 1 else [f"{_LAW}.{name}.offset" for name in self.inputs]
        return [name for name in names if name in linear]

    def _delayed(self, k: int, step: float) -> "ActuatorStructure":
        delay = 0.0 if not k else (k - 0.5) * step
        words = "above 0 s" if not k else f"between {(k - 1) * step:g} and {k * step:g} s"
        remark = f"without a mode the held command shows a delay to a sample only: it is held at {delay:g} s"
        remark += f", {words} all are alike" * bool(k)
        return self._remarked(remark, known={**self.known, "vibration.delay": delay})
