"""The search for the parameters of a structure, on which `hysim.identify` calls.

Numbers that stay positive are searched on a log scale from a tenth of their start to ten times it, others between plus
and minus ten times it. A number stays positive where a negative one is refused, or would make an element a source of
energy: motions of such a structure are chaotic, and a search that met them took eight times as long.

Outputs have no derivatives by the numbers: `hysim.identify` takes finite differences of simulations, which have equal
substeps throughout so that the outputs are smooth: as many as turn the phase of the fastest mode at the start by at
most 0.8 rad each, whose error is about 1e-5 of the largest acceleration.

The search begins with the first motions of the record with the largest input, which are small and determine the
stiffness, and goes on to longer parts of it; what a part does not determine is kept near its start. The parts cost
little: with 14 numbers 50 % off the search took half as long with them, and ended in the same optimum.

`hysim.identify` fits one output for each record. The sensors' outputs are laid one behind the other, each in units of
its noise; the input is repeated for each of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from hysim._basics.frozen import FloatArray, read_only, whole_substeps
from hysim._basics.parallel import in_chunks
from hysim._basics.printing import frozen_result, summary_text
from hysim.errors import SimulationError
from hysim.models.model import not_offered
from hysim.models.parameters import Coordinate, free_coordinate, space_of
from hysim.models.protocols import Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants.structures.assembly import MovingStructure
from hysim.plants.structures.parts import OF_ELEMENTS, OF_NODES, expanded, is_shared, scalars_of, sharing, unknown
from hysim.records import Record, SensorRecord, check_increasing, even_step, span_of

Sensor = tuple[str, int]
"""Name of a signal, and its column."""

_DECADE = 10.0
_PHASE = 0.8  # of the fastest mode in a substep [rad]
_PARTS = (0.01, 0.05, 0.2, 0.5)  # of the integral of the squared input
_FEWEST = 30  # samples of a part
_STEPS = 12  # for each part
_NEAR = 0.7  # in units of the start: how far from its start a number is expected to be
_MISFIT = 0.05  # of the rms of a part of the record: an error like that is worth one such distance
_DIFFERENCE = 1e-5  # of a coordinate
_INSIDE = 1e-9  # coordinates: a descent begins inside the box


@frozen_result
class StructureRecord:
    """Input of a structure, and what several sensors measured.

    Parameters
    ----------
    t, u : array, shape (n,)
        Evenly spaced times of the samples [s], and acceleration of the base [m/s^2] or force [N].
    displacement, velocity, acceleration : array, shape (n, n_nodes), optional
        Relative to the ground, the accelerations absolute, as `hysim.simulate` has them [m], [m/s], [m/s^2]. A column
        of nan is a sensor that is not there.
    drift, force : array, shape (n, n_elements), optional
        Of the elements [m], [N]; likewise.
    name : str, optional
        Name of the record in tables.

    Raises
    ------
    ValueError
        If shapes do not fit, times are not evenly spaced, a column is partly nan, or nothing was measured.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> t = 0.01 * np.arange(100)
    >>> top = np.column_stack([np.full(100, np.nan), np.sin(t)])
    >>> hs.StructureRecord(t=t, u=np.cos(t), acceleration=top).sensors
    (('acceleration', 1),)
    """

    t: FloatArray
    u: FloatArray
    displacement: FloatArray | None = None
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None
    drift: FloatArray | None = None
    force: FloatArray | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name, values in (("t", self.t), ("u", self.u)):
            if values.ndim != 1 or values.size != self.t.size:
                raise ValueError(f"{name} must have the shape ({self.t.size},), got {values.shape}")
            read_only(values, name)  # finite
        if self.t.size < 2:
            raise ValueError(f"a record needs at least 2 samples, got {self.t.size}")
        check_increasing(self.t)
        even_step(self.t)
        for name, values in self.signals.items():
            if values.ndim != 2 or len(values) != self.t.size:
                raise ValueError(f"{name} must have the shape ({self.t.size}, number of columns), got {values.shape}")
            missing = np.isnan(values)
            if (missing.any(axis=0) & ~missing.all(axis=0)).any() or np.isinf(values).any():
                raise ValueError(f"a column of {name} must be finite, or nan as a whole where there is no sensor")
        if not self.sensors:
            raise ValueError(f"a record needs one of {', '.join((*OF_NODES, *OF_ELEMENTS))}")

    def __len__(self) -> int:
        return self.t.size

    def __str__(self) -> str:
        names = ", ".join(f"{signal}[:, {column}]" for signal, column in self.sensors)
        lines = [f"StructureRecord {self.name}".rstrip() + f": {len(self)} samples every {self.sample_time:.4g} s"]
        return summary_text(lines, {"sensors": names})

    @property
    def signals(self) -> dict[str, FloatArray]:
        """The measured signals by name."""
        every = {name: vars(self)[name] for name in (*OF_NODES, *OF_ELEMENTS)}
        return {name: values for name, values in every.items() if values is not None}

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """Name of the signal, and the column, of each sensor that is there."""
        present = {name: np.flatnonzero(~np.isnan(values).any(axis=0)) for name, values in self.signals.items()}
        return tuple((name, column) for name, columns in present.items() for column in columns.tolist())

    @property
    def sample_time(self) -> float:
        """Time between two samples [s]."""
        return even_step(self.t)


def laid(record: Record | StructureRecord, widths: Mapping[str, int], output: Sensor) -> SensorRecord:
    """One output of all sensors, each in units of its rms; ValueError unless signals have `widths` columns."""
    if isinstance(record, Record):
        outputs: list[FloatArray] = [record.y]
        sensors: tuple[Sensor, ...] = (output,)
    else:
        for name, values in record.signals.items():
            if values.shape[1] != widths[name]:
                what = "masses" if name in OF_NODES else "elements"
                raise ValueError(
                    f"{name} must have a column for each of the {widths[name]} {what}, got {values.shape[1]}; "
                    "fill the columns without a sensor with nan"
                )
        outputs, sensors = [record.signals[name][:, column] for name, column in record.sensors], record.sensors
    sizes = [float(np.sqrt(np.mean(y**2))) or 1.0 for y in outputs]
    n = len(record) * len(sensors)
    return SensorRecord(
        t=record.sample_time * np.arange(float(n)),
        u=np.tile(record.u, len(sensors)),
        y=np.concatenate([y / size for y, size in zip(outputs, sizes, strict=True)]),
        name=record.name,
        sensors=sensors,
        scales=tuple(sizes),
        sizes=tuple(sizes),
    )


class SearchedStructure(MovingStructure, Subject):
    """Base class of a structure whose named numbers `hysim.identify` searches, beginning with its own."""

    may_depend: ClassVar[bool] = False

    @property
    def scalars(self) -> dict[str, float]:
        """Every number by name, such as ``"damping"`` and ``"elements.0.beta"``; see `assemble`."""
        return scalars_of(self)

    candidates = not_offered  # a structure begins with its own numbers

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box around the free numbers, and starts from parts of the record; ValueError without free numbers."""
        if freedom.initial not in (None, "rest"):
            raise ValueError("a structure begins with its initial_state: leave initial out")
        span_of(record)  # which raises
        if not freedom.free:
            raise ValueError(f"say which numbers of the structure are free: {_examples(self.scalars)}")
        record.sample_time  # noqa: B018  # raises ValueError if there is none
        known = self._known(freedom)
        held = {name: known[name] for name in known if name not in freedom.free} | freedom.held(known)
        covered = {each for name in freedom.free if is_shared(name) for each in sharing(self.scalars, name)}
        held = {name: value for name, value in held.items() if name not in covered or name in freedom.fixed}
        own = {name: value for name, value in known.items() if name in held or name in freedom.free}
        own |= {name: float(value) for name, value in freedom.fixed.items()}
        strokes = self._strokes(record)
        box = [self._coordinate(name, own[name], freedom, strokes) for name in freedom.free]
        order = {name: own[name] for name in (*freedom.free, *held)}
        limits = freedom.limits(order, held)
        space = space_of(box, (), order, held, limits, screened=0)
        return space_of(box, (), order, held, limits, [self._begun(record, space)], screened=0)

    def _known(self, freedom: Freedom) -> dict[str, float]:
        """Every number by name; with the star those that the user names, the means of what they stand for."""
        scalars: dict[str, float] = self.scalars
        numbers = expanded(scalars, {name: value for name, value in freedom.fixed.items() if is_shared(name)})
        known = scalars | numbers
        for name in (*freedom.free, *freedom.fixed, *freedom.bounds):
            if is_shared(name):
                known[name] = float(np.mean([known[each] for each in sharing(scalars, name)]))
            elif name not in scalars:
                raise unknown(scalars, name)
        return known

    def _strokes(self, record: Record) -> FloatArray | None:
        """Largest drift of each element at the start, (n_elements,); None if the motion diverges."""
        try:
            coarse = replace(self, substeps=self.search_substeps(record.sample_time))
            return np.asarray(np.abs(coarse.signals(_input(record), record.sample_time)["drift"]).max(axis=0))
        except SimulationError:
            return None

    def _coordinate(self, name: str, start: float, freedom: Freedom, strokes: FloatArray | None) -> Coordinate:
        if name in freedom.bounds:
            return free_coordinate(name, *map(float, freedom.bounds[name]))
        if start == 0.0:
            raise ValueError(f"{name!r} is free and begins at zero: give bounds={{{name!r}: (lower, upper)}}")
        if start > 0.0 and not self._may_be_negative(name, -start, strokes):
            return Coordinate(name, start / _DECADE, start * _DECADE, start, log=True)
        size = abs(start)
        return Coordinate(name, -_DECADE * size, _DECADE * size, size)

    def _may_be_negative(self, name: str, value: float, strokes: FloatArray | None) -> bool:
        if name.partition("[")[0].partition(".")[0] in ("mass", "stiffness", "damping"):
            return False
        try:
            other = self.assemble({name: value})
        except ValueError:
            return False
        return strokes is None or not (self.dissipative(strokes) & ~other.dissipative(strokes)).any()

    def _begun(self, record: Record, space: SearchSpace) -> dict[str, float]:
        """Numbers at which the parts of the record, one longer than the other, leave the least error."""
        x = space.starts[0]
        energy = np.cumsum(_input(record) ** 2)
        for part in _PARTS:
            x = self._on_part(record, space, x, max(_FEWEST, int(np.searchsorted(energy, part * energy[-1])) + 1))
        return {name: float(np.ravel(value)[0]) for name, value in space.parameters(x[np.newaxis]).items()}

    def _on_part(self, record: Record, space: SearchSpace, x: FloatArray, n: int) -> FloatArray:
        """Coordinates (n_x,) of the least error on the first `n` samples, together with the distance from the start."""
        from scipy.optimize import least_squares

        start, measured = space.starts[0], record.y.reshape(len(_sensors(record)[0]), -1)[:, :n]
        unit = _MISFIT * float(np.sqrt(np.mean(measured**2) * measured.size)) or 1.0

        def errors(x: FloatArray) -> FloatArray:
            misfit = (self._outputs(space.parameters(x), record, n) - measured).reshape(len(x), -1) / unit
            return np.concatenate([np.nan_to_num(misfit, posinf=1e6, neginf=-1e6), (x - start) / _NEAR], axis=1)

        def slopes(x: FloatArray) -> FloatArray:
            steps = np.where(x + _DIFFERENCE > space.upper, -_DIFFERENCE, _DIFFERENCE)
            rows = errors(np.concatenate([x[np.newaxis], x + np.diag(steps)]))
            return np.asarray(((rows[1:] - rows[0]) / steps[:, np.newaxis]).T)

        if not np.isfinite(errors(x[np.newaxis])).all():
            return x
        inside, box = np.clip(x, space.lower + _INSIDE, space.upper - _INSIDE), (space.lower, space.upper)
        fit = least_squares(
            lambda x: errors(x[np.newaxis])[0], inside, slopes, bounds=box, ftol=1e-3, xtol=1e-4, max_nfev=_STEPS
        )
        return np.asarray(fit.x)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output itself, shape (n_sets, n_samples, 1), sets on threads; inf for a set that diverges."""
        return self._outputs(parameters, record, _input(record).size).reshape(-1, len(record), 1)

    def _outputs(self, parameters: Parameters, record: Record, n: int) -> FloatArray:
        """Outputs of the sensors at the first `n` samples, (n_sets, n_sensors, n)."""
        own = self.scalars
        values = np.broadcast_arrays(*(np.atleast_1d(value) for value in parameters.values()))
        sets = [dict(zip(parameters, row, strict=True)) for row in np.stack(values, axis=1).tolist()]
        sensors, scales = _sensors(record)
        outputs = np.full((len(sets), len(sensors), n), np.inf)
        u, sample_time, substeps = _input(record)[:n], record.sample_time, self.search_substeps(record.sample_time)

        def simulate(begin: int, end: int) -> None:
            for k in range(begin, end):
                others = {name: value for name, value in sets[k].items() if own.get(name) != value}
                try:
                    signals = replace(self.assemble(others), substeps=substeps).signals(u, sample_time)
                except (SimulationError, ValueError):  # a motion that diverges, or numbers that are no structure
                    continue
                for row, (name, column), scale in zip(outputs[k], sensors, scales, strict=True):
                    row[:] = signals[name] if name == "y" else signals[name][:, column]
                    row /= scale

        in_chunks(simulate, len(sets), minimum=1)
        return outputs

    def search_substeps(self, sample_time: float) -> int:
        if self.substeps is not None:
            return self.substeps
        return whole_substeps(sample_time * self.fastest_rate / _PHASE)

    def as_records(self, records: Any) -> Any:
        """Records of several sensors as records of one output, others unchanged; ValueError if columns do not fit."""
        several = [records] if isinstance(records, Record | StructureRecord) else records
        if not isinstance(several, Sequence) or not any(isinstance(each, StructureRecord) for each in several):
            return records
        return [
            laid(each, self.widths, self.place_of(self.output)) if isinstance(each, Record | StructureRecord) else each
            for each in several
        ]

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """The noise of each sensor of the first record, and the steps of the search."""
        n = self.search_substeps(record.sample_time)
        steps = (f"the search simulates with {n} equal step{'' if n == 1 else 's'} a sample",)
        if not isinstance(record, SensorRecord):
            return steps
        sensors, scales = _sensors(record)
        names = (_in_words(name, column) for name, column in sensors)
        levels = ", ".join(f"{scale:.2g} of {name}" for name, scale in zip(names, scales, strict=True))
        return (f"residuals are in units of the noise of each sensor, {levels}", *steps)


def _input(record: Record) -> FloatArray:
    return record.input if isinstance(record, SensorRecord) else record.u


def _sensors(record: Record) -> tuple[tuple[tuple[str, int], ...], tuple[float, ...]]:
    if isinstance(record, SensorRecord):
        return tuple(record.sensors), record.scales
    return (("y", 0),), (1.0,)


def _in_words(name: str, column: int) -> str:
    return f"{name}.{column + (name in OF_NODES)}"


def _examples(scalars: Mapping[str, float]) -> str:
    names = ["damping", *(name for name in scalars if name.startswith("elements."))][:3]
    return f"free=[{', '.join(repr(name) for name in names)}, ...], names as in Structure.scalars"
