"""Work cut into chunks over threads, and work beside one's own in other processes.

Kernels release the interpreter lock, so that a pool of threads keeps all cores busy. How the work is
cut does not change a result: every item is computed by itself. Searches in Python hold the lock; they go
to a second process.

An interrupt ends all of it: a kernel is called for a fraction of a second at a time, an exception is raised in
the threads that are still at work, and processes are terminated. A process also ends with the one that
started it, however that one ends.
"""

import contextlib
import ctypes
import itertools
import multiprocessing
import multiprocessing.connection
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from typing import Any, TypeVar

T = TypeVar("T")

_LONGEST = 2_000_000  # samples to begin with, which take some tenths of a second
_PIECE, _GROWTH = 0.2, 16.0  # seconds of a call of a kernel, and how much longer a call may be than the last
_STRETCH = 100_000  # samples of one path: some hundredths of a second
GLANCE = 0.1  # seconds of a wait after which signals are looked for
_PATIENCE = 0.3  # seconds to wait for threads that have been told to stop

_most: ContextVar[int | None] = ContextVar("most threads", default=None)

Progress = Callable[[int, int], None]
"""Called as ``progress(done, total)``."""


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def in_chunks(
    work: Callable[[int, int], None],
    n_items: int,
    *,
    workers: int | None = None,
    minimum: int = 64,
    n_samples: int = 1,
) -> None:
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
    n_samples : int
        Length of an item: of long ones fewer are worth a thread.
    """
    _check(workers)
    minimum = max(1, min(minimum, _LONGEST // max(1, n_samples)))
    n_chunks = max(1, min(workers or _most.get() or cores(), n_items // minimum))
    edges = [n_items * k // n_chunks for k in range(n_chunks + 1)]
    own, *others = itertools.pairwise(edges)
    if not others:
        _piece_by_piece(work, *own, minimum)
        return
    with threads(len(others)) as pool:
        running = [pool.submit(_piece_by_piece, work, *chunk, minimum) for chunk in others]
        _piece_by_piece(work, *own, minimum)
        for chunk in running:
            awaited(chunk)


def in_pieces(work: Callable[[slice], int], n_samples: int) -> int:
    """Call `work` for one stretch of samples after the other, short enough for an interrupt to come between them.

    It returns -1, or the first sample that failed, counted from the start of its stretch; so does this, counted from
    the first of all. The work carries its state from a stretch to the next.
    """
    for start in range(0, n_samples, _STRETCH):
        failed = work(slice(start, min(start + _STRETCH, n_samples)))
        if failed >= 0:
            return start + failed
    return -1


def _piece_by_piece(work: Callable[[int, int], None], start: int, stop: int, size: int) -> None:
    """Call `work` for pieces that begin with `size` items and take about `_PIECE` seconds: interrupts come between."""
    while start < stop:
        begin, end = time.perf_counter(), min(start + size, stop)
        work(start, end)
        share = _PIECE / max(time.perf_counter() - begin, 1e-9)
        size = max(1, int(size * min(share, _GROWTH)))
        start = end


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
    with threads(n_threads) as pool:
        for item in [pool.submit(here.copy().run, alone, k) for k in range(n_items)]:
            results.append(awaited(item))
            if progress is not None:
                progress(len(results), n_items)
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


def awaited(future: Future[T]) -> T:
    """The result of a future, for which an interrupt is never waited longer than `GLANCE`.

    One that comes between Python's last look for signals and the moment when a thread begins to wait without an end
    is not seen before that wait is over: the more threads ask for the interpreter lock, the more often.
    """
    while not future.done():
        with contextlib.suppress(TimeoutError):
            future.exception(timeout=GLANCE)
    return future.result()


@contextmanager
def threads(number: int) -> Iterator[Executor]:
    """Threads that end with the block: after their work, or if the block fails as soon as they can be stopped."""
    pool = _Threads(number)
    try:
        yield pool
    except BaseException:
        pool.stop(_PATIENCE)
        raise
    pool.shutdown()


class _Stopped(BaseException):
    """Raised in a thread whose work nobody waits for any more."""


class _Threads(Executor):
    """A pool of threads that can be stopped at work, and that does not keep the interpreter from ending.

    The threads of `concurrent.futures` are joined before the interpreter ends, after all of their work.
    """

    def __init__(self, number: int) -> None:
        self._work: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        self._is_shut = False
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(number)]
        for thread in self._threads:
            thread.start()

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        if self._is_shut:
            raise RuntimeError("cannot submit work after shutdown")
        future: Future[Any] = Future()
        self._work.put((future, lambda: function(*args, **options)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._is_shut = True
        while cancel_futures:
            try:
                waiting = self._work.get_nowait()
            except queue.Empty:
                break
            if waiting is not None:
                waiting[0].cancel()
        for _ in self._threads:
            self._work.put(None)
        for thread in self._threads if wait else ():
            while thread.is_alive():
                thread.join(GLANCE)

    def stop(self, patience: float) -> None:
        """Take back what has not begun, raise an exception in every thread, and wait so many seconds for them."""
        for thread in self._threads:
            if thread.ident is not None:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(_Stopped))
        self.shutdown(wait=False, cancel_futures=True)
        deadline = time.monotonic() + patience
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def _serve(self) -> None:
        try:
            while (item := self._work.get()) is not None:
                self._compute(*item)
                del item  # an idle thread would keep the last result
        except _Stopped:
            pass

    @staticmethod
    def _compute(future: Future[Any], work: Callable[[], Any]) -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            result = work()
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(result)


@contextmanager
def second_process() -> Iterator[Executor]:
    """An executor of one further process, forked from this one; where that is no use, one that works at once.

    It is no use on one core, and it is not safe on systems that do not fork. An interrupt is the parent's
    alone. The process cannot print: the standard output is the parent's.
    """
    if not sys.platform.startswith("linux") or cores() < 2:
        yield _AtOnce()
        return
    with processes(1, _print_to_nowhere) as pool:
        yield pool


@contextmanager
def processes(number: int, begin: Callable[..., None], *arguments: Any) -> Iterator[Executor]:
    """Processes that end with the block, at once if it fails, and with this process in whatever way it ends.

    Each calls `begin` first. They are forked where that is usual, so that the arguments need not be pickled.
    """
    before = {*multiprocessing.active_children()}
    context = multiprocessing.get_context("fork" if sys.platform.startswith("linux") else None)
    pool = ProcessPoolExecutor(number, context, _begin, (begin, arguments))
    try:
        with _without_signals():
            pool.submit(_do_nothing)  # which starts the processes, where they are forked
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in {*multiprocessing.active_children()} - before:
            process.terminate()
        raise
    pool.shutdown()


def _do_nothing() -> None:
    pass


@contextmanager
def _without_signals() -> Iterator[None]:
    """Hold back signals until a process that is started here knows what to do with them."""
    if sys.platform == "win32":
        yield
        return
    held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, held)


def _begin(begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """An interrupt is the parent's alone, a request to end is obeyed at once, and no process outlives its parent."""
    signal.set_wakeup_fd(-1)  # which is the parent's
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    threading.Thread(target=_end_with_parent, daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    """Wait for the end of a pipe of which the parent holds the other side."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _print_to_nowhere() -> None:
    """Give up the standard output, so that who reads it need not wait for this process."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


class _AtOnce(Executor):
    """Runs what is submitted before it returns."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **options))
        except Exception as error:
            future.set_exception(error)
        return future
