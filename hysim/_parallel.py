"""Work cut into chunks over threads, and work beside one's own in a second process.

Kernels release the interpreter lock, so that a pool of threads keeps all cores busy. How the work is
cut does not change a result: every item is computed by itself. Searches in Python hold the lock; they go
to a second process.
"""

import itertools
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from typing import Any, TypeVar

T = TypeVar("T")

_most: ContextVar[int | None] = ContextVar("most threads", default=None)

Progress = Callable[[int, int], None]
"""Called as ``progress(done, total)``."""


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_chunks(work: Callable[[int, int], None], n_items: int, *, workers: int | None = None, minimum: int = 64) -> None:
    """Call `work(start, stop)` so that the calls cover `range(n_items)` once.

    Parameters
    ----------
    work : callable
        Computes the items from `start` to `stop - 1`, and writes nothing else.
    n_items : int
        Number of items.
    workers : int, optional
        Number of threads; by default one for each core.
    minimum : int
        Fewest items that are worth a thread.
    """
    _check(workers)
    n_chunks = max(1, min(workers or _most.get() or cores(), n_items // minimum))
    edges = [n_items * k // n_chunks for k in range(n_chunks + 1)]
    own, *others = itertools.pairwise(edges)
    if not others:
        work(*own)
        return
    with ThreadPoolExecutor(len(others)) as pool:
        running = [pool.submit(work, *chunk) for chunk in others]
        work(*own)
        for chunk in running:
            chunk.result()


def map_on_threads(
    work: Callable[[int], T], n_items: int, *, workers: int | None = None, progress: Progress | None = None
) -> list[T]:
    """The results of `work(k)` for k in `range(n_items)`, in order; inside, `in_chunks` has a thread to itself.

    Parameters
    ----------
    work : callable
        Computes the item k, by itself.
    n_items : int
        Number of items. A thread takes the next one when it is done with the last.
    workers : int, optional
        Number of threads; by default one for each core.
    progress : callable, optional
        Called as ``progress(done, total)`` after each item.
    """
    _check(workers)
    n_threads = min(workers or _most.get() or cores(), n_items)

    here = copy_context()  # of which numpy's error state is a part

    def alone(k: int) -> T:
        with at_most(1 if n_threads > 1 else None):
            return work(k)

    results = []
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            for result in pool.map(lambda k: here.copy().run(alone, k), range(n_items)):
                results.append(result)
                if progress is not None:
                    progress(len(results), n_items)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return results


@contextmanager
def at_most(workers: int | None) -> Iterator[None]:
    """Let `in_chunks`, called in this thread without a number of its own, use so many threads; None for all cores."""
    _check(workers)
    token = _most.set(workers or _most.get())
    try:
        yield
    finally:
        _most.reset(token)


def _check(workers: int | None) -> None:
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise ValueError(f"workers must be an integer of at least 1, got {workers}")


@contextmanager
def second_process() -> Iterator[Executor]:
    """An executor of one further process, forked from this one; where that is no use, one that works at once.

    It is no use on one core, and it is not safe on systems that do not fork. An interrupt is the parent's
    alone.
    """
    if not sys.platform.startswith("linux") or cores() < 2:
        yield _AtOnce()
        return
    forked, ignore = multiprocessing.get_context("fork"), (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(1, mp_context=forked, initializer=signal.signal, initargs=ignore)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


class _AtOnce(Executor):
    """Runs what is submitted before it returns."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **options))
        except Exception as error:
            future.set_exception(error)
        return future
