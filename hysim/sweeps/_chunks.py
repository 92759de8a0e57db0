"""Chunks of tasks: how they are computed, the table of the rows that are done, and the seeds of tasks.

A chunk is computed task by task, or through their batch form; failures are kept as rows. The values of a chunk are
returned by their layout, the names and shapes of the tasks' outputs. A worker does not know that of the study.

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

from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import at_most
from hysim._basics.progress import silent
from hysim.sweeps._space import OWN_NAMES, Column

Task = Callable[..., Any]
Layout = tuple[tuple[str, tuple[int, ...]], ...]
"""Names and shapes of a task's outputs; a number has the shape ()."""


@runtime_checkable
class Batched(Protocol):
    """A task with a batch form, which takes and returns columns in place of single values."""

    batch: Task


class Chunk(NamedTuple):
    """Tasks that are sent together: places in the study, shape (n,), parameters, and seeds if the task takes one."""

    places: npt.NDArray[np.int64]
    columns: Mapping[str, Column]
    seeds: npt.NDArray[np.int64] | None


class Group(NamedTuple):
    """Outputs of the tasks at some places: `columns` in the order of the layout, each of shape (n, *shape)."""

    layout: Layout
    places: npt.NDArray[np.int64]
    columns: tuple[FloatArray, ...]


class Outcome(NamedTuple):
    """A finished chunk: values by layout, messages of failed tasks by place, and seconds of each, shape (n,)."""

    places: npt.NDArray[np.int64]
    groups: tuple[Group, ...]
    errors: Mapping[int, str]
    seconds: FloatArray


def computed(task: Task, chunk: Chunk) -> Outcome:
    """The outcome of a chunk; kernels inside use one thread."""
    with at_most(1), silent():
        return _together(task.batch, chunk) if isinstance(task, Batched) else _singly(task, chunk)


def _singly(task: Task, chunk: Chunk) -> Outcome:
    names = [*chunk.columns, *(() if chunk.seeds is None else ("seed",))]
    values = [column.tolist() for column in (*chunk.columns.values(), chunk.seeds) if column is not None]
    rows: dict[Layout, tuple[list[int], list[list[Any]]]] = {}
    errors, seconds, clock = {}, [], time.perf_counter
    for place, *arguments in zip(chunk.places.tolist(), *values, strict=True):
        begin = clock()
        try:
            layout, row = _row(task(**dict(zip(names, arguments, strict=True))))
        except Exception as error:
            errors[place] = _message(error)
        else:
            places, outputs = rows.setdefault(layout, ([], []))
            places.append(place)
            outputs.append(row)
        seconds.append(clock() - begin)
    groups = tuple(
        Group(layout, np.array(places), tuple(_plain(np.array(column)) for column in zip(*outputs, strict=True)))
        for layout, (places, outputs) in rows.items()
    )
    return Outcome(chunk.places, groups, errors, np.array(seconds))


def _together(batch: Task, chunk: Chunk) -> Outcome:
    """The outcome through the batch form; a chunk that fails is halved until each task that fails is alone."""
    begin, n = time.perf_counter(), chunk.places.size
    try:
        arguments = dict(chunk.columns) if chunk.seeds is None else {**chunk.columns, "seed": chunk.seeds}
        group = _group(chunk.places, batch(**arguments))
    except Exception as error:
        if n > 1:
            halves = (slice(None, n // 2), slice(n // 2, None))
            return _joined([_together(batch, part_of(chunk, half)) for half in halves])
        errors = {int(chunk.places[0]): _message(error)}
        return Outcome(chunk.places, (), errors, np.array([time.perf_counter() - begin]))
    return Outcome(chunk.places, (group,), {}, np.full(n, (time.perf_counter() - begin) / n))


def part_of(chunk: Chunk, part: Any) -> Chunk:
    columns = {name: values[part] for name, values in chunk.columns.items()}
    return Chunk(chunk.places[part], columns, None if chunk.seeds is None else chunk.seeds[part])


def _joined(parts: list[Outcome]) -> Outcome:
    return Outcome(
        np.concatenate([part.places for part in parts]),
        tuple(group for part in parts for group in part.groups),
        {place: message for part in parts for place, message in part.errors.items()},
        np.concatenate([part.seconds for part in parts]),
    )


def _row(returned: Any) -> tuple[Layout, list[Any]]:
    values = {name: value if type(value) is float else _numbers(name, value) for name, value in _named(returned)}
    layout = tuple((name, () if isinstance(value, float) else value.shape) for name, value in values.items())
    return layout, [*values.values()]


def _group(places: npt.NDArray[np.int64], returned: Any) -> Group:
    columns = {name: _plain(_numbers(name, values)) for name, values in _named(returned)}
    for name, column in columns.items():
        if column.shape[:1] != places.shape:
            raise ValueError(f"the batch form returned {name} of shape {column.shape} for {places.size} tasks")
    return Group(tuple((name, column.shape[1:]) for name, column in columns.items()), places, tuple(columns.values()))


def _named(returned: Any) -> list[tuple[str, Any]]:
    if not isinstance(returned, Mapping):
        return [("value", returned)]
    if not returned or not all(isinstance(name, str) for name in returned):
        raise TypeError(f"a task returns a number, an array, or a mapping of names to these, got {returned!r}")
    return list(returned.items())


def _numbers(name: str, value: Any) -> FloatArray:
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"a task returns numbers and arrays of numbers, got {type(value).__name__} for {name}")
    return np.array(array, dtype=np.float64)  # a copy: the task may use its array again


def _plain(column: FloatArray) -> FloatArray:
    """These values, every nan with the same bits."""
    return np.where(np.isnan(column), np.nan, column)


def _message(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


class Table:
    """Values of the tasks that are done, nan elsewhere, one column for each output, shape (n_tasks, *shape)."""

    def __init__(self, n_tasks: int, parameters: Iterable[str]) -> None:
        self.layout: Layout | None = None
        self.values: dict[str, FloatArray] = {}
        self.errors: dict[int, str] = {}
        self.seconds = np.full(n_tasks, np.nan)
        self.done = np.zeros(n_tasks, dtype=bool)
        self._other_names = (*OWN_NAMES, *parameters)

    def judge(self, outcome: Outcome) -> Outcome:
        """The outcome in the study's layout, with an error for each task whose values have another layout."""
        if self.layout is None and outcome.groups:
            self.begin(min(outcome.groups, key=lambda group: int(group.places.min())).layout)
        errors, groups = dict(outcome.errors), []
        for group in outcome.groups:
            if dict(group.layout) == dict(self.layout or ()):
                groups.append(self._in_order(group))
            else:
                errors |= dict.fromkeys(group.places.tolist(), self._mismatch(group.layout))
        return outcome._replace(groups=tuple(groups), errors=errors)

    def begin(self, layout: Layout) -> None:
        """Set the layout of the study; ValueError if an output has the name of another column."""
        for name, shape in layout:
            if name in self._other_names:
                raise ValueError(f"the task returned {name}, which is the name of another column: rename the output")
            self.values[name] = np.full((self.done.size, *shape), np.nan)
        self.layout = layout

    def restore(self, layout: Layout | None, outcome: Outcome) -> None:
        if layout:
            self.begin(layout)
        self.enter(outcome)

    def enter(self, outcome: Outcome) -> None:
        for group in outcome.groups:
            for (name, _), column in zip(group.layout, group.columns, strict=True):
                self.values[name][group.places] = column
        self.errors |= outcome.errors
        self.seconds[outcome.places] = outcome.seconds
        self.done[outcome.places] = True

    def _in_order(self, group: Group) -> Group:
        layout = self.layout or ()
        columns = dict(zip(dict(group.layout), group.columns, strict=True))
        return Group(layout, group.places, tuple(columns[name] for name, _ in layout))

    def _mismatch(self, layout: Layout) -> str:
        first = _shown(self.layout or ())
        return f"ValueError: the task returned {_shown(layout)}, where the first that succeeded returned {first}"


def _shown(layout: Layout) -> str:
    return ", ".join(f"{name} of shape {shape}" if shape else f"the number {name}" for name, shape in layout)


_POOL = 4  # words
_WORD = 0xFFFFFFFF
Words = Any
"""One word, an int or an array of uint64, below 2^32."""


def seeds(seed: int, places: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Seeds of the tasks at these places, shape (n,); TypeError or ValueError unless `seed` is an integer from 0 on."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
        raise TypeError(f"seed must be an integer, got {seed!r}")
    if seed < 0:
        raise ValueError(f"seed must be at least 0, got {seed}")
    low, high = _state(_pool([*_words(int(seed)), places.astype(np.uint64)]))
    return np.asarray((high << 32 | low) >> 1, dtype=np.int64)


def _words(seed: int) -> list[Words]:
    """Words of 32 bits, the lowest first, filled up to the pool."""
    words = [seed & _WORD]
    while seed := seed >> 32:
        words.append(seed & _WORD)
    return words + [0] * (_POOL - len(words))


def _pool(entropy: list[Words]) -> list[Words]:
    hashed = _Hash(0x43B0D7E5, 0x931E8875)
    pool = [hashed(word) for word in entropy[:_POOL]]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = _mixed(pool[target], hashed(pool[source]))
    for word in entropy[_POOL:]:
        pool = [_mixed(old, hashed(word)) for old in pool]
    return pool


def _state(pool: list[Words]) -> tuple[Words, Words]:
    hashed = _Hash(0x8B51F9DD, 0x58F38DED)
    return hashed(pool[0]), hashed(pool[1])


class _Hash:
    """Hash of one word after the other, by a constant that changes from word to word."""

    def __init__(self, start: int, factor: int) -> None:
        self.constant, self.factor = start, factor

    def __call__(self, word: Words) -> Words:
        word = word ^ self.constant
        self.constant = self.constant * self.factor & _WORD
        word = word * self.constant & _WORD
        return word ^ word >> 16


def _mixed(one: Words, other: Words) -> Words:
    word = (one * 0xCA01F9DD + (_WORD + 1) - (other * 0x4973F715 & _WORD)) & _WORD
    return word ^ word >> 16
