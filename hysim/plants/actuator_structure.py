"""An actuator to be identified: amplifier, law, creep, modes and delay at once.

    u -> amplifier -> law -> creep -> modes, delay -> y

Of several inputs each has a law, and the outputs of all are added: creep, frequencies, dampings and delay are common,
and each input excites the modes by gains of its own (`hysim.plants.multi_input_actuator`).

What is behind the law is linear: the output is affine in what the law is affine in, and only the law's other parameters
and those of the parts are searched. The search begins part by part (`hysim.identification._starts`): the law where
the input is slow, the modes and the delay on the fastest record, beside a creep of 1 % a decade, and then all at once.

A parameter is undetermined if its standard error is above its use: 1 % a decade of creep (or half of it), a quarter of
a frequency, two samples of a delay (or all of it). It is held where its part has no effect; a mode is left out.

The columns in which the output is affine are those of the law, through everything behind it. The law sees the voltage,
at the ends of sub-steps where an amplifier takes time. What is behind it is linear and begins at rest, so that each
column passes through it by itself, exactly as an `Actuator` passes it (`hysim.plants.chain`). Of many sets of
parameters those that share the law's, or those of the other parts, share the work on them.

The search for a mode and a delay begins with points spread over their box on the fastest record. A light mode is found
from afar by a broad one: at a first pass of wide dampings a grid of frequencies is dense enough, at a second one, about
the best of it, light dampings are tried. All other coordinates have the values that are known.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import lru_cache, partial
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked
from hysim._basics.parallel import in_chunks
from hysim.kernels import actuator_columns as kernels
from hysim.models.joint_space import columns_beside, declared, together
from hysim.models.parts import own
from hysim.models.protocols import Doubt, Identifiable, Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants import linear_parts
from hysim.plants import multi_input_actuator as several
from hysim.plants.chain import Chain, Stages
from hysim.plants.linear_parts import DAMPING, FREQUENCY, GAIN, LinearParts, Survey
from hysim.plants.multi_input_actuator import MAIN, InputSum, ModalGains, MultiInputActuator, seen_by
from hysim.plants.stages import Amplifier, Creep, Sensor
from hysim.records import Record

Rows = npt.NDArray[np.intp]
_SETS_PER_THREAD = 2
MOST_LATE = 13  # samples of delay that are tried where no descent finds it
_PER_DECADE = 55  # frequencies: a step is half the width of the narrower mode that is tried
_BROAD = (0.03, 0.2)  # damping ratios
_LIGHT = (0.003, 0.012, 0.04)
_NEAR, _N_NEAR = 0.04, 11  # share of a frequency about which finer ones are tried, and how many
_SHARES = (-0.3, -0.05, 0.05, 0.3)  # gains of a further mode
_DELAYS = (0.0, 1.5, 3.0, 6.0, 10.0)  # samples
_NEAR_DELAYS = (-0.8, 0.0, 0.8)  # likewise, beside those of the best points
_MIDDLES = (-1.5, -0.5, 0.5, 1.5, 2.5)  # samples from a whole delay
_DELAY = "vibration.delay"
_TIME_CONSTANT = "amplifier.time_constant"
_SLOWER = (10.0, 50.0, 250.0)  # times the shortest time constant
_MOST_BEGUN = 2  # sets of known coordinates beside which points are spread


def columns_through(
    law: Any, shape: Parameters, parts: Parameters, stages: Callable[[Mapping[str, float]], Stages], record: Record
) -> FloatArray:
    """Columns (n_sets, n_samples, n_columns + 1) for the law's parameters and those of the other parts."""
    step = record.sample_time
    n_sets = max((np.size(value) for value in (*shape.values(), *parts.values())), default=1)
    own, of_law = _distinct(shape, n_sets)
    values, of_parts = _distinct(parts, n_sets)
    chains = [_chain(stages(each), step) for each in values]
    drives = [_voltage(chain, record.u) for chain in chains]
    first = [next(j for j, other in enumerate(drives) if np.array_equal(drive, other)) for drive in drives]
    pairs, which = np.unique(np.stack([of_parts, of_law], axis=1), axis=0, return_inverse=True)
    blocks: dict[tuple[int, int], FloatArray] = {}
    for drive in sorted({first[part] for part in of_parts}):
        mine = sorted({k for part, k in pairs.tolist() if first[part] == drive})
        chosen = {name: np.array([own[k][name] for k in mine]) for name in shape}
        columns = law.regressors(chosen, Record(u=drives[drive], y=drives[drive], t=_times(drives[drive], record)))
        columns = np.broadcast_to(columns, (len(mine), *columns.shape[1:]))
        blocks |= {(drive, k): np.ascontiguousarray(block.T) for k, block in zip(mine, columns, strict=True)}
    n_columns = len(next(iter(blocks.values())))
    out = np.empty((len(pairs), n_columns, len(record)))

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            part, own_law = pairs[k].tolist()
            _pass(chains[part], blocks[first[part], own_law], out[k])

    in_chunks(work, len(pairs), minimum=_SETS_PER_THREAD, n_samples=len(record))
    return np.asarray(out[np.ravel(which)].transpose(0, 2, 1))


def _pass(chain: Chain, w: FloatArray, out: FloatArray) -> None:
    """Columns `w` (n_columns, n_fine) through the stage after the law; constant ones have its gain at rest."""
    stage, row = chain.stage, chain.output_row
    gain = float(row[0] + row[1] + row[2] + row[3:] @ stage.rest)
    still = (w == w[:, :1]).all(axis=1)
    out[still] = gain * w[still, :1]
    if not still.all():
        moving = np.empty((int(np.count_nonzero(~still)), out.shape[1]))
        kernels.through(stage.decline, stage.A, stage.B, row, stage.rest, stage.lag, chain.substeps, w[~still], moving)
        out[~still] = moving


def _distinct(parameters: Parameters, n_sets: int) -> tuple[list[dict[str, float]], Rows]:
    names = list(parameters)
    if not names:
        return [{}], np.zeros(n_sets, dtype=np.intp)
    table = np.stack([np.broadcast_to(np.ravel(parameters[name]), n_sets) for name in names], axis=1)
    rows, which = np.unique(table, axis=0, return_inverse=True)
    return [dict(zip(names, row, strict=True)) for row in rows.tolist()], np.ravel(which)


@lru_cache(maxsize=1024)  # a search comes back to the best of some hundred points
def _chain(stages: Stages, step: float) -> Chain:
    """The stages at a sample time; where inputs are compared, they are the same for all of them."""
    return Chain(stages, step)


def _voltage(chain: Chain, u: FloatArray) -> FloatArray:
    amplifier: Amplifier = chain.amplifier
    if not amplifier.dynamic:
        return amplifier.voltage(u)
    return chain.driven(u, chain.rest(float(u[0])))[0].v


def _times(drive: FloatArray, record: Record) -> FloatArray:
    return record.sample_time * len(record) / drive.size * np.arange(float(drive.size))


def as_points(space: SearchSpace, known: Sequence[Mapping[str, float]]) -> FloatArray:
    """Coordinates (n, n_x) by name, the missing ones as of each start of the space; without any these starts."""
    rows = [
        [each.get(name, value) for name, value in zip(space.coordinates, start, strict=True)]
        for each in known or ({},)
        for start in space.starts.tolist()
    ]
    return np.unique(rows, axis=0) if len(rows) > 1 else np.array(rows).reshape(len(rows), -1)


def _spread(space: SearchSpace, axes: Mapping[str, Any], base: FloatArray) -> FloatArray:
    """Every combination of values of the axes that the space has, with each of the base points."""
    own = {name: values for name, values in axes.items() if name in space.coordinates}
    if not own:
        return base
    places = [space.coordinates.index(name) for name in own]
    grid = np.array(list(itertools.product(*own.values()))).reshape(-1, len(places))
    spread = np.repeat(base, len(grid), axis=0)
    spread[:, places] = np.tile(grid, (len(base), 1))
    return np.clip(spread, space.lower, space.upper)


MOST_MODES = 3
MOST_MODES_OF_SEVERAL = 20  # inputs: their gains are solved for, one mode after the other
_LAW, _OFFSET = "hysteresis", "hysteresis.offset"
_PERCENT, _WEIGHT, _SLOPE = 1.0, 0.05, 0.7
_SHARE_OF_FREQUENCY = 0.25
_GAIN = 0.5
_USUAL_DAMPING = 0.02
_SAMPLES = 2.0  # of delay
_AT_BOUND = 1e-6  # relative distance of a bound


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
    offsets: Literal["shared", "own"]
    survey: Any = None
    scaled_on: Any = None  # the record that scales the law's box
    known: Mapping[str, float] = field(default_factory=dict)  # parameters that are held beside those of the user
    remarks: tuple[str, ...] = ()
    starting: Any = ()  # coordinates by name
    start: Any = None  # an actuator from whose vibration the search begins
    inputs: tuple[str, ...] = (MAIN,)

    may_depend: ClassVar[bool] = False
    is_parted: ClassVar[bool] = True

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
        own_spaces = {name: partial(parts.space, name) for name in parts.boxes()}
        space = together(declared({_LAW: partial(self.law.search_space, scaling), **own_spaces}, wished))
        offsets = [_OFFSET] if len(self.inputs) == 1 else [f"{_LAW}.{name}.offset" for name in self.inputs]
        offsets = [name for name in offsets if self.offsets == "own" and name in space.linear]
        points = np.clip(as_points(space, self.starting), space.lower, space.upper)
        return replace(space, starts=points, screened=0, regions={}, state=(*space.state, *offsets))

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
            records = [replace(each, resolution=quantum) if each.resolution is None else each for each in records]
        bank = linear_parts.creep_bank(self.creep, survey)
        names = [f"creep.weights[{k}]" for k in bank.idle]
        idle = {name: 0.0 for name in names if name not in {*freedom.free, *freedom.bounds}}
        remarks = (bank.remark,) if idle else ()
        scaled_on = self.static(records[survey.law])
        structure = replace(self, survey=survey, scaled_on=scaled_on, known=idle, remarks=remarks)
        structure.parts([]).check(freedom)
        return structure, records

    @property
    def noise(self) -> str:
        """The noise that its sensor makes, as `identify` names it."""
        return "quantised" if self.sensor is not None and self.sensor.quantum else "gaussian"

    def static(self, record: Record) -> Record:
        """The record with the voltages that a known amplifier makes of its commands."""
        if not isinstance(self.amplifier, Amplifier):
            return record
        others = {name: self.amplifier.voltage(seen_by(record, name).u) for name in self.inputs if name != MAIN}
        return replace(record, u=self.amplifier.voltage(record.u), channels={**record.channels, **others})

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
        return frozenset(self.parts([]).coordinates)

    def growing(self) -> Sequence["ActuatorStructure"]:
        """The structure without modes, with the first one, and so on; a creep that is searched is left out."""
        creep = self.creep if isinstance(self.creep, Creep) else False
        known = {name: value for name, value in self.known.items() if not name.startswith("creep.")}
        return [replace(self, modes=k, creep=creep, known=known) for k in range(self.modes + 1)]

    def points(self, space: SearchSpace, known: Sequence[Mapping[str, float]]) -> FloatArray:
        """Points of a space of this plant, spread over its last mode and its delay, with `known` coordinates."""
        frequency, damping, gain = self._last_mode
        axes: dict[str, Any] = {}
        if frequency in space.coordinates:
            low, high = (side[space.coordinates.index(frequency)] for side in (space.lower, space.upper))
            count = 1 + int(np.ceil((high - low) / np.log(10.0) * _PER_DECADE))
            axes[frequency] = np.linspace(low, high, count)
        axes |= {damping: np.log(_BROAD), gain: _SHARES} if self.modes else {}
        axes |= {_DELAY: _DELAYS} if self.modes < 2 else {}
        if self.modes < 2 and _TIME_CONSTANT in space.coordinates:
            axes[_TIME_CONSTANT] = space.lower[space.coordinates.index(_TIME_CONSTANT)] + np.log(_SLOWER)
        return _spread(space, axes, as_points(space, known)[:_MOST_BEGUN])

    def finer(self, space: SearchSpace, best: FloatArray) -> FloatArray:
        """Points (n, n_x) of lighter dampings about the frequencies and delays of the `best` ones, and these."""
        frequency, damping, _ = self._last_mode
        if not {frequency, damping} & {*space.coordinates}:
            return best
        about = []
        for point in best:
            axes: dict[str, Any] = {damping: np.log(_LIGHT)}
            if frequency in space.coordinates:
                centre = point[space.coordinates.index(frequency)]
                axes[frequency] = centre + np.linspace(-_NEAR, _NEAR, _N_NEAR)
            if _DELAY in space.coordinates:
                axes[_DELAY] = point[space.coordinates.index(_DELAY)] + np.array(_NEAR_DELAYS)
            about.append(_spread(space, axes, point[np.newaxis]))
        return np.concatenate([best, *about])

    def beyond(self, space: SearchSpace, end: FloatArray) -> FloatArray:
        """The end (1, n_x) of a descent, and points between whole samples of delay, where slopes jump."""
        if _DELAY not in space.coordinates:
            return end
        nearest = np.round(end[0, space.coordinates.index(_DELAY)])
        return np.unique(np.concatenate([end, _spread(space, {_DELAY: nearest + np.array(_MIDDLES)}, end)]), axis=0)

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
        box = self.parts([]).coordinates[f"vibration.{FREQUENCY}[{k}]"]
        low, high = box.lower / (2.0 * math.pi), box.upper / (2.0 * math.pi)
        which = "mode" if not k else "further mode"
        unit = self.survey.rate_unit
        remark = f"the records show no {which} between {low:.3g} and {high:.3g} {unit}: it is left out"
        known = {name: value for name, value in self.known.items() if name not in mine}
        return self._remarked(remark, modes=k, known=known), remark

    def doubts(self, estimates: Mapping[str, float], freedom: Freedom) -> Sequence[Doubt]:
        """The parameters of the other parts than the law that the user does not name; at a bound only some of them."""
        named = {*freedom.fixed, *freedom.free, *freedom.bounds, *self.known}
        doubts = []
        for name, each in self.parts([]).coordinates.items():
            value = estimates[name]
            at_end = value <= each.lower * (1.0 + _AT_BOUND) or value >= each.upper * (1.0 - _AT_BOUND)
            if name not in named and (not at_end or FREQUENCY in name or value == 0.0):
                doubts.append(self._doubt(name, value, freedom))
        return [doubt for doubt in doubts if doubt is not None]

    def _doubt(self, name: str, value: float, freedom: Freedom) -> Doubt | None:
        """A reason to doubt one parameter, and the structure without it."""
        held = {  # largest standard error, the value at which it is held, and what the records do not tell then
            "percent": (max(_PERCENT, 0.5 * abs(value)), 0.0, "creep from the law"),
            "slope": (_SLOPE, 0.0, "how the creep changes from decade to decade"),
            "weights": (max(_WEIGHT, abs(value)), 0.0, "this element from the others and the law"),
            "delay": (max(_SAMPLES * self.survey.shortest, value), 0.0, "a delay from a mode"),
            DAMPING: (value + _USUAL_DAMPING, _USUAL_DAMPING, "the damping of a mode"),
        }
        kind = name.partition(".")[2].partition("[")[0]
        if kind in held:
            largest, at, why = held[kind]
            unit = f" {self.survey.unit}" * (kind == "delay")
            remark = f"the records do not tell {why}: {name} is held at {at:g}{unit}"
            return Doubt(name, largest, self._remarked(remark, known={**self.known, name: at}))
        if kind == "time_constant":
            remark = "the records do not show the time constant of the amplifier: it is left out"
            return Doubt(name, value, self._remarked(remark, amplifier=None))
        if GAIN in name and len(self.inputs) > 1:  # an input may well leave a mode at rest
            return None
        less = self.smaller(freedom)
        largest = _SHARE_OF_FREQUENCY * value if FREQUENCY in name else _GAIN
        return None if less is None else Doubt(name, largest, less[0])

    def _remarked(self, remark: str, **changes: Any) -> "ActuatorStructure":
        return replace(self, remarks=(*self.remarks, remark), **changes)

    def parts(self, records: Sequence[Record]) -> LinearParts:
        survey = self.survey if self.survey is not None or not records else Survey.of(records)
        bank, gains = linear_parts.creep_bank(self.creep, survey), not isinstance(self.law, ModalGains)
        return LinearParts(self.amplifier, bank, self.modes, self.delay, survey, self.inputs, gains)

    @property
    def _last_mode(self) -> tuple[str, str, str]:
        """Names of its frequency, its damping ratio and its gain."""
        frequency, damping, gain = (f"vibration.{name}[{self.modes - 1}]" for name in (FREQUENCY, DAMPING, GAIN))
        return frequency, damping, gain

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

    def _delayed(self, k: int, step: float) -> "ActuatorStructure":
        delay = 0.0 if not k else (k - 0.5) * step
        words = "above 0 s" if not k else f"between {(k - 1) * step:g} and {k * step:g} s"
        remark = f"without a mode the held command shows a delay to a sample only: it is held at {delay:g} s"
        remark += f", {words} all are alike" * bool(k)
        return self._remarked(remark, known={**self.known, "vibration.delay": delay})
