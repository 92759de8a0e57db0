"""The tasks of a study and the chunks in which they are computed, the table of rows that are done, and seeds.

The tasks are a grid, a list, or a sample of distributions, as one column for each parameter.

A chunk is computed task by task, or through their batch form; failures are kept as rows. Tasks whose outputs have the
same names and shapes are kept together, as columns. A worker does not know the names and shapes that the study has.

**Rows that are done.** The first task that succeeds, in the order of the study and not of time, sets the names and
shapes of a row. A task that returns others has failed.

**Seeds.** A task's seed follows from the study's seed and the task's place alone. Task k has that of
``numpy.random.SeedSequence(seed).spawn(n)[k]``,

    SeedSequence(seed, spawn_key=(k,)).generate_state(1, np.uint64) >> 1.

NumPy needs 10 us for each; here they are computed for all tasks at once by its algorithm, M. E. O'Neill's
``seed_seq_fe``, which NumPy keeps stable. One bit is dropped because SQL has no unsigned integers.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, check_count, check_whole, frozen
from hysim._basics.parallel import at_most
from hysim._basics.progress import silent

Column = npt.NDArray[Any]
"""Values of one parameter, shape (n_tasks,): float64, int64, bool or strings."""

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

        sequence = qmc.LatinHypercube if self.method == "latin_hypercube" else qmc.Sobol
        n_samples = 2 if self.method == "saltelli" else 1
        points = sequence(n_samples * len(self.distributions), rng=np.random.default_rng(self.seed)).random(self.n)
        return saltelli(*np.hsplit(points, 2)) if self.method == "saltelli" else np.asarray(points)


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
    kinds = "a pair (low, high) or one of scipy.stats with its arguments"
    raise TypeError(f"the distribution of {name} must be {kinds}, got {distribution!r}")


def _column(name: str, values: Any) -> Column:
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TypeError(f"the values of {name} must be a sequence, got {values!r}: [{values!r}] for one value")
    plain = [value.item() if isinstance(value, np.generic) else value for value in values]
    kinds = {type(value) for value in plain}
    for kinds_of_column, dtype in (({bool}, bool), ({str}, str), ({int}, np.int64), ({int, float}, np.float64)):
        if kinds <= kinds_of_column:
            try:
                return np.array(plain, dtype=dtype)
            except OverflowError:
                raise ValueError(f"the values of {name} have an integer beyond 2^63: give floats, as 1e30") from None
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


Task = Callable[..., Any]
Layout = Mapping[str, tuple[int, ...]]
"""Shapes of a task's outputs by name; a number has the shape ()."""


@runtime_checkable
class Batched(Protocol):
    """A task with a batch form, which takes and returns columns in place of single values."""

    batch: Task


class Chunk(NamedTuple):
    """Tasks that are sent together: places in the study, shape (n,), and parameters, with seeds if the task has one."""

    places: npt.NDArray[np.int64]
    columns: Mapping[str, Column]

    def part(self, part: Any) -> "Chunk":
        return Chunk(self.places[part], {name: values[part] for name, values in self.columns.items()})


class Rows(NamedTuple):
    """Finished tasks: places and times [s], shape (n,), and outputs, shape (n, ...), or errors if they failed."""

    places: npt.NDArray[np.int64]
    seconds: FloatArray
    errors: Sequence[str]
    outputs: Mapping[str, FloatArray]


def computed(task: Task, chunk: Chunk) -> list[Rows]:
    """The rows of a chunk; kernels inside use one thread."""
    with at_most(1), silent():
        return _together(task.batch, chunk) if isinstance(task, Batched) else _singly(task, chunk)


def _singly(task: Task, chunk: Chunk) -> list[Rows]:
    groups: dict[Any, tuple[list[int], list[float], list[list[Any]]]] = {}  # by names and shapes, none if they failed
    errors: list[str] = []
    parameters = [column.tolist() for column in chunk.columns.values()]
    for place, *arguments in zip(chunk.places.tolist(), *parameters, strict=True):
        begin = time.perf_counter()
        try:
            outputs = _outputs(task(**dict(zip(chunk.columns, arguments, strict=True))))
        except Exception as error:
            outputs = {}
            errors.append(_message(error))
        row = [*outputs.values()]
        shapes = tuple([() if type(value) is float else value.shape for value in row])
        places, seconds, rows = groups.setdefault(((*outputs,), shapes), ([], [], []))
        places.append(place)
        rows.append(row)
        seconds.append(time.perf_counter() - begin)
    finished = []
    for (names, _), (places, seconds, rows) in groups.items():
        columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
        finished.append(Rows(np.array(places), np.array(seconds), [] if names else errors, columns))
    return finished


def _together(batch: Task, chunk: Chunk) -> list[Rows]:
    """The rows through the batch form; a chunk that fails is halved until each task that fails is alone."""
    begin, n = time.perf_counter(), chunk.places.size
    errors: list[str] = []
    try:
        outputs = _outputs(batch(**chunk.columns))
        for name, column in outputs.items():
            if np.shape(column)[:1] != (n,):
                raise ValueError(f"the batch form returned {name} of shape {np.shape(column)} for {n} tasks")
    except Exception as error:
        if n > 1:
            return [rows for half in (slice(n // 2), slice(n // 2, n)) for rows in _together(batch, chunk.part(half))]
        errors, outputs = [_message(error)], {}
    return [Rows(chunk.places, np.full(n, (time.perf_counter() - begin) / n), errors, outputs)]


def _outputs(returned: Any) -> dict[str, Any]:
    named = returned if isinstance(returned, Mapping) else {"value": returned}
    if not named or not all(isinstance(name, str) for name in named):
        raise TypeError(f"a task returns a number, an array, or a mapping of names to these, got {returned!r}")
    return {name: value if type(value) is float else _numbers(name, value) for name, value in named.items()}


def _numbers(name: str, value: Any) -> FloatArray:
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"a task returns numbers and arrays of numbers, got {type(value).__name__} for {name}")
    return np.array(array, dtype=np.float64)  # a copy: the task may use its array again


def _message(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


class Table:
    """Outputs of the tasks that are done, one column for each, shape (n_tasks, *shape).

    Rows that are not done take no memory: a shard of a large study is as small as its share.
    """

    def __init__(self, n_tasks: int, parameters: Iterable[str]) -> None:
        self.layout: Layout = {}  # empty until a task has succeeded
        self.values: dict[str, FloatArray] = {}
        self.errors: dict[int, str] = {}
        self.seconds = np.full(n_tasks, np.nan)
        self.done = np.zeros(n_tasks, dtype=bool)
        self._other_names = (*OWN_NAMES, *parameters)

    def begin(self, layout: Layout) -> None:
        """Set the layout of the study; ValueError if an output has the name of another column."""
        for name, shape in layout.items():
            if name in self._other_names:
                raise ValueError(f"the task returned {name}, which is the name of another column: rename the output")
            self.values[name] = np.zeros((self.done.size, *shape))
        self.layout = layout

    def enter(self, rows: Iterable[Rows]) -> list[Rows]:
        """Enter rows in the order of the study, and return them; those with another layout are tasks that failed."""
        entered = []
        for part in rows:
            layout = {name: column.shape[1:] for name, column in part.outputs.items()}
            if layout and not self.layout:
                self.begin(layout)
            if layout and layout != self.layout:
                first, other = shown(self.layout), shown(layout)
                error = f"ValueError: the task returned {other}, where the first that succeeded returned {first}"
                part = part._replace(errors=[error] * part.places.size, outputs={})
            if part.errors:
                self.errors |= zip(part.places.tolist(), part.errors, strict=True)
            # every nan has the same bits, as it has when it is read from a store
            outputs = {name: np.where(np.isnan(c), np.nan, c) for name, c in part.outputs.items()}
            for name, column in outputs.items():
                self.values[name][part.places] = column
            self.seconds[part.places], self.done[part.places] = part.seconds, True
            entered.append(part._replace(outputs=outputs))
        return entered

    def rows(self, which: npt.NDArray[np.bool_]) -> list[Rows]:
        """The rows of these tasks, which are done: those that succeeded, and those that failed."""
        failed = np.array([*self.errors], dtype=np.int64)
        failed, fine = failed[which[failed]], np.setdiff1d(np.flatnonzero(which), failed)
        outputs = {name: column[fine] for name, column in self.values.items()}
        errors = [self.errors[k] for k in failed.tolist()]
        groups = Rows(fine, self.seconds[fine], [], outputs), Rows(failed, self.seconds[failed], errors, {})
        return [each for each in groups if each.places.size]


def shown(layout: Layout) -> str:
    """A layout in words."""
    return ", ".join(f"{name} of shape {shape}" if shape else f"the number {name}" for name, shape in layout.items())


_WORD = 0xFFFFFFFF
_BLOCK = 50_000  # seeds at a time, so that the memory of a long study is that of its columns


def seeds(seed: int | np.integer[Any], places: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Seeds of the tasks at these places, shape (n,); TypeError or ValueError unless `seed` is an integer from 0 on."""
    check_whole(int(seed) if isinstance(seed, np.integer) else seed, "seed", least=0)
    calls = 4 * max(4, -(-int(seed).bit_length() // 32))  # of the hash for the words of the seed, four of its pool
    pool = np.random.SeedSequence(int(seed)).pool.tolist()
    blocks = np.array_split(places.astype(np.uint64), 1 + places.size // _BLOCK)
    return np.concatenate([_seeds(pool, block, calls) for block in blocks])


def _seeds(pool: list[int], places: npt.NDArray[np.uint64], calls: int) -> npt.NDArray[np.int64]:
    own = [_hashed(places, 0x43B0D7E5, 0x931E8875, calls + k) for k in (0, 1)]
    low, high = (_hashed(_mixed(pool[k], own[k]), 0x8B51F9DD, 0x58F38DED, k) for k in (0, 1))
    return np.asarray((high << 32 | low) >> 1, dtype=np.int64)


def _hashed(word: Any, start: int, factor: int, calls: int) -> Any:
    """Hash of words below 2^32; its constant is multiplied by `factor` in every call, and `calls` came before."""
    constant = start * pow(factor, calls, _WORD + 1) & _WORD
    word = (word ^ constant) * (constant * factor & _WORD) & _WORD
    return word ^ word >> 16


def _mixed(one: Any, other: Any) -> Any:
    word = ((one * 0xCA01F9DD & _WORD) + (_WORD + 1) - (other * 0x4973F715 & _WORD)) & _WORD
    return word ^ word >> 16
