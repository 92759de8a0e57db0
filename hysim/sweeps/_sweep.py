"""The verb `sweep`: one function over many parameters, on whatever computes, and resumable.

A chunk is a number of tasks that travel together. It begins with one task and grows, at most fourfold from one
finished chunk to the next, until a chunk takes `_CHUNK`, so that the way there and back, about a millisecond, costs
little; towards the end chunks shrink so that all workers end together. Finished chunks are written before they are
reported. Nothing that is computed depends on how the tasks were cut.
"""

import inspect
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from hysim._parallel import GLANCE, Progress
from hysim.sweeps._chunks import Chunk, Outcome, part_of
from hysim.sweeps._executors import Workers, workers_of
from hysim.sweeps._identity import identity
from hysim.sweeps._result import Sweep, result_of
from hysim.sweeps._seeds import seeds
from hysim.sweeps._space import Column, Space, space_of
from hysim.sweeps._store import ON_CHANGE, OnChange, Store, opened
from hysim.sweeps._table import Table

_CHUNK, _SHORTEST = 0.075, 0.002  # seconds
_WITH_ARRAYS = 0.5  # seconds; a shard for each
_MOST_A_SECOND = 500  # chunks: a scheduler takes a millisecond for each
_GROWTH = 4
_PATIENCE = 0.6  # seconds, after an interrupt, for what is being computed


def sweep(
    task: Callable[..., Any],
    space: Any,
    *,
    executor: Any = None,
    workers: int | None = None,
    store: str | Path | None = None,
    seed: int = 0,
    on_change: OnChange = "error",
    progress: Progress | None = None,
) -> Sweep:
    """Compute a function for many sets of parameters.

    Parameters
    ----------
    task : callable
        Takes the parameters by name, and an argument ``seed`` if it has one. Returns a number, an array, or a
        mapping of names to these, in every call of the same shapes. Its attribute ``batch``, if there is one,
        takes columns, shape (n,), in place of numbers, also of ``seed``, and returns columns, shape (n, ...).
    space : mapping, list of mappings or Sample
        Names to sequences of values, of which all combinations are computed, the last name changing fastest; or
        one mapping of names to values for each task; or a sample of distributions.
    executor : {"threads", "processes"}, Executor or dask client, optional
        Who computes: threads by default, which suit tasks that spend their time in kernels. Any
        `concurrent.futures.Executor` will do, and a `distributed.Client`.
    workers : int, optional
        Number of threads or processes, by default one for each core; or how many chunks the executor computes at
        a time, if it does not say.
    store : path, optional
        File to keep the rows in as they are finished. A second call with the same study computes what is missing.
    seed : int
        Task k gets a seed of its own, from this one and k alone: an integer for `numpy.random.default_rng`.
    on_change : {"error", "keep", "restart"}
        When the store holds a study with another task, space or seed, or of another version of hysim: refuse it;
        keep the finished rows if tasks and seed are the same; or begin anew.
    progress : callable, optional
        Called as ``progress(done, total)`` when rows are finished and written.

    Returns
    -------
    Sweep
        The same bits, but for the seconds, whatever computes and in whatever order. A task that raises, or returns
        other names or shapes than the first that succeeded, is a row with its error.

    Raises
    ------
    TypeError
        If the task does not take the parameters, or an argument is of the wrong kind.
    ValueError
        If there is no task, a name or a value cannot be used, or the store holds another study.
    OSError
        If the store is locked, read-only or full, or the executor fails. What was reported is kept.

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
    if on_change not in ON_CHANGE:
        raise ValueError(f"on_change must be one of {', '.join(ON_CHANGE)}, got {on_change!r}")
    tasks = space_of(space)
    takes_seed = _takes_seed(task, tasks)
    of_tasks = seeds(seed, np.arange(tasks.n_tasks))
    everything = Chunk(np.arange(tasks.n_tasks), tasks.columns, of_tasks if takes_seed else None)
    table = Table(tasks.n_tasks, tasks.columns)
    with nullcontext() if store is None else opened(store) as kept:
        if kept is not None:
            kept.begin(identity(task, tasks, seed), tasks, on_change)
            if layout := kept.layout():
                table.begin(layout)
            table.enter(kept.finished())
        with workers_of(executor, workers, task) as pool:
            _Study(everything, table, kept, tasks, of_tasks, pool, progress).run()
    return result_of(table, tasks.columns, tasks.axes, of_tasks)


def _takes_seed(task: Callable[..., Any], space: Space) -> bool:
    """Whether the task has an argument for its seed.

    Raises
    ------
    TypeError
        If it does not take the parameters.
    """
    if not callable(task):
        raise TypeError(f"a task must be a function, got {task!r}")
    signature = inspect.signature(task)
    takes_seed = "seed" in signature.parameters
    try:
        signature.bind(**dict.fromkeys([*space.columns, *(["seed"] if takes_seed else [])]))
    except TypeError as error:
        name = getattr(task, "__name__", repr(task))
        raise TypeError(f"{name}{signature} does not take the parameters {', '.join(space.columns)}: {error}") from None
    return takes_seed


class _Study:
    """One run: what is to be done, what is on its way, and what is done."""

    def __init__(
        self,
        everything: Chunk,
        table: Table,
        store: Store | None,
        space: Space,
        of_tasks: Column,
        workers: Workers,
        progress: Progress | None,
    ) -> None:
        self.remaining = part_of(everything, np.flatnonzero(~table.done))
        self.table, self.store, self.space, self.seeds = table, store, space, of_tasks
        self.workers, self.progress = workers, progress
        self.running: dict[Future[Outcome], int] = {}
        self.sent, self.largest, self.seconds_a_task = 0, 0, 0.0

    def run(self) -> None:
        """Send out everything that remains, a bounded number of chunks at a time, and settle what comes back."""
        self._report()
        try:
            while self._send() or self.running:
                self._wait()
                self._settle()
        except KeyboardInterrupt:
            self._end(_PATIENCE)
            self._settle()
            raise
        except BaseException:
            self._end(0.0)
            raise

    def _send(self) -> bool:
        """Fill the workers' queues; whether anything was left to send."""
        total, number = self.remaining.places.size, self.workers.number()
        anything = self.sent < total
        while self.sent < total and len(self.running) < 2 * number + 1:
            stop = self.sent + self._size(total - self.sent, number)
            self.running[self._future(part_of(self.remaining, slice(self.sent, stop)))] = stop - self.sent
            self.sent = stop
        return anything

    def _future(self, chunk: Chunk) -> Future[Outcome]:
        try:
            return self.workers.submit(chunk)
        except Exception as error:  # a pool that is broken says so here or by a future
            lost: Future[Outcome] = Future()
            lost.set_exception(error)
            return lost

    def _size(self, remaining: int, number: int) -> int:
        """Number of tasks in the next chunk."""
        if not self.largest:
            return 1
        has_arrays = any(shape for _, shape in self.table.layout or ())
        target = max(_WITH_ARRAYS if has_arrays and self.store else _CHUNK, number / _MOST_A_SECOND)
        cost = max(self.seconds_a_task, 1e-9)
        share = max(remaining / (2 * number), _SHORTEST / cost)
        return max(1, min(remaining, int(min(target / cost, share, _GROWTH * self.largest))))

    def _wait(self) -> None:
        """Until a chunk can be settled; before the layout is known, that is the first one."""
        futures = [next(iter(self.running))] if self.table.layout is None else [*self.running]
        while not any(future.done() for future in futures):
            wait(futures, timeout=GLANCE, return_when=FIRST_COMPLETED)  # and look for an interrupt

    def _settle(self) -> None:
        """Judge, write, enter and report what is finished, in the order of the tasks until the layout is known."""
        outcomes, lost = {}, None
        for future in list(self.running):
            if future.done() and not future.cancelled() and future.exception() is None:
                outcomes[future] = self.table.judged(future.result())
                continue
            if future.done():
                lost = future
            if self.table.layout is None:
                break
        if outcomes and self.store is not None:
            self.store.commit(list(outcomes.values()), self.table.layout, self.space, self.seeds)
        for future, outcome in outcomes.items():
            self.table.enter(outcome)
            self._learn(outcome)
            del self.running[future]
        if outcomes:
            self._report()
        if lost is not None:
            self._raise(lost)

    def _learn(self, outcome: Outcome) -> None:
        n = outcome.places.size
        cost = float(outcome.seconds.sum()) / n
        self.seconds_a_task = 0.5 * (self.seconds_a_task + cost) if self.largest else cost
        self.largest = max(self.largest, n)

    def _report(self) -> None:
        if self.progress is not None:
            self.progress(int(self.table.done.sum()), self.table.done.size)

    def _raise(self, lost: Future[Outcome]) -> None:
        error = CancelledError("it was cancelled") if lost.cancelled() else lost.exception()
        raise OSError(
            f"the executor lost a chunk of {self.running[lost]} tasks: {type(error).__name__}: {error}. "
            f"{int(self.table.done.sum())} of {self.table.done.size} tasks are done"
        ) from error

    def _end(self, patience: float) -> None:
        """Take back what has not begun, and wait for the rest so long."""
        for future in list(self.running):
            if future.cancel():
                del self.running[future]
        wait(self.running, timeout=patience)
