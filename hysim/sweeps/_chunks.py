"""Chunks of tasks: how they are computed, the table of the rows that are done, and the seeds of tasks.

A chunk is computed task by task, or through their batch form; failures are kept as rows. The outputs of a task are kept
by their names. A worker does not know the names and shapes that the study has.

**Rows that are done.** The first task that succeeds, in the order of the study and not of time, sets the names and
shapes of a row. A task that returns others has failed.

**Seeds.** A task's seed follows from the study's seed and the task's place alone. Task k has that of
``numpy.random.SeedSequence(seed).spawn(n)[k]``,

    SeedSequence(seed, spawn_key=(k,)).generate_state(1, np.uint64) >> 1.

NumPy needs 10 us for each; here they are computed for all tasks at once by its algorithm, M. E. O'Neill's
``seed_seq_fe``, which NumPy keeps stable. One bit is dropped because SQL has no unsigned integers.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_whole
from hysim._basics.parallel import at_most
from hysim._basics.progress import silent
from hysim.sweeps._space import OWN_NAMES, Column

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


class Row(NamedTuple):
    """A finished task: its place, its time [s], why it failed, and its outputs, none if it failed."""

    place: int
    seconds: float
    error: str | None
    outputs: Mapping[str, float | FloatArray]


def computed(task: Task, chunk: Chunk) -> list[Row]:
    """The rows of a chunk; kernels inside use one thread."""
    with at_most(1), silent():
        return _together(task.batch, chunk) if isinstance(task, Batched) else _singly(task, chunk)


def _singly(task: Task, chunk: Chunk) -> list[Row]:
    rows, columns = [], [column.tolist() for column in chunk.columns.values()]
    for place, *arguments in zip(chunk.places.tolist(), *columns, strict=True):
        begin = time.perf_counter()
        try:
            arrays = _outputs(task(**dict(zip(chunk.columns, arguments, strict=True))))
            error, outputs = None, {name: array if array.ndim else array.item() for name, array in arrays.items()}
        except Exception as failure:
            error, outputs = _message(failure), {}
        rows.append(Row(place, time.perf_counter() - begin, error, outputs))
    return rows


def _together(batch: Task, chunk: Chunk) -> list[Row]:
    """The rows through the batch form; a chunk that fails is halved until each task that fails is alone."""
    begin, n = time.perf_counter(), chunk.places.size
    try:
        arrays = _outputs(batch(**chunk.columns))
        for name, array in arrays.items():
            if array.shape[:1] != (n,):
                raise ValueError(f"the batch form returned {name} of shape {array.shape} for {n} tasks")
    except Exception as error:
        if n > 1:
            return [row for half in (slice(n // 2), slice(n // 2, n)) for row in _together(batch, chunk.part(half))]
        return [Row(chunk.places.item(), time.perf_counter() - begin, _message(error), {})]
    seconds = (time.perf_counter() - begin) / n
    rows = zip(*(array if array.ndim > 1 else array.tolist() for array in arrays.values()), strict=True)
    places = zip(chunk.places.tolist(), rows, strict=True)
    return [Row(place, seconds, None, dict(zip(arrays, row, strict=True))) for place, row in places]


def _outputs(returned: Any) -> dict[str, FloatArray]:
    named = returned if isinstance(returned, Mapping) else {"value": returned}
    if not named or not all(isinstance(name, str) for name in named):
        raise TypeError(f"a task returns a number, an array, or a mapping of names to these, got {returned!r}")
    arrays = {name: np.asarray(value) for name, value in named.items()}
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            kind = type(named[name]).__name__
            raise TypeError(f"a task returns numbers and arrays of numbers, got {kind} for {name}")
    return {name: np.array(array, dtype=np.float64) for name, array in arrays.items()}  # it may use its arrays again


def _message(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


class Table:
    """Outputs of the tasks that are done, nan elsewhere, one column for each, shape (n_tasks, *shape)."""

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
            self.values[name] = np.full((self.done.size, *shape), np.nan)
        self.layout = layout

    def enter(self, rows: Iterable[Row]) -> list[Row]:
        """Enter rows in the order of the study, and return them; one with another layout is a task that failed."""
        entered = []
        for row in rows:
            layout = {name: () if type(value) is float else np.shape(value) for name, value in row.outputs.items()}
            if layout and not self.layout:
                self.begin(layout)
            if layout and layout != self.layout:
                first, other = _shown(self.layout), _shown(layout)
                error = f"ValueError: the task returned {other}, where the first that succeeded returned {first}"
                row = row._replace(error=error, outputs={})
            if row.error is not None:
                self.errors[row.place] = row.error
            for name, value in row.outputs.items():
                self.values[name][row.place] = value
            self.seconds[row.place], self.done[row.place] = row.seconds, True
            entered.append(row)
        return entered


def _shown(layout: Layout) -> str:
    return ", ".join(f"{name} of shape {shape}" if shape else f"the number {name}" for name, shape in layout.items())


_WORD = 0xFFFFFFFF


def seeds(seed: int | np.integer[Any], places: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Seeds of the tasks at these places, shape (n,); TypeError or ValueError unless `seed` is an integer from 0 on."""
    check_whole(int(seed) if isinstance(seed, np.integer) else seed, "seed", least=0)
    calls = 4 * max(4, -(-int(seed).bit_length() // 32))  # of the hash for the words of the seed, four of its pool
    pool = np.random.SeedSequence(int(seed)).pool.tolist()
    own = [_hashed(places.astype(np.uint64), 0x43B0D7E5, 0x931E8875, calls + k) for k in (0, 1)]
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
