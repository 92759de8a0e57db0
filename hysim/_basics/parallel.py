"""Work divided between threads, and work in other processes.

Kernels release the interpreter lock, so that a pool of threads keeps all cores busy. The division of the work does not
change a result: every item is computed by itself. Searches in Python hold the lock; they run in a second process.

An interrupt ends all of it: a kernel is called for a fraction of a second at a time, after which a thread of a stopped
pool ends, and processes are terminated. A process also ends with its parent, in whatever way that ends.
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

from hysim._basics.frozen import check_count
from hysim._basics.progress import Progress, followed, silence

T = TypeVar("T")
Work = Callable[[int, int], None]
"""A function that computes the items from a first one on, up to another one without it."""

_LONGEST = 2_000_000  # samples to begin with, which take some tenths of a second
_PIECE, _GROWTH = 0.2, 16.0  # seconds of a call of a kernel, and largest ratio of a call to the one before
_STRETCH = 100_000  # samples of one path: some hundredths of a second
GLANCE = 0.1  # longest wait without a check for signals [s]
_SIGNAL_OF_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG of Linux
_PATIENCE = 0.3  # seconds to wait for threads that are being stopped

_most: ContextVar[int | None] = ContextVar("most threads", default=None)


def cores() -> int:
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def in_chunks(work: Work, n_items: int, *, workers: int | None = None, minimum: int = 64, n_samples: int = 1) -> None:
    """Call `work(start, stop)` on several threads so that the calls cover `range(n_items)` once.

    A call computes the items from `start` to `stop - 1`. The number of threads is `workers`, by default one for each
    core; each has at least `minimum` items, or fewer if an item has many samples, `n_samples`.
    """
    _check(workers)
    minimum = max(1, min(minimum, _LONGEST // max(1, n_samples)))
    n_chunks = max(1, min(workers or _most.get() or cores(), n_items // minimum))
    own, *others = itertools.pairwise(n_items * k // n_chunks for k in range(n_chunks + 1))
    if not others:
        _piece_by_piece(work, *own, minimum)
        return
    with threads(len(others)) as pool:
        running = [pool.submit(_piece_by_piece, work, *chunk, minimum) for chunk in others]
        _piece_by_piece(work, *own, minimum)
        for chunk in running:
            awaited(chunk)


def in_pieces(work: Callable[[slice], int], n_samples: int) -> int:
    """Call `work` for one short stretch of samples after the other, so that interrupts are handled between them.

    `work` returns -1, or the first sample that failed, counted from the start of its stretch, and keeps its state
    between stretches. The result is -1, or the first sample that failed, counted from the first of all.
    """
    for start in range(0, n_samples, _STRETCH):
        _go_on()
        failed = work(slice(start, min(start + _STRETCH, n_samples)))
        if failed >= 0:
            return start + failed
        followed(min(start + _STRETCH, n_samples), n_samples)
    return -1


def _piece_by_piece(work: Work, start: int, stop: int, size: int) -> None:
    """Call `work` for pieces of `size` items, then of about `_PIECE` seconds, so that interrupts come between them."""
    while start < stop:
        _go_on()
        begin, end = time.perf_counter(), min(start + size, stop)
        work(start, end)
        share = _PIECE / max(time.perf_counter() - begin, 1e-9)
        size = max(1, int(size * min(share, _GROWTH)))
        start = end


def map_on_threads(
    work: Callable[[int], T], n_items: int, *, workers: int | None = None, progress: Progress | None = None
) -> list[T]:
    """Results of `work(k)` for k in `range(n_items)`, in order; `in_chunks` inside `work` uses one thread."""
    _check(workers)
    n_threads = min(workers or _most.get() or cores(), n_items)
    context = copy_context()  # which contains numpy's error state

    def on_one_thread(k: int) -> T:
        with at_most(1 if n_threads > 1 else None):
            return work(k)

    results = []
    with threads(n_threads) as pool:
        for item in [pool.submit(context.copy().run, on_one_thread, k) for k in range(n_items)]:
            results.append(awaited(item))
            if progress is not None:
                progress(len(results), n_items)
    return results


@contextmanager
def at_most(workers: int | None) -> Iterator[None]:
    """Set the default number of threads of `in_chunks` in this thread; None for all cores."""
    _check(workers)
    token = _most.set(workers or _most.get())
    try:
        yield
    finally:
        _most.reset(token)


def _check(workers: int | None) -> None:
    if workers is not None:
        check_count("workers", workers)


def awaited(future: Future[T]) -> T:
    """The result of a future; the wait is cut into pieces of `GLANCE`, since an endless one can miss an interrupt."""
    while not future.done():
        _go_on()
        with contextlib.suppress(TimeoutError):
            future.exception(timeout=GLANCE)
    return future.result()


@contextmanager
def threads(number: int) -> Iterator[Executor]:
    """Threads that end with the block: after their work, or as soon as they can be stopped if the block fails."""
    pool = _Threads(number)
    try:
        yield pool
    except BaseException:
        pool.stop(_PATIENCE)
        raise
    pool.shutdown()


class _Stopped(BaseException):
    """Raised in a thread of a pool that has been stopped."""


class _Served(threading.local):
    pool: "_Threads | None" = None  # of this thread


_served = _Served()


def _go_on() -> None:
    if _served.pool is not None and _served.pool.is_stopped:
        raise _Stopped


class _Threads(Executor):
    """A pool of threads that can be stopped: the interpreter waits at its end for those of `concurrent.futures`."""

    def __init__(self, number: int) -> None:
        self._work: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        self._is_shut = self.is_stopped = False
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
        if cancel_futures:
            self._cancel()
        for _ in self._threads:
            self._work.put(None)
        for thread in self._threads if wait else ():
            while thread.is_alive():
                thread.join(GLANCE)

    def _cancel(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                if (waiting := self._work.get_nowait()) is not None:
                    waiting[0].cancel()

    def stop(self, patience: float) -> None:
        """Cancel work that has not begun, and wait so many seconds until all threads have seen that they shall end."""
        self.is_stopped = True
        self._cancel()
        self.shutdown(wait=False)
        deadline = time.monotonic() + patience
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def _serve(self) -> None:
        _served.pool = self
        while (item := self._work.get()) is not None:
            self._compute(*item)
            del item  # an idle thread would keep the last result

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
def forked(number: int) -> Iterator[Executor]:
    """An executor of so many forked processes, which cannot print; for 0 one that works at once.

    It works at once on one core, without fork, and in a thread or process of others, who may hold locks.
    """
    is_first = multiprocessing.parent_process() is None and threading.current_thread() is threading.main_thread()
    if number < 1 or cores() < 2 or not is_first or not sys.platform.startswith("linux"):
        yield _AtOnce()
        return
    with processes(number, _begin_aside) as pool:
        yield pool


@contextmanager
def processes(number: int, begin: Callable[..., None], *arguments: Any) -> Iterator[Executor]:
    """Processes that end with the block, at once if it fails, and with this process in whatever way it ends.

    Each calls `begin` first. On Linux they are forked: arguments need not be pickled, and BLAS uses one thread in each.
    """
    before = {*multiprocessing.active_children()}
    context = multiprocessing.get_context("fork" if sys.platform.startswith("linux") else None)
    # Windows cannot wait for more than 61 processes.
    most = 61 if sys.platform == "win32" else number
    pool: Any = ProcessPoolExecutor(min(number, most), context, _begin, (begin, arguments))
    try:
        with _one_blas_thread_if_loaded(), _without_signals():
            pool.submit(os.getpid)  # which starts the processes, where they are forked
        yield pool
    except BaseException:
        reader, results = pool._executor_manager_thread, pool._result_queue
        pool.shutdown(wait=False, cancel_futures=True)
        for process in {*multiprocessing.active_children()} - before:
            process.terminate()
        # Wait for the thread that reads, since the interpreter's end would write to a pipe that it is just closing. If
        # half a second is not enough it is within a result, which ends when nobody can write any more.
        if reader is not None:  # where a process could be started
            reader.join(0.5)
            results._writer.close()
            reader.join()
        raise
    pool.shutdown()


@contextmanager
def _one_blas_thread_if_loaded() -> Iterator[None]:
    """Let processes that are forked here have one thread of BLAS for good, if there is a BLAS to limit.

    A forked OpenBLAS would start its threads anew when their number is set, and they wait busily at first: in each
    process this takes as long as a short task. To load a BLAS for this would take longer.
    """
    if "scipy.linalg" not in sys.modules:
        yield
        return
    from hysim._basics.blas import one_blas_thread

    with one_blas_thread():
        yield


@contextmanager
def _without_signals() -> Iterator[None]:
    """Block signals until a process that is started here has set its handlers."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """Ignore interrupts, which the parent handles, end at once on request, and end with the parent."""
    signal.set_wakeup_fd(-1)  # it is the parent's
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    if sys.platform.startswith("linux"):  # a long call that holds the interpreter's lock would keep the thread waiting
        ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence()  # the parent reports
    begin(*arguments)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _begin_aside() -> None:
    """Use one thread, and close the standard output, so that its reader need not wait for this process."""
    _most.set(1)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)


class _AtOnce(Executor):
    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **options))
        except Exception as error:
            future.set_exception(error)
        return future
