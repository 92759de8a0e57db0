"""A structure over its parameters, its input's scale and ground motions, as a task with a batch form."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_choice, checked, read_only
from hysim._results import model_of
from hysim.plants.structures.ensemble import REDUCTIONS
from hysim.plants.structures.structure import Structure

_RECORD = "record"


@checked
class StructureTask:
    """A function from parameters of a structure to measures of its response; see `structure_task`."""

    structure: Structure
    inputs: FloatArray
    sample_time: float
    measures: tuple[Any, ...]

    def __call__(self, **parameters: float) -> dict[str, Any]:
        """The measures for one set of parameters."""
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
    TypeError
        If the structure is none.
    ValueError
        If a measure is unknown, or the records are not finite.

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
    if isinstance(ground_accelerations, np.ndarray) or np.ndim(ground_accelerations[0]) == 0:  # type: ignore[index]
        records = list(np.atleast_2d(np.asarray(ground_accelerations, dtype=float)))
    else:
        records = [read_only(each, "ground_accelerations", ndim=1) for each in ground_accelerations]  # type: ignore[union-attr]
    table = np.zeros((len(records), max(record.size for record in records)))
    for row, record in zip(table, records, strict=True):
        row[: record.size] = record
    return StructureTask(structure=structure, inputs=table, sample_time=sample_time, measures=names)
