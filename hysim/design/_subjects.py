"""Numbers of a law or of an actuator (the problem of `hysim.identify`), and the information of an input on them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._names import among
from hysim.design._inputs import InputLimits, usual
from hysim.identification.likelihood import Expected, density
from hysim.models.law import Law
from hysim.models.parts import own, share_of
from hysim.models.search_space import Freedom
from hysim.plants.actuator_structure import ActuatorStructure
from hysim.plants.linear_parts import BELOW_NYQUIST, DAMPING, FREQUENCY, GAIN
from hysim.plants.stages import Sensor
from hysim.records import Record

Criterion = Literal["D", "A", "E"]
_LEAST = 1e-12  # eigenvalue of an information of columns of length one, below which a direction is not determined
_TAKES_PART = 1e-3  # share of a number in such a direction, from which on it is not determined


def merit(matrix: FloatArray, criterion: Criterion) -> float:
    """Criterion to maximise: D root of the determinant, A harmonic mean of eigenvalues, E the least; 0 if singular."""
    size = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    if not (size > 0.0).all() or np.linalg.eigvalsh(matrix / np.outer(size, size))[0] < _LEAST:
        return 0.0
    if criterion == "D":
        return float(np.exp(np.linalg.slogdet(matrix)[1] / len(matrix)))
    if criterion == "A":
        return float(len(matrix) / np.trace(np.linalg.inv(matrix)))
    return float(np.linalg.eigvalsh(matrix)[0])


def spreads(matrix: FloatArray) -> FloatArray:
    """Standard errors (n_names,) of an information; infinite where it does not determine a number."""
    size = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    usable = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(usable, usable))
    determined = values > _LEAST
    variances = (vectors[:, determined] ** 2 / values[determined]).sum(axis=1)
    undetermined = (np.abs(vectors[:, ~determined]) > _TAKES_PART).any(axis=1) | (size == 0.0)
    return np.asarray(np.where(undetermined, np.inf, np.sqrt(variances) / usable))


_DIFFERENCE = 1e-4  # of a number, or of one where that is smaller: both errors of a central difference are near 1e-8


def sizes_of(values: FloatArray) -> FloatArray:
    return np.where(values == 0.0, 1.0, np.abs(values))


def squared(slopes: FloatArray) -> FloatArray:
    """Information of derivatives (n_samples, n_names) in units of the noise; zeros if they are not finite."""
    return np.asarray(slopes.T @ slopes) if np.isfinite(slopes).all() else np.zeros((slopes.shape[1],) * 2)


@dataclass(frozen=True)
class LawAlone:
    """A law at rest before the first sample: the free numbers, and the standard deviation of its output."""

    law: Law
    names: tuple[str, ...]
    noise: float
    tolerances: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def values(self) -> FloatArray:
        return np.array([self.law.scalars[name] for name in self.names])

    def information(self, u: FloatArray) -> FloatArray:
        """Fisher information on the numbers in units of their sizes, by central differences; zeros if it diverges."""
        names, steps = self.names, _DIFFERENCE * sizes_of(self.values)
        sets: dict[str, Any] = {name: np.full(2 * len(names), self.law.scalars[name]) for name in names}
        for k, name in enumerate(names):
            sets[name][2 * k : 2 * k + 2] += [steps[k], -steps[k]]
        outputs = self.law.outputs(sets, u)
        with np.errstate(invalid="ignore"):
            slopes = (outputs[0::2] - outputs[1::2]) / (2.0 * _DIFFERENCE * self.noise)
        return squared(slopes.T)

    def covariance(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.inv(self.law.response_jacobian(u, self.names).information(self.noise)))

    def only(self, names: Sequence[str]) -> "LawAlone":
        return replace(self, names=tuple(names))


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

    def only(self, names: Sequence[str]) -> "WholeActuator":
        return replace(self, expected=_expected(self.structure, self.record, self.known, names))


Subject = LawAlone | WholeActuator


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
    """All parameters of the actuator; those of the other parts than the law have defaults where no value is given."""
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
    space = structure.law.search_space(structure.scaled_on, share_of(freedom, _LAW))
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
