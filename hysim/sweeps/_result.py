"""The result of `sweep`: a table with one row for each task."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen
from hysim._names import among
from hysim._printing import csv_text, printed, summary_text
from hysim._versions import optional
from hysim.sweeps._seeds import seeds
from hysim.sweeps._space import Column
from hysim.sweeps._store import opened
from hysim.sweeps._table import Table


@printed
@frozen
class Sweep:
    """A study as a table; ``result["name"]`` is a column of it.

    Parameters
    ----------
    parameters : mapping
        Name to values, shape (n,).
    outputs : mapping
        Name to the numbers that the tasks returned, shape (n,); nan where a task failed.
    arrays : mapping
        Name to the arrays that the tasks returned, shape (n, ...); nan where a task failed.
    task : array, shape (n,)
        Places of the tasks in the study, increasing.
    seed : array, shape (n,)
        Seeds of the tasks.
    seconds : array, shape (n,)
        Computing time of each task [s]; the mean for tasks in a batch.
    errors : mapping
        Place of a failed task to its message.
    n_tasks : int
        Number of tasks of the study, also of those without a row because it was interrupted.
    axes : mapping, optional
        Name of a parameter of a grid to the values along its axis.
    """

    parameters: Mapping[str, Column]
    outputs: Mapping[str, FloatArray]
    arrays: Mapping[str, FloatArray]
    task: npt.NDArray[np.int64]
    seed: npt.NDArray[np.int64]
    seconds: FloatArray
    errors: Mapping[int, str]
    n_tasks: int
    axes: Mapping[str, Column] | None = None

    def __str__(self) -> str:
        return summary_text([f"Sweep of {', '.join(self.parameters)}; {self.summary()}"])

    def __len__(self) -> int:
        return self.task.size

    def __getitem__(self, name: str) -> Column:
        columns = {**self.columns, **self.arrays}
        if name not in columns:
            raise KeyError(f"no column {name!r}: there are {among(name, columns)}")
        return columns[name]

    @property
    def columns(self) -> dict[str, Column]:
        """Parameters, outputs that are numbers, seed, seconds and error, each shape (n,), by name."""
        return {**self.parameters, **self.outputs, "seed": self.seed, "seconds": self.seconds, "error": self.error}

    @property
    def error(self) -> Column:
        """Messages, shape (n,), empty where a task succeeded."""
        messages = np.full(len(self), "", dtype=object)
        for place, message in self.errors.items():
            messages[np.searchsorted(self.task, place)] = message
        messages.setflags(write=False)
        return messages

    def to_csv(self) -> str:
        """The columns as comma-separated values, every digit kept; arrays are left out."""
        columns = {"task": self.task, **self.columns}
        return csv_text([columns, *zip(*(column.tolist() for column in columns.values()), strict=True)], nan="nan")

    def to_frame(self) -> Any:
        """The columns as a `pandas.DataFrame` with the tasks as index, without arrays; ImportError without pandas."""
        pandas = optional("pandas", "to_frame", "tables")
        return pandas.DataFrame(self.columns, index=pandas.Index(self.task, name="task"))

    def to_xarray(self) -> Any:
        """The result as an `xarray.Dataset` along the axes of a grid or the tasks; ImportError without xarray.

        Further axes of an output `name` are called ``name_0``, ``name_1``; values are nan where there is no row.
        """
        xarray = optional("xarray", "to_xarray", "tables")
        own = {"seed": self.seed, "seconds": self.seconds, "error": self.error}
        if self.axes is None:
            dims: tuple[str, ...] = ("task",)
            coordinates = {"task": self.task, **{name: ("task", column) for name, column in self.parameters.items()}}
        else:
            dims, coordinates = tuple(self.axes), dict(self.axes)
        variables = {
            name: ((*dims, *(f"{name}_{k}" for k in range(values.ndim - 1))), self._along_axes(values))
            for name, values in {**self.outputs, **self.arrays, **own}.items()
        }
        return xarray.Dataset(variables, coords=coordinates)

    def summary(self) -> str:
        """Numbers of tasks that are done and that failed, the commonest errors, and the range of every output."""
        n = len(self)
        lines = [f"{n} of {self.n_tasks} tasks: {n - len(self.errors)} succeeded, {len(self.errors)} failed"]
        for message, number in Counter(self.errors.values()).most_common(5):
            lines.append(f"  {number} x {message}")
        for name, values in self.outputs.items():
            finite = values[np.isfinite(values)]
            if finite.size:
                low, middle, high = np.quantile(finite, [0.0, 0.5, 1.0])
                lines.append(f"{name}: {low:.4g} to {high:.4g}, median {middle:.4g}, {n - finite.size} not finite")
        return "\n".join(lines)

    def _along_axes(self, values: Column) -> Column:
        if self.axes is None:
            return values
        shape = tuple(len(axis) for axis in self.axes.values())
        missing: Any = "" if values.dtype == object else 0 if values.dtype.kind == "i" else np.nan
        every = np.full((self.n_tasks, *values.shape[1:]), missing, dtype=values.dtype)
        every[self.task] = values
        return every.reshape(*shape, *values.shape[1:])


def load_sweep(path: str | Path) -> Sweep:
    """Read the store of a study that is finished, interrupted or still running.

    Parameters
    ----------
    path : path
        The argument `store` of `sweep`.

    Returns
    -------
    Sweep
        The rows that are in the store.

    Raises
    ------
    OSError
        If the store cannot be read.
    ValueError
        If the file is not a store.

    Examples
    --------
    >>> import tempfile, hysim as hs
    >>> def product(a, b):
    ...     return a * b
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = hs.sweep(product, {"a": [1, 2], "b": [3.0, 4.0]}, store=f"{folder}/study.sqlite")
    ...     hs.load_sweep(f"{folder}/study.sqlite")["value"].tolist()
    [3.0, 4.0, 6.0, 8.0]
    """
    with opened(path, to_read=True) as store:
        finished, space, seed = store.finished(), store.space(), store.seed
        table = Table(store.n_tasks, space.columns)
        table.restore(store.layout(), finished)
    return result_of(table, space.columns, space.axes, seeds(seed, finished.places))


def result_of(
    table: Table, parameters: Mapping[str, Column], axes: Mapping[str, Column] | None, task_seeds: Column
) -> Sweep:
    """The rows of the tasks that are done, with their parameters and seeds, shape (n,)."""
    places = np.flatnonzero(table.done)
    values = {name: column[places] for name, column in table.values.items()}
    for column in (places, task_seeds, *parameters.values(), *values.values()):
        column.setflags(write=False)
    shapes = dict(table.layout or ())
    return Sweep(
        parameters=parameters,
        outputs={name: column for name, column in values.items() if not shapes[name]},
        arrays={name: column for name, column in values.items() if shapes[name]},
        task=places,
        seed=task_seeds,
        seconds=table.seconds[places],
        errors=dict(sorted(table.errors.items())),
        n_tasks=table.done.size,
        axes=axes,
    )
