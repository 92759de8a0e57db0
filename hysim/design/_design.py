"""The verb `design_input`, and the information of an input on numbers of a law or of an actuator (`identify`)."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, as_mapping, check_choice, check_positive, check_whole, read_only
from hysim._basics.names import check_parameters
from hysim._basics.printing import frozen_result, summary_text
from hysim._basics.results import model_of
from hysim.design import _inputs as shapes
from hysim.design._inputs import InputLimits
from hysim.identification.likelihood import Expected, density
from hysim.models.jacobian import checked_names, exchanged_outputs, sizes_along
from hysim.models.law import Law
from hysim.models.parts import own, share_of
from hysim.models.search_space import Freedom
from hysim.plants.actuator_structure import ActuatorStructure
from hysim.plants.linear_parts import BELOW_NYQUIST, DAMPING, FREQUENCY, GAIN
from hysim.plants.stages import Sensor
from hysim.records import Record

Criterion = Literal["D", "A", "E"]
Values = Mapping[str, float]
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


_DIFFERENCE = 1e-4  # of the size of a number: both errors of a central difference are near 1e-8


def squared(slopes: FloatArray) -> FloatArray:
    """Information of derivatives (n_samples, n_names) in units of the noise; zeros if they are not finite."""
    return np.asarray(slopes.T @ slopes) if np.isfinite(slopes).all() else np.zeros((slopes.shape[1],) * 2)


@dataclass(frozen=True)
class LawAlone:
    """A law at rest before the first sample: the free numbers, their sizes, and the noise of its output."""

    law: Law
    names: tuple[str, ...]
    noise: float
    sizes: FloatArray
    remarks: tuple[str, ...] = ()

    @property
    def values(self) -> FloatArray:
        return np.array([self.law.scalars[name] for name in self.names])

    def information(self, u: FloatArray) -> FloatArray:
        """Fisher information on the numbers in units of their sizes, by central differences; zeros if it diverges."""
        steps = np.diag(_DIFFERENCE * self.sizes)
        sets = self.values[:, np.newaxis] + np.stack([steps, -steps], axis=2).reshape(len(steps), -1)
        outputs = exchanged_outputs(self.law, dict(zip(self.names, sets, strict=True)), u)
        with np.errstate(invalid="ignore"):
            slopes = (outputs[0::2] - outputs[1::2]) / (2.0 * _DIFFERENCE * self.noise)
        return squared(slopes.T)

    def covariance(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.inv(self.law.response_jacobian(u, self.names).information(self.noise)))


_LAW = "hysteresis"
_LARGEST = 1e300  # standard error


@dataclass(frozen=True)
class WholeActuator:
    """An actuator at rest before the first sample; `expected` is its problem, `known` are all its parameters."""

    structure: ActuatorStructure
    record: Record
    known: Values
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
    def sizes(self) -> FloatArray:
        return np.where(self.values == 0.0, 1.0, np.abs(self.values))

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Those of `identify`, beyond which a parameter counts as not determined; for others any that is finite."""
        return dict.fromkeys(self.names, _LARGEST) | {
            doubt.name: doubt.largest for doubt in self.structure.doubts(self.known, Freedom())
        }

    def information(self, u: FloatArray) -> FloatArray:
        slopes = self.expected.jacobian(replace(self.record, u=u))
        return squared(slopes * self.sizes / self.noise)

    def covariance(self, u: FloatArray) -> FloatArray:
        slopes = self.expected.jacobian(replace(self.record, u=u), refined=True) / self.noise
        lengths = np.linalg.norm(slopes, axis=0)
        scaled = slopes / lengths
        return np.asarray(np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths))

    def only(self, names: Sequence[str], remarks: Sequence[str]) -> "WholeActuator":
        expected = _expected(self.structure, self.record, self.known, names)
        return replace(self, expected=expected, remarks=(*self.remarks, *remarks))


Subject = LawAlone | WholeActuator


def whole_actuator(
    structure: ActuatorStructure, limits: InputLimits, values: Values, free: Sequence[str] | None, noise: float | None
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
    u = shapes.usual(limits)["triangle"][0]
    record = Record(u=u, y=law.response(structure.static(Record(u=u, y=u)).u), t=limits.t)
    structure, _ = structure.over([record], Freedom())
    known = _known(structure, shared)
    left_out = all_modes - known.keys()
    check_parameters(known, values=[name for name in shared if name not in left_out])
    names = None if free is None else [name for name in dict.fromkeys(map(_of_all, free)) if name not in left_out]
    expected = _expected(structure, record, known, names)
    return WholeActuator(structure, record, known, expected, _noise(structure.sensor, noise), remarks)


def _of_all(name: str) -> str:
    """The name of an initial memory without the number of its record."""
    return f"{_LAW}.z0" if name.startswith(f"{_LAW}.z0[") else name


def _without_fast_modes(
    structure: ActuatorStructure, limits: InputLimits, values: Values
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


def _known(structure: ActuatorStructure, values: Values) -> dict[str, float]:
    """All parameters of the actuator; those of the other parts than the law have defaults where no value is given."""
    known = {f"{_LAW}.{name}": float(value) for name, value in structure.law.scalars.items()}
    for part, (_, defaults) in structure.parts([]).boxes().items():
        own_values = {f"{part}.{name}": value for name, value in defaults.items()}
        known |= {name: float(values.get(name, value)) for name, value in own_values.items()} | dict(structure.known)
    return known


def _expected(structure: ActuatorStructure, record: Record, known: Values, free: Sequence[str] | None) -> Expected:
    """The problem with these free parameters, or with those that `identify` frees by default."""
    freedom = Freedom()
    if free is not None:
        space = structure.search_space(record)
        every = (*space.names, *space.held)
        check_parameters(every, free=free)
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


@frozen_result
class InputDesign:
    """An input, and what it is expected to tell of a law.

    Attributes
    ----------
    t, u : array, shape (n_samples,)
        Times [s] and input [unit of u], which begins at the centre of its limits.
    levels, holds : array, shape (n_levels,)
        Turning points of the input [unit of u], holds there [s]; the last may lie past the end. Empty for a usual one.
    expected_stderr : mapping
        Names of the numbers to their standard errors, those of an efficient estimate [unit of each].
    covariance : array, shape (n_names, n_names)
        Their covariance, in the same order.
    efficiency : mapping
        Names of the usual inputs to their criterion over this one's, which is proportional to the number of samples.
    beside, beside_stderr : mapping
        Names of usual inputs, for an actuator the best of a few speeds, and of your own to inputs, shape (n_samples,),
        and to the standard errors that are expected of them, by name.
    criterion, noise : str, and float
        ``"D"``, ``"A"`` or ``"E"``, and standard deviation of the output for which all this holds [unit of y].
    limits : InputLimits
        The limits that it keeps.
    remarks : tuple of str
        What no input within the limits determines, and was taken as known, and what this one determines badly.
    """

    t: FloatArray
    u: FloatArray
    levels: FloatArray
    holds: FloatArray
    expected_stderr: Mapping[str, float]
    covariance: FloatArray
    efficiency: Mapping[str, float]
    beside: Mapping[str, FloatArray]
    beside_stderr: Mapping[str, Mapping[str, float]]
    criterion: str
    noise: float
    limits: InputLimits
    remarks: tuple[str, ...] = ()

    @property
    def correlation(self) -> FloatArray:
        """Correlations of the estimates, (n_names, n_names), in the order of `expected_stderr`."""
        size = np.sqrt(self.covariance.diagonal())
        return np.asarray(self.covariance / np.outer(size, size))

    def summary(self) -> str:
        """The printed result as a text."""
        return str(self)

    def __str__(self) -> str:
        head = f"InputDesign: {self.u.size} samples to {self.t[-1]:.4g} s, {self.levels.size} turning points"
        beside = ", ".join(f"{name} {100.0 * value:.0f} %" for name, value in self.efficiency.items())
        rows = self._by_part() | {f"{self.criterion}-efficiency of": beside, "but": "; ".join(self.remarks)}
        return summary_text([head, f"  expected standard errors for noise of {self.noise:.3g}:"], rows)

    def _by_part(self) -> dict[str, str]:
        parts: dict[str, list[str]] = {}
        for name, value in self.expected_stderr.items():
            part, _, short = name.rpartition(".")
            parts.setdefault(part or "law", []).append(f"{short} {value:.3g}")
        return {part: ", ".join(each[:12]) for part, each in parts.items()}


_BEST = 4  # candidates that are improved
_MOVE = 0.3  # of the amplitude: the first moves of a turning point; the last ones are a tenth of it
_PAUSES, _PAUSE = 0.3, 0.1  # share of the moves that change a pause, and their size beside _MOVE in parts of the record

Move = Callable[[FloatArray, float], FloatArray]  # strokes and the progress of the search, from 0 to 1, to strokes


def determined(subject: WholeActuator, inputs: Sequence[FloatArray]) -> WholeActuator:
    """The subject without the numbers that none of these inputs determines, and with a remark on each."""
    names, sizes = subject.names, subject.sizes
    remarks: list[str] = []
    known = [subject.information(u) for u in inputs]
    allowed = np.array([subject.tolerances.get(name, np.inf) for name in names])
    kept = np.arange(len(names))
    while kept.size:
        errors = sizes[kept] * np.min([spreads(each[np.ix_(kept, kept)]) for each in known], axis=0)
        excess = np.where(np.isinf(allowed[kept]), 0.0, errors / allowed[kept])
        worst = int(np.argmax(excess))
        if not excess[worst] > 1.0:
            break
        place = kept[worst]
        enough = f" well enough: {errors[worst]:.3g} at best, and {allowed[place]:.3g} is needed"
        remarks.append(
            f"no input within the limits determines {names[place]}{enough * bool(np.isfinite(errors[worst]))}; "
            f"it is taken as known, {subject.values[place]:.4g}"
        )
        kept = np.delete(kept, worst)
    return subject.only([names[k] for k in kept], remarks) if remarks else subject


def searched(
    drawn: Sequence[FloatArray], worth: Callable[[FloatArray], float], move: Move, moves: int
) -> tuple[float, FloatArray]:
    """The best strokes (n, 3) and their worth, after random moves of the best drawn; moves that are worth more stay."""
    improved = sorted([(worth(strokes), strokes) for strokes in drawn], key=lambda each: -each[0])[:_BEST]
    for place, best in enumerate(improved):
        for k in range(moves):
            strokes = move(best[1], k / moves)
            best = max(best, (worth(strokes), strokes), key=itemgetter(0))
        improved[place] = best
    return max(improved, key=itemgetter(0), default=(0.0, np.empty((0, 3))))


def one_moved(strokes: FloatArray, limits: InputLimits, rng: np.random.Generator, progress: float) -> FloatArray:
    """The strokes with one turning point, or its pause, moved; less and less as the search goes on."""
    trial, share = strokes.copy(), _MOVE * 0.1**progress * rng.standard_normal()
    place = rng.integers(len(trial))
    if rng.random() < _PAUSES:
        trial[place, 1] = max(0.0, trial[place, 1] + _PAUSE * share * limits.duration)
    else:
        target = trial[place, 0] + share * limits.amplitude
        trial[place, 0] = min(max(target, -limits.amplitude), limits.amplitude)
    return trial


_FASTER = 2.0  # times the frequency of the fastest mode: a multisine that is not told how far to go
_BELOW_NYQUIST = 0.8  # at most, of half the sampling rate


def design_input(
    plant: Any,
    *,
    limits: InputLimits | Mapping[str, float],
    free: Sequence[str] | None = None,
    values: Mapping[str, float] | None = None,
    noise: float | None = None,
    criterion: Criterion = "D",
    highest_frequency: float | None = None,
    beside: Mapping[str, npt.ArrayLike] | None = None,
    candidates: int = 100,
    moves: int = 300,
    seed: int = 0,
) -> InputDesign:
    """Propose an input within limits that tells most of the numbers of a law, or of a whole actuator.

    The input is a row of strokes between turning points, at some of which it is held: at the full slew for a law, and
    at many speeds for an actuator. They are drawn at random, and those of the best candidates are changed as long as
    the Fisher information on the numbers grows: a search that may miss the best input. Noise is taken as white, so that
    a pause is as good as any sample. The information depends on the numbers; begin with what is known, and repeat.

    Parameters
    ----------
    plant : Law, result of a fit, or structure of an Actuator
        A law as far as it is known, or `hysim.Actuator.structure` with such a law; at rest before the first sample.
    limits : InputLimits or mapping
        amplitude, slew, duration, sample_time, and optionally centre.
    free : sequence of str, optional
        Numbers to identify, as in ``law.scalars``; of an actuator as in `hysim.identify`, by default all it frees.
    values : mapping, optional
        Names of an actuator's parameters to their values, such as the estimates of a first fit. What is not named has
        the number of the structure's law, or the start of its search; the frequencies of the modes must be named.
    noise : float, optional
        Standard deviation of the output [unit of y]; by default that of the structure's sensor with rounding, or one.
    criterion : {"D", "A", "E"}
        Determinant of the information, mean variance, or the largest; A and E judge numbers in parts of their sizes.
    highest_frequency : float, optional
        Of the random-phase multisine beside an actuator's design [Hz]; by default twice that of the fastest mode.
    beside : mapping, optional
        Names to inputs of your own, (n_samples,) each, that are judged beside the usual ones.
    candidates, moves : int
        Random inputs, and changes of each of the best ones.
    seed : int
        Of the draws.

    Returns
    -------
    InputDesign

    Raises
    ------
    TypeError, ValueError
        If the plant is none of these or `free` a single string; if a name, a limit or the criterion is unknown, a value
        is missing, or no input within the limits tells all numbers apart.

    Examples
    --------
    >>> import hysim as hs
    >>> limits = hs.InputLimits(amplitude=2.0, slew=4.0, duration=8.0, sample_time=0.05)
    >>> design = hs.design_input(hs.Dahl(stiffness=3.0, coulomb=0.5), limits=limits, free=("stiffness", "coulomb"))
    >>> bool(max(design.efficiency.values()) <= 1.0), bool(abs(design.u).max() <= 2.0)
    (True, True)
    """
    check_choice("criterion", criterion, ("D", "A", "E"))
    check_whole(candidates, "candidates", least=0)
    plant = model_of(plant)
    bounds = limits if isinstance(limits, InputLimits) else InputLimits(**as_mapping(limits, "limits"))
    subject = _subject(plant, bounds, free, values, noise)
    rng, in_time = np.random.default_rng(seed), isinstance(plant, ActuatorStructure)
    if in_time:
        inputs = shapes.usual_of_many_speeds(bounds, _highest_frequency(highest_frequency, values or {}, bounds), rng)
    else:
        inputs = shapes.usual(bounds)
    drawn = [*shapes.triangles(bounds), *shapes.triangles(bounds, fading=True)] if in_time else []
    drawn += [(shapes.random_segments if in_time else shapes.random_strokes)(bounds, rng) for _ in range(candidates)]
    inputs |= _own(beside or {}, bounds)
    every = [u for variants in inputs.values() for u in variants]
    if isinstance(subject, WholeActuator):
        subject = determined(subject, [*every, *(shapes.through(strokes, bounds) for strokes in drawn)])

    def worth(u: FloatArray) -> float:
        return merit(subject.information(u), criterion)

    judged = {name: max(((worth(u), u) for u in each), key=itemgetter(0)) for name, each in inputs.items()}
    varied = shapes.with_another_segment if in_time else one_moved

    def moved(strokes: FloatArray, progress: float) -> FloatArray:
        return varied(strokes, bounds, rng, progress)

    best, strokes = searched(drawn, lambda strokes: worth(shapes.through(strokes, bounds)), moved, moves)
    u, first = shapes.through(strokes, bounds), max(judged.values(), key=itemgetter(0))
    if first[0] > best:
        (best, u), strokes = first, np.empty((0, 3))
    if not best > 0.0:
        raise ValueError(f"no input within the limits tells {', '.join(subject.names)} apart: free fewer of them")
    covariance = subject.covariance(u)
    return InputDesign(
        t=bounds.t,
        u=u,
        levels=bounds.centre + strokes[:, 0],
        holds=strokes[:, 1],
        expected_stderr=dict(zip(subject.names, np.sqrt(covariance.diagonal()).tolist(), strict=True)),
        covariance=covariance,
        efficiency={name: value / best for name, (value, _) in judged.items()},
        beside={name: each for name, (_, each) in judged.items()},
        beside_stderr={name: _stderr(subject, each) for name, (_, each) in judged.items()},
        criterion=criterion,
        noise=subject.noise,
        limits=bounds,
        remarks=(*subject.remarks, *_weak(subject, covariance)),
    )


def _own(beside: Mapping[str, npt.ArrayLike], limits: InputLimits) -> dict[str, list[FloatArray]]:
    inputs = {name: read_only(u, f"beside[{name!r}]", ndim=1) for name, u in beside.items()}
    for name, u in inputs.items():
        if u.size != limits.samples:
            raise ValueError(f"beside[{name!r}] must hold {limits.samples} samples, got {u.size}")
    return {name: [u] for name, u in inputs.items()}


def _stderr(subject: Subject, u: FloatArray) -> dict[str, float]:
    """Expected standard errors by name; infinite for numbers that an input does not determine."""
    errors = subject.sizes * spreads(subject.information(u))
    return dict(zip(subject.names, errors.tolist(), strict=True))


def _weak(subject: Subject, covariance: FloatArray) -> list[str]:
    errors = np.sqrt(covariance.diagonal())
    return [
        f"the standard error of {name} is expected to be {error:.3g}, more than its size"
        for name, value, error in zip(subject.names, subject.values.tolist(), errors.tolist(), strict=True)
        if value != 0.0 and error > abs(value)
    ]


def _highest_frequency(requested: float | None, values: Mapping[str, float], limits: InputLimits) -> float:
    nyquist = 0.5 / limits.sample_time
    if requested is not None:
        if not 0.0 < requested <= nyquist:
            raise ValueError(f"highest_frequency must be positive and at most {nyquist:g} Hz, got {requested}")
        return requested
    modes = [value for name, value in values.items() if FREQUENCY in name]
    return min(_FASTER * max(modes, default=np.inf) / (2.0 * np.pi), _BELOW_NYQUIST * nyquist)


def _subject(
    plant: Any, limits: InputLimits, free: Sequence[str] | None, values: Mapping[str, float] | None, noise: float | None
) -> Subject:
    if not isinstance(model_of(plant), Law | ActuatorStructure):
        raise TypeError(
            f"design_input takes a law that a step describes, such as BoucWen, or an Actuator.structure, "
            f"got {type(plant).__name__}"
        )
    if isinstance(free, str):
        raise TypeError(f"free must be a sequence of names, got the string {free!r}")
    check_positive(noise=noise)
    if isinstance(plant, ActuatorStructure):
        return whole_actuator(plant, limits, values or {}, free, noise)
    if values:
        raise ValueError("values are for the structure of an actuator: a law has its numbers")
    if not free:
        raise ValueError("free must name at least one number")
    names = checked_names(plant, free)
    sizes = sizes_along(plant, names, shapes.usual(limits)["triangle"][0])
    return LawAlone(plant, names, 1.0 if noise is None else noise, sizes)
