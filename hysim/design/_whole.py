"""A whole actuator at known parameters as the subject of a design: its problem is that of `hysim.identify`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hysim._frozen import FloatArray
from hysim._names import among
from hysim.design._candidates import usual
from hysim.design._limits import InputLimits
from hysim.design._subjects import sizes_of, squared
from hysim.identification.likelihood import Expected, density
from hysim.models.law import Law
from hysim.models.parts import own
from hysim.models.search_space import Freedom
from hysim.plants.actuator_structure import ActuatorStructure
from hysim.plants.linear_parts import BELOW_NYQUIST, DAMPING, FREQUENCY, GAIN
from hysim.plants.sensor import Sensor
from hysim.records import Record

_LAW = "hysteresis"
_LARGEST = 1e300  # standard error


@dataclass(frozen=True)
class WholeActuator:
    """An actuator at rest before the first sample; `expected` is its problem, `known` are all its parameters."""

    structure: ActuatorStructure
    record: Record
    known: Mapping[str, float]
    expected: Expected
    noise: float
    remarks: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return self.expected.names

    @property
    def values(self) -> FloatArray:
        return np.array([self.known[name] for name in self.names])

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Those of `identify`, beyond which a parameter counts as not determined; for others any that is finite."""
        return dict.fromkeys(self.names, _LARGEST) | {
            doubt.name: doubt.largest for doubt in self.structure.doubts(self.known, Freedom())
        }

    def information(self, u: FloatArray) -> FloatArray:
        slopes = self.expected.jacobian(replace(self.record, u=u))
        return squared(slopes * sizes_of(self.values) / self.noise)

    def covariance(self, u: FloatArray) -> FloatArray:
        slopes = self.expected.jacobian(replace(self.record, u=u), refined=True) / self.noise
        lengths = np.linalg.norm(slopes, axis=0)
        scaled = slopes / lengths
        return np.asarray(np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths))

    def without(self, name: str) -> "WholeActuator":
        others = [each for each in self.names if each != name]
        return replace(self, expected=_expected(self.structure, self.record, self.known, others))


def whole_actuator(
    structure: ActuatorStructure,
    limits: InputLimits,
    values: Mapping[str, float],
    free: Sequence[str] | None,
    noise: float | None,
) -> WholeActuator:
    """The subject for inputs within the limits; ValueError or TypeError if a value is missing or does not fit."""
    law = structure.law
    if not isinstance(law, Law):
        raise TypeError(
            f"hysteresis must be a law with its numbers, such as hs.BoucWen(...), got {type(law).__name__}: pass the "
            "law of an identified model"
        )
    shared = {_of_all(name): value for name, value in values.items()}
    law = law.with_scalars({name: value for name, value in own(shared, _LAW).items() if name in law.scalars})
    all_modes = {f"vibration.{name}[{k}]" for name in (FREQUENCY, DAMPING, GAIN) for k in range(structure.modes)}
    structure, remarks = _without_fast_modes(replace(structure, law=law), limits, shared)
    u = usual(limits)["triangle"][0]
    record = Record(u=u, y=law.response(structure.static(Record(u=u, y=u)).u), t=limits.t)
    structure, _ = structure.over([record], Freedom())
    known = _known(structure, shared)
    left_out = all_modes - known.keys()
    if unknown := [name for name in shared if name not in known and name not in left_out]:
        raise ValueError(f"values has {unknown[0]!r}; the parameters are {among(unknown[0], known)}")
    names = None if free is None else [name for name in dict.fromkeys(map(_of_all, free)) if name not in left_out]
    expected = _expected(structure, record, known, names)
    return WholeActuator(structure, record, known, expected, _noise(structure.sensor, noise), remarks)


def _of_all(name: str) -> str:
    """The name of an initial memory without the number of its record."""
    return f"{_LAW}.z0" if name.startswith(f"{_LAW}.z0[") else name


def _without_fast_modes(
    structure: ActuatorStructure, limits: InputLimits, values: Mapping[str, float]
) -> tuple[ActuatorStructure, tuple[str, ...]]:
    """The structure without the modes beyond half the sampling rate, and remarks on them."""
    names = [f"vibration.{FREQUENCY}[{k}]" for k in range(structure.modes)]
    if missing := [name for name in names if name not in values]:
        raise ValueError(f"values must give {missing[0]} [rad/s]: what an input tells of a mode depends on it")
    highest, remarks = BELOW_NYQUIST * math.pi / limits.sample_time, []
    while names and values[names[-1]] >= highest:
        remarks.append(
            f"{names[-1]} = {values[names[-1]]:g} rad/s is beyond the frequencies that this sample time shows, up to "
            f"{highest:.4g} rad/s: no input shows this mode, and it is left out"
        )
        structure = replace(structure, modes=structure.modes - 1)
        names.pop()
    return structure, tuple(remarks)


def _known(structure: ActuatorStructure, values: Mapping[str, float]) -> dict[str, float]:
    """All parameters of the actuator, those of the parts beside the law by default where there is no value."""
    known = {f"{_LAW}.{name}": float(value) for name, value in structure.law.scalars.items()}
    for part, (_, defaults) in structure.parts([]).boxes().items():
        own_values = {f"{part}.{name}": value for name, value in defaults.items()}
        known |= {name: float(values.get(name, value)) for name, value in own_values.items()} | dict(structure.known)
    return known


def _expected(
    structure: ActuatorStructure, record: Record, known: Mapping[str, float], free: Sequence[str] | None
) -> Expected:
    """The problem with these free parameters, or with those that `identify` frees by default."""
    freedom = Freedom()
    if free is not None:
        space = structure.search_space(record)
        every = (*space.names, *space.held)
        if unknown := [name for name in free if name not in every]:
            raise ValueError(f"free has {unknown[0]!r}; the parameters are {among(unknown[0], every)}")
        freedom = Freedom(fixed={name: known[name] for name in every if name not in free}, free=tuple(free))
    share = Freedom(fixed=own(freedom.fixed, _LAW), free=tuple(own(dict.fromkeys(freedom.free), _LAW)))
    space = structure.law.search_space(structure.scaled_on, share)
    coordinates = dict(zip((f"{_LAW}.{name}" for name in space.coordinates), space.starts[0].tolist(), strict=True))
    for part, (box, _) in structure.parts([]).boxes().items():
        coordinates |= {f"{part}.{each.name}": float(each.encode(known[f"{part}.{each.name}"])) for each in box}
    return Expected.at(structure, record, freedom, coordinates, known)


def _noise(sensor: Sensor | None, noise: float | None) -> float:
    """The noise that is given, or else that of the sensor with its rounding, or one."""
    if noise is not None:
        return noise
    if sensor is None or not (sensor.noise or sensor.quantum):
        return 1.0
    if not sensor.quantum:
        return sensor.noise
    return float(density("quantised", sensor.quantum).spread(np.array(sensor.noise)))
