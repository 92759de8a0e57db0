"""Who computes: threads, processes, the user's executor, or a dask cluster.

The only contract is that of `concurrent.futures.Executor`; a dask client gives one by its `get_executor`.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, NamedTuple

from hysim._parallel import cores, processes, threads
from hysim.sweeps._chunks import Chunk, Outcome, Task, computed

_of_process: list[Task] = []  # the task of the study that this process was started for


class Workers(NamedTuple):
    """How a chunk is sent out, and how many are computed at a time."""

    submit: Callable[[Chunk], Future[Outcome]]
    number: Callable[[], int]


@contextmanager
def workers_of(executor: Any, number: int | None, task: Task) -> Iterator[Workers]:
    """The workers that an argument of `sweep` stands for; own threads and processes end with the block.

    Raises
    ------
    TypeError
        If it is no executor.
    ValueError
        If it is an unknown word, or the number of workers is not at least 1.
    """
    if number is not None and (isinstance(number, bool) or not isinstance(number, int) or number < 1):
        raise ValueError(f"workers must be an integer of at least 1, got {number!r}")
    if executor in (None, "threads"):
        with threads(number or cores()) as pool:
            yield Workers(lambda chunk: pool.submit(computed, task, chunk), lambda: number or cores())
    elif executor == "processes":
        with processes(number or cores(), _begin, task) as pool:
            yield Workers(lambda chunk: pool.submit(_computed_here, chunk), lambda: number or cores())
    elif isinstance(executor, str):
        raise ValueError(f'executor must be "threads", "processes", an Executor or a dask client, got {executor!r}')
    elif callable(getattr(executor, "get_executor", None)):
        theirs = executor.get_executor()
        yield Workers(
            lambda chunk: theirs.submit(computed, task, chunk),
            lambda: number or max(1, sum(executor.nthreads().values())),
        )
    elif callable(getattr(executor, "submit", None)):
        known = number or getattr(executor, "_max_workers", None) or cores()
        yield Workers(lambda chunk: executor.submit(computed, task, chunk), lambda: known)
    else:
        raise TypeError(f"executor must have the method submit of concurrent.futures.Executor, got {executor!r}")


def _begin(task: Task) -> None:
    _of_process[:] = [task]


def _computed_here(chunk: Chunk) -> Outcome:
    return computed(_of_process[0], chunk)
