"""The verb `sweep`: one function over many parameters, on threads, processes or a cluster, and resumable.

Tasks are sent in chunks. The first chunk is one task; chunks grow at most fourfold, until one takes `_CHUNK`, or on a
cluster `_OF_A_CLUSTER`, so that sending, about a millisecond, costs little; at the end they shrink so that all workers
end together. Where the process that sends them would be busy for more than `_BUSY` of the time, they take longer.
Finished chunks are written before they are reported. No result depends on the division into chunks.

**Shards** are shares of a study that know nothing of each other. A store holds the rows of any tasks of its study, so
that the store of a shard is one like all others, and stores are merged by entering their rows.

**Workers** are threads, processes, the user's executor, or a dask cluster. Of an executor only `submit` is used, as
`concurrent.futures.Executor` defines it.

**The identity** of a study is the source of the task, the parameters of the tasks, the seed, and the version of hysim.
"""

import inspect
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType, MethodType
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import check_choice, check_count, check_not_negative, check_whole
from hysim._basics.libraries import is_installed
from hysim._basics.parallel import GLANCE, cores, processes, threads
from hysim._basics.progress import Line, Progress, Reports, reports
from hysim._basics.release import __version__
from hysim.sweeps._chunks import Chunk, Rows, Space, Table, Task, computed, seeds, shown, space_of
from hysim.sweeps._result import Sweep, result_of
from hysim.sweeps._store import ON_CHANGE, OnChange, Store, opened

_CHUNK, _OF_A_CLUSTER, _SHORTEST = 0.25, 1.0, 0.002  # seconds
_MOST_A_SECOND = 500  # chunks: a scheduler takes a millisecond for each
_BUSY, _LONGEST = 0.2, 5.0  # of the time at most, for sending chunks and entering rows; seconds of a chunk for it
_NEEDLESS, _WORTH_IT = 0.5, 60.0  # of the time for sending, where more workers would wait; seconds of a study to divide
_GROWTH, _MOST_TASKS = 4, 8_000  # of a chunk, whose rows a store takes as Python's numbers
_PATIENCE = 0.6  # seconds to wait after an interrupt for the chunks that are being computed

_task_of_process: list[Task] = []  # the task of the study that this process was started for


@runtime_checkable
class _Submits(Protocol):
    def submit(self, function: Task, /, *arguments: Any) -> Future[Any]: ...


@runtime_checkable
class _DaskClient(Protocol):
    def get_executor(self) -> _Submits: ...

    def nthreads(self) -> dict[str, int]: ...


class Workers(NamedTuple):
    """How a chunk is sent out, how many are computed at a time, and seconds that this process spends and a chunk takes.

    Where workers are threads of this process, or may be, the seconds are those of the thread that sends.
    """

    submit: Callable[[Chunk], Future[list[Rows]]]
    number: Callable[[], int]
    clock: Callable[[], float]
    chunk: float


@contextmanager
def workers_of(executor: Any, number: int | None, task: Task) -> Iterator[Workers]:
    """The workers that the argument `executor` of `sweep` stands for; own threads and processes end with the block."""
    if number is not None:
        check_count("workers", number)
    size: Callable[[], int] = cores
    clock, chunk = time.thread_time, _CHUNK
    work: tuple[Any, ...] = computed, task
    if executor in (None, "threads"):
        pool: Any = threads(number or cores())
    elif executor == "processes":
        pool, work = processes(number or cores(), _begin, task), (_computed_here,)
    elif isinstance(executor, _DaskClient):
        pool, size = nullcontext(executor.get_executor()), lambda: max(1, sum(executor.nthreads().values()))
        clock, chunk = time.process_time, _OF_A_CLUSTER
    elif isinstance(executor, _Submits):
        is_pool = isinstance(executor, (ThreadPoolExecutor, ProcessPoolExecutor))
        pool, size = nullcontext(executor), (lambda: vars(executor)["_max_workers"]) if is_pool else cores
        chunk = _CHUNK if is_pool else _OF_A_CLUSTER
    else:
        words = 'executor must be "threads", "processes", a dask client, or have the method submit of an Executor'
        raise (ValueError if isinstance(executor, str) else TypeError)(f"{words}, got {executor!r}")
    with pool as opened_pool:
        yield Workers(partial(opened_pool.submit, *work), lambda: number or size(), clock, chunk)


def _begin(task: Task) -> None:
    _task_of_process[:] = [task]


def _computed_here(chunk: Chunk) -> list[Rows]:
    return computed(_task_of_process[0], chunk)


def identity(task: Callable[..., Any], space: Space, seed: int) -> dict[str, str]:
    """The facts that must not change between two calls that share a store, as short texts."""
    content = _digest(_content(inspect.unwrap(task), ()))
    tasks = f"{space.n_tasks} tasks of {', '.join(space.columns)} ({_digest(dict(space.columns))})"
    return {"task": content, "space": tasks, "seed": str(seed), "hysim": __version__}


def _digest(value: Any) -> str:
    import joblib

    try:
        return str(joblib.hash(value))[:16]
    except Exception as error:
        raise TypeError(f"with a store a task is a function, or something that can be pickled: {error}") from error


def _content(value: Any, above: tuple[Any, ...]) -> Any:
    """A function's source, or its code if no file holds it, and what is bound to it; `above` are those it is in."""
    if isinstance(value, frozenset):
        return {*value}  # joblib sorts sets alone
    if isinstance(value, partial):
        return [_content(value.func, above), value.args, value.keywords]
    if isinstance(value, MethodType):
        return [_content(value.__func__, above), value.__self__]
    if isinstance(value, CodeType):
        return [value.co_code, value.co_names, value.co_varnames, [_content(each, above) for each in value.co_consts]]
    if not isinstance(value, FunctionType) or value in above:
        return value.__name__ if isinstance(value, FunctionType) else value
    try:
        source: Any = inspect.getsource(value)
    except (OSError, TypeError):
        source = _content(value.__code__, above)
    bound = {**inspect.getclosurevars(value).nonlocals, "(batch)": vars(value).get("batch")}
    contents = {name: _content(each, (*above, value)) for name, each in bound.items()}
    return [source, value.__defaults__, value.__kwdefaults__, contents]


@reports
def sweep(
    task: Callable[..., Any],
    space: Any,
    *,
    executor: Any = None,
    workers: int | None = None,
    store: str | Path | None = None,
    shard: tuple[int, int] | None = None,
    merge: Iterable[str | Path] = (),
    time_limit: float | None = None,
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
    shard : (int, int), optional
        ``(k, n)`` for share k of n shares of equal size, from 0 to n - 1, in the order of the tasks: the others are not
        computed. Shards run without each other, each with a store of its own.
    merge : sequence of paths, optional
        Stores of this study, such as those of its shards, whose rows are entered before the rest is computed.
    time_limit : float, optional
        Seconds after which no chunk should run: none is begun that would end later. The result lacks the tasks that
        are left; with a limit of 0 nothing is computed.
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
        If the task does not take the parameters, an argument is wrong, a store holds another study, or stores that are
        merged contradict each other.
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
    check_not_negative(time_limit=time_limit)
    if isinstance(progress, Line) and not is_installed("pandas"):
        progress.warn("pandas is not installed: the result has no to_frame (pip install 'hysim[tables]')")
    tasks = space_of(space)
    own, task_seeds, stores = _share(shard, tasks.n_tasks), seeds(seed, np.arange(tasks.n_tasks)), [*merge]
    columns = {**tasks.columns, "seed": task_seeds} if _takes_seed(task, tasks) else tasks.columns
    table, facts = Table(tasks.n_tasks, tasks.columns), identity(task, tasks, seed) if store or stores else {}
    with nullcontext() if store is None else opened(store) as opened_store:
        if opened_store is not None:
            opened_store.begin(facts, tasks, task_seeds, on_change)
            opened_store.restore(table)
        for path in stores:
            rows = _merged(path, table, facts, on_change)
            if rows and opened_store is not None:
                opened_store.commit(rows, table.layout)
        with workers_of(executor, workers, task) as pool:
            report = progress or (lambda done, total: None)
            _Run(Chunk(own, columns), table, opened_store, pool, report, time_limit).run()
    return result_of(table, tasks, task_seeds, own)


def _share(shard: tuple[int, int] | None, n_tasks: int) -> npt.NDArray[np.int64]:
    if shard is not None and not (isinstance(shard, Sequence) and len(shard) == 2):
        raise TypeError(f"shard must be a pair (k, n), such as (3, 100), got {shard!r}")
    k, n = shard or (0, 1)
    check_count("the number of shards", n)
    check_whole(k, "the shard", least=0)
    if k >= n:
        raise ValueError(f"shards are counted from 0: of {n} the last is {n - 1}, got {k}")
    return np.arange(k * n_tasks // n, (k + 1) * n_tasks // n)


def _merged(path: str | Path, table: Table, facts: Mapping[str, str], on_change: OnChange) -> list[Rows]:
    """Enter the rows of a store that the table has not; ValueError where they contradict it."""
    with opened(path, to_read=True) as store:
        if changes := store.changes(facts, on_change):
            raise ValueError(f"{path} holds another study: {'; '.join(changes.values())}; leave it out")
        other = Table(table.done.size, store.study.parameters)
        store.restore(other)
    if other.layout and table.layout and other.layout != table.layout:
        raise ValueError(f"{path}: its tasks returned {shown(other.layout)}, those before {shown(table.layout)}")
    both = other.done & table.done
    apart = {k for k in other.errors.keys() ^ table.errors.keys() if both[k]}
    for name in other.values.keys() & table.values.keys():
        one, same = other.values[name], table.values[name]
        differ = ~((one == same) | (np.isnan(one) & np.isnan(same))).all(axis=(*range(1, one.ndim),))
        apart.update(np.flatnonzero(both & differ).tolist())
    if apart:
        raise ValueError(f"{path}: the outputs of task {min(apart)} are others than those of a store before it")
    return table.enter(other.rows(other.done & ~table.done))


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
    """One run of a study or share: tasks that remain, chunks that are being computed, and rows that are done."""

    def __init__(
        self, own: Chunk, table: Table, store: Store | None, workers: Workers, progress: Progress, limit: float | None
    ) -> None:
        self.columns, self.table, self.store, self.workers = own.columns, table, store, workers
        self.places, self.total, self.progress = own.places[~table.done[own.places]], own.places.size, progress
        self.running: dict[Future[list[Rows]], int] = {}  # numbers of tasks
        self.largest, self.seconds_a_task = 0, 0.0
        self.done, self.n_chunks = self.total - self.places.size, 0
        self.begin, self.busy, self.limit = time.monotonic(), workers.clock(), np.inf if limit is None else limit

    def run(self) -> None:
        self.progress(self.done, self.total)
        try:
            while self._fill_queues() or self.running:
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
        seconds = time.monotonic() - self.begin
        share = (self.workers.clock() - self.busy) / max(seconds, _SHORTEST)
        if isinstance(self.progress, Line) and seconds > _WORTH_IT and share > _NEEDLESS:
            self.progress.warn(f"this process spends {share:.0%} of its time on chunks: divide the study by shard=")

    def _fill_queues(self) -> bool:
        """Send chunks out, as many as the workers need; whether any was sent."""
        number, before = self.workers.number(), len(self.running)
        while self.places.size and len(self.running) < 2 * number + 1:
            size = self._size(self.places.size, number)
            ends = time.monotonic() - self.begin + self.seconds_a_task * size * (1 + len(self.running) // number)
            if ends >= self.limit:
                break
            places, self.places = np.split(self.places, [size])
            chunk = Chunk(places, {name: values[places] for name, values in self.columns.items()})
            try:
                future = self.workers.submit(chunk)
            except Exception as error:  # a broken pool raises here or in the future
                future = Future()
                future.set_exception(error)
            self.running[future] = size
        return len(self.running) > before

    def _size(self, remaining: int, number: int) -> int:
        if not self.largest:
            return 1
        own = (self.workers.clock() - self.busy) / self.n_chunks  # seconds that a chunk takes here
        target = min(max(self.workers.chunk, number / _MOST_A_SECOND, number * own / _BUSY), _LONGEST)
        cost = max(self.seconds_a_task, 1e-9)
        share = max(remaining / (2 * number), _SHORTEST / cost)
        return max(1, min(remaining, _MOST_TASKS, int(min(target / cost, share, _GROWTH * self.largest))))

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
            self.n_chunks += len(settled)
            self.done += sum(part.places.size for part in rows)
            self.progress(self.done, self.total)
        if lost is not None:
            error = CancelledError("it was cancelled") if lost.cancelled() else lost.exception()
            reason = f"{type(error).__name__}: {error}. {self.done} of {self.total} tasks are done"
            raise OSError(f"the executor lost a chunk of {self.running[lost]} tasks: {reason}") from error
