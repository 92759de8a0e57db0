"""Computation of a chunk: some tasks one after the other, or through their batch form, with failures kept as rows.

The values of a chunk are returned by their layout, the names and shapes of the tasks' outputs. A worker does not know
which layout is that of the study.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim._parallel import at_most
from hysim._progress import silent
from hysim.sweeps._space import Column

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
    """Some of the tasks of a chunk, by a slice or by numbers."""
    columns = {name: values[part] for name, values in chunk.columns.items()}
    return Chunk(chunk.places[part], columns, None if chunk.seeds is None else chunk.seeds[part])


def _joined(parts: list[Outcome]) -> Outcome:
    groups: dict[Layout, list[Group]] = {}
    for part in parts:
        for group in part.groups:
            groups.setdefault(group.layout, []).append(group)
    return Outcome(
        np.concatenate([part.places for part in parts]),
        tuple(
            Group(
                layout,
                np.concatenate([each.places for each in same]),
                tuple(np.concatenate(columns) for columns in zip(*(each.columns for each in same), strict=True)),
            )
            for layout, same in groups.items()
        ),
        {place: message for part in parts for place, message in part.errors.items()},
        np.concatenate([part.seconds for part in parts]),
    )


def _row(returned: Any) -> tuple[Layout, list[Any]]:
    """Layout and values of what one task returned."""
    if type(returned) is float:
        return (("value", ()),), [returned]
    layout: list[tuple[str, tuple[int, ...]]] = []
    values: list[Any] = []
    for name, value in _named(returned):
        if type(value) is float:
            layout.append((name, ()))
            values.append(value)
        else:
            number = _numbers(name, value)
            layout.append((name, number.shape))
            values.append(number)
    return tuple(layout), values


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
