"""Tasks with a batch form: a law over its parameters, and a structure over its own, the scale and the ground motion."""

import inspect
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, checked, given_items, vectors
from hysim._basics.results import model_of, model_or_class
from hysim.plants.structures.ensemble import REDUCTIONS
from hysim.plants.structures.structure import Structure, ground_records

Measure = Literal["rmse", "sse", "max_width", "area", "final", "response"]
_WITH_TARGET = ("rmse", "sse")


@runtime_checkable
class _ComputesMany(Protocol):
    def responses(self, *arguments: Any) -> FloatArray: ...


@checked
class ResponseTask:
    """A function from parameters of a law to one measure of its response, with a batch form; see `response_task`."""

    family: type
    fixed: Mapping[str, Any]
    u: FloatArray
    y: FloatArray | None
    measure: Measure

    def __call__(self, **parameters: float) -> dict[str, Any]:
        """The measure for one set of parameters, or the response, shape (n,), by its name."""
        return {name: values[0] for name, values in self.batch(**{k: [v] for k, v in parameters.items()}).items()}

    def batch(self, **parameters: npt.ArrayLike) -> dict[str, FloatArray]:
        """The measures for many sets, shape (n_sets,), or the responses, shape (n_sets, n), by their name."""
        laws: Any = self.family
        sets = {**self.fixed, **parameters}
        if self.measure == "response":
            return {"response": laws.responses(sets, self.u, workers=1)}
        reduce = "sse" if self.measure == "rmse" else self.measure
        values = laws.responses(sets, self.u, reduce=reduce, target=self.y, workers=1)
        return {self.measure: np.sqrt(values / self.u.size) if self.measure == "rmse" else values}


def response_task(
    law: Any, u: npt.ArrayLike, y: npt.ArrayLike | None = None, measure: Measure = "rmse"
) -> ResponseTask:
    """A task for `sweep`: how a law's response depends on its parameters.

    Parameters
    ----------
    law : law, result of a fit, or class
        A law, which gives the values of the parameters that the study does not vary; or its class, for its defaults.
    u : array, shape (n,)
        Input, linear between its samples.
    y : array, shape (n,), optional
        Output to compare the response with, for ``"rmse"`` and ``"sse"``.
    measure : {"rmse", "sse", "max_width", "area", "final", "response"}
        Root of the mean, or sum, of the squared differences from `y`; a measure of `loop_metrics`; the last sample; or
        the response itself as an array. It is inf for a law that diverges.

    Returns
    -------
    ResponseTask
        A function of the law's parameters, whose batch form computes many sets at once on one thread.

    Raises
    ------
    TypeError, ValueError
        If the family has no ``responses`` with this measure, `y` is missing or not needed, or the lengths differ.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> task = hs.response_task(hs.BoucWen(beta=0.02, gamma=-0.01, gain=0.01, feedthrough=0.02), rec.u, rec.y)
    >>> result = hs.sweep(task, {"beta": [0.01, 0.02], "feedthrough": [0.01, 0.02, 0.03]})
    >>> len(result), result["rmse"].shape
    (6, (6,))
    """
    check_choice("measure", measure, get_args(Measure))
    law = model_or_class(law)
    family = law if isinstance(law, type) else type(law)
    options = inspect.signature(family.responses).parameters if isinstance(family, _ComputesMany) else {}
    if not ("reduce" in options or (options and measure == "response")):
        raise TypeError(f"{family.__name__} cannot compute many laws at once with the measure {measure!r}")
    if (measure in _WITH_TARGET) != (y is not None):
        raise ValueError(f"y is needed for the measures {' and '.join(_WITH_TARGET)}, and for no other")
    fixed = {} if isinstance(law, type) else {k: v for k, v in given_items(law).items() if k != "u_range"}
    inputs, *target = vectors(u=u) if y is None else vectors(u=u, y=y)
    return ResponseTask(family=family, fixed=fixed, u=inputs, y=target[0] if target else None, measure=measure)


_RECORD = "record"


@checked
class StructureTask:
    """A function from parameters of a structure to measures of its response; see `structure_task`."""

    structure: Structure
    inputs: FloatArray
    sample_time: float
    measures: tuple[Any, ...]

    def __call__(self, **parameters: float) -> dict[str, Any]:
        return {name: values[0] for name, values in self.batch(**{k: [v] for k, v in parameters.items()}).items()}

    def batch(self, **parameters: npt.ArrayLike) -> dict[str, FloatArray]:
        """The measures for many sets: the largest of all elements or masses, (n_sets,), and each, (n_sets, ...)."""
        columns = {name: np.atleast_1d(np.asarray(values, dtype=float)) for name, values in parameters.items()}
        records = columns.pop(_RECORD, np.zeros(1))
        places = records.astype(int)
        if (places != records).any() or (places < 0).any() or (places >= len(self.inputs)).any():
            raise ValueError(f"record must be a whole number from 0 to {len(self.inputs) - 1}")
        u = self.inputs[places] if places.size > 1 else self.inputs[places[0]]
        out: dict[str, FloatArray] = {}
        for measure in self.measures:
            values = self.structure.responses(columns, u, sample_time=self.sample_time, reduce=measure, workers=1)
            out |= {measure: np.abs(values).max(axis=1, initial=0.0), f"{measure}_each": values}
        return out


def structure_task(
    structure: Any,
    ground_accelerations: npt.ArrayLike | Sequence[npt.ArrayLike],
    sample_time: float,
    measures: str | Sequence[str] = "peak_drift",
) -> StructureTask:
    """A task for `sweep`: how measures of a structure depend on its parameters, the input's scale and the record.

    With the scales as one axis and the records as the other it is an incremental dynamic analysis; with a
    `hysim.Sample` of parameters, a fragility curve or Sobol indices.

    Parameters
    ----------
    structure : Structure, or result of a fit of one
        Its values are those of the parameters that the study does not vary.
    ground_accelerations : array, shape (n_samples,) or (n_records, n_samples), or sequence of arrays
        Inputs [m/s^2, or N under a force]; shorter ones are continued by zeros.
    sample_time : float
        Time between two samples of all records [s].
    measures : str or sequence of str
        As ``reduce`` of `Structure.responses`.

    Returns
    -------
    StructureTask
        A function of parameters by the names of `Structure.scalars`, of ``scale``, and of ``record``, the place of a
        record. It returns the largest size over elements or masses by the measure's name, and the values of each by
        ``"peak_drift_each"``; its batch form computes many sets on one thread.

    Raises
    ------
    TypeError, ValueError
        If the structure is none, a measure is unknown, or the records are not finite.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> frame = hs.shear_frame([1.0], laws=hs.BoucWen(beta=50.0, gamma=50.0, gain=180.0, feedthrough=20.0))
    >>> records = [hs.signals.ground_motion(3.0, duration=8.0, sample_time=0.02, seed=seed) for seed in (1, 2)]
    >>> task = hs.structure_task(frame, records, 0.02)
    >>> study = hs.sweep(task, {"record": [0, 1], "scale": [0.5, 1.0, 2.0]})
    >>> study["peak_drift"].shape, study["peak_drift_each"].shape
    ((6,), (6, 1))
    """
    structure = model_of(structure)
    if not isinstance(structure, Structure):
        raise TypeError(f"structure_task takes a Structure, got {type(structure).__name__}")
    names = (measures,) if isinstance(measures, str) else tuple(measures)
    for name in names:
        check_choice("measures", name, REDUCTIONS)
    table = np.array([*zip_longest(*ground_records(ground_accelerations), fillvalue=0.0)]).T
    return StructureTask(structure=structure, inputs=table, sample_time=sample_time, measures=names)
