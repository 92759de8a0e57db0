"""The verb `simulate`: the output of a plant for an input in time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, vectors
from hysim._basics.printing import extent, frozen_result, summary_text
from hysim._basics.progress import Reports, along, reports
from hysim._basics.results import Result, model_of
from hysim.interop import dataset, frame
from hysim.models.dependent import on_record
from hysim.models.protocols import Remembering, Responding, needs_time
from hysim.records import Record, check_increasing, even_step

_BY_NODE = frozenset({"displacement", "velocity", "acceleration"})
"""Signals with a column for each mass, as their peaks: masses are nodes 1, 2, ..., because node 0 is the ground."""

_BY_ELEMENT = frozenset({"drift", "force"})

_PEAK = "peak_"


@frozen_result
class Simulation:
    """Result of `simulate`.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    t : array, shape (n,), or None
        Times of the samples; None for a rate-independent law without a time.
    z : array, shape (n,), or None
        Memory of a law that has one.
    signals : mapping
        All signals by name, also those above: shape (n,), or (n, m) for a plant's m masses, elements or memories.
    units : mapping
        Labels of the units, by the signals' names.
    name : str
        Name in pictures.
    """

    u: FloatArray
    y: FloatArray
    t: FloatArray | None = None
    z: FloatArray | None = None
    signals: Mapping[str, FloatArray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = ""

    @property
    def peaks(self) -> dict[str, FloatArray]:
        """Largest sizes over the whole run, by the names of the signals that have a ``"peak_..."``."""
        peaks = {name: values for name, values in self.signals.items() if name.startswith(_PEAK) and len(values)}
        return {name.removeprefix(_PEAK): values[-1] for name, values in peaks.items()}

    def __str__(self) -> str:
        arrays = {"t": self.t, "u": self.u, "y": self.y, "z": self.z, **self.signals}
        told = {f"{_PEAK}{name}" for name in arrays}  # beside the signal that they are the peaks of
        known = {name: values for name, values in arrays.items() if values is not None and name not in told}
        rows = {name: self._in_words(name, values) for name, values in known.items()}
        return summary_text([f"Simulation: {self.u.size} samples"], rows)

    def _in_words(self, name: str, values: FloatArray) -> str:
        least_to_largest = extent(values, self.units.get(name, ""))
        if values.ndim == 1:
            return least_to_largest
        peak = f", peak {self.peaks[name].max():.4g}" if name in self.peaks and values.size else ""
        return f"{values.shape[1]} columns, {least_to_largest}{peak}"

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Signals as the columns of a table, each of shape (n,): t, u, y and z first, then the others.

        A signal of shape (n, m) is m columns: ``drift_0``, ``drift_1``, ... for elements and memories, and
        ``displacement_1``, ``displacement_2``, ... for masses, whose nodes are counted from 1.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0))
        >>> list(hs.simulate(law, None, [0.0, 1.0]).columns)
        ['u', 'y', 'z_0', 'z_1']
        """
        first = {name: self.signals[name] for name in ("t", "u", "y", "z") if name in self.signals}
        named = {name: columns_of(name, values) for name, values in (first | dict(self.signals)).items()}
        return {label: column for columns in named.values() for label, column in columns.items()}

    def to_frame(self) -> Any:
        """The `columns` as a `pandas.DataFrame` over time, with ``attrs["units"]``; ImportError without pandas."""
        return frame_of_signals(self.columns, self.units)

    def to_xarray(self) -> Any:
        """The signals as an `xarray.Dataset` along t, or along sample without a time; ImportError without xarray.

        The second axis of a signal of several masses is ``node``, counted from 1, of one of several elements
        ``element``, and of another one, such as a memory, its own name with ``_0``.
        """
        return dataset_of_signals(self.signals, self.units)


def frame_of_signals(columns: Mapping[str, FloatArray], units: Mapping[str, str]) -> Any:
    """Columns as a `pandas.DataFrame` with t as its index, and units by the columns' names in ``attrs["units"]``."""
    others = {label: values for label, values in columns.items() if label != "t"}
    return frame(others, index=("t", columns["t"]) if "t" in columns else None, units=column_units(columns, units))


def dataset_of_signals(signals: Mapping[str, FloatArray], units: Mapping[str, str]) -> Any:
    """Signals by name, of shape (n,) or (n, m), as an `xarray.Dataset`; see `Simulation.to_xarray`."""
    first = "t" if "t" in signals else "sample"
    variables, coordinates = {}, {first: signals["t"]} if "t" in signals else {}
    for name, values in signals.items():
        axes = [first, *([_second_axis(name)] if values.ndim == 2 else [])]
        if "node" in axes:
            coordinates["node"] = np.arange(1, values.shape[1] + 1)
        if name != "t":
            variables[name] = (axes, values)
    return dataset(variables, coordinates, units)


def _second_axis(name: str) -> str:
    signal = name.removeprefix(_PEAK)
    return "node" if signal in _BY_NODE else "element" if signal in _BY_ELEMENT else f"{name}_0"


def column_units(columns: Iterable[str], units: Mapping[str, str]) -> dict[str, str]:
    """Units of columns by their labels, where they are known: drift_0 has that of the signal drift."""
    return {label: unit for label in columns if (unit := _unit_of(label, units)) is not None}


def _unit_of(label: str, units: Mapping[str, str]) -> str | None:
    signal, _, number = label.rpartition("_")
    return units.get(label, units.get(signal) if number.isdigit() else None)


def columns_of(name: str, values: FloatArray) -> dict[str, FloatArray]:
    if values.ndim == 1:
        return {name: values}
    first = 1 if name.removeprefix(_PEAK) in _BY_NODE else 0
    return {f"{name}_{first + k}": column for k, column in enumerate(values.T)}


def has_elements(result: Simulation) -> bool:
    drift, force = result.signals.get("drift"), result.signals.get("force")
    return drift is not None and force is not None and drift.ndim == 2 and drift.shape == force.shape and drift.size > 0


@runtime_checkable
class _HasSignals(Protocol):
    def signals(self, u: FloatArray, /, *time: float) -> Mapping[str, FloatArray]: ...


@reports
def simulate(
    plant: Any,
    t: npt.ArrayLike | None,
    u: npt.ArrayLike,
    *,
    units: Mapping[str, str] | None = None,
    progress: Reports = None,
) -> Simulation:
    """Simulate a law or a plant without feedback.

    Parameters
    ----------
    plant : model or result of a fit
        A law such as `hysim.BoucWen`, whose output does not depend on time, or a plant with dynamics, such as
        a `hysim.TransferFunction` or a `hysim.BoucWenOscillator`.
    t : array, shape (n,), or None
        Increasing times of the samples [s]; evenly spaced for a plant with dynamics. A law needs none.
    u : array, shape (n,)
        Input; between the samples linear for a law, and by its own `hold` for a plant with dynamics.
    units : mapping, optional
        Labels of units for the result.
    progress : callable or False, optional
        Called as ``progress(done, total)`` with numbers of samples.
        By default calls beyond 2 s report on the standard error; False turns this off.

    Returns
    -------
    Simulation

    Raises
    ------
    TypeError, ValueError, SimulationError
        If the plant has no ``response``; if lengths differ, a value is not finite, or a plant with dynamics has no even
        time; if the output diverges, with the sample.

    Examples
    --------
    >>> import hysim as hs
    >>> sim = hs.simulate(hs.BoucWen(), None, [0.0, 1.0, 0.0])
    >>> sim.y.round(6).tolist()
    [0.0, 0.632121, -0.307799]
    """
    plant = model_of(plant)
    if not isinstance(plant, Responding):
        raise TypeError(f"simulate takes a model with a response, got {type(plant).__name__}")
    inputs, *clock = vectors(u=u) if t is None else vectors(u=u, t=t)
    times = clock[0] if clock else None
    if times is not None:
        check_increasing(times)
    with along(progress):
        signals = _signals(plant, inputs, times)
        memory = plant.memory(inputs) if "z" not in signals and isinstance(plant, Remembering) else signals.get("z")
    every = {"t": times, "u": inputs, "z": memory, **signals}
    known = {name: values for name, values in every.items() if values is not None}
    return Simulation(u=inputs, y=signals["y"], t=times, z=memory, signals=known, units=units or {})


@runtime_checkable
class _Read(Protocol):
    """A plant whose sensor is late."""

    @property
    def as_read(self) -> Any: ...


@runtime_checkable
class _OnSeveral(Protocol):
    """A result of a fit to several records, with a model for each."""

    @property
    def models(self) -> tuple[Any, ...]: ...


def models_on(thing: Any, records: Sequence[Record]) -> list[Any]:
    """The model of a result, or a model itself, on each record: from its initial state there, at its channels."""
    has_each = isinstance(thing, Result) and isinstance(thing, _OnSeveral) and len(thing.models) == len(records)
    models = thing.models if has_each else [model_of(thing)] * len(records)
    return [on_record(model, record) for model, record in zip(models, records, strict=True)]


def free_run(thing: Any, record: Record, units: Mapping[str, str] | None = None) -> Simulation:
    """The free run of a model on the input of a record, as every verb judges and draws it: without sensor noise."""
    (model,) = models_on(thing, [record])
    plant = model.as_read if isinstance(model, _Read) else model
    run = simulate(plant, record.t, record.u, units=record.units if units is None else units)
    return replace(run, name=type(model).__name__)


def residual_of(models: Sequence[Any], records: Sequence[Record]) -> FloatArray:
    """Measured minus modelled output (n_samples,) of free runs, one model for each record [unit of y]."""
    pairs = zip(models, records, strict=True)
    return np.concatenate([record.y - free_run(model, record).y for model, record in pairs])


def _signals(plant: Responding, u: FloatArray, times: FloatArray | None) -> Mapping[str, FloatArray]:
    time: tuple[float, ...] = ()
    if needs_time(plant):
        if times is None:
            raise ValueError(f"a {type(plant).__name__} needs times: pass t=")
        time = (even_step(times),)
    return plant.signals(u, *time) if isinstance(plant, _HasSignals) else {"y": plant.response(u, *time)}
