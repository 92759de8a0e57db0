"""The result of `sweep`, a table with one row for each task; Sobol indices and fragility curves of such results.

**Sobol indices** are the shares of the variance of an output that are due to each parameter. Independent samples A and
B of n sets, and for each parameter i AB_i, which is A with column i from B, give from n (d + 2) tasks

    first order   S_i = Var(E(f | x_i)) / Var(f)              share of parameter i alone
    total         T_i = 1 - Var(E(f | all but x_i)) / Var(f)  share of parameter i and its interactions

by the estimators of Saltelli (2010), as `scipy.stats.sobol_indices` has them.

**Fragility curves** are the share of ground motions that exceed a limit, over the intensity of the motion.

    P(exceeds | x) = Phi(ln(x / median) / dispersion)

Median and dispersion have the greatest binomial likelihood: J. W. Baker, Efficient analytical fragility function
fitting using dynamic structural analysis, Earthquake Spectra 31 (2015) 579. Their logarithms have the covariance
I^-1 S I^-1 with the Fisher information I and the covariance S of the score, which is I where each intensity has records
of its own. If the same ones are scaled, one that exceeds at an intensity exceeds at higher ones: counts are correlated.
"""

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from scipy import special

from hysim._basics.frozen import FloatArray, vectors
from hysim._basics.names import among
from hysim._basics.printing import csv_text, frozen_result, summary_text
from hysim.interop import dataset, frame
from hysim.sweeps._chunks import Column, Space, Table, saltelli, seeds
from hysim.sweeps._store import opened


@frozen_result
class Sweep:
    """A study as a table; ``result["name"]`` is a column of it.

    Parameters
    ----------
    parameters : mapping
        Name to values, shape (n,).
    outputs, arrays : mapping
        Name to the numbers that the tasks returned, shape (n,), and to arrays, shape (n, ...); nan where a task failed.
    task, seed, seconds : array, shape (n,)
        Places of the tasks in the study, increasing; their seeds; and their computing times [s], in a batch the mean.
    errors : mapping
        Place of a failed task to its message.
    n_tasks : int
        Number of tasks of the study, also of those without a row because it was interrupted.
    missing : array
        Places of the tasks of the study, or of the shard that was asked for, without a row.
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
    missing: npt.NDArray[np.int64]
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
        return frame(self.columns, index=("task", self.task))

    def to_xarray(self) -> Any:
        """The result as an `xarray.Dataset` along the axes of a grid or the tasks; ImportError without xarray.

        Further axes of an output `name` are called ``name_0``, ``name_1``; values are nan where there is no row.
        """
        columns = {**self.outputs, **self.arrays, "seed": self.seed, "seconds": self.seconds, "error": self.error}
        if self.axes is None:
            dims: tuple[str, ...] = ("task",)
            coordinates = {"task": self.task, **{name: ("task", column) for name, column in self.parameters.items()}}
        else:
            dims, coordinates = tuple(self.axes), dict(self.axes)
        axes = {name: (*dims, *(f"{name}_{k}" for k in range(v.ndim - 1))) for name, v in columns.items()}
        variables = {name: (axes[name], self._along_axes(values)) for name, values in columns.items()}
        return dataset(variables, coordinates, {})

    @property
    def ranges(self) -> dict[str, dict[str, float]]:
        """Lowest, median and highest value of each output, and not_finite, the number of values that are left out."""
        ranges = {}
        for name, values in self.outputs.items():
            if (finite := values[np.isfinite(values)]).size:
                lowest, median, highest = np.quantile(finite, [0.0, 0.5, 1.0]).tolist()
                extremes = {"lowest": lowest, "median": median, "highest": highest}
                ranges[name] = {**extremes, "not_finite": len(self) - finite.size}
        return ranges

    def summary(self) -> str:
        """Numbers of tasks that are done and that failed, the commonest errors, and the range of every output."""
        n = len(self)
        lines = [f"{n} of {self.n_tasks} tasks: {n - len(self.errors)} succeeded, {len(self.errors)} failed"]
        for message, number in Counter(self.errors.values()).most_common(5):
            lines.append(f"  {number} x {message}")
        for name, each in self.ranges.items():
            values = f"{each['lowest']:.4g} to {each['highest']:.4g}, median {each['median']:.4g}"
            lines.append(f"{name}: {values}, {each['not_finite']} not finite")
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
    """Read the rows in the `store` of a study by `sweep` that is finished, interrupted or still running.

    Raises OSError if the store cannot be read, and ValueError if the file is not a store.

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
        study, space = store.study, store.space()
        table = Table(study.n_tasks, space.columns)
        store.restore(table)
    task_seeds = seeds(int(study.identity["seed"]), np.flatnonzero(table.done))
    return result_of(table, space, task_seeds, np.arange(study.n_tasks))


def result_of(table: Table, space: Space, task_seeds: Column, asked: npt.NDArray[np.int64]) -> Sweep:
    """The rows of the tasks that are done, with the parameters and seeds of these or of all tasks."""
    places = np.flatnonzero(table.done)

    def done(column: Column) -> Column:
        part: Column = column if len(column) == places.size else column[places]
        part.setflags(write=False)
        return part

    places.setflags(write=False)
    for column in table.values.values():
        column[[*table.errors]] = np.nan
    values = {name: done(column) for name, column in table.values.items()}
    study: dict[str, Any] = {"n_tasks": table.done.size, "missing": asked[~table.done[asked]], "axes": space.axes}
    rows: dict[str, Any] = {"task": places, "seed": done(task_seeds), "seconds": done(table.seconds)}
    return Sweep(
        parameters={name: done(column) for name, column in space.columns.items()},
        outputs={name: column for name, column in values.items() if column.ndim == 1},
        arrays={name: column for name, column in values.items() if column.ndim > 1},
        errors=dict(sorted(table.errors.items())),
        **rows,
        **study,
    )


_RESAMPLES = 200


@frozen_result
class SobolIndices:
    """Sobol indices of the outputs of a study.

    Parameters
    ----------
    parameters : tuple of str
        Names of the d parameters.
    first_order, total_order : mapping
        Name of an output to the indices of the parameters, shape (d,).
    first_order_interval, total_order_interval : mapping
        Name of an output to the limits of the intervals at 95 %, shape (2, d), by the bootstrap.
    """

    parameters: tuple[str, ...]
    first_order: Mapping[str, FloatArray]
    total_order: Mapping[str, FloatArray]
    first_order_interval: Mapping[str, FloatArray]
    total_order_interval: Mapping[str, FloatArray]

    def __str__(self) -> str:
        size = f"{len(self.first_order)} outputs by {len(self.parameters)} parameters"
        return summary_text([f"SobolIndices: {size}", self.summary()])

    def summary(self) -> str:
        """The indices as a table."""
        width = max(len(name) for name in ("output", *self.parameters, *self.first_order)) + 2
        lines = ["output".ljust(width) + "parameter".ljust(width + 6) + "first order   total"]
        for output, first in self.first_order.items():
            for k, name in enumerate(self.parameters):
                total = self.total_order[output][k]
                lines.append(f"{output.ljust(width)}{name.ljust(width + 6)}{first[k]:11.3f} {total:7.3f}")
        return "\n".join(lines)


def sobol_indices(result: Sweep, *, seed: int = 0) -> SobolIndices:
    """Sobol indices of every output that is a number, of a study of a ``Sample(..., method="saltelli")``.

    Parameters
    ----------
    result, seed : Sweep, and int
        Result with every task of the sample, and seed of the bootstrap.

    Returns
    -------
    SobolIndices

    Raises
    ------
    ValueError
        If the sample is another one, a task is missing or failed, or an output is not finite or constant.

    Examples
    --------
    >>> import hysim as hs
    >>> def plane(a, b):
    ...     return {"y": 3.0 * a + 4.0 * b}
    >>> sample = hs.Sample(distributions={"a": (0.0, 1.0), "b": (0.0, 1.0)}, n=1024, method="saltelli")
    >>> indices = hs.sobol_indices(hs.sweep(plane, sample))
    >>> indices.parameters, indices.first_order["y"].round(2).tolist()
    (('a', 'b'), [0.36, 0.64])
    """
    d = len(result.parameters)
    n = result.n_tasks // (d + 2)
    _check(result, n)
    estimates, intervals = {}, {}
    rng = np.random.default_rng(seed)
    for name, values in result.outputs.items():
        if not np.isfinite(values).all() or np.ptp(values) == 0.0:
            raise ValueError(f"the output {name} must be finite and vary to have Sobol indices")
        parts = values.reshape(d + 2, n)
        estimates[name] = _estimates(parts)
        again = [_estimates(parts[:, rng.integers(n, size=n)]) for _ in range(_RESAMPLES)]
        intervals[name] = np.quantile(again, [0.025, 0.975], axis=0)
    return SobolIndices(
        parameters=tuple(result.parameters),
        first_order={name: indices[0] for name, indices in estimates.items()},
        total_order={name: indices[1] for name, indices in estimates.items()},
        first_order_interval={name: limits[:, 0] for name, limits in intervals.items()},
        total_order_interval={name: limits[:, 1] for name, limits in intervals.items()},
    )


def _check(result: Sweep, n: int) -> None:
    if len(result) < result.n_tasks or result.errors:
        words = f"{len(result)} are done, {len(result.errors)} failed"
        raise ValueError(f"Sobol indices need all {result.n_tasks} tasks: {words}")
    sets = np.column_stack([*result.parameters.values()])
    if n < 2 or not np.array_equal(sets, saltelli(sets[:n], sets[n : 2 * n])):
        raise ValueError('Sobol indices need the sample hs.Sample(..., method="saltelli"), of two points or more')
    if not result.outputs:
        raise ValueError("Sobol indices need an output that is a number")


def _estimates(parts: FloatArray) -> FloatArray:
    """First order and total, shape (2, d), from the outputs of A, B and AB, shape (d + 2, n)."""
    from scipy import stats

    f_a, f_b, *f_ab = parts[:, np.newaxis]
    with_idle_one = np.array([*f_ab, f_a])  # scipy needs at least two parameters
    indices = stats.sobol_indices(func={"f_A": f_a, "f_B": f_b, "f_AB": with_idle_one}, n=parts.shape[1])
    return np.array([indices.first_order, indices.total_order])[:, :-1]


_FLAT = 1e-6  # slope of a curve that does not rise, with rounding; by hand


@frozen_result
class Fragility:
    """Result of `hysim.fragility`: a lognormal fragility curve, and the counts that it is fitted to.

    Parameters
    ----------
    median, dispersion : float
        Intensity at which half of the records exceed the limit, and standard deviation of the logarithm of the
        intensity at which a record begins to exceed it.
    median_interval, dispersion_interval : array, shape (2,)
        Confidence limits of both.
    level : float
        Confidence of the intervals and of `band`.
    intensities, n_exceeding, n_records : array, shape (n,)
        Intensities, numbers of records above the limit, and numbers of records.
    covariance : array, shape (2, 2)
        Covariance of the logarithms of the median and of the dispersion.
    """

    median: float
    dispersion: float
    median_interval: FloatArray
    dispersion_interval: FloatArray
    level: float
    intensities: FloatArray
    n_exceeding: FloatArray
    n_records: FloatArray
    covariance: FloatArray

    def __str__(self) -> str:
        numbers = {name: (vars(self)[name], *vars(self)[f"{name}_interval"]) for name in ("median", "dispersion")}
        words = {name: f"{value:.3g} ({low:.3g} to {high:.3g})" for name, (value, low, high) in numbers.items()}
        return summary_text([f"Fragility: {self.intensities.size} intensities, {self.level:.0%} intervals"], words)

    def probability(self, intensities: npt.ArrayLike) -> FloatArray:
        """The curve at intensities, zero at zero and below."""
        eta = np.log(np.maximum(np.divide(intensities, self.median), 2.0**-1022)) / self.dispersion
        return np.asarray(special.ndtr(eta))

    def band(self, intensities: npt.ArrayLike) -> FloatArray:
        """Confidence limits of the curve, shape (2, n), at each of n intensities."""
        eta = np.log(np.maximum(np.divide(intensities, self.median), 2.0**-1022)) / self.dispersion
        slopes = np.array([np.full_like(eta, -1.0 / self.dispersion), -eta])
        error = special.ndtri(0.5 + 0.5 * self.level) * np.sqrt((slopes * (self.covariance @ slopes)).sum(axis=0))
        return np.asarray(special.ndtr([eta - error, eta + error]))


def fragility(
    intensities: npt.ArrayLike,
    n_exceeding: npt.ArrayLike,
    n_records: npt.ArrayLike,
    *,
    same_records: bool = False,
    level: float = 0.95,
) -> Fragility:
    """Fit a lognormal fragility curve to the numbers of records that exceed a limit.

    Parameters
    ----------
    intensities : array, shape (n,)
        Intensities of the ground motion, positive.
    n_exceeding, n_records : array, shape (n,), and int or array, shape (n,)
        Number of records whose response exceeds the limit, or that collapse, and of all records, at each intensity.
    same_records : bool
        Whether the same records are scaled to each intensity: then the counts are correlated, and the intervals wider.
    level : float
        Confidence of the intervals.

    Returns
    -------
    Fragility

    Raises
    ------
    ValueError
        If an argument is out of its range, or the counts determine no rising curve.

    Examples
    --------
    >>> import hysim as hs
    >>> print(hs.fragility([0.2, 0.4, 0.6, 0.8, 1.0], [0, 4, 11, 15, 19], 20))
    Fragility: 5 intensities, 95% intervals
      median      0.574 (0.505 to 0.652)
      dispersion  0.392 (0.274 to 0.561)
    """
    all_records = np.full(np.shape(intensities), n_records) if np.ndim(n_records) == 0 else n_records
    x, z, n = vectors(intensities=intensities, n_exceeding=n_exceeding, n_records=all_records)
    _check_counts(x, z, n, level, same_records)
    logs = np.log(x) - np.log(x).mean()
    rows = np.array([np.ones(x.size), logs / logs.std()])

    def loss(line: FloatArray) -> tuple[float, FloatArray]:
        below, above = special.log_ndtr([line @ rows, -line @ rows])
        slopes = _score(line @ rows) * (n * np.exp(below) - z)
        return -float(z @ below + (n - z) @ above) / n.sum(), rows @ slopes / n.sum()

    line = scipy.optimize.minimize(loss, [0.0, 1.0], jac=True, method="BFGS", options={"gtol": 1e-10}).x
    if line[1] <= _FLAT:
        raise ValueError("the share above the limit does not rise with the intensity: are the counts in its order?")
    dispersion = logs.std() / line[1]
    covariance = _covariance(line @ rows, n, dispersion, same_records)
    numbers = np.array([np.exp(np.log(x).mean() - line[0] * dispersion), dispersion])
    factors = np.exp(special.ndtri(0.5 + 0.5 * level) * np.sqrt(np.diag(covariance)))
    low_high = np.transpose([numbers / factors, numbers * factors])
    intervals = {"median_interval": low_high[0], "dispersion_interval": low_high[1]}
    curve = {"median": numbers[0], "dispersion": dispersion, "covariance": covariance, **intervals}
    return Fragility(**curve, level=level, intensities=x, n_exceeding=z, n_records=n)


def _score(eta: FloatArray) -> FloatArray:
    """Slope of the log likelihood of a count over its distance from the mean, phi / (Phi (1 - Phi))."""
    log_variance = special.log_ndtr([eta, -eta]).sum(axis=0)
    return np.asarray(np.exp(-0.5 * eta**2 - log_variance) / math.sqrt(2.0 * math.pi))


def _covariance(eta: FloatArray, n: FloatArray, dispersion: float, same_records: bool) -> FloatArray:
    """Covariance of the logarithms of the median and of the dispersion, shape (2, 2)."""
    below, above = special.ndtr([eta, -eta])
    directions = _score(eta) * np.array([np.full_like(eta, -1.0 / dispersion), -eta])
    inverse = np.linalg.inv(directions * (n * below * above) @ directions.T)
    counts = n * np.minimum.outer(below, below) * np.minimum.outer(above, above)
    return np.asarray(inverse @ directions @ counts @ directions.T @ inverse if same_records else inverse)


def _check_counts(x: FloatArray, z: FloatArray, n: FloatArray, level: float, same_records: bool) -> None:
    if (x <= 0.0).any() or np.unique(x).size < 2 or not 0.0 < level < 1.0:
        raise ValueError("intensities must be positive, at least two must differ, and level must be between 0 and 1")
    if (z % 1.0).any() or (n % 1.0).any() or (z < 0.0).any() or (z > n).any() or (n < 1.0).any():
        raise ValueError("n_exceeding must be whole numbers from 0 to n_records, which must be at least 1")
    if same_records and np.ptp(n) > 0.0:
        raise ValueError("the same records have one number at all intensities; leave same_records=False")
    if not z.any():
        raise ValueError("no record exceeds the limit at any intensity: go on to higher ones")
    if (z == n).all():
        raise ValueError("every record exceeds the limit at every intensity: begin at lower ones")
    if not x[z > 0.0].min() < x[z < n].max():
        words = f"no record exceeds the limit below the intensity {x[z > 0.0].min():g}, and all do above it"
        raise ValueError(f"the dispersion is not determined: {words}; take more intensities near it")
