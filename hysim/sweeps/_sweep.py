"""The verb `sweep`: one function over many parameters, on threads, processes or a cluster, and resumable.

Tasks are sent in chunks. The first chunk is one task; chunks grow at most fourfold, until one takes `_CHUNK`, so that
sending, about a millisecond, costs little; at the end they shrink so that all workers end together. Finished chunks are
written before they are reported. No result depends on the division into chunks.

**Workers** are threads, processes, the user's executor, or a dask cluster. Of an executor only `submit` is used, as
`concurrent.futures.Executor` defines it.

**The identity** of a study is the source of the task, the parameters of the tasks, the seed, and the version of hysim.
"""

import dataclasses
import hashlib
import inspect
import pickle
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hysim._basics.frozen import check_choice, check_count, last_names
from hysim._basics.libraries import is_installed
from hysim._basics.parallel import GLANCE, cores, processes, threads
from hysim._basics.progress import Line, Progress, Reports, reports
from hysim._release import __version__
from hysim.sweeps._chunks import Chunk, Rows, Table, Task, computed, seeds
from hysim.sweeps._result import Sweep, result_of
from hysim.sweeps._space import Space, space_of
from hysim.sweeps._store import ON_CHANGE, OnChange, Store, opened

_task_of_process: list[Task] = []  # the task of the study that this process was started for


@runtime_checkable
class _Submits(Protocol):
    def submit(self, function: Task, /, *arguments: Any) -> Future[Any]: ...


@runtime_checkable
class _DaskClient(Protocol):
    def get_executor(self) -> _Submits: ...

    def nthreads(self) -> dict[str, int]: ...


class Workers(NamedTuple):
    """A function that sends a chunk out, and the number of chunks that are computed at a time."""

    submit: Callable[[Chunk], Future[list[Rows]]]
    number: Callable[[], int]


@contextmanager
def workers_of(executor: Any, number: int | None, task: Task) -> Iterator[Workers]:
    """The workers that the argument `executor` of `sweep` stands for; own threads and processes end with the block."""
    if number is not None:
        check_count("workers", number)
    size: Callable[[], int] = cores
    work: tuple[Any, ...] = computed, task
    if executor in (None, "threads"):
        pool: Any = threads(number or cores())
    elif executor == "processes":
        pool, work = processes(number or cores(), _begin, task), (_computed_here,)
    elif isinstance(executor, _DaskClient):
        pool, size = nullcontext(executor.get_executor()), lambda: max(1, sum(executor.nthreads().values()))
    elif isinstance(executor, _Submits):
        is_pool = isinstance(executor, (ThreadPoolExecutor, ProcessPoolExecutor))
        pool, size = nullcontext(executor), (lambda: vars(executor)["_max_workers"]) if is_pool else cores
    else:
        words = 'executor must be "threads", "processes", a dask client, or have the method submit of an Executor'
        raise (ValueError if isinstance(executor, str) else TypeError)(f"{words}, got {executor!r}")
    with pool as opened_pool:
        yield Workers(partial(opened_pool.submit, *work), lambda: number or size())


def _begin(task: Task) -> None:
    _task_of_process[:] = [task]


def _computed_here(chunk: Chunk) -> list[Rows]:
    return computed(_task_of_process[0], chunk)


_PLAIN = (str, bytes, int, float, complex, type(None), type(...), np.generic)


def identity(task: Callable[..., Any], space: Space, seed: int) -> dict[str, str]:
    """The facts that must not change between two calls that share a store, as short texts."""
    names = ", ".join(space.columns)
    return {
        "task": _digest(inspect.unwrap(task)),
        "space": f"{space.n_tasks} tasks of {names} ({_digest(dict(space.columns))})",
        "seed": str(seed),
        "hysim": __version__,
    }


def _digest(value: Any) -> str:
    digest = hashlib.sha256()
    for part in _parts(value, ()):
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:16]


_MEMBERS: dict[Any, Callable[[Any], list[Any]]] = {
    list | tuple: list,
    Mapping: lambda value: [each for name in sorted(value, key=repr) for each in (name, value[name])],
    set | frozenset: lambda value: sorted(value, key=repr),
    np.ndarray: lambda value: [value.shape, *value.ravel().tolist()],
    partial: lambda value: [value.func, value.args, value.keywords],
    MethodType: lambda value: [value.__func__, value.__self__],
    CodeType: lambda value: [value.co_code, value.co_names, value.co_varnames, value.co_consts],
}
"""The parts of a value in a fixed order, by its type."""


def _parts(value: Any, above: tuple[Any, ...]) -> Iterator[bytes]:
    """The content of a value in bytes that are the same in every process; `above` are the functions that hold it."""
    members = next((members for kind, members in _MEMBERS.items() if isinstance(value, kind)), None)
    if isinstance(value, (FunctionType, CodeType)) and any(value is one for one in above):
        yield b"itself"
    elif isinstance(value, FunctionType):
        yield from _function_parts(value, (*above, value))
    elif isinstance(value, np.ndarray) and value.dtype != object:
        yield from (str(value.dtype).encode(), str(value.shape).encode(), np.ascontiguousarray(value).tobytes())
    elif isinstance(value, _PLAIN):
        yield repr(value).encode()
    elif isinstance(value, (type, ModuleType)):
        yield f"{value.__module__ if isinstance(value, type) else ''}.{value.__name__}".encode()
    elif members is not None or dataclasses.is_dataclass(value):
        parts = members(value) if members is not None else _fields(value)
        yield str(len(parts)).encode()
        for part in parts:
            yield from _parts(part, above)
    else:
        yield from (repr(type(value)).encode(), _pickled(value))


def _fields(value: Any) -> list[Any]:
    # a user's dataclass may have slots, so that `vars` would fail
    values = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    last = last_names(type(value))
    return [type(value), *(each for name, each in values.items() if each is not None or name not in last)]


def _function_parts(function: FunctionType, above: tuple[Any, ...]) -> Iterator[bytes]:
    """The source, or the compiled code where no file holds it, and the values bound to the function."""
    try:
        yield inspect.getsource(function).encode()
    except (OSError, TypeError):
        yield from _parts(function.__code__, above)
    bound = inspect.getclosurevars(function).nonlocals
    batch = vars(function).get("batch")
    yield from _parts([function.__defaults__, function.__kwdefaults__, bound, batch], above)


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception as error:
        raise TypeError(f"with a store a task is a function, or something that can be pickled: {error}") from error


_CHUNK, _SHORTEST = 0.075, 0.002  # seconds
_WITH_ARRAYS = 0.5  # seconds; a shard for each
_MOST_A_SECOND = 500  # chunks: a scheduler takes a millisecond for each
_GROWTH = 4
_PATIENCE = 0.6  # seconds to wait after an interrupt for the chunks that are being computed


@reports
def sweep(
    task: Callable[..., Any],
    space: Any,
    *,
    executor: Any = None,
    workers: int | None = None,
    store: str | Path | None = None,
    seed: int = 0,
    on_change: OnChange = "error",
    progress: Reports = None,
) -> Sweep:
    """Compute a function for many sets of parameters.

    Parameters
    ----------
    task : callable
        Takes the parameters by name, and an argument ``seed`` if it has one. Returns a number, an array, or a
        mapping of names to these, in every call of the same shapes. Its attribute ``batch``, if there is one, takes
        columns, shape (n,), in place of numbers, also of ``seed``, and returns columns, shape (n, ...).
    space : mapping, list of mappings or Sample
        Names to sequences of values, of which all combinations are computed, the last name changing fastest; or
        one mapping of names to values for each task; or a sample of distributions.
    executor : {"threads", "processes"}, Executor or dask client, optional
        Threads by default; or any `concurrent.futures.Executor` or `distributed.Client`.
    workers : int, optional
        Number of threads or processes, by default one for each core; for an executor of unknown size, the number of
        chunks that it computes at a time.
    store : path, optional
        File for the finished rows. A second call with the same study computes only the missing ones.
    seed : int
        Seed of the study. Task k gets its own seed from this one and k: an integer for `numpy.random.default_rng`.
    on_change : {"error", "keep", "restart"}
        If the store holds a study with another task, space, seed or version of hysim: raise; keep the finished rows if
        space and seed are the same; or start again.
    progress : callable or False, optional
        Called as ``progress(done, total)`` when rows are finished and written; see `hysim.simulate`.

    Returns
    -------
    Sweep
        The same bits with every executor, apart from the seconds. The row of a task that raises, or returns other names
        or shapes than the first that succeeded, holds its error.

    Raises
    ------
    TypeError, ValueError
        If the task does not take the parameters, an argument is wrong, or the store holds another study.
    OSError
        If the store is locked, read-only or full, or the executor fails. Reported rows are not lost.

    Examples
    --------
    >>> import hysim as hs
    >>> def width(beta, n):
    ...     u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    ...     return {"width": hs.loop_metrics(u, hs.BoucWen(beta=beta, n=n).response(u)).max_width}
    >>> result = hs.sweep(width, {"beta": [0.2, 0.5], "n": [1.0, 1.5, 2.0]})
    >>> result["width"].round(3).tolist()
    [0.337, 0.299, 0.264, 0.509, 0.442, 0.378]
    """
    check_choice("on_change", on_change, ON_CHANGE)
    if isinstance(progress, Line) and not is_installed("pandas"):
        progress.warn("pandas is not installed: the result has no to_frame (pip install 'hysim[tables]')")
    tasks = space_of(space)
    task_seeds = seeds(seed, np.arange(tasks.n_tasks))
    columns = {**tasks.columns, "seed": task_seeds} if _takes_seed(task, tasks) else tasks.columns
    table = Table(tasks.n_tasks, tasks.columns)
    with nullcontext() if store is None else opened(store) as opened_store:
        if opened_store is not None:
            opened_store.begin(identity(task, tasks, seed), tasks, task_seeds, on_change)
            opened_store.restore(table)
        remaining = Chunk(np.arange(tasks.n_tasks), columns).part(~table.done)
        with workers_of(executor, workers, task) as pool:
            _Run(remaining, table, opened_store, pool, progress or None).run()
    return result_of(table, tasks, task_seeds)


def _takes_seed(task: Callable[..., Any], space: Space) -> bool:
    """Whether the task has an argument for its seed; TypeError if it does not take the parameters."""
    if not callable(task):
        raise TypeError(f"a task must be a function, got {task!r}")
    signature = inspect.signature(task)
    takes_seed = "seed" in signature.parameters
    try:
        signature.bind(**dict.fromkeys([*space.columns, *(["seed"] if takes_seed else [])]))
    except TypeError as error:
        name = task.__name__ if isinstance(task, FunctionType) else repr(task)
        raise TypeError(f"{name}{signature} does not take the parameters {', '.join(space.columns)}: {error}") from None
    return takes_seed


class _Run:
    """One run of a study: the tasks that remain, the chunks that are being computed, and the rows that are done."""

    def __init__(
        self, remaining: Chunk, table: Table, store: Store | None, workers: Workers, progress: Progress | None
    ) -> None:
        self.remaining, self.table, self.store, self.workers = remaining, table, store, workers
        self.progress = progress or (lambda done, total: None)
        self.running: dict[Future[list[Rows]], int] = {}  # numbers of tasks
        self.sent, self.largest, self.seconds_a_task = 0, 0, 0.0

    def run(self) -> None:
        self.progress(*self._done())
        try:
            while self.sent < self.remaining.places.size or self.running:
                self._fill_queues()
                self._wait()
                self._settle()
        except BaseException as error:
            for future in [*self.running]:
                if future.cancel():
                    del self.running[future]
            if isinstance(error, KeyboardInterrupt):
                wait(self.running, timeout=_PATIENCE)
                self._settle()
            raise

    def _done(self) -> tuple[int, int]:
        return int(self.table.done.sum()), self.table.done.size

    def _fill_queues(self) -> None:
        total, number = self.remaining.places.size, self.workers.number()
        while self.sent < total and len(self.running) < 2 * number + 1:
            stop = self.sent + self._size(total - self.sent, number)
            try:
                future = self.workers.submit(self.remaining.part(slice(self.sent, stop)))
            except Exception as error:  # a broken pool raises here or in the future
                future = Future()
                future.set_exception(error)
            self.running[future], self.sent = stop - self.sent, stop

    def _size(self, remaining: int, number: int) -> int:
        if not self.largest:
            return 1
        has_arrays = any(self.table.layout.values())
        target = max(_WITH_ARRAYS if has_arrays and self.store else _CHUNK, number / _MOST_A_SECOND)
        cost = max(self.seconds_a_task, 1e-9)
        share = max(remaining / (2 * number), _SHORTEST / cost)
        return max(1, min(remaining, int(min(target / cost, share, _GROWTH * self.largest))))

    def _wait(self) -> None:
        """Wait until a chunk can be settled: before the layout is known, the first one."""
        futures = [*self.running] if self.table.layout else [next(iter(self.running))]
        while not any(future.done() for future in futures):
            wait(futures, timeout=GLANCE, return_when=FIRST_COMPLETED)  # and check for an interrupt

    def _settle(self) -> None:
        """Enter, write and report finished chunks, in the order of the tasks until the layout is known."""
        rows: list[Rows] = []
        settled, lost = list[Future[list[Rows]]](), None
        for future in self.running:
            is_done = future.done()
            if is_done and not future.cancelled() and future.exception() is None:
                rows += self.table.enter(future.result())
                settled.append(future)
                continue
            lost = future if is_done else lost
            if not self.table.layout:
                break
        if rows:
            if self.store is not None:
                self.store.commit(rows, self.table.layout)
            cost = float(np.concatenate([part.seconds for part in rows]).mean())
            self.seconds_a_task = 0.5 * (self.seconds_a_task + cost) if self.largest else cost
            self.largest = max(self.largest, *(self.running.pop(future) for future in settled))
            self.progress(*self._done())
        if lost is not None:
            error = CancelledError("it was cancelled") if lost.cancelled() else lost.exception()
            done, total = self._done()
            raise OSError(
                f"the executor lost a chunk of {self.running[lost]} tasks: {type(error).__name__}: {error}. "
                f"{done} of {total} tasks are done"
            ) from error
