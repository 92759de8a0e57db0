"""The parts of an actuator other than its law: their coordinates, and the stages that values of these make.

The names of the parameters begin with those of the fields of `hysim.Actuator`:

    amplifier.time_constant                                                         [s]
    creep.percent, creep.slope, or creep.weights[k]                                 see below
    vibration.natural_frequencies[k], damping_ratios[k], gains[k]                   [rad/s], -, -
    vibration.delay                                                                 [s]

The modes stand side by side, and their gains come to one: that of the first mode is what remains. So the law carries
the gain of the whole. Of several inputs each excites the modes by gains of its own, ``vibration.gains[k].u2`` for the
input u2. The creep has few numbers: its growth in a decade, its slope, or free weights.

    per decade      the bank of `hysim.Creep.per_decade`: w_i in proportion to the growth in percent a decade
    N elements      w_i = percent / 100 D (tau_i / t_0)^slope, tau_i log-spaced over the times that the records show,
                    D decades from one to the next, t_0 = 0.1 s or the nearest time to it
    time constants  w_i free, beside an instant gain of one

Of the first two the step response is one at t_0, so that the law keeps the gain.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.models.parameters import Coordinate, space_of
from hysim.models.search_space import Freedom, Parameters, SearchSpace
from hysim.plants.chain import Stages
from hysim.plants.multi_input_actuator import MAIN, MultiInputActuator
from hysim.plants.stages import Amplifier, Creep
from hysim.plants.transfer_function import Modes, TransferFunction
from hysim.records import Record, span_of

_REFERENCE = 0.1  # [s]
_BAND = (1e-3, 1e3)  # [s]
_PERCENT = Coordinate("percent", -10.0, 40.0)
_SLOPE = Coordinate("slope", -1.0, 1.0)
_START = 1.0  # percent a decade
_START_OF_WEIGHTS = 0.01
_BEYOND = 3.0  # times the longest record, from which on an element cannot be told from a drift
_WIDE = 0.8  # of the widest span of inputs: a record with less does not show the law
_FEWEST = 8  # samples
FREQUENCY, DAMPING, GAIN = "natural_frequencies", "damping_ratios", "gains"
BELOW_NYQUIST = 0.98
_PERIODS = 2.0  # of the slowest mode in the fastest record, at least
_DAMPING = (1e-4, 1.5)
_GAIN = (-0.95, 0.95)  # of a mode beside the first one
_GAIN_OF_INPUT = (-100.0, 100.0)  # likewise: one of several inputs may move the output at a resonance only
_LATEST = 50.0  # samples of the fastest record
_TIME_CONSTANT = (0.05, 0.1)  # of its sample time, and of its duration


@dataclass(frozen=True)
class CreepBank:
    """Elements at these time constants; `unit` are their weights for a growth of 1 % a decade, None if each is free.

    Without elements that are searched it is the `known` creep, or none.
    """

    time_constants: tuple[float, ...]
    unit: tuple[float, ...] | None
    reference: float = _REFERENCE
    sloped: bool = False
    idle: tuple[int, ...] = ()  # elements that the records cannot show
    known: Creep | None = None

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        if self.unit is None:
            return tuple(Coordinate(f"weights[{k}]", -1.0, 4.0) for k in range(len(self.time_constants)))
        return (_PERCENT, _SLOPE) if self.sloped else (_PERCENT,)

    @property
    def defaults(self) -> dict[str, float]:
        if self.unit is None:
            idle = {f"weights[{k}]": 0.0 for k in self.idle}
            return {each.name: _START_OF_WEIGHTS for each in self.coordinates} | idle
        return {each.name: value for each, value in zip(self.coordinates, (_START, 0.0), strict=False)}

    def made(self, values: Mapping[str, float]) -> Creep | None:
        if not self.time_constants:
            return self.known
        taus = np.array(self.time_constants)
        if self.unit is None:
            weights = np.array([values[each.name] for each in self.coordinates])
            return Creep(time_constants=self.time_constants, weights=tuple(weights.tolist()))
        weights = values["percent"] * np.array(self.unit) * (taus / self.reference) ** values.get("slope", 0.0)
        at_reference = -np.expm1(-self.reference / taus)
        instant = 1.0 - float(weights @ at_reference)
        return Creep(time_constants=self.time_constants, weights=tuple(weights.tolist()), instant_gain=instant)

    @property
    def remark(self) -> str:
        """A phrase on the elements that the records cannot show; else the empty text."""
        if not self.idle:
            return ""
        times = ", ".join(f"{self.time_constants[k]:g}" for k in self.idle)
        return f"the records are too short or too coarse for creep at {times} s: its weights are held at 0"


def creep_bank(creep: Any, survey: "Survey | None") -> CreepBank:
    """The bank for these records; ValueError where times are not in s, as the bank's are."""
    if survey is None or creep is False or creep is None or isinstance(creep, Creep):
        return CreepBank((), None, known=creep or None)
    shortest, longest = survey.shortest, survey.longest
    if survey.unit != "s" and isinstance(creep, int):
        raise ValueError(
            f'creep is searched on times in s, and these are in {survey.unit}: take record.convert({{"t": "s"}})'
        )
    if creep is True:
        bank = Creep.per_decade(1.0, band=(_BAND[0], max(_BAND[1], longest)))
        return CreepBank(bank.time_constants, bank.weights)
    if isinstance(creep, int):
        taus = np.geomspace(shortest, longest, creep + 2)[1:-1]
        decades = math.log10(longest / shortest) / (creep + 1)
        reference = float(np.clip(_REFERENCE, taus[0], taus[-1]))
        return CreepBank(tuple(taus.tolist()), (0.01 * decades,) * creep, reference, sloped=creep > 1)
    slow = [k for k, tau in enumerate(creep) if tau > _BEYOND * longest or tau < shortest / _BEYOND]
    return CreepBank(tuple(creep), None, idle=tuple(slow))


def checked_creep(creep: Any) -> Any:
    """The argument `creep` of a structure; TypeError or ValueError if it is not valid."""
    if creep is None or isinstance(creep, bool | Creep):
        return creep
    if isinstance(creep, int):
        if creep < 1:
            raise ValueError(f"creep must be at least one element, got {creep}; False leaves it out")
        return creep
    times: FloatArray = read_only(creep, "creep", ndim=1)
    if not times.size or times.min() <= 0.0 or (np.diff(times) <= 0.0).any():
        raise ValueError(f"creep must hold time constants [s] that are positive and increase, got {times.tolist()}")
    return tuple(times.tolist())


@dataclass(frozen=True)
class Survey:
    """Rates of several records, times in the unit of theirs, in seconds without one.

    `law` is the record on which the law is searched: the slowest among those of a wide input. `fastest` is that of the
    shortest sample time, among equal ones that of the fastest input. `duration` is its duration.
    """

    law: int
    fastest: int
    shortest: float
    longest: float
    duration: float
    unit: str = "s"

    @property
    def rate_unit(self) -> str:
        """The unit of cycles over time."""
        return "Hz" if self.unit == "s" else f"cycles/{self.unit}"

    @property
    def nyquist(self) -> float:
        """Half the highest sampling rate [rad/s]."""
        return float(np.pi / self.shortest)

    @classmethod
    def of(cls, records: Sequence[Record]) -> "Survey":
        """Raises ValueError for a record without time, with uneven steps, or too short, and where no input moves."""
        steps = [_even_step(record, k, len(records)) for k, record in enumerate(records)]
        durations = [step * len(record) for step, record in zip(steps, records, strict=True)]
        spans = [float(np.ptp(record.u)) for record in records]
        widest = span_of(*records)
        speeds = [float(np.abs(np.diff(r.u)).sum()) / d for r, d in zip(records, durations, strict=True)]
        wide = [k for k, span in enumerate(spans) if span >= _WIDE * widest]
        fastest = min(range(len(records)), key=lambda k: (steps[k], -speeds[k]))
        return cls(
            law=min(wide, key=lambda k: speeds[k]),
            fastest=fastest,
            shortest=min(steps),
            longest=max(durations),
            duration=durations[fastest],
            unit=records[0].units.get("t") or "s",
        )


def _even_step(record: Record, k: int, n: int) -> float:
    owner = f"record {k}{f' ({record.name})' if record.name else ''}" if n > 1 else "the record"
    if record.t is None:
        raise ValueError(f"{owner} has no time, which an actuator needs: Record(t=..., u=..., y=...)")
    if len(record) < _FEWEST:
        raise ValueError(f"{owner} has {len(record)} samples: an actuator needs at least {_FEWEST}")
    try:
        return record.sample_time
    except ValueError as error:
        raise ValueError(f"{owner} is not sampled evenly: use Record.resample ({error})") from None


@dataclass(frozen=True)
class LinearParts:
    """The parts that are searched, and those that are known."""

    amplifier: Any  # an Amplifier that is known, "first-order", or None
    creep: CreepBank
    modes: int
    delay: bool
    survey: Survey
    inputs: tuple[str, ...] = (MAIN,)
    gains: bool = True  # whether gains of modes are coordinates

    def space(self, name: str, freedom: Freedom) -> SearchSpace:
        """The space of the part of this name."""
        box, defaults = self.boxes()[name]
        held = freedom.held(defaults)
        return space_of(box, (), defaults, held, freedom.limits(defaults, held))

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        return {f"{part}.{each.name}": each for part, (box, _) in self.boxes().items() for each in box}

    def boxes(self) -> dict[str, tuple[tuple[Coordinate, ...], dict[str, float]]]:
        survey = self.survey
        boxes: dict[str, tuple[tuple[Coordinate, ...], dict[str, float]]] = {}
        if self.amplifier == "first-order":
            low, high = _TIME_CONSTANT[0] * survey.shortest, _TIME_CONSTANT[1] * survey.duration
            box = Coordinate("time_constant", low, max(high, 2.0 * low), log=True)
            boxes["amplifier"] = (box,), {"time_constant": min(survey.shortest, box.upper)}
        if self.creep.coordinates:
            boxes["creep"] = self.creep.coordinates, self.creep.defaults
        if self.modes or self.delay:
            boxes["vibration"] = self._vibration()
        return boxes

    def stages(self, values: Mapping[str, float], late: float = 0.0, name: str = MAIN) -> Stages:
        """The stages after the input of this name, at these values of all parameters, `late` by so much more [s]."""
        amplifier = self.amplifier
        if amplifier == "first-order":
            amplifier = Amplifier(time_constant=values["amplifier.time_constant"])
        creep = self.creep.made({name[6:]: value for name, value in values.items() if name.startswith("creep.")})
        delay = late + (values["vibration.delay"] if self.delay else 0.0)
        if not self.modes:
            through = TransferFunction(num=(1.0,), den=(1.0,), delay=delay) if self.delay or delay else None
            return Stages(amplifier, creep=creep, vibration=through)
        others = [values[f"vibration.{self.gain_of(k, name)}"] for k in range(1, self.modes)]
        vibration = self._modes(values, range(self.modes), (1.0 - sum(others), *others), delay)
        return Stages(amplifier, creep=creep, vibration=vibration)

    def one_mode(self, values: Mapping[str, float], k: int) -> Stages:
        vibration = self._modes(values, [k], (1.0,), values["vibration.delay"] if self.delay else 0.0)
        return replace(self, modes=0).stages(values)._replace(vibration=vibration)

    def of_input(self, values: Parameters, name: str) -> Parameters:
        others = {self.gain_of(k, other) for k in range(self.modes) for other in self.inputs if other != name}
        return {each: value for each, value in values.items() if each.removeprefix("vibration.") not in others}

    def of_mode(self, values: Parameters, k: int) -> Parameters:
        others = {f"vibration.{each}[{j}]" for each in (FREQUENCY, DAMPING) for j in range(self.modes) if j != k}
        return {each: value for each, value in values.items() if each not in others}

    def gain_of(self, k: int, name: str) -> str:
        return f"{GAIN}[{k}]" if len(self.inputs) == 1 else f"{GAIN}[{k}].{name}"

    def coordinates_of(self, vibrations: Mapping[str, Any]) -> dict[str, float]:
        """Coordinates by name if the vibration after each input is this one; those of other parts are left out."""
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
                survey = self.survey
                asked, most = (f"{w / (2.0 * math.pi):.4g} {survey.rate_unit}" for w in (wanted[0], survey.nyquist))
                raise ValueError(
                    f"{name} = {wanted[0]:g} rad/{survey.unit} ({asked}) is beyond half the highest sampling rate, "
                    f"{most}: samples look the same as for a mode below it"
                )
        if min((freedom.fixed.get("vibration.delay", 0.0), *freedom.bounds.get("vibration.delay", (0.0,)))) < 0.0:
            raise ValueError("vibration.delay must not be negative")


def vibrations_of(start: Any, inputs: Sequence[str], modes: int) -> dict[str, Modes]:
    """The modes after each input of an actuator; ValueError if it has other inputs, or not so many modes."""
    several = isinstance(start, MultiInputActuator)
    actuators = dict(zip(start.inputs, start.actuators, strict=True)) if several else {MAIN: start}
    if tuple(actuators) != tuple(inputs):
        raise ValueError(f"start has the inputs {', '.join(actuators)}; hysteresis those of {', '.join(inputs)}")
    vibrations = {name: each.vibration for name, each in actuators.items()}
    for name, each in vibrations.items():
        if not isinstance(each, Modes) or len(each.gains) != modes:
            n = len(each.gains) if isinstance(each, Modes) else 0
            raise ValueError(f"start has {n} modes after {name}, and modes={modes}: give modes={n}")
    return vibrations
