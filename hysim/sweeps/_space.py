"""The tasks of a study: a grid, a list, or a sample of distributions, as one column for each parameter."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, check_count, frozen

Column = npt.NDArray[Any]
"""Values of one parameter, shape (n_tasks,): float64, int64, bool or strings."""

Value = float | int | bool | str
OWN_NAMES = ("task", "seed", "seconds", "error")
"""Columns of the result that are no parameters."""

_DESIGNS = ("sobol", "latin_hypercube", "saltelli")


class Space(NamedTuple):
    """The parameters of a study, a value for each task, and for a grid the values along each axis, the last fastest."""

    columns: Mapping[str, Column]
    axes: Mapping[str, Column] | None

    @property
    def n_tasks(self) -> int:
        return len(next(iter(self.columns.values())))


@frozen
class Sample:
    """A space-filling sample of distributions, as the tasks of a study.

    Parameters
    ----------
    distributions : mapping
        Name of a parameter to its distribution: one of `scipy.stats` with its arguments, such as
        ``scipy.stats.norm(1.0, 0.1)``, or a pair ``(low, high)`` for a uniform one.
    n : int
        Number of tasks; a power of 2, except for a Latin hypercube. ``"saltelli"`` has n (d + 2) for d parameters.
    method : {"sobol", "latin_hypercube", "saltelli"}
        Scrambled Sobol sequence or Latin hypercube of `scipy.stats.qmc`; or the sample for `sobol_indices`.
    seed : int
        Seed of the sample. The tasks' own seeds come from the seed of `sweep`.

    Raises
    ------
    TypeError, ValueError
        If a distribution is neither a pair in order nor one of `scipy.stats`, there is none, or `n` does not suit the
        method.

    Examples
    --------
    >>> import hysim as hs
    >>> from scipy import stats
    >>> sample = hs.Sample(distributions={"beta": (0.2, 2.0), "n": stats.uniform(1.0, 1.0)}, n=64)
    >>> {name: values.shape for name, values in sample.draw().items()}
    {'beta': (64,), 'n': (64,)}
    """

    distributions: Mapping[str, Any]
    n: int
    method: Literal["sobol", "latin_hypercube", "saltelli"] = "sobol"
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.distributions:
            raise ValueError("a sample needs at least one distribution")
        check_count("n", self.n)
        check_choice("method", self.method, _DESIGNS)
        if self.method != "latin_hypercube" and self.n & (self.n - 1):
            above = 1 << self.n.bit_length()
            raise ValueError(f"a Sobol sequence has a power of 2 tasks, got n = {self.n}: take {above // 2} or {above}")
        for name, distribution in self.distributions.items():
            _quantiles(name, distribution)

    def draw(self) -> dict[str, FloatArray]:
        """The values of each parameter, shape (n_tasks,); ValueError if a distribution gives one that is not finite."""
        drawn = {}
        for (name, distribution), fractions in zip(self.distributions.items(), self._unit_cube().T, strict=True):
            drawn[name] = np.asarray(_quantiles(name, distribution)(fractions), dtype=float)
            if not np.isfinite(drawn[name]).all():
                raise ValueError(f"the distribution of {name} gave a value that is not finite")
        return drawn

    def _unit_cube(self) -> FloatArray:
        from scipy.stats import qmc

        rng, d = np.random.default_rng(self.seed), len(self.distributions)
        if self.method == "latin_hypercube":
            return np.asarray(qmc.LatinHypercube(d, rng=rng).random(self.n))
        if self.method == "sobol":
            return np.asarray(qmc.Sobol(d, rng=rng).random(self.n))
        return saltelli(*np.hsplit(qmc.Sobol(2 * d, rng=rng).random(self.n), 2))


def saltelli(a: FloatArray, b: FloatArray) -> FloatArray:
    """Samples A, B and AB_i for each parameter i, shape (n (d + 2), d), from the first two, shape (n, d)."""
    d = a.shape[1]
    return np.concatenate([a, b, *(np.where(np.arange(d) == k, b, a) for k in range(d))])


def space_of(space: Any) -> Space:
    """The tasks of a mapping (a grid), a list of mappings or a `Sample`; TypeError or ValueError for anything else."""
    axes = None
    if isinstance(space, Sample):
        columns: Mapping[str, Column] = space.draw()
    elif isinstance(space, Mapping):
        axes = _checked({name: _column(name, values) for name, values in space.items()})
        lengths = [len(values) for values in axes.values()]
        places = np.unravel_index(np.arange(math.prod(lengths)), lengths)
        columns = {name: values[place] for (name, values), place in zip(axes.items(), places, strict=True)}
    elif isinstance(space, Iterable) and not isinstance(space, str):
        columns = _listed(list(space))
    else:
        kind = type(space).__name__
        raise TypeError(f"a space is a mapping of names to values, a list of mappings or a hs.Sample, got {kind}")
    return Space(_checked(columns), axes)


def _quantiles(name: str, distribution: Any) -> Any:
    if isinstance(distribution, Sequence) and not isinstance(distribution, str) and len(distribution) == 2:
        low, high = (float(limit) for limit in distribution)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"the limits of {name} must be finite and in order, got ({low}, {high})")
        return lambda fractions: low + (high - low) * fractions
    with suppress(AttributeError):
        return distribution.ppf
    with suppress(AttributeError):
        return distribution.icdf
    raise TypeError(
        f"the distribution of {name} must be a pair (low, high) or one of scipy.stats with its arguments, "
        f"got {distribution!r}"
    )


def _column(name: str, values: Any) -> Column:
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TypeError(f"the values of {name} must be a sequence, got {values!r}: [{values!r}] for one value")
    plain = [value.item() if isinstance(value, np.generic) else value for value in values]
    kinds = {type(value) for value in plain}
    for kinds_of_column, dtype in (({bool}, bool), ({str}, str), ({int}, np.int64), ({int, float}, np.float64)):
        if kinds <= kinds_of_column:
            return np.array(plain, dtype=dtype)
    names = ", ".join(sorted(kind.__name__ for kind in kinds))
    raise TypeError(f"the values of {name} must be all numbers, all strings or all booleans, got {names}")


def _listed(tasks: list[Any]) -> dict[str, Column]:
    if not tasks:
        raise ValueError("there is no task in the list")
    for k, task in enumerate(tasks):
        if not isinstance(task, Mapping):
            raise TypeError(f"task {k} of the list must be a mapping of names to values, got {type(task).__name__}")
        if task.keys() != tasks[0].keys():
            raise ValueError(f"task {k} of the list has {', '.join(task)}, the first has {', '.join(tasks[0])}")
    return {name: _column(name, [task[name] for task in tasks]) for name in tasks[0]}


def _checked(columns: Mapping[str, Column]) -> dict[str, Column]:
    if not columns:
        raise ValueError("a space needs at least one parameter")
    for name, values in columns.items():
        if not isinstance(name, str) or name in OWN_NAMES:
            raise ValueError(f"a parameter cannot be called {name!r}: the result has a column of its own for it")
        if not len(values):
            raise ValueError(f"there is no value of {name}")
        if values.dtype.kind == "f" and np.isnan(values).any():
            raise ValueError(f"the values of {name} must be numbers, got nan")
        values.setflags(write=False)
    return dict(columns)
